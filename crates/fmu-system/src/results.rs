//! Writes recordings as CSV.

mod number;
mod status;

pub use status::{RunStatus, RunStatuses, STATUS_FILE};

use crate::run::{Binaries, Exact, Recording, Run};
use fmu_import::bytes::BinaryText;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

const CHUNK: usize = 1 << 16;

/// File name of a run: its id with `@` and `#` replaced by `_`.
pub fn file_name(run: &Run) -> String {
    format!("{}.csv", run.id.replace(['@', '#'], "_"))
}

/// Writes `time` and the columns that the run has; `names` are the names of all columns. Numbers have the shortest form
/// that reads back as the same double, Int64 and UInt64 all digits, Binaries the text of their column. The file appears
/// complete or not at all.
///
/// # Errors
/// The folder cannot be made or the file cannot be written; the message contains the path.
pub fn write_csv(path: &Path, names: &[String], recording: &Recording) -> io::Result<()> {
    let part = Part::of(path);
    part.write(names, recording)?;
    part.publish()
}

/// A file that has a hidden name until it is complete and on the disk.
///
/// One process can write the file, and another process can publish it under its final name.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Part {
    path: PathBuf,
    /// In the same folder, so that renaming is atomic.
    hidden: PathBuf,
}

impl Part {
    /// The part of a file that this process or its workers write.
    pub(crate) fn of(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let hidden = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
        Self { path: path.to_owned(), hidden }
    }

    /// Writes the recording; see [`write_csv`]. If that fails, the part is removed.
    pub(crate) fn write(&self, names: &[String], recording: &Recording) -> io::Result<()> {
        self.or_remove(write_hidden(&self.hidden, names, recording))
    }

    /// Syncs the file to the disk and gives it its final name. If that fails, the part is removed.
    pub(crate) fn publish(&self) -> io::Result<()> {
        let stored = File::options().write(true).open(&self.hidden).and_then(|file| file.sync_all());
        self.or_remove(stored.and_then(|()| std::fs::rename(&self.hidden, &self.path)))
    }

    pub(crate) fn remove(&self) {
        // Errors do no harm: the file that remains is hidden.
        let _ = std::fs::remove_file(&self.hidden);
    }

    fn or_remove(&self, result: io::Result<()>) -> io::Result<()> {
        result.map_err(|error| {
            // The first error is the one to report.
            self.remove();
            io::Error::new(error.kind(), format!("{}: {error}", self.path.display()))
        })
    }
}

