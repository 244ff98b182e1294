//! `Resource`: a model of the Reference FMUs of the Modelica Association, with its names. It reads a file in the FMU.

use std::path::Path;

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct Resource;

/// Outputs.
#[derive(Outputs)]
pub struct Output {
    /// Value of the first character in resources/y.txt
    pub y: i32,
}

/// The file.
#[derive(Derived)]
pub struct File {
    first: u8,
}

/// This model loads data from a resource file
#[fmu::model(stop_time = 1.0, step_size = 1.0)]
impl Continuous for Resource {
    type Outputs<T: Scalar> = Output;
    type Derived = File;

    fn load(&self, resources: &Path) -> Result<File, String> {
        let path = resources.join("y.txt");
        let bytes = std::fs::read(&path).map_err(|error| format!("'{}': {error}", path.display()))?;
        let first = *bytes.first().ok_or_else(|| format!("'{}' must have a character, got none", path.display()))?;
        Ok(File { first })
    }
    fn fingerprint(file: &File) -> u64 {
        file.first.into()
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Output {
        Output { y: at.derived.first.into() }
    }
}
