//! Reference values, closed forms and invariants of the equations of motion.
//!
//! "Reference values" were computed by an independent implementation of the model and are compared to their last
//! printed digit.

use approx::assert_abs_diff_eq;
use chassis_vehicle::mirror::mirrored;
use std::f64::consts::FRAC_PI_2;

use chassis_control::riccati::eigenvalues;
use chassis_vehicle::tire::MagicFormula;
use fmu::simulation::ContinuousSimulation;
use fmu::{Dual64, Variables};
use nalgebra::{Complex, DMatrix, Matrix2, Vector2};
use proptest::prelude::*;

use super::*;

const STATES: usize = <X<f64> as Variables<f64>>::COUNTS.reals;
const INPUTS: usize = <U<f64> as Variables<f64>>::COUNTS.reals;
/// Number of states except heading and position, on which nothing depends.
const MOVING: usize = STATES - 3;
// Indices in the state and in the inputs.
const GAMMA: usize = 9;
const DELTA: usize = 1;
const FORCES: usize = 2;

fn derived(p: &HydroPneumaticHalfCar) -> D {
    equations::derived(p).unwrap()
}

fn derivatives(p: &HydroPneumaticHalfCar, x: &X<f64>, u: &U<f64>) -> X<f64> {
    equations::derivatives(p, &derived(p), x, u)
}

fn outputs(p: &HydroPneumaticHalfCar, x: &X<f64>, u: &U<f64>) -> Y<f64> {
    equations::outputs(p, &derived(p), x, u)
}

/// The Jacobian matrices of the derivatives of the first [`MOVING`] states with respect to these states and to the
/// inputs when driving straight ahead, computed exactly with dual numbers.
fn linearized(p: &HydroPneumaticHalfCar, speed: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let d = derived(p);
    let (x, u) = (X::default().reals(), (U { v: speed, ..U::default() }).reals());
    let column = |j: usize| {
        let seeded = |values: &[f64], first: usize| -> Vec<Dual64> {
            let seed = |i: usize| if first + i == j { 1.0 } else { 0.0 };
            values.iter().enumerate().map(|(i, &value)| Dual64::new(value, seed(i))).collect()
        };
        let (x, u) = (X::from_reals(&seeded(&x[..STATES], 0)), U::from_reals(&seeded(&u[..INPUTS], STATES)));
        equations::derivatives(p, &d, &x, &u).reals().into_iter().map(|rate| rate.eps).collect::<Vec<_>>()
    };
    let columns: Vec<_> = (0..STATES + INPUTS).map(column).collect();
    (
        DMatrix::from_fn(MOVING, MOVING, |i, j| columns[j][i]),
        DMatrix::from_fn(MOVING, INPUTS, |i, j| columns[STATES + j][i]),
    )
}

/// Asserts that each of `expected` (real and imaginary part) is a pole to within 1e-3, the last printed digit.
#[track_caller]
fn assert_poles(a: &DMatrix<f64>, expected: &[(f64, f64)]) {
    let poles = eigenvalues(a).unwrap();
    for &(re, im) in expected {
        let nearest = poles
            .iter()
            .map(|pole: &Complex<f64>| fmu::math::hypot(pole.re - re, pole.im - im))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-3, "{re} + {im}i: {poles:?}");
    }
}

const LATERAL: (f64, f64) = (-9.831, 3.597);

#[test]
fn at_rest_it_stays_at_rest() {
    // The load is exactly m g/2 on each side.
    let (p, u) = (HydroPneumaticHalfCar::default(), U::default());
    let y = outputs(&p, &X::default(), &u);
    assert_eq!(y.n.0, [7970.625; 2]);
    assert_eq!(y.v, 70.0 / 3.6);
    let rates = derivatives(&p, &X::default(), &u);
    assert_eq!((X { x: 0.0, ..rates.clone() }).reals(), vec![0.0; STATES]);
    assert_eq!(rates.x, u.v);
}

#[test]
fn the_passive_poles_are_the_reference_values() {
    let (a, _) = linearized(&HydroPneumaticHalfCar::default(), data::SPEED);
    let heave = (-0.458, 6.217);
    let roll = (-0.923, 7.939);
    assert_poles(&a, &[heave, roll, (-9.985, 66.250), (-10.173, 66.129), LATERAL]);
}

