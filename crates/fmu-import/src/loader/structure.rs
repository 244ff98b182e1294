//! Structural parameters of FMI 3.0.

use super::calls::Function;
use super::error::CallError;
use super::instance::Instance;
use crate::c_api::Reference;
use std::sync::Arc;

impl Instance {
    /// `fmi3EnterConfigurationMode`. After the initialization, the FMU enters Reconfiguration Mode.
    pub fn enter_configuration_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_v3(Function::EnterConfigurationMode, |f, c| unsafe { Some(f.enter_configuration_mode?(c)) })
    }

    /// `fmi3ExitConfigurationMode`.
    pub fn exit_configuration_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_v3(Function::ExitConfigurationMode, |f, c| unsafe { Some(f.exit_configuration_mode?(c)) })
    }

    /// `fmi3GetFloat64` for an array of any length. All other methods use the lengths in the description.
    pub fn get_array(&mut self, array: Reference, values: &mut [f64]) -> Result<(), CallError> {
        // SAFETY: live instance; the array has the stated length.
        self.call_v3(Function::GetReal, |f, c| unsafe {
            Some((f.get_float64)(c, &raw const array, 1, values.as_mut_ptr(), values.len()))
        })
    }

    /// `fmi3SetFloat64` for an array of any length.
    pub fn set_array(&mut self, array: Reference, values: &[f64]) -> Result<(), CallError> {
        // SAFETY: live instance; the array has the stated length.
        self.call_v3(Function::SetReal, |f, c| unsafe {
            Some((f.set_float64)(c, &raw const array, 1, values.as_ptr(), values.len()))
        })
    }

    /// Sets the structural parameters with which the description was read. Call it after instantiation and reset.
    pub(super) fn configure(&mut self) -> Result<(), CallError> {
        let library = Arc::clone(self.library());
        let structure = &library.signature.structure;
        if structure.is_empty() {
            return Ok(());
        }
        self.enter_configuration_mode()?;
        structure.iter().try_for_each(|(reference, value)| self.set_value(*reference, value))?;
        self.exit_configuration_mode()
    }
}
