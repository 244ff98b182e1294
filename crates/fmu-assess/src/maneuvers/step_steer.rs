//! Step steer (ISO 7401), and the frequency response, which uses half of its steering angle.

use super::{evaluated, frequency_response, number, reason};
use crate::bench::{Bench, drive};
use crate::evaluators::Evaluation;
use crate::numerics::GRAVITY;
use crate::results::Results;
use crate::run_result::RunResult;
use crate::run_spec::RunSpec;
use crate::wiring::Driving;
use serde_json::json;

/// Maximum number of runs to find the steering angle: with proportional steps only, and in total.
const MOST_RUNS: (usize, usize) = (6, 20);
/// Relative tolerance of the lateral acceleration.
const NEAR: f64 = 0.01;
/// Relative difference between two angles at which the bisection ends.
const NEAREST: f64 = 1e-4;
/// Lateral acceleration at which A is measured, m/s2.
const OF_AMPLITUDE: f64 = 0.3 * GRAVITY;
/// Largest range of a settled signal in the last second, relative to its mean.
const SETTLED: f64 = 0.2;

/// The run with the angle `steer` of the front wheels, rad, at the given speed, m/s.
pub(crate) fn spec(id: String, speed: f64, steer: f64) -> RunSpec {
    RunSpec::new(id, Driving::OpenLoop, speed, 6.0)
        .maneuver("ramp_step")
        .drivers(&[("steer.amplitude", steer), ("steer.start", 1.0), ("steer.rise_time", 0.1)])
        .show("steer", steer)
}

/// Returns the reason that a run does not end in a steady state; `None` if it does.
fn unsteady(run: &RunResult) -> Option<String> {
    if let Some(reason) = run.cut_short() {
        return Some(reason);
    }
    if run.has("spun") {
        return Some("the vehicle spun and reached no steady state".to_owned());
    }
    let times = run.trace.times();
    let first = times.partition_point(|time| *time < times.last().map_or(0.0, |last| last - 1.0));
    ["vehicle.yaw_rate", "vehicle.lateral_acceleration"].into_iter().find_map(|name| {
        let last = run.trace.column(name)?.get(first..)?;
        let mean = last.iter().sum::<f64>() / last.len() as f64;
        let (low, high) = last.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
        let is_steady = high - low <= SETTLED * mean.abs() || high - low < 1e-6;
        (!is_steady).then(|| format!("`{name}` does not settle: {low:.3} to {high:.3} in the last second"))
    })
}

/// The next steering angle: first scaled in proportion, then by bisection between the largest angle that is too small
/// and the smallest that is too large.
fn next(steer: f64, steady: Option<f64>, target: f64, tries: usize, [low, high]: [Option<f64>; 2]) -> Option<f64> {
    let proportional = steady.filter(|steady| *steady > 1e-6).map(|steady| steer * target / steady);
    let is_between = |angle: &f64| low.is_none_or(|low| *angle > low) && high.is_none_or(|high| *angle < high);
    if tries < MOST_RUNS.0
        && let Some(angle) = proportional.filter(is_between)
    {
        return Some(angle);
    }
    match (low, high) {
        (Some(low), Some(high)) => (high - low > NEAREST * high).then_some(0.5 * (low + high)),
        // No steady value so far; try half of the angle.
        (None, Some(high)) => Some(0.5 * high),
        _ => None,
    }
}

