//! `LookupTable`: a torque curve from a file in the FMU. The README has the format.

use std::path::Path;

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct LookupTable {
    /// Name of the file in the resources of the FMU
    #[var(start = "torque.csv")]
    pub file: String,
    /// Factor on the torque (1)
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
}

/// Full-load torque of an engine from a table
#[fmu::model(stop_time = 10.0, step_size = 0.01)]
impl Continuous for LookupTable {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    type Derived = Curve;

    fn load(&self, resources: &Path) -> Result<Curve, String> {
        let table = Table::from_csv(resources.join(&self.file)).map_err(|error| format!("'file': {error}"))?;
        Ok(Curve { table })
    }

    fn fingerprint(curve: &Curve) -> u64 {
        curve.table.fingerprint()
    }

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { torque: at.inputs.speed.interpolate(&at.derived.table) * self.factor }
    }
}
