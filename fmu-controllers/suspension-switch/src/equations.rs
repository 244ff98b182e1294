//! One sample of the switch (eq. 8 with hysteresis and blending).
//!
//! | symbol | meaning |
//! |---|---|
//! | LTR, Q | load transfer ratio (estimate), its threshold |
//! | f_c, f_h | forces that the comfort and the handling law propose |
//! | w | share of the handling law |
//! | h | sample time |

use chassis_control::limit;
use chassis_control::switch::hysteresis;
use chassis_vehicle::positions::Sides;

use crate::{Strategy, SuspensionSwitch, U, X, Y};

pub(crate) fn sample(p: &SuspensionSwitch, x: &mut X, u: &U) -> Y {
    let ltr = if p.magnitude { u.ltr.abs() } else { u.ltr };
    x.handling = match p.strategy {
        Strategy::Switched | Strategy::Passive => hysteresis(x.handling, ltr, p.q, p.width),
        Strategy::Comfort => false,
        Strategy::Handling => true,
    };
    let mode = if x.handling { 1.0 } else { 0.0 };
    x.w = if p.blend_time > 0.0 { limit::rate(mode, x.w, 1.0 / p.blend_time, p.sample_time) } else { mode };
    let w = x.w;
    let f = match p.strategy {
        Strategy::Passive => Sides([0.0; 2]),
        _ => Sides::from_fn(|i| (1.0 - w) * u.f_c[i] + w * u.f_h[i]),
    };
    Y { f, mode: i32::from(x.handling), w }
}
