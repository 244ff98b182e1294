//! Linux functions without a safe binding that are needed to supervise and confine workers: `fork`, and system-call
//! filters with a listener (seccomp(2)).

use libc::{c_ulong, sock_filter, sock_fprog};
use rustix::process::Pid;
use std::io;
use std::os::fd::{AsRawFd as _, BorrowedFd, FromRawFd as _, OwnedFd};

pub(crate) enum Forked {
    Parent(Pid),
    Child,
}

/// Forks this process. Fails if it has several threads, which would not exist in the child, or if the system refuses.
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

/// Maximum resident memory of all children that were waited for, bytes.
pub(crate) fn most_memory_of_children() -> u64 {
    // SAFETY: all zeros are a valid value of this type.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: the function fills the structure.
    let result = unsafe { libc::getrusage(libc::RUSAGE_CHILDREN, &raw mut usage) };
    if result == 0 { u64::try_from(usage.ru_maxrss).unwrap_or(0).saturating_mul(1024) } else { 0 }
}

/// Permanently filters the system calls of this thread and of all threads and processes that it creates. With
/// `listens`, calls with the result `SECCOMP_RET_USER_NOTIF` wait for an answer from the returned listener. Fails if
/// the system does not support such filters, this process already has a listener, or `no_new_privs` is not set.
pub(crate) fn filter_calls(filter: &[sock_filter], listens: bool) -> io::Result<Option<OwnedFd>> {
    let program =
        sock_fprog { len: u16::try_from(filter.len()).map_err(io::Error::other)?, filter: filter.as_ptr().cast_mut() };
    // Without the second flag, old kernels enable a mitigation of speculative execution that slows down the process.
    let listener = if listens { libc::SECCOMP_FILTER_FLAG_NEW_LISTENER } else { 0 };
    let flags = listener | libc::SECCOMP_FILTER_FLAG_SPEC_ALLOW;
    // SAFETY: the program is valid for the call, which only reads it.
    let result = unsafe {
        libc::syscall(libc::SYS_seccomp, c_ulong::from(libc::SECCOMP_SET_MODE_FILTER), flags, &raw const program)
    };
    let descriptor = i32::try_from(result).map_err(io::Error::other)?;
    match descriptor {
        -1 => Err(io::Error::last_os_error()),
        // SAFETY: the system has just created this descriptor, and nothing else uses it.
        _ if listens => Ok(Some(unsafe { OwnedFd::from_raw_fd(descriptor) })),
        _ => Ok(None),
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Waiting {
    id: u64,
    pub(crate) thread: u32,
    pub(crate) number: i64,
    pub(crate) arguments: [u64; 6],
}

/// Receives the next call that is waiting for an answer. Fails if the call has stopped waiting in the meantime, or if
/// all filtered processes have ended.
pub(crate) fn next_call(listener: BorrowedFd<'_>) -> io::Result<Waiting> {
    // SAFETY: all zeros are a valid value of this type; the system requires them.
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
    // SAFETY: the functions only read and write the set, which is on the stack.
    unsafe {
        let mut signals = std::mem::zeroed();
        libc::sigemptyset(&raw mut signals);
        libc::sigaddset(&raw mut signals, libc::SIGTERM);
        libc::pthread_sigmask(how, &raw const signals, std::ptr::null_mut());
    }
}

/// Returns true if a call is still pending; its thread ID is then valid.
pub(crate) fn is_waiting(listener: BorrowedFd<'_>, call: &Waiting) -> bool {
    // SAFETY: the system reads the number.
    unsafe { libc::ioctl(listener.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_ID_VALID as _, &raw const call.id) == 0 }
}

/// Lets a call continue, or makes it fail with an error number. Has no effect if the thread has ended.
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
