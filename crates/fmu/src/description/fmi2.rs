//! modelDescription.xml of FMI 2.0.

use super::structure::{Unknown, Unknowns};
use super::xml::{
    Written, Xml, attributes, borrowed, default_experiment, document, facts, interface, items, list, log_categories,
    start, type_attributes, unit_definitions,
};
use super::{Format, Structure, xml};
use crate::runner::{Kind as ModelKind, Model};
use crate::variable::{Layout, Role, Variable};

/// An empty GUID in the description.
pub(super) const NO_GUID: &str = "guid=\"\"";

/// modelDescription.xml with an empty GUID.
pub(super) fn write<M: Model>(layout: &Layout, format: Format, structure: &Structure) -> std::io::Result<Vec<u8>> {
    let interfaces = format.interfaces;
    let info = &M::INFO;
    let mut facts = facts("2.0", "guid", info, layout);
    if interfaces.model_exchange {
        facts.push(("numberOfEventIndicators", layout.indicators.total().to_string()));
    }
    document("fmiModelDescription", &facts, |xml| {
        let elements = [
            (interfaces.model_exchange, "ModelExchange", "completedIntegratorStepNotNeeded"),
            (interfaces.co_simulation, "CoSimulation", "canHandleVariableCommunicationStepSize"),
        ];
        for (_, name, capability) in elements.into_iter().filter(|(is_provided, ..)| *is_provided) {
            let capabilities = [
                (capability, true),
                ("canNotUseMemoryManagementFunctions", true),
                ("canGetAndSetFMUstate", true),
                ("canSerializeFMUstate", M::IS_SERIALIZABLE),
                ("providesDirectionalDerivative", M::KIND == ModelKind::Continuous),
            ];
            interface(xml, name, info, &capabilities)?;
        }
        unit_definitions(xml, layout)?;
        type_definitions(xml, layout)?;
        log_categories(xml)?;
        default_experiment(xml, info)?;
        xml.create_element("ModelVariables").write_inner_content(|xml| {
            layout.variables.iter().try_for_each(|variable| scalar_variable::<M>(xml, layout, variable))
        })?;
        model_structure::<M>(xml, layout, structure)
    })
}

fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    xml::type_definitions(xml, layout, |xml, one, attributes| {
        xml.create_element("SimpleType").with_attributes(borrowed(&attributes)).write_inner_content(|xml| {
            if one.is_enumeration {
                xml.create_element("Enumeration").write_inner_content(|xml| items(xml, one.items))?;
            } else {
                xml.create_element("Integer").with_attributes(borrowed(&one.limits())).write_empty()?;
            }
            Ok(())
        })?;
        Ok(())
    })
}

fn scalar_variable<M: Model>(xml: &mut Xml, layout: &Layout, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let (attributes, has_start) = attributes::<M>(layout, variable, &declaration.name, &declaration.description);
    let mut of_type = type_attributes(layout, variable);
    if has_start {
        of_type.push(("start", start(variable)));
    }
    if variable.role == Role::Derivative {
        let state = layout.state_of(variable);
        of_type.push(("derivative", layout.structure_index(state.reference).to_string()));
    }
    xml.create_element("ScalarVariable").with_attributes(borrowed(&attributes)).write_inner_content(|xml| {
        xml.create_element(declaration.kind.type_name()).with_attributes(borrowed(&of_type)).write_empty()?;
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
