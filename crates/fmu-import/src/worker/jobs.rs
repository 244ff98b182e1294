//! Jobs of the workers of this crate: checks, linearizations and steady states.

use super::process::{Ended, Process, Settings, Watch};
use super::serve::{Replies, serve as serve_requests};
use super::setup::Incident;
use crate::check::{self, Checked, Event, Finding, Options, Topic};
use crate::linearize::{self, Linear};
use crate::trim::{self, SteadyState};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// The job of workers that [`serve`].
pub const JOB: &str = "import";

/// Request to a worker.
#[derive(Debug, Serialize, Deserialize)]
enum Request {
    /// Check a `.fmu` file.
    Check(PathBuf, Options),
    /// Linearize a `.fmu` file with other values of these variables, by name.
    Linearize { path: PathBuf, changes: Vec<(String, String)> },
    /// Find the steady state of a `.fmu` file.
    Trim { path: PathBuf, settings: Vec<(String, String)>, free: Vec<Vec<String>> },
}

/// Response of a worker.
#[derive(Debug, Serialize, Deserialize)]
enum Response {
    /// Progress or a finding of a check; more follows.
    Event(Event),
    /// All is done.
    Done,
    /// The linear model; its matrix is in the body.
    Linear(Linear),
    /// The steady state.
    Trimmed(SteadyState),
    /// The job failed.
    Failed(String),
}

/// Works for the process that started this one, until the connection to it ends.
///
/// `board` is the file in which the calls are announced.
///
/// # Errors
/// The process was not started as a worker, or the connection is broken.
pub fn serve(board: &Path) -> io::Result<()> {
    serve_requests(board, respond)
}

fn respond(request: Request, _: &[f64], replies: &mut Replies) -> io::Result<()> {
    match request {
        Request::Check(path, options) => {
            let mut sent = Ok(());
            check::check(&path, &options, &mut |event| {
                if sent.is_ok() {
                    sent = replies.send(&Response::Event(event), &[]);
                }
            });
            sent?;
            replies.send(&Response::Done, &[])
        }
        Request::Linearize { path, changes } => match linearize::linearize(&path, &changes) {
            Ok(mut linear) => {
                let jacobian = std::mem::take(&mut linear.jacobian);
                replies.send(&Response::Linear(linear), &[&jacobian])
            }
            Err(message) => replies.send(&Response::Failed(message), &[]),
        },
        Request::Trim { path, settings, free } => {
            let trimmed = trim::trim(&path, &settings, &free);
            replies.send(&trimmed.map_or_else(Response::Failed, Response::Trimmed), &[])
        }
    }
}

/// Checks a `.fmu` file in a worker and returns the findings and the scope of the check. An FMU that ends the worker is one more
/// finding; the trials after that one continue in another worker, unless it took too long. Accesses denied by the sandbox, files
/// that the FMU wrote to the working directory, which is a temporary one, and processes that it left running are findings, too.
///
/// # Errors
/// The worker cannot be started.
pub fn check(settings: &Settings, path: &Path) -> io::Result<(Vec<Finding>, Checked)> {
    let mut findings = Vec::new();
    let mut checked = Checked::default();
    let mut options = Options { experiment: settings.timeout, ..Options::default() };
    loop {
        let before = checked.clone();
        let (mut trial, mut topic) = (String::from("opening the file"), Topic::Simulation);
        let mut tried = options.skip.clone();
        tried.insert(trial.clone());
        let mut process = Process::start_in(settings, JOB, true, Some(DIRECTORY))?;
        process.send(&Request::Check(std::path::absolute(path)?, options.clone()), &[]);
        let mut watch = Watch::new(settings.timeout);
        let ended = loop {
            match process.receive(&mut watch, &mut |_| ()) {
                Ok(Response::Event(Event::Trying { trial: next, topic: its })) => {
                    (trial, topic) = (next, its);
                    tried.insert(trial.clone());
                    watch.restart();
                }
                Ok(Response::Event(Event::Found(finding))) => findings.push(finding),
                Ok(Response::Event(Event::Checked(so_far))) => checked = so_far.after(&before),
                Ok(_) => break None,
                Err(ended) => break Some(ended),
            }
        };
        for finding in besides(settings, process) {
            if !findings.contains(&finding) {
                findings.push(finding);
            }
        }
        let Some(ended) = ended else { return Ok((findings, checked)) };
        // The trial ran although it is to be skipped: the others need it.
        if options.skip.contains(&trial) {
            return Ok((findings, checked));
        }
        findings.push(Finding::error(trial, ended.message).about(topic));
        if ended.is_timeout {
            return Ok((findings, checked));
        }
        options.skip = tried;
    }
}

