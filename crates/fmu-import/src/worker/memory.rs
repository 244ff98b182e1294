//! Memory limit of a worker.

use std::num::NonZeroUsize;

/// Share of the memory that all workers together may use.
const PART: f64 = 0.8;
/// Minimum memory limit of a worker, bytes.
const LEAST: u64 = 1 << 30;

/// Memory limit for each worker, bytes: 80 % of the memory of this machine or container, divided by the number of
/// workers, but at least 1 GiB. `None` on systems other than Linux.
pub fn memory_share(workers: NonZeroUsize) -> Option<u64> {
    let text = |path: &str| std::fs::read_to_string(path).ok();
    let machine = text("/proc/meminfo").as_deref().and_then(total)?;
    // Memory limit of a container (control groups, version 2 or 1). Without a limit, the file contains a word or a huge
    // number.
    let limits = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    let limits = limits.iter().filter_map(|path| text(path)?.trim().parse().ok());
    Some(share(limits.fold(machine, u64::min), workers))
}

/// `MemTotal` from `/proc/meminfo`, bytes.
fn total(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn share(all: u64, workers: NonZeroUsize) -> u64 {
    LEAST.max((PART * all as f64 / workers.get() as f64) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares() {
        assert_eq!(total("MemTotal:       24683660 kB\nMemFree: 1 kB\n"), Some(24_683_660 * 1024));
        assert_eq!(total("MemFree: 1 kB\n"), None);
        let workers = |count| NonZeroUsize::new(count).unwrap();
        assert_eq!(share(10 << 30, workers(1)), 8 << 30);
        assert_eq!(share(10 << 30, workers(4)), 2 << 30);
        assert_eq!(share(10 << 30, workers(100)), 1 << 30);
    }
}
