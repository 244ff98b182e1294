//! Reference values, closed forms and invariants of the equations of motion.
//!
//! "Reference values" were computed by an independent implementation of the model and are compared to their last
//! printed digit.

use approx::assert_abs_diff_eq;
use chassis_control::lqr_suspension::{LATERAL_STATES, VehicleParameters, state_space};
use chassis_control::riccati::eigenvalues;
use chassis_vehicle::mirror::mirrored;
use fmu::simulation::ContinuousSimulation;
use fmu::{Dual64, Variables};
use nalgebra::{Complex, DMatrix};
use proptest::prelude::*;

use super::*;

const STATES: usize = <X<f64> as Variables<f64>>::COUNTS.reals;
const INPUTS: usize = <U<f64> as Variables<f64>>::COUNTS.reals;
// Indices in the state.
const V: usize = 18;
const R: usize = 19;

fn linear() -> RescueVehicle {
    RescueVehicle { tire_model: TireModel::Linear, lift_off: false, ..RescueVehicle::default() }
}

fn derived(p: &RescueVehicle) -> D {
    equations::derived(p).unwrap()
}

fn derivatives(p: &RescueVehicle, x: &X<f64>, u: &U<f64>) -> X<f64> {
    equations::derivatives(p, &derived(p), x, u)
}

/// The Jacobian matrices of the derivatives with respect to state and inputs, computed exactly with dual numbers.
fn linearized(p: &RescueVehicle, x: &X<f64>, u: &U<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let d = derived(p);
    let (x, u) = (x.reals(), u.reals());
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
        DMatrix::from_fn(STATES, STATES, |i, j| columns[j][i]),
        DMatrix::from_fn(STATES, INPUTS, |i, j| columns[STATES + j][i]),
    )
}

/// A state and inputs with different values in all elements.
fn example() -> (X<f64>, U<f64>) {
    let x = X {
        z: 0.01,
        theta: 0.02,
        phi: 0.03,
        z_w: SixWheels([0.001, 0.002, 0.003, 0.004, 0.005, 0.006]),
        zd: 0.1,
        thetad: 0.2,
        phid: 0.3,
        zd_w: SixWheels([0.01, 0.02, 0.03, 0.04, 0.05, 0.06]),
        v: 0.2,
        r: 0.1,
        ..X::default()
    };
    let u = U {
        u: 10.0,
        delta: ThreeAxles([0.1, 0.05, -0.02]),
        f_u: SixWheels([1000.0, 2000.0, 3000.0, 4000.0, 5000.0, 6000.0]),
        z_r: SixWheels([0.006, 0.005, 0.004, 0.003, 0.002, 0.001]),
        ..U::default()
    };
    (x, u)
}

#[test]
fn at_rest_nothing_moves_and_the_loads_are_equal() {
    // Speed alone causes no motion: the rates are exactly 0. The loads are m g / 6 = 58 860 N, except for a few
    // roundings.
    let p = RescueVehicle::default();
    for speed in [0.0, 0.1, 9.7, 40.0] {
        let u = U { u: speed, ..U::default() };
        let rates = X { x: 0.0, ..derivatives(&p, &X::default(), &u) };
        assert!(rates.reals().iter().all(|&rate| rate == 0.0), "{rates:?}");
        let y = equations::outputs(&p, &derived(&p), &X::default(), &u);
        for load in y.n.iter() {
            assert_abs_diff_eq!(*load, 58_860.0, epsilon = 1e-10);
        }
        assert_eq!((y.ltr, y.a_y, y.beta), (0.0, 0.0, 0.0));
    }
}