/// Removes the parts that interrupted writers of a file have left.
pub fn remove_parts(path: &Path) {
    let start = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
    let entries = path.parent().and_then(|folder| std::fs::read_dir(folder).ok());
    for entry in entries.into_iter().flatten().filter_map(Result::ok) {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix(&start)?.strip_suffix(".part"));
        if number.is_some_and(|number| number.parse::<u32>().is_ok()) {
            // Errors do no harm: the file that remains is hidden.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Columns of a file, in the requested order; `None` for a column that the run does not have.
pub type Columns = Vec<Option<Vec<f64>>>;

/// Reads columns of a file that [`write_csv`] has written: the times, and the columns by name.
///
/// # Errors
/// The file cannot be read or is not such a file; the message contains the path.
pub fn read_csv(path: &Path, names: &[&str]) -> io::Result<(Vec<f64>, Columns)> {
    let wrong = |error: &dyn std::fmt::Display| {
        io::Error::new(io::ErrorKind::InvalidData, format!("{}: {error}", path.display()))
    };
    let mut reader = csv::Reader::from_path(path).map_err(|error| wrong(&error))?;
    let head = reader.headers().map_err(|error| wrong(&error))?.clone();
    let of = |name: &str| head.iter().position(|other| other == name);
    let places: Vec<Option<usize>> = names.iter().map(|name| of(name)).collect();
    let at = of("time").ok_or_else(|| wrong(&"there is no column `time`"))?;
    let mut times = Vec::new();
    let mut columns: Columns = places.iter().map(|place| place.map(|_| Vec::new())).collect();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| wrong(&error))? {
        let number = |place: usize| record.get(place).unwrap_or_default().parse::<f64>().map_err(|error| wrong(&error));
        times.push(number(at)?);
        for (place, column) in places.iter().zip(&mut columns) {
            if let (Some(place), Some(column)) = (place, column) {
                column.push(number(*place)?);
            }
        }
    }
    Ok((times, columns))
}

/// Reads the exact values of a file that [`write_csv`] has written, by column: those of the columns `binaries`, and
/// integers beyond 2^53.
///
/// # Errors
/// The file cannot be read, or a value is not the text of a Binary; the message contains the path.
pub fn read_exact(path: &Path, binaries: &[&str], text: BinaryText) -> io::Result<BTreeMap<String, Exact>> {
    const LARGEST: u128 = 1 << f64::MANTISSA_DIGITS;
    let wrong = |error: &dyn std::fmt::Display| {
        io::Error::new(io::ErrorKind::InvalidData, format!("{}: {error}", path.display()))
    };
    let mut reader = csv::Reader::from_path(path).map_err(|error| wrong(&error))?;
    let column = |name: &str| match binaries.contains(&name) {
        true => Some(Exact::Binaries { text, values: Binaries::default() }),
        false => Some(Exact::Integers(Vec::new())),
    };
    let head = reader.headers().map_err(|error| wrong(&error))?.clone();
    let mut columns: Vec<Option<Exact>> = head.iter().map(column).collect();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| wrong(&error))? {
        for (cell, column) in record.iter().zip(&mut columns) {
            match column {
                Some(Exact::Binaries { values, .. }) => {
                    let bytes = text.decode(cell).ok_or_else(|| wrong(&format!("`{cell}` is not a Binary")))?;
                    values.push(&bytes);
                }
                Some(Exact::Integers(values)) => match cell.parse() {
                    Ok(value) => values.push(value),
                    // The column has doubles.
                    Err(_) => *column = None,
                },
                None => (),
            }
        }
    }
    let is_exact = |column: &Exact| match column {
        Exact::Integers(values) => values.iter().any(|value| value.unsigned_abs() > LARGEST),
        Exact::Binaries { .. } => true,
    };
    let named = head.iter().zip(columns).filter_map(|(name, column)| Some((name.to_owned(), column?)));
    Ok(named.filter(|(_, column)| is_exact(column)).collect())
}

fn write_hidden(path: &Path, names: &[String], recording: &Recording) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    push_csv(&mut File::create(path)?, names, recording)
}

