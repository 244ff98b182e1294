//! Equations of motion, in the order of computation: suspension, tires, motion in the plane with roll and pitch, wheels.
//! The numbers are those of the paper; corrections are listed in the README.
//!
//! | symbol | meaning |
//! |---|---|
//! | x, y (wheel) | position of a wheel in front of and to the left of the reference point, the ground projection of the center of mass |
//! | u, v, r, psi | longitudinal and lateral velocity of the reference point, yaw rate, heading |
//! | z, phi, theta | heave, roll and pitch of the body |
//! | e, H (h_b) | body's center of mass ahead of the reference point, and over the roll and pitch axis |
//! | A, B | the same with roll and pitch: ahead by A = e + H theta, to the right by B = H phi |
//! | V_x, V_y, p_u, p_v | velocity of the body's center of mass, momentum of the vehicle |
//! | O_1, O_2 | angular velocity of the body about its longitudinal and lateral axis |
//! | z_u, z_r | height of a wheel and of the road under it |
//! | d, F, f | deflection of the suspension (compression negative), force on the body, force of the actuator |
//! | F_z, F_z0 | tire load, and at rest |
//! | delta, V_xw, V_yw | steering angle of a wheel, velocity of its hub along and across its plane |
//! | s, t | longitudinal slip, tangent of the slip angle |
//! | F_xw, F_yw, f_x, f_y | tire force along and across the plane of the wheel, and along the axes of the car |
//! | G | load that the links carry from axle to axle and from side to side (up positive) |
//! | T_d, T_b, omega | drive and brake torque, speed of rotation of a wheel |
//!
//! One more d at the end of a name is one more derivative with respect to time: zd, zdd.

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
             body's center of mass is {h_s:.3} m over ground, and the roll axis would lie below it",
            p.h_b
        ));
    }
    let i_w: f64 = (0..4).map(|i| m_i[i] * (x[i] * x[i] + y[i] * y[i])).sum();
    let wheelbase = p.a + p.b;
    let loads = [p.b, p.a].map(|arm| m * p.g * arm / (2.0 * wheelbase));
    // [[m, c], [c, i + m_s H^2]]: never singular, because the wheels do not turn with the body.
    let c = p.m_s * p.h_b;
    let inverse = |c: f64, i: f64| {
        let i = i + p.m_s * p.h_b * p.h_b;
        let determinant = m * i - c * c;
        [[i / determinant, -c / determinant], [-c / determinant, m / determinant]]
    };
    Ok(D {
        m,
        i_vehicle: p.i_z + i_w + p.m_s * e * e,
        f_z0: FourWheels::from_fn(|i| loads[axle_of(i)]),
        m_w,
        e,
        h_ra: h_s - p.h_b,
        x,
        y,
        i_w,
        per_f_z0: std::array::from_fn(|i| 1.0 / loads[axle_of(i)]),
        per_m_s: 1.0 / p.m_s,
        per_m_u: p.m_u.0.map(|m_u| 1.0 / m_u),
        per_m_w: 1.0 / m_w,
        per_j_w: 1.0 / p.j_w,
        per_w_eps: 1.0 / p.w_eps,
        per_track: 1.0 / p.track,
        per_wheelbase: 1.0 / wheelbase,
        u_theta: inverse(c, p.i_y),
        v_phi: inverse(-c, p.i_x),
    })
}

/// Everything that follows from state and inputs.
struct Motion<T> {
    sin_psi: T,
    cos_psi: T,
    d: FourWheels<T>,
    dd: FourWheels<T>,
    t_z: FourWheels<T>,
    f_z: FourWheels<T>,
    s: FourWheels<T>,
    t: FourWheels<T>,
    f_xw: FourWheels<T>,
    f_yw: FourWheels<T>,
    ud: T,
    vd: T,
    rd: T,
    zdd: T,
    phidd: T,
    thetadd: T,
    zdd_u: FourWheels<T>,
    omegad: FourWheels<T>,
}

