//! Ride on random roads (ISO 8608), evaluated with the weights of ISO 2631-1.

use super::{executed, number, reason};
use crate::bench::Bench;
use crate::evaluators::{Evaluation, comfort};
use crate::metric::Definition;
use crate::results::Results;
use crate::run_spec::RunSpec;
use crate::wiring::Driving;
use serde_json::json;

/// Roughness classes, and the seeds for each class.
const CLASSES: [(&str, f64); 4] = [("a", 1.0), ("b", 2.0), ("c", 3.0), ("d", 4.0)];
const SEEDS: [f64; 3] = [1.0, 2.0, 3.0];
/// Start of the evaluation, and end of the run, s.
pub(crate) const BEGIN: f64 = 2.0;
const STOP: f64 = 22.0;

/// The run on a road; `roughness` is 1 for class A, 2 for B, and so on.
pub(crate) fn spec(bench: &Bench<'_>, class: &str, roughness: f64, seed: f64) -> RunSpec {
    let id = format!("ride.{class}.{seed}");
    let spec = RunSpec::new(id, Driving::Ride, bench.speed(), STOP)
        .maneuver("straight")
        .drivers(&[("path.start", 2000.0), ("speed.control", f64::from(bench.has_pedals()))])
        .show("seed", seed)
        .show("class", roughness);
    on_road(bench, spec, roughness, seed)
}

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

/// Metrics for a roughness class: the largest value of all wheels or struts, averaged over the seeds.
const METRICS: [Definition; 4] = [
    Definition::lower("vibration_total", "Weighted acceleration", "m/s2")
        .is("Root of the sum of squares of the weighted heave, roll and pitch accelerations, averaged over three roads. The label is the comfort class \
         of ISO 2631-1; where the ranges in the standard overlap, the less comfortable class."),
    Definition::lower("heave_weighted", "Weighted heave acceleration", "m/s2")
        .is("RMS of the heave acceleration weighted by W_k (ISO 2631-1), averaged over three roads."),
    Definition::lower("dynamic_load_coefficient", "Largest dynamic load coefficient", "1")
        .is("Standard deviation of the tire load divided by its mean, at the wheel where this is largest, averaged over three roads."),
    Definition::lower("suspension_travel_rms", "Largest suspension travel, RMS", "m")
        .is("RMS of the suspension deflection about its mean, at the strut where this is largest, averaged over three roads."),
];

/// Mean over the seeds of the metric at the wheel or strut where it is largest.
fn mean(found: &[Evaluation], name: &str) -> Option<f64> {
    let of_run = |metrics: &Evaluation| {
        let values = metrics.metrics.iter().filter(|metric| metric.definition.name == name);
        values.filter_map(|metric| number(metrics, &metric.name)).reduce(f64::max)
    };
    let values: Vec<f64> = found.iter().map(of_run).collect::<Option<_>>()?;
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

pub(crate) fn run(bench: &Bench<'_>, results: &mut Results) {
    for (class, roughness) in CLASSES {
        let specs = SEEDS.map(|seed| spec(bench, class, roughness, seed));
        let (runs, mut found): (Vec<_>, Vec<_>) =
            executed(bench, specs, "ride", &json!({ "begin": BEGIN }), results).into_iter().unzip();
        if let (Some(first), "c") = (runs.first(), class) {
            results.show(first);
        }
        let broken = runs.iter().find_map(|run| run.cut_short().map(|reason| format!("{}: {reason}", run.spec.id)));
        // A mean over fewer roads is not comparable.
        if broken.is_some() {
            found.clear();
        }
        for of in &METRICS {
            let value = mean(&found, of.name);
            let metric = results.metric(of, value);
            metric.id = format!("ride.{class}.{}", of.name);
            metric.title = format!("{}, class {}", of.title, class.to_uppercase());
            metric.label = value.filter(|_| of.name == "vibration_total").map(comfort);
            if value.is_none() {
                metric.reason = broken.clone().or_else(|| found.iter().find_map(|metrics| reason(metrics, of.name)));
            }
        }
    }
}
