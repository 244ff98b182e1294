//! Type definitions, and the attributes that variables inherit from them.

use super::{MAX_INHERITED, check_length, items};
use crate::c_api::Reference;
use crate::description::{BaseType, Causality, DataType, Initial, Item, Variability, Variable};
use crate::xml::{Element, XmlError};
use std::collections::HashMap;
use std::sync::Arc;

/// A type definition.
pub(super) struct Type<'a> {
    element: &'a Element,
    data_type: DataType,
    items: Arc<[Item]>,
}

/// Type definitions by name.
pub(super) type Types<'a> = HashMap<&'a str, Type<'a>>;

impl<'a> Type<'a> {
    /// The type that an element defines with its attributes.
    pub(super) fn new(element: &'a Element, data_type: DataType) -> Result<Self, XmlError> {
        let items = if data_type == DataType::Enumeration { items(element)? } else { Arc::default() };
        Ok(Self { element, data_type, items })
    }
}

/// Attributes of a variable that both versions of FMI have.
pub(super) struct Head {
    pub(super) name: String,
    pub(super) reference: Reference,
    pub(super) description: Option<String>,
    pub(super) causality: Causality,
    pub(super) variability: Variability,
    pub(super) initial: Option<Initial>,
    pub(super) base_type: BaseType,
    pub(super) data_type: DataType,
}

/// Reads a scalar without a start value. The attributes of `element` override those of the type.
pub(super) fn variable(element: &Element, head: Head, types: &Types<'_>) -> Result<Variable, XmlError> {
    let Head { name, reference, description, causality, variability, initial, base_type, data_type } = head;
    let declared = match element.attribute("declaredType") {
        None => None,
        Some(type_name) => match types.get(type_name) {
            Some(definition) if definition.data_type == data_type => Some(definition),
            Some(_) => {
                return Err(element.place.error(format!("variable `{name}`: type `{type_name}` is of another type")));
            }
            None => {
                return Err(element.place.error(format!("variable `{name}`: type `{type_name}` is not defined")));
            }
        },
    };
    let source = |attribute: &str| match (element.attribute(attribute), declared) {
        (None, Some(definition)) => definition.element,
        _ => element,
    };
    let text = |attribute| {
        let text = source(attribute).attribute(attribute);
        text.map(|text| check_length(source(attribute), attribute, text, MAX_INHERITED).map(|()| text.to_string()))
            .transpose()
    };
    let number = |attribute| source(attribute).real(attribute);
    Ok(Variable {
        reference,
        description,
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
        other_start: None,
        min: number("min")?,
        max: number("max")?,
        nominal: number("nominal")?,
        quantity: text("quantity")?,
        unit: text("unit")?,
        display_unit: text("displayUnit")?,
        relative_quantity: source("relativeQuantity").boolean("relativeQuantity")?.unwrap_or(false),
        declared_type: element.attribute("declaredType").map(str::to_string),
        items: declared.map(|definition| Arc::clone(&definition.items)).unwrap_or_default(),
        derivative_of: None,
        is_clocked: false,
        alias_of: None,
        element: None,
        name,
    })
}
