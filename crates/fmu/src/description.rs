//! The model description: modelDescription.xml, generated from the declarations.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

mod fmi2;
mod fmi3;
mod structure;
mod terminals;
mod xml;

use self::structure::{Structure, Unknowns, structure};
use self::xml::{is_xml, simple_type, with_references};
use crate::calls::{Interfaces, Version};
use crate::clocks::{self, InputClock, Interval, Timing};
use crate::model::Info;
use crate::number::Size;
use crate::runner::{Kind as ModelKind, Model};
use crate::store::Length;
use crate::unit::Unit;
use crate::variable::{Declaration, Kind, Layout, Role, Variable};

/// Category of messages about rejected calls and failed steps; always logged.
pub const LOG_ERROR: &str = "logStatusError";
/// Category of messages about information that does not exist.
pub const LOG_DISCARD: &str = "logStatusDiscard";
/// Category of messages about initialization, termination, reset and restored states.
pub const LOG_EVENTS: &str = "logEvents";

/// The log categories with their descriptions.
pub const LOG_CATEGORIES: [(&str, &str); 3] = [
    (LOG_ERROR, "Rejected calls and failed steps: what, where, and the rule (always logged)"),
    (LOG_DISCARD, "Questions that have no answer"),
    (LOG_EVENTS, "Initialization, termination, reset and restored states"),
];

/// Format of a packed FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Version of the standard.
    pub version: Version,
    /// Requested interfaces; the model may have only some of them.
    pub interfaces: Interfaces,
    /// True if arrays of the model are variables with dimensions (FMI 3.0) instead of one variable for each element.
    pub arrays: bool,
}

impl Format {
    /// FMI 2.0 with all interfaces of the model.
    pub const FMI2: Self = Self { version: Version::Fmi2, interfaces: Interfaces::ALL, arrays: false };
    /// FMI 3.0 with all interfaces of the model.
    pub const FMI3: Self = Self { version: Version::Fmi3, ..Self::FMI2 };
}

/// Data of a model that all its instances share.
#[derive(Debug)]
pub struct Description {
    /// All variables.
    pub layout: Layout,
    /// Hash of the description.
    pub guid: String,
    /// modelDescription.xml; empty in a packed library.
    pub xml: String,
    /// Reasons why the model structure lists too many dependencies, each with the remedy; empty in a packed library.
    pub notes: Vec<String>,
    /// With native arrays, the number of values for each value reference; otherwise empty.
    pub(crate) lengths: Vec<u32>,
    /// Dependencies in FMI 3.0: see [`structure::table`].
    pub(crate) dependencies: Cow<'static, str>,
}

/// A dependency of an element of a variable. Elements are numbered from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dependency {
    /// Element of the dependent variable.
    pub element: usize,
    /// Value reference of the variable on which it depends.
    pub on: u32,
    /// Element of this variable.
    pub element_of: usize,
}

impl Description {
    /// Describes the model `M`; `resources` is the folder that [`crate::Continuous::load`] reads. Panics if the
    /// declarations are inconsistent (two variables with the same name, a start value outside its limits), or if the
    /// derived parameters cannot be computed, whatever the values of Booleans and enumerations. The test that
    /// [`model`](macro@crate::model) adds to the package detects these errors.
    pub fn of<M: Model>(format: Format, resources: &Path) -> Self {
        Self::consistent::<M>(format, resources).unwrap_or_else(|problem| panic!("{problem}"))
    }

    /// Like [`Self::of`], but returns an error instead of panicking. Also fails if the FMI version cannot express a
    /// variable.
    pub fn try_of<M: Model>(format: Format, resources: &Path) -> Result<Self, String> {
        // A model that gives some of its clocks a priority would lose scheduled execution without a word.
        let is_scheduled = M::CLOCKS.iter().any(|clock| clock.priority.is_some())
            || format.version == Version::Fmi3 && format.interfaces.scheduled_execution;
        let is_unordered = |clock: &&InputClock| M::KIND == ModelKind::Discrete && clock.priority.is_none();
        let mut unordered = M::CLOCKS.iter().filter(|clock| is_scheduled && is_unordered(clock));
        let without_priority = unordered.next().map(|InputClock { name, .. }| {
            format!("scheduled execution needs the `priority` of every clock: add it to the clock '{name}'")
        });
        match without_priority.or_else(|| inexpressible(&M::layout(), format)) {
            Some(problem) => Err(format!("{}: {problem}", M::INFO.name)),
            None => Self::consistent::<M>(format, resources),
        }
    }

