//! Equations of motion, in the order of computation: wheels and struts, tires, lateral motion, vertical motion.
//! Equation numbers refer to the paper; the README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | z, theta, phi | heave, pitch, roll of the sprung mass |
//! | z_f, z_b, th_b | height of the front wheels; height and pitch of the walking beams |
//! | z_w, q | height of a wheel and of the road under it |
//! | x, y | position of an axle in front of the center of mass, and of a side to the left of it |
//! | d_s, d_t | deflection of a strut and of the tires (compression negative) |
//! | f, S | force of the actuator and of the whole strut (push the body up) |
//! | F_0, F_z | load of the tires at a wheel position: at rest, actual |
//! | delta, alpha, F_y | steering angle, slip angle, lateral force of a wheel position |
//! | Y (y_axle) | lateral force of an axle, across the vehicle |
//! | R (r_bar) | moment of an anti-roll bar |
//! | G | load that the lateral force of an axle adds to its left wheel and takes from its right wheel |
//! | M_phi | moment of struts, bars and weight about the roll axis |
//! | phi_a, kappa | lateral model: roll angle of an axle; share of the roll angle that its springs take |
//! | u, v, r | longitudinal and lateral velocity, yaw rate |
//! | a_y, psi | lateral acceleration, heading |
//!
//! Each d added to a symbol, before its index, is a derivative with respect to time: zd, zdd_f, dd_s.

use chassis_vehicle::arithmetic::{Divisor, Over, Rotation};
use chassis_vehicle::positions::{
    FrontWheels, Sides, SixWheels, Struts, ThreeAxles, TwoAxles, axle_of, left_is_positive,
};
use chassis_vehicle::suspension::{load_transfer_ratio, spring_damper, tire_load};
use chassis_vehicle::tire::MagicFormula;
use fmu::Scalar;

use crate::{Coupling, D, HeavyVehicle, U, X, Y};

/// Masses, static loads, positions, the mass matrix of the lateral motion and the tire.
pub(crate) fn derived(p: &HeavyVehicle) -> Result<D, String> {
    check(p)?;
    let m_u = [2.0 * p.m_t[0], 2.0 * p.m_t[1] + p.m_beam, 2.0 * p.m_t[2] + p.m_beam];
    let m = p.m_b + m_u.iter().sum::<f64>();
    let b = p.b1 + p.b2;

    // Roll stiffnesses of the quasi-static axles.
    let bb = p.b1 * p.b1 + p.b2 * p.b2;
    let k_s = [0, 1].map(|group| p.k[group] * bb + p.k_a[group]);
    let k_tire = [p.k_t[0] * bb, (p.k_t[1] + p.k_t[2]) * bb];

    // Mass and pitch inertia of a beam with its wheels.
    let m_bw = p.m_beam + p.m_t[1] + p.m_t[2];
    let j_bw = p.i_beam + (p.m_t[1] + p.m_t[2]) * p.l3 * p.l3 / 4.0;
    let share = std::array::from_fn(|i| p.n[axle_of(i)] * p.lambda);
    Ok(D {
        m,
        f0: static_loads(p),
        m_u,
        x: [p.l1, p.l3 / 2.0 - p.l2, -p.l3 / 2.0 - p.l2],
        x_s: [p.l1, -p.l2],
        y: [p.b1, -p.b2],
        b,
        k_s,
        k_tire,
        kappa: [0, 1].map(|group| k_tire[group] / (k_s[group] + k_tire[group])),
        inverse: inverse_mass_matrix(p, m)?,
        share,
        load_scale: share.map(Divisor::new),
        track: Divisor::new(b),
        m_b: Divisor::new(p.m_b),
        i_y: Divisor::new(p.i_y),
        m_t: Divisor::new(p.m_t[0]),
        m_bw: Divisor::new(m_bw),
        j_bw: Divisor::new(j_bw),
        magic: MagicFormula { c: p.c_mf, a: [p.a1, p.a2, p.a3, p.a4, p.a5, p.a6, p.a7, p.a8] },
    })
}

