//! Common parts of the model descriptions in both versions of FMI.

use std::collections::BTreeMap;
use std::fmt::Display;

use quick_xml::events::{BytesDecl, Event};
use quick_xml::{ElementWriter, Writer};

use super::LOG_CATEGORIES;
use crate::calls::Version;
use crate::enumeration::Item;
use crate::model::Info;
use crate::number::Size;
use crate::runner::{Kind as ModelKind, Model};
use crate::unit::{DisplayUnit, Unit};
use crate::variable::{Declaration, Details, Kind, Layout, Role, Variable};

pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}

/// The shortest text that parses to the same number in the precision of the variable: FMI 2.0 has 64 bits only.
fn number_of(kind: &Kind, value: f64, version: Version) -> String {
    match (kind, version) {
        (Kind::Float32(_), Version::Fmi3) => format!("{:?}", value as f32),
        _ => number(value),
    }
}

pub(super) fn list(numbers: impl IntoIterator<Item = usize>) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

pub(super) type Written = std::io::Result<()>;
pub(super) type Xml = Writer<Vec<u8>>;
pub(super) type Attributes = Vec<(&'static str, String)>;

pub(super) fn borrowed(attributes: &Attributes) -> Vec<(&str, &dyn Display)> {
    attributes.iter().map(|(name, value)| (*name, value as &dyn Display)).collect()
}

fn open<'x>(xml: &'x mut Xml, name: &'x str, attributes: &[(&str, &dyn Display)]) -> ElementWriter<'x, Vec<u8>> {
    let element = xml.create_element(name);
    attributes.iter().fold(element, |element, (name, value)| element.with_attribute((*name, &*value.to_string())))
}

pub(super) fn empty(xml: &mut Xml, name: &str, attributes: &[(&str, &dyn Display)]) -> Written {
    open(xml, name, attributes).write_empty().map(drop)
}

pub(super) fn element(
    xml: &mut Xml,
    name: &str,
    attributes: &[(&str, &dyn Display)],
    content: impl FnOnce(&mut Xml) -> Written,
) -> Written {
    open(xml, name, attributes).write_inner_content(content).map(drop)
}

pub(super) fn document(
    name: &str,
    attributes: &Attributes,
    content: impl FnOnce(&mut Xml) -> Written,
) -> std::io::Result<Vec<u8>> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    element(&mut xml, name, &borrowed(attributes), content)?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

/// Attributes of the root element. The manifest may have no authors or no license; these attributes are then omitted.
pub(super) fn facts(version: &str, guid: &'static str, info: &Info, layout: &Layout) -> Attributes {
    let tool = concat!("fmu ", env!("CARGO_PKG_VERSION"), " (Rust)");
    let first = [("fmiVersion", version.to_owned()), ("modelName", info.name.to_owned()), (guid, String::new())];
    let facts = [
        ("description", info.description.to_owned()),
        ("author", info.authors.replace(':', ", ")),
        ("version", info.version.to_owned()),
        ("license", info.license.to_owned()),
        ("generationTool", tool.to_owned()),
        ("variableNamingConvention", naming_convention(layout).to_owned()),
    ];
    first.into_iter().chain(facts.into_iter().filter(|(_, value)| !value.is_empty())).collect()
}

/// In a `structured` name, a dot separates a component from its parent. This is true for names in this crate's
/// convention, lower snake case. In other names a dot may be an ordinary character, so these names are declared as
/// `flat`.
fn naming_convention(layout: &Layout) -> &'static str {
    if layout.names().all(is_structured) { "structured" } else { "flat" }
}

/// Returns true for lower snake case with indices, joined by dots, and in `der(…)` for a derivative.
fn is_structured(name: &str) -> bool {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_part = |part: &str| {
        let word = match part.strip_suffix(']').map(|rest| rest.split_once('[')) {
            Some(Some((word, indices))) if indices.split(',').all(is_number) => word,
            _ => part,
        };
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
    };
    name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')')).unwrap_or(name).split('.').all(is_part)
}

