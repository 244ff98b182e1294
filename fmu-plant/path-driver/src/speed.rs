//! Speed: the driver's reference, and the pedals that keep it.
//!
//! | symbol | meaning |
//! |---|---|
//! | t, T | time since the start, sample time |
//! | v, v_ref | speed of the vehicle, not negative, and its reference |
//! | a_x | demanded acceleration |
//! | k_pv, k_iv | acceleration per speed error, and per integral of the speed error |
//! | z | integral of the speed error times k_iv |

use crate::steering::SLACK;
use crate::{PathDriver, X};

/// `clamp((t - start)/rise_time, 0, 1)`; with `rise_time = 0` a step (all in s).
fn ramp(t: f64, start: f64, rise_time: f64) -> f64 {
    if rise_time > 0.0 { ((t - start) / rise_time).clamp(0.0, 1.0) } else { f64::from(u8::from(t >= start - SLACK)) }
}

/// v_ref at the time `t` in s.
pub(crate) fn reference(p: &PathDriver, t: f64) -> f64 {
    p.v_0 + (p.v_1 - p.v_0) * ramp(t, p.t_v, p.d_v)
}

/// One sample of the pedals, throttle and brake, at the station `s` in m.
pub(crate) fn pedals(p: &PathDriver, x: &mut X, v: f64, s: f64, t: f64) -> [f64; 2] {
    x.released |= p.release >= 0.0 && s >= p.release;
    if t >= p.t_brake - SLACK {
        return [0.0, p.brake * ramp(t, p.t_brake, p.d_brake)];
    }
    if x.released || !p.speed_control {
        return [0.0; 2];
    }
    let rises = t >= p.t_v && t < p.t_v + p.d_v;
    let feedforward = if rises { (p.v_1 - p.v_0) / p.d_v } else { 0.0 };
    let error = reference(p, t) - v;
    let a_x = feedforward + p.k_pv * error + x.z;
    let saturated = a_x.clamp(-p.a_brake, p.a_throttle);
    // Anti-windup: while a pedal is saturated, the integral only changes in the direction that ends the saturation.
    if a_x == saturated || error * a_x < 0.0 {
        x.z += p.k_iv * error * p.sample_time;
    }
    if saturated > 0.0 {
        [saturated / p.a_throttle, 0.0]
    } else if saturated < -p.deadband {
        [0.0, -saturated / p.a_brake]
    } else {
        [0.0; 2]
    }
}
