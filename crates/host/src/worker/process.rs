//! A worker as the process sees it that starts it.

use super::connection::{self, Connection};
use super::output::{Output, Printed};
use super::protocol::{self, Numbers, Reader, Request, Response};
use crate::check::{Checked, Event, Finding, Severity};
use crate::linearize::Linear;
use crate::loader::calls::{self, Snapshot};
use crate::plan::Plan;
use crate::temporary::Folder;
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

/// How often the board of a worker is looked at.
const LOOK: Duration = Duration::from_millis(100);
/// How long a worker may take until it announces that it is there, whatever the timeout of a step.
const START: Duration = Duration::from_secs(60);
/// How long a worker that has closed its connection may take to end.
const FAREWELL: Duration = Duration::from_secs(1);

/// How a worker is started: the program, and the arguments that make it call [`super::serve`], before the one with the
/// path of the board.
#[derive(Debug, Clone)]
pub struct Launch {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
}

/// What workers are like.
#[derive(Clone)]
pub struct Settings {
    /// How they are started.
    pub launch: Launch,
    /// The longest that a step of a run, or a trial of a check, may take.
    pub timeout: Duration,
    /// The library of Python, for FMUs that need one.
    pub libpython: Option<PathBuf>,
    /// Takes what FMUs print.
    pub printed: Printed,
}

impl std::fmt::Debug for Settings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Settings").field("launch", &self.launch).field("timeout", &self.timeout).finish_non_exhaustive()
    }
}

/// A running worker; ended when dropped.
pub(super) struct Process {
    child: Child,
    connection: Connection,
    reader: Reader,
    board: File,
    output: Output,
    // For the board and the temporary files of FMUs.
    _folder: Folder,
}

/// A worker that has ended without a response, or was ended.
#[derive(Debug)]
pub(super) struct Ended {
    /// Start of the step it was in, s.
    pub(super) time: Option<f64>,
    /// Index of the component that it was in.
    pub(super) component: Option<usize>,
    /// How it ended and in which call.
    pub(super) message: String,
}

/// How long something has taken.
pub(super) struct Watch {
    timeout: Duration,
    since: Instant,
    pulse: Option<u64>,
    /// Whether progress starts it anew.
    is_per_step: bool,
}

impl Watch {
    pub(super) fn new(timeout: Duration) -> Self {
        Self { timeout, since: Instant::now(), pulse: None, is_per_step: true }
    }

    /// For all steps together.
    fn of_all(timeout: Duration) -> Self {
        Self { is_per_step: false, ..Self::new(timeout) }
    }

    pub(super) fn restart(&mut self) {
        self.since = Instant::now();
    }

    /// Whether there was no progress for too long.
    fn is_over(&mut self, pulse: u64) -> bool {
        if self.pulse.replace(pulse) != Some(pulse) && self.is_per_step {
            self.restart();
        }
        let limit = if pulse == 0 { self.timeout.max(START) } else { self.timeout };
        self.since.elapsed() > limit
    }
}

impl Process {
    /// Starts a worker, with the library of Python if that is asked for.
    pub(super) fn start(settings: &Settings, with_python: bool) -> io::Result<Self> {
        let folder = Folder::new()?;
        let path = folder.path().join("calls");
        let board = File::options().read(true).write(true).create_new(true).open(&path)?;
        calls::create(&board)?;
        let (pipe, output) = io::pipe()?;
        let mut command = Command::new(&settings.launch.program);
        command.args(&settings.launch.arguments).arg(path).stdout(output.try_clone()?).stderr(output);
        command.envs(["TMPDIR", "TMP", "TEMP"].map(|variable| (variable, folder.path())));
        if let Some(library) = settings.libpython.as_ref().filter(|_| with_python) {
            let mut list = library.clone().into_os_string();
            if let Some(others) = std::env::var_os("LD_PRELOAD") {
                list.push(":");
                list.push(others);
            }
            command.env("LD_PRELOAD", list);
        }
        let (child, connection) = connection::spawn(command)?;
        connection.set_patience(Some(LOOK.min(settings.timeout / 4)))?;
        let output = Output::read(pipe, settings.printed.clone())?;
        Ok(Self { child, connection, reader: Reader::new(), board, output, _folder: folder })
    }

    /// Sends a request. That the worker cannot be reached shows when its response is awaited.
    pub(super) fn send(&mut self, request: &Request, body: &[f64]) {
        let _ = protocol::write(&mut self.connection, request, &[body]);
    }

    /// Waits for a response; `steps` is told now and then how many steps are done.
    pub(super) fn receive(&mut self, watch: &mut Watch, steps: &mut dyn FnMut(u64)) -> Result<Response, Ended> {
        loop {
            match self.reader.read(&mut self.connection) {
                Ok(Some(response)) => return Ok(response),
                Err(error) if connection::is_patience_over(&error) => {
                    let Ok(snapshot) = Snapshot::read(&self.board) else { continue };
                    steps(snapshot.steps);
                    if watch.is_over(snapshot.pulse) {
                        self.kill();
                        let limit = watch.timeout.as_secs_f64();
                        return Err(self.ended(&format!("not done after {limit} s (--timeout), stopped")));
                    }
                    // A program that it has started may hold the connection open.
                    if let Ok(Some(status)) = self.child.try_wait() {
                        return Err(self.ended(&format!("the process ended ({})", words(status))));
                    }
                }
                Ok(None) => {
                    let how = match self.wait() {
                        Some(status) => format!("the process ended ({})", words(status)),
                        None => "the process closed its connection and was stopped".to_owned(),
                    };
                    return Err(self.ended(&how));
                }
                Err(error) => {
                    let how = match self.wait() {
                        Some(status) => format!("the process ended ({})", words(status)),
                        None => format!("the process was stopped because its messages cannot be read: {error};"),
                    };
                    return Err(self.ended(&how));
                }
            }
        }
    }

