//! Compares the oscillation with an independent solution, and the equations with the published trajectory.

use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;
use reference_van_der_pol::{ReferenceVanDerPol, X};

/// Time in s, `x0`, `x1`: solution of high accuracy, rounded to eight decimals.
const EXACT: [(f64, f64, f64); 4] = [
    (1.0, 1.508_144_24, -0.780_218_07),
    (5.0, -0.837_077_45, 1.307_088_94),
    (10.0, -2.008_340_78, 0.032_907_07),
    (20.0, 2.008_149_76, -0.042_508_88),
];

/// Tolerance: half of the last decimal, and the error of the Runge-Kutta method. With the steps of 10 ms of the model, it is
/// at most 4.8e-8 (compared with 30 digits), so it is below 2e-10 with steps of 2.5 ms.
#[test]
fn the_oscillation_matches_the_exact_one() {
    let mut run = ContinuousSimulation::new(ReferenceVanDerPol::default()).expect("it starts");
    for (time, x0, x1) in EXACT {
        while run.time() < time - 1e-6 {
            run.step(&(), 0.0025).expect("a step");
        }
        let error = (run.state().x0 - x0, run.state().x1 - x1);
        assert!(error.0.abs() < 5.2e-9 && error.1.abs() < 5.2e-9, "{error:?} at {time} s");
    }
}

/// Reference: the published FMU integrates by Euler's method in steps of 10 ms; its values at 20 s have nine decimals.
/// Tolerance: half of the last one.
#[test]
fn eulers_method_gives_the_published_end_values() {
    let model = ReferenceVanDerPol::default();
    let mut state = X { x0: 2.0, x1: 0.0 };
    for _ in 0..2000 {
        let at = At { time: 0.0, state: &state, inputs: &(), derived: &(), discrete: &() };
        let slope = model.derivatives(at);
        state = X { x0: state.x0 + 0.01 * slope.x0, x1: state.x1 + 0.01 * slope.x1 };
    }
    let error = (state.x0 - 2.014_841_886, state.x1 - 0.244_194_708);
    assert!(error.0.abs() < 0.5e-9 && error.1.abs() < 0.5e-9, "{error:?}");
}
