//! Printing for people and pipes: a reader that has seen enough, such as `head`, is no failure.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write as _};

/// Prints to the standard output; [`outln`] adds the end of the line.
macro_rules! out {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

/// Prints a line to the standard output.
macro_rules! outln {
    ($($text:tt)*) => { $crate::output::write(format_args!("{}\n", format_args!($($text)*))) };
}

pub(crate) use {out, outln};

/// Ends the program if nobody reads any more.
pub(crate) fn write(text: Arguments<'_>) {
    if let Err(error) = std::io::stdout().lock().write_fmt(text) {
        if error.kind() == ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: the standard output cannot be written: {error}");
        std::process::exit(1);
    }
}
