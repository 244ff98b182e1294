//! One sample of the antilock logic, wheel by wheel.
//!
//! | symbol | meaning |
//! |---|---|
//! | u, omega | speed of the vehicle, speed of rotation of the wheel |
//! | slip, pred | braking slip (positive, 1 locked), the same extrapolated by the lead time |
//! | acc | acceleration of the wheel's circumference |
//! | req, cmd | pressure demanded by driver and yaw control, commanded pressure |
//! | T | sample time |

use chassis_vehicle::positions::FourWheels;

use crate::{AntilockBraking, U, X, Y};

/// Floor of the speed in the slip, m/s.
const LEAST_SPEED: f64 = 0.5;

pub(crate) fn sample(p: &AntilockBraking, x: &mut X, inputs: &U) -> Y {
    let t = p.sample_time;
    let u = inputs.u;
    let is_on = inputs.enable && u >= p.speed_min;
    for i in 0..4 {
        let omega = inputs.omega[i];
        let req = (inputs.master + inputs.p_dyc[i]).max(0.0).min(p.p_max);
        let slip = (u - p.radius * omega) / u.max(LEAST_SPEED);
        let acc = if x.has_past { p.radius * (omega - x.omega[i]) / t } else { 0.0 };
        let pred = slip + p.lead * (slip - x.slip[i]) / t;
        let is_high = pred > inputs.target[i] + p.band;
        let is_low = pred < inputs.target[i] - p.band;
        x.active[i] = is_on && (x.active[i] || (is_high && req > 0.0));
        if x.active[i] {
            let cmd = if is_high {
                // A wheel that already speeds up again keeps its pressure.
                if acc < p.reacceleration { x.cmd[i] - p.rate_down * t } else { x.cmd[i] }
            } else if is_low {
                x.cmd[i] + p.rate_up * t
            } else {
                x.cmd[i]
            };
            x.active[i] = cmd < req;
            x.cmd[i] = cmd.min(req).max(0.0);
        } else {
            x.cmd[i] = req;
        }
        (x.omega[i], x.slip[i]) = (omega, slip);
    }
    x.has_past = true;
    Y { cmd: FourWheels(x.cmd), active: FourWheels(x.active) }
}
