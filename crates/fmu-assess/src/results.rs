//! Results of a maneuver: metrics with their limits, runs, and signals for figures.

use crate::Trace;
use crate::evaluators::{self, Evaluation};
use crate::json::document;
use crate::metric::{self, Definition, Direction};
use crate::run_result::RunResult;
use fmu_system::requirements::holds;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A group of maneuvers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Suite {
    /// Steady state and response to steering.
    Handling,
    /// Sine with dwell and double lane changes.
    Stability,
    /// Fishhook and J-turn.
    Rollover,
    /// Braking straight ahead, on split friction, and in a turn.
    Braking,
    /// Ride on rough roads.
    Ride,
}

impl Suite {
    /// All suites.
    pub const ALL: [Self; 5] = [Self::Handling, Self::Stability, Self::Rollover, Self::Braking, Self::Ride];
}

/// Results of a maneuver for one system.
#[derive(Debug)]
pub(crate) struct Results {
    pub(crate) maneuver: &'static str,
    pub(crate) suite: Suite,
    pub(crate) system: &'static str,
    pub(crate) metrics: Vec<Measured>,
    pub(crate) runs: Vec<RunRecord>,
    pub(crate) skipped: Option<Skipped>,
    /// Runs whose signals the report shows.
    pub(crate) shown: Vec<(String, Trace<'static>)>,
    /// Sections of a coned track, m: begin, end, right and left edge of each.
    pub(crate) track: Option<[[f64; 4]; 3]>,
    /// Largest entry speed of a coned track, km/h.
    pub(crate) entry_speed: Option<f64>,
}

impl Results {
    pub(crate) fn new(maneuver: &'static str, suite: Suite, system: &'static str) -> Self {
        let (metrics, runs, shown) = (Vec::new(), Vec::new(), Vec::new());
        Self { maneuver, suite, system, metrics, runs, skipped: None, shown, track: None, entry_speed: None }
    }

    /// Skips the maneuver. A metric with the name of the maneuver reports the reason.
    pub(crate) fn skip(&mut self, missing: Vec<String>, reason: String) {
        let of = Definition::neutral("", "The maneuver", "").is("A skipped maneuver has no metrics.");
        self.maneuver.clone_into(&mut self.metric(&of, Value::Null).set_dropped(&reason).id);
        self.skipped = Some(Skipped { run: self.maneuver.to_owned(), missing, reason });
    }

    /// Adds a run with its metrics.
    pub(crate) fn note(&mut self, result: &RunResult, metrics: &Evaluation) {
        self.runs.push(RunRecord {
            id: result.spec.id.clone(),
            suite: self.suite,
            system: self.system,
            parameters: result.spec.shown.clone(),
            flags: result.flags.clone(),
            stop_reason: result.stop_reason.clone(),
            rows: result.trace.times().len(),
            error: result.error.clone(),
            metrics: document(&metrics.metrics),
        });
    }

    /// Keeps the signals of a run for figures.
    pub(crate) fn show(&mut self, result: &RunResult) {
        self.shown.push((result.spec.id.clone(), result.trace.clone()));
    }

    pub(crate) fn metric(&mut self, of: &Definition, value: impl Into<Value>) -> &mut Measured {
        self.metrics.push(Measured {
            id: format!("{}.{}", self.maneuver, of.name),
            title: of.title.to_owned(),
            definition: of.definition,
            unit: of.unit,
            suite: self.suite,
            value: value.into(),
            direction: of.direction,
            reason: None,
            limit: None,
            is_dropped: false,
            is_best_without: false,
            bound: None,
            series: None,
            incomparable: None,
            label: None,
        });
        self.last()
    }

    pub(crate) fn last(&mut self) -> &mut Measured {
        self.metrics.last_mut().expect("a metric was added")
    }

    /// Adds metrics from an evaluator. If the run was cut short, they cannot be compared.
    pub(crate) fn take(&mut self, run: &RunResult, metrics: &Evaluation, wanted: &[&str]) {
        for found in wanted.iter().filter_map(|name| metrics.metrics.iter().find(|metric| metric.name == *name)) {
            // A row of the report can show only one number.
            if matches!(found.value, metric::Value::Numbers(_)) {
                continue;
            }
            let metric = self.metric(found.definition, json!(found.value));
            if let metric::Value::Null(reason) = &found.value {
                metric.set_reason(&reason.to_string());
            }
            metric.incomparable = run.cut_short();
        }
    }

