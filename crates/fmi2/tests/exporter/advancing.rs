//! A plant with an exact step, and states that start by the parameters.

use fmi2::abi::{Export, Library};
use fmi2::calls::Mode;
use fmi2::model::{Exact, PlantModel};
use fmi2::prelude::*;

use crate::models::{Unit, refused};

#[derive(Parameters, Clone)]
struct P {
    /// Time constant
    #[par("lag.time_constant", unit = S, start = 0.5, positive, tunable)]
    tau: f64,
    /// Where the lag starts
    #[par("lag.initial", unit = M, start = 2.0)]
    start: f64,
}

#[derive(State, Clone)]
struct X<T> {
    /// Delayed input
    #[var("lag_state", unit = M, local)]
    y: T,
    /// Integral of the input
    #[var("integral", unit = M, local)]
    i: T,
}

#[derive(Inputs, Clone)]
struct U<T> {
    /// What is delayed
    #[var("lag_input", unit = M)]
    u: T,
}

#[derive(Outputs, Clone)]
struct Y<T> {
    /// Difference of input and state
    #[var("lag_error", unit = M)]
    e: T,
}

/// tau y' = u - y.
struct Lag;

impl Plant for Lag {
    const INFO: Info = Info { name: "Lag", description: "A lag", version: "1.0.0", stop_time: 1.0, step_size: 0.1 };
    type Parameters = P;
    type Design = ();
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn design(_: &P) -> Result<(), String> {
        Ok(())
    }
    fn begin(p: &P, x: &mut X<f64>) {
        x.y = p.start;
    }
    fn derivatives<T: Scalar>(p: &P, (): &(), x: &X<T>, u: &U<T>) -> X<T> {
        X { y: (u.u - x.y) / p.tau, i: u.u * 1.0 }
    }
    fn outputs<T: Scalar>(_: &P, (): &(), x: &X<T>, u: &U<T>) -> Y<T> {
        Y { e: u.u - x.y }
    }
}

impl Advancing for Lag {
    fn advance(p: &P, (): &(), x: &X<f64>, u: &U<f64>, h: f64) -> X<f64> {
        X { y: u.u + (x.y - u.u) * (-h / p.tau).exp(), i: x.i + h * u.u }
    }
}

impl Export for Lag {
    type Model = PlantModel<Self, Exact>;
    fn library() -> &'static Library {
        static LIBRARY: Library = Library::new();
        &LIBRARY
    }
}

#[test]
fn a_step_of_any_length_is_exact() {
    // Closed form; the same step in parts differs by a few roundings of numbers of order 1.
    for parts in [1, 3, 1000] {
        let mut unit = Unit::<Lag>::ready();
        unit.set("lag_input", -1.0).unwrap();
        for _ in 0..parts {
            unit.step(1.5 / f64::from(parts)).unwrap();
        }
        let expected = -1.0 + 3.0 * (-3.0_f64).exp();
        assert!((unit.get("lag_state") - expected).abs() < 1e-13, "{parts}");
        assert!((unit.get("integral") + 1.5).abs() < 1e-13, "{parts}");
    }
    // Longer than any number of parts of an integrator allows.
    let mut unit = Unit::<Lag>::ready();
    unit.step(1e12).unwrap();
    assert_eq!(unit.get("lag_state"), 0.0);
}

#[test]
fn outputs_and_derivatives_follow_state_and_inputs_at_once() {
    let mut unit = Unit::<Lag>::ready();
    unit.set("lag_input", 5.0).unwrap();
    assert_eq!((unit.get("lag_error"), unit.get("der(lag_state)")), (3.0, 6.0));
    unit.set("lag.time_constant", 1.0).unwrap();
    assert_eq!(unit.get("der(lag_state)"), 3.0);
    let (error, state) = (crate::models::reference::<Lag>("lag_error"), crate::models::reference::<Lag>("lag_state"));
    let mut slope = [0.0];
    unit.0.directional_derivative(&[error], &[state], &[1.0], &mut slope).unwrap();
    assert_eq!(slope, [-1.0]);
}

#[test]
fn refused_and_failed_steps_are_those_of_a_plant() {
    let mut unit = Unit::<Lag>::ready();
    assert!(refused(unit.step(0.0)).contains("a finite number above 0 was expected"));
    assert!(refused(unit.0.do_step(1.0, 0.1)).contains("the instance is at 0 s"));
    unit.set("lag_input", 1e300).unwrap();
    let message = refused(unit.step(1e300));
    assert!(message.contains("'integral' became inf"), "{message}");
    assert_eq!((unit.0.mode(), unit.get("lag_state"), unit.get("integral")), (Mode::StepFailed, 2.0, 0.0));
}

#[test]
fn a_state_can_start_by_a_parameter() {
    let mut unit = Unit::<Lag>::new();
    unit.set("lag.initial", 3.0).unwrap();
    unit.0.enter_initialization().unwrap();
    assert_eq!(unit.get("lag_state"), 3.0);
    unit.set("lag.initial", 4.0).unwrap();
    unit.set("integral", 7.0).unwrap(); // this state is not calculated
    assert_eq!((unit.get("lag_error"), unit.get("integral")), (-4.0, 7.0));
    assert_eq!(
        refused(unit.set("lag_state", 1.0)),
        "fmi2SetReal: 'lag_state' is a state that starts by the parameters, never settable; the instance is in \
         Initialization Mode"
    );
    unit.0.exit_initialization().unwrap();
    assert_eq!((unit.get("lag_state"), unit.get("integral")), (4.0, 7.0));
    // A saved state goes on where it was, not at its start.
    unit.step(0.5).unwrap();
    let (bytes, state) = (unit.bytes(), unit.get("lag_state"));
    let mut copy = Unit::<Lag>::new();
    let snapshot = copy.0.deserialize(&bytes).unwrap();
    copy.0.restore(&snapshot).unwrap();
    assert_eq!(copy.get("lag_state"), state);
    copy.0.reset().unwrap();
    copy.0.enter_initialization().unwrap();
    assert_eq!(copy.get("lag_state"), 2.0);
}

#[test]
fn the_description_tells_which_states_are_calculated() {
    let xml = &Lag::description().xml;
    let variable = |name: &str| {
        let from = xml.find(&format!("name=\"{name}\"")).unwrap();
        &xml[from..from + xml[from..].find("</ScalarVariable>").unwrap()]
    };
    assert!(variable("lag_state").contains("initial=\"calculated\"") && !variable("lag_state").contains("start="));
    assert!(variable("integral").contains("initial=\"exact\"") && variable("integral").contains("start=\"0.0\""));
    // Variables: 1 time constant, 2 initial, 3 input, 4 error, 5 state, 6 integral, 7 and 8 their derivatives. At the
    // start the state follows from the fixed parameter, and what depends on the state from the parameters.
    let initial = &xml[xml.find("<InitialUnknowns>").unwrap()..];
    for line in [
        "<Unknown index=\"4\" dependencies=\"1 2 3\"/>",
        "<Unknown index=\"5\" dependencies=\"2\"/>",
        "<Unknown index=\"7\" dependencies=\"1 2 3\"/>",
    ] {
        assert!(initial.contains(line), "{line} is missing in {initial}");
    }
    assert!(!initial.contains("index=\"6\""));
}
