//! The part of a description that is needed to call the library.

use crate::c_api::Reference;
use crate::description::{
    ArrayElement, BaseType, Causality, Clock, DataType, FmiVersion, Interface, IntervalVariability, ModelDescription,
    Unknown, Value, Variability, Variable,
};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Version, interface, and the FMI 3.0 variables that the plain getters and setters cannot transfer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Signature {
    pub(crate) fmi: FmiVersion,
    pub(crate) interface: Interface,
    /// Variables that are arrays or have types other than Float64, Int32, Boolean, String and Binary.
    special: HashMap<Reference, Special>,
    /// Start values of the arrays whose elements are variables, by the reference of the array.
    starts: HashMap<Reference, Vec<Value>>,
    /// For fast checks: a bit for each value reference below [`MARKED`], 1 if it is special.
    marks: Vec<u64>,
    pub(crate) states: usize,
    pub(crate) event_indicators: usize,
    /// Input clocks in co-simulation and scheduled execution, where smaller priorities come first.
    pub(crate) clocks: Vec<InputClock>,
    /// Output clocks, with the clocks on which they depend.
    pub(crate) output_clocks: Vec<(Reference, Vec<Reference>)>,
    /// True if the FMU has clocks that the loader activates.
    pub(crate) has_clocks: bool,
    /// Clocked variables. In scheduled execution, also other inputs and tunable parameters, which are set before any
    /// activation: no variable is read between a call that sets one and an activation (FMI 3.0.2, section 5.2.1).
    pub(crate) clocked: Vec<Clocked>,
    /// Structural parameters that are set after instantiation.
    pub(crate) structure: Vec<(Reference, Value)>,
    pub(crate) exchange: Exchange,
}

/// Variables and capabilities that the integration of an FMU for model exchange uses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Exchange {
    pub(crate) needs_completed_step: bool,
    /// True if the FMU returns directional derivatives of `derivatives` with respect to `states`.
    pub(crate) has_derivatives: bool,
    pub(crate) states: Vec<Reference>,
    pub(crate) derivatives: Vec<Reference>,
    /// Names of the event indicators (FMI 3.0).
    pub(crate) indicators: Vec<String>,
}

impl Exchange {
    fn new(description: &ModelDescription) -> Option<Self> {
        let unit = description.model_exchange.as_ref()?;
        let variable = |unknown: &Unknown| &description.variables[unknown.variable];
        let derivatives = || description.derivatives.iter().map(variable);
        let states: Vec<_> = derivatives().filter_map(|derivative| derivative.derivative_of).collect();
        Some(Self {
            needs_completed_step: unit.needs_completed_integrator_step,
            has_derivatives: unit.provides_directional_derivative && states.len() == derivatives().count(),
            states: states.into_iter().map(|state| description.variables[state].reference).collect(),
            derivatives: derivatives().map(|derivative| derivative.reference).collect(),
            indicators: description.event_indicators.iter().flat_map(|unknown| variable(unknown).elements()).collect(),
        })
    }
}

/// An input clock that the loader activates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct InputClock {
    pub(crate) name: String,
    pub(crate) reference: Reference,
    pub(crate) kind: IntervalVariability,
    /// Interval in s; `None` if the loader must ask for it.
    pub(crate) interval: Option<f64>,
    /// Time of the first tick after the start in s.
    pub(crate) shift: f64,
}

/// A variable that is accessible only while one of its clocks is active.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Clocked {
    pub(crate) reference: Reference,
    pub(crate) base_type: BaseType,
    pub(crate) size: usize,
    pub(crate) is_input: bool,
    pub(crate) clocks: Vec<Reference>,
}

/// Greater value references have no bit and are looked up in the table.
const MARKED: Reference = 1 << 16;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Special {
    pub(crate) data_type: DataType,
    pub(crate) size: usize,
    /// For an array element: its array, and the number of elements in it.
    pub(crate) element: Option<(ArrayElement, usize)>,
}

