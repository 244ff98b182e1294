//! `cargo fmu check`: validates FMUs by their description and by their behavior.

use std::path::PathBuf;

use fmu_import::check::{Checked, Severity};
use fmu_import::terminal::indented;
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::inspect::locate;
use crate::output::outln;
use crate::worker;

/// Which FMUs.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Names of FMUs of this workspace (packed before), or paths of any .fmu files
    #[arg(required = true)]
    fmus: Vec<String>,
    #[command(flatten)]
    workers: worker::Options,
}

/// Checks each FMU in a process of its own, which an FMU may take down, and prints what was found.
///
/// # Errors
/// When an FMU has errors, is not there, or the process cannot be started.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let settings = arguments.workers.settings(worker::printed())?;
    let paths = arguments.fmus.iter().map(|fmu| locate(fmu)).collect::<Result<Vec<PathBuf>>>()?;
    let mut faulty = Vec::new();
    for path in paths {
        let (findings, checked) =
            fmu_import::worker::check(&settings, &path).into_diagnostic().wrap_err("starting a worker process")?;
        let count = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
        let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
        outln!("{}: {}, {}", path.display(), counted(errors, "error"), counted(warnings, "warning"));
        if checked != Checked::default() {
            outln!("  {}", indented(&checked.to_string(), "  "));
        }
        for finding in &findings {
            outln!("  {finding}");
        }
        if errors > 0 {
            faulty.push(path.display().to_string());
        }
    }
    if faulty.is_empty() { Ok(()) } else { Err(miette!("does not conform to FMI: {}", faulty.join(", "))) }
}

fn counted(count: usize, what: &str) -> String {
    match count {
        0 => format!("no {what}"),
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}
