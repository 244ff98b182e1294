//! The sliding mode of roll (eqs. 9-14, derived again with T as the full track and opposite forces).
//!
//! | symbol | meaning |
//! |---|---|
//! | phi, phid | roll angle and rate |
//! | s, rho | sliding surface phid + rho phi |
//! | d_s, dd_s | suspension deflection of a side and its rate |
//! | F | force of spring and damper of a side, pushing the body up |
//! | a_y | lateral acceleration |
//! | mu + kap | switching gain; kap grows with the magnitudes of phi (kappa1) and phid (kappa2) |
//! | eta | linear reaching rate |
//! | f | actuator force of a side |

use chassis_control::limit;
use chassis_control::sliding_mode::reaching_law;
use chassis_vehicle::positions::Sides;
use chassis_vehicle::suspension::spring_damper;

use crate::{HandlingSlidingMode, U, Y};

pub(crate) fn forces(p: &HandlingSlidingMode, u: &U) -> Y {
    let U { phi, phid, a_y, .. } = *u;
    let s = p.rho * phi + phid;
    let f: [f64; 2] = std::array::from_fn(|i| spring_damper(p.k_s, p.cancellation * p.c_s, u.d_s[i], u.dd_s[i]));
    let kap = p.kappa1 * phi.abs() + p.kappa2 * phid.abs();
    // The roll acceleration that brings s to 0, and the moments that act without the actuators.
    let wanted = reaching_law(s, p.eta, p.mu + kap, p.width) - p.rho * phid;
    let passive = p.t / 2.0 * (f[0] - f[1]) + p.m_s * p.h * (a_y + p.g * fmu::math::sin(phi));
    let f_l = limit::magnitude((p.i_x * wanted - passive) / p.t, limit::positive_or_none(p.limit));
    Y { f: Sides([f_l, -f_l]), s }
}