/// Checks that the middle axle is behind the center of mass, and that the peak of the magic formula is positive at its
/// load limit.
fn check(p: &HeavyVehicle) -> Result<(), String> {
    if p.l3 / 2.0 >= p.l2 {
        return Err(format!(
            "'geometry.middle_to_rear_axle' must be less than twice 'geometry.cg_to_rear_suspension' ({} m), got {} m: \
             the middle axle must be behind the center of mass",
            2.0 * p.l2,
            p.l3
        ));
    }
    let peak = |load: f64| p.a1 * load * load + p.a2 * load;
    if peak(p.f_max) <= 0.0 {
        return Err(format!(
            "'tire.fit_load_limit' must be a load at which the peak of the magic formula is positive, got {} kN: the \
             peak would be {:.0} N",
            p.f_max,
            peak(p.f_max)
        ));
    }
    Ok(())
}

/// F_0: the weight of the body, shared between front and rear, left and right, plus the unsprung weight.
fn static_loads(p: &HeavyVehicle) -> SixWheels<f64> {
    let (l, b) = (p.l1 + p.l2, p.b1 + p.b2);
    let side = [p.b2 / b, p.b1 / b];
    SixWheels::from_fn(|i| {
        let wheel = p.m_t[axle_of(i)] * p.g;
        let body = p.m_b * p.g * side[i % 2];
        if axle_of(i) == 0 { body * p.l2 / l + wheel } else { (body * p.l1 / l + p.m_beam * p.g) / 2.0 + wheel }
    })
}

/// Inverse of the mass matrix of (vd, rd, phidd), [[m, 0, c], [0, I_z, I_xz], [c, I_xz, i]] with c = -m_b h and
/// i = I_x + m_b h^2.
fn inverse_mass_matrix(p: &HeavyVehicle, m: f64) -> Result<[[f64; 3]; 3], String> {
    let (c, i) = (-p.m_b * p.h, p.i_x + p.m_b * p.h * p.h);
    let determinant = m * (p.i_z * i - p.i_xz * p.i_xz) - c * c * p.i_z;
    if determinant <= 0.0 {
        let most = (p.i_z * (i - c * c / m)).sqrt();
        return Err(format!(
            "'body.roll_yaw_inertia' must be below {most:.0} kg.m2 in magnitude, got {} kg.m2: reduce it, or increase \
             the roll or yaw inertia",
            p.i_xz
        ));
    }
    let cofactors = [
        [p.i_z * i - p.i_xz * p.i_xz, c * p.i_xz, -c * p.i_z],
        [c * p.i_xz, m * i - c * c, -m * p.i_xz],
        [-c * p.i_z, -m * p.i_xz, m * p.i_z],
    ];
    Ok(cofactors.map(|row| row.map(|cofactor| cofactor / determinant)))
}

/// Suspension of an axle: front (0) or walking beams (1).
fn group_of(axle: usize) -> usize {
    axle.min(1)
}

/// Values that derivatives and outputs share.
struct Motion<T> {
    /// Derivatives of the state.
    rates: X<T>,
    wheels: Wheels<T>,
    suspension: Suspension<T>,
    springs: TireSprings<T>,
    tires: Tires<T>,
    a_y: T,
}

#[inline]
fn motion<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>, u: &U<T>) -> Motion<T> {
    let axles = axles(p, d, x, u);
    let wheels = wheels(p, x, &axles);
    let suspension = suspension(p, d, x, u, &axles);
    let springs = tire_springs(p, d, u, &axles, &wheels);
    let steering = Rotation::by_each(u.delta.0);
    let heading = Rotation::by(x.psi);
    let tires = tires(p, d, x, u, &steering, &springs.f_z);
    let lateral = lateral_motion(p, d, x, u, &steering, &suspension, &tires.f_y);
    let vertical = vertical_motion(p, d, x, &suspension, &springs.f_z, &lateral);

    let [xd, yd] = heading.out_of_frame([u.u, x.v]);
    let rates = X {
        z: x.zd,
        theta: x.thetad,
        phi: x.phid,
        z_f: x.zd_f,
        z_b: x.zd_b,
        th_b: x.thd_b,
        zd: vertical.zdd,
        thetad: vertical.thetadd,
        phid: lateral.phidd,
        zd_f: vertical.zdd_f,
        zd_b: vertical.zdd_b,
        thd_b: vertical.thdd_b,
        v: lateral.vd,
        r: lateral.rd,
        psi: x.r,
        x: xd,
        y: yd,
    };
    Motion { rates, wheels, suspension, springs, tires, a_y: lateral.a_y }
}

struct Axles<T> {
    z_f: FrontWheels<T>,
    z_b: Sides<T>,
    zd_f: FrontWheels<T>,
    zd_b: Sides<T>,
    /// Roll angle of the front axle and of the beams; used by the lateral model only.
    phi_a: TwoAxles<T>,
}

