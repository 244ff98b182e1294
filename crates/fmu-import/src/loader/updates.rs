//! Intermediate updates of FMI 3.0 (FMI 3.0.2, section 4.2.2): an FMU calls the importer during a step.

use super::calls::Function;
use super::error::{CallError, CallProblem, Status};
use super::functions::{Functions, v3};
use super::instance::{Instance, Uses};
use super::library::Library;
use crate::c_api::v3::RawBoolean;
use crate::c_api::{Component, RawStatus, Reference};
use std::cell::RefCell;
use std::ffi::c_void;
use std::sync::Arc;

/// An intermediate update.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// Time, s.
    pub time: f64,
    /// True at the end of a step of the FMU's solver, false if the values are tentative.
    pub is_finished: bool,
    /// True if the importer may end the communication step now.
    pub can_return_early: bool,
    /// Values of the required variables; empty if they cannot be read.
    pub values: Vec<f64>,
}

/// The step that a thread executes.
struct Running {
    environment: *mut c_void,
    component: Component,
    library: Arc<Library>,
    required: Vec<Reference>,
    returns_early: bool,
    updates: Vec<Update>,
    failure: Option<RawStatus>,
}

thread_local! {
    static RUNNING: RefCell<Option<Running>> = const { RefCell::new(None) };
}

/// Reads the required variables. Ignored outside of a step, in other threads, and with the environment of another
/// instance.
pub(super) unsafe extern "C" fn intermediate_update(
    environment: *mut c_void,
    time: f64,
    _can_set: RawBoolean,
    can_get: RawBoolean,
    is_finished: RawBoolean,
    can_return_early: RawBoolean,
    requests_return: *mut RawBoolean,
    return_time: *mut f64,
) {
    let returns_early = RUNNING.with(|running| {
        let mut running = running.try_borrow_mut().ok()?;
        let running = running.as_mut().filter(|running| running.environment == environment)?;
        let mut values = vec![0.0; if can_get == 0 { 0 } else { running.required.len() }];
        if let (Functions::V3(v3::Functions { get_float64, .. }), count @ 1..) =
            (&running.library.functions, values.len())
        {
            let required = running.required.as_ptr();
            // SAFETY: live instance in Intermediate Update Mode; both arrays have the stated length.
            let status = unsafe { get_float64(running.component, required, count, values.as_mut_ptr(), count) };
            running.failure = running.failure.or((status > 1).then_some(status));
        }
        let (is_finished, can_return_early) = (is_finished != 0, can_return_early != 0);
        running.updates.push(Update { time, is_finished, can_return_early, values });
        Some(running.returns_early && can_return_early)
    });
    if !requests_return.is_null() && !return_time.is_null() {
        // SAFETY: the FMU passes places for both results.
        unsafe { (*requests_return, *return_time) = (RawBoolean::from(returns_early == Some(true)), time) };
    }
}

impl Instance {
    /// Instantiates an FMU for co-simulation of FMI 3.0 that makes intermediate updates, in which these variables of the
    /// type Float64 are read. With `early`, steps may return early.
    pub fn instantiate_with_updates(
        library: &Arc<Library>,
        name: &str,
        guid: &str,
        required: &[Reference],
        early: bool,
    ) -> Result<Self, CallError> {
        Self::instantiate_with(library, name, guid, false, Uses { events: false, early, updates: Some(required) })
    }

    /// Like [`Self::step`], for an instance with intermediate updates. Appends the updates. With `returns_early`, the
    /// step ends at the first update at which it can; this is the error [`CallProblem::EarlyReturn`].
    pub fn step_with_updates(
        &mut self,
        (time, step): (f64, f64),
        required: &[Reference],
        returns_early: bool,
        updates: &mut Vec<Update>,
    ) -> Result<(), CallError> {
        RUNNING.set(Some(Running {
            environment: self.log.environment(),
            component: self.component,
            library: Arc::clone(self.library()),
            required: required.to_vec(),
            returns_early,
            updates: std::mem::take(updates),
            failure: None,
        }));
        let result = self.step(time, step);
        let Some(running) = RUNNING.take() else { return result };
        *updates = running.updates;
        match running.failure {
            Some(status) => Err(self.failure(Function::GetReal, CallProblem::Status(Status::from(status)))),
            None => result,
        }
    }
}
