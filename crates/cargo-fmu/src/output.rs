//! Printing to terminals and pipes. Text from an FMU cannot control the terminal. If a reader such as `head` closes the
//! pipe early, this is not an error.

use std::fmt::Arguments;
use std::io::{ErrorKind, IsTerminal as _, Write as _};

use fmu_import::terminal::escaped;

/// Prints to the standard output; [`outln`](crate::outln) adds the end of the line.
#[macro_export]
macro_rules! out {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

/// Prints a line to the standard output.
#[macro_export]
macro_rules! outln {
    ($($text:tt)*) => { $crate::output::write(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints a line to the standard error.
#[macro_export]
macro_rules! errln {
    ($($text:tt)*) => { $crate::output::write_error(format_args!($($text)*)) };
}

/// Writes to the standard output. Ends the program if nobody reads the output.
pub fn write(text: Arguments<'_>) {
    write_raw(escaped(&text.to_string()).as_bytes());
}

/// Prints a line to the standard error.
pub fn write_error(text: Arguments<'_>) {
    eprintln!("{}", escaped(&text.to_string()));
}

/// Prints the text of a file. On a terminal, control characters are escaped.
pub(crate) fn write_file(text: &str) {
    let shown = if std::io::stdout().is_terminal() { escaped(text) } else { text.into() };
    write_raw(shown.as_bytes());
}

fn write_raw(bytes: &[u8]) {
    if let Err(error) = std::io::stdout().lock().write_all(bytes) {
        fmu_import::temporary::remove();
        if error.kind() == ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: the standard output cannot be written: {error}");
        std::process::exit(1);
    }
}

/// Quotes a word for a POSIX shell, as Python's `shlex.quote` does.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "@%+=:,./-_".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\"'\"'"))
}
