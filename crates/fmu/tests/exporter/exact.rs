//! A continuous-time model with a closed-form solution, and states whose start values follow from parameters.

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::Mode;

use crate::models::{Fmu, error_of};

#[derive(Parameters)]
struct Lag {
    /// Time constant
    #[var("lag.time_constant", unit = "s", start = 0.5, positive, tunable)]
    tau: f64,
    /// Initial delayed input
    #[var("lag.initial", unit = "m", start = 2.0)]
    start: f64,
}

#[derive(State)]
struct X<T> {
    /// Delayed input
    #[var("lag_state", unit = "m", local, calculated)]
    y: T,
    /// Integral of the input
    #[var("integral", unit = "m", local)]
    i: T,
}

#[derive(Inputs)]
struct U<T> {
    /// What is delayed
    #[var("lag_input", unit = "m")]
    u: T,
}

#[derive(Outputs)]
struct Y<T> {
    /// Difference of input and state
    #[var("lag_error", unit = "m")]
    e: T,
}

/// tau y' = u - y
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Lag {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn initialize(&self, (): &(), state: &mut X<f64>) {
        state.y = self.start;
        state.i = f64::NAN; // not marked as calculated, so it keeps its start value
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let u = at.inputs.u;
        X { y: (u - at.state.y) / self.tau, i: u }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { e: at.inputs.u - at.state.y }
    }
    fn advance(&self, at: At<f64, Self>, step: f64) -> X<f64> {
        let (x, u) = (at.state, at.inputs.u);
        X { y: u + (x.y - u) * (-step / self.tau).exp(), i: x.i + step * u }
    }
}

#[test]
fn a_step_of_any_length_is_exact() {
    // The expected values follow from the closed form. Dividing the step changes only a few rounding errors of numbers
    // near 1.
    for parts in [1, 3, 1000] {
        let mut fmu = Fmu::<Lag>::ready();
        fmu.set("lag_input", -1.0).unwrap();
        for _ in 0..parts {
            fmu.step(1.5 / f64::from(parts)).unwrap();
        }
        let expected = -1.0 + 3.0 * (-3.0_f64).exp();
        assert!((fmu.get("lag_state") - expected).abs() < 1e-13, "{parts}");
        assert!((fmu.get("integral") + 1.5).abs() < 1e-13, "{parts}");
    }
    // This step is longer than the maximum number of integration steps would allow with another solver.
    let mut fmu = Fmu::<Lag>::ready();
    fmu.step(1e12).unwrap();
    assert_eq!(fmu.get("lag_state"), 0.0);
}

#[test]
fn outputs_and_derivatives_follow_state_and_inputs_at_once() {
    let mut fmu = Fmu::<Lag>::ready();
    fmu.set("lag_input", 5.0).unwrap();
    assert_eq!((fmu.get("lag_error"), fmu.get("der(lag_state)")), (3.0, 6.0));
    fmu.set("lag.time_constant", 1.0).unwrap();
    assert_eq!(fmu.get("der(lag_state)"), 3.0);
    let (error, state) = (crate::models::reference::<Lag>("lag_error"), crate::models::reference::<Lag>("lag_state"));
    let mut slope = [0.0];
    fmu.0.directional_derivative(&[error], &[state], &[1.0], &mut slope).unwrap();
    assert_eq!(slope, [-1.0]);
}

#[test]
fn rejected_and_failed_steps_are_those_of_every_continuous_model() {
    let mut fmu = Fmu::<Lag>::ready();
    assert!(error_of(fmu.step(0.0)).contains("must be finite and above 0"));
    assert!(error_of(fmu.0.do_step(1.0, 0.1)).contains("the instance is at 0 s"));
    fmu.set("lag_input", 1e300).unwrap();
    let message = error_of(fmu.step(1e300));
    assert!(message.contains("'integral' became inf"), "{message}");
    assert_eq!((fmu.0.mode(), fmu.get("lag_state"), fmu.get("integral")), (Mode::StepFailed, 2.0, 0.0));
}

#[test]
fn a_start_value_can_follow_from_a_parameter() {
    let mut fmu = Fmu::<Lag>::new();
    fmu.set("lag.initial", 3.0).unwrap();
    fmu.0.enter_initialization().unwrap();
    assert_eq!(fmu.get("lag_state"), 3.0);
    fmu.set("lag.initial", 4.0).unwrap();
    fmu.set("integral", 7.0).unwrap(); // this state is not calculated
    assert_eq!((fmu.get("lag_error"), fmu.get("integral")), (-4.0, 7.0));
    assert_eq!(
        error_of(fmu.set("lag_state", 1.0)),
        "fmi2SetReal: 'lag_state' is a state whose start value follows from the parameters, never settable; the instance is in \
         Initialization Mode"
    );
    fmu.0.exit_initialization().unwrap();
    assert_eq!((fmu.get("lag_state"), fmu.get("integral")), (4.0, 7.0));
    // A saved state continues from its values, not from the start values.
    fmu.step(0.5).unwrap();
    let (bytes, state) = (fmu.bytes(), fmu.get("lag_state"));
    let mut copy = Fmu::<Lag>::new();
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
    // The solution applies to inputs that are held.
    assert!(!xml.contains("canInterpolateInputs"));
    let variable = |name: &str| {
        let from = xml.find(&format!("name=\"{name}\"")).unwrap();
        &xml[from..from + xml[from..].find("</ScalarVariable>").unwrap()]
    };
    assert!(variable("lag_state").contains("initial=\"calculated\"") && !variable("lag_state").contains("start="));
    assert!(variable("integral").contains("initial=\"exact\"") && variable("integral").contains("start=\"0.0\""));
    // Variables: 1 time constant, 2 initial, 3 input, 4 error, 5 state, 6 integral, 7 and 8 their derivatives. At the
    // start, the state depends on the fixed parameter, and unknowns that depend on the state therefore on the
    // parameters.
    let initial = &xml[xml.find("<InitialUnknowns>").unwrap()..];
    for line in [
        "<Unknown index=\"4\" dependencies=\"1 2 3\"/>",
        "<Unknown index=\"5\" dependencies=\"1 2\"/>",
        "<Unknown index=\"7\" dependencies=\"1 2 3\"/>",
    ] {
        assert!(initial.contains(line), "{line} is missing in {initial}");
    }
    assert!(!initial.contains("index=\"6\""));
}
