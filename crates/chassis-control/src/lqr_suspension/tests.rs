//! Check numbers and closed forms for the design model, and for closed loops with one or both laws.
//!
//! "Check numbers" were computed by an independent implementation and are compared to their last printed digit. The
//! tests of the two controllers compare the gain matrices.

use crate::riccati::eigenvalues;
use approx::assert_abs_diff_eq;
use proptest::prelude::*;

use super::*;

const FORCE: f64 = 20_000.0;

fn accepted<const N: usize>(outputs: [(Weighted, f64); N]) -> [Accepted; N] {
    outputs.map(|(quantity, value)| Accepted { quantity, value })
}

/// The cost of `IntegratedLqrSuspension` with its start values.
fn integrated() -> [Accepted; 5] {
    accepted([
        (Weighted::HeaveAcceleration, 1.0),
        (Weighted::PitchAcceleration, 1.0),
        (Weighted::RollAcceleration, 0.347),
        (Weighted::SuspensionDeflections, 0.0347),
        (Weighted::TireDeflections, 0.0589),
    ])
}

/// The cost of `RollLqrSuspension` with its start values.
fn roll() -> [Accepted; 4] {
    accepted([
        (Weighted::Roll, 1_f64.to_radians()),
        (Weighted::RollAcceleration, 0.347),
        (Weighted::SuspensionDeflections, 0.0347),
        (Weighted::TireDeflections, 0.0589),
    ])
}

/// A and B of the design model with the start values.
fn model() -> (DMatrix<f64>, DMatrix<f64>) {
    state_space(&VehicleParameters::default(), None).unwrap()
}

fn gain(outputs: &[Accepted]) -> DMatrix<f64> {
    regulator(&VehicleParameters::default(), outputs, FORCE).unwrap().gain
}

/// Largest real part of the poles, with the share `k1` of the integrated and `k2` of the roll law.
fn slowest(k1: f64, k2: f64) -> f64 {
    let (a, b) = model();
    let closed = a - b * (k1 * gain(&integrated()) + k2 * gain(&roll()));
    eigenvalues(&closed).unwrap()[0].re
}

/// Stiffness of a strut and its tire in series.
fn series(p: &VehicleParameters) -> f64 {
    p.k_s * p.k_t / (p.k_s + p.k_t)
}

#[test]
fn frequencies_with_massless_wheels_are_the_closed_forms() {
    // Massless wheels are always in equilibrium, which reduces the acceleration per position to A_bb - A_bw A_ww^-1
    // A_wb. Closed forms for one degree of freedom: omega^2 = k/m with struts and tires in series, minus the moment of
    // the weight. Tolerance: rounding in this reduction.
    let p = VehicleParameters::default();
    let (a, _) = model();
    let body = a.view((9, 0), (3, 3)) - {
        let ww = a.view((12, 3), (6, 6)).into_owned().lu();
        a.view((9, 3), (3, 6)) * ww.solve(&a.view((12, 0), (6, 3)).into_owned()).unwrap()
    };
    let m_s = p.m - 6.0 * p.m_w;
    let weight = m_s * p.g * p.h_s;
    let (x, y) = p.positions();
    let sum = |lever: &[f64; 6]| lever.iter().map(|l| l * l).sum::<f64>();
    let hertz = |squared: f64| squared.sqrt() / std::f64::consts::TAU;
    let closed =
        [6.0 * series(&p) / m_s, (series(&p) * sum(&x) - weight) / p.i_y, (series(&p) * sum(&y) - weight) / p.i_x];
    for (i, printed) in [0.96859, 0.79844, 0.83028].into_iter().enumerate() {
        assert_abs_diff_eq!(-body[(i, i)] / closed[i], 1.0, epsilon = 1e-12);
        assert_abs_diff_eq!(hertz(closed[i]), printed, epsilon = 1e-5); // check numbers
        // No coupling, because the center of mass is at the mean of the axle positions.
        for j in (0..3).filter(|&j| j != i) {
            assert_abs_diff_eq!(body[(i, j)], 0.0, epsilon = 1e-12 * closed[i]);
        }
    }
    // Wheel hop between strut and tire, with the body at rest.
    assert_abs_diff_eq!(-a[(12, 3)], (p.k_s + p.k_t) / p.m_w, epsilon = 1e-9);
    assert_abs_diff_eq!(hertz(-a[(12, 3)]), 7.2644, epsilon = 1e-4); // check number
}

