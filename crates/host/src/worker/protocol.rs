//! Messages: a header in JSON and a body of numbers, both of bounded length.

use super::connection::Connection;
use crate::check::Event;
use crate::fmu::Binary;
use crate::linearize::Linear;
use crate::loader::Message;
use crate::master::Recording;
use crate::plan::{Feed, Run, Simulation, Trial};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// Longest header, bytes. What FMUs log is the longest part: 100 messages of 10,000 bytes per instance at most.
const MAX_HEADER: u32 = 256 << 20;
/// Most numbers of a body: 8 GB, beyond what a run can record in memory.
const MAX_NUMBERS: u64 = 1 << 30;
/// Bytes in front of every message: the lengths of its parts.
const PREFIX: usize = 12;

/// What a worker is asked for.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Request {
    /// The FMUs of all later runs. There is no response.
    Fmus(Vec<Binary>),
    /// To load all FMUs.
    Load,
    /// To execute a run.
    Run {
        simulation: Simulation,
        /// Its feeds are in the body.
        run: Box<Run>,
        /// Slots of the feeds, number of rows, and whether a feed has the times of the one before.
        feeds: Vec<(usize, usize, bool)>,
        /// Names of the columns, and the file to write them to instead of returning them.
        csv: Option<(Vec<String>, PathBuf)>,
    },
    /// To check a `.fmu` file.
    Check(PathBuf),
    /// To find parameters without an effect.
    Trials { simulation: Simulation, trials: Vec<Trial> },
    /// To linearize a `.fmu` file with other values of these variables, which are in the body.
    Linearize { path: PathBuf, names: Vec<String> },
}

/// What a worker responds.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Response {
    /// Something about the file that is checked; more follows.
    Event(Event),
    /// All is done.
    Done,
    /// What the trials have shown.
    Warnings(Vec<String>),
    /// The linear model; its matrix is in the body.
    Linear(Linear),
    /// The run is done. Time and columns are in the body.
    Recorded { rows: usize, columns: Vec<bool>, messages: Vec<(String, Message)>, seconds: f64 },
    /// It could not be done.
    Failed {
        /// Start of the step that failed, s.
        time: Option<f64>,
        /// Why.
        message: String,
        /// Whether no library of the worker may be used any more.
        is_fatal: bool,
    },
}

impl Request {
    /// A run as header and body.
    pub(super) fn run(simulation: &Simulation, mut run: Run, csv: Option<(Vec<String>, PathBuf)>) -> (Self, Vec<f64>) {
        let mut body = Vec::new();
        let mut feeds: Vec<(usize, usize, bool)> = Vec::new();
        let taken = std::mem::take(&mut run.feeds);
        for (at, feed) in taken.iter().enumerate() {
            let is_same = at > 0 && Arc::ptr_eq(&feed.times, &taken[at - 1].times);
            if !is_same {
                body.extend_from_slice(&feed.times);
            }
            body.extend_from_slice(&feed.values);
            feeds.push((feed.slot, feed.values.len(), is_same));
        }
        (Self::Run { simulation: *simulation, run: Box::new(run), feeds, csv }, body)
    }
}

/// The feeds of a run from its body.
pub(super) fn feeds(list: &[(usize, usize, bool)], mut body: &[f64]) -> io::Result<Vec<Feed>> {
    let mut take = |count: usize| -> io::Result<Arc<[f64]>> {
        let (numbers, rest) = body.split_at_checked(count).ok_or_else(|| invalid("a body is too short"))?;
        body = rest;
        Ok(numbers.into())
    };
    let mut feeds: Vec<Feed> = Vec::new();
    for &(slot, rows, is_same) in list {
        let times = match feeds.last().filter(|_| is_same) {
            Some(before) => Arc::clone(&before.times),
            None => take(rows)?,
        };
        feeds.push(Feed { slot, times, values: take(rows)? });
    }
    Ok(feeds)
}

impl Response {
    /// A recording as header and body.
    pub(super) fn recorded(recording: Recording) -> (Self, Vec<f64>) {
        let Recording { time, columns, messages, seconds } = recording;
        let rows = time.len();
        let has = columns.iter().map(Option::is_some).collect();
        let mut body = time;
        columns.into_iter().flatten().for_each(|column| body.extend(column));
        (Self::Recorded { rows, columns: has, messages, seconds }, body)
    }
}

