//! Equations of motion, in the order of computation: suspension (eqs. 4-6), tires, motion in the plane with roll and
//! pitch (eqs. 1, 3, 7, 11), wheels (eqs. 5, 13). Equation numbers refer to the paper; the README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | x, y (wheel) | position of a wheel in front of and to the left of the reference point, the ground projection of the center of mass |
//! | u, v, r, psi | longitudinal and lateral velocity of the reference point, yaw rate, heading |
//! | z, phi, theta | heave, roll and pitch of the body |
//! | e, H (h_b) | body's center of mass ahead of the reference point, and over the roll and pitch axis |
//! | A, B | body's center of mass with roll and pitch: ahead by A = e + H theta, to the right by B = H phi |
//! | m_U (m_w), x_w | mass of all wheels, and its center ahead of the reference point |
//! | S_1 | moment sum m_i x_i = -m_s e of the wheels about the reference point |
//! | V_x, V_y, p_u, p_v | velocity of the body's center of mass, momentum of the vehicle |
//! | O_1, O_2 | angular velocity of the body about its longitudinal and lateral axis |
//! | M, q | mass matrix and right-hand side of the equations for (ud, vd, rd, phidd, thetadd) |
//! | z_u, z_r | height of a wheel and of the road under it |
//! | d_s, d_t | deflection of the suspension and of the tire (compression negative) |
//! | F, f | force of the suspension on the body, force of its actuator |
//! | F_z, F_z0 | tire load, tire load at rest |
//! | delta, V_xw, V_yw | steering angle of a wheel, velocity of its hub along and across its plane |
//! | s, t | longitudinal slip, tangent of the slip angle |
//! | n, mu | F_z/F_z0, friction coefficient |
//! | F_xw, F_yw, f_x, f_y | tire force along and across the plane of the wheel, and along the axes of the car |
//! | F_x, F_y, M_z | sums of f_x and f_y, and their moment about the reference point |
//! | a_xs, a_xw, a_y | longitudinal acceleration of body and wheels, lateral acceleration of an axle |
//! | G | load that the links carry from axle to axle and from side to side (up positive) |
//! | T_d, T_b, omega | drive and brake torque, speed of rotation of a wheel |
//!
//! Each d added to a symbol, before its index, is a derivative with respect to time: zd, zdd_u, dd_s.

use chassis_vehicle::arithmetic::{Divisor, Over, Rotation};
use chassis_vehicle::positions::{FourWheels, TwoAxles, axle_of, left_is_positive};
use chassis_vehicle::{suspension, tire};
use fmu::Scalar;

use crate::{D, EspCar, U, X, Y};

/// Masses, positions, loads at rest and the constant blocks of the mass matrix.
pub(crate) fn derived(p: &EspCar) -> Result<D, String> {
    let m_i: [f64; 4] = std::array::from_fn(|i| p.m_u[axle_of(i)]);
    let x: [f64; 4] = std::array::from_fn(|i| if axle_of(i) == 0 { p.a } else { -p.b });
    let y: [f64; 4] = std::array::from_fn(|i| p.track / 2.0 * left_is_positive(i));
    let m_w: f64 = m_i.iter().sum();
    let m = p.m_s + m_w;
    let e = -(0..4).map(|i| m_i[i] * x[i]).sum::<f64>() / p.m_s;
    let h_s = (m * p.h - m_w * p.h_u) / p.m_s;
    if h_s < p.h_b {
        return Err(format!(
            "'geometry.body_cg_to_roll_axis' must be at most {h_s:.3} m, got {} m: with this 'geometry.cg_height' the \
             body's center of mass is {h_s:.3} m over ground, and the roll axis would be below the ground",
            p.h_b
        ));
    }
    let i_w: f64 = (0..4).map(|i| m_i[i] * (x[i] * x[i] + y[i] * y[i])).sum();
    let wheelbase = p.a + p.b;
    let f_z0 = [p.b, p.a].map(|lever| m * p.g * lever / (2.0 * wheelbase));
    let s_1 = -p.m_s * e;
    // The matrix [[m, c], [c, i + m_s H^2]] is never singular, because m includes the wheels, which do not rotate with
    // the body.
    let c = p.m_s * p.h_b;
    let inverse = |c: f64, i: f64| {
        let i = i + p.m_s * p.h_b * p.h_b;
        let determinant = m * i - c * c;
        [[i / determinant, -c / determinant], [-c / determinant, m / determinant]]
    };
    Ok(D {
        m,
        i_vehicle: p.i_z + i_w + p.m_s * e * e,
        f_z0: FourWheels::from_fn(|i| f_z0[axle_of(i)]),
        m_w,
        e,
        s_1,
        x_w: s_1.over(Divisor::new(m_w)),
        h_ra: h_s - p.h_b,
        x,
        y,
        i_w,
        static_load: std::array::from_fn(|i| Divisor::new(f_z0[axle_of(i)])),
        m_s: Divisor::new(p.m_s),
        m_u: p.m_u.0.map(Divisor::new),
        j_w: Divisor::new(p.j_w),
        w_eps: Divisor::new(p.w_eps),
        track: Divisor::new(p.track),
        wheelbase: Divisor::new(wheelbase),
        u_theta: inverse(c, p.i_y),
        v_phi: inverse(-c, p.i_x),
    })
}

