//! Reference values, closed forms and invariants of the equations of motion.
//!
//! "Reference values" were computed by an independent implementation of the model and are compared to their last
//! printed digit.

use approx::assert_abs_diff_eq;
use chassis_vehicle::mirror::mirrored;
use std::array;

use chassis_control::riccati::eigenvalues;
use fmu::simulation::ContinuousSimulation;
use fmu::{Dual64, Variables};
use nalgebra::DMatrix;
use proptest::prelude::*;

use super::*;

const STATES: usize = <X<f64> as Variables<f64>>::COUNTS.reals;
const INPUTS: usize = <U<f64> as Variables<f64>>::COUNTS.reals;
/// Indices of states.
const V: usize = 4;
const R: usize = 5;
const Z: usize = 6;

fn derived(p: &EspCar) -> D {
    equations::derived(p).unwrap()
}

fn derivatives(p: &EspCar, x: &X<f64>, u: &U<f64>) -> X<f64> {
    equations::derivatives(p, &derived(p), x, u)
}

fn outputs(p: &EspCar, x: &X<f64>, u: &U<f64>) -> Y<f64> {
    equations::outputs(p, &derived(p), x, u)
}

/// Driving straight ahead with rolling wheels.
fn straight(p: &EspCar, speed: f64) -> X<f64> {
    let mut x = X::default();
    let car = EspCar { u_0: speed, ..p.clone() };
    car.initialize(&derived(&car), &mut x);
    x
}

/// The state after `time` seconds with constant inputs, in steps of 1 ms.
fn simulated(p: &EspCar, x: &X<f64>, u: &U<f64>, time: f64) -> X<f64> {
    let mut run = ContinuousSimulation::new(p.clone()).unwrap();
    run.set_state(x);
    for _ in 0..(time / 1e-3).round() as u32 {
        run.step(u, 1e-3).unwrap();
    }
    run.state()
}

/// The Jacobian matrix of outputs or derivatives with respect to state and inputs, computed exactly with dual numbers.
fn linearized(p: &EspCar, x: &X<f64>, u: &U<f64>, of_outputs: bool) -> DMatrix<f64> {
    let d = derived(p);
    let (x, u) = (x.reals(), u.reals());
    let column = |j: usize| {
        let seeded = |values: &[f64], first: usize| -> Vec<Dual64> {
            let seed = |i: usize| if first + i == j { 1.0 } else { 0.0 };
            values.iter().enumerate().map(|(i, &value)| Dual64::new(value, seed(i))).collect()
        };
        let (x, u) = (X::from_reals(&seeded(&x[..STATES], 0)), U::from_reals(&seeded(&u[..INPUTS], STATES)));
        let results = if of_outputs {
            equations::outputs(p, &d, &x, &u).reals()
        } else {
            equations::derivatives(p, &d, &x, &u).reals()
        };
        results.into_iter().map(|result| result.eps).collect::<Vec<_>>()
    };
    let columns: Vec<_> = (0..STATES + INPUTS).map(column).collect();
    DMatrix::from_fn(columns[0].len(), STATES + INPUTS, |i, j| columns[j][i])
}

#[test]
fn at_rest_nothing_moves() {
    // Exactly 0, because every term has a factor of 0.
    let p = EspCar { u_0: 0.0, ..EspCar::default() };
    let rates = derivatives(&p, &straight(&p, 0.0), &U::default());
    assert!(rates.reals().iter().all(|&rate| rate == 0.0), "{rates:?}");
    // Loads m g b/(2 L) and m g a/(2 L): reference values.
    let y = outputs(&p, &straight(&p, 0.0), &U::default());
    assert_abs_diff_eq!(y.f_z[0], 3534.954, epsilon = 5e-4);
    assert_abs_diff_eq!(y.f_z[3], 3135.846, epsilon = 5e-4);
    assert_eq!((y.ltr, y.a_x, y.a_y, y.beta), (0.0, 0.0, 0.0, 0.0));
}

#[test]
fn the_geometry_has_the_reference_values() {
    let d = derived(&EspCar::default());
    assert_abs_diff_eq!(d.e, -0.010_166_7, epsilon = 5e-8);
    assert_abs_diff_eq!(d.h_ra, 0.478_667, epsilon = 5e-7);
    assert_abs_diff_eq!(d.m, 1360.0, epsilon = 0.0);
    assert_abs_diff_eq!(d.i_vehicle, data::YAW_INERTIA, epsilon = 5e-3);
}

