//! Reference values, closed forms and invariants of the equations of motion.
//!
//! "Reference values" were computed by an independent implementation of the model and are compared to their last
//! printed digit.

use approx::assert_abs_diff_eq;
use chassis_control::riccati::eigenvalues;
use chassis_vehicle::mirror::mirrored;
use fmu::{Dual64, Variables};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use proptest::prelude::*;

use super::*;

const STATES: usize = <X<f64> as Variables<f64>>::COUNTS.reals;
const INPUTS: usize = <U<f64> as Variables<f64>>::COUNTS.reals;
/// Number of states except heading and position, on which nothing depends.
const DYNAMIC: usize = 20;
// Indices in the state and in the inputs.
const PHI: usize = 2;
const PHID: usize = 11;
const V: usize = 18;
const R: usize = 19;
const FRONT_STEER: usize = 1;

const KM_H: f64 = 1.0 / 3.6;
const COUPLINGS: [Coupling; 3] = [Coupling::Coupled, Coupling::VerticalOnly, Coupling::LateralOnly];

fn with(coupling: Coupling) -> HeavyVehicle {
    HeavyVehicle { coupling, ..HeavyVehicle::default() }
}

fn derived(p: &HeavyVehicle) -> D {
    equations::derived(p).unwrap()
}

/// Lateral force of the tires of one wheel position.
fn lateral_force<T: Scalar>(p: &HeavyVehicle, d: &D, axle: usize, friction: T, load: T, alpha: T) -> T {
    let (friction, load) = (SixWheels([friction; 6]), SixWheels([load; 6]));
    equations::lateral_forces(p, d, &friction, &load, &ThreeAxles([alpha; 3]))[2 * axle]
}

fn derivatives(p: &HeavyVehicle, x: &X<f64>, u: &U<f64>) -> X<f64> {
    equations::derivatives(p, &derived(p), x, u)
}

fn outputs(p: &HeavyVehicle, x: &X<f64>, u: &U<f64>) -> Y<f64> {
    equations::outputs(p, &derived(p), x, u)
}

/// The values of a block as dual numbers with the derivatives `slopes`.
fn dual<B: Variables<f64>>(block: &B, slopes: &B) -> Vec<Dual64> {
    block.reals().into_iter().zip(slopes.reals()).map(|(value, slope)| Dual64::new(value, slope)).collect()
}

/// The Jacobian matrices of the derivatives with respect to state and inputs, computed exactly with dual numbers.
fn linearized(p: &HeavyVehicle, x: &X<f64>, u: &U<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let d = derived(p);
    let unit = |length: usize, j: usize| -> Vec<f64> { (0..length).map(|i| f64::from(u8::from(i == j))).collect() };
    let column = |x_slope: &[f64], u_slope: &[f64]| {
        let (x, u) =
            (X::from_reals(&dual(x, &X::from_reals(x_slope))), U::from_reals(&dual(u, &U::from_reals(u_slope))));
        equations::derivatives(p, &d, &x, &u).reals()
    };
    let a: Vec<_> = (0..STATES).map(|j| column(&unit(STATES, j), &[0.0; INPUTS])).collect();
    let b: Vec<_> = (0..INPUTS).map(|j| column(&[0.0; STATES], &unit(INPUTS, j))).collect();
    (DMatrix::from_fn(STATES, STATES, |i, j| a[j][i].eps), DMatrix::from_fn(STATES, INPUTS, |i, j| b[j][i].eps))
}

/// Equilibrium of the states `active`, by Newton's method from rest; the other states stay 0.
fn equilibrium(p: &HeavyVehicle, u: &U<f64>, active: &[usize]) -> X<f64> {
    let mut x = vec![0.0; STATES];
    for _ in 0..20 {
        let block = X::<f64>::from_reals(&x);
        let rates = derivatives(p, &block, u).reals();
        let (a, _) = linearized(p, &block, u);
        let a = DMatrix::from_fn(active.len(), active.len(), |i, j| a[(active[i], active[j])]);
        let step = a.lu().solve(&DVector::from_iterator(active.len(), active.iter().map(|&i| rates[i]))).unwrap();
        active.iter().zip(step.iter()).for_each(|(&i, step)| x[i] -= step);
    }
    X::from_reals(&x)
}

