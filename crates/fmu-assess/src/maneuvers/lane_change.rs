//! Single lane change (ISO 14791, SAE J2179): the lateral acceleration follows one period of a sine.

use super::shown;
use crate::bench::Bench;
use crate::results::Results;
use crate::run_spec::{EndAt, RunSpec};
use crate::wiring::Driving;
use serde_json::json;

const START: f64 = 50.0;
/// Frequency of the lateral acceleration, Hz, and the resulting lateral offset, m.
const FREQUENCY: f64 = 0.4;
const OFFSET: f64 = 1.4637;
/// Distance after the lane change, m.
const BEHIND: f64 = 60.0;

/// The run at the given speed, m/s.
pub(crate) fn spec(bench: &Bench<'_>, speed: f64) -> RunSpec {
    let distance = speed / FREQUENCY;
    let end = START + distance + BEHIND;
    RunSpec::new("single_lane_change", Driving::Path, speed, 1.6 * end / speed + 2.0)
        .maneuver("single_lane_change")
        .drivers(&[
            ("path.start", START),
            ("path.offset", OFFSET),
            ("path.change_distance", distance),
            ("path.run_out", 100.0),
            ("speed.control", f64::from(bench.has_pedals())),
        ])
        .end(EndAt::Position(end))
        .end(EndAt::Lost)
        .with_end()
}

pub(crate) fn run(bench: &Bench<'_>, results: &mut Results) {
    let speed = bench.other_speed.unwrap_or(if bench.is_car() { 88.0 } else { 80.0 } / 3.6);
    let spec = spec(bench, speed);
    let Some((run, metrics)) = shown(bench, spec, "single_lane_change", &json!({}), results) else { return };
    let wanted = [
        "lateral_acceleration_peak",
        "deviation_peak",
        "overshoot",
        "yaw_rate_peak",
        "sideslip_peak",
        "roll_peak",
        "load_transfer_peak",
    ];
    results.take(&run, &metrics, &wanted);
}
