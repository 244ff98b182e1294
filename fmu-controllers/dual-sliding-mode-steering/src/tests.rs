//! Check numbers, closed forms and invariants of the steering law.
//!
//! "Check numbers" were computed by an independent implementation of the law and are compared to their last printed
//! digit.

use approx::assert_abs_diff_eq;
use fmu::Enumeration as _;
use proptest::prelude::*;

use super::*;

const KM_H: f64 = 1.0 / 3.6;

fn derived(p: &DualSlidingModeSteering) -> D {
    equations::derived(p).unwrap()
}

fn sample(p: &DualSlidingModeSteering, x: &mut X, u: &U) -> Y {
    equations::sample(p, &derived(p), x, u)
}

/// Inputs of the check numbers.
const TURN: U = U { steer: 0.05, u: 10.0, beta: 0.01, r: 0.1, k3: 1.0 };

#[test]
fn three_samples_from_rest_have_the_check_numbers() {
    let p = DualSlidingModeSteering::default();
    let mut x = X::default();
    let expected = [
        (0.02072383357, 0.02708851014, 0.000174532925, 0.0),
        (0.02050099309, 0.02711281770, 0.000349065850, 1.9272766159e-6),
        (0.02027815414, 0.02713712373, 0.000523598776, 5.7722176328e-6),
    ];
    for (n, (middle, rear, front, reference)) in expected.into_iter().enumerate() {
        let y = sample(&p, &mut x, &TURN);
        assert_abs_diff_eq!(y.request[0], middle, epsilon = 1e-11);
        assert_abs_diff_eq!(y.request[1], rear, epsilon = 1e-11);
        assert_abs_diff_eq!(y.delta[0], front, epsilon = 1e-12);
        // The rate limit of the middle and rear axles: 30 deg/s times 1 ms per sample.
        let slewed = 0.000523598776 * (n + 1) as f64;
        assert_abs_diff_eq!(y.delta[1], slewed, epsilon = 2e-12);
        assert_abs_diff_eq!(y.delta[2], slewed, epsilon = 2e-12);
        assert_abs_diff_eq!(y.r_d, reference, epsilon = 1e-16);
    }
}

#[test]
fn small_slip_angles_have_the_check_numbers() {
    let p =
        DualSlidingModeSteering { slip_angle_model: SlipAngleModel::SmallAngle, ..DualSlidingModeSteering::default() };
    let y = sample(&p, &mut X::default(), &TURN);
    assert_abs_diff_eq!(y.request[0], 0.02076301808, epsilon = 1e-11);
    assert_abs_diff_eq!(y.request[1], 0.02706244899, epsilon = 1e-11);
}

#[test]
fn small_slip_angles_solve_the_equations_of_the_paper() {
    // Eqs. 14-31 written with A1, A2, A3 as in the paper (k = -C, six tires): the angles must satisfy both equations.
    // Tolerance: rounding errors of forces of 1e5 N, divided by 6e5 N/rad.
    let p =
        DualSlidingModeSteering { slip_angle_model: SlipAngleModel::SmallAngle, ..DualSlidingModeSteering::default() };
    let d = derived(&p);
    let Vehicle { a, b, c, c_axle: [c_f, c_m, c_r], .. } = d.vehicle;
    let (a1, a2, a3) = (c_f + c_m + c_r, a * c_f - b * c_m - c * c_r, a * a * c_f + b * b * c_m + c * c * c_r);
    let U { u, beta, r, .. } = TURN;
    let memory = X { i_b: 0.001, i_r: -0.002, r_d: 0.09, df: 0.04, ..X::default() };
    let mut x = memory.clone();
    let y = sample(&p, &mut x, &TURN);

    let (s_b, e_r) = (beta + p.zeta[0] * memory.i_b, r - memory.r_d);
    let s_r = e_r + p.zeta[1] * memory.i_r;
    assert_eq!((y.s_b, y.s_r), (s_b, s_r));
    let reach_b = -p.zeta[0] * beta - p.k[0] * s_b - p.eps_b * (s_b / p.width_b).clamp(-1.0, 1.0);
    let gain = d.vehicle.yaw_rate_gain(p.reference_model, u);
    let rd_d = (gain * x.df.tan() - memory.r_d) / p.tau;
    let reach_r = rd_d - p.zeta[1] * e_r - p.k[1] * s_r - p.eps_r * (s_r / p.width_r).clamp(-1.0, 1.0);
    let n_b = a1 * beta + (a2 / u + p.m * u) * r - c_f * x.df + p.m * u * reach_b;
    let n_r = a2 * beta + a3 * r / u - a * c_f * x.df + p.i_z * reach_r;
    assert_abs_diff_eq!(c_m * y.request[0] + c_r * y.request[1], n_b, epsilon = 1e-9);
    assert_abs_diff_eq!(-b * c_m * y.request[0] - c * c_r * y.request[1], n_r, epsilon = 1e-9);
}

