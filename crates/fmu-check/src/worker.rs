//! Checks in worker processes.

use crate::{Checked, Event, Finding, Options, Topic};
use fmu_import::worker::{Incident, Process, Replies, Settings, Watch, serve_requests};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// Job name of workers that [`serve`].
pub const JOB: &str = "check";

#[derive(Debug, Serialize, Deserialize)]
struct Request(PathBuf, Options);

#[derive(Debug, Serialize, Deserialize)]
enum Response {
    /// Progress or a finding of a check; more follows.
    Event(Event),
    Done,
}

/// Serves the process that started this one until the connection is closed. `board` is the file of the call board.
pub fn serve(board: &Path) -> io::Result<()> {
    serve_requests(board, respond)
}

fn respond(Request(path, options): Request, _: &[f64], replies: &mut Replies) -> io::Result<()> {
    let mut sent = Ok(());
    crate::check(&path, &options, &mut |event| {
        if sent.is_ok() {
            sent = replies.send(&Response::Event(event), &[]);
        }
    });
    sent?;
    replies.send(&Response::Done, &[])
}

/// Checks a `.fmu` file in a worker and returns the findings and the scope of the check. If the FMU ends the worker,
/// this is a finding, and another worker continues with the next trial, unless the trial took too long. Accesses denied
/// by the sandbox, files that the FMU wrote to the working directory, which is a temporary one, and processes that it
/// left running are findings, too.
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
        process.send(&Request(std::path::absolute(path)?, options.clone()), &[]);
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
                Ok(Response::Done) => break None,
                Err(ended) => break Some(ended),
            }
        };
        for finding in besides(settings, process) {
            if !findings.contains(&finding) {
                findings.push(finding);
            }
        }
        let Some(ended) = ended else { return Ok((findings, checked)) };
        // This trial cannot be skipped, because the other trials need it.
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
