//! Reads the XML text.

mod types;
mod v2;
mod v3;

use super::{
    BaseUnit, Capabilities, Causality, Clock, DefaultExperiment, DisplayUnit, FmiVersion, Item, ModelDescription,
    StructuralParameters, Unit, Unknown, Variable,
};
use crate::terminal;
use crate::xml::{self, Element, XmlError};
use serde::de::{DeserializeOwned, value::StrDeserializer};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Maximum length of the name of a variable, unit, type or item, bytes.
const MAX_NAME: usize = 4096;
/// Maximum length of a model identifier, bytes. File systems limit names to 255 bytes with the extension.
const MAX_IDENTIFIER: usize = 240;
/// Maximum length of a variable's unit, display unit or quantity, bytes. The limit is low, because every variable of a
/// type has a copy.
const MAX_INHERITED: usize = 200;
/// Maximum number of display units of a unit. The limit is low, because every recorded signal has a copy.
const MAX_DISPLAY_UNITS: usize = 100;
/// Maximum number of elements in all arrays together, and in a list of the model structure. The values of all elements
/// are kept in memory.
const MAX_ELEMENTS: usize = 10_000_000;

#[derive(Default)]
struct Variables {
    list: Vec<Variable>,
    clocks: Vec<Clock>,
    names: HashSet<String>,
}

impl Variables {
    /// Adds a name. Fails if a variable already has it.
    fn take(&mut self, element: &Element, name: &str) -> Result<(), XmlError> {
        if self.names.insert(name.to_owned()) {
            return Ok(());
        }
        Err(element.place.error(format!("variable `{name}` is declared twice")))
    }
}

struct Structure {
    outputs: Vec<Unknown>,
    derivatives: Vec<Unknown>,
    initial_unknowns: Vec<Unknown>,
    event_indicators: Vec<Unknown>,
    number_of_event_indicators: usize,
}

impl ModelDescription {
    /// Parses the text of a `modelDescription.xml`. Fails if the XML is not well-formed or hostile (document type
    /// declaration, excessive size or nesting), the FMI version is not supported, an attribute is missing or malformed,
    /// a type or variable does not exist, or a name occurs twice. The error contains line and column.
    pub fn parse(text: &str) -> Result<Self, XmlError> {
        Self::parse_with(text, &StructuralParameters::new())
    }

    /// Like [`Self::parse`], with values of structural parameters instead of their start values. Arrays then have other
    /// sizes; those whose size may have changed have no start values. Names that are not structural parameters have no effect.
    pub fn parse_with(text: &str, given: &StructuralParameters) -> Result<Self, XmlError> {
        let root = xml::parse(text)?;
        if root.name != "fmiModelDescription" {
            return Err(root
                .place
                .error(format!("the root element is <{}>, expected <fmiModelDescription>", root.name)));
        }
        let fmi_version = root.required("fmiVersion")?;
        let fmi = version(fmi_version).ok_or_else(|| {
            root.place.error(format!("FMI version {fmi_version}, expected 2.0 or 3.0: export the FMU for one of these"))
        })?;
        let units = root.listed("UnitDefinitions", "Unit").map(unit).collect::<Result<Vec<_>, _>>()?;
        let mut units_by_name = HashMap::new();
        for (i, unit) in units.iter().enumerate() {
            units_by_name.entry(unit.name.clone()).or_insert(i);
        }
        let (variables, structure) = match fmi {
            FmiVersion::V2 => v2::variables_and_structure(&root)?,
            FmiVersion::V3 => v3::variables_and_structure(&root, given)?,
        };
        let text = |name| root.attribute(name).map(str::to_string);
        let interface = |name| root.child(name).map(|element| capabilities(element, fmi)).transpose();
        let experiment = root.child("DefaultExperiment");
        let time = |name| experiment.map_or(Ok(None), |e| e.real(name));
        let token = match fmi {
            FmiVersion::V2 => "guid",
            FmiVersion::V3 => "instantiationToken",
        };
        Ok(Self {
            fmi,
            fmi_version: fmi_version.to_string(),
            model_name: root.required("modelName")?.to_string(),
            guid: root.required(token)?.to_string(),
            description: text("description"),
            author: text("author"),
            version: text("version"),
            license: text("license"),
            generation_tool: text("generationTool"),
            generation_date_and_time: text("generationDateAndTime"),
            variable_naming_convention: text("variableNamingConvention").unwrap_or_else(|| "flat".to_string()),
            co_simulation: interface("CoSimulation")?,
            model_exchange: interface("ModelExchange")?,
            scheduled_execution: if fmi == FmiVersion::V3 { interface("ScheduledExecution")? } else { None },
            log_categories: root
                .listed("LogCategories", "Category")
                .map(|c| bounded(c, "name", MAX_NAME).map(str::to_string))
                .collect::<Result<_, _>>()?,
            default_experiment: DefaultExperiment {
                start_time: time("startTime")?,
                stop_time: time("stopTime")?,
                tolerance: time("tolerance")?,
                step_size: time("stepSize")?,
            },
            outputs: structure.outputs,
            derivatives: structure.derivatives,
            initial_unknowns: structure.initial_unknowns,
            event_indicators: structure.event_indicators,
            structure: given.clone(),
            number_of_event_indicators: structure.number_of_event_indicators,
            units,
            by_name: variables.list.iter().enumerate().map(|(i, variable)| (variable.name.clone(), i)).collect(),
            units_by_name,
            variables: variables.list,
            clocks: variables.clocks,
        })
    }
}

