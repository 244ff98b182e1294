//! Inputs that are linear in time (fmi2SetRealInputDerivatives). References: the closed form of x' = -3 x + u for a linear
//! input; FMI 2.0.4, section 4.2.1 (derivatives apply at the start of a step), section 4.3.1 (`canInterpolateInputs`).

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::instance::CallError;

use crate::allocations::allocations;
use crate::models::{CartPair, Fmu, Sampler, error_of, exported, reference};

#[derive(State)]
struct X<T> {
    /// Delayed input (1)
    x: T,
    /// Integral of the input (s)
    i: T,
}

#[derive(Inputs)]
struct U<T> {
    /// Input (1)
    u: T,
    /// Input that is never set (1)
    rest: T,
    /// Discrete input (1)
    single: f32,
}

#[derive(Outputs)]
struct Y<T> {
    /// Derivative of the delayed input (1/s)
    y: T,
    /// Time of the last event (s)
    event: T,
    /// The input at the last event (1)
    at_event: T,
}

#[derive(DiscreteState, Clone, Default)]
struct Last {
    event: f64,
    at_event: f64,
}

macro_rules! lags {
    ($($name:ident $solver:expr, { $($items:tt)* };)*) => {$(
        #[derive(Parameters)]
        struct $name {
            /// Value of the input at which there is an event (1)
            #[var(start = 1e9)]
            level: f64,
        }

        /// Delay
        #[fmu::model(stop_time = 1.0, step_size = 0.1, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = X<T>;
            type Inputs<T: Scalar> = U<T>;
            type Outputs<T: Scalar> = Y<T>;
            type DiscreteState = Last;
            $($items)*

            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
                X { x: at.state.x * -3.0 + at.inputs.u + at.inputs.rest, i: at.inputs.u }
            }
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
                let Last { event, at_event } = *at.discrete;
                Y { y: at.state.x * -3.0 + at.inputs.u, event: event.into(), at_event: at_event.into() }
            }
        }
    )*};
}

macro_rules! watches {
    ($($name:ident $solver:expr;)*) => {
        lags! {$($name $solver, {
            type Crossings = [f64; 1];
            fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
                [at.inputs.u - self.level]
            }
            fn on_event(&self, event: Event<Self>) {
                *event.discrete = Last { event: event.time, at_event: event.inputs.u };
            }
        };)*}
    };
}

lags! {
    Fixed RungeKutta, {};
    Controlled DormandPrince { tolerance: 1e-12 }, {};
    Implicit Rosenbrock { tolerance: 1e-11 }, {};
    Timed DormandPrince { tolerance: 1e-12 }, {
        fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
            (at.discrete.event < 0.15).then_some(0.15)
        }
        fn on_event(&self, event: Event<Self>) {
            *event.discrete = Last { event: event.time, at_event: event.inputs.u };
        }
    };
    Clocked RungeKutta, {
        /// Samples the input
        #[clock(interval = 15 / 100)]
        fn sample(&self, tick: Tick<Self>) {
            *tick.state = Last { event: tick.time, at_event: tick.inputs.u };
        }
    };
}
watches! {
    FixedEvents RungeKutta;
    ControlledEvents DormandPrince { tolerance: 1e-12 };
    ImplicitEvents Rosenbrock { tolerance: 1e-11 };
}

#[derive(State)]
struct Many<T> {
    /// Delayed inputs (1)
    x: [T; 40],
}

#[derive(Parameters)]
struct Sparse;

/// Delays with a sparse Jacobian
#[fmu::model(stop_time = 1.0, step_size = 0.1, solver = Rosenbrock { tolerance: 1e-6 })]
impl Continuous for Sparse {
    type State<T: Scalar> = Many<T>;
    type Inputs<T: Scalar> = U<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Many<T> {
        Many { x: at.state.x.map(|x| x * -3.0 + at.inputs.u) }
    }
}

exported! { Lag3: Fixed, fmu::testing::description::Format::FMI3; }

