//! Metrics of the runs so far.

use crate::free::Source;
use crate::requests::Metric;
use fmu_assess::{Direction, Value};
use fmu_system::master::Recording;
use fmu_system::metrics::Columns;
use fmu_system::plan::Plan;
use fmu_system::report;
use fmu_system::requirements;
use fmu_system::run::Simulation;
use serde_json::{Value as Json, json};

pub(crate) struct Recorded<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) simulation: &'a Simulation,
    pub(crate) source: &'a Source,
    pub(crate) recording: &'a Recording,
}

/// The metrics that are defined for the first system, with their values for all systems.
pub(crate) fn of(systems: &[Recorded<'_>]) -> Vec<Metric> {
    match systems.first() {
        None | Some(Recorded { source: Source::Nothing, .. }) => Vec::new(),
        Some(Recorded { source: Source::Scenario { .. }, .. }) => of_scenario(systems),
        Some(Recorded { source: Source::Maneuver(_), .. }) => of_maneuver(systems),
    }
}

fn columns(recording: &Recording) -> Columns<'_> {
    let values = recording.columns.iter().enumerate();
    values.filter_map(|(index, column)| Some((index, column.as_deref()?))).collect()
}

fn case<'a>(system: &'a Recorded<'_>) -> &'a str {
    match system.source {
        Source::Scenario { case } => case,
        Source::Maneuver(_) | Source::Nothing => "",
    }
}

fn of_scenario(systems: &[Recorded<'_>]) -> Vec<Metric> {
    let plan = systems[0].plan;
    let all: Vec<Columns<'_>> = systems.iter().map(|system| columns(system.recording)).collect();
    let mut numbers: Vec<Vec<Option<f64>>> = vec![Vec::new(); systems.len()];
    let mut found = Vec::new();
    for metric in &plan.metrics {
        let mut reason = String::new();
        for (index, system) in systems.iter().enumerate() {
            let times = &system.recording.time;
            let number = match &metric.source {
                report::Source::Signals(definition) => {
                    let known = plan.cases.iter().find(|known| known.name == case(system));
                    let baseline = known.and_then(|known| known.baseline.as_deref());
                    let other = systems.iter().position(|other| Some(case(other)) == baseline);
                    // The baseline may have fewer rows.
                    let rows = times.len();
                    let of_baseline = other.filter(|other| systems[*other].recording.time.len() >= rows).map(|other| {
                        all[other].iter().map(|(column, values)| (*column, &values[..rows])).collect::<Columns<'_>>()
                    });
                    let step = system.simulation.step;
                    match definition.value(times, &all[index], of_baseline.as_ref(), step) {
                        Ok(number) => number,
                        Err(error) => {
                            if index == 0 {
                                reason = error.to_string();
                            }
                            None
                        }
                    }
                }
                report::Source::Metrics { value, .. } => {
                    value.value(|other| numbers[index].get(other).copied().flatten())
                }
            };
            numbers[index].push(number);
        }
        let values: Vec<_> = numbers.iter().map(|of| of.last().copied().flatten()).collect();
        if values[0].is_none() && reason.is_empty() {
            "not defined yet".clone_into(&mut reason);
        }
        found.push(Metric {
            id: metric.name.clone(),
            title: metric.title.clone(),
            unit: metric.unit.clone().unwrap_or_default(),
            definition: definition(plan, &metric.source),
            verdict: metric
                .requirement
                .as_ref()
                .and_then(|requirement| verdict(requirement, case(&systems[0]), values[0])),
            reason: if values[0].is_none() { reason } else { String::new() },
            values: values.into_iter().map(|value| json!(value)).collect(),
        });
    }
    found
}

/// Describes the inputs of a metric.
fn definition(plan: &Plan, source: &report::Source) -> String {
    match source {
        report::Source::Signals(definition) => {
            let names = definition.columns.iter().filter_map(|index| plan.columns.get(*index));
            let names: Vec<_> = names.map(|column| column.name.as_str()).collect();
            let kind = serde_json::to_value(definition.kind).ok();
            let kind = kind.as_ref().and_then(|kind| kind.as_str()).unwrap_or_default().replace('_', " ");
            let window = definition.window.map_or(String::new(), |[from, to]| format!(", {from} s to {to} s"));
            format!("{kind} of {}{window}", names.join(", "))
        }
        report::Source::Metrics { uses, .. } => {
            let names = uses.iter().filter_map(|index| plan.metrics.get(*index));
            let names: Vec<_> = names.map(|metric| metric.title.as_str()).collect();
            format!("computed from {}", names.join(", "))
        }
    }
}

fn verdict(requirement: &report::Requirement, case: &str, value: Option<f64>) -> Option<&'static str> {
    let value = value?;
    if !requirement.cases.iter().any(|of| of == case) {
        return None;
    }
    let holds = requirements::holds([requirement.min, requirement.max], Some(value));
    Some(if holds { "pass" } else { "fail" })
}

fn of_maneuver(systems: &[Recorded<'_>]) -> Vec<Metric> {
    let evaluated: Vec<_> = systems
        .iter()
        .map(|system| match system.source {
            Source::Maneuver(single) => single.evaluate(system.recording),
            Source::Scenario { .. } | Source::Nothing => None,
        })
        .collect();
    let Some(Some(first)) = evaluated.first() else { return Vec::new() };
    let shown = |value: &Value| match value {
        Value::Number(number) => json!(number),
        Value::Boolean(value) => json!(value),
        Value::Numbers(_) | Value::Null(_) => Json::Null,
    };
    first
        .metrics
        .iter()
        .filter(|metric| !matches!(metric.value, Value::Numbers(_)))
        .map(|metric| {
            let of = |evaluation: &Option<fmu_assess::Evaluation>| {
                evaluation.as_ref().and_then(|evaluation| evaluation.value(&metric.name)).map_or(Json::Null, shown)
            };
            let definition = metric.definition;
            let place = metric.name.strip_prefix(definition.name).unwrap_or_default().trim_start_matches('.');
            let place = if place.is_empty() { String::new() } else { format!(", {place}") };
            let verdict = match (&metric.value, definition.direction) {
                (Value::Boolean(value), Direction::Up) => Some(if *value { "pass" } else { "fail" }),
                (Value::Boolean(value), Direction::Down) => Some(if *value { "fail" } else { "pass" }),
                (Value::Null(_), _) => None,
                _ => Some("info"),
            };
            Metric {
                id: metric.name.clone(),
                title: format!("{}{place}", definition.title),
                unit: if definition.unit == "1" { String::new() } else { definition.unit.to_owned() },
                definition: definition.definition.to_owned(),
                values: evaluated.iter().map(of).collect(),
                reason: match &metric.value {
                    Value::Null(reason) => reason.to_string(),
                    _ => String::new(),
                },
                verdict,
            }
        })
        .collect()
}
