//! Steady turn without sideslip, and its first-order lag (eqs. 12-16 of the paper, corrected).
//!
//! | symbol | meaning |
//! |---|---|
//! | m, I_z | mass and yaw inertia of the vehicle |
//! | l1, l2 | center of mass to front axle and to the trunnion between the rear axles; L is their sum |
//! | kc | cornering stiffness of one front wheel |
//! | u, delta | speed, steering angle of the front axle demanded by the driver |
//! | k, tau | yaw rate of the steady turn per steering angle, time constant |
//! | w | reference of the yaw rate |

use chassis_control::limit;

use crate::{U, X, Y, YawRateReference};

/// Gain k in 1/s and time constant tau in s at the speed `u`.
pub(crate) fn gain_and_time_constant(p: &YawRateReference, u: f64) -> (f64, f64) {
    let l = p.l1 + p.l2;
    let den = 2.0 * p.kc[0] * p.l1 * l + p.m * p.l2 * u * u;
    (2.0 * p.kc[0] * u * l / den, p.i_z * u / den)
}

/// The reference of this sample follows from the samples before it.
pub(crate) fn sample(p: &YawRateReference, x: &mut X, u: &U) -> Y {
    let (k, tau) = gain_and_time_constant(p, u.u);
    let y = Y { w: x.w, beta: 0.0 };
    x.w = limit::lag(x.w, k * u.delta, tau, p.sample_time);
    y
}
