//! Braking straight ahead: deceleration, distance, and deviation from the straight line.

use super::steering_wheel::{OPTIONAL_RATIO, steering_wheel};
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, at, largest_magnitude, no_rows};
use crate::options::Options;
use fmu_math::{hypot, sin_cos};

/// Fractions of the initial speed between which the mean fully developed deceleration is computed.
const FROM: f64 = 0.8;
const TO: f64 = 0.1;
/// Largest relative difference between `vehicle.speed` and the speed from the positions.
const DISAGREEMENT: f64 = 0.02;
/// Ratios of two speeds that indicate a wrong unit, and the words for the probable cause in the message.
const FACTORS: [(f64, &str); 4] = [
    (3.6, "it were in km/h"),
    (2.236_936, "it were in mph"),
    (1000.0, "times were in ms"),
    (0.001, "positions were in mm"),
];
/// Relative tolerance for these ratios.
const ALIKE: f64 = 0.05;
/// Time before braking in which the speed should change by less than [`DISAGREEMENT`], s.
const BEFORE: f64 = 0.2;
/// Speed below which the vehicle counts as stopped, m/s.
const STOP: f64 = 0.2;

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "braking",
    title: "Straight-line braking",
    source: "UN R13-H, also on split friction",
    columns: &[
        Column::needed("driver.brake", "1"),
        Column::needed("vehicle.position_x", "m"),
        Column::needed("vehicle.position_y", "m"),
        Column::optional("vehicle.speed", "m/s"),
        Column::optional("vehicle.yaw", "rad"),
        Column::optional("vehicle.yaw_rate", "rad/s"),
        Column::optional("driver.steering_wheel", "rad"),
        Column::optional("driver.steer", "rad"),
    ],
    options: &[OPTIONAL_RATIO],
    metrics: &[
        Definition::neutral("initial_speed", "Initial speed", "m/s")
            .is("Speed over ground in the last row before `driver.brake` rises above 0. The speed over ground is the distance from the previous \
             position, times the sampling rate. If `vehicle.speed` is recorded and differs from it by more than 2 % up to this row (position noise \
             increases distances), all metrics use `vehicle.speed` and its integral instead."),
        Definition::neutral("mfdd", "Mean fully developed deceleration", "m/s2")
            .is("((0.8 v)^2 - (0.1 v)^2) divided by twice the distance traveled between the speeds 0.8 v and 0.1 v; v is the initial speed."),
        Definition::lower("distance", "Braking distance", "m")
            .is("Distance from the row of the initial speed until the speed falls to 0.2 m/s."),
        Definition::neutral("time", "Braking time", "s").is("Time for the same distance."),
        Definition::lower("lateral_peak", "Largest lateral offset", "m")
            .is("Largest distance, until the stop, from the line through the initial position in the direction of the initial yaw angle."),
        Definition::neutral("yaw_peak", "Largest change of the yaw angle", "rad")
            .is("Largest magnitude until the stop."),
        Definition::neutral("yaw_rate_peak_1s", "Largest yaw rate", "rad/s")
            .is("Largest magnitude in the first second."),
        Definition::neutral("steering_wheel_peak", "Largest steering wheel angle", "rad")
            .is("Largest magnitude until the stop."),
        Definition::neutral("steering_wheel_peak_2s", "Largest steering wheel angle in 2 s", "rad")
            .is("Largest magnitude in the first two seconds."),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let first = before_braking(rows)?;
    let mut ground = Ground::new(rows)?;
    let speed = rows.column("vehicle.speed");
    if let Err(reason) = &speed
        && rows.has("vehicle.speed")
    {
        results
            .notes
            .push(format!("{reason}; the speed is computed from the positions, whose noise makes it too large"));
    }
    if let Ok(speed) = speed
        && let measured = Ground::of_speed(rows, speed)
        && let Some([of_positions, of_speed]) = ground.disagrees(&measured, first)
    {
        let ratio = of_speed / of_positions;
        if let Some((factor, meant)) = FACTORS.into_iter().find(|(factor, _)| (ratio / factor - 1.0).abs() < ALIKE) {
            return Err(format!(
                "`vehicle.speed` is {factor:.3} times the speed computed from the positions, as if {meant}: specify the units \
                 of the columns"
            ));
        }
        results.notes.push(format!(
            "the positions give a speed of {of_positions:.3} m/s when braking begins, but `vehicle.speed` is {of_speed:.3} \
             m/s; `vehicle.speed` and its integral are used"
        ));
        ground = measured;
    }
    let initial = ground.speed[first];
    if let Some(mean) =
        ground.mean_before(rows, first).filter(|mean| (initial - mean).abs() > DISAGREEMENT * mean.abs())
    {
        results.notes.push(format!(
            "the speed is {initial:.3} m/s when braking begins, but its mean over the previous {BEFORE} s is {mean:.3} \
             m/s; all metrics are equally uncertain. Record `vehicle.speed`, or filter the recording"
        ));
    }
    results.set("initial_speed", initial);
    if initial <= STOP {
        return Err(format!("the vehicle is not faster than {STOP} m/s when it begins to brake"));
    }
    let fall = |level: f64| {
        ground
            .falls_to(rows, level, first)
            .ok_or_else(|| format!("the speed over ground does not fall to {level:.3} m/s after braking begins"))
    };
    let mfdd = fall(FROM * initial).and_then(|begin| {
        let (high, low) = (FROM * initial, TO * initial);
        Ok((high * high - low * low) / (2.0 * (fall(low)?.way - begin.way)))
    });
    results.set("mfdd", mfdd);
    let stop = fall(STOP);
    results.set("distance", stop.clone().map(|stop| stop.way - ground.way[first]));
    results.set("time", stop.clone().map(|stop| stop.time - rows.times[first]));

    let until_stop = |x: Result<Vec<f64>, Reason>| {
        let (x, stop) = (x?, stop.clone()?);
        largest_magnitude(&x[first..stop.row]).ok_or_else(|| "the vehicle does not move when braking begins".to_owned())
    };
    let yaw = rows.column("vehicle.yaw");
    let offset = yaw.clone().and_then(|yaw| {
        let [x, y] = ["vehicle.position_x", "vehicle.position_y"].map(|column| rows.column(column));
        let (x, y, (sin, cos)) = (x?, y?, sin_cos(yaw[first]));
        Ok(x.iter().zip(y).map(|(px, py)| (py - y[first]) * cos - (px - x[first]) * sin).collect())
    });
    results.set("lateral_peak", until_stop(offset));
    results.set("yaw_peak", until_stop(yaw.map(|yaw| yaw.iter().map(|angle| angle - yaw[first]).collect())));
    let wheel = steering_wheel(rows, options);
    results.set("steering_wheel_peak", until_stop(wheel.clone().map(|angle| angle.into_owned())));

    let has_stopped = stop.is_ok();
    let peak_within = |x: &[f64], span: f64| {
        let end = end_of_span(rows, first, span, has_stopped)?;
        largest_magnitude(&x[first..end]).ok_or_else(no_rows)
    };
    results.set("yaw_rate_peak_1s", rows.column("vehicle.yaw_rate").and_then(|rate| peak_within(rate, 1.0)));
    results.set("steering_wheel_peak_2s", wheel.and_then(|angle| peak_within(&angle, 2.0)));
    Ok(())
}