/// 60 km/h with the front axle at 0.1 rad.
fn turn() -> U<f64> {
    U { delta: ThreeAxles([0.1, 0.0, 0.0]), ..U::default() }
}

#[test]
fn at_rest_nothing_moves_and_the_loads_have_the_reference_values() {
    for coupling in COUPLINGS {
        let p = with(coupling);
        for speed in [0.0, 0.1, 16.7, 40.0] {
            let u = U { u: speed, ..U::default() };
            let rates = X { x: 0.0, ..derivatives(&p, &X::default(), &u) };
            assert!(rates.reals().iter().all(|&rate| rate == 0.0), "{rates:?}");
            let y = outputs(&p, &X::default(), &u);
            for (i, load) in y.f_z.iter().enumerate() {
                assert_abs_diff_eq!(*load, if i < 2 { 30_762.402_99 } else { 40_535.798_51 }, epsilon = 5e-6);
            }
            // The sum of the tire loads is the weight, except for a few roundings.
            assert_abs_diff_eq!(y.f_z.iter().sum::<f64>(), 22_800.0 * 9.81, epsilon = 1e-9);
            assert_eq!((y.a_y, y.beta), (0.0, 0.0));
            assert_abs_diff_eq!(y.ltr, 0.0, epsilon = 1e-15);
        }
    }
}

#[test]
fn the_data_agree_with_each_other() {
    let d = derived(&HeavyVehicle::default());
    assert_eq!(d.m, data::MASS);
    // The tire parameter of the controllers: the slope of a front wheel's force at its load at rest, computed exactly
    // with dual numbers. The reference values have 11 and 9 correct digits.
    let stiffness = |axle: usize| {
        let load = Dual64::from(d.f0[2 * axle]);
        -lateral_force(&HeavyVehicle::default(), &d, axle, Dual64::from(1.0), load, Dual64::new(0.0, 1.0)).eps
    };
    assert_abs_diff_eq!(stiffness(0), data::FRONT_CORNERING_STIFFNESS, epsilon = 2e-6);
    assert_abs_diff_eq!(stiffness(1), 278_887.988, epsilon = 5e-4);
    assert_abs_diff_eq!(stiffness(2), 278_887.988, epsilon = 5e-4);
}

#[test]
fn the_tire_has_the_reference_values() {
    // Forces of the one or two tires at a wheel position, printed with 3 decimals. The last two loads are unusual.
    let numbers = [
        (0, 30_762.403, 0.05, -6106.468),
        (0, 30_762.403, -0.2, 20_899.004),
        (1, 40_535.798_507, 0.1, -25_773.249),
        (1, 500.0, 0.05, -383.066),
        (0, 60_000.0, 0.1, -10_109.539),
    ];
    let p = HeavyVehicle::default();
    let d = derived(&p);
    for (axle, load, alpha, force) in numbers {
        assert_abs_diff_eq!(lateral_force(&p, &d, axle, 1.0, load, alpha), force, epsilon = 5e-4);
        // Both friction coefficients (of the tires and of the road) scale the force at any slip angle. Their product, a
        // power of 2, is exact.
        let slippery = HeavyVehicle { mu: 0.5, ..HeavyVehicle::default() };
        let full = lateral_force(&p, &d, axle, 1.0, load, alpha);
        assert_eq!(lateral_force(&slippery, &d, axle, 0.5, load, alpha), 0.25 * full);
    }
    // Above the load limit of the fit, the force does not depend on the load.
    let beyond = |load| lateral_force(&p, &d, 0, 1.0, load, 0.1);
    assert_eq!(beyond(1000.0 * 22.0 * 2.4 + 1.0), beyond(1e6));
}

