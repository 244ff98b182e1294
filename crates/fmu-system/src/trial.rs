//! Trial runs: they show whether a parameter of a scenario changes anything that is read.
//!
//! The model structure of FMI lists the parameters on which an initial value depends, but not those on which later
//! values depend. It also has to cover all values of the other parameters: the steering angle of a driver depends on
//! the speed in a slalom, but not in a step steer. A component without inputs behaves the same with and without the
//! rest of the system, so a run of it alone is enough.

use crate::fmus::Fmus;
use crate::master::{self, Recording};
use crate::parameter;
use crate::run::{Component, Evaluation, Run, Simulation, Suspect, Trial, Variant, Wire};
use fmu_import::description::{Causality, ModelDescription, Value, Variable};

/// Maximum number of variants of a component that are tried; only a long sweep has more.
const MAX_VARIANTS: usize = 10;
/// Maximum number of values that a trial run records; a longer run is not tried.
const MAX_RECORDED: u64 = 20_000_000;

/// Returns the warnings of all trials of a plan. Their FMUs are loaded into this process, which may crash.
pub fn warnings(simulation: &Simulation, trials: &[Trial]) -> Vec<String> {
    let mut warnings = Vec::new();
    for trial in trials {
        if let Ok(fmus) = Fmus::of_components(trial.variants.iter().map(|variant| &variant.component)) {
            warnings.extend(trial.warnings(simulation, &fmus));
        }
    }
    warnings
}

impl Trial {
    /// Runs the component alone with other values of each parameter, and returns a warning for every parameter that
    /// changes only outputs that nothing reads. A failed run gives no warning.
    fn warnings(&self, simulation: &Simulation, fmus: &Fmus) -> Vec<String> {
        let outcomes = |suspect: &Suspect| -> Option<Vec<String>> {
            let mut changed = Vec::new();
            for variant in self.variants.iter().take(MAX_VARIANTS) {
                for output in variant.changed_by(&suspect.name, simulation, fmus)? {
                    if variant.read.contains(&output) {
                        return None;
                    }
                    if !changed.contains(&output) {
                        changed.push(output);
                    }
                }
            }
            Some(changed).filter(|changed| !changed.is_empty())
        };
        self.suspects
            .iter()
            .filter_map(|suspect| {
                let changed: Vec<String> = outcomes(suspect)?.iter().map(|name| format!("`{name}`")).collect();
                Some(format!(
                    "{}: `{}` of `{}` has no effect: it changes {} only, which nothing reads",
                    suspect.place,
                    suspect.name,
                    self.component,
                    changed.join(", ")
                ))
            })
            .collect()
    }
}

impl Variant {
    /// Names of the outputs that change with other values of a parameter; `None` if no trial succeeds.
    fn changed_by(&self, parameter: &str, simulation: &Simulation, fmus: &Fmus) -> Option<Vec<String>> {
        let description = fmus.get(&self.component).ok()?.description();
        let variable = description.variable(parameter)?;
        let Some(at) = self.component.parameters.iter().position(|setting| setting.name == parameter) else {
            // The parameter is set only in another case or at another point.
            return Some(Vec::new());
        };
        let outputs: Vec<&Variable> = outputs(description).collect();
        if simulation.steps.saturating_mul(outputs.len() as u64 + 1) > MAX_RECORDED {
            return None;
        }
        let run = |component: Component| execute(component, &outputs, simulation, fmus);
        let as_it_is = run(self.component.clone())?;
        let mut changed = None;
        for value in other_values(variable, &self.component.parameters[at].value) {
            let mut component = self.component.clone();
            component.parameters[at].value = value;
            let Some(other) = run(component) else { continue };
            let differs = |column: usize| match (as_it_is.column(column), other.column(column)) {
                (Some(one), Some(two)) => one.iter().zip(two).any(|(a, b)| a.to_bits() != b.to_bits()),
                _ => false,
            };
            let names: &mut Vec<String> = changed.get_or_insert_default();
            for (column, output) in outputs.iter().enumerate() {
                if differs(column) && !names.contains(&output.name) {
                    names.push(output.name.clone());
                }
            }
        }
        changed
    }
}

fn outputs(description: &ModelDescription) -> impl Iterator<Item = &Variable> {
    let can_be_recorded = |v: &&Variable| v.causality == Causality::Output && v.base_type.is_number() && !v.is_array();
    description.variables.iter().filter(can_be_recorded)
}

/// Runs a component alone and records its outputs; `None` if that fails.
fn execute(mut component: Component, outputs: &[&Variable], simulation: &Simulation, fmus: &Fmus) -> Option<Recording> {
    component.outputs = outputs.iter().enumerate().map(|(slot, variable)| Wire::new(variable, slot)).collect();
    let run = Run {
        id: format!("trial of {}", component.name),
        components: vec![component],
        initialization: vec![Evaluation::of(0)],
        slots: outputs.len(),
        columns: (0..outputs.len()).map(Some).collect(),
        ..Run::default()
    };
    let Simulation { start, stop, step, steps, step_argument, .. } = *simulation;
    let simulation = Simulation { start, stop, step, steps, step_argument, every: 1, ..Simulation::default() };
    master::execute(&simulation, &run, fmus).ok()
}

fn other_values(variable: &Variable, value: &Value) -> Vec<Value> {
    let candidates = match value {
        Value::Real(v) => [v * 1.25, v * 0.75, v + 1.0].map(Value::Real).to_vec(),
        Value::Integer(v) => [v.checked_add(1), v.checked_sub(1)].into_iter().flatten().map(Value::Integer).collect(),
        Value::Boolean(v) => vec![Value::Boolean(!v)],
        Value::Unsigned(_) | Value::String(_) | Value::Binary { .. } => Vec::new(),
    };
    let mut values: Vec<Value> = Vec::new();
    for candidate in variable.start.iter().cloned().chain(candidates) {
        if candidate != *value && !values.contains(&candidate) && parameter::check(variable, &candidate).is_ok() {
            values.push(candidate);
        }
    }
    values
}
