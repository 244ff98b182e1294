//! The side of the worker.

use super::connection::{self, Connection};
use super::protocol::{self, Reader, Request, Response};
use crate::fmu::{Binary, FmuError, Instances};
use crate::loader::{CallProblem, Instance, Library, Status, calls, flush_prints};
use crate::master::{self, RunError};
use crate::plan::Unit;
use crate::{check, linearize, results, trial};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::channel;

/// Works for the process that started this one, and never returns to it: the process ends when the connection does.
///
/// `board` is the file in which the calls are announced.
///
/// # Errors
/// The process was not started by `super::process`, or the connection is broken.
pub fn serve(board: &Path) -> io::Result<()> {
    keep_memory();
    let mut connection = connection::accept()?;
    calls::publish(&OpenOptions::new().read(true).write(true).open(board)?)?;
    // An interrupt from the keyboard reaches all processes; this one ends with the one that started it.
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::default())?;

    // Requests are read by a thread of their own, which notices the end of the connection whatever an FMU is doing.
    let (requests, received) = channel();
    let mut input = connection.try_clone()?;
    std::thread::Builder::new().name("requests".to_owned()).spawn(move || {
        let mut reader = Reader::new();
        while let Ok(Some(request)) = reader.read::<Request>(&mut input) {
            if requests.send((request, reader.body().rest())).is_err() {
                break;
            }
        }
        // At once: neither the end of the program nor what FMUs have registered for it has anything left to do.
        signal_hook::low_level::exit(0);
    })?;

    let mut libraries = Libraries::default();
    for (request, body) in received {
        respond(request, &body, &mut libraries, &mut connection)?;
    }
    Ok(())
}

/// Lets the allocator keep what a run frees for the next run.
///
/// glibc gives it back to the system at once, more than 128 kB at the end of the heap, and gets it again page by page,
/// which takes 2 % of a run of a study. A larger block that is freed raises this limit to twice its size (mallopt(3),
/// `M_MMAP_THRESHOLD`). Nothing is written to the block, so it takes no memory.
fn keep_memory() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(16 << 20)));
}

fn respond(request: Request, body: &[f64], libraries: &mut Libraries, connection: &mut Connection) -> io::Result<()> {
    let mut send = |response: &Response, body: &[&[f64]]| {
        // Before: a worker may be ended after its last response.
        flush_prints();
        protocol::write(&mut *connection, response, body)
    };
    let failed = |message: String| Response::Failed { time: None, message, is_fatal: false };
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
            send(&loaded.map_or_else(|error| failed(error.to_string()), |()| Response::Done), &[])
        }
        Request::Run { simulation, mut run, feeds, csv } => {
            run.feeds = protocol::feeds(&feeds, body)?;
            let (response, body) = match master::execute(&simulation, &run, libraries) {
                Err(RunError { time, cause, .. }) => {
                    let is_fatal =
                        matches!(&*cause, FmuError::Call(call) if call.problem == CallProblem::Status(Status::Fatal));
                    (Response::Failed { time, message: cause.to_string(), is_fatal }, Vec::new())
                }
                Ok(mut recording) => match csv {
                    None => Response::recorded(recording),
                    Some((names, path)) => match results::write_csv(&path, &names, &recording) {
                        Err(error) => (failed(error.to_string()), Vec::new()),
                        Ok(()) => {
                            recording.time.clear();
                            recording.columns.clear();
                            Response::recorded(recording)
                        }
                    },
                },
            };
            send(&response, &body.iter().map(Vec::as_slice).collect::<Vec<_>>())
        }
        Request::Check(path) => {
            let mut sent = Ok(());
            check::check(&path, &mut |event| {
                if sent.is_ok() {
                    sent = send(&Response::Event(event), &[]);
                }
            });
            sent?;
            send(&Response::Done, &[])
        }
        Request::Trials { simulation, trials } => {
            send(&Response::Warnings(trial::of_trials(&simulation, &trials)), &[])
        }
        Request::Linearize { path, names } => {
            let settings: Vec<(String, f64)> = names.into_iter().zip(body.iter().copied()).collect();
            match linearize::linearize(&path, &settings) {
                Ok(mut linear) => {
                    let jacobian = std::mem::take(&mut linear.jacobian);
                    send(&Response::Linear(linear), &[&jacobian])
                }
                Err(message) => send(&failed(message), &[]),
            }
        }
    }
}

/// Libraries that are loaded when they are needed first, and stay.
#[derive(Default)]
struct Libraries {
    binaries: BTreeMap<String, Binary>,
    loaded: RefCell<BTreeMap<String, Arc<Library>>>,
}

impl Libraries {
    fn get(&self, fmu: &str) -> Result<(&Binary, Arc<Library>), FmuError> {
        let binary = self.binaries.get(fmu).ok_or_else(|| FmuError::NotLoaded(fmu.to_string()))?;
        if let Some(library) = self.loaded.borrow().get(fmu) {
            return Ok((binary, Arc::clone(library)));
        }
        let library = binary.load_elsewhere()?;
        self.loaded.borrow_mut().insert(fmu.to_string(), Arc::clone(&library));
        Ok((binary, library))
    }
}

impl Instances for Libraries {
    fn of(&self, unit: &Unit) -> Result<Instance, FmuError> {
        let (binary, library) = self.get(&unit.fmu)?;
        binary.instantiate(&library, &unit.name)
    }
}
