//! Linux interfaces that supervising and confining a worker needs and that have no safe binding: `fork`, and filters of system
//! calls with a listener (seccomp(2)).

use libc::{c_ulong, sock_filter, sock_fprog};
use rustix::process::Pid;
use std::io;
use std::os::fd::{AsRawFd as _, BorrowedFd, FromRawFd as _, OwnedFd};

pub(crate) enum Forked {
    /// The process that called it, and the new one.
    Parent(Pid),
    /// The new process.
    Child,
}

/// Makes a copy of this process.
///
/// # Errors
/// The process has several threads, of which the copy would have one only, or the system has no room for another process.
pub(crate) fn fork() -> io::Result<Forked> {
    if std::fs::read_dir("/proc/self/task")?.count() != 1 {
        return Err(io::Error::other("this process has several threads"));
    }
    // SAFETY: the process is single-threaded, so the child cannot deadlock on a lock held by another thread.
    match unsafe { libc::fork() } {
        -1 => Err(io::Error::last_os_error()),
        0 => Ok(Forked::Child),
        id => Pid::from_raw(id).map(Forked::Parent).ok_or_else(|| io::ErrorKind::InvalidData.into()),
    }
}

/// The most memory that a child that was waited for has had resident, bytes.
pub(crate) fn most_memory_of_children() -> u64 {
    // SAFETY: all bits 0 are a value of this type.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: the function fills the structure.
    let result = unsafe { libc::getrusage(libc::RUSAGE_CHILDREN, &raw mut usage) };
    if result == 0 { u64::try_from(usage.ru_maxrss).unwrap_or(0).saturating_mul(1024) } else { 0 }
}

/// Filters the system calls of this thread, and of all threads and processes that it makes, permanently. With `listens` the
/// calls for which the filter returns `SECCOMP_RET_USER_NOTIF` wait for an answer from the returned listener.
///
/// # Errors
/// The system has no such filters, another listener already has the calls of this process, or `no_new_privs` is not set.
pub(crate) fn filter_calls(filter: &[sock_filter], listens: bool) -> io::Result<Option<OwnedFd>> {
    let program =
        sock_fprog { len: u16::try_from(filter.len()).map_err(io::Error::other)?, filter: filter.as_ptr().cast_mut() };
    // Without the second flag old kernels make all code of the process slower, as a measure against speculation.
    let listener = if listens { libc::SECCOMP_FILTER_FLAG_NEW_LISTENER } else { 0 };
    let flags = listener | libc::SECCOMP_FILTER_FLAG_SPEC_ALLOW;
    // SAFETY: the program is valid for the call, which only reads it.
    let result = unsafe {
        libc::syscall(libc::SYS_seccomp, c_ulong::from(libc::SECCOMP_SET_MODE_FILTER), flags, &raw const program)
    };
    let descriptor = i32::try_from(result).map_err(io::Error::other)?;
    match descriptor {
        -1 => Err(io::Error::last_os_error()),
        // SAFETY: the system has made this descriptor, and nothing else uses it.
        _ if listens => Ok(Some(unsafe { OwnedFd::from_raw_fd(descriptor) })),
        _ => Ok(None),
    }
}

/// A system call that waits for an answer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Waiting {
    id: u64,
    pub(crate) thread: u32,
    pub(crate) number: i64,
    pub(crate) arguments: [u64; 6],
}

/// Takes the next call that waits at a listener.
///
/// # Errors
/// None waits any more, or the filter is gone with its processes.
pub(crate) fn next_call(listener: BorrowedFd<'_>) -> io::Result<Waiting> {
    // SAFETY: all bits 0 are a value of this type, and required by the system.
    let mut notice: libc::seccomp_notif = unsafe { std::mem::zeroed() };
    // SAFETY: the system fills the structure, whose size is part of the request.
    let result = unsafe { libc::ioctl(listener.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_RECV as _, &raw mut notice) };
    if result != 0 {
        return Err(io::Error::last_os_error());
    }
    let number = i64::from(notice.data.nr);
    Ok(Waiting { id: notice.id, thread: notice.pid, number, arguments: notice.data.args })
}

pub(crate) fn hold_termination(holds: bool) {
    let how = if holds { libc::SIG_BLOCK } else { libc::SIG_UNBLOCK };
    // SAFETY: the set is on the stack, and the functions only read and write it.
    unsafe {
        let mut signals = std::mem::zeroed();
        libc::sigemptyset(&raw mut signals);
        libc::sigaddset(&raw mut signals, libc::SIGTERM);
        libc::pthread_sigmask(how, &raw const signals, std::ptr::null_mut());
    }
}

/// Checks that a call is still pending, so its thread ID is valid.
pub(crate) fn is_waiting(listener: BorrowedFd<'_>, call: &Waiting) -> bool {
    // SAFETY: the system reads the number.
    unsafe { libc::ioctl(listener.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_ID_VALID as _, &raw const call.id) == 0 }
}

/// Lets a call continue, or makes it fail with an error number. Nothing happens if its thread has ended.
pub(crate) fn answer(listener: BorrowedFd<'_>, call: &Waiting, denied: Option<i32>) {
    let goes_on = u32::try_from(libc::SECCOMP_USER_NOTIF_FLAG_CONTINUE).unwrap_or(1);
    let response = libc::seccomp_notif_resp {
        id: call.id,
        val: 0,
        error: -denied.unwrap_or(0),
        flags: if denied.is_some() { 0 } else { goes_on },
    };
    // SAFETY: the system reads the structure, whose size is part of the request.
    unsafe { libc::ioctl(listener.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_SEND as _, &raw const response) };
}
