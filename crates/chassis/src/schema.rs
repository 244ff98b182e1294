//! `chassis schema`: JSON Schemas of the formats.

use cargo_fmu::outln;
use miette::{IntoDiagnostic as _, Result};

/// Arguments of `chassis schema`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Format
    format: Format,
}

/// A format with a schema.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Format {
    /// Output of `chassis plan --json`
    Plan,
}

/// Prints the schema.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let Format::Plan = arguments.format;
    outln!("{}", serde_json::to_string_pretty(&fmu_system::plan::schema()).into_diagnostic()?);
    Ok(())
}
