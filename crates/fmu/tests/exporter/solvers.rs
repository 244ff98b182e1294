//! Solvers: order, error control, stiff problems. References: closed forms; for Robertson's problem, Hairer and Wanner,
//! "Solving Ordinary Differential Equations II", section IV.10 (the values are also in the SUNDIALS documentation).

use std::cell::Cell;

use fmu::prelude::*;
use fmu::testing::abi::Export;

use crate::models::{Fmu, error_of};

#[derive(State)]
struct One<T> {
    /// State (1)
    #[var(start = 1.0)]
    x: T,
}

thread_local! {
    /// Number of evaluations of the derivatives in this thread.
    static EVALUATIONS: Cell<u64> = const { Cell::new(0) };
}

macro_rules! models {
    ($(#[doc = $doc:literal] $name:ident, $solver:expr, $state:ident, |$at:ident| $derivatives:expr;)*) => {$(
        #[derive(Parameters)]
        struct $name;

        #[doc = $doc]
        #[fmu::model(stop_time = 1.0, step_size = 0.1, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = $state<T>;
            fn derivatives<T: Scalar>(&self, $at: At<T, Self>) -> $state<T> {
                EVALUATIONS.set(EVALUATIONS.get() + 1);
                $derivatives
            }
        }
    )*};
}

models! {
    /// x' = x cos t, so x = exp(sin t)
    ClassicalGrowth, RungeKutta, One, |at| One { x: at.state.x * at.time.cos() };
    /// x' = x cos t
    ControlledGrowth, DormandPrince { tolerance: 1e-6 }, One, |at| One { x: at.state.x * at.time.cos() };
    /// x' = x cos t
    ImplicitGrowth, Rosenbrock { tolerance: 1e-6 }, One, |at| One { x: at.state.x * at.time.cos() };
    /// x' = x^2, so x = 1 / (1 - t)
    ControlledPole, DormandPrince { tolerance: 1e-6 }, One, |at| One { x: at.state.x.squared() };
    /// x' = x^2
    ImplicitPole, Rosenbrock { tolerance: 1e-6 }, One, |at| One { x: at.state.x.squared() };
    /// x' = -1000 (x - cos t) - sin t, so x = cos t (Prothero and Robinson 1974)
    Stiff, Rosenbrock { tolerance: 1e-5 }, One,
        |at| One { x: (at.state.x - at.time.cos()) * -1e3 - at.time.sin() };
    /// Reaction of Robertson
    Robertson, Rosenbrock { tolerance: 1e-8 }, Concentrations, |at| {
        let &Concentrations { a, b, c } = at.state;
        let (first, second, third) = (a * 0.04, b * c * 1e4, b * b * 3e7);
        Concentrations { a: second - first, b: first - second - third, c: third }
    };
    /// Reaction of Robertson with an explicit solver
    ExplicitRobertson, DormandPrince { tolerance: 1e-6 }, Concentrations, |at| {
        let &Concentrations { a, b, c } = at.state;
        let (first, second, third) = (a * 0.04, b * c * 1e4, b * b * 3e7);
        Concentrations { a: second - first, b: first - second - third, c: third }
    };
}

#[derive(State)]
struct Concentrations<T> {
    /// First species (1)
    #[var(start = 1.0, nominal = 1.0)]
    a: T,
    /// Second species (1)
    #[var(nominal = 1e-5)]
    b: T,
    /// Third species (1)
    #[var(nominal = 1.0)]
    c: T,
}

/// Error of x' = x cos t at 2 s with steps of `step` s.
fn error_of_steps<E: Export>(step: f64, parameter: &str, value: f64) -> f64 {
    let mut fmu = Fmu::<E>::starting(0.0, &[(parameter, value)]);
    for k in 0..(2.0 / step).round() as u32 {
        fmu.0.do_step(f64::from(k) * step, step).unwrap();
    }
    (fmu.get("x") - 2.0_f64.sin().exp()).abs()
}

#[test]
fn the_error_falls_with_the_order_of_the_method() {
    fn check<E: Export>(order: i32, parameter: &str, value: impl Fn(f64) -> f64) {
        let errors = [0.05, 0.025, 0.0125].map(|step| error_of_steps::<E>(step, parameter, value(step)));
        for pair in errors.windows(2) {
            let ratio = pair[0] / pair[1];
            // Halving the step divides the error by 2^order; terms of higher order change this factor by at most 30 %.
            assert!((ratio / 2.0_f64.powi(order) - 1.0).abs() < 0.3, "order {order}: {ratio} of {errors:?}");
        }
    }
    check::<ClassicalGrowth>(4, "max_step", |step| step);
    // With a tolerance that accepts every step, each communication step except the first is one solver step.
    check::<ControlledGrowth>(5, "tolerance", |_| 1e6);
    check::<ImplicitGrowth>(4, "tolerance", |_| 1e6);
}

