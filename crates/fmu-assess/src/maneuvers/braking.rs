//! Braking: straight ahead and on split friction (UN R13-H), and in a turn (ISO 7975).

use super::{executed, number, reason, shown};
use crate::bench::Bench;
use crate::metric::Definition;
use crate::results::{Limit, Results};
use crate::run_spec::{EndAt, RunSpec};
use crate::wiring::Driving;
use fmu_import::description::Causality;
use serde_json::json;

/// Smallest mean fully developed deceleration that UN R13-H allows, m/s2.
const MFDD: f64 = 6.43;
/// Source of the limits on split friction.
const ANNEX: &str = "UN R13-H, annex on antilock braking";
/// Metrics on split friction, each the larger value of two runs, and limits for the steering wheel angles, deg.
const OF_BOTH_SIDES: [(Definition, Option<f64>); 4] = [
    (
        Definition::lower("steering_wheel_peak_2s", "Largest steering wheel angle in the first 2 s", "deg")
            .is("Largest magnitude of the steering wheel angle in the first 2 s of braking, over both runs."),
        Some(120.0),
    ),
    (
        Definition::lower("steering_wheel_peak", "Largest steering wheel angle", "deg")
            .is("Largest magnitude of the steering wheel angle until the car stops, over both runs."),
        Some(240.0),
    ),
    (
        Definition::lower("lateral_peak", "Largest lateral offset", "m")
            .is("Largest distance from the line on which braking begins, over both runs."),
        None,
    ),
    (
        Definition::lower("yaw_peak", "Largest change of the yaw angle", "rad")
            .is("Largest change of the yaw angle after braking begins, over both runs."),
        None,
    ),
];
/// Friction on the slippery side.
const SLIPPERY: f64 = 0.5;

/// Braking on a straight line from the given speed, m/s.
pub(crate) fn spec(id: String, speed: f64) -> RunSpec {
    RunSpec::new(id, Driving::Path, speed, 20.0)
        .maneuver("straight")
        .drivers(&[
            ("speed.control", 1.0),
            ("path.start", 400.0),
            ("path.lost_distance", 50.0),
            ("brake.amplitude", 1.0),
            ("brake.start", 1.0),
            ("brake.rise_time", 0.15),
        ])
        .end(EndAt::GroundSpeed(0.15))
}

pub(crate) fn straight(bench: &Bench<'_>, results: &mut Results) {
    let spec = spec("braking".to_owned(), 100.0 / 3.6);
    let Some((run, metrics)) = shown(bench, spec, "braking", &json!({}), results) else { return };
    let applies = (!bench.is_car()).then_some("the limit applies to cars only");
    results.take(&run, &metrics, &["mfdd"]);
    results.last().set_limit(Limit::at_least(MFDD, "UN R13-H, type 0"), applies);
    results.take(&run, &metrics, &["distance"]);
    if let Some(v) = number(&metrics, "initial_speed").map(|speed| 3.6 * speed) {
        results.last().set_limit(Limit::at_most(0.1 * v + 0.006 * v * v, "UN R13-H, type 0"), applies);
    }
    results.take(&run, &metrics, &["lateral_peak", "yaw_peak"]);
}

pub(crate) fn split_spec(bench: &Bench<'_>, id: String, speed: f64, slippery_left: bool) -> RunSpec {
    let is_left = |name: &str| name.rsplit('.').next().is_some_and(|place| place.ends_with('l'));
    let inputs = bench.plant.signals(Causality::Input).filter(|input| input.starts_with("road_friction."));
    inputs.fold(spec(id, speed), |spec, input| {
        let friction = if is_left(input) == slippery_left { SLIPPERY } else { 1.0 };
        spec.value("plant", input, friction)
    })
}

pub(crate) fn split_friction(bench: &Bench<'_>, results: &mut Results) {
    let specs = [("left", true), ("right", false)]
        .map(|(side, slippery_left)| split_spec(bench, format!("split_friction.{side}"), 50.0 / 3.6, slippery_left));
    let mut held = true;
    let mut cut = None;
    let mut worst = [const { Ok(0.0_f64) }; 4];
    for (run, metrics) in executed(bench, specs, "braking", &json!({}), results) {
        results.show(&run);
        held &= !run.has("spun") && run.stop_reason == "stopped";
        cut = cut.or_else(|| run.cut_short());
        // If one run has no value, the larger of the two values is unknown.
        for (worst, (of, _)) in worst.iter_mut().zip(&OF_BOTH_SIDES) {
            let missing = || format!("{}: {}", run.spec.id, reason(&metrics, of.name).unwrap_or_default());
            match (worst.as_mut(), number(&metrics, of.name)) {
                (Ok(worst), Some(value)) => *worst = worst.max(value),
                (Ok(_), None) => *worst = Err(missing()),
                (Err(_), _) => (),
            }
        }
    }
    let applies = (!bench.is_car()).then_some("the limit applies to cars only");
    let of = Definition::higher("held", "Stops without spinning", "").is(
        "True if the car stops in both runs and its sideslip angle stays below 0.7 rad while it is faster than 3 m/s.",
    );
    results.metric(&of, held).set_limit(Limit::holds(ANNEX), applies);
    for (worst, (of, limit)) in worst.into_iter().zip(&OF_BOTH_SIDES) {
        let worst = worst.map(|value| if of.unit == "deg" { value.to_degrees() } else { value });
        let metric = results.metric(of, worst.as_ref().ok().copied());
        metric.reason = worst.err();
        metric.incomparable.clone_from(&cut);
        if let Some(limit) = limit {
            metric.set_limit(Limit::at_most(*limit, ANNEX), applies);
        }
    }
}

pub(crate) fn turn_spec() -> RunSpec {
    const RADIUS: f64 = 100.0;
    let speed = (5.0 * RADIUS).sqrt();
    RunSpec::new("brake_in_turn", Driving::Path, speed, 20.0)
        .maneuver("circle")
        .drivers(&[
            ("path.radius", RADIUS),
            ("path.turn_in", 60.0),
            ("path.arc", 900.0),
            ("lateral.integral_gain", 0.3),
            ("speed.control", 1.0),
            ("brake.start", 16.0),
            ("steer.hold_start", 16.0),
            ("brake.amplitude", 0.45),
        ])
        .end(EndAt::Speed(1.0))
        .show("radius", RADIUS)
}

pub(crate) fn in_a_turn(bench: &Bench<'_>, results: &mut Results) {
    let Some((run, metrics)) = shown(bench, turn_spec(), "brake_in_turn", &json!({}), results) else { return };
    let wanted =
        ["deceleration_1s", "yaw_rate_ratio_1s", "yaw_rate_ratio_max", "sideslip_change", "radius_deviation_1s"];
    results.take(&run, &metrics, &wanted);
}
