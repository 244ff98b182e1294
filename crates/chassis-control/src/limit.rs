//! Limits on magnitude and rate, and the exact step of a first-order lag.
//!
//! The caller chooses the unit; all values of one call have the same unit. Times are in s. NaN in any argument gives
//! NaN.

/// Keeps `value` within `-limit..=limit`.
///
/// ```text
/// y = min(max(value, -limit), limit)
/// ```
///
/// * `limit`: largest magnitude, in the unit of `value`; a negative limit is treated as 0. If 0 means "no limit", call
///   [`positive_or_none`] first.
///
/// ```
/// use chassis_control::limit::{magnitude, positive_or_none};
/// assert_eq!(magnitude(3.0, 2.0), 2.0);
/// assert_eq!(magnitude(3.0, 0.0), 0.0);
/// assert_eq!(magnitude(3.0, positive_or_none(0.0)), 3.0);
/// ```
pub fn magnitude(value: f64, limit: f64) -> f64 {
    // f64::clamp panics on a NaN limit, and f64::max would drop it.
    if limit.is_nan() {
        return limit;
    }
    let limit = limit.max(0.0);
    value.clamp(-limit, limit)
}

/// Returns `limit` if it is positive, otherwise positive infinity. Use it where a limit <= 0 means "no limit".
pub fn positive_or_none(limit: f64) -> f64 {
    if limit <= 0.0 { f64::INFINITY } else { limit }
}

/// Moves from `previous` towards `target` by at most `rate * dt`.
///
/// ```text
/// y = previous + min(max(target - previous, -rate dt), rate dt)
/// ```
///
/// A target within reach is returned exactly.
///
/// * `rate`: largest speed of change in units of `target` per s; `rate` <= 0 means no limit.
/// * `dt`: time since `previous` in s, not negative.
///
/// ```
/// use chassis_control::limit::rate;
/// assert_eq!(rate(1.0, 0.0, 2.0, 0.25), 0.5);
/// assert_eq!(rate(1.0, 0.0, 0.0, 0.25), 1.0);
/// ```
pub fn rate(target: f64, previous: f64, rate: f64, dt: f64) -> f64 {
    if [target, previous, rate, dt].iter().any(|x| x.is_nan()) {
        return f64::NAN;
    }
    if rate <= 0.0 {
        return target;
    }
    let change = target - previous;
    let step = rate * dt;
    if change.abs() <= step { target } else { previous + step.copysign(change) }
}

/// One exact step of the first-order lag `time_constant * dx/dt = target - x` with a constant `target`.
///
/// ```text
/// x(t + dt) = target + (x(t) - target) exp(-dt / time_constant)
/// ```
///
/// * `value`: x(t).
/// * `time_constant`: in s; <= 0 means no lag: the result is `target`.
/// * `dt`: step in s, not negative.
///
/// ```
/// use chassis_control::limit::lag;
/// let x = lag(1.0, 0.0, 0.2, 0.2);
/// assert!((x - (-1.0_f64).exp()).abs() < 1e-15);
/// ```
pub fn lag(value: f64, target: f64, time_constant: f64, dt: f64) -> f64 {
    if time_constant <= 0.0 && !value.is_nan() && !dt.is_nan() {
        return target;
    }
    target + (value - target) * fmu::math::exp(-dt / time_constant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn magnitude_at_its_edges() {
        assert_eq!(magnitude(-3.0, 2.0), -2.0);
        assert_eq!(magnitude(1.5, 2.0), 1.5);
        assert_eq!(magnitude(f64::INFINITY, 2.0), 2.0);
        assert_eq!(magnitude(1.0, -2.0), 0.0);
        assert_eq!(magnitude(-7.0, f64::INFINITY), -7.0);
        assert!(magnitude(f64::NAN, 2.0).is_nan());
        assert!(magnitude(1.0, f64::NAN).is_nan());
    }

    #[test]
    fn positive_or_none_opens_only_at_zero_and_below() {
        assert_eq!(positive_or_none(4.0), 4.0);
        assert_eq!(positive_or_none(0.0), f64::INFINITY);
        assert_eq!(positive_or_none(-1.0), f64::INFINITY);
        assert!(positive_or_none(f64::NAN).is_nan());
    }

    /// Front axle of the rescue vehicle from rest: 10 deg/s times 1 ms is 0.000174532925 rad per sample (check numbers
    /// for the steering controller, printed to 9 digits).
    #[test]
    fn rate_steps_like_the_check_numbers() {
        let mut steer = 0.0;
        for expected in [0.000174532925, 0.000349065850, 0.000523598776] {
            steer = rate(0.05, steer, 10f64.to_radians(), 0.001);
            assert!((steer - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn rate_at_its_edges() {
        assert_eq!(rate(-1.0, 0.0, 2.0, 0.25), -0.5);
        assert_eq!(rate(5.0, 1.0, -1.0, 0.001), 5.0);
        assert_eq!(rate(5.0, 1.0, 3.0, 0.0), 1.0);
        assert!(rate(f64::NAN, 1.0, 3.0, 0.1).is_nan());
        assert!(rate(1.0, f64::NAN, 3.0, 0.1).is_nan());
        assert!(rate(1.0, f64::NAN, 0.0, 0.1).is_nan());
        assert!(rate(1.0, 0.0, f64::NAN, 0.1).is_nan());
        assert!(rate(1.0, 0.0, 1.0, f64::NAN).is_nan());
    }

    #[test]
    fn lag_at_its_edges() {
        assert_eq!(lag(1.0, 3.0, 0.2, 0.0), 1.0);
        assert_eq!(lag(1.0, 3.0, 0.0, 0.1), 3.0);
        assert_eq!(lag(1.0, 3.0, -1.0, 0.1), 3.0);
        for (value, target, tau, dt) in [
            (f64::NAN, 3.0, 0.0, 0.1),
            (f64::NAN, 3.0, 0.2, 0.1),
            (1.0, f64::NAN, 0.2, 0.1),
            (1.0, 3.0, f64::NAN, 0.1),
            (1.0, 3.0, 0.2, f64::NAN),
        ] {
            assert!(lag(value, target, tau, dt).is_nan());
        }
    }

    proptest! {
        #[test]
        fn magnitude_is_odd_and_bounded(value in -1e3..1e3f64, limit in 0.0..1e2f64) {
            let y = magnitude(value, limit);
            prop_assert!(y.abs() <= limit);
            prop_assert_eq!(y, -magnitude(-value, limit));
        }

        #[test]
        fn rate_never_moves_too_far_nor_past_the_target(
            target in -10.0..10.0f64, previous in -10.0..10.0f64, speed in 1e-3..10.0f64, dt in 1e-4..1.0f64,
        ) {
            let y = rate(target, previous, speed, dt);
            // Tolerance: a few rounding errors of numbers up to 10.
            prop_assert!((y - previous).abs() <= speed * dt + 1e-14);
            prop_assert!((y - previous) * (target - y) >= 0.0);
            prop_assert_eq!(y, -rate(-target, -previous, speed, dt));
        }

        /// Two half steps equal one full step, because the step is exact. Tolerance: a few rounding errors of numbers
        /// up to 20.
        #[test]
        fn lag_composes(value in -10.0..10.0f64, target in -10.0..10.0f64, tau in 0.01..10.0f64, dt in 0.0..1.0f64) {
            let whole = lag(value, target, tau, dt);
            let halves = lag(lag(value, target, tau, dt / 2.0), target, tau, dt / 2.0);
            prop_assert!((whole - halves).abs() < 1e-14);
        }
    }
}
