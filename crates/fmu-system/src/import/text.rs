//! The text of a scenario made from an SSP file.

use super::{Bound, Fmu, Owner, Reader};
use crate::data::unit::{Declared, UnitMismatch};
use crate::run::Linear;
use fmu_import::bytes::BinaryText;
use fmu_import::description::{BaseType, Causality, ModelDescription, Value, Variable};
use fmu_import::limits::TEXT_FILE;
use fmu_import::xml::{Element, Place, XmlError};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

/// Types of annotations of which only the communication step matters.
const KNOWN: [&str; 2] = ["org.openmodelica", "com.opensimulationplatform"];

/// A scenario with one case from the part with everything else.
pub(super) fn scenario(file: &Path, part: &str) -> String {
    let title = quoted(&file.file_stem().unwrap_or_default().to_string_lossy());
    format!("title = {title}\n{part}\n[[case]]\nname = \"system\"\ntitle = {title}\n")
}

/// A string in TOML. JSON has the same escape sequences, but does not need one for the character 127.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string().replace('\u{7f}', "\\u007f")
}

/// A name of a component: lowercase letters, digits and `_`.
pub(super) fn snake_case(name: &str) -> String {
    let mut text = String::new();
    let mut is_word = false;
    for c in name.chars() {
        if (c.is_ascii_uppercase() && is_word) || (!c.is_ascii_alphanumeric() && !text.ends_with('_')) {
            text.push('_');
        }
        text.extend(c.is_ascii_alphanumeric().then(|| c.to_ascii_lowercase()));
        is_word = c.is_ascii_lowercase() || c.is_ascii_digit();
    }
    if text.starts_with(|c: char| c.is_ascii_lowercase()) { text } else { format!("component_{text}") }
}

/// The name, with a number if it is taken.
pub(super) fn unique(name: &str, taken: &mut BTreeSet<String>) -> String {
    let numbered = |n: usize| if n == 1 { name.to_owned() } else { format!("{name}_{n}") };
    let free = (1..).map(numbered).find(|name| !taken.contains(name)).unwrap_or_default();
    taken.insert(free.clone());
    free
}

#[derive(Default)]
struct Text {
    text: String,
    origins: Vec<(usize, Range<usize>)>,
}

impl Text {
    /// Adds lines that stem from the element at `span`.
    fn add(&mut self, span: Range<usize>, lines: &str) {
        self.origins.push((self.text.len(), span));
        self.text += lines;
        self.text.push('\n');
    }
}

/// The text, and the places of the elements from which its parts stem. Mistakes are reported.
pub(super) fn write(reader: &mut Reader<'_, '_>, root: &Element) -> (String, Vec<(usize, Range<usize>)>) {
    let mut text = Text::default();
    let times = simulation(reader, root);
    text.add(reader.span(root.place), &reader.take(times).unwrap_or_default());
    for at in 0..reader.owners.len() {
        component(reader, at, &mut text);
    }
    // The outputs of the root system are recorded, or, if it has none, those that components have as connectors.
    let outputs = |at: usize| {
        let connectors = reader.owners[at].connectors.iter().filter(|(_, causality)| **causality == Causality::Output);
        connectors.map(move |(name, _)| (at, *name))
    };
    let of_root = outputs(0).filter_map(|(at, name)| reader.source(at, name)).map(|edge| edge.from);
    let mut recorded: Vec<_> = of_root.filter(|(at, _)| reader.owners[*at].fmu.is_some()).collect();
    if recorded.is_empty() {
        recorded.extend((1..reader.owners.len()).filter(|at| reader.owners[*at].fmu.is_some()).flat_map(outputs));
    }
    let signals: BTreeSet<String> = recorded.into_iter().map(|(at, name)| signal(&reader.owners[at], name)).collect();
    let signals: Vec<String> = if signals.is_empty() { vec![quoted("*")] } else { signals.into_iter().collect() };
    text.add(reader.span(root.place), &format!("[record]\nsignals = [\n    {}\n]", signals.join(",\n    ")));
    if text.text.len() as u64 > TEXT_FILE {
        let message = format!("as a scenario, the system has {} bytes, the limit is {TEXT_FILE}", text.text.len());
        reader.refuse(root.place.error(message));
    }
    (text.text, text.origins)
}

fn signal(owner: &Owner<'_>, name: &str) -> String {
    quoted(&format!("{}:{name}", owner.id))
}

