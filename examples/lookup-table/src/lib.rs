//! `LookupTable`: a torque curve from a file of the FMU. The README has the format.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::Path;

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct LookupTable {
    /// Name of the file in the resources of the FMU
    #[var(start = "torque.csv")]
    pub file: String,
    /// Factor of the torque (1)
    #[var(start = 1.0, tunable)]
    pub factor: f64,
}

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Speed of the engine (rad/s)
    pub speed: T,
}

/// Outputs.
#[derive(Outputs)]
pub struct Y<T> {
    /// Full-load torque (N.m)
    pub torque: T,
}

/// The file.
#[derive(Derived)]
pub struct Curve {
    table: Table,
    hash: u64,
}

/// Full-load torque of an engine from a table
#[fmu::model(stop_time = 10.0, step_size = 0.01)]
impl Continuous for LookupTable {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    type Derived = Curve;

    fn load(&self, resources: &Path) -> Result<Curve, String> {
        let path = resources.join(&self.file);
        let text = std::fs::read_to_string(&path).map_err(|error| format!("'file': {}: {error}", path.display()))?;
        let number = |field: &str, line: usize| {
            let invalid = |_| format!("'file': {}:{line}: '{field}' is not a number", path.display());
            field.trim().parse::<f64>().map_err(invalid)
        };
        let mut points = Vec::new();
        // Line 1 has the names of the columns.
        for (line, row) in (1..).zip(text.lines()).skip(1) {
            let (speed, torque) = row.split_once(',').unwrap_or((row, ""));
            points.push((number(speed, line)?, number(torque, line)?));
        }
        let table = Table::new(points).map_err(|error| format!("'file': {}: {error}", path.display()))?;
        let mut hasher = DefaultHasher::new();
        text.hash(&mut hasher);
        Ok(Curve { table, hash: hasher.finish() })
    }

    fn fingerprint(curve: &Curve) -> u64 {
        curve.hash
    }

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { torque: at.inputs.speed.interpolate(&at.derived.table) * self.factor }
    }
}
