//! Steps of FMI 3.0 that call the importer at each intermediate update.

use super::{RawBoolean, RawInstance};
use fmu_import::c_api::RawStatus;
use std::cell::Cell;
use std::ffi::c_void;

type Importer<'a> = dyn FnMut() + 'a;

thread_local! {
    /// The importer's part of an update, during a step.
    static IMPORTER: Cell<Option<*mut Importer<'static>>> = const { Cell::new(None) };
}

/// `fmi3IntermediateUpdateCallback`.
pub(super) unsafe extern "C" fn update(
    _: *mut c_void,
    _time: f64,
    _sets: bool,
    _gets: bool,
    _is_finished: bool,
    _can_return_early: bool,
    _requested: *mut RawBoolean,
    _return_time: *mut f64,
) {
    let importer = IMPORTER.get().expect("steps are made with `step_with_updates`");
    // SAFETY: it lives as long as the step, which is in progress.
    unsafe { (*importer)() };
}

impl RawInstance<'_> {
    /// fmi3DoStep of an instance with a callback; `importer` runs at each intermediate update.
    pub fn step_with_updates(&self, time: f64, step: f64, importer: &mut Importer<'_>) -> RawStatus {
        let importer = std::ptr::from_mut(importer);
        // SAFETY: only the lifetime changes; the pointer is removed before the function ends.
        let importer = unsafe { std::mem::transmute::<*mut Importer<'_>, *mut Importer<'static>>(importer) };
        IMPORTER.set(Some(importer));
        let status = self.step_with_events(time, step, Some(&mut [0; 3]), Some(&mut 0.0));
        IMPORTER.set(None);
        status
    }
}
