//! modelDescription.xml of FMI 3.0.

use std::collections::BTreeSet;
use std::fmt::Display;

use super::structure::{Unknown, Unknowns};
use super::xml::{
    Written, Xml, attributes, borrowed, default_experiment, document, element, empty, facts, interface, items, list,
    log_categories, number, start, type_attributes, unit_definitions,
};
use super::{Format, xml};
use crate::calls::Version;
use crate::clocks::{InputClock, Interval, Setting, Span, Timing};
use crate::runner::{Kind as ModelKind, Model};
use crate::store::ValueStore;
use crate::variable::{Declaration, Kind, Layout, Role, Variable};

/// modelDescription.xml with an empty instantiation token.
pub(super) fn write<M: Model>(layout: &Layout, format: Format, unknowns: &Unknowns<'_>) -> std::io::Result<Vec<u8>> {
    let info = &M::INFO;
    document("fmiModelDescription", &facts("3.0", "instantiationToken", info, layout), |xml| {
        let interfaces = format.interfaces;
        let all = [
            (interfaces.model_exchange, "ModelExchange"),
            (interfaces.co_simulation, "CoSimulation"),
            (interfaces.scheduled_execution, "ScheduledExecution"),
        ];
        for (_, name) in all.into_iter().filter(|(is_provided, _)| *is_provided) {
            let is_co_simulation = name == "CoSimulation";
            let has_events = is_co_simulation && M::HAS_EVENTS;
            let has_updates = is_co_simulation && M::KIND == ModelKind::Continuous;
            let capabilities = [
                ("canGetAndSetFMUState", true),
                ("canSerializeFMUState", M::IS_SERIALIZABLE),
                ("providesDirectionalDerivatives", M::KIND == ModelKind::Continuous),
                ("providesAdjointDerivatives", M::KIND == ModelKind::Continuous),
                ("providesPerElementDependencies", true),
                ("canHandleVariableCommunicationStepSize", is_co_simulation),
                ("hasEventMode", has_events),
                // Rejects integrator steps past a tick.
                ("needsCompletedIntegratorStep", M::HAS_CLOCKS && name == "ModelExchange"),
                ("mightReturnEarlyFromDoStep", has_events && !(M::HAS_CLOCKS && M::KIND == ModelKind::Discrete)),
                ("providesIntermediateUpdate", has_updates),
                ("canReturnEarlyAfterIntermediateUpdate", has_updates),
            ];
            let order: &[(&str, &dyn Display)] = &[("maxOutputDerivativeOrder", &1)];
            interface(xml, name, info, &capabilities, if has_updates { order } else { &[] })?;
        }
        unit_definitions(xml, layout)?;
        type_definitions(xml, layout)?;
        log_categories(xml)?;
        default_experiment(xml, info)?;
        element(xml, "ModelVariables", &[], |xml| {
            independent_variable(xml, layout)?;
            variables(layout, format).try_for_each(|variable| model_variable::<M>(xml, layout, format, variable))?;
            if interfaces.model_exchange {
                (0..layout.indicators.total()).try_for_each(|index| event_indicator(xml, layout, index))?;
            }
            Ok(())
        })?;
        model_structure(xml, layout, format, unknowns)
    })
}

/// The variables to write. A native array is represented by its first element.
pub(super) fn variables(layout: &Layout, format: Format) -> impl Iterator<Item = &Variable> {
    let representatives = if format.arrays { layout.representatives() } else { Vec::new() };
    let is_written = move |variable: &&Variable| {
        representatives.get(variable.reference as usize).is_none_or(|&first| first == variable.reference)
    };
    layout.variables.iter().filter(is_written)
}

fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    xml::type_definitions(xml, layout, |xml, mut attributes, all, limits| match limits {
        Some((size, limits)) => {
            attributes.extend(limits);
            empty(xml, &format!("{}Type", size.name()), &borrowed(&attributes))
        }
        None => element(xml, "EnumerationType", &borrowed(&attributes), |xml| items(xml, all)),
    })
}

fn time(layout: &Layout) -> u32 {
    layout.end
}

fn indicator(layout: &Layout, index: usize) -> u32 {
    layout.end + 1 + u32::try_from(index).expect("numbered in 32 bits")
}

/// Writes the time, under a name that no variable of the model has.
fn independent_variable(xml: &mut Xml, layout: &Layout) -> Written {
    let is_free = |name: &&str| layout.names().all(|other| other != *name);
    let name = ["time", "simulation_time"].into_iter().find(is_free).unwrap_or("independent_variable");
    let attributes: [(&str, &dyn Display); 5] = [
        ("name", &name),
        ("valueReference", &time(layout)),
        ("description", &"Simulation time in s"),
        ("causality", &"independent"),
        ("variability", &"continuous"),
    ];
    empty(xml, "Float64", &attributes)
}

