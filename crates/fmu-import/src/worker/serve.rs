//! The worker's side.

use super::connection::{self, Connection};
use super::message::{self, Reader};
use super::setup::Setup;
use crate::loader::{calls, flush_prints};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::OpenOptions;
use std::io;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::mpsc::channel;

/// Sends the responses of a worker.
#[derive(Debug)]
pub struct Replies {
    connection: Connection,
    /// ID of the worker process: a copy of it made by an FMU must not send.
    process: u32,
}

impl Replies {
    /// Ends this process if it is a copy of the worker that an FMU has made and not ended: it would do all work twice.
    pub fn end_copies(&self) {
        if std::process::id() != self.process {
            signal_hook::low_level::exit(0);
        }
    }

    /// Sends a response.
    pub fn send(&mut self, response: &impl Serialize, body: &[&[f64]]) -> io::Result<()> {
        self.end_copies();
        // Before: a worker may be ended after its last response.
        flush_prints();
        message::write(&mut self.connection, response, body)
    }
}

/// Works for the process that started this one, and never returns to it: the process ends when the connection does.
///
/// `board` is the file in which the calls are announced; `respond` gets every request with its numbers.
///
/// # Errors
/// The process was not started by a [`super::Process`], or the connection is broken.
pub fn serve<R: DeserializeOwned + Send + 'static>(
    board: &Path,
    mut respond: impl FnMut(R, &[f64], &mut Replies) -> io::Result<()>,
) -> io::Result<()> {
    let file = OpenOptions::new().read(true).write(true).open(board)?;
    let setup = Setup::read(board)?;
    #[cfg(target_os = "linux")]
    super::supervisor::divide(&setup, board)?;
    #[cfg(not(target_os = "linux"))]
    drop(setup);
    keep_memory();
    let connection = connection::accept()?;
    calls::publish(&file)?;
    // An interrupt from the keyboard reaches all processes; this one ends with the one that started it.
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::default())?;

    // Requests are read by a thread of their own, which notices the end of the connection whatever an FMU is doing.
    let (requests, received) = channel();
    let mut input = connection.try_clone()?;
    std::thread::Builder::new().name("requests".to_owned()).spawn(move || {
        let mut reader = Reader::default();
        while let Ok(Some(request)) = reader.read::<R>(&mut input) {
            if requests.send((request, reader.body().rest())).is_err() {
                break;
            }
        }
        // Immediately: neither the end of the program nor exit handlers of FMUs have anything left to do.
        signal_hook::low_level::exit(0);
    })?;

    let mut replies = Replies { connection, process: std::process::id() };
    for (request, body) in received {
        respond(request, &body, &mut replies)?;
    }
    Ok(())
}

/// Lets another program work in the place of this one, under the same rules. Two arguments are added: the path of the board, and the names of
/// the functions in FMI 2.0 and FMI 3.0 in the order of their numbers on the board, as JSON.
///
/// # Errors
/// The process was not started by a [`super::Process`], or the program cannot be started.
pub fn hand_over(board: &Path, mut command: Command) -> io::Result<()> {
    let setup = Setup::read(board)?;
    #[cfg(target_os = "linux")]
    super::supervisor::divide(&setup, board)?;
    #[cfg(not(target_os = "linux"))]
    drop(setup);
    command.arg(board).arg(serde_json::to_string(calls::NAMES)?);
    #[cfg(unix)]
    return Err(std::os::unix::process::CommandExt::exec(&mut command));
    #[cfg(not(unix))]
    signal_hook::low_level::exit(command.status()?.code().unwrap_or(1))
}

/// Lets the allocator keep memory that a run frees for the next run.
///
/// glibc returns it to the system at once, more than 128 kB at the end of the heap, and gets it back page by page,
/// which takes 2 % of a run of a study. A larger block that is freed raises this limit to twice its size (mallopt(3),
/// `M_MMAP_THRESHOLD`). Nothing is written to the block, so it takes no memory.
fn keep_memory() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(16 << 20)));
}
