//! Data from CSV files: measurements from loggers, tables from spreadsheets, signals from simulations.
//!
//! A [`Table`] holds the columns of a file by name, with the units in the file. [`Table::times`] makes a clock from one
//! column, [`Table::signal`] a signal from another. All commands use this module, so they all read a file in the same
//! way.
//!
//! Cells and names are data: nothing in a file is evaluated.

pub mod unit;

mod clock;
mod text;

pub use self::clock::{Channel, Clock, Duplicates, Offset, Signal, TimeColumn, Trigger};
pub use self::text::Encoding;

use self::text::{Cell, Rows, cell, is_number};
use fmu_import::limits;
use fmu_import::names::suggestion;
use std::borrow::Cow;
use std::io::Read as _;
use std::path::Path;

/// Maximum number of rows of a table.
const ROWS: usize = 10_000_000;
/// Maximum number of columns of a table.
const COLUMNS: usize = 4096;
/// Longest line, in bytes.
const LINE: usize = 1_000_000;
/// Number of rows searched for the decimal mark.
const LOOKED_AT: usize = 100;
/// Maximum number of mistakes reported for a file.
const REPORTED: usize = 20;
/// Delimiters that are detected. If two are equally frequent, the first one in this list is chosen.
const DELIMITERS: [char; 4] = ['\t', ';', ',', '|'];
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Format of a file. Fields that are `None` are detected.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Format {
    /// Cell separator.
    pub delimiter: Option<char>,
    /// Decimal mark, `.` or `,`.
    pub decimal: Option<char>,
    /// Encoding.
    pub encoding: Option<Encoding>,
    /// Line of the header, from 1.
    pub header: Option<usize>,
}

/// Format of a file, as detected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// Encoding.
    pub encoding: Encoding,
    /// Cell separator.
    pub delimiter: char,
    /// Decimal mark.
    pub decimal: char,
    /// Number of rows.
    pub rows: usize,
}

/// Columns of a file.
#[derive(Debug)]
pub struct Table {
    file: String,
    found: Found,
    columns: Vec<Column>,
    /// Line of each row.
    lines: Vec<u32>,
}

/// A column of a file.
#[derive(Debug)]
pub struct Column {
    /// Name, without the unit in brackets after it.
    pub name: String,
    /// Unit in the line below the header, or in brackets after the name.
    pub unit: Option<String>,
    /// A number for each row; NaN for a missing or invalid cell.
    cells: Vec<f64>,
    /// Unit in brackets after the name, if the line below the header has a different unit.
    contradiction: Option<String>,
    /// Invalid cells with their rows, at most as many as are reported.
    wrong: Vec<(usize, String)>,
}

/// A mistake in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// Line, from 1; `None` if the mistake has no line.
    pub line: Option<usize>,
    /// Description of the mistake.
    pub message: String,
    /// Remedy.
    pub help: Option<String>,
}

/// A file that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, miette::Diagnostic)]
#[error("{}", self.lines().join("\n"))]
pub struct DataError {
    /// The file.
    pub file: String,
    /// The mistakes, at least one.
    pub mistakes: Vec<Mistake>,
}

impl DataError {
    /// A mistake without a line.
    pub fn new(file: &str, message: impl Into<String>, help: Option<String>) -> Self {
        Self::of(file, Mistake { line: None, message: message.into(), help })
    }

    pub(crate) fn of(file: &str, mistake: Mistake) -> Self {
        Self { file: file.to_owned(), mistakes: vec![mistake] }
    }

    /// The mistakes as `file:line: message; help`.
    pub fn lines(&self) -> Vec<String> {
        let shown = self.mistakes.iter().take(REPORTED).map(|mistake| {
            let place = mistake.line.map_or(String::new(), |line| format!(":{line}"));
            let help = mistake.help.as_ref().map_or(String::new(), |help| format!("; {help}"));
            format!("{}{place}: {}{help}", self.file, mistake.message)
        });
        let more = self.mistakes.len().saturating_sub(REPORTED);
        shown.chain((more > 0).then(|| format!("{}: {more} more mistakes", self.file))).collect()
    }
}

