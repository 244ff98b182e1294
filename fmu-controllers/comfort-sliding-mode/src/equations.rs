//! The sliding mode of a quarter car (eqs. 15-23).
//!
//! | symbol | meaning |
//! |---|---|
//! | x1, x2 | height of the left wheel, heave of the body |
//! | x3, x4 | their rates |
//! | n1, n2, n3 | weights of x1, x2, x3 in the surface S; that of x4 is 1 |
//! | e | force of spring and damper on the body |
//! | NA, NB | rate of S without force, and per force |
//! | mu, eta | switching gain and linear reaching rate |
//! | f | force of a side; zeta is right over left |

use chassis_control::limit;
use chassis_control::sliding_mode::reaching_law;
use chassis_vehicle::positions::Sides;
use chassis_vehicle::suspension::spring_damper;

use crate::{ComfortSlidingMode, U, Y};

/// Rate of the surface per force of the left actuator, 1/kg.
fn surface_rate_per_force(p: &ComfortSlidingMode) -> f64 {
    1.0 / p.m_s - p.n3 / p.m_u
}

/// The force has to move the surface. The weight is tunable, so every sample looks at it.
pub(crate) fn check(p: &ComfortSlidingMode) -> Result<(), String> {
    let singular = p.m_u / p.m_s;
    // Within a few roundings of the weight at which body and wheel motion cancel in the surface.
    if (surface_rate_per_force(p) * p.m_s).abs() > 1e-9 {
        return Ok(());
    }
    Err(format!(
        "'surface.weight.wheel_velocity' must differ from 'wheel.mass.side'/'body.mass' = {singular}, got {}: no force \
         moves the surface",
        p.n3
    ))
}

pub(crate) fn forces(p: &ComfortSlidingMode, u: &U) -> Y {
    let ([x1], x2, [x3], x4) = (*u.x1, u.x2, *u.x3, u.x4);
    let s = p.n1 * x1 + p.n2 * x2 + p.n3 * x3 + x4;
    let e = spring_damper(p.k_s, p.c_s, x2 - x1, x4 - x3);
    let na = p.n1 * x3 + p.n2 * x4 + p.n3 * (-p.k_t * x1 - e) / p.m_u + e / p.m_s;
    let nb = surface_rate_per_force(p);
    let f_l = (reaching_law(s, p.eta, p.mu, p.width) - na) / nb;
    let f_l = limit::magnitude(f_l, limit::positive_or_none(p.limit));
    Y { f: Sides([f_l, p.zeta * f_l]), s }
}