/// The last row before the brake pedal rises above 0.
pub(super) fn before_braking(rows: &Rows<'_>) -> Result<usize, Reason> {
    match rows.column("driver.brake")?.iter().position(|pedal| *pedal > 0.0) {
        None => Err("`driver.brake` is never above 0".to_owned()),
        Some(0) => {
            Err("`driver.brake` is above 0 in the first row, so the start of braking is not recorded".to_owned())
        }
        Some(row) => Ok(row - 1),
    }
}

/// The first row after a duration of `span` (s) from the row `first`. The recording may end earlier only if the
/// maneuver `is_over`.
pub(super) fn end_of_span(rows: &Rows<'_>, first: usize, span: f64, is_over: bool) -> Result<usize, Reason> {
    let limit = rows.times[first] + span;
    let end = rows.times.partition_point(|time| rows.is_until(*time, limit));
    let ends_early = end == rows.times.len() && !rows.is_until(limit, rows.times[end - 1]);
    if ends_early && !is_over {
        return Err(format!("the recording ends less than {span} s after braking begins"));
    }
    Ok(end)
}

/// Motion over ground.
struct Ground {
    /// Distance traveled, m.
    way: Vec<f64>,
    speed: Vec<f64>,
}

/// The point at which the speed falls to a level.
#[derive(Clone, Copy)]
struct Fall {
    /// The first row at or below the level.
    row: usize,
    time: f64,
    way: f64,
}

