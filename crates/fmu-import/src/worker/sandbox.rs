//! The sandbox of a worker, which protects the machine from the code of FMUs.
//!
//! The sandbox uses two features of Linux. *Landlock* denies all changes to files outside of given folders. A
//! *system-call filter* (seccomp) denies starting programs, using the network, sending signals to processes outside of
//! the worker, and calls that could be used to escape. Restricted calls wait for the [`Guard`] in the supervisor, which
//! reads the arguments, decides, and records denied calls. Calls that change files also wait, because Landlock does not
//! report what it denies. Those that the guard does not deny continue to Landlock; another thread that changes the path
//! after the guard has read it therefore gains nothing. Calls that are needed for computing are not restricted, so a
//! step takes as long as without a sandbox.
//!
//! Reading files is allowed: without a network, data can leave the machine only in results.

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

/// Devices to which FMUs may write, because the data is discarded.
const SINKS: [&str; 5] = ["/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom"];

/// Permanently puts this thread, and all threads and processes that it creates, into the sandbox. `supervisor` receives
/// the listener of the filter. Returns a sentence for each feature that this machine does not have.
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

/// Denies changes to files outside of the folders. Returns false if the kernel does not support this.
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
