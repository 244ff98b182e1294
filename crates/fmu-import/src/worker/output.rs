//! Output that FMUs print: any bytes, in any amount.

use crate::terminal;
use std::io::{BufRead, BufReader, PipeReader, Read as _};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Maximum length of a line, bytes. Longer lines are split.
const MAX_LINE: u64 = 1000;
/// Maximum number of lines that are passed on from a worker.
const MAX_LINES: usize = 1000;
/// Time limit for reading the remaining output of a worker that has ended. Programs that the worker started can keep
/// its output open.
const PATIENCE: Duration = Duration::from_secs(1);

/// Receives the lines that FMUs print, without control characters and line breaks.
pub type Printed = Arc<dyn Fn(&str) + Send + Sync>;

pub(super) struct Output {
    end: Receiver<()>,
}

impl Output {
    pub(super) fn read(pipe: PipeReader, printed: Printed) -> std::io::Result<Self> {
        let (ended, end) = channel();
        std::thread::Builder::new().name("output".to_owned()).spawn(move || {
            pass_on(BufReader::new(pipe), &*printed);
            drop(ended);
        })?;
        Ok(Self { end })
    }

    /// Waits until all output is passed on. The worker must have ended.
    pub(super) fn finish(&self) {
        // Returns when the channel is disconnected; nothing is ever sent.
        let _ = self.end.recv_timeout(PATIENCE);
    }
}

fn pass_on(mut from: impl BufRead, printed: &dyn Fn(&str)) {
    let mut line = Vec::new();
    for count in 0.. {
        line.clear();
        match from.by_ref().take(MAX_LINE).read_until(b'\n', &mut line) {
            Ok(0) => return,
            Ok(_) if count < MAX_LINES => printed(&printable(&line)),
            Ok(_) if count == MAX_LINES => printed("(further output of FMUs is omitted)"),
            // The pipe is still read, because writers would block otherwise.
            Ok(_) => (),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => (),
            Err(_) => return,
        }
    }
}

/// Makes a line safe for a terminal: escapes control characters, replaces invalid UTF-8, removes the line break.
fn printable(bytes: &[u8]) -> String {
    terminal::line(String::from_utf8_lossy(bytes).trim_end_matches(['\r', '\n'])).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    fn lines(bytes: &[u8]) -> Vec<String> {
        let lines = Mutex::new(Vec::new());
        pass_on(bytes, &|line| lines.lock().unwrap().push(line.to_owned()));
        lines.into_inner().unwrap()
    }

    #[test]
    fn any_bytes_become_lines() {
        assert_eq!(
            lines(b"one\r\n\xff\x1b[31mtwo\x07\n\nthree"),
            ["one", "\u{fffd}\\u001b[31mtwo\\u0007", "", "three"]
        );
        assert_eq!(lines("tab\there, ä\n".as_bytes()), ["tab\\there, ä"]);
    }

    #[test]
    fn length_and_number_of_lines_are_bounded() {
        let endless = lines(&vec![b'x'; 2500]);
        assert_eq!(endless.iter().map(String::len).collect::<Vec<_>>(), [1000, 1000, 500]);
        let many = lines(&b"x\n".repeat(5000));
        assert_eq!(many.len(), MAX_LINES + 1);
        assert!(many[MAX_LINES].contains("omitted"));
    }
}
