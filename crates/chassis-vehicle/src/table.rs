//! Tables of measured or prescribed signals, read from text with comma-separated values.
//!
//! # Format
//!
//! The first line contains the column names, every further line a row of finite numbers. Blank lines and lines that
//! start with `#` are skipped. Spaces around a field are ignored. A byte order mark and Windows line ends are accepted.
//! Quoted fields are rejected. A [`Table`] requires an abscissa (time or distance) that increases strictly; [`Columns`]
//! have no abscissa.
//!
//! The path is untrusted input: only regular files of limited size are read, and an error message contains the position
//! of the problem, never the content of the file.
//!
//! ```
//! # use chassis_vehicle::table::Table;
//! let text = "time,driver.steer\n0,0\n2,0.1\n";
//! let table = Table::parse(text, "steer.csv", "time", &["driver.steer", "driver.speed"])?;
//! assert_eq!(table.at(0, 1.0), Some(0.05));
//! assert_eq!(table.at(1, 1.0), None); // the file has no such column
//! # Ok::<(), String>(())
//! ```

use std::fs::{File, Metadata};
use std::io::{Error, Read as _};
use std::path::Path;

/// Size of the largest file that is read, in bytes: 64 MiB hold four signals, sampled every millisecond for 20 minutes.
const LARGEST: u64 = 64 << 20;

/// Reads the file that a parameter names. Returns its full path and its text. A relative path starts at `resources`,
/// the resources folder of the FMU.
///
/// # Errors
///
/// If the path is empty, or the file cannot be read, is not a regular file, is larger than 64 MiB or is not UTF-8. The
/// message contains the parameter and the path.
pub fn read_file(parameter: &str, file: &str, resources: &Path) -> Result<(String, String), String> {
    if file.is_empty() {
        return Err(format!("'{parameter}' must be the path of a CSV file, it is empty"));
    }
    let path = resources.join(file);
    let text = read_regular(&path, LARGEST).map_err(|error| {
        format!(
            "'{parameter}' = {file}: {} cannot be read ({error}); name a CSV file, a relative path starts at the \
             resources folder of the FMU",
            path.display()
        )
    })?;
    Ok((path.display().to_string(), text))
}

/// The text of a regular file of at most `largest` bytes.
fn read_regular(path: &Path, largest: u64) -> Result<String, Error> {
    let check = |metadata: &Metadata| {
        if !metadata.is_file() {
            Err(Error::other("it is not a regular file"))
        } else if metadata.len() > largest {
            Err(Error::other(format!("it has {} bytes, at most {largest} are allowed", metadata.len())))
        } else {
            Ok(())
        }
    };
    // Checked before opening, because opening a pipe would wait for its other end. Checked again after opening, in case
    // the file was replaced.
    check(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    check(&file.metadata()?)?;
    let mut text = String::new();
    // The file may still be growing.
    if file.take(largest + 1).read_to_string(&mut text)? as u64 > largest {
        return Err(Error::other(format!("it has more than {largest} bytes")));
    }
    Ok(text)
}

/// Columns of numbers, such as the points of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    values: Vec<Option<Vec<f64>>>,
    lines: Vec<usize>,
    content_hash: u64,
}

impl Columns {
    /// Reads columns, all of which are required. `path` only appears in messages. [`Columns::column`] counts the
    /// columns in the order of `names`.
    ///
    /// # Errors
    ///
    /// If a column is missing, unknown or given twice, the table is empty, a row and the header differ in their number of
    /// fields, or a field is not a finite number. The message contains path, line and column, but not the content of
    /// the file.
    pub fn parse(text: &str, path: &str, names: &[&str]) -> Result<Self, String> {
        let expected = format!("`{}`", names.join("`, `"));
        Self::read(text, path, names, &expected, |found| found.len() == names.len())
    }

