//! The model description: modelDescription.xml, generated from the declarations.

use std::collections::BTreeMap;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};

use crate::block::{ParameterReader, Parameters as _};
use crate::model::{Info, Model};
use crate::scalar::Dependencies;
use crate::unit::Unit;
use crate::variable::{Kind, Layout, Role, Variable};

/// Category of messages about refused calls and failed steps; always logged.
pub const LOG_ERROR: &str = "logStatusError";
/// Category of messages about information that does not exist.
pub const LOG_DISCARD: &str = "logStatusDiscard";
/// Category of messages about the life of the instance.
pub const LOG_EVENTS: &str = "logEvents";

/// The log categories with their descriptions.
pub const LOG_CATEGORIES: [(&str, &str); 3] = [
    (LOG_ERROR, "Refused calls and failed steps: what, where, and what was expected (always logged)"),
    (LOG_DISCARD, "Questions that have no answer"),
    (LOG_EVENTS, "Initialization, termination, reset and restored states"),
];

/// What is known about a model without an instance.
#[derive(Debug)]
pub struct Description {
    /// All variables.
    pub layout: Layout,
    /// Hash of the description.
    pub guid: String,
    /// modelDescription.xml.
    pub xml: String,
    /// The same, as the C interface hands it out.
    pub(crate) c_xml: std::ffi::CString,
}

impl Description {
    /// Describes the model `M`.
    ///
    /// # Panics
    /// When the declarations contradict each other (two variables of one name, a start value outside its limits);
    /// the test that [`export!`](crate::export) adds to the model's package finds that.
    pub fn of<M: Model>() -> Self {
        let layout = M::layout();
        if let Some(problem) = contradiction(&layout) {
            panic!("{}: {problem}", M::INFO.name);
        }
        let structure = if M::IS_PLANT { structure::<M>(&layout) } else { Vec::new() };
        let write = |guid: &str| {
            let xml = xml(&M::INFO, M::IS_PLANT, &layout, &structure, guid).expect("writing to memory does not fail");
            String::from_utf8(xml).expect("all texts are UTF-8")
        };
        // The GUID is the hash of the description with an empty one.
        let hash = uuid::Uuid::new_v5(&uuid::Uuid::NAMESPACE_OID, write("").as_bytes());
        let guid = format!("{{{hash}}}");
        let xml = write(&guid);
        let c_xml = std::ffi::CString::new(xml.as_str()).expect("XML has no zero bytes");
        Self { layout, guid, xml, c_xml }
    }
}

/// What is wrong with the declarations, if anything.
fn contradiction(layout: &Layout) -> Option<String> {
    let mut seen = BTreeMap::new();
    for variable in &layout.variables {
        let declaration = &variable.declaration;
        let name = &declaration.name;
        if seen.insert(name, ()).is_some() {
            return Some(format!("two variables are named '{name}'"));
        }
        if declaration.description.is_empty() {
            return Some(format!("'{name}' has no description"));
        }
        match &declaration.kind {
            Kind::Real(real) => {
                let (min, max) = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
                if !real.start.is_finite() || !(min..=max).contains(&real.start) {
                    return Some(format!("start of '{name}' = {} is not within [{min}, {max}]", real.start));
                }
                if real.positive && real.start <= 0.0 {
                    return Some(format!("start of '{name}' = {} is not above 0", real.start));
                }
                if let Some(display) = real.display
                    && real.unit.display_unit(display).is_none()
                {
                    return Some(format!("'{name}': {} cannot be displayed in {display}", real.unit.name));
                }
            }
            Kind::Integer { start, min, max, .. } if !(min..=max).contains(&start) => {
                return Some(format!("start of '{name}' = {start} is not within [{min}, {max}]"));
            }
            Kind::String { start } if start.contains('\0') => {
                return Some(format!("start of '{name}' has a zero byte"));
            }
            _ => {}
        }
    }
    None
}