#[test]
fn poles_of_the_design_model_are_the_check_numbers() {
    let poles = eigenvalues(&model().0).unwrap();
    let expected = [
        (-1.11562, 5.00581),
        (-1.34663, 5.18733),
        (-1.53572, 6.08773),
        (-20.83333, 40.61164),
        (-20.83333, 40.61164),
        (-20.83333, 40.61164),
        (-21.41485, 39.17688),
        (-21.51874, 38.87143),
        (-21.61243, 38.60507),
    ];
    for (pair, (re, im)) in poles.chunks(2).zip(expected) {
        for (pole, im) in [(pair[0], im), (pair[1], -im)] {
            assert!(fmu::math::hypot(pole.re - re, pole.im - im) < 1e-5, "{pole} is not {re} + {im}i");
        }
    }
}

#[test]
fn static_roll_per_lateral_acceleration() {
    // Equilibrium of the body under the moment m_s h_s a_y about the roll axis: 0 = (A - B K) X + b a_y. Closed form
    // without control: m_s h_s/(K_phi - m_s g h_s), K_phi = 6 (B/2)^2 k_s k_t/(k_s + k_t).
    let p = VehicleParameters::default();
    let (a, b) = model();
    let m_s = p.m - 6.0 * p.m_w;
    let mut disturbance = DVector::zeros(STATES);
    disturbance[11] = m_s * p.h_s / p.i_x;
    let roll_angle = |k: DMatrix<f64>| (&a - &b * k).lu().solve(&-&disturbance).unwrap()[2];

    let passive = roll_angle(DMatrix::zeros(6, STATES));
    let k_phi = series(&p) * p.positions().1.iter().map(|y| y * y).sum::<f64>();
    let closed = m_s * p.h_s / (k_phi - m_s * p.g * p.h_s);
    assert_abs_diff_eq!(passive / closed, 1.0, epsilon = 1e-12); // tolerance: the linear solver
    assert_abs_diff_eq!(passive, 0.01984193, epsilon = 1e-8); // check number
    assert_abs_diff_eq!(roll_angle(gain(&integrated())), 0.019399, epsilon = 1e-6); // check number
    assert_abs_diff_eq!(roll_angle(gain(&roll())), 0.016622, epsilon = 1e-6); // check number
}

#[test]
fn each_law_alone_and_any_share_of_both_is_stable() {
    assert_eq!(format!("{:.4}", slowest(1.0, 0.0)), "-3.1400"); // check number
    assert_eq!(format!("{:.4}", slowest(0.0, 1.0)), "-2.9949"); // check number
    for k1 in [0.1, 0.3, 0.5, 0.7, 0.9] {
        assert!(slowest(k1, 1.0 - k1) < 0.0);
    }
    assert_abs_diff_eq!(slowest(1.0, 0.5), -1.32, epsilon = 0.01); // check number
}

#[test]
fn both_laws_fully_on_are_unstable() {
    // Check number, 2 digits.
    assert_abs_diff_eq!(slowest(1.0, 1.0), 5.3, epsilon = 0.05);
}

#[test]
fn lateral_states_leave_the_vertical_model_as_it_is() {
    // Sideslip and yaw rate affect the vertical motion only through roll.
    let p = VehicleParameters::default();
    let (a, b) = model();
    let (a20, b20) = state_space(&p, Some(data::SPEED)).unwrap();
    for i in (0..STATES).filter(|&i| i != 11) {
        for j in 0..LATERAL_STATES {
            let expected = if j < STATES { a[(i, j)] } else { 0.0 };
            assert_abs_diff_eq!(a20[(i, j)], expected, epsilon = 1e-12 * a.amax());
        }
        for j in 0..6 {
            assert_abs_diff_eq!(b20[(i, j)], b[(i, j)], epsilon = 1e-12 * b.amax());
        }
    }
}

#[test]
fn lateral_states_are_fed_back_on_demand() {
    // Check numbers: the gain for sideslip in the integrated law is about -1.9e5 N/rad, and the closed loop is stable.
    let p = VehicleParameters { lateral_states: true, ..VehicleParameters::default() };
    let with = regulator(&p, &integrated(), FORCE).unwrap();
    assert_eq!(with.gain.shape(), (6, LATERAL_STATES));
    assert!(with.poles.iter().all(|pole| pole.re < 0.0));
    let gains = Gains::derived(&p, &integrated(), FORCE).unwrap();
    for (i, beta) in gains.beta.iter().enumerate() {
        // The right side pushes up when the left side pulls down.
        assert_abs_diff_eq!(*beta * left_is_positive(i), -1.9e5, epsilon = 0.05e5);
    }
    let without = Gains::derived(&VehicleParameters::default(), &integrated(), FORCE).unwrap();
    assert_eq!((*without.beta, *without.r), ([0.0; 6], [0.0; 6]));
}

