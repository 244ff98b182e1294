//! Double lane changes (ISO 3888-1 and ISO 3888-2): the largest speed at which no cone is touched.

use super::{executed, number, truth};
use crate::bench::Bench;
use crate::evaluators::Evaluation;
use crate::evaluators::cones::{self, Part};
use crate::metric::Definition;
use crate::results::{Bound, Results, Series};
use crate::run_result::RunResult;
use crate::run_spec::{EndAt, RunSpec};
use crate::wiring::Driving;
use serde_json::{Value, json};

/// Position of the first cones, m.
const START: f64 = 50.0;
/// Speed step, and tolerance of the bisection, km/h.
const STEP: f64 = 5.0;
const NEAR: f64 = 0.5;

/// The run at the speed `v`, m/s, and the options for its evaluator.
pub(crate) fn spec(bench: &Bench<'_>, part: Part, id: String, v: f64) -> Option<(RunSpec, Value)> {
    let (front, rear) = (bench.vehicle.front.as_ref()?.value, bench.vehicle.rear.as_ref()?.value);
    let width = bench.vehicle.width.as_ref()?.value;
    let length = match part {
        Part::One => 125.0,
        Part::Two => 61.0,
    };
    let end = START + length + rear + 1.0;
    let mut spec = RunSpec::new(id, Driving::Path, v, 1.6 * end / v + 2.0)
        .maneuver(part.maneuver())
        .drivers(&[
            ("path.start", START),
            ("path.overlap", if part == Part::One { 6.0 } else { 2.5 }),
            ("speed.control", f64::from(bench.has_pedals())),
        ])
        .end(EndAt::Position(end))
        .end(EndAt::Lost)
        .end(EndAt::Speed(1.0))
        .with_end();
    if part == Part::Two && bench.has_pedals() {
        spec = spec.value("driver", "release.distance", START + 2.0);
    }
    let options = json!({
        "maneuver": part.option(),
        "path.mirror": u8::from(bench.is_mirrored),
        "path.start": START,
        "vehicle.width": width,
        "footprint.front": front,
        "footprint.rear": rear,
    });
    Some((spec, options))
}

/// Sections of a track for the vehicle.
pub(crate) fn cones(part: Part, bench: &Bench<'_>) -> Option<[[f64; 4]; 3]> {
    let width = bench.vehicle.width.as_ref()?.value;
    Some(cones::track(part, START, width, bench.is_mirrored))
}

fn attempt(bench: &Bench<'_>, part: Part, speed: f64, results: &mut Results) -> Option<(RunResult, Evaluation, bool)> {
    let (spec, options) = spec(bench, part, format!("{}.{speed:.4}", part.name()), speed / 3.6)?;
    let (run, metrics) = executed(bench, vec![spec], "cones", &options, results).pop()?;
    let passed =
        truth(&metrics, "passed") == Some(true) && !run.has("lost") && !run.has("rolled_over") && run.error.is_none();
    Some((run, metrics, passed))
}

pub(crate) fn run(bench: &Bench<'_>, part: Part, results: &mut Results) {
    results.track = cones(part, bench);
    let (slowest, limit) = if bench.is_car() { (30.0, 150.0) } else { (20.0, 100.0) };
    let mut speed = slowest;
    let mut passed: Vec<(f64, RunResult, Evaluation)> = Vec::new();
    let mut failed: Option<(f64, RunResult)> = None;
    let mut attempts = |speed: f64, results: &mut Results| {
        let (run, metrics, has_passed) = attempt(bench, part, speed, results)?;
        if has_passed {
            passed.push((speed, run, metrics));
        } else {
            failed = Some((speed, run));
        }
        Some(has_passed)
    };
    let mut last_passed = None;
    let mut first_failed = None;
    while speed <= limit && first_failed.is_none() {
        match attempts(speed, results) {
            Some(true) => last_passed = Some(speed),
            Some(false) => first_failed = Some(speed),
            None => return,
        }
        speed += STEP;
    }
    while let (Some(low), Some(high)) = (last_passed, first_failed)
        && high - low > NEAR
    {
        let middle = 0.5 * (low + high);
        match attempts(middle, results) {
            Some(true) => last_passed = Some(middle),
            Some(false) => first_failed = Some(middle),
            None => return,
        }
    }
    let of = Definition::higher("max_entry_speed", "Largest entry speed", "km/h")
        .is("Largest speed at which no cone is touched, found in steps of 5 km/h, then by bisection to 0.5 km/h.");
    let metric = results.metric(&of, last_passed.filter(|_| first_failed.is_some()));
    match (last_passed, first_failed) {
        (Some(_), Some(_)) => (),
        (None, _) => {
            metric.set_reason(&format!("it fails at {slowest} km/h")).bound = Some(Bound::Below(slowest));
        }
        (Some(_), None) => {
            metric.set_best(&format!("it passes up to {limit} km/h")).bound = Some(Bound::Above(limit));
        }
    }
    // Runs are in the order of execution, so the last run that passed is the fastest.
    if let Some((speed, run, metrics)) = passed.last() {
        results.show(run);
        results.entry_speed = Some(*speed);
        for name in OF_FASTEST {
            results.take(run, metrics, &[name]);
            let values =
                passed.iter().filter_map(|(speed, _, metrics)| Some((*speed, number(metrics, name)?))).collect();
            results.last().series = Some(Series { unit: "km/h", values, is_whole: true });
        }
    }
    if let Some((_, run)) = &failed {
        results.show(run);
    }
}

/// Metrics taken from the fastest run that touches no cone.
const OF_FASTEST: [&str; 4] = ["exit_speed", "sideslip_peak", "roll_peak", "load_transfer_peak"];

/// Drives at `speed`, the largest entry speed of the other, slower system, km/h, to make both systems comparable.
pub(crate) fn compare_at(bench: &Bench<'_>, part: Part, speed: f64, results: &mut Results) {
    let Some((_, metrics, true)) = attempt(bench, part, speed, results) else { return };
    for name in OF_FASTEST {
        let id = format!("{}.{name}", part.name());
        let metric = results.metrics.iter_mut().find(|metric| metric.id == id);
        let series = metric.and_then(|metric| metric.series.as_mut());
        if let Some((series, value)) = series.zip(number(&metrics, name)) {
            series.values.push((speed, value));
        }
    }
}