impl Table {
    /// Reads a file, plain or compressed with gzip.
    ///
    /// # Errors
    /// The file cannot be read, is too large, or is not a table.
    pub fn read(path: &Path, format: &Format) -> Result<Self, DataError> {
        let file = path.to_string_lossy();
        let other = ["parquet", "mat", "mf4", "mdf", "xlsx", "xls", "ods"];
        if let Some(ending) = path.extension().and_then(|ending| ending.to_str())
            && other.contains(&ending.to_ascii_lowercase().as_str())
        {
            let message = format!("a file in the format `{ending}` cannot be read");
            return Err(DataError::new(
                &file,
                message,
                Some("convert it to CSV, plain or compressed with gzip".into()),
            ));
        }
        let bytes = limits::read_bytes(path, limits::INPUT_FILE).map_err(|error| {
            DataError::new(&file, format!("cannot read the file: {error}"), Some("give the path of a CSV file".into()))
        })?;
        Self::parse(&file, &bytes, format)
    }

    /// As [`Self::read`], for the content of a file. `file` names it in messages.
    pub fn parse(file: &str, bytes: &[u8], format: &Format) -> Result<Self, DataError> {
        let mut plain = Vec::new();
        let bytes = if bytes.starts_with(&GZIP) {
            let limit = limits::INPUT_FILE;
            let read = flate2::read::MultiGzDecoder::new(bytes).take(limit + 1).read_to_end(&mut plain);
            read.map_err(|error| {
                let help = "check it with `gzip -t`, or give the CSV file itself".to_owned();
                DataError::new(file, format!("the file cannot be decompressed: {error}"), Some(help))
            })?;
            if plain.len() as u64 > limit {
                let message = format!("the decompressed file is larger than the limit of {limit} bytes");
                return Err(DataError::new(file, message, None));
            }
            &plain[..]
        } else {
            bytes
        };
        let (text, encoding) = text::decode(bytes, format.encoding).map_err(|message| {
            DataError::new(file, message, Some("save the file as CSV in UTF-8, or give its encoding".into()))
        })?;
        Self::of_text(file, &text, encoding, format)
    }

    fn of_text(file: &str, text: &str, encoding: Encoding, format: &Format) -> Result<Self, DataError> {
        let fail = |line, message: String, help: Option<&str>| {
            Err(DataError::of(file, Mistake { line, message, help: help.map(str::to_owned) }))
        };
        if text.contains('\0') {
            return fail(None, "the file is not text".into(), Some("give a CSV file"));
        }
        if let Some((index, line)) = text.split(['\n', '\r']).enumerate().find(|(_, line)| line.len() > LINE) {
            let message = format!("line {} has {} bytes, the limit is {LINE}", index + 1, line.len());
            return fail(None, message, None);
        }
        let (mut rows, header) = Rows::new(text, format.header);
        let Some(header) = header else {
            return fail(None, "the file has no header".into(), Some("name the columns in its first line"));
        };
        let delimiter = format.delimiter.unwrap_or_else(|| delimiter(header));
        rows.delimiter = delimiter;
        let mut names = Vec::new();
        let unclosed =
            |line| fail(Some(line), "a quotation mark is not closed".into(), Some("quote a cell on both sides"));
        let at = match rows.next(&mut names) {
            Some(Ok(line)) => line,
            Some(Err(line)) => return unclosed(line),
            None => return fail(None, "the file has no header".into(), None),
        };
        if names.len() > COLUMNS {
            let message = format!("the header has {} columns, the limit is {COLUMNS}", names.len());
            return fail(Some(at), message, None);
        }
        let units = unit_line(&rows, names.len());
        if units.is_some() {
            rows.next(&mut Vec::new());
        }
        let decimal = format.decimal.unwrap_or_else(|| decimal(rows.clone(), delimiter));
        let mut columns: Vec<Column> = Vec::with_capacity(names.len());
        for (index, name) in names.iter().enumerate() {
            let (name, bracket) = split_unit(name);
            let below = units.as_ref().and_then(|units| units.get(index).cloned()).filter(|unit| !unit.is_empty());
            let bracket = bracket.map(str::to_owned);
            let contradiction =
                bracket.clone().filter(|bracket| below.as_ref().is_some_and(|below| differ(below, bracket)));
            let (name, unit) = (name.to_owned(), below.or(bracket));
            columns.push(Column { name, unit, cells: Vec::new(), contradiction, wrong: Vec::new() });
        }
        let mut table = Self {
            file: file.to_owned(),
            found: Found { encoding, delimiter, decimal, rows: 0 },
            columns,
            lines: Vec::new(),
        };
        table.add_rows(rows, names.len())?;
        Ok(table)
    }

