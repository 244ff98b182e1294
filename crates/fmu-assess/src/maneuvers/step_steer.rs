//! Step steer (ISO 7401), and the frequency response, which takes half of its steering.

use super::{Results, evaluated, frequency_response, number};
use crate::bench::Bench;
use crate::course::{Course, Ended, drive};
use crate::evaluators::Evaluation;
use crate::metric::Direction;
use crate::wiring::Driving;
use serde_json::json;

/// Most runs for the steering angle that gives the lateral acceleration.
const MOST_RUNS: usize = 6;
/// How near the lateral acceleration has to come, relative.
const NEAR: f64 = 0.01;
/// Lateral acceleration at which A is measured, m/s2.
const OF_AMPLITUDE: f64 = 0.3 * super::G;

/// The run with a steering angle of the front wheels, rad, at a speed, m/s.
pub(crate) fn course(id: String, speed: f64, steer: f64) -> Course {
    Course::new(id, Driving::OpenLoop, speed, 6.0)
        .drivers(&[("maneuver", 1.0), ("steer.amplitude", steer), ("steer.start", 1.0), ("steer.rise_time", 0.1)])
        .show("steer", steer)
}

/// Finds the steering angle, then tells how the vehicle answers it.
pub(crate) fn carry_out(bench: &Bench<'_>, results: &mut Results) {
    let target = if bench.is_car() { 4.0 } else { 2.0 };
    // Without an amplitude of the slowly increasing steer: that of a neutral vehicle.
    let of_amplitude = bench.amplitude.map(|amplitude| amplitude.to_radians() / bench.ratio());
    let neutral = bench.wheelbase().map(|wheelbase| wheelbase * OF_AMPLITUDE / bench.speed().powi(2)).unwrap_or(0.02);
    let mut steer = of_amplitude.unwrap_or(neutral) * target / OF_AMPLITUDE;
    let mut last: Option<(Ended, Evaluation)> = None;
    let mut is_reached = false;
    for index in 1..=MOST_RUNS {
        let Some(run) = drive(bench, vec![course(format!("step_steer.{index}"), bench.speed(), steer)]).pop() else {
            return;
        };
        let metrics = evaluated("step_steer", &run, &json!({}));
        results.note(&run, &metrics);
        let steady = number(&metrics, "lateral_acceleration.steady");
        last = Some((run, metrics));
        let Some(steady) = steady.filter(|steady| steady.abs() > 1e-6) else { break };
        if (steady.abs() / target - 1.0).abs() <= NEAR {
            is_reached = true;
            break;
        }
        steer *= target / steady.abs();
    }
    let Some((run, metrics)) = last else { return };
    results.show(&run);
    if is_reached {
        results.take(
            &metrics,
            &[
                "steer",
                "yaw_rate.gain",
                "yaw_rate.response_time",
                "yaw_rate.overshoot",
                "lateral_acceleration.response_time",
                "lateral_acceleration.overshoot",
                "roll.overshoot",
                "tb_factor",
            ],
        );
    } else {
        let reason = format!("target not reached: no steering angle gave {target} m/s2");
        results.without("yaw_rate.overshoot", "Overshoot of the yaw rate", "1", Direction::Down, reason);
        results
            .defined("Peak less steady value, over the steady value, of a step that gives the lateral acceleration.");
    }
    let steer = number(&metrics, "steer").filter(|_| is_reached);
    frequency_response::carry_out(bench, steer, results);
}
