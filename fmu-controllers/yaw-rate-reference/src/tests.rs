//! Check numbers, the steady turn, the step response, and symmetry.
//!
//! "Check numbers" were computed by an independent implementation and are compared to their last printed digit.

use approx::assert_abs_diff_eq;
use proptest::prelude::*;

use super::*;

const KM_H: f64 = 1.0 / 3.6;

/// The references of `n` samples with constant inputs.
fn run(p: &YawRateReference, u: &U, n: usize) -> Vec<f64> {
    let mut x = X::default();
    (0..n).map(|_| p.update(Sample { time: 0.0, state: &mut x, inputs: u, derived: &() }).w).collect()
}

#[test]
fn gains_and_time_constants_have_the_check_numbers() {
    let numbers =
        [(20.0, 1.25236, 0.10442), (40.0, 1.60005, 0.13340), (60.0, 1.49819, 0.12491), (80.0, 1.30896, 0.10913)];
    for (km_h, k, tau) in numbers {
        let (actual_k, actual_tau) = gain_and_time_constant(&YawRateReference::default(), km_h * KM_H);
        assert_abs_diff_eq!(actual_k, k, epsilon = 5.1e-6);
        assert_abs_diff_eq!(actual_tau, tau, epsilon = 5.1e-6);
    }
}

#[test]
fn the_gain_balances_forces_and_moments_without_sideslip() {
    // In a steady turn with beta = 0, the front force 2 kc (delta - l1 w/u) and a rear force at l2 add up to m u w and
    // produce no moment.
    let p = YawRateReference::default();
    let u = 60.0 * KM_H;
    let (k, _) = gain_and_time_constant(&p, u);
    let (delta, w) = (0.01, k * 0.01);
    let front = 2.0 * p.kc[0] * (delta - p.l1 * w / u);
    let rear = p.m * u * w - front;
    // Tolerance: rounding errors of moments of 1e4 N m.
    assert_abs_diff_eq!(p.l1 * front - p.l2 * rear, 0.0, epsilon = 1e-10);
}

#[test]
fn a_step_rises_with_the_time_constant_and_shows_one_sample_later() {
    // Closed form of the sampled lag: k delta (1 - exp(-n T/tau)). Tolerance: rounding errors of numbers of about 0.1.
    let p = YawRateReference::default();
    let u = U { delta: 0.1, u: 60.0 * KM_H };
    let (k, tau) = gain_and_time_constant(&p, u.u);
    let references = run(&p, &u, 3000);
    assert_eq!(references[0], 0.0);
    for (n, reference) in references.iter().enumerate() {
        assert_abs_diff_eq!(*reference, k * 0.1 * (1.0 - (-(n as f64) * p.sample_time / tau).exp()), epsilon = 1e-14);
    }
    assert_abs_diff_eq!(references[2999], 0.1498, epsilon = 5e-5); // check number
    // With ten times the sample time, every tenth value is the same.
    let coarse = run(&YawRateReference { sample_time: 0.01, ..p }, &u, 300);
    for (n, reference) in coarse.into_iter().enumerate() {
        assert_abs_diff_eq!(reference, references[10 * n], epsilon = 1e-14);
    }
}

#[test]
fn a_standing_vehicle_does_not_turn() {
    assert_eq!(gain_and_time_constant(&YawRateReference::default(), 0.0), (0.0, 0.0));
    assert!(run(&YawRateReference::default(), &U { delta: 0.5, u: 0.0 }, 10).iter().all(|&reference| reference == 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Left and right are mirror images bit for bit, references are finite forward and backward, and the sideslip
    /// reference is 0.
    #[test]
    fn the_law_is_odd(inputs in prop::collection::vec((-0.6..0.6_f64, -10.0..40.0_f64), 1..50)) {
        let p = YawRateReference::default();
        let (mut left, mut right) = (X::default(), X::default());
        for (delta, u) in inputs {
            let y = p.update(Sample { time: 0.0, state: &mut left, inputs: &U { delta, u }, derived: &() });
            let mirror = p.update(Sample { time: 0.0, state: &mut right, inputs: &U { delta: -delta, u }, derived: &() });
            prop_assert_eq!(y.w, -mirror.w);
            prop_assert!(y.w.is_finite() && y.beta == 0.0);
        }
    }
}
