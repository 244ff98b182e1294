//! Equations of motion, in the order of computation: deflections, tires, lateral motion, vertical motion. The numbers
//! are those of the paper; corrections are listed in the README.
//!
//! | symbol | meaning |
//! |---|---|
//! | z_s, phi | heave and roll of the sprung mass |
//! | z_u, z_q | height of the unsprung mass of a side and of the road under it |
//! | T, arm | track and its half |
//! | d, e | deflection of suspension and tires (compression negative) |
//! | F, f | force of spring and damper, of the actuator (both push the body up) |
//! | N, N_0 | load of the tires of a side, and at rest |
//! | M | moment of suspension and weight about the roll axis |
//! | G | lateral force through the roll center, as a vertical force on the left wheels (opposite on the right) |
//! | h, h_r | center of mass over the roll axis, roll center over ground |
//! | v | speed; v_e is v with a floor, for divisions; q fades the tire forces out below the floor |
//! | beta, gamma, psi | sideslip angle, yaw rate, heading |
//! | delta, alpha, F_y | steering angle, slip angle of an axle, lateral force of a tire |
//! | a_y, LTR | lateral acceleration, load transfer ratio estimated from it |
//! | c | share of the roll acceleration in the lateral motion (`model.roll_lateral_coupling`) |
//!
//! One more d at the end of a name is one more derivative with respect to time: phid, phidd.

use chassis_vehicle::positions::{FourWheels, Sides, TwoAxles, axle_of, left_is_positive};
use chassis_vehicle::suspension::{load_transfer_ratio, spring_damper, tire_load};
use chassis_vehicle::tire::MagicFormula;
use fmu::Scalar;

use crate::{D, HydroPneumaticHalfCar, U, X, Y};

/// Floor of the speed where it divides, m/s; below it the tire forces fade out.
const FLOOR: f64 = 1.0;
/// Rate at which sideslip and yaw rate decay at standstill, 1/s.
const DECAY: f64 = 10.0;

/// Mass and loads at rest.
pub(crate) fn derived(p: &HydroPneumaticHalfCar) -> Result<D, String> {
    let m = p.m_s + 2.0 * p.m_u;
    let least = p.c * (p.m_s * p.h).powi(2) / m;
    if p.i_x <= least {
        return Err(format!(
            "'body.roll_axis_inertia' must be more than {least:.1} kg.m2, got {} kg.m2: the masses, \
             'geometry.body_cg_to_roll_axis' and 'model.roll_lateral_coupling' need it",
            p.i_x
        ));
    }
    let share = [p.l_r, p.l_f].map(|lever| lever / (p.l_f + p.l_r));
    Ok(D {
        m,
        n0: (p.m_s / 2.0 + p.m_u) * p.g,
        share: std::array::from_fn(|i| share[axle_of(i)]),
        per_t: 1.0 / p.t,
        per_m_s: 1.0 / p.m_s,
        per_m_u: 1.0 / p.m_u,
        per_i_x: 1.0 / p.i_x,
        per_i_z: 1.0 / p.i_z,
        per_m_y: 1.0 / (m - p.c * (p.m_s * p.h) * (p.m_s * p.h) / p.i_x),
    })
}

/// Everything that follows from state and inputs.
struct Motion<T> {
    /// Derivatives of the state.
    rates: X<T>,
    sin_phi: T,
    cos_phi: T,
    d: Sides<T>,
    dd: Sides<T>,
    e: Sides<T>,
    n: Sides<T>,
    alpha: TwoAxles<T>,
    f_y: FourWheels<T>,
    a_y: T,
}

