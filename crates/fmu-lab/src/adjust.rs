//! Values that may change while a system runs: tunable parameters, and inputs that nothing writes.

use crate::columns::display;
use crate::fmus::Fmus;
use crate::requests::{Adjustable, Display};
use fmu_import::description::{BaseType, Causality, ModelDescription, Value, Variability, Variable};
use fmu_system::run::{Component, Run, Setting};
use std::collections::BTreeMap;

/// Adjustable numbers of a run. Inputs whose names differ only in the last part, such as the friction at each wheel,
/// share one adjustable number.
pub(crate) fn of_run(run: &Run, fmus: &Fmus) -> Vec<Adjustable> {
    run.components
        .iter()
        .filter_map(|component| Some((component, fmus.described(&component.fmu)?)))
        .flat_map(|(component, description)| of_component(component, description))
        .collect()
}

fn of_component(component: &Component, description: &ModelDescription) -> Vec<Adjustable> {
    let is_number = |variable: &&Variable| !variable.is_array() && variable.base_type.is_number();
    let tunable = description.variables.iter().filter(is_number).filter(|variable| {
        variable.causality == Causality::Parameter
            && variable.variability == Variability::Tunable
            && variable.items.is_empty()
    });
    let mut found: Vec<Adjustable> = tunable
        .map(|variable| {
            let set = component.parameters.iter().find(|setting| setting.name == variable.name);
            adjustable(component, description, variable, set, &variable.name)
        })
        .collect();
    let mut groups: BTreeMap<&str, Vec<(&Variable, &Setting)>> = BTreeMap::new();
    for constant in &component.constants {
        let Some(variable) = description.variable(&constant.name).filter(is_number) else { continue };
        groups.entry(group(&variable.name)).or_default().push((variable, constant));
    }
    for (name, members) in groups {
        // The inputs of a group share one slider, unless their start values differ.
        let is_same = members.iter().all(|(_, setting)| setting.value == members[0].1.value);
        if members.len() > 1 && is_same {
            let (variable, constant) = members[0];
            let mut one = adjustable(component, description, variable, Some(constant), &format!("{name}.*"));
            one.title = name.to_owned();
            found.push(one);
        } else {
            let each = members.into_iter();
            found.extend(each.map(|(variable, constant)| {
                adjustable(component, description, variable, Some(constant), &variable.name)
            }));
        }
    }
    found
}

/// The name of the group of an input: its name without the last part.
fn group(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(group, _)| group)
}

/// Names of the inputs to which an id refers. `name` is the id without its component, such as `group.*`.
pub(crate) fn variables(component: &Component, name: &str) -> Vec<String> {
    match name.strip_suffix(".*") {
        Some(wanted) => {
            let names = component.constants.iter().map(|constant| &constant.name);
            names.filter(|name| group(name) == wanted).cloned().collect()
        }
        None => vec![name.to_owned()],
    }
}

fn adjustable(
    component: &Component,
    description: &ModelDescription,
    variable: &Variable,
    set: Option<&Setting>,
    name: &str,
) -> Adjustable {
    let value = set.map(|setting| &setting.value).or(variable.start.as_ref()).and_then(Value::number).unwrap_or(0.0);
    let (min, max) = limits(variable, value);
    Adjustable {
        id: format!("{}:{name}", component.name),
        title: variable.name.clone(),
        unit: variable.unit.clone().unwrap_or_default(),
        min,
        max,
        value,
        display: match variable.base_type {
            BaseType::Real => display(description, variable),
            _ => Display::new("", 1.0),
        },
    }
}

/// The ends of a slider. A declared limit is used unless it is too far away; otherwise, the value determines the end.
fn limits(variable: &Variable, value: f64) -> (f64, f64) {
    if variable.base_type == BaseType::Boolean {
        return (0.0, 1.0);
    }
    if variable.name.starts_with("road_friction.") {
        return (0.05, 1.2);
    }
    let extent = if value == 0.0 { variable.nominal.unwrap_or(1.0) } else { 3.0 * value.abs() };
    let has_sign = value <= 0.0;
    let near = |limit: f64| limit.abs() <= 100.0 * extent;
    let min = variable.min.filter(|min| near(*min)).unwrap_or(if has_sign { -extent } else { 0.0 });
    let max = variable.max.filter(|max| near(*max)).unwrap_or(extent);
    (min.min(value), max.max(value))
}
