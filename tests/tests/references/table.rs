//! Files of reference data.

use std::io::Read;

/// A table of numbers with named columns.
pub(crate) struct Table {
    /// Names of the columns.
    pub(crate) names: Vec<String>,
    /// Rows; absent cells are NaN.
    pub(crate) rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads `references/NAME.csv.gz`.
    ///
    /// # Panics
    /// If the file is missing or is not a table of numbers.
    pub(crate) fn read(name: &str) -> Self {
        let path = tests::workspace().join("tests/references").join(format!("{name}.csv.gz"));
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut text = String::new();
        flate2::read::GzDecoder::new(&bytes[..])
            .read_to_string(&mut text)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut lines = text.lines();
        let names: Vec<_> = lines.next().expect("a line of names").split(',').map(str::to_owned).collect();
        let number = |cell: &str| if cell.is_empty() { f64::NAN } else { cell.parse().expect("cells are numbers") };
        let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(number).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == names.len()), "{}: rows of different length", path.display());
        Self { names, rows }
    }

    /// Values of a column.
    ///
    /// # Panics
    /// If there is no column with this name.
    pub(crate) fn column(&self, name: &str) -> Vec<f64> {
        let column = self.names.iter().position(|column| column == name);
        let column = column.unwrap_or_else(|| panic!("the file has no column {name}"));
        self.rows.iter().map(|row| row[column]).collect()
    }
}
