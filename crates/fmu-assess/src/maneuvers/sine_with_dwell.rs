//! Sine with dwell (FMVSS 126, UN R140): a series of increasing amplitudes to both sides, while coasting.

use super::{Extreme, NotApplicable, SIDES, executed, number, reason, truth};
use crate::bench::Bench;
use crate::evaluators::sine_with_dwell::least_displacement;
use crate::metric::Definition;
use crate::results::{Limit, Results};
use crate::run_spec::RunSpec;
use crate::wiring::Driving;
use serde_json::json;

pub(crate) const SPEED: f64 = 80.0 / 3.6;
/// Smallest amplitude for which a displacement is required, as a multiple of A.
const COUNTS_FROM: f64 = 5.0;

/// The amplitudes, deg at the steering wheel.
fn amplitudes(a: f64) -> Vec<f64> {
    let last = if 6.5 * a > 300.0 { 300.0 } else { (6.5 * a).max(270.0) };
    let steps = (0..).map(|index| (1.5 + 0.5 * f64::from(index)) * a);
    steps.take_while(|amplitude| *amplitude < last - 1e-9).chain([last]).collect()
}

/// The run with the amplitude `steer`, rad at the front wheels, coasting from the given speed, m/s.
pub(crate) fn spec(id: String, speed: f64, steer: f64) -> RunSpec {
    RunSpec::new(id, Driving::OpenLoop, speed, 6.0).maneuver("sine_with_dwell").drivers(&[
        ("steer.amplitude", steer),
        ("steer.start", 1.0),
        ("steer.frequency", 0.7),
        ("steer.dwell_time", 0.5),
    ])
}

/// Lower limit of A, deg. With a smaller A, the series would have thousands of amplitudes.
const LEAST: f64 = 0.1;

/// Returns the reason that no series is run, if there is one.
pub(crate) fn not_applicable(bench: &Bench<'_>) -> Option<NotApplicable> {
    let small = bench.amplitude.filter(|a| *a <= LEAST)?;
    Some(NotApplicable::new(format!("A is {small} deg; the series needs more than {LEAST} deg")))
}

pub(crate) fn run(bench: &Bench<'_>, results: &mut Results) {
    let Some(a) = bench.amplitude else { return };
    let mut worst = ["yaw_rate_ratio_1s", "yaw_rate_ratio_1_75s"].map(|name| Extreme::new(name, f64::max));
    let mut least = Extreme::new("lateral_displacement", f64::min);
    let mut is_stable = true;
    let mut unstable_from = None;
    let mut unknown = None;
    for amplitude in amplitudes(a) {
        let specs = SIDES.map(|(side, sign)| {
            let steer = sign * amplitude.to_radians() / bench.ratio();
            spec(format!("sine_with_dwell.{side}.{amplitude:.1}"), SPEED, steer).show("amplitude", amplitude)
        });
        let mut is_pair_stable = true;
        let options = json!({ "steer.ratio": bench.ratio() });
        for (run, metrics) in executed(bench, specs, "sine_with_dwell", &options, results) {
            results.show(&run);
            let is_whole = run.cut_short().is_none();
            for worst in &mut worst {
                worst.add(amplitude / a, number(&metrics, worst.name).map(f64::abs), is_whole);
            }
            if amplitude >= COUNTS_FROM * a - 1e-9 {
                least.add(amplitude / a, number(&metrics, least.name), is_whole);
            }
            match truth(&metrics, "stable") {
                _ if run.has("spun") || run.has("rolled_over") || run.error.is_some() => is_pair_stable = false,
                Some(stable) => is_pair_stable &= stable,
                None => {
                    let why = reason(&metrics, "stable").unwrap_or_default();
                    unknown = unknown.or(Some(format!("{}: {why}", run.spec.id)));
                }
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
    let wanted = least_displacement(bench.vehicle.mass.as_ref().map_or(0.0, |mass| mass.value));
    let applies = bench.not_applicable();
    let stable = (unknown.is_none() || !is_stable).then_some(is_stable);
    let of = Definition::higher("stable", "Stable at all amplitudes", "").is(
        "True if, in all runs, the yaw rate is at most 35 % of its second peak 1 s after the steering, and at most 20 % \
         after 1.75 s.",
    );
    let metric = results.metric(&of, stable).set_limit(Limit::holds("FMVSS 126 S5.2, UN R140"), applies);
    metric.reason = unknown.clone().filter(|_| is_stable);
    let of = Definition::neutral("unstable_from", "Unstable from an amplitude of", "A")
        .is("Smallest amplitude at which a run is not stable.");
    let metric = results.metric(&of, unstable_from);
    if unstable_from.is_none() {
        metric.set_best(unknown.as_deref().unwrap_or("stable at all amplitudes"));
    }
    let titles = ["Largest yaw rate 1 s after the steering", "Largest yaw rate 1.75 s after the steering"];
    let definitions = [
        "Largest magnitude of the yaw rate 1 s after the completion of steer, divided by its second peak, in all runs.",
        "The same 1.75 s after the completion of steer.",
    ];
    for (worst, (title, definition)) in worst.into_iter().zip(titles.into_iter().zip(definitions)) {
        let of = Definition::lower(worst.name, title, "1").is(definition);
        let value = worst.value;
        results.metric(&of, value).series = Some(worst.series("A"));
    }
    let of = Definition::higher(least.name, "Smallest displacement from 5 A", "m").is(
        "Smallest lateral displacement 1.07 s after the beginning of steer, in all runs with an amplitude of at least \
         5 A.",
    );
    let metric = results.metric(&of, least.value);
    metric.set_limit(Limit::at_least(wanted, "FMVSS 126 S5.2.3, UN R140"), applies);
    if least.value.is_none() {
        let largest = amplitudes(a).into_iter().fold(0.0, f64::max);
        if largest < COUNTS_FROM * a {
            metric.set_reason(&format!("the largest amplitude, {largest:.0} deg, is below 5 A"));
        } else {
            metric.set_reason("no run with at least 5 A has a displacement");
        }
    }
    metric.series = Some(least.series("A"));
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
