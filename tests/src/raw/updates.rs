//! Calls of FMI 3.0 during which the FMU calls the importer: steps with intermediate updates, and partitions of scheduled
//! execution.

use super::{RawBoolean, RawInstance};
use fmu_import::c_api::{Component, RawStatus, Reference};
use std::cell::Cell;
use std::ffi::c_void;
use std::sync::atomic::{AtomicU64, Ordering};

/// Returns the time of an early return, if the importer requests it.
type Importer<'a> = dyn FnMut() -> Option<f64> + 'a;

thread_local! {
    /// What the importer does in a callback, during a call.
    static IMPORTER: Cell<Option<*mut Importer<'static>>> = const { Cell::new(None) };
}

/// Numbers of calls of `lockPreemption` and `unlockPreemption` in this process.
static LOCKS: [AtomicU64; 2] = [AtomicU64::new(0), AtomicU64::new(0)];

/// `fmi3IntermediateUpdateCallback`.
pub(super) unsafe extern "C" fn update(
    _: *mut c_void,
    _time: f64,
    _sets: RawBoolean,
    _gets: RawBoolean,
    _is_finished: RawBoolean,
    _can_return_early: RawBoolean,
    requested: *mut RawBoolean,
    return_time: *mut f64,
) {
    if let Some(time) = call_importer() {
        // SAFETY: the FMU passes values to write to.
        unsafe { (*requested, *return_time) = (1, time) };
    }
}

/// `fmi3ClockUpdateCallback`.
pub(super) unsafe extern "C" fn clock_update(_: *mut c_void) {
    call_importer();
}

/// `fmi3LockPreemptionCallback`.
pub(super) unsafe extern "C" fn lock() {
    LOCKS[0].fetch_add(1, Ordering::SeqCst);
}

/// `fmi3UnlockPreemptionCallback`.
pub(super) unsafe extern "C" fn unlock() {
    LOCKS[1].fetch_add(1, Ordering::SeqCst);
}

/// The numbers of calls of `lockPreemption` and `unlockPreemption` so far.
#[must_use]
pub fn locks() -> [u64; 2] {
    [0, 1].map(|at| LOCKS[at].load(Ordering::SeqCst))
}

fn call_importer() -> Option<f64> {
    let importer = IMPORTER.get().expect("the call was made with an importer");
    // SAFETY: it lives as long as the call, which is in progress.
    unsafe { (*importer)() }
}

/// Makes a call during which `importer` runs in each callback in this thread.
fn with_importer<T>(importer: &mut Importer<'_>, call: impl FnOnce() -> T) -> T {
    let importer = std::ptr::from_mut(importer);
    // SAFETY: only the lifetime changes; the pointer is removed before the function ends.
    let importer = unsafe { std::mem::transmute::<*mut Importer<'_>, *mut Importer<'static>>(importer) };
    IMPORTER.set(Some(importer));
    let result = call();
    IMPORTER.set(None);
    result
}

/// An instance for scheduled execution, which several threads use.
pub struct Shared<'a>(pub RawInstance<'a>);

// SAFETY: the functions of such an instance may be called by several threads (FMI 3.0.2, section 5.2).
unsafe impl Sync for Shared<'_> {}

impl RawInstance<'_> {
    /// fmi3DoStep of an instance with a callback; `importer` runs at each intermediate update. The arguments after the
    /// step are those of [`Self::step_with_events`].
    pub fn step_with_updates(
        &self,
        (time, step): (f64, f64),
        flags: Option<&mut [u8; 3]>,
        last: Option<&mut f64>,
        importer: &mut Importer<'_>,
    ) -> RawStatus {
        with_importer(importer, || self.step_with_events(time, step, flags, last))
    }

    /// fmi3ActivateModelPartition; `importer` runs at each update of clocks.
    pub fn activate(&self, clock: Reference, time: f64, importer: &mut Importer<'_>) -> RawStatus {
        type Activate = unsafe extern "C" fn(Component, Reference, f64) -> RawStatus;
        let function: Activate = self.raw.function("fmi3ActivateModelPartition");
        // SAFETY: a live instance.
        with_importer(importer, || unsafe { function(self.component, clock, time) })
    }
}
