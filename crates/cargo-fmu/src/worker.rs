//! `cargo fmu worker`: the processes that execute FMUs for the other commands, and the options of these about them.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use fmu_import::worker::{Launch, Printed, Settings};
use miette::{IntoDiagnostic, Result, WrapErr};

/// What to work at, and the file in which calls of FMUs are announced.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    job: String,
    board: PathBuf,
}

/// Works for the process that started this one.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let serve = match arguments.job.as_str() {
        fmu_import::worker::JOB => fmu_import::worker::serve,
        #[cfg(feature = "system")]
        fmu_system::worker::JOB => fmu_system::worker::serve,
        job => return Err(miette::miette!("there is no worker for `{job}`")),
    };
    serve(&arguments.board).into_diagnostic().wrap_err("a worker is started by other commands")
}

/// Longest time for a step, unless another is given.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(60);

/// What the commands say that start workers.
#[derive(clap::Args, Debug)]
pub(crate) struct Options {
    /// Longest time for a step of a run, a trial of a check or a linearization; an FMU that takes longer is stopped
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = timeout)]
    timeout: Duration,

    /// Library of Python (libpython3.*.so), for FMUs made with Python that do not bring it along
    #[arg(long, value_name = "FILE")]
    libpython: Option<PathBuf>,
}

fn timeout(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0);
    seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).ok_or("must be a number above 0".to_owned())
}

/// What other commands use: those of no FMU made with Python.
#[cfg(feature = "system")]
impl Default for Options {
    fn default() -> Self {
        Self { timeout: DEFAULT_TIMEOUT, libpython: None }
    }
}

/// Prints what FMUs print.
pub(crate) fn printed() -> Printed {
    Arc::new(|line| eprintln!("FMU prints: {line}"))
}

impl Options {
    /// The options that differ from the defaults, with their values.
    pub(crate) fn given(&self) -> Vec<(&'static str, String)> {
        let timeout = (self.timeout != DEFAULT_TIMEOUT).then(|| ("--timeout", self.timeout.as_secs_f64().to_string()));
        let library = self.libpython.as_ref().map(|file| ("--libpython", file.display().to_string()));
        timeout.into_iter().chain(library).collect()
    }

    /// Settings of workers that start this program. `printed` takes what FMUs print.
    pub(crate) fn settings(&self, printed: Printed) -> Result<Settings> {
        let program = std::env::current_exe().into_diagnostic().wrap_err("finding this program")?;
        if let Some(library) = self.libpython.as_ref().filter(|library| !library.is_file()) {
            return Err(miette::miette!("there is no file {}, the library of Python", library.display()));
        }
        Ok(Settings {
            launch: Launch { program, arguments: vec![OsString::from("worker")] },
            timeout: self.timeout,
            libpython: self.libpython.as_ref().map(std::path::absolute).transpose().into_diagnostic()?,
            printed,
        })
    }
}