#[test]
fn the_derivatives_have_the_reference_values() {
    let p = RescueVehicle::default();
    let (x, u) = example();
    let rates = derivatives(&p, &x, &u);
    assert_abs_diff_eq!(rates.zd, 0.046296296296, epsilon = 1e-12);
    assert_abs_diff_eq!(rates.thetad, -1.1454778333, epsilon = 1e-10);
    assert_abs_diff_eq!(rates.phid, -3.3864965183, epsilon = 1e-10);
    let wheels = [4.0972222222, -65.486111111, 41.597222222, -27.986111111, 57.430555556, -12.152777778];
    for (actual, expected) in rates.zd_w.iter().zip(wheels) {
        assert_abs_diff_eq!(*actual, expected, epsilon = 1e-9);
    }
    assert_abs_diff_eq!(rates.v, -2.9353380236, epsilon = 1e-10);
    assert_abs_diff_eq!(rates.r, 0.40471817373, epsilon = 1e-11);
    // The rate of each position is its velocity.
    assert_eq!((rates.z, rates.theta, rates.phi, rates.z_w, rates.psi), (x.zd, x.thetad, x.phid, x.zd_w, x.r));
    // u cos psi, v cos psi with psi = 0.
    assert_eq!((rates.x, rates.y), (10.0, 0.2));

    let y = equations::outputs(&p, &derived(&p), &x, &u);
    let f_s = [-1541.6666667, -40291.666667, 26958.333333, -11791.666667, 42458.333333, 3708.3333333];
    for (i, expected) in f_s.into_iter().enumerate() {
        assert_abs_diff_eq!(p.k_s * y.d_s[i] + p.c_s * y.dd_s[i], expected, epsilon = 1e-6);
    }
    let f_y = [15753.647634, 15709.816993, 10097.802895, 10083.914977, -5708.9092767, -5705.8295911];
    for (actual, expected) in y.f_y.iter().zip(f_y) {
        assert_abs_diff_eq!(*actual, expected, epsilon = 1e-6);
    }
    // Definitions: accelerations are the derivatives, a_y = vd + u r, beta = atan(v/u).
    assert_eq!((y.zdd, y.thetadd, y.phidd, y.rd), (rates.zd, rates.thetad, rates.phid, rates.r));
    assert_eq!(y.a_y, rates.v + 10.0 * 0.1);
    assert_abs_diff_eq!(y.beta, 0.02_f64.atan(), epsilon = 1e-17);
}

#[test]
fn the_paper_tire_has_the_reference_values() {
    let p = RescueVehicle { tire_model: TireModel::Linear, ..RescueVehicle::default() };
    let (x, u) = example();
    let rates = derivatives(&p, &x, &u);
    assert_abs_diff_eq!(rates.v, -2.8360835017, epsilon = 1e-10);
    assert_abs_diff_eq!(rates.phid, -3.3311814824, epsilon = 1e-10);
    assert_abs_diff_eq!(rates.r, 0.4253293022, epsilon = 1e-10);
}

#[test]
fn one_millisecond_has_the_reference_values() {
    // Four Runge-Kutta steps of 0.25 ms have an error of 1e-13 here; the reference values have 10 decimals.
    let p = RescueVehicle::default();
    let (x, u) = example();
    let mut run = ContinuousSimulation::new(p).unwrap();
    run.set_state(&x);
    run.step(&u, 0.001).unwrap();
    let x = run.state();
    assert_abs_diff_eq!(x.z, 0.0101000223, epsilon = 1e-10);
    assert_abs_diff_eq!(x.phi, 0.0302983458, epsilon = 1e-10);
    assert_abs_diff_eq!(x.v, 0.1971744722, epsilon = 1e-10);
    assert_abs_diff_eq!(x.r, 0.1004070351, epsilon = 1e-10);
}

#[test]
fn the_steady_yaw_gain_is_that_of_a_neutral_vehicle() {
    // Three axles have equal stiffness, and the center of mass is at their mean position. If only the front axle steers
    // and the angles are small, r/delta_f = u a/(a^2 + b^2 + c^2) (Chen et al. eqs. 14, 15 with A2 = 0). 1e-12 covers
    // the rounding of the linear solution. Without heading and position, the state matrix is regular.
    let p = linear();
    let (a, b) = linearized(&p, &X::default(), &U::default());
    let front = 1; // speed, then the front axle
    let steady = a.view((0, 0), (20, 20)).into_owned().lu().solve(&(-b.view((0, front), (20, 1)))).unwrap();
    let gain = steady[(R, 0)];
    let x = derived(&p).x;
    let closed = data::SPEED * x[0] / (x[0] * x[0] + x[2] * x[2] + x[4] * x[4]);
    assert_abs_diff_eq!(gain / closed, 1.0, epsilon = 1e-12);
    assert_abs_diff_eq!(gain, 2.252655, epsilon = 1e-6); // reference value
    assert_abs_diff_eq!(gain / data::SPEED, 0.231702, epsilon = 1e-6); // reference value
}

