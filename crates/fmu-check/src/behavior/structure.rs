//! Structural parameters (FMI 3.0): arrays and states have their new lengths after Configuration Mode and, if the
//! parameter is tunable, after Reconfiguration Mode.

use super::{CheckResult, Report, describe, found};
use crate::{Finding, Severity};
use fmu_import::description::{
    Causality, DataType, Dimension, Interface, ModelDescription, Value, Variability, Variable,
};
use fmu_import::loader::{CallError, Instance};

/// Name of the trial.
pub(super) const STRUCTURE: &str = "structural parameters";
/// Greatest length that the trial sets.
const LONGEST: f64 = 64.0;
/// Maximum number of structural parameters that are tried.
const MOST: usize = 20;
/// Maximum number of elements of an array.
const MOST_ELEMENTS: usize = 1_000_000;

/// The calls of the trial that depend on the interface.
pub(super) struct Structure<'a> {
    pub(super) description: &'a ModelDescription,
    /// Start time, s.
    pub(super) start: f64,
    pub(super) instance: &'a dyn Fn(&str) -> CheckResult<Instance>,
    /// Step with this number, or an update of the discrete states.
    pub(super) advance: &'a dyn Fn(&mut Instance, usize) -> CheckResult<()>,
    pub(super) interface: Interface,
}

