//! The plan: a fully resolved scenario.
//!
//! It contains what a master executes ([`run`](crate::run)) and what the results show ([`report`](crate::report)), and
//! is printed as JSON for other programs.

use crate::report::{Figure, Finding, Metric};
use crate::run::{Linear, Run, Simulation, Trial};
pub use fmu_import::description::{BaseType, DisplayUnit, Value};
use fmu_import::temporary::Folder;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use std::sync::Arc;

/// Version of the plan's layout.
pub const FORMAT: u32 = 9;

/// A resolved scenario.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Plan {
    /// [`FORMAT`].
    pub format: u32,
    /// File stem of the scenario.
    pub name: String,
    /// Path of the scenario as it was given.
    pub file: String,
    /// Title.
    pub title: String,
    /// Description; a blank line separates paragraphs.
    pub description: String,
    /// Source of the experiment.
    pub reference: String,
    /// Times and order.
    pub simulation: Simulation,
    /// True if the requested stop time is earlier than the scenario's.
    pub is_cut: bool,
    /// Cases in the order of the file.
    pub cases: Vec<Case>,
    /// Points of the sweep; empty without one.
    pub points: Vec<Point>,
    /// Abscissa of the sweep.
    pub sweep: Option<Sweep>,
    /// Seeds; empty if nothing is repeated.
    pub seeds: Vec<i32>,
    /// Recorded signals of all cases.
    pub columns: Vec<Column>,
    /// Runs, ordered by case, then point, then seed.
    pub runs: Vec<Run>,
    /// Numbers to compute from the columns.
    pub metrics: Vec<Metric>,
    /// Figures to draw.
    pub figures: Vec<Figure>,
    /// Claims of the paper, and what the runs show.
    pub findings: Vec<Finding>,
    /// Sources of the inputs of each case, by name.
    pub wiring: Vec<Wiring>,
    /// Warnings about what is allowed but probably unintended, each as `file:line:column: message`.
    pub warnings: Vec<String>,
    /// Trial runs that show whether parameters set by the scenario have an effect.
    #[serde(skip)]
    pub trials: Vec<Trial>,
    /// Temporary folders with FMUs from SSP files, deleted with the plan.
    #[serde(skip)]
    pub folders: Vec<Arc<Folder>>,
}

/// Returns the JSON Schema of a plan as it is printed.
pub fn schema() -> schemars::Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<Plan>()
}

/// Inputs of a case, and outputs that nothing reads.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Wiring {
    /// Name of the case.
    pub case: String,
    /// Inputs: components in order of execution, variables in the order of the FMU.
    pub inputs: Vec<Connected>,
    /// Outputs that no input reads and that are not recorded.
    pub unread: Vec<Signal>,
    /// Algebraic loops: signals that depend on each other at one time.
    pub loops: Vec<Loop>,
    /// Names of the components that take samples.
    #[serde(skip)]
    pub discrete: Vec<String>,
}

/// An algebraic loop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Loop {
    /// True for a loop at the start, which is solved; false for a loop in each step.
    pub at_start: bool,
    /// Its signals: `a:y -> b:u -> b:y -> a:u`.
    pub path: String,
    /// Its connections whose values are held over a step, each as `b:y -> a:u`.
    pub held: Vec<String>,
}

/// A variable of a component.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
pub struct Signal {
    /// Name of the component.
    pub component: String,
    /// Name of the variable.
    pub variable: String,
}

/// An input and its source.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Connected {
    /// The input.
    pub input: Signal,
    /// Source of its value.
    pub source: Origin,
    /// Type conversion in the connection, if any.
    pub type_change: Option<TypeChange>,
    /// Conversion of units, with the factor and offset of the connection.
    pub conversion: Option<Linear>,
    /// Time of the value, if it comes from an output.
    pub timing: Option<Timing>,
}

/// Time of the values that a connection carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Timing {
    /// The value is that of the time for which the reader uses it.
    OnTime,
    /// Between continuous components, the value from the start of a step holds over the step.
    Held,
    /// A sample arrives one step late.
    Late,
    /// A sample that is due at the start of a step is taken from its end.
    Early,
}

/// Conversion between Real and Boolean in a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TypeChange {
    /// True is 1, false is 0.
    BooleanToReal,
    /// Above 0.5 is true.
    RealToBoolean,
}

/// Source of the value of an input.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// An output.
    Output(Signal),
    /// A column of the input file.
    File(String),
    /// A constant value, in the unit of the input.
    Constant {
        /// The value.
        value: Value,
        /// Unit of measure.
        unit: Option<String>,
    },
}

/// A variant of the experiment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Case {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Case that changes in percent refer to.
    pub baseline: Option<String>,
}

/// A point of the sweep.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Point {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Abscissa.
    pub value: f64,
    /// Value on the second axis; `None` without one.
    pub second: Option<f64>,
}

/// Abscissa of the sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Sweep {
    /// Title.
    pub title: String,
    /// Unit of measure of the values.
    pub unit: String,
    /// Second axis of a sweep over two parameters.
    pub second: Option<SecondSweep>,
}

/// Second axis of a sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SecondSweep {
    /// Title.
    pub title: String,
    /// Unit of measure of the values.
    pub unit: String,
}

/// A recorded signal. Shown value = factor * value + offset.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Column {
    /// Name of the signal, or `component:signal` if an earlier component in the scenario records a signal with that
    /// name.
    pub name: String,
    /// Unit of measure of the recorded values.
    pub unit: Option<String>,
    /// Unit of measure to show them in.
    pub display_unit: Option<String>,
    /// Factor of the display unit, 1 without one.
    pub factor: f64,
    /// Offset of the display unit, 0 without one.
    pub offset: f64,
    /// Description of the variable.
    pub description: String,
    /// All units the values can be shown in.
    pub units: Vec<DisplayUnit>,
    /// True if, in some case, the values come from the input file instead of the component.
    pub from_file: bool,
    /// True for a Binary; files contain its values as text.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_binary: bool,
}
