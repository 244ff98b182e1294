//! Equations of motion, in the order of computation: deflections, tires, lateral motion, vertical motion. Equation
//! numbers refer to the paper; the README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | z_s, phi | heave and roll of the sprung mass |
//! | z_u, z_q | height of the unsprung mass of a side and of the road under it |
//! | T | track |
//! | d_s, d_t | deflection of suspension and tires (compression negative) |
//! | F, f | force of spring and damper, of the actuator (both push the body up) |
//! | N, N_0 | tire load of a side, tire load at rest |
//! | M | moment of suspension and weight about the roll axis |
//! | G | lateral force through the roll center, as a vertical force on the left wheels (opposite on the right) |
//! | h, h_r | center of mass over the roll axis, roll center over ground |
//! | v, v_e | speed; speed limited to 1 m/s, for divisions |
//! | q | factor that fades the tire forces out below 1 m/s |
//! | beta, gamma, psi | sideslip angle, yaw rate, heading |
//! | delta, alpha, F_y | steering angle, slip angle of an axle, lateral force of a tire |
//! | F_f, F_r | lateral force of the front and the rear axle |
//! | a_y, LTR | lateral acceleration, load transfer ratio estimated from it |
//! | c | share of the roll acceleration in the lateral motion (`model.roll_lateral_coupling`) |
//!
//! Each d added to a symbol, before its index, is a derivative with respect to time: phid, zdd_u, dd_s.

use chassis_vehicle::arithmetic::{Divisor, Over, Rotation};
use chassis_vehicle::positions::{FourWheels, Sides, TwoAxles, axle_of, left_is_positive};
use chassis_vehicle::suspension::{load_transfer_ratio, spring_damper, tire_load};
use chassis_vehicle::tire::MagicFormula;
use fmu::Scalar;

use crate::{D, HydroPneumaticHalfCar, U, X, Y};

/// Lower limit of the speed in divisions, m/s; below it the tire forces fade out.
const FLOOR: f64 = 1.0;
/// Rate at which sideslip and yaw rate decay at standstill, 1/s.
const DECAY: f64 = 10.0;

/// Mass and loads at rest.
pub(crate) fn derived(p: &HydroPneumaticHalfCar) -> Result<D, String> {
    let m = p.m_s + 2.0 * p.m_u;
    let least = p.c * (p.m_s * p.h).powi(2) / m;
    if p.i_x <= least {
        return Err(format!(
            "'body.roll_axis_inertia' must be more than {least:.1} kg.m2, got {} kg.m2: the limit follows from the \
             masses, 'geometry.body_cg_to_roll_axis' and 'model.roll_lateral_coupling'",
            p.i_x
        ));
    }
    let share = [p.l_r, p.l_f].map(|lever| lever / (p.l_f + p.l_r));
    Ok(D {
        m,
        n0: (p.m_s / 2.0 + p.m_u) * p.g,
        share: std::array::from_fn(|i| share[axle_of(i)]),
        t: Divisor::new(p.t),
        m_s: Divisor::new(p.m_s),
        m_u: Divisor::new(p.m_u),
        i_x: Divisor::new(p.i_x),
        i_z: Divisor::new(p.i_z),
        m_y: Divisor::new(m - p.c * (p.m_s * p.h) * (p.m_s * p.h) / p.i_x),
    })
}

/// Values that derivatives and outputs share.
struct Motion<T> {
    /// Derivatives of the state.
    rates: X<T>,
    roll: Rotation<T>,
    suspension: Suspension<T>,
    tires: Tires<T>,
    a_y: T,
}

#[inline]
fn motion<T: Scalar>(p: &HydroPneumaticHalfCar, d: &D, x: &X<T>, u: &U<T>) -> Motion<T> {
    let [roll, heading] = Rotation::by_each([x.phi, x.psi]);
    let suspension = suspension(p, d, x, u);
    let per_v_e = T::from(1.0) / Scalar::max(u.v, T::from(FLOOR));
    let q = Scalar::clamp(u.v / FLOOR, T::from(0.0), T::from(1.0));
    let tires = tires(p, d, x, u, &suspension.n, [per_v_e, q]);
    let moment = roll_moment(p, &suspension, &roll);
    let Lateral { a_y, betad, gammad } = lateral_motion(p, d, x, &tires.f_y, moment, [per_v_e, q]);
    let Vertical { zdd_s, phidd, zdd_u } = vertical_motion(p, d, &suspension, moment, a_y);

    // Sideslip is a small angle.
    let [xd, yd] = heading.out_of_frame([u.v, u.v * x.beta]);
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
        x: xd,
        y: yd,
    };
    Motion { rates, roll, suspension, tires, a_y }
}

struct Suspension<T> {
    d_s: Sides<T>,
    dd_s: Sides<T>,
    /// F + f
    push: Sides<T>,
    d_t: Sides<T>,
    n: Sides<T>,
}