/// Name of the working directory of a check.
const DIRECTORY: &str = "directory";

/// Ends a worker and returns the findings about what it leaves behind.
fn besides(settings: &Settings, mut process: Process) -> Vec<Finding> {
    let mut findings: Vec<Finding> =
        process.finish().iter().filter_map(|incident| finding(settings, incident)).collect();
    let written = std::fs::read_dir(process.folder().join(DIRECTORY));
    let is_removed = written.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::NotFound);
    let mut written: Vec<String> = written
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    written.sort();
    let message = match written.len() {
        _ if is_removed => "removes the working directory of its master".to_owned(),
        0 => return findings,
        _ => format!("writes to the working directory of its master: {}", written.join(", ")),
    };
    findings.push(Finding::warning("files", message).about(Topic::Simulation));
    findings
}

/// The finding about an incident; `None` for a missing feature of this machine.
fn finding(settings: &Settings, incident: &Incident) -> Option<Finding> {
    let subject = match incident {
        Incident::Denied { .. } => "sandbox",
        Incident::Left { .. } => "processes",
        Incident::Memory { .. } => "memory",
        Incident::NoSandbox(_) => {
            (settings.noticed)(&incident.to_string());
            return None;
        }
    };
    let remedy = match incident {
        Incident::Denied { .. } => " (--no-sandbox allows it)",
        _ => "",
    };
    Some(Finding::warning(subject, format!("{incident}{remedy}")).about(Topic::Simulation))
}

/// Linearizes a `.fmu` file in a worker, at the start values with these changes.
///
/// # Errors
/// The worker cannot be started, the FMU ends it, has no states, or does not take a value.
pub fn linearize(settings: &Settings, path: &Path, changes: &[(String, String)]) -> Result<Linear, String> {
    let mut process =
        Process::start(settings, JOB, true).map_err(|error| format!("cannot start a worker process: {error}"))?;
    process.send(&Request::Linearize { path: path.to_path_buf(), changes: changes.to_vec() }, &[]);
    match process.receive(&mut Watch::of_all(settings.timeout), &mut |_| ()) {
        Ok(Response::Linear(linear)) => {
            let jacobian = process.body().rest();
            let [n, m, p] = [&linear.states, &linear.inputs, &linear.outputs].map(Vec::len);
            let is_complete = jacobian.len() == (n + p) * (n + m);
            let linear = Linear { jacobian, ..linear };
            is_complete.then_some(linear).ok_or_else(|| "the worker process sent an incomplete response".to_owned())
        }
        Ok(Response::Failed(message)) => Err(message),
        Ok(_) => Err("the worker process sent an unexpected response".to_owned()),
        Err(Ended { message, .. }) => Err(format!("{}: {message}", path.display())),
    }
}

/// Finds the steady state of a `.fmu` file in a worker: see [`trim::trim`].
///
/// # Errors
/// The worker cannot be started, the FMU ends it, has no states with directional derivatives, does not take a value, or has a
/// state that cannot rest.
pub fn trim(
    settings: &Settings,
    path: &Path,
    changes: &[(String, String)],
    free: &[Vec<String>],
) -> Result<SteadyState, String> {
    let mut process =
        Process::start(settings, JOB, true).map_err(|error| format!("cannot start a worker process: {error}"))?;
    let request = Request::Trim { path: path.to_path_buf(), settings: changes.to_vec(), free: free.to_vec() };
    process.send(&request, &[]);
    match process.receive(&mut Watch::of_all(settings.timeout), &mut |_| ()) {
        Ok(Response::Trimmed(steady)) => Ok(steady),
        Ok(Response::Failed(message)) => Err(message),
        Ok(_) => Err("the worker process sent an unexpected response".to_owned()),
        Err(Ended { message, .. }) => Err(format!("{}: {message}", path.display())),
    }
}
