//! One sample of the law: error of the yaw rate, its rate, fuzzy PID.
//!
//! | symbol | meaning |
//! |---|---|
//! | w_d, w | reference of the yaw rate, yaw rate |
//! | e, ec | error of the yaw rate and its filtered rate |
//! | delta, dd | angle of the front axle demanded by the driver, and the added angle |
//! | K_p, K_i, K_d | gains after the correction by fuzzy rules |

use chassis_control::fuzzy_pid::{FuzzyPid, Gains, Settings, filtered_rate};
use chassis_vehicle::positions::FrontAxle;

use crate::{ActiveFrontSteering, D, U, X, Y};

/// Tabulates the rules.
pub(crate) fn derived(p: &ActiveFrontSteering) -> Result<D, String> {
    Ok(D { pid: FuzzyPid::new(p.rule_table)? })
}

pub(crate) fn sample(p: &ActiveFrontSteering, d: &D, x: &mut X, u: &U) -> Y {
    let e = u.w_d - u.w;
    let previous = if x.has_previous { x.e } else { e };
    let ec = filtered_rate(x.ec, e, previous, p.t_f, p.sample_time);
    (x.e, x.ec, x.has_previous) = (e, ec, true);

    let settings = Settings {
        gains: Gains { proportional: p.kp, integral: p.ki, derivative: p.kd },
        scales: Gains { proportional: p.kp_scale, integral: p.ki_scale, derivative: p.kd_scale },
        error_range: p.error_range,
        rate_range: p.rate_range,
        output_minimum: p.output_minimum,
        output_maximum: p.output_maximum,
        integral_limit: p.integral_limit,
        leak_rate: p.leak_rate,
    };
    let (dd, k) = d.pid.sample(&settings, &mut x.i, e, ec, p.sample_time);
    let delta = FrontAxle([u.delta + dd]);
    Y { delta, dd: FrontAxle([dd]), kp: k.proportional, ki: k.integral, kd: k.derivative }
}
