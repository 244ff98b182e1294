//! Type definitions, and the attributes that variables inherit from them.

use super::{MAX_INHERITED, MAX_NAME, bounded, causality, check_length, chosen, items};
use crate::c_api::Reference;
use crate::description::{BaseType, Causality, DataType, FmiVersion, Initial, Item, Variability, Variable};
use crate::xml::{Element, XmlError};
use std::collections::HashMap;
use std::sync::Arc;

pub(super) struct Type<'a> {
    element: &'a Element,
    data_type: DataType,
    items: Arc<[Item]>,
}

pub(super) type Types<'a> = HashMap<&'a str, Type<'a>>;

impl<'a> Type<'a> {
    pub(super) fn new(element: &'a Element, data_type: DataType) -> Result<Self, XmlError> {
        let items = if data_type == DataType::Enumeration { items(element)? } else { Arc::default() };
        Ok(Self { element, data_type, items })
    }
}

pub(super) fn identity(element: &Element) -> Result<(String, Reference), XmlError> {
    let name = bounded(element, "name", MAX_NAME)?.to_string();
    match element.parsed("valueReference", "a whole number from 0")? {
        Some(reference) => Ok((name, reference)),
        None => Err(element.place.error(format!("variable `{name}` lacks the attribute `valueReference`"))),
    }
}

/// The declared type of a variable.
pub(super) fn declared<'t, 'a>(
    own: &Element,
    name: &str,
    data_type: DataType,
    types: &'t Types<'a>,
) -> Result<Option<&'t Type<'a>>, XmlError> {
    let Some(type_name) = own.attribute("declaredType") else { return Ok(None) };
    let problem = match types.get(type_name) {
        Some(definition) if definition.data_type == data_type => return Ok(Some(definition)),
        Some(_) => "has another base type",
        None => "is not defined",
    };
    Err(own.place.error(format!("variable `{name}`: type `{type_name}` {problem}")))
}

/// The element whose attribute applies: the declared type, if the variable does not have the attribute.
pub(super) fn source<'a>(own: &'a Element, declared: Option<&Type<'a>>, attribute: &str) -> &'a Element {
    match (own.attribute(attribute), declared) {
        (None, Some(definition)) => definition.element,
        _ => own,
    }
}

/// Reads a scalar, without its start value and its references to other variables. Attributes in `own` override
/// attributes of the declared type.
pub(super) fn variable(
    element: &Element,
    own: &Element,
    fmi: FmiVersion,
    (base_type, data_type): (BaseType, DataType),
    types: &Types<'_>,
) -> Result<Variable, XmlError> {
    let (name, reference) = identity(element)?;
    let causality = causality(element, fmi)?;
    let default = match causality {
        // FMI 3.0.2, section 2.4.7.4.
        Causality::Parameter | Causality::CalculatedParameter | Causality::StructuralParameter
            if fmi == FmiVersion::V3 =>
        {
            Variability::Fixed
        }
        _ if base_type == BaseType::Real => Variability::Continuous,
        _ => Variability::Discrete,
    };
    let variability = chosen(element, "variability", fmi)?.unwrap_or(default);
    // FMI 2.0.4, section 2.2.7; FMI 3.0.2, section 2.4.7.5.
    let default = match causality {
        Causality::Input | Causality::Independent => None,
        Causality::Parameter | Causality::StructuralParameter => Some(Initial::Exact),
        _ if variability == Variability::Constant => Some(Initial::Exact),
        _ => Some(Initial::Calculated),
    };
    let initial = chosen(element, "initial", fmi)?.or(default);
    let declared = declared(own, &name, data_type, types)?;
    let source = |attribute: &str| source(own, declared, attribute);
    let text = |attribute| {
        let text = source(attribute).attribute(attribute);
        text.map(|text| check_length(source(attribute), attribute, text, MAX_INHERITED).map(|()| text.to_string()))
            .transpose()
    };
    let number = |attribute| source(attribute).real(attribute);
    Ok(Variable {
        reference,
        description: element.attribute("description").map(str::to_string),
        causality,
        variability,
        initial,
        base_type,
        data_type,
        dimensions: Vec::new(),
        lengths: Vec::new(),
        size: 1,
        start: None,
        starts: Vec::new(),
        mime_type: text("mimeType")?,
        max_size: source("maxSize").parsed("maxSize", "a whole number from 0")?,
        min: number("min")?,
        max: number("max")?,
        nominal: number("nominal")?,
        quantity: text("quantity")?,
        unit: text("unit")?,
        display_unit: text("displayUnit")?,
        relative_quantity: source("relativeQuantity").boolean("relativeQuantity")?.unwrap_or(false),
        declared_type: own.attribute("declaredType").map(str::to_string),
        items: declared.map(|definition| Arc::clone(&definition.items)).unwrap_or_default(),
        derivative_of: None,
        clocks: Vec::new(),
        intermediate_update: false,
        alias_of: None,
        element: None,
        name,
    })
}