impl<E: Export> Fmu<E> {
    fn set_slope(&mut self, name: &str, slope: f64) -> Result<(), CallError> {
        self.0.set_real_input_derivatives(&[reference::<E>(name)], &[1], &[slope])
    }

    fn ramp(&mut self, value: f64, slope: f64) {
        self.set("u", value).unwrap();
        self.set_slope("u", slope).unwrap();
    }
}

/// The solution of x' = -3 x + u + slope t after `t`.
fn lag(x: f64, u: f64, slope: f64, t: f64) -> f64 {
    let offset = (u - slope / 3.0) / 3.0;
    (x - offset) * (-3.0 * t).exp() + offset + slope / 3.0 * t
}

fn each(check: impl Fn(&mut dyn FnMut(f64, f64, f64) -> [f64; 5], &str)) {
    macro_rules! all {
        ($($model:ident),*) => {$({
            let mut fmu = Fmu::<$model>::ready();
            let mut step = |u: f64, slope: f64, h: f64| {
                fmu.ramp(u, slope);
                // Equal steps have an error of about (3 h)^5/120 each.
                for _ in 0..100 {
                    fmu.step(h / 100.0).unwrap();
                }
                ["x", "i", "u", "y", "rest"].map(|name| fmu.get(name))
            };
            check(&mut step, stringify!($model));
        })*};
    }
    all!(Fixed, Controlled, Implicit, FixedEvents, ControlledEvents, ImplicitEvents, Timed, Clocked);
}

#[test]
fn a_linear_input_has_the_solution_in_closed_form() {
    each(|step, name| {
        let (mut x, mut i) = (0.0, 0.0);
        for (u, slope, h) in [(1.0, 2.0, 0.1), (-1.0, 0.0, 0.1), (0.5, -30.0, 0.3)] {
            let end = u + slope * h;
            (x, i) = (lag(x, u, slope, h), i + (u + end) / 2.0 * h);
            let found = step(u, slope, h);
            // The value that was not set again goes on along its slope; outputs are those of the input at the end.
            for (found, expected) in found.into_iter().zip([x, i, end, -3.0 * x + end, 0.0]) {
                assert!((found - expected).abs() < 1e-9, "{name}: {found} instead of {expected} after {h} s");
            }
        }
    });
}

/// Largest error of x for u = sin 2t with steps of `h`, for inputs that are linear to the next value.
fn error_of_sine<E: Export>(h: f64) -> f64 {
    let mut fmu = Fmu::<E>::starting(0.0, &[]);
    let value = |k: u32| (2.0 * (f64::from(k) * h)).sin();
    for k in 0..(1.0 / h).round() as u32 {
        fmu.ramp(value(k), (value(k + 1) - value(k)) / h);
        fmu.0.do_step(f64::from(k) * h, h).unwrap();
    }
    // cosimulation.md, section 8: exact, and the result of linear inputs at 10 ms.
    if h == 0.01 {
        assert!((fmu.get("x") - 0.281_510_623_067_834).abs() < 1e-9, "{}", fmu.get("x"));
    }
    (fmu.get("x") - 0.281_520_006_946_697).abs()
}

#[test]
fn linear_inputs_converge_with_order_two() {
    for error_of_sine in [error_of_sine::<Fixed>, error_of_sine::<Controlled>, error_of_sine::<Implicit>] {
        let errors = [0.04, 0.02, 0.01].map(error_of_sine);
        for pair in errors.windows(2) {
            assert!((pair[0] / pair[1] - 4.0).abs() < 0.05, "{errors:?}");
        }
    }
}

