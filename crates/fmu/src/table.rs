//! Tables of a function of one variable.

use std::path::Path;

/// A function of one variable, given by points: linear between them and constant outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    x: Box<[f64]>,
    y: Box<[f64]>,
}

impl Table {
    /// A table from one or more points. Fails if a number is not finite, or if `x` does not increase.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Result<Self, String> {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        if x.is_empty() {
            return Err("a table needs at least one point".to_owned());
        }
        if let Some(i) = (0..x.len()).find(|&i| !(x[i].is_finite() && y[i].is_finite())) {
            return Err(format!("point {} of the table is ({}, {}); both must be finite", i + 1, x[i], y[i]));
        }
        if let Some(i) = (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
            return Err(format!("the first column of the table must increase, but {} follows {}", x[i], x[i - 1]));
        }
        Ok(Self { x: x.into(), y: y.into() })
    }

    /// Reads a table from a text file with two columns. Call it in `load` to read a file from the FMU's resources.
    ///
    /// The columns are separated by commas, semicolons or tabs. With semicolons or tabs, numbers can have a decimal
    /// comma. The first line can contain the column names. Blank lines and lines that start with `#` are skipped. Fails
    /// if the file cannot be read, a line does not contain two numbers, or [`Self::new`] rejects the points.
    pub fn from_csv(path: impl AsRef<Path>) -> Result<Self, String> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|error| {
            format!(
                "{}: {error}; put the file into the folder `resources` of the package, and join its path to the argument \
                 `resources` of `load`",
                path.display()
            )
        })?;
        let rows = rows(&text).map_err(|(line, message)| format!("{}:{line}: {message}", path.display()))?;
        let descent = rows.windows(2).find(|rows| rows[1].1 <= rows[0].1);
        if let Some([(_, before, _), (line, x, _)]) = descent {
            return Err(format!("{}:{line}: the first column must increase, but {x} follows {before}", path.display()));
        }
        Self::new(rows.into_iter().map(|(_, x, y)| (x, y))).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Hash of the points, for the function `fingerprint` of a model. It is the same on every platform.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        // FNV-1a over the bytes of all numbers.
        let numbers = self.x.iter().chain(&self.y);
        let bytes = numbers.flat_map(|number| number.to_bits().to_le_bytes());
        bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
    }

    /// Value and slope at `x`.
    #[must_use]
    pub fn at(&self, x: f64) -> (f64, f64) {
        let above = self.x.partition_point(|&point| point <= x);
        if above == 0 {
            return (self.y[0], 0.0);
        }
        let below = above - 1;
        if above == self.x.len() {
            return (self.y[below], 0.0);
        }
        let slope = (self.y[above] - self.y[below]) / (self.x[above] - self.x[below]);
        (self.y[below] + slope * (x - self.x[below]), slope)
    }
}

/// Line number, `x`, `y`.
type Row = (usize, f64, f64);

/// Parses the rows of a text; an error contains the line number.
fn rows(text: &str) -> Result<Vec<Row>, (usize, String)> {
    let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines().map(str::trim));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).peekable();
    let first = lines.peek().map_or("", |(_, line)| line);
    let separator = ['\t', ';'].into_iter().find(|&separator| first.contains(separator)).unwrap_or(',');
    let number = |field: &str| {
        let field = if separator == ',' { field.trim().to_owned() } else { field.trim().replace(',', ".") };
        field.parse::<f64>().ok().filter(|number| number.is_finite())
    };
    let mut rows = Vec::new();
    let mut is_first = true;
    for (line, row) in lines {
        let fields: Vec<&str> = row.split(separator).collect();
        let [x, y] = fields[..] else {
            let message = format!("a row must have two columns, got {}: `{row}`", fields.len());
            return Err((line, message));
        };
        match (number(x), number(y)) {
            (Some(x), Some(y)) => rows.push((line, x, y)),
            // Column names.
            (None, None) if is_first => {}
            (None, _) => return Err((line, format!("`{}` is not a finite number", x.trim()))),
            (_, None) => return Err((line, format!("`{}` is not a finite number", y.trim()))),
        }
        is_first = false;
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_from_a_file() {
        let folder = std::env::temp_dir().join(format!("fmu-table-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("pump.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Table::from_csv(&path).map_err(|error| error.replace(&*path.to_string_lossy(), "pump.csv"))
        };
        let table = Table::new([(0.0, 6.0), (0.25, 5.5)]).unwrap();
        for text in [
            "0,6\n0.25,5.5\n",
            "\u{feff}flow,pressure\r\n0, 6\r\n\r\n# measured\r\n0.25, 5.5\r\n",
            "flow;pressure\n0;6\n0,25;5,5",
            "0\t6\n0.25\t5.5\n",
        ] {
            assert_eq!(read(text).as_ref(), Ok(&table), "{text:?}");
        }
        for (text, message) in [
            ("", "pump.csv: a table needs at least one point"),
            ("flow,pressure\n", "pump.csv: a table needs at least one point"),
            ("flow,pressure\n0,6,1\n", "pump.csv:2: a row must have two columns, got 3: `0,6,1`"),
            ("flow,pressure\n0,six\n", "pump.csv:2: `six` is not a finite number"),
            ("flow,pressure\nflow,pressure\n", "pump.csv:2: `flow` is not a finite number"),
            ("0,6\n\n1,inf\n", "pump.csv:3: `inf` is not a finite number"),
            ("0,6\n1,5\n1,4\n", "pump.csv:3: the first column must increase, but 1 follows 1"),
        ] {
            assert_eq!(read(text).unwrap_err(), message, "{text:?}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
        let missing = Table::from_csv(&path).unwrap_err();
        assert!(
            missing.contains("pump.csv: ") && missing.contains("the folder `resources` of the package"),
            "{missing}"
        );
    }

    #[test]
    fn a_fingerprint_depends_on_all_points() {
        let fingerprint = |points: [(f64, f64); 2]| Table::new(points).unwrap().fingerprint();
        let first = fingerprint([(0.0, 1.0), (1.0, 2.0)]);
        assert_eq!(fingerprint([(0.0, 1.0), (1.0, 2.0)]), first);
        for other in [[(0.0, 1.0), (1.0, 3.0)], [(-1.0, 1.0), (1.0, 2.0)], [(0.0, 2.0), (1.0, 1.0)]] {
            assert_ne!(fingerprint(other), first);
        }
    }

    #[test]
    fn a_table_is_linear_between_its_points_and_constant_outside() {
        let table = Table::new([(0.0, 1.0), (2.0, 5.0), (3.0, 4.0)]).unwrap();
        assert_eq!([-1.0, 0.0, 0.5, 2.0, 2.25, 9.0].map(|x| table.at(x).0), [1.0, 1.0, 2.0, 5.0, 4.75, 4.0]);
        assert_eq!([-1.0, 0.5, 2.25, 9.0].map(|x| table.at(x).1), [0.0, 2.0, -1.0, 0.0]);
    }

    #[test]
    fn impossible_tables_are_rejected() {
        assert_eq!(Table::new([]).unwrap_err(), "a table needs at least one point");
        let error = Table::new([(1.0, 0.0), (1.0, 2.0)]).unwrap_err();
        assert_eq!(error, "the first column of the table must increase, but 1 follows 1");
        let error = Table::new([(1.0, f64::NAN)]).unwrap_err();
        assert_eq!(error, "point 1 of the table is (1, NaN); both must be finite");
    }
}
