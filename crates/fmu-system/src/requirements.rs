//! Requirements: compares the metrics of the runs with their limits, and writes the verdicts as text and JUnit XML.
//!
//! This is the only implementation of the rules.

use crate::metrics::{Columns, Definition, Kind};
use crate::plan::Plan;
use crate::report::{Metric, Requirement, Source};
use crate::run::Run;
use crate::typography;
use fmu_import::terminal::escaped;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// Status of a requirement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Enough runs are within the limits.
    Passed,
    /// Too few runs are within the limits.
    Failed,
    /// A run failed, was ended by an FMU or was cut short.
    Open,
}

impl Status {
    /// Text of a badge.
    pub fn title(self) -> &'static str {
        match self {
            Self::Passed => "Passed",
            Self::Failed => "Failed",
            Self::Open => "Not evaluated",
        }
    }
}

/// Outcome of a requirement for the runs of a case at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Status of the requirement.
    pub status: Status,
    /// The number that comes closest to a limit or exceeds it most; `None` if no run has a number.
    pub worst: Option<f64>,
    /// Number of executed runs in which the metric is undefined.
    pub missing: usize,
}

/// The rows that a metric is computed from, in relation to its window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rows {
    /// All rows of the window.
    All,
    /// The runs end before the window does. A requirement fails if a metric of this kind can no longer return to its
    /// limits; otherwise it is open. `None` for a metric that is computed from other metrics.
    Cut(Option<Kind>),
}

/// Distance from a number to the nearest limit; negative outside the limits. A number that is not finite is outside.
fn margin([min, max]: [Option<f64>; 2], value: f64) -> f64 {
    if !value.is_finite() {
        return f64::NEG_INFINITY;
    }
    (value - min.unwrap_or(f64::NEG_INFINITY)).min(max.unwrap_or(f64::INFINITY) - value)
}

/// Returns true if a number is within the limits, minimum and maximum; false for a missing or non-finite number.
pub fn holds(limits: [Option<f64>; 2], value: Option<f64>) -> bool {
    value.is_some_and(|value| margin(limits, value) >= 0.0)
}

/// Returns true if at least `share` of the runs are within the limits.
pub fn is_enough(kept: usize, of: usize, share: f64) -> bool {
    kept as f64 >= share * of as f64
}

/// Compares a metric with its limits. `numbers` contains the value for each executed run, `None` if undefined; `runs`
/// is the number of planned runs.
pub fn evaluate(limits: [Option<f64>; 2], share: f64, numbers: &[Option<f64>], runs: usize, rows: Rows) -> Outcome {
    let known = || numbers.iter().copied().flatten();
    let kept = numbers.iter().filter(|value| holds(limits, **value)).count();
    // More rows cannot bring these numbers back within the limits.
    let stays_outside = |kind: Option<Kind>| {
        let [least, greatest] = limits;
        let decides = match kind {
            Some(Kind::Peak | Kind::Max | Kind::PeakToPeak | Kind::Changes) => [None, greatest],
            Some(Kind::Min) => [least, None],
            _ => [None, None],
        };
        let outside = known().filter(|value| value.is_finite() && !holds(decides, Some(*value))).count();
        !is_enough(numbers.len() - outside, numbers.len(), share)
    };
    let status = match () {
        () if matches!(rows, Rows::Cut(kind) if !stays_outside(kind)) => Status::Open,
        () if !is_enough(kept, numbers.len(), share) => Status::Failed,
        () if numbers.len() < runs => Status::Open,
        () => Status::Passed,
    };
    let worst = known().min_by(|a, b| margin(limits, *a).total_cmp(&margin(limits, *b)));
    Outcome { status, worst, missing: numbers.len() - known().count() }
}

/// A requirement for a case at a point, and its outcome.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict<'a> {
    metric: &'a Metric,
    requirement: &'a Requirement,
    case: &'a str,
    /// `None` without a sweep.
    point: Option<&'a str>,
    /// Outcome.
    pub outcome: Outcome,
}

/// Returns the metrics that have requirements, and the metrics that they are computed from, in ascending order.
fn needed(plan: &Plan) -> BTreeSet<usize> {
    let mut all: BTreeSet<usize> =
        (0..plan.metrics.len()).filter(|index| plan.metrics[*index].requirement.is_some()).collect();
    // A metric can only use metrics above it.
    for index in (0..plan.metrics.len()).rev() {
        if let (true, Source::Metrics { uses, .. }) = (all.contains(&index), &plan.metrics[index].source) {
            all.extend(uses);
        }
    }
    all
}

