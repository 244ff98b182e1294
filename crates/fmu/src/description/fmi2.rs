//! modelDescription.xml of FMI 2.0.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};

use super::structure::{Unknown, Unknowns};
use super::xml::{
    Written, Xml, default_experiment, enumeration_types, facts, items, kind_of, list, log_categories, nominal, number,
    simple_type, unit_definitions,
};
use super::{Format, Structure};
use crate::runner::{Kind as ModelKind, Model};
use crate::variable::{Kind, Layout, Role, Variable};

/// An empty GUID in the description.
pub(super) const NO_GUID: &str = "guid=\"\"";

/// modelDescription.xml with an empty GUID.
pub(super) fn write<M: Model>(layout: &Layout, format: Format, structure: &Structure) -> std::io::Result<Vec<u8>> {
    let interfaces = format.interfaces;
    let info = &M::INFO;
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let indicators = layout.indicators.total().to_string();
    let authors = info.authors.replace(':', ", ");
    let first = [("fmiVersion", "2.0"), ("modelName", info.name), ("guid", "")];
    let facts: Vec<_> = facts(&M::INFO, layout, &authors).collect();
    let indicators = interfaces.model_exchange.then_some(("numberOfEventIndicators", indicators.as_str()));
    let facts = first.into_iter().chain(facts.iter().map(|(key, value)| (*key, value.as_str()))).chain(indicators);
    xml.create_element("fmiModelDescription").with_attributes(facts).write_inner_content(|xml| {
        let elements = [
            (interfaces.model_exchange, "ModelExchange", "completedIntegratorStepNotNeeded"),
            (interfaces.co_simulation, "CoSimulation", "canHandleVariableCommunicationStepSize"),
        ];
        for (_, name, capability) in elements.into_iter().filter(|(is_provided, ..)| *is_provided) {
            let mut element = xml.create_element(name).with_attributes([
                ("modelIdentifier", info.name),
                (capability, "true"),
                ("canNotUseMemoryManagementFunctions", "true"),
                ("canGetAndSetFMUstate", "true"),
            ]);
            if M::IS_SERIALIZABLE {
                element = element.with_attribute(("canSerializeFMUstate", "true"));
            }
            if M::KIND == ModelKind::Continuous {
                element = element.with_attribute(("providesDirectionalDerivative", "true"));
            }
            element.write_empty()?;
        }
        unit_definitions(xml, layout)?;
        type_definitions(xml, layout)?;
        log_categories(xml)?;
        default_experiment(xml, info)?;
        xml.create_element("ModelVariables").write_inner_content(|xml| {
            layout.variables.iter().try_for_each(|variable| scalar_variable::<M>(xml, layout, variable))
        })?;
        model_structure::<M>(xml, layout, structure)
    })?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}
fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    let mut types = enumeration_types(layout).peekable();
    if types.peek().is_none() {
        return Ok(());
    }
    xml.create_element("TypeDefinitions").write_inner_content(|xml| {
        types.try_for_each(|one| -> Written {
            xml.create_element("SimpleType")
                .with_attributes([("name", one.name.as_str()), ("description", one.description.as_str())])
                .write_inner_content(|xml| {
                    if one.is_enumeration {
                        xml.create_element("Enumeration").write_inner_content(|xml| items(xml, one.items))?;
                    } else {
                        let (min, max) = (one.min.to_string(), one.max.to_string());
                        xml.create_element("Integer")
                            .with_attributes([("min", min.as_str()), ("max", max.as_str())])
                            .write_empty()?;
                    }
                    Ok(())
                })?;
            Ok(())
        })
    })?;
    Ok(())
}

fn scalar_variable<M: Model>(xml: &mut Xml, layout: &Layout, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let (causality, variability, initial) = kind_of::<M>(layout, variable);
    let mut element = xml.create_element("ScalarVariable").with_attributes([
        ("name", declaration.name.as_str()),
        ("valueReference", variable.reference.to_string().as_str()),
        ("description", declaration.description.as_str()),
        ("causality", causality),
        ("variability", variability),
    ]);
    if let Some(initial) = initial {
        element = element.with_attribute(("initial", initial));
    }
    let has_start = initial != Some("calculated");
    element.write_inner_content(|xml| {
        match &declaration.kind {
            Kind::Real(real) => {
                let mut element = xml.create_element("Real");
                if real.unit.is_declared() {
                    element = element.with_attribute(("unit", real.unit.name));
                }
                if let Some(display) = real.display {
                    element = element.with_attribute(("displayUnit", display.name));
                }
                for (name, value) in [("min", real.min), ("max", real.max), ("nominal", nominal(variable))] {
                    if let Some(value) = value {
                        element = element.with_attribute((name, number(value).as_str()));
                    }
                }
                if has_start {
                    element = element.with_attribute(("start", number(real.start).as_str()));
                }
                if variable.role == Role::Derivative {
                    let state = layout.states.at.reals + variable.index - layout.derivatives.at.reals;
                    let reference = u32::try_from(state).expect("numbered in 32 bits");
                    element =
                        element.with_attribute(("derivative", layout.structure_index(reference).to_string().as_str()));
                }
                element.write_empty()?;
            }
            Kind::Integer { start, min, max, items, type_name, is_enumeration } => {
                let mut element = xml.create_element(if *is_enumeration { "Enumeration" } else { "Integer" });
                if !items.is_empty() {
                    element = element
                        .with_attribute(("declaredType", simple_type(layout, type_name, *is_enumeration).as_str()));
                }
                for (name, value, none) in [("min", min, i32::MIN), ("max", max, i32::MAX)] {
                    if *value != none {
                        element = element.with_attribute((name, value.to_string().as_str()));
                    }
                }
                if has_start {
                    element = element.with_attribute(("start", start.to_string().as_str()));
                }
                element.write_empty()?;
            }
            Kind::Boolean { start } => {
                let mut element = xml.create_element("Boolean");
                if has_start {
                    element = element.with_attribute(("start", start.to_string().as_str()));
                }
                element.write_empty()?;
            }
            Kind::String { start } => {
                let mut element = xml.create_element("String");
                if has_start {
                    element = element.with_attribute(("start", start.as_str()));
                }
                element.write_empty()?;
            }
        }
        Ok(())
    })?;
    Ok(())
}
fn model_structure<M: Model>(xml: &mut Xml, layout: &Layout, structure: &Structure) -> Written {
    let index = |variable: &Variable| layout.structure_index(variable.reference);
    let unknown = |xml: &mut Xml, unknown: &Unknown<'_>| -> Written {
        let (index, dependencies) =
            (index(unknown.variable).to_string(), list(unknown.dependencies.iter().map(|variable| index(variable))));
        xml.create_element("Unknown")
            .with_attributes([("index", index.as_str()), ("dependencies", dependencies.as_str())])
            .write_empty()?;
        Ok(())
    };
    let Unknowns { outputs, derivatives, initial } = Unknowns::of::<M>(layout, structure);
    xml.create_element("ModelStructure").write_inner_content(|xml| {
        let lists = [("Outputs", outputs), ("Derivatives", derivatives), ("InitialUnknowns", initial)];
        for (name, unknowns) in lists.iter().filter(|(_, unknowns)| !unknowns.is_empty()) {
            xml.create_element(*name)
                .write_inner_content(|xml| unknowns.iter().try_for_each(|one| unknown(xml, one)))?;
        }
        Ok(())
    })?;
    Ok(())
}
