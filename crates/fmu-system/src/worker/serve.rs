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
use std::cell::RefCell;
use std::collections::BTreeMap;
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
            libraries.binaries =
                binaries.into_iter().map(|binary| (binary.fmu.to_string_lossy().into(), binary)).collect();
            Ok(())
        }
        Request::Load => {
            let loaded = libraries.binaries.keys().enumerate().try_for_each(|(index, fmu)| {
                if let Some(board) = calls::board() {
                    board.component(index);
                }
                libraries.get(fmu).map(drop)
            });
            replies.send(&loaded.map_or_else(|error| failed(error.to_string()), |()| Response::Done), &[])
        }
        Request::Run { simulation, mut run, series, csv, is_repeated } => {
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
            let executed = master::record(&simulation, &run, libraries, !is_repeated);
            replies.end_copies();
            let (response, body) = match executed {
                Err(mut failure) => match failure.recorded.as_deref_mut().map_or(Ok(()), kept) {
                    Err(error) => (failed(error.to_string()), Vec::new()),
                    Ok(()) => Response::failed(failure),
                },
                Ok(mut recording) => match kept(&mut recording) {
                    Err(error) => (failed(error.to_string()), Vec::new()),
                    Ok(()) => Response::recorded(recording),
                },
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
struct Libraries {
    binaries: BTreeMap<String, Binary>,
    loaded: RefCell<BTreeMap<String, Arc<Library>>>,
}

impl Libraries {
    fn get(&self, fmu: &str) -> Result<(&Binary, Arc<Library>), FmusError> {
        let binary = self.binaries.get(fmu).ok_or_else(|| FmusError::NotLoaded(fmu.to_string()))?;
        if let Some(library) = self.loaded.borrow().get(fmu) {
            return Ok((binary, Arc::clone(library)));
        }
        let library = binary.load_elsewhere()?;
        self.loaded.borrow_mut().insert(fmu.to_string(), Arc::clone(&library));
        Ok((binary, library))
    }
}

impl Instances for Libraries {
    fn of(&self, component: &Component) -> Result<Instance, FmusError> {
        let (binary, library) = self.get(&component.fmu)?;
        Ok(binary.instantiate(&library, &component.name)?)
    }
}
