//! Check numbers, and symmetry and limits of the law.

use approx::assert_abs_diff_eq;
use proptest::prelude::*;

use super::*;

fn derived(p: &AllWheelSteering) -> D {
    p.derived().unwrap()
}

fn sample(p: &AllWheelSteering, d: &D, x: &mut X, u: &U) -> Y {
    p.update(Sample { time: 0.0, state: x, inputs: u, derived: d })
}

#[test]
fn the_middle_ratio_has_the_check_numbers() {
    // Computed by an independent implementation, printed to 8 decimals. The ratio is constant below -1 and above 1.
    let middle = derived(&AllWheelSteering::default()).middle;
    let numbers =
        [(-1.0, -0.66663366), (-0.5, -0.3334), (0.0, 0.0), (0.1, 0.23939586), (0.5, 0.70883073), (1.0, 0.89217822)];
    for (k2, k1) in numbers {
        assert_abs_diff_eq!(middle.of(k2), k1, epsilon = 1e-8);
    }
    assert_eq!((middle.of(-1.5), middle.of(1.5)), (middle.of(-1.0), middle.of(1.0)));
    assert!(middle.of(f64::NAN).is_nan());
}

#[test]
fn the_first_sample_has_the_rules_of_its_error() {
    // An error of a third of the range means E = 1, and EC is 0. The increments are then dKp = 0.99996779 and
    // dKi = -0.99996779 (independent implementation, 8 digits). In this left turn, the rear slides outward, so the rear
    // axle has to steer in the direction of the front axle.
    let p = AllWheelSteering::default();
    let e = 0.2 / 3.0;
    let y = sample(&p, &derived(&p), &mut X::default(), &U { delta: 0.1, beta_d: 0.0, beta: -e });
    let k2 = (6.0 + 0.99996779) * e + (30.0 - 5.0 * 0.99996779) * e * 0.001;
    assert_abs_diff_eq!(y.ratio[1], k2, epsilon = 1e-8);
    assert_abs_diff_eq!(y.delta[1], 0.1 * k2, epsilon = 1e-9);
    assert_eq!(y.delta[0], 0.1 * y.ratio[0]);
    assert_eq!(y.ratio[0], derived(&p).middle.of(y.ratio[1]));
}

#[test]
fn without_error_the_gains_are_those_of_the_rules_at_zero() {
    // The expected gains are k + scale dK(0, 0), with increments dK that an independent implementation printed to 8
    // digits.
    let cases = [
        (Rules::Mirrored, [0.21831225, -0.08619045, -1.08617784]),
        (Rules::Standard, [0.129705217, 0.0, -0.999967787]),
    ];
    for (rule_table, dk) in cases {
        let p = AllWheelSteering { rule_table, ..AllWheelSteering::default() };
        let y = sample(&p, &derived(&p), &mut X::default(), &U { delta: 0.1, beta_d: 0.0, beta: 0.0 });
        assert_eq!((y.delta[1], y.ratio[1]), (0.0, 0.0));
        assert_abs_diff_eq!(y.ratio[0], 0.0, epsilon = 1e-15); // a sum over a symmetric set
        assert_abs_diff_eq!(y.kp, 6.0 + dk[0], epsilon = 1e-8);
        assert_abs_diff_eq!(y.ki, 30.0 + 5.0 * dk[1], epsilon = 5e-8);
        assert_abs_diff_eq!(y.kd, 0.3 + 0.05 * dk[2], epsilon = 1e-9);
    }
}

#[test]
fn straight_ahead_the_integral_rests() {
    // If the driver does not steer, the error is 0. At half of `sign_width`, the error is halved.
    let p = AllWheelSteering::default();
    let (d, mut x) = (derived(&p), X::default());
    for _ in 0..100 {
        let y = sample(&p, &d, &mut x, &U { delta: 0.0, beta_d: 0.0, beta: 0.05 });
        assert_eq!((*y.delta, y.ratio[1], x.i), ([0.0; 2], 0.0, 0.0));
    }
    let half = sample(&p, &d, &mut X::default(), &U { delta: 0.01, beta_d: 0.0, beta: -0.1 });
    let full = sample(&p, &d, &mut X::default(), &U { delta: 0.3, beta_d: 0.0, beta: -0.05 });
    assert_eq!(half.ratio, full.ratio);
}

#[test]
fn the_sideslip_reference_is_followed_from_either_side() {
    // The integral grows while the sideslip angle is below its reference and falls above it.
    let p = AllWheelSteering::default();
    let d = derived(&p);
    for (beta_d, beta, sign) in [(0.02, 0.0, 1.0), (-0.02, 0.0, -1.0), (0.01, 0.03, -1.0)] {
        let mut x = X::default();
        sample(&p, &d, &mut x, &U { delta: 0.1, beta_d, beta });
        assert!(x.i * sign > 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Right turns mirror left turns bit for bit: the ratios are the same, even with asymmetric rules, because the
    /// error has the sign of the turn. The ratios stay within the range of Table 2.
    #[test]
    fn left_and_right_turns_are_alike(
        inputs in prop::collection::vec((-0.3..0.3_f64, -0.1..0.1_f64, -0.3..0.3_f64), 1..50), standard: bool,
    ) {
        let rule_table = if standard { Rules::Standard } else { Rules::Mirrored };
        let p = AllWheelSteering { rule_table, ..AllWheelSteering::default() };
        let d = derived(&p);
        let (mut left, mut right) = (X::default(), X::default());
        for (delta, beta_d, beta) in inputs {
            let y = sample(&p, &d, &mut left, &U { delta, beta_d, beta });
            let mirror = sample(&p, &d, &mut right, &U { delta: -delta, beta_d: -beta_d, beta: -beta });
            prop_assert_eq!(y.ratio, mirror.ratio);
            prop_assert_eq!(*y.delta, mirror.delta.map(|angle| -angle));
            prop_assert!((-1.0..=1.0).contains(&y.ratio[1]) && (-0.6667..=0.8922).contains(&y.ratio[0]));
        }
    }
}