impl Ground {
    fn new(rows: &Rows<'_>) -> Result<Self, Reason> {
        let [x, y] = ["vehicle.position_x", "vehicle.position_y"].map(|column| rows.column(column));
        let (x, y) = (x?, y?);
        let mut way = vec![0.0; x.len()];
        let mut speed = vec![0.0; x.len()];
        for row in 1..x.len() {
            way[row] = way[row - 1] + hypot(x[row] - x[row - 1], y[row] - y[row - 1]);
            speed[row] = (way[row] - way[row - 1]) * rows.rate;
        }
        speed[0] = speed[1];
        Ok(Self { way, speed })
    }

    /// Computes the motion from the speed.
    fn of_speed(rows: &Rows<'_>, speed: &[f64]) -> Self {
        let mut way = vec![0.0; speed.len()];
        for row in 1..speed.len() {
            way[row] = way[row - 1] + 0.5 * (speed[row] + speed[row - 1]) * (rows.times[row] - rows.times[row - 1]);
        }
        Self { way, speed: speed.to_vec() }
    }

    /// Returns both speeds in a row if they, or the distances up to the row, differ by more than [`DISAGREEMENT`].
    fn disagrees(&self, speed: &Self, row: usize) -> Option<[f64; 2]> {
        let differ = |a: f64, b: f64| (a - b).abs() > DISAGREEMENT * b.abs();
        let is_off = differ(self.speed[row], speed.speed[row]) || differ(self.way[row], speed.way[row]);
        is_off.then_some([self.speed[row], speed.speed[row]])
    }

    /// The mean speed in the last [`BEFORE`] seconds before a row; `None` if the recording begins later.
    fn mean_before(&self, rows: &Rows<'_>, row: usize) -> Option<f64> {
        let from = rows.times[..row].iter().rposition(|time| rows.times[row] - time >= BEFORE)?;
        Some((self.way[row] - self.way[from]) / (rows.times[row] - rows.times[from]))
    }

