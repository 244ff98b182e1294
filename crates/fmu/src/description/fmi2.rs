//! modelDescription.xml of FMI 2.0.

use super::structure::{Unknown, Unknowns};
use super::xml::{
    Written, Xml, attributes, borrowed, default_experiment, document, element, empty, facts, interface, items, list,
    log_categories, start, type_attributes, unit_definitions,
};
use super::{Format, xml};
use crate::calls::Version;
use crate::runner::{Kind as ModelKind, Model};
use crate::variable::{Declaration, Kind, Layout, Role, Variable};

/// modelDescription.xml with an empty GUID.
pub(super) fn write<M: Model>(layout: &Layout, format: Format, unknowns: &Unknowns<'_>) -> std::io::Result<Vec<u8>> {
    let interfaces = format.interfaces;
    let info = &M::INFO;
    let mut facts = facts("2.0", "guid", info, layout);
    if interfaces.model_exchange {
        facts.push(("numberOfEventIndicators", layout.indicators.total().to_string()));
    }
    document("fmiModelDescription", &facts, |xml| {
        let interpolates = M::INTERPOLATES && layout.variables.iter().any(Variable::is_continuous_input);
        let elements = [
            (interfaces.model_exchange, "ModelExchange", "completedIntegratorStepNotNeeded"),
            (interfaces.co_simulation, "CoSimulation", "canHandleVariableCommunicationStepSize"),
        ];
        for (_, name, capability) in elements.into_iter().filter(|(is_provided, ..)| *is_provided) {
            let capabilities = [
                (capability, true),
                ("canInterpolateInputs", interpolates && name == "CoSimulation"),
                ("canNotUseMemoryManagementFunctions", true),
                ("canGetAndSetFMUstate", true),
                ("canSerializeFMUstate", M::IS_SERIALIZABLE),
                ("providesDirectionalDerivative", M::KIND == ModelKind::Continuous),
            ];
            interface(xml, name, info, &capabilities, &[])?;
        }
        unit_definitions(xml, layout)?;
        type_definitions(xml, layout)?;
        log_categories(xml)?;
        default_experiment(xml, info)?;
        element(xml, "ModelVariables", &[], |xml| {
            // FMI 2.0 has no clocks. Input clocks are last, so that the indices of the others do not change.
            let mut variables = layout.variables.iter().filter(|variable| variable.role != Role::Clock);
            variables.try_for_each(|variable| scalar_variable::<M>(xml, layout, variable))?;
            // At the end, because the model structure refers to the positions of the variables.
            layout.variables.iter().try_for_each(|variable| aliases::<M>(xml, layout, variable))
        })?;
        model_structure(xml, layout, unknowns)
    })
}

fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    xml::type_definitions(xml, layout, |xml, attributes, all, limits| {
        element(xml, "SimpleType", &borrowed(&attributes), |xml| match limits {
            Some((_, limits)) => empty(xml, "Integer", &borrowed(&limits)),
            None => element(xml, "Enumeration", &[], |xml| items(xml, all)),
        })
    })
}

fn scalar_variable<M: Model>(xml: &mut Xml, layout: &Layout, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let (attributes, has_start) = attributes::<M>(layout, variable, &declaration.name, &declaration.description);
    let mut of_type = type_attributes(layout, variable, Version::Fmi2);
    if has_start {
        of_type.push(("start", start(variable, Version::Fmi2)));
    }
    if variable.role == Role::Derivative {
        let state = layout.state_of(variable);
        of_type.push(("derivative", layout.structure_index(state.reference).to_string()));
    }
    element(xml, "ScalarVariable", &borrowed(&attributes), |xml| {
        empty(xml, declaration.kind.type_name(Version::Fmi2), &borrowed(&of_type))
    })
}

/// Writes an alias as a local variable with the value reference of its variable. It could not have the same causality:
/// only one variable of the set can be set, and each output must be listed in the model structure.
fn aliases<M: Model>(xml: &mut Xml, layout: &Layout, variable: &Variable) -> Written {
    variable.declaration.aliases.iter().try_for_each(|alias| {
        let mut declaration = Declaration { name: alias.name.clone(), ..variable.declaration.clone() };
        if let Kind::Real(real) | Kind::Float32(real) = &mut declaration.kind {
            real.display = alias.display;
        }
        let alias_of = Variable { declaration, ..variable.clone() };
        let (mut attributes, _) = attributes::<M>(layout, variable, &alias.name, &alias.description);
        attributes.retain(|(name, _)| *name != "initial");
        for (_, value) in attributes.iter_mut().filter(|(name, _)| *name == "causality") {
            "local".clone_into(value);
        }
        let mut of_type = type_attributes(layout, &alias_of, Version::Fmi2);
        // All variables of the set are constant. Otherwise, only one can have a start value.
        let is_constant = variable.declaration.details.constant;
        attributes.push(("initial", if is_constant { "exact" } else { "calculated" }.to_owned()));
        of_type.extend(is_constant.then(|| ("start", start(variable, Version::Fmi2))));
        element(xml, "ScalarVariable", &borrowed(&attributes), |xml| {
            empty(xml, variable.declaration.kind.type_name(Version::Fmi2), &borrowed(&of_type))
        })
    })
}

fn model_structure(xml: &mut Xml, layout: &Layout, unknowns: &Unknowns<'_>) -> Written {
    let index = |variable: &Variable| layout.structure_index(variable.reference);
    let unknown = |xml: &mut Xml, unknown: &Unknown<'_>| -> Written {
        // Without clocks, outputs are held between the steps.
        let is_held = layout.clocks.counts.booleans > 0 && unknown.variable.role == Role::Output;
        let dependencies = unknown.dependencies.iter().filter(|_| !is_held);
        let dependencies = list(dependencies.map(|variable| index(variable)));
        empty(xml, "Unknown", &[("index", &index(unknown.variable)), ("dependencies", &dependencies)])
    };
    let Unknowns { outputs, derivatives, initial, .. } = unknowns;
    element(xml, "ModelStructure", &[], |xml| {
        let lists = [("Outputs", outputs), ("Derivatives", derivatives), ("InitialUnknowns", initial)];
        let mut lists = lists.iter().filter(|(_, unknowns)| !unknowns.is_empty());
        lists.try_for_each(|(name, unknowns)| {
            element(xml, name, &[], |xml| unknowns.iter().try_for_each(|one| unknown(xml, one)))
        })
    })
}
