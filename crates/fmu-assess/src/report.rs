//! Report on an assessment: metrics of both systems side by side with their verdicts, as JSON and JUnit XML.

use crate::json::all_rounded;
use crate::metric::Direction;
use crate::results::{Bound, Measured, RunRecord, Series, Skipped, Suite};
use crate::vehicle::Vehicle;
use fmu_system::requirements::{XML, junit_suite};
use fmu_system::typography;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Name and version of the JSON format.
pub const SCHEMA: &str = "chassis-fmu-assessment/1";

/// Verdict on a metric.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The value is within the limit.
    Pass,
    /// The value exceeds the limit.
    Fail,
    /// The metric has no limit.
    Info,
    /// The metric has a limit that does not apply to this vehicle.
    Comparison,
    /// A signal is missing.
    Dropped,
    /// A run failed.
    Error,
}

/// Change of a metric with the controllers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgment {
    /// Better by at least one percent.
    Better,
    /// Changed by less than one percent.
    Same,
    /// Worse by at least one percent.
    Worse,
    /// A value is missing, a run ended early, or there is no common condition.
    NotComparable,
}

/// Values of both systems under the same condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// The condition: the highest speed or amplitude that both systems can drive.
    pub at: f64,
    /// Unit of the condition: `km/h`, `mph`, or `A` for multiples of the amplitude A.
    pub at_unit: &'static str,
    /// Without the controllers.
    pub without: f64,
    /// With the controllers.
    pub with: f64,
}

/// A metric for both systems.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Id: maneuver and metric.
    pub id: String,
    /// Title.
    pub title: String,
    /// Computation, in words.
    pub definition: &'static str,
    /// Unit of measure.
    pub unit: &'static str,
    /// Group of maneuvers.
    pub suite: Suite,
    /// Without the controllers.
    pub without: Value,
    /// With the controllers; null if there are none.
    pub with: Value,
    /// Label of the value in a standard, such as a comfort class, by system.
    pub words: BTreeMap<&'static str, &'static str>,
    /// Bounds of missing values, such as `< 30`, by system.
    pub bounds: BTreeMap<&'static str, String>,
    /// Values under the same condition, if the values of the two systems come from different conditions.
    pub compared: Option<Compared>,
    /// Reason that the systems cannot be compared.
    pub incomparable: Option<String>,
    /// Change of the comparable values, percent; null if a value is missing or the value without controllers is close
    /// to zero.
    pub change: Value,
    /// Preferred direction.
    pub direction: Direction,
    /// Judgment of the change.
    pub judgment: Option<Judgment>,
    /// Verdict on the system with controllers, or on the only system.
    pub verdict: Verdict,
    /// Verdict on the system without controllers.
    pub verdict_without: Verdict,
    /// Limit, if there is one.
    pub limit: Value,
    /// Reason that the value is missing or that the limit does not apply.
    pub reason: Option<String>,
    /// Reason that there is no value without controllers.
    pub reason_without: Option<String>,
    /// True for each system that has the metric. Some metrics exist only if a maneuver is passed, others only if it
    /// fails.
    #[serde(skip)]
    present: [bool; 2],
}

/// An assessment.
#[derive(Debug, Serialize)]
pub struct Assessment {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// The plant: name, GUID, version and SHA-256 of its FMU.
    pub plant: Value,
    /// FMUs that belong to the vehicle.
    pub base: Vec<Value>,
    /// Controllers.
    pub with: Vec<Value>,
    /// Parameters set by the caller: component, FMU, parameter, value as written, unit and start value.
    pub set: Vec<Value>,
    /// Vehicle data and their sources.
    pub vehicle: Vehicle,
    /// Data of the driver model: understeer gradient, rad/(m/s2), and amplitude A, deg.
    pub driver: Value,
    /// Names of the systems.
    pub systems: Vec<&'static str>,
    /// Unconnected inputs of each system, and their values.
    pub unwritten: BTreeMap<&'static str, BTreeMap<String, String>>,
    /// Components whose outputs nothing reads.
    pub idle: Vec<String>,
    /// Signals of the plant without a declared unit, and the unit that the bench assumes.
    pub assumed: BTreeMap<String, &'static str>,
    /// All runs.
    pub runs: Vec<RunRecord>,
    /// All metrics.
    pub metrics: Vec<Row>,
    /// Skipped maneuvers.
    pub dropped: Vec<Skipped>,
    /// Sections of the coned tracks, by maneuver, m: begin, end, right and left edge of each.
    pub tracks: BTreeMap<&'static str, [[f64; 4]; 3]>,
    /// Frequencies, Hz, and gains of W_k, the weighting of vertical vibrations in ISO 2631-1; only with the suite
    /// `ride`.
    pub weighting: Option<[Vec<f64>; 2]>,
}

