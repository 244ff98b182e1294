//! Ride on random roads of ISO 8608, weighted by ISO 2631-1.

use super::{evaluated, number, reason};
use crate::bench::{Bench, drive};
use crate::evaluators::{Evaluation, comfort};
use crate::metric::{Direction, Value};
use crate::results::Results;
use crate::run_spec::RunSpec;
use crate::wiring::Driving;
use serde_json::json;

/// Roughness classes, and seeds of each.
const CLASSES: [(&str, f64); 4] = [("a", 1.0), ("b", 2.0), ("c", 3.0), ("d", 4.0)];
const SEEDS: [f64; 3] = [1.0, 2.0, 3.0];
/// Start of the evaluation, and end of the run, s.
pub(crate) const BEGIN: f64 = 2.0;
const STOP: f64 = 22.0;

/// The run on a road of a class, from 1 for A on.
pub(crate) fn spec(bench: &Bench<'_>, class: &str, roughness: f64, seed: f64) -> RunSpec {
    let id = format!("ride.{class}.{seed}");
    let spec = RunSpec::new(id, Driving::Ride, bench.speed(), STOP)
        .maneuver("straight")
        .drivers(&[("path.start", 2000.0), ("speed.control", if bench.has_pedals() { 1.0 } else { 0.0 })])
        .show("seed", seed)
        .show("class", roughness);
    on_road(bench, spec, roughness, seed)
}

/// Sets the road of a run.
pub(crate) fn on_road(bench: &Bench<'_>, spec: RunSpec, roughness: f64, seed: f64) -> RunSpec {
    let mut spec = spec
        .value("road", "profile", 1.0)
        .value("road", "tracks", 1.0)
        .value("road", "roughness.start", 2.0)
        .value("road", "roughness.class", roughness)
        .value("road", "seed", seed);
    let offsets = &bench.vehicle.axle_offsets;
    if let Some(rear) = offsets.last() {
        spec = spec.value("road", "geometry.axle_offset.rear", *rear);
    }
    if let [middle, _] = offsets[..] {
        spec = spec.value("road", "geometry.axle_offset.middle", middle);
    }
    spec
}

/// Mean of a metric over the seeds.
fn mean(found: &[Evaluation], name: &str) -> Option<f64> {
    let values: Vec<f64> = found.iter().map(|metrics| number(metrics, name)).collect::<Option<_>>()?;
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The metric of the wheel or strut where it is largest, in the mean over the seeds.
fn largest(found: &[Evaluation], name: &str) -> Option<f64> {
    let of_run = |metrics: &Evaluation| {
        let values = metrics.metrics.iter().filter(|metric| metric.definition.name == name);
        values
            .filter_map(|metric| if let Value::Number(number) = metric.value { Some(number) } else { None })
            .reduce(f64::max)
    };
    let values: Vec<f64> = found.iter().map(of_run).collect::<Option<_>>()?;
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

pub(crate) fn run(bench: &Bench<'_>, results: &mut Results) {
    for (class, roughness) in CLASSES {
        let specs = SEEDS.map(|seed| spec(bench, class, roughness, seed));
        let mut found = Vec::new();
        let mut broken = None;
        for (index, run) in drive(bench, specs.into()).into_iter().enumerate() {
            let metrics = evaluated("ride", &run, &json!({ "begin": BEGIN }));
            results.note(&run, &metrics);
            if index == 0 && class == "c" {
                results.show(&run);
            }
            broken = broken.or_else(|| run.cut_short().map(|reason| format!("{}: {reason}", run.spec.id)));
            found.push(metrics);
        }
        let of_class = class.to_uppercase();
        // A mean over fewer roads is another number.
        if broken.is_some() {
            found.clear();
        }
        let why = |name: &str| broken.clone().or_else(|| found.iter().find_map(|of| reason(of, name)));
        let mut add = |name: &str, title: &str, unit: &'static str, definition: &str, value: Option<f64>| {
            let (id, title) = (format!("{class}.{name}"), format!("{title}, class {of_class}"));
            let metric = results.metric(&id, &title, unit, Direction::Down, json!(value));
            metric.set_definition(definition);
            if let Some(total) = value.filter(|_| name == "vibration_total") {
                metric.label = Some(comfort(total));
            }
            if let (None, Some(reason)) = (value, why(name)) {
                metric.set_reason(&reason);
            }
        };
        let of_all = "Root of the sum of the squares of the weighted heave, roll and pitch accelerations, mean of three roads. \
             The label is its comfort class in ISO 2631-1; where the ranges of the standard overlap, that of the lower end.";
        let total = mean(&found, "vibration_total");
        add("vibration_total", "Weighted acceleration", "m/s2", of_all, total);
        let of_heave = "RMS of the heave acceleration weighted by W_k (ISO 2631-1), mean of three roads.";
        add("heave_weighted", "Weighted heave acceleration", "m/s2", of_heave, mean(&found, "heave_weighted"));
        let of_load =
            "Standard deviation of the tire load over its mean, of the wheel where it is largest, mean of three roads.";
        let load = largest(&found, "dynamic_load_coefficient");
        add("dynamic_load_coefficient", "Largest dynamic load coefficient", "1", of_load, load);
        let of_travel =
            "RMS of the suspension deflection about its mean, of the strut where it is largest, mean of three roads.";
        let travel = largest(&found, "suspension_travel_rms");
        add("suspension_travel_rms", "Largest suspension travel, RMS", "m", of_travel, travel);
    }
}
