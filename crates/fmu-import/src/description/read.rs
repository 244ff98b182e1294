//! Reads the XML text.

use super::{
    BaseType, BaseUnit, Causality, CoSimulation, DefaultExperiment, DependencyKind, DisplayUnit, Initial, Item,
    ModelDescription, Unit, Unknown, Value, Variability, Variable,
};
use crate::xml::{self, Element, XmlError};
use std::collections::HashMap;
use std::sync::Arc;

/// Longest name of a variable, unit, type or item, bytes.
const MAX_NAME: usize = 4096;
/// Longest unit, display unit or quantity of a variable, bytes: every variable of a type has a copy.
const MAX_INHERITED: usize = 200;
/// Most display units of a unit: every recorded signal has a copy.
const MAX_DISPLAY_UNITS: usize = 100;

impl ModelDescription {
    /// Parses the text of a `modelDescription.xml`.
    ///
    /// # Errors
    /// With line and column: XML that is not well formed or hostile (document type declaration,
    /// excessive size or nesting), another FMI version, a missing or malformed attribute, a
    /// reference to a type or variable that does not exist, a name used twice.
    pub fn parse(text: &str) -> Result<Self, XmlError> {
        let root = xml::parse(text)?;
        if root.name != "fmiModelDescription" {
            return Err(root
                .place
                .error(format!("the root element is <{}>, expected <fmiModelDescription>", root.name)));
        }
        let fmi_version = root.required("fmiVersion")?;
        if fmi_version != "2.0" {
            return Err(root.place.error(format!("FMI version {fmi_version}, expected 2.0")));
        }
        let co_simulation = root.child("CoSimulation").map(co_simulation).transpose()?;
        let model_exchange = root.child("ModelExchange").map(identifier).transpose()?;
        let units = children(&root, "UnitDefinitions", "Unit").map(unit).collect::<Result<Vec<_>, _>>()?;
        let mut units_by_name = HashMap::new();
        for (i, unit) in units.iter().enumerate() {
            units_by_name.entry(unit.name.clone()).or_insert(i);
        }
        let mut types = HashMap::new();
        for simple_type in children(&root, "TypeDefinitions", "SimpleType") {
            types.insert(bounded(simple_type, "name", MAX_NAME)?, SimpleType::new(simple_type)?);
        }
        let mut variables = Vec::new();
        let mut by_name = HashMap::new();
        for element in children(&root, "ModelVariables", "ScalarVariable") {
            let variable = variable(element, &types)?;
            if by_name.insert(variable.name.clone(), variables.len()).is_some() {
                return Err(element.place.error(format!("variable `{}` is declared twice", variable.name)));
            }
            variables.push(variable);
        }
        for (element, position) in children(&root, "ModelVariables", "ScalarVariable").zip(0..variables.len()) {
            if let Some(of) = variables[position].derivative_of
                && of >= variables.len()
            {
                return Err(element.place.error(format!(
                    "variable `{}` is the derivative of variable {}, there are {}",
                    variables[position].name,
                    of + 1,
                    variables.len()
                )));
            }
        }
        let structure = |list| -> Result<Vec<Unknown>, XmlError> {
            root.child("ModelStructure")
                .into_iter()
                .flat_map(|s| children(s, list, "Unknown"))
                .map(|element| unknown(element, variables.len()))
                .collect()
        };
        let text = |name| root.attribute(name).map(str::to_string);
        let experiment = root.child("DefaultExperiment");
        let time = |name| experiment.map_or(Ok(None), |e| e.real(name));
        Ok(Self {
            fmi_version: fmi_version.to_string(),
            model_name: root.required("modelName")?.to_string(),
            guid: root.required("guid")?.to_string(),
            description: text("description"),
            author: text("author"),
            version: text("version"),
            copyright: text("copyright"),
            license: text("license"),
            generation_tool: text("generationTool"),
            generation_date_and_time: text("generationDateAndTime"),
            variable_naming_convention: text("variableNamingConvention").unwrap_or_else(|| "flat".to_string()),
            co_simulation,
            model_exchange,
            log_categories: children(&root, "LogCategories", "Category")
                .map(|c| bounded(c, "name", MAX_NAME).map(str::to_string))
                .collect::<Result<_, _>>()?,
            default_experiment: DefaultExperiment {
                start_time: time("startTime")?,
                stop_time: time("stopTime")?,
                tolerance: time("tolerance")?,
                step_size: time("stepSize")?,
            },
            outputs: structure("Outputs")?,
            derivatives: structure("Derivatives")?,
            initial_unknowns: structure("InitialUnknowns")?,
            units,
            variables,
            by_name,
            units_by_name,
        })
    }
}