    /// The numbers of the last response.
    pub(super) fn body(&self) -> Numbers<'_> {
        self.reader.body()
    }

    /// What the board says about a worker that has ended in some way.
    fn ended(&self, how: &str) -> Ended {
        let snapshot = Snapshot::read(&self.board).ok();
        let call = snapshot.and_then(|snapshot| snapshot.call);
        let message = match call {
            Some((_, "")) => format!("{how} while its library was loaded"),
            Some((_, function)) => format!("{how} during {function}"),
            None => format!("{how} outside of the FMUs"),
        };
        Ended { time: snapshot.and_then(|snapshot| snapshot.time), component: call.map(|(index, _)| index), message }
    }

    /// The status of a worker whose connection is closed; `None` if it goes on and had to be ended.
    fn wait(&mut self) -> Option<ExitStatus> {
        let begin = Instant::now();
        while begin.elapsed() < FAREWELL {
            match self.child.try_wait() {
                Ok(None) => std::thread::sleep(Duration::from_millis(1)),
                Ok(status) => return status,
                Err(_) => break,
            }
        }
        self.kill();
        None
    }

    fn kill(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl std::fmt::Debug for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Process").field("id", &self.child.id()).finish_non_exhaustive()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
        self.output.finish();
    }
}

/// How a process ended.
fn words(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        let name = signal_hook::low_level::signal_name(signal).map_or(String::new(), |name| format!(", {name}"));
        return format!("signal {signal}{name}");
    }
    match status.code() {
        // Windows numbers what a crash is called elsewhere.
        Some(code) if code < 0 => format!("exit code {code:#x}"),
        Some(code) => format!("exit code {code}"),
        None => status.to_string(),
    }
}

/// Checks a `.fmu` file in a worker and returns what was found, and what was looked at. An FMU that ends the worker is one more finding.
///
/// # Errors
/// The worker cannot be started.
pub fn check(settings: &Settings, path: &Path) -> io::Result<(Vec<Finding>, Checked)> {
    let mut process = Process::start(settings, true)?;
    process.send(&Request::Check(path.to_path_buf()), &[]);
    let mut watch = Watch::new(settings.timeout);
    let mut findings = Vec::new();
    let mut checked = Checked::default();
    let mut trial = String::from("opening the file");
    loop {
        match process.receive(&mut watch, &mut |_| ()) {
            Ok(Response::Event(Event::Trying(what))) => {
                trial = what;
                watch.restart();
            }
            Ok(Response::Event(Event::Found(finding))) => findings.push(finding),
            Ok(Response::Event(Event::Checked(so_far))) => checked = so_far,
            Ok(_) => return Ok((findings, checked)),
            Err(Ended { message, .. }) => {
                findings.push(Finding { severity: Severity::Error, subject: trial, message });
                return Ok((findings, checked));
            }
        }
    }
}

/// How long all trials of a scenario may take. Those of ours take a fraction of a second.
const TRIALS: Duration = Duration::from_secs(20);

/// The warnings that the trial runs of a plan give, made in a worker. Trials that fail or take too long give none: nothing
/// depends on them.
#[must_use]
pub fn trials(settings: &Settings, plan: &Plan) -> Vec<String> {
    if plan.trials.is_empty() {
        return Vec::new();
    }
    let Ok(mut process) = Process::start(settings, true) else { return Vec::new() };
    process.send(&Request::Trials { simulation: plan.simulation, trials: plan.trials.clone() }, &[]);
    match process.receive(&mut Watch::of_all(TRIALS), &mut |_| ()) {
        Ok(Response::Warnings(warnings)) => warnings,
        _ => Vec::new(),
    }
}

/// Linearizes a `.fmu` file in a worker, at the start values with these changes.
///
/// # Errors
/// Why that does not work: the worker cannot be started, the FMU ends it, has no states with directional derivatives, or
/// does not take a value.
pub fn linearize(settings: &Settings, path: &Path, changes: &[(String, f64)]) -> Result<Linear, String> {
    let mut process =
        Process::start(settings, true).map_err(|error| format!("cannot start a worker process: {error}"))?;
    let (names, values): (Vec<String>, Vec<f64>) = changes.iter().cloned().unzip();
    process.send(&Request::Linearize { path: path.to_path_buf(), names }, &values);
    match process.receive(&mut Watch::of_all(settings.timeout), &mut |_| ()) {
        Ok(Response::Linear(linear)) => {
            let jacobian = process.body().rest();
            let [n, m, p] = [&linear.states, &linear.inputs, &linear.outputs].map(Vec::len);
            let is_complete = jacobian.len() == (n + p) * (n + m);
            let linear = Linear { jacobian, ..linear };
            is_complete.then_some(linear).ok_or_else(|| "the worker process sent an incomplete response".to_owned())
        }
        Ok(Response::Failed { message, .. }) => Err(message),
        Ok(_) => Err("the worker process sent an unexpected response".to_owned()),
        Err(Ended { message, .. }) => Err(format!("{}: {message}", path.display())),
    }
}
