//! One sample of yaw control: references, sliding mode, brake pressures. Equation numbers refer to the paper; the
//! README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | delta | steering angle demanded by the driver |
//! | u, beta, r | speed (u_e: with a lower limit, for divisions), sideslip angle, yaw rate |
//! | K_f, K_r | cornering stiffness of the axles (both tires), positive |
//! | K | stability factor |
//! | r_ss, r_d, rd_d | yaw rate of the steady turn, the lagged reference, and the rate of the reference; the same for beta |
//! | beta_n, r_n | rates of sideslip and yaw rate without yaw moment, from the linear model |
//! | sigma, c | sliding surface (r - r_d) + c (beta - beta_d) |
//! | dM | demanded yaw moment, positive to the left |
//! | F_d | brake force of each wheel on one side |
//! | T | sample time |

use chassis_control::limit::{lag, magnitude};
use chassis_control::sliding_mode::reaching_law;
use chassis_vehicle::positions::{FourWheels, axle_of, left_is_positive};

use crate::{D, DirectYawControl, U, X, Y};

/// Stability factor and slope of the sliding surface.
pub(crate) fn derived(p: &DirectYawControl) -> Result<D, String> {
    if p.s2 == 0.0 {
        return Err(
            "'surface.weight.yaw_rate' must not be 0: the yaw moment acts on the yaw rate, so the surface must depend \
             on it"
                .to_owned(),
        );
    }
    let [k_f, k_r] = *p.k;
    let wheelbase = p.a + p.b;
    Ok(D { stability: p.m * (p.b * k_r - p.a * k_f) / (wheelbase * wheelbase * k_f * k_r), c: p.s1 / p.s2 })
}

pub(crate) fn sample(p: &DirectYawControl, d: &D, x: &mut X, inputs: &U) -> Y {
    let u_e = inputs.u.max(p.speed_min);
    let rates = update_references(p, d, x, inputs.delta, u_e);
    let dm = if inputs.enable && inputs.u > p.speed_min { yaw_moment(p, d, x, inputs, u_e, rates) } else { 0.0 };
    Y { dm, pressure: brake_pressures(p, dm), r_d: x.r_d, beta_d: x.beta_d }
}

/// Updates r_d and beta_d: first-order lags of the steady turn that the driver demands, within the friction limit.
/// Returns rd_d and betad_d.
fn update_references(p: &DirectYawControl, d: &D, x: &mut X, delta: f64, u_e: f64) -> [f64; 2] {
    let (m, a, b, t) = (p.m, p.a, p.b, p.sample_time);
    let [_, k_r] = *p.k;
    let wheelbase = a + b;
    // An oversteering vehicle has a critical speed. The lower limit keeps the turn finite at and above this speed.
    let den = wheelbase * (1.0 + d.stability * u_e * u_e).max(0.05);
    let r_ss = magnitude(u_e * delta / den, 0.85 * p.mu * p.g / u_e);
    let beta_ss =
        magnitude((b - a * m * u_e * u_e / (k_r * wheelbase)) * delta / den, fmu::math::atan(0.02 * p.mu * p.g));
    x.r_d = lag(x.r_d, r_ss, p.tau, t);
    x.beta_d = lag(x.beta_d, beta_ss, p.tau, t);
    [(r_ss - x.r_d) / p.tau, (beta_ss - x.beta_d) / p.tau]
}

/// dM: the moment that brings the motion to the surface (eq. 20), from the rates without yaw moment (eqs. 9, 10, 19).
fn yaw_moment(p: &DirectYawControl, d: &D, x: &X, inputs: &U, u_e: f64, [rd_d, betad_d]: [f64; 2]) -> f64 {
    let U { delta, beta, r, .. } = *inputs;
    let (m, i_z, a, b) = (p.m, p.i_z, p.a, p.b);
    let [k_f, k_r] = *p.k;
    let beta_n =
        -(k_f + k_r) / (m * u_e) * beta + ((b * k_r - a * k_f) / (m * u_e * u_e) - 1.0) * r + k_f / (m * u_e) * delta;
    let r_n = (b * k_r - a * k_f) / i_z * beta - (a * a * k_f + b * b * k_r) / (i_z * u_e) * r + a * k_f / i_z * delta;
    let sigma = (r - x.r_d) + d.c * (beta - x.beta_d);
    let sigma_d = reaching_law(sigma, p.k_s, p.eta, p.layer);
    magnitude(i_z * (sigma_d - d.c * (beta_n - betad_d) - (r_n - rd_d)), p.moment_max)
}

/// Both wheels of the inner side brake with the same force (eqs. 21, 22).
fn brake_pressures(p: &DirectYawControl, dm: f64) -> FourWheels<f64> {
    let f_d = if dm.abs() <= p.deadband { 0.0 } else { dm.abs() / p.track };
    FourWheels::from_fn(|i| {
        let is_braked = dm * left_is_positive(i) > 0.0;
        let megapascal = p.radius * f_d / p.gain[axle_of(i)] * 1e-6;
        if is_braked { megapascal.min(p.pressure_max) } else { 0.0 }
    })
}
