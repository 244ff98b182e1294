//! Messages: a header in JSON and a body of numbers, both of bounded length.

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
/// Bytes of a body that are written at once.
const CHUNK: usize = 1 << 16;
/// Largest buffer that is kept for the next message, bytes.
const KEPT: usize = 16 << 20;

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
    /// A recording as header and body, which is to be sent as one.
    pub(super) fn recorded(recording: Recording) -> (Self, Vec<Vec<f64>>) {
        let Recording { time, columns, messages, seconds } = recording;
        let rows = time.len();
        let has = columns.iter().map(Option::is_some).collect();
        let body = std::iter::once(time).chain(columns.into_iter().flatten()).collect();
        (Self::Recorded { rows, columns: has, messages, seconds }, body)
    }
}

/// A recording from its header and its body.
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
    Ok(Recording { time, columns, messages, seconds })
}

pub(super) fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// Writes a message. The parts of the body become one.
pub(super) fn write(mut to: impl Write, header: &impl Serialize, body: &[&[f64]]) -> io::Result<()> {
    let mut bytes = vec![0; PREFIX];
    serde_json::to_writer(&mut bytes, header)?;
    let length = u32::try_from(bytes.len() - PREFIX).ok().filter(|length| *length <= MAX_HEADER);
    let length = length.ok_or_else(|| invalid("a message is too long"))?;
    let numbers: usize = body.iter().map(|part| part.len()).sum();
    bytes[..4].copy_from_slice(&length.to_le_bytes());
    bytes[4..PREFIX].copy_from_slice(&(numbers as u64).to_le_bytes());
    for chunk in body.iter().flat_map(|part| part.chunks(CHUNK / 8)) {
        if bytes.len() + 8 * chunk.len() > CHUNK {
            to.write_all(&bytes)?;
            bytes.clear();
        }
        chunk.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    }
    to.write_all(&bytes)
}

/// Numbers of a body.
#[derive(Clone, Copy)]
pub(super) struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    /// The next numbers; `None` if there are not so many.
    fn take(&mut self, count: usize) -> Option<Vec<f64>> {
        let (bytes, rest) = self.0.split_at_checked(count.checked_mul(8)?)?;
        self.0 = rest;
        let number = |bytes: &[u8]| {
            let mut eight = [0; 8];
            eight.copy_from_slice(bytes);
            f64::from_le_bytes(eight)
        };
        Some(bytes.chunks_exact(8).map(number).collect())
    }

    /// All that are left.
    pub(super) fn rest(mut self) -> Vec<f64> {
        self.take(self.0.len() / 8).unwrap_or_default()
    }
}

/// Reads messages from a connection that may have only a part of one yet. Its buffer stays for the next message: to get
/// and give back this memory again and again costs more than to copy it.
pub(super) struct Reader {
    buffer: Vec<u8>,
    /// Bytes of the buffer that have been received.
    received: usize,
    /// Where the body of a complete message begins.
    body: Option<usize>,
}

impl Reader {
    pub(super) fn new() -> Self {
        Self { buffer: Vec::new(), received: 0, body: None }
    }

    /// The header of the next message; `None` if the connection was closed before it was complete.
    ///
    /// # Errors
    /// As the connection, among them that nothing has come within the time it waits; the call may be repeated then. Also
    /// if what comes is not a message.
    pub(super) fn read<T: DeserializeOwned>(&mut self, from: &mut impl Read) -> io::Result<Option<T>> {
        if self.body.take().is_some() {
            self.received = 0;
            if self.buffer.len() > KEPT {
                self.buffer = Vec::new();
            }
        }
        loop {
            let wanted = self.wanted()?;
            if self.received == wanted && wanted > PREFIX {
                let length = &self.buffer[..4];
                let body = PREFIX + u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
                self.body = Some(body);
                return Ok(Some(serde_json::from_slice(&self.buffer[PREFIX..body])?));
            }
            // A part at a time: a length that lies costs no memory.
            let end = wanted.min(self.received + (1 << 20));
            if self.buffer.len() < end {
                self.buffer.resize(end, 0);
            }
            match from.read(&mut self.buffer[self.received..end]) {
                Ok(0) => return Ok(None),
                Ok(count) => self.received += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => (),
                Err(error) => return Err(error),
            }
        }
    }

