//! Linearizations and steady states in worker processes.

use crate::linearize::{self, Linear};
use crate::trim::{self, SteadyState};
use fmu_import::worker::{Process, Replies, Settings, Watch, serve_requests};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// Job name of workers that [`serve`].
pub const JOB: &str = "linear";

#[derive(Debug, Serialize, Deserialize)]
enum Request {
    /// Linearize a `.fmu` file with other values for these variables, which are given by name.
    Linearize {
        path: PathBuf,
        changes: Vec<(String, String)>,
    },
    Trim {
        path: PathBuf,
        settings: Vec<(String, String)>,
        free: Vec<Vec<String>>,
    },
}

#[derive(Debug, Serialize, Deserialize)]
enum Response {
    /// The linear model; its matrix is in the body.
    Linear(Linear),
    Trimmed(SteadyState),
    Failed(String),
}

/// Serves the process that started this one until the connection is closed. `board` is the file of the call board.
pub fn serve(board: &Path) -> io::Result<()> {
    serve_requests(board, respond)
}

fn respond(request: Request, _: &[f64], replies: &mut Replies) -> io::Result<()> {
    match request {
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

/// Sends a request about a `.fmu` file to a new worker, and returns the worker with its response.
fn ask(settings: &Settings, path: &Path, request: &Request) -> Result<(Process, Response), String> {
    let mut process =
        Process::start(settings, JOB, true).map_err(|error| format!("cannot start a worker process: {error}"))?;
    process.send(request, &[]);
    match process.receive(&mut Watch::of_all(settings.timeout), &mut |_| ()) {
        Ok(Response::Failed(message)) => Err(message),
        Ok(response) => Ok((process, response)),
        Err(ended) => Err(format!("{}: {}", path.display(), ended.message)),
    }
}

/// Linearizes a `.fmu` file in a worker, at its start values, some of which `changes` replaces.
pub fn linearize(settings: &Settings, path: &Path, changes: &[(String, String)]) -> Result<Linear, String> {
    let request = Request::Linearize { path: path.to_path_buf(), changes: changes.to_vec() };
    let (process, Response::Linear(linear)) = ask(settings, path, &request)? else {
        return Err("the worker process sent an unexpected response".to_owned());
    };
    let jacobian = process.body().rest();
    let [n, m, p] = [&linear.states, &linear.inputs, &linear.outputs].map(Vec::len);
    if jacobian.len() != (n + p) * (n + m) {
        return Err("the worker process sent an incomplete response".to_owned());
    }
    Ok(Linear { jacobian, ..linear })
}

/// Finds the steady state of a `.fmu` file in a worker: see [`trim::trim`].
pub fn trim(
    settings: &Settings,
    path: &Path,
    changes: &[(String, String)],
    free: &[Vec<String>],
) -> Result<SteadyState, String> {
    let request = Request::Trim { path: path.to_path_buf(), settings: changes.to_vec(), free: free.to_vec() };
    match ask(settings, path, &request)? {
        (_, Response::Trimmed(steady)) => Ok(steady),
        _ => Err("the worker process sent an unexpected response".to_owned()),
    }
}