/// Accepts `2.0`, `3.0`, and `3.0.` followed by a number.
fn version(text: &str) -> Option<FmiVersion> {
    if text == "2.0" {
        return Some(FmiVersion::V2);
    }
    let rest = text.strip_prefix("3.0")?;
    let is_patch = |patch: &str| !patch.is_empty() && patch.bytes().all(|byte| byte.is_ascii_digit());
    (rest.is_empty() || rest.strip_prefix('.').is_some_and(is_patch)).then_some(FmiVersion::V3)
}

/// The model identifier, which becomes part of a path. Many tools write identifiers that are invalid in C. They are
/// accepted here; `check` reports them.
fn identifier(element: &Element) -> Result<String, XmlError> {
    let text = bounded(element, "modelIdentifier", MAX_IDENTIFIER)?;
    let leads_elsewhere = text.contains(['/', '\\', ':']) || matches!(text, "" | "." | "..");
    if leads_elsewhere || terminal::is_unsafe(text) {
        let message = format!("modelIdentifier \"{text}\" cannot be the name of a file");
        return Err(element.place.error(message));
    }
    Ok(text.to_string())
}

fn capabilities(element: &Element, fmi: FmiVersion) -> Result<Capabilities, XmlError> {
    let flag = |name| Ok(element.boolean(name)?.unwrap_or(false));
    let of = |v2, v3| flag(if fmi == FmiVersion::V2 { v2 } else { v3 });
    let is_exchange = element.name == "ModelExchange";
    Ok(Capabilities {
        model_identifier: identifier(element)?,
        needs_execution_tool: flag("needsExecutionTool")?,
        can_handle_variable_communication_step_size: flag("canHandleVariableCommunicationStepSize")?,
        can_interpolate_inputs: flag("canInterpolateInputs")?,
        max_output_derivative_order: element.parsed("maxOutputDerivativeOrder", "a whole number from 0")?.unwrap_or(0),
        can_run_asynchronously: flag("canRunAsynchronuously")?,
        fixed_internal_step_size: element.real("fixedInternalStepSize")?,
        has_event_mode: flag("hasEventMode")?,
        provides_intermediate_update: flag("providesIntermediateUpdate")?,
        can_return_early_after_intermediate_update: flag("canReturnEarlyAfterIntermediateUpdate")?,
        needs_completed_integrator_step: is_exchange
            && match fmi {
                FmiVersion::V2 => !flag("completedIntegratorStepNotNeeded")?,
                FmiVersion::V3 => flag("needsCompletedIntegratorStep")?,
            },
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess")?,
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions")?,
        can_get_and_set_fmu_state: of("canGetAndSetFMUstate", "canGetAndSetFMUState")?,
        can_serialize_fmu_state: of("canSerializeFMUstate", "canSerializeFMUState")?,
        provides_directional_derivative: of("providesDirectionalDerivative", "providesDirectionalDerivatives")?,
        provides_adjoint_derivatives: flag("providesAdjointDerivatives")?,
        provides_per_element_dependencies: flag("providesPerElementDependencies")?,
    })
}

/// A required attribute with at most `most` bytes.
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

/// A unit of measure; in SSP, it has no display units.
pub(crate) fn unit(element: &Element) -> Result<Unit, XmlError> {
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
        // In FMI 3.0, a display unit can be a reciprocal. It is omitted, because factor and offset cannot express it.
        .filter(|display| !matches!(display.boolean("inverse"), Ok(Some(true))))
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
        let message = format!("a unit can have {MAX_DISPLAY_UNITS} display units, got {}", display_units.len());
        return Err(element.place.error(message));
    }
    Ok(Unit { name: bounded(element, "name", MAX_INHERITED)?.to_string(), base, display_units })
}

