//! Decides about restricted system calls; runs in the supervisor.

use super::super::family;
use super::super::setup::{Incident, note};
use super::SINKS;
use super::calls::{Call, Kind, Place, WRITES, restricted};
use crate::loader::calls::Snapshot;
use crate::loader::linux::{self, Waiting};
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage, SendFlags,
    recvmsg, sendmsg,
};
use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd as _, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStringExt as _;
use std::os::unix::fs::FileExt as _;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

/// Maximum number of different incidents that are recorded. An FMU may try to write a new file in each step.
const MAX_INCIDENTS: usize = 100;
/// Maximum number of links that the kernel follows for a path.
const MAX_LINKS: usize = 40;
/// Maximum length of a path, bytes (`PATH_MAX`).
const MAX_PATH: usize = 4096;

pub(super) fn hand_over(supervisor: &UnixStream, listener: &OwnedFd, has_landlock: bool) -> io::Result<()> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut message = SendAncillaryBuffer::new(&mut space);
    let listener = [listener.as_fd()];
    message.push(SendAncillaryMessage::ScmRights(&listener));
    sendmsg(supervisor, &[IoSlice::new(&[u8::from(has_landlock)])], &mut message, SendFlags::empty())?;
    Ok(())
}

pub(in super::super) struct Guard {
    listener: OwnedFd,
    calls: HashMap<i64, Call>,
    writable: Vec<PathBuf>,
    /// True if Landlock also restricts changes to files.
    has_landlock: bool,
    board: File,
    noted: HashSet<Incident>,
}

enum Decision {
    /// The call continues, within the limits of Landlock.
    GoesOn,
    /// The call fails with this error number, and the action is recorded.
    Denied(i32, String),
    /// The call fails with this error number.
    Fails(i32),
}
use Decision::{Denied, Fails, GoesOn};

impl Guard {
    /// Receives the listener from the worker; `None` if the worker has none.
    pub(in super::super) fn receive(from: UnixStream, folders: &[PathBuf], board: &Path) -> io::Result<Option<Self>> {
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
        let mut message = RecvAncillaryBuffer::new(&mut space);
        let mut byte = [0];
        let received = rustix::io::retry_on_intr(|| {
            recvmsg(&from, &mut [IoSliceMut::new(&mut byte)], &mut message, RecvFlags::CMSG_CLOEXEC)
        })?;
        let mut descriptors = message.drain().filter_map(|part| match part {
            RecvAncillaryMessage::ScmRights(descriptors) => Some(descriptors),
            _ => None,
        });
        let listener = descriptors.next().and_then(|mut descriptors| descriptors.next());
        let Some(listener) = listener.filter(|_| received.bytes == 1) else { return Ok(None) };
        // Resolves links.
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let writable = folders.iter().map(PathBuf::as_path).chain(SINKS.map(Path::new)).map(real).collect();
        let calls = restricted().unwrap_or_default().into_iter().map(|call| (call.number, call)).collect();
        let board = File::open(board)?;
        Ok(Some(Self { listener, calls, writable, has_landlock: byte[0] != 0, board, noted: HashSet::new() }))
    }

