//! Equations of motion, in the order of computation: wheels and struts, tires, lateral motion, vertical motion. The
//! numbers are those of the paper; corrections are listed in the README.
//!
//! | symbol | meaning |
//! |---|---|
//! | z, theta, phi | heave, pitch, roll of the sprung mass |
//! | z_f, z_b, th_b | height of the front wheels; height and pitch of the walking beams |
//! | z_w, q | height of a wheel and of the road under it |
//! | x, y | position of an axle in front of and of a side to the left of the center of mass |
//! | d, t | deflection of a strut and of the tires (compression negative) |
//! | f, F_s | force of the actuator and of the whole strut (push the body up) |
//! | F_0, F_z | load of the tires of a wheel position at rest and now |
//! | delta, alpha, F_y | steering angle, slip angle, lateral force of a wheel position |
//! | Y | lateral force of an axle, across the vehicle |
//! | R | moment of an anti-roll bar |
//! | G | lateral force of an axle that loads its left wheel and relieves the right one on its way to the body |
//! | M_phi | moment of struts, bars and weight about the roll axis |
//! | phi_a, kappa | lateral model: roll angle of an axle; share of the roll angle that its springs take |
//! | u, v, r | longitudinal and lateral velocity, yaw rate |
//! | a_y, psi | lateral acceleration, heading |
//!
//! One more d at the end of a name is one more derivative with respect to time: zd, zdd.

use chassis_vehicle::positions::{
    FrontWheels, Sides, SixWheels, Struts, ThreeAxles, TwoAxles, axle_of, left_is_positive,
};
use chassis_vehicle::suspension::{load_transfer_ratio, spring_damper, tire_load};
use chassis_vehicle::tire::MagicFormula;
use fmu::Scalar;

use crate::{Coupling, D, HeavyVehicle, U, X, Y};

/// Masses, static loads, positions, the mass matrix of the lateral motion and the tire.
pub(crate) fn derived(p: &HeavyVehicle) -> Result<D, String> {
    if p.l3 / 2.0 >= p.l2 {
        return Err(format!(
            "'geometry.middle_to_rear_axle' must be less than twice 'geometry.cg_to_rear_suspension' ({} m), got {} m: \
             the middle axle stands behind the center of mass",
            2.0 * p.l2,
            p.l3
        ));
    }
    let peak = |load: f64| p.a1 * load * load + p.a2 * load;
    if peak(p.f_max) <= 0.0 {
        return Err(format!(
            "'tire.fit_load_limit' must be a load at which the tire has a lateral force, got {} kN: the peak of the \
             magic formula would be {:.0} N",
            p.f_max,
            peak(p.f_max)
        ));
    }

    let m_u = [2.0 * p.m_t[0], 2.0 * p.m_t[1] + p.m_beam, 2.0 * p.m_t[2] + p.m_beam];
    let m = p.m_b + m_u.iter().sum::<f64>();
    let (l, b) = (p.l1 + p.l2, p.b1 + p.b2);
    let side = [p.b2 / b, p.b1 / b];
    let f0 = SixWheels::from_fn(|i| {
        let wheel = p.m_t[axle_of(i)] * p.g;
        let body = p.m_b * p.g * side[i % 2];
        if axle_of(i) == 0 { body * p.l2 / l + wheel } else { (body * p.l1 / l + p.m_beam * p.g) / 2.0 + wheel }
    });

    // Mass matrix of (vd, rd, phidd): [[m, 0, c], [0, i_z, i_xz], [c, i_xz, i]].
    let (c, i) = (-p.m_b * p.h, p.i_x + p.m_b * p.h * p.h);
    let determinant = m * (p.i_z * i - p.i_xz * p.i_xz) - c * c * p.i_z;
    if determinant <= 0.0 {
        let most = (p.i_z * (i - c * c / m)).sqrt();
        return Err(format!(
            "'body.roll_yaw_inertia' must be below {most:.0} kg.m2 in magnitude, got {} kg.m2: roll and yaw inertia \
             allow no more",
            p.i_xz
        ));
    }
    let inverse = [
        [p.i_z * i - p.i_xz * p.i_xz, c * p.i_xz, -c * p.i_z],
        [c * p.i_xz, m * i - c * c, -m * p.i_xz],
        [-c * p.i_z, -m * p.i_xz, m * p.i_z],
    ]
    .map(|row| row.map(|cofactor| cofactor / determinant));

    // Roll of the quasi-static axles.
    let bb = p.b1 * p.b1 + p.b2 * p.b2;
    let k_s = [0, 1].map(|group| p.k[group] * bb + p.k_a[group]);
    let k_tire = [p.k_t[0] * bb, (p.k_t[1] + p.k_t[2]) * bb];
    let m_bw = p.m_beam + p.m_t[1] + p.m_t[2];
    let j_bw = p.i_beam + (p.m_t[1] + p.m_t[2]) * p.l3 * p.l3 / 4.0;
    let share = std::array::from_fn(|i| p.n[axle_of(i)] * p.lambda);
    Ok(D {
        m,
        f0,
        m_u,
        x: [p.l1, p.l3 / 2.0 - p.l2, -p.l3 / 2.0 - p.l2],
        x_s: [p.l1, -p.l2],
        y: [p.b1, -p.b2],
        b,
        k_s,
        k_tire,
        kappa: [0, 1].map(|group| k_tire[group] / (k_s[group] + k_tire[group])),
        inverse,
        share,
        per_share: share.map(|share| 1.0 / share),
        per_b: 1.0 / b,
        per_m_b: 1.0 / p.m_b,
        per_i_y: 1.0 / p.i_y,
        per_m_t: 1.0 / p.m_t[0],
        per_m_bw: 1.0 / m_bw,
        per_j_bw: 1.0 / j_bw,
        magic: MagicFormula { c: p.c_mf, a: [p.a1, p.a2, p.a3, p.a4, p.a5, p.a6, p.a7, p.a8] },
    })
}