    /// Reads the `known` columns that are in the file. `is_complete` decides whether the names of these columns are
    /// sufficient.
    fn read(
        text: &str,
        path: &str,
        known: &[&str],
        expected: &str,
        is_complete: impl Fn(&[&str]) -> bool,
    ) -> Result<Self, String> {
        let content = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = content
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line.trim()))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));

        let (header_line, header) =
            lines.next().ok_or_else(|| format!("{path}: the file is empty, expected columns {expected}"))?;
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        for (index, name) in names.iter().enumerate() {
            if !known.contains(name) {
                return Err(format!(
                    "{path}:{header_line}: the name of column {} is unknown, expected {expected}",
                    index + 1
                ));
            }
            if names[..index].contains(name) {
                return Err(format!("{path}:{header_line}: column `{name}` appears twice"));
            }
        }
        if !is_complete(&names) {
            // Repeating the header is safe: it consists of known names.
            return Err(format!("{path}:{header_line}: expected columns {expected}, found only `{header}`"));
        }

        let mut data: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
        let mut line_of_row = Vec::new();
        for (line, row) in lines {
            let fields = row.split(',').count();
            if fields != names.len() {
                return Err(format!("{path}:{line}: {fields} fields, expected {} as in the first line", names.len()));
            }
            for ((field, name), values) in row.split(',').zip(&names).zip(&mut data) {
                let field = field.trim();
                let value = field.parse::<f64>().ok().filter(|value| value.is_finite());
                values.push(value.ok_or_else(|| {
                    format!("{path}:{line}: column `{name}` is not a finite number with a decimal point")
                })?);
            }
            line_of_row.push(line);
        }
        if line_of_row.is_empty() {
            return Err(format!("{path}:{header_line}: no row after the column names"));
        }
        let mut take = |name: &&str| {
            let index = names.iter().position(|found| found == name)?;
            Some(std::mem::take(&mut data[index]))
        };
        Ok(Self {
            values: known.iter().map(&mut take).collect(),
            lines: line_of_row,
            content_hash: content_hash(text.as_bytes()),
        })
    }

    /// The values of a column, one per row.
    ///
    /// # Panics
    ///
    /// If the index is out of bounds.
    pub fn column(&self, column: usize) -> &[f64] {
        self.values[column].as_deref().expect("all columns are there")
    }

    /// Line number of a row in the file.
    ///
    /// # Panics
    ///
    /// If the index is out of bounds.
    pub fn line(&self, row: usize) -> usize {
        self.lines[row]
    }

    /// The [`content_hash`] of the file.
    pub fn content_hash(&self) -> u64 {
        self.content_hash
    }
}

/// Signals over an increasing abscissa, interpolated linearly.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    abscissa: Vec<f64>,
    columns: Vec<Option<Vec<f64>>>,
    content_hash: u64,
}

impl Table {
    /// Reads a table. `path` only appears in messages. The column `abscissa` is required. The file must contain at
    /// least one of the `columns`; [`Table::at`] counts them in this order.
    ///
    /// # Errors
    ///
    /// In the same cases as [`Columns::parse`], and if the abscissa does not increase.
    pub fn parse(text: &str, path: &str, abscissa: &str, columns: &[&str]) -> Result<Self, String> {
        let known: Vec<&str> = std::iter::once(abscissa).chain(columns.iter().copied()).collect();
        let expected = format!("`{abscissa}` and any of `{}`", columns.join("`, `"));
        let is_complete = |found: &[&str]| found.contains(&abscissa) && found.len() > 1;
        let Columns { mut values, lines, content_hash } = Columns::read(text, path, &known, &expected, is_complete)?;
        let points = values.remove(0).unwrap_or_default();
        if let Some(row) = points.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(format!(
                "{path}:{}: column `{abscissa}` is not greater than in the row before, expected strictly increasing values",
                lines[row + 1]
            ));
        }
        Ok(Self { abscissa: points, columns: values, content_hash })
    }

    /// The values of the abscissa: at least one, strictly increasing.
    pub fn abscissa(&self) -> &[f64] {
        &self.abscissa
    }

    /// The values of a column, one per row; `None` if the file does not have it.
    pub fn column(&self, column: usize) -> Option<&[f64]> {
        self.columns.get(column)?.as_deref()
    }

    /// The value of a column at `x`, interpolated linearly between the rows and held constant outside. `None` if the
    /// file does not have the column.
    pub fn at(&self, column: usize, x: f64) -> Option<f64> {
        let values = self.column(column)?;
        let next = self.next_row(x);
        Some(if next == 0 {
            values[0]
        } else if next == values.len() {
            values[next - 1]
        } else {
            let share = (x - self.abscissa[next - 1]) / (self.abscissa[next] - self.abscissa[next - 1]);
            values[next - 1] + (values[next] - values[next - 1]) * share
        })
    }

    /// Index of the first row after `x`, or the number of rows if `x` is not before any row.
    pub fn next_row(&self, x: f64) -> usize {
        self.abscissa.partition_point(|point| *point <= x)
    }

    /// The [`content_hash`] of the file.
    pub fn content_hash(&self) -> u64 {
        self.content_hash
    }
}