#[inline]
fn axles<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>, u: &U<T>) -> Axles<T> {
    if p.coupling == Coupling::LateralOnly {
        return quasi_static(p, d, x, u);
    }
    Axles { z_f: x.z_f, z_b: x.z_b, zd_f: x.zd_f, zd_b: x.zd_b, phi_a: TwoAxles([T::from(0.0); 2]) }
}

/// Lateral model: massless axles in equilibrium between springs, tires and lateral force (eq. 11, corrected).
#[inline]
fn quasi_static<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>, u: &U<T>) -> Axles<T> {
    let l = p.l1 + p.l2;
    let bb = p.b1 * p.b1 + p.b2 * p.b2;
    // The lateral acceleration depends on the result, so u r is used instead.
    let a_y = u.u * x.r;
    let g = [
        a_y * ((p.m_b * p.l2 / l * p.h_rc + d.m_u[0] * p.h_u) / d.b),
        a_y * ((p.m_b * p.l1 / l * p.h_rc + (d.m_u[1] + d.m_u[2]) * p.h_u) / d.b),
    ];
    let phi_a = TwoAxles::<T>::from_fn(|group| {
        let actuators = u.f[2 * group] * d.y[0] + u.f[2 * group + 1] * d.y[1];
        (x.phi * d.k_s[group] + x.phid * (p.c[group] * bb * d.kappa[group]) + g[group] * d.b - actuators)
            / (d.k_s[group] + d.k_tire[group])
    });
    Axles {
        z_f: FrontWheels::from_fn(|side| phi_a[0] * d.y[side]),
        z_b: Sides::from_fn(|side| phi_a[1] * d.y[side]),
        zd_f: FrontWheels::from_fn(|side| x.phid * ((1.0 - d.kappa[0]) * d.y[side])),
        zd_b: Sides::from_fn(|side| x.phid * ((1.0 - d.kappa[1]) * d.y[side])),
        phi_a,
    }
}

struct Wheels<T> {
    z_w: SixWheels<T>,
    zd_w: SixWheels<T>,
    z_b: Sides<T>,
}

#[inline]
fn wheels<T: Scalar>(p: &HeavyVehicle, x: &X<T>, axles: &Axles<T>) -> Wheels<T> {
    let lever = [0.0, -p.l3 / 2.0, p.l3 / 2.0]; // from the trunnion to a wheel
    let wheel = |front: &FrontWheels<T>, trunnion: &Sides<T>, pitch: &Sides<T>, i: usize| {
        let side = i % 2;
        if axle_of(i) == 0 { front[side] } else { trunnion[side] + pitch[side] * lever[axle_of(i)] }
    };
    Wheels {
        z_w: SixWheels::from_fn(|i| wheel(&axles.z_f, &axles.z_b, &x.th_b, i)),
        zd_w: SixWheels::from_fn(|i| wheel(&axles.zd_f, &axles.zd_b, &x.thd_b, i)),
        z_b: axles.z_b,
    }
}

struct Suspension<T> {
    d_s: Struts<T>,
    dd_s: Struts<T>,
    /// S
    s: Struts<T>,
    /// R, front and rear.
    r_bar: [T; 2],
}

/// Struts and anti-roll bars (eqs. 1-3, corrected): the left side rises with positive roll, the front sinks with positive pitch.
#[inline]
fn suspension<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>, u: &U<T>, axles: &Axles<T>) -> Suspension<T> {
    let strut = |z: T, theta: T, phi: T, foot: T, i: usize| z - theta * d.x_s[i / 2] + phi * d.y[i % 2] - foot;
    let d_s = Struts::<T>::from_fn(|i| {
        let foot = if i < 2 { axles.z_f[i] } else { axles.z_b[i - 2] };
        strut(x.z, x.theta, x.phi, foot, i)
    });
    let dd_s = Struts::<T>::from_fn(|i| {
        let foot = if i < 2 { axles.zd_f[i] } else { axles.zd_b[i - 2] };
        strut(x.zd, x.thetad, x.phid, foot, i)
    });
    let s = Struts::<T>::from_fn(|i| spring_damper(p.k[i / 2], p.c[i / 2], d_s[i], dd_s[i]) + u.f[i]);
    let bar = |group: usize, left: T, right: T| (x.phi - (left - right).over(d.track)) * p.k_a[group];
    let r_bar = [bar(0, axles.z_f[0], axles.z_f[1]), bar(1, axles.z_b[0], axles.z_b[1])];
    Suspension { d_s, dd_s, s, r_bar }
}