/// Smallest change that counts as better or worse, percent.
const COUNTS: f64 = 1.0;

/// Row for a metric. If `is_pair` is true, two systems are compared, and one of them can lack the metric.
pub(crate) fn row(without: Option<&Measured>, with: Option<&Measured>, is_pair: bool) -> Row {
    let decisive = with.or(without).expect("a metric is of a system");
    let both = [("without", without), ("with", with)];
    let [old, new] = [without, with].map(|metric| metric.map_or(Value::Null, |metric| metric.value.clone()));
    let comparison = match (without, with) {
        (Some(without), Some(with)) => comparison(without, with),
        (_, None) => Comparison::None(ONLY_WITHOUT.to_owned()),
        (None, _) => Comparison::None(ONLY_WITH.to_owned()),
    };
    let (change, compared) = match &comparison {
        Comparison::Numbers(old, new, compared) => (percent(*old, *new, decisive.unit), compared.clone()),
        _ => (None, None),
    };
    let has_direction = is_pair && decisive.direction != Direction::None;
    let judgment = if has_direction { judgment(&old, &new, &comparison, decisive) } else { None };
    let incomparable = match comparison {
        Comparison::None(reason) if is_pair && !(old.is_null() && new.is_null()) => Some(reason),
        _ => None,
    };
    let reason = |metric: &Measured| {
        let not_applicable = metric.limit.and_then(|limit| limit.not_applicable).map(str::to_owned);
        metric.reason.clone().or(not_applicable)
    };
    let mut row = Row {
        id: decisive.id.clone(),
        title: decisive.title.clone(),
        definition: decisive.definition,
        unit: decisive.unit,
        suite: decisive.suite,
        words: both.into_iter().filter_map(|(system, metric)| Some((system, metric?.label?))).collect(),
        without: old,
        with: new,
        bounds: both.into_iter().filter_map(|(system, metric)| Some((system, metric?.bound?.text()))).collect(),
        compared,
        incomparable,
        change: json!(change),
        direction: decisive.direction,
        judgment,
        verdict: verdict(decisive),
        verdict_without: without.map_or(Verdict::Info, verdict),
        limit: json!(decisive.limit),
        reason: reason(decisive),
        reason_without: without.map_or_else(|| Some(ONLY_WITH.to_owned()), reason),
        present: [without.is_some(), with.is_some()],
    };
    if is_pair && with.is_none() {
        // If the system with controllers lacks a metric, limits from regulations give no verdict.
        let is_required = decisive.limit.is_some_and(|limit| limit.is_required());
        row.verdict = if is_required { Verdict::Fail } else { Verdict::Info };
        row.reason = Some(ONLY_WITHOUT.to_owned());
    }
    row
}

/// Reason that only one system has a value.
const ONLY_WITHOUT: &str = "only the runs without controllers have it";
const ONLY_WITH: &str = "only the runs with controllers have it";

/// Values of two systems that can be compared.
enum Comparison {
    /// Two numbers. The last element is set if they are not the metric's values, but values under a condition that both
    /// systems can drive.
    Numbers(f64, f64, Option<Compared>),
    /// Two Booleans.
    Booleans(bool, bool),
    /// One system has a number, and the other has only a bound. True if the value increases.
    Rises(bool),
    /// Not comparable, with the reason.
    None(String),
}

/// Magnitude below which a value counts as zero: a rounding error of a simulation, or a negligible ratio.
fn nothing(unit: &str) -> f64 {
    if unit == "1" { 0.005 } else { 1e-6 }
}

/// Largest change shown, percent. A larger change only means that the value without controllers is almost zero.
const TELLS: f64 = 1000.0;