    fn consistent<M: Model>(format: Format, resources: &Path) -> Result<Self, String> {
        let mut layout = M::layout();
        let Format { version, interfaces, .. } = format;
        let is_scheduled = M::SCHEDULED_EXECUTION && version == Version::Fmi3;
        let interfaces = Interfaces {
            // FMI 2.0 has no clocks.
            model_exchange: interfaces.model_exchange
                && M::MODEL_EXCHANGE
                && !(M::HAS_CLOCKS && version == Version::Fmi2),
            scheduled_execution: interfaces.scheduled_execution && is_scheduled,
            ..interfaces
        };
        let format = Format { interfaces, ..format };
        let structure = match contradiction(&M::INFO, &layout, format, M::CALCULATES_OUTPUTS)
            .or_else(|| misplaced(M::KIND, &layout))
        {
            Some(problem) => Err(problem),
            None if interfaces == Interfaces::NONE => {
                let (what, others) = match (M::HAS_CLOCKS, M::MODEL_EXCHANGE) {
                    (true, _) if version == Version::Fmi2 => ("a model with clocks", "only co-simulation in FMI 2.0"),
                    (true, true) => ("a continuous-time model", "no scheduled execution"),
                    (true, _) => ("a discrete-time model with clocks", "no model exchange"),
                    (_, true) => ("a model without clocks", "no scheduled execution"),
                    _ => ("a stateful model", "no model exchange"),
                };
                Err(format!("{what} has {others}; pack it with the interface cs"))
            }
            None if M::KIND == ModelKind::Continuous => structure::<M>(&layout, resources, version),
            None => Ok(Structure::default()),
        }
        .map_err(|problem| format!("{}: {problem}", M::INFO.name))?;
        layout.indicators.relations = structure.relations;
        let unknowns = Unknowns::of::<M>(&layout, &structure).in_version(version);
        let write = match version {
            Version::Fmi2 => fmi2::write::<M>,
            Version::Fmi3 => fmi3::write::<M>,
        };
        let xml = write(&layout.in_version(version), format, &unknowns).expect("writing to memory does not fail");
        let xml = with_references(std::str::from_utf8(&xml).expect("all texts are UTF-8"));
        // The GUID is the hash of the description with an empty GUID. The first match is the GUID's attribute, because
        // it is in the root element.
        let hash = uuid::Uuid::new_v5(&uuid::Uuid::NAMESPACE_OID, xml.as_bytes());
        let guid = format!("{{{hash}}}");
        let name = if version == Version::Fmi2 { "guid" } else { "instantiationToken" };
        let xml = xml.replacen(&format!("{name}=\"\""), &format!("{name}=\"{guid}\""), 1);
        let dependencies = match version {
            Version::Fmi2 => "".into(),
            Version::Fmi3 => structure::table(&layout, &unknowns, format).into(),
        };
        Ok(Self { lengths: lengths(&layout, format), layout, guid, xml, notes: structure.notes, dependencies })
    }

    /// Dependencies of a variable of FMI 3.0, element by element, at the start or after it. They are those of the model
    /// structure: independent of the present values. `None` if there is no variable with this value reference.
    /// `lengths` are the present lengths of arrays.
    pub(crate) fn dependencies_of(
        &self,
        reference: u32,
        at_start: bool,
        lengths: &[Length],
    ) -> Option<Vec<Dependency>> {
        // The first element of the array, for each value reference.
        let mut firsts: Vec<u32> = Vec::new();
        while let Some(&length) = self.lengths.get(firsts.len()) {
            firsts.extend(std::iter::repeat_n(firsts.len() as u32, length as usize));
        }
        let first = |reference: u32| firsts.get(reference as usize).copied().unwrap_or(reference);
        let length = self.lengths.get(reference as usize).copied().unwrap_or(1) as usize;
        let mut lines = self.dependencies.split('\n').skip(reference as usize).take(length).peekable();
        lines.peek().filter(|_| first(reference) == reference)?;
        // Number of the element at a position in memory, from 1; `None` if the array is shorter at present.
        let number = |reference: u32, position: usize| match self.layout.sized_array(reference) {
            Some(array) => array.elements(lengths).position(|present| present == position).map(|number| number + 1),
            None => Some(position + 1),
        };
        let mut all = Vec::new();
        for (position, line) in lines.enumerate() {
            let (list, adds_parameters) = match line.split_once(';') {
                Some((after_start, start)) => (if at_start { start } else { after_start }, false),
                None if line.is_empty() => return None,
                None => (line, at_start),
            };
            let Some(element) = number(reference, position) else { continue };
            let mut add = |on: u32| {
                if let Some(element_of) = number(first(on), (on - first(on)) as usize) {
                    all.push(Dependency { element, on: first(on), element_of });
                }
            };
            let mut ranges = list.split(' ').filter(|range| !range.is_empty());
            let mut range = if adds_parameters { Some("p") } else { ranges.next() };
            while let Some(text) = range {
                range = ranges.next();
                if text == "p" {
                    let is_shown = |v: &&Variable| v.role == Role::Parameter && v.is_in(Version::Fmi3);
                    let parameters = self.layout.variables.iter().filter(is_shown);
                    parameters.for_each(|parameter| add(parameter.reference));
                    continue;
                }
                let (first, last) = text.split_once('-').unwrap_or((text, text));
                (first.parse().ok()?..=last.parse().ok()?).for_each(&mut add);
            }
        }
        Some(all)
    }

    /// terminalsAndIcons.xml of FMI 3.0: a terminal for each element that arrays of inputs and outputs have in common,
    /// such as a wheel or an axle, and the terminals that nested structs declare.
    pub fn terminals(&self, format: Format) -> String {
        let xml = terminals::write(&self.layout.in_version(format.version), format);
        let xml = xml.expect("writing to memory does not fail");
        with_references(std::str::from_utf8(&xml).expect("all texts are UTF-8"))
    }

