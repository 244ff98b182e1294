//! Variables and model structure of FMI 2.0.

use super::types::{self, Type, Types};
use super::{MAX_ELEMENTS, MAX_NAME, Structure, Variables, bounded, check_kinds};
use crate::description::{BaseType, DataType, FmiVersion, Unknown, Value, Variable};
use crate::xml::{Element, XmlError};

/// The model structure refers to variables by their position in the document, from 1.
pub(super) fn variables_and_structure(root: &Element) -> Result<(Variables, Structure), XmlError> {
    let mut types = Types::new();
    for simple_type in root.listed("TypeDefinitions", "SimpleType") {
        let (element, (_, data_type)) = typed_child(simple_type)?;
        types.insert(bounded(simple_type, "name", MAX_NAME)?, Type::new(element, data_type)?);
    }
    let mut variables = Variables::default();
    for element in root.listed("ModelVariables", "ScalarVariable") {
        let variable = variable(element, &types)?;
        variables.take(element, &variable.name)?;
        variables.list.push(variable);
    }
    let count = variables.list.len();
    for (element, variable) in root.listed("ModelVariables", "ScalarVariable").zip(&variables.list) {
        if let Some(of) = variable.derivative_of
            && of >= count
        {
            let message =
                format!("variable `{}` is the derivative of variable {}, but there are {count}", variable.name, of + 1);
            return Err(element.place.error(message));
        }
    }
    let list = |list| -> Result<Vec<Unknown>, XmlError> {
        root.child("ModelStructure")
            .into_iter()
            .flat_map(|s| s.listed(list, "Unknown"))
            .map(|element| unknown(element, count))
            .collect()
    };
    let number_of_event_indicators = root.parsed("numberOfEventIndicators", "a whole number from 0")?.unwrap_or(0);
    if number_of_event_indicators > MAX_ELEMENTS {
        let message =
            format!("numberOfEventIndicators is {number_of_event_indicators}, at most {MAX_ELEMENTS} are read");
        return Err(root.place.error(message));
    }
    let structure = Structure {
        outputs: list("Outputs")?,
        derivatives: list("Derivatives")?,
        initial_unknowns: list("InitialUnknowns")?,
        event_indicators: Vec::new(),
        number_of_event_indicators,
    };
    Ok((variables, structure))
}

/// The child element that contains the type of a variable or type definition.
fn typed_child(element: &Element) -> Result<(&Element, (BaseType, DataType)), XmlError> {
    element
        .children
        .iter()
        .find_map(|child| {
            let types = match child.name.as_str() {
                "Real" => (BaseType::Real, DataType::Float64),
                "Integer" => (BaseType::Integer, DataType::Int32),
                "Boolean" => (BaseType::Boolean, DataType::Boolean),
                "String" => (BaseType::String, DataType::String),
                "Enumeration" => (BaseType::Integer, DataType::Enumeration),
                _ => return None,
            };
            Some((child, types))
        })
        .ok_or_else(|| {
            element.place.error(format!(
                "<{}> has no type, expected <Real>, <Integer>, <Boolean>, <String> or <Enumeration>",
                element.name
            ))
        })
}

fn variable(element: &Element, types: &Types<'_>) -> Result<Variable, XmlError> {
    let (own, types_of) = typed_child(element)?;
    let start = match types_of.0 {
        BaseType::Real => own.real("start")?.map(Value::Real),
        BaseType::Integer => own.parsed::<i32>("start", "a whole number")?.map(|value| Value::Integer(value.into())),
        BaseType::Boolean => own.boolean("start")?.map(Value::Boolean),
        BaseType::String => own.attribute("start").map(|s| Value::String(s.to_string())),
        // FMI 2.0 has no Binaries.
        BaseType::Binary => None,
    };
    let derivative_of = own
        .parsed::<usize>("derivative", "the number of a variable, from 1")?
        .map(|number| number.checked_sub(1).ok_or_else(|| own.place.error("variables are numbered from 1")))
        .transpose()?;
    Ok(Variable { start, derivative_of, ..types::variable(element, own, FmiVersion::V2, types_of, types)? })
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
    check_kinds(element, FmiVersion::V2, dependencies.as_ref().map(Vec::len))?;
    Ok(Unknown { variable: index(number)?, dependencies })
}