#[test]
fn a_steady_turn_without_sideslip_is_an_equilibrium() {
    // Closed form of a turn with v = 0: every tire carries m u r / 6, and the roll angle per lateral acceleration is
    // m_s h_s / (K_phi - m_s g h_s) with springs and tire springs in series, K_phi = 6 (B/2)^2 k_s k_t / (k_s + k_t).
    let p = linear();
    let d = derived(&p);
    let (speed, r) = (data::SPEED, 0.385);
    let a_y = speed * r;
    let half = p.b_t / 2.0;
    let k_phi = 6.0 * half * half * p.k_s * p.k_t / (p.k_s + p.k_t);
    let per_acceleration = d.m_s * p.h_s / (k_phi - d.m_s * p.g * p.h_s);
    assert_abs_diff_eq!(per_acceleration, 0.01984193, epsilon = 1e-8); // reference value
    let phi = per_acceleration * a_y;
    let share = p.k_s / (p.k_s + p.k_t);
    let delta = ThreeAxles::from_fn(|axle| {
        let travel = (d.x[2 * axle] * r).atan2(speed);
        let mut delta = travel;
        for _ in 0..100 {
            delta = travel + p.m * a_y / 6.0 / (p.c[axle] * delta.cos());
        }
        delta
    });
    let x = X { phi, z_w: SixWheels::from_fn(|i| share * d.y[i] * phi), r, ..X::default() };
    let u = U { u: speed, delta, ..U::default() };
    let rates = derivatives(&p, &x, &u);
    // The tolerance covers the rounding of forces of 1e5 N that act on the smallest mass, 600 kg.
    for rate in (X { x: 0.0, y: 0.0, psi: 0.0, ..rates }).reals() {
        assert_abs_diff_eq!(rate, 0.0, epsilon = 1e-12);
    }
    // Load transfer: the moment of the tires about the roll axis equals the moment of the springs.
    let y = equations::outputs(&p, &d, &x, &u);
    assert_abs_diff_eq!(y.ltr, k_phi * phi / (half * p.m * p.g), epsilon = 1e-12);
    assert_abs_diff_eq!(y.a_y, a_y, epsilon = 1e-12);
}

#[test]
fn the_linearized_plant_is_the_design_model_of_the_controllers() {
    // Two derivations of one model: these equations, linearized by dual numbers, and the matrices M, N, R, Q in
    // Appendix A of the paper (corrected), with v = u beta. The tolerance covers a few roundings of the largest
    // element.
    let p = linear();
    let vehicle = VehicleParameters::default();
    let speed = data::SPEED;
    let (a_design, b_design) = state_space(&vehicle, Some(speed)).unwrap();
    let (a, b) = linearized(&p, &X::default(), &U { u: speed, ..U::default() });
    let scale = |i: usize| if i == V { speed } else { 1.0 };
    for i in 0..LATERAL_STATES {
        for j in 0..LATERAL_STATES {
            assert_abs_diff_eq!(a[(i, j)] / scale(i) * scale(j), a_design[(i, j)], epsilon = 1e-12 * a_design.amax());
        }
        for j in 0..6 {
            let first_force = 4; // speed and three axles
            assert_abs_diff_eq!(
                b[(i, first_force + j)] / scale(i),
                b_design[(i, j)],
                epsilon = 1e-12 * b_design.amax()
            );
        }
    }
}

#[test]
fn the_poles_at_35_km_h_are_the_reference_values() {
    // The paper's tires and the saturating tires have the same slope at rest. The expected poles are printed with 4
    // decimals.
    for p in [linear(), RescueVehicle::default()] {
        let (a, _) = linearized(&p, &X::default(), &U::default());
        let poles = eigenvalues(&a.view((0, 0), (20, 20)).into_owned()).unwrap();
        let expected = [
            (-2.7235, 4.6566),   // roll
            (-11.1879, 0.0),     // lateral
            (-3.4122, 0.0),      // lateral
            (-1.1156, 5.0058),   // pitch, as without lateral motion
            (-1.5357, 6.0877),   // heave, as without lateral motion
            (-20.8333, 40.6116), // wheel hop, as without lateral motion
        ];
        for (re, im) in expected {
            let distance = |pole: &Complex<f64>| fmu::math::hypot(pole.re - re, pole.im - im);
            let nearest = poles.iter().map(distance).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-4, "{re} + {im}i: {poles:?}");
        }
        assert!(poles.iter().all(|pole| pole.re < 0.0));
    }
}

