//! Report on the results: metrics with the numbers of a paper, figures and findings.
//!
//! Nothing is computed here. The plan contains references, which the reader of the results resolves. The execution of
//! runs does not depend on this module.

use crate::metrics::{Definition, Expression};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A metric: a number computed from each run.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Metric {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Computation.
    #[serde(flatten)]
    pub source: Source,
    /// Unit of measure of the number.
    pub unit: Option<String>,
    /// Decimal places to show.
    pub digits: Option<u8>,
    /// The paper's numbers, in the same unit.
    pub paper: Option<Paper>,
    /// Required limits of the number.
    pub requirement: Option<Requirement>,
}

/// Computation of a metric.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Source {
    /// From signals; the columns are indices into those of the plan.
    Signals(Definition),
    /// From other metrics of the same run, which precede it in the plan.
    Metrics {
        /// The formula, with the names of the metrics.
        value: Expression,
        /// The metrics in it, by their indices.
        uses: Vec<usize>,
    },
}

/// Limits on a metric in the runs of all points and seeds.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Requirement {
    /// Minimum, in the unit of the metric.
    pub min: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
    /// Names of the cases that must meet the requirement.
    pub cases: Vec<String>,
    /// Share of their runs that must meet the requirement, above 0 and up to 1.
    pub share: f64,
    /// Source of the requirement, such as a standard.
    pub source: Option<String>,
}

/// Numbers printed in a paper.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Paper {
    /// Table or place in the paper.
    pub table: Option<String>,
    /// Value by case, or by `case@point`.
    pub values: BTreeMap<String, f64>,
    /// Change in percent by `case/case` or `case@point/case@point`, where the paper gives no values.
    pub changes: BTreeMap<String, f64>,
    /// Keys of the values used for calibration; the other values are predictions. `None`: unknown.
    pub calibrated: Option<Vec<String>>,
}

/// A figure to draw.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title.
    pub title: String,
    /// Kind of figure.
    pub kind: FigureKind,
    /// Names of the cases shown.
    pub cases: Vec<String>,
    /// A panel for every case in a time plot, instead of cases overlaid.
    pub separate: bool,
    /// Indices into the columns of the plan, for time plots and spectra.
    pub columns: Vec<usize>,
    /// Index of the column drawn dashed in every panel of a time plot.
    pub against: Option<usize>,
    /// Index of the column drawn over a second vertical axis in every panel of a time plot.
    pub right: Option<usize>,
    /// Abscissa: index of a column for [`FigureKind::Xy`], of the input for [`FigureKind::Transfer`], of a metric for
    /// [`FigureKind::Scatter`].
    pub over: Option<usize>,
    /// Indices into the metrics of the plan, for the kinds that show metrics.
    pub metrics: Vec<usize>,
    /// True if all panels have the same scales.
    pub same_scale: bool,
    /// True if both axes of a [`FigureKind::Xy`] have the same scale.
    pub equal_axes: bool,
    /// Frequencies shown, Hz; `None`: all.
    pub band: Option<[f64; 2]>,
    /// Times shown or used, s; `None`: all.
    pub window: Option<[f64; 2]>,
    /// Levels marked in every panel of a time plot.
    pub levels: Vec<Level>,
    /// Unit of measure of the signals; `None`: the display unit of each column.
    pub unit: Option<String>,
    /// Factor for the conversion to that unit.
    pub factor: f64,
    /// Offset for the conversion to that unit.
    pub offset: f64,
    /// Caption.
    pub caption: Option<Text>,
}

/// Kind of figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FigureKind {
    /// Signals over time, cases overlaid or [`Figure::separate`].
    Time,
    /// One-sided power spectral densities of signals over frequency, means over the seeds, cases overlaid.
    Spectrum,
    /// Metrics over the points of the sweep, cases overlaid.
    Sweep,
    /// Metrics over the points of a sweep of two axes, as colors, a panel for each case.
    HeatMap,
    /// Metrics over windows that end at each time, cases overlaid.
    Running,
    /// Signals over another signal, cases overlaid.
    Xy,
    /// Transfer functions from one signal to other signals over frequency: gain, phase and coherence, from spectra
    /// averaged over the seeds, cases overlaid.
    Transfer,
    /// Metrics of all runs as cumulative distributions, cases overlaid.
    Distribution,
    /// Metrics of all runs over another metric, a point for each run, cases overlaid.
    Scatter,
}