fn comparison(without: &Measured, with: &Measured) -> Comparison {
    let of = |system: &str, reason: &str| Comparison::None(format!("{system} controllers: {reason}"));
    for (system, metric) in [("without", without), ("with", with)] {
        if let Some(reason) = &metric.incomparable {
            return of(system, reason);
        }
    }
    let no_value = |metric: &Measured| metric.reason.clone().unwrap_or_else(|| "no value was computed".to_owned());
    let (old, new) = match (&without.value, &with.value) {
        (Value::Bool(old), Value::Bool(new)) => return Comparison::Booleans(*old, *new),
        (Value::Null, Value::Null) => return Comparison::None("neither system has a value".to_owned()),
        (Value::Null, new) => {
            return beyond(without.bound, new).map_or_else(|| of("without", &no_value(without)), Comparison::Rises);
        }
        (old, Value::Null) => {
            let rises = beyond(with.bound, old).map(|falls| !falls);
            return rises.map_or_else(|| of("with", &no_value(with)), Comparison::Rises);
        }
        (old, new) => (old.as_f64(), new.as_f64()),
    };
    let Some((old, new)) = old.zip(new) else { return Comparison::None("the value is not a number".to_owned()) };
    let (Some(first), Some(second)) = (&without.series, &with.series) else {
        return Comparison::Numbers(old, new, None);
    };
    let conditions = |series: &Series| series.values.iter().map(|(at, _)| *at).collect::<Vec<_>>();
    if first.is_whole && second.is_whole && conditions(first) == conditions(second) {
        return Comparison::Numbers(old, new, None);
    }
    let both = first
        .values
        .iter()
        .filter_map(|(at, old)| second.values.iter().find(|(other, _)| other == at).map(|(_, new)| (*at, *old, *new)));
    match both.max_by(|(a, ..), (b, ..)| a.total_cmp(b)) {
        Some((at, without, with)) => {
            Comparison::Numbers(without, with, Some(Compared { at, at_unit: first.unit, without, with }))
        }
        None => {
            let condition = if first.unit == "A" { "amplitude" } else { "speed" };
            Comparison::None(format!("there is no {condition} that both systems can drive"))
        }
    }
}

/// `true` if the number is above all values that the bound allows, `false` if it is below all of them.
fn beyond(bound: Option<Bound>, number: &Value) -> Option<bool> {
    let number = number.as_f64()?;
    match bound? {
        Bound::Below(limit) if number >= limit => Some(true),
        Bound::Above(limit) if number <= limit => Some(false),
        _ => None,
    }
}

/// Change in percent, where it is meaningful.
fn percent(old: f64, new: f64, unit: &str) -> Option<f64> {
    let change = 100.0 * (new - old) / old.abs();
    (old.abs() >= nothing(unit) && change.abs() <= TELLS).then_some(change)
}

/// Compares a metric with and without controllers.
fn judgment(old: &Value, new: &Value, comparison: &Comparison, metric: &Measured) -> Option<Judgment> {
    let is_up = metric.direction == Direction::Up;
    let rate = |rises: bool| if rises == is_up { Judgment::Better } else { Judgment::Worse };
    match comparison {
        Comparison::None(_) if old.is_null() && new.is_null() => None,
        Comparison::None(_) => Some(Judgment::NotComparable),
        Comparison::Rises(rises) => Some(rate(*rises)),
        Comparison::Booleans(old, new) if old == new => Some(Judgment::Same),
        Comparison::Booleans(_, new) => Some(rate(*new)),
        Comparison::Numbers(old, new, _) => {
            let is_nothing = old.abs().max(new.abs()) < nothing(metric.unit);
            if is_nothing || (100.0 * (new - old) / old.abs()).abs() < COUNTS {
                Some(Judgment::Same)
            } else {
                Some(rate(new > old))
            }
        }
    }
}

