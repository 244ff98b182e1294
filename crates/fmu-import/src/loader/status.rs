//! Status of a step: functions of FMI 2.0, and the results of `fmi3DoStep`, which replace them in FMI 3.0.

use super::calls::Function;
use super::error::CallError;
use super::functions::{Functions, v2};
use super::instance::Instance;
use crate::c_api;
use crate::description::FmiVersion;

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

    /// `fmi2GetRealStatus(fmi2LastSuccessfulTime)`, or the result of the last `fmi3DoStep` or integration, s.
    pub fn last_successful_time(&mut self) -> Result<f64, CallError> {
        if self.fmi() == FmiVersion::V3 || self.integration.is_some() {
            return Ok(self.step_end.time);
        }
        let mut value = 0.0;
        // SAFETY: live instance; the value is written through a valid pointer. 2: fmi2LastSuccessfulTime.
        let get = |f: c_api::GetStatus<f64>, c| unsafe { f(c, 2, &raw mut value) };
        self.call_optional(Function::GetRealStatus, |f| v2(f)?.get_real_status, get)?;
        Ok(value)
    }

    /// `fmi2GetBooleanStatus(fmi2Terminated)`, or the result of the last `fmi3DoStep` or integration.
    pub fn wants_termination(&mut self) -> Result<bool, CallError> {
        if self.fmi() == FmiVersion::V3 || self.integration.is_some() {
            return Ok(self.step_end.terminate != 0);
        }
        let mut value = 0;
        // SAFETY: as above. 3: fmi2Terminated.
        let get = |f: c_api::GetStatus<c_api::Boolean>, c| unsafe { f(c, 3, &raw mut value) };
        self.call_optional(Function::GetBooleanStatus, |f| v2(f)?.get_boolean_status, get)?;
        Ok(value != 0)
    }
}
