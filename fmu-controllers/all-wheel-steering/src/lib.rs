//! `AllWheelSteering`: steers the middle and the rear axle in proportion to the front axle so that the sideslip angle
//! follows its reference. A PID controller whose gains follow fuzzy rules computes the rear ratio; fuzzy rules derive
//! the middle ratio from it.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, section 3.2, Table 2.

mod equations;
#[cfg(test)]
mod tests;

use chassis_control::fuzzy_pid::{FuzzyPid, Rules};
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Parameters. The paper prints the ranges of the error, its rate and the ratio; all other values are assumed.
#[derive(Parameters, Clone, Debug)]
pub struct AllWheelSteering {
    /// Driver's angle above which the error counts in full; at smaller angles, the error is reduced in proportion
    #[var("steer.sign_width", unit = "rad", start = 0.02, positive, tunable, display = "deg")]
    sign_width: f64,
    /// T_f: time constant of the filter for the rate of the error; 0 for none
    #[var("filter.time_constant", unit = "s", start = 0.02, min = 0.0, tunable, display = "ms")]
    t_f: f64,
    /// Rules for the gains
    #[var("fuzzy.rule_table", start = Rules::Mirrored)]
    rule_table: Rules,
    /// Error at the edge of the rules' domain (paper); lower it to let the gains change with smaller errors
    #[var("fuzzy.error_range", unit = "rad", start = 0.2, positive, tunable, display = "deg")]
    error_range: f64,
    /// Rate of the error at the edge of the rules' domain (paper)
    #[var("fuzzy.rate_range", unit = "rad/s", start = 0.06, positive, tunable, display = "deg/s")]
    rate_range: f64,
    /// kp: proportional gain before the fuzzy correction
    #[var("pid.proportional_gain", unit = "1/rad", start = 6.0, min = 0.0, tunable)]
    kp: f64,
    /// ki: integral gain before the fuzzy correction; raise it to remove a lasting error
    #[var("pid.integral_gain", unit = "1/(rad.s)", start = 30.0, min = 0.0, tunable)]
    ki: f64,
    /// kd: derivative gain before the fuzzy correction
    #[var("pid.derivative_gain", unit = "s/rad", start = 0.3, min = 0.0, tunable)]
    kd: f64,
    /// Change of the proportional gain per unit of the rules' output, which is between -3 and 3
    #[var("fuzzy.proportional_scale", unit = "1/rad", start = 1.0, min = 0.0, tunable)]
    kp_scale: f64,
    /// Change of the integral gain per unit of the rules' output
    #[var("fuzzy.integral_scale", unit = "1/(rad.s)", start = 5.0, min = 0.0, tunable)]
    ki_scale: f64,
    /// Change of the derivative gain per unit of the rules' output
    #[var("fuzzy.derivative_scale", unit = "s/rad", start = 0.05, min = 0.0, tunable)]
    kd_scale: f64,
    /// Smallest rear ratio (paper)
    #[var("pid.output_minimum", unit = "1", start = -1.0, min = -1.0, max = 0.0, tunable)]
    output_minimum: f64,
    /// Largest rear ratio (paper)
    #[var("pid.output_maximum", unit = "1", start = 1.0, min = 0.0, max = 1.0, tunable)]
    output_maximum: f64,
    /// Largest magnitude of the integral part of the ratio
    #[var("pid.integral_limit", unit = "1", start = 1.0, min = 0.0, tunable)]
    integral_limit: f64,
    /// Rate at which the integral part decays
    #[var("pid.leak_rate", unit = "1/s", start = 0.0, min = 0.0, tunable)]
    leak_rate: f64,
    /// T
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Driver's demand, reference and measurement.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(DRIVER_STEER)]
    delta: f64,
    #[var(REFERENCE_SIDESLIP)]
    beta_d: f64,
    #[var(VEHICLE_SIDESLIP)]
    beta: f64,
}

/// The angles of the middle and the rear axle, and their ratios (k1, k2) to the driver's demand.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(STEER)]
    delta: RearAxles<f64>,
    #[var(STEER_RATIO)]
    ratio: RearAxles<f64>,
    #[var(ALL_WHEEL_STEERING_PROPORTIONAL_GAIN)]
    kp: f64,
    #[var(ALL_WHEEL_STEERING_INTEGRAL_GAIN)]
    ki: f64,
    #[var(ALL_WHEEL_STEERING_DERIVATIVE_GAIN)]
    kd: f64,
}

/// Integral part, error at the last sample if there was one, and filtered rate of the error.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    i: f64,
    e: f64,
    ec: f64,
    has_previous: bool,
}

/// The rules, tabulated.
#[derive(Derived, Clone, Debug)]
pub struct D {
    pid: FuzzyPid,
    middle: equations::MiddleRatio,
}

/// Middle and rear steering angles in proportion to the front, so that the sideslip angle follows its reference, by a
/// fuzzy PID
#[fmu::model(stop_time = 13.0, step_size = 0.001)]
impl Discrete for AllWheelSteering {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn derived(&self) -> Result<D, String> {
        equations::derived(self)
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        equations::sample(self, sample.derived, sample.state, sample.inputs)
    }
}
