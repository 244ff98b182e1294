//! The plan: a scenario with nothing left to look up.
//!
//! A plan is what a master executes, this one or another (it is printed as JSON). Signals travel on
//! a *bus* of doubles per run: every wired or recorded output has a slot, so has every signal fed
//! from a file; integers and booleans are doubles there.

use crate::c_api::Reference;
pub use crate::description::{BaseType, Value};
use crate::description::{Causality, ModelDescription, Variability, Variable};
pub use crate::findings::{Cell, Check, Expect, Finding, Format, Part, Text};
use crate::fmu::{FmuError, Fmus};
use crate::named_values::listed;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Version of the plan's layout.
pub const FORMAT: u32 = 2;

/// A resolved scenario.
#[derive(Debug, Clone, Serialize)]
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
    /// Runs: cases, in them points, in them seeds.
    pub runs: Vec<Run>,
    /// Numbers to compute from the columns.
    pub metrics: Vec<Metric>,
    /// Figures to draw.
    pub figures: Vec<Figure>,
    /// What the paper says and what was found.
    pub findings: Vec<Finding>,
    /// Where the inputs of each case get their values from, by name.
    pub wiring: Vec<Wiring>,
    /// What is allowed but probably not meant, each as `file:line:column: message`.
    pub warnings: Vec<String>,
    /// What only a trial run can tell: whether parameters that the scenario sets have an effect.
    #[serde(skip)]
    pub trials: Vec<Trial>,
}

/// Inputs of a case, and outputs that nothing reads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Wiring {
    /// Name of the case.
    pub case: String,
    /// Inputs: components in order of execution, variables in the order of the FMU.
    pub inputs: Vec<Connected>,
    /// Outputs that no input reads and that are not recorded.
    pub unread: Vec<Signal>,
}

/// A variable of a component.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Signal {
    /// Name of the component.
    pub component: String,
    /// Name of the variable.
    pub variable: String,
}

/// An input and where its value comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Connected {
    /// The input.
    pub input: Signal,
    /// What writes it.
    pub source: Origin,
}

/// Where the value of an input comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// An output.
    Output(Signal),
    /// A column of the input file.
    File(String),
    /// A value that stays, in the unit of the input.
    Constant {
        /// The value.
        value: Value,
        /// Unit of measure.
        unit: Option<String>,
    },
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
    pub(crate) unit: Unit,
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

/// Times, s, and order of execution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Simulation {
    /// Start, s.
    pub start: f64,
    /// Stop, s.
    pub stop: f64,
    /// Communication step, s.
    pub step: f64,
    /// Number of steps.
    pub steps: u64,
    /// Order of the units.
    pub order: Order,
    /// Every how many steps a row is recorded, from 1.
    pub every: u64,
}

/// How the units of a system follow each other within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// One after the other; a unit sees the new outputs of those before it (Gauss-Seidel).
    Sequential,
    /// All at once from the outputs of the step before.
    Jacobi,
}

/// A variant of the experiment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Case {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Case that changes in percent refer to.
    pub baseline: Option<String>,
}

/// A point of the sweep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Abscissa.
    pub value: f64,
}

/// Abscissa of the sweep.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Sweep {
    /// Title.
    pub title: String,
    /// Unit of measure of the values.
    pub unit: String,
}

/// A recorded signal. Shown value = factor * value + offset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Column {
    /// Name of the signal, or `unit:signal` where several units have it.
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
    pub units: Vec<Conversion>,
}

/// A unit to show values in: shown value = factor * value + offset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Conversion {
    /// Name of the unit.
    pub name: String,
    /// Factor.
    pub factor: f64,
    /// Offset.
    pub offset: f64,
}

/// A run of one case at one point with one seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// `case`, `case@point`, `case#seed` or `case@point#seed`.
    pub id: String,
    /// Name of the case.
    pub case: String,
    /// Name of the point.
    pub point: Option<String>,
    /// Seed.
    pub seed: Option<i32>,
    /// Units in order of execution.
    pub units: Vec<Unit>,
    /// Signals from a file.
    pub feeds: Vec<Feed>,
    /// Number of bus slots.
    pub slots: usize,
    /// Slot of each of [`Plan::columns`]; `None` where the case leaves the unit out.
    pub columns: Vec<Option<usize>>,
}

