//! Reference data: gzip CSV files in `references/`, and the comparison of runs with them.

use std::io::Read;
use std::path::Path;

/// A table of numbers with named columns.
#[derive(Clone, Debug)]
pub struct Table {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads `references/NAME.csv.gz`.
    ///
    /// # Panics
    /// When the file is missing or no table of numbers.
    #[must_use]
    pub fn read(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("references").join(format!("{name}.csv.gz"));
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut text = String::new();
        flate2::read::GzDecoder::new(&bytes[..])
            .read_to_string(&mut text)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut lines = text.lines();
        let names: Vec<_> = lines.next().expect("a line of names").split(',').map(str::to_owned).collect();
        let rows: Vec<Vec<f64>> =
            lines.map(|line| line.split(',').map(|cell| cell.parse().expect("cells are numbers")).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == names.len()), "{}: rows of different length", path.display());
        Self { names, rows }
    }

    /// Position of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|column| column == name)
    }
}

/// Magnitude that a reference column counts as having at least, so that columns that are zero up to rounding pass.
pub const FLOOR: f64 = 1e-6;

/// The worst column of a comparison: name, largest |error| over largest |reference|.
///
/// # Panics
/// When nothing is compared or the shapes differ.
#[must_use]
pub fn worst(names: &[String], expected: &[Vec<f64>], found: &[Vec<f64>]) -> (String, f64) {
    assert!(!names.is_empty() && !expected.is_empty() && expected.len() == found.len(), "nothing to compare");
    let relative = |column: usize| {
        let peak = expected.iter().fold(FLOOR, |peak, row| peak.max(row[column].abs()));
        let errors = expected.iter().zip(found).map(|(a, b)| (a[column] - b[column]).abs());
        // A result that is not a number must not get lost in a maximum.
        errors.fold(0.0, |worst: f64, error| if error.is_finite() { worst.max(error) } else { f64::INFINITY }) / peak
    };
    let mut all: Vec<_> = names.iter().enumerate().map(|(column, name)| (name.clone(), relative(column))).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.swap_remove(0)
}