/// Values that derivatives and outputs share.
struct Motion<T> {
    heading: Rotation<T>,
    suspension: Suspension<T>,
    tires: Tires<T>,
    body: Accelerations<T>,
    wheels: Wheels<T>,
}

#[inline]
fn motion<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, inputs: &U<T>) -> Motion<T> {
    let steering = Rotation::by(inputs.delta[0]);
    let heading = Rotation::by(x.psi);
    let t_b = brake_torques(d, x, inputs);

    let suspension = suspensions(p, d, x, inputs);
    let v_w = hub_velocities(d, x, steering);
    let tires = tires(p, d, x, &suspension.f_z, &inputs.friction, v_w);
    let f = forces_on_car(&tires, steering);
    let body = body(p, d, x, &suspension.f_s, &f);
    let g = load_of_links(p, d, x, &body, &f);
    let wheels = wheels(p, d, inputs, &suspension, &tires, &g, &t_b);
    Motion { heading, suspension, tires, body, wheels }
}

/// Brake torques, smoothed near standstill.
#[inline]
fn brake_torques<T: Scalar>(d: &D, x: &X<T>, inputs: &U<T>) -> FourWheels<T> {
    let direction = T::tanh_each(x.omega.0.map(|omega| omega.over(d.w_eps)));
    FourWheels::from_fn(|i| inputs.t_b[i] * direction[i])
}

struct Suspension<T> {
    d_s: FourWheels<T>,
    dd_s: FourWheels<T>,
    d_t: FourWheels<T>,
    f_s: FourWheels<T>,
    f_z: FourWheels<T>,
}

/// Eqs. 4-6: the left side rises with positive roll, the front sinks with positive pitch.
#[inline]
fn suspensions<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, inputs: &U<T>) -> Suspension<T> {
    let x_s: [f64; 4] = std::array::from_fn(|i| d.x[i] - d.e);
    let d_s = FourWheels::from_fn(|i| x.z + x.phi * d.y[i] - x.theta * x_s[i] - x.z_u[i]);
    let dd_s = FourWheels::from_fn(|i| x.zd + x.phid * d.y[i] - x.thetad * x_s[i] - x.zd_u[i]);
    let bar = TwoAxles::<T>::from_fn(|j| {
        let twist = x.phi - (x.z_u[2 * j] - x.z_u[2 * j + 1]).over(d.track);
        twist * p.k_a[j].over(d.track)
    });
    let f_s = FourWheels::<T>::from_fn(|i| {
        let j = axle_of(i);
        suspension::spring_damper(p.k_s[j], p.c_s[j], d_s[i], dd_s[i]) + inputs.f[i] - bar[j] * left_is_positive(i)
    });
    let d_t = FourWheels::from_fn(|i| x.z_u[i] - inputs.z_r[i]);
    let f_z = FourWheels::<T>::from_fn(|i| suspension::tire_load(d.f_z0[i], p.k_t, d_t[i], true));
    Suspension { d_s, dd_s, d_t, f_s, f_z }
}

struct Tires<T> {
    s: FourWheels<T>,
    t: FourWheels<T>,
    f_xw: FourWheels<T>,
    f_yw: FourWheels<T>,
}

