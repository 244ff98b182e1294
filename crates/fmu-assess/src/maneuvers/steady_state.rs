//! Slowly increasing steer (FMVSS 126 S7.6, ISO 4138 at constant speed) and constant radius (ISO 4138).

use super::{SIDES, evaluated, number, reason, shown};
use crate::bench::{Bench, drive};
use crate::metric::{self, Definition};
use crate::numerics::GRAVITY;
use crate::results::{Results, Suite};
use crate::run_spec::{EndAt, RunSpec};
use crate::wiring::Driving;
use serde_json::{Value, json};

/// Lateral acceleration that ends the slowly increasing steer, m/s2.
const HIGHEST: f64 = 0.55 * GRAVITY;

/// Results of the slowly increasing steer that other maneuvers need.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Increasing {
    /// A: steering wheel angle at 0.3 g, deg.
    pub(crate) amplitude: Option<f64>,
    pub(crate) understeer_gradient: Option<f64>,
}

pub(crate) fn slowly_increasing_steer(bench: &Bench<'_>, suite: Suite) -> (Results, Increasing) {
    let mut results = Results::new("slowly_increasing_steer", suite, bench.system.name);
    let specs = SIDES.map(|(side, sign)| {
        RunSpec::new(format!("slowly_increasing_steer.{side}"), Driving::Path, bench.speed(), 40.0)
            .maneuver("slowly_increasing_steer")
            .drivers(&[
                ("speed.control", f64::from(bench.has_pedals())),
                ("steer.wheel_rate", 13.5_f64.to_radians()),
                ("steer.wheel_amplitude", sign * 400.0_f64.to_radians()),
            ])
            .end(EndAt::LateralAcceleration(HIGHEST))
            .end(EndAt::Finished(1.0))
    });
    let runs = drive(bench, specs.into());
    // The understeer gradient depends on the wheelbase and is removed if the wheelbase is unknown.
    let wheelbase = bench.wheelbase();
    let options = json!({ "steer.ratio": bench.ratio(), "geometry.wheelbase": wheelbase.as_ref().unwrap_or(&1.0) });
    let mut found: Vec<_> = runs.iter().map(|run| evaluated("slowly_increasing_steer", run, &options)).collect();
    if let Err(reason) = &wheelbase {
        let gradients = found.iter_mut().flat_map(|metrics| &mut metrics.metrics);
        for gradient in gradients.filter(|metric| metric.name == "understeer_gradient") {
            gradient.value = metric::Value::Null(reason.clone());
        }
    }
    for (run, metrics) in runs.iter().zip(&found) {
        results.note(run, metrics);
        results.show(run);
    }
    // The mean of both sides, if both have a value.
    let mean = |name: &str| {
        let values: Option<Vec<f64>> = found.iter().map(|metrics| number(metrics, name)).collect();
        values.map(|values| values.iter().sum::<f64>() / values.len() as f64)
    };
    let mut add = |name, title, unit, definition, value: Option<f64>| {
        let metric = results.metric(&Definition::neutral(name, title, unit).is(definition), value);
        metric.reason = found.iter().find_map(|metrics| reason(metrics, name));
    };
    let amplitude = mean("A").map(|mean| (10.0 * mean + 0.5).floor() / 10.0);
    let definition = "A: mean of the magnitudes for both directions, rounded to 0.1 deg.";
    add("A", "Steering wheel angle at 0.3 g", "deg", definition, amplitude);
    let definition = "Slope over the lateral acceleration from 1 to 3 m/s2, averaged over both directions.";
    for (name, title, unit) in [
        ("understeer_gradient", "Understeer gradient", "rad/(m/s2)"),
        ("sideslip_gradient", "Sideslip gradient", "rad/(m/s2)"),
        ("roll_gradient", "Roll gradient", "rad/(m/s2)"),
        ("load_transfer_gradient", "Load transfer gradient", "1/(m/s2)"),
    ] {
        add(name, title, unit, definition, mean(name));
    }
    (results, Increasing { amplitude, understeer_gradient: mean("understeer_gradient") })
}

/// A circle with increasing speed, and the options for its evaluator.
pub(crate) fn circle(bench: &Bench<'_>) -> Option<(RunSpec, Value)> {
    const RADIUS: f64 = 100.0;
    const BEGIN: f64 = 60.0;
    let highest: f64 = if bench.is_car() { 4.0 } else { 2.0 };
    let spec = RunSpec::new("constant_radius", Driving::Path, 5.0, 72.0)
        .maneuver("circle")
        .drivers(&[
            ("path.radius", RADIUS),
            ("path.start", 20.0),
            ("path.arc", 2000.0),
            ("lateral.integral_gain", 0.3),
            ("speed.control", f64::from(bench.has_pedals())),
            ("speed.final", (highest * RADIUS).sqrt()),
            ("speed.start", 12.0),
            ("speed.rise_time", 60.0),
        ])
        .end(EndAt::Lost)
        .show("radius", RADIUS);
    let class = if bench.is_car() { "car" } else { "truck" };
    let options = json!({ "geometry.wheelbase": bench.wheelbase().ok()?, "begin": BEGIN, "vehicle.class": class });
    Some((spec, options))
}

pub(crate) fn constant_radius(bench: &Bench<'_>, results: &mut Results) {
    let Some((spec, options)) = circle(bench) else { return };
    let Some((run, metrics)) = shown(bench, spec, "constant_radius", &options, results) else { return };
    results.take(&run, &metrics, &["understeer_gradient", "sideslip_gradient", "roll_gradient", "deviation_max"]);
    if run.error.is_some() {
        let definition = "True if the run reaches its end, 72 s, without an error.";
        results.metric(&Definition::neutral("completed", "Circle driven to the end", "").is(definition), false);
    }
}
