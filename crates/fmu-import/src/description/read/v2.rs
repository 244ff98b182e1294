//! Variables and model structure of FMI 2.0.

use super::{
    MAX_INHERITED, MAX_NAME, Structure, Variables, bounded, causality, check_length, children, dependency_kinds,
    initial, items, variability,
};
use crate::description::{BaseType, DataType, FmiVersion, Item, Unknown, Value, Variability, Variable};
use crate::xml::{Element, XmlError};
use std::collections::HashMap;
use std::sync::Arc;

/// Variables are numbered from 1 in document order, which the model structure refers to.
pub(super) fn variables_and_structure(root: &Element) -> Result<(Variables, Structure), XmlError> {
    let mut types = HashMap::new();
    for simple_type in children(root, "TypeDefinitions", "SimpleType") {
        types.insert(bounded(simple_type, "name", MAX_NAME)?, SimpleType::new(simple_type)?);
    }
    let mut variables = Variables::default();
    for element in children(root, "ModelVariables", "ScalarVariable") {
        variables.push(element, variable(element, &types)?)?;
    }
    let count = variables.list.len();
    for (element, variable) in children(root, "ModelVariables", "ScalarVariable").zip(&variables.list) {
        if let Some(of) = variable.derivative_of
            && of >= count
        {
            let message =
                format!("variable `{}` is the derivative of variable {}, there are {count}", variable.name, of + 1);
            return Err(element.place.error(message));
        }
    }
    let list = |list| -> Result<Vec<Unknown>, XmlError> {
        root.child("ModelStructure")
            .into_iter()
            .flat_map(|s| children(s, list, "Unknown"))
            .map(|element| unknown(element, count))
            .collect()
    };
    let structure = Structure {
        outputs: list("Outputs")?,
        derivatives: list("Derivatives")?,
        initial_unknowns: list("InitialUnknowns")?,
        event_indicators: Vec::new(),
        number_of_event_indicators: root.parsed("numberOfEventIndicators", "a whole number from 0")?.unwrap_or(0),
    };
    Ok((variables, structure))
}

/// The five elements that say the type of a variable.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Real,
    Integer,
    Boolean,
    String,
    Enumeration,
}

/// The child that says the type of a variable or of a type definition.
fn typed_child(element: &Element) -> Result<(&Element, Kind), XmlError> {
    element
        .children
        .iter()
        .find_map(|child| {
            let kind = match child.name.as_str() {
                "Real" => Kind::Real,
                "Integer" => Kind::Integer,
                "Boolean" => Kind::Boolean,
                "String" => Kind::String,
                "Enumeration" => Kind::Enumeration,
                _ => return None,
            };
            Some((child, kind))
        })
        .ok_or_else(|| {
            element.place.error(format!(
                "<{}> has no type, expected <Real>, <Integer>, <Boolean>, <String> or <Enumeration>",
                element.name
            ))
        })
}

/// A type definition: what its variables inherit.
struct SimpleType<'a> {
    element: &'a Element,
    kind: Kind,
    items: Arc<[Item]>,
}

impl<'a> SimpleType<'a> {
    fn new(definition: &'a Element) -> Result<Self, XmlError> {
        let (element, kind) = typed_child(definition)?;
        let items = if kind == Kind::Enumeration { items(element)? } else { Arc::default() };
        Ok(Self { element, kind, items })
    }
}