fn simulation(reader: &mut Reader<'_, '_>, root: &Element) -> Result<String, XmlError> {
    let experiment = root.child("DefaultExperiment").unwrap_or(root);
    let start = experiment.real("startTime")?.unwrap_or(0.0);
    let stop = experiment.real("stopTime")?.or(reader.choice.stop);
    let stop = stop.ok_or_else(|| experiment.place.error("the file has no stop time; set one with `--stop`"))?;
    let (mut step, mut others) = (None, BTreeSet::new());
    annotations(root, None, &mut |kind, element| {
        let size = |name| element.real(name).ok().flatten().filter(|step| *step > 0.0);
        step = step.or_else(|| size("baseStepSize")).or_else(|| size("stepSize"));
        others.extend((!KNOWN.contains(&kind)).then(|| kind.to_owned()));
    });
    if !others.is_empty() {
        let others: Vec<String> = others.into_iter().collect();
        reader.warn(root, format!("annotations are ignored: {}", others.join(", ")));
    }
    let fmus = reader.owners.iter().filter_map(|owner| owner.fmu.as_ref());
    let of_fmus = fmus.filter_map(|fmu| fmu.description.default_experiment.step_size).filter(|step| *step > 0.0);
    let (step, source) = match (reader.choice.step, step, of_fmus.min_by(f64::total_cmp)) {
        (Some(step), ..) => (step, "--step"),
        (None, Some(step), _) => (step, "an annotation"),
        (None, None, Some(step)) => (step, "the smallest step of the FMUs"),
        (None, None, None) => (thousandth(stop - start), "about a thousandth of the time"),
    };
    if source.contains("the ") {
        let message = format!("the file has no communication step; {step:?} s is {source}, `--step` sets another one");
        reader.warn(experiment, message);
    }
    let times = format!("start = {start:?}\nstop = {stop:?}\nstep = {step:?} # {source}\norder = \"auto\"");
    Ok(format!("connect_by_name = false\n\n[simulation]\n{times}\n"))
}

/// Calls a function with each element within an annotation, and the type of the annotation.
fn annotations<'e>(element: &'e Element, kind: Option<&'e str>, call: &mut impl FnMut(&str, &Element)) {
    let kind = if element.name == "Annotation" { element.attribute("type") } else { kind };
    if let Some(kind) = kind {
        call(kind, element);
    }
    element.children.iter().for_each(|child| annotations(child, kind, call));
}

/// A thousandth of a time, rounded down to 1, 2 or 5 times a power of ten.
fn thousandth(time: f64) -> f64 {
    let wanted = time / 1000.0 * (1.0 + 1e-9);
    let power = wanted.log10().floor();
    let digit = [5, 2].into_iter().find(|digit| f64::from(*digit) * 10f64.powf(power) <= wanted).unwrap_or(1);
    // Parsed, so that it is the double nearest to the decimal number.
    format!("{digit}e{power}").parse().unwrap_or(time)
}