    fn add_rows(&mut self, mut rows: Rows<'_>, count: usize) -> Result<(), DataError> {
        let mut cells: Vec<Cow<'_, str>> = Vec::new();
        let mut mistakes = Vec::new();
        while let Some(row) = rows.next(&mut cells) {
            let (line, message) = match row {
                Ok(line) if cells.len() == count => {
                    self.add_row(line, &cells);
                    if self.lines.len() > ROWS {
                        return Err(DataError::new(&self.file, format!("the file has more than {ROWS} rows"), None));
                    }
                    continue;
                }
                Ok(line) => (line, format!("line {line} has {} fields, the header {count}", cells.len())),
                Err(line) => (line, "a quotation mark is not closed".to_owned()),
            };
            let help = if cells.len() == count + 1 && cells.last().is_some_and(|last| last.is_empty()) {
                "remove the delimiter at the end of the rows, or add one to the header".to_owned()
            } else if mistakes.is_empty() && self.lines.is_empty() {
                "the header is the first line that is neither empty nor a comment (#, %): remove the lines above it"
                    .to_owned()
            } else {
                "give every row a cell for each column; a cell may be empty".to_owned()
            };
            mistakes.push(Mistake { line: Some(line), message, help: Some(help) });
            if mistakes.len() > REPORTED {
                break;
            }
        }
        self.found.rows = self.lines.len();
        if mistakes.is_empty() { Ok(()) } else { Err(DataError { file: self.file.clone(), mistakes }) }
    }

    fn add_row(&mut self, line: usize, cells: &[Cow<'_, str>]) {
        let row = self.lines.len();
        for (column, text) in self.columns.iter_mut().zip(cells) {
            let value = match cell(text, self.found.decimal) {
                Cell::Number(value) => value,
                Cell::Missing => f64::NAN,
                Cell::Other => {
                    if column.wrong.len() <= REPORTED {
                        column.wrong.push((row, text.as_ref().to_owned()));
                    }
                    f64::NAN
                }
            };
            column.cells.push(value);
        }
        self.lines.push(u32::try_from(line).unwrap_or(u32::MAX));
    }

    /// Format of the file.
    pub fn found(&self) -> Found {
        self.found
    }

    /// Name of the file in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The columns, in the order of the file.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn line(&self, row: usize) -> usize {
        self.lines.get(row).map_or(0, |line| *line as usize)
    }

