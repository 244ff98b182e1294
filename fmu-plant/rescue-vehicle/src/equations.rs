//! Equations of motion, in the order of computation: deflections, tires, vertical motion, lateral motion. Equation
//! numbers refer to the paper; the README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | x, y | position of a wheel in front of and to the left of the center of mass |
//! | Z, theta, phi | heave, pitch, roll of the sprung mass |
//! | z_w, z_r | height of a wheel and of the road under it |
//! | d_s, d_t | deflection of suspension and tire (compression negative) |
//! | F_s, U | force of spring and damper (tension positive), of the actuator (pushes the body up) |
//! | q | force on the body, U - F_s |
//! | N, F_z0 | tire load, tire load at rest |
//! | delta, alpha, F_y | steering angle, slip angle and lateral force of a tire |
//! | u, v, r | longitudinal and lateral velocity, yaw rate |
//! | u_e | u, limited to the minimum speed, for divisions |
//! | psi | heading |
//!
//! Each d added to a symbol, before its index, is a derivative with respect to time: zd, zdd_w, dd_s.

use chassis_vehicle::arithmetic::{Divisor, Over, Rotation};
use chassis_vehicle::positions::{SixWheels, ThreeAxles, axle_of, left_is_positive};
use chassis_vehicle::suspension::{load_transfer_ratio, tire_load};
use chassis_vehicle::{statics, tire};
use fmu::Scalar;

use crate::{D, RescueVehicle, TireModel, U, X, Y};

/// Sprung mass, static loads, positions of the wheels and the mass matrix of the lateral motion.
pub(crate) fn derived(p: &RescueVehicle) -> Result<D, String> {
    let unsprung = 6.0 * p.m_w;
    if p.m <= unsprung {
        return Err(format!("'vehicle.mass' must be more than six times 'wheel.mass' ({unsprung} kg), got {} kg", p.m));
    }
    let m_s = p.m - unsprung;

    let axles = [p.a, p.a - p.l12, p.a - p.l12 - p.l23];
    let loads = statics::three_axle_loads(p.m, p.g, axles);
    if let Some(i) = loads.iter().position(|&load| load <= 0.0 && p.g > 0.0) {
        return Err(format!(
            "'geometry.cg_to_front_axle' = {} m puts the center of mass too far from the axles: the load on the {} at \
             rest would be {:.0} N",
            p.a,
            ThreeAxles::<f64>::ELEMENTS[i].description,
            loads[i]
        ));
    }

    // Mass matrix of (vd, phidd, rd): [[a, b, 0], [b, c, d], [0, d, e]].
    let (a, b, c) = (p.m, -m_s * p.h_s, p.i_x);
    let (d, e) = (-p.i_xz, p.i_z);
    let least = b * b / a + d * d / e;
    if c <= least {
        return Err(format!(
            "'body.roll_axis_inertia' must be more than {least:.0} kg.m2, got {} kg.m2: the limit follows from the \
             masses, 'geometry.body_cg_to_roll_axis' and 'body.product_of_inertia'",
            p.i_x
        ));
    }
    let determinant = a * (c * e - d * d) - b * b * e;
    let inverse = [[c * e - d * d, -b * e, b * d], [-b * e, a * e, -a * d], [b * d, -a * d, a * c - b * b]]
        .map(|row| row.map(|cofactor| cofactor / determinant));
    Ok(D {
        m_s,
        fz0: SixWheels::from_fn(|i| loads[axle_of(i)] / 2.0),
        x: std::array::from_fn(|i| axles[axle_of(i)]),
        y: std::array::from_fn(|i| p.b_t / 2.0 * left_is_positive(i)),
        inverse,
        c: std::array::from_fn(|i| p.c[axle_of(i)]),
        sprung_mass: Divisor::new(m_s),
        m_w: Divisor::new(p.m_w),
        i_y: Divisor::new(p.i_y),
    })
}

/// Values that derivatives and outputs share.
struct Motion<T> {
    heading: Rotation<T>,
    suspension: Suspension<T>,
    tires: Tires<T>,
    vertical: Vertical<T>,
    lateral: Lateral<T>,
}

#[inline]
fn motion<T: Scalar>(p: &RescueVehicle, d: &D, x: &X<T>, u: &U<T>) -> Motion<T> {
    let suspension = suspension(p, d, x, u);
    let directions = directions(p, d, x, u);
    let steering = Rotation::by_each(u.delta.0);
    let heading = Rotation::by(x.psi);
    let tires = tires(p, d, u, &suspension.n, directions);
    let vertical = vertical_motion(p, d, x, u, &suspension);
    let lateral = lateral_motion(p, d, x, u, &suspension.q, &tires.f_y, &steering);
    Motion { heading, suspension, tires, vertical, lateral }
}

struct Suspension<T> {
    d_s: SixWheels<T>,
    dd_s: SixWheels<T>,
    f_s: SixWheels<T>,
    q: SixWheels<T>,
    d_t: SixWheels<T>,
    n: SixWheels<T>,
}