/// What every output and derivative of a plant depends on, over all values of all modes and switches.
fn structure<M: Model>(layout: &Layout) -> Vec<Dependencies> {
    let mut reals = vec![0.0; layout.reals()];
    let (mut integers, mut booleans, mut strings) = (Vec::new(), Vec::new(), Vec::new());
    // Every mode with its values, and every switch with both.
    let mut modes: Vec<(bool, usize, Vec<i32>)> = Vec::new();
    for variable in &layout.variables {
        match &variable.declaration.kind {
            Kind::Real(real) => reals[variable.index] = real.start,
            Kind::Integer { start, choices, .. } => {
                integers.push(*start);
                if !choices.is_empty() {
                    modes.push((true, variable.index, choices.iter().map(|choice| choice.value).collect()));
                }
            }
            Kind::Boolean { start } => {
                booleans.push(*start);
                modes.push((false, variable.index, vec![0, 1]));
            }
            Kind::String { start } => strings.push(start.clone()),
        }
    }
    let combinations: usize = modes.iter().map(|(_, _, values)| values.len()).product();
    let mut union = vec![Dependencies::default(); layout.outputs.len() + layout.states.len()];
    for combination in 0..combinations {
        let mut rest = combination;
        for (is_integer, index, values) in &modes {
            let value = values[rest % values.len()];
            rest /= values.len();
            if *is_integer {
                integers[*index] = value;
            } else {
                booleans[*index] = value != 0;
            }
        }
        let p = M::Parameters::read(&mut ParameterReader::new(&reals, &integers, &booleans, &strings));
        // A combination without a design cannot be simulated, so it adds nothing.
        if let Ok(d) = M::load(&p, std::path::Path::new("")) {
            for (sum, set) in union.iter_mut().zip(M::dependencies(&p, &d)) {
                *sum = sum.union(set);
            }
        }
    }
    union
}

fn number(value: f64) -> String {
    format!("{value:?}")
}

/// Numbers separated by blanks.
fn list(numbers: impl IntoIterator<Item = usize>) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

type Written = std::io::Result<()>;
type Xml = Writer<Vec<u8>>;

fn xml(
    info: &Info,
    is_plant: bool,
    layout: &Layout,
    structure: &[Dependencies],
    guid: &str,
) -> std::io::Result<Vec<u8>> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let tool = concat!("fmi2 ", env!("CARGO_PKG_VERSION"), " (Chassis FMU)");
    xml.create_element("fmiModelDescription")
        .with_attributes([
            ("fmiVersion", "2.0"),
            ("modelName", info.name),
            ("guid", guid),
            ("description", info.description),
            ("author", "The Chassis FMU developers"),
            ("version", info.version),
            ("license", "MIT OR Apache-2.0"),
            ("generationTool", tool),
            ("variableNamingConvention", "structured"),
        ])
        .write_inner_content(|xml| {
            let mut element = xml.create_element("CoSimulation").with_attributes([
                ("modelIdentifier", info.name),
                ("canHandleVariableCommunicationStepSize", "true"),
                ("canNotUseMemoryManagementFunctions", "true"),
                ("canGetAndSetFMUstate", "true"),
                ("canSerializeFMUstate", "true"),
            ]);
            if is_plant {
                element = element.with_attribute(("providesDirectionalDerivative", "true"));
            }
            element.write_empty()?;
            unit_definitions(xml, layout)?;
            type_definitions(xml, layout)?;
            xml.create_element("LogCategories").write_inner_content(|xml| {
                for (name, description) in LOG_CATEGORIES {
                    xml.create_element("Category")
                        .with_attributes([("name", name), ("description", description)])
                        .write_empty()?;
                }
                Ok(())
            })?;
            xml.create_element("DefaultExperiment")
                .with_attributes([
                    ("startTime", "0.0"),
                    ("stopTime", number(info.stop_time).as_str()),
                    ("stepSize", number(info.step_size).as_str()),
                ])
                .write_empty()?;
            xml.create_element("ModelVariables").write_inner_content(|xml| {
                layout.variables.iter().try_for_each(|variable| scalar_variable(xml, is_plant, layout, variable))
            })?;
            model_structure(xml, is_plant, layout, structure)
        })?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

