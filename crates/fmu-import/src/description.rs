//! Reads `modelDescription.xml` of FMI 2.0 and 3.0.
//!
//! Source: FMI 2.0.4, sections 2.2, 3.3 and 4.3; FMI 3.0.2, sections 2.4, 3.4 and 4.4. Type definitions are resolved: a
//! [`Variable`] contains the unit, limits and items that it inherits. Where the versions use different names, FMI 2.0
//! names are used: [`guid`](ModelDescription::guid) is the instantiation token in FMI 3.0.

mod elements;
mod interface;
mod read;
mod terminals;

use crate::bytes::BinaryText;
use crate::c_api::Reference;
pub use crate::xml::XmlError;
pub use elements::ArrayElement;
pub use interface::{Capabilities, FmiVersion, Interface};
pub(crate) use read::unit;
pub use read::word;
use std::collections::{BTreeMap, HashMap};
use std::ops::RangeInclusive;
use std::sync::Arc;
pub use terminals::{Terminal, TerminalMember};

/// MIME type of a Binary that declares none (FMI 3.0.2, section 2.4.7.1).
const OCTET_STREAM: &str = "application/octet-stream";
/// Number of bytes of a Binary that messages show.
const SHOWN: usize = 16;

/// Contents of `modelDescription.xml`.
#[derive(Debug, Clone)]
pub struct ModelDescription {
    /// FMI version.
    pub fmi: FmiVersion,
    /// FMI version as written, such as `2.0` or `3.0.1`.
    pub fmi_version: String,
    /// Name of the model in the modeling tool.
    pub model_name: String,
    /// Fingerprint that the binary checks at instantiation: GUID (FMI 2.0) or instantiation token (FMI 3.0).
    pub guid: String,
    /// One-line description.
    pub description: Option<String>,
    /// Author.
    pub author: Option<String>,
    /// Version of the model.
    pub version: Option<String>,
    /// License.
    pub license: Option<String>,
    /// Tool that generated the FMU.
    pub generation_tool: Option<String>,
    /// Time at which the FMU was created, as written.
    pub generation_date_and_time: Option<String>,
    /// `flat` (default) or `structured`.
    pub variable_naming_convention: String,
    /// The co-simulation interface, if the FMU has one.
    pub co_simulation: Option<Capabilities>,
    /// The model-exchange interface, if the FMU has one.
    pub model_exchange: Option<Capabilities>,
    /// The interface for scheduled execution (FMI 3.0), if the FMU has one.
    pub scheduled_execution: Option<Capabilities>,
    /// Unit definitions.
    pub units: Vec<Unit>,
    /// Names of the log categories.
    pub log_categories: Vec<String>,
    /// Default experiment; empty if not declared.
    pub default_experiment: DefaultExperiment,
    /// Variables in document order, except Clocks. An alias follows its variable.
    pub variables: Vec<Variable>,
    /// Clocks (FMI 3.0).
    pub clocks: Vec<Clock>,
    /// Outputs in the model structure.
    pub outputs: Vec<Unknown>,
    /// State derivatives in the model structure.
    pub derivatives: Vec<Unknown>,
    /// Initial unknowns in the model structure.
    pub initial_unknowns: Vec<Unknown>,
    /// Event indicators in the model structure (FMI 3.0).
    pub event_indicators: Vec<Unknown>,
    /// Values of structural parameters that replace their start values, see [`Self::parse_with`].
    pub structure: StructuralParameters,
    /// Number of event indicators, including array elements.
    pub number_of_event_indicators: usize,
    by_name: HashMap<String, usize>,
    units_by_name: HashMap<String, usize>,
}

/// Experiment that the author suggests; `None` if not declared.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DefaultExperiment {
    /// Start, s.
    pub start_time: Option<f64>,
    /// Stop, s.
    pub stop_time: Option<f64>,
    /// Relative tolerance.
    pub tolerance: Option<f64>,
    /// Communication step, s.
    pub step_size: Option<f64>,
}

/// A unit of measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Name that variables use.
    pub name: String,
    /// The unit in SI base units, if given.
    pub base: Option<BaseUnit>,
    /// Display units.
    pub display_units: Vec<DisplayUnit>,
}

/// A unit as a product of powers of SI base units: value in SI = factor * value + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseUnit {
    /// Powers of kg, m, s, A, K, mol, cd, rad, in this order.
    pub exponents: [i32; 8],
    /// Factor to SI.
    pub factor: f64,
    /// Offset to SI.
    pub offset: f64,
}