    /// A descriptor that is readable when a call waits.
    pub(in super::super) fn listener(&self) -> BorrowedFd<'_> {
        self.listener.as_fd()
    }

    pub(in super::super) fn decide(&mut self, incidents: &File) {
        let Ok(waiting) = linux::next_call(self.listener()) else { return };
        let decision = match self.calls.get(&waiting.number) {
            Some(call) => self.decision(call, Caller(&waiting)),
            None => Fails(libc::EPERM),
        };
        // If the call no longer waits, its thread ID may belong to another thread. The guard has then read the memory
        // of that thread, so its decision is invalid.
        if !linux::is_waiting(self.listener(), &waiting) {
            return;
        }
        let denied = match decision {
            GoesOn => None,
            Fails(error) => Some(error),
            Denied(error, action) => {
                let call = Snapshot::read(&self.board).ok().and_then(|snapshot| snapshot.call);
                let (component, function) = call.unzip();
                let function = function.unwrap_or("the work of the importer").to_owned();
                let incident = Incident::Denied { component, function, action };
                if self.noted.len() < MAX_INCIDENTS && self.noted.insert(incident.clone()) {
                    note(incidents, &incident);
                }
                Some(error)
            }
        };
        linux::answer(self.listener(), &waiting, denied);
    }

    fn decision(&self, call: &Call, caller: Caller<'_>) -> Decision {
        let name = call.name;
        match call.kind {
            Kind::Program(place) => {
                let program = caller.text(place.1).unwrap_or_default();
                Denied(libc::EPERM, format!("starting the program {} ({name})", program.to_string_lossy()))
            }
            Kind::Network(family) => {
                let family =
                    family.map_or(String::new(), |argument| format!(" {}", family_name(caller.integer(argument))));
                Denied(libc::EACCES, format!("a connection to other programs or machines ({name}{family})"))
            }
            Kind::Open(place, flags) => {
                let flags = match flags {
                    Some(argument) => caller.integer(argument),
                    None => caller.word(2).unwrap_or(WRITES),
                };
                if flags & WRITES == 0 {
                    return GoesOn;
                }
                let path = match caller.path(place, true) {
                    Some(Ok(path)) => path,
                    Some(Err(error)) => return Fails(error),
                    None => return self.unknown(name),
                };
                // If the file does not exist and is not created, the kernel reports the error.
                let is_missing = flags & libc::O_CREAT == 0 && !path.exists();
                if is_missing || self.is_writable(&path) { GoesOn } else { denied_change(&path, name) }
            }
            Kind::Change(places) => {
                for place in places {
                    match caller.path(*place, false) {
                        Some(Ok(path)) if self.is_writable(&path) => {}
                        Some(Ok(path)) => return denied_change(&path, name),
                        Some(Err(error)) => return Fails(error),
                        None => return self.unknown(name),
                    }
                }
                GoesOn
            }
            Kind::Attributes(place) => {
                // `utimensat` without a path changes the file of the descriptor.
                let path = match (place.0, caller.0.arguments[place.1]) {
                    (Some(descriptor), 0) => caller.open_file(caller.integer(descriptor)),
                    _ => caller.path(place, true).and_then(Result::ok),
                };
                // These calls never continue, because another thread could replace the path before the kernel reads it.
                match path {
                    Some(path) if path.exists() => denied_change(&path, name),
                    _ => Fails(libc::ENOENT),
                }
            }
            Kind::AttributesOfOpen(descriptor) => match caller.open_file(caller.integer(descriptor)) {
                Some(path) => denied_change(&path, name),
                None => Fails(libc::EBADF),
            },
            Kind::Signal(target, signal) => self.signal(&caller, caller.integer(target), caller.integer(signal), name),
            Kind::SignalByDescriptor(descriptor) => match caller.process_of(caller.integer(descriptor)) {
                Some(target) => self.signal(&caller, target, caller.integer(1), name),
                None => Fails(libc::EBADF),
            },
            Kind::Schedule(kind) => {
                let is_process = kind.is_none_or(|kind| caller.integer(0) == kind);
                let target = caller.integer(usize::from(kind.is_some()));
                if is_process && family::is_member(target) {
                    return GoesOn;
                }
                Denied(libc::EPERM, format!("the scheduling of other processes ({name})"))
            }
            Kind::Other => Denied(libc::EPERM, format!("the system call {name}")),
        }
    }

    /// Decides about a file whose path cannot be read: with Landlock, the call continues.
    fn unknown(&self, name: &str) -> Decision {
        if self.has_landlock {
            GoesOn
        } else {
            Denied(libc::EACCES, format!("changing a file of unknown path ({name})"))
        }
    }

    fn signal(&self, caller: &Caller<'_>, target: i32, signal: i32, name: &str) -> Decision {
        let is_own = match target {
            0 => caller.group().is_some_and(family::is_member),
            -1 => false,
            _ => family::is_member(target.saturating_abs()),
        };
        match signal {
            _ if is_own => GoesOn,
            // Signal 0 only tests if the process exists.
            0 => Fails(libc::EPERM),
            _ => {
                let whom = match target {
                    0 => "its group".to_owned(),
                    -1 => "all processes".to_owned(),
                    _ if target < 0 => format!("the group {}", target.saturating_abs()),
                    _ => format!("the process {target}"),
                };
                Denied(libc::EPERM, format!("sending the signal {signal} to {whom} ({name})"))
            }
        }
    }

    fn is_writable(&self, path: &Path) -> bool {
        // The caller may write to pipes and sockets that it has open. Their names are not absolute paths.
        !path.is_absolute() || self.writable.iter().any(|folder| path.starts_with(folder))
    }
}

fn denied_change(path: &Path, name: &str) -> Decision {
    Denied(libc::EACCES, format!("changing the file {} ({name})", path.display()))
}