#[test]
fn the_modes_at_60_km_h_are_the_reference_values() {
    // Natural frequency in Hz and damping ratio, printed with 3 decimals.
    let expected = [
        (0.704, 0.806),  // lateral
        (1.632, 0.087),  // roll
        (1.662, 0.117),  // pitch
        (2.114, 0.041),  // heave
        (9.400, 0.072),  // beam pitch
        (9.4015, 0.072), // beam pitch
        (10.230, 0.331), // front wheels
        (10.309, 0.313), // front wheels
        (11.114, 0.084), // beams
        (11.133, 0.089), // beams
    ];
    let (a, _) = linearized(&HeavyVehicle::default(), &X::default(), &U::default());
    let poles = eigenvalues(&a.view((0, 0), (DYNAMIC, DYNAMIC)).into_owned()).unwrap();
    let mut modes: Vec<_> = poles
        .iter()
        .filter(|pole| pole.im > 0.0)
        .map(|pole| (fmu::math::hypot(pole.re, pole.im), -pole.re))
        .map(|(modulus, decay)| (modulus / std::f64::consts::TAU, decay / modulus))
        .collect();
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(modes.len(), expected.len(), "{modes:?}");
    for ((frequency, damping), (expected_frequency, expected_damping)) in modes.into_iter().zip(expected) {
        assert_abs_diff_eq!(frequency, expected_frequency, epsilon = 6e-4);
        assert_abs_diff_eq!(damping, expected_damping, epsilon = 6e-4);
    }
}

#[test]
fn the_steady_gains_are_those_of_a_single_track_model() {
    // For small angles, the vehicle is a single-track model with the stiffnesses at rest, given by the balances of
    // force and moment. The model linearized by dual numbers must agree with it (1e-8 covers the solution of 20
    // equations), and with the reference values (6 decimals).
    let p = HeavyVehicle::default();
    let d = derived(&p);
    let c = [2.0 * data::FRONT_CORNERING_STIFFNESS, 2.0 * 278_887.988, 2.0 * 278_887.988];
    let moment = |n: i32| (0..3).map(|axle| c[axle] * d.x[axle].powi(n)).sum::<f64>();
    let expected = [
        (20.0, 0.937872, 0.179578),
        (40.0, 1.570257, -0.041270),
        (60.0, 1.852539, -0.283622),
        (80.0, 1.901674, -0.489074),
    ];
    for (km_h, yaw_gain, sideslip_gain) in expected {
        let speed = km_h * KM_H;
        let bicycle = Matrix2::new(moment(0), moment(1) / speed + d.m * speed, moment(1), moment(2) / speed);
        let closed = bicycle.lu().solve(&Vector2::new(c[0], p.l1 * c[0])).unwrap();
        let (a, b) = linearized(&p, &X::default(), &U { u: speed, ..U::default() });
        let b = -b.view((0, FRONT_STEER), (DYNAMIC, 1));
        let steady = a.view((0, 0), (DYNAMIC, DYNAMIC)).into_owned().lu().solve(&b).unwrap();
        assert_abs_diff_eq!(steady[(R, 0)], closed[1], epsilon = 1e-8);
        assert_abs_diff_eq!(steady[(V, 0)] / speed, closed[0], epsilon = 1e-8);
        assert_abs_diff_eq!(steady[(R, 0)], yaw_gain, epsilon = 6e-7);
        assert_abs_diff_eq!(steady[(V, 0)] / speed, sideslip_gain, epsilon = 6e-7);
    }
}

