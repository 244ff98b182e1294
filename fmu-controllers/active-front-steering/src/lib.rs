//! `ActiveFrontSteering`: adds an angle to the driver's demand so that the yaw rate follows its reference. The angle
//! comes from a PID controller whose gains follow fuzzy rules.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, section 3.2.
//!
//! | symbol | meaning |
//! |---|---|
//! | w_d, w | yaw rate reference, yaw rate |
//! | e, ec | yaw rate error and its filtered rate |
//! | delta, dd | front-axle angle demanded by the driver, and the added angle |
//! | K_p, K_i, K_d | gains after the correction by fuzzy rules |

#[cfg(test)]
mod tests;

use chassis_control::fuzzy_pid::{FuzzyPid, Gains, Rules, Settings, filtered_rate};
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Parameters. All values are assumed; the paper prints none.
#[derive(Parameters, Clone, Debug)]
pub struct ActiveFrontSteering {
    /// T_f: time constant of the filter for the rate of the error; 0 for none
    #[var("filter.time_constant", unit = "s", start = 0.02, min = 0.0, tunable, display = "ms")]
    t_f: f64,
    /// Rules for the gains
    #[var("fuzzy.rule_table", start = Rules::Mirrored)]
    rule_table: Rules,
    /// Error at the edge of the rules' domain; lower it to let the gains change with smaller errors
    #[var("fuzzy.error_range", unit = "rad/s", start = 0.1, positive, tunable, display = "deg/s")]
    error_range: f64,
    /// Rate of the error at the edge of the rules' domain
    #[var("fuzzy.rate_range", unit = "rad/s2", start = 0.5, positive, tunable, display = "deg/s2")]
    rate_range: f64,
    /// kp: proportional gain before the fuzzy correction
    #[var("pid.proportional_gain", unit = "s", start = 0.4, min = 0.0, tunable)]
    kp: f64,
    /// ki: integral gain before the fuzzy correction; raise it to remove a lasting error
    #[var("pid.integral_gain", unit = "1", start = 2.0, min = 0.0, tunable)]
    ki: f64,
    /// kd: derivative gain before the fuzzy correction
    #[var("pid.derivative_gain", unit = "s2", start = 0.02, min = 0.0, tunable)]
    kd: f64,
    /// Change of the proportional gain per unit of the rules' output, which is between -3 and 3
    #[var("fuzzy.proportional_scale", unit = "s", start = 0.1, min = 0.0, tunable)]
    kp_scale: f64,
    /// Change of the integral gain per unit of the rules' output
    #[var("fuzzy.integral_scale", unit = "1", start = 0.5, min = 0.0, tunable)]
    ki_scale: f64,
    /// Change of the derivative gain per unit of the rules' output
    #[var("fuzzy.derivative_scale", unit = "s2", start = 0.005, min = 0.0, tunable)]
    kd_scale: f64,
    /// Smallest added angle
    #[var("pid.output_minimum", unit = "rad", start = -0.06, max = 0.0, tunable, display = "deg")]
    output_minimum: f64,
    /// Largest added angle
    #[var("pid.output_maximum", unit = "rad", start = 0.06, min = 0.0, tunable, display = "deg")]
    output_maximum: f64,
    /// Largest magnitude of the integral part of the angle
    #[var("pid.integral_limit", unit = "rad", start = 0.06, min = 0.0, tunable, display = "deg")]
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
    #[var(REFERENCE_YAW_RATE)]
    w_d: f64,
    #[var(VEHICLE_YAW_RATE)]
    w: f64,
}

/// The angle of the front axle, and its components.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(STEER)]
    delta: FrontAxle<f64>,
    #[var(STEER_CORRECTION)]
    dd: FrontAxle<f64>,
    #[var(FRONT_STEERING_PROPORTIONAL_GAIN)]
    kp: f64,
    #[var(FRONT_STEERING_INTEGRAL_GAIN)]
    ki: f64,
    #[var(FRONT_STEERING_DERIVATIVE_GAIN)]
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
}

/// Front steering angle that lets the yaw rate follow its reference, by a fuzzy PID
#[fmu::model(stop_time = 13.0, step_size = 0.001)]
impl Discrete for ActiveFrontSteering {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn derived(&self) -> Result<D, String> {
        Ok(D { pid: FuzzyPid::new(self.rule_table).map_err(|error| error.to_string())? })
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, u) = (sample.state, sample.inputs);
        let e = u.w_d - u.w;
        let previous = if x.has_previous { x.e } else { e };
        let ec = filtered_rate(x.ec, e, previous, self.t_f, self.sample_time);
        (x.e, x.ec, x.has_previous) = (e, ec, true);

        let settings = Settings {
            gains: Gains { proportional: self.kp, integral: self.ki, derivative: self.kd },
            scales: Gains { proportional: self.kp_scale, integral: self.ki_scale, derivative: self.kd_scale },
            error_range: self.error_range,
            rate_range: self.rate_range,
            output_minimum: self.output_minimum,
            output_maximum: self.output_maximum,
            integral_limit: self.integral_limit,
            leak_rate: self.leak_rate,
        };
        let (dd, k) = sample.derived.pid.sample(&settings, &mut x.i, e, ec, self.sample_time);
        let delta = FrontAxle([u.delta + dd]);
        Y { delta, dd: FrontAxle([dd]), kp: k.proportional, ki: k.integral, kd: k.derivative }
    }
}
