//! Braking: straight ahead and on split friction (UN R13-H), and in a turn (ISO 7975).

use super::{evaluated, number, reason};
use crate::bench::{Bench, drive};
use crate::metric::Direction;
use crate::results::{Limit, Results};
use crate::run_spec::{EndAt, RunSpec};
use crate::wiring::Driving;
use serde_json::{Value, json};

/// Least mean fully developed deceleration of UN R13-H, m/s2.
const MFDD: f64 = 6.43;
/// Largest steering wheel angles on split friction, deg: in the first two seconds, and in all.
const STEERING: (f64, f64) = (120.0, 240.0);
/// Friction of the slippery side.
const SLIPPERY: f64 = 0.5;

/// Braking on a straight line from a speed, m/s.
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
    let Some(run) = drive(bench, vec![spec("braking".to_owned(), 100.0 / 3.6)]).pop() else { return };
    let metrics = evaluated("braking", &run, &json!({}));
    results.note(&run, &metrics);
    results.show(&run);
    let applies = (!bench.is_car()).then_some("the limit is that of cars");
    results.take(&run, &metrics, &["mfdd"]);
    results.last().set_limit(Limit::at_least(MFDD, "UN R13-H, type 0"), applies);
    results.take(&run, &metrics, &["distance"]);
    if let Some(v) = number(&metrics, "initial_speed").map(|speed| 3.6 * speed) {
        results.last().set_limit(Limit::at_most(0.1 * v + 0.006 * v * v, "UN R13-H, type 0"), applies);
    }
    results.take(&run, &metrics, &["lateral_peak", "yaw_peak"]);
}

/// Braking on split friction.
pub(crate) fn split_spec(bench: &Bench<'_>, id: String, speed: f64, slippery_left: bool) -> RunSpec {
    let is_left = |name: &str| name.rsplit('.').next().is_some_and(|place| place.ends_with('l'));
    bench.inputs("road_friction.").iter().fold(spec(id, speed), |spec, input| {
        let friction = if is_left(input) == slippery_left { SLIPPERY } else { 1.0 };
        spec.value("plant", input, friction)
    })
}

pub(crate) fn split_friction(bench: &Bench<'_>, results: &mut Results) {
    let specs = [("left", true), ("right", false)]
        .map(|(side, slippery_left)| split_spec(bench, format!("split_friction.{side}"), 50.0 / 3.6, slippery_left));
    let mut spun = false;
    let mut is_finished = true;
    let mut worst: [Result<f64, String>; 4] = [const { Ok(0.0) }; 4];
    let mut cut = None;
    const NAMES: [&str; 4] = ["steering_wheel_peak_2s", "steering_wheel_peak", "lateral_peak", "yaw_peak"];
    for run in drive(bench, specs.into()) {
        let metrics = evaluated("braking", &run, &json!({}));
        results.note(&run, &metrics);
        results.show(&run);
        spun |= run.has("spun");
        is_finished &= run.stop_reason == "stopped";
        cut = cut.or_else(|| run.cut_short());
        // If the number of one side is missing, the larger one is unknown.
        for (worst, name) in worst.iter_mut().zip(NAMES) {
            let value = number(&metrics, name);
            let missing = || format!("{}: {}", run.spec.id, reason(&metrics, name).unwrap_or_default());
            match (worst.as_mut(), value) {
                (Ok(worst), Some(value)) => *worst = worst.max(value),
                (Ok(_), None) => *worst = Err(missing()),
                (Err(_), _) => (),
            }
        }
    }
    let applies = (!bench.is_car()).then_some("the limit is that of cars");
    let held = Value::Bool(!spun && is_finished);
    results
        .metric("held", "Stops without spinning", "", Direction::Up, held)
        .set_definition("Whether the car stops on both sides and its sideslip angle stays below 0.7 rad above 3 m/s.")
        .set_limit(Limit::holds("UN R13-H, annex on antilock braking"), applies);
    let [first_wheel, wheel, lateral, yaw] = worst;
    let degrees = |angle: Result<f64, String>| angle.map(f64::to_degrees);
    let mut add = |name: &str, title: &str, unit: &'static str, value: Result<f64, String>, definition: &str| {
        let metric = match value {
            Ok(value) => results.metric(name, title, unit, Direction::Down, json!(value)),
            Err(reason) => results.without(name, title, unit, Direction::Down, &reason),
        };
        metric.set_definition(definition).incomparable.clone_from(&cut);
        let steering = match name {
            "steering_wheel_peak_2s" => Some(STEERING.0),
            "steering_wheel_peak" => Some(STEERING.1),
            _ => None,
        };
        if let Some(limit) = steering {
            metric.set_limit(Limit::at_most(limit, "UN R13-H, annex on antilock braking"), applies);
        }
    };
    add(
        NAMES[0],
        "Largest steering wheel angle in the first 2 s",
        "deg",
        degrees(first_wheel),
        "Largest magnitude of the steering wheel angle in the first 2 s of braking, of both sides.",
    );
    add(
        NAMES[1],
        "Largest steering wheel angle",
        "deg",
        degrees(wheel),
        "Largest magnitude of the steering wheel angle until the car stops, of both sides.",
    );
    add(
        NAMES[2],
        "Largest lateral offset",
        "m",
        lateral,
        "Largest distance from the line on which braking begins, of both sides.",
    );
    add(
        NAMES[3],
        "Largest change of the yaw angle",
        "rad",
        yaw,
        "Largest change of the yaw angle from the start of braking, of both sides.",
    );
}

/// Braking on a circle.
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
    let Some(run) = drive(bench, vec![turn_spec()]).pop() else { return };
    let metrics = evaluated("brake_in_turn", &run, &json!({}));
    results.note(&run, &metrics);
    results.show(&run);
    results.take(
        &run,
        &metrics,
        &["deceleration_1s", "yaw_rate_ratio_1s", "yaw_rate_ratio_max", "sideslip_change", "radius_deviation_1s"],
    );
}
