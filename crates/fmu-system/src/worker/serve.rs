//! The worker's side.

use super::protocol::{self, Request, Response};
use crate::failure::Failure;
use crate::fmus::{Fmus, FmusError, Instances};
use crate::master::{self, Recording};
use crate::run::Component;
use crate::trial;
use fmu_import::fmu::Binary;
use fmu_import::loader::{Instance, Library, calls};
use fmu_import::worker::{Replies, serve_requests};
use std::cell::OnceCell;
use std::io;
use std::path::Path;
use std::sync::Arc;

/// Serves the process that started this one until the connection to it ends.
///
/// `board` is the file in which the calls are announced.
///
/// # Errors
/// The process was not started as a worker, or the connection is broken.
pub fn serve(board: &Path) -> io::Result<()> {
    let mut libraries = Libraries::default();
    serve_requests(board, |request, body, replies| respond(request, body, &mut libraries, replies))
}

fn respond(request: Request, body: &[f64], libraries: &mut Libraries, replies: &mut Replies) -> io::Result<()> {
    let failed = |message: String| Response::Failed { failure: Failure::new("", message), rows: None };
    match request {
        Request::Fmus(binaries) => {
            libraries.0 = binaries.into_iter().map(|binary| (binary, OnceCell::new())).collect();
            Ok(())
        }
        Request::Load => {
            let loaded = libraries.0.iter().enumerate().try_for_each(|(index, entry)| {
                if let Some(board) = calls::board() {
                    board.component(index);
                }
                load(entry).map(drop)
            });
            replies.send(&loaded.map_or_else(|error| failed(error.to_string()), |()| Response::Done), &[])
        }
        Request::Run { simulation, mut run, series, csv, is_repeated, pace } => {
            run.series = protocol::series(&series, body)?;
            // The rows go to the file, if there is one, and not to the response.
            let kept = |recording: &mut Recording| {
                let Some((names, part)) = &csv else { return Ok(()) };
                part.write(names, recording)?;
                recording.time.drain(..recording.time.len().saturating_sub(1));
                recording.columns.clear();
                recording.exact.clear();
                io::Result::Ok(())
            };
            let mut executed = master::record(&simulation, &run, libraries, !is_repeated, pace);
            replies.end_copies();
            let recording = match &mut executed {
                Ok(recording) => Some(recording),
                Err(failure) => failure.recorded.as_deref_mut(),
            };
            let (response, body) = match recording.map_or(Ok(()), kept) {
                Err(error) => (failed(error.to_string()), Vec::new()),
                Ok(()) => Response::of(executed),
            };
            replies.send(&response, &body.iter().map(Vec::as_slice).collect::<Vec<_>>())
        }
        Request::Steady { simulation, mut run } => {
            let found = Fmus::of_components(&run.components).map_err(|error| error.to_string()).and_then(|fmus| {
                run.find_steady_starts(&simulation, &fmus).map_err(|error| error.to_string())?;
                Ok(run.components.into_iter().map(|component| component.steady).collect())
            });
            replies.send(&found.map_or_else(failed, Response::Steady), &[])
        }
        Request::Trials { simulation, trials } => {
            replies.send(&Response::Warnings(trial::warnings(&simulation, &trials)), &[])
        }
    }
}

/// Libraries, loaded on first use and kept.
#[derive(Default)]
struct Libraries(Vec<(Binary, OnceCell<Arc<Library>>)>);

fn load((binary, library): &(Binary, OnceCell<Arc<Library>>)) -> Result<&Arc<Library>, FmusError> {
    if let Some(library) = library.get() {
        return Ok(library);
    }
    let loaded = binary.load_elsewhere()?;
    Ok(library.get_or_init(|| loaded))
}

impl Instances for Libraries {
    fn of(&self, component: &Component) -> Result<Instance, FmusError> {
        let is_found = |(binary, _): &&(Binary, _)| component.uses(binary);
        let entry = self.0.iter().find(is_found).ok_or_else(|| FmusError::NotLoaded(component.fmu.clone()))?;
        Ok(entry.0.instantiate(load(entry)?, &component.name)?)
    }
}