#[test]
fn a_raised_road_raises_the_car() {
    // The tolerance covers the rounding of forces of 1e3 N that act on a mass of 35 kg.
    let p = EspCar::default();
    let x = X { z: 0.01, z_u: FourWheels([0.01; 4]), ..straight(&p, 0.0) };
    let u = U { z_r: FourWheels([0.01; 4]), ..U::default() };
    for rate in derivatives(&p, &x, &u).reals() {
        assert_abs_diff_eq!(rate, 0.0, epsilon = 1e-12);
    }
}

/// Energy of the car: kinetic energy to second order in the angles of the body, plus springs, anti-roll bars, tires and
/// weight.
fn energy<T: Scalar>(p: &EspCar, d: &D, x: &X<T>) -> T {
    let (a, b) = (x.theta * p.h_b + d.e, x.phi * p.h_b);
    let (v_x, v_y) = (x.u + x.thetad * p.h_b + x.r * b, x.v - x.phid * p.h_b + x.r * a);
    let (o_1, o_2) = (x.phid - x.r * x.theta, x.thetad + x.r * x.phi);
    let tilt = x.phi.squared() + x.theta.squared();
    let body = (v_x.squared() + v_y.squared() + x.zd.squared()) * p.m_s
        + o_1.squared() * p.i_x
        + o_2.squared() * p.i_y
        + (x.r.squared() * (-tilt + 1.0) - x.r * x.phi * x.thetad * 2.0) * p.i_z
        - tilt * (p.m_s * p.g * p.h_b);
    let wheels = (0..4).map(|i| {
        let j = axle_of(i);
        let deflection = x.z + x.phi * d.y[i] - x.theta * (d.x[i] - d.e) - x.z_u[i];
        let speed = (x.u - x.r * d.y[i]).squared() + (x.v + x.r * d.x[i]).squared() + x.zd_u[i].squared();
        speed * p.m_u[j] + x.omega[i].squared() * p.j_w + deflection.squared() * p.k_s[j] + x.z_u[i].squared() * p.k_t
    });
    let bars = (0..2).map(|j| (x.phi - (x.z_u[2 * j] - x.z_u[2 * j + 1]) / p.track).squared() * p.k_a[j]);
    (body + wheels.sum::<T>() + bars.sum::<T>()) * 0.5
}

/// Linear momentum along the axes of the road and angular momentum about their origin.
fn momentum(p: &EspCar, d: &D, x: &X<f64>) -> [f64; 3] {
    // The momenta are the derivatives of the kinetic energy with respect to u, v and r.
    let by = |place: usize| {
        let values: Vec<_> = x
            .reals()
            .into_iter()
            .enumerate()
            .map(|(i, value)| Dual64::new(value, if i == place { 1.0 } else { 0.0 }))
            .collect();
        energy(p, d, &X::from_reals(&values)).eps
    };
    let (p_u, p_v, about) = (by(3), by(V), by(R));
    let (sine, cosine) = x.psi.sin_cos();
    let (p_x, p_y) = (p_u * cosine - p_v * sine, p_u * sine + p_v * cosine);
    [p_x, p_y, about + x.x * p_y - x.y * p_x]
}

/// A car that conserves energy: without dampers and friction, and with the unsprung masses at the height of the roll
/// axis.
fn conservative() -> EspCar {
    let p = EspCar { c_s: TwoAxles([0.0; 2]), mu_0: 1e-12, ..EspCar::default() };
    let m = derived(&p).m;
    EspCar { h_u: p.h - p.m_s * p.h_b / m, ..p }
}