fn verdict(metric: &Measured) -> Verdict {
    // Matches the message for a missing column.
    let is_missing = metric.is_dropped || metric.reason.as_ref().is_some_and(|reason| reason.contains("has no column"));
    match &metric.limit {
        Some(limit) if metric.value.is_null() && limit.is_required() => {
            if metric.is_best_without {
                Verdict::Pass
            } else {
                Verdict::Fail
            }
        }
        _ if metric.value.is_null() && is_missing => Verdict::Dropped,
        None => Verdict::Info,
        Some(limit) if limit.not_applicable.is_some() => Verdict::Comparison,
        Some(limit) => match limit.is_kept(&metric.value) {
            Some(true) => Verdict::Pass,
            Some(false) => Verdict::Fail,
            None => Verdict::Error,
        },
    }
}

impl Assessment {
    /// The assessment as JSON, with sorted keys and numbers with nine significant digits. The same inputs give the same
    /// bytes.
    pub fn to_json(&self) -> String {
        let value = serde_json::to_value(self).map_or(Value::Null, |value| all_rounded(&value));
        let mut text = serde_json::to_string_pretty(&value).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Returns true if at least one run was recorded.
    pub fn has_run(&self) -> bool {
        self.runs.iter().any(|run| run.rows > 0)
    }

    /// Returns true if no metric and no run of the system with controllers, or of the only system, fails.
    pub fn is_passed(&self) -> bool {
        let decisive = self.systems.last().copied().unwrap_or("without");
        let is_bad = |row: &Row| matches!(row.verdict, Verdict::Fail | Verdict::Error);
        !self.metrics.iter().any(is_bad) && !self.runs.iter().any(|run| run.system == decisive && run.error.is_some())
    }

    /// The verdicts as JUnit XML: a test suite for each suite and system, a test case for each metric and failed run.
    pub fn to_junit(&self) -> String {
        let suites = Suite::ALL.into_iter().flat_map(|suite| self.systems.iter().map(move |system| (suite, *system)));
        let suites = suites.filter_map(|(suite, system)| self.junit_suite(suite, system));
        format!("{XML}<testsuites>\n{}</testsuites>\n", suites.collect::<String>())
    }

    fn junit_suite(&self, suite: Suite, system: &str) -> Option<String> {
        let is_with = system == "with";
        let is_first = !is_with && self.systems.len() > 1;
        let rows = self.metrics.iter().filter(|row| row.suite == suite && row.present[usize::from(is_with)]);
        let verdicts = rows.map(|row| {
            let value = if is_with { &row.with } else { &row.without };
            let (verdict, reason) =
                if is_first { (row.verdict_without, &row.reason_without) } else { (row.verdict, &row.reason) };
            let reason = reason.as_deref().unwrap_or_default();
            let found = if value.is_null() { format!("no value: {reason}") } else { with_unit(value, row.unit) };
            let words = row.words.get(system).map_or_else(String::new, |words| format!(" ({words})"));
            let (element, text) = match verdict {
                Verdict::Fail => ("failure", found + &words + &required(row)),
                Verdict::Error => ("error", reason.to_owned()),
                Verdict::Dropped => ("skipped", reason.to_owned()),
                _ => ("system-out", found + &words + &required(row)),
            };
            (row.id.clone(), row.title.clone(), element, text)
        });
        let runs = self.runs.iter().filter(|run| run.suite == suite && run.system == system);
        let broken = runs.filter_map(|run| Some(("run".to_owned(), run.id.clone(), "error", run.error.clone()?)));
        let cases: Vec<_> = verdicts.chain(broken).collect();
        (!cases.is_empty())
            .then(|| junit_suite(&format!("{}.{system}", json!(suite).as_str().unwrap_or_default()), &cases))
    }
}

/// A value with five significant digits and its unit.
fn with_unit(value: &Value, unit: &str) -> String {
    match value {
        Value::Bool(holds) => if *holds { "yes" } else { "no" }.to_owned(),
        number => {
            let number = typography::significant(number.as_f64().unwrap_or(f64::NAN), 5);
            typography::with_unit(&number, &typography::unit(unit))
        }
    }
}

/// The limit of a row, as text to follow the value.
fn required(row: &Row) -> String {
    let Some(source) = row.limit["source"].as_str() else { return String::new() };
    let limits = [row.limit["min"].as_f64(), row.limit["max"].as_f64()];
    let limits =
        if row.limit["is"].is_boolean() { "yes" } else { &typography::limits(limits, &typography::unit(row.unit)) };
    format!(", required {limits} ({source})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Definition;
    use crate::results::{Limit, REQUIRED, Results};

    fn measured(value: Value, direction: Direction, limit: Option<Limit>) -> Measured {
        let of = Definition { direction, ..Definition::neutral("mfdd", "Deceleration", "m/s2") };
        let mut results = Results::new("braking", Suite::Braking, "without");
        Measured { limit, ..results.metric(&of, value).clone() }
    }

    #[test]
    fn changes_are_judged_by_the_direction() {
        let of = |old: f64, new: f64, direction| {
            let (old, new) = (measured(json!(old), direction, None), measured(json!(new), direction, None));
            row(Some(&old), Some(&new), true).judgment
        };
        assert_eq!(of(5.0, 6.0, Direction::Up), Some(Judgment::Better));
        assert_eq!(of(5.0, 6.0, Direction::Down), Some(Judgment::Worse));
        assert_eq!(of(5.0, 5.04, Direction::Down), Some(Judgment::Same));
        assert_eq!(of(-5.0, -4.0, Direction::Up), Some(Judgment::Better));
        assert_eq!(of(0.0, 6.0, Direction::Up), Some(Judgment::Better));
        // Both values are rounding errors of a simulation and count as equal.
        assert_eq!(of(1e-13, 3e-13, Direction::Down), Some(Judgment::Same));
        assert_eq!(of(5.0, 6.0, Direction::None), None);
    }

    /// A missing value can be compared only if its bound is known. Booleans are compared, too.
    #[test]
    fn numbers_that_come_and_go_are_compared_by_their_bounds() {
        let of = |old: Value, new: Value, direction, bound| {
            let of = |value: Value| {
                let bound = if value.is_null() { bound } else { None };
                Measured { bound, ..measured(value, direction, None) }
            };
            row(Some(&of(old)), Some(&of(new)), true).judgment
        };
        for direction in [Direction::Up, Direction::Down] {
            assert_eq!(of(json!(5.0), Value::Null, direction, None), Some(Judgment::NotComparable));
            assert_eq!(of(Value::Null, json!(5.0), direction, None), Some(Judgment::NotComparable));
            assert_eq!(of(Value::Null, Value::Null, direction, None), None);
        }
        for (bound, old, new, judgment) in [
            (Bound::Below(4.0), json!(5.0), Value::Null, Judgment::Worse),
            (Bound::Below(4.0), Value::Null, json!(5.0), Judgment::Better),
            (Bound::Above(6.0), json!(5.0), Value::Null, Judgment::Better),
            (Bound::Above(6.0), Value::Null, json!(5.0), Judgment::Worse),
            (Bound::Above(4.0), Value::Null, json!(5.0), Judgment::NotComparable),
        ] {
            assert_eq!(of(old, new, Direction::Up, Some(bound)), Some(judgment), "{bound:?}");
        }
        assert_eq!(of(json!(5.0), Value::Null, Direction::None, None), None);
        assert_eq!(of(json!(false), json!(true), Direction::Up, None), Some(Judgment::Better));
        assert_eq!(of(json!(true), json!(false), Direction::Up, None), Some(Judgment::Worse));
        assert_eq!(of(json!(true), json!(true), Direction::Up, None), Some(Judgment::Same));
    }

    /// 20 at 40 km/h and 10 at 30 km/h are not comparable, but both systems have a value at 30 km/h.
    #[test]
    fn numbers_of_unequal_speeds_are_compared_at_the_highest_that_both_can_drive() {
        let of = |value: f64, values: &[(f64, f64)], is_whole| {
            let series = Some(Series { unit: "km/h", values: values.to_vec(), is_whole });
            Measured { series, ..measured(json!(value), Direction::Down, None) }
        };
        let fast = of(20.0, &[(25.0, 4.0), (30.0, 9.0), (40.0, 20.0)], true);
        let slow = of(10.0, &[(25.0, 5.0), (30.0, 10.0)], true);
        let found = row(Some(&slow), Some(&fast), true);
        assert_eq!((found.without, found.with, found.judgment), (json!(10.0), json!(20.0), Some(Judgment::Better)));
        assert_eq!(found.change, json!(-10.0));
        assert_eq!(found.compared, Some(Compared { at: 30.0, at_unit: "km/h", without: 10.0, with: 9.0 }));
        // If the speeds are the same, the metrics are compared directly.
        let found = row(Some(&slow), Some(&of(11.0, &[(25.0, 1.0), (30.0, 11.0)], true)), true);
        assert_eq!((found.compared, found.change), (None, json!(10.0)));
        // The value of this metric includes runs that the vehicle cannot drive.
        let found = row(Some(&slow), Some(&of(50.0, &[(25.0, 1.0), (30.0, 11.0)], false)), true);
        assert_eq!(found.compared.map(|compared| compared.with), Some(11.0));
        let none = row(Some(&slow), Some(&of(1.0, &[], false)), true);
        assert_eq!((none.judgment, none.change), (Some(Judgment::NotComparable), Value::Null));
        assert_eq!(none.incomparable.as_deref(), Some("there is no speed that both systems can drive"));
        let lost = Measured { incomparable: Some("the driver lost the path".to_owned()), ..fast };
        let found = row(Some(&slow), Some(&lost), true);
        assert_eq!(found.incomparable.as_deref(), Some("with controllers: the driver lost the path"));
        assert_eq!(found.judgment, Some(Judgment::NotComparable));
    }

    /// A change relative to a value close to zero is not shown as a percentage.
    #[test]
    fn a_change_that_tells_nothing_has_no_percentage() {
        assert_eq!(percent(2.0, 3.0, "m"), Some(50.0));
        assert_eq!(percent(0.0, 3.0, "m"), None);
        assert_eq!(percent(0.01, 0.5, "m"), None);
        assert_eq!(percent(1e-13, 2e-13, "m"), None);
        assert_eq!(percent(0.004, 0.008, "1"), None);
    }

    /// A metric that only one system has gets a verdict only for this system.
    #[test]
    fn a_metric_of_one_system_has_its_verdict() {
        let failed = measured(json!(false), Direction::Up, Some(Limit::holds("R140")));
        let only_with = row(None, Some(&failed), true);
        assert_eq!((only_with.verdict, only_with.verdict_without), (Verdict::Fail, Verdict::Info));
        assert_eq!((&only_with.without, &only_with.with), (&Value::Null, &json!(false)));
        let only_without = row(Some(&failed), None, true);
        assert_eq!((only_without.verdict, only_without.verdict_without), (Verdict::Info, Verdict::Fail));
        assert_eq!((&only_without.without, &only_without.with), (&json!(false), &Value::Null));
        assert_eq!(only_without.reason.as_deref(), Some(ONLY_WITHOUT));
        assert_eq!(row(Some(&failed), None, false).verdict, Verdict::Fail);
        // The caller requires the metric.
        let required = measured(json!(7.0), Direction::Up, Some(Limit::at_least(6.0, REQUIRED)));
        assert_eq!(row(Some(&required), None, true).verdict, Verdict::Fail);
    }

    #[test]
    fn limits_decide_the_verdict() {
        let of = |value: Value, limit: Limit| verdict(&measured(value, Direction::Up, Some(limit)));
        assert_eq!(of(json!(6.43), Limit::at_least(6.43, "R13-H")), Verdict::Pass);
        assert_eq!(of(json!(6.42), Limit::at_least(6.43, "R13-H")), Verdict::Fail);
        assert_eq!(of(json!(70.0), Limit::at_most(70.0, "R13-H")), Verdict::Pass);
        assert_eq!(of(json!(false), Limit::holds("R140")), Verdict::Fail);
        assert_eq!(of(Value::Null, Limit::holds("R140")), Verdict::Error);
        // A required metric must have a value.
        assert_eq!(of(Value::Null, Limit::at_least(1.0, REQUIRED)), Verdict::Fail);
        let best = Measured {
            is_best_without: true,
            ..measured(Value::Null, Direction::Up, Some(Limit::at_least(1.0, REQUIRED)))
        };
        assert_eq!(verdict(&best), Verdict::Pass);
        let mut failed = measured(json!(false), Direction::Up, None);
        failed.set_limit(Limit::holds("R140"), Some("a truck"));
        assert_eq!(verdict(&failed), Verdict::Comparison);
    }
}
