//! Converts cells to signals: times, and values at these times.

use super::unit::{self, Conversion, Target};
use super::{DataError, Mistake, REPORTED, Table};
use std::sync::Arc;

/// Default names of the column of times; the first that exists is used.
const TIMES: [&str; 3] = ["time", "Time", "t"];

/// The column of times.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimeColumn {
    /// Name of the column; `None` for the first of `time`, `Time` and `t`.
    pub column: Option<String>,
    /// Its unit; `None` for that in the file, else s.
    pub unit: Option<String>,
    /// True if the signals jump at equal times: the first row is the left limit, the last one holds from there on. Otherwise equal times
    /// are a mistake.
    pub has_jumps: bool,
}

/// Times of a table.
#[derive(Debug)]
pub struct Clock {
    /// Index of the column.
    pub(crate) column: usize,
    /// Times, s, nondecreasing; equal ones are a jump.
    times: Arc<[f64]>,
}

/// Samples of a signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Times, s, nondecreasing; equal ones are a jump. Signals without missing cells share those of their clock.
    pub times: Arc<[f64]>,
    /// A value for each time, in the unit of the variable.
    pub values: Arc<[f64]>,
    /// Conversion of the values of the file.
    pub conversion: Conversion,
}

impl Clock {
    /// Times, s, nondecreasing.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }
}

impl Table {
    /// The times.
    ///
    /// # Errors
    /// There is no column of times, a time is missing or invalid, times decrease, or two are equal where that is an
    /// error.
    pub fn times(&self, options: &TimeColumn) -> Result<Clock, DataError> {
        let fail = |row: Option<usize>, message: String, help: &str| {
            let mistake = Mistake { line: row.map(|row| self.line(row)), message, help: Some(help.to_owned()) };
            Err(DataError::of(&self.file, mistake))
        };
        let name = match &options.column {
            Some(name) => name.as_str(),
            None => match TIMES.into_iter().find(|name| self.columns().iter().any(|column| column.name == *name)) {
                Some(name) => name,
                None => {
                    let shown: Vec<String> =
                        self.columns().iter().take(5).map(|column| format!("`{}`", column.name)).collect();
                    let more = self.columns().len().saturating_sub(5);
                    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
                    let message = format!("the file has no column `time`, but {}{more}", shown.join(", "));
                    let help = match self.columns().len() {
                        1 => {
                            "the first line names the columns, separated by tab, `;`, `,` or `|`: remove the lines above it"
                        }
                        _ => "call the column of times `time`, `Time` or `t`",
                    };
                    return fail(None, message, help);
                }
            },
        };
        let column = self.numbers(name)?;
        if column.cells.is_empty() {
            return fail(None, "the file has no rows".into(), "give it a row for each time");
        }
        let unit = options.unit.as_deref().or(column.unit.as_deref()).unwrap_or("s");
        let conversion = match Target::named("s").from(unit) {
            Ok(conversion) => conversion,
            Err((message, _)) => {
                return fail(None, format!("column `{name}`: {message}"), "times are in s, ms, us, ns, min or h");
            }
        };
        if let Some(row) = column.cells.iter().position(|cell| cell.is_nan()) {
            return fail(
                Some(row),
                format!("the time is missing at line {}", self.line(row)),
                "give every row a time, or remove it",
            );
        }
        let times: Vec<f64> = column.cells.iter().map(|cell| conversion.factor * cell + conversion.offset).collect();
        let mut mistakes = Vec::new();
        for (row, pair) in times.windows(2).enumerate() {
            let (lines, [before, now]) = ((self.line(row), self.line(row + 1)), [pair[0], pair[1]]);
            let (message, help) = if now < before {
                (
                    format!("time {now} at line {} follows {before}", lines.1),
                    "sort the rows by time, or correct the time",
                )
            } else if now == before && !options.has_jumps {
                let message = format!("time {now} is there twice, lines {} and {}", lines.0, lines.1);
                (message, "remove one of the rows")
            } else {
                continue;
            };
            mistakes.push(Mistake { line: Some(lines.1), message, help: Some(help.to_owned()) });
            if mistakes.len() > REPORTED {
                break;
            }
        }
        if !mistakes.is_empty() {
            return Err(DataError { file: self.file.clone(), mistakes });
        }
        let index = self.columns().iter().position(|column| column.name == name).unwrap_or_default();
        Ok(Clock { column: index, times: times.into() })
    }

    /// Converts a column to a signal in the unit `target`. `unit` is that of its cells; `None` for that in the file, else the target.
    ///
    /// # Errors
    /// There is no such column, a cell is not a number, or the unit does not fit.
    pub fn signal(&self, clock: &Clock, name: &str, unit: Option<&str>, target: &Target) -> Result<Signal, DataError> {
        let column = self.numbers(name)?;
        let conversion = match unit.or(column.unit.as_deref()) {
            None => unit::SAME,
            Some(unit) => target.from(unit).map_err(|(message, help)| {
                DataError::new(&self.file, format!("column `{name}`: {message}"), Some(help))
            })?,
        };
        let rows = || clock.times.iter().zip(&column.cells).filter(|(_, cell)| !cell.is_nan());
        let is_same = conversion == unit::SAME;
        let value = |cell: f64| if is_same { cell } else { conversion.factor * cell + conversion.offset };
        let values: Arc<[f64]> = rows().map(|(_, cell)| value(*cell)).collect();
        if values.is_empty() {
            let message = format!("the column `{name}` has no value");
            return Err(DataError::new(&self.file, message, Some("remove the column, or give it values".into())));
        }
        let is_whole = values.len() == clock.times.len();
        let times = if is_whole { Arc::clone(&clock.times) } else { rows().map(|(time, _)| *time).collect() };
        Ok(Signal { times, values, conversion })
    }
}