#[test]
fn energy_and_momentum_are_conserved_without_friction() {
    let p = conservative();
    let d = derived(&p);
    assert_abs_diff_eq!(p.h_u, 0.456_470_6, epsilon = 5e-8);
    assert_abs_diff_eq!(d.h_ra, p.h_u, epsilon = 1e-15);
    let start = X { v: 1.0, r: 2.0, phi: 0.05, theta: 0.03, z: 0.02, phid: 0.3, ..straight(&p, 10.0) };
    let end = simulated(&p, &start, &U::default(), 2.0);
    // Reference values.
    assert_abs_diff_eq!(energy(&p, &d, &start), 74_071.716_1, epsilon = 5e-5);
    for (actual, expected) in [
        (end.x, 20.028_088),
        (end.y, 1.938_985),
        (end.psi, 3.995_619),
        (end.phi, -0.025_669),
        (end.theta, 0.025_470),
        (end.z, -0.008_142),
    ] {
        assert_abs_diff_eq!(actual, expected, epsilon = 5e-7);
    }
    let (first, last) = (momentum(&p, &d, &start), momentum(&p, &d, &end));
    assert_abs_diff_eq!(first[0], 13_616.8, epsilon = 0.05);
    assert_abs_diff_eq!(first[1], 1319.68, epsilon = 5e-3);
    assert_abs_diff_eq!(first[2], 3_078.706_963, epsilon = 5e-7);
    // The tolerance covers the integration error with steps of 0.1 ms, which is (0.1 ms)^4 times the fifth derivative
    // of motions at 10 Hz.
    assert_abs_diff_eq!(energy(&p, &d, &end) / energy(&p, &d, &start), 1.0, epsilon = 1e-10);
    for i in 0..3 {
        assert_abs_diff_eq!(last[i], first[i], epsilon = 1e-10 * 14e3);
    }
}

/// A state of usual size: angles and heights up to 0.1, rates up to 1, speeds up to 20.
fn any_state() -> impl Strategy<Value = X<f64>> {
    (prop::array::uniform24(-1.0..1.0_f64), -20.0..20.0_f64).prop_map(|(values, speed)| {
        let mut x = X::from_reals(&values);
        x.u = speed;
        for small in [&mut x.z, &mut x.phi, &mut x.theta] {
            *small *= 0.1;
        }
        x.z_u = FourWheels::from_fn(|i| 0.05 * x.z_u[i]);
        x.omega = FourWheels::from_fn(|i| 70.0 * x.omega[i]);
        x
    })
}