    /// Creates only the data that an instance needs, from the GUID, the number of event indicators and the dependencies
    /// that the packer built in: see [`crate::abi::Export::GUID`].
    pub fn packed<M: Model>(format: Format, guid: &str, indicators: usize, dependencies: &'static str) -> Self {
        let mut layout = M::layout();
        layout.indicators.relations = indicators.saturating_sub(layout.indicators.declared);
        Self {
            lengths: lengths(&layout, format),
            layout,
            guid: guid.to_owned(),
            xml: String::new(),
            notes: Vec::new(),
            dependencies: dependencies.into(),
        }
    }
}

/// With native arrays, the number of values for each value reference. An array has the reference of its first element.
fn lengths(layout: &Layout, format: Format) -> Vec<u32> {
    if !format.arrays {
        return Vec::new();
    }
    let mut lengths = vec![0; layout.end as usize];
    layout.representatives().iter().for_each(|&first| lengths[first as usize] += 1);
    lengths.iter().map(|&length| length.max(1)).collect()
}

/// Returns an error for the first variable that the FMI version cannot express, if any.
fn inexpressible(layout: &Layout, format: Format) -> Option<String> {
    let sized = layout.variables.iter().find(|variable| !variable.declaration.details.sizes.is_empty());
    if let Some(Declaration { array: Some(array), details, .. }) = sized.map(|found| &found.declaration)
        && !format.arrays
    {
        return Some(format!(
            "'{}' has the length {}, which only array variables can have: pack with --fmi 3 --arrays",
            array.name,
            details.sizes.join(" × ")
        ));
    }
    let range = Size::Int32.range();
    let is_shown = |variable: &&Variable| format.version == Version::Fmi2 && variable.is_in(Version::Fmi2);
    layout.variables.iter().filter(is_shown).find_map(|variable| {
        let name = &variable.declaration.name;
        if matches!(variable.declaration.kind, Kind::Binary { .. }) {
            return Some(format!(
                "'{name}' is a Binary, a type that FMI 2.0 does not have: pack with --fmi 3, or leave it out of FMI 2.0 with \
                 `#[var(fmi = 3)]`"
            ));
        }
        if let Kind::Clock(Some(InputClock { timing: Timing::Triggered, .. })) = variable.declaration.kind {
            return Some(format!(
                "'{name}' is a triggered clock, which nothing would activate in FMI 2.0: pack with --fmi 3"
            ));
        }
        let Kind::Integer { size, min, max, .. } = &variable.declaration.kind else { return None };
        let fits = range.contains(min) && range.contains(max);
        let (size, least, greatest) = (size.name(), range.start(), range.end());
        (!fits).then(|| {
            format!(
                "'{name}' of type {size} may have values that an Integer of FMI 2.0 (32 bits) cannot have: declare \
                 `min` and `max` within [{least}, {greatest}], pack with --fmi 3, or leave it out of FMI 2.0 with \
                 `#[var(fmi = 3)]`"
            )
        })
    })
}

/// Returns the first mistake in the declarations of clocks and clocked variables, if any.
fn mistaken_clock(layout: &Layout) -> Option<String> {
    let clocks: Vec<_> = layout.variables.iter().filter(|variable| variable.role == Role::Clock).collect();
    layout.variables.iter().find_map(|variable| {
        let name = &variable.declaration.name;
        let is_unknown = |of: &&&str| clocks.iter().all(|clock| clock.declaration.name != **of);
        if let Some(of) = variable.declaration.details.clocks.iter().find(is_unknown) {
            let known: Vec<_> = clocks.iter().map(|clock| &*clock.declaration.name).collect();
            return Some(format!(
                "'{name}': the model has no input clock '{of}'; a method with `#[clock(…)]` declares one (found: {})",
                if known.is_empty() { "none".to_owned() } else { known.join(", ") }
            ));
        }
        match variable.declaration.kind {
            Kind::Clock(None) if variable.role != Role::Output => {
                Some(format!("'{name}' cannot be a `Clock`: an input clock is a method with `#[clock(triggered)]`"))
            }
            Kind::Clock(None) if layout.output_clocks.len() > 128 => {
                Some(format!("a model can have at most 128 output clocks, got {}", layout.output_clocks.len()))
            }
            Kind::Clock(None) if clocks.is_empty() => {
                Some(format!("the clock '{name}' cannot tick: no method of the model has the attribute `#[clock(…)]`"))
            }
            Kind::Clock(Some(InputClock { timing, .. })) => match timing.interval() {
                Some(Interval::Of(parameter)) if clocks::parameter(layout, parameter).is_none() => {
                    Some(format!("the interval of the clock '{name}': the model has no real parameter '{parameter}'"))
                }
                _ if matches!(timing, Timing::Periodic { shift, .. } if !(shift.seconds() >= 0.0 && shift.seconds().is_finite())) => {
                    Some(format!("the shift of the clock '{name}' must be at least 0 s"))
                }
                Some(Interval::Constant(span)) if !(span.seconds() > 0.0 && span.seconds().is_finite()) => {
                    Some(format!("the interval of the clock '{name}' must be above 0 s, got {} s", span.seconds()))
                }
                _ => None,
            },
            _ => None,
        }
    })
}