#[test]
fn under_the_comfort_law_the_body_is_held_by_a_sky_hook() {
    // Linear part of the law (eqs. 15-23) with the parameters from Table 5 of the paper. The law uses the whole sprung
    // mass and the left wheel, and f_r = zeta f_l.
    let p = HydroPneumaticHalfCar::default();
    let (n1, n2, eta, zeta) = (-0.575, 0.6559, 11.0, 0.444);
    let (a, b) = linearized(&p, data::SPEED);
    let mut f_l = DMatrix::zeros(1, MOVING);
    // z_s, z_ul, and their rates: -(n1 x3 + n2 x4 + e/m_s + eta S) m_s
    for (state, surface, rate, strut) in
        [(0, n2, 0.0, -p.k_s), (2, n1, 0.0, p.k_s), (4, 1.0, n2, -p.c_s), (6, 0.0, n1, p.c_s)]
    {
        f_l[(0, state)] = -(rate + strut / p.m_s + eta * surface) * p.m_s;
    }
    let force = b.columns(FORCES, 2) * nalgebra::dmatrix![1.0; zeta];
    let expected = [(-1.508, 0.0), (-16.05, 0.0), (-0.959, 7.936), (-8.575, 60.107), (-10.146, 66.159), LATERAL];
    let poles = eigenvalues(&(a + force * f_l)).unwrap();
    for (re, im) in expected {
        // -16.05 is printed with two decimals.
        let nearest = poles
            .iter()
            .map(|pole: &Complex<f64>| fmu::math::hypot(pole.re - re, pole.im - im))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 5e-3, "{re} + {im}i: {poles:?}");
    }
}

/// The plant with the linear part of the handling law (eqs. 9-14), which demands a roll acceleration and cancels the
/// passive moments. `cancellation` is the share of the damper moment that it cancels.
fn under_the_handling_law(cancellation: f64) -> DMatrix<f64> {
    let p = HydroPneumaticHalfCar::default();
    let (rho, eta) = (5.0, 25.0);
    let (a, b) = linearized(&p, data::SPEED);
    // The roll acceleration becomes -(rho + eta) phid - rho eta phi, plus the remaining damper moment.
    let phid = 5;
    let mut wanted = DMatrix::zeros(1, MOVING);
    (wanted[(0, 1)], wanted[(0, phid)]) = (-rho * eta, -(rho + eta));
    let arm = p.t / 2.0;
    for (state, moment) in [(phid, -2.0 * arm * arm * p.c_s), (6, arm * p.c_s), (7, -arm * p.c_s)] {
        wanted[(0, state)] += (1.0 - cancellation) * moment / p.i_x;
    }
    let f_l = (wanted - a.row(phid)) * (p.i_x / p.t);
    let force = b.columns(FORCES, 2) * nalgebra::dmatrix![1.0; -1.0];
    a + force * f_l
}

#[test]
fn exact_cancellation_leaves_the_wheels_undamped() {
    // In the zero dynamics, the wheels move against each other without damping on their tires. The poles are +-j
    // sqrt(k_t/m_u).
    let p = HydroPneumaticHalfCar::default();
    let hop = (p.k_t / p.m_u).sqrt();
    assert_abs_diff_eq!(hop, 61.644, epsilon = 5e-4);
    let a = under_the_handling_law(1.0);
    assert_poles(&a, &[(-5.0, 0.0), (-25.0, 0.0), (0.0, hop), (-0.458, 6.217), (-9.985, 66.25), LATERAL]);
    // If the law does not cancel the damper, the mode is damped. With w, the height of the wheels against each other,
    // and the Laplace variable s: (s^2 + (rho + eta + 2 arm^2 c_s/I_x) s + rho eta) phi = (2 arm c_s/I_x) s w and (m_u
    // s^2 + k_t) w = -(I_x s^2 - m_s g h) phi/T. The roots were computed by another program, with three decimals.
    assert_poles(&under_the_handling_law(0.0), &[(-7.296, 56.356), (-33.164, 0.0), (-4.435, 0.0)]);
}