pub(super) fn is_xml(c: char) -> bool {
    !(c < ' ' && !"\t\n\r".contains(c) || c == '\u{fffe}' || c == '\u{ffff}')
}

/// Writes line breaks and tabs in attributes as character references, because a parser turns literal ones into spaces.
pub(super) fn with_references(xml: &str) -> String {
    let mut result = String::with_capacity(xml.len());
    // Attribute values are in double quotes. Quotes occur nowhere else, because quotes inside texts are escaped.
    let mut is_value = false;
    for c in xml.chars() {
        is_value ^= c == '"';
        match c {
            '\n' if is_value => result.push_str("&#10;"),
            '\r' if is_value => result.push_str("&#13;"),
            '\t' if is_value => result.push_str("&#9;"),
            _ => result.push(c),
        }
    }
    result
}

pub(super) fn unit_definitions(xml: &mut Xml, layout: &Layout) -> Written {
    let mut units: BTreeMap<&str, (Unit, Vec<DisplayUnit>)> = BTreeMap::new();
    for variable in &layout.variables {
        let Some(real) = variable.declaration.kind.real() else { continue };
        if real.unit.is_declared() {
            let (_, display) = units.entry(real.unit.name).or_insert_with(|| (real.unit, Vec::new()));
            let of_aliases = variable.declaration.aliases.iter().filter_map(|alias| alias.display);
            for one in real.unit.display.iter().copied().chain(real.display).chain(of_aliases) {
                if !display.iter().any(|known| known.name == one.name) {
                    display.push(one);
                }
            }
        }
    }
    if units.is_empty() {
        return Ok(());
    }
    let other_than = |default: f64, name, value| (value != default).then(|| (name, number(value)));
    element(xml, "UnitDefinitions", &[], |xml| {
        units.values().try_for_each(|(unit, display)| {
            element(xml, "Unit", &[("name", &unit.name)], |xml| {
                let exponents = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"].into_iter().zip(unit.exponents);
                let exponents = exponents.filter(|(_, exponent)| *exponent != 0);
                let mut base: Attributes = exponents.map(|(name, exponent)| (name, exponent.to_string())).collect();
                base.extend(other_than(1.0, "factor", unit.factor));
                base.extend(other_than(0.0, "offset", unit.offset));
                empty(xml, "BaseUnit", &borrowed(&base))?;
                display.iter().try_for_each(|display| {
                    let mut attributes = vec![("name", display.name.to_owned()), ("factor", number(display.factor))];
                    attributes.extend(other_than(0.0, "offset", display.offset));
                    empty(xml, "DisplayUnit", &borrowed(&attributes))
                })
            })
        })
    })
}

pub(super) fn log_categories(xml: &mut Xml) -> Written {
    element(xml, "LogCategories", &[], |xml| {
        LOG_CATEGORIES
            .iter()
            .try_for_each(|(name, description)| empty(xml, "Category", &[("name", name), ("description", description)]))
    })
}

pub(super) fn default_experiment(xml: &mut Xml, info: &Info) -> Written {
    let (stop, step) = (number(info.stop_time), number(info.step_size));
    empty(xml, "DefaultExperiment", &[("startTime", &"0.0"), ("stopTime", &stop), ("stepSize", &step)])
}