/// A recording from its header and its body.
pub(super) fn recording(
    rows: usize,
    columns: &[bool],
    messages: Vec<(String, Message)>,
    seconds: f64,
    mut body: &[f64],
) -> io::Result<Recording> {
    let mut take = || -> io::Result<Vec<f64>> {
        let (numbers, rest) = body.split_at_checked(rows).ok_or_else(|| invalid("a body is too short"))?;
        body = rest;
        Ok(numbers.to_vec())
    };
    let time = take()?;
    let columns = columns.iter().map(|has| has.then(&mut take).transpose()).collect::<io::Result<_>>()?;
    Ok(Recording { time, columns, messages, seconds })
}

pub(super) fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// Writes a message.
pub(super) fn write(mut to: impl Write, header: &impl Serialize, body: &[f64]) -> io::Result<()> {
    let mut bytes = vec![0; PREFIX];
    serde_json::to_writer(&mut bytes, header)?;
    let length = u32::try_from(bytes.len() - PREFIX).ok().filter(|length| *length <= MAX_HEADER);
    let length = length.ok_or_else(|| invalid("a message is too long"))?;
    bytes[..4].copy_from_slice(&length.to_le_bytes());
    bytes[4..PREFIX].copy_from_slice(&(body.len() as u64).to_le_bytes());
    bytes.extend(body.iter().flat_map(|number| number.to_le_bytes()));
    to.write_all(&bytes)
}

/// Reads messages from a connection that may have only a part of one yet.
pub(super) struct Reader {
    received: Vec<u8>,
}

impl Reader {
    pub(super) fn new() -> Self {
        Self { received: Vec::new() }
    }

    /// The next message; `None` if the connection was closed before it was complete.
    ///
    /// # Errors
    /// As the connection, among them that nothing has come within the time it waits; the call may be repeated then. Also
    /// if what comes is not a message.
    pub(super) fn read<T: DeserializeOwned>(&mut self, from: &mut Connection) -> io::Result<Option<(T, Vec<f64>)>> {
        loop {
            let wanted = self.wanted()?;
            if self.received.len() >= wanted && wanted > PREFIX {
                return self.take(wanted).map(Some);
            }
            // A chunk at a time: a length that lies costs no memory.
            let missing = (wanted - self.received.len()).min(1 << 20);
            let before = self.received.len();
            self.received.resize(before + missing, 0);
            let read = from.read(&mut self.received[before..]);
            self.received.truncate(before + read.as_ref().map_or(0, |count| *count));
            match read {
                Ok(0) => return Ok(None),
                Err(error) if error.kind() != io::ErrorKind::Interrupted => return Err(error),
                _ => (),
            }
        }
    }

    /// Bytes of the message at hand, as far as they are known.
    fn wanted(&self) -> io::Result<usize> {
        let Some((lengths, _)) = self.received.split_at_checked(PREFIX) else { return Ok(PREFIX) };
        let header = u32::from_le_bytes([lengths[0], lengths[1], lengths[2], lengths[3]]);
        let mut eight = [0; 8];
        eight.copy_from_slice(&lengths[4..]);
        let numbers = u64::from_le_bytes(eight);
        if header == 0 || header > MAX_HEADER || numbers > MAX_NUMBERS {
            return Err(invalid("the length of a message is out of bounds"));
        }
        usize::try_from(PREFIX as u64 + u64::from(header) + 8 * numbers).map_err(|_| invalid("a message is too long"))
    }

    fn take<T: DeserializeOwned>(&mut self, length: usize) -> io::Result<(T, Vec<f64>)> {
        let rest = self.received.split_off(length);
        let message = std::mem::replace(&mut self.received, rest);
        let header = u32::from_le_bytes([message[0], message[1], message[2], message[3]]) as usize;
        let (header, body) = message[PREFIX..].split_at(header);
        let number = |bytes: &[u8]| {
            let mut eight = [0; 8];
            eight.copy_from_slice(bytes);
            f64::from_le_bytes(eight)
        };
        Ok((serde_json::from_slice(header)?, body.chunks_exact(8).map(number).collect()))
    }
}