fn items(element: &Element) -> Result<Arc<[Item]>, XmlError> {
    let items = element.children.iter().filter(|child| child.name == "Item");
    let items = items.map(|item| {
        Ok(Item {
            name: bounded(item, "name", MAX_NAME)?.to_string(),
            value: item
                .parsed("value", "a whole number of 32 bits")?
                .ok_or_else(|| item.place.error("<Item> lacks the attribute `value`"))?,
            description: item.attribute("description").map(str::to_string),
        })
    });
    items.collect()
}

/// Converts a keyword of FMI or SSP to an enum.
pub fn word<T: DeserializeOwned>(text: &str) -> Option<T> {
    T::deserialize(StrDeserializer::<serde::de::value::Error>::new(text)).ok()
}

/// An attribute whose value is a keyword; `None` if it is absent.
fn chosen<T: DeserializeOwned>(element: &Element, attribute: &str, fmi: FmiVersion) -> Result<Option<T>, XmlError> {
    let known = |text| word(text).ok_or_else(|| unexpected(element, attribute, text, fmi));
    element.attribute(attribute).map(known).transpose()
}

fn causality(element: &Element, fmi: FmiVersion) -> Result<Causality, XmlError> {
    match chosen(element, "causality", fmi)?.unwrap_or(Causality::Local) {
        Causality::StructuralParameter if fmi == FmiVersion::V2 => {
            Err(unexpected(element, "causality", "structuralParameter", fmi))
        }
        causality => Ok(causality),
    }
}

fn unexpected(element: &Element, attribute: &str, value: &str, fmi: FmiVersion) -> XmlError {
    element.place.error(format!("<{}> has {attribute}=\"{value}\", which FMI {fmi} does not know", element.name))
}