/// The tires at the loads `f_z`: Dugoff's law (SAE paper 700377) with load-dependent stiffness and speed-dependent
/// friction.
#[inline]
fn tires<T: Scalar>(
    p: &EspCar,
    d: &D,
    x: &X<T>,
    f_z: &FourWheels<T>,
    friction: &FourWheels<T>,
    [v_xw, v_yw]: [FourWheels<T>; 2],
) -> Tires<T> {
    let one = T::from(1.0);
    let rolling = FourWheels::from_fn(|i| x.omega[i] * p.radius);
    let sliding = FourWheels::<T>::from_fn(|i| rolling[i] - v_xw[i]);

    let v_eps2 = T::from(p.v_eps * p.v_eps);
    let v_xw2 = FourWheels::<T>::from_fn(|i| v_xw[i].squared());
    let fastest2 = FourWheels::<T>::from_fn(|i| Scalar::max(v_xw2[i], rolling[i].squared()));
    let s = FourWheels::<T>::from_fn(|i| Scalar::clamp(sliding[i] / (fastest2[i] + v_eps2).sqrt(), -one, one));
    let t = FourWheels::<T>::from_fn(|i| v_yw[i] / (v_xw2[i] + v_eps2).sqrt());

    let shape = FourWheels::<T>::from_fn(|i| {
        let n = Scalar::clamp(f_z[i].over(d.static_load[i]), T::from(0.0), T::from(3.0));
        n * (-n * p.q + (1.0 + p.q))
    });
    let mu = FourWheels::<T>::from_fn(|i| {
        let loss = (sliding[i].squared() + v_yw[i].squared()).sqrt() * p.a_s;
        Scalar::max(-loss + 1.0, T::from(p.mu_floor)) * p.mu_0 * friction[i]
    });
    let c = [&p.c_kappa, &p.c_alpha].map(|c| std::array::from_fn(|i| shape[i] * c[axle_of(i)]));
    let mu_f_z = std::array::from_fn(|i| mu[i] * f_z[i]);
    let [f_xw, f_yw] = tire::dugoff_each(c, mu_f_z, s.0, t.0);
    Tires { s, t, f_xw: FourWheels(f_xw), f_yw: FourWheels(f_yw) }
}

/// V_xw and V_yw; only the front wheels steer.
#[inline]
fn hub_velocities<T: Scalar>(d: &D, x: &X<T>, steering: Rotation<T>) -> [FourWheels<T>; 2] {
    let v_x = FourWheels::<T>::from_fn(|i| x.u - x.r * d.y[i]);
    let v_y = FourWheels::<T>::from_fn(|i| x.v + x.r * d.x[i]);
    let turned = |i: usize| if axle_of(i) == 0 { steering.into_frame([v_x[i], v_y[i]]) } else { [v_x[i], v_y[i]] };
    [FourWheels::from_fn(|i| turned(i)[0]), FourWheels::from_fn(|i| turned(i)[1])]
}

/// Tire forces along the axes of the car.
struct Forces<T> {
    f_x: FourWheels<T>,
    f_y: FourWheels<T>,
}

#[inline]
fn forces_on_car<T: Scalar>(tires: &Tires<T>, steering: Rotation<T>) -> Forces<T> {
    let f: [[T; 2]; 4] = std::array::from_fn(|i| {
        let f_w = [tires.f_xw[i], tires.f_yw[i]];
        if axle_of(i) == 0 { steering.out_of_frame(f_w) } else { f_w }
    });
    Forces { f_x: FourWheels::from_fn(|i| f[i][0]), f_y: FourWheels::from_fn(|i| f[i][1]) }
}

/// Accelerations of the reference point and of the body.
struct Accelerations<T> {
    ud: T,
    vd: T,
    rd: T,
    zdd: T,
    phidd: T,
    thetadd: T,
}