fn variable(element: &Element, types: &HashMap<&str, SimpleType<'_>>) -> Result<Variable, XmlError> {
    let name = bounded(element, "name", MAX_NAME)?.to_string();
    let (own, kind) = typed_child(element)?;
    let declared = match own.attribute("declaredType") {
        None => None,
        Some(type_name) => match types.get(type_name) {
            Some(definition) if definition.kind == kind => Some(definition),
            Some(_) => {
                return Err(own.place.error(format!("variable `{name}`: type `{type_name}` is of another base type")));
            }
            None => {
                return Err(own.place.error(format!("variable `{name}`: type `{type_name}` is not defined")));
            }
        },
    };
    // An attribute of the variable stands above that of its type.
    let source = |attribute: &str| match (own.attribute(attribute), declared) {
        (None, Some(definition)) => definition.element,
        _ => own,
    };
    let text = |attribute| {
        let text = source(attribute).attribute(attribute);
        text.map(|text| check_length(source(attribute), attribute, text, MAX_INHERITED).map(|()| text.to_string()))
            .transpose()
    };
    let number = |attribute| source(attribute).real(attribute);
    let (base_type, data_type) = match kind {
        Kind::Real => (BaseType::Real, DataType::Float64),
        Kind::Integer => (BaseType::Integer, DataType::Int32),
        Kind::Enumeration => (BaseType::Integer, DataType::Enumeration),
        Kind::Boolean => (BaseType::Boolean, DataType::Boolean),
        Kind::String => (BaseType::String, DataType::String),
    };
    let start = match base_type {
        BaseType::Real => own.real("start")?.map(Value::Real),
        BaseType::Integer => own.parsed("start", "a whole number")?.map(Value::Integer),
        BaseType::Boolean => own.boolean("start")?.map(Value::Boolean),
        BaseType::String => own.attribute("start").map(|s| Value::String(s.to_string())),
    };
    let causality = causality(element, FmiVersion::V2)?;
    let default = if base_type == BaseType::Real { Variability::Continuous } else { Variability::Discrete };
    let variability = variability(element, FmiVersion::V2)?.unwrap_or(default);
    let initial = initial(element, causality, variability, FmiVersion::V2)?;
    let derivative_of = own
        .parsed::<usize>("derivative", "the number of a variable, from 1")?
        .map(|number| number.checked_sub(1).ok_or_else(|| own.place.error("variables are numbered from 1")))
        .transpose()?;
    Ok(Variable {
        reference: element
            .parsed("valueReference", "a whole number from 0")?
            .ok_or_else(|| element.place.error(format!("variable `{name}` lacks the attribute `valueReference`")))?,
        description: element.attribute("description").map(str::to_string),
        causality,
        variability,
        initial,
        base_type,
        data_type,
        dimensions: Vec::new(),
        lengths: Vec::new(),
        size: 1,
        start,
        starts: Vec::new(),
        other_start: None,
        min: number("min")?,
        max: number("max")?,
        nominal: number("nominal")?,
        quantity: text("quantity")?,
        unit: text("unit")?,
        display_unit: text("displayUnit")?,
        relative_quantity: source("relativeQuantity").boolean("relativeQuantity")?.unwrap_or(false),
        declared_type: own.attribute("declaredType").map(str::to_string),
        items: declared.map(|definition| Arc::clone(&definition.items)).unwrap_or_default(),
        derivative_of,
        is_clocked: false,
        alias_of: None,
        name,
    })
}

fn unknown(element: &Element, variables: usize) -> Result<Unknown, XmlError> {
    let index = |number: usize| match number.checked_sub(1) {
        Some(i) if i < variables => Ok(i),
        _ => Err(element.place.error(format!("<Unknown> names variable {number}, expected 1 to {variables}"))),
    };
    let number: Option<usize> = element.parsed("index", "the number of a variable, from 1")?;
    let number = number.ok_or_else(|| element.place.error("<Unknown> lacks the attribute `index`"))?;
    let dependencies = element
        .attribute("dependencies")
        .map(|list| {
            list.split_ascii_whitespace()
                .map(|text| {
                    let number = text.parse().map_err(|_| {
                        element
                            .place
                            .error(format!("<Unknown> depends on \"{text}\", expected the number of a variable"))
                    })?;
                    index(number)
                })
                .collect::<Result<Vec<_>, _>>()
        })
        .transpose()?;
    let kinds = dependency_kinds(element, FmiVersion::V2)?;
    if !kinds.is_empty() && Some(kinds.len()) != dependencies.as_ref().map(Vec::len) {
        return Err(element.place.error("<Unknown> has another number of dependenciesKind than of dependencies"));
    }
    Ok(Unknown { variable: index(number)?, dependencies, kinds })
}
