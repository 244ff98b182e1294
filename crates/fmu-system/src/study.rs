//! Study files with `[[vary]]`: TOML. Their reference is `studies/README.md`.
//!
//! The Python package runs them; it gets them as JSON.

mod check;
mod scenario;

use crate::fmus::FmusError;
use crate::problem::{Collector, Problems};
use crate::resolve::{self, Descriptions, ResolveError};
use crate::spanned::Spanned;
use miette::Diagnostic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A study: a scenario with values that vary.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Title.
    title: String,
    /// Description; an empty line begins a new paragraph.
    #[serde(default)]
    description: String,
    /// Source, such as a paper.
    #[serde(default)]
    reference: String,
    /// Scenario; path relative to this file.
    scenario: Spanned<String>,
    /// Choice of the samples.
    method: Spanned<Method>,
    /// Cases of the scenario that are run; all if absent.
    cases: Option<Spanned<Vec<Spanned<String>>>>,
    /// Points of the scenario's sweep that are run; all if absent.
    points: Option<Spanned<Vec<Spanned<String>>>>,
    /// Stop time, s, earlier than the scenario's.
    stop: Option<Spanned<f64>>,
    /// Number of samples, base samples (Sobol) or trajectories (Morris); 100 if absent.
    runs: Option<Spanned<i64>>,
    /// Seed of the samples; 1 if absent.
    seed: Option<Spanned<i64>>,
    /// Design of a sweep or a sample.
    design: Option<Spanned<Design>>,
    /// Analysis of method sensitivity.
    analysis: Option<Spanned<Analysis>>,
    /// Metrics of the scenario that are reported; all if absent.
    metrics: Option<Vec<Spanned<String>>>,
    /// Factors: what varies.
    vary: Spanned<Vec<Factor>>,
    /// Correlations of normal factors without limits, for method sample.
    #[serde(default)]
    correlation: Vec<Correlation>,
    /// Requirements in addition to those of the scenario; one for the same metric replaces the scenario's.
    #[serde(default)]
    requirement: Vec<Requirement>,
    /// Runs whose signals are recorded.
    series: Option<Series>,
    /// Search of the methods `worst_case` and `optimize`.
    search: Option<Spanned<Search>>,
}

/// Choice of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Method {
    /// Listed values: all combinations, lists in parallel, or one factor at a time.
    Sweep,
    /// Random samples from distributions (Monte Carlo).
    Sample,
    /// Morris' elementary effects or Sobol indices.
    Sensitivity,
    /// Search for the extreme of a metric; a failed run is the worst case.
    WorstCase,
    /// Search for the extreme of a metric; failed runs are skipped.
    Optimize,
}

/// Design of a sweep or a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Design {
    /// All combinations of the values; default of method sweep.
    FullFactorial,
    /// First values with first values, second with second, and so on.
    List,
    /// All factors at their middle value, then each factor at its other values.
    OneAtATime,
    /// Independent random numbers.
    Random,
    /// One sample in each of `runs` equal parts of every distribution; default of method sample.
    LatinHypercube,
    /// Sobol sequence.
    Sobol,
}

/// Analysis of method sensitivity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Analysis {
    /// Elementary effects.
    Morris,
    /// Shares of the variance; `runs` is a power of two.
    Sobol,
}

/// Variables, or the FMU of a component, and their values.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Factor {
    /// Name of the factor and of its column in the tables.
    name: Spanned<String>,
    /// Parameters, start values, or constant inputs, as `component:variable`; or the communication step in s, as
    /// `simulation:step`.
    variable: Option<Spanned<Names>>,
    /// Component whose FMU varies, instead of a variable.
    fmu: Option<Spanned<String>>,
    /// True if the other FMUs get the component's parameters, as far as they have them.
    #[serde(default)]
    keep_parameters: bool,
    /// Unit of the values: that of the variable or a display unit.
    unit: Option<Spanned<String>>,
    /// True if the values are multiples of the scenario's value.
    #[serde(default)]
    relative: bool,
    /// Distribution, instead of values.
    distribution: Option<Spanned<Distribution>>,
    /// Values, instead of a distribution; for `fmu`, the names of FMUs.
    values: Option<Spanned<Vec<Spanned<Level>>>>,
    /// Weights of the values, which make some more frequent.
    weights: Option<Spanned<Vec<f64>>>,
    /// Minimum of uniform, log_uniform, triangular and grid; truncates normal and lognormal.
    min: Option<Spanned<f64>>,
    /// Maximum, as `min`.
    max: Option<Spanned<f64>>,
    /// Mean of normal.
    mean: Option<Spanned<f64>>,
    /// Standard deviation of a normal value, or of the natural logarithm of a lognormal value.
    deviation: Option<Spanned<f64>>,
    /// Median of lognormal.
    median: Option<Spanned<f64>>,
    /// Most frequent value of triangular.
    mode: Option<Spanned<f64>>,
    /// Number of values of grid.
    count: Option<Spanned<i64>>,
    /// Spacing of the values of grid; linear if absent.
    scale: Option<Spanned<Scale>>,
}

/// One name or several.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "must be a string or a list of strings")]
enum Names {
    /// One name.
    One(String),
    /// Several names.
    Several(Vec<String>),
}

/// Distribution of a factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Distribution {
    /// Equally frequent from `min` to `max`.
    Uniform,
    /// The logarithm is uniform from `min` to `max`.
    LogUniform,
    /// Normal, with `mean` and `deviation`; `min` and `max` truncate it.
    Normal,
    /// The natural logarithm is normal, with `median` and `deviation`; `min` and `max` truncate it.
    Lognormal,
    /// The density rises linearly from `min` to `mode` and falls linearly to `max`.
    Triangular,
    /// `count` values from `min` to `max`.
    Grid,
    /// A different Integer for every sample.
    Seed,
}