/// An instance of an FMU and its wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Name, also of the instance.
    pub name: String,
    /// Path of the `.fmu` file.
    pub fmu: String,
    /// Model identifier.
    pub model_identifier: String,
    /// GUID.
    pub guid: String,
    /// Parameters to set before initialization, sorted by name.
    pub parameters: Vec<Setting>,
    /// Inputs that keep one value.
    pub constants: Vec<Setting>,
    /// Inputs read from the bus.
    pub inputs: Vec<Wire>,
    /// Outputs written to the bus.
    pub outputs: Vec<Wire>,
}

/// A variable and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Feed {
    /// Slot of the bus, written by nothing else.
    pub slot: usize,
    /// Times, s, rising; the first is not after the start. Shared by the feeds of a file.
    #[serde(serialize_with = "as_sequence", deserialize_with = "from_sequence")]
    pub times: Arc<[f64]>,
    /// Value from each time on.
    #[serde(serialize_with = "as_sequence", deserialize_with = "from_sequence")]
    pub values: Arc<[f64]>,
}

fn as_sequence<S: Serializer>(values: &Arc<[f64]>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter())
}

fn from_sequence<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<[f64]>, D::Error> {
    Ok(Vec::deserialize(deserializer)?.into())
}

/// A number computed from a column, each of whose values is factor * recorded value + offset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metric {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Indices into [`Plan::columns`]; several are combined row by row.
    pub columns: Vec<usize>,
    /// How they are combined; `None` for a single one.
    pub combine: Option<Combine>,
    /// Weight of each column, for [`Combine::Squares`].
    pub weights: Vec<f64>,
    /// How it is computed.
    pub kind: MetricKind,
    /// Rows with from <= time <= to, s; `None`: all.
    pub window: Option<[f64; 2]>,
    /// What ends the window before its end.
    pub until: Option<Until>,
    /// Index of the column that is subtracted before.
    pub minus: Option<usize>,
    /// Whether the signal of the run of the case's baseline is subtracted before; no number for a case without one.
    pub from_baseline: bool,
    /// Frequencies of [`MetricKind::BandPower`], Hz.
    pub band: Option<[f64; 2]>,
    /// Level that the kind refers to, in the unit the signal is converted to.
    pub threshold: Option<f64>,
    /// Unit of measure of the number.
    pub unit: Option<String>,
    /// Factor that the signal is multiplied with before.
    pub factor: f64,
    /// Offset that is added to it then.
    pub offset: f64,
    /// Decimal places to show.
    pub digits: Option<u8>,
    /// The paper's numbers, in the same unit.
    pub paper: Option<Paper>,
}

/// The end of a window: the rows from the first one on where a signal is above or below a level do not count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Until {
    /// Index into [`Plan::columns`].
    pub column: usize,
    /// Above the level, else below.
    pub above: bool,
    /// Level, in the unit of the column.
    pub level: f64,
}

/// How several signals become one, row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Combine {
    /// The smallest.
    Min,
    /// The largest.
    Max,
    /// Root of the sum of the squares.
    Norm,
    /// Weighted sum of the squares.
    Squares,
}

/// How a metric is computed over the rows of its window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MetricKind {
    /// Root of the mean square.
    Rms,
    /// Largest magnitude.
    Peak,
    /// Largest value.
    Max,
    /// Smallest value.
    Min,
    /// Mean.
    Mean,
    /// Last value.
    Final,
    /// Largest minus smallest value.
    PeakToPeak,
    /// Standard deviation: root of the mean square of what differs from the mean.
    Deviation,
    /// Integral over time (sum of the rows times their distance).
    Integral,
    /// Integral of the power spectral density over a band of frequencies.
    BandPower,
    /// Share of the rows below the threshold, 0 to 1.
    ShareBelow,
    /// Time, s, of the first row above the threshold; no number if there is none.
    Crossing,
    /// Time, s, of the first row whose magnitude is above the threshold; no number if there is none.
    MagnitudeCrossing,
    /// Share of the rows above the threshold, 0 to 1.
    Share,
    /// Share of the rows whose magnitude is above the threshold, 0 to 1.
    MagnitudeShare,
    /// How often the value differs from that of the row before.
    Changes,
    /// How far the value goes beyond its last one, as a share of that; no number if the last value is 0.
    Overshoot,
    /// Time, s, from the first row to the first one whose value is the share `threshold` of the last value; no number if
    /// the last value is 0.
    RiseTime,
    /// Time, s, from the first row to the first one from which on the value stays within the share `threshold` of the
    /// last value; no number if the last value is 0.
    SettlingTime,
}