/// Slip, tangent of the slip angle and force of the tires.
struct Contacts<T> {
    s: FourWheels<T>,
    t: FourWheels<T>,
    f_xw: FourWheels<T>,
    f_yw: FourWheels<T>,
}

/// The tires at the loads `f_z`: all wheels at once.
#[inline]
fn contacts<T: Scalar>(
    p: &EspCar,
    k: &D,
    f_z: &FourWheels<T>,
    friction: &FourWheels<T>,
    omega: &FourWheels<T>,
    [v_xw, v_yw]: [FourWheels<T>; 2],
) -> Contacts<T> {
    let one = T::from(1.0);
    let rolling = FourWheels::from_fn(|i| omega[i] * p.radius);
    let sliding = FourWheels::<T>::from_fn(|i| rolling[i] - v_xw[i]);
    // Squares of speeds.
    let v_eps = T::from(p.v_eps * p.v_eps);
    let along = FourWheels::<T>::from_fn(|i| v_xw[i].squared());
    let fastest = FourWheels::<T>::from_fn(|i| Scalar::max(along[i], rolling[i].squared()));
    let s = FourWheels::<T>::from_fn(|i| Scalar::clamp(sliding[i] / (fastest[i] + v_eps).sqrt(), -one, one));
    let t = FourWheels::<T>::from_fn(|i| v_yw[i] / (along[i] + v_eps).sqrt());
    let shape = FourWheels::<T>::from_fn(|i| {
        let n = Scalar::clamp(f_z[i] * k.per_f_z0[i], T::from(0.0), T::from(3.0));
        n * (-n * p.q + (1.0 + p.q))
    });
    let mu = FourWheels::<T>::from_fn(|i| {
        let loss = (sliding[i].squared() + v_yw[i].squared()).sqrt() * p.a_s;
        Scalar::max(-loss + 1.0, T::from(p.mu_floor)) * p.mu_0 * friction[i]
    });
    let c = [&p.c_kappa, &p.c_alpha].map(|c| std::array::from_fn(|i| shape[i] * c[axle_of(i)]));
    let mu_n = std::array::from_fn(|i| mu[i] * f_z[i]);
    let [f_xw, f_yw] = tire::dugoff_each(c, mu_n, s.0, t.0);
    Contacts { s, t, f_xw: FourWheels(f_xw), f_yw: FourWheels(f_yw) }
}

