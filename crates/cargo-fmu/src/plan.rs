//! `cargo fmu plan`: prints a resolved scenario.

use crate::selection::Selection;
use clap::Args;
use miette::IntoDiagnostic;
use std::io::{self, BufWriter, Write};

/// Which scenario. The plan names every run with its units, parameters, wires and recorded columns.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,
}

/// Prints the plan.
pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    let plan = arguments.selection.plan()?;
    let mut out = BufWriter::new(io::stdout().lock());
    let printed = serde_json::to_writer(&mut out, &plan)
        .map_err(io::Error::from)
        .and_then(|()| writeln!(out))
        .and_then(|()| out.flush());
    match printed {
        // A reader that has seen enough is no error.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.into_diagnostic(),
    }
}