fn unit_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    let units: BTreeMap<&str, Unit> = layout
        .variables
        .iter()
        .filter_map(|variable| match &variable.declaration.kind {
            Kind::Real(real) => Some((real.unit.name, real.unit)),
            _ => None,
        })
        .collect();
    if units.is_empty() {
        return Ok(());
    }
    xml.create_element("UnitDefinitions").write_inner_content(|xml| {
        for unit in units.values() {
            xml.create_element("Unit").with_attribute(("name", unit.name)).write_inner_content(|xml| {
                let e = unit.exponents;
                let mut base = xml.create_element("BaseUnit");
                for (name, exponent) in [("kg", e.kg), ("m", e.m), ("s", e.s), ("rad", e.rad)] {
                    if exponent != 0 {
                        base = base.with_attribute((name, exponent.to_string().as_str()));
                    }
                }
                if unit.factor != 1.0 {
                    base = base.with_attribute(("factor", number(unit.factor).as_str()));
                }
                base.write_empty()?;
                for display in unit.display {
                    let mut element = xml
                        .create_element("DisplayUnit")
                        .with_attributes([("name", display.name), ("factor", number(display.factor).as_str())]);
                    if display.offset != 0.0 {
                        element = element.with_attribute(("offset", number(display.offset).as_str()));
                    }
                    element.write_empty()?;
                }
                Ok(())
            })?;
        }
        Ok(())
    })?;
    Ok(())
}

/// A mode is an integer, because several masters cannot set enumerations; its type says what the numbers mean.
fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    let mut modes = BTreeMap::new();
    for variable in &layout.variables {
        if let Kind::Integer { choices, type_name, min, max, .. } = &variable.declaration.kind
            && !choices.is_empty()
        {
            modes.insert(*type_name, (*choices, *min, *max));
        }
    }
    if modes.is_empty() {
        return Ok(());
    }
    xml.create_element("TypeDefinitions").write_inner_content(|xml| {
        for (name, (choices, min, max)) in modes {
            let description = choices
                .iter()
                .map(|choice| format!("{} {}: {}", choice.value, choice.name, choice.description))
                .collect::<Vec<_>>()
                .join("; ");
            xml.create_element("SimpleType")
                .with_attributes([("name", name), ("description", description.as_str())])
                .write_inner_content(|xml| {
                xml.create_element("Integer")
                    .with_attributes([("min", min.to_string().as_str()), ("max", max.to_string().as_str())])
                    .write_empty()?;
                Ok(())
            })?;
        }
        Ok(())
    })?;
    Ok(())
}

fn scalar_variable(xml: &mut Xml, is_plant: bool, layout: &Layout, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let (causality, variability, initial) = match variable.role {
        Role::Parameter => ("parameter", if declaration.tunable { "tunable" } else { "fixed" }, Some("exact")),
        Role::Calculated => ("calculatedParameter", "fixed", Some("calculated")),
        Role::Input => ("input", "continuous", None),
        Role::Output if is_plant => ("output", "continuous", Some("calculated")),
        Role::Output => ("output", "discrete", Some("exact")),
        Role::State => (if declaration.local { "local" } else { "output" }, "continuous", Some("exact")),
        Role::Derivative => ("local", "continuous", Some("calculated")),
    };
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
                let mut element = xml.create_element("Real").with_attribute(("unit", real.unit.name));
                if let Some(display) = real.display {
                    element = element.with_attribute(("displayUnit", display));
                }
                for (name, value) in [("min", real.min), ("max", real.max), ("nominal", real.nominal)] {
                    if let Some(value) = value {
                        element = element.with_attribute((name, number(value).as_str()));
                    }
                }
                if has_start {
                    element = element.with_attribute(("start", number(real.start).as_str()));
                }
                if variable.role == Role::Derivative {
                    let state = layout.states.start + variable.index - layout.derivatives.start;
                    let reference = u32::try_from(state).expect("numbered in 32 bits");
                    element =
                        element.with_attribute(("derivative", layout.structure_index(reference).to_string().as_str()));
                }
                element.write_empty()?;
            }
            Kind::Integer { start, min, max, choices, type_name } => {
                let mut element = xml.create_element("Integer");
                if !choices.is_empty() {
                    element = element.with_attribute(("declaredType", *type_name));
                }
                element
                    .with_attributes([
                        ("min", min.to_string().as_str()),
                        ("max", max.to_string().as_str()),
                        ("start", start.to_string().as_str()),
                    ])
                    .write_empty()?;
            }
            Kind::Boolean { start } => {
                xml.create_element("Boolean").with_attribute(("start", start.to_string().as_str())).write_empty()?;
            }
            Kind::String { start } => {
                xml.create_element("String").with_attribute(("start", start.as_str())).write_empty()?;
            }
        }
        Ok(())
    })?;
    Ok(())
}

