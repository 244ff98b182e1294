//! Runs: what a master executes.
//!
//! Signals travel on a *bus* of doubles per run: every wired or recorded output has a slot, so has every signal fed from a
//! file; integers and booleans are doubles there.

use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, FmiVersion, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::sync::Arc;

/// Times, s, and order of execution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Simulation {
    /// Start, s.
    pub start: f64,
    /// Stop, s.
    pub stop: f64,
    /// Communication step, s.
    pub step: f64,
    /// Number of steps.
    pub steps: u64,
    /// Order of the components.
    pub order: Order,
    /// Every how many steps a row is recorded, from 1.
    pub every: u64,
}

/// How the components of a system follow each other within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// One after the other; a component sees the new outputs of those before it (Gauss-Seidel).
    Sequential,
    /// All at once from the outputs of the step before.
    Jacobi,
}

/// A run of one case at one point with one seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// `case`, `case@point`, `case#seed` or `case@point#seed`.
    pub id: String,
    /// Name of the case.
    pub case: String,
    /// Name of the point.
    pub point: Option<String>,
    /// Seed.
    pub seed: Option<i32>,
    /// Components in order of execution.
    pub components: Vec<Component>,
    /// Signals from a file.
    pub series: Vec<InputSeries>,
    /// Number of bus slots.
    pub slots: usize,
    /// Slot of each column of the plan; `None` where the case leaves the component out.
    pub columns: Vec<Option<usize>>,
}

/// An instance of an FMU and its wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Component {
    /// Name, also of the instance.
    pub name: String,
    /// Path of the `.fmu` file.
    pub fmu: String,
    /// Version of FMI.
    pub fmi: FmiVersion,
    /// Model identifier.
    pub model_identifier: String,
    /// GUID, or instantiation token of FMI 3.0.
    pub guid: String,
    /// Parameters to set before initialization, sorted by name.
    pub parameters: Vec<Setting>,
    /// Start values of a component that starts in a steady state, to be set after the parameters; empty if they are still to be
    /// found. `None` for one that starts as declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steady: Option<Vec<Setting>>,
    /// Inputs that keep one value.
    pub constants: Vec<Setting>,
    /// Inputs read from the bus.
    pub inputs: Vec<Wire>,
    /// Outputs written to the bus.
    pub outputs: Vec<Wire>,
}

/// A variable and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setting {
    /// Name of the variable.
    pub name: String,
    /// Base type.
    #[serde(rename = "type")]
    pub base_type: BaseType,
    /// Value reference.
    pub reference: Reference,
    /// Value, of that base type.
    pub value: Value,
}

/// A variable and its place on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Wire {
    /// Value reference.
    pub reference: Reference,
    /// Base type, not `String`.
    #[serde(rename = "type")]
    pub base_type: BaseType,
    /// Slot of the bus.
    pub slot: usize,
}

/// A signal from a file, held between its times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InputSeries {
    /// Slot of the bus, written by nothing else.
    pub slot: usize,
    /// Times, s, rising; the first is not after the start. Shared by the series of a file.
    #[serde(serialize_with = "as_sequence", deserialize_with = "from_sequence")]
    #[schemars(with = "Vec<f64>")]
    pub times: Arc<[f64]>,
    /// Value from each time on.
    #[serde(serialize_with = "as_sequence", deserialize_with = "from_sequence")]
    #[schemars(with = "Vec<f64>")]
    pub values: Arc<[f64]>,
}

fn as_sequence<S: Serializer>(values: &Arc<[f64]>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter())
}

fn from_sequence<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<[f64]>, D::Error> {
    Ok(Vec::deserialize(deserializer)?.into())
}

/// Parameters that a scenario sets for a component without inputs, none of whose cases reads all outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Name of the component.
    pub(crate) component: String,
    /// The component as the runs have it, each variant once.
    pub(crate) variants: Vec<Variant>,
    /// Parameters that are set.
    pub(crate) suspects: Vec<Suspect>,
}

/// A component of some run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Variant {
    pub(crate) component: Component,
    /// Names of the outputs that are read in the case of the run.
    pub(crate) read: Vec<String>,
}

/// A parameter, and where it is set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Suspect {
    pub(crate) name: String,
    /// `file:line:column`.
    pub(crate) place: String,
}
