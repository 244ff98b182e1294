//! Switching between two laws with hysteresis.

/// Returns true if a law is on. It switches on when `x` exceeds `threshold`, and off when `x` has fallen to
/// `threshold - width`.
///
/// * `was_on`: the result for the previous sample.
/// * `width`: hysteresis in the unit of `x`, not negative; 0 switches back at once.
///
/// A NaN switches the law off.
///
/// ```
/// use chassis_control::switch::hysteresis;
/// assert!(!hysteresis(false, 0.8, 0.8, 0.1));
/// assert!(hysteresis(false, 0.81, 0.8, 0.1));
/// assert!(hysteresis(true, 0.75, 0.8, 0.1));
/// assert!(!hysteresis(true, 0.69, 0.8, 0.1));
/// ```
pub fn hysteresis(was_on: bool, x: f64, threshold: f64, width: f64) -> bool {
    x > threshold || (was_on && x > threshold - width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn edges_belong_to_off() {
        assert!(!hysteresis(false, 0.5, 0.5, 0.0));
        assert!(!hysteresis(true, 0.5, 0.5, 0.0));
        assert!(!hysteresis(true, 0.25, 0.5, 0.25));
    }

    #[test]
    fn nan_switches_off() {
        for was_on in [false, true] {
            assert!(!hysteresis(was_on, f64::NAN, 0.5, 0.1));
            assert!(!hysteresis(was_on, 1.0, f64::NAN, 0.1));
        }
    }

    proptest! {
        /// Outside the band, the result depends only on `x`; inside, only on `was_on`.
        #[test]
        fn only_the_band_remembers(x in -2.0..2.0f64, threshold in -1.0..1.0f64, width in 0.0..1.0f64, was_on: bool) {
            let is_on = hysteresis(was_on, x, threshold, width);
            if x > threshold {
                prop_assert!(is_on);
            } else if x <= threshold - width {
                prop_assert!(!is_on);
            } else {
                prop_assert_eq!(is_on, was_on);
            }
        }
    }
}
