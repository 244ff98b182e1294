//! Variables and model structure of FMI 3.0.

use super::types::{self, Type, Types};
use super::{
    MAX_ELEMENTS, MAX_INHERITED, MAX_NAME, Structure, Variables, bounded, causality, check_kinds, check_length, chosen,
    word,
};
use crate::bytes::BinaryText;
use crate::c_api::Reference;
use crate::description::{
    BaseType, Causality, Clock, DataType, Dimension, FmiVersion, Initial, IntervalVariability, StructuralParameters,
    Unknown, Value, Variability, Variable,
};
use crate::xml::{Element, XmlError};
use std::collections::HashMap;
use std::str::FromStr;

const FMI: FmiVersion = FmiVersion::V3;

pub(super) fn variables_and_structure(
    root: &Element,
    given: &StructuralParameters,
) -> Result<(Variables, Structure), XmlError> {
    let mut types = Types::new();
    for element in root.child("TypeDefinitions").into_iter().flat_map(|list| &list.children) {
        let Some(data_type) = element.name.strip_suffix("Type").and_then(word) else { continue };
        types.insert(bounded(element, "name", MAX_NAME)?, Type::new(element, data_type)?);
    }
    let mut reader =
        VariableReader { variables: Variables::default(), elements: Vec::new(), indices: HashMap::new(), given };
    for element in root.child("ModelVariables").into_iter().flat_map(|list| &list.children) {
        if let Some(data_type) = word(&element.name) {
            reader.add(element, data_type, &types)?;
        }
    }
    reader.link()?;
    let structure = reader.structure(root)?;
    Ok((reader.variables, structure))
}

struct VariableReader<'a> {
    variables: Variables,
    /// The XML element of each variable. For an alias, this is the element of the variable to which it belongs.
    elements: Vec<&'a Element>,
    /// Indices of the variables by value reference; `None` for a Clock.
    indices: HashMap<Reference, Option<usize>>,
    /// Values of structural parameters instead of their start values.
    given: &'a StructuralParameters,
}

impl<'a> VariableReader<'a> {
    fn add(&mut self, element: &'a Element, data_type: DataType, types: &Types<'_>) -> Result<(), XmlError> {
        let (name, reference) = types::identity(element)?;
        let index = self.variables.list.len();
        if self.indices.insert(reference, data_type.base_type().map(|_| index)).is_some() {
            let message = format!("variable `{name}` has the value reference {reference} of another variable");
            return Err(element.place.error(message));
        }
        let aliases = element.children.iter().filter(|child| child.name == "Alias");
        let Some(base_type) = data_type.base_type() else {
            let causality = causality(element, FMI)?;
            let declared = types::declared(element, &name, data_type, types)?;
            let source = |attribute: &str| types::source(element, declared, attribute);
            let text = |element: &Element| element.attribute("description").map(str::to_string);
            for named in std::iter::once(element).chain(aliases) {
                let name = bounded(named, "name", MAX_NAME)?.to_string();
                let description = text(named);
                self.variables.take(named, &name)?;
                let signal = types::variable(element, element, FMI, (BaseType::Boolean, DataType::Clock), types)?;
                let signal = Variable { name: name.clone(), description: description.clone(), ..signal };
                self.variables.clocks.push(Clock {
                    signal: Some(signal).filter(|_| causality == Causality::Output),
                    name,
                    reference,
                    causality,
                    interval_variability: chosen(source("intervalVariability"), "intervalVariability", FMI)?
                        .unwrap_or(IntervalVariability::Triggered),
                    interval: source("intervalDecimal").real("intervalDecimal")?,
                    shift: source("shiftDecimal").real("shiftDecimal")?.unwrap_or(0.0),
                    clocks: clocks(element)?,
                    priority: source("priority")
                        .attribute("priority")
                        .and_then(|text| text.trim().parse().ok())
                        .unwrap_or(0),
                    can_be_deactivated: source("canBeDeactivated").boolean("canBeDeactivated")?.unwrap_or(false),
                    description,
                });
            }
            return Ok(());
        };
        let variable = Variable {
            clocks: clocks(element)?,
            intermediate_update: element.boolean("intermediateUpdate")?.unwrap_or_default(),
            ..types::variable(element, element, FMI, (base_type, data_type), types)?
        };
        let mut named = vec![(element, variable.clone())];
        for alias in aliases {
            let display_unit = alias.attribute("displayUnit").map(str::to_string);
            if let Some(unit) = &display_unit {
                check_length(alias, "displayUnit", unit, MAX_INHERITED)?;
            }
            let is_output = variable.causality == Causality::Output;
            named.push((
                alias,
                Variable {
                    name: bounded(alias, "name", MAX_NAME)?.to_string(),
                    description: alias.attribute("description").map(str::to_string),
                    display_unit: display_unit.or_else(|| variable.display_unit.clone()),
                    causality: if is_output { Causality::Output } else { Causality::Local },
                    initial: Some(Initial::Calculated),
                    start: None,
                    starts: Vec::new(),
                    alias_of: Some(index),
                    ..variable.clone()
                },
            ));
        }
        for (place, variable) in named {
            self.variables.take(place, &variable.name)?;
            self.variables.list.push(variable);
            self.elements.push(element);
        }
        Ok(())
    }