/// Kinetic and potential energy of the vehicle without lift-off; 0 at rest.
fn energy<T: Scalar>(p: &RescueVehicle, d: &D, x: &X<T>) -> T {
    let wheels = (0..6).map(|i| {
        let d_s = x.z - x.theta * d.x[i] + x.phi * d.y[i] - x.z_w[i];
        d_s.squared() * p.k_s + x.z_w[i].squared() * p.k_t + x.zd_w[i].squared() * p.m_w
    });
    let body = x.zd.squared() * d.m_s + x.thetad.squared() * p.i_y + x.phid.squared() * p.i_x;
    let plane = x.v.squared() * p.m + x.r.squared() * p.i_z;
    let coupling = x.v * x.phid * (d.m_s * p.h_s) + x.phid * x.r * p.i_xz;
    let height = (x.theta.squared() + x.phi.squared()) * (d.m_s * p.g * p.h_s);
    (wheels.sum::<T>() + body + plane - height) * 0.5 - coupling
}

/// A state of usual size: positions up to 0.1, rates up to 1.
fn any_state() -> impl Strategy<Value = X<f64>> {
    prop::array::uniform23(-1.0..1.0_f64).prop_map(|values| {
        let scaled: Vec<_> = values.iter().enumerate().map(|(i, v)| if i < 9 { 0.1 * v } else { *v }).collect();
        X::from_reals(&scaled)
    })
}

fn any_inputs() -> impl Strategy<Value = U<f64>> {
    (0.0..20.0, prop::array::uniform3(-0.5..0.5), prop::array::uniform6(-1e4..1e4), prop::array::uniform6(-0.05..0.05))
        .prop_flat_map(|(u, delta, f_u, z_r)| {
            prop::array::uniform6(0.0..1.0).prop_map(move |friction| U {
                u,
                delta: ThreeAxles(delta),
                f_u: SixWheels(f_u),
                z_r: SixWheels(z_r),
                friction: SixWheels(friction),
            })
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// At standstill on a flat road, without actuators or steering, only dampers and sliding tires change the energy,
    /// and they reduce it. The tolerance of 1e-8 W covers the rounding in sums of terms up to 1e6 W.
    #[test]
    fn the_energy_balance_closes(x in any_state()) {
        for tire_model in [TireModel::Linear, TireModel::Saturating] {
            let p = RescueVehicle { tire_model, lift_off: false, ..RescueVehicle::default() };
            let d = derived(&p);
            let u = U { u: 0.0, ..U::default() };
            let rates = equations::derivatives(&p, &d, &x, &u);
            let moving: Vec<_> = x.reals().into_iter().zip(rates.reals()).map(|(x, d)| Dual64::new(x, d)).collect();
            let power = energy(&p, &d, &X::from_reals(&moving)).eps;
            let y = equations::outputs(&p, &d, &x, &u);
            let dampers: f64 = y.dd_s.iter().map(|dd_s| -p.c_s * dd_s * dd_s).sum();
            let tires: f64 = (0..6).map(|i| y.f_y[i] * (x.v + x.r * d.x[i])).sum();
            prop_assert!(dampers <= 0.0 && tires <= 0.0);
            prop_assert!((power - dampers - tires).abs() <= 1e-8, "{} W from {} W", power - dampers - tires, power);
        }
    }

    /// Mirroring only changes the order of sums, so results differ by a few roundings of the largest acceleration or
    /// force.
    #[test]
    fn the_vehicle_is_symmetric(x in any_state(), u in any_inputs(), saturating: bool, lift_off: bool) {
        let tire_model = if saturating { TireModel::Saturating } else { TireModel::Linear };
        let p = RescueVehicle { tire_model, lift_off, ..RescueVehicle::default() };
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
                prop_assert!((expected - actual).abs() <= 1e-14 * largest, "{expected} {actual}");
            }
        }
    }

    /// At standstill, all values stay finite, and a tire never pulls on the road.
    #[test]
    fn a_standing_vehicle_has_finite_slip(x in any_state(), u in any_inputs()) {
        let p = RescueVehicle::default();
        let u = U { u: 0.0, ..u };
        let y = equations::outputs(&p, &derived(&p), &x, &u);
        prop_assert!(y.reals().iter().all(|value| value.is_finite()));
        prop_assert!(derivatives(&p, &x, &u).reals().iter().all(|value| value.is_finite()));
        prop_assert!(y.n.iter().all(|&load| load >= 0.0));
        prop_assert!((-1.0..=1.0).contains(&y.ltr));
        for (i, f_y) in y.f_y.iter().enumerate() {
            prop_assert!(f_y.abs() <= y.n[i] * u.friction[i] * p.mu);
        }
    }
}