impl FigureKind {
    /// Returns true if it shows signals, not metrics.
    pub fn is_of_signals(self) -> bool {
        matches!(self, Self::Time | Self::Spectrum | Self::Xy | Self::Transfer)
    }
}

/// A level marked in a plot over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// Value, in the unit of the figure.
    pub value: f64,
    /// Label.
    pub title: String,
}

/// A claim, the checks that decide on it, and an explanation.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Finding {
    /// Claim.
    pub claim: Text,
    /// Explanation of what the runs show.
    pub explanation: Text,
    /// True if the claim is not from a paper.
    pub own: bool,
    /// Checks that must all pass; at least one.
    pub checks: Vec<Check>,
}

/// A comparison that decides on a claim.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Check {
    /// Cell that is checked.
    pub cell: Cell,
    /// Cell to compare with.
    pub against: Option<Cell>,
    /// Expected result.
    pub expect: Expect,
    /// Level for [`Expect::Above`] and [`Expect::Below`], in the unit of the metric.
    pub level: Option<f64>,
}

/// A cell of the table of metrics.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Cell {
    /// Index into the metrics of the plan.
    pub metric: usize,
    /// Name of the case.
    pub case: String,
    /// Name of the point; `None` without a sweep.
    pub point: Option<String>,
}

/// Expectation of a check for its cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Expect {
    /// The change that the paper gives.
    PaperChange,
    /// The value that the paper gives.
    PaperValue,
    /// Less than the cell that it is compared with.
    Lower,
    /// More than the cell that it is compared with.
    Higher,
    /// About as much as the cell that it is compared with.
    Unchanged,
    /// The cell falls relative to its baseline by a larger share than the cell that it is compared with.
    FallsMore,
    /// Less than a level.
    Below,
    /// More than a level.
    Above,
    /// Undefined, because a level is never crossed.
    Never,
}

/// Words and numbers.
pub type Text = Vec<Part>;

/// A part of a text.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Part {
    /// Words.
    Words(String),
    /// A number of the results.
    #[schemars(title = "Number")]
    Number {
        /// Number to show, and its format.
        format: Format,
        /// Index into the metrics of the plan.
        metric: usize,
        /// Cells whose number is shown; several give a range. Empty if the format needs none.
        cells: Vec<Cell>,
        /// Cells to compare with, one for each cell; empty if the format needs none.
        against: Vec<Cell>,
    },
}

/// Number of a cell that a text shows, and its format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// The value with its unit; the default.
    Value,
    /// The value without its unit.
    Number,
    /// A share in percent.
    Percent,
    /// The value with its standard deviation over the seeds.
    Spread,
    /// The change in percent with its sign.
    Change,
    /// The size of the change in percent.
    By,
    /// The ratio to the cell to compare with.
    Ratio,
    /// The difference with its unit.
    Difference,
    /// The paper's value with its unit.
    Paper,
    /// The paper's change in percent with its sign.
    PaperChange,
    /// The size of the paper's change in percent.
    PaperBy,
    /// The threshold of the metric.
    Threshold,
    /// The start of the metric's window.
    From,
    /// The end of the metric's window.
    To,
    /// Both ends of the metric's band.
    Band,
}

impl Format {
    /// Returns true if the number is a setting of the metric, the same for every cell.
    pub(crate) fn is_of_metric(self) -> bool {
        matches!(self, Self::Threshold | Self::From | Self::To | Self::Band)
    }

    pub(crate) fn compares(self) -> bool {
        matches!(self, Self::Change | Self::By | Self::Ratio | Self::Difference | Self::PaperChange | Self::PaperBy)
    }

    pub(crate) fn parse(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| word(format) == text)
    }

    #[rustfmt::skip]
    pub(crate) const ALL: [Self; 15] = [
        Self::Value, Self::Number, Self::Percent, Self::Spread, Self::Change, Self::By, Self::Ratio, Self::Difference,
        Self::Paper, Self::PaperChange, Self::PaperBy, Self::Threshold, Self::From, Self::To, Self::Band,
    ];
}

/// Name of a variant in files.
pub(crate) fn word(of: impl Serialize) -> String {
    serde_json::to_value(of).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

impl Cell {
    /// `case` or `case@point`.
    pub fn key(&self) -> String {
        match &self.point {
            Some(point) => format!("{}@{point}", self.case),
            None => self.case.clone(),
        }
    }
}

impl Expect {
    pub(crate) fn is_of_paper(self) -> bool {
        matches!(self, Self::PaperChange | Self::PaperValue)
    }
}