/// Attributes of a variable or array in both versions, and true if it has a start value.
pub(super) fn attributes<M: Model>(
    layout: &Layout,
    variable: &Variable,
    name: &str,
    description: &str,
) -> (Attributes, bool) {
    let Declaration { kind, tunable, local, calculated, details, .. } = &variable.declaration;
    let is_real = matches!(kind, Kind::Real(_));
    let fixed = |is_tunable: bool| if is_tunable { "tunable" } else { "fixed" };
    let discrete = |is_continuous: bool| if is_continuous { "continuous" } else { "discrete" };
    let exact = |is_calculated: bool| if is_calculated { "calculated" } else { "exact" };
    let (causality, variability, initial) = match variable.role {
        Role::Parameter => ("parameter", fixed(*tunable), "exact"),
        // Calculated parameters may depend on any parameter.
        Role::Calculated => {
            let is_tunable = layout.variables.iter().any(|variable| variable.declaration.tunable);
            ("calculatedParameter", fixed(is_tunable), "calculated")
        }
        // A clocked variable is discrete (FMI 3.0, section 2.4.7.4).
        Role::Input => ("input", discrete(is_real && details.clocks.is_empty()), ""),
        Role::Output => {
            let is_continuous = M::KIND == ModelKind::Continuous && is_real && details.clocks.is_empty();
            ("output", discrete(is_continuous), exact(M::CALCULATES_OUTPUTS))
        }
        Role::State => (if *local { "local" } else { "output" }, "continuous", exact(*calculated)),
        Role::Derivative => ("local", "continuous", "calculated"),
        Role::Clocked | Role::Previous => ("local", "discrete", "calculated"),
        Role::Clock => ("input", "discrete", ""),
    };
    let (causality, variability, initial) = match (variable.declaration.details.constant, variable.role) {
        // A calculated parameter cannot be constant.
        (true, Role::Calculated) => ("local", "constant", "exact"),
        (true, _) => (causality, "constant", "exact"),
        (false, _) => (causality, variability, initial),
    };
    let attributes = [
        ("name", name),
        ("valueReference", &variable.reference.to_string()),
        ("description", description),
        ("causality", causality),
        ("variability", variability),
        ("initial", initial),
    ];
    let is_written = |(name, value): &(&str, &str)| *name != "initial" || !value.is_empty();
    let attributes = attributes.into_iter().filter(is_written).map(|(name, value)| (name, value.to_owned()));
    (attributes.collect(), initial != "calculated")
}

pub(super) fn type_attributes(layout: &Layout, variable: &Variable, version: Version) -> Attributes {
    let mut attributes = Vec::new();
    let kind = &variable.declaration.kind;
    match kind {
        Kind::Real(real) | Kind::Float32(real) => {
            if real.unit.is_declared() {
                attributes.push(("unit", real.unit.name.to_owned()));
            }
            attributes.extend(real.display.map(|display| ("displayUnit", display.name.to_owned())));
            // 1 is the default. It is written for states only, because solvers use their nominal values.
            let nominal = real.nominal.filter(|&nominal| nominal != 1.0 || variable.role == Role::State);
            for (name, value) in [("min", real.min), ("max", real.max), ("nominal", nominal)] {
                attributes.extend(value.map(|value| (name, number_of(kind, value, version))));
            }
        }
        Kind::Integer { size, min, max, items, type_name, is_enumeration, .. } => {
            if !items.is_empty() {
                attributes.push(("declaredType", simple_type(layout, type_name, *is_enumeration)));
            }
            // The limits of the type are the default. In FMI 2.0, all types are Integers of 32 bits.
            let range = size.range();
            let is_other = version == Version::Fmi2 && *size != Size::Int32;
            for (name, value, none) in [("min", min, range.start()), ("max", max, range.end())] {
                if is_other || value != none {
                    attributes.push((name, value.to_string()));
                }
            }
        }
        Kind::Binary { most, mime, .. } => {
            attributes.extend((!mime.is_empty()).then(|| ("mimeType", (*mime).to_owned())));
            attributes.push(("maxSize", most.to_string()));
        }
        Kind::Boolean { .. } | Kind::String { .. } | Kind::Clock(_) => {}
    }
    let Details { quantity, relative_quantity, unbounded, .. } = variable.declaration.details;
    attributes.extend((!quantity.is_empty()).then(|| ("quantity", quantity.to_owned())));
    for (name, value) in [("relativeQuantity", relative_quantity), ("unbounded", unbounded)] {
        attributes.extend(value.then(|| (name, "true".to_owned())));
    }
    attributes
}

pub(super) fn start(variable: &Variable, version: Version) -> String {
    match &variable.declaration.kind {
        kind @ (Kind::Real(real) | Kind::Float32(real)) => number_of(kind, real.start, version),
        Kind::Integer { start, .. } => start.to_string(),
        Kind::Boolean { start } => start.to_string(),
        Kind::Clock(_) => "false".to_owned(),
        Kind::String { start } => start.clone(),
        Kind::Binary { start, .. } => start.iter().map(|byte| format!("{byte:02x}")).collect(),
    }
}