/// Returns the first mistake in the declarations of structural parameters and of the arrays whose lengths they are, if any.
fn mistaken_size(layout: &Layout) -> Option<String> {
    let is_size = |name: &str| layout.variables.iter().any(|array| array.declaration.details.sizes.contains(&name));
    layout.variables.iter().find_map(|variable| {
        let Declaration { name, array, kind, details, .. } = &variable.declaration;
        match kind {
            Kind::Integer { start: 0, .. } if is_size(name) => {
                return Some(format!("start of '{name}' must be above 0, because it is the length of an array; got 0"));
            }
            _ if details.sizes.is_empty() => return None,
            _ => {}
        }
        let array = array.as_ref()?;
        let name = &array.name;
        for (size, most) in details.sizes.iter().zip(&array.dimensions) {
            let parameter = layout.by_name(size).filter(|v| v.role == Role::Parameter && v.declaration.is_length());
            let Some(Declaration { kind: Kind::Integer { max, .. }, .. }) = parameter.map(|found| &found.declaration)
            else {
                return Some(format!(
                    "the length '{size}' of '{name}' must be a parameter of type `u64` with `structural`"
                ));
            };
            if *max != *most as i128 {
                return Some(format!(
                    "'{name}' has room for {most} elements, so `max` of '{size}' must be {most}, got {max}"
                ));
            }
        }
        let is_whole = details.sizes.len() == array.dimensions.len() && layout.array_of(variable).is_some();
        (!is_whole).then(|| format!("the elements of '{name}' must have the same type, unit and limits"))
    })
}

/// Returns an error for the first variable that a model of this kind cannot have, if any: an output clock, or an input
/// that is declared to change in intermediate updates, but cannot.
fn misplaced(kind: ModelKind, layout: &Layout) -> Option<String> {
    if kind == ModelKind::Continuous
        && let Some(clock) = layout.variables.iter().find(|v| matches!(v.declaration.kind, Kind::Clock(None)))
    {
        let name = &clock.declaration.name;
        return Some(format!(
            "'{name}' cannot be a `Clock`: the outputs of a continuous-time model follow from its states"
        ));
    }
    let is_possible = |variable: &Variable| kind == ModelKind::Continuous && variable.is_intermediate();
    let mut declared = layout.variables.iter().filter(|variable| variable.declaration.details.intermediate);
    let name = &declared.find(|variable| !is_possible(variable))?.declaration.name;
    Some(format!("'{name}': remove `intermediate`, which only `f64` inputs of continuous-time models can have"))
}