    /// The first point after a row at which the speed falls to a level, interpolated.
    fn falls_to(&self, rows: &Rows<'_>, level: f64, after: usize) -> Option<Fall> {
        let speed = &self.speed;
        let row = (after + 1..speed.len()).find(|row| speed[row - 1] > level && speed[*row] <= level)?;
        let share = (speed[row - 1] - level) / (speed[row - 1] - speed[row]);
        let time = rows.times[row - 1] + share * (rows.times[row] - rows.times[row - 1]);
        Some(Fall { row, time, way: at(rows.times, &self.way, time)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Value;
    use crate::trace::Trace;
    use serde_json::json;

    const STEP: f64 = 0.001;

    /// Evaluates a vehicle that decelerates constantly from 0.5 s on and drives in the direction `course`, rad.
    fn evaluate(speed: f64, deceleration: f64, course: f64) -> super::super::Evaluation {
        let times: Vec<f64> = (1..=6_000).map(|k| f64::from(k) * STEP).collect();
        let way = |time: f64| {
            let braking = (time - 0.5).clamp(0.0, speed / deceleration);
            speed * time.min(0.5) + speed * braking - 0.5 * deceleration * braking * braking
        };
        let (sin, cos) = sin_cos(course);
        let column = |of: &dyn Fn(f64) -> f64| times.iter().map(|time| of(*time)).collect::<Vec<_>>();
        // The pedal position in each row is the one held during the preceding step.
        let trace = Trace::new(times.clone()).with("driver.brake", column(&|t| f64::from(t > 0.5005))).unwrap();
        let trace = trace.with("vehicle.position_x", column(&|t| way(t) * cos)).unwrap();
        let trace = trace.with("vehicle.position_y", column(&|t| way(t) * sin)).unwrap();
        let trace = trace.with("vehicle.yaw", vec![course; 6_000]).unwrap();
        EVALUATOR.evaluate(&trace, &json!({})).unwrap()
    }

    fn number(evaluation: &super::super::Evaluation, name: &str) -> f64 {
        match evaluation.value(name) {
            Some(Value::Number(number)) => *number,
            other => panic!("{name}: {other:?}"),
        }
    }

    /// Check number: 8.00256 m/s2 for a deceleration of 8 m/s2 from 27.8 m/s. It is not exactly 8 m/s2, because the
    /// speed computed for a row is the speed in the middle of the preceding step. Tolerance: half of the last digit.
    #[test]
    fn a_constant_deceleration() {
        for course in [0.0, 2.0, -0.7] {
            let evaluation = evaluate(27.8, 8.0, course);
            let mfdd = number(&evaluation, "mfdd");
            assert!((mfdd - 8.002_56).abs() < 5e-6, "{mfdd}");
            assert!((number(&evaluation, "initial_speed") - 27.8).abs() < 1e-9);
            // Closed form. The computed speed reaches 0.2 m/s half a step late.
            assert!((number(&evaluation, "distance") - (27.8 * 27.8 - 0.04) / 16.0).abs() < 2e-4);
            assert!((number(&evaluation, "time") - (27.8 - 0.2) / 8.0 - 0.0005).abs() < 1e-6);
            assert!(number(&evaluation, "lateral_peak") < 1e-12);
        }
    }

    /// Reference: closed form for 27.8 m/s and 8 m/s2. Noise of 1 cm at 1 kHz adds about 18 m/s to the speed from the
    /// positions.
    #[test]
    fn noise_of_positions_does_not_add_to_the_speed() {
        let times: Vec<f64> = (1..=6_000).map(|k| f64::from(k) * STEP).collect();
        let speed = |time: f64| (27.8 - 8.0 * (time - 0.5).max(0.0)).max(0.0);
        let way = |time: f64| {
            let braking = (time - 0.5).clamp(0.0, 27.8 / 8.0);
            27.8 * time.min(0.5) + 27.8 * braking - 4.0 * braking * braking
        };
        let column = |of: &dyn Fn(f64) -> f64| times.iter().map(|time| of(*time)).collect::<Vec<_>>();
        let evaluated = |amplitude: f64, speed: Option<&dyn Fn(f64) -> f64>| {
            let noise = |time: f64| amplitude * sin_cos(1e6 * time).0;
            let trace = Trace::new(times.clone()).with("driver.brake", column(&|t| f64::from(t > 0.5005))).unwrap();
            let trace = trace.with("vehicle.position_x", column(&|t| way(t) + noise(t))).unwrap();
            let trace = trace.with("vehicle.position_y", column(&|t| noise(t + 7.0))).unwrap();
            let speed = speed.map(|speed| trace.clone().with("vehicle.speed", column(speed)).unwrap());
            EVALUATOR.evaluate(&speed.unwrap_or(trace), &json!({})).unwrap()
        };
        let noisy = |speed| evaluated(0.01, speed);
        let evaluation = noisy(Some(&speed));
        assert_eq!(number(&evaluation, "initial_speed"), 27.8);
        let distance = number(&evaluation, "distance");
        assert!((distance - (27.8 * 27.8 - 0.04) / 16.0).abs() < 2e-4, "{distance}");
        assert!((number(&evaluation, "mfdd") - 8.0).abs() < 1e-3);
        assert_eq!(evaluation.notes.len(), 1);
        // Without `vehicle.speed`, the mean speed over several rows reveals the noise of the positions.
        let notes = noisy(None).notes;
        assert!(matches!(&notes[..], [note] if note.starts_with("the speed is ")), "{notes:?}");
        // A ratio of 3.6 indicates km/h.
        let in_kilometers = evaluated(0.0, Some(&|time| 3.6 * speed(time)));
        let Some(Value::Null(reason)) = in_kilometers.value("mfdd") else { panic!("{:?}", in_kilometers.metrics) };
        assert!(reason.to_string().contains("as if it were in km/h: specify the units of the columns"), "{reason}");
        let with_gap = noisy(Some(&|time| if (5.0..5.002).contains(&time) { f64::NAN } else { speed(time) }));
        assert!(with_gap.notes[0].starts_with("`vehicle.speed` is not a finite number at 5"), "{:?}", with_gap.notes);
        let clean = evaluate(27.8, 8.0, 0.0);
        assert!(clean.notes.is_empty());
    }

    #[test]
    fn without_a_stop_there_is_no_distance() {
        let evaluation = evaluate(27.8, 4.0, 0.0);
        assert!((number(&evaluation, "initial_speed") - 27.8).abs() < 1e-9);
        for name in ["mfdd", "distance", "time", "lateral_peak", "yaw_peak"] {
            let Some(Value::Null(reason)) = evaluation.value(name) else { panic!("{name}") };
            assert!(reason.to_string().starts_with("the speed over ground does not fall to "), "{name}: {reason}");
        }
    }

    #[test]
    fn the_begin_of_braking_is_recorded() {
        for (pedal, expected) in [(1.0, "is above 0 in the first row"), (0.0, "is never above 0")] {
            let trace = Trace::new(vec![0.0, 0.1]).with("driver.brake", vec![pedal; 2]).unwrap();
            let evaluation = EVALUATOR.evaluate(&trace, &json!({})).unwrap();
            let Some(Value::Null(reason)) = evaluation.value("mfdd") else { panic!() };
            assert!(reason.to_string().contains(expected), "{reason}");
        }
    }
}
