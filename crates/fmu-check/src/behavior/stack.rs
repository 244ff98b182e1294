//! The stack that a run needs: other programs call FMUs on threads with less stack than the main thread.

use super::{CheckResult, Report, Trial, found};
use crate::{Finding, Topic};
use fmu_import::loader::CallError;

pub(super) const STACK: &str = "stack";

/// Stack in KiB above which a run gets a warning: threads of importers have 512 KiB to 1 MiB, and use part of it.
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
        let unit = self.description.co_simulation.as_ref();
        if unit.is_some_and(|unit| unit.provides_directional_derivative)
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

/// Warns if the largest of these stacks, in KiB, is larger than threads of other programs have.
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
    // A thread that does nothing takes a few pages.
    measured(|| ()).filter(|(_, size)| *size <= 32)?;
    measured(f)
}

/// Runs `f` on a new thread and returns its result with the stack that it touched in KiB, in whole pages; `None` where
/// the system does not report it.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn measured<R: Send>(f: impl FnOnce() -> R + Send) -> Option<(R, usize)> {
    use std::io::{Read as _, Seek as _, SeekFrom};

    const PAGE: usize = 4096;
    /// So large that the thread gets a new stack, not one left behind by another thread.
    const PAGES: usize = 16 * 1024;
    /// Bits of a page that is in memory, or was moved out of it.
    const IN_USE: u64 = 0b11 << 62;

    std::thread::scope(|scope| {
        let work = || {
            let mark = 0_u8;
            let top = std::ptr::from_ref(std::hint::black_box(&mark)).addr() / PAGE;
            let result = f();
            let mut file = std::fs::File::open("/proc/self/pagemap").ok()?;
            // The last pages may be those of the guard and of the memory below.
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

    /// Reference: an array of 300 KiB needs its size, and little more.
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
