//! Limits of wall-clock time in tests.

use std::time::Duration;

/// A limit in seconds. CHASSIS_TEST_PATIENCE is the factor of all limits on a slow machine.
pub(crate) fn patience(seconds: f64) -> Duration {
    let factor = std::env::var("CHASSIS_TEST_PATIENCE").map_or(1.0, |factor| factor.parse().unwrap());
    Duration::from_secs_f64(seconds * factor)
}
