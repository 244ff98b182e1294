//! What the results are to show: metrics with the numbers of a paper, figures, and findings.
//!
//! Nothing is computed here. The plan holds references, and whoever has the results fills them in. What executes runs
//! knows nothing of this module.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A number computed from a column, each of whose values is factor * recorded value + offset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metric {
    /// Name.
    pub name: String,
    /// Title.
    pub title: String,
    /// Indices into the columns of the plan; several are combined row by row.
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
    /// Index into the columns of the plan.
    pub column: usize,
    /// Above the level, else below.
    pub above: bool,
    /// Level, in the unit of the column.
    pub level: f64,
}

/// How several signals become one, row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
    /// Indices into the columns of the plan, for time plots and spectra.
    pub columns: Vec<usize>,
    /// Index of the column drawn dashed beside each of them, in a time plot.
    pub against: Option<usize>,
    /// Indices into the metrics of the plan, for sweep plots.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// Where, in the unit of the figure.
    pub value: f64,
    /// What it is.
    pub title: String,
}

/// A claim, what decides on it, and an explanation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What is claimed.
    pub claim: Text,
    /// What the runs show and why.
    pub explanation: Text,
    /// The claim is not a paper's.
    pub own: bool,
    /// What must hold; at least one.
    pub checks: Vec<Check>,
}

/// A comparison that decides on a claim.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What is looked at.
    pub cell: Cell,
    /// What it is compared with.
    pub against: Option<Cell>,
    /// What is expected.
    pub expect: Expect,
    /// Level for [`Expect::Above`] and [`Expect::Below`], in the unit of the metric.
    pub level: Option<f64>,
}

/// A cell of the table of metrics.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Cell {
    /// Index into the metrics of the plan.
    pub metric: usize,
    /// Name of the case.
    pub case: String,
    /// Name of the point; `None` without a sweep.
    pub point: Option<String>,
}

/// What a check expects of its cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Expect {
    /// The change that the paper gives.
    PaperChange,
    /// The value that the paper gives.
    PaperValue,
    /// Less than what it is compared with.
    Lower,
    /// More than that.
    Higher,
    /// About as much as that.
    Unchanged,
    /// It falls against its baseline, and by a larger share than what it is compared with does against its own.
    FallsMore,
    /// Less than a level.
    Below,
    /// More than a level.
    Above,
    /// No number: the metric has none, because a level is never crossed.
    Never,
}

/// Words and numbers.
pub type Text = Vec<Part>;

/// A part of a text.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Part {
    /// Words.
    Words(String),
    /// A number of the results.
    Number {
        /// What number, and how it is written.
        format: Format,
        /// Index into the metrics of the plan.
        metric: usize,
        /// The cells it is of; several give a range, none where the format needs none.
        cells: Vec<Cell>,
        /// What each cell is compared with; empty where the format needs nothing.
        against: Vec<Cell>,
    },
}

/// What number of a cell a text shows, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
    /// How many times what it is compared with.
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
    /// The begin of the metric's window.
    From,
    /// The end of the metric's window.
    To,
    /// Both ends of the metric's band.
    Band,
}

impl Format {
    /// The number belongs to the metric, whatever the cell.
    pub(crate) fn is_of_metric(self) -> bool {
        matches!(self, Self::Threshold | Self::From | Self::To | Self::Band)
    }

    /// The number compares two cells.
    pub(crate) fn compares(self) -> bool {
        matches!(self, Self::Change | Self::By | Self::Ratio | Self::Difference | Self::PaperChange | Self::PaperBy)
    }

    pub(crate) fn parse(word: &str) -> Option<Self> {
        Self::ALL.iter().find(|(name, _)| *name == word).map(|(_, format)| *format)
    }

    pub(crate) const ALL: [(&str, Self); 15] = [
        ("value", Self::Value),
        ("number", Self::Number),
        ("percent", Self::Percent),
        ("spread", Self::Spread),
        ("change", Self::Change),
        ("by", Self::By),
        ("ratio", Self::Ratio),
        ("difference", Self::Difference),
        ("paper", Self::Paper),
        ("paper_change", Self::PaperChange),
        ("paper_by", Self::PaperBy),
        ("threshold", Self::Threshold),
        ("from", Self::From),
        ("to", Self::To),
        ("band", Self::Band),
    ];
}

impl Cell {
    /// `case` or `case@point`.
    #[must_use]
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
