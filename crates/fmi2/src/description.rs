//! The model description: modelDescription.xml, generated from the declarations.

use std::collections::{BTreeMap, BTreeSet};

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
    /// modelDescription.xml; empty in a packed library.
    pub xml: String,
}

impl Description {
    /// Describes the model `M`.
    ///
    /// # Panics
    /// When the declarations contradict each other (two variables of one name, a start value outside its limits), or
    /// a plant has no design for any value of its modes and switches; the test that [`export!`](crate::export) adds
    /// to the model's package finds that.
    pub fn of<M: Model>() -> Self {
        let layout = M::layout();
        let structure = match contradiction(&M::INFO, &layout) {
            Some(problem) => Err(problem),
            None if M::IS_PLANT => structure::<M>(&layout),
            None => Ok(Vec::new()),
        }
        .unwrap_or_else(|problem| panic!("{}: {problem}", M::INFO.name));
        let xml = xml::<M>(&layout, &structure).expect("writing to memory does not fail");
        let xml = String::from_utf8(xml).expect("all texts are UTF-8");
        // The GUID is the hash of the description with an empty one, which is the first: it stands in the first element.
        let hash = uuid::Uuid::new_v5(&uuid::Uuid::NAMESPACE_OID, xml.as_bytes());
        let guid = format!("{{{hash}}}");
        let xml = xml.replacen(NO_GUID, &format!("guid=\"{guid}\""), 1);
        Self { layout, guid, xml }
    }

    /// What an instance needs, where the GUID is known: see [`crate::abi::Export::GUID`].
    pub fn packed<M: Model>(guid: &str) -> Self {
        Self { layout: M::layout(), guid: guid.to_owned(), xml: String::new() }
    }
}

/// What is wrong with the declarations, if anything.
fn contradiction(info: &Info, layout: &Layout) -> Option<String> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if !info.name.starts_with(|c: char| c.is_ascii_alphabetic()) || !info.name.chars().all(is_word) {
        return Some("the name is not an identifier of C, as modelIdentifier has to be".to_owned());
    }
    for (what, value) in [("stop_time", info.stop_time), ("step_size", info.step_size)] {
        if !(value.is_finite() && value > 0.0) {
            return Some(format!("{what} of the default experiment = {value} s, a number above 0 was expected"));
        }
    }
    // An XML reader turns line breaks into blanks and refuses other control characters.
    let is_plain = |text: &str| !text.contains(char::is_control);
    let (mut names, mut units, mut types) = (BTreeSet::new(), BTreeMap::new(), BTreeMap::new());
    for variable in &layout.variables {
        let declaration = &variable.declaration;
        let name = &declaration.name;
        if !names.insert(name) {
            return Some(format!("two variables are named '{name}'"));
        }
        if declaration.description.is_empty() || !is_plain(&declaration.description) {
            return Some(format!("'{name}' has no description, or one with control characters"));
        }
        match &declaration.kind {
            Kind::Real(real) => {
                if *units.entry(real.unit.name).or_insert(real.unit) != real.unit {
                    return Some(format!("'{name}': there is another unit of the name {}", real.unit.name));
                }
                if [real.min, real.max, real.nominal].into_iter().flatten().any(|value| !value.is_finite()) {
                    return Some(format!("'{name}': a limit or the nominal value is not a finite number"));
                }
                if real.nominal.is_some_and(|nominal| nominal <= 0.0) {
                    return Some(format!("'{name}': the nominal value is not above 0"));
                }
                let (min, max) = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
                if !real.start.is_finite() || !(min..=max).contains(&real.start) {
                    return Some(format!("start of '{name}' = {} is not within [{min}, {max}]", real.start));
                }
                if let Some(display) = real.display
                    && real.unit.display_unit(display).is_none()
                {
                    return Some(format!("'{name}': {} cannot be displayed in {display}", real.unit.name));
                }
            }
            Kind::Integer { start, min, max, choices, type_name } => {
                if !(min..=max).contains(&start) {
                    return Some(format!("start of '{name}' = {start} is not within [{min}, {max}]"));
                }
                if !choices.is_empty() && *types.entry(*type_name).or_insert(*choices) != *choices {
                    return Some(format!("'{name}': there is another mode of the name {type_name}"));
                }
            }
            Kind::String { start } if !is_plain(start) => {
                return Some(format!("start of '{name}' has control characters"));
            }
            _ => {}
        }
    }
    None
}

