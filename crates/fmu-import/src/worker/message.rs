//! Messages: a header in JSON and a body of numbers, both of bounded length.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::{self, Read, Write};

/// Longest header, bytes. Log messages of FMUs are the longest part: 100 messages of 10,000 bytes per instance at most.
const MAX_HEADER: u32 = 256 << 20;
/// Most numbers of a body: 8 GB, beyond what a run can record in memory.
const MAX_NUMBERS: u64 = 1 << 30;
/// Bytes in front of every message: the lengths of its parts.
const PREFIX: usize = 12;
/// Bytes of a body that are written at once.
const CHUNK: usize = 1 << 16;
/// Largest buffer that is kept for the next message, bytes.
const KEPT: usize = 16 << 20;

/// A message that breaks the rules.
pub fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// Writes a message. The parts of the body become one.
pub fn write(mut to: impl Write, header: &impl Serialize, body: &[&[f64]]) -> io::Result<()> {
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

/// Length of the header in bytes, and of the body in numbers, from the first bytes of a message.
fn lengths(message: &[u8]) -> (u32, u64) {
    let of = |bytes: &[u8]| bytes.iter().rev().fold(0, |length, byte| length << 8 | u64::from(*byte));
    (of(&message[..4]) as u32, of(&message[4..PREFIX]))
}

/// Numbers of a body.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    /// The next numbers; `None` if there are fewer.
    pub fn take(&mut self, count: usize) -> Option<Vec<f64>> {
        let (bytes, rest) = self.0.split_at_checked(count.checked_mul(8)?)?;
        self.0 = rest;
        Some(bytes.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect())
    }

    /// All numbers that are left.
    pub fn rest(mut self) -> Vec<f64> {
        self.take(self.0.len() / 8).unwrap_or_default()
    }
}

/// Reads messages from a connection that may have only a part of one yet. Its buffer is kept for the next message:
/// allocating and freeing it repeatedly costs more than copying.
#[derive(Debug, Default)]
pub struct Reader {
    buffer: Vec<u8>,
    /// Bytes of the buffer that have been received.
    received: usize,
    /// Position of the body of a complete message.
    body: Option<usize>,
}

impl Reader {
    /// The header of the next message; `None` if the connection was closed before it was complete.
    ///
    /// # Errors
    /// As the connection, including a timeout without data, after which the call may be repeated. Also if the data is
    /// not a message.
    pub fn read<T: DeserializeOwned>(&mut self, from: &mut impl Read) -> io::Result<Option<T>> {
        if self.body.take().is_some() {
            self.received = 0;
            if self.buffer.len() > KEPT {
                self.buffer = Vec::new();
            }
        }
        loop {
            let wanted = self.wanted()?;
            if self.received == wanted && wanted > PREFIX {
                let body = PREFIX + lengths(&self.buffer).0 as usize;
                self.body = Some(body);
                return Ok(Some(serde_json::from_slice(&self.buffer[PREFIX..body])?));
            }
            // One part at a time: a wrong length costs no memory.
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
    pub fn body(&self) -> Numbers<'_> {
        Numbers(self.body.map_or(&[], |begin| &self.buffer[begin..self.received]))
    }

    /// Bytes of the message at hand, as far as they are known.
    fn wanted(&self) -> io::Result<usize> {
        if self.received < PREFIX {
            return Ok(PREFIX);
        }
        let (header, numbers) = lengths(&self.buffer);
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
            let mut reader = Reader::default();
            for (index, body) in bodies.iter().enumerate() {
                assert_eq!(next::<String>(&mut reader, &mut from), Some(format!("header {index}")));
                let bits = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&reader.body().rest()), bits(&body.concat()), "{index}, {step}");
            }
            assert_eq!(next::<String>(&mut reader, &mut from), None);
        }
    }
}
