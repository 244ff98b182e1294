//! Fishhook with roll-rate feedback, and J-turn (NHTSA): lowest speed at which two wheels lift.

use super::{Extreme, SIDES, executed, number, truth};
use crate::bench::Bench;
use crate::metric::Definition;
use crate::results::{Bound, Limit, Results};
use crate::run_spec::RunSpec;
use crate::wiring::Driving;
use serde_json::json;

/// One mile per hour, m/s.
const MPH: f64 = 0.447_04;

/// Makes the specification of a run from the name and sign of the side, and the speed in mph and in m/s.
type MakeSpec<'a> = &'a dyn Fn(&str, f64, f64, f64) -> RunSpec;

fn series(bench: &Bench<'_>, speeds: &[f64], spec: MakeSpec<'_>, results: &mut Results) {
    let mut lifted = None;
    let mut peaks = PEAKS.map(|(of, _)| Extreme::new(of.name, f64::max));
    let mut is_known = false;
    for mph in speeds {
        let specs = SIDES.map(|(side, sign)| spec(side, sign, *mph, mph * MPH));
        let mut found = Vec::new();
        for (run, metrics) in executed(bench, specs, "rollover", &json!({}), results) {
            results.show(&run);
            let lift = truth(&metrics, "two_wheel_lift");
            is_known |= lift.is_some() || run.has("rolled_over");
            if lift == Some(true) || run.has("rolled_over") {
                lifted = lifted.or(Some(*mph));
            }
            found.push((metrics, run.cut_short().is_some()));
        }
        for (metrics, is_cut) in &found {
            let is_comparable = lifted.is_none() && !is_cut;
            peaks.iter_mut().for_each(|peak| peak.add(*mph, number(metrics, peak.name), is_comparable));
        }
        if lifted.is_some() {
            break;
        }
    }
    let of = Definition::higher("no_lift", "No two-wheel lift up to the highest speed", "")
        .is("True if, at all speeds of the series, no side loses contact with the road for 20 ms.");
    let metric = results.metric(&of, is_known.then_some(lifted.is_none()));
    metric.set_limit(Limit::holds("NHTSA, 49 CFR 575.106"), bench.not_applicable());
    if !is_known {
        metric.set_reason("no run has tire loads");
    }
    let of = Definition::higher("lift_speed", "Speed of the first two-wheel lift", "mph")
        .is("First speed of the series at which the wheels on one side lift or the vehicle rolls over.");
    let metric = results.metric(&of, lifted);
    if lifted.is_none() {
        metric.set_best("no wheels lift");
        metric.bound = speeds.last().filter(|_| is_known).map(|highest| Bound::Above(*highest));
    }
    for (peak, (of, signal)) in peaks.into_iter().zip(&PEAKS) {
        let metric = results.metric(of, peak.value);
        if peak.value.is_none() && bench.plant.has_output(signal) {
            metric.set_reason("no run has a value");
        } else if peak.value.is_none() {
            metric.set_dropped(&format!("the plant has no output `{signal}`"));
        }
        metric.series = Some(peak.series("mph"));
    }
}

/// Metrics that are the largest values of all runs, and the signal that each needs.
const PEAKS: [(Definition, &str); 2] = [
    (
        Definition::lower("load_transfer_peak", "Largest load transfer ratio", "1")
            .is("Largest magnitude of the load transfer ratio in all runs."),
        "vehicle.load_transfer_ratio",
    ),
    (
        Definition::lower("roll_peak", "Largest roll angle", "rad")
            .is("Largest magnitude of the roll angle in all runs."),
        "body.roll",
    ),
];

/// A fishhook at the given speed (m/s) and steering-wheel angle (deg).
pub(crate) fn fishhook_spec(bench: &Bench<'_>, id: String, speed: f64, wheel: f64) -> RunSpec {
    let spec = RunSpec::new(id, Driving::Path, speed, 9.0)
        .maneuver("fishhook")
        .drivers(&[("steer.wheel_amplitude", wheel.to_radians()), ("steer.wheel_rate", 720.0_f64.to_radians())]);
    if bench.plant.has_output("body.roll_rate") {
        return spec;
    }
    spec.drivers(&[("steer.maximum_dwell", 0.25), ("roll_rate.threshold", -1.0)])
}

/// A J-turn at the given speed (m/s) and steering-wheel angle (deg).
pub(crate) fn j_turn_spec(bench: &Bench<'_>, id: String, speed: f64, wheel: f64) -> RunSpec {
    RunSpec::new(id, Driving::OpenLoop, speed, 6.0).maneuver("ramp_step").drivers(&[
        ("steer.amplitude", wheel.to_radians() / bench.ratio()),
        ("steer.start", 1.0),
        ("steer.rise_time", wheel.abs() / 1000.0),
    ])
}

/// Steers to one side, waits until the roll rate is back at zero, and steers to the other side.
pub(crate) fn fishhook(bench: &Bench<'_>, results: &mut Results) {
    let Some(a) = bench.amplitude else { return };
    let spec = |side: &str, sign: f64, mph: f64, speed: f64| {
        let wheel = 6.5 * a;
        fishhook_spec(bench, format!("fishhook.{side}.{mph}"), speed, sign * wheel).show("amplitude", wheel)
    };
    series(bench, &[35.0, 40.0, 45.0, 47.5, 50.0], &spec, results);
}

/// Steers to one side and holds.
pub(crate) fn j_turn(bench: &Bench<'_>, results: &mut Results) {
    let Some(a) = bench.amplitude else { return };
    let spec = |side: &str, sign: f64, mph: f64, speed: f64| {
        let wheel = 8.0 * a;
        j_turn_spec(bench, format!("j_turn.{side}.{mph}"), speed, sign * wheel).show("amplitude", wheel)
    };
    series(bench, &[35.0, 40.0, 45.0, 50.0, 55.0, 60.0], &spec, results);
}
