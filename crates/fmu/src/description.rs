//! The model description: modelDescription.xml, generated from the declarations.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};

use crate::calls::{Interfaces, Version};
use crate::model::Info;
use crate::runner::{Kind as ModelKind, Model};
use crate::scalar::DependencySet;
use crate::store::ValueStore;
use crate::unit::{DisplayUnit, Unit};
use crate::variable::{Kind, Layout, Role, Variable};

/// Category of messages about rejected calls and failed steps; always logged.
pub const LOG_ERROR: &str = "logStatusError";
/// Category of messages about information that does not exist.
pub const LOG_DISCARD: &str = "logStatusDiscard";
/// Category of messages about the life of the instance.
pub const LOG_EVENTS: &str = "logEvents";

/// The log categories with their descriptions.
pub const LOG_CATEGORIES: [(&str, &str); 3] = [
    (LOG_ERROR, "Rejected calls and failed steps: what, where, and the rule (always logged)"),
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
    /// Describes the model `M`; `resources` is the folder that [`crate::Continuous::load`] reads.
    ///
    /// # Panics
    /// When the declarations contradict each other (two variables of one name, a start value outside its limits), or
    /// a model has no derived parameters for any value of its Booleans and enumerations; the test that
    /// [`model`](macro@crate::model) adds to the package finds that.
    pub fn of<M: Model>(version: Version, interfaces: Interfaces, resources: &Path) -> Self {
        Self::try_of::<M>(version, interfaces, resources).unwrap_or_else(|problem| panic!("{problem}"))
    }

    /// As [`Self::of`].
    ///
    /// # Errors
    /// What is wrong with the declarations.
    pub fn try_of<M: Model>(version: Version, interfaces: Interfaces, resources: &Path) -> Result<Self, String> {
        let mut layout = M::layout();
        let interfaces = Interfaces { model_exchange: interfaces.model_exchange && M::MODEL_EXCHANGE, ..interfaces };
        let structure = match contradiction(&M::INFO, &layout) {
            Some(problem) => Err(problem),
            None if interfaces == Interfaces::NONE => {
                Err("a stateful model has no model exchange; pack it with the interface cs".to_owned())
            }
            None if M::KIND == ModelKind::Continuous => structure::<M>(&layout, resources),
            None => Ok(Structure::default()),
        }
        .map_err(|problem| format!("{}: {problem}", M::INFO.name))?;
        layout.indicators.relations = structure.relations;
        assert_eq!(version, Version::Fmi2);
        let xml = xml::<M>(&layout, interfaces, &structure.dependencies).expect("writing to memory does not fail");
        let xml = String::from_utf8(xml).expect("all texts are UTF-8");
        // The GUID is the hash of the description with an empty one, which is the first: it stands in the first element.
        let hash = uuid::Uuid::new_v5(&uuid::Uuid::NAMESPACE_OID, xml.as_bytes());
        let guid = format!("{{{hash}}}");
        let xml = xml.replacen(NO_GUID, &format!("guid=\"{guid}\""), 1);
        Ok(Self { layout, guid, xml })
    }

    /// What an instance needs, where the GUID and the number of event indicators are known: see [`crate::abi::Export::GUID`].
    pub fn packed<M: Model>(guid: &str, indicators: usize) -> Self {
        let mut layout = M::layout();
        layout.indicators.relations = indicators.saturating_sub(layout.indicators.declared);
        Self { layout, guid: guid.to_owned(), xml: String::new() }
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
            return Some(format!("{what} of the default experiment must be above 0, got {value} s"));
        }
    }
    // An XML reader turns line breaks into blanks and rejects other control characters.
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
                let definition = |unit: Unit| (unit.exponents, unit.factor, unit.offset);
                let known = units.entry(real.unit.name).or_insert(real.unit);
                if definition(*known) != definition(real.unit) {
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
                if let Some(display) = real.display.filter(|display| !display.factor.is_finite()) {
                    return Some(format!("'{name}': {} cannot be displayed in {}", real.unit.name, display.name));
                }
            }
            Kind::Integer { start, min, max, items, type_name, is_enumeration } => {
                if !(min..=max).contains(&start) {
                    return Some(format!("start of '{name}' = {start} is not within [{min}, {max}]"));
                }
                let key = simple_type(layout, type_name, *is_enumeration);
                if !items.is_empty() && *types.entry(key).or_insert(*items) != *items {
                    return Some(format!("'{name}': there is another enumeration of the name {type_name}"));
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

/// The most combinations of Booleans, enumerations and bounded Integers that are tried.
const MOST_COMBINATIONS: usize = 4096;

/// The most values of an Integer that are tried.
const MOST_VALUES: i64 = 64;

/// What the equations say about themselves.
#[derive(Default)]
struct Structure {
    /// What each real output, then each derivative depends on.
    dependencies: Vec<DependencySet>,
    /// The most relations.
    relations: usize,
}

/// Dependencies and relations over all values of all Booleans, enumerations and bounded Integers.
fn structure<M: Model>(layout: &Layout, resources: &Path) -> Result<Structure, String> {
    let mut values = ValueStore::start(layout);
    let known = layout.inputs.counts.reals + layout.states.counts.reals;
    let unknown = layout.outputs.counts.reals + layout.states.counts.reals;
    // Variables that equations may branch on, with their values.
    let mut branches: Vec<(bool, usize, Vec<i32>)> = Vec::new();
    let mut is_open = false;
    for variable in layout.variables.iter().filter(|v| matches!(v.role, Role::Parameter | Role::Input)) {
        match &variable.declaration.kind {
            Kind::Real(_) => {}
            Kind::Integer { items, .. } if !items.is_empty() => {
                branches.push((true, variable.index, items.iter().map(|item| item.value).collect()));
            }
            Kind::Integer { min, max, .. } if i64::from(*max) - i64::from(*min) < MOST_VALUES => {
                branches.push((true, variable.index, (*min..=*max).collect()));
            }
            Kind::Boolean { .. } => branches.push((false, variable.index, vec![0, 1])),
            // Too many values to try: anything may depend on them, and on everything else through them.
            Kind::Integer { .. } | Kind::String { .. } => is_open = true,
        }
    }
    let combinations = branches.iter().try_fold(1_usize, |all, (_, _, values)| all.checked_mul(values.len()));
    let combinations = combinations.filter(|&all| all <= MOST_COMBINATIONS);
    is_open |= combinations.is_none();
    let mut union = vec![DependencySet::default(); unknown];
    if is_open {
        union.iter_mut().for_each(|set| (0..known).for_each(|index| set.insert(index)));
    }
    let mut relations = 0;
    let mut failure = None;
    let mut has_derived = false;
    for combination in 0..combinations.unwrap_or(1) {
        let mut rest = combination;
        for (is_integer, index, options) in &branches {
            let value = options[rest % options.len()];
            rest /= options.len();
            if *is_integer {
                values.integers[*index] = value;
            } else {
                values.booleans[*index] = value != 0;
            }
        }
        let p = values.parameters::<M>();
        let begun = M::load(&p, resources).and_then(|derived| {
            let mut values = values.clone();
            M::initialize(&p, &derived, layout, &mut values);
            let memory = M::begin(&p, &derived, resources, layout, &values, 0.0)?;
            Ok((derived, memory))
        });
        match begun {
            Ok((derived, memory)) => {
                has_derived = true;
                relations = relations.max(M::count_relations(&p, &derived, &memory, layout, &values));
                if !is_open {
                    let sets = M::dependencies(&p, &derived, &memory, layout, &values);
                    union.iter_mut().zip(sets).for_each(|(sum, set)| sum.extend(&set));
                }
            }
            // A combination without derived parameters cannot be simulated, so it adds nothing.
            Err(message) => failure = Some(message),
        }
    }
    match failure {
        Some(message) if !has_derived => Err(format!("the start values of the parameters do not work: {message}")),
        _ => Ok(Structure { dependencies: union, relations }),
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
fn xml<M: Model>(layout: &Layout, interfaces: Interfaces, structure: &[DependencySet]) -> std::io::Result<Vec<u8>> {
    let info = &M::INFO;
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let tool = concat!("fmu ", env!("CARGO_PKG_VERSION"), " (Rust)");
    let indicators = layout.indicators.total().to_string();
    let authors = info.authors.replace(':', ", ");
    let facts = [
        ("fmiVersion", "2.0"),
        ("modelName", info.name),
        ("guid", ""),
        ("description", info.description),
        ("author", authors.as_str()),
        ("version", info.version),
        ("license", info.license),
        ("generationTool", tool),
        ("variableNamingConvention", "structured"),
        ("numberOfEventIndicators", if interfaces.model_exchange { indicators.as_str() } else { "" }),
    ];
    // A manifest need not name authors or a license.
    let facts = facts.into_iter().filter(|(key, value)| *key == "guid" || !value.is_empty());
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
    let mut units: BTreeMap<&str, (Unit, Vec<DisplayUnit>)> = BTreeMap::new();
    for variable in &layout.variables {
        let Kind::Real(real) = &variable.declaration.kind else { continue };
        if real.unit.is_declared() {
            let (_, display) = units.entry(real.unit.name).or_insert_with(|| (real.unit, Vec::new()));
            for one in real.unit.display.iter().copied().chain(real.display) {
                if !display.iter().any(|known| known.name == one.name) {
                    display.push(one);
                }
            }
        }
    }
    if units.is_empty() {
        return Ok(());
    }
    xml.create_element("UnitDefinitions").write_inner_content(|xml| {
        for (unit, display) in units.values() {
            xml.create_element("Unit").with_attribute(("name", unit.name)).write_inner_content(|xml| {
                let mut base = xml.create_element("BaseUnit");
                for (name, exponent) in ["kg", "m", "s", "A", "K", "mol", "cd", "rad"].into_iter().zip(unit.exponents) {
                    if exponent != 0 {
                        base = base.with_attribute((name, exponent.to_string().as_str()));
                    }
                }
                if unit.factor != 1.0 {
                    base = base.with_attribute(("factor", number(unit.factor).as_str()));
                }
                if unit.offset != 0.0 {
                    base = base.with_attribute(("offset", number(unit.offset).as_str()));
                }
                base.write_empty()?;
                for display in display {
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

/// Types of the enumerations. Most are Integers, because several masters cannot set FMI enumerations; their description says
/// what the numbers mean.
/// Name of the type of an enumeration. One that is an Integer too has two types.
fn simple_type(layout: &Layout, name: &str, is_enumeration: bool) -> String {
    let is_integer = |variable: &Variable| matches!(&variable.declaration.kind, Kind::Integer { type_name, is_enumeration: false, .. } if *type_name == name);
    let is_both = is_enumeration && layout.variables.iter().any(is_integer);
    if is_both { format!("{name}Enumeration") } else { name.to_owned() }
}

fn type_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    let mut types = BTreeMap::new();
    for variable in &layout.variables {
        if let Kind::Integer { items, type_name, min, max, is_enumeration, .. } = &variable.declaration.kind
            && !items.is_empty()
        {
            types.insert(simple_type(layout, type_name, *is_enumeration), (*items, *min, *max, *is_enumeration));
        }
    }
    if types.is_empty() {
        return Ok(());
    }
    xml.create_element("TypeDefinitions").write_inner_content(|xml| {
        for (name, (items, min, max, is_enumeration)) in types {
            let description = items
                .iter()
                .map(|item| format!("{} {}: {}", item.value, item.name, item.description))
                .collect::<Vec<_>>()
                .join("; ");
            xml.create_element("SimpleType")
                .with_attributes([("name", name.as_str()), ("description", description.as_str())])
                .write_inner_content(|xml| {
                    if !is_enumeration {
                        xml.create_element("Integer")
                            .with_attributes([("min", min.to_string().as_str()), ("max", max.to_string().as_str())])
                            .write_empty()?;
                        return Ok(());
                    }
                    xml.create_element("Enumeration").write_inner_content(|xml| {
                        for item in items {
                            xml.create_element("Item")
                                .with_attributes([
                                    ("name", item.name),
                                    ("value", item.value.to_string().as_str()),
                                    ("description", item.description),
                                ])
                                .write_empty()?;
                        }
                        Ok(())
                    })?;
                    Ok(())
                })?;
        }
        Ok(())
    })?;
    Ok(())
}

fn scalar_variable<M: Model>(xml: &mut Xml, layout: &Layout, variable: &Variable) -> Written {
    let declaration = &variable.declaration;
    let is_real = matches!(declaration.kind, Kind::Real(_));
    let (causality, variability, initial) = match variable.role {
        Role::Parameter => ("parameter", if declaration.tunable { "tunable" } else { "fixed" }, Some("exact")),
        Role::Calculated => ("calculatedParameter", "fixed", Some("calculated")),
        Role::Input => ("input", if is_real { "continuous" } else { "discrete" }, None),
        Role::Output => (
            "output",
            if M::KIND == ModelKind::Continuous && is_real { "continuous" } else { "discrete" },
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
                    element = element.with_attribute(("displayUnit", display.name));
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

fn model_structure<M: Model>(xml: &mut Xml, layout: &Layout, structure: &[DependencySet]) -> Written {
    let with_role = |role: Role| layout.variables.iter().filter(move |variable| variable.role == role);
    let index = |variable: &Variable| layout.structure_index(variable.reference);
    let is_real = |variable: &&Variable| matches!(variable.declaration.kind, Kind::Real(_));
    // Known real variables in the order in which `DependencySet` numbers them; what depends on the others is not known.
    let known: Vec<usize> = with_role(Role::Input).filter(is_real).chain(with_role(Role::State)).map(index).collect();
    let others: Vec<usize> = with_role(Role::Input).filter(|variable| !is_real(variable)).map(index).collect();
    let depends = |variable: &Variable| -> Vec<usize> {
        let everything = || known.iter().chain(&others).copied().collect::<Vec<_>>();
        let set = match (variable.role, M::KIND) {
            (Role::Output, ModelKind::Continuous) if is_real(&variable) => {
                &structure[variable.index - layout.outputs.at.reals]
            }
            (Role::Output, ModelKind::Continuous) => {
                let mut indices = everything();
                indices.sort_unstable();
                return indices;
            }
            (Role::Derivative, _) => {
                &structure[layout.outputs.counts.reals + variable.index - layout.derivatives.at.reals]
            }
            // Outputs of other models are held; an output that is a state is known itself.
            _ => return Vec::new(),
        };
        let mut indices: Vec<_> =
            known.iter().enumerate().filter(|&(i, _)| set.contains(i)).map(|(_, &index)| index).collect();
        indices.extend(&others);
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
        if layout.derivatives.counts.reals > 0 {
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
    use crate::declare::Spec;
    use crate::enumeration::Item;
    use crate::unit;
    use crate::variable::{Declaration, Declarations};

    const INFO: Info = Info {
        name: "Name",
        description: "D",
        version: "1",
        authors: "",
        license: "",
        homepage: "",
        stop_time: 1.0,
        step_size: 0.1,
    };
    const ITEMS: &[Item] = &[Item { value: 0, name: "off", description: "Off" }];

    fn real(spec: Spec, start: f64) -> Vec<Declaration> {
        let mut all = Vec::new();
        spec.doc("D").declare_real(Some(start), &mut all);
        all
    }

    fn plain(kind: Kind) -> Vec<Declaration> {
        let (name, description) = ("x".to_owned(), "D".to_owned());
        vec![Declaration { name, description, tunable: false, local: false, calculated: false, kind }]
    }

    fn enumeration(type_name: &'static str, items: &'static [Item]) -> Kind {
        Kind::Integer { start: 0, min: 0, max: 1, type_name, items, is_enumeration: false }
    }

    fn problem(parameters: Vec<Declaration>) -> String {
        contradiction(&INFO, &Layout::new(Declarations { parameters, ..Declarations::default() })).unwrap_or_default()
    }

    #[test]
    fn contradicting_declarations_are_named() {
        let x = || Spec::named("x").unit(unit!("m"));
        assert_eq!(problem(real(x().min(-1.0).max(1.0).nominal(0.5), 0.0)), "");
        assert_eq!(problem([real(x(), 0.0), real(x(), 0.0)].concat()), "two variables are named 'x'");
        assert_eq!(problem(real(x().max(1.0), 2.0)), "start of 'x' = 2 is not within [-inf, 1]");
        assert_eq!(problem(real(x(), f64::NAN)), "start of 'x' = NaN is not within [-inf, inf]");
        assert_eq!(problem(real(x().positive(), 0.0)), "start of 'x' = 0 is not within [0.000001, inf]");
        assert_eq!(problem(real(x().display_named("deg"), 0.0)), "'x': m cannot be displayed in deg");
        for spec in [x().max(f64::INFINITY), x().min(f64::NEG_INFINITY), x().nominal(f64::NAN)] {
            assert_eq!(problem(real(spec, 0.0)), "'x': a limit or the nominal value is not a finite number");
        }
        assert_eq!(problem(real(x().nominal(0.0), 0.0)), "'x': the nominal value is not above 0");
        assert_eq!(
            problem([real(x(), 0.0), real(Spec::named("y").unit(Unit { name: "m", ..Unit::S }), 0.0)].concat()),
            "'y': there is another unit of the name m"
        );
        let mut other_mode = plain(enumeration("Law", ITEMS));
        other_mode[0].name = "y".to_owned();
        const OTHERS: &[Item] = &[Item { value: 0, name: "on", description: "On" }];
        assert_eq!(
            problem([other_mode, plain(enumeration("Law", OTHERS))].concat()),
            "'x': there is another enumeration of the name Law"
        );
        let number = Kind::Integer { start: 3, min: 0, max: 2, type_name: "", items: &[], is_enumeration: false };
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
        let nothing = Layout::new(Declarations::default());
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
        let least = |spec: Spec| match &real(spec, 3.0)[0].kind {
            Kind::Real(real) => real.min,
            _ => None,
        };
        assert_eq!(least(Spec::named("x").unit(unit!("1")).min(2.0).positive()), Some(2.0));
        assert_eq!(least(Spec::named("x").unit(unit!("1")).min(-2.0).positive()), Some(1e-6));
        assert_eq!(least(Spec::named("x").unit(unit!("1")).positive()), Some(1e-6));
    }
}