fn family_name(family: i32) -> String {
    match family {
        libc::AF_UNIX => "AF_UNIX".to_owned(),
        libc::AF_INET => "AF_INET".to_owned(),
        libc::AF_INET6 => "AF_INET6".to_owned(),
        libc::AF_NETLINK => "AF_NETLINK".to_owned(),
        _ => format!("of family {family}"),
    }
}

struct Caller<'a>(&'a Waiting);

impl Caller<'_> {
    /// The lower half of an argument, which is an `int` in C.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
    fn integer(&self, argument: usize) -> i32 {
        self.0.arguments[argument] as u32 as i32
    }

    fn memory(&self) -> Option<File> {
        File::open(format!("/proc/{}/mem", self.0.thread)).ok()
    }

    fn word(&self, argument: usize) -> Option<i32> {
        let mut bytes = [0; 4];
        self.memory()?.read_exact_at(&mut bytes, self.0.arguments[argument]).ok()?;
        Some(i32::from_ne_bytes(bytes))
    }

    fn text(&self, argument: usize) -> Option<OsString> {
        let memory = self.memory()?;
        let mut text = Vec::new();
        let mut address = self.0.arguments[argument];
        while text.len() < MAX_PATH {
            // Does not read beyond the end of a page, because the next page may not be mapped.
            let mut bytes = vec![0; usize::try_from(256 - address % 256).ok()?];
            memory.read_exact_at(&mut bytes, address).ok()?;
            if let Some(end) = bytes.iter().position(|byte| *byte == 0) {
                text.extend_from_slice(&bytes[..end]);
                return Some(OsString::from_vec(text));
            }
            address += bytes.len() as u64;
            text.append(&mut bytes);
        }
        None
    }

    fn open_file(&self, descriptor: i32) -> Option<PathBuf> {
        self.link(&match descriptor {
            libc::AT_FDCWD => "cwd".to_owned(),
            _ => format!("fd/{descriptor}"),
        })
    }

    fn link(&self, name: &str) -> Option<PathBuf> {
        std::fs::read_link(format!("/proc/{}/{name}", self.0.thread)).ok()
    }

    /// The real path that the arguments specify; `None` if it cannot be read. `follows` resolves a link at its end. The
    /// error is the error number of the call, for example if the folder does not exist.
    fn path(&self, (folder, path): Place, follows: bool) -> Option<Result<PathBuf, i32>> {
        let path = PathBuf::from(self.text(path)?);
        let own = [("/dev/stdin", "fd/0"), ("/dev/stdout", "fd/1"), ("/dev/stderr", "fd/2")];
        if let Some((_, link)) = own.iter().find(|(name, _)| path == Path::new(name)) {
            return self.link(link).map(Ok);
        }
        for (name, start) in [("/proc/self", ""), ("/proc/thread-self", ""), ("/dev/fd", "fd")] {
            if let Ok(rest) = path.strip_prefix(name) {
                let own = Path::new(start).join(rest);
                if own.parent() == Some(Path::new("fd")) {
                    return self.link(own.to_str()?).map(Ok);
                }
                return Some(Ok(Path::new("/proc").join(self.0.thread.to_string()).join(own)));
            }
        }
        let path = if path.is_absolute() {
            path
        } else {
            self.open_file(folder.map_or(libc::AT_FDCWD, |argument| self.integer(argument)))?.join(path)
        };
        if follows && let Ok(real) = path.canonicalize() {
            return Some(Ok(real));
        }
        // If a link leads to a file that does not exist, the kernel creates this file.
        let mut path = path;
        for _ in 0..MAX_LINKS {
            match path.read_link() {
                Ok(target) if follows => path = path.parent()?.join(target),
                _ => break,
            }
        }
        let (Some(parent), Some(name)) = (path.parent(), path.file_name()) else { return Some(Ok(path)) };
        let real = parent.canonicalize().map(|parent| parent.join(name));
        Some(real.map_err(|error| error.raw_os_error().unwrap_or(libc::EACCES)))
    }

    fn group(&self) -> Option<i32> {
        family::group(i32::try_from(self.0.thread).ok()?)
    }

    fn process_of(&self, descriptor: i32) -> Option<i32> {
        let text = std::fs::read_to_string(format!("/proc/{}/fdinfo/{descriptor}", self.0.thread)).ok()?;
        text.lines().find_map(|line| line.strip_prefix("Pid:"))?.trim().parse().ok()
    }
}
