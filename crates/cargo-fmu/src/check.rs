//! `cargo fmu check`: judges FMUs by their description and by what they do.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use host::check::{Event, Finding, Severity};
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::inspect::locate;
use crate::output::outln;

/// Which FMUs.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Names of FMUs of this workspace (packed before), or paths of any .fmu files
    #[arg(required = true)]
    fmus: Vec<String>,
    /// Checks in this process and prints what happens as JSON, a line each
    #[arg(long, hide = true)]
    events: bool,
}

/// Checks each FMU in a process of its own, which an FMU may take down, and prints what was found.
///
/// # Errors
/// When an FMU has errors, is not there, or the process cannot be started.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    if arguments.events {
        for fmu in &arguments.fmus {
            host::check::check(Path::new(fmu), &mut |event| {
                outln!("{}", serde_json::to_string(&event).expect("events are plain data"));
            });
        }
        return Ok(());
    }
    let paths = arguments.fmus.iter().map(|fmu| locate(fmu)).collect::<Result<Vec<PathBuf>>>()?;
    let mut faulty = Vec::new();
    for path in paths {
        let findings = findings(&path)?;
        let count = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
        let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
        outln!("{}: {}, {}", path.display(), counted(errors, "error"), counted(warnings, "warning"));
        for finding in &findings {
            outln!("  {finding}");
        }
        if errors > 0 {
            faulty.push(path.display().to_string());
        }
    }
    if faulty.is_empty() { Ok(()) } else { Err(miette!("not as FMI 2.0 wants it: {}", faulty.join(", "))) }
}

fn counted(count: usize, what: &str) -> String {
    match count {
        0 => format!("no {what}"),
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}

fn findings(path: &Path) -> Result<Vec<Finding>> {
    // What the process unpacks is removed even if the FMU takes the process down.
    let temporary = tempfile::tempdir().into_diagnostic().wrap_err("making a folder for temporary files")?;
    let start = || -> std::io::Result<_> {
        Command::new(std::env::current_exe()?)
            .args(["check", "--events"])
            .arg(path)
            .envs(["TMPDIR", "TMP", "TEMP"].map(|variable| (variable, temporary.path())))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
    };
    let mut child = start().into_diagnostic().wrap_err("starting a process for the check")?;
    let mut findings = Vec::new();
    let mut trying = String::from("opening the file");
    let lines = child.stdout.take().into_iter().flat_map(|output| BufReader::new(output).lines());
    // An FMU may print lines of its own.
    for event in lines.map_while(Result::ok).filter_map(|line| serde_json::from_str(&line).ok()) {
        match event {
            Event::Trying(what) => trying = what,
            Event::Found(finding) => findings.push(finding),
        }
    }
    let status = child.wait().into_diagnostic()?;
    if !status.success() {
        findings.push(Finding {
            severity: Severity::Error,
            subject: trying,
            message: format!("the process did not survive it: {status}"),
        });
    }
    Ok(findings)
}
