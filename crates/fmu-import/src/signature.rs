//! What a caller of a library has to know of its description.

use crate::c_api::Reference;
use crate::description::{BaseType, DataType, FmiVersion, Interface, ModelDescription};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Version, interface, and the variables of FMI 3.0 that the plain getters and setters cannot transfer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Signature {
    pub(crate) fmi: FmiVersion,
    pub(crate) interface: Interface,
    /// Variables that are arrays, or of another type than Float64, Int32, Boolean and String.
    pub(crate) special: HashMap<Reference, Special>,
    pub(crate) states: usize,
    pub(crate) event_indicators: usize,
}

/// A variable that needs a function or a number of values of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Special {
    pub(crate) data_type: DataType,
    /// Number of values.
    pub(crate) size: usize,
}

impl Signature {
    /// The signature of an FMU that is used by this interface.
    pub(crate) fn new(description: &ModelDescription, interface: Interface) -> Self {
        let mut special = HashMap::new();
        if description.fmi == FmiVersion::V3 {
            for variable in description.variables.iter().filter(|variable| variable.alias_of.is_none()) {
                let is_plain = match variable.base_type {
                    BaseType::Real => variable.data_type == DataType::Float64,
                    BaseType::Integer => variable.data_type == DataType::Int32,
                    BaseType::Boolean | BaseType::String => true,
                };
                if !is_plain || variable.is_array() {
                    let entry = Special { data_type: variable.data_type, size: variable.size };
                    special.insert(variable.reference, entry);
                }
            }
        }
        Self {
            fmi: description.fmi,
            interface,
            special,
            states: description.number_of_states(),
            event_indicators: description.number_of_event_indicators,
        }
    }
}
