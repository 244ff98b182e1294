//! Requests and responses about runs.

use crate::failure::Failure;
use crate::results::Part;
use crate::run::{Exact, InputSeries, Interpolation, RealTime, Recording, Run, Setting, Simulation, StepCounts, Trial};
use fmu_import::fmu::Binary;
use fmu_import::loader::Message;
use fmu_import::worker::message::{Numbers, invalid};
use serde::{Deserialize, Serialize};
use std::io;
use std::sync::Arc;

/// Slot of an input series, number of rows, interpolation, and true if it shares the times of the previous series.
pub(super) type Series = (usize, usize, Interpolation, bool);

#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Request {
    /// The FMUs of all later runs. There is no response.
    Fmus(Vec<Binary>),
    Load,
    Run {
        simulation: Simulation,
        /// The run, without its series, which are in the body.
        run: Box<Run>,
        series: Vec<Series>,
        /// Names of the columns, and the file to write them to instead of returning them. The worker does not publish
        /// the file.
        csv: Option<(Vec<String>, Part)>,
        /// True for a run that has crashed or hung before: its instances are neither terminated nor freed.
        is_repeated: bool,
        /// Factor of a run in real time.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pace: Option<f64>,
    },
    Steady {
        simulation: Simulation,
        run: Box<Run>,
    },
    Trials {
        simulation: Simulation,
        trials: Vec<Trial>,
    },
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Response {
    Done,
    /// Start values of each component that starts in a steady state; `None` for other components.
    Steady(Vec<Option<Vec<Setting>>>),
    Warnings(Vec<String>),
    /// The run is done. Time and columns are in the body.
    Recorded {
        rows: usize,
        columns: Vec<bool>,
        /// Exact values by column.
        #[serde(default)]
        exact: Vec<(usize, Exact)>,
        messages: Vec<(String, Message)>,
        seconds: f64,
        #[serde(default)]
        real_time: Option<RealTime>,
        #[serde(default)]
        steps: Option<StepCounts>,
    },
    Failed {
        failure: Failure,
        #[serde(default)]
        real_time: Option<RealTime>,
        #[serde(default)]
        steps: Option<StepCounts>,
        /// Number of rows before the failure, and which columns they have. The rows are in the body unless they were
        /// written to the file. `None` without rows.
        rows: Option<(usize, Vec<bool>)>,
    },
}

impl Request {
    /// A run as header and body.
    pub(super) fn run(
        simulation: &Simulation,
        mut run: Run,
        csv: Option<(Vec<String>, Part)>,
        is_repeated: bool,
        pace: Option<f64>,
    ) -> (Self, Vec<f64>) {
        let mut body = Vec::new();
        let mut series: Vec<Series> = Vec::new();
        let taken = std::mem::take(&mut run.series);
        for (at, feed) in taken.iter().enumerate() {
            let is_same = at > 0 && Arc::ptr_eq(&feed.times, &taken[at - 1].times);
            if !is_same {
                body.extend_from_slice(&feed.times);
            }
            body.extend_from_slice(&feed.values);
            series.push((feed.slot, feed.values.len(), feed.interpolation, is_same));
        }
        (Self::Run { simulation: *simulation, run: Box::new(run), series, csv, is_repeated, pace }, body)
    }
}

pub(super) fn series(list: &[Series], mut body: &[f64]) -> io::Result<Vec<InputSeries>> {
    let mut take = |count: usize| -> io::Result<Arc<[f64]>> {
        let (numbers, rest) = body.split_at_checked(count).ok_or_else(|| invalid("a body is too short"))?;
        body = rest;
        Ok(numbers.into())
    };
    let mut series: Vec<InputSeries> = Vec::new();
    for &(slot, rows, interpolation, is_same) in list {
        let times = match series.last().filter(|_| is_same) {
            Some(before) => Arc::clone(&before.times),
            None => take(rows)?,
        };
        series.push(InputSeries { slot, interpolation, times, values: take(rows)? });
    }
    Ok(series)
}

impl Response {
    /// A recording as header and body.
    pub(super) fn recorded(mut recording: Recording) -> (Self, Vec<Vec<f64>>) {
        let exact = std::mem::take(&mut recording.exact).into_iter().collect();
        let Recording { real_time, steps, .. } = recording;
        let ((rows, columns), body, messages, seconds) = parts(recording);
        (Self::Recorded { rows, columns, exact, messages, seconds, real_time, steps }, body)
    }

    /// A failure as header, and the rows before it as body.
    pub(super) fn failed(mut failure: Failure) -> (Self, Vec<Vec<f64>>) {
        let Some(recording) = failure.recorded.take() else { return (Self::failure(failure), Vec::new()) };
        let Recording { real_time, steps, .. } = *recording;
        let (rows, body, ..) = parts(*recording);
        (Self::Failed { failure, real_time, steps, rows: Some(rows) }, body)
    }

    /// A failure without rows.
    pub(super) fn failure(failure: Failure) -> Self {
        Self::Failed { failure, real_time: None, steps: None, rows: None }
    }
}

/// The parts of a recording: the number of rows with a flag for each column that exists, the times and columns, the
/// messages, and the duration in seconds.
type Parts = ((usize, Vec<bool>), Vec<Vec<f64>>, Vec<(String, Message)>, f64);

fn parts(recording: Recording) -> Parts {
    let Recording { time, columns, messages, seconds, .. } = recording;
    let rows = (time.len(), columns.iter().map(Option::is_some).collect());
    (rows, std::iter::once(time).chain(columns.into_iter().flatten()).collect(), messages, seconds)
}

pub(super) fn recording(
    rows: usize,
    columns: &[bool],
    messages: Vec<(String, Message)>,
    seconds: f64,
    mut body: Numbers<'_>,
) -> io::Result<Recording> {
    let mut take = || body.take(rows).ok_or_else(|| invalid("a body is too short"));
    let time = take()?;
    let columns = columns.iter().map(|has| has.then(&mut take).transpose()).collect::<io::Result<_>>()?;
    Ok(Recording { time, columns, messages, seconds, ..Recording::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_import::worker::message::{Reader, write};

    #[test]
    fn a_body_that_is_too_short_is_no_recording() {
        let mut bytes = Vec::new();
        write(&mut bytes, &0, &[&[0.0, 1.0, 5.0, 6.0]]).unwrap();
        let mut reader = Reader::default();
        assert_eq!(reader.read(&mut &bytes[..]).unwrap(), Some(0));
        let made = recording(2, &[false, true], Vec::new(), 0.0, reader.body()).unwrap();
        assert_eq!((made.time, made.columns), (vec![0.0, 1.0], vec![None, Some(vec![5.0, 6.0])]));
        for rows in [3, usize::MAX] {
            assert!(recording(rows, &[false, true], Vec::new(), 0.0, reader.body()).is_err());
        }
    }
}
