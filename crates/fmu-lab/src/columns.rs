//! Signals that the page shows: all scalar outputs of all components.

use crate::fmus::Fmus;
use crate::requests::{Column, Display};
use fmu_import::description::{Causality, ModelDescription, Variable};
use fmu_system::run::{Run, Wire};
use std::collections::BTreeMap;

/// A column and its slot on the bus.
#[derive(Debug, Clone)]
pub(crate) struct Shown {
    pub(crate) slot: usize,
    pub(crate) component: String,
    pub(crate) variable: String,
    pub(crate) column: Column,
}

/// Gives every output of a run a slot, and lists the outputs. Reading additional outputs does not change any result.
pub(crate) fn show_all(run: &mut Run, fmus: &Fmus, plant: &str) -> Vec<Shown> {
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    let mut shown = Vec::new();
    for component in &mut run.components {
        let Some(description) = fmus.described(&component.fmu) else { continue };
        for variable in description.variables.iter().filter(|variable| is_shown(variable)) {
            let is_same = |wire: &&Wire| wire.reference == variable.reference && wire.base_type == variable.base_type;
            let slot = match component.outputs.iter().find(is_same) {
                Some(wire) => wire.slot,
                None => {
                    let slot = run.slots;
                    run.slots += 1;
                    component.outputs.push(Wire::new(variable, slot));
                    slot
                }
            };
            *count.entry(variable.name.clone()).or_default() += 1;
            shown.push(Shown {
                slot,
                component: component.name.clone(),
                variable: variable.name.clone(),
                column: column(description, variable),
            });
        }
    }
    for shown in &mut shown {
        // Signals of the plant get no prefix, because the drawing finds them by their plain names.
        if count[&shown.variable] > 1 && shown.component != plant {
            shown.column.name = format!("{}:{}", shown.component, shown.variable);
        }
    }
    shown
}

fn is_shown(variable: &Variable) -> bool {
    variable.causality == Causality::Output && !variable.is_array() && variable.base_type.is_number()
}

fn column(description: &ModelDescription, variable: &Variable) -> Column {
    Column {
        name: variable.name.clone(),
        description: variable.description.clone().unwrap_or_default(),
        unit: variable.unit.clone().unwrap_or_default(),
        display: display(description, variable),
    }
}

pub(crate) fn display(description: &ModelDescription, variable: &Variable) -> Display {
    let own = variable.unit.as_deref().unwrap_or_default();
    let units = description.display_units(variable);
    let wanted = variable.display_unit.as_ref().and_then(|name| units.iter().find(|unit| unit.name == *name));
    // The page does not support offsets, so units with an offset are not shown.
    match wanted.filter(|unit| unit.offset == 0.0) {
        Some(unit) => Display::new(&unit.name, unit.factor),
        None => Display::new(own, 1.0),
    }
}
