//! Compares the filter with closed forms.

use fmu::simulation::DiscreteSimulation;
use kalman_filter::{KalmanFilter, U};

/// Reference: the solution of the Riccati equation of the double integrator (Kalata, "The tracking index: a generalized
/// parameter for alpha-beta and alpha-beta-gamma target trackers", 1984): with the tracking index L = deviation of the
/// acceleration * T^2 / deviation of the measurement and r = (4 + L - sqrt(8 L + L^2)) / 4, the gains are a = 1 - r^2
/// and (2 (2 - a) - 4 sqrt(1 - a)) / T. The tolerance covers the roundings of the recursion, whose errors decay.
#[test]
fn the_gains_become_those_of_the_riccati_equation() {
    for (acceleration, measurement) in [(1.0, 0.5), (20.0, 0.1), (0.1, 3.0)] {
        let mut model = KalmanFilter::default();
        (model.acceleration_deviation, model.measurement_deviation) = (acceleration, measurement);
        let mut run = DiscreteSimulation::new(model).expect("it starts");
        let step = run.sample_time();
        let index = acceleration * step * step / measurement;
        let r = (4.0 + index - (8.0 * index + index * index).sqrt()) / 4.0;
        let position = 1.0 - r * r;
        let velocity = (2.0 * (2.0 - position) - 4.0 * (1.0 - position).sqrt()) / step;
        let y = (0..10_000).map(|_| run.sample(&U::default()).expect("a sample")).last().expect("samples");
        assert!((y.position_gain / position - 1.0).abs() < 1e-10, "{} and {position}", y.position_gain);
        assert!((y.velocity_gain / velocity - 1.0).abs() < 1e-10, "{} and {velocity}", y.velocity_gain);
    }
}

/// Reference: the filter has no bias for a motion with constant velocity. Tolerance: the first samples reduce the
/// initial error of 5 m to centimeters. The error then decays by a factor of r = 0.905 per sample, to 2e-9 of its value
/// after 20 s.
#[test]
fn constant_velocity_is_estimated_without_bias() {
    let mut run = DiscreteSimulation::new(KalmanFilter::default()).expect("it starts");
    for k in 0..200 {
        let time = f64::from(k) * run.sample_time();
        let y = run.sample(&U { measured_position: 5.0 + 3.0 * time }).expect("a sample");
        if k == 199 {
            assert!((y.position - (5.0 + 3.0 * time)).abs() < 1e-9, "{}", y.position);
            assert!((y.velocity - 3.0).abs() < 1e-9, "{}", y.velocity);
        }
    }
}