/// The children `name` of the child `list`.
fn children<'a>(parent: &'a Element, list: &str, name: &'a str) -> impl Iterator<Item = &'a Element> {
    parent.child(list).into_iter().flat_map(|l| &l.children).filter(move |c| c.name == name)
}

/// The model identifier, which becomes part of a path: nothing but a C identifier is accepted.
fn identifier(element: &Element) -> Result<String, XmlError> {
    let text = element.required("modelIdentifier")?;
    let plain = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit()) || !plain {
        return Err(element
            .place
            .error(format!("modelIdentifier \"{text}\" is not a C identifier (letters, digits, _)")));
    }
    Ok(text.to_string())
}

fn co_simulation(element: &Element) -> Result<CoSimulation, XmlError> {
    let flag = |name| Ok(element.boolean(name)?.unwrap_or(false));
    Ok(CoSimulation {
        model_identifier: identifier(element)?,
        needs_execution_tool: flag("needsExecutionTool")?,
        can_handle_variable_communication_step_size: flag("canHandleVariableCommunicationStepSize")?,
        can_interpolate_inputs: flag("canInterpolateInputs")?,
        max_output_derivative_order: element.parsed("maxOutputDerivativeOrder", "a whole number from 0")?.unwrap_or(0),
        can_run_asynchronously: flag("canRunAsynchronuously")?,
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess")?,
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions")?,
        can_get_and_set_fmu_state: flag("canGetAndSetFMUstate")?,
        can_serialize_fmu_state: flag("canSerializeFMUstate")?,
        provides_directional_derivative: flag("providesDirectionalDerivative")?,
    })
}

/// An attribute that must be there and must not be longer than so many bytes.
fn bounded<'a>(element: &'a Element, attribute: &str, most: usize) -> Result<&'a str, XmlError> {
    let text = element.required(attribute)?;
    check_length(element, attribute, text, most)?;
    Ok(text)
}

fn check_length(element: &Element, attribute: &str, text: &str, most: usize) -> Result<(), XmlError> {
    if text.len() <= most {
        return Ok(());
    }
    let message = format!("`{attribute}` of <{}> has {} bytes, at most {most} are read", element.name, text.len());
    Err(element.place.error(message))
}