impl MetricKind {
    /// Whether the kind refers to a threshold.
    #[must_use]
    pub fn has_threshold(self) -> bool {
        matches!(
            self,
            Self::Crossing
                | Self::MagnitudeCrossing
                | Self::Share
                | Self::ShareBelow
                | Self::MagnitudeShare
                | Self::RiseTime
                | Self::SettlingTime
        )
    }

    /// Whether the number can be drawn over a window that grows.
    #[must_use]
    pub fn can_run(self) -> bool {
        matches!(self, Self::Rms | Self::Mean | Self::Integral)
    }

    /// Unit of measure of the number for signals of a unit; `None`: none is known.
    #[must_use]
    pub fn unit(self, of_signal: Option<&str>) -> Option<String> {
        match self {
            Self::Crossing | Self::MagnitudeCrossing | Self::RiseTime | Self::SettlingTime => Some("s".into()),
            Self::Share | Self::ShareBelow | Self::MagnitudeShare | Self::Changes | Self::Overshoot => Some("1".into()),
            // m/s2 becomes m/s, m/s becomes m, N becomes N.s
            Self::Integral => of_signal.map(|unit| match (unit.strip_suffix("/s2"), unit.strip_suffix("/s")) {
                (Some(rest), _) => format!("{rest}/s"),
                (None, Some(rest)) => rest.to_string(),
                (None, None) => format!("{unit}.s"),
            }),
            Self::BandPower => of_signal.map(|unit| format!("({unit})2")),
            _ => of_signal.map(str::to_string),
        }
    }
}

/// Numbers printed in a paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Paper {
    /// Where they stand.
    pub table: Option<String>,
    /// Value by case, or by `case@point`.
    pub values: BTreeMap<String, f64>,
    /// Change in percent by `case/case` or `case@point/case@point`, where the paper gives no values.
    pub changes: BTreeMap<String, f64>,
    /// Keys of the values that something was fitted to, the others being predictions; `None`: not said.
    pub calibrated: Option<Vec<String>>,
}

/// A figure to draw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title.
    pub title: String,
    /// What it shows.
    pub kind: FigureKind,
    /// Names of the cases shown.
    pub cases: Vec<String>,
    /// A panel for every case in a time plot, instead of cases overlaid.
    pub separate: bool,
    /// Indices into [`Plan::columns`], for time plots and spectra.
    pub columns: Vec<usize>,
    /// Index of the column drawn dashed beside each of them, in a time plot.
    pub against: Option<usize>,
    /// Indices into [`Plan::metrics`], for sweep plots.
    pub metrics: Vec<usize>,
    /// Times shown or used, s; `None`: all.
    pub window: Option<[f64; 2]>,
    /// Levels marked in every panel of a time plot.
    pub levels: Vec<Level>,
    /// Unit of measure of the signals; `None`: the display unit of each column.
    pub unit: Option<String>,
    /// Factor to that unit.
    pub factor: f64,
    /// Offset to that unit.
    pub offset: f64,
    /// What one sees.
    pub caption: Option<Text>,
}

/// What a figure shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FigureKind {
    /// Signals over time, cases overlaid or [`Figure::separate`].
    Time,
    /// One-sided power spectral densities of signals over frequency, means over the seeds, cases overlaid.
    Spectrum,
    /// Metrics over the points of the sweep, cases overlaid.
    Sweep,
    /// Metrics over windows that end at each time, cases overlaid.
    Running,
}

/// A level marked in a plot over time.
#[derive(Debug, Clone, PartialEq, Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// Where, in the unit of the figure.
    pub value: f64,
    /// What it is.
    pub title: String,
}