struct TireSprings<T> {
    d_t: SixWheels<T>,
    f_z: SixWheels<T>,
}

#[inline]
fn tire_springs<T: Scalar>(p: &HeavyVehicle, d: &D, u: &U<T>, axles: &Axles<T>, wheels: &Wheels<T>) -> TireSprings<T> {
    let is_lateral_only = p.coupling == Coupling::LateralOnly;
    let deflection = |i: usize| {
        if is_lateral_only {
            let bb = p.b1 * p.b1 + p.b2 * p.b2;
            axles.phi_a[group_of(axle_of(i))] * (bb / d.b * left_is_positive(i))
        } else {
            wheels.z_w[i] - u.q[i]
        }
    };
    let f_z = SixWheels::<T>::from_fn(|i| tire_load(d.f0[i], p.k_t[axle_of(i)], deflection(i), true));
    let d_t = SixWheels::from_fn(|i| {
        // In the lateral model, a wheel stays on the road even without load: the deflection is computed from the load.
        if is_lateral_only { (-f_z[i] + d.f0[i]) / p.k_t[axle_of(i)] } else { deflection(i) }
    });
    TireSprings { d_t, f_z }
}

struct Tires<T> {
    alpha: ThreeAxles<T>,
    f_y: SixWheels<T>,
}

/// Slip angles in the frame of the wheel, the same on both sides, and forces (eqs. 9 and 10, corrected).
#[inline]
fn tires<T: Scalar>(
    p: &HeavyVehicle,
    d: &D,
    x: &X<T>,
    u: &U<T>,
    steering: &[Rotation<T>; 3],
    f_z: &SixWheels<T>,
) -> Tires<T> {
    if p.coupling == Coupling::VerticalOnly {
        let zero = T::from(0.0);
        return Tires { alpha: ThreeAxles([zero; 3]), f_y: SixWheels([zero; 6]) };
    }
    let tangent = |axle: usize| {
        let [longitudinal, lateral] = steering[axle].into_frame([u.u, x.v + x.r * d.x[axle]]);
        lateral / Scalar::max(longitudinal.abs(), T::from(p.u_min))
    };
    let alpha = ThreeAxles(T::atan_each([tangent(0), tangent(1), tangent(2)]));
    Tires { alpha, f_y: lateral_forces(p, d, &u.friction, f_z, &alpha) }
}

/// Lateral forces of the tires at the loads `f_z` (eq. 9, corrected): truck tires, scaled by similarity from the car
/// tire of the magic formula.
#[inline]
pub(crate) fn lateral_forces<T: Scalar>(
    p: &HeavyVehicle,
    d: &D,
    friction: &SixWheels<T>,
    f_z: &SixWheels<T>,
    alpha: &ThreeAxles<T>,
) -> SixWheels<T> {
    let load = std::array::from_fn(|i| Scalar::min(f_z[i].over(d.load_scale[i]), T::from(1000.0 * p.f_max)));
    let force = d.magic.lateral_each([T::from(1.0); 6], load, std::array::from_fn(|i| alpha[axle_of(i)]));
    SixWheels::from_fn(|i| force[i] * friction[i] * (p.mu * d.share[i]))
}

struct Lateral<T> {
    vd: T,
    rd: T,
    phidd: T,
    a_y: T,
    /// Y
    y_axle: ThreeAxles<T>,
}