/// Without the derivative of the input in the derivative with respect to time, the order of RODAS would be 2.
#[test]
fn the_order_of_implicit_steps_is_kept() {
    fn check<E: Export>(x: &str) {
        let errors = [0.05, 0.025].map(|step| {
            let mut fmu = Fmu::<E>::starting(0.0, &[("tolerance", 1e6)]);
            // The first solver step is short, because no step was proposed yet.
            fmu.step(1e-3).unwrap();
            fmu.ramp(1.0, 20.0);
            for _ in 0..(1.0_f64 / step).round() as u32 {
                fmu.step(step).unwrap();
            }
            let error = (fmu.get(x) - lag(0.0, 1.0, 20.0, 1.0)).abs();
            // Nothing of the slope is left in the memory of the solver.
            fmu.set("u", 0.0).unwrap();
            let bytes = fmu.bytes();
            let mut fresh = Fmu::<E>::new();
            let state = fresh.0.deserialize(&bytes).unwrap();
            fresh.0.restore(&state).unwrap();
            fmu.step(0.1).unwrap();
            fresh.step(0.1).unwrap();
            assert_eq!(fmu.bits(), fresh.bits());
            error
        });
        assert!((errors[0] / errors[1] / 16.0 - 1.0).abs() < 0.3, "{errors:?}");
    }
    check::<Implicit>("x");
    check::<Sparse>("x[1]");
}

#[test]
fn events_ticks_and_crossings_see_the_input_at_their_time() {
    fn check<E: Export>(level: Option<f64>) {
        let values: Vec<_> = level.map(|level| ("level", level)).into_iter().collect();
        let mut fmu = Fmu::<E>::starting(0.0, &values);
        fmu.ramp(0.2, 4.0);
        fmu.step(0.25).unwrap();
        // u = 0.8 at 0.15 s.
        assert!((fmu.get("event") - 0.15).abs() < 1e-15 * 4.0, "{}", fmu.get("event"));
        assert!((fmu.get("at_event") - 0.8).abs() < 1e-14, "{}", fmu.get("at_event"));
        assert!((fmu.get("i") - (0.2 * 0.25 + 2.0 * 0.25 * 0.25)).abs() < 1e-12);
        assert!((fmu.get("u") - 1.2).abs() < 1e-14);
    }
    check::<FixedEvents>(Some(0.8));
    check::<ControlledEvents>(Some(0.8));
    check::<ImplicitEvents>(Some(0.8));
    check::<Timed>(None);
    check::<Clocked>(None);
}

#[test]
fn a_value_that_is_set_is_held_and_states_contain_slopes() {
    let mut fmu = Fmu::<Fixed>::ready();
    fmu.ramp(1.0, 2.0);
    let (saved, bytes) = (fmu.0.snapshot().unwrap(), fmu.bytes());
    fmu.step(0.1).unwrap();
    let linear = fmu.bits();
    assert!((fmu.get("u") - 1.2).abs() < 1e-15);
    fmu.set("u", 0.5).unwrap();
    fmu.step(0.1).unwrap();
    assert_eq!(fmu.get("u"), 0.5);
    for _ in 0..2 {
        fmu.0.restore(&saved).unwrap();
        fmu.step(0.1).unwrap();
        assert_eq!(fmu.bits(), linear);
    }
    let mut other = Fmu::<Fixed>::new();
    let snapshot = other.0.deserialize(&bytes).unwrap();
    other.0.restore(&snapshot).unwrap();
    other.step(0.1).unwrap();
    assert_eq!(other.bits(), linear);
    // Without a new value, the input goes on.
    other.step(0.1).unwrap();
    assert!((other.get("u") - 1.4).abs() < 1e-15);

    fmu.set_slope("u", 7.0).unwrap();
    fmu.0.reset().unwrap();
    let start = |mut fmu: Fmu<Fixed>| {
        fmu.0.setup_experiment(0.0, None).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu.set("u", 1.0).unwrap();
        fmu.0.exit_initialization().unwrap();
        fmu.step(0.1).unwrap();
        fmu.bits()
    };
    assert_eq!(start(fmu), start(Fmu::new()));
    // Derivatives may also be set before the start.
    let mut early = Fmu::<Fixed>::initializing(0.0);
    early.ramp(1.0, 2.0);
    early.0.exit_initialization().unwrap();
    early.step(0.1).unwrap();
    assert_eq!(early.bits(), linear);
}

