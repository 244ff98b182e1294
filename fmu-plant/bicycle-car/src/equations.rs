//! Equations of motion, in the order of computation: slip angles, tires, motion in the plane, roll.
//!
//! | symbol | meaning |
//! |---|---|
//! | u, u_s | speed; speed limited to the minimum speed, for divisions |
//! | v, r, psi | lateral velocity, yaw rate, heading |
//! | phi, p | roll angle and roll rate |
//! | delta, alpha, F | steering angle; slip angle and lateral force of an axle |
//! | C, F_z | cornering stiffness and load at rest of an axle |
//! | mu | factor on the tire friction |
//! | a_y | lateral acceleration |

use chassis_vehicle::arithmetic::Rotation;
use fmu::Scalar;

use crate::{BicycleCar, U, X, Y};

/// Lower limit of the friction coefficient in a division, for roads without friction. Below it, the slope of the tire
/// force at the origin is no longer the cornering stiffness.
const LEAST_FRICTION: f64 = 1e-9;

/// Values that derivatives and outputs share.
struct Motion<T> {
    rates: X<T>,
    u_s: T,
    a_y: T,
}

#[inline]
fn motion<T: Scalar>(p: &BicycleCar, x: &X<T>, u: &U<T>) -> Motion<T> {
    let (v, r, u_s) = (x.v, x.r, Scalar::max(u.u, T::from(p.u_min)));
    let alpha_f = (v + r * p.a) / u_s - u.delta[0];
    let alpha_r = (v - r * p.b) / u_s;
    let weight = p.m * p.g / (p.a + p.b);
    let f_f = lateral_force(p, p.c[0], weight * p.b, alpha_f, u.mu[0]);
    let f_r = lateral_force(p, p.c[1], weight * p.a, alpha_r, u.mu[0]);

    let a_y = (f_f + f_r) / p.m;
    let [xd, yd] = Rotation::by(x.psi).out_of_frame([u.u, v]);
    let rates = X {
        v: a_y - u.u * r,
        r: (f_f * p.a - f_r * p.b) / p.i_z,
        psi: r,
        x: xd,
        y: yd,
        phi: x.p,
        p: (a_y * (p.m_s * p.h_s) + x.phi * (p.m_s * p.g * p.h_s - p.k_phi) - x.p * p.d_phi) / p.i_x,
    };
    Motion { rates, u_s, a_y }
}

/// Lateral force, in N, of an axle with the cornering stiffness `c` in N/rad and the load at rest `f_z` in N.
#[inline]
fn lateral_force<T: Scalar>(p: &BicycleCar, c: f64, f_z: f64, alpha: T, mu: T) -> T {
    // Both laws depend on the same variables, so the model structure does not depend on this branch.
    if p.mu_0 == 0.0 {
        return -alpha * mu * c;
    }
    let mu = mu * p.mu_0;
    let linear = alpha * c / (Scalar::max(mu, T::from(LEAST_FRICTION)) * f_z);
    -mu * f_z * linear.tanh()
}

pub(crate) fn derivatives<T: Scalar>(p: &BicycleCar, x: &X<T>, u: &U<T>) -> X<T> {
    motion(p, x, u).rates
}

pub(crate) fn outputs<T: Scalar>(p: &BicycleCar, x: &X<T>, u: &U<T>) -> Y<T> {
    let Motion { rates, u_s, a_y } = motion(p, x, u);
    let ratio = a_y * (2.0 * p.h / (p.g * p.track));
    Y { u: u.u, beta: x.v.atan2(u_s), rd: rates.r, a_y, ratio: Scalar::clamp(ratio, T::from(-1.0), T::from(1.0)) }
}
