//! Pressures and torques (eq. 12).
//!
//! | symbol | meaning |
//! |---|---|
//! | p_master | pressure that the driver's pedal makes, MPa |
//! | p, p_cmd | pressure of a wheel brake, and as commanded, MPa |
//! | T_b, T_d | brake and drive torque of a wheel |
//! | omega | speed of rotation of a wheel |

use std::f64::consts::PI;

use chassis_vehicle::positions::{FourWheels, axle_of};
use fmu::Scalar;

use crate::{BrakeAndDriveActuators, U, X, Y};

/// Pascal per megapascal.
const MEGA: f64 = 1e6;

pub(crate) fn derivatives<T: Scalar>(p: &BrakeAndDriveActuators, x: &X<T>, u: &U<T>) -> X<T> {
    X { p: FourWheels::from_fn(|i| (u.p_cmd[i] - x.p[i]) / p.tau_p) }
}

/// The exact solution for held commands.
pub(crate) fn advance(p: &BrakeAndDriveActuators, x: &X<f64>, u: &U<f64>, h: f64) -> X<f64> {
    let decay = fmu::math::exp(-h / p.tau_p);
    X { p: FourWheels::from_fn(|i| u.p_cmd[i] + (x.p[i] - u.p_cmd[i]) * decay) }
}

pub(crate) fn outputs<T: Scalar>(p: &BrakeAndDriveActuators, x: &X<T>, u: &U<T>) -> Y<T> {
    let (zero, one) = (T::from(0.0), T::from(1.0));
    let per_pedal = 4.0 * p.f_pedal * p.i_b * p.eta_p * p.boost / (PI * p.d_m * p.d_m) / MEGA;
    let mean_speed = (u.omega[0] + u.omega[1]) * 0.5;
    let torque = Scalar::min(T::from(p.t_max), T::from(p.p_max) / Scalar::max(mean_speed, one));
    let t_d = Scalar::clamp(u.throttle, zero, one) * torque;
    Y {
        p_master: Scalar::max(u.brake * per_pedal - p.p_loss, zero),
        t_b: FourWheels::from_fn(|i| x.p[i] * (p.gain[axle_of(i)] * MEGA)),
        t_d: FourWheels::from_fn(|i| if axle_of(i) == 0 { t_d * 0.5 } else { zero }),
    }
}