fn event_indicator(xml: &mut Xml, layout: &Layout, index: usize) -> Written {
    let description = if index < layout.indicators.declared {
        "Quantity whose zero crossing is an event, in parts of its scale"
    } else {
        "Difference of the operands of a relation, in parts of its scale"
    };
    let attributes: [(&str, &dyn Display); 6] = [
        ("name", &format_args!("event_indicator[{}]", index + 1)),
        ("valueReference", &indicator(layout, index)),
        ("description", &description),
        ("causality", &"local"),
        ("variability", &"continuous"),
        ("initial", &"calculated"),
    ];
    empty(xml, "Float64", &attributes)
}

fn model_variable<M: Model>(xml: &mut Xml, layout: &Layout, format: Format, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    if let Kind::Clock(input) = declaration.kind {
        return clock(xml, layout, variable, input);
    }
    let array = if format.arrays { layout.array_of(variable) } else { None };
    let (name, description, elements) = match &array {
        Some((array, elements)) => (&array.name, &array.description, elements.as_slice()),
        None => (&declaration.name, &declaration.description, &[variable][..]),
    };
    let (mut attributes, has_start) = attributes::<M>(layout, variable, name, description);
    if declaration.details.structural {
        let causality = attributes.iter_mut().find(|(name, _)| *name == "causality");
        causality.expect("always written").1 = "structuralParameter".to_owned();
    }
    attributes.extend(type_attributes(layout, variable, Version::Fmi3));
    if variable.role == Role::Derivative {
        attributes.push(("derivative", layout.state_of(variable).reference.to_string()));
    }
    if !declaration.details.clocks.is_empty() {
        attributes.push(("clocks", clocks(layout, variable)));
    }
    if variable.role == Role::Clocked
        && let Some(previous) = layout.previous(variable)
    {
        attributes.push(("previous", previous.reference.to_string()));
    }
    // An event may set the states.
    if variable.role == Role::State && M::HAS_EVENTS && format.interfaces.model_exchange {
        attributes.push(("reinit", "true".to_owned()));
    }
    if variable.is_intermediate() && M::KIND == ModelKind::Continuous && format.interfaces.co_simulation {
        attributes.push(("intermediateUpdate", "true".to_owned()));
    }
    let sized = if array.is_some() { layout.sized_array(variable.reference) } else { None };
    let elements: Vec<&Variable> = match sized {
        Some(array) => array.elements(&ValueStore::start(layout).lengths).map(|position| elements[position]).collect(),
        None => elements.to_vec(),
    };
    let starts: Vec<_> = elements.iter().filter(|_| has_start).map(|variable| start(variable, Version::Fmi3)).collect();
    let is_text = matches!(declaration.kind, Kind::String { .. } | Kind::Binary { .. });
    if has_start && !is_text {
        attributes.push(("start", starts.join(" ")));
    }
    let (name, attributes) = (declaration.kind.type_name(Version::Fmi3), borrowed(&attributes));
    let has_content = array.is_some() || (is_text && has_start) || !declaration.aliases.is_empty();
    if !has_content {
        return empty(xml, name, &attributes);
    }
    element(xml, name, &attributes, |xml| {
        let mut sizes = declaration.details.sizes.iter().filter_map(|name| layout.by_name(name));
        sizes.try_for_each(|size| empty(xml, "Dimension", &[("valueReference", &size.reference)]))?;
        let mut dimensions = array.iter().filter(|_| sized.is_none()).flat_map(|(array, _)| &array.dimensions);
        dimensions.try_for_each(|length| empty(xml, "Dimension", &[("start", length)]))?;
        starts.iter().filter(|_| is_text).try_for_each(|start| empty(xml, "Start", &[("value", start)]))?;
        aliases(xml, declaration)
    })
}

fn aliases(xml: &mut Xml, declaration: &Declaration) -> Written {
    declaration.aliases.iter().try_for_each(|alias| {
        let display = alias.display.map(|display| ("displayUnit", display.name.to_owned()));
        let names = [("name", alias.name.clone()), ("description", alias.description.clone())];
        empty(xml, "Alias", &borrowed(&names.into_iter().chain(display).collect()))
    })
}

fn clocks(layout: &Layout, variable: &Variable) -> String {
    list(layout.clocks_of(variable).map(|clock| clock.reference as usize))
}