#[test]
fn the_yaw_gain_is_that_of_a_bicycle() {
    // Closed form of the linear bicycle model: v/(L + K v^2) with K = m/L (l_r/C_f - l_f/C_r) and the cornering
    // stiffness of two tires at rest. The tolerance covers the rounding of the linear solution.
    let p = HydroPneumaticHalfCar::default();
    let m = derived(&p).m;
    let n0 = derived(&p).n0;
    let length = p.l_f + p.l_r;
    let stiffness = |lever: f64| {
        let (mu, load, slope) = (Dual64::from(1.0), Dual64::from(n0 * lever / length), Dual64::new(0.0, -1.0));
        2.0 * MagicFormula::PASSENGER_CAR.lateral_each([mu], [load], [slope])[0].eps
    };
    let (c_f, c_r) = (stiffness(p.l_r), stiffness(p.l_f));
    assert_abs_diff_eq!(c_f, 122_328.2, epsilon = 0.05); // reference value
    assert_abs_diff_eq!(c_r, 107_553.6, epsilon = 0.05); // reference value
    let k = m / length * (p.l_r / c_f - p.l_f / c_r);
    assert_abs_diff_eq!(k, 0.00205070, epsilon = 5e-9); // reference value
    for (speed, yaw_gain, a_y_gain) in [(70.0 / 3.6, 4.87899, 94.869), (60.0 / 3.6, 4.40959, 73.493)] {
        let (a, b) = linearized(&p, speed);
        let steady = a.lu().solve(&(-b.column(DELTA))).unwrap();
        let gain = steady[GAMMA];
        assert_abs_diff_eq!(gain, speed / (length + k * speed * speed), epsilon = 1e-10);
        assert_abs_diff_eq!(gain, yaw_gain, epsilon = 5e-6); // reference value
        assert_abs_diff_eq!(gain * speed, a_y_gain, epsilon = 5e-4); // reference value
    }
}

/// Simulates 10 s from rest in steps of 1 ms.
fn after_ten_seconds(p: &HydroPneumaticHalfCar, u: &U<f64>) -> X<f64> {
    let mut run = ContinuousSimulation::new(p.clone()).unwrap();
    for _ in 0..10_000 {
        run.step(u, 0.001).unwrap();
    }
    run.state()
}

#[test]
fn a_steady_turn_has_the_reference_values() {
    // A turn with 0.002 rad at 70 km/h. The slowest mode (heave, 0.458 1/s) would have decayed only to exp(-4.6), but
    // the turn does not excite it.
    let p = HydroPneumaticHalfCar::default();
    let u = U { delta: FrontAxle([0.002]), ..U::default() };
    let x = after_ten_seconds(&p, &u);
    let y = outputs(&p, &x, &u);
    assert_abs_diff_eq!(x.gamma / 0.002, 4.87878, epsilon = 1e-4);
    assert_abs_diff_eq!(y.a_y, u.v * x.gamma, epsilon = 1e-6);

    // Roll angle and left wheel height per lateral acceleration, from two linear equations: moments about the roll axis
    // and forces on a wheel. After 10 s, the roll mode (0.923 1/s) has decayed to exp(-9).
    let arm = p.t / 2.0;
    let m_sh = p.m_s * p.h;
    let stiffness = Matrix2::new(2.0 * arm * arm * p.k_s - m_sh * p.g, -2.0 * arm * p.k_s, -arm * p.k_s, p.k_s + p.k_t);
    let load = Vector2::new(m_sh, p.m_s * p.h_r / p.t);
    let per_acceleration = stiffness.lu().solve(&load).unwrap();
    assert_abs_diff_eq!(per_acceleration[0], 0.0275344, epsilon = 5e-8); // reference value
    assert_abs_diff_eq!(per_acceleration[1], 0.00551321, epsilon = 5e-9); // reference value
    assert_abs_diff_eq!(x.phi / y.a_y, per_acceleration[0], epsilon = 1e-4 * per_acceleration[0] + 1e-5);
    assert_abs_diff_eq!(x.z_u[0] / y.a_y, per_acceleration[1], epsilon = 1e-4 * per_acceleration[1] + 1e-5);

    // The estimate and the ratio of the tire loads agree, because the model includes the force through the roll center.
    let ltr = 2.0 * p.m_s / (derived(&p).m * p.t) * ((p.h_r + p.h) / p.g + p.h * per_acceleration[0]);
    assert_abs_diff_eq!(ltr, 0.131421, epsilon = 5e-7); // reference value
    assert_abs_diff_eq!(y.ltr / y.a_y, ltr, epsilon = 1e-4);
    assert_abs_diff_eq!(y.ratio / y.a_y, ltr, epsilon = 1e-4);
    // Lateral acceleration at the threshold 0.8 of the switch, for the leaning passive vehicle and for an upright one.
    assert_abs_diff_eq!(0.8 / ltr, 6.09, epsilon = 5e-3); // reference value
    let upright = 2.0 * p.m_s / (derived(&p).m * p.t) * (p.h_r + p.h) / p.g;
    assert_abs_diff_eq!(0.8 / upright, 6.87, epsilon = 5e-3); // reference value
}