    /// The body of the message that was read last.
    pub(super) fn body(&self) -> Numbers<'_> {
        Numbers(self.body.map_or(&[], |begin| &self.buffer[begin..self.received]))
    }

    /// Bytes of the message at hand, as far as they are known.
    fn wanted(&self) -> io::Result<usize> {
        if self.received < PREFIX {
            return Ok(PREFIX);
        }
        let lengths = &self.buffer[..PREFIX];
        let header = u32::from_le_bytes([lengths[0], lengths[1], lengths[2], lengths[3]]);
        let mut eight = [0; 8];
        eight.copy_from_slice(&lengths[4..]);
        let numbers = u64::from_le_bytes(eight);
        if header == 0 || header > MAX_HEADER || numbers > MAX_NUMBERS {
            return Err(invalid("the length of a message is out of bounds"));
        }
        usize::try_from(PREFIX as u64 + u64::from(header) + 8 * numbers).map_err(|_| invalid("a message is too long"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A connection that has so many bytes at a time, and nothing every other time.
    struct Slow<'a> {
        bytes: &'a [u8],
        step: usize,
        has_some: bool,
    }

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.has_some = !self.has_some;
            if !self.has_some {
                return Err(io::ErrorKind::WouldBlock.into());
            }
            let count = self.step.min(buffer.len());
            self.bytes.read(&mut buffer[..count])
        }
    }

    fn next<T: DeserializeOwned>(reader: &mut Reader, from: &mut Slow<'_>) -> Option<T> {
        loop {
            match reader.read(from) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => (),
                other => return other.unwrap(),
            }
        }
    }

    #[test]
    fn messages_are_read_as_they_were_written() {
        // Longer and shorter than what is written or kept at once; every bit of a number counts.
        let long: Vec<f64> = (0..40_000).map(f64::from).collect();
        let special = [-0.0, f64::from_bits(0x7ff8_0000_0000_0123), f64::INFINITY];
        let bodies: [&[&[f64]]; 5] = [&[&long, &special, &long], &[], &[&special], &[&[], &long], &[&[1.0], &[2.0]]];
        let mut bytes = Vec::new();
        for (index, body) in bodies.iter().enumerate() {
            write(&mut bytes, &format!("header {index}"), body).unwrap();
        }
        for step in [1_000_000, 4096, 7] {
            let mut from = Slow { bytes: &bytes, step, has_some: false };
            let mut reader = Reader::new();
            for (index, body) in bodies.iter().enumerate() {
                assert_eq!(next::<String>(&mut reader, &mut from), Some(format!("header {index}")));
                let bits = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&reader.body().rest()), bits(&body.concat()), "{index}, {step}");
            }
            assert_eq!(next::<String>(&mut reader, &mut from), None);
        }
    }

    #[test]
    fn a_body_that_is_too_short_is_no_recording() {
        let mut bytes = Vec::new();
        write(&mut bytes, &0, &[&[0.0, 1.0, 5.0, 6.0]]).unwrap();
        let mut reader = Reader::new();
        assert_eq!(reader.read(&mut &bytes[..]).unwrap(), Some(0));
        let made = recording(2, &[false, true], Vec::new(), 0.0, reader.body()).unwrap();
        assert_eq!((made.time, made.columns), (vec![0.0, 1.0], vec![None, Some(vec![5.0, 6.0])]));
        for rows in [3, usize::MAX] {
            assert!(recording(rows, &[false, true], Vec::new(), 0.0, reader.body()).is_err());
        }
    }
}
