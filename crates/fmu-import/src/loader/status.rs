//! Statuses of a step: functions of FMI 2.0, and what `fmi3DoStep` returns instead.

use super::calls::Function;
use super::error::{CallError, Status};
use super::functions::{Functions, v2};
use super::instance::Instance;
use super::strings::text;
use crate::c_api::{self, RawStatus};
use crate::description::FmiVersion;
use std::ffi::c_char;
use std::ptr;

/// The functions of FMI 2.0.
fn v2(functions: &Functions) -> Option<&v2::Functions> {
    match functions {
        Functions::V2(functions) => Some(functions),
        Functions::V3(_) => None,
    }
}

impl Instance {
    /// `fmi2CancelStep`.
    pub fn cancel_step(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_optional(Function::CancelStep, |f| v2(f)?.cancel_step, |f, c| unsafe { f(c) })
    }

    /// `fmi2GetStatus(fmi2DoStepStatus)`: status of a pending step.
    pub fn do_step_status(&mut self) -> Result<Status, CallError> {
        let mut value = 0;
        // SAFETY: live instance; the value is written through a valid pointer. 0: fmi2DoStepStatus.
        let get = |f: c_api::GetStatus<RawStatus>, c| unsafe { f(c, 0, &raw mut value) };
        self.call_optional(Function::GetStatus, |f| v2(f)?.get_status, get)?;
        Ok(Status::from(value))
    }

    /// `fmi2GetRealStatus(fmi2LastSuccessfulTime)`, or the result of the latest `fmi3DoStep`: time reached, s.
    pub fn last_successful_time(&mut self) -> Result<f64, CallError> {
        if self.fmi() == FmiVersion::V3 {
            return Ok(self.step_end.time);
        }
        let mut value = 0.0;
        // SAFETY: as above. 2: fmi2LastSuccessfulTime.
        let get = |f: c_api::GetStatus<f64>, c| unsafe { f(c, 2, &raw mut value) };
        self.call_optional(Function::GetRealStatus, |f| v2(f)?.get_real_status, get)?;
        Ok(value)
    }

    /// `fmi2GetIntegerStatus` for the number of a kind of `fmi2StatusKind`; no kind is standard.
    pub fn integer_status(&mut self, kind: i32) -> Result<i32, CallError> {
        let mut value = 0;
        // SAFETY: as above.
        let get = |f: c_api::GetStatus<i32>, c| unsafe { f(c, kind, &raw mut value) };
        self.call_optional(Function::GetIntegerStatus, |f| v2(f)?.get_integer_status, get)?;
        Ok(value)
    }

    /// `fmi2GetBooleanStatus(fmi2Terminated)`, or the result of the latest `fmi3DoStep`: the FMU requests the end of the
    /// simulation.
    pub fn wants_termination(&mut self) -> Result<bool, CallError> {
        if self.fmi() == FmiVersion::V3 {
            return Ok(self.step_end.terminate != 0);
        }
        let mut value = 0;
        // SAFETY: as above. 3: fmi2Terminated.
        let get = |f: c_api::GetStatus<c_api::Boolean>, c| unsafe { f(c, 3, &raw mut value) };
        self.call_optional(Function::GetBooleanStatus, |f| v2(f)?.get_boolean_status, get)?;
        Ok(value != 0)
    }

    /// `fmi2GetStringStatus(fmi2PendingStatus)`: description of a pending step.
    pub fn pending_status(&mut self) -> Result<String, CallError> {
        let mut value = ptr::null();
        // SAFETY: as above. 1: fmi2PendingStatus.
        let get = |f: c_api::GetStatus<*const c_char>, c| unsafe { f(c, 1, &raw mut value) };
        self.call_optional(Function::GetStringStatus, |f| v2(f)?.get_string_status, get)?;
        // SAFETY: a C string of the FMU, valid until its next function is called.
        Ok(unsafe { text(value) })
    }
}
