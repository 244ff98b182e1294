//! `KalmanFilter`: position and velocity from noisy positions. The README has the equations.

use fmu::prelude::*;
use nalgebra::{Matrix2, RowVector2, Vector2};

/// Parameters.
#[derive(Parameters)]
pub struct KalmanFilter {
    /// Standard deviation of the acceleration, constant during a sample (m/s2)
    #[var(start = 1.0, positive)]
    pub acceleration_deviation: f64,
    /// Standard deviation of the measured position (m)
    #[var(start = 0.5, positive)]
    pub measurement_deviation: f64,
    /// Standard deviation of the position at the start (m)
    #[var(start = 10.0, positive)]
    pub initial_position_deviation: f64,
    /// Standard deviation of the velocity at the start (m/s)
    #[var(start = 10.0, positive)]
    pub initial_velocity_deviation: f64,
    #[var(SAMPLE_TIME, start = 0.1)]
    sample_time: f64,
}

/// Inputs.
#[derive(Inputs)]
pub struct U {
    /// Measured position (m)
    pub measured_position: f64,
}

/// Outputs.
#[derive(Outputs)]
pub struct Y {
    /// Estimated position (m)
    pub position: f64,
    /// Estimated velocity (m/s)
    pub velocity: f64,
    /// Gain of the position (1)
    pub position_gain: f64,
    /// Gain of the velocity (1/s)
    pub velocity_gain: f64,
}

/// Prediction for the next sample.
#[derive(DiscreteState, Clone, Default)]
pub struct X {
    /// Estimate of position and velocity.
    pub estimate: [f64; 2],
    /// Covariance of the estimation error.
    pub covariance: [[f64; 2]; 2],
}

/// Kalman filter for position and velocity
#[fmu::model(stop_time = 10.0, step_size = 0.1)]
impl Discrete for KalmanFilter {
    type Inputs = U;
    type Outputs = Y;
    type State = X;

    fn initial_state(&self, (): &()) -> X {
        let variance = |deviation: f64| deviation * deviation;
        let (position, velocity) = (self.initial_position_deviation, self.initial_velocity_deviation);
        X { estimate: [0.0; 2], covariance: [[variance(position), 0.0], [0.0, variance(velocity)]] }
    }

    fn update(&self, sample: Sample<Self>) -> Y {
        let step = self.sample_time;
        let transition = Matrix2::new(1.0, step, 0.0, 1.0);
        let output = RowVector2::new(1.0, 0.0);
        let noise = Vector2::new(0.5 * step * step, step) * self.acceleration_deviation;
        let (mut x, mut p) = (Vector2::from(sample.state.estimate), Matrix2::from(sample.state.covariance));
        // Correction.
        let innovation_variance = (output * p * output.transpose()).x + self.measurement_deviation.powi(2);
        let gain = p * output.transpose() / innovation_variance;
        x += gain * (sample.inputs.measured_position - (output * x).x);
        p = (Matrix2::identity() - gain * output) * p;
        let y = Y { position: x.x, velocity: x.y, position_gain: gain.x, velocity_gain: gain.y };
        // Prediction.
        x = transition * x;
        p = transition * p * transition.transpose() + noise * noise.transpose();
        *sample.state = X { estimate: x.into(), covariance: p.into() };
        y
    }
}
