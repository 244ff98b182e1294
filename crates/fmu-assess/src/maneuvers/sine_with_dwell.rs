//! Sine with dwell (FMVSS 126, UN R140): a series of rising amplitudes to both sides, coasting.

use super::{Hindrance, Results, SIDES, evaluated, number, or_null, reason, truth};
use crate::bench::Bench;
use crate::course::{Course, drive};
use crate::metric::Direction;
use crate::report::Limit;
use crate::wiring::Driving;
use serde_json::{Value, json};

/// Speed, m/s.
pub(crate) const SPEED: f64 = 80.0 / 3.6;
/// Least displacement of a vehicle up to 3,500 kg and above, m, and the amplitude from which it counts, in A.
const DISPLACEMENT: (f64, f64) = (1.83, 1.52);
const COUNTS_FROM: f64 = 5.0;

/// The amplitudes, deg at the steering wheel.
fn amplitudes(a: f64) -> Vec<f64> {
    let last = if 6.5 * a > 300.0 { 300.0 } else { (6.5 * a).max(270.0) };
    let steps = (0..).map(|index| (1.5 + 0.5 * f64::from(index)) * a);
    steps.take_while(|amplitude| *amplitude < last - 1e-9).chain([last]).collect()
}

/// The run with an amplitude, rad at the front wheels, coasting from a speed, m/s.
pub(crate) fn course(id: String, speed: f64, steer: f64) -> Course {
    Course::new(id, Driving::OpenLoop, speed, 6.0).drivers(&[
        ("maneuver", 5.0),
        ("steer.amplitude", steer),
        ("steer.start", 1.0),
        ("steer.frequency", 0.7),
        ("steer.dwell_time", 0.5),
    ])
}

/// Least A, deg: below, the series would have thousands of amplitudes.
const LEAST: f64 = 0.1;

/// Reason for no series.
pub(crate) fn hindrance(bench: &Bench<'_>) -> Option<Hindrance> {
    let small = bench.amplitude.filter(|a| *a <= LEAST)?;
    Some(Hindrance::new(format!("A is {small} deg, the series needs more than {LEAST} deg")))
}

pub(crate) fn carry_out(bench: &Bench<'_>, results: &mut Results) {
    let Some(a) = bench.amplitude else { return };
    let mut worst: [Option<f64>; 2] = [None, None];
    let mut is_stable = true;
    let mut unstable_from = None;
    let mut least = None;
    let mut unknown = None;
    for amplitude in amplitudes(a) {
        let courses = SIDES.map(|(side, sign)| {
            let steer = sign * amplitude.to_radians() / bench.ratio();
            course(format!("sine_with_dwell.{side}.{amplitude:.1}"), SPEED, steer).show("amplitude", amplitude)
        });
        let mut is_pair_stable = true;
        for run in drive(bench, courses.into()) {
            let metrics = evaluated("sine_with_dwell", &run, &json!({ "steer.ratio": bench.ratio() }));
            results.note(&run, &metrics);
            results.show(&run);
            for (worst, name) in worst.iter_mut().zip(["yaw_rate_ratio_1s", "yaw_rate_ratio_1_75s"]) {
                if let Some(ratio) = number(&metrics, name) {
                    *worst = Some(worst.map_or(ratio.abs(), |worst: f64| worst.max(ratio.abs())));
                }
            }
            match truth(&metrics, "stable") {
                Some(stable) if !run.has("spun") && !run.has("rolled_over") && run.error.is_none() => {
                    is_pair_stable &= stable;
                }
                Some(_) => is_pair_stable = false,
                None if run.has("spun") || run.has("rolled_over") || run.error.is_some() => is_pair_stable = false,
                None => {
                    let why = reason(&metrics, "stable").unwrap_or_default();
                    unknown = unknown.or(Some(format!("{}: {why}", run.course.id)));
                }
            }
            if amplitude >= COUNTS_FROM * a - 1e-9
                && let Some(displacement) = number(&metrics, "lateral_displacement")
            {
                least = Some(least.map_or(displacement, |least: f64| least.min(displacement)));
            }
        }
        if !is_pair_stable {
            is_stable = false;
            unstable_from = unstable_from.or(Some(amplitude / a));
            if bench.is_quick {
                break;
            }
        }
    }
    let wanted = if bench.vehicle.mass.as_ref().is_none_or(|mass| mass.value <= 3500.0) {
        DISPLACEMENT.0
    } else {
        DISPLACEMENT.1
    };
    let applies = bench.foreign();
    let stable = if unknown.is_none() || !is_stable { Value::Bool(is_stable) } else { Value::Null };
    results.metric("stable", "Stable at all amplitudes", "", Direction::Up, stable);
    if let Some(reason) = unknown.as_ref().filter(|_| is_stable) {
        results.because(reason);
    }
    results.limit(Limit::holds("FMVSS 126 S5.2, UN R140"), applies);
    results.defined("Yes if the yaw rate is at most 35 % of its second peak 1 s after the steering, and 20 % after 1.75 s, in all runs.");
    results.metric("unstable_from", "Unstable from an amplitude of", "A", Direction::None, or_null(unstable_from));
    results.defined("Smallest amplitude at which a run is not stable.");
    if unstable_from.is_none() {
        results.best(unknown.as_deref().unwrap_or("stable at all amplitudes"));
    }
    let [first, second] = worst;
    results.metric(
        "yaw_rate_ratio_1s",
        "Largest yaw rate 1 s after the steering",
        "1",
        Direction::Down,
        or_null(first),
    );
    results.defined(
        "Largest magnitude of the yaw rate 1 s after the completion of steer, over its second peak, of all runs.",
    );
    results.metric(
        "yaw_rate_ratio_1_75s",
        "Largest yaw rate 1.75 s after the steering",
        "1",
        Direction::Down,
        or_null(second),
    );
    results.defined("The same 1.75 s after the completion of steer.");
    results.metric("lateral_displacement", "Least displacement from 5 A on", "m", Direction::Up, or_null(least));
    results
        .defined("Smallest lateral displacement 1.07 s after the beginning of steer, of all runs with at least 5 A.");
    results.limit(Limit::at_least(wanted, "FMVSS 126 S5.2.3, UN R140"), applies);
    if least.is_none() {
        let largest = amplitudes(a).into_iter().fold(0.0, f64::max);
        if largest < COUNTS_FROM * a {
            results.because(&format!("the largest amplitude, {largest:.0} deg, is below 5 A"));
        } else {
            results.because("no run of at least 5 A has a displacement");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the series of FMVSS 126 S7.9.
    #[test]
    fn amplitudes_rise_to_the_last_one() {
        assert_eq!(amplitudes(20.0).last(), Some(&270.0));
        assert_eq!(amplitudes(45.0).last(), Some(&292.5));
        assert_eq!(amplitudes(60.0).last(), Some(&300.0));
        assert_eq!(amplitudes(60.0), [90.0, 120.0, 150.0, 180.0, 210.0, 240.0, 270.0, 300.0]);
    }
}
