//! Reads a CSV file of signals that stand in for outputs of components.

use crate::problem::{Collector, Problems};
use fmu_import::names::suggestion;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Signals over time. The file is read completely and checked.
pub(crate) struct InputFile {
    /// Times, s, rising.
    pub(crate) times: Arc<[f64]>,
    /// Signals in the order of the file.
    pub(crate) signals: Vec<Signal>,
}

/// A column of the file.
pub(crate) struct Signal {
    /// `signal` or `component:signal`.
    pub(crate) name: String,
    /// One value per time.
    pub(crate) values: Arc<[f64]>,
}

impl InputFile {
    /// Reads the text of a file. `start` is the start of the simulation, `slack` how much later the
    /// first row may be, both in seconds.
    pub(crate) fn parse(file: &Path, text: &str, start: f64, slack: f64) -> Result<Self, Problems> {
        let mut problems = Collector::new(file, text, "csv");
        let mut reader = csv::ReaderBuilder::new().has_headers(false).trim(csv::Trim::All).from_reader(text.as_bytes());
        let mut header: Vec<String> = Vec::new();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for (row, record) in reader.records().enumerate() {
            let record = match record {
                Ok(record) => record,
                Err(error) => {
                    let at = error.position().map_or(0, csv::Position::byte);
                    problems.add(line(text, at), error.to_string());
                    break;
                }
            };
            let at = line(text, record.position().map_or(0, csv::Position::byte));
            if row == 0 {
                header = record.iter().map(str::to_string).collect();
                columns = vec![Vec::new(); header.len()];
                if header.first().map(String::as_str) != Some("time") {
                    problems.add(at.clone(), "expected `time` as the first column");
                }
                for (i, name) in header.iter().enumerate() {
                    if header[..i].contains(name) {
                        problems.add(at.clone(), format!("the column `{name}` is there twice"));
                    }
                }
                continue;
            }
            for ((field, column), name) in record.iter().zip(&mut columns).zip(&header) {
                let value = match field {
                    "true" => Some(1.0),
                    "false" => Some(0.0),
                    _ => field.parse().ok().filter(|v: &f64| v.is_finite()),
                };
                match value {
                    Some(value) => column.push(value),
                    None => problems.add(at.clone(), format!("`{name}` is \"{field}\", expected a finite number")),
                }
            }
            // One faulty row tells enough; a wrong separator would fill pages.
            if !problems.is_empty() {
                break;
            }
            if let [.., before, now] = columns[0][..]
                && before >= now
            {
                problems.add(at.clone(), format!("time {now} follows {before}, expected rising times"));
                break;
            }
        }
        if problems.is_empty() {
            match columns.first().and_then(|times| times.first()) {
                None => problems.add(0..text.len(), "the file has no rows"),
                Some(first) if *first > start + slack => {
                    problems.add(line(text, 0), format!("the first row is at {first} s, after the start at {start} s"))
                }
                Some(_) => (),
            }
        }
        problems.finish()?;
        let mut columns = columns.into_iter();
        let times = columns.next().unwrap_or_default().into();
        let signals = header
            .into_iter()
            .skip(1)
            .zip(columns)
            .map(|(name, values)| Signal { name, values: values.into() })
            .collect();
        Ok(Self { times, signals })
    }

    /// Index of a column.
    pub(crate) fn index(&self, name: &str) -> Option<usize> {
        self.signals.iter().position(|s| s.name == name)
    }

    /// Reports columns that write nothing, and values that do not fit the inputs they write.
    pub(crate) fn report(
        file: &Path,
        text: &str,
        unused: &[String],
        misfits: &[String],
        known: &[String],
    ) -> Result<(), Problems> {
        let mut problems = Collector::new(file, text, "csv");
        let header = line(text, 0);
        for name in unused {
            problems.add_with_help(
                header.clone(),
                format!("no input takes the signal `{name}`"),
                suggestion(name, known.iter().map(String::as_str)),
            );
        }
        for misfit in misfits {
            problems.add(header.clone(), misfit.clone());
        }
        problems.finish()
    }
}

/// Bytes of the line that starts at `at`.
fn line(text: &str, at: u64) -> Range<usize> {
    let start = usize::try_from(at).unwrap_or(usize::MAX).min(text.len());
    let rest = text.get(start..).unwrap_or("");
    let blank = rest.len() - rest.trim_start_matches(['\r', '\n']).len();
    let start = start + blank;
    let length = rest[blank..].find(['\r', '\n']).unwrap_or(rest.len() - blank);
    start..start + length
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<InputFile, String> {
        InputFile::parse(Path::new("in.csv"), text, 0.0, 1e-12)
            .map_err(|p| p.problems.iter().map(|p| p.line()).collect())
    }

    #[test]
    fn columns_are_read() {
        let series =
            parse("time, driver.steer,road:road_height.l\n0,0.1,true\n0.5,-2e-3,0\n").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(*series.times, [0.0, 0.5]);
        assert_eq!(series.index("road:road_height.l"), Some(1));
        assert_eq!(*series.signals[0].values, [0.1, -2e-3]);
        assert_eq!(*series.signals[1].values, [1.0, 0.0]);
    }

    #[test]
    fn faults_are_reported_with_their_line() {
        for (text, expected) in [
            ("t,a\n0,1\n", "in.csv:1:1: expected `time`"),
            ("time,a,a\n0,1,1\n", "in.csv:1:1: the column `a`"),
            ("time,a\n0,x\n", "in.csv:2:1: `a` is \"x\""),
            ("time,a\n0,nan\n", "in.csv:2:1: `a` is \"nan\""),
            ("time,a\n0,1\n0,1\n", "in.csv:3:1: time 0 follows 0"),
            ("time,a\n0,1\n1\n", "in.csv:3:1: CSV error"),
            ("time,a\n1,1\n", "in.csv:1:1: the first row is at 1 s"),
            ("time,a\n", "no rows"),
            ("", "no rows"),
        ] {
            let error = parse(text).err().expect(text);
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }
}
