//! Compares the decay with the closed form, and the equation with the published trajectory.

use dahlquist::{Dahlquist, X};
use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;

/// Reference: x = exp(-k t). Tolerance: the Runge-Kutta method of order 4 multiplies x by exp(-h) + h^5 / 120 + O(h^6) in
/// a step, so the relative error is h^4 t / 120 = 8.3e-6 at 10 s; 1e-5 contains the next orders.
#[test]
fn the_state_decays_exponentially() {
    let mut run = ContinuousSimulation::new(Dahlquist::default()).expect("it starts");
    for step in 1..=100 {
        run.step(&(), 0.1).expect("a step");
        let exact = (-f64::from(step) / 10.0).exp();
        assert!((run.state().x / exact - 1.0).abs() < 1e-5, "{} instead of {exact}", run.state().x);
    }
}

/// Reference: the published FMU integrates by Euler's method in steps of 0.1 s and ends with 0.9^100. Tolerance: rounding
/// of 100 steps.
#[test]
fn eulers_method_gives_the_published_end_value() {
    let model = Dahlquist::default();
    let mut state = X { x: 1.0 };
    for _ in 0..100 {
        let at = At { time: 0.0, state: &state, inputs: &(), derived: &(), discrete: &() };
        state.x += 0.1 * model.derivatives(at).x;
    }
    assert!((state.x / 2.656_139_888_758_748e-5 - 1.0).abs() < 100.0 * f64::EPSILON, "{}", state.x);
}