#[inline]
fn motion<T: Scalar>(p: &HydroPneumaticHalfCar, s: &D, x: &X<T>, u: &U<T>) -> Motion<T> {
    let arm = |i| p.t / 2.0 * left_is_positive(i);
    let ([sin_phi, sin_psi], [cos_phi, cos_psi]) = T::sin_cos_each([x.phi, x.psi]);

    // Suspension (eq. 4, corrected).
    let d = Sides::from_fn(|i| x.z_s + x.phi * arm(i) - x.z_u[i]);
    let dd = Sides::from_fn(|i| x.zd_s + x.phid * arm(i) - x.zd_u[i]);
    let push = Sides::<T>::from_fn(|i| spring_damper(p.k_s, p.c_s, d[i], dd[i]) + u.f[i]); // F + f

    // Tires: a side's load is shared by its front and rear tire as at rest.
    let e = Sides::from_fn(|i| x.z_u[i] - u.z_q[i]);
    let n = Sides::from_fn(|i| tire_load(s.n0, p.k_t, e[i], p.lift_off));
    let per_v_e = T::from(1.0) / Scalar::max(u.v, T::from(FLOOR));
    let q = Scalar::clamp(u.v / FLOOR, T::from(0.0), T::from(1.0));
    let alpha = TwoAxles([x.beta + x.gamma * p.l_f * per_v_e - u.delta[0], x.beta - x.gamma * p.l_r * per_v_e]);
    let force = MagicFormula::PASSENGER_CAR.lateral_each(
        std::array::from_fn(|i| u.friction[i % 2] * p.mu),
        std::array::from_fn(|i| n[i % 2] * s.share[i]),
        std::array::from_fn(|i| alpha[axle_of(i)]),
    );
    let f_y = FourWheels(force.map(|force| q * force));

    // Lateral and yaw motion (eqs. 2 and 3, corrected); with c = 1 sway and roll are one system of two equations:
    // m a_y - m_s h phidd = F_f + F_r,  I_x phidd = M + m_s h a_y.
    let m_sh = p.m_s * p.h;
    let moment = (push[0] - push[1]) * (p.t / 2.0) + sin_phi * (m_sh * p.g);
    let (f_front, f_rear) = (f_y[0] + f_y[1], f_y[2] + f_y[3]);
    let a_y = (f_front + f_rear + moment * (p.c * m_sh * s.per_i_x)) * s.per_m_y;
    let fade = |rate: T, value: T| q * rate - (-q + 1.0) * value * DECAY;
    let betad = fade(a_y * per_v_e - x.gamma, x.beta);
    let gammad = fade((f_front * p.l_f - f_rear * p.l_r) * s.per_i_z, x.gamma);

    // Vertical and roll motion (eqs. 1, 4, 5 and 9, corrected).
    let zdd_s = (push[0] + push[1]) * s.per_m_s;
    let phidd = (moment + a_y * m_sh) * s.per_i_x;
    let g = (a_y - phidd * (p.c * p.h)) * (p.geometric * p.m_s * p.h_r * s.per_t);
    let zdd_u = Sides::from_fn(|i| (n[i] - s.n0 - push[i] + g * left_is_positive(i)) * s.per_m_u);

    let lateral = u.v * x.beta; // lateral velocity: sideslip is a small angle
    let rates = X {
        z_s: x.zd_s,
        phi: x.phid,
        z_u: x.zd_u,
        zd_s: zdd_s,
        phid: phidd,
        zd_u: zdd_u,
        beta: betad,
        gamma: gammad,
        psi: x.gamma,
        x: u.v * cos_psi - lateral * sin_psi,
        y: u.v * sin_psi + lateral * cos_psi,
    };
    Motion { rates, sin_phi, cos_phi, d, dd, e, n, alpha, f_y, a_y }
}

pub(crate) fn derivatives<T: Scalar>(p: &HydroPneumaticHalfCar, s: &D, x: &X<T>, u: &U<T>) -> X<T> {
    motion(p, s, x, u).rates
}

pub(crate) fn outputs<T: Scalar>(p: &HydroPneumaticHalfCar, s: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let m = motion(p, s, x, u);
    // Moment balance about the ground (eq. 7).
    let lever = m.cos_phi * p.h + p.h_r;
    let ltr = (lever * m.a_y / p.g + m.sin_phi * p.h) * (2.0 * p.m_s / (s.m * p.t));
    Y {
        v: u.v,
        gammad: m.rates.gamma,
        a_y: m.a_y,
        ltr,
        ratio: load_transfer_ratio(m.n[0], m.n[1]),
        zdd_s: m.rates.zd_s,
        phidd: m.rates.phid,
        d: m.d,
        dd: m.dd,
        e: m.e,
        n: m.n,
        alpha: m.alpha,
        f_y: m.f_y,
    }
}
