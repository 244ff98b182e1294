//! Compares the mean temperature with its closed form for this number of cells.

use fmu::simulation::ContinuousSimulation;
use rod::{CELLS, Rod, mean};

/// Tolerance: 1e-6 of the value; the error tolerance of a single step is 1e-8.
#[test]
fn the_mean_temperature_matches_the_closed_form() {
    assert!((mean(CELLS, 0.0) - 100.0).abs() < 1e-9);
    let mut run = ContinuousSimulation::new(Rod::default()).expect("it starts");
    for _ in 0..20 {
        run.step(&(), 0.1).expect("a step");
        let (found, expected) = (run.outputs(&()).mean, mean(CELLS, run.time()));
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} and {expected} at {} s", run.time());
    }
}