#[inline]
fn motion<T: Scalar>(p: &EspCar, k: &D, x: &X<T>, inputs: &U<T>) -> Motion<T> {
    let X { u, v, r, phi, theta, phid, thetad, .. } = *x;
    let (m_s, h_b) = (p.m_s, p.h_b);
    // Left and right wheels side by side.
    let sum = |f: &dyn Fn(usize) -> T| (f(0) + f(2)) + (f(1) + f(3));

    // Functions first: a call in the middle would spill what is in registers. Each number by itself, because the array form
    // would wait for the stores of an array that is put together here.
    let (sine, cosine) = inputs.delta[0].sin_cos();
    let (sin_psi, cos_psi) = x.psi.sin_cos();
    let turning = T::tanh_each(x.omega.0.map(|omega| omega * k.per_w_eps));

    // Suspension and tire springs (eqs. 4-6): the left side rises with positive roll, the front sinks with positive pitch.
    let arm: [f64; 4] = std::array::from_fn(|i| k.x[i] - k.e);
    let d = FourWheels::from_fn(|i| x.z + phi * k.y[i] - theta * arm[i] - x.z_u[i]);
    let dd = FourWheels::from_fn(|i| x.zd + phid * k.y[i] - thetad * arm[i] - x.zd_u[i]);
    let bar =
        TwoAxles::<T>::from_fn(|j| (phi - (x.z_u[2 * j] - x.z_u[2 * j + 1]) * k.per_track) * (p.k_a[j] * k.per_track));
    let f_s = FourWheels::<T>::from_fn(|i| {
        let j = axle_of(i);
        suspension::spring_damper(p.k_s[j], p.c_s[j], d[i], dd[i]) + inputs.f[i] - bar[j] * left_is_positive(i)
    });
    let t_z = FourWheels::from_fn(|i| x.z_u[i] - inputs.z_r[i]);
    let f_z = FourWheels::<T>::from_fn(|i| suspension::tire_load(k.f_z0[i], p.k_t, t_z[i], true));

    // Tires; only the front wheels steer.
    let along = FourWheels::<T>::from_fn(|i| u - r * k.y[i]);
    let across = FourWheels::<T>::from_fn(|i| v + r * k.x[i]);
    let v_xw = FourWheels::from_fn(|i| if axle_of(i) == 0 { along[i] * cosine + across[i] * sine } else { along[i] });
    let v_yw = FourWheels::from_fn(|i| if axle_of(i) == 0 { across[i] * cosine - along[i] * sine } else { across[i] });
    let Contacts { s, t, f_xw, f_yw } = contacts(p, k, &f_z, &inputs.friction, &x.omega, [v_xw, v_yw]);
    let turned = |i: usize| {
        if axle_of(i) == 0 {
            [f_xw[i] * cosine - f_yw[i] * sine, f_xw[i] * sine + f_yw[i] * cosine]
        } else {
            [f_xw[i], f_yw[i]]
        }
    };
    let force: [[T; 2]; 4] = std::array::from_fn(turned);
    let f_x = sum(&|i| force[i][0]);
    let f_y = sum(&|i| force[i][1]);
    let m_z = sum(&|i| force[i][1] * k.x[i] - force[i][0] * k.y[i]);

    // Motion in the plane with roll and pitch (eqs. 1, 3, 7 and those the paper leaves out): M (ud, vd, rd, phidd,
    // thetadd) = q. S1 = sum m_i x_i is -m_s e.
    let (a, b) = (theta * h_b + k.e, phi * h_b);
    let s1 = -m_s * k.e;
    let (v_x, v_y) = (u + thetad * h_b + r * b, v - phid * h_b + r * a);
    let (o_1, o_2) = (phid - r * theta, thetad + r * phi);
    let p_u = v_x * m_s + u * k.m_w;
    let p_v = v_y * m_s + v * k.m_w + r * s1;
    let q_u = r * p_v + f_x - r * phid * (m_s * h_b);
    let q_v = -r * p_u + f_y - r * thetad * (m_s * h_b);
    let q_r = v * p_u - u * p_v + m_z
        - ((phid * v_x + b * r * phid + thetad * v_y + a * r * thetad) * (m_s * h_b)
            + (theta * r * thetad - thetad * o_1) * p.i_x
            + (phid * o_2 + phi * r * phid) * p.i_y
            - (phid * thetad + r * (phi * phid + theta * thetad) * 2.0) * p.i_z);
    let q_phi = (r * v_x + phi * p.g + r * thetad * h_b) * (m_s * h_b)
        + r * (o_2 * p.i_y - thetad * p.i_z - r * phi * p.i_z + thetad * p.i_x)
        + sum(&|i| f_s[i] * k.y[i]);
    let q_theta = (r * v_y + theta * p.g - r * phid * h_b) * (m_s * h_b)
        - r * (o_1 * p.i_x + r * theta * p.i_z + phid * (p.i_y - p.i_z))
        - sum(&|i| f_s[i] * arm[i]);
    let m_rr = (a.squared() + b.squared()) * m_s
        + theta.squared() * (p.i_x - p.i_z)
        + phi.squared() * (p.i_y - p.i_z)
        + (p.i_z + k.i_w);
    // The blocks of (ud, thetadd) and of (vd, phidd) are constant and meet only in rd: eliminate them, solve for rd.
    let with_u = [b * m_s, b * (m_s * h_b) + phi * (p.i_y - p.i_z)];
    let with_v = [a * m_s + s1, -a * (m_s * h_b) - theta * p.i_x];
    let times = |m: &[[f64; 2]; 2], q: [T; 2]| m.map(|row| q[0] * row[0] + q[1] * row[1]);
    let dot = |a: [T; 2], b: [T; 2]| a[0] * b[0] + a[1] * b[1];
    let (free_u, free_v) = (times(&k.u_theta, [q_u, q_theta]), times(&k.v_phi, [q_v, q_phi]));
    let (back_u, back_v) = (times(&k.u_theta, with_u), times(&k.v_phi, with_v));
    let rd = (q_r - dot(with_u, free_u) - dot(with_v, free_v)) / (m_rr - dot(with_u, back_u) - dot(with_v, back_v));
    let [ud, thetadd] = [0, 1].map(|i| free_u[i] - back_u[i] * rd);
    let [vd, phidd] = [0, 1].map(|i| free_v[i] - back_v[i] * rd);
    let zdd = sum(&|i| f_s[i]) * k.per_m_s;

    // Load that reaches the tires by the links, at the height of the roll axis, and the inertia of the wheels.
    let a_xs = ud - v * r + thetadd * h_b + rd * b + r * phid * (2.0 * h_b) - r.squared() * a;
    let a_xw = ud - v * r - r.squared() * (s1 * k.per_m_w);
    let g_x = (a_xs * (k.h_ra * m_s) + a_xw * (p.h_u * k.m_w)) * (0.5 * k.per_wheelbase);
    let g_y = TwoAxles::<T>::from_fn(|j| {
        let a_y = vd + u * r + rd * k.x[2 * j];
        let side = force[2 * j][1] + force[2 * j + 1][1];
        (side * k.h_ra - a_y * ((k.h_ra - p.h_u) * 2.0 * p.m_u[j])) * k.per_track
    });

    // Wheels (eqs. 5, 13).
    let zdd_u = FourWheels::from_fn(|i| {
        let j = axle_of(i);
        let links = g_y[j] * left_is_positive(i) + if j == 0 { g_x } else { -g_x };
        (f_z[i] - k.f_z0[i] - f_s[i] + links) * k.per_m_u[j]
    });
    let omegad = FourWheels::from_fn(|i| (inputs.t_d[i] - inputs.t_b[i] * turning[i] - f_xw[i] * p.radius) * k.per_j_w);
    Motion { sin_psi, cos_psi, d, dd, t_z, f_z, s, t, f_xw, f_yw, ud, vd, rd, zdd, phidd, thetadd, zdd_u, omegad }
}

