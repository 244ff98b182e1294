//! `AllWheelSteering`: steers the middle and the rear axle in proportion to the front, so that the sideslip angle follows
//! its reference: the rear ratio by a PID controller whose gains follow fuzzy rules, the middle one by fuzzy rules on it.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, section 3.2, Table 2.

mod equations;
#[cfg(test)]
mod tests;

use chassis::prelude::*;
use control::fuzzy_pid::{FuzzyPid, Rules};
use fmi2::prelude::*;

/// The controller.
pub struct AllWheelSteering;

/// Parameters; the paper prints the ranges of the error, its rate and the ratio, all other values are assumed.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// Angle of the driver from which on the error counts in full; below, it fades out and the integral rests
    #[par("steer.sign_width", unit = RAD, start = 0.02, positive, tunable, display = "deg")]
    sign_width: f64,
    /// T_f: time constant of the filter that makes the rate of the error; 0 for none
    #[par("filter.time_constant", unit = S, start = 0.02, min = 0.0, tunable, display = "ms")]
    t_f: f64,
    /// Rules for the gains
    #[par("fuzzy.rule_table", mode, start = Rules::Mirrored)]
    rule_table: Rules,
    /// Error at the edge of the rules' domain (paper); lower it to let the gains change with smaller errors
    #[par("fuzzy.error_range", unit = RAD, start = 0.2, positive, tunable, display = "deg")]
    error_range: f64,
    /// Rate of the error at the edge of the rules' domain (paper)
    #[par("fuzzy.rate_range", unit = RAD_PER_S, start = 0.06, positive, tunable, display = "deg/s")]
    rate_range: f64,
    /// kp: proportional gain before the fuzzy correction
    #[par("pid.proportional_gain", unit = PER_RAD, start = 6.0, min = 0.0, tunable)]
    kp: f64,
    /// ki: integral gain before the fuzzy correction; raise it against a lasting error
    #[par("pid.integral_gain", unit = PER_RAD_S, start = 30.0, min = 0.0, tunable)]
    ki: f64,
    /// kd: derivative gain before the fuzzy correction
    #[par("pid.derivative_gain", unit = S_PER_RAD, start = 0.3, min = 0.0, tunable)]
    kd: f64,
    /// Change of the proportional gain per unit of the rules' output, which is within -3 and 3
    #[par("fuzzy.proportional_scale", unit = PER_RAD, start = 1.0, min = 0.0, tunable)]
    kp_scale: f64,
    /// Change of the integral gain per unit of the rules' output
    #[par("fuzzy.integral_scale", unit = PER_RAD_S, start = 5.0, min = 0.0, tunable)]
    ki_scale: f64,
    /// Change of the derivative gain per unit of the rules' output
    #[par("fuzzy.derivative_scale", unit = S_PER_RAD, start = 0.05, min = 0.0, tunable)]
    kd_scale: f64,
    /// Least rear ratio (paper)
    #[par("pid.output_minimum", unit = ONE, start = -1.0, min = -1.0, max = 0.0, tunable)]
    output_minimum: f64,
    /// Greatest rear ratio (paper)
    #[par("pid.output_maximum", unit = ONE, start = 1.0, min = 0.0, max = 1.0, tunable)]
    output_maximum: f64,
    /// Greatest magnitude of the integral part of the ratio
    #[par("pid.integral_limit", unit = ONE, start = 1.0, min = 0.0, tunable)]
    integral_limit: f64,
    /// Rate at which the integral part decays
    #[par("pid.leak_rate", unit = PER_S, start = 0.0, min = 0.0, tunable)]
    leak_rate: f64,
    /// T
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// What the driver asks for, reference and measurement.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(DRIVER_STEER)]
    delta: f64,
    #[signal(REFERENCE_SIDESLIP)]
    beta_d: f64,
    #[signal(VEHICLE_SIDESLIP)]
    beta: f64,
}

/// The angles of the middle and the rear axle, and their ratios (k1, k2) to what the driver asks for.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(STEER)]
    delta: RearAxles<f64>,
    #[signal(STEER_RATIO)]
    ratio: RearAxles<f64>,
    #[signal(ALL_WHEEL_STEERING_PROPORTIONAL_GAIN)]
    kp: f64,
    #[signal(ALL_WHEEL_STEERING_INTEGRAL_GAIN)]
    ki: f64,
    #[signal(ALL_WHEEL_STEERING_DERIVATIVE_GAIN)]
    kd: f64,
}

/// Integral part, error of the last sample if there was one, and filtered rate.
#[derive(Memory, Clone, Debug, Default)]
pub struct X {
    i: f64,
    e: f64,
    ec: f64,
    has_previous: bool,
}

/// The rules, tabulated.
#[derive(Design, Clone, Debug)]
pub struct D {
    pid: FuzzyPid,
    middle: equations::MiddleRatio,
}

/// Middle and rear steering angles in proportion to the front, so that the sideslip angle follows its reference, by a
/// fuzzy PID
#[model(stop_time = 13.0, step_size = 0.001)]
impl Sampled for AllWheelSteering {
    type Parameters = P;
    type Design = D;
    type Memory = X;
    type Inputs = U;
    type Outputs = Y;

    fn design(p: &P) -> Result<D, String> {
        equations::design(p)
    }
    fn update(p: &P, d: &D, x: &mut X, u: &U, _t: f64) -> Y {
        equations::sample(p, d, x, u)
    }
}

fmi2::export!(sampled AllWheelSteering);
