//! A case with its components, and shared parts of the resolver.

use super::fmus::Found;
use super::inputs::Inputs;
use super::pattern::{is_match, matches, split_pattern};
use crate::parameter;
use crate::plan;
use crate::problem::{Collector, Context};
use crate::run::Linear;
use crate::scenario::{Case, Component, Replacement, Scenario, unknown};
use crate::spanned::Spanned;
use fmu_import::description::{BaseType, Capabilities, Causality, Clock, FmiVersion, Interface, Value, Variable};
use fmu_import::loader::Solver;
use fmu_import::names::similar;
use fmu_import::parameter_set::ParameterSet;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::path::Path;

pub(super) struct CaseComponent<'a> {
    pub(super) component: &'a Component,
    pub(super) found: Found,
    /// Set if the case replaces the component's FMU.
    pub(super) replaced: Option<Replaced>,
    /// Inputs in the order of the description, each with its source.
    pub(super) inputs: Vec<(usize, Source)>,
    /// Conversions between outputs and the inputs that read them, by input.
    pub(super) conversions: HashMap<usize, Linear>,
    /// Triggered input clocks, each with the component and the clock that activate it. Clocks are indices in the
    /// descriptions.
    pub(super) clocks: Vec<(usize, (usize, usize))>,
    /// Solver of a component in model exchange.
    pub(super) integration: Option<Solver>,
    /// True if the component is not needed because signals come from a file.
    pub(super) dropped: bool,
}

impl CaseComponent<'_> {
    pub(super) fn name(&self) -> &str {
        self.component.name.get_ref()
    }

    pub(super) fn clock(&self, index: usize) -> &Clock {
        &self.found.description.clocks[index]
    }

    pub(super) fn interface(&self) -> Interface {
        self.integration.map_or(self.found.description.stepped_interface(), |_| Interface::ModelExchange)
    }

    /// Returns true if other components can share the ticks of its clocks.
    pub(super) fn shares_clocks(&self) -> bool {
        self.interface() == Interface::CoSimulation
    }

    /// The clocks with this causality, by index; also their aliases.
    pub(super) fn all_clocks(&self, causality: Causality) -> impl Iterator<Item = (usize, &Clock)> {
        self.found.description.clocks.iter().enumerate().filter(move |(_, clock)| clock.causality == causality)
    }

    /// Returns true if the interface of the FMU has a capability. The integrator of a component in model exchange makes
    /// steps of any size, and its inputs may be lines.
    pub(super) fn has(&self, capability: impl Fn(&Capabilities) -> bool) -> bool {
        let unit = self.found.description.interface(self.interface());
        let (can_handle_variable_communication_step_size, can_interpolate_inputs) = (true, true);
        unit.is_some_and(|unit| match self.integration {
            None => capability(unit),
            Some(_) => capability(&Capabilities {
                can_handle_variable_communication_step_size,
                can_interpolate_inputs,
                ..unit.clone()
            }),
        })
    }

    /// Returns true if the inputs can have slopes.
    pub(super) fn can_interpolate(&self) -> bool {
        let is_called = self.found.description.fmi == FmiVersion::V2 || self.integration.is_some();
        is_called && self.has(|capabilities| capabilities.can_interpolate_inputs)
    }

    pub(super) fn variable(&self, index: usize) -> &Variable {
        &self.found.description.variables[index]
    }

    /// Variables of a causality that can be connected, by index.
    pub(super) fn wirable(&self, causality: Causality) -> impl Iterator<Item = (usize, &Variable)> {
        self.all(causality).filter(|(_, v)| v.base_type != BaseType::String && !v.is_array())
    }

    /// The names of a variable: its own, and aliases of an input (FMI 3.0). An alias of an output is another output.
    pub(super) fn names(&self, index: usize) -> impl Iterator<Item = &str> {
        let aliases = self.found.description.variables.iter().filter(move |v| v.alias_of == Some(index));
        let aliases = aliases.filter(|v| v.causality != Causality::Output);
        std::iter::once(self.variable(index)).chain(aliases).map(|v| v.name.as_str())
    }

    pub(super) fn all(&self, causality: Causality) -> impl Iterator<Item = (usize, &Variable)> {
        self.found.description.variables.iter().enumerate().filter(move |(_, v)| v.causality == causality)
    }
}