impl Structure<'_> {
    pub(super) fn check(&self, report: Report<'_>) -> CheckResult<()> {
        let can_be_set = |(parameter, _): &(usize, &Variable)| {
            let mut arrays = self.arrays(*parameter).peekable();
            self.description.variables[*parameter].causality == Causality::StructuralParameter
                && arrays.peek().is_some()
                && arrays
                    .all(|array| array.clocks.is_empty() && (!is_given(array) || array.data_type == DataType::Float64))
        };
        for (i, parameter) in self.description.variables.iter().enumerate().filter(can_be_set).take(MOST) {
            let Some(start) = parameter.start.as_ref().and_then(Value::whole) else { continue };
            let (min, max) = (parameter.min.unwrap_or(1.0).max(1.0), parameter.max.unwrap_or(f64::INFINITY));
            let ends = [min, max].into_iter().filter(|length| *length <= LONGEST).map(|length| length as usize);
            let is_small = |length: &usize| self.arrays(i).all(|array| size(array, (i, *length)) <= MOST_ELEMENTS);
            let lengths: Vec<usize> = ends.chain(usize::try_from(start)).filter(is_small).collect();
            for last in 0..lengths.len() {
                let mut instance = (self.instance)("structure")?;
                if let Err(finding) = self.resized(&mut instance, i, &lengths[..=last]) {
                    found(report, finding);
                    break;
                }
            }
        }
        Ok(())
    }

    /// The arrays whose length is a structural parameter.
    fn arrays(&self, parameter: usize) -> impl Iterator<Item = &Variable> {
        let variables = self.description.variables.iter().filter(|variable| variable.alias_of.is_none());
        variables.filter(move |variable| variable.dimensions.contains(&Dimension::Parameter(parameter)))
    }

    fn failure(&self, parameter: usize, problem: &str, error: &CallError) -> Finding {
        let name = &self.description.variables[parameter].name;
        Finding::error(format!("variable `{name}`"), format!("{problem} ({}): {}", self.interface, describe(error)))
    }

    /// Sets the lengths one after the other, and continues with the last one.
    fn resized(&self, instance: &mut Instance, parameter: usize, lengths: &[usize]) -> Result<(), Finding> {
        for &length in lengths {
            self.resize(instance, (parameter, length), false)?;
        }
        let length = lengths[lengths.len() - 1];
        // The values that the trial sets may not suit the model.
        let unsuitable = |what: &str, length: usize, error: CallError| Finding {
            severity: Severity::Warning,
            ..self.failure(parameter, &format!("the FMU cannot {what} when it has the value {length}"), &error)
        };
        let initialized = instance.setup_experiment(self.start, None);
        let initialized = initialized.and_then(|()| instance.enter_initialization_mode());
        initialized.and_then(|()| instance.exit_initialization_mode()).map_err(|e| unsuitable("start", length, e))?;
        self.inspect(instance, (parameter, length))?;
        (self.advance)(instance, 0).map_err(|error| unsuitable("continue", length, error))?;
        let mut to = (parameter, length);
        if self.description.variables[parameter].variability == Variability::Tunable {
            to.1 = lengths[0];
            self.resize(instance, to, true)?;
            self.inspect(instance, to)?;
            (self.advance)(instance, 1).map_err(|error| unsuitable("continue", lengths[0], error))?;
        }
        let Some(array) = self.arrays(parameter).find(|array| array.data_type == DataType::Float64) else {
            return Ok(());
        };
        let too_many = size(array, to) + 1;
        if instance.get_array(array.reference, &mut vec![0.0; too_many]).is_err() {
            return Ok(());
        }
        let message = format!("gives {too_many} values although it has {} elements ({})", too_many - 1, self.interface);
        Err(Finding::warning(format!("variable `{}`", array.name), message))
    }

    /// Sets a length, and then the values of the arrays, which have lost them.
    fn resize(&self, instance: &mut Instance, to: (usize, usize), is_running: bool) -> Result<(), Finding> {
        let mode = if is_running { "Reconfiguration Mode" } else { "Configuration Mode" };
        let problem = format!("cannot have the value {} in {mode}, although it is within the limits", to.1);
        let failure = |error| self.failure(to.0, &problem, &error);
        let value = Value::Integer(to.1 as i64);
        let set = instance.enter_configuration_mode();
        let set = set.and_then(|()| instance.set_value(self.description.variables[to.0].reference, &value));
        set.and_then(|()| instance.exit_configuration_mode()).map_err(failure)?;
        let is_set = |array: &&Variable| is_given(array) && !(is_running && array.variability == Variability::Fixed);
        for array in self.arrays(to.0).filter(is_set) {
            let starts = array.starts.iter().filter_map(|start| match start {
                Value::Real(start) => Some(*start),
                _ => None,
            });
            let values: Vec<f64> = starts.cycle().take(size(array, to)).collect();
            let set = instance.set_array(array.reference, &values);
            set.map_err(|error| self.wrong_size(array, to, &error))?;
        }
        Ok(())
    }

    fn wrong_size(&self, array: &Variable, to: (usize, usize), error: &CallError) -> Finding {
        let (size, parameter) = (size(array, to), &self.description.variables[to.0].name);
        let message = format!("must have {size} elements when `{parameter}` has the value {}", to.1);
        let message = format!("{message} ({}): {}", self.interface, describe(error));
        Finding::error(format!("variable `{}`", array.name), message)
    }

    /// Checks the lengths of arrays and, in model exchange, the number of states.
    fn inspect(&self, instance: &mut Instance, to: (usize, usize)) -> Result<(), Finding> {
        for array in self.arrays(to.0).filter(|array| array.data_type == DataType::Float64) {
            // An FMU whose array has kept its length may write more values than allowed.
            let mut values = vec![0.0; array.size.max(size(array, to))];
            let read = instance.get_array(array.reference, &mut values[..size(array, to)]);
            read.map_err(|error| self.wrong_size(array, to, &error))?;
        }
        if self.interface != Interface::ModelExchange {
            return Ok(());
        }
        let derivatives = self.description.derivatives.iter();
        let states: usize = derivatives.map(|unknown| size(&self.description.variables[unknown.variable], to)).sum();
        let number = instance.get_number_of_states();
        let number = number.map_err(|error| self.failure(to.0, "the number of states is unknown", &error))?;
        let parameter = &self.description.variables[to.0].name;
        let message = format!("gives {number} when `{parameter}` has the value {}, but must give {states}", to.1);
        if number == states { Ok(()) } else { Err(Finding::error("fmi3GetNumberOfContinuousStates", message)) }
    }
}

/// Returns true if the FMU has structural parameters.
pub(super) fn is_structural(description: &ModelDescription) -> bool {
    description.variables.iter().any(|variable| variable.causality == Causality::StructuralParameter)
}

/// Returns true for an array whose values the importer sets.
fn is_given(array: &Variable) -> bool {
    matches!(array.causality, Causality::Parameter | Causality::Input)
}

/// Number of elements of a variable after a structural parameter was set.
fn size(variable: &Variable, (parameter, new): (usize, usize)) -> usize {
    let length = |(dimension, old): (&Dimension, &usize)| match dimension {
        Dimension::Parameter(other) if *other == parameter => new,
        _ => *old,
    };
    variable.dimensions.iter().zip(&variable.lengths).map(length).product()
}