fn model_structure(xml: &mut Xml, is_plant: bool, layout: &Layout, structure: &[Dependencies]) -> Written {
    let with_role = |role: Role| layout.variables.iter().filter(move |variable| variable.role == role);
    let index = |variable: &Variable| layout.structure_index(variable.reference);
    // Known variables in the order in which `Dependencies` numbers them.
    let known: Vec<usize> = with_role(Role::Input).chain(with_role(Role::State)).map(index).collect();
    let depends = |variable: &Variable| -> Vec<usize> {
        let set = match variable.role {
            Role::Output if is_plant => structure[variable.index - layout.outputs.start],
            Role::Derivative => structure[layout.outputs.len() + variable.index - layout.derivatives.start],
            // Outputs of sampled units are held; an output that is a state is known itself.
            _ => Dependencies::default(),
        };
        let mut indices: Vec<_> =
            known.iter().enumerate().filter(|&(i, _)| set.contains(i)).map(|(_, &index)| index).collect();
        indices.sort_unstable();
        indices
    };
    let unknown = |xml: &mut Xml, variable: &Variable, dependencies: Vec<usize>| -> Written {
        xml.create_element("Unknown")
            .with_attributes(
                [("index", index(variable).to_string()), ("dependencies", list(dependencies))]
                    .iter()
                    .map(|(name, value)| (*name, value.as_str())),
            )
            .write_empty()?;
        Ok(())
    };
    let outputs: Vec<_> = layout
        .variables
        .iter()
        .filter(|v| v.role == Role::Output || (v.role == Role::State && !v.declaration.local))
        .collect();
    xml.create_element("ModelStructure").write_inner_content(|xml| {
        if !outputs.is_empty() {
            xml.create_element("Outputs")
                .write_inner_content(|xml| outputs.iter().try_for_each(|v| unknown(xml, v, depends(v))))?;
        }
        if !layout.derivatives.is_empty() {
            xml.create_element("Derivatives")
                .write_inner_content(|xml| with_role(Role::Derivative).try_for_each(|v| unknown(xml, v, depends(v))))?;
        }
        // At the start everything may also depend on any parameter; calculated ones on the fixed parameters only.
        let parameters: Vec<_> = with_role(Role::Parameter).map(index).collect();
        let fixed: Vec<_> = with_role(Role::Parameter).filter(|v| !v.declaration.tunable).map(index).collect();
        let mut initial: Vec<_> = layout
            .variables
            .iter()
            .filter(|v| match v.role {
                Role::Calculated | Role::Derivative => true,
                Role::Output => is_plant,
                _ => false,
            })
            .collect();
        initial.sort_by_key(|v| index(v));
        if !initial.is_empty() {
            xml.create_element("InitialUnknowns").write_inner_content(|xml| {
                initial.iter().try_for_each(|v| {
                    let mut all = if v.role == Role::Calculated { fixed.clone() } else { parameters.clone() };
                    all.extend(depends(v));
                    unknown(xml, v, all)
                })
            })?;
        }
        Ok(())
    })?;
    Ok(())
}
