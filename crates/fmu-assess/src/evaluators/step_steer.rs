//! Step steer: gains, response times and overshoot.

use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, first_largest, mean, sign, up};
use crate::options::Options;

/// Duration at the end of the recording over which steady values are averaged, s.
const STEADY: f64 = 1.0;
/// Fraction of the steady value that ends the response time.
const RESPONSE: f64 = 0.9;

/// Evaluated responses: name of the group of metrics, column.
const RESPONSES: [(&str, &str); 3] =
    [("yaw_rate", "vehicle.yaw_rate"), ("lateral_acceleration", "vehicle.lateral_acceleration"), ("roll", "body.roll")];

/// The table of metrics: the metrics of the maneuver, and six metrics for each response.
macro_rules! metrics {
    ($first:expr, $second:expr, [$($group:literal $title:literal $unit:literal $gain:literal)*], $($last:expr),*) => {
        &[
            $first,
            $second,
            $(
                Definition::neutral(concat!($group, ".steady"), concat!($title, ", steady"), $unit)
                    .is("Mean of the last second, positive in the direction of the steering angle."),
                Definition::neutral(concat!($group, ".gain"), concat!($title, ", gain"), $gain)
                    .is("Steady value divided by the steady steering angle."),
                Definition::neutral(concat!($group, ".peak"), concat!($title, ", peak"), $unit)
                    .is("Largest value from the step on."),
                Definition::neutral(concat!($group, ".response_time"), concat!($title, ", response time"), "s")
                    .is("Time from t0 until the signal rises to 90 % of its steady value."),
                Definition::neutral(concat!($group, ".peak_response_time"), concat!($title, ", peak response time"), "s")
                    .is("Time from t0 to the first row of the peak."),
                Definition::lower(concat!($group, ".overshoot"), concat!($title, ", overshoot"), "1")
                    .is("Peak minus steady value, divided by the steady value."),
            )*
            $($last),*
        ]
    };
}

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "step_steer",
    title: "Step steer",
    source: "ISO 7401",
    columns: &[
        Column::needed("driver.steer", "rad"),
        Column::optional("vehicle.yaw_rate", "rad/s"),
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("body.roll", "rad"),
        Column::optional("vehicle.sideslip", "rad"),
    ],
    options: &[],
    metrics: metrics!(
        Definition::neutral("t0", "Time of the step", "s")
            .is("Time when the steering angle rises to half of its steady magnitude, interpolated. Signals are not filtered."),
        Definition::neutral("steer", "Steering angle", "rad")
            .is("Magnitude of the mean steering angle of the last second."),
        [
            "yaw_rate" "Yaw rate" "rad/s" "1/s"
            "lateral_acceleration" "Lateral acceleration" "m/s2" "m/(s2.rad)"
            "roll" "Roll angle" "rad" "1"
        ],
        Definition::neutral("sideslip", "Sideslip angle, steady", "rad")
            .is("Mean of the last second, positive in the direction of the steering angle."),
        Definition::lower("tb_factor", "TB factor", "rad.s")
            .is("Peak response time of the yaw rate times the magnitude of the steady sideslip angle.")
    ),
    compute,
};

fn compute(rows: &Rows<'_>, _: &Options, results: &mut Results) -> Result<(), Reason> {
    let steer = rows.column("driver.steer")?;
    let steady = steady(rows, steer)?;
    let sign = sign(steady);
    if sign == 0.0 {
        return Err("`driver.steer` has a mean of 0 over the last second, so the file contains no step".to_owned());
    }
    let magnitude = sign * steady;
    results.set("steer", magnitude);
    let turned = |column| -> Result<Vec<f64>, Reason> { Ok(rows.column(column)?.iter().map(|x| sign * x).collect()) };
    let step = up(rows.times, &turned("driver.steer")?, 0.5 * magnitude, 0)
        .ok_or_else(|| "`driver.steer` does not rise to half of its steady value".to_owned());
    let step = step.map(|crossing| (crossing.time, crossing.row));
    results.set("t0", step.clone().map(|(time, _)| time));
    let mut peak_time = Err("the yaw rate has no peak response time".to_owned());
    for (group, column) in RESPONSES {
        let response = turned(column).and_then(|x| Response::new(rows, &x, magnitude, &step));
        let mut set = |name: &str, value: Result<f64, Reason>| results.set(&format!("{group}.{name}"), value);
        let of = |part: fn(&Response) -> Result<f64, Reason>| response.as_ref().map_err(Clone::clone).and_then(part);
        set("steady", of(|response| Ok(response.steady)));
        set("gain", of(|response| Ok(response.gain)));
        set("peak", of(|response| response.peak.clone().map(|peak| peak.value)));
        set("response_time", of(|response| response.time.clone()));
        set("peak_response_time", of(|response| response.peak.clone().map(|peak| peak.time)));
        set("overshoot", of(|response| response.peak.clone().map(|peak| peak.overshoot)));
        if group == "yaw_rate" {
            peak_time = response.and_then(|response| response.peak).map(|peak| peak.time);
        }
    }
    let sideslip = turned("vehicle.sideslip").and_then(|sideslip| self::steady(rows, &sideslip));
    results.set("sideslip", sideslip.clone());
    results.set("tb_factor", peak_time.and_then(|time| Ok(time * sideslip?.abs())));
    Ok(())
}

/// Response of a signal to the steering angle.
struct Response {
    steady: f64,
    gain: f64,
    peak: Result<Peak, Reason>,
    time: Result<f64, Reason>,
}

#[derive(Clone)]
struct Peak {
    value: f64,
    /// Time after the step, s.
    time: f64,
    overshoot: f64,
}

impl Response {
    /// Evaluates a signal that is positive in the direction of the steering angle.
    fn new(rows: &Rows<'_>, x: &[f64], steer: f64, step: &Result<(f64, usize), Reason>) -> Result<Self, Reason> {
        let steady = steady(rows, x)?;
        let after = step.clone().and_then(|step| {
            if steady > 0.0 {
                Ok(step)
            } else {
                Err("the steady value is not in the direction of the steering angle".to_owned())
            }
        });
        let peak = after.clone().map(|(begin, row)| {
            let from = row.saturating_sub(1);
            let peak = from + first_largest(&x[from..]).unwrap_or(0);
            Peak { value: x[peak], time: rows.times[peak] - begin, overshoot: (x[peak] - steady) / steady }
        });
        let time = after.and_then(|(begin, row)| {
            let reached = up(rows.times, x, RESPONSE * steady, row.saturating_sub(2));
            let reached =
                reached.ok_or_else(|| "the signal does not rise to 90 % of its steady value after the step".to_owned());
            Ok(reached?.time - begin)
        });
        Ok(Self { steady, gain: steady / steer, peak, time })
    }
}

/// Mean of the last second.
fn steady(rows: &Rows<'_>, x: &[f64]) -> Result<f64, Reason> {
    let begin = x.len().checked_sub(rows.count(STEADY));
    let last = begin.and_then(|begin| mean(&x[begin..]));
    last.ok_or_else(|| "the recording is shorter than 1 s, over which steady values are averaged".to_owned())
}