/// Motion in the plane with roll and pitch (eqs. 1, 3, 7, 11, and equations that the paper omits):
/// M (ud, vd, rd, phidd, thetadd) = q, with M_phitheta = M_uv = M_uphi = M_vtheta = 0.
#[inline]
fn body<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, f_s: &FourWheels<T>, f: &Forces<T>) -> Accelerations<T> {
    let q = right_side(p, d, x, f_s, f);
    let m = mass_matrix(p, d, x);
    // The blocks of (ud, thetadd) and (vd, phidd) are constant and coupled only through rd, so they are eliminated
    // first. `free` contains their accelerations for rd = 0, and `back` the decrease of these accelerations per unit of
    // rd.
    let times = |block: &[[f64; 2]; 2], w: [T; 2]| block.map(|row| w[0] * row[0] + w[1] * row[1]);
    let dot = |v: [T; 2], w: [T; 2]| v[0] * w[0] + v[1] * w[1];
    let (with_u, with_v) = ([m.ur, m.rtheta], [m.vr, m.rphi]);
    let (free_u, free_v) = (times(&d.u_theta, [q.u, q.theta]), times(&d.v_phi, [q.v, q.phi]));
    let (back_u, back_v) = (times(&d.u_theta, with_u), times(&d.v_phi, with_v));
    let rd = (q.r - dot(with_u, free_u) - dot(with_v, free_v)) / (m.rr - dot(with_u, back_u) - dot(with_v, back_v));
    let [ud, thetadd] = [0, 1].map(|i| free_u[i] - back_u[i] * rd);
    let [vd, phidd] = [0, 1].map(|i| free_v[i] - back_v[i] * rd);
    let zdd = FourWheels::sum_of(|i| f_s[i]).over(d.m_s);
    Accelerations { ud, vd, rd, zdd, phidd, thetadd }
}

/// A and B: the body's center of mass ahead and to the right of the reference point.
#[inline]
fn body_center<T: Scalar>(p: &EspCar, d: &D, x: &X<T>) -> (T, T) {
    (x.theta * p.h_b + d.e, x.phi * p.h_b)
}

struct RightSide<T> {
    u: T,
    v: T,
    r: T,
    phi: T,
    theta: T,
}

#[inline]
fn right_side<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, f_s: &FourWheels<T>, f: &Forces<T>) -> RightSide<T> {
    let X { u, v, r, phi, theta, phid, thetad, .. } = *x;
    let (m_s, h_b) = (p.m_s, p.h_b);
    let f_x = FourWheels::sum_of(|i| f.f_x[i]);
    let f_y = FourWheels::sum_of(|i| f.f_y[i]);
    let m_z = FourWheels::sum_of(|i| f.f_y[i] * d.x[i] - f.f_x[i] * d.y[i]);

    let (a, b) = body_center(p, d, x);
    let (v_x, v_y) = (u + thetad * h_b + r * b, v - phid * h_b + r * a);
    let (o_1, o_2) = (phid - r * theta, thetad + r * phi);
    let p_u = v_x * m_s + u * d.m_w;
    let p_v = v_y * m_s + v * d.m_w + r * d.s_1;
    RightSide {
        u: r * p_v + f_x - r * phid * (m_s * h_b),
        v: -r * p_u + f_y - r * thetad * (m_s * h_b),
        r: v * p_u - u * p_v + m_z
            - ((phid * v_x + b * r * phid + thetad * v_y + a * r * thetad) * (m_s * h_b)
                + (theta * r * thetad - thetad * o_1) * p.i_x
                + (phid * o_2 + phi * r * phid) * p.i_y
                - (phid * thetad + r * (phi * phid + theta * thetad) * 2.0) * p.i_z),
        phi: (r * v_x + phi * p.g + r * thetad * h_b) * (m_s * h_b)
            + r * (o_2 * p.i_y - thetad * p.i_z - r * phi * p.i_z + thetad * p.i_x)
            + FourWheels::sum_of(|i| f_s[i] * d.y[i]),
        theta: (r * v_y + theta * p.g - r * phid * h_b) * (m_s * h_b)
            - r * (o_1 * p.i_x + r * theta * p.i_z + phid * (p.i_y - p.i_z))
            - FourWheels::sum_of(|i| f_s[i] * (d.x[i] - d.e)),
    }
}

/// Elements of the mass matrix M that change with roll and pitch: the row of the yaw acceleration.
struct MassMatrix<T> {
    ur: T,
    vr: T,
    rr: T,
    rphi: T,
    rtheta: T,
}

#[inline]
fn mass_matrix<T: Scalar>(p: &EspCar, d: &D, x: &X<T>) -> MassMatrix<T> {
    let (m_s, h_b) = (p.m_s, p.h_b);
    let (a, b) = body_center(p, d, x);
    MassMatrix {
        ur: b * m_s,
        vr: a * m_s + d.s_1,
        rr: (a.squared() + b.squared()) * m_s
            + x.theta.squared() * (p.i_x - p.i_z)
            + x.phi.squared() * (p.i_y - p.i_z)
            + (p.i_z + d.i_w),
        rphi: -a * (m_s * h_b) - x.theta * p.i_x,
        rtheta: b * (m_s * h_b) + x.phi * (p.i_y - p.i_z),
    }
}

