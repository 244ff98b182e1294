//! Rules of FMI 3.0 about clocks, clocked variables and the sizes of arrays.
//!
//! They concern attributes and elements that the parsed description does not contain, or contains only in another form.

use super::{Finding, Report, variable_named};
use fmu_import::c_api::Reference;
use fmu_import::description::{Causality, DataType, ModelDescription, Variability, Variable};
use fmu_import::xml::Element;
use std::collections::{HashMap, HashSet};

const TYPES: &str = "2.4.4";
const ARRAYS: &str = "2.4.7.2";
const ATTRIBUTES: &str = "2.4.7.4";
const STRUCTURE: &str = "2.4.8";
const KINDS: &str = "2.2.8.2";

/// Reports a violated rule: the subject, the message, and the section of the standard.
type Violation<'a> = &'a mut dyn FnMut(&str, String, &str);

pub(super) fn check(root: &Element, description: &ModelDescription, report: Report<'_>) {
    let mut error = |subject: &str, message: String, section: &str| {
        report(Finding::error(subject, format!("{message} (FMI 3.0.2, section {section})")));
    };
    if description.co_simulation.as_ref().is_some_and(|unit| !unit.has_event_mode) && !description.clocks.is_empty() {
        error("hasEventMode", "must be true, because the FMU has clocks, got false".to_owned(), "4.4");
    }
    let children = |name| root.child(name).map_or(&[][..], |list| &list.children);
    let types = children("TypeDefinitions").iter().filter(|element| element.name == "ClockType");
    let types: HashMap<_, _> = types.filter_map(|element| Some((element.attribute("name")?, element))).collect();
    let known = Known {
        variables: description
            .variables
            .iter()
            .filter(|variable| variable.alias_of.is_none())
            .map(|variable| (variable.reference, variable))
            .collect(),
        // The aliases of a clock have its reference and follow it.
        clocks: description.clocks.iter().rev().map(|clock| (clock.reference, &*clock.name)).collect(),
    };
    let mut lengths = HashSet::new();
    for element in children("ModelVariables") {
        if element.name == "Clock" {
            let declared = element.attribute("declaredType").and_then(|name| types.get(name).copied());
            clock(element, declared, description.scheduled_execution.is_some(), &mut error);
        }
        variable(element, &known, &mut lengths, &mut error);
    }
    structure(children("ModelStructure"), children("ModelVariables"), &known, &mut error);
}

struct Known<'a> {
    variables: HashMap<Reference, &'a Variable>,
    /// Names of the clocks.
    clocks: HashMap<Reference, &'a str>,
}

impl Known<'_> {
    /// The variable or clock as the subject of a finding.
    fn subject(&self, reference: Reference) -> String {
        let name = self.variables.get(&reference).map(|variable| &*variable.name);
        name.or(self.clocks.get(&reference).copied()).map_or(format!("value reference {reference}"), variable_named)
    }
}

fn subject(element: &Element) -> String {
    variable_named(element.attribute("name").unwrap_or_default())
}

fn reference(element: &Element, attribute: &str) -> Option<Reference> {
    element.parsed(attribute, "").ok().flatten()
}