/// Eq. 4, corrected.
#[inline]
fn suspension<T: Scalar>(p: &HydroPneumaticHalfCar, d: &D, x: &X<T>, u: &U<T>) -> Suspension<T> {
    let y = |i| p.t / 2.0 * left_is_positive(i);
    let d_s = Sides::from_fn(|i| x.z_s + x.phi * y(i) - x.z_u[i]);
    let dd_s = Sides::from_fn(|i| x.zd_s + x.phid * y(i) - x.zd_u[i]);
    let push = Sides::from_fn(|i| spring_damper(p.k_s, p.c_s, d_s[i], dd_s[i]) + u.f[i]);
    let d_t = Sides::from_fn(|i| x.z_u[i] - u.z_q[i]);
    let n = Sides::from_fn(|i| tire_load(d.n0, p.k_t, d_t[i], p.lift_off));
    Suspension { d_s, dd_s, push, d_t, n }
}

struct Tires<T> {
    alpha: TwoAxles<T>,
    f_y: FourWheels<T>,
}

/// The front and the rear tire of a side share its load in the ratio at rest.
#[inline]
fn tires<T: Scalar>(
    p: &HydroPneumaticHalfCar,
    d: &D,
    x: &X<T>,
    u: &U<T>,
    n: &Sides<T>,
    [per_v_e, q]: [T; 2],
) -> Tires<T> {
    let alpha = TwoAxles([x.beta + x.gamma * p.l_f * per_v_e - u.delta[0], x.beta - x.gamma * p.l_r * per_v_e]);
    let force = MagicFormula::PASSENGER_CAR.lateral_each(
        std::array::from_fn(|i| u.friction[i % 2] * p.mu),
        std::array::from_fn(|i| n[i % 2] * d.share[i]),
        std::array::from_fn(|i| alpha[axle_of(i)]),
    );
    let f_y = FourWheels(force.map(|force| q * force));
    Tires { alpha, f_y }
}

/// M in eqs. 1 and 9, corrected.
#[inline]
fn roll_moment<T: Scalar>(p: &HydroPneumaticHalfCar, Suspension { push, .. }: &Suspension<T>, roll: &Rotation<T>) -> T {
    (push[0] - push[1]) * (p.t / 2.0) + roll.sin * (p.m_s * p.h * p.g)
}

struct Lateral<T> {
    a_y: T,
    betad: T,
    gammad: T,
}

/// Eqs. 2 and 3, corrected. With c = 1, sway and roll are coupled: m a_y - m_s h phidd = F_f + F_r,
/// I_x phidd = M + m_s h a_y.
#[inline]
fn lateral_motion<T: Scalar>(
    p: &HydroPneumaticHalfCar,
    d: &D,
    x: &X<T>,
    f_y: &FourWheels<T>,
    moment: T,
    [per_v_e, q]: [T; 2],
) -> Lateral<T> {
    let (f_f, f_r) = (f_y[0] + f_y[1], f_y[2] + f_y[3]);
    let a_y = (f_f + f_r + moment * (p.c * (p.m_s * p.h)).over(d.i_x)).over(d.m_y);
    let fade = |rate: T, value: T| q * rate - (-q + 1.0) * value * DECAY;
    Lateral {
        a_y,
        betad: fade(a_y * per_v_e - x.gamma, x.beta),
        gammad: fade((f_f * p.l_f - f_r * p.l_r).over(d.i_z), x.gamma),
    }
}

struct Vertical<T> {
    zdd_s: T,
    phidd: T,
    zdd_u: Sides<T>,
}

/// Eqs. 1, 4, 5 and 9, corrected.
#[inline]
fn vertical_motion<T: Scalar>(
    p: &HydroPneumaticHalfCar,
    d: &D,
    Suspension { push, n, .. }: &Suspension<T>,
    moment: T,
    a_y: T,
) -> Vertical<T> {
    let phidd = (moment + a_y * (p.m_s * p.h)).over(d.i_x);
    let g = (a_y - phidd * (p.c * p.h)) * (p.geometric * p.m_s * p.h_r).over(d.t);
    Vertical {
        zdd_s: (push[0] + push[1]).over(d.m_s),
        phidd,
        zdd_u: Sides::from_fn(|i| (n[i] - d.n0 - push[i] + g * left_is_positive(i)).over(d.m_u)),
    }
}

pub(crate) fn derivatives<T: Scalar>(p: &HydroPneumaticHalfCar, d: &D, x: &X<T>, u: &U<T>) -> X<T> {
    motion(p, d, x, u).rates
}

pub(crate) fn outputs<T: Scalar>(p: &HydroPneumaticHalfCar, d: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let Motion { rates, roll, suspension, tires, a_y } = motion(p, d, x, u);
    // Moment balance about the ground (eq. 7).
    let lever = roll.cos * p.h + p.h_r;
    let ltr = (lever * a_y / p.g + roll.sin * p.h) * (2.0 * p.m_s / (d.m * p.t));
    Y {
        v: u.v,
        gammad: rates.gamma,
        a_y,
        ltr,
        ratio: load_transfer_ratio(suspension.n[0], suspension.n[1]),
        zdd_s: rates.zd_s,
        phidd: rates.phid,
        d_s: suspension.d_s,
        dd_s: suspension.dd_s,
        d_t: suspension.d_t,
        n: suspension.n,
        alpha: tires.alpha,
        f_y: tires.f_y,
    }
}