/// Front axle (0) or walking-beam suspension (1) of an axle.
fn group_of(axle: usize) -> usize {
    axle.min(1)
}

/// Heights of the front wheels and of the beams, and their rates.
struct Axles<T> {
    z_f: FrontWheels<T>,
    z_b: Sides<T>,
    zd_f: FrontWheels<T>,
    zd_b: Sides<T>,
    /// Roll angle of the front axle and of the beams; used by the lateral model only.
    phi_a: TwoAxles<T>,
}

/// Massless axles in equilibrium between springs, tires and lateral force (eq. 11, corrected): lateral model.
#[inline]
fn quasi_static<T: Scalar>(p: &HeavyVehicle, s: &D, x: &X<T>, u: &U<T>) -> Axles<T> {
    let l = p.l1 + p.l2;
    let bb = p.b1 * p.b1 + p.b2 * p.b2;
    // u r instead of the lateral acceleration, which depends on the result.
    let a_y = u.u * x.r;
    let g = [
        a_y * ((p.m_b * p.l2 / l * p.h_rc + s.m_u[0] * p.h_u) / s.b),
        a_y * ((p.m_b * p.l1 / l * p.h_rc + (s.m_u[1] + s.m_u[2]) * p.h_u) / s.b),
    ];
    let phi_a = TwoAxles::<T>::from_fn(|group| {
        let actuators = u.f[2 * group] * s.y[0] + u.f[2 * group + 1] * s.y[1];
        (x.phi * s.k_s[group] + x.phid * (p.c[group] * bb * s.kappa[group]) + g[group] * s.b - actuators)
            / (s.k_s[group] + s.k_tire[group])
    });
    Axles {
        z_f: FrontWheels::from_fn(|side| phi_a[0] * s.y[side]),
        z_b: Sides::from_fn(|side| phi_a[1] * s.y[side]),
        zd_f: FrontWheels::from_fn(|side| x.phid * ((1.0 - s.kappa[0]) * s.y[side])),
        zd_b: Sides::from_fn(|side| x.phid * ((1.0 - s.kappa[1]) * s.y[side])),
        phi_a,
    }
}

/// Lateral forces of the tires at the loads `f_z` (eq. 9, corrected): truck tires by similarity from
/// the car tire of the magic formula.
#[inline]
pub(crate) fn lateral_forces<T: Scalar>(
    p: &HeavyVehicle,
    s: &D,
    friction: &SixWheels<T>,
    f_z: &SixWheels<T>,
    alpha: &ThreeAxles<T>,
) -> SixWheels<T> {
    let load = std::array::from_fn(|i| Scalar::min(f_z[i] * s.per_share[i], T::from(1000.0 * p.f_max)));
    let force = s.magic.lateral_each([T::from(1.0); 6], load, std::array::from_fn(|i| alpha[axle_of(i)]));
    SixWheels::from_fn(|i| force[i] * friction[i] * (p.mu * s.share[i]))
}

/// Everything that follows from state and inputs.
struct Motion<T> {
    /// Derivatives of the state.
    rates: X<T>,
    z_w: SixWheels<T>,
    zd_w: SixWheels<T>,
    z_b: Sides<T>,
    d: Struts<T>,
    dd: Struts<T>,
    t: SixWheels<T>,
    f_z: SixWheels<T>,
    alpha: ThreeAxles<T>,
    f_y: SixWheels<T>,
    a_y: T,
}