/// A display unit: displayed value = factor * value + offset.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct DisplayUnit {
    /// Name of the unit.
    pub name: String,
    /// Factor, not 0.
    pub factor: f64,
    /// Offset in the display unit.
    pub offset: f64,
}

/// Role of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Causality {
    /// Set by the environment, constant during the simulation.
    Parameter,
    /// Computed from parameters.
    CalculatedParameter,
    /// Set by the importer or by connected FMUs.
    Input,
    /// Can be connected to inputs.
    Output,
    /// For inspection only.
    Local,
    /// Time.
    Independent,
    /// Determines array sizes (FMI 3.0); can be set in Configuration Mode only.
    StructuralParameter,
}

/// Times at which a variable may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialization.
    Fixed,
    /// Between steps, by the environment.
    Tunable,
    /// At events.
    Discrete,
    /// At any time.
    Continuous,
}

/// Initialization of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Initial {
    /// With its start value.
    Exact,
    /// By iteration from its start value.
    Approx,
    /// From other variables.
    Calculated,
}

/// Base type in the C interface of FMI 2.0, where the values of enumerations are integers.
///
/// In FMI 3.0, a Real is a Float64 or Float32, and an Integer is one of eight types: see [`Variable::data_type`].
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
pub enum BaseType {
    /// A floating-point number.
    Real,
    /// An integer.
    Integer,
    /// A Boolean.
    Boolean,
    /// A String.
    String,
    /// Bytes (FMI 3.0).
    Binary,
}

impl BaseType {
    /// Returns true for the types that a master records as numbers: Real, Integer and Boolean.
    pub fn is_number(self) -> bool {
        matches!(self, Self::Real | Self::Integer | Self::Boolean)
    }
}

/// Type of a variable in FMI 3.0. In FMI 2.0, a Real is a Float64 and an Integer is an Int32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[allow(missing_docs)]
pub enum DataType {
    Float32,
    Float64,
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Boolean,
    String,
    Enumeration,
    Binary,
    Clock,
}

impl DataType {
    /// The base type; `None` for a Clock.
    pub fn base_type(self) -> Option<BaseType> {
        match self {
            Self::Float32 | Self::Float64 => Some(BaseType::Real),
            Self::Boolean => Some(BaseType::Boolean),
            Self::String => Some(BaseType::String),
            Self::Binary => Some(BaseType::Binary),
            Self::Clock => None,
            _ => Some(BaseType::Integer),
        }
    }

    /// The range of an integer type or enumeration.
    pub fn integers(self) -> Option<RangeInclusive<i128>> {
        Some(match self {
            Self::Int8 => i8::MIN.into()..=i8::MAX.into(),
            Self::UInt8 => 0..=u8::MAX.into(),
            Self::Int16 => i16::MIN.into()..=i16::MAX.into(),
            Self::UInt16 => 0..=u16::MAX.into(),
            // The items of an enumeration have 32 bits.
            Self::Int32 | Self::Enumeration => i32::MIN.into()..=i32::MAX.into(),
            Self::UInt32 => 0..=u32::MAX.into(),
            Self::Int64 => i64::MIN.into()..=i64::MAX.into(),
            Self::UInt64 => 0..=u64::MAX.into(),
            _ => return None,
        })
    }

    /// Returns true if every value of this type is a value of `other` without rounding. Enumerations have the range of
    /// an Int32.
    pub fn widens_to(self, other: Self) -> bool {
        match (self.integers(), other.integers()) {
            (Some(own), Some(other)) => other.contains(own.start()) && other.contains(own.end()),
            _ => self == other || (self, other) == (Self::Float32, Self::Float64),
        }
    }
}

impl std::fmt::Display for DataType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, f)
    }
}

impl std::fmt::Display for BaseType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, f)
    }
}

/// A value of a base type.
///
/// JSON contains only the value; a Real always has a decimal point or an exponent.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum Value {
    /// An Integer, or the value of an enumeration; 32 bits in FMI 2.0.
    Integer(i64),
    /// An Integer above the range of an `i64`, which only a UInt64 can have.
    Unsigned(u64),
    /// A Real.
    Real(f64),
    /// A Boolean.
    Boolean(bool),
    /// A String.
    String(String),
    /// The bytes of a Binary.
    #[schemars(title = "Bytes")]
    Binary {
        /// In JSON, two hexadecimal digits for each byte.
        #[serde(with = "crate::bytes::hex")]
        #[schemars(with = "String")]
        hex: Vec<u8>,
    },
}

