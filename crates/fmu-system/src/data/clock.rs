//! Converts cells to signals: times, and values at these times.

use super::unit::Target;
use super::{DataError, Mistake, REPORTED, Table};
use crate::run::Linear;
use std::ops::Range;
use std::sync::Arc;

/// Default names of the time column; the first that exists is used.
const TIMES: [&str; 3] = ["time", "Time", "t"];

/// Settings of the time column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimeColumn {
    /// Name of the column; `None` for the first of `time`, `Time` and `t`.
    pub column: Option<String>,
    /// Unit of the times; `None` for the unit in the file, or s if the file has none.
    pub unit: Option<String>,
    /// Shift of the times.
    pub offset: Offset,
    /// Event that becomes time 0 before the offset is added.
    pub trigger: Option<Trigger>,
    /// Treatment of rows with equal times.
    pub duplicates: Duplicates,
}

/// Shift of the times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Offset {
    /// Adds an offset, s.
    Add(f64),
    /// Moves the first row to 0.
    First,
}

impl Default for Offset {
    fn default() -> Self {
        Self::Add(0.0)
    }
}

/// Event that defines time 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Trigger {
    /// Name of the column.
    pub column: String,
    /// Level that the column crosses, in the unit of the file.
    pub level: f64,
    /// True for falling below the level, false for rising above it.
    pub falls: bool,
}

/// Treatment of rows with equal times.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Duplicates {
    /// Equal times are a mistake.
    #[default]
    Error,
    /// The signal jumps: the first row is the left limit, the last row is the value from this time on.
    Jump,
    /// The first row is used.
    First,
    /// The last row is used.
    Last,
    /// The mean of the rows is used.
    Mean,
}

/// Times of a table.
#[derive(Debug)]
pub struct Clock {
    pub(crate) column: usize,
    /// Times, s, nondecreasing; equal times are a jump.
    times: Arc<[f64]>,
    /// The rows of each time; `None` if every row has its own time.
    rows: Option<Vec<Range<usize>>>,
}

/// Conversion of a column to a signal: sign * (scale * cell + offset). Then the unit is converted, and `delay` and
/// `zero` are applied.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel<'a> {
    /// Name of the column.
    pub column: &'a str,
    /// Unit after scale and offset; `None` for the unit in the file, or the unit of the variable if the file has none.
    pub unit: Option<&'a str>,
    /// Factor.
    pub scale: f64,
    /// Offset.
    pub offset: f64,
    /// 1 or -1.
    pub sign: f64,
    /// Delay of the column, s; it is subtracted from the times.
    pub delay: f64,
    /// Interval, s; the mean over it is subtracted.
    pub zero: Option<[f64; 2]>,
}

impl<'a> Channel<'a> {
    /// A column without conversion.
    pub fn new(column: &'a str) -> Self {
        Self { column, unit: None, scale: 1.0, offset: 0.0, sign: 1.0, delay: 0.0, zero: None }
    }
}

/// Samples of a signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Times, s, nondecreasing; equal times are a jump. A signal without missing cells and without delay shares the
    /// times of its clock.
    pub times: Arc<[f64]>,
    /// A value for each time, in the unit of the variable.
    pub values: Arc<[f64]>,
    /// Number of missing cells.
    pub missing: usize,
    /// Conversion of the values in the file.
    pub conversion: Linear,
}

impl Clock {
    /// Times, s, nondecreasing.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The rows with the time of this index.
    fn rows(&self, index: usize) -> Range<usize> {
        self.rows.as_ref().map_or(index..index + 1, |rows| rows[index].clone())
    }
}