#[inline]
fn motion<T: Scalar>(p: &HeavyVehicle, s: &D, x: &X<T>, u: &U<T>) -> Motion<T> {
    let zero = T::from(0.0);
    let is_lateral_only = p.coupling == Coupling::LateralOnly;

    // Wheels and struts: the left side rises with positive roll, the front sinks with positive pitch.
    let axles = if is_lateral_only {
        quasi_static(p, s, x, u)
    } else {
        Axles { z_f: x.z_f, z_b: x.z_b, zd_f: x.zd_f, zd_b: x.zd_b, phi_a: TwoAxles([zero; 2]) }
    };
    let lever = [0.0, -p.l3 / 2.0, p.l3 / 2.0]; // of a wheel at its beam
    let wheel = |front: &FrontWheels<T>, trunnion: &Sides<T>, pitch: &Sides<T>, i: usize| {
        let side = i % 2;
        if axle_of(i) == 0 { front[side] } else { trunnion[side] + pitch[side] * lever[axle_of(i)] }
    };
    let z_w = SixWheels::from_fn(|i| wheel(&axles.z_f, &axles.z_b, &x.th_b, i));
    let zd_w = SixWheels::from_fn(|i| wheel(&axles.zd_f, &axles.zd_b, &x.thd_b, i));
    let strut = |z: T, theta: T, phi: T, foot: T, i: usize| z - theta * s.x_s[i / 2] + phi * s.y[i % 2] - foot;
    let d = Struts::<T>::from_fn(|i| {
        let foot = if i < 2 { axles.z_f[i] } else { axles.z_b[i - 2] };
        strut(x.z, x.theta, x.phi, foot, i)
    });
    let dd = Struts::<T>::from_fn(|i| {
        let foot = if i < 2 { axles.zd_f[i] } else { axles.zd_b[i - 2] };
        strut(x.zd, x.thetad, x.phid, foot, i)
    });
    let f_s = Struts::<T>::from_fn(|i| spring_damper(p.k[i / 2], p.c[i / 2], d[i], dd[i]) + u.f[i]);
    let roll_bar = |group: usize, left: T, right: T| (x.phi - (left - right) * s.per_b) * p.k_a[group];
    let r_bar = [roll_bar(0, axles.z_f[0], axles.z_f[1]), roll_bar(1, axles.z_b[0], axles.z_b[1])];

    // Tires: loads, then slip angles in the frame of the wheel, the same on both sides, then forces (eqs. 9 and 10).
    let tires = |i: usize| {
        if is_lateral_only {
            let bb = p.b1 * p.b1 + p.b2 * p.b2;
            axles.phi_a[group_of(axle_of(i))] * (bb / s.b * left_is_positive(i))
        } else {
            z_w[i] - u.q[i]
        }
    };
    let f_z = SixWheels::<T>::from_fn(|i| tire_load(s.f0[i], p.k_t[axle_of(i)], tires(i), true));
    let t = SixWheels::from_fn(|i| {
        // In the lateral model there is no road to hang over: the deflection is that of the load.
        if is_lateral_only { (-f_z[i] + s.f0[i]) / p.k_t[axle_of(i)] } else { tires(i) }
    });
    let (mut alpha, mut f_y) = (ThreeAxles([zero; 3]), SixWheels([zero; 6]));
    // Separate from the heading: an array of small angles takes the fast path.
    let (sin, cos) = T::sin_cos_each(u.delta.0);
    let (sin_psi, cos_psi) = x.psi.sin_cos();
    if p.coupling != Coupling::VerticalOnly {
        let tangent = |axle: usize| {
            let across = x.v + x.r * s.x[axle];
            let lateral = across * cos[axle] - u.u * sin[axle];
            let longitudinal = u.u * cos[axle] + across * sin[axle];
            lateral / Scalar::max(longitudinal.abs(), T::from(p.u_min))
        };
        alpha = ThreeAxles(T::atan_each([tangent(0), tangent(1), tangent(2)]));
        f_y = lateral_forces(p, s, &u.friction, &f_z, &alpha);
    }
    let y_axle = ThreeAxles::<T>::from_fn(|axle| (f_y[2 * axle] + f_y[2 * axle + 1]) * cos[axle]);

    // Sum over struts: left and right ones side by side.
    let sum = |f: &dyn Fn(usize) -> T| (f(0) + f(2)) + (f(1) + f(3));

    // Lateral, yaw and roll motion (eqs. 3, 7 and 8, corrected): one system in (vd, rd, phidd).
    let m_phi = sum(&|i| f_s[i] * s.y[i % 2]) - r_bar[0] - r_bar[1] + x.phi * (p.m_b * p.g * p.h);
    let (vd, rd, phidd) = if p.coupling == Coupling::VerticalOnly {
        (zero, zero, m_phi / (p.i_x + p.m_b * p.h * p.h))
    } else {
        let sum = |f: &dyn Fn(usize) -> T| f(0) + f(1) + f(2);
        let along = sum(&|axle| (f_y[2 * axle] * p.b1 - f_y[2 * axle + 1] * p.b2) * sin[axle]);
        let right = [
            sum(&|axle| y_axle[axle]) - u.u * x.r * s.m,
            sum(&|axle| y_axle[axle] * s.x[axle]) + along,
            m_phi + u.u * x.r * (p.m_b * p.h),
        ];
        let [vd, rd, phidd] = s.inverse.map(|row| right[0] * row[0] + right[1] * row[1] + right[2] * row[2]);
        (vd, rd, phidd)
    };
    let a_y = vd + if p.coupling == Coupling::VerticalOnly { zero } else { u.u * x.r };

    // Vertical motion (eqs. 1, 2, 4-6, corrected).
    let (mut zdd, mut thetadd) = (zero, zero);
    let (mut zdd_f, mut zdd_b, mut thdd_b) = (FrontWheels([zero; 2]), Sides([zero; 2]), Sides([zero; 2]));
    if !is_lateral_only {
        let g = ThreeAxles::<T>::from_fn(|axle| match p.coupling {
            Coupling::Coupled => {
                let inertia = a_y * s.m_u[axle];
                ((y_axle[axle] - inertia) * p.h_rc + inertia * p.h_u) * s.per_b
            }
            _ => zero,
        });
        // Force on a wheel from its tires and from the lateral force, up.
        let push = SixWheels::<T>::from_fn(|i| f_z[i] - s.f0[i] + g[axle_of(i)] * left_is_positive(i));
        let bar = |group: usize, side: usize| r_bar[group] * (left_is_positive(side) * s.per_b);
        let bushing = |side: usize| (x.thd_b[side] - x.thetad) * p.c_b;
        zdd = sum(&|i| f_s[i]) * s.per_m_b;
        thetadd = (bushing(0) + bushing(1) - sum(&|i| f_s[i] * s.x_s[i / 2])) * s.per_i_y;
        zdd_f = FrontWheels::from_fn(|side| (-f_s[side] + push[side] + bar(0, side)) * s.per_m_t);
        zdd_b = Sides::from_fn(|side| (-f_s[2 + side] + push[2 + side] + push[4 + side] + bar(1, side)) * s.per_m_bw);
        thdd_b = Sides::from_fn(|side| ((push[4 + side] - push[2 + side]) * (p.l3 / 2.0) - bushing(side)) * s.per_j_bw);
    }
    let rates = X {
        z: x.zd,
        theta: x.thetad,
        phi: x.phid,
        z_f: x.zd_f,
        z_b: x.zd_b,
        th_b: x.thd_b,
        zd: zdd,
        thetad: thetadd,
        phid: phidd,
        zd_f: zdd_f,
        zd_b: zdd_b,
        thd_b: thdd_b,
        v: vd,
        r: rd,
        psi: x.r,
        x: u.u * cos_psi - x.v * sin_psi,
        y: u.u * sin_psi + x.v * cos_psi,
    };
    Motion { rates, z_w, zd_w, z_b: axles.z_b, d, dd, t, f_z, alpha, f_y, a_y }
}

pub(crate) fn derivatives<T: Scalar>(p: &HeavyVehicle, s: &D, x: &X<T>, u: &U<T>) -> X<T> {
    motion(p, s, x, u).rates
}

pub(crate) fn outputs<T: Scalar>(p: &HeavyVehicle, s: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let m = motion(p, s, x, u);
    let loads = |side: usize| (0..3).map(|axle| m.f_z[2 * axle + side]).sum::<T>();
    Y {
        u: u.u,
        beta: x.v / Scalar::max(u.u.abs(), T::from(p.u_min)),
        rd: m.rates.r,
        a_y: m.a_y,
        ltr: load_transfer_ratio(loads(0), loads(1)),
        zdd: m.rates.zd,
        thetadd: m.rates.thetad,
        phidd: m.rates.phid,
        z_w: m.z_w,
        zd_w: m.zd_w,
        z_b: m.z_b,
        d: m.d,
        dd: m.dd,
        t: m.t,
        f_z: m.f_z,
        alpha: SixWheels::from_fn(|i| m.alpha[axle_of(i)]),
        f_y: m.f_y,
    }
}
