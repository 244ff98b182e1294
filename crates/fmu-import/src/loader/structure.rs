//! Structural parameters of FMI 3.0.

use super::calls::Function;
use super::error::CallError;
use super::functions::Functions;
use super::instance::Instance;

impl Instance {
    /// `fmi3EnterConfigurationMode`.
    pub fn enter_configuration_mode(&mut self) -> Result<(), CallError> {
        self.call_present(Function::EnterConfigurationMode, |f, c| match f {
            // SAFETY: live instance.
            Functions::V3(f) => f.enter_configuration_mode.map(|enter| unsafe { enter(c) }),
            Functions::V2(_) => None,
        })
    }

    /// `fmi3ExitConfigurationMode`.
    pub fn exit_configuration_mode(&mut self) -> Result<(), CallError> {
        self.call_present(Function::ExitConfigurationMode, |f, c| match f {
            // SAFETY: live instance.
            Functions::V3(f) => f.exit_configuration_mode.map(|exit| unsafe { exit(c) }),
            Functions::V2(_) => None,
        })
    }

    /// Sets the structural parameters with which the description was read. Call it after instantiation and reset.
    pub(super) fn configure(&mut self) -> Result<(), CallError> {
        if self.signature().structure.is_empty() {
            return Ok(());
        }
        let structure = self.signature().structure.clone();
        self.enter_configuration_mode()?;
        structure.iter().try_for_each(|(reference, value)| self.set_value(*reference, value))?;
        self.exit_configuration_mode()
    }
}