impl Signature {
    pub(crate) fn new(description: &ModelDescription, interface: Interface) -> Self {
        let mut special = HashMap::new();
        if description.fmi == FmiVersion::V3 {
            for variable in description.variables.iter().filter(|variable| variable.alias_of.is_none()) {
                let is_plain = match variable.base_type {
                    BaseType::Real => variable.data_type == DataType::Float64,
                    BaseType::Integer => variable.data_type == DataType::Int32,
                    BaseType::Boolean | BaseType::String | BaseType::Binary => true,
                };
                if !is_plain || variable.is_array() {
                    let entry = Special { data_type: variable.data_type, size: variable.size, element: None };
                    special.insert(variable.reference, entry);
                }
            }
        }
        let mut starts = HashMap::new();
        for (variable, references) in description.variables.iter().zip(description.element_references()) {
            if references.is_some() && variable.alias_of.is_none() {
                starts.insert(variable.reference, variable.starts.clone());
            }
            for (index, reference) in references.into_iter().flatten().enumerate() {
                let element = Some((ArrayElement { array: variable.reference, index }, variable.size));
                special.insert(reference, Special { data_type: variable.data_type, size: 1, element });
            }
        }
        let mut marks = Vec::new();
        for reference in special.keys().filter(|reference| **reference < MARKED) {
            let (word, bit) = (*reference as usize / 64, reference % 64);
            if marks.len() <= word {
                marks.resize(word + 1, 0);
            }
            marks[word] |= 1 << bit;
        }
        let is_scheduled = interface == Interface::ScheduledExecution;
        let inputs = description.clocks.iter().filter(|clock| clock.causality == Causality::Input);
        let mut inputs: Vec<&Clock> = inputs.collect();
        if is_scheduled {
            inputs.sort_by_key(|clock| clock.priority);
        }
        let mut clocks: Vec<InputClock> = Vec::new();
        for clock in inputs {
            // The list also contains aliases.
            if clocks.iter().all(|known| known.reference != clock.reference) {
                clocks.push(InputClock {
                    name: clock.name.clone(),
                    reference: clock.reference,
                    kind: clock.interval_variability,
                    interval: clock.interval,
                    shift: clock.shift,
                });
            }
        }
        let output_clocks = description.clocks.iter().filter(|clock| clock.causality == Causality::Output);
        let mut output_clocks: Vec<_> = output_clocks.map(|clock| (clock.reference, clock.clocks.clone())).collect();
        output_clocks.dedup();
        let is_set = |variable: &Variable| match variable.causality {
            Causality::Input => true,
            Causality::Parameter => is_scheduled && variable.variability == Variability::Tunable,
            _ => false,
        };
        let is_clocked = |variable: &&Variable| {
            variable.alias_of.is_none() && (!variable.clocks.is_empty() || (is_scheduled && is_set(variable)))
        };
        let clocked = description.variables.iter().filter(is_clocked);
        let all: Vec<Reference> = clocks.iter().map(|clock| clock.reference).collect();
        let clocked = clocked.map(|variable| Clocked {
            reference: variable.reference,
            base_type: variable.base_type,
            size: variable.size,
            is_input: is_set(variable),
            clocks: if variable.clocks.is_empty() { all.clone() } else { variable.clocks.clone() },
        });
        let structure = description.structure.iter();
        let structure = structure
            .filter_map(|(name, value)| Some((description.variable(name)?.reference, value.clone())))
            .collect();
        Self {
            structure,
            exchange: Exchange::new(description).filter(|_| interface == Interface::ModelExchange).unwrap_or_default(),
            clocks,
            output_clocks,
            has_clocks: is_scheduled || !description.clocks.is_empty(),
            clocked: clocked.collect(),
            fmi: description.fmi,
            interface,
            special,
            starts,
            marks,
            states: description.number_of_states(),
            event_indicators: description.number_of_event_indicators,
        }
    }

    pub(crate) fn has_special(&self, references: &[Reference]) -> bool {
        !self.special.is_empty() && references.iter().any(|reference| self.is_special(*reference))
    }

    fn is_special(&self, reference: Reference) -> bool {
        match self.marks.get(reference as usize / 64) {
            Some(word) => word >> (reference % 64) & 1 == 1,
            None => reference >= MARKED && self.special.contains_key(&reference),
        }
    }

    pub(crate) fn special(&self, reference: Reference) -> Option<Special> {
        self.is_special(reference).then(|| self.special.get(&reference).copied()).flatten()
    }

    pub(crate) fn starts(&self, array: Reference) -> &[Value] {
        self.starts.get(&array).map_or(&[], Vec::as_slice)
    }

    /// For a reference from [`ModelDescription::with_elements`]: its array, and the number of elements.
    pub(crate) fn element(&self, reference: Reference) -> Option<(ArrayElement, usize)> {
        self.special(reference)?.element
    }

    pub(crate) fn elements(&self, references: &[Reference]) -> usize {
        if self.special.is_empty() {
            return references.len();
        }
        references.iter().map(|reference| self.special(*reference).map_or(1, |special| special.size)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests references with and without a bit, next to references that are not special.
    #[test]
    fn special_variables_are_found_by_any_reference() {
        for reference in [5, 63, 64, MARKED - 1, MARKED, Reference::MAX] {
            let text = include_str!("../tests/data/Tank.xml")
                .replace("valueReference=\"11\"", &format!("valueReference=\"{reference}\""));
            let text = text
                .replace("<Int8 name=\"weights\" valueReference=\"5\"", "<Int8 name=\"weights\" valueReference=\"12\"");
            let description = ModelDescription::parse(&text).unwrap();
            let signature = Signature::new(&description, Interface::CoSimulation);
            assert_eq!(signature.special(reference).map(|special| special.size), Some(6), "{reference}");
            assert!(signature.has_special(&[1, reference]) && !signature.has_special(&[1, 2, 77]));
            assert_eq!(signature.elements(&[1, reference, 2]), 8);
        }
    }
}
