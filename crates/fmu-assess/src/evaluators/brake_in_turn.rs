//! Braking in a turn: deviation from the circle.

use super::braking::{before_braking, end_of_span};
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, at, largest, mean, no_rows, sign, smallest};
use crate::options::Options;
use fmu_math::{hypot, sin_cos};

/// Duration over which initial values are averaged, s.
const INITIAL: f64 = 0.5;
/// Time from the start of braking to the values "after 1 s", s.
const AFTER: f64 = 1.0;
/// Duration from the start of braking in which the extreme values are searched, s.
const SPAN: f64 = 2.0;
/// Fraction of the initial speed below which rows are not evaluated.
const SLOW: f64 = 0.2;
const SLOW_AT_ONCE: &str = "the vehicle is below 20 % of its initial speed when braking begins";

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "brake_in_turn",
    title: "Braking in a turn",
    source: "ISO 7975",
    columns: &[
        Column::needed("driver.brake", "1"),
        Column::needed("vehicle.speed", "m/s"),
        Column::needed("vehicle.yaw_rate", "rad/s"),
        Column::optional("vehicle.yaw", "rad"),
        Column::optional("vehicle.sideslip", "rad"),
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("vehicle.position_x", "m"),
        Column::optional("vehicle.position_y", "m"),
    ],
    options: &[],
    metrics: &[
        Definition::neutral("initial_speed", "Initial speed", "m/s")
            .is("Mean over the 0.5 s that end in the last row before `driver.brake` rises above 0. The other initial values are means over the same rows."),
        Definition::neutral("radius", "Radius", "m")
            .is("Initial speed divided by the magnitude of the initial yaw rate."),
        Definition::neutral("lateral_acceleration", "Initial lateral acceleration", "m/s2")
            .is("Mean over the same rows, positive to the left."),
        Definition::neutral("deceleration_1s", "Deceleration in 1 s", "m/s2")
            .is("Initial speed minus the speed after 1 s, divided by 1 s."),
        Definition::neutral("yaw_rate_ratio_1s", "Yaw rate ratio after 1 s", "1")
            .is("Yaw rate 1 s after braking begins, divided by the yaw rate on the initial circle at the speed of that time."),
        Definition::neutral("yaw_rate_ratio_max", "Largest yaw rate ratio", "1")
            .is("Largest value in the first 2 s, while the speed is above 20 % of the initial speed."),
        Definition::neutral("yaw_rate_ratio_min", "Smallest yaw rate ratio", "1")
            .is("Smallest value in the same rows."),
        Definition::lower("sideslip_change", "Largest change of the sideslip angle", "rad")
            .is("Largest magnitude of the difference from the initial sideslip angle, in the same rows."),
        Definition::neutral("radius_deviation_1s", "Offset from the circle after 1 s", "m")
            .is("Distance from the center of the initial circle minus its radius, 1 s after braking begins; positive outward."),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, _: &Options, results: &mut Results) -> Result<(), Reason> {
    let first = before_braking(rows)?;
    let Some(begin) = first.checked_sub(rows.count(INITIAL)) else {
        return Err(format!("the recording begins less than {INITIAL} s before braking"));
    };
    let initial = |column| {
        let values: &[f64] = rows.column(column)?;
        mean(&values[begin..=first]).ok_or_else(no_rows)
    };
    results.set("lateral_acceleration", initial("vehicle.lateral_acceleration"));
    let (speed, yaw_rate) = (initial("vehicle.speed")?, initial("vehicle.yaw_rate")?);
    results.set("initial_speed", speed);
    if yaw_rate == 0.0 || speed <= 0.0 {
        return Err("the vehicle does not drive in a turn before it brakes".to_owned());
    }
    let circle = Circle { radius: speed / yaw_rate.abs(), direction: sign(yaw_rate) };
    results.set("radius", circle.radius);

    let time = rows.times[first] + AFTER;
    let after = |values: &[f64]| {
        at(rows.times, values, time)
            .ok_or_else(|| format!("the recording ends less than {AFTER} s after braking begins"))
    };
    let [speeds, yaw_rates] = ["vehicle.speed", "vehicle.yaw_rate"].map(|column| rows.column(column));
    let (speeds, yaw_rates) = (speeds?, yaw_rates?);
    results.set("deceleration_1s", after(speeds).map(|later| (speed - later) / AFTER));
    results.set("yaw_rate_ratio_1s", after(yaw_rates).and_then(|rate| Ok(circle.ratio(rate, after(speeds)?))));
    results.set("radius_deviation_1s", circle.offset(rows, first, after));

    let slow = (first..speeds.len()).find(|row| speeds[*row] <= SLOW * speed);
    let end = end_of_span(rows, first, SPAN, slow.is_some()).map(|end| slow.map_or(end, |slow| slow.min(end)));
    let ratios =
        end.clone().map(|end| (first..end).map(|row| circle.ratio(yaw_rates[row], speeds[row])).collect::<Vec<_>>());
    let extreme = |of: fn(&[f64]) -> Option<f64>| {
        of(ratios.as_ref().map_err(Clone::clone)?).ok_or_else(|| SLOW_AT_ONCE.to_owned())
    };
    results.set("yaw_rate_ratio_max", extreme(largest));
    results.set("yaw_rate_ratio_min", extreme(smallest));
    let change = initial("vehicle.sideslip").and_then(|initial| {
        let changes = rows.column("vehicle.sideslip")?[first..end?].iter().map(|angle| (angle - initial).abs());
        changes.reduce(f64::max).ok_or_else(|| SLOW_AT_ONCE.to_owned())
    });
    results.set("sideslip_change", change);
    Ok(())
}