#[test]
fn without_the_force_through_the_roll_center_its_height_has_no_effect_on_the_loads() {
    // In a steady state, the tires then balance only the moment about the roll axis, and h_r is not in the closed form.
    // The tolerance covers the small-angle approximation and rounding.
    let p = HydroPneumaticHalfCar { geometric: 0.0, ..HydroPneumaticHalfCar::default() };
    let (a, b) = linearized(&p, data::SPEED);
    let delta = 1e-6;
    let steady = a.lu().solve(&(-b.column(DELTA) * delta)).unwrap();
    let mut values = X::default().reals();
    values[..MOVING].copy_from_slice(steady.as_slice());
    let x = X::from_reals(&values);
    let y = outputs(&p, &x, &U { delta: FrontAxle([delta]), ..U::default() });
    let expected = 2.0 * p.m_s * p.h / (derived(&p).m * p.t) * (y.a_y / p.g + x.phi);
    assert_abs_diff_eq!(y.ratio / expected, 1.0, epsilon = 1e-6);
    assert!(y.ratio < 0.6 * y.ltr);
}

#[test]
fn steady_forces_lift_or_turn_the_body() {
    // Equal forces lift the body by f/k_s and do not move the wheels. Opposite forces roll the body.
    let p = HydroPneumaticHalfCar::default();
    let steady = |f: [f64; 2]| {
        let (a, b) = linearized(&p, data::SPEED);
        a.lu().solve(&(-b.columns(FORCES, 2) * nalgebra::dmatrix![f[0]; f[1]])).unwrap()
    };
    let x = steady([1000.0; 2]);
    assert_abs_diff_eq!(x[0], 1000.0 / p.k_s, epsilon = 1e-12);
    assert_abs_diff_eq!(x[0], 0.0285714, epsilon = 5e-8); // reference value
    assert_abs_diff_eq!(x[2], 0.0, epsilon = 1e-12);
    let x = steady([1000.0, -1000.0]);
    assert_abs_diff_eq!(x[1], 0.0450662, epsilon = 5e-8); // reference value
    assert_abs_diff_eq!(x[2], 0.00102358, epsilon = 5e-9); // reference value
}

/// Kinetic and potential energy of the vehicle without lift-off on a flat road; it is 0 at rest.
fn energy<T: Scalar>(p: &HydroPneumaticHalfCar, x: &X<T>) -> T {
    let sides = (0..2).map(|i| {
        let d = x.z_s + x.phi * (p.t / 2.0 * [1.0, -1.0][i]) - x.z_u[i];
        d.squared() * p.k_s + x.z_u[i].squared() * p.k_t + x.zd_u[i].squared() * p.m_u
    });
    let body = x.zd_s.squared() * p.m_s + x.phid.squared() * p.i_x;
    (sides.sum::<T>() + body) * 0.5 + (x.phi.cos() - 1.0) * (p.m_s * p.g * p.h)
}

/// A state of usual size: positions up to 0.1, rates up to 1.
fn any_state() -> impl Strategy<Value = X<f64>> {
    prop::array::uniform13(-1.0..1.0f64).prop_map(|values| {
        let scaled: Vec<_> = values.iter().enumerate().map(|(i, v)| if i < 4 { 0.1 * v } else { *v }).collect();
        X::from_reals(&scaled)
    })
}

fn any_inputs() -> impl Strategy<Value = U<f64>> {
    let sides = |size: f64| prop::array::uniform2(-size..size).prop_map(Sides);
    (0.0..30.0, -0.5..0.5, sides(1e4), sides(0.05), prop::array::uniform2(0.0..1.0f64))
        .prop_map(|(v, delta, f, z_q, friction)| U { v, delta: FrontAxle([delta]), f, z_q, friction: Sides(friction) })
}