/// Replacement of the FMU of a component in a case.
pub(super) struct Replaced {
    pub(super) original: Option<Found>,
    /// True if the component's own parameters apply.
    pub(super) keep_parameters: bool,
}

#[derive(Clone)]
pub(super) enum Source {
    /// An output: component and variable.
    Output(usize, usize),
    /// A signal of the input file.
    Series(usize),
    Constant(Value),
}

impl Source {
    pub(super) fn output(&self) -> Option<(usize, usize)> {
        if let Self::Output(m, v) = self { Some((*m, *v)) } else { None }
    }

    pub(super) fn series(&self) -> Option<usize> {
        if let Self::Series(feed) = self { Some(*feed) } else { None }
    }
}

pub(super) struct System<'a> {
    pub(super) case: &'a Case,
    /// In the order of the scenario.
    pub(super) members: Vec<CaseComponent<'a>>,
    /// Indices of the members that are not dropped, in order of execution.
    pub(super) order: Vec<usize>,
    /// Recorded outputs, as component and variable, that have the values of a signal of the input file.
    pub(super) replaced: BTreeMap<(usize, usize), usize>,
}

impl System<'_> {
    pub(super) fn member(&self, component: &str) -> Option<usize> {
        self.members.iter().position(|m| m.name() == component)
    }
}

pub(super) struct Column {
    pub(super) component: String,
    pub(super) variable: String,
    pub(super) plan: plan::Column,
}

pub(super) struct Resolver<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) problems: Collector,
    pub(super) inputs: Option<Inputs>,
    /// Patterns of recorded signals; the name of an array stands for the pattern of its elements.
    pub(super) record: Vec<Spanned<String>>,
    /// Patterns of recorded signals that match no output and are therefore for inputs.
    pub(super) of_inputs: Vec<String>,
    pub(super) folder: &'a Path,
    /// Parameter sets by path as written.
    pub(super) sets: HashMap<String, ParameterSet>,
}

impl Resolver<'_> {
    /// Splits `component:name` and checks the component; also returns the place of the name.
    pub(super) fn component_and_name<'s>(
        &mut self,
        written: &'s Spanned<String>,
    ) -> Option<(&'s str, &'s str, Range<usize>)> {
        let text = written.as_str();
        let Some((component, name)) = text.split_once(':') else {
            self.problems.add(written.span(), "expected \"component:variable\"");
            return None;
        };
        let components = self.scenario.components.iter().map(|u| u.name.as_str());
        if !components.clone().any(|u| u == component) {
            unknown("component", component, written.span(), components, &mut self.problems);
            return None;
        }
        Some((component, name, written.span()))
    }

    /// Replaces the names of arrays in the patterns of recorded signals by patterns of their elements.
    pub(super) fn record_arrays(&mut self, systems: &[System<'_>]) {
        let members = || systems.iter().flat_map(|system| &system.members);
        for pattern in &mut self.record {
            let (component, name) = split_pattern(pattern);
            let is_array = |member: &CaseComponent<'_>| {
                let description = &member.found.description;
                component.is_none_or(|component| component == member.name())
                    && description.index(name).is_none()
                    && description.elements_of(name).next().is_some()
            };
            if members().any(is_array) {
                *pattern = Spanned::new(pattern.span(), format!("{}[*]", pattern.get_ref()));
            }
        }
    }

    pub(super) fn is_recorded(&self, component: &str, signal: &str) -> bool {
        self.record.iter().any(|pattern| is_match(pattern.get_ref(), component, signal))
    }
}

