//! The layout of the file.

use fmu_system::metrics::Kind;
use serde::Deserialize;
use serde_spanned::Spanned;
use std::collections::BTreeMap;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) title: String,
    #[serde(default)]
    pub(super) description: String,
    #[serde(default)]
    pub(super) reference: String,
    pub(super) scenario: Spanned<String>,
    pub(super) method: Spanned<String>,
    pub(super) cases: Option<Vec<Spanned<String>>>,
    pub(super) stop: Option<Spanned<f64>>,
    pub(super) seeds: Option<Spanned<i64>>,
    pub(super) seed: Option<Spanned<i64>>,
    pub(super) penalty: Option<Spanned<f64>>,
    pub(super) budget: Budget,
    #[serde(rename = "parameter", default)]
    pub(super) parameters: Vec<ParameterEntry>,
    #[serde(default)]
    pub(super) constants: BTreeMap<Spanned<String>, Spanned<f64>>,
    #[serde(rename = "constraint", default)]
    pub(super) constraints: Vec<ConstraintEntry>,
    #[serde(rename = "limit", default)]
    pub(super) limits: Vec<LimitEntry>,
    pub(super) objective: Spanned<ObjectiveEntry>,
    #[serde(rename = "search", default)]
    pub(super) methods: Vec<MethodEntry>,
    #[serde(rename = "compare", default)]
    pub(super) comparisons: Vec<CompareEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Budget {
    pub(super) evaluations: Spanned<i64>,
    pub(super) target: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParameterEntry {
    pub(super) name: Spanned<String>,
    pub(super) symbol: Option<Spanned<String>>,
    pub(super) min: Spanned<f64>,
    pub(super) max: Spanned<f64>,
    #[serde(default)]
    pub(super) log: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConstraintEntry {
    pub(super) name: Spanned<String>,
    pub(super) inequality: Spanned<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitEntry {
    pub(super) signal: Spanned<String>,
    pub(super) magnitude: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectiveEntry {
    pub(super) judgments: Option<Spanned<Vec<Vec<Spanned<Judgment>>>>>,
    #[serde(rename = "term", default)]
    pub(super) terms: Vec<TermEntry>,
}

/// A number, or a reciprocal such as "1/3".
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Judgment {
    Number(f64),
    Text(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TermEntry {
    pub(super) signal: Spanned<String>,
    pub(super) kind: Spanned<Kind>,
    pub(super) weight: Option<Spanned<f64>>,
    pub(super) reference: Option<Spanned<f64>>,
    pub(super) window: Option<Spanned<[f64; 2]>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MethodEntry {
    pub(super) kind: Spanned<String>,
    pub(super) name: Option<Spanned<String>>,
    pub(super) title: Option<String>,
    pub(super) seed: Option<Spanned<i64>>,
    pub(super) seeds: Option<Spanned<Vec<Spanned<i64>>>>,
    #[serde(default)]
    pub(super) settings: BTreeMap<Spanned<String>, Spanned<toml::Value>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CompareEntry {
    pub(super) title: String,
    pub(super) case: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) values: BTreeMap<Spanned<String>, Spanned<f64>>,
}
