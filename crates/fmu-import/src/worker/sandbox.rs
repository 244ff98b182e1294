//! The sandbox of a worker, which protects the rest of the machine from the code of an FMU.
//!
//! It consists of two features of Linux. *Landlock* forbids all changes of files outside of some folders. A *filter of system calls*
//! (seccomp) forbids programs, the network, signals to processes that are not the worker's own, and calls that would lead out. Calls that
//! the filter does not allow wait for the [`Guard`] in the supervisor, which reads their arguments, notes what it denies, and responds.
//! Calls that change files are among them, because Landlock does not report what it denies; the guard only passes them on to Landlock, so
//! that nothing depends on a path that another thread changes after it was read. Calls that an FMU makes while it computes are not among
//! them, so a step takes as long as without a sandbox.
//!
//! Reading is allowed: without a network, nothing that was read leaves the machine, other than in results.

mod calls;
mod guard;

pub(super) use guard::Guard;

use crate::loader::linux;
use landlock::{
    ABI, Access as _, AccessFs, AccessNet, PathBeneath, PathFd, Ruleset, RulesetAttr as _, RulesetCreatedAttr as _,
    RulesetStatus, Scope,
};
use std::io;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

/// Files that may be written to, because their contents are discarded.
const SINKS: [&str; 5] = ["/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom"];

/// Puts this thread, and all threads and processes that it makes, into the sandbox, permanently. `supervisor` receives the
/// listener of the filter. Returns the missing features of this machine, a sentence each.
pub(super) fn enter(folders: &[PathBuf], supervisor: Option<UnixStream>) -> io::Result<Vec<String>> {
    let mut lacks = Vec::new();
    rustix::thread::set_no_new_privs(true)?;
    let protected = protect_files(folders);
    let has_landlock = matches!(protected, Ok(true));
    if let Err(error) = protected {
        lacks.push(format!("the sandbox does not protect files: Landlock cannot be used: {error}"));
    } else if !has_landlock {
        lacks.push("the sandbox does not protect files: this system has no Landlock (Linux 5.13)".to_owned());
    }
    let Some(calls) = calls::restricted() else {
        lacks.push("the sandbox does not filter system calls: it does not support this processor".to_owned());
        return Ok(lacks);
    };
    let own = std::process::id();
    if let Some(supervisor) = supervisor
        && let Ok(Some(listener)) = linux::filter_calls(&calls::filter(&calls, own, true), true)
    {
        guard::hand_over(&supervisor, &listener, has_landlock)?;
        return Ok(lacks);
    }
    match linux::filter_calls(&calls::filter(&calls, own, false), false) {
        Ok(_) => {
            lacks.push("the sandbox does not report what it denies: this system has no listener for calls".to_owned())
        }
        Err(error) => lacks.push(format!("the sandbox does not filter system calls: {error}")),
    }
    Ok(lacks)
}

/// Forbids changes of files outside of some folders; false: the kernel cannot.
fn protect_files(folders: &[PathBuf]) -> Result<bool, landlock::RulesetError> {
    let changes = AccessFs::from_write(ABI::V3);
    let mut rules = Ruleset::default()
        .handle_access(changes)?
        .handle_access(AccessNet::from_all(ABI::V4))?
        .scope(Scope::Signal)?
        .create()?;
    for folder in folders.iter().filter_map(|folder| PathFd::new(folder).ok()) {
        rules = rules.add_rule(PathBeneath::new(folder, changes))?;
    }
    for file in SINKS.iter().filter_map(|file| PathFd::new(file).ok()) {
        rules = rules.add_rule(PathBeneath::new(file, AccessFs::WriteFile | AccessFs::Truncate))?;
    }
    Ok(rules.restrict_self()?.ruleset != RulesetStatus::NotEnforced)
}