/// G: load that reaches the tires through the links, at the height of the roll axis, and through the inertia of the
/// wheels.
#[inline]
fn load_of_links<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, body: &Accelerations<T>, f: &Forces<T>) -> FourWheels<T> {
    let X { u, v, r, phid, .. } = *x;
    let Accelerations { ud, vd, rd, thetadd, .. } = *body;
    let (a, b) = body_center(p, d, x);
    let a_xs = ud - v * r + thetadd * p.h_b + rd * b + r * phid * (2.0 * p.h_b) - r.squared() * a;
    let a_xw = ud - v * r - r.squared() * d.x_w;
    let g_x = (a_xs * (d.h_ra * p.m_s) + a_xw * (p.h_u * d.m_w)) * 0.5.over(d.wheelbase);
    let g_y = TwoAxles::<T>::from_fn(|j| {
        let a_y = vd + u * r + rd * d.x[2 * j];
        let f_y = f.f_y[2 * j] + f.f_y[2 * j + 1];
        (f_y * d.h_ra - a_y * ((d.h_ra - p.h_u) * 2.0 * p.m_u[j])).over(d.track)
    });
    FourWheels::from_fn(|i| g_y[axle_of(i)] * left_is_positive(i) + if axle_of(i) == 0 { g_x } else { -g_x })
}

/// Vertical and angular acceleration of the wheels.
struct Wheels<T> {
    zdd_u: FourWheels<T>,
    omegad: FourWheels<T>,
}

/// Eqs. 5 and 13.
#[inline]
fn wheels<T: Scalar>(
    p: &EspCar,
    d: &D,
    inputs: &U<T>,
    Suspension { f_s, f_z, .. }: &Suspension<T>,
    tires: &Tires<T>,
    g: &FourWheels<T>,
    t_b: &FourWheels<T>,
) -> Wheels<T> {
    Wheels {
        zdd_u: FourWheels::from_fn(|i| (f_z[i] - d.f_z0[i] - f_s[i] + g[i]).over(d.m_u[axle_of(i)])),
        omegad: FourWheels::from_fn(|i| (inputs.t_d[i] - t_b[i] - tires.f_xw[i] * p.radius).over(d.j_w)),
    }
}

pub(crate) fn derivatives<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, u: &U<T>) -> X<T> {
    let m = motion(p, d, x, u);
    let [xd, yd] = m.heading.out_of_frame([x.u, x.v]);
    X {
        x: xd,
        y: yd,
        psi: x.r,
        u: m.body.ud,
        v: m.body.vd,
        r: m.body.rd,
        z: x.zd,
        phi: x.phid,
        theta: x.thetad,
        zd: m.body.zdd,
        phid: m.body.phidd,
        thetad: m.body.thetadd,
        z_u: x.zd_u,
        zd_u: m.wheels.zdd_u,
        omega: m.wheels.omegad,
    }
}

pub(crate) fn outputs<T: Scalar>(p: &EspCar, d: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let Motion { suspension, tires, body, .. } = motion(p, d, x, u);
    let Accelerations { ud, vd, rd, zdd, phidd, thetadd } = body;
    let f_z = suspension.f_z;
    Y {
        a_x: ud - x.v * x.r,
        a_y: vd + x.u * x.r,
        beta: x.v.atan2((x.u.squared() + T::from(p.v_eps).squared()).sqrt()),
        rd,
        ltr: suspension::load_transfer_ratio(f_z[0] + f_z[2], f_z[1] + f_z[3]),
        zdd,
        phidd,
        thetadd,
        corner: FourWheels::from_fn(|i| zdd + phidd * d.y[i] - thetadd * (d.x[i] - d.e)),
        d_s: suspension.d_s,
        dd_s: suspension.dd_s,
        d_t: suspension.d_t,
        f_z,
        f_xw: tires.f_xw,
        f_yw: tires.f_yw,
        alpha: FourWheels(T::atan_each(tires.t.0)),
        s: tires.s,
    }
}