pub(crate) fn derivatives<T: Scalar>(p: &EspCar, k: &D, x: &X<T>, u: &U<T>) -> X<T> {
    let m = motion(p, k, x, u);
    X {
        x: x.u * m.cos_psi - x.v * m.sin_psi,
        y: x.u * m.sin_psi + x.v * m.cos_psi,
        psi: x.r,
        u: m.ud,
        v: m.vd,
        r: m.rd,
        z: x.zd,
        phi: x.phid,
        theta: x.thetad,
        zd: m.zdd,
        phid: m.phidd,
        thetad: m.thetadd,
        z_u: x.zd_u,
        zd_u: m.zdd_u,
        omega: m.omegad,
    }
}

pub(crate) fn outputs<T: Scalar>(p: &EspCar, k: &D, x: &X<T>, u: &U<T>) -> Y<T> {
    let m = motion(p, k, x, u);
    Y {
        a_x: m.ud - x.v * x.r,
        a_y: m.vd + x.u * x.r,
        beta: x.v.atan2((x.u.squared() + T::from(p.v_eps).squared()).sqrt()),
        rd: m.rd,
        ltr: suspension::load_transfer_ratio(m.f_z[0] + m.f_z[2], m.f_z[1] + m.f_z[3]),
        zdd: m.zdd,
        phidd: m.phidd,
        thetadd: m.thetadd,
        corner: FourWheels::from_fn(|i| m.zdd + m.phidd * k.y[i] - m.thetadd * (k.x[i] - k.e)),
        d: m.d,
        dd: m.dd,
        t_z: m.t_z,
        f_z: m.f_z,
        f_xw: m.f_xw,
        f_yw: m.f_yw,
        alpha: FourWheels(T::atan_each(m.t.0)),
        s: m.s,
    }
}
