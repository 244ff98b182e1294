//! A first-order lag with a limited rate behind a limited command.
//!
//! | symbol | meaning |
//! |---|---|
//! | u, x | command, value of the actuator |
//! | T, r | time constant, greatest rate |
//! | x_min, x_max | range |
//! | h, h_r | step, and the part of it at the greatest rate |

use fmu::Scalar;

use crate::Actuator;

pub(crate) fn check(p: &Actuator) -> Result<(), String> {
    if p.x_min <= p.x_max {
        return Ok(());
    }
    Err(format!("'actuator.minimum' = {} must not exceed 'actuator.maximum' = {}", p.x_min, p.x_max))
}

/// A value within the range.
pub(crate) fn within<T: Scalar>(p: &Actuator, value: T) -> T {
    Scalar::clamp(value, T::from(p.x_min), T::from(p.x_max))
}

/// x'
pub(crate) fn rate<T: Scalar>(p: &Actuator, x: T, u: T) -> T {
    Scalar::clamp((within(p, u) - x) / p.t, T::from(-p.r), T::from(p.r))
}

/// The solution after `h` for a held command: at the greatest rate until the error is r T, then the lag.
pub(crate) fn advance(p: &Actuator, x: f64, u: f64, h: f64) -> f64 {
    let target = within(p, u);
    let e = target - x;
    let h_r = (e.abs() / p.r - p.t).max(0.0);
    if h <= h_r {
        return x + (p.r * h).copysign(e);
    }
    target - e.abs().min(p.r * p.t).copysign(e) * fmu::math::exp((h_r - h) / p.t)
}
