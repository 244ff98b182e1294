//! Components that start in a steady state: `start = "steady"`.
//!
//! The inputs are those at the start of a run: constants, series, and the outputs of the other components after
//! initialization in their declared start states. Through direct feedthrough, these outputs can depend on the
//! component's own start, so the search is repeated until the inputs stay the same.

use crate::failure::Failure;
use crate::fmus::{FmusError, Instances};
use crate::run::{Component, Run, Setting, Simulation};
use crate::session::Session;
use fmu_import::description::{BaseType, Causality, Interface, ModelDescription, Value};
use fmu_linear::trim::{self, Request};

/// Maximum number of searches until the inputs stay the same.
const ROUNDS: usize = 20;

/// Checks in the description whether a component can start in a steady state.
pub(crate) fn check(description: &ModelDescription, interface: Interface) -> Result<(), String> {
    if description.interface(interface).is_some_and(|unit| unit.provides_directional_derivative) {
        return trim::check(description);
    }
    Err(format!(
        "{} has no steady state: it lists no directional derivatives for {interface}, which a plant does",
        description.model_name
    ))
}

impl Run {
    /// Returns true if a component starts in a steady state that has not been found yet.
    pub fn needs_steady_starts(&self) -> bool {
        self.components.iter().any(|component| component.steady.as_ref().is_some_and(Vec::is_empty))
    }

    /// Finds the steady states in which components start. A master does this before a run if they are missing.
    ///
    /// # Errors
    /// A run cannot be initialized, there is no steady state, or a component's inputs keep changing with its start.
    pub fn find_steady_starts(&mut self, simulation: &Simulation, fmus: &dyn Instances) -> Result<(), Failure> {
        let id = self.id.clone();
        let failed = |component: &str, message: String| {
            Failure::of(&id, None, FmusError::Steady { component: component.to_owned(), message })
        };
        let descriptions = self
            .components
            .iter()
            .map(|component| component.steady.is_some().then(|| fmus.description(component)).transpose())
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| Failure::of(&id, None, error))?;
        let mut before: Option<Vec<u64>> = None;
        for _ in 0..ROUNDS {
            // No instance is kept: some FMUs allow only one.
            let bus = Session::initialized(simulation, self, fmus)?.bus().to_vec();
            let read = self.components.iter().filter(|component| component.steady.is_some());
            let read = read.flat_map(|component| &component.inputs).map(|wire| bus[wire.slot].to_bits());
            let read: Vec<u64> = read.collect();
            if before.as_ref() == Some(&read) {
                return Ok(());
            }
            before = Some(read);
            for (component, description) in self.components.iter_mut().zip(&descriptions) {
                if let Some(description) = description {
                    let found = start(component, description, &bus, simulation.start, fmus);
                    component.steady = Some(found.map_err(|message| failed(&component.name, message))?);
                }
            }
        }
        let component = self.components.iter().find(|component| component.steady.is_some());
        let message = format!(
            "the steady state and the inputs at the start do not converge in {ROUNDS} iterations: the components form an \
             algebraic loop"
        );
        Err(failed(component.map_or("", |component| &component.name), message))
    }

    /// Clears the steady states, which must be found again after a change.
    pub(crate) fn forget_steady_starts(&mut self) {
        for component in &mut self.components {
            if let Some(found) = &mut component.steady {
                found.clear();
            }
        }
    }
}

/// The start values that put a component into its steady state.
fn start(
    component: &Component,
    description: &ModelDescription,
    bus: &[f64],
    time: f64,
    fmus: &dyn Instances,
) -> Result<Vec<Setting>, String> {
    let variables = description.variables.iter().enumerate();
    let mut given: Vec<(usize, Value)> = component
        .parameters
        .iter()
        .chain(&component.constants)
        .filter_map(|setting| Some((description.index(&setting.name)?, setting.value.clone())))
        .collect();
    for wire in &component.inputs {
        let value = wire.conversion.map_or(bus[wire.slot], |conversion| conversion.of(bus[wire.slot]));
        let of_wire = variables.clone().find(|(_, variable)| {
            variable.causality == Causality::Input
                && variable.reference == wire.reference
                && variable.base_type == wire.base_type
        });
        let value = match wire.base_type {
            BaseType::Real => Value::Real(value),
            // Convert as a master does.
            BaseType::Integer => Value::Integer(value as i64),
            BaseType::Boolean => Value::Boolean(value > 0.5),
            BaseType::String | BaseType::Binary => continue,
        };
        given.extend(of_wire.map(|(index, _)| (index, value)));
    }
    let request = Request::of_inputs(description, given, time);
    let steady = trim::steady(description, &request, &mut || fmus.of(component).map_err(|error| error.to_string()))?;
    let is_given =
        |index: usize, value: &Value| request.given.iter().any(|(given, other)| *given == index && other == value);
    let settings = steady.starts.into_iter().filter_map(|(name, value)| {
        let index = description.index(&name)?;
        (!is_given(index, &value)).then(|| Setting::new(&description.variables[index], value))
    });
    Ok(settings.collect())
}
