//! Variables as `cargo fmu inspect` and the documentation of an FMU list them.

use fmu_import::description::{Value, Variable};

/// The lengths of an array with a blank before them, such as ` (3 x 2)`; empty for a scalar.
pub(crate) fn lengths(variable: &Variable) -> String {
    if !variable.is_array() {
        return String::new();
    }
    let lengths: Vec<String> = variable.lengths.iter().map(usize::to_string).collect();
    format!(" ({})", lengths.join(" x "))
}

/// The start value; for an array, the first few start values.
pub(crate) fn start(variable: &Variable) -> String {
    const SHOWN: usize = 3;
    let mut starts: Vec<String> = variable.start.iter().chain(&variable.starts).take(SHOWN).map(value).collect();
    if variable.starts.len() > SHOWN {
        starts.push("...".to_owned());
    }
    starts.join(" ")
}

fn value(value: &Value) -> String {
    match value {
        Value::Real(number) => format!("{number}"),
        other => other.to_string(),
    }
}