/// The circle before braking.
struct Circle {
    radius: f64,
    /// 1 for a left turn, -1 for a right turn.
    direction: f64,
}

impl Circle {
    /// Yaw rate divided by the yaw rate on the circle at the given speed.
    fn ratio(&self, yaw_rate: f64, speed: f64) -> f64 {
        yaw_rate * self.radius / (self.direction * speed)
    }

    /// Offset of a later position from the circle, m, positive outwards. `later` takes a coordinate from its column.
    fn offset(
        &self,
        rows: &Rows<'_>,
        first: usize,
        later: impl Fn(&[f64]) -> Result<f64, Reason>,
    ) -> Result<f64, Reason> {
        let [x, y] = ["vehicle.position_x", "vehicle.position_y"].map(|column| rows.column(column));
        let (x, y) = (x?, y?);
        let course = rows.column("vehicle.yaw")?[first] + rows.column("vehicle.sideslip")?[first];
        let (sin, cos) = sin_cos(course);
        let inwards = self.direction * self.radius;
        let center = [x[first] - inwards * sin, y[first] + inwards * cos];
        Ok(hypot(later(x)? - center[0], later(y)? - center[1]) - self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Value;
    use crate::trace::Trace;
    use serde_json::json;

    /// Closed form: a vehicle that stays on a circle of 100 m radius and brakes from 20 m/s with 5 m/s2 from 1 s on, in
    /// a left and a right turn.
    #[test]
    fn a_vehicle_on_its_circle() {
        let times: Vec<f64> = (1..=4_000).map(|k| f64::from(k) * 0.001).collect();
        for direction in [1.0, -1.0] {
            let speed = |t: f64| 20.0 - 5.0 * (t - 1.0).max(0.0);
            let way = |t: f64| 20.0 * t - 2.5 * (t - 1.0).max(0.0).powi(2);
            let column = |of: &dyn Fn(f64) -> f64| times.iter().map(|time| of(*time)).collect::<Vec<_>>();
            let trace = Trace::new(times.clone())
                .with("driver.brake", column(&|t| f64::from(t > 1.0005)))
                .and_then(|trace| trace.with("vehicle.speed", column(&speed)))
                .and_then(|trace| trace.with("vehicle.yaw_rate", column(&|t| direction * speed(t) / 100.0)))
                .and_then(|trace| trace.with("vehicle.yaw", column(&|t| direction * way(t) / 100.0 + 0.1)))
                .and_then(|trace| trace.with("vehicle.sideslip", column(&|_| -0.1)))
                .and_then(|trace| trace.with("vehicle.position_x", column(&|t| 100.0 * (way(t) / 100.0).sin())))
                .and_then(|trace| {
                    trace.with("vehicle.position_y", column(&|t| direction * 100.0 * (1.0 - (way(t) / 100.0).cos())))
                })
                .unwrap();
            let evaluation = EVALUATOR.evaluate(&trace, &json!({})).unwrap();
            for (name, expected) in [
                ("initial_speed", 20.0),
                ("radius", 100.0),
                ("deceleration_1s", 5.0),
                ("yaw_rate_ratio_1s", 1.0),
                ("yaw_rate_ratio_max", 1.0),
                ("yaw_rate_ratio_min", 1.0),
                ("sideslip_change", 0.0),
                ("radius_deviation_1s", 0.0),
            ] {
                let Some(Value::Number(number)) = evaluation.value(name) else { panic!("{name}") };
                assert!((number - expected).abs() < 1e-9, "{name}: {number}");
            }
            assert!(matches!(evaluation.value("lateral_acceleration"), Some(Value::Null(_))));
        }
    }
}