/// Why a parameter cannot be set.
#[derive(Debug, thiserror::Error)]
pub enum ParameterError {
    /// The run has no such unit.
    #[error("the run has no unit `{0}`")]
    Unit(String),
    /// The FMU is not loaded.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The name or the value does not fit.
    #[error("`{unit}`: {reason}")]
    Refused {
        /// Unit.
        unit: String,
        /// What does not fit.
        reason: String,
    },
}

impl Run {
    /// Sets a parameter, on top of what the scenario says.
    ///
    /// # Errors
    /// The run has no such unit, its FMU no such parameter, or the value has another type or lies
    /// outside its limits.
    pub fn set_parameter(&mut self, fmus: &Fmus, unit: &str, name: &str, value: Value) -> Result<(), ParameterError> {
        let target =
            self.units.iter_mut().find(|u| u.name == unit).ok_or_else(|| ParameterError::Unit(unit.to_string()))?;
        let refused = |reason| ParameterError::Refused { unit: unit.to_string(), reason };
        let description = fmus.get(&target.fmu)?.description();
        let variable = parameter(description, name).map_err(|e| refused(e.message))?;
        check(variable, &value).map_err(refused)?;
        let setting =
            Setting { name: name.to_string(), base_type: variable.base_type, reference: variable.reference, value };
        match target.parameters.binary_search_by(|p| p.name.as_str().cmp(name)) {
            Ok(at) => target.parameters[at] = setting,
            Err(at) => target.parameters.insert(at, setting),
        }
        Ok(())
    }
}

/// A name that is no parameter.
pub(crate) struct NoParameter {
    pub(crate) message: String,
    pub(crate) help: Option<String>,
}

/// The parameter of that name.
pub(crate) fn parameter<'a>(description: &'a ModelDescription, name: &str) -> Result<&'a Variable, NoParameter> {
    let settable = |v: &&Variable| v.causality == Causality::Parameter && v.variability != Variability::Constant;
    let model = &description.model_name;
    match description.variable(name) {
        Some(variable) if settable(&variable) => Ok(variable),
        Some(variable) => Err(NoParameter {
            message: format!("`{name}` of {model} is not a parameter but {}", role(variable)),
            help: None,
        }),
        None => Err(NoParameter {
            message: format!("{model} has no parameter `{name}`"),
            help: crate::problem::suggestion(
                name,
                description.variables.iter().filter(settable).map(|v| v.name.as_str()),
            ),
        }),
    }
}

/// What a variable is, with its article.
pub(crate) fn role(variable: &Variable) -> &'static str {
    match (variable.causality, variable.variability) {
        (_, Variability::Constant) => "a constant",
        (Causality::Parameter, _) => "a parameter",
        (Causality::CalculatedParameter, _) => "a calculated parameter",
        (Causality::Input, _) => "an input",
        (Causality::Output, _) => "an output",
        (Causality::Local, _) => "a local variable",
        (Causality::Independent, _) => "the time",
    }
}

/// Checks type, limits and items; the text says what does not fit.
pub(crate) fn check(variable: &Variable, value: &Value) -> Result<(), String> {
    let name = &variable.name;
    let number = match value {
        _ if value.base_type() != variable.base_type => {
            return Err(format!("`{name}` is {}, got {value}, {}", variable.base_type, value.base_type()));
        }
        Value::Real(v) if !v.is_finite() => {
            return Err(format!("`{name}` is {v}, expected a finite number"));
        }
        Value::Real(v) => *v,
        Value::Integer(v) => {
            let named = variable.named_values();
            if !named.is_empty() && named.iter().all(|(value, _)| value != v) {
                return Err(format!("`{name}` is {v}, expected one of {}", listed(&named)));
            }
            f64::from(*v)
        }
        Value::Boolean(_) | Value::String(_) => return Ok(()),
    };
    let unit = variable.unit.as_deref().filter(|u| *u != "1").map_or(String::new(), |u| format!(" {u}"));
    if variable.min.is_some_and(|min| number < min) {
        return Err(format!("`{name}` is {value}{unit}, expected at least {}", variable.min.unwrap_or_default()));
    }
    if variable.max.is_some_and(|max| number > max) {
        return Err(format!("`{name}` is {value}{unit}, expected at most {}", variable.max.unwrap_or_default()));
    }
    Ok(())
}