/// Eqs. 3, 7 and 8, corrected: one linear system in (vd, rd, phidd).
#[inline]
fn lateral_motion<T: Scalar>(
    p: &HeavyVehicle,
    d: &D,
    x: &X<T>,
    u: &U<T>,
    steering: &[Rotation<T>; 3],
    Suspension { s, r_bar, .. }: &Suspension<T>,
    f_y: &SixWheels<T>,
) -> Lateral<T> {
    let y_axle = ThreeAxles::<T>::from_fn(|axle| (f_y[2 * axle] + f_y[2 * axle + 1]) * steering[axle].cos);
    let m_phi = Struts::sum_of(|i| s[i] * d.y[i % 2]) - r_bar[0] - r_bar[1] + x.phi * (p.m_b * p.g * p.h);
    if p.coupling == Coupling::VerticalOnly {
        let zero = T::from(0.0);
        return Lateral { vd: zero, rd: zero, phidd: m_phi / (p.i_x + p.m_b * p.h * p.h), a_y: zero, y_axle };
    }
    let sum = |f: &dyn Fn(usize) -> T| f(0) + f(1) + f(2);
    let along = sum(&|axle| (f_y[2 * axle] * p.b1 - f_y[2 * axle + 1] * p.b2) * steering[axle].sin);
    let right = [
        sum(&|axle| y_axle[axle]) - u.u * x.r * d.m,
        sum(&|axle| y_axle[axle] * d.x[axle]) + along,
        m_phi + u.u * x.r * (p.m_b * p.h),
    ];
    let [vd, rd, phidd] = d.inverse.map(|row| right[0] * row[0] + right[1] * row[1] + right[2] * row[2]);
    Lateral { vd, rd, phidd, a_y: vd + u.u * x.r, y_axle }
}

struct Vertical<T> {
    zdd: T,
    thetadd: T,
    zdd_f: FrontWheels<T>,
    zdd_b: Sides<T>,
    thdd_b: Sides<T>,
}

/// Eqs. 1, 2 and 4-6, corrected.
#[inline]
fn vertical_motion<T: Scalar>(
    p: &HeavyVehicle,
    d: &D,
    x: &X<T>,
    Suspension { s, r_bar, .. }: &Suspension<T>,
    f_z: &SixWheels<T>,
    &Lateral { a_y, y_axle, .. }: &Lateral<T>,
) -> Vertical<T> {
    let zero = T::from(0.0);
    if p.coupling == Coupling::LateralOnly {
        let (zdd_f, zdd_b) = (FrontWheels([zero; 2]), Sides([zero; 2]));
        return Vertical { zdd: zero, thetadd: zero, zdd_f, zdd_b, thdd_b: zdd_b };
    }
    let g = ThreeAxles::<T>::from_fn(|axle| match p.coupling {
        Coupling::Coupled => {
            let inertia = a_y * d.m_u[axle];
            ((y_axle[axle] - inertia) * p.h_rc + inertia * p.h_u).over(d.track)
        }
        _ => zero,
    });
    // Force on a wheel from its tires and from the lateral force, up.
    let push = SixWheels::<T>::from_fn(|i| f_z[i] - d.f0[i] + g[axle_of(i)] * left_is_positive(i));
    let bar = |group: usize, side: usize| r_bar[group] * left_is_positive(side).over(d.track);
    let bushing = |side: usize| (x.thd_b[side] - x.thetad) * p.c_b;
    Vertical {
        zdd: Struts::sum_of(|i| s[i]).over(d.m_b),
        thetadd: (bushing(0) + bushing(1) - Struts::sum_of(|i| s[i] * d.x_s[i / 2])).over(d.i_y),
        zdd_f: FrontWheels::from_fn(|side| (-s[side] + push[side] + bar(0, side)).over(d.m_t)),
        zdd_b: Sides::from_fn(|side| (-s[2 + side] + push[2 + side] + push[4 + side] + bar(1, side)).over(d.m_bw)),
        thdd_b: Sides::from_fn(|side| ((push[4 + side] - push[2 + side]) * (p.l3 / 2.0) - bushing(side)).over(d.j_bw)),
    }
}

pub(crate) fn derivatives<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>, u: &U<T>) -> X<T> {
    motion(p, d, x, u).rates
}

pub(crate) fn outputs<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let Motion { rates, wheels, suspension, springs, tires, a_y } = motion(p, d, x, u);
    let f_z = springs.f_z;
    let loads = |side: usize| (0..3).map(|axle| f_z[2 * axle + side]).sum::<T>();
    Y {
        u: u.u,
        beta: x.v / Scalar::max(u.u.abs(), T::from(p.u_min)),
        rd: rates.r,
        a_y,
        ltr: load_transfer_ratio(loads(0), loads(1)),
        zdd: rates.zd,
        thetadd: rates.thetad,
        phidd: rates.phid,
        z_w: wheels.z_w,
        zd_w: wheels.zd_w,
        z_b: wheels.z_b,
        d_s: suspension.d_s,
        dd_s: suspension.dd_s,
        d_t: springs.d_t,
        f_z,
        alpha: SixWheels::from_fn(|i| tires.alpha[axle_of(i)]),
        f_y: tires.f_y,
    }
}