#[test]
fn the_steady_turn_has_the_reference_values_and_balances() {
    let (p, u) = (HeavyVehicle::default(), turn());
    let x = equilibrium(&p, &u, &(0..DYNAMIC).collect::<Vec<_>>());
    let y = outputs(&p, &x, &u);
    assert_abs_diff_eq!(x.r, 0.198519, epsilon = 6e-7);
    assert_abs_diff_eq!(y.beta, -0.034668, epsilon = 6e-7);
    assert_abs_diff_eq!(y.a_y, 3.308645, epsilon = 6e-7);
    assert_abs_diff_eq!(x.phi, 0.0185312, epsilon = 6e-8);
    assert_abs_diff_eq!(y.ltr, 0.387638, epsilon = 6e-7);
    for (axle, alpha) in [-0.091788, -0.043574, -0.059611].into_iter().enumerate() {
        assert_abs_diff_eq!(y.alpha[2 * axle], alpha, epsilon = 6e-7);
        assert_eq!(y.alpha[2 * axle], y.alpha[2 * axle + 1]);
    }

    // Balances of lateral forces, and of moments about the longitudinal axis. Newton's method leaves residuals of 1e-6.
    let d = derived(&p);
    let across: f64 = (0..6).map(|i| y.f_y[i] * u.delta[axle_of(i)].cos()).sum();
    assert_abs_diff_eq!(across, d.m * y.a_y, epsilon = 1e-6);
    let tipping = y.a_y * (p.m_b * (p.h + p.h_rc) + (d.m - p.m_b) * p.h_u) + p.m_b * p.g * p.h * x.phi;
    let righting: f64 = (0..6).map(|i| -y.f_z[i] * d.y[i % 2]).sum();
    assert_abs_diff_eq!(righting, tipping, epsilon = 1e-6);
    assert_abs_diff_eq!(righting, 82_367.07, epsilon = 6e-3); // reference value
}

#[test]
fn the_lateral_model_agrees_with_the_coupled_one_in_a_steady_turn() {
    let (p, u) = (with(Coupling::LateralOnly), turn());
    let x = equilibrium(&p, &u, &[PHI, PHID, V, R]);
    let y = outputs(&p, &x, &u);
    // Reference values: 5 or 6 decimals.
    assert_abs_diff_eq!(x.r, 0.19767, epsilon = 6e-6);
    assert_abs_diff_eq!(y.beta, -0.03422, epsilon = 6e-6);
    assert_abs_diff_eq!(x.phi, 0.018467, epsilon = 6e-7);
    assert_abs_diff_eq!(y.ltr, 0.38598, epsilon = 6e-6);
    // The README states 1 %. The lateral model shares the lateral force among the axles by their weight instead of by
    // the tire forces, and its beams do not pitch.
    let coupled = equilibrium(&HeavyVehicle::default(), &u, &(0..DYNAMIC).collect::<Vec<_>>());
    assert!((x.r / coupled.r - 1.0).abs() < 0.01 && (x.phi / coupled.phi - 1.0).abs() < 0.01);
}

/// Energy of the vertical motion: kinetic energy, springs, bars, tires, and the weight of the leaning body.
fn energy<T: Scalar>(p: &HeavyVehicle, d: &D, x: &X<T>) -> T {
    let square = |value: T, factor: f64| value.squared() * factor;
    // A beam with its wheels.
    let m_bw = p.m_beam + p.m_t[1] + p.m_t[2];
    let j_bw = p.i_beam + (p.m_t[1] + p.m_t[2]) * p.l3 * p.l3 / 4.0;
    let mut energy = square(x.zd, p.m_b) + square(x.thetad, p.i_y) + square(x.phid, p.i_x + p.m_b * p.h * p.h)
        - square(x.phi, p.m_b * p.g * p.h);
    for side in 0..2 {
        for (group, foot) in [x.z_f[side], x.z_b[side]].into_iter().enumerate() {
            energy += square(x.z - x.theta * d.x_s[group] + x.phi * d.y[side] - foot, p.k[group]);
        }
        let lift = x.th_b[side] * (p.l3 / 2.0);
        energy += square(x.z_f[side], p.k_t[0])
            + square(x.z_b[side] - lift, p.k_t[1])
            + square(x.z_b[side] + lift, p.k_t[2])
            + square(x.zd_f[side], p.m_t[0])
            + square(x.zd_b[side], m_bw)
            + square(x.thd_b[side], j_bw);
    }
    let twist = |left: T, right: T| x.phi - (left - right) / d.b;
    energy += square(twist(x.z_f[0], x.z_f[1]), p.k_a[0]) + square(twist(x.z_b[0], x.z_b[1]), p.k_a[1]);
    energy * 0.5
}