#[test]
fn the_steady_turn_needs_the_angles_of_equal_slip() {
    // Steady state with zero sideslip at 35 km/h and 0.05 rad. All axles have the slip angle alpha = m u r/A1. The
    // middle axle therefore has the angle alpha - b r/u, and the rear axle alpha - c r/u, with r = gain tan(0.05).
    // Replacing arc tangents and the tangent by their arguments changes angles by less than 0.05^3/3 = 4e-5 rad, and
    // the result by less than 1e-4.
    let p = DualSlidingModeSteering::default();
    let d = derived(&p);
    let u = 35.0 * KM_H;
    let r = d.vehicle.yaw_rate_gain(p.reference_model, u) * 0.05_f64.tan();
    assert_abs_diff_eq!(r, 0.110394, epsilon = 1e-6); // check number
    let mut x = X { r_d: r, df: 0.05, ..X::default() };
    let y = sample(&p, &mut x, &U { steer: 0.05, u, beta: 0.0, r, k3: 1.0 });
    let alpha = p.m * u * r / d.vehicle.c_axle.iter().sum::<f64>();
    assert_abs_diff_eq!(alpha - d.vehicle.b * r / u, 0.01655, epsilon = 1e-5); // check number
    assert_abs_diff_eq!(alpha - d.vehicle.c * r / u, -0.00219, epsilon = 1e-5); // check number
    assert_abs_diff_eq!(y.request[0], alpha - d.vehicle.b * r / u, epsilon = 1e-4);
    assert_abs_diff_eq!(y.request[1], alpha - d.vehicle.c * r / u, epsilon = 1e-4);
    assert_eq!((y.s_b, y.s_r), (0.0, 0.0));
}

#[test]
fn the_front_axle_slews_to_the_angle_of_the_largest_lateral_acceleration() {
    // A step of pi/6 at 35 km/h. At 10 deg/s, the axle reaches its limit of 9.8995 deg (check number) after 0.99 s. The
    // reference then approaches ay_limit/u; after 9 s, exp(-9/0.2) of the difference remains.
    let p = DualSlidingModeSteering::default();
    let mut x = X::default();
    let u = U { steer: std::f64::consts::FRAC_PI_6, u: 35.0 * KM_H, beta: 0.0, r: 0.0, k3: 0.0 };
    let mut y = Y::default();
    for n in 1..=10_000 {
        y = sample(&p, &mut x, &u);
        let slewed: f64 = 0.01 * f64::from(n);
        assert_abs_diff_eq!(y.delta[0].to_degrees(), slewed.min(9.8995), epsilon = 1e-4);
    }
    assert_abs_diff_eq!(y.r_d, p.ay_limit / u.u, epsilon = 1e-12);
    assert_eq!((y.delta[1], y.delta[2]), (0.0, 0.0));
}

#[test]
fn switched_off_the_axles_return_and_the_integrals_are_cleared() {
    let p = DualSlidingModeSteering::default();
    let mut x = X::default();
    for _ in 0..100 {
        sample(&p, &mut x, &TURN);
    }
    assert!(x.i_b > 0.0 && x.i_r > 0.0);
    let last = x.dm;
    let y = sample(&p, &mut x, &U { k3: 0.5, ..TURN });
    assert_eq!((x.i_b, x.i_r, y.s_b, y.s_r), (0.0, 0.0, 0.0, 0.0));
    assert_eq!((y.request[0], y.request[1]), (0.0, 0.0));
    assert_abs_diff_eq!(y.delta[1], last - p.rate * p.sample_time * last.signum(), epsilon = 1e-16); // one rounding
}

