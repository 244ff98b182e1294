//! Descendants of the supervisor, read from `/proc`.

use rustix::process::{Pid, getpid};

/// Fields in `/proc/ID/stat` for a process or thread.
pub(super) struct Status {
    pub(super) program: String,
    parent: i32,
    pub(super) group: i32,
    /// True if all threads of the process have ended.
    is_over: bool,
}

impl Status {
    fn read(id: i32) -> Option<Self> {
        let text = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
        // The name is in parentheses and may contain any characters.
        let (start, rest) = text.rsplit_once(')')?;
        let (_, program) = start.split_once('(')?;
        let fields: Vec<&str> = rest.split_ascii_whitespace().collect();
        Some(Self {
            program: program.to_owned(),
            parent: fields.get(1)?.parse().ok()?,
            group: fields.get(2)?.parse().ok()?,
            // In this state, other threads may still run: the first thread may have ended before them.
            is_over: ["Z", "X"].contains(fields.first()?) && fields.get(17)?.parse::<u32>().ok()? < 2,
        })
    }
}

/// The running descendants of this process. The newest comes first, because it may end while the others are read.
pub(super) fn members() -> impl Iterator<Item = (Pid, Status)> {
    let entries = std::fs::read_dir("/proc").into_iter().flatten().filter_map(Result::ok);
    let mut ids: Vec<i32> = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
    ids.sort_unstable();
    let members = ids.into_iter().rev().filter(|id| is_member(*id));
    members.filter_map(|id| Some((Pid::from_raw(id)?, Status::read(id).filter(|status| !status.is_over)?)))
}

pub(super) fn is_member(id: i32) -> bool {
    // Process IDs can be reused while they are read; the limit prevents an endless loop.
    const DEEPEST: usize = 1000;
    let own = getpid().as_raw_nonzero().get();
    let parents = std::iter::successors(Some(id), |id| Status::read(*id).map(|status| status.parent));
    id > 1 && id != own && parents.take(DEEPEST).take_while(|id| *id > 1).any(|id| id == own)
}

/// Name of the program that a process executes. If an FMU forked the process without starting another program, the name
/// begins with "a copy of".
pub(super) fn name(id: Pid, program: String) -> String {
    let file = |process: &str| std::fs::read_link(format!("/proc/{process}/exe")).ok();
    let is_copy = match file(&id.as_raw_nonzero().to_string()) {
        Some(other) => file("self") == Some(other),
        // The process or its first thread has ended.
        None => Status::read(getpid().as_raw_nonzero().get()).is_some_and(|own| own.program == program),
    };
    if is_copy { format!("a copy of {program}") } else { program }
}

pub(super) fn group(id: i32) -> Option<i32> {
    Status::read(id).map(|status| status.group)
}