/// A state in which no tire leaves the ground: heights up to 10 mm, angles up to 5 mrad, rates up to 0.5.
fn any_state() -> impl Strategy<Value = X<f64>> {
    prop::array::uniform23(-1.0..1.0_f64).prop_map(|values| {
        let size = |i: usize| match i {
            0 | 3..7 => 0.01,
            1..3 | 7..9 => 0.005,
            _ => 0.5,
        };
        X::from_reals(&values.iter().enumerate().map(|(i, value)| size(i) * value).collect::<Vec<_>>())
    })
}

fn any_inputs() -> impl Strategy<Value = U<f64>> {
    let friction = prop::array::uniform6(0.0..1.0);
    let q = prop::array::uniform6(-0.02..0.02);
    (0.0..30.0, prop::array::uniform3(-0.5..0.5), prop::array::uniform4(-1e4..1e4), q, friction).prop_map(
        |(u, delta, f, q, friction)| U {
            u,
            delta: ThreeAxles(delta),
            f: Struts(f),
            q: SixWheels(q),
            friction: SixWheels(friction),
        },
    )
}

fn any_coupling() -> impl Strategy<Value = Coupling> {
    prop::sample::select(COUPLINGS.to_vec())
}

/// Asserts that two blocks agree to within `tolerance` times their greatest value, or times 1 if that is greater.
#[track_caller]
fn assert_same<B: Variables<f64>>(actual: &B, expected: &B, tolerance: f64) {
    let (actual, expected) = (actual.reals(), expected.reals());
    let largest = expected.iter().fold(1.0_f64, |most, value| most.max(value.abs()));
    for ((actual, expected), declaration) in actual.into_iter().zip(expected).zip(B::declarations()) {
        let name = declaration.name;
        assert!((actual - expected).abs() <= tolerance * largest, "{name}: {actual} is not {expected}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// On a flat road without actuators, only the dampers change the energy of the vertical motion, and they reduce it.
    /// The tolerance of 1e-8 W covers the rounding in sums of terms up to 1e5 W.
    #[test]
    fn the_energy_balance_of_the_vertical_motion_closes(x in any_state(), bars: bool) {
        let k_a = TwoAxles(if bars { [3e5, 5e5] } else { [0.0; 2] });
        let p = HeavyVehicle { k_a, ..with(Coupling::VerticalOnly) };
        let d = derived(&p);
        let rates = equations::derivatives(&p, &d, &x, &U::default());
        let power = energy(&p, &d, &X::from_reals(&dual(&x, &rates))).eps;
        let y = equations::outputs(&p, &d, &x, &U::default());
        let struts: f64 = (0..4).map(|i| -p.c[i / 2] * y.dd_s[i] * y.dd_s[i]).sum();
        let bushings: f64 = x.thd_b.iter().map(|rate| -p.c_b * (rate - x.thetad).powi(2)).sum();
        prop_assert!(struts <= 0.0 && bushings <= 0.0);
        prop_assert!((power - struts - bushings).abs() <= 1e-8, "{} W of {power} W", power - struts - bushings);
    }

    /// Mirroring only changes the order of sums, so results differ by a few roundings of the largest acceleration or
    /// force.
    #[test]
    fn the_vehicle_is_symmetric(x in any_state(), u in any_inputs(), coupling in any_coupling()) {
        let p = HeavyVehicle { k_a: TwoAxles([3e5, 5e5]), ..with(coupling) };
        let (xm, um) = (mirrored(&x), mirrored(&u));
        assert_same(&derivatives(&p, &xm, &um), &mirrored(&derivatives(&p, &x, &u)), 1e-13);
        assert_same(&outputs(&p, &xm, &um), &mirrored(&outputs(&p, &x, &u)), 1e-14);
    }

    /// A symmetric vehicle on a straight road without cross fall stays exactly on its line and moves like the vertical
    /// model.
    #[test]
    fn a_straight_run_stays_straight(x in any_state(), u in any_inputs()) {
        let even = |family: &[f64; 6]| SixWheels::from_fn(|i| family[i / 2 * 2]);
        let x = X {
            z_f: FrontWheels([x.z_f[0]; 2]),
            z_b: Sides([x.z_b[0]; 2]),
            th_b: Sides([x.th_b[0]; 2]),
            zd_f: FrontWheels([x.zd_f[0]; 2]),
            zd_b: Sides([x.zd_b[0]; 2]),
            thd_b: Sides([x.thd_b[0]; 2]),
            z: x.z, theta: x.theta, zd: x.zd, thetad: x.thetad,
            ..X::default()
        };
        let u = U {
            delta: ThreeAxles([0.0; 3]), f: Struts([u.f[0], u.f[0], u.f[2], u.f[2]]), q: even(&u.q), friction: even(&u.friction),
            ..u
        };
        let rates = derivatives(&HeavyVehicle::default(), &x, &u);
        prop_assert_eq!((rates.v, rates.r, rates.phid, rates.psi), (0.0, 0.0, 0.0, 0.0));
        prop_assert_eq!(rates.reals(), derivatives(&with(Coupling::VerticalOnly), &x, &u).reals());
    }

    /// If only one motion is simulated, the inputs of the other motion have no effect, and its states stay constant.
    #[test]
    fn a_motion_alone_ignores_the_other(x in any_state(), u in any_inputs(), other in any_inputs()) {
        let p = with(Coupling::VerticalOnly);
        let steered = U { delta: other.delta, friction: other.friction, ..u.clone() };
        let rates = derivatives(&p, &X { psi: 0.0, ..x.clone() }, &u);
        prop_assert_eq!(rates.reals(), derivatives(&p, &X { psi: 0.0, ..x.clone() }, &steered).reals());
        prop_assert_eq!((rates.v, rates.r), (0.0, 0.0));
        let y = outputs(&p, &x, &u);
        prop_assert_eq!((*y.f_y, *y.alpha, y.a_y), ([0.0; 6], [0.0; 6], 0.0));

        let p = with(Coupling::LateralOnly);
        let rough = U { q: other.q, ..u.clone() };
        let rates = derivatives(&p, &x, &u);
        prop_assert_eq!(rates.reals(), derivatives(&p, &x, &rough).reals());
        prop_assert_eq!((rates.zd, rates.thetad), (0.0, 0.0));
        prop_assert_eq!((*rates.zd_f, *rates.zd_b, *rates.thd_b), ([0.0; 2], [0.0; 2], [0.0; 2]));
    }

    /// On a road with constant heights, the output velocities are the derivatives of the output heights and
    /// deflections. Dual numbers are exact, so the tolerance only covers a few roundings of velocities of order 1.
    #[test]
    fn velocities_are_the_rates_of_heights_and_deflections(x in any_state(), u in any_inputs()) {
        let p = HeavyVehicle::default();
        let d = derived(&p);
        let rates = equations::derivatives(&p, &d, &x, &u);
        let still = U::<Dual64>::from_reals(&u.reals().into_iter().map(Dual64::from).collect::<Vec<_>>());
        let moving = equations::outputs(&p, &d, &X::from_reals(&dual(&x, &rates)), &still);
        let y = equations::outputs(&p, &d, &x, &u);
        for i in 0..4 {
            prop_assert!((moving.d_s[i].eps - y.dd_s[i]).abs() < 1e-14);
        }
        for i in 0..6 {
            prop_assert!((moving.z_w[i].eps - y.zd_w[i]).abs() < 1e-14);
            prop_assert!((moving.d_t[i].eps - y.zd_w[i]).abs() < 1e-14);
        }
    }

    /// All values stay finite when the vehicle stands, moves backward or leaves the ground, and a tire never pulls on
    /// the road.
    #[test]
    fn everything_stays_finite(
        x in prop::array::uniform23(-1.0..1.0_f64), u in any_inputs(), speed in -5.0..5.0, stands: bool, coupling in any_coupling(),
    ) {
        let (p, x) = (with(coupling), X::from_reals(&x));
        let u = U { u: if stands { 0.0 } else { speed }, ..u };
        let y = outputs(&p, &x, &u);
        prop_assert!(y.reals().iter().all(|value| value.is_finite()));
        prop_assert!(derivatives(&p, &x, &u).reals().iter().all(|value| value.is_finite()));
        prop_assert!(y.f_z.iter().all(|&load| load >= 0.0));
        prop_assert!((-1.0..=1.0).contains(&y.ltr));
    }
}

#[test]
fn a_standing_vehicle_does_not_respond_to_steering() {
    let u = U { u: 0.0, delta: ThreeAxles([0.4, -0.2, 0.1]), ..U::default() };
    for coupling in COUPLINGS {
        let p = with(coupling);
        assert!(derivatives(&p, &X::default(), &u).reals().iter().all(|&rate| rate == 0.0));
        let y = outputs(&p, &X::default(), &u);
        assert_eq!((y.a_y, y.beta, *y.f_y, *y.alpha), (0.0, 0.0, [0.0; 6], [0.0; 6]));
    }
}

#[test]
fn slip_angles_are_those_of_the_wheel_frame() {
    // The slip angle of a wheel that rolls forward is atan((v + x r)/u) - delta (closed form, except for a few
    // roundings).
    let p = HeavyVehicle::default();
    let x = X { v: 0.7, r: 0.3, ..X::default() };
    let u = U { u: 10.0, delta: ThreeAxles([0.3, -0.1, 0.05]), ..U::default() };
    let y = outputs(&p, &x, &u);
    for (axle, position) in derived(&p).x.into_iter().enumerate() {
        assert_abs_diff_eq!(y.alpha[2 * axle], ((0.7 + position * 0.3) / 10.0).atan() - u.delta[axle], epsilon = 1e-15);
    }
}

#[test]
fn longitudinal_components_of_lateral_forces_turn_the_vehicle() {
    // Steered wheels with different forces left and right. Their yaw moment, computed from its definition, must equal
    // I_z r' + I_xz phi''. The tolerance covers the rounding of moments of 1e5 N m.
    let p = HeavyVehicle::default();
    let d = derived(&p);
    let x = X { phi: 0.01, v: -0.5, r: 0.2, z_f: FrontWheels([0.01, -0.01]), ..X::default() };
    let u = U { delta: ThreeAxles([0.4, 0.2, -0.3]), ..turn() };
    let y = outputs(&p, &x, &u);
    let moment: f64 = (0..6)
        .map(|i| {
            let (sin, cos) = u.delta[axle_of(i)].sin_cos();
            let (along, across) = (-y.f_y[i] * sin, y.f_y[i] * cos);
            d.x[axle_of(i)] * across - d.y[i % 2] * along
        })
        .sum();
    assert_abs_diff_eq!(p.i_z * y.rd + p.i_xz * y.phidd, moment, epsilon = 1e-8);
    // Balance of lateral forces: m v' - m_b h phi'' = sum Y - m u r.
    let across: f64 = (0..6).map(|i| y.f_y[i] * u.delta[axle_of(i)].cos()).sum();
    assert_abs_diff_eq!(d.m * y.a_y - p.m_b * p.h * y.phidd, across, epsilon = 1e-8);
}

#[test]
fn without_contact_or_friction_there_is_no_lateral_force() {
    let u = turn();
    let flying = X { z_f: FrontWheels([1.0; 2]), z_b: Sides([1.0; 2]), ..X::default() };
    let y = outputs(&HeavyVehicle::default(), &flying, &u);
    assert_eq!((*y.f_z, *y.f_y, y.ltr), ([0.0; 6], [0.0; 6], 0.0));
    for (p, friction) in [(HeavyVehicle { mu: 0.0, ..HeavyVehicle::default() }, 1.0), (HeavyVehicle::default(), 0.0)] {
        let y = outputs(&p, &X::default(), &U { friction: SixWheels([friction; 6]), ..u.clone() });
        assert_eq!(*y.f_y, [0.0; 6]);
    }
}

#[test]
fn an_actuator_pushes_the_body_up_and_the_wheel_down() {
    // Accelerations at rest in closed form: f/m_b, -l1 f/I_y, b1 f/(I_x + m_b h^2), -f/m.
    let p = with(Coupling::VerticalOnly);
    let rates = derivatives(&p, &X::default(), &U { f: Struts([1000.0, 0.0, 0.0, 0.0]), ..U::default() });
    assert_abs_diff_eq!(rates.zd, 1000.0 / p.m_b, epsilon = 1e-15);
    assert_abs_diff_eq!(rates.thetad, -p.l1 * 1000.0 / p.i_y, epsilon = 1e-15);
    assert_abs_diff_eq!(rates.phid, p.b1 * 1000.0 / (p.i_x + p.m_b * p.h * p.h), epsilon = 1e-15);
    assert_abs_diff_eq!(rates.zd_f[0], -1000.0 / p.m_t[0], epsilon = 1e-14);
    let rates = derivatives(&p, &X::default(), &U { f: Struts([0.0, 0.0, 0.0, 1000.0]), ..U::default() });
    assert_abs_diff_eq!(rates.thetad, p.l2 * 1000.0 / p.i_y, epsilon = 1e-15);
    assert_abs_diff_eq!(rates.phid, -p.b2 * 1000.0 / (p.i_x + p.m_b * p.h * p.h), epsilon = 1e-15);
    assert_abs_diff_eq!(rates.zd_b[1], -1000.0 / (p.m_beam + p.m_t[1] + p.m_t[2]), epsilon = 1e-15);
    assert_eq!(*rates.thd_b, [0.0; 2]);
}

#[test]
fn the_path_follows_speed_and_heading() {
    // A vehicle that points to the left by 90 degrees and drifts: (u cos psi - v sin psi, u sin psi + v cos psi).
    let x = X { psi: std::f64::consts::FRAC_PI_2, v: 0.5, ..X::default() };
    let rates = derivatives(&HeavyVehicle::default(), &x, &U { u: 10.0, ..U::default() });
    assert_abs_diff_eq!(rates.x, -0.5, epsilon = 1e-14);
    assert_abs_diff_eq!(rates.y, 10.0, epsilon = 1e-14);
}

#[test]
fn inconsistent_parameters_are_rejected() {
    let message = |p: HeavyVehicle| equations::derived(&p).unwrap_err();
    assert_eq!(
        message(HeavyVehicle { l3: 3.0, ..HeavyVehicle::default() }),
        "'geometry.middle_to_rear_axle' must be less than twice 'geometry.cg_to_rear_suspension' (2.85 m), got 3 m: \
         the middle axle must be behind the center of mass"
    );
    // The peak D is 0 at the load -a2/a1 = 45.75 kN.
    assert_eq!(
        message(HeavyVehicle { f_max: 50.0, ..HeavyVehicle::default() }),
        "'tire.fit_load_limit' must be a load at which the peak of the magic formula is positive, got 50 kN: the peak \
         would be -4700 N"
    );
    // The limit is sqrt(I_z (I_x + m_b h^2 - (m_b h)^2/m)) = sqrt(1e5 (26 050 - 3552.6)) = 47 431 kg m2.
    assert_eq!(
        message(HeavyVehicle { i_xz: -50_000.0, ..HeavyVehicle::default() }),
        "'body.roll_yaw_inertia' must be below 47431 kg.m2 in magnitude, got -50000 kg.m2: reduce it, or increase the \
         roll or yaw inertia"
    );
    assert!(equations::derived(&HeavyVehicle { i_xz: 47_430.0, ..HeavyVehicle::default() }).is_ok());
}