/// The rules of a clock, whose attributes override those of its declared type.
fn clock(element: &Element, declared: Option<&Element>, is_scheduled: bool, error: Violation<'_>) {
    let text = |name| element.attribute(name).or_else(|| declared?.attribute(name)).map(str::trim);
    let has = |name| text(name).is_some();
    let kind = text("intervalVariability").unwrap_or("triggered");
    let (causality, variability) = (text("causality").unwrap_or("local"), text("variability").unwrap_or("discrete"));
    let (is_input, is_output) = (causality == "input", causality == "output");
    let mut must = |holds: bool, rule: &str, section: &str| {
        if !holds {
            error(&subject(element), format!("is a {kind} {causality} clock, which must {rule}"), section);
        }
    };
    must(is_input || is_output || causality == "local", "be an input, an output or local", ATTRIBUTES);
    must(variability == "discrete", &format!("be discrete, got variability=\"{variability}\""), ATTRIBUTES);
    must(element.attribute("intervalVariability").is_some(), "have the attribute `intervalVariability`", TYPES);
    must(kind == "triggered" || is_input, "be an input", KINDS);
    must(kind != "constant" || has("intervalDecimal"), "have an interval: add `intervalDecimal`", TYPES);
    must(!is_scheduled || !is_input || has("priority"), "have a `priority` for scheduled execution", TYPES);
    must(!is_output || !has("priority"), "not have a `priority`", TYPES);
    let is_periodic = matches!(kind, "constant" | "fixed" | "tunable");
    for name in ["intervalDecimal", "resolution", "intervalCounter"].into_iter().filter(|name| has(name)) {
        must(is_periodic, &format!("be constant, fixed or tunable, because it has `{name}`"), TYPES);
    }
    let is_exact = matches!(text("supportsFraction"), Some("true" | "1")) && has("resolution");
    let rule = "have supportsFraction=\"true\" and `resolution`, because it has `intervalCounter`";
    must(is_exact || !has("intervalCounter"), rule, TYPES);
    for (name, needed) in [("shiftDecimal", "intervalDecimal"), ("shiftCounter", "intervalCounter")] {
        must(has(needed) || !has(name), &format!("have `{needed}`, because it has `{name}`"), TYPES);
    }
    let numbers = ["intervalDecimal", "resolution", "intervalCounter", "shiftDecimal", "shiftCounter", "priority"];
    let number = |name| text(name)?.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
    for (i, name) in numbers.into_iter().enumerate() {
        let Some(text) = text(name) else { continue };
        let (is_positive, is_whole) = (i < 3, !name.ends_with("Decimal"));
        let is_valid = number(name).is_some_and(|value| value > 0.0 || !is_positive);
        let (word, range) = (if is_whole { " whole" } else { "" }, if is_positive { "above" } else { "from" });
        let is_valid = is_valid && (!is_whole || text.parse::<u64>().is_ok());
        must(is_valid, &format!("have a{word} number {range} 0 as `{name}`, got {text}"), TYPES);
    }
    if let [Some(interval), Some(resolution), Some(counter), ..] = numbers.map(number) {
        // Decimals may be rounded.
        let is_same = (counter / resolution - interval).abs() <= 1e-6 * interval;
        must(is_same, &format!("have one interval, got {interval} s and {counter} / {resolution} s"), TYPES);
    }
}

/// The rules of clocked variables and arrays. Collects the variables that are the length of an array.
fn variable(element: &Element, known: &Known<'_>, lengths: &mut HashSet<Reference>, error: Violation<'_>) {
    let subject = &subject(element);
    let clocks = element.attribute("clocks");
    if clocks.is_some_and(|clocks| clocks.trim().is_empty()) {
        error(subject, "`clocks` is empty; leave it out, or add the value reference of a clock".to_owned(), ATTRIBUTES);
    }
    let references = clocks.unwrap_or_default().split_ascii_whitespace().filter_map(|text| text.parse().ok());
    for reference in references.filter(|reference| !known.clocks.contains_key(reference)) {
        let other = known.subject(reference);
        error(subject, format!("has {other} in `clocks`, which is not a Clock"), ATTRIBUTES);
    }
    let variable = reference(element, "valueReference").and_then(|reference| known.variables.get(&reference));
    let Some(variable) = variable else { return };
    let variability = variable.variability;
    if clocks.is_some() && !matches!(variability, Variability::Discrete | Variability::Tunable) {
        error(subject, format!("has clocks, so it must be discrete or tunable, got {variability:?}"), ATTRIBUTES);
    }
    if element.boolean("intermediateUpdate") == Ok(Some(true)) && variability != Variability::Continuous {
        let message =
            format!("has intermediateUpdate=\"true\", which needs a continuous variable, got {variability:?}");
        error(subject, message, ATTRIBUTES);
    }
    for dimension in element.children.iter().filter(|child| child.name == "Dimension") {
        let start = dimension.attribute("start");
        if variable.causality == Causality::StructuralParameter {
            error(subject, "is a structural parameter, which must be a scalar".to_owned(), ATTRIBUTES);
        }
        if start.is_some_and(|start| start.trim().parse() == Ok(0)) {
            error(subject, "a dimension has start=\"0\", but must be above 0".to_owned(), ARRAYS);
        }
        let Some(reference) = reference(dimension, "valueReference") else { continue };
        if start.is_some() {
            let message = "a dimension must have one of the attributes `start` and `valueReference`, got both";
            error(subject, message.to_owned(), ARRAYS);
        }
        let Some(length) = known.variables.get(&reference).filter(|_| lengths.insert(reference)) else { continue };
        if length.data_type != DataType::UInt64 {
            let message = format!("is the length of an array, so it must be a UInt64, got {}", length.data_type);
            error(&variable_named(&length.name), message, ARRAYS);
        }
        if length.start.as_ref().and_then(|start| start.whole()) == Some(0) {
            let message = "is the length of an array, so its start value must be above 0, got 0; `min` may be 0";
            error(&variable_named(&length.name), message.to_owned(), ATTRIBUTES);
        }
    }
}