fn any_inputs() -> impl Strategy<Value = U<f64>> {
    let four = |least: f64, most: f64| prop::array::uniform4(least..most).prop_map(FourWheels);
    (-0.5..0.5, four(-0.05, 0.05), four(0.0, 1.0), four(-1500.0, 1500.0), four(0.0, 1500.0), four(-500.0, 500.0))
        .prop_map(|(delta, z_r, friction, f, t_b, t_d)| U { delta: FrontAxle([delta]), z_r, friction, f, t_b, t_d })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Without friction, only dampers, drive and brakes change the energy. The tolerance of 1e-8 W covers the rounding
    /// in sums of terms up to 1e6 W.
    #[test]
    fn the_energy_balance_closes(x in any_state(), u in any_inputs()) {
        let p = EspCar { c_s: TwoAxles([560.0, 400.0]), mu_0: 0.0, ..conservative() };
        let d = derived(&p);
        // Flat road, no actuators; the wheels stay on the road.
        let u = U { z_r: FourWheels::default(), f: FourWheels::default(), ..u };
        let x = X { z_u: FourWheels::from_fn(|i| 0.4 * x.z_u[i]), ..x };
        let rates = equations::derivatives(&p, &d, &x, &u);
        let moving: Vec<_> = x.reals().into_iter().zip(rates.reals()).map(|(x, d)| Dual64::new(x, d)).collect();
        let power = energy(&p, &d, &X::from_reals(&moving)).eps;
        let y = equations::outputs(&p, &d, &x, &u);
        let dampers: f64 = (0..4).map(|i| -p.c_s[axle_of(i)] * y.dd_s[i] * y.dd_s[i]).sum();
        let wheels: f64 = (0..4).map(|i| x.omega[i] * (u.t_d[i] - u.t_b[i] * (x.omega[i] / p.w_eps).tanh())).sum();
        prop_assert!((power - dampers - wheels).abs() <= 1e-8, "{} W of {power} W", power - dampers - wheels);
    }

    /// Mirroring only changes the order of sums, so results differ by a few roundings of the largest value.
    #[test]
    fn the_car_is_symmetric(x in any_state(), u in any_inputs()) {
        let p = EspCar::default();
        let d = derived(&p);
        let (xm, um) = (mirrored(&x), mirrored(&u));
        let pairs = [
            (
                mirrored(&equations::derivatives(&p, &d, &x, &u)).reals(),
                equations::derivatives(&p, &d, &xm, &um).reals(),
            ),
            (mirrored(&equations::outputs(&p, &d, &x, &u)).reals(), equations::outputs(&p, &d, &xm, &um).reals()),
        ];
        for (expected, actual) in pairs {
            let largest = expected.iter().fold(1.0_f64, |most, value| most.max(value.abs()));
            for (expected, actual) in expected.into_iter().zip(actual) {
                prop_assert!((expected - actual).abs() <= 1e-13 * largest, "{expected} {actual}");
            }
        }
    }

    /// Newton's law in the vertical direction: loads and weight accelerate body and wheels; the forces in the links
    /// cancel. The tolerance covers roundings of 1e5 N.
    #[test]
    fn the_vertical_forces_balance(x in any_state(), u in any_inputs()) {
        let p = EspCar::default();
        let d = derived(&p);
        let (rates, y) = (equations::derivatives(&p, &d, &x, &u), equations::outputs(&p, &d, &x, &u));
        let inertia: f64 = p.m_s * rates.zd + (0..4).map(|i| p.m_u[axle_of(i)] * rates.zd_u[i]).sum::<f64>();
        // The actuator forces cancel, because they act between wheels and body.
        let loads: f64 = y.f_z.iter().sum::<f64>() - d.m * p.g;
        prop_assert!((inertia - loads).abs() <= 1e-9, "{inertia} {loads}");
    }

    /// A tire never pulls, its force stays within the friction limit, and slips are finite at any speed.
    #[test]
    fn tire_forces_stay_within_friction(x in any_state(), u in any_inputs(), standing: bool) {
        let p = EspCar::default();
        let x = if standing { X { u: 0.0, v: 0.0, r: 0.0, omega: FourWheels::default(), ..x } } else { x };
        let y = outputs(&p, &x, &u);
        prop_assert!(y.reals().iter().all(|value| value.is_finite()));
        prop_assert!((-1.0..=1.0).contains(&y.ltr));
        for i in 0..4 {
            prop_assert!(y.f_z[i] >= 0.0 && y.s[i].abs() <= 1.0);
            let force = y.f_xw[i].hypot(y.f_yw[i]);
            prop_assert!(force <= p.mu_0 * u.friction[i] * y.f_z[i] * (1.0 + 1e-14), "{force}");
        }
    }
}

/// State and outputs per front steering angle in a steady turn of the linear model at 60 km/h.
fn steady_turn(p: &EspCar) -> (X<f64>, Y<f64>) {
    let x = straight(p, data::SPEED);
    let jacobian = linearized(p, &x, &U::default(), false);
    // All states except position and heading, which are not steady, and speed, which does not change to first order.
    let kept = STATES - V;
    let a = jacobian.view((V, V), (kept, kept)).into_owned();
    let b = jacobian.view((V, STATES), (kept, 1)).into_owned();
    let steady = a.lu().solve(&-b).unwrap();
    let mut point = DMatrix::zeros(STATES + INPUTS, 1);
    point.view_mut((V, 0), (kept, 1)).copy_from(&steady);
    point[(STATES, 0)] = 1.0;
    let y = linearized(p, &x, &U::default(), true) * &point;
    (X::from_reals(&point.as_slice()[..STATES]), Y::from_reals(y.as_slice()))
}