#[test]
fn slopes_of_zero_give_the_bits_of_held_inputs() {
    fn check<E: Export>() {
        let [mut held, mut linear] = [Fmu::<E>::ready(), Fmu::<E>::ready()];
        for k in 0..20 {
            held.set("u", f64::from(k)).unwrap();
            linear.ramp(f64::from(k), 0.0);
            held.step(0.1).unwrap();
            linear.step(0.1).unwrap();
            assert_eq!(held.bits(), linear.bits());
        }
        assert_eq!(held.bytes(), linear.bytes());
    }
    check::<Fixed>();
    check::<Controlled>();
    check::<Implicit>();
    check::<FixedEvents>();
    check::<Clocked>();
}

#[test]
fn a_failed_step_restores_the_inputs() {
    fn check<E: Export>() {
        let mut fmu = Fmu::<E>::ready();
        fmu.ramp(1.0, 1e308);
        let before = fmu.bits();
        let error = error_of(fmu.step(20.0));
        assert!(error.contains("the state at 0 s was restored"), "{error}");
        assert_eq!(fmu.bits(), before);
    }
    check::<Fixed>();
    check::<FixedEvents>();
    check::<Clocked>();
}

#[test]
fn steps_with_slopes_do_not_allocate() {
    fn check<E: Export>() {
        let mut fmu = Fmu::<E>::ready();
        let u = [reference::<E>("u")];
        let mut go = |count: u32| {
            for k in 0..count {
                fmu.0.set_real(&u, &[f64::from(k)]).unwrap();
                fmu.0.set_real_input_derivatives(&u, &[1], &[1.0]).unwrap();
                fmu.step(0.01).unwrap();
            }
        };
        go(2);
        assert_eq!(allocations(|| go(20)), 0);
    }
    check::<Fixed>();
    check::<Controlled>();
    check::<Implicit>();
}

#[test]
fn rejected_derivatives_change_nothing() {
    let mut fmu = Fmu::<Fixed>::ready();
    let u = reference::<Fixed>("u");
    let mut set = |name: &str, order, value| {
        let references = [u, reference::<Fixed>(name)];
        error_of(fmu.0.set_real_input_derivatives(&references, &[1, order], &[5.0, value]))
    };
    let name = "fmi2SetRealInputDerivatives";
    assert_eq!(set("u", 0, 1.0), format!("{name}: the order of the derivative of 'u' must be 1, got 0"));
    assert_eq!(set("u", 2, 1.0), format!("{name}: the order of the derivative of 'u' must be 1, got 2"));
    assert_eq!(set("u", 1, f64::NAN), format!("{name}: the derivative of 'u' must be finite, got NaN"));
    for other in ["x", "y", "level", "single"] {
        assert_eq!(set(other, 1, 1.0), format!("{name}: '{other}' must be a continuous input of type Real"));
    }
    let unknown = error_of(fmu.0.set_real_input_derivatives(&[9999], &[1], &[1.0]));
    assert!(unknown.starts_with(&format!("{name}: value reference 9999 must be")), "{unknown}");
    fmu.step(0.1).unwrap();
    assert_eq!(fmu.get("u"), 0.0);
}

#[test]
fn the_description_declares_interpolation_for_continuous_inputs() {
    fn interpolates<E: Export>() -> bool {
        let xml = &E::description().xml;
        assert!(!xml.split("<CoSimulation").next().unwrap().contains("canInterpolateInputs"));
        xml.contains("canInterpolateInputs=\"true\"")
    }
    assert!(interpolates::<Fixed>() && interpolates::<Clocked>() && interpolates::<CartPair>());
    // Discrete-time models, models without inputs, FMI 3.0; solutions in closed form are tested in `exact`.
    assert!(!interpolates::<Sampler>() && !interpolates::<crate::events::EqualSteps>() && !interpolates::<Lag3>());
}
