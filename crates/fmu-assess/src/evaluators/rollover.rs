//! Rollover: peaks, and wheel lift.

use super::{Column, Evaluator, LATERAL_ACCELERATION_PEAK, LOAD_TRANSFER_PEAK, ROLL_PEAK, peak};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, smallest};
use crate::options::Options;

/// Load up to which a tire counts as off the road, N.
const OFF: f64 = 1.0;
/// Time that one side must be off the road for a two-wheel lift, s.
const LIFT_TIME: f64 = 0.02;

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "rollover",
    title: "Rollover",
    source: "NHTSA fishhook and J-turn; wheel lift is detected from tire loads, because not all vehicle models output wheel heights",
    columns: &[
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("vehicle.load_transfer_ratio", "1"),
        Column::optional("body.roll", "rad"),
        Column::optional("body.roll_rate", "rad/s"),
        Column::optional("tire_load.*", "N"),
    ],
    options: &[],
    metrics: &[
        LATERAL_ACCELERATION_PEAK.is("Largest magnitude."),
        LOAD_TRANSFER_PEAK.is("Largest magnitude."),
        ROLL_PEAK.is("Largest magnitude."),
        peak("roll_rate_peak", "Peak of the roll rate", "rad/s", "body.roll_rate").is("Largest magnitude."),
        Definition::neutral("two_wheel_lift", "Two-wheel lift", "1")
            .is("True if all tire loads on one side are at most 1 N for 0.02 s, in consecutive rows (at least one)."),
        Definition::neutral("two_wheel_lift_time", "Time of the lift", "s")
            .is("Time of the row that completes the 0.02 s."),
        Definition::neutral("two_wheel_lift_duration", "Duration of the lift", "s")
            .is("Longest time that a side is off the road, even if it is too short for a lift."),
        Definition::neutral("load_minimum", "Smallest tire load", "N").is("Smallest load of any tire in any row."),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, _: &Options, results: &mut Results) -> Result<(), Reason> {
    let sides = ['l', 'r'].map(|side| loads(rows, side));
    let [left, right] = sides;
    let (left, right) = (left?, right?);
    let all = left.iter().chain(&right).filter_map(|loads| smallest(loads));
    results.set("load_minimum", all.reduce(f64::min).unwrap_or(f64::NAN));

    let needed = rows.count(LIFT_TIME).max(1);
    let lifts = [left, right].map(|side| Lift::of(&side, needed));
    let first = lifts.iter().filter_map(|lift| lift.completed).min();
    results.set("two_wheel_lift", first.is_some());
    let time = first.map(|row| rows.times[row]).ok_or_else(|| "no side is off the road for 0.02 s".to_owned());
    results.set("two_wheel_lift_time", time);
    let longest = lifts.iter().map(|lift| lift.longest).max().unwrap_or(0);
    results.set("two_wheel_lift_duration", longest as f64 / rows.rate);
    Ok(())
}

/// The tire loads on a side: the columns whose name ends with `side`.
fn loads<'a>(rows: &Rows<'a>, side: char) -> Result<Vec<&'a [f64]>, Reason> {
    let places = rows.places("tire_load").into_iter().filter(|(place, _)| place.ends_with(side));
    let loads = places.map(|(_, name)| rows.column(name)).collect::<Result<Vec<_>, _>>()?;
    if loads.is_empty() {
        return Err(format!("the recording has no column `tire_load.*` for the side `{side}`"));
    }
    Ok(loads)
}

/// Rows in which a side is off the road.
struct Lift {
    /// The row that completes the first lift.
    completed: Option<usize>,
    /// The largest number of consecutive rows off the road.
    longest: usize,
}

impl Lift {
    fn of(side: &[&[f64]], needed: usize) -> Self {
        let (mut off, mut longest, mut completed) = (0, 0, None);
        for row in 0..side[0].len() {
            off = if side.iter().all(|loads| loads[row] <= OFF) { off + 1 } else { 0 };
            longest = longest.max(off);
            if off == needed {
                completed = completed.or(Some(row));
            }
        }
        Self { completed, longest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Value;
    use crate::trace::Trace;
    use serde_json::json;

    /// The left side is off the road for `rows_off` rows of 1 ms from 0.101 s on; the right side never is.
    fn lifted(rows_off: usize) -> [Value; 3] {
        let times: Vec<f64> = (1..=1_000).map(|k| f64::from(k) * 0.001).collect();
        let load = |row: usize| if (100..100 + rows_off).contains(&row) { 1.0 } else { 1.001 };
        let left: Vec<f64> = (0..1_000).map(load).collect();
        let trace = Trace::new(times).with("tire_load.fl", left).unwrap();
        // A single unloaded wheel on the right side is not a lift.
        let trace =
            trace.with("tire_load.fr", vec![0.0; 1_000]).unwrap().with("tire_load.rr", vec![2.0; 1_000]).unwrap();
        let evaluation = EVALUATOR.evaluate(&trace, &json!({})).unwrap();
        ["two_wheel_lift", "two_wheel_lift_time", "two_wheel_lift_duration"]
            .map(|name| evaluation.value(name).unwrap().clone())
    }

    /// A lift needs 20 rows; 19 are too few.
    #[test]
    fn a_lift_takes_20_ms() {
        let [lift, time, duration] = lifted(20);
        assert_eq!((lift, time, duration), (Value::Boolean(true), Value::Number(0.12), Value::Number(0.02)));
        let [lift, time, duration] = lifted(19);
        assert_eq!((lift, duration), (Value::Boolean(false), Value::Number(0.019)));
        assert_eq!(time, Value::Null("no side is off the road for 0.02 s".to_owned()));
    }

    #[test]
    fn both_sides_are_needed() {
        let trace = Trace::new(vec![0.0, 0.1]).with("tire_load.l", vec![0.0; 2]).unwrap();
        let evaluation = EVALUATOR.evaluate(&trace, &json!({})).unwrap();
        let expected = Value::Null("the recording has no column `tire_load.*` for the side `r`".to_owned());
        assert_eq!(evaluation.value("two_wheel_lift"), Some(&expected));
    }
}