    fn index(&self, element: &Element, reference: Reference) -> Result<Option<usize>, XmlError> {
        self.indices.get(&reference).copied().ok_or_else(|| {
            element
                .place
                .error(format!("<{}> refers to the value reference {reference}, which no variable has", element.name))
        })
    }

    /// Replaces value references with variables, and reads the attributes that depend on array sizes.
    fn link(&mut self) -> Result<(), XmlError> {
        let mut total = 0_usize;
        for i in 0..self.variables.list.len() {
            let element = self.elements[i];
            let derivative = element.parsed("derivative", "the value reference of a variable")?;
            let alias_of = self.variables.list[i].alias_of;
            if let Some(reference) = derivative.filter(|_| alias_of.is_none()) {
                let of = self.index(element, reference)?;
                let opaque = || element.place.error(format!("value reference {reference} is a Clock"));
                self.variables.list[i].derivative_of = Some(of.ok_or_else(opaque)?);
            }
            let dimensions = self.dimensions(element)?;
            let length = |dimension: &Dimension| match dimension {
                Dimension::Fixed(length) => Ok(*length),
                Dimension::Parameter(parameter) => self.length(element, *parameter),
            };
            let lengths = dimensions.iter().map(length).collect::<Result<Vec<_>, _>>()?;
            let is_given = |dimension: &Dimension| match dimension {
                Dimension::Fixed(_) => false,
                Dimension::Parameter(parameter) => self.given.contains_key(&self.variables.list[*parameter].name),
            };
            let is_resized = dimensions.iter().any(is_given);
            let size = lengths.iter().fold(1_usize, |size, length| size.saturating_mul(*length));
            total = if dimensions.is_empty() { total } else { total.saturating_add(size) };
            if total > MAX_ELEMENTS {
                let message = format!("the arrays, including this one, have more than {MAX_ELEMENTS} elements");
                return Err(element.place.error(message));
            }
            let variable = &mut self.variables.list[i];
            (variable.dimensions, variable.lengths, variable.size) = (dimensions, lengths, size);
            let value = self.given.get(&variable.name);
            if value.is_some() && variable.causality == Causality::StructuralParameter {
                variable.start = value.cloned();
            } else if alias_of.is_none() && !is_resized {
                start_values(element, variable)?;
            }
        }
        Ok(())
    }

    fn dimensions(&self, element: &Element) -> Result<Vec<Dimension>, XmlError> {
        let dimensions = element.children.iter().filter(|child| child.name == "Dimension");
        dimensions
            .map(|dimension| {
                if let Some(length) = dimension.parsed("start", "a whole number from 0")? {
                    return Ok(Dimension::Fixed(length));
                }
                let reference = dimension.parsed("valueReference", "the value reference of a structural parameter")?;
                let reference = reference.ok_or_else(|| {
                    dimension.place.error("<Dimension> must have one of the attributes `start` and `valueReference`")
                })?;
                match self.index(dimension, reference)? {
                    Some(i) if self.variables.list[i].causality == Causality::StructuralParameter => {
                        Ok(Dimension::Parameter(i))
                    }
                    Some(i) if self.variables.list[i].variability == Variability::Constant => {
                        self.length(element, i).map(Dimension::Fixed)
                    }
                    _ => Err(dimension.place.error(format!(
                        "<Dimension> refers to the value reference {reference}, which is not a structural parameter or \
                         constant"
                    ))),
                }
            })
            .collect()
    }

    fn length(&self, element: &Element, parameter: usize) -> Result<usize, XmlError> {
        let variable = &self.variables.list[parameter];
        let given = self.given.get(&variable.name).filter(|_| variable.causality == Causality::StructuralParameter);
        let given = given.and_then(Value::whole).and_then(|value| usize::try_from(value).ok());
        let written = self.elements[parameter].parsed("start", "a whole number from 0")?;
        given.or(written).ok_or_else(|| {
            let name = &variable.name;
            element.place.error(format!("`{name}` is the length of an array, so it must have a start value"))
        })
    }

    fn structure(&self, root: &Element) -> Result<Structure, XmlError> {
        let list = |tag: &str| -> Result<Vec<Unknown>, XmlError> {
            let elements = root.child("ModelStructure").into_iter().flat_map(|structure| &structure.children);
            elements.filter(|child| child.name == tag).filter_map(|child| self.unknown(child).transpose()).collect()
        };
        let (derivatives, event_indicators) = (list("ContinuousStateDerivative")?, list("EventIndicator")?);
        self.elements(root, "ContinuousStateDerivative", &derivatives)?;
        Ok(Structure {
            outputs: list("Output")?,
            derivatives,
            initial_unknowns: list("InitialUnknown")?,
            number_of_event_indicators: self.elements(root, "EventIndicator", &event_indicators)?,
            event_indicators,
        })
    }