impl Value {
    /// The value of an Integer; `None` outside of the ranges of all types.
    pub fn integer(value: i128) -> Option<Self> {
        let unsigned = || value.try_into().ok().map(Self::Unsigned);
        value.try_into().ok().map(Self::Integer).or_else(unsigned)
    }

    /// The Real; `None` for other types.
    pub fn real(&self) -> Option<f64> {
        if let Self::Real(value) = self { Some(*value) } else { None }
    }

    /// The value as a double, 0 or 1 for a Boolean; `None` for a String and a Binary.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Boolean(value) => Some(f64::from(u8::from(*value))),
            other => other.real().or_else(|| Some(other.whole()? as f64)),
        }
    }

    /// The Integer; `None` for other types.
    pub fn whole(&self) -> Option<i128> {
        match self {
            Self::Integer(value) => Some((*value).into()),
            Self::Unsigned(value) => Some((*value).into()),
            _ => None,
        }
    }

    /// Base type of the value.
    pub fn base_type(&self) -> BaseType {
        match self {
            Self::Real(_) => BaseType::Real,
            Self::Integer(_) | Self::Unsigned(_) => BaseType::Integer,
            Self::Boolean(_) => BaseType::Boolean,
            Self::String(_) => BaseType::String,
            Self::Binary { .. } => BaseType::Binary,
        }
    }

    /// The value as in XML and on the command line: a String has no quotes, a Binary has hexadecimal digits.
    pub fn text(&self) -> String {
        match self {
            Self::String(text) => text.clone(),
            Self::Binary { hex } => BinaryText::Hex.encode(hex),
            other => other.to_string(),
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Real(v) => write!(f, "{v:?}"),
            Self::Integer(v) => write!(f, "{v}"),
            Self::Unsigned(v) => write!(f, "{v}"),
            Self::Boolean(v) => write!(f, "{v}"),
            Self::String(v) => write!(f, "{v:?}"),
            Self::Binary { hex } if hex.len() <= SHOWN => write!(f, "0x{}", BinaryText::Hex.encode(hex)),
            Self::Binary { hex } => write!(f, "0x{}... ({} bytes)", BinaryText::Hex.encode(&hex[..SHOWN]), hex.len()),
        }
    }
}

/// Values of structural parameters by name: whole numbers or Booleans.
pub type StructuralParameters = BTreeMap<String, Value>;

/// A variable: a scalar, or an array (FMI 3.0).
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Unique name.
    pub name: String,
    /// Value reference. Except for aliases, it is unique among the variables of the same base type (FMI 2.0) or of the
    /// FMU (FMI 3.0).
    pub reference: Reference,
    /// Description.
    pub description: Option<String>,
    /// Role.
    pub causality: Causality,
    /// Times at which it may change.
    pub variability: Variability,
    /// Initialization; `None` for inputs and time.
    pub initial: Option<Initial>,
    /// Base type.
    pub base_type: BaseType,
    /// Type in FMI 3.0.
    pub data_type: DataType,
    /// Dimensions of an array; empty for a scalar.
    pub dimensions: Vec<Dimension>,
    /// Length of each dimension while all structural parameters have their start values.
    pub lengths: Vec<usize>,
    /// Number of elements: the product of the lengths, 1 for a scalar.
    pub size: usize,
    /// Start value of a scalar.
    pub start: Option<Value>,
    /// Start values of an array, one per element; empty if there are none.
    pub starts: Vec<Value>,
    /// Type of the content of a Binary, `application/octet-stream` unless declared.
    pub mime_type: Option<String>,
    /// Maximum size of a Binary, bytes.
    pub max_size: Option<usize>,
    /// Smallest value of a Real, Integer or enumeration.
    pub min: Option<f64>,
    /// Largest value of a Real, Integer or enumeration.
    pub max: Option<f64>,
    /// Typical magnitude of a Real.
    pub nominal: Option<f64>,
    /// Physical quantity.
    pub quantity: Option<String>,
    /// Unit of measure of a Real.
    pub unit: Option<String>,
    /// Display unit of a Real.
    pub display_unit: Option<String>,
    /// True if the offset of the display unit does not apply, as with temperature differences.
    pub relative_quantity: bool,
    /// Name of the declared type.
    pub declared_type: Option<String>,
    /// Items of an enumeration, shared by all variables of its type; otherwise empty.
    pub items: Arc<[Item]>,
    /// Index of the variable whose derivative this is.
    pub derivative_of: Option<usize>,
    /// Value references of the clocks at whose ticks the variable changes (attribute `clocks` in FMI 3.0).
    pub clocks: Vec<Reference>,
    /// True if the variable can be accessed in intermediate updates (FMI 3.0).
    pub intermediate_update: bool,
    /// Index of the variable for which this is another name (`<Alias>` in FMI 3.0). An alias of an output is an output;
    /// other aliases are local, so that a value can be set by one name only.
    pub alias_of: Option<usize>,
    /// The array to which this element belongs, after [`ModelDescription::with_elements`].
    pub element: Option<ArrayElement>,
}