/// Type name of an enumeration. If some variables use it as an Integer and others as an FMI Enumeration, there are two
/// types.
pub(super) fn simple_type(layout: &Layout, name: &str, is_enumeration: bool) -> String {
    let is_integer = |variable: &Variable| matches!(&variable.declaration.kind, Kind::Integer { type_name, is_enumeration: false, .. } if *type_name == name);
    let is_both = is_enumeration && layout.variables.iter().any(is_integer);
    if is_both { format!("{name}Enumeration") } else { name.to_owned() }
}

/// Writes the types of enumerations, sorted by name. `write` gets the attributes of a type, its items, and the size and
/// limits of an Integer. Most types are Integers, because several masters cannot set FMI enumerations; the description
/// of such a type lists the meanings of the numbers.
pub(super) fn type_definitions(
    xml: &mut Xml,
    layout: &Layout,
    write: impl Fn(&mut Xml, Attributes, &[Item], Option<(Size, Attributes)>) -> Written,
) -> Written {
    let mut types = BTreeMap::new();
    for variable in &layout.variables {
        if let Kind::Integer { size, items, type_name, min, max, is_enumeration, .. } = &variable.declaration.kind
            && !items.is_empty()
        {
            let limits = (!is_enumeration).then(|| (*size, vec![("min", min.to_string()), ("max", max.to_string())]));
            types.insert(simple_type(layout, type_name, *is_enumeration), (*items, limits));
        }
    }
    if types.is_empty() {
        return Ok(());
    }
    element(xml, "TypeDefinitions", &[], |xml| {
        types.into_iter().try_for_each(|(name, (items, limits))| {
            let described = items.iter().map(|item| format!("{} {}: {}", item.value, item.name, item.description));
            let description = described.collect::<Vec<_>>().join("; ");
            write(xml, vec![("name", name), ("description", description)], items, limits)
        })
    })
}

/// Writes the element of an interface, with the capabilities that the FMU has and its other attributes.
pub(super) fn interface(
    xml: &mut Xml,
    name: &str,
    info: &Info,
    capabilities: &[(&str, bool)],
    others: &[(&str, &dyn Display)],
) -> Written {
    let capabilities = capabilities.iter().filter(|(_, has)| *has);
    let mut attributes: Vec<(&str, &dyn Display)> = vec![("modelIdentifier", &info.name)];
    attributes.extend(capabilities.map(|(capability, has)| (*capability, has as &dyn Display)));
    attributes.extend(others);
    empty(xml, name, &attributes)
}

pub(super) fn items(xml: &mut Xml, items: &[Item]) -> Written {
    items.iter().try_for_each(|item| {
        empty(xml, "Item", &[("name", &item.name), ("value", &item.value), ("description", &item.description)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_the_convention_are_structured() {
        for name in ["x", "tire.front_left.load", "x[1]", "x[1,12].y2", "der(axle.rear[2].speed)"] {
            assert!(is_structured(name), "{name}");
        }
        for name in
            ["X", "acc.setSpeed", "VehSpd_kph", "a b", "a..b", "a.", "1st", "x[]", "x[a]", "x.1", "der(X)", "grad(x)"]
        {
            assert!(!is_structured(name), "{name}");
        }
    }

    /// Reference: XML 1.0, section 3.3.3, normalization of attribute values.
    #[test]
    fn line_breaks_in_attributes_are_character_references() {
        let xml = "<?xml version=\"1.0\"?>\n<a b=\"1\n2\t3\r\">\n\t<c d=\"\"/>\n</a>\n";
        let expected = "<?xml version=\"1.0\"?>\n<a b=\"1&#10;2&#9;3&#13;\">\n\t<c d=\"\"/>\n</a>\n";
        assert_eq!(with_references(xml), expected);
        assert!("\t\n\r ä\u{10ffff}".chars().all(is_xml));
        assert!(!"\0\u{b}\u{1b}\u{fffe}".chars().any(is_xml));
    }
}