    /// Returns a column, which must contain only numbers.
    fn numbers(&self, name: &str) -> Result<&Column, DataError> {
        let mut of_name = self.columns.iter().filter(|column| column.name == name);
        let Some(column) = of_name.next() else {
            let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
            let help = suggestion(name, names.iter().copied()).unwrap_or_else(|| {
                let shown: Vec<String> = names.iter().take(6).map(|name| format!("`{name}`")).collect();
                format!("the columns are {}{}", shown.join(", "), if names.len() > 6 { ", …" } else { "" })
            });
            return Err(DataError::new(&self.file, format!("there is no column `{name}`"), Some(help)));
        };
        if of_name.next().is_some() {
            let help = "remove or rename one of them".to_owned();
            return Err(DataError::new(&self.file, format!("there are two columns `{name}`"), Some(help)));
        }
        if let (Some(unit), Some(other)) = (&column.unit, &column.contradiction) {
            let message = format!("the column `{name}` has the unit `{other}` after its name and `{unit}` below it");
            return Err(DataError::new(&self.file, message, Some("remove the wrong one".to_owned())));
        }
        if column.wrong.is_empty() {
            return Ok(column);
        }
        let mistakes = column.wrong.iter().map(|(row, text)| {
            let line = self.line(*row);
            let other = if self.found.decimal == ',' { '.' } else { ',' };
            let (message, help) = if is_number(text, other) {
                let message = format!(
                    "`{text}` at line {line}, column `{name}`, is not a number: the file has decimal comma and decimal point"
                );
                (message, "write all numbers with the same decimal mark")
            } else {
                let message = format!("`{text}` at line {line}, column `{name}`, is not a number");
                (message, "a cell holds a number without thousands separators, true, false, or nothing")
            };
            Mistake { line: Some(line), message, help: Some(help.to_owned()) }
        });
        Err(DataError { file: self.file.clone(), mistakes: mistakes.collect() })
    }
}

/// The most frequent delimiter of a header, outside quotation marks.
fn delimiter(header: &str) -> char {
    let mut counts = [0_usize; DELIMITERS.len()];
    let mut is_quoted = false;
    for c in header.chars() {
        is_quoted ^= c == '"';
        if let Some(index) = DELIMITERS.iter().position(|delimiter| *delimiter == c).filter(|_| !is_quoted) {
            counts[index] += 1;
        }
    }
    let most = counts.iter().copied().max().unwrap_or(0);
    counts.iter().position(|count| *count == most).map_or(',', |index| DELIMITERS[index])
}

/// Returns the line of units: a line without a number, followed by a line with a number.
fn unit_line(rows: &Rows<'_>, count: usize) -> Option<Vec<String>> {
    let mut rows = rows.clone();
    let has_number = |cells: &[Cow<'_, str>]| cells.iter().any(|cell| is_number(cell, '.') || is_number(cell, ','));
    let (mut units, mut first) = (Vec::new(), Vec::new());
    rows.next(&mut units)?.ok()?;
    rows.next(&mut first)?.ok()?;
    let is_line = units.len() == count && !has_number(&units) && has_number(&first);
    is_line.then(|| units.iter().map(|unit| unit.trim_matches(['[', ']', '(', ')']).to_owned()).collect())
}

fn differ(a: &str, b: &str) -> bool {
    a != b && (unit::find(a).is_none() || unit::find(a) != unit::find(b))
}

/// Detects the decimal mark in the first rows.
fn decimal(mut rows: Rows<'_>, delimiter: char) -> char {
    let mut cells = Vec::new();
    for _ in 0..LOOKED_AT {
        match rows.next(&mut cells) {
            Some(Ok(_)) => (),
            _ => break,
        }
        if delimiter != ',' && cells.iter().any(|cell| cell.contains(',') && is_number(cell, ',')) {
            return ',';
        }
    }
    '.'
}

/// Splits `Speed [m/s]` or `Speed (m/s)` into name and unit. The names `a[2,1]` and `Force (front)` have no unit.
fn split_unit(name: &str) -> (&str, Option<&str>) {
    let within = |open, close| name.strip_suffix(close).and_then(|rest: &str| rest.rsplit_once(open));
    let (before, unit) = match (within('[', ']'), within('(', ')')) {
        (Some((before, unit)), _) => {
            let is_index = !before.ends_with(char::is_whitespace)
                && unit.chars().all(|c| c.is_ascii_digit() || c == ',' || c == ' ');
            if is_index {
                return (name, None);
            }
            (before, unit)
        }
        (None, Some((before, unit))) if unit::find(unit).is_some() => (before, unit),
        _ => return (name, None),
    };
    if before.trim().is_empty() {
        return (name, None);
    }
    (before.trim(), Some(unit.trim()).filter(|unit| !unit.is_empty()))
}
