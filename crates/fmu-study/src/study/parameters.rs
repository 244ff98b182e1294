//! Parameters with their ranges, constraints on them, and values to compare with.

use super::layout::{File, ParameterEntry};
use crate::expression::{FUNCTIONS, Inequality};
use crate::simulation::Constraint;
use crate::space::Parameter;
use fmu_import::description::{Causality, Value};
use fmu_import::names::suggestion;
use fmu_system::fmus::Fmus;
use fmu_system::plan::Plan;
use fmu_system::problem::Collector;
use fmu_system::run::Run;
use std::collections::BTreeSet;

/// Values of the parameters that are evaluated once, for comparison.
#[derive(Debug)]
pub(crate) struct Comparison {
    pub(crate) title: String,
    /// Pairs of parameter index and value. Other parameters keep the scenario's values.
    pub(crate) values: Vec<(usize, f64)>,
    pub(crate) runs: Vec<Run>,
}

/// Checks names and ranges; returns the symbols that constraints may use: the symbols of the parameters, then the names
/// of the constants.
pub(super) fn check_parameters<'a>(file: &'a File, problems: &mut Collector) -> Vec<&'a str> {
    if file.parameters.is_empty() {
        problems.add(0..0, "a study needs at least one [[parameter]]");
    }
    let mut seen = BTreeSet::new();
    for parameter in &file.parameters {
        let name = parameter.name.as_str();
        if !name.contains(':') {
            problems.add(parameter.name.span(), "expected \"component:parameter\"");
        }
        if !seen.insert(name) {
            problems.add(parameter.name.span(), format!("the parameter `{name}` appears twice"));
        }
        let (min, max) = (*parameter.min.get_ref(), *parameter.max.get_ref());
        if !min.is_finite() {
            problems.add(parameter.min.span(), "expected a finite number");
        } else if !(max.is_finite() && min < max) {
            problems.add(parameter.max.span(), format!("max is {max:?}, expected a finite number above min {min:?}"));
        } else if parameter.log && min <= 0.0 {
            problems.add(parameter.min.span(), format!("min is {min:?}, expected above 0 with log = true"));
        }
    }
    let symbols = file.parameters.iter().filter_map(|p| p.symbol.as_ref());
    let mut names: Vec<&str> = Vec::new();
    for symbol in symbols.chain(file.constants.keys()) {
        let text = symbol.as_str();
        let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if text.starts_with(|c: char| c.is_ascii_digit()) || text.is_empty() || !text.chars().all(is_letter) {
            problems.add(
                symbol.span(),
                "a name in constraints must consist of letters, digits and _ and not start with a digit",
            );
        } else if FUNCTIONS.contains(&text) {
            problems.add(symbol.span(), format!("`{text}` is a function"));
        } else if names.contains(&text) {
            problems.add(symbol.span(), format!("the name `{text}` appears twice"));
        }
        names.push(text);
    }
    for value in file.constants.values().filter(|v| !v.is_finite()) {
        problems.add(value.span(), "expected a finite number");
    }
    names
}

pub(super) fn constraints(file: &File, symbols: &[&str], problems: &mut Collector) -> Vec<Constraint> {
    let mut constraints: Vec<Constraint> = Vec::new();
    for entry in &file.constraints {
        if constraints.iter().any(|c| c.name == *entry.name.get_ref()) {
            problems.add(entry.name.span(), format!("the constraint `{}` appears twice", entry.name.get_ref()));
        }
        match Inequality::parse(entry.inequality.get_ref(), symbols) {
            Ok(inequality) => constraints.push(Constraint { name: entry.name.get_ref().clone(), inequality }),
            Err((message, span)) => {
                // The text starts after the opening quote. An escape sequence before the mistake would shift the mark a
                // little.
                let start = entry.inequality.span().start + 1;
                problems.add(start + span.start..start + span.end, message);
            }
        }
    }
    constraints
}

