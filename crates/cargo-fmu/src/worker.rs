//! The subcommand `worker`: processes that execute FMUs for the other commands, and the options that these commands
//! share.

use std::collections::HashSet;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use fmu_import::terminal::line;
use fmu_import::worker::{Launch, Settings, memory_share};
use miette::{IntoDiagnostic, Result, WrapErr};

/// Arguments of the hidden subcommand `worker`: the job, and the file in which calls to FMUs are announced.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    job: String,
    board: PathBuf,
}

/// A kind of work, and the function that does it. The argument of the function is the path of the call board.
pub type Job = (&'static str, fn(&Path) -> std::io::Result<()>);

/// Serves the process that started this one. `jobs` contains all jobs of this program; the arguments select one.
pub fn run(arguments: &Arguments, jobs: &[Job]) -> Result<()> {
    let job = jobs.iter().find(|(name, _)| *name == arguments.job);
    let (_, serve) = job.ok_or_else(|| miette::miette!("unknown worker job `{}`", arguments.job))?;
    serve(&arguments.board).into_diagnostic().wrap_err("workers are started by other commands")
}

const DEFAULT_TIMEOUT: Duration = Duration::from_secs(60);

/// Options of the commands that start workers.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Time limit for a step, in seconds; an FMU that takes longer is stopped
    ///
    /// The limit also applies to each trial of `check`, and to a whole linearization or search for a steady state.
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = timeout)]
    timeout: Duration,

    /// Python library (libpython3.*.so), for FMUs made with Python that do not contain one
    #[arg(long, value_name = "FILE", env = "CHASSIS_LIBPYTHON", hide_env = true)]
    libpython: Option<PathBuf>,

    /// Memory limit of each process that executes FMUs, such as 4G or 500M, or `none`; Linux only
    /// [default: 80 % of the machine's memory, divided by the number of processes, at least 1G]
    #[arg(long, value_name = "SIZE", value_parser = memory)]
    memory: Option<Memory>,

    /// Run FMUs in a sandbox; Linux only, the default of `check`
    ///
    /// The sandbox denies FMUs the network, other programs and processes, and writing outside of their temporary folder
    /// and the folder for results.
    #[arg(long, conflicts_with = "no_sandbox")]
    sandbox: bool,

    /// Run FMUs with all of your permissions, without a sandbox
    ///
    /// Some FMUs need a license server or another program.
    #[arg(long)]
    no_sandbox: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Memory {
    Bytes(u64),
    Unlimited,
}

fn timeout(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0);
    seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).ok_or("must be a number above 0".to_owned())
}

/// Smallest memory limit with which a worker can start, bytes.
const LEAST_MEMORY: u64 = 64 << 20;

fn memory(text: &str) -> Result<Memory, String> {
    if text == "none" {
        return Ok(Memory::Unlimited);
    }
    let unit = [('K', 10), ('M', 20), ('G', 30), ('T', 40)];
    let parsed = unit.iter().find_map(|(letter, bits)| Some((text.strip_suffix(*letter)?, 1_u64 << bits)));
    let bytes = parsed.and_then(|(number, unit)| number.parse::<u64>().ok()?.checked_mul(unit));
    match bytes {
        Some(bytes) if bytes >= LEAST_MEMORY => Ok(Memory::Bytes(bytes)),
        Some(_) => Err("must be at least 64M, or `none`".to_owned()),
        None => Err("must be `none`, or a whole number followed by K, M, G or T".to_owned()),
    }
}

/// The defaults of the command line, without a Python library from the environment.
impl Default for Options {
    fn default() -> Self {
        Self { timeout: DEFAULT_TIMEOUT, libpython: None, memory: None, sandbox: false, no_sandbox: false }
    }
}

/// Receiver of lines about workers and FMUs.
pub type Lines = Arc<dyn Fn(&str) + Send + Sync>;

/// Prints lines about workers and FMUs.
pub fn to_terminal() -> Lines {
    Arc::new(|line| eprintln!("{line}"))
}

impl Options {
    /// The options that differ from the defaults, with their values. A flag has no value.
    pub fn given(&self) -> Vec<(&'static str, Option<String>)> {
        let mut given = Vec::new();
        if self.timeout != DEFAULT_TIMEOUT {
            given.push(("--timeout", Some(self.timeout.as_secs_f64().to_string())));
        }
        if let Some(file) = &self.libpython {
            given.push(("--libpython", Some(file.display().to_string())));
        }
        if let Some(memory) = self.memory {
            let text = match memory {
                Memory::Bytes(bytes) => format!("{}K", bytes >> 10),
                Memory::Unlimited => "none".to_owned(),
            };
            given.push(("--memory", Some(text)));
        }
        if self.sandbox {
            given.push(("--sandbox", None));
        }
        given
    }

    /// Time limit for a step.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Returns true with `--no-sandbox`. Only commands that use a sandbox by default call this function.
    pub(crate) fn is_without_sandbox(&self) -> bool {
        self.no_sandbox
    }

    /// Settings for a number of workers, which are processes of this program. `lines` receives the lines that FMUs
    /// print, and each note about the workers once.
    pub fn settings(&self, lines: Lines, workers: NonZeroUsize) -> Result<Settings> {
        let program = std::env::current_exe().into_diagnostic().wrap_err("finding this program")?;
        if let Some(library) = self.libpython.as_ref().filter(|library| !library.is_file()) {
            return Err(miette::miette!(
                "cannot load the Python library given with --libpython: {} does not exist",
                library.display()
            ));
        }
        let printing = Arc::clone(&lines);
        let noted = Mutex::new(HashSet::new());
        Ok(Settings {
            launch: Launch { program, arguments: vec![OsString::from("worker")] },
            timeout: self.timeout,
            libpython: self.libpython.as_ref().map(std::path::absolute).transpose().into_diagnostic()?,
            printed: Arc::new(move |line| printing(&format!("FMU prints: {line}"))),
            sandbox: self.sandbox.then(Vec::new),
            memory: match self.memory {
                None => memory_share(workers),
                Some(Memory::Bytes(bytes)) => Some(bytes),
                Some(Memory::Unlimited) => None,
            },
            noticed: Arc::new(move |note| {
                let note = format!("note: {}", line(note));
                if noted.lock().unwrap_or_else(PoisonError::into_inner).insert(note.clone()) {
                    lines(&note);
                }
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory() {
        assert_eq!(memory("none"), Ok(Memory::Unlimited));
        assert_eq!(memory("2G"), Ok(Memory::Bytes(2 << 30)));
        assert_eq!(memory("65536K"), Ok(Memory::Bytes(LEAST_MEMORY)));
        for text in ["", "2", "G", "-1G", "1.5G", "63M", "99999999999T"] {
            assert!(memory(text).is_err(), "{text}");
        }
    }
}