fn unit(element: &Element) -> Result<Unit, XmlError> {
    let base = element
        .child("BaseUnit")
        .map(|base| -> Result<BaseUnit, XmlError> {
            let mut exponents = [0; 8];
            for (exponent, name) in exponents.iter_mut().zip(["kg", "m", "s", "A", "K", "mol", "cd", "rad"]) {
                *exponent = base.parsed(name, "a whole number")?.unwrap_or(0);
            }
            Ok(BaseUnit {
                exponents,
                factor: base.real("factor")?.unwrap_or(1.0),
                offset: base.real("offset")?.unwrap_or(0.0),
            })
        })
        .transpose()?;
    let display_units = element
        .children
        .iter()
        .filter(|c| c.name == "DisplayUnit")
        .map(|display| {
            let factor = display.real("factor")?.unwrap_or(1.0);
            let offset = display.real("offset")?.unwrap_or(0.0);
            if factor == 0.0 || !factor.is_finite() || !offset.is_finite() {
                return Err(display.place.error(format!(
                    "display unit with factor {factor} and offset {offset}, expected finite numbers and a factor other than 0"
                )));
            }
            Ok(DisplayUnit {
                name: bounded(display, "name", MAX_INHERITED)?.to_string(),
                factor,
                offset,
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    if display_units.len() > MAX_DISPLAY_UNITS {
        let message = format!("{} display units, at most {MAX_DISPLAY_UNITS} are read", display_units.len());
        return Err(element.place.error(message));
    }
    Ok(Unit { name: bounded(element, "name", MAX_INHERITED)?.to_string(), base, display_units })
}

/// The five elements that say the type of a variable.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Real,
    Integer,
    Boolean,
    String,
    Enumeration,
}

/// The child that says the type of a variable or of a type definition.
fn typed_child(element: &Element) -> Result<(&Element, Kind), XmlError> {
    element
        .children
        .iter()
        .find_map(|child| {
            let kind = match child.name.as_str() {
                "Real" => Kind::Real,
                "Integer" => Kind::Integer,
                "Boolean" => Kind::Boolean,
                "String" => Kind::String,
                "Enumeration" => Kind::Enumeration,
                _ => return None,
            };
            Some((child, kind))
        })
        .ok_or_else(|| {
            element.place.error(format!(
                "<{}> has no type, expected <Real>, <Integer>, <Boolean>, <String> or <Enumeration>",
                element.name
            ))
        })
}

/// A type definition: what its variables inherit.
struct SimpleType<'a> {
    element: &'a Element,
    kind: Kind,
    items: Arc<[Item]>,
}

impl<'a> SimpleType<'a> {
    fn new(definition: &'a Element) -> Result<Self, XmlError> {
        let (element, kind) = typed_child(definition)?;
        let items = element.children.iter().filter(|child| kind == Kind::Enumeration && child.name == "Item");
        let items = items.map(|item| {
            Ok(Item {
                name: bounded(item, "name", MAX_NAME)?.to_string(),
                value: item
                    .parsed("value", "a whole number")?
                    .ok_or_else(|| item.place.error("<Item> lacks the attribute `value`"))?,
                description: item.attribute("description").map(str::to_string),
            })
        });
        Ok(Self { element, kind, items: items.collect::<Result<_, XmlError>>()? })
    }
}

fn variable(element: &Element, types: &HashMap<&str, SimpleType<'_>>) -> Result<Variable, XmlError> {
    let name = bounded(element, "name", MAX_NAME)?.to_string();
    let (own, kind) = typed_child(element)?;
    let declared = match own.attribute("declaredType") {
        None => None,
        Some(type_name) => match types.get(type_name) {
            Some(definition) if definition.kind == kind => Some(definition),
            Some(_) => {
                return Err(own.place.error(format!("variable `{name}`: type `{type_name}` is of another base type")));
            }
            None => {
                return Err(own.place.error(format!("variable `{name}`: type `{type_name}` is not defined")));
            }
        },
    };
    // An attribute of the variable stands above that of its type.
    let source = |attribute: &str| match (own.attribute(attribute), declared) {
        (None, Some(definition)) => definition.element,
        _ => own,
    };
    let text = |attribute| {
        let text = source(attribute).attribute(attribute);
        text.map(|text| check_length(source(attribute), attribute, text, MAX_INHERITED).map(|()| text.to_string()))
            .transpose()
    };
    let number = |attribute| source(attribute).real(attribute);
    let base_type = match kind {
        Kind::Real => BaseType::Real,
        Kind::Integer | Kind::Enumeration => BaseType::Integer,
        Kind::Boolean => BaseType::Boolean,
        Kind::String => BaseType::String,
    };
    let start = match base_type {
        BaseType::Real => own.real("start")?.map(Value::Real),
        BaseType::Integer => own.parsed("start", "a whole number")?.map(Value::Integer),
        BaseType::Boolean => own.boolean("start")?.map(Value::Boolean),
        BaseType::String => own.attribute("start").map(|s| Value::String(s.to_string())),
    };
    let causality = match element.attribute("causality") {
        None | Some("local") => Causality::Local,
        Some("parameter") => Causality::Parameter,
        Some("calculatedParameter") => Causality::CalculatedParameter,
        Some("input") => Causality::Input,
        Some("output") => Causality::Output,
        Some("independent") => Causality::Independent,
        Some(other) => return Err(unexpected(element, "causality", other)),
    };
    let variability = match element.attribute("variability") {
        None if base_type == BaseType::Real => Variability::Continuous,
        None => Variability::Discrete,
        Some("constant") => Variability::Constant,
        Some("fixed") => Variability::Fixed,
        Some("tunable") => Variability::Tunable,
        Some("discrete") => Variability::Discrete,
        Some("continuous") => Variability::Continuous,
        Some(other) => return Err(unexpected(element, "variability", other)),
    };
    let initial = match element.attribute("initial") {
        None => default_initial(causality, variability),
        Some("exact") => Some(Initial::Exact),
        Some("approx") => Some(Initial::Approx),
        Some("calculated") => Some(Initial::Calculated),
        Some(other) => return Err(unexpected(element, "initial", other)),
    };
    let derivative_of = own
        .parsed::<usize>("derivative", "the number of a variable, from 1")?
        .map(|number| number.checked_sub(1).ok_or_else(|| own.place.error("variables are numbered from 1")))
        .transpose()?;
    Ok(Variable {
        reference: element
            .parsed("valueReference", "a whole number from 0")?
            .ok_or_else(|| element.place.error(format!("variable `{name}` lacks the attribute `valueReference`")))?,
        description: element.attribute("description").map(str::to_string),
        causality,
        variability,
        initial,
        base_type,
        start,
        min: number("min")?,
        max: number("max")?,
        nominal: number("nominal")?,
        quantity: text("quantity")?,
        unit: text("unit")?,
        display_unit: text("displayUnit")?,
        relative_quantity: source("relativeQuantity").boolean("relativeQuantity")?.unwrap_or(false),
        declared_type: own.attribute("declaredType").map(str::to_string),
        items: declared.map(|definition| Arc::clone(&definition.items)).unwrap_or_default(),
        derivative_of,
        name,
    })
}

fn unexpected(element: &Element, attribute: &str, value: &str) -> XmlError {
    element.place.error(format!("<{}> has {attribute}=\"{value}\", which FMI 2.0 does not know", element.name))
}

/// `initial` where it is not written (FMI 2.0.4, section 2.2.7, the tables of defaults).
fn default_initial(causality: Causality, variability: Variability) -> Option<Initial> {
    match (causality, variability) {
        (Causality::Input | Causality::Independent, _) => None,
        (Causality::Parameter, _) | (_, Variability::Constant) => Some(Initial::Exact),
        _ => Some(Initial::Calculated),
    }
}

fn unknown(element: &Element, variables: usize) -> Result<Unknown, XmlError> {
    let index = |number: usize| match number.checked_sub(1) {
        Some(i) if i < variables => Ok(i),
        _ => Err(element.place.error(format!("<Unknown> names variable {number}, expected 1 to {variables}"))),
    };
    let number: Option<usize> = element.parsed("index", "the number of a variable, from 1")?;
    let number = number.ok_or_else(|| element.place.error("<Unknown> lacks the attribute `index`"))?;
    let dependencies = element
        .attribute("dependencies")
        .map(|list| {
            list.split_ascii_whitespace()
                .map(|text| {
                    let number = text.parse().map_err(|_| {
                        element
                            .place
                            .error(format!("<Unknown> depends on \"{text}\", expected the number of a variable"))
                    })?;
                    index(number)
                })
                .collect::<Result<Vec<_>, _>>()
        })
        .transpose()?;
    let kinds = element
        .attribute("dependenciesKind")
        .unwrap_or("")
        .split_ascii_whitespace()
        .map(|kind| match kind {
            "dependent" => Ok(DependencyKind::Dependent),
            "constant" => Ok(DependencyKind::Constant),
            "fixed" => Ok(DependencyKind::Fixed),
            "tunable" => Ok(DependencyKind::Tunable),
            "discrete" => Ok(DependencyKind::Discrete),
            other => Err(unexpected(element, "dependenciesKind", other)),
        })
        .collect::<Result<Vec<_>, _>>()?;
    if !kinds.is_empty() && Some(kinds.len()) != dependencies.as_ref().map(Vec::len) {
        return Err(element.place.error("<Unknown> has another number of dependenciesKind than of dependencies"));
    }
    Ok(Unknown { variable: index(number)?, dependencies, kinds })
}

#[cfg(test)]
mod tests {
    use super::*;

    const VEHICLE: &str = include_str!("../../tests/data/Vehicle.xml");

    #[test]
    fn everything_a_description_says_is_read() {
        let d = ModelDescription::parse(VEHICLE).unwrap();
        assert_eq!(d.model_name, "Vehicle");
        assert_eq!(d.guid, "{vehicle}");
        let cs = d.co_simulation.as_ref().unwrap();
        assert_eq!(cs.model_identifier, "Vehicle");
        assert!(cs.can_get_and_set_fmu_state && !cs.can_serialize_fmu_state);
        assert_eq!(d.default_experiment.stop_time, Some(10.0));
        assert_eq!(d.default_experiment.tolerance, None);
        assert_eq!(d.log_categories, ["logStatusError"]);

        let roll = d.variable("body.roll").unwrap();
        assert_eq!(roll.reference, 2);
        assert_eq!(roll.causality, Causality::Output);
        assert_eq!(roll.variability, Variability::Continuous);
        assert_eq!(roll.initial, Some(Initial::Exact));
        assert_eq!(roll.unit.as_deref(), Some("rad"), "from the type");
        assert_eq!(roll.display_unit.as_deref(), Some("deg"), "from the type");
        assert_eq!(roll.max, Some(1.5), "own limit above that of the type");
        assert_eq!(roll.min, Some(-3.0), "from the type");
        assert_eq!(d.display_units(roll)[0].name, "deg");

        let mode = d.variable("tire.mode").unwrap();
        assert_eq!(mode.base_type, BaseType::Integer);
        assert_eq!(mode.start, Some(Value::Integer(1)));
        assert_eq!(mode.items[1].name, "linear");
        assert_eq!(mode.variability, Variability::Fixed);
        assert_eq!(mode.initial, Some(Initial::Exact), "default of a parameter");

        let rate = d.index("body.roll_rate").unwrap();
        assert_eq!(d.variables[rate].derivative_of, d.index("body.roll"));
        assert_eq!(d.outputs[0].variable, d.index("body.roll").unwrap());
        assert_eq!(d.outputs[0].dependencies.as_deref(), Some(&[][..]));
        assert_eq!(d.outputs[1].kinds, [DependencyKind::Fixed]);
        assert_eq!(d.initial_unknowns[0].dependencies, None);
        let torque = d.unit("N.m").unwrap().base.unwrap();
        assert_eq!(torque.exponents, [1, 2, -2, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn faults_are_reported_with_their_place() {
        let long = |name: &str, bytes| format!("{name}=\"{}\"", "x".repeat(bytes));
        for (from, to, expected) in [
            ("fmiVersion=\"2.0\"", "fmiVersion=\"3.0\"", "FMI version 3.0"),
            ("guid=\"{vehicle}\"", "", "lacks the attribute `guid`"),
            ("modelIdentifier=\"Vehicle\"", "modelIdentifier=\"../x\"", "C identifier"),
            ("valueReference=\"2\"", "valueReference=\"-2\"", "valueReference=\"-2\""),
            ("name=\"body.roll_rate\"", "name=\"body.roll\"", "declared twice"),
            ("declaredType=\"Angle\"", "declaredType=\"Angel\"", "`Angel` is not defined"),
            ("causality=\"output\"", "causality=\"out\"", "causality=\"out\""),
            ("<Unknown index=\"3\"", "<Unknown index=\"99\"", "names variable 99"),
            ("max=\"1.5\"", "max=\"big\"", "max=\"big\""),
            ("derivative=\"3\"", "derivative=\"0\"", "numbered from 1"),
            ("derivative=\"3\"", "derivative=\"77\"", "derivative of variable 77"),
            ("factor=\"57.29577951308232\"", "factor=\"0\"", "other than 0"),
            ("name=\"body.roll\"", &long("name", 4097), "`name` of <ScalarVariable> has 4097 bytes, at most 4096 are"),
            ("unit=\"rad\"", &long("unit", 201), "`unit` of <Real> has 201 bytes, at most 200 are"),
        ] {
            assert!(VEHICLE.contains(from), "{from}");
            let error = ModelDescription::parse(&VEHICLE.replacen(from, to, 1)).expect_err(to).to_string();
            assert!(error.contains(expected), "{to}: {error}");
            assert!(error.starts_with("line "), "{error}");
        }
    }
}