/// Returns the parameters. Reports a parameter that cannot be set to both ends of its range in every run.
pub(super) fn parameters(file: &File, runs: &[Run], fmus: &Fmus, problems: &mut Collector) -> Vec<Parameter> {
    let mut parameters = Vec::new();
    for entry in &file.parameters {
        let Some((component, name)) = entry.name.split_once(':') else { continue };
        for run in runs {
            for bound in [&entry.min, &entry.max] {
                if let Err(error) = run.clone().set_parameter(fmus, component, name, Value::Real(*bound.get_ref())) {
                    let (help, in_range) = parameter_help(run, fmus, component, name);
                    // If the parameter exists, its bound is wrong; otherwise, its name is wrong.
                    let span = if in_range { bound.span() } else { entry.name.span() };
                    problems.add_with_help(span, format!("case `{}`: {error}", run.case), help);
                }
            }
        }
        let of_component = runs.iter().flat_map(|run| &run.components).find(|u| u.name == component);
        let variable = of_component.and_then(|u| fmus.get(u).ok()).and_then(|fmu| fmu.description().variable(name));
        parameters.push(Parameter {
            name: entry.name.get_ref().clone(),
            symbol: entry.symbol.as_ref().map(|s| s.get_ref().clone()),
            unit: variable.and_then(|v| v.unit.clone()),
            min: *entry.min.get_ref(),
            max: *entry.max.get_ref(),
            log: entry.log,
        });
    }
    parameters
}

/// Suggests a name if the given name is wrong; also returns whether the parameter exists.
fn parameter_help(run: &Run, fmus: &Fmus, component: &str, name: &str) -> (Option<String>, bool) {
    let Some(found) = run.components.iter().find(|u| u.name == component) else {
        return (suggestion(component, run.components.iter().map(|u| u.name.as_str())), false);
    };
    let Ok(fmu) = fmus.get(found) else { return (None, false) };
    let description = fmu.description();
    if description.variable(name).is_some() {
        return (None, true);
    }
    (suggestion(name, description.of(Causality::Parameter).map(|v| v.name.as_str())), false)
}

pub(super) fn comparisons(
    file: &File,
    plan: &Plan,
    runs: &[Run],
    fmus: &Fmus,
    problems: &mut Collector,
) -> Vec<Comparison> {
    let mut comparisons = Vec::new();
    for entry in &file.comparisons {
        let runs = match &entry.case {
            None => runs.to_vec(),
            Some(case) => plan.runs.iter().filter(|run| run.case == *case.get_ref()).cloned().collect(),
        };
        if let Some(case) = entry.case.as_ref().filter(|_| runs.is_empty()) {
            let help = suggestion(case.get_ref(), plan.cases.iter().map(|c| c.name.as_str()));
            problems.add_with_help(case.span(), format!("unknown case `{}`", case.get_ref()), help);
        }
        let mut values = Vec::new();
        for (key, value) in &entry.values {
            let is = |p: &ParameterEntry| p.name == *key || p.symbol.as_ref().is_some_and(|symbol| symbol == key);
            let Some(index) = file.parameters.iter().position(is) else {
                let names = file.parameters.iter().flat_map(|p| [Some(&p.name), p.symbol.as_ref()]).flatten();
                let help = suggestion(key.get_ref(), names.map(|n| n.as_str()));
                problems.add_with_help(
                    key.span(),
                    format!("`{}` is not a parameter of this study", key.get_ref()),
                    help,
                );
                continue;
            };
            if let Some((component, name)) = file.parameters[index].name.split_once(':') {
                for run in &runs {
                    if let Err(error) = run.clone().set_parameter(fmus, component, name, Value::Real(*value.get_ref()))
                    {
                        problems.add(value.span(), error);
                    }
                }
            }
            values.push((index, *value.get_ref()));
        }
        comparisons.push(Comparison { title: entry.title.clone(), values, runs });
    }
    comparisons
}