impl Table {
    /// Reads the time column.
    ///
    /// # Errors
    /// There is no time column, a time is missing or invalid, times decrease, or two are equal with
    /// [`Duplicates::Error`].
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
                        _ => "name the time column `time`, `Time` or `t`",
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
                "give every row a time, or remove rows without one",
            );
        }
        let mut times: Vec<f64> = column.cells.iter().map(|cell| conversion.factor * cell).collect();
        let zero = match &options.trigger {
            Some(trigger) => self.event(trigger, &times)?,
            None => 0.0,
        };
        let shift = match options.offset {
            Offset::Add(offset) => offset - zero,
            Offset::First => -times[0],
        };
        for time in &mut times {
            *time += shift;
        }
        let mut mistakes = Vec::new();
        for (row, pair) in times.windows(2).enumerate() {
            let (lines, [before, now]) = ((self.line(row), self.line(row + 1)), [pair[0], pair[1]]);
            let (message, help) = if now < before {
                (
                    format!("time {now} at line {} follows {before}", lines.1),
                    "sort the rows by time, or correct the time",
                )
            } else if now == before && options.duplicates == Duplicates::Error {
                let message = format!("time {now} is there twice, lines {} and {}", lines.0, lines.1);
                (message, "remove one of the rows, or choose one with `duplicates`")
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
        Ok(clock(index, times, options.duplicates))
    }

    /// Finds the time at which a column first crosses a level, by interpolation.
    fn event(&self, trigger: &Trigger, times: &[f64]) -> Result<f64, DataError> {
        let column = self.numbers(&trigger.column)?;
        let sign = if trigger.falls { -1.0 } else { 1.0 };
        let level = sign * trigger.level;
        let mut samples =
            times.iter().zip(&column.cells).filter(|(_, cell)| !cell.is_nan()).map(|(t, cell)| (*t, sign * cell));
        let mut before = samples.next();
        for (now, value) in samples {
            if let Some((then, last)) = before
                && last <= level
                && value > level
            {
                return Ok(then + (level - last) / (value - last) * (now - then));
            }
            before = Some((now, value));
        }
        let passes = if trigger.falls { "falls below" } else { "rises above" };
        let message = format!("the trigger column `{}` never {passes} {}", trigger.column, trigger.level);
        Err(DataError::new(&self.file, message, Some("choose another level, in the unit of the file".into())))
    }

    /// Converts a column to a signal in the unit `target`.
    ///
    /// # Errors
    /// There is no such column, a cell is not a number, the unit does not fit, or the interval of `zero` has no sample.
    pub fn signal(&self, clock: &Clock, channel: &Channel<'_>, target: &Target) -> Result<Signal, DataError> {
        let name = channel.column;
        let column = self.numbers(name)?;
        let conversion = match channel.unit.or(column.unit.as_deref()) {
            None => Linear::IDENTITY,
            Some(unit) => target.from(unit).map_err(|(message, help)| {
                DataError::new(&self.file, format!("column `{name}`: {message}"), Some(help))
            })?,
        };
        let is_plain =
            channel.scale == 1.0 && channel.offset == 0.0 && channel.sign == 1.0 && conversion == Linear::IDENTITY;
        let value = |cell: f64| {
            if is_plain {
                return cell;
            }
            conversion.factor * (channel.sign * (channel.scale * cell + channel.offset)) + conversion.offset
        };
        let of_time = |index: usize| {
            let mut values =
                column.cells[clock.rows(index)].iter().filter(|cell| !cell.is_nan()).map(|cell| value(*cell));
            let first = values.next()?;
            let (sum, count) = values.fold((first, 1.0), |(sum, count), value| (sum + value, count + 1.0));
            Some(sum / count)
        };
        let values: Vec<Option<f64>> = (0..clock.times.len()).map(of_time).collect();
        let missing = values.iter().filter(|value| value.is_none()).count();
        let times: Arc<[f64]> = if missing == 0 && channel.delay == 0.0 {
            Arc::clone(&clock.times)
        } else {
            clock
                .times
                .iter()
                .zip(&values)
                .filter(|(_, value)| value.is_some())
                .map(|(t, _)| t - channel.delay)
                .collect()
        };
        let mut values: Vec<f64> = values.into_iter().flatten().collect();
        if values.is_empty() {
            let message = format!("the column `{name}` has no value");
            return Err(DataError::new(&self.file, message, Some("remove the column, or give it values".into())));
        }
        if let Some([from, to]) = channel.zero {
            let within = times.iter().zip(&values).filter(|(time, _)| (from..=to).contains(*time));
            let (sum, count) = within.fold((0.0, 0_u32), |(sum, count), (_, value)| (sum + value, count + 1));
            if count == 0 {
                let message =
                    format!("the column `{name}` has no sample from {from} s to {to} s, the interval of its `zero`");
                return Err(DataError::new(&self.file, message, Some("choose an interval with samples".into())));
            }
            for value in &mut values {
                *value -= sum / f64::from(count);
            }
        }
        Ok(Signal { times, values: values.into(), missing, conversion })
    }
}

/// Makes a clock from nondecreasing times.
fn clock(column: usize, times: Vec<f64>, duplicates: Duplicates) -> Clock {
    if matches!(duplicates, Duplicates::Error | Duplicates::Jump) || times.windows(2).all(|pair| pair[0] < pair[1]) {
        return Clock { column, times: times.into(), rows: None };
    }
    let mut first = 0;
    let groups = times.chunk_by(|a, b| a == b).map(|group| {
        let rows = first..first + group.len();
        first = rows.end;
        match duplicates {
            Duplicates::First => rows.start..rows.start + 1,
            Duplicates::Last => rows.end - 1..rows.end,
            _ => rows,
        }
    });
    let rows: Vec<Range<usize>> = groups.collect();
    Clock { column, times: rows.iter().map(|rows| times[rows.start]).collect(), rows: Some(rows) }
}