/// The FMU that a case names instead of the component's own.
pub(super) fn replacement<'c>(case: &'c Case, component: &Component) -> Option<&'c Spanned<Replacement>> {
    let other = case.fmu.get(component.name.as_str())?;
    (other.fmu != *component.fmu.get_ref()).then_some(other)
}

/// Returns the name of a case in messages, with the FMU that it sets for a component.
pub(super) fn context(case: &Case, component: Option<&Component>) -> Context {
    let name = case.name.get_ref();
    match component.and_then(|component| Some((component.name.get_ref(), replacement(case, component)?))) {
        Some((component, other)) => {
            Context { label: format!("case `{name}` (fmu.{component} = \"{}\")", other.fmu), is_special: true }
        }
        None => Context { label: format!("case `{name}`"), is_special: false },
    }
}

/// Returns the outputs in all cases as (component, output), each once; `component` selects one component.
pub(super) fn outputs<'s>(systems: &'s [System<'_>], component: Option<&str>) -> BTreeSet<(&'s str, &'s str)> {
    systems
        .iter()
        .flat_map(|system| &system.members)
        .filter(|member| component.is_none_or(|component| component == member.name()))
        .flat_map(|member| member.wirable(Causality::Output).map(|(_, v)| (member.name(), v.name.as_str())))
        .collect()
}

/// Returns a hint for a name that is not an output of the given component, or of any component: similar names or, if
/// there are none, all outputs.
pub(super) fn near_outputs(systems: &[System<'_>], component: Option<&str>, name: &str) -> String {
    const SHOWN: usize = 6;
    let members = || {
        let all = systems.iter().flat_map(|system| &system.members);
        all.filter(|member| component.is_none_or(|component| component == member.name()))
    };
    if let Some(hint) = members().find_map(|member| parameter::array(&member.found.description, name)) {
        return hint;
    }
    let mut texts = members().flat_map(|member| member.all(Causality::Output).map(|(_, variable)| variable));
    if let Some(text) = texts.find(|text| text.base_type == BaseType::String && matches(name, &text.name)) {
        return format!(
            "`{}` is a String; only numbers, Booleans, enumerations and Binaries can be recorded",
            text.name
        );
    }
    for member in members() {
        let description = &member.found.description;
        if description.variables.iter().any(|v| v.name == name && v.causality == Causality::Local) {
            return format!("`{name}` is a local variable, not an output");
        }
        if description.clocks.iter().any(|clock| clock.name == name && clock.causality == Causality::Input) {
            return format!("`{name}` is an input Clock, not an output");
        }
    }
    if let Some((other, _)) = outputs(systems, None).into_iter().find(|(_, output)| *output == name) {
        return format!("did you mean `{other}:{name}`?");
    }
    let names: BTreeSet<&str> = outputs(systems, component).into_iter().map(|(_, output)| output).collect();
    similar(name, names.iter().copied()).unwrap_or_else(|| {
        let of = component.map_or("all components".to_string(), |component| format!("`{component}`"));
        let mut list: Vec<String> = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
        match names.len().saturating_sub(SHOWN) {
            _ if names.is_empty() => list.push("none".to_string()),
            0 => (),
            more => list.push(format!("{more} more (`cargo fmu inspect FMU` lists those of an FMU)")),
        }
        format!("the outputs of {of}: {}", list.join(", "))
    })
}

/// Names of all inputs or outputs, as `signal` and `component:signal`.
pub(super) fn signal_names(systems: &[System<'_>], causality: Causality) -> Vec<String> {
    let mut names = BTreeSet::new();
    for member in systems.iter().flat_map(|system| &system.members) {
        for (_, v) in member.wirable(causality) {
            names.insert(v.name.clone());
            names.insert(format!("{}:{}", member.name(), v.name));
        }
    }
    names.into_iter().collect()
}