pub(crate) fn definitions<'a>(plan: &'a Plan, metrics: &BTreeSet<usize>) -> impl Iterator<Item = &'a Definition> {
    metrics.iter().filter_map(|index| match &plan.metrics[*index].source {
        Source::Signals(definition) => Some(definition),
        Source::Metrics { .. } => None,
    })
}

/// Index of the baseline's run for a run, if one of the metrics needs it.
pub(crate) fn baseline(plan: &Plan, metrics: &BTreeSet<usize>, run: &Run) -> Option<usize> {
    let case = plan.cases.iter().find(|case| case.name == run.case)?;
    let name = case.baseline.as_ref()?;
    definitions(plan, metrics).find(|definition| definition.from_baseline)?;
    plan.runs.iter().position(|other| other.case == *name && other.point == run.point && other.seed == run.seed)
}

/// Recorded signals of a run.
#[derive(Debug, Clone, Default)]
pub struct Signals {
    /// Times, s.
    pub times: Vec<f64>,
    /// Columns of the plan, by index.
    pub columns: BTreeMap<usize, Vec<f64>>,
}

impl Signals {
    fn columns(&self) -> Columns<'_> {
        self.columns.iter().map(|(index, values)| (*index, values.as_slice())).collect()
    }
}

/// Reads columns of a run, by index; `None` for a run that failed.
pub type Read<'a> = &'a dyn Fn(&Run, &BTreeSet<usize>) -> Option<Result<Signals, String>>;

type Numbers = Vec<Option<f64>>;

/// Values of the metrics of the complete runs, by the id of the run.
pub type RunNumbers<'a> = BTreeMap<&'a str, Numbers>;

/// Computes the metrics of all runs; with `is_only_required`, only those that a requirement needs.
///
/// # Errors
/// Signals cannot be read, or a metric has no number.
pub fn numbers<'a>(plan: &'a Plan, is_only_required: bool, read: Read<'_>) -> Result<RunNumbers<'a>, String> {
    let metrics = if is_only_required { needed(plan) } else { (0..plan.metrics.len()).collect() };
    if is_only_required && metrics.is_empty() {
        return Ok(RunNumbers::new());
    }
    let columns: BTreeSet<usize> = definitions(plan, &metrics).flat_map(Definition::needed_columns).collect();
    let mut found = RunNumbers::new();
    for run in &plan.runs {
        let Some(signals) = read(run, &columns).transpose()? else { continue };
        let baseline = baseline(plan, &metrics, run).and_then(|other| read(&plan.runs[other], &columns)).transpose()?;
        let of_baseline = baseline.as_ref().map(Signals::columns);
        let numbers = numbers_of(plan, &metrics, &signals.times, &signals.columns(), of_baseline.as_ref())?;
        found.insert(&run.id, numbers);
    }
    Ok(found)
}

/// The verdicts on a plan, ordered by metric, case, point.
pub fn verdicts<'a>(plan: &'a Plan, numbers: &RunNumbers<'_>) -> Vec<Verdict<'a>> {
    let points: Vec<Option<&str>> =
        if plan.points.is_empty() { vec![None] } else { plan.points.iter().map(|p| Some(p.name.as_str())).collect() };
    let mut found = Vec::new();
    for (index, metric) in plan.metrics.iter().enumerate() {
        let Some(requirement) = &metric.requirement else { continue };
        let kind = match &metric.source {
            Source::Signals(definition) => Some(definition.kind),
            Source::Metrics { .. } => None,
        };
        let rows = if plan.is_cut && is_cut_off(plan, index) { Rows::Cut(kind) } else { Rows::All };
        for case in &requirement.cases {
            for point in &points {
                let runs = plan.runs.iter().filter(|run| run.case == *case && run.point.as_deref() == *point);
                let values: Vec<Option<f64>> =
                    runs.filter_map(|run| numbers.get(run.id.as_str())).map(|of_run| of_run[index]).collect();
                let limits = [requirement.min, requirement.max];
                let outcome = evaluate(limits, requirement.share, &values, plan.seeds.len().max(1), rows);
                found.push(Verdict { metric, requirement, case, point: *point, outcome });
            }
        }
    }
    found
}