#[test]
fn a_steady_turn_matches_the_single_track_model() {
    let p = EspCar::default();
    let (x, y) = steady_turn(&p);
    // K = m (b K_r - a K_f)/(L^2 K_f K_r) with the axle stiffnesses K_f and K_r, gain u/(L (1 + K u^2)).
    let (k_f, k_r, wheelbase) = (2.0 * p.c_alpha[0], 2.0 * p.c_alpha[1], p.a + p.b);
    let stability = derived(&p).m * (p.b * k_r - p.a * k_f) / (wheelbase * wheelbase * k_f * k_r);
    assert_abs_diff_eq!(stability, 7.999_03e-4, epsilon = 5e-10);
    let gain = data::SPEED / (wheelbase * (1.0 + stability * data::SPEED * data::SPEED));
    assert_abs_diff_eq!(gain, 5.827_63, epsilon = 5e-6);
    // Not exactly 1: smoothing the slip angles by 0.5 m/s softens the tires by 4.5e-4, and loads and body angles
    // change.
    assert_abs_diff_eq!(x.r / gain, 0.999_91, epsilon = 1e-5);
    // The roll angle follows from the balance of moments on the body and on each axle, which rolls on its tires and
    // carries G.
    let d = derived(&p);
    let w = p.track / 2.0;
    let k = [0, 1].map(|j| 2.0 * w * w * p.k_s[j] + p.k_a[j]);
    assert_abs_diff_eq!(k[0] + k[1], 46_682.8, epsilon = 5e-2); // reference value
    let weight = p.m_s * p.g * p.h_b;
    let tires = 2.0 * w * w * p.k_t;
    let balance =
        nalgebra::Matrix3::new(k[0] + k[1] - weight, -k[0], -k[1], -k[0], k[0] + tires, 0.0, -k[1], 0.0, k[1] + tires);
    let carried = |j: usize, arm: f64| d.h_ra * d.m * arm / wheelbase - (d.h_ra - p.h_u) * 2.0 * p.m_u[j];
    let moments = nalgebra::Vector3::new(p.m_s * p.h_b, carried(0, p.b), carried(1, p.a));
    let roll = balance.lu().solve(&moments).unwrap()[0];
    assert_abs_diff_eq!(roll, 0.006_986_43, epsilon = 5e-9);
    assert_abs_diff_eq!(x.phi / y.a_y, roll, epsilon = 1e-12);
    // The load transfer follows from moments about the road: 2 h/(g track), plus the weight of the leaning body.
    let transfer = (d.m * p.h + weight * roll) / (w * d.m * p.g);
    assert_abs_diff_eq!(y.ltr / y.a_y, transfer, epsilon = 1e-12);
    // With stiff tires, whose compliance is 1e-5 of the springs' compliance, the roll gradient is m_s H/(K_phi - m_s g
    // H).
    let rigid = EspCar { k_t: 1e9, ..p };
    let (x, y) = steady_turn(&rigid);
    assert_abs_diff_eq!(x.phi / y.a_y, 0.003_730_5, epsilon = 1e-6);
}

#[test]
fn the_vertical_modes_have_the_reference_values() {
    // Frequencies in Hz, and damping ratios where the reference gives them, at 60 km/h straight ahead.
    let p = EspCar::default();
    let jacobian = linearized(&p, &straight(&p, data::SPEED), &U::default(), false);
    let poles = eigenvalues(&jacobian.view((Z, Z), (14, 14)).into_owned()).unwrap();
    let near = |frequency: f64, damping: Option<f64>| {
        let is_near = |pole: &&nalgebra::Complex<f64>| {
            let modulus = fmu::math::hypot(pole.re, pole.im);
            let hertz = modulus / std::f64::consts::TAU;
            let digits = if frequency < 2.0 { 5e-5 } else { 6e-4 }; // 9.6165 is printed as 9.617
            (hertz - frequency).abs() <= digits
                && damping.is_none_or(|ratio| (-pole.re / modulus - ratio).abs() <= 5e-5)
        };
        assert_eq!(poles.iter().filter(is_near).count(), 2, "{frequency} Hz: {poles:?}");
    };
    near(1.1618, Some(0.0998)); // heave
    near(1.3331, Some(0.1178)); // pitch
    near(1.3526, Some(0.0825)); // roll
    for wheels in [9.385, 9.617, 10.565, 10.831] {
        near(wheels, None);
    }
}

