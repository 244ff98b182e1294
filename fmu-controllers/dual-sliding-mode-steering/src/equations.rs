//! One sample of the steering law, in the order of computation: front axle and reference, sliding modes, limits.
//! Equation numbers refer to the paper; the README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | beta, r, u | sideslip angle, yaw rate, speed |
//! | df, dm, dr | angles of the front, middle and rear axle |
//! | a, -b, -c | positions of the axles relative to the center of mass, positive forward |
//! | C_F, C_M, C_R | cornering stiffness of the axles (two tires each), positive |
//! | W_F | load of the front axle at rest |
//! | r_d, rd_d | yaw rate reference, and its rate; the sideslip reference is 0 |
//! | e, I | errors of sideslip (e_b) and yaw rate (e_r), and their integrals |
//! | S | sliding surfaces of sideslip (S_b) and yaw rate (S_r) |
//! | g | cornering stiffness times slip angle of an axle, with the middle and rear axles straight |
//! | n_b, n_r | lateral force and yaw moment that the steering of the middle and rear axles has to produce |
//! | T | sample time |

use chassis_control::front_steering::{Limits, ReferenceModel, Sample, Vehicle};
use chassis_control::limit;
use chassis_control::sliding_mode::{integral_surface, reaching_law};
use chassis_vehicle::positions::{RearAxles, ThreeAxles};
use fmu::math;

use crate::{D, DualSlidingModeSteering, SlipAngleModel, U, X, Y};

/// Positions, axle stiffnesses and the load of the front axle.
pub(crate) fn derived(p: &DualSlidingModeSteering) -> Result<D, String> {
    let vehicle = Vehicle::new(p.m, p.g, [p.a, p.l12, p.l23], *p.c_tire)?;
    Ok(D { vehicle, w_f: vehicle.w_f })
}

/// Limits of the front axle.
pub(crate) fn front_limits(p: &DualSlidingModeSteering) -> Limits {
    Limits { model: p.reference_model, ay_limit: p.ay_limit, angle: p.front_limit, rate: p.front_rate }
}

pub(crate) fn sample(p: &DualSlidingModeSteering, d: &D, x: &mut X, inputs: &U) -> Y {
    let t = p.sample_time;
    let u = inputs.u.max(p.u_min);

    // Front axle and reference.
    let Sample { gain, r_max, df } = front_limits(p).sample(&d.vehicle, inputs.steer, u, x.df, t);
    let steady = match p.reference_model {
        ReferenceModel::ZeroSideslip => gain * math::tan(df),
        ReferenceModel::TwoDegreesOfFreedom => gain * df,
    };
    let target = limit::magnitude(steady, r_max);
    let r_d = x.r_d;
    let rd_d = (target - r_d) / p.tau;

    let is_on = inputs.k3 > 0.5;
    let (e_b, e_r) = (inputs.beta, inputs.r - r_d);
    let Modes { s_b, s_r, dm, dr } =
        if is_on { sliding_modes(p, d, x, inputs, [u, df, rd_d], [e_b, e_r]) } else { Modes::default() };

    // Limits; the integrals are frozen while an axle is at its angle limit (anti-windup).
    let is_free = dm.abs() <= p.limit && dr.abs() <= p.limit;
    let limited = |angle, last| limit::rate(limit::magnitude(angle, p.limit), last, p.rate, t);
    (x.df, x.dm, x.dr) = (df, limited(dm, x.dm), limited(dr, x.dr));
    if !is_on {
        (x.i_b, x.i_r) = (0.0, 0.0);
    } else if is_free {
        x.i_b += t * e_b;
        x.i_r += t * e_r;
    }
    x.r_d = limit::lag(r_d, target, p.tau, t);
    Y { delta: ThreeAxles([x.df, x.dm, x.dr]), s_b, s_r, r_d, request: RearAxles([dm, dr]) }
}

/// Surfaces, and the angles of the middle and rear axles that drive them to zero.
#[derive(Default)]
struct Modes {
    s_b: f64,
    s_r: f64,
    dm: f64,
    dr: f64,
}

/// Surfaces (eqs. 19, 20), reaching laws (eqs. 23, 24), their force and moment (eqs. 25, 26), angles (eqs. 16, 31).
fn sliding_modes(
    p: &DualSlidingModeSteering,
    d: &D,
    x: &X,
    &U { beta, r, .. }: &U,
    [u, df, rd_d]: [f64; 3],
    [e_b, e_r]: [f64; 2],
) -> Modes {
    let Vehicle { a, b, c, c_axle: [c_f, c_m, c_r], .. } = d.vehicle;
    let s_b = integral_surface(e_b, x.i_b, p.zeta[0]);
    let s_r = integral_surface(e_r, x.i_r, p.zeta[1]);
    let slip = |lever: f64| match p.slip_angle_model {
        SlipAngleModel::Arctangent => math::atan(math::tan(beta) + lever * r / u),
        SlipAngleModel::SmallAngle => beta + lever * r / u,
    };
    let (g_f, g_m, g_r) = (c_f * (slip(a) - df), c_m * slip(-b), c_r * slip(-c));
    let reach_b = -p.zeta[0] * e_b + reaching_law(s_b, p.k[0], p.eps_b, p.width_b);
    let reach_r = rd_d - p.zeta[1] * e_r + reaching_law(s_r, p.k[1], p.eps_r, p.width_r);
    let n_b = g_f + g_m + g_r + p.m * u * r + p.m * u * reach_b;
    let n_r = a * g_f - b * g_m - c * g_r + p.i_z * reach_r;
    // n_b = C_M dm + C_R dr, n_r = -b C_M dm - c C_R dr
    Modes { s_b, s_r, dm: (n_r + c * n_b) / ((c - b) * c_m), dr: -(n_r + b * n_b) / ((c - b) * c_r) }
}