/// Computes some metrics of a run; the result has an element for every metric of the plan.
pub(crate) fn numbers_of(
    plan: &Plan,
    metrics: &BTreeSet<usize>,
    times: &[f64],
    columns: &Columns<'_>,
    baseline: Option<&Columns<'_>>,
) -> Result<Numbers, String> {
    let simulation = &plan.simulation;
    let mut numbers = vec![None; plan.metrics.len()];
    for index in metrics {
        let metric = &plan.metrics[*index];
        numbers[*index] = match &metric.source {
            // The runs were cut short.
            Source::Signals(Definition { window: Some([from, _]), .. }) if *from >= simulation.stop => None,
            Source::Signals(definition) => definition
                .value(times, columns, baseline, simulation.step)
                .map_err(|error| format!("metric {}: {error}", metric.name))?,
            Source::Metrics { value, .. } => value.value(|index| numbers[index]),
        };
    }
    Ok(numbers)
}

/// Returns true if a metric needs rows after the stop time of the plan.
fn is_cut_off(plan: &Plan, index: usize) -> bool {
    match &plan.metrics[index].source {
        Source::Metrics { uses, .. } => uses.iter().any(|index| is_cut_off(plan, *index)),
        Source::Signals(definition) => definition.window.is_none_or(|[_, to]| to > plan.simulation.stop),
    }
}

impl Verdict<'_> {
    /// Describes the requirement and the result.
    pub fn text(&self, plan: &Plan) -> String {
        let Self { metric, requirement, outcome, .. } = self;
        let case = plan.cases.iter().find(|case| case.name == self.case).map_or("", |case| &case.title);
        let point = plan.points.iter().find(|point| Some(point.name.as_str()) == self.point);
        let place: Vec<&str> = [metric.title.as_str(), case, point.map_or("", |point| &point.title)]
            .into_iter()
            .filter(|text| !text.is_empty())
            .collect();
        let unit = typography::unit(metric.unit.as_deref().unwrap_or_default());
        let seeds = plan.seeds.len();
        let mut found = Vec::new();
        if let Some(worst) = outcome.worst {
            let of = if seeds > 1 { format!(" in the worst of {seeds} seeds") } else { String::new() };
            found.push(format!("{}{of}", typography::with_unit(&typography::number(worst, metric.digits), &unit)));
        }
        match outcome.missing {
            0 => (),
            _ if seeds < 2 => found.push("no number".to_owned()),
            missing => found.push(format!("no number in {missing} of {seeds} seeds")),
        }
        let found = if found.is_empty() { "–".to_owned() } else { found.join("; ") };
        let limits = typography::limits([requirement.min, requirement.max], &unit);
        let mut text = format!("{}: {found}, required {limits}", place.join(", "));
        if requirement.share < 1.0 {
            let _ = write!(text, " in {} % of the runs", typography::significant(100.0 * requirement.share, 6));
        }
        if let Some(source) = requirement.source.as_ref().filter(|source| !source.is_empty()) {
            let _ = write!(text, " ({source})");
        }
        text
    }
}