fn any_options() -> impl Strategy<Value = HydroPneumaticHalfCar> {
    (prop::bool::ANY, 0.0..1.0, 0.0..1.0, 0.0..1.5).prop_map(|(lift_off, c, geometric, mu)| HydroPneumaticHalfCar {
        lift_off,
        c,
        geometric,
        mu,
        ..HydroPneumaticHalfCar::default()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// At standstill on a flat road without actuators, only the dampers change the energy, and they reduce it. The
    /// tolerance of 1e-9 W covers the rounding in sums of terms up to 1e5 W.
    #[test]
    fn the_energy_balance_closes(x in any_state()) {
        let p = HydroPneumaticHalfCar { lift_off: false, ..HydroPneumaticHalfCar::default() };
        let u = U { v: 0.0, ..U::default() };
        let rates = derivatives(&p, &x, &u);
        let moving: Vec<_> = x.reals().into_iter().zip(rates.reals()).map(|(x, d)| Dual64::new(x, d)).collect();
        let power = energy(&p, &X::from_reals(&moving)).eps;
        let dampers: f64 = outputs(&p, &x, &u).dd_s.iter().map(|dd_s| -p.c_s * dd_s * dd_s).sum();
        prop_assert!(dampers <= 0.0);
        prop_assert!((power - dampers).abs() <= 1e-9, "{power} W, dampers {dampers} W");
    }

    /// Vertical and lateral momentum of the whole vehicle, and angular momentum about the line on the ground under its
    /// middle. The tolerances cover roundings of forces up to 1e5 N.
    #[test]
    fn the_momentum_balances_close(x in any_state(), u in any_inputs(), options in any_options()) {
        let p = HydroPneumaticHalfCar { geometric: 1.0, ..options };
        let (d, rates, y) = (derived(&p), derivatives(&p, &x, &u), outputs(&p, &x, &u));
        let (m_sh, arm) = (p.m_s * p.h, p.t / 2.0);
        let vertical = p.m_s * rates.zd_s + p.m_u * (rates.zd_u[0] + rates.zd_u[1]);
        prop_assert!((vertical - (y.n[0] + y.n[1] - 2.0 * d.n0)).abs() < 1e-9);
        let sway = d.m * y.a_y - p.c * m_sh * rates.phid;
        prop_assert!((sway - y.f_y.iter().sum::<f64>()).abs() < 1e-9);
        let roll = p.i_x * rates.phid + p.m_u * arm * (rates.zd_u[0] - rates.zd_u[1]);
        let load = arm * (y.n[0] - y.n[1]) + m_sh * p.g * x.phi.sin() + m_sh * y.a_y;
        let through_the_roll_center = p.m_s * p.h_r * (y.a_y - p.c * p.h * rates.phid);
        prop_assert!((roll - load - through_the_roll_center).abs() < 1e-8);
    }

    /// Mirrored states and inputs give bit-identical mirrored results.
    #[test]
    fn the_vehicle_is_symmetric(x in any_state(), u in any_inputs(), p in any_options()) {
        let (xm, um) = (mirrored(&x), mirrored(&u));
        prop_assert_eq!(mirrored(&derivatives(&p, &x, &u)).reals(), derivatives(&p, &xm, &um).reals());
        prop_assert_eq!(mirrored(&outputs(&p, &x, &u)).reals(), outputs(&p, &xm, &um).reals());
    }

    /// From 1 m/s on, a_y is the acceleration of a point that moves with v, beta and gamma. The tolerance covers one
    /// rounding of each term.
    #[test]
    fn the_lateral_acceleration_is_that_of_the_path(x in any_state(), u in any_inputs(), p in any_options()) {
        let u = U { v: 1.0 + u.v, ..u };
        let path = u.v * (derivatives(&p, &x, &u).beta + x.gamma);
        prop_assert!((path - outputs(&p, &x, &u).a_y).abs() < 1e-12);
    }

    /// At standstill, steering has no effect, and sideslip and yaw rate decay.
    #[test]
    fn a_standing_vehicle_does_not_turn(x in any_state(), u in any_inputs()) {
        let p = HydroPneumaticHalfCar::default();
        let u = U { v: 0.0, ..u };
        let (rates, y) = (derivatives(&p, &x, &u), outputs(&p, &x, &u));
        prop_assert_eq!((y.f_y.0, y.a_y), ([0.0; 4], 0.0));
        prop_assert_eq!((rates.beta, rates.gamma), (-10.0 * x.beta, -10.0 * x.gamma));
        prop_assert_eq!((rates.x, rates.y), (0.0, 0.0));
    }

    /// All values are finite at any speed, a tire never pulls on the road, and its lateral force stays below its peak.
    #[test]
    fn tire_forces_keep_their_limits(x in any_state(), u in any_inputs(), options in any_options()) {
        let p = HydroPneumaticHalfCar { lift_off: true, ..options };
        let y = outputs(&p, &x, &u);
        prop_assert!(y.reals().iter().chain(&derivatives(&p, &x, &u).reals()).all(|value| value.is_finite()));
        prop_assert!((-1.0..=1.0).contains(&y.ratio));
        for (i, f_y) in y.f_y.iter().enumerate() {
            let load = y.n[i % 2];
            prop_assert!(load >= 0.0);
            // mu a2 N is the peak without its decrease at large loads.
            prop_assert!(f_y.abs() <= 1.011 * p.mu * u.friction[i % 2] * load);
        }
    }
}

#[test]
fn a_wheel_in_the_air_carries_and_steers_nothing() {
    let p = HydroPneumaticHalfCar::default();
    // 0.1 m exceeds the static tire deflection of N_0/k_t = 0.042 m.
    let x = X { z_u: Sides([0.1, 0.0]), beta: 0.05, ..X::default() };
    let y = outputs(&p, &x, &U::default());
    assert_eq!((y.n[0], y.f_y[0], y.f_y[2], y.ratio), (0.0, 0.0, 0.0, 1.0));
    assert!(y.f_y[1] < 0.0 && y.f_y[3] < 0.0);
    // Without lift-off the tire spring pulls: N_0 - k_t e.
    let y = outputs(&HydroPneumaticHalfCar { lift_off: false, ..p }, &x, &U::default());
    assert_abs_diff_eq!(y.n[0], 7970.625 - 19_000.0, epsilon = 1e-9);
}

#[test]
fn friction_of_a_side_scales_its_peak() {
    // Far beyond the peak, the force depends on the friction of its own side only.
    let (p, x) = (HydroPneumaticHalfCar::default(), X { beta: 0.3, ..X::default() });
    let u = U { friction: Sides([0.5, 1.0]), ..U::default() };
    let y = outputs(&p, &x, &u);
    let [half] = MagicFormula::PASSENGER_CAR.lateral_each([0.5], [7970.625 * p.l_r / (p.l_f + p.l_r)], [0.3]);
    assert_abs_diff_eq!(y.f_y[0], half, epsilon = 1e-9);
    assert_eq!(y.f_y[1], outputs(&p, &x, &U::default()).f_y[1]);
}

#[test]
fn the_path_follows_speed_and_heading() {
    // A vehicle that points to the left by 90 degrees and drifts with v beta = 0.5 m/s.
    let x = X { psi: FRAC_PI_2, beta: 0.05, ..X::default() };
    let rates = derivatives(&HydroPneumaticHalfCar::default(), &x, &U { v: 10.0, ..U::default() });
    assert_abs_diff_eq!(rates.x, -0.5, epsilon = 1e-14);
    assert_abs_diff_eq!(rates.y, 10.0, epsilon = 1e-14);
}

#[test]
fn a_roll_inertia_that_is_too_small_is_rejected() {
    let message = |p: HydroPneumaticHalfCar| equations::derived(&p).unwrap_err();
    // The limit is (m_s h)^2/m = 289.8 kg m2.
    assert_eq!(
        message(HydroPneumaticHalfCar { c: 1.0, i_x: 289.0, ..HydroPneumaticHalfCar::default() }),
        "'body.roll_axis_inertia' must be more than 289.8 kg.m2, got 289 kg.m2: the limit follows from the masses, \
         'geometry.body_cg_to_roll_axis' and 'model.roll_lateral_coupling'"
    );
    // Without coupling, or just above the limit, the inertia is accepted.
    assert!(equations::derived(&HydroPneumaticHalfCar { i_x: 289.0, ..HydroPneumaticHalfCar::default() }).is_ok());
    assert!(
        equations::derived(&HydroPneumaticHalfCar { c: 1.0, i_x: 290.0, ..HydroPneumaticHalfCar::default() }).is_ok()
    );
}
