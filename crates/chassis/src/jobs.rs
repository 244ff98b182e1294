//! Number of worker processes.

use std::num::NonZeroUsize;

/// Number of worker processes: the given one, by default one per processor.
pub(crate) fn jobs(asked: Option<NonZeroUsize>) -> NonZeroUsize {
    asked.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN)
}