/// Length of an array in one dimension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// A number.
    Fixed(usize),
    /// The value of a structural parameter, by its index in [`ModelDescription::variables`].
    Parameter(usize),
}

/// A variable of the type Clock, or another name of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// Unique name.
    pub name: String,
    /// Value reference.
    pub reference: Reference,
    /// Role.
    pub causality: Causality,
    /// Kind.
    pub interval_variability: IntervalVariability,
    /// Interval of a periodic clock in s, if the description contains it.
    pub interval: Option<f64>,
    /// Time of the first tick of a periodic clock after the start in s.
    pub shift: f64,
    /// Value references of the clocks on which it depends (attribute `clocks`).
    pub clocks: Vec<Reference>,
    /// Order in scheduled execution: of several clocks at one time, that with the smallest number ticks first.
    pub priority: u32,
    /// The importer can deactivate the clock again in an event.
    pub can_be_deactivated: bool,
    /// Description.
    pub description: Option<String>,
    /// For an output clock: a Boolean, see [`ModelDescription::with_elements`].
    pub(crate) signal: Option<Variable>,
}

/// Kind of a clock (FMI 3.0.2, section 2.2.8.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum IntervalVariability {
    /// Periodic, with a constant interval.
    Constant,
    /// Periodic, with an interval that is known after initialization.
    Fixed,
    /// Periodic, with an interval that follows from tunable parameters.
    Tunable,
    /// The FMU determines each interval at the tick before.
    Changing,
    /// The FMU starts it.
    Countdown,
    /// Activated by the importer or, as an output, by the FMU.
    Triggered,
}

impl std::fmt::Display for IntervalVariability {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

impl Variable {
    /// Returns true if the variable is an array.
    pub fn is_array(&self) -> bool {
        !self.dimensions.is_empty()
    }

    /// Names of the elements in the order of their values: `x` for a scalar, `x[1]`, `x[2]`, … for an array, and
    /// `x[1,1]`, … for an array with two dimensions.
    pub fn elements(&self) -> Vec<String> {
        if !self.is_array() {
            return vec![self.name.clone()];
        }
        let name = |element: usize| {
            let mut rest = element;
            let mut indices: Vec<String> = Vec::new();
            for length in self.lengths.iter().rev() {
                indices.push((rest % length + 1).to_string());
                rest /= length;
            }
            indices.reverse();
            format!("{}[{}]", self.name, indices.join(","))
        };
        (0..self.size).map(name).collect()
    }

    /// The range of the type of an Integer or enumeration.
    pub fn integers(&self) -> RangeInclusive<i128> {
        self.data_type.integers().unwrap_or(i32::MIN.into()..=i32::MAX.into())
    }

    /// The type of the content of a Binary.
    pub fn mime_type(&self) -> &str {
        self.mime_type.as_deref().unwrap_or(OCTET_STREAM)
    }

    /// Returns true if the description has a start value.
    pub fn has_start(&self) -> bool {
        self.start.is_some() || !self.starts.is_empty()
    }

    /// Returns `None` if this output can be connected to the input, otherwise their differing properties. The type of
    /// the input must have all values of the type of the output ([`DataType::widens_to`]). The units must be equal if
    /// both have one.
    pub fn mismatch(&self, input: &Self) -> Option<[String; 2]> {
        self.mismatch_of_types(input).or_else(|| match (&self.unit, &input.unit) {
            (Some(from), Some(to)) if from != to => Some([from, to].map(|unit| format!("in {unit}"))),
            _ => None,
        })
    }

