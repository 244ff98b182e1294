//! The stack that a run needs: other programs call FMUs on threads with less stack than the main thread.

use super::{CheckResult, Report, Trial, found};
use crate::{Finding, Topic};
use fmu_import::loader::CallError;

pub(super) const STACK: &str = "stack";

/// If a run needs more stack than this, in KiB, a warning is reported. Threads of importers have 512 KiB to 1 MiB of
/// stack, and use a part of it themselves.
const MOST: usize = 256;

impl Trial<'_> {
    /// Checks that a run and a directional derivative do not need much stack.
    pub(super) fn stack(&self, report: Report<'_>) -> CheckResult<()> {
        let trial = self.clone();
        let run = move || -> Result<(), CallError> {
            let mut instance = trial.started(STACK)?;
            trial.go(&mut instance, 0..trial.steps, 1).map(drop)
        };
        let Some((result, size)) = taken(run) else { return Ok(()) };
        self.instances.set(self.instances.get() + 1);
        let mut sizes = vec![("a run", size)];
        if self.unit.provides_directional_derivative
            && let Some(question) = self.question()
        {
            let trial = self.clone();
            let size = taken(move || drop(trial.slope(&question))).map(|(_, size)| size);
            sizes.extend(size.map(|size| ("a run with a directional derivative", size)));
        }
        warn_above_limit(report, STACK, &sizes);
        result
    }
}

/// Warns if the largest of these stacks, in KiB, may be too large for threads of other programs.
pub(super) fn warn_above_limit(report: Report<'_>, subject: &str, sizes: &[(&str, usize)]) {
    let Some((what, size)) = sizes.iter().rev().max_by_key(|(_, size)| size).filter(|(_, size)| *size > MOST) else {
        return;
    };
    let message = format!(
        "{what} takes {size} KiB of stack, more than {MOST} KiB: threads of other programs have 512 KiB to 1 MiB; keep \
         large values on the heap, or run the FMU on a thread with more stack"
    );
    found(report, Finding::warning(subject, message).about(Topic::Simulation));
}

/// Calls `f` and measures its stack in KiB. Returns `None` where the system does not count single pages.
pub(super) fn taken<R: Send>(f: impl FnOnce() -> R + Send) -> Option<(R, usize)> {
    // A thread that does nothing uses a few pages. If more are counted, the measurement is too coarse.
    measured(|| ()).filter(|(_, size)| *size <= 32)?;
    measured(f)
}

/// Runs `f` on a new thread. Returns its result and the size of the stack that it used, in KiB (whole pages); `None` if
/// the system does not report the size.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn measured<R: Send>(f: impl FnOnce() -> R + Send) -> Option<(R, usize)> {
    use std::io::{Read as _, Seek as _, SeekFrom};

    const PAGE: usize = 4096;
    /// Number of pages of the stack. It is so large that the thread gets a new stack, not one that another thread has
    /// used.
    const PAGES: usize = 16 * 1024;
    /// One of these bits is set for a page that is in memory or was swapped out.
    const IN_USE: u64 = 0b11 << 62;

    std::thread::scope(|scope| {
        let work = || {
            let mark = 0_u8;
            let top = std::ptr::from_ref(std::hint::black_box(&mark)).addr() / PAGE;
            let result = f();
            let mut file = std::fs::File::open("/proc/self/pagemap").ok()?;
            // The last pages may belong to the guard and to the memory below the stack.
            let pages = PAGES - 64;
            let first = top - pages;
            file.seek(SeekFrom::Start(8 * (first as u64 + 1))).ok()?;
            let mut entries = vec![0_u8; 8 * pages];
            file.read_exact(&mut entries).ok()?;
            let in_use = |entry: &[u8]| entry.try_into().is_ok_and(|entry| u64::from_ne_bytes(entry) & IN_USE != 0);
            let unused = entries.chunks_exact(8).position(in_use).unwrap_or(pages);
            Some((result, (pages - unused) * PAGE / 1024))
        };
        std::thread::Builder::new().stack_size(PAGES * PAGE).spawn_scoped(scope, work).ok()?.join().ok()?
    })
}

#[cfg(not(all(target_os = "linux", target_arch = "x86_64")))]
fn measured<R>(_: impl FnOnce() -> R) -> Option<(R, usize)> {
    None
}

#[cfg(all(test, target_os = "linux", target_arch = "x86_64"))]
mod tests {
    use super::measured;
    use std::hint::black_box;

    /// Reference: a function with an array of 300 KiB needs 300 KiB of stack, and little more.
    #[test]
    fn the_stack_of_an_array_is_its_size() {
        #[inline(never)]
        fn array() {
            black_box([1_u8; 300 * 1024]);
        }
        // Skipped on systems with huge pages, which are too coarse for the measurement.
        let size = |f: fn()| measured(f).expect("Linux tells the pages in use").1;
        if size(|| ()) <= 32 {
            let taken = size(array);
            assert!((300..700).contains(&taken), "{taken}");
        }
    }
}
