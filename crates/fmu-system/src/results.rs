//! Writes recordings as CSV.

use crate::master::Recording;
use crate::run::Run;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// File name of a run: its id with `@` and `#` replaced by `_`.
#[must_use]
pub fn file_name(run: &Run) -> String {
    format!("{}.csv", run.id.replace(['@', '#'], "_"))
}

/// Writes `time` and the columns that the run has, with all their names given, numbers in the shortest form that reads back
/// as the same double. The file appears complete or not at all.
///
/// # Errors
/// The folder cannot be made or the file cannot be written; the path is in the text.
pub fn write_csv(path: &Path, names: &[String], recording: &Recording) -> io::Result<()> {
    let part = part_of(path);
    let written = write_part(&part, names, recording)
        .and_then(|()| std::fs::rename(&part, path))
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())));
    if written.is_err() {
        // The first error is the one to report; what is left is only a hidden part.
        let _ = std::fs::remove_file(&part);
    }
    written
}

/// Name of the file while it is written: in the same folder, so that renaming is atomic.
fn part_of(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.part", std::process::id()))
}

/// Removes what writers of a file have left that did not come to their end.
pub fn remove_parts(path: &Path) {
    let start = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
    let entries = path.parent().and_then(|folder| std::fs::read_dir(folder).ok());
    for entry in entries.into_iter().flatten().filter_map(Result::ok) {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix(&start)?.strip_suffix(".part"));
        if number.is_some_and(|number| number.parse::<u32>().is_ok()) {
            // What is left is hidden and small.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

fn write_part(path: &Path, names: &[String], recording: &Recording) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut out = BufWriter::with_capacity(1 << 16, File::create(path)?);
    let present: Vec<(&str, &[f64])> = names
        .iter()
        .zip(&recording.columns)
        .filter_map(|(name, values)| Some((name.as_str(), values.as_deref()?)))
        .collect();
    write!(out, "time")?;
    for (name, _) in &present {
        // Names of FMI variables may hold anything.
        if name.contains([',', '"', '\n', '\r']) {
            write!(out, ",\"{}\"", name.replace('"', "\"\""))?;
        } else {
            write!(out, ",{name}")?;
        }
    }
    writeln!(out)?;
    for (row, time) in recording.time.iter().enumerate() {
        write!(out, "{time:?}")?;
        for (_, values) in &present {
            write!(out, ",{:?}", values[row])?;
        }
        writeln!(out)?;
    }
    out.into_inner()?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_exactly_and_absent_columns_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs/a.csv");
        let values = [0.1 + 0.2, -1e-300];
        let recording = Recording {
            time: vec![0.0, 0.001],
            columns: vec![Some(values.to_vec()), None, Some(vec![1.0, 5e300])],
            messages: Vec::new(),
            seconds: 0.0,
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
    fn a_failure_names_the_file_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        // A folder of that name cannot be replaced by a file.
        std::fs::create_dir(&path).unwrap();
        let recording = Recording { time: Vec::new(), columns: Vec::new(), messages: Vec::new(), seconds: 0.0 };
        let error = write_csv(&path, &[], &recording).unwrap_err().to_string();
        assert!(error.contains("a.csv"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