/// The rules of clocks and clocked states in the model structure.
fn structure(entries: &[Element], variables: &[Element], known: &Known<'_>, error: Violation<'_>) {
    let mut listed: HashMap<&str, HashSet<Reference>> = HashMap::new();
    for entry in entries {
        let Some(reference) = reference(entry, "valueReference") else { continue };
        let (list, subject) = (listed.entry(&entry.name).or_default(), known.subject(reference));
        let is_clock = known.clocks.contains_key(&reference);
        if !list.insert(reference) && (is_clock || entry.name == "ClockedState") {
            error(&subject, format!("is listed twice in {}", entry.name), STRUCTURE);
        }
        if is_clock && !matches!(&*entry.name, "Output" | "InitialUnknown") {
            error(&subject, format!("is a Clock, which cannot be listed in {}", entry.name), STRUCTURE);
        } else if !is_clock && !known.variables.contains_key(&reference) {
            // The reader rejects an unknown reference in other lists.
            error(&subject, format!("is listed in {}, but belongs to no variable", entry.name), STRUCTURE);
        }
    }
    let is_listed = |list: &str, reference| listed.get(list).is_some_and(|list| list.contains(&reference));
    let mut all_previous = HashMap::new();
    for element in variables {
        let Some(own) = reference(element, "valueReference") else { continue };
        if element.name == "Clock" {
            let is_output = element.attribute("causality") == Some("output");
            if is_output != is_listed("Output", own) {
                let rule = if is_output { "is an output, so it must" } else { "is not an output, so it must not" };
                error(&subject(element), format!("{rule} be listed in Output"), STRUCTURE);
            }
            continue;
        }
        let (previous, is_state) = (element.attribute("previous"), is_listed("ClockedState", own));
        let Some(variable) = known.variables.get(&own).filter(|_| is_state || previous.is_some()) else { continue };
        let mut must = |holds: bool, rule: &str, section: &str| {
            if !holds {
                error(&subject(element), format!("is a clocked state, which must {rule}"), section);
            }
        };
        let variability = variable.variability;
        must(is_state, "be listed in ClockedState", STRUCTURE);
        must(previous.is_some(), "have the attribute `previous`", STRUCTURE);
        must(element.attribute("clocks").is_some(), "have the attribute `clocks`", STRUCTURE);
        must(variability == Variability::Discrete, &format!("be discrete, got {variability:?}"), STRUCTURE);
        let Some(text) = previous else { continue };
        let reference = reference(element, "previous").unwrap_or(own);
        let old = known.variables.get(&reference).filter(|_| reference != own);
        let rule = format!("have the value reference of another variable as `previous`, got {text}");
        must(old.is_some(), &rule, ATTRIBUTES);
        let Some(old) = old else { continue };
        let (name, data_type) = (&old.name, variable.data_type);
        let rule = format!("have a previous value of its type {data_type}, got `{name}` of type {}", old.data_type);
        must(old.data_type == data_type, &rule, ATTRIBUTES);
        let rule = format!("have a discrete previous value, got `{name}`, which is {:?}", old.variability);
        must(old.variability == Variability::Discrete, &rule, ATTRIBUTES);
        let rule = format!("have a previous value that is not an input, got `{name}`");
        must(old.causality != Causality::Input, &rule, ATTRIBUTES);
        let other = all_previous.insert(reference, &variable.name);
        let rule =
            format!("have a previous value of its own, got `{name}`, as has `{}`", other.map_or("", |name| name));
        must(other.is_none(), &rule, ATTRIBUTES);
    }
}
