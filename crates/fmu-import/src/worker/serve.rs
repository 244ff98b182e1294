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
    /// Process ID of the worker. A copy of the worker, forked by an FMU, must not send responses.
    process: u32,
}

impl Replies {
    /// Ends this process if it is a copy of the worker that an FMU forked. It would otherwise do all work twice.
    pub fn end_copies(&self) {
        if std::process::id() != self.process {
            signal_hook::low_level::exit(0);
        }
    }

    /// Sends a response.
    pub fn send(&mut self, response: &impl Serialize, body: &[&[f64]]) -> io::Result<()> {
        self.end_copies();
        // The output is flushed before the response is sent, because the parent may end a worker after its last
        // response.
        flush_prints();
        message::write(&mut self.connection, response, body)
    }
}

/// Serves the requests of the parent process. This process ends when the connection is closed.
///
/// `board` is the file of the call board; `respond` gets every request with its numbers. Fails if the process was not
/// started by a [`super::Process`], or the connection is broken.
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
    // Ignores interrupts from the keyboard, which reach all processes: this process ends when its parent does.
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::default())?;

    // A separate thread reads the requests, and notices the end of the connection even while an FMU is executing.
    let (requests, received) = channel();
    let mut input = connection.try_clone()?;
    std::thread::Builder::new().name("requests".to_owned()).spawn(move || {
        let mut reader = Reader::default();
        while let Ok(Some(request)) = reader.read::<R>(&mut input) {
            if requests.send((request, reader.body().rest())).is_err() {
                break;
            }
        }
        // Exits without running exit handlers, such as those of FMUs.
        signal_hook::low_level::exit(0);
    })?;

    let mut replies = Replies { connection, process: std::process::id() };
    for (request, body) in received {
        respond(request, &body, &mut replies)?;
    }
    Ok(())
}

/// Replaces this program with another one that serves requests under the same rules. Appends two arguments: the path of
/// the call board, and a JSON list of the functions' names in FMI 2.0 and 3.0, in the order of their numbers. Fails if
/// the process was not started by a [`super::Process`], or the program cannot be started.
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

/// Makes the allocator keep freed memory for the next run.
///
/// By default, glibc returns more than 128 kB of free memory at the end of the heap to the system, and later gets it
/// back page by page. This takes 2 % of the time of a run in a study. Freeing a large block raises the limit to twice
/// the size of the block (mallopt(3), `M_MMAP_THRESHOLD`). The block is never written to, so it uses no memory.
fn keep_memory() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(16 << 20)));
}
