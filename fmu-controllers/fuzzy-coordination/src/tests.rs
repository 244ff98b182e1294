//! Check numbers, symmetry and limits of the shares.

use proptest::prelude::{ProptestConfig, prop_assert, prop_assert_eq, proptest};

use super::*;

const KM_H: f64 = 1.0 / 3.6;

fn weights(p: &FuzzyCoordination, degrees: f64, km_h: f64) -> Y {
    let d = p.derived().unwrap();
    p.update(Sample {
        time: 0.0,
        state: &mut (),
        inputs: &U { steer: degrees.to_radians(), speed: km_h * KM_H },
        derived: &d,
    })
}

/// Steering angle in degrees, speed in km/h, K1, K2, computed by an independent implementation and printed to 9
/// decimals.
const CHECKS: [(f64, f64, f64, f64); 7] = [
    (30.0, 35.0, 0.146518016, 0.853481984),
    (0.0, 35.0, 0.615975864, 0.384024136),
    (10.0, 20.0, 0.492556677, 0.507443323),
    (32.0, 40.0, 0.075676347, 0.924323653),
    (16.0, 20.0, 0.381932498, 0.618067502),
    (5.0, 0.0, 0.932707829, 0.088768399),
    (20.0, 10.0, 0.580488560, 0.419511440),
];

#[test]
fn the_shares_have_the_check_numbers() {
    for (degrees, km_h, k1, k2) in CHECKS {
        let y = weights(&FuzzyCoordination::default(), degrees, km_h);
        assert!((y.k1 - k1).abs() < 1e-9 && (y.k2 - k2).abs() < 1e-9, "{degrees} deg, {km_h} km/h: {y:?}");
    }
}

#[test]
fn rules_as_printed_exchange_the_shares() {
    let printed = FuzzyCoordination { as_printed: true, ..FuzzyCoordination::default() };
    for (degrees, km_h, ..) in CHECKS {
        let (y, z) = (weights(&FuzzyCoordination::default(), degrees, km_h), weights(&printed, degrees, km_h));
        assert_eq!((y.k1, y.k2, y.k3), (z.k2, z.k1, z.k3));
    }
}

#[test]
fn multi_axle_steering_needs_speed_and_a_steering_demand() {
    let p = FuzzyCoordination::default();
    assert_eq!(weights(&p, 30.0, 0.0).k3, 0.0);
    assert_eq!(weights(&p, 30.0, -5.0).k3, 0.0);
    assert_eq!(weights(&p, 30.0, 0.001).k3, 1.0);
    assert_eq!(weights(&p, 0.999, 35.0).k3, 0.0);
    assert_eq!(weights(&p, 1.0, 35.0).k3, 1.0); // exactly the activation angle
    assert_eq!(weights(&p, -1.0, 35.0).k3, 1.0);
    // With a threshold of 0, steering is on whenever the vehicle moves.
    assert_eq!(weights(&FuzzyCoordination { delta_0: 0.0, ..p }, 0.0, 35.0).k3, 1.0);
}

#[test]
fn individual_control_has_constant_weights() {
    let p = FuzzyCoordination { strategy: Strategy::Individual, ..FuzzyCoordination::default() };
    let y = weights(&p, 30.0, 35.0);
    assert_eq!((y.k1, y.k2, y.k3), (1.0, 0.0, 1.0));
    let p = FuzzyCoordination { fixed_integrated: 0.5, fixed_roll: 0.25, fixed_steering: 0.0, ..p };
    let y = weights(&p, 0.0, 0.0);
    assert_eq!((y.k1, y.k2, y.k3), (0.5, 0.25, 0.0));
}

#[test]
fn turning_and_speed_shift_the_shares_to_the_roll_law() {
    // As the paper's text requires, K2 rises and K1 falls with steering angle and speed. This is checked at the centers
    // of the sets, because Mamdani inference is not monotone between them.
    let share = |i: usize, j: usize| weights(&FuzzyCoordination::default(), 8.0 * i as f64, 10.0 * j as f64);
    for i in 0..5 {
        for j in 0..4 {
            for (a, b) in [(share(i, j), share(i, j + 1)), (share(j, i), share(j + 1, i))] {
                assert!(b.k2 >= a.k2 - 0.02 && b.k1 <= a.k1 + 0.02, "{i} {j}: {a:?} {b:?}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Left and right turns give identical shares, because only the magnitude is used. Beyond 32 degrees and 40 km/h,
    /// nothing changes.
    #[test]
    fn the_shares_are_even_and_bounded(degrees in -60.0..60.0_f64, km_h in -10.0..80.0_f64) {
        let p = FuzzyCoordination::default();
        let y = weights(&p, degrees, km_h);
        let mirror = weights(&p, -degrees, km_h);
        prop_assert_eq!((y.k1, y.k2, y.k3), (mirror.k1, mirror.k2, mirror.k3));
        for share in [y.k1, y.k2] {
            prop_assert!((0.0..=1.0).contains(&share));
        }
        // If Table 3 were an exact mirror, the sum would be 1. But Table 3 maps PVS (1/6) to PEB (1) instead of PVB
        // (5/6), so the center moves by 1/6, and the set merges with the set for PES. An independent computation on a
        // grid found sums of 0.956 to 1.084.
        prop_assert!((0.95..1.09).contains(&(y.k1 + y.k2)), "{}", y.k1 + y.k2);
        let edge = weights(&p, degrees.clamp(-32.0, 32.0), km_h.clamp(0.0, 40.0));
        // Tolerance: rounding of the conversion between degrees and radians.
        prop_assert!((y.k1 - edge.k1).abs() < 1e-12 && (y.k2 - edge.k2).abs() < 1e-12);
    }
}