/// Adds a component, and the connections that its inputs read.
fn component(reader: &mut Reader<'_, '_>, at: usize, text: &mut Text) {
    let Owner { element, id, fmu: Some(Fmu { stem, description }), incoming, .. } = &reader.owners[at] else { return };
    let (element, id, description) = (*element, id.clone(), description.clone());
    let is_exchange = element.attribute("implementation") == Some("ModelExchange");
    let interface = if is_exchange { "\ninterface = \"model-exchange\"" } else { "" };
    text.add(reader.span(element.place), &format!("[[component]]\nname = \"{id}\"\nfmu = {}{interface}", quoted(stem)));
    // An input of FMI 3.0 that is connected by another of its names.
    let aliases: BTreeSet<usize> = incoming.keys().filter_map(|name| description.variable(name)?.alias_of).collect();
    let (mut tables, mut connections) = (BTreeMap::<&str, Vec<(String, Place)>>::new(), Vec::new());
    for (index, variable) in description.variables.iter().enumerate() {
        let name = &variable.name;
        let source = reader.source(at, name).map(|source| (source, &reader.owners[source.from.0]));
        if let Some((source, writer)) = source.filter(|(_, writer)| writer.fmu.is_some()) {
            let (from, to) = (signal(writer, source.from.1), signal(&reader.owners[at], name));
            let linear = reader.linear(&source, (at, name));
            let linear = reader.take(linear).filter(|linear| *linear != Linear::IDENTITY);
            let linear = linear.map(|Linear { factor, offset }| format!("factor = {factor:?}\noffset = {offset:?}\n"));
            let linear = linear.unwrap_or_default();
            let convert = if source.convert { "" } else { "convert = false\n" };
            let lines = format!("\n[[connection]]\nfrom = {from}\nto = {to}\n{linear}{convert}");
            connections.push((lines, source.element.place));
            continue;
        }
        let (table, is_kept) = match variable.causality {
            // Inputs that nothing writes are constant.
            Causality::Input => ("inputs", aliases.contains(&index) || variable.alias_of.is_some()),
            Causality::StructuralParameter => ("structure", true),
            _ => ("parameters", true),
        };
        // The value of a connector of a system replaces that of the component.
        let bound = source.and_then(|(source, writer)| Some((writer.values.get(source.from.1)?, source.linear)));
        let bound = bound.or_else(|| Some((reader.owners[at].values.get(name)?, Linear::IDENTITY)));
        let (value, place) = match (bound, &variable.start) {
            (Some((bound, linear)), _) => {
                let place = bound.element.place;
                let value = value(&description, variable, bound, linear).map_err(|message| place.error(message));
                (reader.take(value), place)
            }
            (None, Some(start)) if !is_kept && !variable.is_array() && variable.base_type.is_number() => {
                let value = plain(start);
                if let Some((source, _)) = source.filter(|(source, _)| source.from.0 == 0) {
                    let input = source.from.1;
                    let message = format!("the input `{input}` of the system is constant: `{id}:{name}` is {value}");
                    reader.warn(source.element, message);
                }
                (Some(value), element.place)
            }
            _ => continue,
        };
        tables.entry(table).or_default().extend(value.map(|value| (format!("{} = {value}", quoted(name)), place)));
    }
    for (table, lines) in tables {
        text.add(reader.span(element.place), &format!("[component.{table}]"));
        lines.into_iter().for_each(|(line, place)| text.add(reader.span(place), &line));
    }
    connections.into_iter().for_each(|(lines, place)| text.add(reader.span(place), &lines));
    text.text.push('\n');
}

/// A parameter or constant in TOML.
fn value(
    description: &ModelDescription,
    variable: &Variable,
    bound: &Bound<'_>,
    linear: Linear,
) -> Result<String, String> {
    let mut number = match bound.value {
        Value::Real(number) if variable.base_type == BaseType::Real => number,
        _ => return Ok(plain(&bound.value)),
    };
    let mut apply = |linear: Linear| {
        if linear != Linear::IDENTITY {
            number = linear.of(number);
        }
    };
    let mut unit = None;
    if let (Some(given), Some(own)) = (&bound.unit, Declared::of(description, variable)) {
        let base = given.base.or_else(|| description.unit(&given.name)?.base);
        let given = Declared { name: given.name.clone(), base, is_relative: own.is_relative };
        // A unit without a definition may be one for display, which the scenario accepts.
        unit = Some(if base.is_none() { given.name.clone() } else { own.name.clone() });
        if base.is_some() {
            apply(given.conversion_to(&own).map_err(|UnitMismatch { words: [is, other], .. }| {
                format!("the value of `{}` is {is}, but the variable is {other}", variable.name)
            })?);
        }
    }
    apply(linear);
    Ok(match unit {
        Some(unit) => format!("{{ value = {number:?}, unit = {} }}", quoted(&unit)),
        None => format!("{number:?}"),
    })
}

fn plain(value: &Value) -> String {
    match value {
        Value::Unsigned(value) if i64::try_from(*value).is_err() => format!("\"{value}\""),
        Value::String(text) => quoted(text),
        Value::Binary { hex } => format!("{{ hex = \"{}\" }}", BinaryText::Hex.encode(hex)),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_lower_snake_case_and_unique() {
        for (name, expected) in [
            ("MyPlant", "my_plant"),
            ("PID 2", "pid_2"),
            ("a-b.c", "a_b_c"),
            ("x1Y", "x1_y"),
            ("plant_2", "plant_2"),
            ("2x", "component_2x"),
        ] {
            assert_eq!(snake_case(name), expected);
        }
        let mut taken = BTreeSet::new();
        assert_eq!(["a", "a", "a_2"].map(|name| unique(name, &mut taken)), ["a", "a_2", "a_2_2"]);
    }

    #[test]
    fn steps_are_round_numbers() {
        for (time, step) in [(1.0, 0.001), (20.0, 0.02), (7.0, 0.005), (1.7, 0.001), (3e-3, 2e-6), (4999.0, 2.0)] {
            assert_eq!(thousandth(time), step);
        }
    }
}