#[test]
fn constant_braking_loads_the_front_axle() {
    // m a = -(sum T)/R while the wheels roll, where m includes their inertia. Slip, pitch and pitch rate change the
    // acceleration by less than 1e-3 of its value.
    let p = EspCar { max_step: 2.5e-4, ..EspCar::default() };
    let d = derived(&p);
    let u = U { t_b: FourWheels([300.0, 300.0, 120.0, 120.0]), ..U::default() };
    let x = simulated(&p, &straight(&p, 28.0), &u, 9.0);
    let y = outputs(&p, &x, &u);
    let rolling = -840.0 / p.radius / (d.m + 4.0 * p.j_w / (p.radius * p.radius));
    assert_abs_diff_eq!(rolling, -2.064_83, epsilon = 5e-6);
    assert_abs_diff_eq!(y.a_x / rolling, 1.0, epsilon = 1e-3);
    // The expected load on the front axle follows from the balance of moments about the rear contact points. After 9 s,
    // the pitch oscillation has decayed to exp(-9).
    let gain = y.f_z[0] + y.f_z[1] - 2.0 * d.f_z0[0];
    let expected = (d.m * -y.a_x * p.h + p.m_s * p.g * p.h_b * x.theta) / (p.a + p.b);
    assert_abs_diff_eq!(gain / expected, 1.0, epsilon = 1e-3);
}

#[test]
fn a_braked_car_stops_and_stays() {
    let p = EspCar::default();
    let u = U { t_b: FourWheels([1740.0, 1740.0, 690.0, 690.0]), ..U::default() };
    let stopped = simulated(&p, &straight(&p, 5.0), &u, 2.0);
    // The body oscillates on its springs above stopped wheels.
    assert!(stopped.u.abs() < 0.02, "{}", stopped.u);
    let later = simulated(&p, &stopped, &u, 3.0);
    assert_abs_diff_eq!(later.x, stopped.x, epsilon = 1e-3);
    assert!(later.u.abs() < stopped.u.abs().max(1e-3));
    // The distance is slightly more than v^2/(2 mu g), because friction decreases with the sliding speed.
    let distance = 25.0 / (2.0 * p.mu_0 * p.g);
    assert!((1.0..1.15).contains(&(stopped.x / distance)), "{}", stopped.x);
}

#[test]
fn a_car_in_the_air_has_no_tire_forces() {
    // For a wheel that is locked in the air, stiffness, friction and 1 - |s| are all 0.
    let p = EspCar::default();
    let x = X { z_u: FourWheels([1.0; 4]), omega: FourWheels::default(), v: 1.0, ..straight(&p, 1e3) };
    let y = outputs(&p, &x, &U::default());
    assert_eq!((*y.f_z, *y.f_xw, *y.f_yw, y.ltr), ([0.0; 4], [0.0; 4], [0.0; 4], 0.0));
}

#[test]
fn road_friction_is_a_factor() {
    let p = EspCar::default();
    let x = X { v: 8.0, ..straight(&p, 10.0) };
    let u = U { friction: FourWheels([0.5; 4]), ..U::default() };
    let half = outputs(&EspCar { mu_0: p.mu_0 / 2.0, ..p.clone() }, &x, &U::default());
    assert_eq!(*outputs(&p, &x, &u).f_yw, *half.f_yw);
}

#[test]
fn a_roll_axis_below_the_ground_is_rejected() {
    let message = |p: EspCar| equations::derived(&p).unwrap_err();
    assert_eq!(
        message(EspCar { h: 0.1, ..EspCar::default() }),
        "'geometry.body_cg_to_roll_axis' must be at most 0.075 m, got 0.14 m: with this 'geometry.cg_height' the \
         body's center of mass is 0.075 m over ground, and the roll axis would be below the ground"
    );
    // The center of mass may be on the roll axis.
    assert!(equations::derived(&EspCar { h_b: 0.0, h: 0.3, ..EspCar::default() }).is_ok());
}

#[test]
fn the_car_starts_at_its_initial_speed() {
    let x = straight(&EspCar::default(), 12.0);
    assert_eq!((x.u, *x.omega), (12.0, [12.0 / data::RADIUS; 4]));
    assert_eq!(array::from_fn::<_, 3, _>(|i| [x.x, x.v, x.z][i]), [0.0; 3]);
}

/// Reference: the definition of the slip, (R omega - u)/u for a wheel that rolls straight ahead.
#[test]
fn wheels_start_with_their_initial_slip() {
    let slips = FourWheels([0.0, 0.25, -0.5, -1.0]);
    let x = straight(&EspCar { s_0: slips, ..EspCar::default() }, 12.0);
    for i in 0..4 {
        assert_abs_diff_eq!((data::RADIUS * x.omega[i] - x.u) / x.u, slips[i], epsilon = 1e-15);
    }
    assert_eq!(x.u, 12.0);
}
