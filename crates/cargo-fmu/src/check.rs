//! `cargo fmu check`: validates FMUs by their description and by their behavior.

use std::collections::HashSet;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use fmu_check::{Checked, Finding, Severity, Topic};
use fmu_import::terminal::indented;
use fmu_import::worker::Printed;
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::inspect::locate;
use crate::outln;
use crate::worker;

/// Maximum number of lines shown of an FMU's output.
const MOST_PRINTED: usize = 20;

/// Arguments of `cargo fmu check`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Names of packed FMUs of this workspace, or paths of any .fmu files
    #[arg(required = true)]
    fmus: Vec<String>,
    /// Exit with 1 only for errors in this question
    #[arg(long, value_name = "QUESTION", value_enum, default_value_t = FailOn::All)]
    fail_on: FailOn,
    #[command(flatten)]
    workers: worker::Options,
}

#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum FailOn {
    /// Both questions
    All,
    /// Does the FMU simulate: loading, starting, stepping, the default experiment
    Simulation,
    /// Does the FMU follow the standard: everything else
    Standard,
}

impl FailOn {
    fn counts(self, finding: &Finding) -> bool {
        let is_asked = match self {
            Self::All => true,
            Self::Simulation => finding.topic == Topic::Simulation,
            Self::Standard => finding.topic == Topic::Standard,
        };
        is_asked && finding.severity == Severity::Error
    }
}

/// Checks each FMU in a separate process, because an FMU may crash its process. Prints the findings.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let paths = arguments.fmus.iter().map(|fmu| locate(fmu)).collect::<Result<Vec<PathBuf>>>()?;
    let mut faulty = Vec::new();
    for path in paths {
        let banner = Arc::new(Mutex::new(Banner::default()));
        let lines = Arc::clone(&banner);
        let printed: Printed = Arc::new(move |line| lines.lock().unwrap_or_else(PoisonError::into_inner).show(line));
        let mut settings = arguments.workers.settings(worker::to_terminal(), NonZeroUsize::MIN)?;
        settings.printed = printed;
        // The FMU is not trusted before it is checked.
        settings.sandbox = (!arguments.workers.is_without_sandbox()).then(Vec::new);
        let (findings, checked) =
            fmu_check::worker::check(&settings, &path).into_diagnostic().wrap_err("starting a worker process")?;
        banner.lock().unwrap_or_else(PoisonError::into_inner).end();
        let all: Vec<&Finding> = findings.iter().collect();
        outln!("{}: {}", path.display(), counted_all(&all));
        let topics = [(Topic::Simulation, "it simulates"), (Topic::Standard, "it follows the standard")]
            .map(|(topic, title)| (topic, title, all.iter().copied().filter(|f| f.topic == topic).collect::<Vec<_>>()));
        for (topic, title, findings) in &topics {
            let holds = match findings.iter().any(|f| f.severity == Severity::Error) {
                true => "no",
                false if *topic == Topic::Simulation && checked.instances == 0 => "not tried",
                false => "yes",
            };
            outln!("  {title}: {holds} ({})", counted_all(findings));
        }
        if checked != Checked::default() {
            outln!("  {}", indented(&checked.to_string(), "  "));
        }
        for finding in topics.iter().flat_map(|(.., findings)| findings) {
            outln!("  {finding}");
        }
        if findings.iter().any(|finding| arguments.fail_on.counts(finding)) {
            faulty.push(path.display().to_string());
        }
    }
    let what = if arguments.fail_on == FailOn::Simulation { "does not simulate" } else { "does not conform to FMI" };
    if faulty.is_empty() { Ok(()) } else { Err(miette!("{what}: {}", faulty.join(", "))) }
}

fn counted_all(findings: &[&Finding]) -> String {
    let count = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
    format!("{}, {}", counted(count(Severity::Error), "error"), counted(count(Severity::Warning), "warning"))
}

fn counted(count: usize, what: &str) -> String {
    match count {
        0 => format!("no {what}"),
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}

/// Lines that an FMU prints. A check makes many instances, which may print the same each time.
#[derive(Default)]
struct Banner {
    shown: HashSet<String>,
    left_out: usize,
}

impl Banner {
    fn show(&mut self, line: &str) {
        if !self.shown.contains(line) && self.shown.len() < MOST_PRINTED {
            eprintln!("FMU prints: {line}");
            self.shown.insert(line.to_owned());
        } else {
            self.left_out += 1;
        }
    }

    fn end(&self) {
        if self.left_out > 0 {
            let lines = counted(self.left_out, "line");
            eprintln!("FMU prints: ({lines} more: only the first {MOST_PRINTED} different ones are shown)");
        }
    }
}