#[test]
fn error_control_keeps_the_tolerance() {
    fn check<E: Export>() {
        let mut before = f64::INFINITY;
        for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
            let mut fmu = Fmu::<E>::starting(0.0, &[("tolerance", tolerance)]);
            fmu.step(10.0).unwrap();
            let error = (fmu.get("x") - 10.0_f64.sin().exp()).abs();
            // The tolerance applies to each step. Over 10 s, the errors of the steps add up and grow by a factor of at
            // most e^2.
            assert!(error < 50.0 * tolerance, "{error} with a tolerance of {tolerance}");
            assert!(error < before);
            before = error;
        }
    }
    check::<ControlledGrowth>();
    check::<ImplicitGrowth>();
}

#[test]
fn a_stiff_problem_with_a_moving_solution_is_solved_in_few_steps() {
    EVALUATIONS.set(0);
    let mut fmu = Fmu::<Stiff>::ready();
    EVALUATIONS.set(0);
    fmu.step(10.0).unwrap();
    assert!((fmu.get("x") - 10.0_f64.cos()).abs() < 1e-5, "{}", fmu.get("x") - 10.0_f64.cos());
    // An explicit method is stable with steps up to 3.3/1000 s, and would need 3000 steps of 6 evaluations.
    assert!(EVALUATIONS.get() < 9000, "{}", EVALUATIONS.get());
}

const ROBERTSON: [f64; 3] = [0.715_827_068_8, 9.185_534_765e-6, 0.284_163_745_8];

#[test]
fn the_reaction_of_robertson_has_the_published_concentrations() {
    for steps in [1, 40] {
        let mut fmu = Fmu::<Robertson>::ready();
        for k in 0..steps {
            let step = 40.0 / f64::from(steps);
            fmu.0.do_step(f64::from(k) * step, step).unwrap();
        }
        for (name, expected) in ["a", "b", "c"].into_iter().zip(ROBERTSON) {
            let error = (fmu.get(name) / expected - 1.0).abs();
            assert!(error < 1e-6, "{name}: {error} in {steps} steps");
        }
    }
    // An explicit method needs short steps, but its results are correct.
    let mut fmu = Fmu::<ExplicitRobertson>::ready();
    fmu.step(40.0).unwrap();
    assert!((fmu.get("a") / ROBERTSON[0] - 1.0).abs() < 1e-4);
}

#[test]
fn a_tolerance_that_cannot_be_kept_is_an_error() {
    fn check<E: Export>() {
        let mut fmu = Fmu::<E>::ready();
        fmu.step(0.5).unwrap();
        assert!((fmu.get("x") - 2.0).abs() < 1e-4);
        let before = fmu.get("x");
        let message = error_of(fmu.step(1.0));
        assert!(message.contains("the solver cannot keep the tolerance 0.000001 at "), "{message}");
        assert!(message.ends_with("the state at 0.5 s was restored and the instance cannot continue"), "{message}");
        assert_eq!((fmu.get("x"), fmu.0.time()), (before, 0.5));
    }
    check::<ControlledPole>();
    check::<ImplicitPole>();
}

#[test]
fn a_restored_state_continues_with_the_step_of_the_solver() {
    fn check<E: Export>() {
        let mut fmu = Fmu::<E>::ready();
        fmu.step(0.3).unwrap();
        let bytes = fmu.bytes();
        let run = |fmu: &mut Fmu<E>| {
            let mut seen = Vec::new();
            for step in [0.5, 1e-3, 0.25] {
                fmu.step(step).unwrap();
                seen.push(fmu.bits());
            }
            (seen, fmu.bytes())
        };
        let expected = run(&mut fmu);
        let mut other = Fmu::<E>::ready();
        let saved = other.0.deserialize(&bytes).unwrap();
        other.0.restore(&saved).unwrap();
        assert_eq!(run(&mut other), expected);
    }
    check::<ControlledGrowth>();
    check::<ImplicitGrowth>();
    check::<Stiff>();
}

#[test]
fn short_communication_steps_and_steps_that_end_on_them_are_no_problem() {
    // Takes steps of a few units in the last place of the time.
    let mut fmu = Fmu::<ControlledGrowth>::starting(1e3, &[]);
    for _ in 0..100 {
        let time = fmu.0.time();
        fmu.0.do_step(time, 4.0 * (time.next_up() - time)).unwrap();
    }
    for k in 0..1000 {
        let mut fmu = Fmu::<ControlledGrowth>::ready();
        fmu.step(0.01).unwrap();
        fmu.step(0.1 + f64::from(k) * 1e-4).unwrap();
    }
}
