//! Thresholds, control cases, blending, and invariants of the switch.

use fmu::Enumeration as _;
use proptest::prelude::*;

use super::{Discrete, Sample, Sides, Strategy, SuspensionSwitch, U, X, Y};

fn sample(p: &SuspensionSwitch, x: &mut X, u: &U) -> Y {
    p.update(Sample { time: 0.0, derived: &(), state: x, inputs: u })
}

/// A load transfer ratio, and different forces for the two laws.
fn inputs(ltr: f64) -> U {
    U { ltr, f_c: Sides([100.0, 44.0]), f_h: Sides([-2000.0, 2000.0]) }
}

/// The modes for a sequence of load transfer ratios.
fn modes(p: &SuspensionSwitch, ratios: &[f64]) -> Vec<i32> {
    let mut x = X::default();
    ratios.iter().map(|&ltr| sample(p, &mut x, &inputs(ltr)).mode).collect()
}

#[test]
fn it_starts_with_comfort_and_switches_above_the_threshold() {
    // At the threshold Q = 0.8 itself, the comfort law is active. In a right turn, the signed ratio is negative and
    // thus below Q.
    assert_eq!(modes(&SuspensionSwitch::default(), &[0.0, 0.8, 0.81, 0.8, 0.81, -0.9]), [0, 0, 1, 0, 1, 0]);
}

#[test]
fn hysteresis_keeps_the_handling_law() {
    let p = SuspensionSwitch { width: 0.25, q: 0.75, ..SuspensionSwitch::default() };
    assert_eq!(modes(&p, &[0.6, 0.76, 0.6, 0.51, 0.5, 0.6]), [0, 1, 1, 1, 0, 0]);
}

#[test]
fn the_magnitude_protects_right_turns_too() {
    let p = SuspensionSwitch { magnitude: true, ..SuspensionSwitch::default() };
    assert_eq!(modes(&p, &[-0.79, -0.81, 0.81, 0.0]), [0, 1, 1, 0]);
}

#[test]
fn the_control_cases_choose_the_law() {
    let sample = |strategy, ltr| {
        let y = sample(&SuspensionSwitch { strategy, ..SuspensionSwitch::default() }, &mut X::default(), &inputs(ltr));
        (y.f.0, y.mode)
    };
    let (comfort, handling) = (inputs(0.0).f_c.0, inputs(0.0).f_h.0);
    assert_eq!(sample(Strategy::Switched, 0.9), (handling, 1));
    assert_eq!(sample(Strategy::Switched, 0.5), (comfort, 0));
    assert_eq!(sample(Strategy::Comfort, 0.9), (comfort, 0));
    assert_eq!(sample(Strategy::Handling, 0.5), (handling, 1));
    assert_eq!(sample(Strategy::Passive, 0.5), ([0.0; 2], 0));
    assert_eq!(sample(Strategy::Passive, 0.9), ([0.0; 2], 1));
}

#[test]
fn blending_takes_its_time() {
    // 0.25 s are 250 samples of 1 ms; each adds 0.004, with one rounding error. Later, the direction changes in the
    // middle of a blend.
    let p = SuspensionSwitch { blend_time: 0.25, ..SuspensionSwitch::default() };
    let mut x = X::default();
    for n in 1..=260 {
        let y = sample(&p, &mut x, &inputs(0.9));
        let w = (0.004 * f64::from(n)).min(1.0);
        assert!((y.w - w).abs() < 1e-13, "{n}");
        assert!((y.f[0] - (100.0 - 2100.0 * w)).abs() < 1e-9, "{n}");
        assert_eq!(y.mode, 1);
    }
    assert_eq!(x.w, 1.0);
    for _ in 0..100 {
        sample(&p, &mut x, &inputs(0.0));
    }
    assert!((x.w - 0.6).abs() < 1e-13);
    let y = sample(&p, &mut x, &inputs(0.9));
    assert!((y.w - 0.604).abs() < 1e-13);
}

#[test]
fn a_blend_shorter_than_a_sample_is_at_once() {
    let p = SuspensionSwitch { blend_time: 1e-4, ..SuspensionSwitch::default() };
    assert_eq!(sample(&p, &mut X::default(), &inputs(0.9)).w, 1.0);
}

proptest! {
    /// Without blending, the force is exactly one of the two proposals; with blending, it is between them.
    #[test]
    fn the_force_is_a_mean_of_the_proposals(
        ltr in -1.5..1.5, f in prop::array::uniform4(-1e4..1e4_f64), w in 0.0..=1.0, handling: bool,
        blend_time in prop_oneof![Just(0.0), 0.001..1.0], strategy in 0..3,
    ) {
        let p = SuspensionSwitch { blend_time, strategy: Strategy::from_value(strategy).unwrap(), ..SuspensionSwitch::default() };
        let u = U { ltr, f_c: Sides([f[0], f[1]]), f_h: Sides([f[2], f[3]]) };
        let y = sample(&p, &mut X { handling, w }, &u);
        prop_assert!((0.0..=1.0).contains(&y.w));
        if blend_time == 0.0 {
            prop_assert_eq!(y.f, if y.mode == 1 { u.f_h } else { u.f_c });
        }
        for i in 0..2 {
            let (low, high) = (u.f_c[i].min(u.f_h[i]), u.f_c[i].max(u.f_h[i]));
            // Tolerance: two rounding errors of forces of up to 1e4 N.
            prop_assert!(low - 1e-11 <= y.f[i] && y.f[i] <= high + 1e-11);
        }
    }
}