#[test]
fn a_vehicle_in_the_air_has_no_tire_forces() {
    let p = RescueVehicle::default();
    let x = X { z_w: SixWheels([1.0; 6]), v: 1.0, r: 0.5, ..X::default() };
    let y = equations::outputs(&p, &derived(&p), &x, &U::default());
    assert_eq!((*y.n, *y.f_y, y.ltr), ([0.0; 6], [0.0; 6], 0.0));
    // Without lift-off the tire spring pulls: F_z0 - k_t t.
    let y = equations::outputs(&linear(), &derived(&p), &x, &U::default());
    assert_abs_diff_eq!(y.n[0], 58_860.0 - 1e6, epsilon = 1e-9);
}

#[test]
fn the_path_follows_speed_and_heading() {
    // A vehicle that points to the left by 90 degrees and drifts: (u cos psi - v sin psi, u sin psi + v cos psi).
    let x = X { psi: std::f64::consts::FRAC_PI_2, v: 0.5, ..X::default() };
    let rates = derivatives(&RescueVehicle::default(), &x, &U { u: 10.0, ..U::default() });
    assert_abs_diff_eq!(rates.x, -0.5, epsilon = 1e-14);
    assert_abs_diff_eq!(rates.y, 10.0, epsilon = 1e-14);
}

#[test]
fn inconsistent_parameters_are_rejected() {
    let message = |p: RescueVehicle| equations::derived(&p).unwrap_err();
    assert_eq!(
        message(RescueVehicle { m: 3600.0, ..RescueVehicle::default() }),
        "'vehicle.mass' must be more than six times 'wheel.mass' (3600 kg), got 3600 kg"
    );
    assert_eq!(
        message(RescueVehicle { a: 6.0, ..RescueVehicle::default() }),
        "'geometry.cg_to_front_axle' = 6 m puts the center of mass too far from the axles: the load on the front axle \
         at rest would be -167313 N"
    );
    assert_eq!(
        message(RescueVehicle { a: 0.5, ..RescueVehicle::default() }),
        "'geometry.cg_to_front_axle' = 0.5 m puts the center of mass too far from the axles: the load on the rear axle \
         at rest would be -18885 N"
    );
    // The limit is (m_s h_s)^2/m + I_xz^2/I_z = 29 160 + 131.6 kg m2.
    assert_eq!(
        message(RescueVehicle { i_x: 29_000.0, ..RescueVehicle::default() }),
        "'body.roll_axis_inertia' must be more than 29292 kg.m2, got 29000 kg.m2: the limit follows from the masses, \
         'geometry.body_cg_to_roll_axis' and 'body.product_of_inertia'"
    );
    // An inertia just above the limit is accepted.
    assert!(equations::derived(&RescueVehicle { i_x: 29_293.0, ..RescueVehicle::default() }).is_ok());
}

#[test]
fn the_inverse_mass_matrix_is_correct() {
    // M M^-1 = 1. The tolerance covers the rounding of sums of 3 terms of order 1.
    let p = RescueVehicle::default();
    let d = derived(&p);
    let coupling = -d.m_s * p.h_s;
    let mass = [[p.m, coupling, 0.0], [coupling, p.i_x, -p.i_xz], [0.0, -p.i_xz, p.i_z]];
    for (i, row) in mass.iter().enumerate() {
        for j in 0..3 {
            let product: f64 = (0..3).map(|k| row[k] * d.inverse[k][j]).sum();
            assert_abs_diff_eq!(product, if i == j { 1.0 } else { 0.0 }, epsilon = 1e-13);
        }
    }
}