/// A test case in JUnit XML: class, name, element for the result (`failure`, `error`, `skipped`, `system-out`), and a
/// text whose first line is the message.
pub type TestCase = (String, String, &'static str, String);

/// First line of a JUnit file.
pub const XML: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";

/// A test suite in JUnit XML.
pub fn junit_suite(name: &str, cases: &[TestCase]) -> String {
    let count = |wanted| cases.iter().filter(|(_, _, element, _)| *element == wanted).count();
    let (failures, errors, skipped) = (count("failure"), count("error"), count("skipped"));
    let (name, tests) = (attribute(name), cases.len());
    let mut out = format!(
        "<testsuite name=\"{name}\" tests=\"{tests}\" failures=\"{failures}\" errors=\"{errors}\" skipped=\"{skipped}\">\n"
    );
    for (class, name, element, text) in cases {
        let (class, name, text) = (attribute(class), attribute(&escaped(name)), escaped(text));
        let (message, text) = (attribute(text.lines().next().unwrap_or_default()), content(&text));
        let inside = match *element {
            "system-out" => format!("<system-out>{text}</system-out>"),
            "skipped" => format!("<skipped message=\"{message}\" />"),
            _ => format!("<{element} message=\"{message}\">{text}</{element}>"),
        };
        let _ = write!(out, "  <testcase classname=\"{class}\" name=\"{name}\">\n    {inside}\n  </testcase>\n");
    }
    out + "</testsuite>\n"
}

/// Writes the verdicts as JUnit XML: a test case for each verdict, and a test case with the message for each failed
/// run.
pub fn junit(plan: &Plan, verdicts: &[Verdict<'_>], failures: &[(String, String)]) -> String {
    let broken = failures.iter().map(|(run, message)| (format!("run {run}"), "error", message.clone()));
    let evaluated = verdicts.iter().map(|verdict| {
        let text = verdict.text(plan);
        let (element, text) = match verdict.outcome.status {
            Status::Failed => ("failure", text),
            Status::Open => ("skipped", format!("Not evaluated: {text}")),
            Status::Passed => ("system-out", text),
        };
        let point = verdict.point.map_or_else(String::new, |point| format!("@{point}"));
        (format!("{}.{}{point}", verdict.metric.name, verdict.case), element, text)
    });
    let cases = broken.chain(evaluated).map(|(name, element, text)| (plan.name.clone(), name, element, text));
    format!("{XML}{}", junit_suite(&plan.name, &cases.collect::<Vec<_>>()))
}

fn content(text: &str) -> Cow<'_, str> {
    quick_xml::escape::partial_escape(text)
}

fn attribute(text: &str) -> String {
    content(text).replace('"', "&quot;").replace('\r', "&#13;").replace('\n', "&#10;").replace('\t', "&#09;")
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT_MOST: [Option<f64>; 2] = [None, Some(1.0)];

    #[test]
    fn the_worst_number_decides() {
        let outcome = evaluate(AT_MOST, 1.0, &[Some(0.5), Some(2.0), Some(-3.0)], 3, Rows::All);
        assert_eq!(outcome, Outcome { status: Status::Failed, worst: Some(2.0), missing: 0 });
        let outcome = evaluate([Some(-1.0), Some(1.0)], 1.0, &[Some(0.0), Some(1.0)], 2, Rows::All);
        assert_eq!(outcome, Outcome { status: Status::Passed, worst: Some(1.0), missing: 0 });
        // A number that is not finite is outside all limits.
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for limits in [AT_MOST, [Some(-1.0), None]] {
                assert!(!holds(limits, Some(value)));
                let outcome = evaluate(limits, 1.0, &[Some(value), Some(0.0)], 2, Rows::All);
                assert_eq!(outcome.status, Status::Failed, "{value} {limits:?}");
            }
        }
        assert!(!holds(AT_MOST, None) && holds(AT_MOST, Some(1.0)) && !holds(AT_MOST, Some(1.1)));
    }

    #[test]
    fn a_run_without_a_number_keeps_no_limit() {
        let outcome = evaluate(AT_MOST, 1.0, &[None, Some(0.0)], 2, Rows::All);
        assert_eq!(outcome, Outcome { status: Status::Failed, worst: Some(0.0), missing: 1 });
        assert_eq!(evaluate(AT_MOST, 0.5, &[None, Some(0.0)], 2, Rows::All).status, Status::Passed);
    }

    #[test]
    fn what_did_not_take_place_is_open() {
        assert_eq!(evaluate(AT_MOST, 1.0, &[Some(0.0)], 2, Rows::All).status, Status::Open);
        assert_eq!(evaluate(AT_MOST, 1.0, &[], 1, Rows::All).status, Status::Open);
        assert_eq!(evaluate(AT_MOST, 1.0, &[Some(2.0)], 1, Rows::Cut(None)).status, Status::Open);
        // One run outside the limits is enough to fail, whatever the result of the missing run.
        assert_eq!(evaluate(AT_MOST, 1.0, &[Some(2.0)], 2, Rows::All).status, Status::Failed);
    }

    #[test]
    fn what_is_cut_off_fails_if_nothing_can_bring_it_back() {
        let of =
            |kind, limits, numbers: &[Option<f64>]| evaluate(limits, 1.0, numbers, 2, Rows::Cut(Some(kind))).status;
        let (too_high, too_low) = ([Some(2.0), Some(0.0)], [Some(-2.0), Some(0.0)]);
        let at_least = [Some(-1.0), None];
        for kind in [Kind::Peak, Kind::Max, Kind::PeakToPeak, Kind::Changes] {
            assert_eq!(of(kind, AT_MOST, &too_high), Status::Failed);
            assert_eq!(of(kind, AT_MOST, &too_low), Status::Open);
            assert_eq!(of(kind, at_least, &too_low), Status::Open);
        }
        assert_eq!(of(Kind::Min, at_least, &too_low), Status::Failed);
        assert_eq!(of(Kind::Min, AT_MOST, &too_high), Status::Open);
        assert_eq!(of(Kind::Rms, AT_MOST, &too_high), Status::Open);
        // With a share of 0.5, one of two runs within the limits is enough.
        assert_eq!(evaluate(AT_MOST, 0.5, &too_high, 2, Rows::Cut(Some(Kind::Peak))).status, Status::Open);
    }
}