    /// The number of elements in a list, which may contain an array more than once.
    fn elements(&self, root: &Element, tag: &str, unknowns: &[Unknown]) -> Result<usize, XmlError> {
        let sizes = unknowns.iter().map(|unknown| self.variables.list[unknown.variable].size);
        let total = sizes.fold(0_usize, usize::saturating_add);
        if total > MAX_ELEMENTS {
            let place = root.child("ModelStructure").map_or(root.place, |structure| structure.place);
            return Err(place.error(format!("<{tag}> has {total} elements, at most {MAX_ELEMENTS} are read")));
        }
        Ok(total)
    }

    /// An entry in the model structure; `None` for a Clock.
    fn unknown(&self, element: &Element) -> Result<Option<Unknown>, XmlError> {
        let reference = element
            .parsed("valueReference", "a whole number from 0")?
            .ok_or_else(|| element.place.error(format!("<{}> lacks the attribute `valueReference`", element.name)))?;
        let Some(variable) = self.index(element, reference)? else { return Ok(None) };
        let index = |written: &str| {
            let reference = written.parse().map_err(|_| {
                let message = format!("<{}> depends on \"{written}\", which is not a value reference", element.name);
                element.place.error(message)
            })?;
            self.index(element, reference)
        };
        let list = element.attribute("dependencies");
        let list =
            list.map(|list| list.split_ascii_whitespace().map(index).collect::<Result<Vec<_>, _>>()).transpose()?;
        check_kinds(element, FMI, list.as_ref().map(Vec::len))?;
        Ok(Some(Unknown { variable, dependencies: list.map(|list| list.into_iter().flatten().collect()) }))
    }
}

/// The attribute `clocks`.
fn clocks(element: &Element) -> Result<Vec<Reference>, XmlError> {
    let reference = |text: &str| {
        let message = || format!("<{}> has clocks=\"{text}\", which is not a list of value references", element.name);
        text.parse().map_err(|_| element.place.error(message()))
    };
    element.attribute("clocks").unwrap_or_default().split_ascii_whitespace().map(reference).collect()
}

/// Parses a value in a list; `None` if it does not have this type.
fn value(text: &str, data_type: DataType) -> Option<Value> {
    fn integer<T: FromStr + Into<i128>>(text: &str) -> Option<i128> {
        text.parse::<T>().ok().map(Into::into)
    }
    let value = match data_type {
        DataType::Float64 => return text.parse().ok().map(Value::Real),
        DataType::Float32 => return text.parse::<f32>().ok().map(|value| Value::Real(value.into())),
        DataType::Boolean => {
            return match text {
                "true" | "1" => Some(Value::Boolean(true)),
                "false" | "0" => Some(Value::Boolean(false)),
                _ => None,
            };
        }
        DataType::Int8 => integer::<i8>(text),
        DataType::UInt8 => integer::<u8>(text),
        DataType::Int16 => integer::<i16>(text),
        DataType::UInt16 => integer::<u16>(text),
        DataType::Int32 => integer::<i32>(text),
        DataType::UInt32 => integer::<u32>(text),
        DataType::Int64 | DataType::Enumeration => integer::<i64>(text),
        DataType::UInt64 => integer::<u64>(text),
        DataType::String | DataType::Binary | DataType::Clock => None,
    };
    value.and_then(Value::integer)
}

/// Reads the start values of a variable; its size must be known.
fn start_values(element: &Element, variable: &mut Variable) -> Result<(), XmlError> {
    let name = &variable.name;
    let mut values = Vec::new();
    if matches!(variable.data_type, DataType::String | DataType::Binary) {
        for start in element.children.iter().filter(|child| child.name == "Start") {
            let text = start.attribute("value").unwrap_or_default();
            values.push(match variable.data_type {
                DataType::String => Value::String(text.to_string()),
                _ => Value::Binary {
                    hex: BinaryText::Hex.decode(text.trim()).ok_or_else(|| {
                        let message = format!("a start value of `{name}` is not a list of hexadecimal digits in pairs");
                        start.place.error(message)
                    })?,
                },
            });
        }
        if values.is_empty() {
            return Ok(());
        }
    } else {
        let Some(written) = element.attribute("start") else { return Ok(()) };
        for text in written.split_ascii_whitespace() {
            values.push(value(text, variable.data_type).ok_or_else(|| {
                let article = if "AEIOU".contains(&element.name[..1]) { "an" } else { "a" };
                let message = format!("the start value \"{text}\" of `{name}` is not {article} {}", element.name);
                element.place.error(message)
            })?);
        }
    }
    // One value applies to all elements of an array.
    if variable.is_array() && values.len() == 1 {
        let value = values.remove(0);
        values = vec![value; variable.size];
    }
    if values.len() != variable.size {
        let message = format!("variable `{name}` has {} start values, but {} elements", values.len(), variable.size);
        return Err(element.place.error(message));
    }
    if variable.is_array() {
        variable.starts = values;
    } else {
        variable.start = values.pop();
    }
    Ok(())
}