/// Writes the content of a [`write_csv`] file to a stream.
pub fn push_csv(file: &mut dyn Write, names: &[String], recording: &Recording) -> io::Result<()> {
    let (names, mut columns): (Vec<&str>, Vec<Cells<'_>>) = names
        .iter()
        .zip(&recording.columns)
        .enumerate()
        .filter_map(|(index, (name, values))| {
            Some((name.as_str(), Cells::new(values.as_deref()?, recording.exact.get(&index))))
        })
        .unzip();
    // Room for a chunk and the row that completes it.
    let mut text = Vec::with_capacity(CHUNK + (columns.len() + 1) * (number::MAX_LENGTH + 1));
    text.extend_from_slice(b"time");
    for name in names {
        // Names of FMI variables may contain any character.
        if name.contains([',', '"', '\n', '\r']) {
            write!(text, ",\"{}\"", name.replace('"', "\"\""))?;
        } else {
            write!(text, ",{name}")?;
        }
    }
    text.push(b'\n');
    for (row, time) in recording.time.iter().enumerate() {
        number::push(&mut text, *time);
        for cells in &mut columns {
            text.push(b',');
            match cells {
                Cells::Numbers(values) => number::push(&mut text, values[row]),
                Cells::Integers(values) => write!(text, "{}", values[row])?,
                Cells::Binaries(values, encoding) => encoding.push(&mut text, values.next().unwrap_or_default()),
            }
        }
        text.push(b'\n');
        if text.len() >= CHUNK {
            file.write_all(&text)?;
            text.clear();
        }
    }
    file.write_all(&text)
}

/// The values of a column.
enum Cells<'a> {
    Numbers(&'a [f64]),
    Integers(&'a [i128]),
    Binaries(Box<dyn Iterator<Item = &'a [u8]> + 'a>, BinaryText),
}

impl<'a> Cells<'a> {
    fn new(numbers: &'a [f64], exact: Option<&'a Exact>) -> Self {
        match exact {
            None => Self::Numbers(numbers),
            Some(Exact::Integers(values)) => Self::Integers(values),
            Some(Exact::Binaries { text, values }) => Self::Binaries(Box::new(values.iter()), *text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The limits of the types, and numbers that doubles round.
    #[test]
    fn integers_have_all_digits_and_binaries_are_texts() {
        let mut binaries = Binaries::default();
        [&b"foo"[..], b"", &[0, 0xff]].iter().for_each(|value| binaries.push(value));
        let exact = |text| {
            let integers = vec![i64::MIN.into(), (1 << 53) + 1, u64::MAX.into()];
            let binaries = Exact::Binaries { text, values: binaries.clone() };
            BTreeMap::from([(0, Exact::Integers(integers)), (2, binaries)])
        };
        let mut recording = Recording {
            time: vec![0.0, 1.0, 2.0],
            columns: vec![Some(vec![0.0; 3]); 3],
            exact: exact(BinaryText::Base64),
            ..Recording::default()
        };
        let written = |recording: &Recording| {
            let mut text = Vec::new();
            push_csv(&mut text, &["n", "x", "b"].map(String::from), recording).unwrap();
            String::from_utf8(text).unwrap()
        };
        let expected = "time,n,x,b\n0.0,-9223372036854775808,0.0,Zm9v\n1.0,9007199254740993,0.0,\n\
                        2.0,18446744073709551615,0.0,AP8=\n";
        assert_eq!(written(&recording), expected);
        recording.exact = exact(BinaryText::Hex);
        let expected = expected.replace("Zm9v", "666f6f").replace("AP8=", "00ff");
        assert_eq!(written(&recording), expected);

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, &expected).unwrap();
        let read = read_exact(&path, &["b"], BinaryText::Hex).unwrap();
        assert_eq!(read.into_values().collect::<Vec<_>>(), [recording.exact[&2].clone(), recording.exact[&0].clone()]);
        let error = read_exact(&path, &["x"], BinaryText::Hex).unwrap_err().to_string();
        assert!(error.ends_with("a.csv: `0.0` is not a Binary"), "{error}");
    }

    #[test]
    fn numbers_read_back_exactly_and_absent_columns_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs/a.csv");
        let values = [0.1 + 0.2, -1e-300];
        let recording = Recording {
            time: vec![0.0, 0.001],
            columns: vec![Some(values.to_vec()), None, Some(vec![1.0, 5e300])],
            ..Recording::default()
        };
        let columns = ["body.roll", "absent", "a,\"b\""].map(String::from);
        write_csv(&path, &columns, &recording).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "time,body.roll,\"a,\"\"b\"\"\"\n0.0,0.30000000000000004,1.0\n0.001,-1e-300,5e300\n");
        let back: f64 = text.lines().nth(1).unwrap().split(',').nth(1).unwrap().parse().unwrap();
        assert_eq!(back.to_bits(), values[0].to_bits());
        assert_eq!(std::fs::read_dir(folder.path().join("runs")).unwrap().count(), 1);
    }

    #[test]
    fn a_part_is_hidden_until_it_is_published() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        // More than one chunk.
        let time: Vec<f64> = (0..30_000).map(|k| f64::from(k) * 0.001).collect();
        let recording = Recording { time, columns: Vec::new(), ..Recording::default() };
        let part = Part::of(&path);
        part.write(&[], &recording).unwrap();
        assert!(!path.exists());
        part.publish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let back: Vec<f64> = text.lines().skip(1).map(|line| line.parse().unwrap()).collect();
        assert_eq!(back, recording.time);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        // A part that was not written cannot be published.
        let error = Part::of(&path).publish().unwrap_err().to_string();
        assert!(error.contains("a.csv: "), "{error}");
    }

    #[test]
    fn a_failure_names_the_file_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        // A folder of that name cannot be replaced by a file.
        std::fs::create_dir(&path).unwrap();
        let recording = Recording { time: Vec::new(), columns: Vec::new(), ..Recording::default() };
        let error = write_csv(&path, &[], &recording).unwrap_err().to_string();
        assert!(error.contains("a.csv"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