#[test]
fn the_integrals_wait_while_an_axle_is_at_its_limit() {
    let p = DualSlidingModeSteering { limit: 0.01, ..DualSlidingModeSteering::default() };
    let mut x = X::default();
    let y = sample(&p, &mut x, &TURN);
    assert!(y.request[1] > p.limit);
    assert_eq!((x.i_b, x.i_r), (0.0, 0.0));
    // Below the limit, the integral is exactly T e.
    let p = DualSlidingModeSteering::default();
    sample(&p, &mut x, &TURN);
    assert_eq!(x.i_b, p.sample_time * TURN.beta);
}

#[test]
fn without_rate_limits_the_axles_follow_at_once() {
    let p = DualSlidingModeSteering { front_rate: 0.0, rate: 0.0, ..DualSlidingModeSteering::default() };
    let y = sample(&p, &mut X::default(), &TURN);
    assert_eq!(y.delta[0], 0.05);
    assert_eq!((y.delta[1], y.delta[2]), (y.request[0], y.request[1]));
}

fn any_memory() -> impl Strategy<Value = X> {
    prop::array::uniform6(-0.1..0.1_f64).prop_map(|[i_b, i_r, r_d, df, dm, dr]| X { i_b, i_r, r_d, df, dm, dr })
}

fn any_inputs() -> impl Strategy<Value = U> {
    (-0.6..0.6, 0.0..20.0, -0.3..0.3, -0.6..0.6, 0.0..1.0).prop_map(|(steer, u, beta, r, k3)| U {
        steer,
        u,
        beta,
        r,
        k3,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Right turns mirror left turns bit for bit.
    #[test]
    fn the_law_is_odd(x in any_memory(), u in any_inputs(), ordinary_reference: bool, small_angles: bool) {
        let p = DualSlidingModeSteering {
            reference_model: ReferenceModel::from_value(i32::from(!ordinary_reference)).unwrap(),
            slip_angle_model: SlipAngleModel::from_value(i32::from(!small_angles)).unwrap(),
            ..DualSlidingModeSteering::default()
        };
        let (mut left, mut right) = (
            x.clone(),
            X { i_b: -x.i_b, i_r: -x.i_r, r_d: -x.r_d, df: -x.df, dm: -x.dm, dr: -x.dr },
        );
        let y = sample(&p, &mut left, &u);
        let mirror = sample(&p, &mut right, &U { steer: -u.steer, beta: -u.beta, r: -u.r, ..u });
        prop_assert_eq!(*y.delta, mirror.delta.map(|angle| -angle));
        prop_assert_eq!(*y.request, mirror.request.map(|angle| -angle));
        prop_assert_eq!((y.s_b, y.s_r, y.r_d), (-mirror.s_b, -mirror.s_r, -mirror.r_d));
        prop_assert_eq!((left.i_b, left.i_r, left.r_d), (-right.i_b, -right.i_r, -right.r_d));
    }

    /// Angles and rates stay within their limits from any state within them, at any speed down to 0.
    #[test]
    fn angles_and_rates_keep_their_limits(x in any_memory(), u in any_inputs()) {
        let p = DualSlidingModeSteering::default();
        let mut after = x.clone();
        let y = sample(&p, &mut after, &u);
        let steps = [(x.df, y.delta[0], p.front_rate), (x.dm, y.delta[1], p.rate), (x.dr, y.delta[2], p.rate)];
        for (before, angle, rate) in steps {
            prop_assert!(angle.is_finite() && angle.abs() <= p.limit);
            // Tolerance: rounding of an angle below 1 rad.
            prop_assert!((angle - before).abs() <= rate * p.sample_time + 1e-16);
        }
        prop_assert!(y.r_d.is_finite() && after.r_d.is_finite());
    }
}
