//! Sine with dwell: stability and responsiveness.

use super::steering_wheel::RATIO;
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, at, derivative, largest, largest_magnitude, lowpass, mean, no_rows, sign, smallest, up};
use crate::options::Options;

/// Cutoff frequencies of steering angle and motion, Hz.
const STEER_CUTOFF: f64 = 10.0;
const MOTION_CUTOFF: f64 = 6.0;
/// Half of the duration over which the steering wheel rate is averaged, s.
const RATE_SPAN: f64 = 0.05;
/// The maneuver begins when the steering wheel rate exceeds `RATE`, deg/s, for `RATE_TIME`, s.
const RATE: f64 = 75.0;
const RATE_TIME: f64 = 0.2;
/// Duration before the maneuver over which offsets are averaged, s.
const ZEROING: f64 = 1.0;
/// Steering wheel angle at the beginning of steer, deg.
const BEGINNING: f64 = 5.0;
/// Time in which the steering wheel has to return from half of its second amplitude to 0, s. Otherwise, the steering is
/// complete at `COMPLETION_SHARE` of the second amplitude.
const COMPLETION_TIME: f64 = 0.5;
const COMPLETION_SHARE: f64 = 0.01;
/// Time after the beginning of steer at which the lateral displacement is evaluated, s.
const DISPLACEMENT_TIME: f64 = 1.07;
/// Times after the completion of steer, s, and limits for the magnitude of the yaw rate ratio at these times.
const RATIOS: [(f64, f64); 2] = [(1.0, 0.35), (1.75, 0.20)];
/// Mass up to which the larger displacement is required, kg, and the displacements up to and above this mass, m.
const LIGHT: f64 = 3500.0;
const DISPLACEMENTS: [f64; 2] = [1.83, 1.52];

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "sine_with_dwell",
    title: "Sine with dwell",
    source: "FMVSS 126, UN R140",
    columns: &[
        Column::needed("driver.steer", "rad"),
        Column::optional("vehicle.yaw_rate", "rad/s"),
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("vehicle.sideslip", "rad"),
    ],
    options: &[RATIO],
    metrics: &[
        Definition::neutral("bos", "Beginning of steer", "s")
            .is("Time when the steering wheel angle reaches 5 deg, interpolated. The angle is filtered at 10 Hz, yaw rate and lateral acceleration at 6 Hz; \
             their means over the second before the maneuver are subtracted; all are positive in the direction of the first steering."),
        Definition::neutral("cos", "Completion of steer", "s")
            .is("Time when the steering wheel returns to 0 after the dwell. If the return from half of the second amplitude takes more than 0.5 s, the time when the steering wheel reaches 1 % of the second amplitude."),
        Definition::neutral("direction", "Direction", "1").is("Direction of the first steering: 1 left, -1 right."),
        Definition::neutral("amplitude", "Amplitude", "deg").is("Largest magnitude of the steering wheel angle."),
        Definition::neutral("first_peak_yaw_rate", "First peak of the yaw rate", "rad/s")
            .is("Largest yaw rate from the beginning of steer until the angle is negative."),
        Definition::neutral("second_peak_yaw_rate", "Second peak of the yaw rate", "rad/s")
            .is("Magnitude of the first minimum of the yaw rate below 0 after the angle has become negative."),
        Definition::neutral("second_peak_time", "Time of the second peak", "s")
            .is("Time of the row of the second peak."),
        Definition::neutral("yaw_rate_ratio_1s", "Yaw rate ratio after 1 s", "1")
            .is("Yaw rate 1 s after the completion of steer, divided by the yaw rate at the second peak."),
        Definition::neutral("yaw_rate_ratio_1_75s", "Yaw rate ratio after 1.75 s", "1").is("The same after 1.75 s."),
        Definition::neutral("lateral_displacement", "Lateral displacement", "m")
            .is("Lateral acceleration integrated twice over the 1.07 s after the beginning of steer, starting at 0."),
        Definition::lower("sideslip_peak", "Peak of the sideslip angle", "rad")
            .is("Largest magnitude of the unfiltered sideslip angle after the maneuver begins."),
        Definition::neutral("stable", "Stable", "1")
            .is("True if the magnitude of the yaw rate ratio is at most 0.35 after 1 s and at most 0.20 after 1.75 s."),
    ],
    compute,
};