/// Returns the first inconsistency in the declarations, if any. Outputs that the model calculates have no start value.
fn contradiction(info: &Info, layout: &Layout, format: Format, calculates_outputs: bool) -> Option<String> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if !info.name.starts_with(|c: char| c.is_ascii_alphabetic()) || !info.name.chars().all(is_word) {
        return Some("the name is used as the modelIdentifier and must be a C identifier".to_owned());
    }
    for (what, value) in [("stop_time", info.stop_time), ("step_size", info.step_size)] {
        if !(value.is_finite() && value > 0.0) {
            return Some(format!("{what} of the default experiment must be above 0, got {value} s"));
        }
    }
    let is_text = |text: &str| text.chars().all(is_xml);
    for (what, text) in [
        ("description", info.description),
        ("version", info.version),
        ("author", info.authors),
        ("license", info.license),
    ] {
        if !is_text(text) {
            return Some(format!("the {what} has a control character that XML cannot hold"));
        }
    }
    let (mut names, mut units, mut types) = (BTreeSet::new(), BTreeMap::new(), BTreeMap::new());
    for variable in &layout.variables {
        let declaration = &variable.declaration;
        let name = &declaration.name;
        let has_start = declaration.details.constant || variable.role != Role::Output || !calculates_outputs;
        if let Some(twice) = declaration.names().find(|name| !names.insert(*name)) {
            return Some(format!("two variables are named '{twice}'"));
        }
        let details = declaration.details;
        if !is_text(details.quantity) {
            return Some(format!("the quantity of '{name}' has a control character that XML cannot hold"));
        }
        if (details.relative_quantity || details.unbounded) && declaration.kind.real().is_none() {
            return Some(format!("'{name}': only a real variable has `relative_quantity` or `unbounded`"));
        }
        for alias in &declaration.aliases {
            let (other, description) = (&alias.name, &alias.description);
            if !is_text(description) {
                return Some(format!("the description of '{other}' has a control character that XML cannot hold"));
            }
            let unit = declaration.kind.real().map(|real| real.unit);
            let Some(display) = alias.display else { continue };
            if unit.is_none() || !display.factor.is_finite() {
                let unit = unit.filter(Unit::is_declared).map_or("a value without a unit", |unit| unit.name);
                return Some(format!("'{other}': {unit} cannot be displayed in {}", display.name));
            }
        }
        if name.is_empty() || name.contains(char::is_control) || !is_text(name) {
            return Some(format!("the name {name:?} is empty or has a control character, which FMI does not allow"));
        }
        if declaration.description.is_empty() || !is_text(&declaration.description) {
            return Some(format!("'{name}' has no description, or one with a control character that XML cannot hold"));
        }
        match &declaration.kind {
            Kind::Real(real) | Kind::Float32(real) => {
                let definition = |unit: Unit| (unit.exponents, unit.factor, unit.offset);
                let known = units.entry(real.unit.name).or_insert(real.unit);
                if definition(*known) != definition(real.unit) {
                    return Some(format!(
                        "'{name}': the unit {} is defined differently for another variable",
                        real.unit.name
                    ));
                }
                if [real.min, real.max, real.nominal].into_iter().flatten().any(|value| !value.is_finite()) {
                    return Some(format!("'{name}': a limit or the nominal value is not a finite number"));
                }
                if real.nominal.is_some_and(|nominal| nominal <= 0.0) {
                    return Some(format!("'{name}': the nominal value is not above 0"));
                }
                let range = real.range();
                if !real.start.is_finite() || (has_start && !range.contains(&real.start)) {
                    let (start, min, max) = (real.start, range.start(), range.end());
                    return Some(format!("start of '{name}' = {start} is not within [{min}, {max}]"));
                }
                if let Some(display) = real.display.filter(|display| !display.factor.is_finite()) {
                    return Some(format!("'{name}': {} cannot be displayed in {}", real.unit.name, display.name));
                }
            }
            Kind::Integer { size, start, min, max, items, type_name, is_enumeration } => {
                if has_start && !(min..=max).contains(&start) {
                    return Some(format!("start of '{name}' = {start} is not within [{min}, {max}]"));
                }
                let key = simple_type(layout, type_name, *is_enumeration);
                if items.iter().any(|item| !is_text(item.description)) {
                    return Some(format!(
                        "'{name}': an item of {type_name} has a control character that XML cannot hold"
                    ));
                }
                if !items.is_empty() && *types.entry(key).or_insert((*size, *items)) != (*size, *items) {
                    return Some(format!(
                        "'{name}': the enumeration {type_name} is defined differently for another variable"
                    ));
                }
            }
            Kind::Binary { start, most, .. } if start.len() > *most => {
                return Some(format!("start of '{name}' has {} bytes, at most {most} are possible", start.len()));
            }
            Kind::Binary { mime, .. } if !is_text(mime) => {
                return Some(format!("the MIME type of '{name}' has a control character that XML cannot hold"));
            }
            Kind::String { start } if !is_text(start) => {
                return Some(format!("start of '{name}' has a control character that XML cannot hold"));
            }
            _ => {}
        }
    }
    let mistaken = mistaken_clock(layout).or_else(|| mistaken_size(layout));
    if let Some(problem) = mistaken.or_else(|| terminals::terminals(layout, format).err()) {
        return Some(problem);
    }
    if format.version == Version::Fmi2 {
        return None;
    }
    // In FMI 3.0 the time and the event indicators are variables. The module `fmi3` writes them with these names.
    const TIME: [&str; 3] = ["time", "simulation_time", "independent_variable"];
    if TIME.iter().all(|name| names.contains(name)) {
        return Some(format!("rename one of '{}': FMI 3.0 needs one of these names for the time", TIME.join("', '")));
    }
    let is_index = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_indicator = |name: &&&str| {
        let index = name.strip_prefix("event_indicator[").and_then(|rest| rest.strip_suffix(']'));
        format.interfaces.model_exchange && index.is_some_and(is_index)
    };
    names.iter().find(is_indicator).map(|name| {
        format!("'{name}' is the name of an event indicator in FMI 3.0; choose another name for the variable")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::declare::{Spec, named_display_unit};
    use crate::enumeration::Item;
    use crate::unit;
    use crate::variable::{Alias, ArrayElement, Declaration, Declarations, Details, Terminal};

    const INFO: Info = Info {
        name: "Name",
        description: "D",
        version: "1",
        authors: "",
        license: "",
        homepage: "",
        stop_time: 1.0,
        step_size: 0.1,
        resources: "",
    };
    const ITEMS: &[Item] = &[Item { value: 0, name: "off", description: "Off" }];

    fn real(spec: Spec, start: f64) -> Vec<Declaration> {
        let mut all = Vec::new();
        Spec { doc: "D", ..spec }.declare_real(Some(start), &mut all);
        all
    }

    fn named(name: &str, unit: Unit) -> Spec {
        Spec { units: unit.into(), ..Spec::named(name) }
    }

    fn positive(mut spec: Spec) -> Spec {
        spec.make_positive();
        spec
    }

    fn plain(kind: Kind) -> Vec<Declaration> {
        let (name, description) = ("x".to_owned(), "D".to_owned());
        let (array, aliases, terminals, details) = (None, Vec::new(), Vec::new(), Details::default());
        let (tunable, local, calculated) = (false, false, false);
        vec![Declaration { name, description, tunable, local, calculated, kind, array, aliases, terminals, details }]
    }

    fn enumeration(type_name: &'static str, items: &'static [Item]) -> Kind {
        Kind::Integer { size: Size::Int32, start: 0, min: 0, max: 1, type_name, items, is_enumeration: false }
    }

    fn problem(parameters: Vec<Declaration>) -> String {
        problem_in(Format::FMI2, parameters)
    }

    fn problem_in(format: Format, parameters: Vec<Declaration>) -> String {
        let layout = Layout::new(Declarations { parameters, ..Declarations::default() });
        contradiction(&INFO, &layout, format, false).unwrap_or_default()
    }

    #[test]
    fn inconsistent_declarations_are_reported() {
        let x = || named("x", unit!("m"));
        assert_eq!(problem(real(Spec { min: Some(-1.0), max: Some(1.0), nominal: Some(0.5), ..x() }, 0.0)), "");
        assert_eq!(problem([real(x(), 0.0), real(x(), 0.0)].concat()), "two variables are named 'x'");
        assert_eq!(problem(real(Spec { max: Some(1.0), ..x() }, 2.0)), "start of 'x' = 2 is not within [-inf, 1]");
        assert_eq!(problem(real(x(), f64::NAN)), "start of 'x' = NaN is not within [-inf, inf]");
        assert_eq!(problem(real(positive(x()), 0.0)), "start of 'x' = 0 is not within [0.000001, inf]");
        assert_eq!(problem(real(Spec { display_name: Some("deg"), ..x() }, 0.0)), "'x': m cannot be displayed in deg");
        let unbounded = Details { unbounded: true, ..Details::default() };
        let mut law = plain(enumeration("Law", ITEMS));
        law[0].details = unbounded;
        assert_eq!(problem(law), "'x': only a real variable has `relative_quantity` or `unbounded`");
        assert_eq!(problem(real(Spec { details: unbounded, ..x() }, 0.0)), "");
        let alias = |name: &str, display: Option<&'static str>| {
            let (name, description) = (name.to_owned(), String::new());
            let aliases = vec![Alias { name, description, display: display.map(named_display_unit) }];
            Spec { aliases, ..x() }
        };
        assert_eq!(problem(real(alias("y", Some("mm")), 0.0)), "");
        assert_eq!(problem(real(alias("y", Some("ft")), 0.0)), "'y': m cannot be displayed in ft");
        let nothing = Spec { units: Unit::NONE.into(), ..alias("y", Some("mm")) };
        assert_eq!(problem(real(nothing, 0.0)), "'y': a value without a unit cannot be displayed in mm");
        assert_eq!(problem(real(alias("x", None), 0.0)), "two variables are named 'x'");
        let y = real(named("y", unit!("m")), 0.0);
        assert_eq!(problem([real(alias("y", None), 0.0), y].concat()), "two variables are named 'y'");
        for spec in [
            Spec { max: Some(f64::INFINITY), ..x() },
            Spec { min: Some(f64::NEG_INFINITY), ..x() },
            Spec { nominal: Some(f64::NAN), ..x() },
        ] {
            assert_eq!(problem(real(spec, 0.0)), "'x': a limit or the nominal value is not a finite number");
        }
        assert_eq!(problem(real(Spec { nominal: Some(0.0), ..x() }, 0.0)), "'x': the nominal value is not above 0");
        assert_eq!(
            problem([real(x(), 0.0), real(named("y", Unit { name: "m", ..Unit::S }), 0.0)].concat()),
            "'y': the unit m is defined differently for another variable"
        );
        let mut other_mode = plain(enumeration("Law", ITEMS));
        other_mode[0].name = "y".to_owned();
        const OTHERS: &[Item] = &[Item { value: 0, name: "on", description: "On" }];
        assert_eq!(
            problem([other_mode, plain(enumeration("Law", OTHERS))].concat()),
            "'x': the enumeration Law is defined differently for another variable"
        );
        let number = |size, min, max| Kind::Integer {
            size,
            start: 3,
            min,
            max,
            type_name: "",
            items: &[],
            is_enumeration: false,
        };
        assert_eq!(problem(plain(number(Size::Int32, 0, 2))), "start of 'x' = 3 is not within [0, 2]");
        let above = i128::from(i32::MAX) + 1;
        let problem_of = |format, max| {
            let parameters = plain(number(Size::UInt32, 0, max));
            inexpressible(&Layout::new(Declarations { parameters, ..Declarations::default() }), format)
        };
        assert_eq!(problem_of(Format::FMI2, above - 1), None);
        assert_eq!(problem_of(Format::FMI3, above), None);
        assert_eq!(
            problem_of(Format::FMI2, above).unwrap(),
            "'x' of type UInt32 may have values that an Integer of FMI 2.0 (32 bits) cannot have: declare \
             `min` and `max` within [-2147483648, 2147483647], pack with --fmi 3, or leave it out of FMI 2.0 with \
             `#[var(fmi = 3)]`"
        );
        for (start, message) in
            [("two\nlines\t\r", ""), ("\0", "start of 'x' has a control character that XML cannot hold")]
        {
            let text = Kind::String { start: start.to_owned() };
            assert_eq!(problem(plain(text)), message);
        }
        for words in ["", "a\u{1}b"] {
            let mut all = plain(Kind::Boolean { start: true });
            all[0].description = words.to_owned();
            assert_eq!(problem(all), "'x' has no description, or one with a control character that XML cannot hold");
        }
        for name in ["", "a\tb", "a\u{ffff}"] {
            assert_eq!(
                problem(real(Spec::named(name), 0.0)),
                format!("the name {name:?} is empty or has a control character, which FMI does not allow")
            );
        }
    }

    #[test]
    fn only_continuous_inputs_change_in_intermediate_updates() {
        let layout = |kind: Kind| {
            let mut inputs = plain(kind);
            inputs[0].details.intermediate = true;
            Layout::new(Declarations { inputs, ..Declarations::default() })
        };
        let of = |all: Vec<Declaration>| all[0].kind.clone();
        let continuous = layout(of(real(named("x", unit!("m")), 0.0)));
        let mut all = Vec::new();
        named("x", unit!("m")).declare_float32(Some(0.0), &mut all);
        let message = "'x': remove `intermediate`, which only `f64` inputs of continuous-time models can have";
        assert_eq!(misplaced(ModelKind::Continuous, &continuous), None);
        assert_eq!(misplaced(ModelKind::Discrete, &continuous).unwrap(), message);
        assert_eq!(misplaced(ModelKind::Stateful, &continuous).unwrap(), message);
        assert_eq!(misplaced(ModelKind::Continuous, &layout(of(all))).unwrap(), message);
        assert_eq!(misplaced(ModelKind::Continuous, &layout(Kind::Boolean { start: true })).unwrap(), message);
    }

    #[test]
    fn a_continuous_time_model_has_no_output_clock() {
        let layout = Layout::new(Declarations { outputs: plain(Kind::Clock(None)), ..Declarations::default() });
        let problem = misplaced(ModelKind::Continuous, &layout).unwrap();
        let expected = "cannot be a `Clock`: the outputs of a continuous-time model follow from its states";
        assert!(problem.ends_with(expected), "{problem}");
        assert_eq!(misplaced(ModelKind::Discrete, &layout), None);
    }

    /// FMI 3.0.2, section 2.4.9: names of terminals are unique among siblings, names of members in a terminal.
    #[test]
    fn mistakes_in_terminals_are_reported() {
        let terminal = |name, rule| Terminal { name, rule, description: "", member: 2 };
        let (plug, bus) = (terminal("shaft", "plug"), terminal("shaft", "bus"));
        let output = |name: &str, terminals: &[Terminal]| {
            let mut all = plain(Kind::Boolean { start: true });
            (all[0].name, all[0].terminals) = (name.to_owned(), terminals.to_vec());
            all
        };
        let of = |outputs: [Vec<Declaration>; 2]| {
            let layout = Layout::new(Declarations { outputs: outputs.concat(), ..Declarations::default() });
            contradiction(&INFO, &layout, Format::FMI3, false).unwrap_or_default()
        };
        assert_eq!(of([output("a.x", &[plug]), output("b.y", &[plug])]), "");
        assert_eq!(
            of([output("a.x", &[plug]), output("b.x", &[plug, bus])]),
            "",
            "a child may have the name of its parent"
        );
        assert_eq!(
            of([output("a.x", &[plug]), output("b.y", &[bus])]),
            "the terminal 'shaft' has the rules `plug` and `bus`"
        );
        assert_eq!(
            of([output("a.x", &[plug]), output("b.x", &[plug])]),
            "the terminal 'shaft' has two members 'x', the variables 'a.x' and 'b.x': give one of them another name, or \
             declare two terminals"
        );
        let mut wheel = output("load.shaft", &[]);
        let (name, description, element) = ("load".to_owned(), "D".to_owned(), "shaft".to_owned());
        wheel[0].array = Some(ArrayElement { name, description, element, dimensions: vec![1] });
        assert_eq!(
            of([wheel, output("a.x", &[plug])]),
            "the terminal 'shaft' has the name of an element of an array, which has a terminal of its own: choose another \
             name"
        );
    }

    #[test]
    fn mistakes_in_clocks_are_reported() {
        use crate::clocks::{Setting, Span};
        const CLOCKS: &[InputClock] = &[
            InputClock { name: "fast", description: "D", timing: Timing::Countdown(None), priority: None },
            InputClock {
                name: "slow",
                description: "D",
                timing: Timing::Changing(Interval::Of("period")),
                priority: None,
            },
        ];
        let layout = |clocks: &[InputClock], outputs, inputs, parameters| {
            let clocks = clocks.iter().map(crate::variable::declare_clock).collect();
            Layout::new(Declarations { clocks, outputs, inputs, parameters, ..Declarations::default() })
        };
        let of = |layout: &Layout| contradiction(&INFO, layout, Format::FMI3, false).unwrap_or_default();
        let period = || real(named("period", unit!("s")), 1.0);
        let clocked = |names| {
            let mut all = plain(Kind::Boolean { start: false });
            all[0].details.clocks = names;
            all
        };
        let none = Vec::new;
        assert_eq!(of(&layout(CLOCKS, clocked(&["fast", "slow"]), none(), period())), "");
        assert_eq!(
            of(&layout(CLOCKS, clocked(&["fast", "fats"]), none(), period())),
            "'x': the model has no input clock 'fats'; a method with `#[clock(…)]` declares one (found: fast, slow)"
        );
        assert_eq!(
            of(&layout(CLOCKS, none(), none(), none())),
            "the interval of the clock 'slow': the model has no real parameter 'period'"
        );
        assert_eq!(
            of(&layout(&[], plain(Kind::Clock(None)), none(), none())),
            "the clock 'x' cannot tick: no method of the model has the attribute `#[clock(…)]`"
        );
        assert_eq!(
            of(&layout(CLOCKS, none(), plain(Kind::Clock(None)), period())),
            "'x' cannot be a `Clock`: an input clock is a method with `#[clock(triggered)]`"
        );
        const ZERO: &[InputClock] = &[InputClock {
            name: "zero",
            description: "D",
            timing: Timing::periodic(Interval::Constant(Span::Decimal(0.0)), None, Setting::Never),
            priority: None,
        }];
        assert_eq!(
            of(&layout(ZERO, none(), none(), none())),
            "the interval of the clock 'zero' must be above 0 s, got 0 s"
        );
        const TRIGGERED: &[InputClock] =
            &[InputClock { name: "button", description: "D", timing: Timing::Triggered, priority: None }];
        let triggered = layout(TRIGGERED, none(), none(), none());
        assert_eq!(
            inexpressible(&triggered, Format::FMI2).unwrap(),
            "'button' is a triggered clock, which nothing would activate in FMI 2.0: pack with --fmi 3"
        );
        assert_eq!(inexpressible(&triggered, Format::FMI3), None);
    }

    /// A calculated output has no start value that could be outside the limits.
    #[test]
    fn limits_of_a_calculated_output_need_not_contain_0() {
        let outputs = real(Spec { min: Some(1.0), ..named("y", unit!("m")) }, 0.0);
        let layout = Layout::new(Declarations { outputs, ..Declarations::default() });
        let of = |calculates_outputs| contradiction(&INFO, &layout, Format::FMI3, calculates_outputs);
        assert_eq!(of(false).unwrap(), "start of 'y' = 0 is not within [1, inf]");
        assert_eq!(of(true), None);
    }

    /// The same names are valid in FMI 2.0. Names of event indicators are also valid in FMI 3.0 without model exchange.
    #[test]
    fn names_that_fmi_3_needs_are_rejected() {
        let all = |names: &[&'static str]| -> Vec<Declaration> {
            names.iter().flat_map(|name| real(named(name, unit!("s")), 0.0)).collect()
        };
        let taken = ["time", "simulation_time", "independent_variable"];
        assert_eq!(problem_in(Format::FMI3, all(&taken[..2])), "");
        assert_eq!(
            problem_in(Format::FMI3, all(&taken)),
            "rename one of 'time', 'simulation_time', 'independent_variable': FMI 3.0 needs one of these names for the time"
        );
        assert_eq!(problem_in(Format::FMI2, all(&taken)), "");
        let indicator = || all(&["event_indicator[12]"]);
        assert_eq!(
            problem_in(Format::FMI3, indicator()),
            "'event_indicator[12]' is the name of an event indicator in FMI 3.0; choose another name for the variable"
        );
        assert_eq!(problem_in(Format::FMI2, indicator()), "");
        let co_simulation = Interfaces { model_exchange: false, ..Interfaces::ALL };
        assert_eq!(problem_in(Format { interfaces: co_simulation, ..Format::FMI3 }, indicator()), "");
        assert_eq!(problem_in(Format::FMI3, all(&["event_indicator", "event_indicator[]", "event_indicator[a]"])), "");
    }

    #[test]
    fn an_array_whose_name_is_taken_stays_scalars() {
        let element = |i: usize| {
            let mut all = real(named("x", unit!("m")), 0.0);
            all[0].name = format!("x[{i}]");
            let (name, description) = ("x".to_owned(), "D".to_owned());
            all[0].array = Some(ArrayElement { name, description, element: String::new(), dimensions: vec![2] });
            all
        };
        let is_array = |parameters: Vec<Declaration>| {
            let layout = Layout::new(Declarations { parameters, ..Declarations::default() });
            layout.array_of(&layout.variables[0]).is_some()
        };
        assert!(is_array([element(1), element(2)].concat()));
        let scalar = real(named("x", unit!("m")), 0.0);
        assert!(!is_array([element(1), element(2), scalar].concat()));
    }

    #[test]
    fn an_invalid_default_experiment_or_name_is_reported() {
        let nothing = Layout::new(Declarations::default());
        for name in ["", "1st", "with-dash", "a b", "\u{e4}"] {
            let problem = contradiction(&Info { name, ..INFO }, &nothing, Format::FMI2, false).unwrap();
            assert!(problem.contains("identifier"), "{name}");
        }
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let problem = |info| contradiction(&info, &nothing, Format::FMI2, false).unwrap();
            assert!(problem(Info { stop_time: value, ..INFO }).starts_with("stop_time"));
            assert!(problem(Info { step_size: value, ..INFO }).starts_with("step_size"));
        }
    }

    #[test]
    fn positive_keeps_a_greater_least_value() {
        let least = |spec: Spec| match &real(spec, 3.0)[0].kind {
            Kind::Real(real) => real.min,
            _ => None,
        };
        for (min, expected) in [(Some(2.0), 2.0), (Some(-2.0), 1e-6), (None, 1e-6)] {
            assert_eq!(least(positive(Spec { min, ..named("x", unit!("1")) })), Some(expected));
        }
    }
}
