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
            clock(element, declared, description.has_scheduled_execution, &mut error);
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
    let text = |attribute| element.attribute(attribute).or_else(|| declared?.attribute(attribute));
    let has = |attribute| text(attribute).is_some();
    let mut violated = |is_violated: bool, message: &str, section: &str| {
        if is_violated {
            error(&subject(element), message.to_owned(), section);
        }
    };
    let causality = text("causality").unwrap_or("local");
    violated(
        !matches!(causality, "input" | "output" | "local"),
        &format!("is a Clock, which must be an input, an output or local, got causality=\"{causality}\""),
        ATTRIBUTES,
    );
    let variability = text("variability").unwrap_or("discrete");
    let message = format!("is a Clock, which must be discrete, got variability=\"{variability}\"");
    violated(variability != "discrete", &message, ATTRIBUTES);
    violated(
        element.attribute("intervalVariability").is_none(),
        "is a Clock, which must have the attribute `intervalVariability`",
        TYPES,
    );
    let kind = text("intervalVariability").unwrap_or("triggered");
    let is_periodic = matches!(kind, "constant" | "fixed" | "tunable");
    violated(
        kind != "triggered" && causality != "input",
        &format!("is a {kind} clock, which must be an input, got causality=\"{causality}\""),
        "2.2.8.2",
    );
    violated(
        kind == "constant" && !has("intervalDecimal"),
        "is a constant clock, which must have an interval: add `intervalDecimal`",
        TYPES,
    );
    let supports_fraction = matches!(text("supportsFraction").map(str::trim), Some("true" | "1"));
    for attribute in ["intervalDecimal", "resolution", "intervalCounter"] {
        let message = format!("is a {kind} clock, but only constant, fixed and tunable ones may have `{attribute}`");
        violated(has(attribute) && !is_periodic, &message, TYPES);
    }
    for (attribute, needed) in [("shiftDecimal", "intervalDecimal"), ("shiftCounter", "intervalCounter")] {
        violated(has(attribute) && !has(needed), &format!("has `{attribute}`, which needs `{needed}`"), TYPES);
    }
    let message = "has `intervalCounter`, which needs supportsFraction=\"true\" and `resolution`";
    violated(has("intervalCounter") && !(supports_fraction && has("resolution")), message, TYPES);
    for (attribute, is_whole, is_positive) in [
        ("intervalDecimal", false, true),
        ("shiftDecimal", false, false),
        ("resolution", true, true),
        ("intervalCounter", true, true),
        ("shiftCounter", true, false),
        ("priority", true, false),
    ] {
        let Some(text) = text(attribute).map(str::trim) else { continue };
        let in_range = |value: f64| value.is_finite() && if is_positive { value > 0.0 } else { value >= 0.0 };
        let is_valid = text.parse().is_ok_and(in_range) && (!is_whole || text.parse::<u64>().is_ok());
        let noun = if is_whole { "whole number" } else { "number" };
        let range = if is_positive { "above 0" } else { "from 0" };
        violated(!is_valid, &format!("`{attribute}` must be a {noun} {range}, got {text}"), TYPES);
    }
    let number = |attribute| text(attribute)?.trim().parse::<f64>().ok();
    if let [Some(interval), Some(counter), Some(resolution)] =
        ["intervalDecimal", "intervalCounter", "resolution"].map(number)
    {
        let message = format!(
            "`intervalDecimal` is {interval}, but `intervalCounter` / `resolution` is {counter} / {resolution}"
        );
        // Decimals may be rounded.
        violated((counter / resolution - interval).abs() > 1e-6 * interval, &message, TYPES);
    }
    let message = "is an input clock of an FMU with scheduled execution, which must have the attribute `priority`";
    violated(is_scheduled && causality == "input" && !has("priority"), message, TYPES);
    violated(causality == "output" && has("priority"), "is an output clock, which must not have `priority`", TYPES);
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
        let reason = match known.variables.get(&reference) {
            Some(variable) => {
                format!("which belongs to the {} `{}`, not to a Clock", variable.data_type, variable.name)
            }
            None => "which no variable has".to_owned(),
        };
        error(subject, format!("`clocks` contains the value reference {reference}, {reason}"), ATTRIBUTES);
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
        let name = element.attribute("name").unwrap_or_default();
        if element.name == "Clock" {
            let is_output = element.attribute("causality") == Some("output");
            if is_output != is_listed("Output", own) {
                let word =
                    if is_output { "is an output clock, so it must" } else { "is not an output, so it must not" };
                error(&subject(element), format!("{word} be listed in Output"), STRUCTURE);
            }
            continue;
        }
        let (previous, is_state) = (element.attribute("previous"), is_listed("ClockedState", own));
        let Some(variable) = known.variables.get(&own).filter(|_| is_state || previous.is_some()) else { continue };
        let mut violated = |is_violated: bool, message: &str, section: &str| {
            if is_violated {
                error(&subject(element), message.to_owned(), section);
            }
        };
        violated(!is_state, "has `previous`, so it must be listed in ClockedState", STRUCTURE);
        violated(previous.is_none(), "is listed in ClockedState, so it must have the attribute `previous`", STRUCTURE);
        let is_clocked = element.attribute("clocks").is_some();
        violated(!is_clocked, "is a clocked state, so it must have the attribute `clocks`", STRUCTURE);
        let variability = variable.variability;
        let message = format!("is a clocked state, so it must be discrete, got {variability:?}");
        violated(variability != Variability::Discrete, &message, STRUCTURE);
        let Some(text) = previous else { continue };
        let Some((reference, old)) =
            reference(element, "previous").and_then(|reference| Some((reference, known.variables.get(&reference)?)))
        else {
            let message = format!("has previous=\"{text}\", which is not the value reference of a variable");
            violated(true, &message, ATTRIBUTES);
            continue;
        };
        violated(reference == own, "has itself as `previous`", ATTRIBUTES);
        let message = |is: String, rule: &str| format!("has `{}` as `previous`, which is {is}: {rule}", old.name);
        let (types, rule) = ([variable.data_type, old.data_type], "both must have the same type");
        violated(types[0] != types[1], &message(format!("of type {}, not {}", types[1], types[0]), rule), ATTRIBUTES);
        let is_discrete = old.variability == Variability::Discrete;
        violated(!is_discrete, &message(format!("{:?}", old.variability), "it must be discrete"), ATTRIBUTES);
        let is_input = old.causality == Causality::Input;
        violated(is_input, &message("an input".to_owned(), "it must not be one"), ATTRIBUTES);
        if let Some(other) = all_previous.insert(reference, name) {
            let rule = format!("that of `{other}`, too");
            violated(true, &message(rule, "two variables must not have the same"), ATTRIBUTES);
        }
    }
}
