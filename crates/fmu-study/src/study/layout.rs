//! The layout of a study file.

use fmu_system::metrics::Kind;
use fmu_system::spanned::Spanned;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// A study that searches parameters of FMUs.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    /// Title.
    pub(super) title: String,
    /// Description; an empty line begins a new paragraph.
    #[serde(default)]
    pub(super) description: String,
    /// Source, such as a paper.
    #[serde(default)]
    pub(super) reference: String,
    /// Scenario; path relative to this file.
    pub(super) scenario: Spanned<String>,
    /// `optimize`.
    pub(super) method: Spanned<String>,
    /// Cases of the scenario that are evaluated; all if absent.
    pub(super) cases: Option<Vec<Spanned<String>>>,
    /// Stop time, s, earlier than the scenario's.
    pub(super) stop: Option<Spanned<f64>>,
    /// The scenario's first n seeds; all if absent.
    pub(super) seeds: Option<Spanned<i64>>,
    /// Seed of the methods; 1 if absent.
    pub(super) seed: Option<Spanned<i64>>,
    /// Objective of candidates that are not feasible; 1e6 if absent.
    pub(super) penalty: Option<Spanned<f64>>,
    /// End of each method.
    pub(super) budget: Budget,
    /// Parameters that are searched.
    #[serde(rename = "parameter", default)]
    pub(super) parameters: Vec<ParameterEntry>,
    /// Constants by name, for constraints.
    #[serde(default)]
    pub(super) constants: BTreeMap<Spanned<String>, Spanned<f64>>,
    /// Inequalities between parameters, checked before a candidate is run.
    #[serde(rename = "constraint", default)]
    pub(super) constraints: Vec<ConstraintEntry>,
    /// Limits on signals; a run that exceeds one counts as diverged.
    #[serde(rename = "limit", default)]
    pub(super) limits: Vec<LimitEntry>,
    /// The objective, which is minimized: the sum of its terms, averaged over the runs.
    pub(super) objective: Spanned<ObjectiveEntry>,
    /// Methods, one after the other.
    #[serde(rename = "search", default)]
    pub(super) methods: Vec<MethodEntry>,
    /// Values to compare with, in addition to the scenario's own.
    #[serde(rename = "compare", default)]
    pub(super) comparisons: Vec<CompareEntry>,
}

/// End of a method.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Budget {
    /// Evaluations per method.
    pub(super) evaluations: Spanned<i64>,
    /// A method ends when it has reached this objective.
    pub(super) target: Option<Spanned<f64>>,
}

/// A Real parameter of a component and its range.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ParameterEntry {
    /// Parameter, as `component:parameter`.
    pub(super) name: Spanned<String>,
    /// Name in constraints.
    pub(super) symbol: Option<Spanned<String>>,
    /// Minimum, in the unit of the parameter.
    pub(super) min: Spanned<f64>,
    /// Maximum, in the unit of the parameter.
    pub(super) max: Spanned<f64>,
    /// True for equal ratios instead of equal differences.
    #[serde(default)]
    pub(super) log: bool,
}

/// An inequality between parameters.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ConstraintEntry {
    /// Name.
    pub(super) name: Spanned<String>,
    /// Inequality, such as `eta > kappa2`: < <= > >=, + - * / ^, parentheses, abs, sqrt, min, max.
    pub(super) inequality: Spanned<String>,
}

/// A limit on a signal.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitEntry {
    /// Recorded signal, as `component:signal`.
    pub(super) signal: Spanned<String>,
    /// Largest magnitude, in the unit of the signal.
    pub(super) magnitude: Spanned<f64>,
}

/// Terms with weights, or with judgments that determine the weights.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectiveEntry {
    /// Importance of each term relative to the others: 1 to 9, reciprocals such as "1/3" below the diagonal.
    pub(super) judgments: Option<Spanned<Vec<Vec<Spanned<Judgment>>>>>,
    /// Terms.
    #[serde(rename = "term", default)]
    pub(super) terms: Vec<TermEntry>,
}

/// A number, or a reciprocal such as "1/3".
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Judgment {
    /// A number.
    Number(f64),
    /// A ratio.
    Text(String),
}

/// A term of the objective.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TermEntry {
    /// Recorded signal, as `component:signal`.
    pub(super) signal: Spanned<String>,
    /// Kind of number that needs no band, threshold or times. Its magnitude is used.
    pub(super) kind: Spanned<Kind>,
    /// Weight; absent with judgments.
    pub(super) weight: Option<Spanned<f64>>,
    /// Value that counts as 1; 1 if absent.
    pub(super) reference: Option<Spanned<f64>>,
    /// First and last time, s; the whole run if absent.
    pub(super) window: Option<Spanned<[f64; 2]>>,
}

/// A method.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct MethodEntry {
    /// `pacsa`, `ga` or `cmaes`.
    pub(super) kind: Spanned<String>,
    /// Folder of the results; the kind if absent.
    pub(super) name: Option<Spanned<String>>,
    /// Title.
    pub(super) title: Option<String>,
    /// Seed; if absent, the study's.
    pub(super) seed: Option<Spanned<i64>>,
    /// Seeds: the method runs once with each.
    pub(super) seeds: Option<Spanned<Vec<Spanned<i64>>>>,
    /// Settings of the method.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, f64>")]
    pub(super) settings: BTreeMap<Spanned<String>, Spanned<toml::Value>>,
}

/// Values that are evaluated once.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CompareEntry {
    /// Title.
    pub(super) title: String,
    /// Another case of the scenario.
    pub(super) case: Option<Spanned<String>>,
    /// Values by symbol or `component:parameter`; the others are the scenario's.
    #[serde(default)]
    pub(super) values: BTreeMap<Spanned<String>, Spanned<f64>>,
}