/// Required lateral displacement, m, for a vehicle mass, kg. The limit applies to amplitudes of at least 5 A.
pub(crate) fn least_displacement(mass: f64) -> f64 {
    if mass <= LIGHT { DISPLACEMENTS[0] } else { DISPLACEMENTS[1] }
}

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let ratio = options.number("steer.ratio");
    let degrees: Vec<f64> = rows.column("driver.steer")?.iter().map(|angle| (angle * ratio).to_degrees()).collect();
    let angle = lowpass(&degrees, STEER_CUTOFF, rows.rate)?;
    let zeroing = Zeroing::new(rows, &angle)?;
    results.set("direction", zeroing.direction);
    results.set(
        "sideslip_peak",
        rows.column("vehicle.sideslip")
            .and_then(|sideslip| largest_magnitude(&sideslip[zeroing.row..]).ok_or_else(no_rows)),
    );
    let angle = zeroing.apply(angle);
    results.set("amplitude", largest_magnitude(&angle).unwrap_or(f64::NAN));
    let motion = |column| Ok(zeroing.apply(lowpass(rows.column(column)?, MOTION_CUTOFF, rows.rate)?));

    let begin = beginning(rows, &angle, zeroing.row)?;
    results.set("bos", begin.time);
    let displacement =
        motion("vehicle.lateral_acceleration").and_then(|acceleration| displacement(rows, &acceleration, begin));
    results.set("lateral_displacement", displacement);
    let completion = completion(rows, &angle, begin.row);
    results.set("cos", completion.clone());

    let yaw_rate = motion("vehicle.yaw_rate");
    let negative = (begin.row..angle.len()).find(|row| angle[*row] < 0.0);
    let negative = negative.ok_or_else(|| "the steering wheel angle does not become negative".to_owned());
    let both = yaw_rate.clone().and_then(|yaw_rate| Ok((yaw_rate, negative?)));
    let first = both.clone().and_then(|(yaw_rate, negative)| {
        largest(&yaw_rate[begin.row..negative]).ok_or_else(|| "the steering wheel angle is never positive".to_owned())
    });
    results.set("first_peak_yaw_rate", first);
    let second = both.and_then(|(yaw_rate, negative)| second_peak(&yaw_rate, negative).map(|row| (row, yaw_rate[row])));
    results.set("second_peak_yaw_rate", second.clone().map(|(_, peak)| -peak));
    results.set("second_peak_time", second.clone().map(|(row, _)| rows.times[row]));

    let ratio = |after: f64| {
        let (yaw_rate, (_, peak), completion) = (yaw_rate.clone()?, second.clone()?, completion.clone()?);
        let value = at(rows.times, &yaw_rate, completion + after);
        let value =
            value.ok_or_else(|| format!("the recording ends less than {after} s after the completion of steer"));
        Ok(value? / peak)
    };
    let ratios = RATIOS.map(|(after, limit)| (ratio(after), limit));
    results.set("yaw_rate_ratio_1s", ratios[0].0.clone());
    results.set("yaw_rate_ratio_1_75s", ratios[1].0.clone());
    results.set("stable", is_stable(ratios));
    Ok(())
}

/// True if all ratios are within their limits; false if one exceeds its limit, even if the other is missing.
fn is_stable(ratios: [(Result<f64, Reason>, f64); 2]) -> Result<bool, Reason> {
    let exceeds = |(ratio, limit): &(Result<f64, Reason>, f64)| ratio.as_ref().is_ok_and(|ratio| ratio.abs() > *limit);
    if ratios.iter().any(exceeds) {
        return Ok(false);
    }
    ratios.into_iter().try_for_each(|(ratio, _)| ratio.map(drop))?;
    Ok(true)
}