/// Finds the steering angle, then evaluates the response to it.
pub(crate) fn run(bench: &Bench<'_>, results: &mut Results) {
    let target = if bench.is_car() { 4.0 } else { 2.0 };
    // If the slowly increasing steer gave no amplitude, start with the steering angle of a neutral vehicle.
    let of_amplitude = bench.amplitude.map(|amplitude| amplitude.to_radians() / bench.ratio());
    let neutral = bench.wheelbase().map(|wheelbase| wheelbase * OF_AMPLITUDE / bench.speed().powi(2)).unwrap_or(0.02);
    let mut steer = of_amplitude.unwrap_or(neutral) * target / OF_AMPLITUDE;
    let mut last: Option<(RunResult, Evaluation)> = None;
    let mut is_reached = false;
    // The largest angle that gives too little lateral acceleration, and the smallest that gives too much.
    let mut between = [None, None];
    let mut nearest: Option<f64> = None;
    let mut why = None;
    for index in 1..=MOST_RUNS.1 {
        let Some(mut run) = drive(bench, vec![spec(format!("step_steer.{index}"), bench.speed(), steer)]).pop() else {
            return;
        };
        let metrics = evaluated("step_steer", &run, &json!({}));
        let unsteady = unsteady(&run);
        if unsteady.as_ref().is_some_and(|reason| reason.contains("settle")) {
            run.flags.push("not_settled");
        }
        results.note(&run, &metrics);
        let steady = number(&metrics, "lateral_acceleration.steady").map(f64::abs).filter(|_| unsteady.is_none());
        why = unsteady.or_else(|| reason(&metrics, "lateral_acceleration.steady")).or(why);
        last = Some((run, metrics));
        if let Some(steady) = steady {
            if (steady / target - 1.0).abs() <= NEAR {
                is_reached = true;
                break;
            }
            if nearest.is_none_or(|nearest: f64| (steady - target).abs() < (nearest - target).abs()) {
                nearest = Some(steady);
            }
        }
        match steady {
            Some(steady) if steady < target => between[0] = Some(steer),
            _ => between[1] = Some(steer),
        }
        let Some(angle) = next(steer, steady, target, index, between) else { break };
        steer = angle;
    }
    let Some((run, metrics)) = last else { return };
    results.show(&run);
    let wanted = [
        "steer",
        "yaw_rate.gain",
        "yaw_rate.response_time",
        "yaw_rate.overshoot",
        "lateral_acceleration.response_time",
        "lateral_acceleration.overshoot",
        "roll.overshoot",
        "tb_factor",
    ];
    if is_reached {
        results.take(&run, &metrics, &wanted);
    } else {
        let nearest = nearest.map_or_else(String::new, |nearest| format!(", the nearest gave {nearest:.3} m/s2"));
        let why = why.map_or_else(String::new, |why| format!("; {why}"));
        let reason = format!("no steering angle gave {target} m/s2{nearest}{why}");
        results.take_none("step_steer", &wanted, &reason);
    }
    let steer = number(&metrics, "steer").filter(|_| is_reached);
    frequency_response::run(bench, steer, results);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_in_proportion_until_that_leaves_the_bracket() {
        assert_eq!(next(0.125, Some(2.0), 4.0, 1, [None, None]), Some(0.25));
        assert_eq!(next(0.125, Some(2.0), 4.0, 1, [Some(0.125), Some(0.5)]), Some(0.25));
        // If the proportional angle is outside the bracket, or after too many tries, the next angle is the middle of
        // the bracket.
        assert_eq!(next(0.125, Some(1.0), 4.0, 1, [Some(0.125), Some(0.375)]), Some(0.25));
        assert_eq!(next(0.125, Some(3.9), 4.0, MOST_RUNS.0, [Some(0.125), Some(0.375)]), Some(0.25));
        // Without a steady value, the next angle is half of the upper bound. If the bracket is narrow enough, the
        // search ends.
        assert_eq!(next(0.5, None, 4.0, 1, [None, Some(0.5)]), Some(0.25));
        assert_eq!(next(0.5, None, 4.0, 1, [Some(0.5 * (1.0 - 0.5 * NEAREST)), Some(0.5)]), None);
        assert_eq!(next(0.5, None, 4.0, 1, [None, None]), None);
    }

    /// Reference: an understeering vehicle with a_y = 8 tanh(10 angle) that does not settle above 0.05 rad. It reaches
    /// 3.6 m/s² at artanh(0.45) / 10 rad.
    #[test]
    fn a_target_near_the_limit_is_found() {
        let target = 3.6;
        let exact = (target / 8.0_f64).atanh() / 10.0;
        let steady = |angle: f64| (angle <= 0.05).then(|| 8.0 * (10.0 * angle).tanh());
        let (mut angle, mut bracket) = (0.2, [None, None]);
        for tries in 1.. {
            let is_low = steady(angle).is_some_and(|steady| steady < target);
            bracket[usize::from(!is_low)] = Some(angle);
            let Some(other) = next(angle, steady(angle), target, tries, bracket) else { break };
            angle = other;
            assert!(tries < 100, "the search ends");
        }
        // Tolerance: the final width of the bracket.
        assert!((angle - exact).abs() <= 2.0 * NEAREST * exact, "{angle} instead of {exact}");
    }
}
