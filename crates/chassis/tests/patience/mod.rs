//! Limits on wall-clock time in tests.

use std::time::Duration;

/// A time limit of this many seconds. On a slow machine, set CHASSIS_TEST_PATIENCE to a factor for all limits.
pub(crate) fn patience(seconds: f64) -> Duration {
    let factor = std::env::var("CHASSIS_TEST_PATIENCE").map_or(1.0, |factor| factor.parse().unwrap());
    Duration::from_secs_f64(seconds * factor)
}
