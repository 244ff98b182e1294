//! The process between a worker and its parent.
//!
//! A worker starts as one process and forks: the first process becomes the supervisor, the second one the worker. If
//! the parent of a process that an FMU started ends, the process becomes a child of the supervisor
//! (`PR_SET_CHILD_SUBREAPER`). Therefore no process outlives the worker, even in another process group or as a daemon.
//! The supervisor ends with the exit code or signal of the worker. On SIGTERM, it ends all processes. If the supervisor
//! is killed, so is the worker.

use super::family;
use super::sandbox::{self, Guard};
use super::setup::{Incident, Setup, note};
use crate::loader::linux::{self, Forked};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, Resource, Rlimit, Signal, WaitOptions, WaitStatus};
use signal_hook::consts::{SIGCHLD, SIGTERM};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fs::File;
use std::io::{self, Read as _};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time limit for killed processes to end.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time for processes to end by themselves after the worker has ended.
const GRACE: Duration = Duration::from_millis(50);
/// If a worker used more than this share of its memory limit, its end is reported as possibly caused by the limit.
const NEARLY_ALL: f64 = 0.8;

/// Forks this process, which must have only one thread, and returns in the worker only. If the fork fails, this process
/// becomes the worker and is not supervised.
pub(super) fn divide(setup: &Setup, board: &Path) -> io::Result<()> {
    let incidents = Setup::incidents(board)?;
    let (ours, theirs) = UnixStream::pair()?;
    let supervisor = rustix::process::getpid();
    // Must precede the fork, because an FMU in the worker could leave a process behind.
    rustix::process::set_child_subreaper(Some(supervisor))?;
    // SIGTERM is blocked until the supervisor handles it; otherwise the supervisor could end without its worker.
    linux::hold_termination(true);
    match linux::fork() {
        Ok(Forked::Child) => {
            linux::hold_termination(false);
            drop(ours);
            rustix::process::set_parent_process_death_signal(Some(Signal::KILL))?;
            if rustix::process::getppid() != Some(supervisor) {
                return Err(io::Error::other("the supervisor has ended"));
            }
            // If an FMU sends a signal to its process group, the signal must not reach the supervisor or the parent.
            rustix::process::setpgid(None, None)?;
            obey(setup, Some(theirs), &incidents)
        }
        Ok(Forked::Parent(worker)) => {
            drop(theirs);
            let code = supervise(setup, board, worker, ours, incidents).unwrap_or(1);
            signal_hook::low_level::exit(code)
        }
        Err(error) => {
            linux::hold_termination(false);
            let message = format!("processes that an FMU starts are not supervised: {error}");
            note(&incidents, &Incident::NoSandbox(message));
            obey(setup, None, &incidents)
        }
    }
}

/// Applies the rules to the worker; `supervisor` receives the listener of its sandbox.
fn obey(setup: &Setup, supervisor: Option<UnixStream>, incidents: &File) -> io::Result<()> {
    if let Some(bytes) = setup.memory {
        // An existing limit cannot be raised.
        let present = rustix::process::getrlimit(Resource::Data).maximum;
        let limit = Some(present.map_or(bytes, |present| present.min(bytes)));
        rustix::process::setrlimit(Resource::Data, Rlimit { current: limit, maximum: limit })?;
    }
    if let Some(folders) = &setup.writable {
        for reason in sandbox::enter(folders, supervisor)? {
            note(incidents, &Incident::NoSandbox(reason));
        }
    }
    Ok(())
}

/// Waits for the end of the worker and ends the remaining processes. Returns the worker's exit code. If the worker was
/// ended by a signal, ends this process with the same signal.
fn supervise(setup: &Setup, board: &Path, worker: Pid, handed: UnixStream, incidents: File) -> io::Result<i32> {
    let ended = (|| {
        // The connection and the output must be open in the worker only.
        let null = File::options().read(true).write(true).open("/dev/null")?;
        rustix::stdio::dup2_stdin(&null)?;
        rustix::stdio::dup2_stdout(&null)?;
        rustix::stdio::dup2_stderr(&null)?;
        watch(setup, board, worker, handed, &incidents)
    })();
    end_all(worker, &incidents);
    let status = ended?;
    if let (Some(limit), Some(used)) = (setup.memory, status.map(|_| linux::most_memory_of_children()))
        && status.is_some_and(|status| status.exit_status() != Some(0))
        && used as f64 >= NEARLY_ALL * limit as f64
    {
        note(&incidents, &Incident::Memory { used, limit });
    }
    let Some(status) = status else { return Ok(128 + SIGTERM) };
    if let Some(signal) = status.terminating_signal() {
        // Prevents a core dump of this process.
        let _ = rustix::process::setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) });
        signal_hook::low_level::emulate_default_handler(signal)?;
        return Ok(128 + signal);
    }
    Ok(status.exit_status().unwrap_or(1))
}