/// Beginning of the maneuver, rows that determine the offsets, and direction of the first steering.
struct Zeroing {
    row: usize,
    /// Number of rows before the maneuver whose mean is the offset.
    count: usize,
    direction: f64,
}

impl Zeroing {
    fn new(rows: &Rows<'_>, angle: &[f64]) -> Result<Self, Reason> {
        let rate = smoothed(&derivative(angle, rows.rate), rows.count(RATE_SPAN));
        let lasting = rows.count(RATE_TIME).saturating_add(1);
        // Number of consecutive fast rows up to each row.
        let mut fast = 0;
        let end = rate.iter().position(|rate| {
            fast = if rate.abs() > RATE { fast + 1 } else { 0 };
            fast == lasting
        });
        let Some(end) = end else {
            return Err(format!(
                "the steering wheel is never faster than {RATE} deg/s for {RATE_TIME} s: the maneuver does not begin"
            ));
        };
        let row = end + 1 - lasting;
        Ok(Self { row, count: rows.count(ZEROING).min(row), direction: sign(rate[row]) })
    }

    /// Subtracts the offset, and changes the sign if the first steering is to the right.
    fn apply(&self, mut x: Vec<f64>) -> Vec<f64> {
        let offset = mean(&x[self.row - self.count..self.row]).unwrap_or(0.0);
        x.iter_mut().for_each(|x| *x = self.direction * (*x - offset));
        x
    }
}

/// Moving average over the rows k - half … k + half, as far as they exist.
fn smoothed(x: &[f64], half: usize) -> Vec<f64> {
    let mean = |row: usize| {
        let span = &x[row.saturating_sub(half)..row.saturating_add(half).saturating_add(1).min(x.len())];
        span.iter().sum::<f64>() / span.len() as f64
    };
    (0..x.len()).map(mean).collect()
}

/// Beginning of steer: the time, and the first row at or after it.
#[derive(Clone, Copy)]
struct Beginning {
    time: f64,
    row: usize,
}

fn beginning(rows: &Rows<'_>, angle: &[f64], from: usize) -> Result<Beginning, Reason> {
    let reached = (from..angle.len()).find(|row| angle[*row] >= BEGINNING);
    let reached = reached.ok_or_else(|| format!("the steering wheel does not reach {BEGINNING} deg"))?;
    let before = (0..reached).rev().find(|row| angle[*row] < BEGINNING);
    let before = before.ok_or_else(|| format!("the steering wheel is beyond {BEGINNING} deg from the first row on"))?;
    let share = (BEGINNING - angle[before]) / (angle[before + 1] - angle[before]);
    let time = rows.times[before] + share * (rows.times[before + 1] - rows.times[before]);
    Ok(Beginning { time, row: before + 1 })
}

/// Time of the completion of steer.
fn completion(rows: &Rows<'_>, angle: &[f64], begin: usize) -> Result<f64, Reason> {
    let minimum = smallest(&angle[begin..]).filter(|minimum| *minimum < 0.0);
    let minimum = minimum.ok_or_else(|| "the steering wheel angle does not become negative".to_owned())?;
    let dwell = (begin..angle.len()).rev().find(|row| angle[*row] <= 0.5 * minimum).unwrap_or(begin);
    let limit = dwell.saturating_add(rows.count(COMPLETION_TIME));
    let back = up(rows.times, angle, 0.0, dwell).filter(|crossing| crossing.row <= limit);
    let back = back.or_else(|| up(rows.times, angle, COMPLETION_SHARE * minimum, dwell));
    Ok(back.ok_or_else(|| "the steering wheel does not return to 0".to_owned())?.time)
}

