//! Requests and responses about runs.

use crate::failure::Failure;
use crate::results::Part;
use crate::run::{InputSeries, Interpolation, Recording, Run, Setting, Simulation, Trial};
use fmu_import::fmu::Binary;
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
    /// The run is done.
    Recorded(Header),
    Failed {
        failure: Failure,
        /// The rows before the failure; `None` without rows.
        rows: Option<Header>,
    },
}

/// A recording whose times and columns are in the body, unless they were written to a file.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Header {
    /// Number of rows.
    rows: usize,
    /// True for each column that exists.
    columns: Vec<bool>,
    /// The rest of the recording.
    #[serde(default)]
    recording: Recording,
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
    /// The outcome of a run as header and body.
    pub(super) fn of(outcome: Result<Recording, Failure>) -> (Self, Vec<Vec<f64>>) {
        match outcome {
            Ok(recording) => {
                let (header, body) = Header::of(recording);
                (Self::Recorded(header), body)
            }
            Err(mut failure) => {
                let (rows, body) = failure.recorded.take().map(|recording| Header::of(*recording)).unzip();
                (Self::Failed { failure, rows }, body.unwrap_or_default())
            }
        }
    }
}

impl Header {
    /// A recording as header and body.
    fn of(mut recording: Recording) -> (Self, Vec<Vec<f64>>) {
        let (time, columns) = (std::mem::take(&mut recording.time), std::mem::take(&mut recording.columns));
        let header = Self { rows: time.len(), columns: columns.iter().map(Option::is_some).collect(), recording };
        (header, std::iter::once(time).chain(columns.into_iter().flatten()).collect())
    }

    pub(super) fn recording(self, mut body: Numbers<'_>) -> io::Result<Recording> {
        let mut take = || body.take(self.rows).ok_or_else(|| invalid("a body is too short"));
        let time = take()?;
        let columns = self.columns.iter().map(|has| has.then(&mut take).transpose()).collect::<io::Result<_>>()?;
        Ok(Recording { time, columns, ..self.recording })
    }
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
        let header = |rows| Header { rows, columns: vec![false, true], recording: Recording::default() };
        let made = header(2).recording(reader.body()).unwrap();
        assert_eq!((made.time, made.columns), (vec![0.0, 1.0], vec![None, Some(vec![5.0, 6.0])]));
        for rows in [3, usize::MAX] {
            assert!(header(rows).recording(reader.body()).is_err());
        }
    }
}