/// Eq. 8, corrected: the left side rises with positive roll, the front sinks with positive pitch.
#[inline]
fn suspension<T: Scalar>(p: &RescueVehicle, d: &D, x: &X<T>, u: &U<T>) -> Suspension<T> {
    let d_s = SixWheels::from_fn(|i| x.z - x.theta * d.x[i] + x.phi * d.y[i] - x.z_w[i]);
    let dd_s = SixWheels::from_fn(|i| x.zd - x.thetad * d.x[i] + x.phid * d.y[i] - x.zd_w[i]);
    let f_s = SixWheels::<T>::from_fn(|i| d_s[i] * p.k_s + dd_s[i] * p.c_s);
    let q = SixWheels::<T>::from_fn(|i| u.f_u[i] - f_s[i]);
    let d_t = SixWheels::from_fn(|i| x.z_w[i] - u.z_r[i]);
    let n = SixWheels::from_fn(|i| tire_load(d.fz0[i], p.k_t, d_t[i], p.lift_off));
    Suspension { d_s, dd_s, f_s, q, d_t, n }
}

/// Directions of travel of the three axles and of the center of mass; the last one is the sideslip angle.
#[inline]
fn directions<T: Scalar>(p: &RescueVehicle, d: &D, x: &X<T>, u: &U<T>) -> [T; 4] {
    let u_e = Scalar::max(u.u, T::from(p.u_min));
    let v = |x_axle: f64| x.v + x.r * x_axle;
    T::atan2_each([v(d.x[0]), v(d.x[2]), v(d.x[4]), x.v], [u_e; 4])
}

struct Tires<T> {
    alpha: SixWheels<T>,
    f_y: SixWheels<T>,
    beta: T,
}

/// Eq. 7, or its saturating form.
#[inline]
fn tires<T: Scalar>(p: &RescueVehicle, d: &D, u: &U<T>, n: &SixWheels<T>, [axles @ .., beta]: [T; 4]) -> Tires<T> {
    let alpha = SixWheels::from_fn(|i| axles[axle_of(i)] - u.delta[axle_of(i)]);
    let f_y = match p.tire_model {
        TireModel::Linear => SixWheels::from_fn(|i| tire::linear(d.c[i], alpha[i])),
        TireModel::Saturating => {
            SixWheels(tire::saturating_each(d.c, std::array::from_fn(|i| n[i] * u.friction[i] * p.mu), alpha.0))
        }
    };
    Tires { alpha, f_y, beta }
}

struct Vertical<T> {
    zdd: T,
    thetadd: T,
    zdd_w: SixWheels<T>,
}

/// Eqs. 4-6, corrected.
#[inline]
fn vertical_motion<T: Scalar>(
    p: &RescueVehicle,
    d: &D,
    x: &X<T>,
    u: &U<T>,
    Suspension { f_s, q, n, .. }: &Suspension<T>,
) -> Vertical<T> {
    Vertical {
        zdd: SixWheels::sum_of(|i| q[i]).over(d.sprung_mass),
        thetadd: (-SixWheels::sum_of(|i| q[i] * d.x[i]) + x.theta * (d.m_s * p.g * p.h_s)).over(d.i_y),
        zdd_w: SixWheels::from_fn(|i| (f_s[i] - u.f_u[i] + (n[i] - d.fz0[i])).over(d.m_w)),
    }
}

struct Lateral<T> {
    vd: T,
    phidd: T,
    rd: T,
}

/// Eqs. 1-3: one symmetric linear system in (vd, phidd, rd).
#[inline]
fn lateral_motion<T: Scalar>(
    p: &RescueVehicle,
    d: &D,
    x: &X<T>,
    u: &U<T>,
    q: &SixWheels<T>,
    f_y: &SixWheels<T>,
    steering: &[Rotation<T>; 3],
) -> Lateral<T> {
    let across = SixWheels::<T>::from_fn(|i| f_y[i] * steering[axle_of(i)].cos);
    let right = [
        SixWheels::sum_of(|i| across[i]) - u.u * x.r * p.m,
        SixWheels::sum_of(|i| q[i] * d.y[i]) + x.phi * (d.m_s * p.g * p.h_s) + u.u * x.r * (d.m_s * p.h_s),
        SixWheels::sum_of(|i| across[i] * d.x[i]),
    ];
    let [vd, phidd, rd] = d.inverse.map(|row| right[0] * row[0] + right[1] * row[1] + right[2] * row[2]);
    Lateral { vd, phidd, rd }
}

pub(crate) fn derivatives<T: Scalar>(p: &RescueVehicle, d: &D, x: &X<T>, u: &U<T>) -> X<T> {
    let Motion { heading, vertical, lateral, .. } = motion(p, d, x, u);
    let [xd, yd] = heading.out_of_frame([u.u, x.v]);
    X {
        z: x.zd,
        theta: x.thetad,
        phi: x.phid,
        z_w: x.zd_w,
        zd: vertical.zdd,
        thetad: vertical.thetadd,
        phid: lateral.phidd,
        zd_w: vertical.zdd_w,
        v: lateral.vd,
        r: lateral.rd,
        psi: x.r,
        x: xd,
        y: yd,
    }
}

pub(crate) fn outputs<T: Scalar>(p: &RescueVehicle, d: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let Motion { suspension, tires, vertical, lateral, .. } = motion(p, d, x, u);
    let loads = |side: usize| (0..3).map(|axle| suspension.n[2 * axle + side]).sum::<T>();
    Y {
        u: u.u,
        beta: tires.beta,
        rd: lateral.rd,
        a_y: lateral.vd + u.u * x.r,
        ltr: load_transfer_ratio(loads(0), loads(1)),
        zdd: vertical.zdd,
        thetadd: vertical.thetadd,
        phidd: lateral.phidd,
        d_s: suspension.d_s,
        dd_s: suspension.dd_s,
        d_t: suspension.d_t,
        n: suspension.n,
        alpha: tires.alpha,
        f_y: tires.f_y,
    }
}
