//! How many processes execute runs.

use std::num::NonZeroUsize;

/// Number of processes: as asked for, or that of the processors.
pub(crate) fn jobs(asked: Option<NonZeroUsize>) -> NonZeroUsize {
    asked.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN)
}
