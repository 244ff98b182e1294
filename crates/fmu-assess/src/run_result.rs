//! Result of a run: how it ended, and its recording.

use crate::Trace;
use crate::run_spec::{EndAt, RunSpec};
use crate::wiring::STEP;
use fmu_system::master::Recording;

/// Yaw rate above which a simulation has diverged, rad/s.
const DIVERGED: f64 = 50.0;
/// Roll angle above which a vehicle has rolled over, rad.
pub(crate) const ROLLED_OVER: f64 = 0.8;
/// A vehicle spins if its sideslip angle, rad, and its speed over ground, m/s, exceed these values.
const SPUN: (f64, f64) = (0.7, 3.0);

#[derive(Debug)]
pub(crate) struct RunResult {
    pub(crate) spec: RunSpec,
    pub(crate) trace: Trace<'static>,
    /// `spun`, `rolled_over`, `lost`, `not_finished`, `not_settled`, `diverged`.
    pub(crate) flags: Vec<&'static str>,
    pub(crate) stop_reason: String,
    /// Error, if any, with the time and the signal or call.
    pub(crate) error: Option<String>,
}

impl RunResult {
    /// A run that recorded nothing.
    pub(crate) fn failed(spec: RunSpec, message: String) -> Self {
        let stop_reason = "failed".to_owned();
        Self { spec, trace: Trace::default(), flags: vec!["diverged"], stop_reason, error: Some(message) }
    }

    pub(crate) fn has(&self, flag: &str) -> bool {
        self.flags.contains(&flag)
    }

    /// The reason if the run ended early, in which case its metrics cover only part of the maneuver.
    pub(crate) fn cut_short(&self) -> Option<String> {
        let time = self.trace.times().last().map_or_else(String::new, |time| format!(" at {} s", shown_time(*time)));
        match &self.error {
            Some(error) => Some(format!("a run failed: {error}")),
            None if self.has("rolled_over") => Some(format!("the vehicle rolled over{time}")),
            None if self.has("lost") => Some(format!("the driver lost the path{time}")),
            None if self.has("not_finished") => Some("the driver did not reach the end of the path".to_owned()),
            None => None,
        }
    }
}

/// Cuts a recording with the columns `names` where the run ends. `failure` describes the failure after the last row, if
/// any.
pub(crate) fn cut(
    spec: RunSpec,
    names: &[String],
    recording: &Recording,
    ratio: f64,
    failure: Option<String>,
) -> RunResult {
    // The first row is dropped: the driver signals in a row are those held during the preceding step, and no step
    // precedes the first row.
    let of = |name: &str| {
        let index = names.iter().position(|column| column == name)?;
        recording.column(index)?.get(1..)
    };
    let time = recording.time.get(1..).unwrap_or_default();
    let ground = ground_speed(of("vehicle.position_x"), of("vehicle.position_y"));
    let at = |column: Option<&[f64]>, row: usize| column.map_or(f64::NAN, |values| values[row]);
    let (yaw_rate, roll, sideslip) = (of("vehicle.yaw_rate"), of("body.roll"), of("vehicle.sideslip"));
    let (forward, lateral, x) = (of("vehicle.speed"), of("vehicle.lateral_acceleration"), of("vehicle.position_x"));
    let (finished, lost) = (of("path.finished"), of("path.lost"));
    let mut flags = Vec::new();
    let mut error = failure;
    let mut stop_reason = if error.is_some() { "failed".to_owned() } else { "time".to_owned() };
    let mut rows = time.len();
    let mut finished_at = None;
    let recorded: Vec<(&String, &[f64])> =
        names.iter().enumerate().filter_map(|(index, name)| Some((name, recording.column(index)?.get(1..)?))).collect();
    for row in 0..time.len() {
        let unstable = match recorded.iter().find(|(_, values)| !values[row].is_finite()) {
            Some((name, _)) => Some(format!("`{name}` is not finite")),
            None if at(yaw_rate, row).abs() > DIVERGED => Some(format!("`vehicle.yaw_rate` is above {DIVERGED} rad/s")),
            None => None,
        };
        if let Some(unstable) = unstable {
            (rows, stop_reason) = (row, "diverged".to_owned());
            error = Some(format!("{unstable} at {} s", shown_time(time[row])));
            break;
        }
        let speed = ground.as_ref().map_or_else(|| at(forward, row), |values| values[row]);
        if at(sideslip, row).abs() > SPUN.0 && speed > SPUN.1 && !flags.contains(&"spun") {
            flags.push("spun");
        }
        if finished_at.is_none() && at(finished, row) > 0.5 {
            finished_at = Some(time[row]);
        }
        let reason = if at(roll, row).abs() > ROLLED_OVER {
            flags.push("rolled_over");
            Some("rolled over")
        } else {
            spec.ends.iter().find_map(|end| {
                let (holds, reason) = match *end {
                    EndAt::LateralAcceleration(limit) => (at(lateral, row).abs() > limit, "lateral acceleration"),
                    EndAt::Finished(after) => {
                        (finished_at.is_some_and(|from| time[row] >= from + after - 0.5 * STEP), "finished")
                    }
                    EndAt::Lost => (at(lost, row) > 0.5, "lost"),
                    EndAt::Position(limit) => (at(x, row) > limit, "finished"),
                    EndAt::Speed(limit) => (at(forward, row) < limit, "speed"),
                    EndAt::GroundSpeed(limit) => (speed < limit, "stopped"),
                };
                holds.then_some(reason)
            })
        };
        if let Some(reason) = reason {
            (rows, stop_reason) = (row + 1, reason.to_owned());
            // A failure after the end of the run is ignored.
            error = None;
            break;
        }
    }
    if at_last(lost, rows) > 0.5 {
        flags.push("lost");
    }
    let is_finished = at_last(finished, rows) > 0.5;
    if spec.has_end && !is_finished {
        flags.push("not_finished");
    }
    if error.is_some() {
        flags.push("diverged");
    }
    let mut trace = Trace::new(time[..rows].to_vec());
    for (name, values) in recorded {
        let values = &values[..rows];
        if name == "driver.steer" {
            let angles: Vec<f64> = values.iter().map(|steer| ratio * steer).collect();
            trace = trace.with("driver.steering_wheel", angles).expect("a column of the recording has its rows");
        }
        trace = trace.with(name.clone(), values.to_vec()).expect("a column of the recording has its rows");
    }
    RunResult { spec, trace, flags, stop_reason, error }
}

