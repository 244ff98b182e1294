//! Reads `modelDescription.xml` of an FMI 2.0 FMU.
//!
//! Source: FMI 2.0.4, section 2.2 (attributes, defaults, model structure) and 4.3 (co-simulation).
//! Type definitions are resolved: a [`Variable`] carries the unit, limits and items it inherits.

mod read;

use crate::c_api::Reference;
pub use crate::xml::XmlError;
use std::collections::HashMap;
use std::sync::Arc;

/// Contents of `modelDescription.xml`.
#[derive(Debug, Clone)]
pub struct ModelDescription {
    /// FMI version, `"2.0"`.
    pub fmi_version: String,
    /// Name of the model as modeled.
    pub model_name: String,
    /// Fingerprint that the binary checks at instantiation.
    pub guid: String,
    /// One-line description.
    pub description: Option<String>,
    /// Author.
    pub author: Option<String>,
    /// Version of the model.
    pub version: Option<String>,
    /// Copyright notice.
    pub copyright: Option<String>,
    /// License.
    pub license: Option<String>,
    /// Tool that made the FMU.
    pub generation_tool: Option<String>,
    /// Time at which the FMU was made, as written.
    pub generation_date_and_time: Option<String>,
    /// `flat` (default) or `structured`.
    pub variable_naming_convention: String,
    /// The co-simulation interface, if it has one.
    pub co_simulation: Option<CoSimulation>,
    /// Model identifier of the model-exchange interface, if it has one.
    pub model_exchange: Option<String>,
    /// Unit definitions.
    pub units: Vec<Unit>,
    /// Names of the log categories.
    pub log_categories: Vec<String>,
    /// Default experiment; empty where nothing is said.
    pub default_experiment: DefaultExperiment,
    /// Variables in document order.
    pub variables: Vec<Variable>,
    /// Outputs of the model structure.
    pub outputs: Vec<Unknown>,
    /// State derivatives of the model structure.
    pub derivatives: Vec<Unknown>,
    /// Initial unknowns of the model structure.
    pub initial_unknowns: Vec<Unknown>,
    by_name: HashMap<String, usize>,
    units_by_name: HashMap<String, usize>,
}

/// Identifier and capabilities of the co-simulation interface (FMI 2.0.4, section 4.3.1).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CoSimulation {
    /// File stem of the binary; a C identifier.
    pub model_identifier: String,
    /// The FMU is a wrapper that needs its tool.
    pub needs_execution_tool: bool,
    /// The communication step may change.
    pub can_handle_variable_communication_step_size: bool,
    /// Inputs may be given with derivatives.
    pub can_interpolate_inputs: bool,
    /// Highest output derivative offered.
    pub max_output_derivative_order: u32,
    /// `fmi2DoStep` may return before it is done.
    pub can_run_asynchronously: bool,
    /// At most one instance per process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// The memory callbacks are not used.
    pub can_not_use_memory_management_functions: bool,
    /// The state can be saved and restored.
    pub can_get_and_set_fmu_state: bool,
    /// The state can be turned into bytes.
    pub can_serialize_fmu_state: bool,
    /// Directional derivatives are offered.
    pub provides_directional_derivative: bool,
}

/// Experiment the author suggests; `None` where nothing is said.
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
    /// Units to show values in.
    pub display_units: Vec<DisplayUnit>,
}

/// A unit as powers of SI base units: value in SI = factor * value + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseUnit {
    /// Powers of kg, m, s, A, K, mol, cd, rad, in this order.
    pub exponents: [i32; 8],
    /// Factor to SI.
    pub factor: f64,
    /// Offset to SI.
    pub offset: f64,
}

/// A unit to show values in: shown value = factor * value + offset.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplayUnit {
    /// Name.
    pub name: String,
    /// Factor, not 0.
    pub factor: f64,
    /// Offset in the display unit.
    pub offset: f64,
}

/// Role of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Causality {
    /// Set by the environment, constant during the simulation.
    Parameter,
    /// Computed from parameters.
    CalculatedParameter,
    /// Written by others.
    Input,
    /// Read by others.
    Output,
    /// For inspection only.
    Local,
    /// Time.
    Independent,
}