/// What every output and derivative of a plant depends on, over all values of all modes and switches.
fn structure<M: Model>(layout: &Layout) -> Result<Vec<Dependencies>, String> {
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
    let known = layout.inputs.len() + layout.states.len();
    if known > Dependencies::CAPACITY {
        return Err(format!("{known} inputs and states, at most {} were expected", Dependencies::CAPACITY));
    }
    let mut union = vec![Dependencies::default(); layout.outputs.len() + layout.states.len()];
    let mut failure = None;
    let mut has_design = false;
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
        match M::load(&p, std::path::Path::new("")) {
            Ok(d) => {
                has_design = true;
                for (sum, set) in union.iter_mut().zip(M::dependencies(&p, &d)) {
                    *sum = sum.union(set);
                }
            }
            // A combination without a design cannot be simulated, so it adds nothing.
            Err(message) => failure = Some(message),
        }
    }
    match failure {
        Some(message) if !has_design => Err(format!("no design for the start values of the parameters: {message}")),
        _ => Ok(union),
    }
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

/// How an empty GUID is written.
const NO_GUID: &str = "guid=\"\"";

/// modelDescription.xml with an empty GUID.
fn xml<M: Model>(layout: &Layout, structure: &[Dependencies]) -> std::io::Result<Vec<u8>> {
    let info = &M::INFO;
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let tool = concat!("fmi2 ", env!("CARGO_PKG_VERSION"), " (Chassis FMU)");
    xml.create_element("fmiModelDescription")
        .with_attributes([
            ("fmiVersion", "2.0"),
            ("modelName", info.name),
            ("guid", ""),
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
            if M::IS_PLANT {
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
                layout.variables.iter().try_for_each(|variable| scalar_variable::<M>(xml, layout, variable))
            })?;
            model_structure::<M>(xml, layout, structure)
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
            Kind::Real(real) if real.unit.is_declared() => Some((real.unit.name, real.unit)),
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

fn scalar_variable<M: Model>(xml: &mut Xml, layout: &Layout, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let (causality, variability, initial) = match variable.role {
        Role::Parameter => ("parameter", if declaration.tunable { "tunable" } else { "fixed" }, Some("exact")),
        Role::Calculated => ("calculatedParameter", "fixed", Some("calculated")),
        Role::Input => ("input", "continuous", None),
        Role::Output => (
            "output",
            if M::IS_PLANT { "continuous" } else { "discrete" },
            Some(if M::CALCULATES_OUTPUTS { "calculated" } else { "exact" }),
        ),
        Role::State => (
            if declaration.local { "local" } else { "output" },
            "continuous",
            Some(if declaration.calculated { "calculated" } else { "exact" }),
        ),
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
                let mut element = xml.create_element("Real");
                if real.unit.is_declared() {
                    element = element.with_attribute(("unit", real.unit.name));
                }
                if let Some(display) = real.display {
                    element = element.with_attribute(("displayUnit", display));
                }
                // 1 is the default, which only a state states: solvers look there.
                let nominal = real.nominal.filter(|&nominal| nominal != 1.0 || variable.role == Role::State);
                for (name, value) in [("min", real.min), ("max", real.max), ("nominal", nominal)] {
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

fn model_structure<M: Model>(xml: &mut Xml, layout: &Layout, structure: &[Dependencies]) -> Written {
    let with_role = |role: Role| layout.variables.iter().filter(move |variable| variable.role == role);
    let index = |variable: &Variable| layout.structure_index(variable.reference);
    // Known variables in the order in which `Dependencies` numbers them.
    let known: Vec<usize> = with_role(Role::Input).chain(with_role(Role::State)).map(index).collect();
    let depends = |variable: &Variable| -> Vec<usize> {
        let set = match variable.role {
            Role::Output if M::IS_PLANT => structure[variable.index - layout.outputs.start],
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
        // At the start everything may also depend on any parameter; calculated ones on the fixed parameters only, the
        // outputs of a source on those it names.
        let can_follow = |v: &Variable, parameter: &Variable| match (v.role, M::SOURCE) {
            (Role::Calculated | Role::State, _) => !parameter.declaration.tunable,
            (_, Some(influence)) => influence(&v.declaration.name, &parameter.declaration.name),
            _ => true,
        };
        let mut initial: Vec<_> = layout
            .variables
            .iter()
            .filter(|v| match v.role {
                Role::Calculated | Role::Derivative => true,
                Role::State => v.declaration.calculated,
                Role::Output => M::CALCULATES_OUTPUTS,
                _ => false,
            })
            .collect();
        initial.sort_by_key(|v| index(v));
        if !initial.is_empty() {
            xml.create_element("InitialUnknowns").write_inner_content(|xml| {
                initial.iter().try_for_each(|v| {
                    let mut all: Vec<_> =
                        with_role(Role::Parameter).filter(|parameter| can_follow(v, parameter)).map(index).collect();
                    // A state that is calculated itself is unknown at the start; it follows from the parameters.
                    all.extend(depends(v).into_iter().filter(|&i| !layout.variables[i - 1].declaration.calculated));
                    unknown(xml, v, all)
                })
            })?;
        }
        Ok(())
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::Choice;
    use crate::declare::{Spec, other};
    use crate::unit::{M, ONE, S};
    use crate::variable::Declaration;

    const INFO: Info = Info { name: "Name", description: "D", version: "1", stop_time: 1.0, step_size: 0.1 };
    const CHOICES: &[Choice] = &[Choice { value: 0, name: "off", description: "Off" }];

    fn real(spec: Spec) -> Vec<Declaration> {
        let mut all = Vec::new();
        spec.doc("D").declare::<f64, f64>(&mut all);
        all
    }

    fn plain(kind: Kind) -> Vec<Declaration> {
        let mut all = Vec::new();
        other(&mut all, "x", "D", false, kind);
        all
    }

    fn mode(type_name: &'static str, choices: &'static [Choice]) -> Kind {
        Kind::Integer { start: 0, min: 0, max: 1, type_name, choices }
    }

    fn problem(parameters: Vec<Declaration>) -> String {
        contradiction(&INFO, &Layout::new(parameters, vec![], vec![], vec![], vec![])).unwrap_or_default()
    }

    #[test]
    fn contradicting_declarations_are_named() {
        let x = || Spec::named("x", M);
        assert_eq!(problem(real(x().min(-1.0).max(1.0).nominal(0.5))), "");
        assert_eq!(problem([real(x()), real(x())].concat()), "two variables are named 'x'");
        assert_eq!(problem(real(x().start(2.0).max(1.0))), "start of 'x' = 2 is not within [-inf, 1]");
        assert_eq!(problem(real(x().start(f64::NAN))), "start of 'x' = NaN is not within [-inf, inf]");
        assert_eq!(problem(real(x().positive())), "start of 'x' = 0 is not within [0.000001, inf]");
        assert_eq!(problem(real(x().display("deg"))), "'x': m cannot be displayed in deg");
        for spec in [x().max(f64::INFINITY), x().min(f64::NEG_INFINITY), x().nominal(f64::NAN)] {
            assert_eq!(problem(real(spec)), "'x': a limit or the nominal value is not a finite number");
        }
        assert_eq!(problem(real(x().nominal(0.0))), "'x': the nominal value is not above 0");
        assert_eq!(
            problem([real(x()), real(Spec::named("y", Unit { name: "m", ..S }))].concat()),
            "'y': there is another unit of the name m"
        );
        let mut other_mode = plain(mode("Law", CHOICES));
        other_mode[0].name = "y".to_owned();
        const OTHERS: &[Choice] = &[Choice { value: 0, name: "on", description: "On" }];
        assert_eq!(
            problem([other_mode, plain(mode("Law", OTHERS))].concat()),
            "'x': there is another mode of the name Law"
        );
        let number = Kind::Integer { start: 3, min: 0, max: 2, type_name: "", choices: &[] };
        assert_eq!(problem(plain(number)), "start of 'x' = 3 is not within [0, 2]");
        for start in ["two\nlines", "\0"] {
            let text = Kind::String { start: start.to_owned() };
            assert_eq!(problem(plain(text)), "start of 'x' has control characters");
        }
        for words in ["", "a\u{1}b"] {
            let mut all = plain(Kind::Boolean { start: true });
            all[0].description = words.to_owned();
            assert_eq!(problem(all), "'x' has no description, or one with control characters");
        }
    }

    #[test]
    fn an_impossible_default_experiment_or_name_is_named() {
        let nothing = Layout::new(vec![], vec![], vec![], vec![], vec![]);
        for name in ["", "1st", "with-dash", "a b", "\u{e4}"] {
            assert!(contradiction(&Info { name, ..INFO }, &nothing).unwrap().contains("identifier"), "{name}");
        }
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(contradiction(&Info { stop_time: value, ..INFO }, &nothing).unwrap().starts_with("stop_time"));
            assert!(contradiction(&Info { step_size: value, ..INFO }, &nothing).unwrap().starts_with("step_size"));
        }
    }

    #[test]
    fn positive_keeps_a_greater_least_value() {
        let least = |spec: Spec| match &real(spec.start(3.0))[0].kind {
            Kind::Real(real) => real.min,
            _ => None,
        };
        assert_eq!(least(Spec::named("x", ONE).min(2.0).positive()), Some(2.0));
        assert_eq!(least(Spec::named("x", ONE).min(-2.0).positive()), Some(1e-6));
        assert_eq!(least(Spec::named("x", ONE).positive()), Some(1e-6));
    }
}