/// A value of a factor.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "must be a number, true, false or a string")]
enum Level {
    /// Boolean.
    Boolean(bool),
    /// Whole number.
    Integer(i64),
    /// Number.
    Number(f64),
    /// String, value of an enumeration, or FMU.
    Text(String),
}

impl Level {
    /// The value, if it is a number.
    fn number(&self) -> Option<f64> {
        match self {
            Self::Integer(value) => Some(*value as f64),
            Self::Number(value) => Some(*value),
            Self::Boolean(_) | Self::Text(_) => None,
        }
    }
}

/// Spacing of the values of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Scale {
    /// Equal differences.
    Linear,
    /// Equal ratios.
    Log,
}

/// Correlation of two normal factors.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Correlation {
    /// Names of the two factors.
    between: Spanned<Vec<Spanned<String>>>,
    /// Coefficient of correlation, between -1 and 1.
    coefficient: Spanned<f64>,
}

/// Limits on a metric, and the share of the runs that must be within them.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Requirement {
    /// Metric of the scenario.
    metric: Spanned<String>,
    /// True if the limits apply to the change against the case's baseline in the same sample, in percent.
    #[serde(default)]
    of_change: bool,
    /// Minimum, in the unit of the metric.
    min: Option<Spanned<f64>>,
    /// Maximum, in the unit of the metric.
    max: Option<Spanned<f64>>,
    /// Cases that must be within the limits; all if absent.
    cases: Option<Vec<Spanned<String>>>,
    /// Share of the runs that must be within the limits, above 0 and up to 1; 1 if absent.
    share: Option<Spanned<f64>>,
}

/// Runs whose signals are recorded.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Series {
    /// Metric that decides which runs are the worst; the first one with a requirement if absent.
    metric: Option<Spanned<String>>,
    /// Number of the worst runs of each case and point; 0 if absent.
    worst: Option<Spanned<i64>>,
    /// Number of other runs of each case and point, chosen at random; 0 if absent.
    random: Option<Spanned<i64>>,
}

/// A search for the extreme of a metric.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Search {
    /// Metric of the scenario.
    metric: Spanned<String>,
    /// Extreme to search for.
    direction: Direction,
    /// Case whose metric is used; if absent, the extreme of all cases for `worst_case`, the worst of all cases for
    /// `optimize`.
    case: Option<Spanned<String>>,
    /// Sampler of Optuna; TPESampler if absent.
    sampler: Option<String>,
    /// Options of the sampler.
    #[serde(default = "no_options")]
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    options: Spanned<toml::Table>,
    /// Samples proposed at a time; 8 if absent.
    batch: Option<Spanned<i64>>,
}

fn no_options() -> Spanned<toml::Table> {
    Spanned::new(0..0, toml::Table::new())
}

/// Extreme of a metric.
#[derive(Debug, Clone, Copy, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Direction {
    /// Smallest value.
    Minimize,
    /// Largest value.
    Maximize,
}

/// Error while reading a study.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum StudyError {
    /// The study has mistakes.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Problems(#[from] Problems),
    /// The study cannot be read, or the scenario cannot be resolved.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scenario(#[from] ResolveError),
    /// An FMU cannot be opened.
    #[error(transparent)]
    Fmu(#[from] FmusError),
}

impl StudyError {
    /// The mistakes, each as `file:line:column: message; hint`.
    pub fn lines(&self) -> Vec<String> {
        match self {
            Self::Problems(problems) => problems.lines(),
            Self::Scenario(error) => error.lines(),
            Self::Fmu(_) => vec![self.to_string()],
        }
    }
}

/// Reads the text of a study.
pub fn text(path: &Path) -> Result<String, StudyError> {
    Ok(resolve::read(path)?)
}

/// Reads a study and checks it against its scenario. `runs` replaces its number of samples.
///
/// # Errors
/// A file cannot be read, the study or its scenario has mistakes, or they do not fit together.
pub fn read(path: &Path, source: &dyn Descriptions, runs: Option<u64>) -> Result<Study, StudyError> {
    let text = text(path)?;
    let mut problems = Collector::new(path, &text, "toml");
    let Some(mut study) = problems.parse::<Study>(&text) else { return Err(problems.fail().into()) };
    if let Some(runs) = runs {
        let span = study.runs.as_ref().map_or(study.method.span(), Spanned::span);
        if *study.method.get_ref() == Method::Sweep {
            problems.add(span, "the values of a sweep determine the number of samples: remove --runs");
            return Err(problems.fail().into());
        }
        study.runs = Some(Spanned::new(span, i64::try_from(runs).unwrap_or(i64::MAX)));
    }
    study.check(&mut problems);
    if problems.is_empty() {
        study.check_scenario(path, source, &mut problems)?;
    }
    problems.finish()?;
    Ok(study)
}

impl Study {
    /// The study as JSON, without the keys that are absent.
    pub fn json(&self) -> serde_json::Value {
        let mut all = serde_json::to_value(self).unwrap_or_default();
        remove_null(&mut all);
        all
    }
}

fn remove_null(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(object) => {
            object.retain(|_, value| !value.is_null());
            object.values_mut().for_each(remove_null);
        }
        serde_json::Value::Array(values) => values.iter_mut().for_each(remove_null),
        _ => (),
    }
}
