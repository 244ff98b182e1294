//! Equations of motion, in the order of computation: deflections, tires, vertical motion, lateral motion. The numbers
//! are those of the paper; corrections are listed in the README.
//!
//! | symbol | meaning |
//! |---|---|
//! | x, y | position of a wheel in front of and to the left of the center of mass |
//! | Z, theta, phi | heave, pitch, roll of the sprung mass |
//! | z_w, z_r | height of a wheel and of the road under it |
//! | d, t | deflection of suspension and tire (compression negative) |
//! | F_s, U | force of spring and damper (tension positive), of the actuator (pushes the body up) |
//! | q | force on the body, U - F_s |
//! | N, F_z0 | tire load, and at rest |
//! | delta, alpha, F_y | steering angle, slip angle and lateral force of a tire |
//! | u, v, r | longitudinal and lateral velocity, yaw rate; u_e is u with a floor, for divisions |
//! | psi | heading |
//!
//! One more d at the end of a name is one more derivative with respect to time: zd, zdd.

use chassis_vehicle::positions::{SixWheels, ThreeAxles, axle_of, left_is_positive};
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
            "'geometry.cg_to_front_axle' = {} m puts the center of mass too far from the axles: the load of the {} at \
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
            "'body.roll_axis_inertia' must be more than {least:.0} kg.m2, got {} kg.m2: mass, \
             'geometry.body_cg_to_roll_axis' and 'body.product_of_inertia' need it",
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
        per_m_s: 1.0 / m_s,
        per_m_w: 1.0 / p.m_w,
        per_i_y: 1.0 / p.i_y,
    })
}

/// Everything that follows from state and inputs.
struct Motion<T> {
    d: SixWheels<T>,
    dd: SixWheels<T>,
    t: SixWheels<T>,
    n: SixWheels<T>,
    beta: T,
    sin_psi: T,
    cos_psi: T,
    alpha: SixWheels<T>,
    f_y: SixWheels<T>,
    zdd: T,
    thetadd: T,
    phidd: T,
    zdd_w: SixWheels<T>,
    vd: T,
    rd: T,
}

#[inline]
fn motion<T: Scalar>(p: &RescueVehicle, s: &D, x: &X<T>, u: &U<T>) -> Motion<T> {
    let u_e = Scalar::max(u.u, T::from(p.u_min));
    // Suspension (eq. 8, corrected): the left side rises with positive roll, the front sinks with positive pitch.
    let d = SixWheels::from_fn(|i| x.z - x.theta * s.x[i] + x.phi * s.y[i] - x.z_w[i]);
    let dd = SixWheels::from_fn(|i| x.zd - x.thetad * s.x[i] + x.phid * s.y[i] - x.zd_w[i]);
    let f_s = SixWheels::<T>::from_fn(|i| d[i] * p.k_s + dd[i] * p.c_s);

    // Tires (eq. 7, or its saturating form).
    let t = SixWheels::from_fn(|i| x.z_w[i] - u.z_r[i]);
    let n = SixWheels::from_fn(|i| {
        let load = -t[i] * p.k_t + s.fz0[i];
        if p.lift_off { Scalar::max(load, T::from(0.0)) } else { load }
    });
    // Both wheels of an axle have its direction; the fourth is that of the center of mass.
    let across = |x_axle: f64| x.v + x.r * x_axle;
    let [direction @ .., beta] = T::atan2_each([across(s.x[0]), across(s.x[2]), across(s.x[4]), x.v], [u_e; 4]);
    // Separate from the heading: an array of small angles takes the fast path.
    let (_, cos_delta) = T::sin_cos_each(u.delta.0);
    let (sin_psi, cos_psi) = x.psi.sin_cos();
    let alpha = SixWheels::from_fn(|i| direction[axle_of(i)] - u.delta[axle_of(i)]);
    let f_y: SixWheels<T> = match p.tire_model {
        TireModel::Linear => SixWheels::from_fn(|i| tire::linear(s.c[i], alpha[i])),
        TireModel::Saturating => {
            SixWheels(tire::saturating_each(s.c, std::array::from_fn(|i| n[i] * u.friction[i] * p.mu), alpha.0))
        }
    };

    // Vertical motion (eqs. 4-6, corrected).
    let q = SixWheels::<T>::from_fn(|i| u.f_u[i] - f_s[i]);
    // Left and right wheels side by side.
    let sum = |f: &dyn Fn(usize) -> T| (f(0) + f(2) + f(4)) + (f(1) + f(3) + f(5));
    let zdd = sum(&|i| q[i]) * s.per_m_s;
    let thetadd = (-sum(&|i| q[i] * s.x[i]) + x.theta * (s.m_s * p.g * p.h_s)) * s.per_i_y;
    let zdd_w = SixWheels::from_fn(|i| (f_s[i] - u.f_u[i] + (n[i] - s.fz0[i])) * s.per_m_w);

    // Lateral, roll and yaw motion (eqs. 1-3): one symmetric system in (vd, phidd, rd).
    let across = SixWheels::<T>::from_fn(|i| f_y[i] * cos_delta[axle_of(i)]);
    let right = [
        sum(&|i| across[i]) - u.u * x.r * p.m,
        sum(&|i| q[i] * s.y[i]) + x.phi * (s.m_s * p.g * p.h_s) + u.u * x.r * (s.m_s * p.h_s),
        sum(&|i| across[i] * s.x[i]),
    ];
    let [vd, phidd, rd] = s.inverse.map(|row| right[0] * row[0] + right[1] * row[1] + right[2] * row[2]);
    Motion { d, dd, t, n, beta, sin_psi, cos_psi, alpha, f_y, zdd, thetadd, phidd, zdd_w, vd, rd }
}

pub(crate) fn derivatives<T: Scalar>(p: &RescueVehicle, s: &D, x: &X<T>, u: &U<T>) -> X<T> {
    let m = motion(p, s, x, u);
    X {
        z: x.zd,
        theta: x.thetad,
        phi: x.phid,
        z_w: x.zd_w,
        zd: m.zdd,
        thetad: m.thetadd,
        phid: m.phidd,
        zd_w: m.zdd_w,
        v: m.vd,
        r: m.rd,
        psi: x.r,
        x: u.u * m.cos_psi - x.v * m.sin_psi,
        y: u.u * m.sin_psi + x.v * m.cos_psi,
    }
}

pub(crate) fn outputs<T: Scalar>(p: &RescueVehicle, s: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let m = motion(p, s, x, u);
    let right: T = (0..6).filter(|i| i % 2 == 1).map(|i| m.n[i]).sum();
    let left: T = (0..6).filter(|i| i % 2 == 0).map(|i| m.n[i]).sum();
    let least = T::from(1.0); // N; the ratio of a vehicle in the air is 0
    let all = right + left;
    Y {
        u: u.u,
        beta: m.beta,
        rd: m.rd,
        a_y: m.vd + u.u * x.r,
        ltr: all.if_greater(least, (right - left) / Scalar::max(all, least), T::from(0.0)),
        zdd: m.zdd,
        thetadd: m.thetadd,
        phidd: m.phidd,
        d: m.d,
        dd: m.dd,
        t: m.t,
        n: m.n,
        alpha: m.alpha,
        f_y: m.f_y,
    }
}
