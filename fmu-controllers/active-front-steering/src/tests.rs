//! Check numbers, the law without fuzzy rules, and its symmetry and limits.

use approx::assert_abs_diff_eq;
use proptest::prelude::*;

use super::*;

const REST: U = U { delta: 0.0, w_d: 0.0, w: 0.0 };

fn derived(p: &ActiveFrontSteering) -> D {
    p.derived().unwrap()
}

fn sample(p: &ActiveFrontSteering, d: &D, x: &mut X, u: &U) -> Y {
    p.update(Sample { time: 0.0, state: x, inputs: u, derived: d })
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
        let p = ActiveFrontSteering { rule_table, ..ActiveFrontSteering::default() };
        let y = sample(&p, &derived(&p), &mut X::default(), &U { delta: 0.07, ..REST });
        assert_eq!((y.delta[0], y.dd[0]), (0.07, 0.0));
        assert_abs_diff_eq!(y.kp, 0.4 + 0.1 * dk[0], epsilon = 1e-9);
        assert_abs_diff_eq!(y.ki, 2.0 + 0.5 * dk[1], epsilon = 5e-9);
        assert_abs_diff_eq!(y.kd, 0.02 + 0.005 * dk[2], epsilon = 1e-10);
    }
}

#[test]
fn the_first_sample_has_the_rules_of_its_error_and_no_kick() {
    // An error of a third of the range means E = 1. Without a previous sample, the rate is 0, so EC = 0. The increments
    // are then dKp = 0.99996779 and dKi = -0.99996779 (independent implementation, 8 digits).
    let p = ActiveFrontSteering::default();
    let e = 0.1 / 3.0;
    let y = sample(&p, &derived(&p), &mut X::default(), &U { w_d: 0.12 + e, w: 0.12, ..REST });
    let expected = (0.4 + 0.099996779) * e + (2.0 - 0.499983895) * e * 0.001;
    assert_abs_diff_eq!(y.dd[0], expected, epsilon = 1e-10);
    assert_abs_diff_eq!(y.delta[0], expected, epsilon = 1e-10);
}

#[test]
fn without_rules_it_is_a_pid_on_the_yaw_rate() {
    // The law written out: K_p e + sum K_i e T + K_d d, with the filtered difference quotient d. Tolerance: rounding.
    let p = ActiveFrontSteering { kp_scale: 0.0, ki_scale: 0.0, kd_scale: 0.0, ..ActiveFrontSteering::default() };
    let d = derived(&p);
    let a = (-0.05_f64).exp();
    let (mut x, mut integral, mut rate, mut last) = (X::default(), 0.0, 0.0, None);
    for n in 0..50 {
        let e = 0.02 * (0.3 * f64::from(n)).sin() + 0.01;
        rate = a * rate + (1.0 - a) * (e - last.unwrap_or(e)) / 0.001;
        last = Some(e);
        integral += 2.0 * e * 0.001;
        let y = sample(&p, &d, &mut x, &U { w_d: e, ..REST });
        let expected: f64 = 0.4 * e + integral + 0.02 * rate;
        assert_abs_diff_eq!(y.dd[0], expected.clamp(-0.06, 0.06), epsilon = 1e-14);
    }
}

#[test]
fn a_lasting_error_leads_to_the_limit_and_no_further() {
    let p = ActiveFrontSteering::default();
    let (d, mut x) = (derived(&p), X::default());
    let y = (0..5000).map(|_| sample(&p, &d, &mut x, &U { w_d: 0.02, ..REST })).last().unwrap();
    assert_eq!(y.dd[0], 0.06);
    // The integral stops growing when the output reaches its limit, so the output leaves the limit once the error is 0.
    let after = sample(&p, &d, &mut x, &U { w_d: 0.0, ..REST });
    assert!(x.i < 0.06 && after.dd[0] < 0.06);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// With the mirrored rules, right turns mirror left turns bit for bit. With both sets of rules, the correction
    /// stays within its limits.
    #[test]
    fn the_law_is_odd_and_bounded(
        inputs in prop::collection::vec((-0.3..0.3_f64, -0.5..0.5_f64, -0.5..0.5_f64), 1..50), standard: bool,
    ) {
        let rule_table = if standard { Rules::Standard } else { Rules::Mirrored };
        let p = ActiveFrontSteering { rule_table, ..ActiveFrontSteering::default() };
        let d = derived(&p);
        let (mut left, mut right) = (X::default(), X::default());
        for (delta, w_d, w) in inputs {
            let y = sample(&p, &d, &mut left, &U { delta, w_d, w });
            prop_assert!(y.dd[0].abs() <= 0.06 && y.kp >= 0.0 && y.ki >= 0.0 && y.kd >= 0.0);
            if !standard {
                let mirror = sample(&p, &d, &mut right, &U { delta: -delta, w_d: -w_d, w: -w });
                prop_assert_eq!((y.delta[0], y.dd[0]), (-mirror.delta[0], -mirror.dd[0]));
                prop_assert_eq!((y.kp, y.ki, y.kd), (mirror.kp, mirror.ki, mirror.kd));
            }
        }
    }
}