/// When a variable may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// How a variable is initialized.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Initial {
    /// With its start value.
    Exact,
    /// By iteration from its start value.
    Approx,
    /// From other variables.
    Calculated,
}

/// Base type as the C interface tells them apart; an enumeration travels as an integer.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
pub enum BaseType {
    /// `fmi2Real`.
    Real,
    /// `fmi2Integer`.
    Integer,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`.
    String,
}

impl std::fmt::Display for BaseType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, f)
    }
}

/// A value of a base type.
///
/// In JSON it is only the value. A Real has a decimal point or an exponent there, so the first variant that fits is right.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum Value {
    /// `fmi2Integer`, also of an enumeration.
    Integer(i32),
    /// `fmi2Real`.
    Real(f64),
    /// `fmi2Boolean`.
    Boolean(bool),
    /// `fmi2String`.
    String(String),
}

impl Value {
    /// Base type of the value.
    #[must_use]
    pub fn base_type(&self) -> BaseType {
        match self {
            Self::Real(_) => BaseType::Real,
            Self::Integer(_) => BaseType::Integer,
            Self::Boolean(_) => BaseType::Boolean,
            Self::String(_) => BaseType::String,
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Real(v) => write!(f, "{v:?}"),
            Self::Integer(v) => write!(f, "{v}"),
            Self::Boolean(v) => write!(f, "{v}"),
            Self::String(v) => write!(f, "{v:?}"),
        }
    }
}

/// A scalar variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Unique name.
    pub name: String,
    /// Value reference, unique per base type but for aliases.
    pub reference: Reference,
    /// Description.
    pub description: Option<String>,
    /// Role.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// How it is initialized; `None` for inputs and time.
    pub initial: Option<Initial>,
    /// Base type.
    pub base_type: BaseType,
    /// Start value.
    pub start: Option<Value>,
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
    /// Unit to show a Real in.
    pub display_unit: Option<String>,
    /// The offset of the display unit does not apply, as with temperature differences.
    pub relative_quantity: bool,
    /// Name of the declared type.
    pub declared_type: Option<String>,
    /// Items of an enumeration, which all variables of its type share; empty otherwise.
    pub items: Arc<[Item]>,
    /// Index of the variable whose derivative this is.
    pub derivative_of: Option<usize>,
}

impl Variable {
    /// Why this output cannot be wired to that input: what the one is and what the other; `None`: it can. The base types
    /// have to be the same, and the units of measure where both have one.
    #[must_use]
    pub fn mismatch(&self, input: &Self) -> Option<[String; 2]> {
        if self.base_type != input.base_type {
            return Some([self, input].map(|variable| variable.base_type.to_string()));
        }
        match (&self.unit, &input.unit) {
            (Some(from), Some(to)) if from != to => Some([from, to].map(|unit| format!("in {unit}"))),
            _ => None,
        }
    }

    /// Why a value for this parameter does not fit that one of another FMU: what the one is and what the other; `None`: it
    /// does. Base type and unit of measure have to be the same.
    #[must_use]
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

/// An unknown of the model structure and what it depends on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown {
    /// Index into [`ModelDescription::variables`].
    pub variable: usize,
    /// Indices of the variables it depends on; `None`: may depend on all knowns.
    pub dependencies: Option<Vec<usize>>,
    /// Kind of each dependency; empty where nothing is said.
    pub kinds: Vec<DependencyKind>,
}

/// Kind of a dependency (FMI 2.0.4, section 2.2.8).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DependencyKind {
    /// No particular structure.
    Dependent,
    /// Linear with a constant factor.
    Constant,
    /// Linear with a factor fixed after initialization.
    Fixed,
    /// Linear with a tunable factor.
    Tunable,
    /// Linear with a factor that changes at events.
    Discrete,
}

impl ModelDescription {
    /// The variable of that name.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.index(name).map(|i| &self.variables[i])
    }

    /// Index into [`Self::variables`] of the variable of that name.
    #[must_use]
    pub fn index(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// The unit definition of that name.
    #[must_use]
    pub fn unit(&self, name: &str) -> Option<&Unit> {
        self.units_by_name.get(name).map(|&i| &self.units[i])
    }

    /// The units a variable can be shown in; the offset is 0 for a relative quantity.
    #[must_use]
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