#[test]
fn designs_without_solution_say_what_was_expected() {
    let rejected =
        |p: VehicleParameters, outputs: &[Accepted], force: f64| Gains::derived(&p, outputs, force).unwrap_err();
    let start = VehicleParameters::default;
    assert_eq!(
        rejected(VehicleParameters { m: 3000.0, ..start() }, &integrated(), FORCE),
        "'vehicle.mass' must be more than six times 'wheel.mass' (3600 kg), got 3000 kg"
    );
    // The lower limit is (m_s h_s)^2/m + I_xz^2/I_z, as in the plant, with and without lateral states.
    for lateral_states in [false, true] {
        let light = VehicleParameters { i_x: 20_000.0, lateral_states, ..start() };
        assert_eq!(
            rejected(light, &integrated(), FORCE),
            "'body.roll_axis_inertia' must be more than 29292 kg.m2, got 20000 kg.m2: mass, \
             'geometry.body_cg_to_roll_axis' and 'body.product_of_inertia' need it"
        );
        for i_xz in [1e300, -1e300] {
            let message = rejected(VehicleParameters { i_xz, lateral_states, ..start() }, &integrated(), FORCE);
            assert!(message.contains("'body.product_of_inertia' need it"), "{message}");
        }
    }
    // An oversteering vehicle above its critical speed. No suspension force affects its lateral motion.
    let unstable = VehicleParameters {
        lateral_states: true,
        h_s: 0.0,
        i_xz: 0.0,
        c: ThreeAxles([6e5, 3e5, 1e5]),
        speed: 20.0,
        ..start()
    };
    assert_eq!(
        rejected(unstable, &integrated(), FORCE),
        "no suspension gains for these vehicle data and these values of 'accepted': Riccati design: no convergence; \
         (A, B) is not stabilizable, the Hamiltonian matrix has eigenvalues on the imaginary axis, or the cost ignores an unstable mode"
    );
}

#[test]
fn accepted_values_whose_weight_is_no_number_are_rejected() {
    let rejected =
        |outputs: &[Accepted], force| Gains::derived(&VehicleParameters::default(), outputs, force).unwrap_err();
    assert_eq!(
        rejected(&integrated(), 1e-200),
        "'accepted.suspension_force' must be a number in [1e-150, 1e150], got 1e-200"
    );
    for quantity in [
        Weighted::HeaveAcceleration,
        Weighted::PitchAcceleration,
        Weighted::Roll,
        Weighted::RollAcceleration,
        Weighted::SuspensionDeflections,
        Weighted::TireDeflections,
    ] {
        assert_eq!(
            rejected(&accepted([(quantity, 1e200)]), FORCE),
            format!("'{}' must be a number in [1e-150, 1e150], got 1e200", quantity.parameter())
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Mirroring the state mirrors the forces. The gains are symmetric only to about 1e-12 of the largest, because the
    /// iteration of the Riccati solution rounds asymmetrically.
    #[test]
    fn the_forces_are_symmetric(values in prop::collection::vec(-1.0..1.0_f64, 20), lateral_states: bool) {
        let p = VehicleParameters { lateral_states, ..VehicleParameters::default() };
        let x: Feedback = fmu::Variables::from_reals(&values);
        let other_side = |family: &SixWheels<f64>| SixWheels::from_fn(|i| family[i ^ 1]);
        let mirror = Feedback {
            phi: -x.phi,
            z_w: other_side(&x.z_w),
            phid: -x.phid,
            zd_w: other_side(&x.zd_w),
            beta: -x.beta,
            r: -x.r,
            ..x
        };
        for gains in [Gains::derived(&p, &integrated(), FORCE), Gains::derived(&p, &roll(), FORCE)] {
            let gains = gains.unwrap();
            let (forces, mirrored) = (gains.force(&x), other_side(&gains.force(&mirror)));
            for i in 0..6 {
                prop_assert!((forces[i] - mirrored[i]).abs() < 1e-5, "{forces:?} {mirrored:?}");
            }
        }
    }
}
