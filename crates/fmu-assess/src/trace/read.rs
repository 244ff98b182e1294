//! Traces from CSV files.

use super::Trace;
use std::io::Read as _;

/// The first bytes of a gzip file.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// A file that is not a trace. The messages are for a report that names the file.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// A compressed file is damaged.
    #[error("the file cannot be decompressed: {0}")]
    Compressed(#[source] std::io::Error),
    /// It is not text.
    #[error("the file is not UTF-8 text")]
    Text,
    /// The first line is missing.
    #[error("the file is empty")]
    Empty,
    /// The first line has no column of times.
    #[error("line 1 has no column `time`, but {0}")]
    NoTime(String),
    /// A name is there twice.
    #[error("line 1 has the column `{0}` twice")]
    Twice(String),
    /// A row has more or fewer cells than the first line.
    #[error("line {line} has {cells} cells, line 1 has {columns}")]
    Cells {
        /// Line of the file, from 1.
        line: u64,
        /// Cells of the row.
        cells: u64,
        /// Cells of the first line.
        columns: u64,
    },
    /// A cell is not a number.
    #[error("line {line}, column `{column}`: \"{cell}\" is not a number")]
    Cell {
        /// Line of the file, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// The cell.
        cell: String,
    },
}

impl ReadError {
    /// Advice for the user.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match self {
            Self::Compressed(_) => "Check the file with `gzip -t`, or give the CSV file itself.",
            Self::Text => "Save the recording as CSV in UTF-8, plain or compressed with gzip.",
            Self::Empty | Self::NoTime(_) => {
                "Line 1 contains the names of the columns, separated by commas: `time` (s) and signals such as `vehicle.yaw_rate`."
            }
            Self::Twice(_) => "Remove or rename one of the columns.",
            Self::Cells { .. } => "Give every row a cell for each column, separated by commas; a cell may be empty.",
            Self::Cell { .. } => "A cell contains a number with a decimal point, `true`, `false`, or nothing.",
        }
    }
}

impl Trace<'static> {
    /// Reads a CSV file, plain or compressed with gzip.
    ///
    /// The first line contains the names of the columns, of which one is `time`. Cells are numbers, `true` (1) or `false` (0). An empty
    /// cell is NaN.
    ///
    /// # Errors
    /// The file is damaged, has no column `time` or a name twice, or a cell is not a number.
    pub fn read(bytes: &[u8]) -> Result<Self, ReadError> {
        if !bytes.starts_with(&GZIP) {
            return Self::parse(bytes);
        }
        let mut plain = Vec::new();
        flate2::read::MultiGzDecoder::new(bytes).read_to_end(&mut plain).map_err(ReadError::Compressed)?;
        Self::parse(&plain)
    }

    fn parse(bytes: &[u8]) -> Result<Self, ReadError> {
        let text = std::str::from_utf8(bytes).map_err(|_| ReadError::Text)?;
        // Spreadsheets begin a file with a byte order mark.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new().has_headers(false).trim(csv::Trim::All).from_reader(text.as_bytes());
        let mut record = csv::StringRecord::new();
        if !next(&mut reader, &mut record)? {
            return Err(ReadError::Empty);
        }
        let names: Vec<String> = record.iter().map(str::to_owned).collect();
        if let Some((_, twice)) = names.iter().enumerate().find(|(index, name)| names[..*index].contains(name)) {
            return Err(ReadError::Twice(twice.clone()));
        }
        let Some(time) = names.iter().position(|name| name == "time") else {
            let known: Vec<String> = names.iter().take(5).map(|name| format!("`{name}`")).collect();
            let rest = names.len().saturating_sub(5);
            let rest = if rest > 0 { format!(" and {rest} more") } else { String::new() };
            return Err(ReadError::NoTime(known.join(", ") + &rest));
        };
        let mut columns = vec![Vec::new(); names.len()];
        while next(&mut reader, &mut record)? {
            for ((cell, column), name) in record.iter().zip(&mut columns).zip(&names) {
                column.push(number(cell).ok_or_else(|| ReadError::Cell {
                    line: record.position().map_or(0, csv::Position::line),
                    column: name.clone(),
                    cell: cell.to_owned(),
                })?);
            }
        }
        let mut trace = Self::new(columns[time].clone());
        let signals = names.into_iter().zip(columns).enumerate().filter(|(index, _)| *index != time);
        trace.columns = signals.map(|(_, (name, column))| (name.into(), column.into())).collect();
        Ok(trace)
    }
}

/// Reads a row; `false` at the end.
fn next(reader: &mut csv::Reader<&[u8]>, record: &mut csv::StringRecord) -> Result<bool, ReadError> {
    reader.read_record(record).map_err(|error| match error.into_kind() {
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
            ReadError::Cells { line: pos.map_or(0, |pos| pos.line()), cells: len, columns: expected_len }
        }
        csv::ErrorKind::Io(error) => ReadError::Compressed(error),
        _ => ReadError::Text,
    })
}

fn number(cell: &str) -> Option<f64> {
    match cell {
        "" => Some(f64::NAN),
        "true" => Some(1.0),
        "false" => Some(0.0),
        _ => cell.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn files_are_read_plain_and_compressed() {
        let text = "\u{feff}a, time,path.finished\n1e-3,0.1,false\n,0.2,true\n";
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(text.as_bytes()).unwrap();
        for bytes in [text.as_bytes().to_vec(), encoder.finish().unwrap()] {
            let trace = Trace::read(&bytes).unwrap();
            assert_eq!(trace.times(), [0.1, 0.2]);
            assert_eq!(trace.names().collect::<Vec<_>>(), ["a", "path.finished"]);
            assert_eq!(trace.column("path.finished"), Some(&[0.0, 1.0][..]));
            let a = trace.column("a").unwrap();
            assert!(a[0] == 1e-3 && a[1].is_nan());
        }
    }

    #[test]
    fn a_file_may_have_no_rows() {
        assert!(Trace::read(b"time,a\n").unwrap().times().is_empty());
    }

    #[test]
    fn mistakes_have_a_place() {
        for (text, expected) in [
            (&b""[..], "the file is empty"),
            (b"\n", "the file is empty"),
            (b"t;a\n0;1\n", "line 1 has no column `time`, but `t;a`"),
            (b"a,b,c,d,e,f\n", "line 1 has no column `time`, but `a`, `b`, `c`, `d`, `e` and 1 more"),
            (b"time,a,a\n", "line 1 has the column `a` twice"),
            (b"time,a\n0,1\n0.1\n", "line 3 has 1 cells, line 1 has 2"),
            (b"time,a\n0,1\n0.1,x\n", "line 3, column `a`: \"x\" is not a number"),
            (b"time,a\n0,\xff\n", "the file is not UTF-8 text"),
            (b"\x1f\x8bnothing", "the file cannot be decompressed: "),
        ] {
            let error = Trace::read(text).unwrap_err();
            assert!(error.to_string().starts_with(expected), "{error}");
            assert!(!error.help().is_empty());
        }
    }
}
