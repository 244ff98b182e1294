//! Status of a step: functions of FMI 2.0, and the results of `fmi3DoStep`, which replace them in FMI 3.0.

use super::calls::Function;
use super::error::CallError;
use super::instance::Instance;
use crate::description::FmiVersion;

impl Instance {
    /// `fmi2CancelStep`.
    pub fn cancel_step(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_v2(Function::CancelStep, |f, c| unsafe { Some(f.cancel_step?(c)) })
    }

    /// `fmi2GetRealStatus(fmi2LastSuccessfulTime)`, or the result of the last `fmi3DoStep` or integration, s.
    pub fn last_successful_time(&mut self) -> Result<f64, CallError> {
        if self.fmi() == FmiVersion::V3 || self.integration.is_some() {
            return Ok(self.step_end.time);
        }
        let mut value = 0.0;
        // SAFETY: live instance; the value is written through a valid pointer. 2: fmi2LastSuccessfulTime.
        self.call_v2(Function::GetRealStatus, |f, c| unsafe { Some(f.get_real_status?(c, 2, &raw mut value)) })?;
        Ok(value)
    }

    /// `fmi2GetBooleanStatus(fmi2Terminated)`, or the result of the last `fmi3DoStep` or integration.
    pub fn wants_termination(&mut self) -> Result<bool, CallError> {
        if self.fmi() == FmiVersion::V3 || self.integration.is_some() {
            return Ok(self.step_end.terminate != 0);
        }
        let mut value = 0;
        // SAFETY: as above. 3: fmi2Terminated.
        self.call_v2(Function::GetBooleanStatus, |f, c| unsafe { Some(f.get_boolean_status?(c, 3, &raw mut value)) })?;
        Ok(value != 0)
    }
}