fn clock(xml: &mut Xml, layout: &Layout, variable: &Variable, input: Option<InputClock>) -> Written {
    let declaration = &variable.declaration;
    let mut attributes = vec![
        ("name", declaration.name.clone()),
        ("valueReference", variable.reference.to_string()),
        ("description", declaration.description.clone()),
        ("causality", if input.is_some() { "input" } else { "output" }.to_owned()),
    ];
    let Some(InputClock { timing, priority, .. }) = input else {
        // Only the parts of input clocks let an output clock tick.
        attributes.push(("clocks", clocks(layout, variable)));
        attributes.push(("intervalVariability", "triggered".to_owned()));
        let attributes = borrowed(&attributes);
        return match declaration.aliases.is_empty() {
            true => empty(xml, "Clock", &attributes),
            false => element(xml, "Clock", &attributes, |xml| aliases(xml, declaration)),
        };
    };
    attributes.push(("canBeDeactivated", "true".to_owned()));
    attributes.extend(priority.map(|priority| ("priority", priority.to_string())));
    let variability = match timing {
        Timing::Periodic { interval: Interval::Constant(_), setting, .. } => match setting {
            Setting::Never => "constant",
            Setting::Fixed => "fixed",
            Setting::Tunable => "tunable",
        },
        // Importers ask for the interval, because it follows from a parameter.
        Timing::Periodic { interval: Interval::Of(name), .. } => {
            let is_tunable =
                |parameter: &&Variable| parameter.declaration.name == name && parameter.declaration.tunable;
            if layout.variables.iter().any(|parameter| is_tunable(&parameter)) { "tunable" } else { "fixed" }
        }
        Timing::Changing(_) => "changing",
        Timing::Countdown(_) => "countdown",
        Timing::Triggered => "triggered",
    };
    attributes.push(("intervalVariability", variability.to_owned()));
    if let Timing::Periodic { interval: Interval::Constant(interval), shift, .. } = timing {
        attributes.push(("intervalDecimal", number(interval.seconds())));
        if shift.seconds() != 0.0 {
            attributes.push(("shiftDecimal", number(shift.seconds())));
        }
        if let (Span::Fraction(counter, resolution), Span::Fraction(offset, _)) = (interval, shift) {
            attributes.push(("supportsFraction", "true".to_owned()));
            attributes.push(("resolution", resolution.to_string()));
            attributes.push(("intervalCounter", counter.to_string()));
            if offset != 0 {
                attributes.push(("shiftCounter", offset.to_string()));
            }
        }
    }
    empty(xml, "Clock", &borrowed(&attributes))
}

fn model_structure(xml: &mut Xml, layout: &Layout, format: Format, unknowns: &Unknowns<'_>) -> Written {
    // A native array has the dependencies of all its elements.
    let representatives = if format.arrays { layout.representatives() } else { Vec::new() };
    let representative =
        |variable: &Variable| representatives.get(variable.reference as usize).copied().unwrap_or(variable.reference);
    let write = |xml: &mut Xml, name: &str, unknowns: &[Unknown<'_>]| -> Written {
        let mut merged: Vec<(u32, Vec<u32>)> = Vec::new();
        for unknown in unknowns {
            let reference = representative(unknown.variable);
            let dependencies = unknown.dependencies.iter().map(|known| representative(known));
            let dependencies = unknown.on_time.then(|| time(layout)).into_iter().chain(dependencies);
            match merged.last_mut().filter(|(last, _)| *last == reference) {
                Some((_, all)) => all.extend(dependencies),
                None => merged.push((reference, dependencies.collect())),
            }
        }
        merged.into_iter().try_for_each(|(reference, mut dependencies)| {
            let mut seen = BTreeSet::new();
            dependencies.retain(|dependency| seen.insert(*dependency));
            let dependencies = list(dependencies.iter().map(|&dependency| dependency as usize));
            empty(xml, name, &[("valueReference", &reference), ("dependencies", &dependencies)])
        })
    };
    let Unknowns { outputs, derivatives, clocked, initial } = unknowns;
    let indicators = if format.interfaces.model_exchange { layout.indicators.total() } else { 0 };
    element(xml, "ModelStructure", &[], |xml| {
        write(xml, "Output", outputs)?;
        write(xml, "ContinuousStateDerivative", derivatives)?;
        write(xml, "ClockedState", clocked)?;
        write(xml, "InitialUnknown", initial)?;
        (0..indicators).try_for_each(|index| {
            // Without a list of dependencies, the indicator depends on everything.
            empty(xml, "EventIndicator", &[("valueReference", &indicator(layout, index))])
        })
    })
}