/// FNV-1a hash (64 bit) of a file's content. A model saves it in the FMU state, and rejects a saved state that was made
/// with a different file. The hash is not cryptographic: it guards against mistakes, not against tampering.
///
/// # Reference
///
/// Fowler, Noll, Vo, Eastlake: The FNV Non-Cryptographic Hash Algorithm.
pub fn content_hash(content: &[u8]) -> u64 {
    content.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Table, String> {
        Table::parse(text, "a.csv", "time", &["steer", "speed"])
    }

    /// The values are exact in binary, so the comparison is exact.
    #[test]
    fn interpolates_between_and_holds_outside() {
        let table = parse("\u{feff}time, speed\r\n\r\n# a comment\r\n1, 10\r\n3, 20\r\n").unwrap();
        let at = |x| table.at(1, x).unwrap();
        assert_eq!([at(0.0), at(1.0), at(1.5), at(3.0), at(9.0)], [10.0, 10.0, 12.5, 20.0, 20.0]);
        assert_eq!(table.at(0, 1.0), None);
        assert_eq!(table.at(7, 1.0), None);
        assert_eq!(table.abscissa(), [1.0, 3.0]);
        assert_eq!(table.next_row(0.0), 0);
        assert_eq!(table.next_row(3.0), 2);
    }

    #[test]
    fn rejects_with_line_and_column() {
        for (text, message) in [
            ("", "a.csv: the file is empty, expected columns `time` and any of `steer`, `speed`"),
            ("time,wheel\n", "a.csv:1: the name of column 2 is unknown, expected `time` and any of `steer`, `speed`"),
            ("time,time\n", "a.csv:1: column `time` appears twice"),
            ("\nsteer\n1\n", "a.csv:2: expected columns `time` and any of `steer`, `speed`, found only `steer`"),
            ("time\n1\n", "a.csv:1: expected columns `time` and any of `steer`, `speed`, found only `time`"),
            ("time,steer\n", "a.csv:1: no row after the column names"),
            ("time,steer\n0,1\n1\n", "a.csv:3: 1 fields, expected 2 as in the first line"),
            ("time,steer\n0,x\n", "a.csv:2: column `steer` is not a finite number with a decimal point"),
            ("time,steer\n0,inf\n", "a.csv:2: column `steer` is not a finite number with a decimal point"),
            (
                "time,steer\n0,1\n#\n0,2\n",
                "a.csv:4: column `time` is not greater than in the row before, expected strictly increasing values",
            ),
        ] {
            assert_eq!(parse(text).unwrap_err(), message);
        }
    }

    #[test]
    fn columns_need_no_order() {
        let columns = Columns::parse("# a path\ny, x\n0,1\n\n2,1\n-1,0.5\n", "a.csv", &["x", "y"]).unwrap();
        assert_eq!(columns.column(0), [1.0, 1.0, 0.5]);
        assert_eq!(columns.column(1), [0.0, 2.0, -1.0]);
        assert_eq!([0, 1, 2].map(|row| columns.line(row)), [3, 5, 6]);
        for (text, message) in [
            ("x\n1\n", "a.csv:1: expected columns `x`, `y`, found only `x`"),
            ("x,z\n", "a.csv:1: the name of column 2 is unknown, expected `x`, `y`"),
            ("x,y\n", "a.csv:1: no row after the column names"),
            ("x,y\n1,nan\n", "a.csv:2: column `y` is not a finite number with a decimal point"),
        ] {
            assert_eq!(Columns::parse(text, "a.csv", &["x", "y"]).unwrap_err(), message);
        }
    }

    #[test]
    fn reads_the_file_of_a_parameter() {
        let resources = Path::new(env!("CARGO_MANIFEST_DIR"));
        let (path, text) = read_file("table.file", "Cargo.toml", resources).unwrap();
        assert!(path.ends_with("Cargo.toml") && text.contains("chassis"));
        // an absolute path is used unchanged
        assert_eq!(read_file("table.file", &path, Path::new("nowhere")).unwrap(), (path, text));
        let message = read_file("table.file", "no.csv", resources).unwrap_err();
        assert!(message.starts_with("'table.file' = no.csv: ") && message.contains("name a CSV file"));
        let message = read_file("table.file", "", resources).unwrap_err();
        assert_eq!(message, "'table.file' must be the path of a CSV file, it is empty");
    }

    /// A FIFO would block, a device would never end, and a folder has no text: each is rejected before it is opened.
    #[test]
    fn reads_regular_files_only() {
        let folder = tempfile::tempdir().unwrap();
        let rejected = |path: &Path| read_regular(path, 10).unwrap_err().to_string();
        assert_eq!(rejected(folder.path()), "it is not a regular file");
        let file = folder.path().join("a.csv");
        std::fs::write(&file, "0123456789").unwrap();
        assert_eq!(read_regular(&file, 10).unwrap(), "0123456789");
        assert_eq!(read_regular(&file, 9).unwrap_err().to_string(), "it has 10 bytes, at most 9 are allowed");
        std::fs::write(&file, [0xff, 0xfe]).unwrap();
        assert!(rejected(&file).contains("UTF-8"));
        #[cfg(unix)]
        {
            assert_eq!(rejected(Path::new("/dev/zero")), "it is not a regular file");
            let fifo = folder.path().join("fifo");
            assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
            assert_eq!(rejected(&fifo), "it is not a regular file");
            // a link is treated as its target
            std::fs::write(&file, "0").unwrap();
            let link = folder.path().join("link");
            std::os::unix::fs::symlink(&file, &link).unwrap();
            assert_eq!(read_regular(&link, 10).unwrap(), "0");
        }
    }

    /// No message repeats the content of a rejected file: readers of the log may not be allowed to see it.
    #[test]
    fn messages_do_not_repeat_the_file() {
        const SECRET: &str = "31415";
        for text in [
            format!("{SECRET}\n"),
            format!("time,{SECRET}\n"),
            format!("time,steer\n{SECRET}\n"),
            format!("time,steer\n0,x{SECRET}\n"),
            format!("time,steer\n{SECRET},0\n{SECRET},0\n"),
            format!("time\n{SECRET}\n"),
            format!("# {SECRET}\n"),
        ] {
            let message = parse(&text).unwrap_err();
            assert!(!message.contains(SECRET), "{message}");
        }
    }

    /// Reference: the published FNV-1a test vectors for the empty text and for "a".
    #[test]
    fn content_hash_is_fnv_1a() {
        assert_eq!(content_hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(content_hash(b"a"), 0xaf63_dc4c_8601_ec8c);
        let text = "time,steer\n0,0\n";
        assert_eq!(parse(text).unwrap().content_hash(), content_hash(text.as_bytes()));
    }
}