fn at_last(column: Option<&[f64]>, rows: usize) -> f64 {
    column.zip(rows.checked_sub(1)).map_or(f64::NAN, |(values, row)| values[row])
}

/// Speed over ground, also for a car that slides sideways. The first row has the speed of the second.
fn ground_speed(x: Option<&[f64]>, y: Option<&[f64]>) -> Option<Vec<f64>> {
    let (x, y) = x.zip(y)?;
    let ways =
        x.windows(2).zip(y.windows(2)).map(|(x, y)| ((x[1] - x[0]).powi(2) + (y[1] - y[0]).powi(2)).sqrt() / STEP);
    let mut speeds: Vec<f64> = std::iter::once(0.0).chain(ways).collect();
    if speeds.len() > 1 {
        speeds[0] = speeds[1];
    }
    Some(speeds)
}

/// Removes the rounding error of accumulated steps from a time.
fn shown_time(time: f64) -> f64 {
    (time / STEP).round() / (1.0 / STEP).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wiring::Driving;

    /// A signal: name, value, and the row at which it changes to another value.
    type Signal = (&'static str, f64, Option<(usize, f64)>);

    /// Cuts a recording of 1 s. The rows of the recording begin at 0 s, those of the run one step later.
    fn run(spec: RunSpec, signals: &[Signal], failure: Option<&str>) -> RunResult {
        let rows = 1001;
        let column = |before: f64, change: Option<(usize, f64)>| {
            let of = |row| change.filter(|(from, _)| row >= *from).map_or(before, |(_, after)| after);
            Some((0..rows).map(of).collect())
        };
        let recording = Recording {
            time: (0..rows).map(|row| row as f64 * STEP).collect(),
            columns: signals.iter().map(|(_, before, change)| column(*before, *change)).collect(),
            ..Recording::default()
        };
        let names: Vec<String> = signals.iter().map(|(name, _, _)| (*name).to_owned()).collect();
        cut(spec, &names, &recording, 16.0, failure.map(str::to_owned))
    }

    fn spec() -> RunSpec {
        RunSpec::new("run", Driving::Path, 20.0, 1.0)
    }

    const CALM: Signal = ("vehicle.speed", 20.0, None);

    #[test]
    fn a_calm_run_lasts_to_its_end() {
        let result = run(spec(), &[CALM, ("driver.steer", 0.5, None)], None);
        assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (1000, "time"));
        assert_eq!((result.flags.len(), result.error), (0, None));
        assert_eq!(result.trace.column("driver.steering_wheel").unwrap()[0], 8.0);
    }

    /// Keeps the rows before the first value that is not finite.
    #[test]
    fn a_value_that_is_not_finite_ends_the_run() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let result = run(spec(), &[CALM, ("body.roll", 0.0, Some((500, value)))], None);
            assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (499, "diverged"));
            assert_eq!(result.flags, ["diverged"]);
            assert_eq!(result.error.as_deref(), Some("`body.roll` is not finite at 0.5 s"));
        }
        // If the first value is not finite, no rows remain.
        let result = run(spec(), &[("vehicle.speed", f64::NAN, None)], None);
        assert_eq!((result.trace.times().len(), result.flags), (0, vec!["diverged"]));
    }

    #[test]
    fn a_yaw_rate_that_no_vehicle_has_ends_the_run() {
        let of = |rate: f64| run(spec(), &[CALM, ("vehicle.yaw_rate", 0.1, Some((500, rate)))], None);
        for sign in [1.0, -1.0] {
            let result = of(sign * 50.1);
            assert_eq!(result.flags, ["diverged"]);
            assert_eq!(result.error.as_deref(), Some("`vehicle.yaw_rate` is above 50 rad/s at 0.5 s"));
            let result = run(spec(), &[CALM, ("vehicle.yaw_rate", 0.1, Some((3, sign * 51.0)))], None);
            assert_eq!(result.error.as_deref(), Some("`vehicle.yaw_rate` is above 50 rad/s at 0.003 s"));
            assert_eq!(of(sign * 50.0).flags.len(), 0);
        }
    }

    /// Keeps the rows before the failed call. A failure after the end of the run is ignored.
    #[test]
    fn a_call_that_fails_ends_the_run() {
        let message = "plant: fmi2DoStep returned fmi2Error";
        let result = run(spec(), &[CALM], Some(message));
        assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (1000, "failed"));
        assert_eq!((result.flags, result.error.as_deref()), (vec!["diverged"], Some(message)));
        let position = ("vehicle.position_x", 0.0, Some((500, 60.0)));
        let result = run(spec().end(EndAt::Position(50.0)), &[CALM, position], Some(message));
        assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (500, "finished"));
        assert_eq!((result.flags.len(), result.error), (0, None));
    }

    #[test]
    fn a_driver_off_the_path_ends_the_run_where_the_maneuver_asks_for_it() {
        let lost = ("path.lost", 0.0, Some((500, 1.0)));
        let result = run(spec().end(EndAt::Lost).with_end(), &[CALM, lost, ("path.finished", 0.0, None)], None);
        assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (500, "lost"));
        assert_eq!((result.flags, result.error), (vec!["lost", "not_finished"], None));
        let result = run(spec(), &[CALM, lost], None);
        assert_eq!((result.trace.times().len(), result.flags), (1000, vec!["lost"]));
    }

    /// A spin sets a flag, and the run continues. Below 3 m/s over ground, a large sideslip angle is not a spin.
    #[test]
    fn a_spin_is_a_flag() {
        let of = |speed: f64, sideslip: f64| {
            let sideslip = ("vehicle.sideslip", 0.0, Some((500, sideslip)));
            run(spec(), &[("vehicle.speed", speed, None), sideslip], None)
        };
        let result = of(20.0, -0.71);
        assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (1000, "time"));
        assert_eq!((result.flags, result.error), (vec!["spun"], None));
        assert_eq!(of(20.0, 0.7).flags.len(), 0);
        assert_eq!(of(2.9, 2.0).flags.len(), 0);
        // A car that slides sideways has a small forward speed but a large speed over ground.
        let rows = 1001;
        let x: Vec<f64> = (0..rows).map(|row| 0.02 * f64::from(row)).collect();
        let recording = Recording {
            time: (0..rows).map(|row| f64::from(row) * STEP).collect(),
            columns: vec![Some(vec![0.0; x.len()]), Some(vec![1.5; x.len()]), Some(vec![0.0; x.len()]), Some(x)],
            ..Recording::default()
        };
        let names =
            ["vehicle.speed", "vehicle.sideslip", "vehicle.position_y", "vehicle.position_x"].map(str::to_owned);
        assert_eq!(cut(spec(), &names, &recording, 16.0, None).flags, ["spun"]);
    }

    #[test]
    fn a_vehicle_that_tips_over_ends_the_run() {
        let result = run(spec(), &[CALM, ("body.roll", 0.0, Some((500, -0.81)))], None);
        assert_eq!((result.trace.times().len(), result.stop_reason.as_str()), (500, "rolled over"));
        assert_eq!((result.flags, result.error), (vec!["rolled_over"], None));
    }
}