/// The row of the second peak; `negative` is the row in which the steering angle becomes negative.
fn second_peak(yaw_rate: &[f64], negative: usize) -> Result<usize, Reason> {
    let is_peak =
        |row: &usize| yaw_rate[*row] < 0.0 && yaw_rate[*row] <= yaw_rate[row - 1] && yaw_rate[*row] < yaw_rate[row + 1];
    let mut later = negative + 1..yaw_rate.len().saturating_sub(1);
    later.find(is_peak).ok_or_else(|| "the yaw rate has no second peak".to_owned())
}

/// Lateral displacement 1.07 s after the beginning of steer, m.
fn displacement(rows: &Rows<'_>, acceleration: &[f64], begin: Beginning) -> Result<f64, Reason> {
    let end = begin.time + DISPLACEMENT_TIME;
    let value = |time| {
        at(rows.times, acceleration, time)
            .ok_or_else(|| format!("the recording ends less than {DISPLACEMENT_TIME} s after the beginning of steer"))
    };
    let inner = (begin.row..rows.times.len()).map(|row| (rows.times[row], acceleration[row]));
    let inner = inner.filter(|(time, _)| *time > begin.time && *time < end);
    let (mut time, mut acceleration) = (begin.time, value(begin.time)?);
    let (mut velocity, mut displacement) = (0.0, 0.0);
    for (next, value) in inner.chain([(end, value(end)?)]) {
        let span = next - time;
        let faster = velocity + 0.5 * span * (acceleration + value);
        displacement += 0.5 * span * (velocity + faster);
        (time, acceleration, velocity) = (next, value, faster);
    }
    Ok(displacement)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Value;
    use crate::trace::Trace;
    use fmu_math::sin;
    use serde_json::json;
    use std::f64::consts::PI;

    const STEP: f64 = 0.001;

    /// Steering wheel angle, deg: a sine of 0.7 Hz with a dwell of 0.5 s, from 1 s on.
    fn steering(time: f64) -> f64 {
        let (period, dwell) = (1.0 / 0.7, 0.5);
        let phase = match time - 1.0 {
            t if t < 0.0 => return 0.0,
            t if t < 0.75 * period => t / period,
            t if t < 0.75 * period + dwell => 0.75,
            t if t < period + dwell => (t - dwell) / period,
            _ => return 0.0,
        };
        100.0 * sin(2.0 * PI * phase)
    }

    /// Evaluates a vehicle with the given yaw rate and a constant lateral acceleration from 1 s on.
    fn evaluate(sign: f64, yaw_rate: impl Fn(f64) -> f64, acceleration: f64) -> super::super::Evaluation {
        let times: Vec<f64> = (1..=6_000).map(|k| f64::from(k) * STEP).collect();
        let column = |of: &dyn Fn(f64) -> f64| times.iter().map(|time| sign * of(*time)).collect::<Vec<_>>();
        let steer = column(&|time| (steering(time) / 16.0).to_radians());
        let yaw_rates = column(&yaw_rate);
        let accelerations = column(&|time| if time > 1.0 { acceleration } else { 0.0 });
        let trace = Trace::new(times.clone()).with("driver.steer", steer).unwrap();
        let trace = trace.with("vehicle.yaw_rate", yaw_rates).unwrap();
        let trace = trace.with("vehicle.lateral_acceleration", accelerations).unwrap();
        EVALUATOR.evaluate(&trace, &json!({"steer.ratio": 16.0})).unwrap()
    }

    fn number(evaluation: &super::super::Evaluation, name: &str) -> f64 {
        match evaluation.value(name) {
            Some(Value::Number(number)) => *number,
            other => panic!("{name}: {other:?}"),
        }
    }

    /// Yaw rate: -1 at the second peak, then constant around 1 s and 1.75 s after the steering, which ends at 2.929 s.
    /// The low-pass filter does not change constant values.
    fn yaw_rate(first: f64, second: f64) -> impl Fn(f64) -> f64 {
        move |time| match time {
            t if t < 3.0 => steering(t) / 100.0,
            t if t < 4.35 => -first,
            _ => -second,
        }
    }

    /// Ratios just below and above each limit. Tolerance: the low-pass filter changes the second peak, a smooth sine,
    /// by 1e-3.
    #[test]
    fn stability_is_decided_by_both_ratios() {
        for sign in [1.0, -1.0] {
            for (first, second, expected) in [
                (0.34, 0.19, true),
                (0.36, 0.19, false),
                (0.34, 0.21, false),
                (-0.34, -0.19, true),
                (-0.36, -0.19, false),
                (-0.34, -0.21, false),
            ] {
                let evaluation = evaluate(sign, yaw_rate(first, second), 1.0);
                assert_eq!(number(&evaluation, "direction"), sign);
                let [one, two] = ["yaw_rate_ratio_1s", "yaw_rate_ratio_1_75s"].map(|name| number(&evaluation, name));
                assert!((one - first).abs() < 3e-3 && (two - second).abs() < 3e-3, "{one} {two}");
                assert_eq!(evaluation.value("stable"), Some(&Value::Boolean(expected)), "{first} {second}");
            }
        }
    }

    #[test]
    fn one_ratio_beyond_its_limit_is_enough() {
        let missing = || Err("the recording ends".to_owned());
        assert_eq!(is_stable([(Ok(0.36), 0.35), (missing(), 0.2)]), Ok(false));
        assert!(is_stable([(Ok(0.35), 0.35), (missing(), 0.2)]).is_err());
        assert_eq!(is_stable([(Ok(0.35), 0.35), (Ok(-0.2), 0.2)]), Ok(true));
        assert_eq!(is_stable([(Ok(f64::from_bits(0.35_f64.to_bits() + 1)), 0.35), (Ok(0.0), 0.2)]), Ok(false));
    }

    /// Closed form: a constant lateral acceleration a gives a/2 (1.07 s)^2. The steering angle reaches 5 deg 0.0114 s
    /// after the acceleration begins. Tolerance: the low-pass filter removes part of the step.
    #[test]
    fn displacements_on_both_sides_of_each_limit() {
        for (limit, mass) in [(1.83, 3500.0), (1.52, 3501.0)] {
            for (share, expected) in [(0.97, false), (1.03, true)] {
                let acceleration = 2.0 * share * limit / (1.07 * 1.07);
                let displacement = number(&evaluate(-1.0, yaw_rate(0.0, 0.0), acceleration), "lateral_displacement");
                assert!((displacement - share * limit).abs() < 0.02 * limit, "{displacement}");
                assert_eq!(displacement >= least_displacement(mass), expected, "{displacement}");
            }
            assert_eq!(least_displacement(mass), limit);
        }
    }

    /// Closed form: the sine with an amplitude of 100 deg reaches 5 deg at asin(0.05)/(2 pi 0.7 Hz) and returns to 0 at
    /// 1/0.7 Hz + 0.5 s. Tolerance: the 10 Hz filter smooths the end of the sine over a fraction of 0.1 s.
    #[test]
    fn beginning_and_completion_of_steer() {
        let evaluation = evaluate(1.0, yaw_rate(0.0, 0.0), 1.0);
        assert!((number(&evaluation, "bos") - 1.0 - 0.05_f64.asin() / (2.0 * PI * 0.7)).abs() < 2e-3);
        assert!((number(&evaluation, "cos") - 1.0 - (1.0 / 0.7 + 0.5)).abs() < 0.02);
        assert!((number(&evaluation, "amplitude") - 100.0).abs() < 1.0);
    }

    #[test]
    fn a_maneuver_that_does_not_begin_has_a_reason() {
        let times: Vec<f64> = (1..=6_000).map(|k| f64::from(k) * STEP).collect();
        let trace = Trace::new(times).with("driver.steer", vec![0.01; 6_000]).unwrap();
        let evaluation = EVALUATOR.evaluate(&trace, &json!({"steer.ratio": 16.0})).unwrap();
        let Some(Value::Null(reason)) = evaluation.value("stable") else { panic!() };
        assert!(reason.to_string().contains("the maneuver does not begin"));
    }
}