    /// As [`Self::mismatch`], without the units. The MIME types of Binaries must be equal, unless one is
    /// `application/octet-stream`.
    pub fn mismatch_of_types(&self, input: &Self) -> Option<[String; 2]> {
        if self.is_array() || input.is_array() {
            let shape = |variable: &Self| match variable.is_array() {
                true => format!("an array of {} elements, which cannot be connected", variable.size),
                false => "a scalar".to_owned(),
            };
            return Some([self, input].map(shape));
        }
        if self.base_type != input.base_type {
            return Some([self, input].map(|variable| variable.base_type.to_string()));
        }
        if !self.data_type.widens_to(input.data_type) {
            return Some([self, input].map(|variable| variable.data_type.to_string()));
        }
        let types = [self, input].map(Self::mime_type);
        if self.base_type == BaseType::Binary && types[0] != types[1] && !types.contains(&OCTET_STREAM) {
            return Some(types.map(|mime_type| format!("a Binary of the MIME type {mime_type}")));
        }
        None
    }

    /// Returns `None` if this parameter and a parameter of another FMU can have the same value, otherwise their
    /// differing properties. Base types and units must be equal.
    pub fn mismatch_of_parameter(&self, other: &Self) -> Option<[String; 2]> {
        let unit =
            |variable: &Self| variable.unit.as_ref().map_or("without a unit".into(), |unit| format!("in {unit}"));
        self.mismatch(other).or_else(|| (self.unit != other.unit).then(|| [unit(self), unit(other)]))
    }
}

/// An item of an enumeration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// Name.
    pub name: String,
    /// Value.
    pub value: i32,
    /// Description.
    pub description: Option<String>,
}

/// An unknown in the model structure, with its dependencies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown {
    /// Index in [`ModelDescription::variables`].
    pub variable: usize,
    /// Indices of the variables on which the unknown depends; `None` if it may depend on all knowns.
    pub dependencies: Option<Vec<usize>>,
}

impl ModelDescription {
    /// The variable with this name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.index(name).map(|i| &self.variables[i])
    }

    /// The variables of a causality.
    pub fn of(&self, causality: Causality) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(move |variable| variable.causality == causality)
    }

    /// Index in [`Self::variables`] of the variable with this name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// Number of continuous states, including array elements.
    pub fn number_of_states(&self) -> usize {
        self.derivatives.iter().map(|unknown| self.variables[unknown.variable].size).sum()
    }

    /// The interfaces of the FMU.
    pub fn interfaces(&self) -> Vec<Interface> {
        let interfaces = [Interface::CoSimulation, Interface::ModelExchange, Interface::ScheduledExecution];
        interfaces.into_iter().filter(|interface| self.model_identifier(*interface).is_some()).collect()
    }

    /// The interface with which a master steps the FMU, unless it chooses another one: the first that the FMU has of
    /// co-simulation, model exchange and scheduled execution.
    pub fn stepped_interface(&self) -> Interface {
        self.interfaces().first().copied().unwrap_or(Interface::CoSimulation)
    }

    /// The capabilities of an interface; `None` if the FMU does not have it.
    pub fn interface(&self, interface: Interface) -> Option<&Capabilities> {
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref(),
            Interface::ModelExchange => self.model_exchange.as_ref(),
            Interface::ScheduledExecution => self.scheduled_execution.as_ref(),
        }
    }

    /// File stem of the binary for an interface; `None` if the FMU does not have the interface.
    pub fn model_identifier(&self, interface: Interface) -> Option<&str> {
        self.interface(interface).map(|unit| unit.model_identifier.as_str())
    }

    /// The unit definition with this name.
    pub fn unit(&self, name: &str) -> Option<&Unit> {
        self.units_by_name.get(name).map(|&i| &self.units[i])
    }

    /// The display units of a variable. The offset is 0 for a relative quantity.
    pub fn display_units(&self, variable: &Variable) -> Vec<DisplayUnit> {
        let mut units = variable
            .unit
            .as_deref()
            .and_then(|name| self.unit(name))
            .map(|unit| unit.display_units.clone())
            .unwrap_or_default();
        if variable.relative_quantity {
            for unit in &mut units {
                unit.offset = 0.0;
            }
        }
        units
    }
}
