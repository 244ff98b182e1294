//! modelDescription.xml and terminalsAndIcons.xml of FMI 3.0.

use super::structure::{Unknown, Unknowns};
use super::xml::{
    Written, Xml, attributes, borrowed, default_experiment, document, facts, interface, items, list, log_categories,
    start, type_attributes, unit_definitions,
};
use super::{Format, Structure, xml};
use crate::calls::Version;
use crate::runner::{Kind as ModelKind, Model};
use crate::variable::{Kind, Layout, Role, Variable, name_in};

/// An empty instantiation token in the description.
pub(super) const NO_TOKEN: &str = "instantiationToken=\"\"";

/// modelDescription.xml with an empty instantiation token.
pub(super) fn write<M: Model>(layout: &Layout, format: Format, structure: &Structure) -> std::io::Result<Vec<u8>> {
    let info = &M::INFO;
    document("fmiModelDescription", &facts("3.0", "instantiationToken", info, layout), |xml| {
        let interfaces = format.interfaces;
        for (_, name) in [(interfaces.model_exchange, "ModelExchange"), (interfaces.co_simulation, "CoSimulation")]
            .into_iter()
            .filter(|(is_provided, _)| *is_provided)
        {
            let is_co_simulation = name == "CoSimulation";
            let capabilities = [
                ("canGetAndSetFMUState", true),
                ("canSerializeFMUState", M::IS_SERIALIZABLE),
                ("providesDirectionalDerivatives", M::KIND == ModelKind::Continuous),
                ("providesAdjointDerivatives", M::KIND == ModelKind::Continuous),
                ("canHandleVariableCommunicationStepSize", is_co_simulation),
                ("hasEventMode", is_co_simulation && M::HAS_EVENTS),
                ("mightReturnEarlyFromDoStep", is_co_simulation && M::HAS_EVENTS),
            ];
            interface(xml, name, info, &capabilities)?;
        }
        unit_definitions(xml, layout)?;
        type_definitions(xml, layout)?;
        log_categories(xml)?;
        default_experiment(xml, info)?;
        xml.create_element("ModelVariables").write_inner_content(|xml| {
            independent_variable(xml, layout)?;
            for variable in variables(layout, format) {
                model_variable::<M>(xml, layout, format, variable)?;
            }
            if interfaces.model_exchange {
                (0..layout.indicators.total()).try_for_each(|index| event_indicator(xml, layout, index))?;
            }
            Ok(())
        })?;
        model_structure::<M>(xml, layout, format, structure)
    })
}

/// The variables that are written: with native arrays, the first element represents all.
fn variables(layout: &Layout, format: Format) -> impl Iterator<Item = &Variable> {
    let representatives = if format.arrays { layout.representatives() } else { Vec::new() };
    let is_written = move |variable: &&Variable| {
        representatives.get(variable.reference as usize).is_none_or(|&first| first == variable.reference)
    };
    layout.variables.iter().filter(is_written)
}

fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    xml::type_definitions(xml, layout, |xml, one, mut attributes| {
        if one.is_enumeration {
            let element = xml.create_element("EnumerationType").with_attributes(borrowed(&attributes));
            element.write_inner_content(|xml| items(xml, one.items))?;
        } else {
            attributes.extend(one.limits());
            xml.create_element("Int32Type").with_attributes(borrowed(&attributes)).write_empty()?;
        }
        Ok(())
    })
}

/// Value reference of the time.
fn time(layout: &Layout) -> u32 {
    layout.end
}

/// Value reference of an event indicator.
fn indicator(layout: &Layout, index: usize) -> u32 {
    layout.end + 1 + u32::try_from(index).expect("numbered in 32 bits")
}

/// The time, under a name that no variable of the model has.
fn independent_variable(xml: &mut Xml, layout: &Layout) -> Written {
    let is_free = |name: &&str| layout.variables.iter().all(|variable| variable.declaration.name != *name);
    let name = ["time", "simulation_time"].into_iter().find(is_free).unwrap_or("independent_variable");
    xml.create_element("Float64")
        .with_attributes([
            ("name", name),
            ("valueReference", time(layout).to_string().as_str()),
            ("description", "Simulation time in s"),
            ("causality", "independent"),
            ("variability", "continuous"),
        ])
        .write_empty()?;
    Ok(())
}

fn event_indicator(xml: &mut Xml, layout: &Layout, index: usize) -> Written {
    let description = if index < layout.indicators.declared {
        "Quantity whose zero crossing is an event, in parts of its scale"
    } else {
        "Difference of the operands of a relation, in parts of its scale"
    };
    xml.create_element("Float64")
        .with_attributes([
            ("name", format!("event_indicator[{}]", index + 1).as_str()),
            ("valueReference", indicator(layout, index).to_string().as_str()),
            ("description", description),
            ("causality", "local"),
            ("variability", "continuous"),
            ("initial", "calculated"),
        ])
        .write_empty()?;
    Ok(())
}

