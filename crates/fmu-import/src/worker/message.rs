//! Messages: a JSON header and a body of numbers. Their lengths are limited.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::{self, Read, Write};

/// Maximum length of a header, bytes. An instance can have 100 log messages of 10,000 bytes.
const MAX_HEADER: u32 = 256 << 20;
/// Maximum length of a body, as the number of values. They take 8 GB, more than a run can record.
const MAX_NUMBERS: u64 = 1 << 30;
/// Length of the prefix of every message, bytes. It contains the lengths of header and body.
const PREFIX: usize = 12;
/// Size of the blocks in which a body is written, bytes.
const CHUNK: usize = 1 << 16;
/// Maximum size of a buffer that is kept for the next message, bytes.
const KEPT: usize = 16 << 20;

/// Error for an invalid message.
pub fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// Writes a message. The parts of the body are concatenated.
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

/// Reads the prefix of a message: length of the header in bytes, length of the body in numbers.
fn lengths(message: &[u8]) -> (u32, u64) {
    let of = |bytes: &[u8]| bytes.iter().rev().fold(0, |length, byte| length << 8 | u64::from(*byte));
    (of(&message[..4]) as u32, of(&message[4..PREFIX]))
}

/// Numbers in a body.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    /// The next `count` numbers; `None` if fewer remain.
    pub fn take(&mut self, count: usize) -> Option<Vec<f64>> {
        let (bytes, rest) = self.0.split_at_checked(count.checked_mul(8)?)?;
        self.0 = rest;
        Some(bytes.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect())
    }

    /// The remaining numbers.
    pub fn rest(mut self) -> Vec<f64> {
        self.take(self.0.len() / 8).unwrap_or_default()
    }
}

/// Reads messages from a connection, even if a message arrives in parts. The buffer is kept for the next message,
/// because allocating it again would cost more than copying.
#[derive(Debug, Default)]
pub struct Reader {
    buffer: Vec<u8>,
    /// Number of bytes in the buffer that have been received.
    received: usize,
    /// Position of the body of a complete message.
    body: Option<usize>,
}

impl Reader {
    /// The header of the next message; `None` if the connection was closed before the message was complete. Fails if
    /// the connection does, or if the data is not a message. After a timeout, the call can be repeated.
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
            // The buffer grows with the received data, so a wrong length does not cost memory.
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

    /// Length in bytes of the present message, or of its prefix while the prefix is incomplete.
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

    /// A connection that delivers a few bytes at a time, and times out at every other read.
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
        // The bodies are longer and shorter than the blocks and the buffer. All bits of a number must be preserved.
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