    /// Adds metrics without a value, all for the same reason.
    pub(crate) fn take_none(&mut self, evaluator: &str, wanted: &[&str], reason: &str) {
        let table = evaluators::find(evaluator).map_or(&[][..], |evaluator| evaluator.metrics);
        for of in wanted.iter().filter_map(|name| table.iter().find(|definition| definition.name == *name)) {
            self.metric(of, Value::Null).set_reason(reason);
        }
    }
}

/// A metric of one system.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Measured {
    pub(crate) id: String,
    pub(crate) title: String,
    /// Computation, in words.
    pub(crate) definition: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) suite: Suite,
    pub(crate) value: Value,
    pub(crate) direction: Direction,
    pub(crate) reason: Option<String>,
    pub(crate) limit: Option<Limit>,
    /// True if the plant lacks a signal that the metric needs.
    pub(crate) is_dropped: bool,
    /// True if a missing value is the best result.
    pub(crate) is_best_without: bool,
    /// Bound of a missing value.
    pub(crate) bound: Option<Bound>,
    /// Values under different conditions; the value of the metric is their extreme or last value.
    pub(crate) series: Option<Series>,
    /// Reason that the value cannot be compared with the other system's.
    pub(crate) incomparable: Option<String>,
    /// Label of the value in a standard, such as a comfort class.
    pub(crate) label: Option<&'static str>,
}

/// Bound of a value that is outside the range of the procedure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Bound {
    Above(f64),
    Below(f64),
}

impl Bound {
    pub(crate) fn text(self) -> String {
        match self {
            Self::Above(limit) => format!("> {limit}"),
            Self::Below(limit) => format!("< {limit}"),
        }
    }
}

/// Values of a metric by the condition of the run, such as the speed. Values under different conditions are not
/// comparable, and the better system reaches conditions that the other system does not reach.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Series {
    pub(crate) unit: &'static str,
    /// Condition and value for each run that the vehicle can drive.
    pub(crate) values: Vec<(f64, f64)>,
    /// True if the metric depends only on these runs.
    pub(crate) is_whole: bool,
}

impl Measured {
    /// Sets the limit. `not_applicable` is the reason if the limit does not apply.
    pub(crate) fn set_limit(&mut self, limit: Limit, not_applicable: Option<&'static str>) -> &mut Self {
        self.limit = Some(Limit { not_applicable, ..limit });
        self
    }

    pub(crate) fn set_reason(&mut self, reason: &str) -> &mut Self {
        self.reason = Some(reason.to_owned());
        self
    }

    /// Sets the reason for a missing value: the plant lacks a signal.
    pub(crate) fn set_dropped(&mut self, reason: &str) -> &mut Self {
        self.is_dropped = true;
        self.set_reason(reason)
    }

    /// Sets the reason for a missing value that is the best result.
    pub(crate) fn set_best(&mut self, reason: &str) -> &mut Self {
        self.is_best_without = true;
        self.set_reason(reason)
    }
}

/// Source of limits set by the caller.
pub(crate) const REQUIRED: &str = "--require";

/// A limit from a regulation or from the caller.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub(crate) struct Limit {
    /// `Some(true)` if the value is a Boolean that must be true.
    #[serde(rename = "is", skip_serializing_if = "Option::is_none")]
    holds: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    min: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max: Option<f64>,
    source: &'static str,
    /// Reason that the limit does not apply.
    #[serde(skip)]
    pub(crate) not_applicable: Option<&'static str>,
}

impl Limit {
    /// A Boolean that must be true.
    pub(crate) fn holds(source: &'static str) -> Self {
        Self { holds: Some(true), source, ..Self::default() }
    }

    pub(crate) fn at_least(limit: f64, source: &'static str) -> Self {
        Self { min: Some(limit), source, ..Self::default() }
    }

    pub(crate) fn at_most(limit: f64, source: &'static str) -> Self {
        Self { max: Some(limit), source, ..Self::default() }
    }

    /// True if the caller has set the limit. It then gives a verdict even for a missing value.
    pub(crate) fn is_required(&self) -> bool {
        self.source == REQUIRED
    }

    pub(crate) fn is_kept(&self, value: &Value) -> Option<bool> {
        let is_within = |value| holds([self.min, self.max], Some(value));
        if self.holds.is_some() { value.as_bool() } else { value.as_f64().map(is_within) }
    }
}

/// An executed run.
#[derive(Debug, Clone, Serialize)]
pub struct RunRecord {
    /// Name.
    pub id: String,
    /// Group of maneuvers.
    pub suite: Suite,
    /// `without` or `with`.
    pub system: &'static str,
    /// Inputs of the run, SI; amplitudes in degrees at the steering wheel.
    pub parameters: BTreeMap<String, f64>,
    /// `spun`, `rolled_over`, `lost`, `not_finished`, `not_settled`, `diverged`.
    pub flags: Vec<&'static str>,
    /// Reason for its end.
    pub stop_reason: String,
    /// Number of rows.
    pub rows: usize,
    /// Error, if any.
    pub error: Option<String>,
    /// Metrics of the evaluator.
    pub metrics: Value,
}

/// A skipped maneuver.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// Name of the maneuver.
    pub run: String,
    /// Signals that are missing.
    pub missing: Vec<String>,
    /// Reason.
    pub reason: String,
}