fn model_variable<M: Model>(xml: &mut Xml, layout: &Layout, format: Format, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let array = if format.arrays { layout.array_of(variable) } else { None };
    let elements: Vec<&Variable> = match &array {
        Some(array) => array.elements.clone(),
        None => vec![variable],
    };
    let (name, description) = match &array {
        Some(array) => (&array.name, &array.description),
        None => (&declaration.name, &declaration.description),
    };
    let (mut attributes, has_start) = attributes::<M>(layout, variable, name, description);
    attributes.extend(type_attributes(layout, variable));
    if variable.role == Role::Derivative {
        attributes.push(("derivative", layout.state_of(variable).reference.to_string()));
    }
    // An event may set the states.
    if variable.role == Role::State && M::HAS_EVENTS && format.interfaces.model_exchange {
        attributes.push(("reinit", "true".to_owned()));
    }
    let starts: Vec<_> = elements.iter().filter(|_| has_start).map(|variable| start(variable)).collect();
    let is_text = matches!(declaration.kind, Kind::String { .. });
    if has_start && !is_text {
        attributes.push(("start", starts.join(" ")));
    }
    let writer =
        xml.create_element(name_in(Version::Fmi3, declaration.kind.type_name())).with_attributes(borrowed(&attributes));
    let has_content = array.is_some() || (is_text && has_start);
    if !has_content {
        writer.write_empty()?;
        return Ok(());
    }
    writer.write_inner_content(|xml| {
        for length in array.iter().flat_map(|array| &array.dimensions) {
            xml.create_element("Dimension").with_attribute(("start", length.to_string().as_str())).write_empty()?;
        }
        for start in starts.iter().filter(|_| is_text) {
            xml.create_element("Start").with_attribute(("value", start.as_str())).write_empty()?;
        }
        Ok(())
    })?;
    Ok(())
}

fn model_structure<M: Model>(xml: &mut Xml, layout: &Layout, format: Format, structure: &Structure) -> Written {
    // With native arrays, an array has the dependencies of all its elements.
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
        for (reference, mut dependencies) in merged {
            let mut seen = std::collections::BTreeSet::new();
            dependencies.retain(|dependency| seen.insert(*dependency));
            let dependencies = list(dependencies.iter().map(|&dependency| dependency as usize));
            xml.create_element(name)
                .with_attributes([
                    ("valueReference", reference.to_string().as_str()),
                    ("dependencies", dependencies.as_str()),
                ])
                .write_empty()?;
        }
        Ok(())
    };
    let Unknowns { outputs, derivatives, initial } = Unknowns::of::<M>(layout, structure);
    let indicators = if format.interfaces.model_exchange { layout.indicators.total() } else { 0 };
    xml.create_element("ModelStructure").write_inner_content(|xml| {
        write(xml, "Output", &outputs)?;
        write(xml, "ContinuousStateDerivative", &derivatives)?;
        write(xml, "InitialUnknown", &initial)?;
        (0..indicators).try_for_each(|index| {
            // Without a list of dependencies it depends on everything.
            let reference = indicator(layout, index).to_string();
            xml.create_element("EventIndicator")
                .with_attribute(("valueReference", reference.as_str()))
                .write_empty()?;
            Ok(())
        })
    })?;
    Ok(())
}

/// Side of the icon in the coordinates of terminalsAndIcons.xml.
const SIDE: &str = "100.0";

/// terminalsAndIcons.xml.
pub(super) fn terminals(layout: &Layout, format: Format) -> std::io::Result<Vec<u8>> {
    // Elements in the order of their first variable.
    let mut terminals: Vec<(&str, Vec<(&str, &Variable)>)> = Vec::new();
    let is_signal = |variable: &&Variable| match variable.role {
        Role::Input | Role::Output => true,
        Role::State => !variable.declaration.local,
        _ => false,
    };
    for variable in layout.variables.iter().filter(is_signal).filter(|_| !format.arrays) {
        let array = variable.declaration.array.as_ref();
        let Some(array) = array.filter(|array| array.dimensions.len() == 1 && !array.element.is_empty()) else {
            continue;
        };
        let member = (array.name.as_str(), variable);
        match terminals.iter_mut().find(|(name, _)| *name == array.element) {
            Some((_, members)) => members.push(member),
            None => terminals.push((&array.element, vec![member])),
        }
    }
    document("fmiTerminalsAndIcons", &vec![("fmiVersion", "3.0".to_owned())], |xml| {
        xml.create_element("GraphicalRepresentation").write_inner_content(|xml| {
            let corners = [("x1", "0.0"), ("y1", "0.0"), ("x2", SIDE), ("y2", SIDE)];
            xml.create_element("CoordinateSystem")
                .with_attributes(corners)
                .with_attribute(("suggestedScalingFactorTo_mm", "0.1"))
                .write_empty()?;
            xml.create_element("Icon").with_attributes(corners).write_empty()?;
            Ok(())
        })?;
        if terminals.is_empty() {
            return Ok(());
        }
        xml.create_element("Terminals").write_inner_content(|xml| {
            terminals.iter().try_for_each(|(name, members)| -> Written {
                let description = format!("Signals of the element {name}");
                xml.create_element("Terminal")
                    .with_attributes([("name", *name), ("matchingRule", "bus"), ("description", description.as_str())])
                    .write_inner_content(|xml| {
                        members.iter().try_for_each(|(member, variable)| -> Written {
                            xml.create_element("TerminalMemberVariable")
                                .with_attributes([
                                    ("variableName", variable.declaration.name.as_str()),
                                    ("memberName", *member),
                                    ("variableKind", "signal"),
                                ])
                                .write_empty()?;
                            Ok(())
                        })
                    })?;
                Ok(())
            })
        })?;
        Ok(())
    })
}
