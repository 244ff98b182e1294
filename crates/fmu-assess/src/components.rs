//! Components of a system: FMUs, with the bench's names for their signals.

use crate::signals::{self, conversion};
use fmu_import::description::{Causality, ModelDescription, Variable};
use fmu_import::names::suggestion;
use fmu_system::resolve::{Descriptions, Found};
use heck::ToSnakeCase as _;
use std::collections::BTreeMap;

/// Name in a vehicle file for the time column of a recording.
pub(crate) const TIME: &str = "time";

/// An FMU, a value, an option or a recording cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct SetupError {
    /// Message, including the location.
    pub message: String,
    /// Remedy.
    pub help: Option<String>,
}

impl SetupError {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None }
    }

    pub(crate) fn with_help(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: Some(help.into()) }
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Component {
    /// Name of the component: `antilock_braking` for `AntilockBraking`.
    pub(crate) name: String,
    /// Name of the FMU.
    pub(crate) fmu: String,
    pub(crate) found: Found,
    /// Name of the FMU's variable -> the bench's name of the signal, if they differ.
    renamed: BTreeMap<String, String>,
    /// The bench's name of a signal -> unit set by the caller.
    pub(crate) given: BTreeMap<String, String>,
}

impl Component {
    pub(crate) fn description(&self) -> &ModelDescription {
        &self.found.description
    }

    /// The bench's names of the inputs or outputs.
    pub(crate) fn signals(&self, causality: Causality) -> impl Iterator<Item = &str> {
        self.description().of(causality).map(|variable| self.signal(&variable.name))
    }

    /// Returns true if the component has an input or output with this name on the bench.
    pub(crate) fn has(&self, causality: Causality, signal: &str) -> bool {
        self.signals(causality).any(|name| name == signal)
    }

    /// The bench's name of a variable.
    pub(crate) fn signal<'a>(&'a self, variable: &'a str) -> &'a str {
        self.renamed.get(variable).map_or(variable, String::as_str)
    }

    /// The FMU's name of a signal.
    pub(crate) fn variable<'a>(&'a self, signal: &'a str) -> &'a str {
        self.renamed.iter().find(|(_, of)| *of == signal).map_or(signal, |(variable, _)| variable)
    }

    /// Converts a value in the bench's unit to the unit of the variable.
    pub(crate) fn of_si(&self, signal: &str, variable: &Variable, value: f64) -> Result<f64, String> {
        let Some(needed) = signals::unit(signal) else { return Ok(value) };
        let found = conversion(needed, self.description(), variable, self.given.get(signal).map(String::as_str));
        let found = found.map_err(|unit| format!("`{}` is in {unit}, but the bench writes {needed}", variable.name))?;
        Ok(found.map_or(value, |conversion| conversion.inverse_of(value)))
    }
}

/// Finds an FMU. `names`: the bench's name of a signal -> name of the FMU's variable, if they differ.
pub(crate) fn find(
    source: &dyn Descriptions,
    fmu: &str,
    names: Option<&BTreeMap<String, String>>,
) -> Result<Component, SetupError> {
    let found = source.find(fmu).map_err(SetupError::new)?;
    let Some(found) = found else {
        let names = source.names();
        let similar = suggestion(fmu, names.iter().map(String::as_str));
        let help = similar.unwrap_or_else(|| {
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            format!("Pack it with `cargo fmu pack {fmu}`, or name its folder with `--fmus`. FMUs found: {known}.")
        });
        return Err(SetupError::with_help(format!("there is no FMU {fmu} in {}", source.place()), help));
    };
    let mut renamed = BTreeMap::new();
    for (signal, variable) in names.into_iter().flatten().filter(|(signal, _)| *signal != TIME) {
        if found.description.variable(variable).is_none() {
            return Err(SetupError::new(format!(
                "the vehicle data map `{signal}` to `{variable}`, but {fmu} has no such variable"
            )));
        }
        renamed.insert(variable.clone(), signal.clone());
    }
    Ok(Component { name: fmu.to_snake_case(), fmu: fmu.to_owned(), found, renamed, given: BTreeMap::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_named_like_their_fmus() {
        for (fmu, name) in [
            ("EspCar", "esp_car"),
            ("AntilockBraking", "antilock_braking"),
            ("RollLQRSuspension", "roll_lqr_suspension"),
            ("my-plant", "my_plant"),
            ("Stranger2", "stranger2"),
        ] {
            assert_eq!(fmu.to_snake_case(), name);
        }
    }
}
