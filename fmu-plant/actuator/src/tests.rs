//! Tests against the closed forms in the README and the differential equation.

use std::path::Path;
use std::sync::Arc;

use fmu::Dual64;
use fmu::simulation::ContinuousSimulation;
use fmu::testing::calls::Protocol;
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::Instance;
use fmu::testing::runner::ContinuousModel;
use proptest::prelude::*;

use super::*;

fn at<'a>(state: &'a X<f64>, inputs: &'a U<f64>) -> At<'a, f64, Actuator> {
    At { time: 0.0, state, inputs, derived: &(), discrete: &() }
}

fn advance(p: &Actuator, x: f64, u: f64, h: f64) -> f64 {
    p.advance(at(&X { x }, &U { u }), h).x
}

/// Times and values over `count` steps of `h`. The command `u` is a function of the time at the start of each step.
fn run(p: &Actuator, h: f64, count: usize, u: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let mut actuator = ContinuousSimulation::new(p.clone()).unwrap();
    (0..=count)
        .map(|k| {
            let now = (actuator.time(), actuator.state().x);
            actuator.step(&U { u: u(k as f64 * h) }, h).unwrap();
            now
        })
        .collect()
}

/// Tolerance for rounding in a few hundred steps, which are exact otherwise, with numbers of order 1 to 10.
const ROUNDING: f64 = 1e-13;

#[test]
fn a_step_rises_with_the_time_constant() {
    // The value is A (1 - exp(-t/T)) at every communication point, for any step size.
    let p = Actuator { t: 0.05, ..Actuator::default() };
    for h in [1e-4, 1e-3, 0.013, 0.5] {
        for (t, x) in run(&p, h, 400, |_| 2.0) {
            assert!((x - 2.0 * (1.0 - (-t / p.t).exp())).abs() < ROUNDING, "{t} s, steps of {h} s: {x}");
        }
    }
}

#[test]
fn a_limited_rate_is_a_ramp_and_then_the_lag() {
    // The lag takes over at t_s = A/r - T, when the error is r T.
    let p = Actuator { t: 0.05, r: 4.0, ..Actuator::default() };
    for (a, h) in [(2.0, 1e-3), (-2.0, 1e-3), (2.0, 0.07), (-2.0, 0.45)] {
        let size = f64::abs(a);
        let t_s = size / p.r - p.t;
        assert_eq!(t_s, 0.45);
        for (t, x) in run(&p, h, 300, |_| a) {
            let expected = if t <= t_s { p.r * t } else { size - p.r * p.t * (-(t - t_s) / p.t).exp() };
            assert!((x - expected.copysign(a)).abs() < ROUNDING, "{t} s, steps of {h} s: {x}");
        }
    }
}

#[test]
fn a_small_step_does_not_reach_the_greatest_rate() {
    // Because A <= r T, the lag acts from the start.
    let p = Actuator { t: 0.05, r: 4.0, ..Actuator::default() };
    for (t, x) in run(&p, 1e-3, 300, |_| 0.2) {
        assert!((x - 0.2 * (1.0 - (-t / p.t).exp())).abs() < ROUNDING);
    }
}

#[test]
fn the_range_limits_the_command_without_windup() {
    let p = Actuator { t: 0.05, x_min: -0.5, x_max: 1.5, ..Actuator::default() };
    // A command of 7 from 0 s on acts like 1.5, and a command of -7 from 1 s on acts like -0.5.
    for (t, x) in run(&p, 1e-3, 2000, |t| if t < 0.9995 { 7.0 } else { -7.0 }) {
        let at_one = 1.5 * (1.0 - (-1.0 / p.t).exp());
        let expected =
            if t < 1.0 { 1.5 * (1.0 - (-t / p.t).exp()) } else { -0.5 + (at_one + 0.5) * (-(t - 1.0) / p.t).exp() };
        assert!((x - expected).abs() < 20.0 * ROUNDING, "{t} s: {x}");
        assert!((-0.5..=1.5).contains(&x));
    }
}

#[test]
fn a_ramp_is_delayed_by_the_time_constant() {
    // The command is held over each step, so it lags behind the ramp by h/2 on average: x = a (t - (T + h/2)(1 -
    // exp(-t/T))), with an error of at most h^2/(12 T).
    let p = Actuator { t: 0.05, r: 4.0, ..Actuator::default() };
    let (a, h) = (3.0, 1e-4);
    for (t, x) in run(&p, h, 5000, |t| a * t) {
        let lag = 1.0 - (-t / p.t).exp();
        assert!((x - a * (t - (p.t + 0.5 * h) * lag)).abs() < a * h * h / p.t, "{t} s: {x}");
    }
}

#[test]
fn with_the_least_time_constant_the_value_follows_at_once() {
    let p = Actuator { t: 1e-6, r: 4.0, ..Actuator::default() };
    let fast = Actuator { t: 1e-6, ..Actuator::default() };
    for (k, (_, x)) in run(&fast, 1e-3, 10, |t| 1e3 * t).into_iter().enumerate().skip(1) {
        assert_eq!(x, 1e3 * ((k - 1) as f64 * 1e-3));
    }
    // Only the rate limit acts: the value rises at 4/s, up to 0.5 at 0.125 s.
    for (t, x) in run(&p, 1e-3, 200, |_| 0.5) {
        assert!((x - (4.0 * t).min(0.5)).abs() < 4e-6 + ROUNDING, "{t} s: {x}");
    }
}