/// Checks the keywords and the length of the list `dependenciesKind`, which is not used otherwise.
fn check_kinds(element: &Element, fmi: FmiVersion, dependencies: Option<usize>) -> Result<(), XmlError> {
    const KINDS: [&str; 5] = ["dependent", "constant", "fixed", "tunable", "discrete"];
    let kinds: Vec<&str> = element.attribute("dependenciesKind").unwrap_or_default().split_ascii_whitespace().collect();
    if let Some(other) = kinds.iter().find(|kind| !KINDS.contains(kind)) {
        return Err(unexpected(element, "dependenciesKind", other, fmi));
    }
    if !kinds.is_empty() && Some(kinds.len()) != dependencies {
        let message = format!("<{}> must have as many dependenciesKind as dependencies", element.name);
        return Err(element.place.error(message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{BaseType, DataType, Dimension, Initial, IntervalVariability, Value, Variability};

    const VEHICLE: &str = include_str!("../../tests/data/Vehicle.xml");

    #[test]
    fn a_complete_description_is_read() {
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
        assert_eq!(roll.max, Some(1.5), "the limit of the variable overrides the limit of the type");
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
        assert_eq!(d.initial_unknowns[0].dependencies, None);
        let torque = d.unit("N.m").unwrap().base.unwrap();
        assert_eq!(torque.exponents, [1, 2, -2, 0, 0, 0, 0, 0]);
    }

    const TANK: &str = include_str!("../../tests/data/Tank.xml");

    #[test]
    fn a_description_of_fmi_3_is_read() {
        let d = ModelDescription::parse(TANK).unwrap();
        assert_eq!((d.fmi, d.fmi_version.as_str(), d.guid.as_str()), (FmiVersion::V3, "3.0", "{tank}"));
        let cs = d.co_simulation.as_ref().unwrap();
        assert!(cs.can_get_and_set_fmu_state && !cs.can_serialize_fmu_state && cs.provides_adjoint_derivatives);
        assert_eq!(cs.fixed_internal_step_size, Some(0.001));
        let me = d.model_exchange.as_ref().unwrap();
        assert!(me.needs_completed_integrator_step && me.provides_directional_derivative);
        assert!(d.scheduled_execution.is_some());

        let level = d.variable("level").unwrap();
        assert_eq!((level.data_type, level.base_type), (DataType::Float64, BaseType::Real));
        assert_eq!((level.unit.as_deref(), level.min), (Some("m"), Some(0.0)), "from the type");
        assert_eq!(level.start, Some(Value::Real(0.5)));
        let alias = d.variable("level_in_feet").unwrap();
        assert_eq!((alias.reference, alias.alias_of), (level.reference, d.index("level")));
        assert_eq!((alias.causality, alias.has_start()), (Causality::Output, false));
        assert_eq!(alias.display_unit.as_deref(), Some("ft"));
        assert_eq!(d.variables[d.index("der(level)").unwrap()].derivative_of, d.index("level"));

        let size = d.variable("n").unwrap();
        assert_eq!((size.causality, size.initial), (Causality::StructuralParameter, Some(Initial::Exact)));
        assert_eq!(size.variability, Variability::Fixed, "default of a parameter");
        let inflow = d.variable("inflow").unwrap();
        assert_eq!(inflow.dimensions, [Dimension::Parameter(d.index("n").unwrap()), Dimension::Fixed(2)]);
        assert_eq!((inflow.size, inflow.start.is_none()), (6, true));
        let elements = ["[1,1]", "[1,2]", "[2,1]", "[2,2]", "[3,1]", "[3,2]"].map(|index| format!("inflow{index}"));
        assert_eq!(inflow.elements(), elements);
        assert_eq!(inflow.starts, vec![Value::Real(0.25); 6], "one value for all elements");
        assert_eq!(d.variable("weights").unwrap().starts, [1, 2, 3].map(Value::Integer));
        let given =
            StructuralParameters::from([("n".to_string(), Value::Unsigned(2)), ("level".into(), Value::Real(9.0))]);
        let resized = ModelDescription::parse_with(TANK, &given).unwrap();
        let inflow = resized.variable("inflow").unwrap();
        assert_eq!((inflow.lengths.as_slice(), inflow.size, inflow.starts.as_slice()), (&[2, 2][..], 4, &[][..]));
        assert_eq!(resized.variable("n").unwrap().start, Some(Value::Unsigned(2)));
        let same = |name: &str| resized.variable(name).unwrap().starts == d.variable(name).unwrap().starts;
        assert!(same("weights") && same("level"), "not a structural parameter");
        let seed = d.variable("seed").unwrap();
        assert_eq!(seed.start, Some(Value::Unsigned(u64::MAX)));
        assert_eq!(d.variable("label").unwrap().start, Some(Value::String("a b".into())));
        let valve = d.variable("valve").unwrap();
        assert_eq!((valve.start.as_ref(), valve.items[1].name.as_str()), (Some(&Value::Integer(1)), "closed"));
        let image = d.variable("image").unwrap();
        assert_eq!(image.start, Some(Value::Binary { hex: b"foo".to_vec() }));
        assert_eq!((image.mime_type(), image.max_size), ("image/png", Some(1024)));
        assert_eq!(d.clocks.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["tick"]);
        assert_eq!(d.display_units(level).len(), 1, "the reciprocal is not read");

        assert_eq!(d.outputs.iter().map(|unknown| unknown.variable).collect::<Vec<_>>(), [d.index("level").unwrap()]);
        assert_eq!(d.outputs[0].dependencies, Some(["inflow", "image"].map(|name| d.index(name).unwrap()).to_vec()));
        assert_eq!((d.event_indicators.len(), d.number_of_event_indicators), (1, 6));
        assert_eq!(d.number_of_states(), 1);
    }

    /// FMI 3.0.2, sections 2.4.7.2 (the length may be a constant) and 2.4.7.5 (a type has the defaults of its variables).
    #[test]
    fn constant_lengths_and_types_of_clocks_are_read() {
        let (constant, clock_type) = (
            "<UInt64 name=\"three\" valueReference=\"20\" variability=\"constant\" start=\"3\"/><Int8 name=\"weights\"",
            "<ClockType name=\"Task\" intervalVariability=\"constant\" intervalDecimal=\"0.5\" shiftDecimal=\"0.25\"/>",
        );
        let text = TANK
            .replacen("<Dimension start=\"3\"/>", "<Dimension valueReference=\"20\"/>", 1)
            .replacen("<Int8 name=\"weights\"", constant, 1)
            .replacen("<Float64Type", &format!("{clock_type}<Float64Type"), 1);
        let own = "causality=\"output\" intervalVariability=\"triggered\"";
        let text = text.replacen(own, "causality=\"input\" declaredType=\"Task\" shiftDecimal=\"0\"", 1);
        let d = ModelDescription::parse(&text).unwrap();
        assert_eq!(d.variable("weights").unwrap().dimensions, [Dimension::Fixed(3)]);
        let clock = &d.clocks[0];
        assert_eq!(clock.interval_variability, IntervalVariability::Constant);
        assert_eq!(
            (clock.interval, clock.shift),
            (Some(0.5), 0.0),
            "the shift of the clock overrides that of the type"
        );
    }

    #[test]
    fn errors_in_fmi_3_are_reported_with_their_place() {
        for (from, to, expected) in [
            ("fmiVersion=\"3.0\"", "fmiVersion=\"3.1\"", "FMI version 3.1, expected 2.0 or 3.0"),
            ("instantiationToken=\"{tank}\"", "guid=\"{tank}\"", "lacks the attribute `instantiationToken`"),
            ("valueReference=\"2\"", "valueReference=\"1\"", "has the value reference 1 of another variable"),
            ("name=\"tick\"", "name=\"level\"", "variable `level` is declared twice"),
            ("name=\"level_in_feet\"", "name=\"level\"", "variable `level` is declared twice"),
            ("derivative=\"1\"", "derivative=\"77\"", "the value reference 77, which no variable has"),
            ("declaredType=\"Level\"", "declaredType=\"Valve\"", "type `Valve` has another base type"),
            ("start=\"1 2 3\"", "start=\"1 2\"", "`weights` has 2 start values, but 3 elements"),
            ("start=\"1 2 3\"", "start=\"1 2 300\"", "the start value \"300\" of `weights` is not an Int8"),
            ("<Dimension start=\"3\"/>", "<Dimension start=\"99999999\"/>", "more than 10000000 elements"),
            ("<Dimension start=\"3\"/>", "<Dimension/>", "must have one of the attributes"),
            ("<Dimension start=\"3\"/>", "<Dimension valueReference=\"1\"/>", "is not a structural parameter"),
            ("<Output valueReference=\"1\"", "<Output valueReference=\"x\"", "valueReference=\"x\""),
            ("dependencies=\"4 9\"", "dependencies=\"4\"", "must have as many dependenciesKind as dependencies"),
        ] {
            assert!(TANK.contains(from), "{from}");
            let error = ModelDescription::parse(&TANK.replacen(from, to, 1)).expect_err(to).to_string();
            assert!(error.contains(expected), "{to}: {error}");
            assert!(error.starts_with("line "), "{error}");
        }
    }

    /// A list can contain an array repeatedly and therefore have more elements than all arrays together.
    #[test]
    fn lists_of_many_elements_are_rejected() {
        let large = TANK.replacen(
            "valueReference=\"11\"><Dimension valueReference=\"3\"/>",
            "valueReference=\"11\"><Dimension start=\"3000000\"/>",
            1,
        );
        assert_eq!(ModelDescription::parse(&large).unwrap().number_of_event_indicators, 6_000_000);
        let once = "<EventIndicator valueReference=\"11\"/>";
        for tag in ["EventIndicator", "ContinuousStateDerivative"] {
            let again = format!("{once}{}", format!("<{tag} valueReference=\"11\"/>").repeat(2));
            let error = ModelDescription::parse(&large.replacen(once, &again, 1)).expect_err(tag).to_string();
            assert!(
                error.contains(&format!("<{tag}> has 1")) && error.contains("at most 10000000 are read"),
                "{error}"
            );
            assert!(error.starts_with("line "), "{error}");
        }
    }

    #[test]
    fn errors_are_reported_with_their_place() {
        let long = |name: &str, bytes| format!("{name}=\"{}\"", "x".repeat(bytes));
        for (from, to, expected) in [
            ("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\"", "FMI version 1.0"),
            ("guid=\"{vehicle}\"", "", "lacks the attribute `guid`"),
            (
                "numberOfEventIndicators=\"0\"",
                "numberOfEventIndicators=\"10000001\"",
                "numberOfEventIndicators is 10000001, at most 10000000 are read",
            ),
            ("modelIdentifier=\"Vehicle\"", "modelIdentifier=\"../x\"", "cannot be the name of a file"),
            ("valueReference=\"2\"", "valueReference=\"-2\"", "valueReference=\"-2\""),
            ("name=\"body.roll_rate\"", "name=\"body.roll\"", "declared twice"),
            ("declaredType=\"Angle\"", "declaredType=\"Angel\"", "`Angel` is not defined"),
            ("causality=\"output\"", "causality=\"out\"", "causality=\"out\""),
            ("<Unknown index=\"3\"", "<Unknown index=\"99\"", "names variable 99"),
            ("dependenciesKind=\"fixed\"", "dependenciesKind=\"linear\"", "dependenciesKind=\"linear\", which FMI 2.0"),
            ("dependencies=\"6\" ", "dependencies=\"\" ", "must have as many dependenciesKind as dependencies"),
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