/// Waits until the worker ends. Returns `None` if SIGTERM requests its end.
fn watch(
    setup: &Setup,
    board: &Path,
    worker: Pid,
    handed: UnixStream,
    incidents: &File,
) -> io::Result<Option<WaitStatus>> {
    let (mut wake, signaled) = UnixStream::pair()?;
    wake.set_nonblocking(true)?;
    let is_over = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(SIGTERM, Arc::clone(&is_over))?;
    signal_hook::low_level::pipe::register(SIGTERM, signaled.try_clone()?)?;
    signal_hook::low_level::pipe::register(SIGCHLD, signaled)?;
    linux::hold_termination(false);
    // Ignores interrupts from the keyboard, which reach all processes: this process ends when its parent does.
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::default())?;
    let mut guard = match &setup.writable {
        Some(folders) => Guard::receive(handed, folders, board)?,
        None => None,
    };
    loop {
        // Includes processes that ended before the signal handlers were registered.
        while let Ok(Some((id, status))) = rustix::process::wait(WaitOptions::NOHANG) {
            if id == worker {
                return Ok(Some(status));
            }
        }
        if is_over.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let listener = guard.as_ref().map(Guard::listener);
        let mut descriptors = vec![PollFd::new(&wake, PollFlags::IN)];
        descriptors.extend(listener.map(|listener| PollFd::from_borrowed_fd(listener, PollFlags::IN)));
        match poll(&mut descriptors, None) {
            Ok(_) | Err(rustix::io::Errno::INTR) => (),
            Err(error) => return Err(error.into()),
        }
        let calls = descriptors.get(1).map_or(PollFlags::empty(), PollFd::revents);
        drop(descriptors);
        while matches!(wake.read(&mut [0; 64]), Ok(bytes) if bytes > 0) {}
        if calls.contains(PollFlags::IN) {
            guard.iter_mut().for_each(|guard| guard.decide(incidents));
        } else if !calls.is_empty() {
            // No processes are left in the sandbox.
            guard = None;
        }
    }
}

fn end_all(worker: Pid, incidents: &File) {
    // Fails if the worker has already ended.
    let _ = rustix::process::kill_process(worker, Signal::KILL);
    let begin = Instant::now();
    let mut found = HashMap::new();
    let are_ended = loop {
        match rustix::process::wait(WaitOptions::NOHANG) {
            Err(rustix::io::Errno::CHILD) => break true,
            Ok(Some(_)) => continue,
            _ if begin.elapsed() > PATIENCE => break false,
            _ if begin.elapsed() < GRACE => {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            }
            _ => (),
        }
        // All processes are stopped before the first is killed: a running one could react by starting a new process.
        let before = found.len();
        for (id, process) in family::members().filter(|(id, _)| *id != worker) {
            if let Entry::Vacant(entry) = found.entry(id) {
                let _ = if process.group == worker.as_raw_nonzero().get() {
                    // Stops the entire group at once, including processes that were just started.
                    rustix::process::kill_process_group(worker, Signal::STOP)
                } else {
                    rustix::process::kill_process(id, Signal::STOP)
                };
                entry.insert(family::name(id, process.program));
            }
        }
        if found.len() == before {
            for (id, process) in family::members() {
                let _ = rustix::process::kill_process(id, Signal::KILL);
                // This process may have started after the others were stopped.
                if id != worker {
                    found.entry(id).or_insert_with(|| family::name(id, process.program));
                }
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    let programs: Vec<String> = if are_ended {
        found.into_values().collect()
    } else {
        family::members().map(|(id, process)| family::name(id, process.program)).collect()
    };
    if !are_ended || !programs.is_empty() {
        note(incidents, &Incident::Left { programs, are_ended });
    }
}