#[test]
fn the_initial_value_is_within_the_range() {
    for (x_0, expected) in [(0.3, 0.3), (-7.0, -0.5), (7.0, 1.5)] {
        let p = Actuator { x_min: -0.5, x_max: 1.5, x_0, ..Actuator::default() };
        assert_eq!(ContinuousSimulation::new(p).unwrap().state().x, expected);
    }
}

#[test]
fn a_range_upside_down_is_an_error() {
    let p = Actuator { x_min: 2.0, x_max: -1.0, ..Actuator::default() };
    let error = ContinuousSimulation::new(p).unwrap_err();
    assert_eq!(error, "'actuator.minimum' = 2 must not exceed 'actuator.maximum' = -1");
    assert!(ContinuousSimulation::new(Actuator { x_min: 1.0, x_max: 1.0, ..Actuator::default() }).is_ok());
}

/// The FMU starts at the initial value and takes the same exact steps.
#[test]
fn the_instance_gives_the_bits_of_the_equations() {
    type Fmu = Instance<ContinuousModel<Actuator>>;
    let p = Actuator { t: 0.05, r: 4.0, x_min: -0.4, x_max: 0.6, x_0: 0.1 };
    let description = Arc::new(Description::of::<ContinuousModel<Actuator>>(Format::FMI2, Path::new("")));
    let reference = |name: &str| {
        description
            .layout
            .variables
            .iter()
            .find(|v| v.declaration.name == name)
            .unwrap_or_else(|| panic!("{name}"))
            .reference
    };
    let mut fmu = Fmu::new(Protocol::CS2, Arc::clone(&description), Path::new("").to_owned());
    let parameters = [
        ("actuator.time_constant", p.t),
        ("actuator.rate_limit", p.r),
        ("actuator.minimum", p.x_min),
        ("actuator.maximum", p.x_max),
        ("actuator.initial_value", p.x_0),
    ];
    for (name, value) in parameters {
        fmu.set_real(&[reference(name)], &[value]).unwrap();
    }
    fmu.setup_experiment(0.0, None).unwrap();
    fmu.enter_initialization().unwrap();
    fmu.exit_initialization().unwrap();
    let [u, x] = ["actuator.command", "actuator.value"].map(reference);
    let mut expected = p.x_0;
    for k in 0..500 {
        let mut value = [f64::NAN];
        fmu.get_real(&[x], &mut value).unwrap();
        assert_eq!(value[0].to_bits(), expected.to_bits(), "step {k}");
        let command = (f64::from(k) * 0.03).sin();
        fmu.set_real(&[u], &[command]).unwrap();
        fmu.do_step(f64::from(k) * 1e-3, 1e-3).unwrap();
        expected = advance(&p, expected, command, 1e-3);
    }
}

proptest! {
    /// The exact step solves the differential equation: its derivative with respect to the step size is x' at its end,
    /// and two partial steps give the result of one. The tolerances cover the rounding of values up to 10 and of slopes
    /// up to 20/T.
    #[test]
    fn the_step_is_the_solution(
        x in -10.0..10.0_f64, u in -20.0..20.0_f64, t in 1e-3..1.0_f64, r in 0.1..100.0_f64, h in 1e-5..2.0_f64, part in 0.01..0.99_f64,
    ) {
        let p = Actuator { t, r, x_min: -10.0, x_max: 10.0, x_0: 0.0 };
        let whole = advance(&p, x, u, h);
        let first = advance(&p, x, u, part * h);
        let second = advance(&p, first, u, (1.0 - part) * h);
        prop_assert!((whole - second).abs() < ROUNDING);
        // The derivative of the closed form, computed with a dual number.
        let e = u.clamp(-10.0, 10.0) - x;
        let h_r = (e.abs() / r - t).max(0.0);
        let slope = if h < h_r {
            r.copysign(e)
        } else {
            let decay = Scalar::exp((Dual64::new(-h, -1.0) + h_r) / t);
            -decay.eps * e.abs().min(r * t).copysign(e)
        };
        let rate = p.derivatives(at(&X { x: whole }, &U { u })).x;
        prop_assert!((rate - slope).abs() < ROUNDING * (1.0 + 1.0 / t));
        // The value never passes its target, nor changes faster than the greatest rate.
        prop_assert!((u.clamp(-10.0, 10.0) - whole) * e >= -ROUNDING);
        prop_assert!((whole - x).abs() <= r * h + ROUNDING);
    }

    /// Opposite commands give opposite values, bit for bit.
    #[test]
    fn both_directions_are_alike(x in -10.0..10.0_f64, u in -20.0..20.0_f64, r in 0.1..100.0_f64, h in 1e-5..2.0_f64) {
        let p = Actuator { t: 0.1, r, x_min: -10.0, x_max: 10.0, x_0: 0.0 };
        prop_assert_eq!(advance(&p, -x, -u, h), -advance(&p, x, u, h));
    }
}
