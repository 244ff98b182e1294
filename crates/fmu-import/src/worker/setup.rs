//! The rules for a worker and the list of its incidents: files in its folder to which FMUs cannot write.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

/// The rules for a worker, which the worker reads at its start.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Setup {
    /// Folders to which the worker may write; `None` without a sandbox.
    pub(super) writable: Option<Vec<PathBuf>>,
    /// Memory limit for each process of the worker, bytes.
    pub(super) memory: Option<u64>,
}

const RULES: &str = "setup";
const INCIDENTS: &str = "incidents";

impl Setup {
    /// Writes the rules next to a call board, and creates the file of incidents.
    pub(super) fn write(&self, board: &Path) -> io::Result<Incidents> {
        std::fs::write(board.with_file_name(RULES), serde_json::to_vec(self)?)?;
        let path = board.with_file_name(INCIDENTS);
        let file = File::options().read(true).write(true).create_new(true).open(path)?;
        Ok(Incidents { file, position: 0 })
    }

    pub(super) fn read(board: &Path) -> io::Result<Self> {
        Ok(serde_json::from_slice(&std::fs::read(board.with_file_name(RULES))?)?)
    }

    /// Opens the file of incidents next to a call board for writing.
    #[cfg(target_os = "linux")]
    pub(super) fn incidents(board: &Path) -> io::Result<File> {
        File::options().append(true).open(board.with_file_name(INCIDENTS))
    }
}

/// An unexpected event in a worker.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Incident {
    /// The sandbox denied an action of an FMU.
    Denied {
        /// Index of the component whose function was called.
        component: Option<usize>,
        /// Name of the function; empty while the library was loaded.
        function: String,
        /// The denied action, including the path or number and the system call.
        action: String,
    },
    /// Processes that FMUs started were still running when the worker ended.
    Left {
        /// Names of the programs.
        programs: Vec<String>,
        /// False if some of them could not be ended.
        are_ended: bool,
    },
    /// The worker ended, possibly because it reached its memory limit.
    Memory {
        /// Maximum memory in use, bytes.
        used: u64,
        /// Memory limit, bytes.
        limit: u64,
    },
    /// The sandbox is missing or incomplete, because this machine does not support it.
    NoSandbox(String),
}

impl fmt::Display for Incident {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Denied { function, action, .. } if function.is_empty() => {
                write!(f, "the sandbox denied {action}, while the library was loaded")
            }
            Self::Denied { function, action, .. } => write!(f, "the sandbox denied {action}, during {function}"),
            Self::Left { programs, are_ended: false } if programs.is_empty() => {
                f.write_str("processes that an FMU had started could not be ended")
            }
            Self::Left { programs, are_ended } => {
                let (count, more) = match (programs.len(), are_ended) {
                    (1, true) => ("a process".to_owned(), "did not end with the run; it was ended"),
                    (1, false) => ("a process".to_owned(), "could not be ended"),
                    (count, true) => (format!("{count} processes"), "did not end with the run; they were ended"),
                    (count, false) => (format!("{count} processes"), "could not be ended"),
                };
                let mut names: Vec<&str> = Vec::new();
                for program in programs {
                    if !names.contains(&program.as_str()) {
                        names.push(program);
                    }
                }
                let dots = if names.len() > 5 { ", ..." } else { "" };
                names.truncate(5);
                write!(f, "{count} that an FMU had started ({}{dots}) {more}", names.join(", "))
            }
            Self::Memory { used, limit } => write!(
                f,
                "{:.1} of {:.1} GiB of memory were in use at the end; --memory sets another limit",
                *used as f64 / GIB,
                *limit as f64 / GIB
            ),
            Self::NoSandbox(reason) => f.write_str(reason),
        }
    }
}

const GIB: f64 = (1_u64 << 30) as f64;

#[derive(Debug)]
pub(super) struct Incidents {
    file: File,
    position: u64,
}

impl Incidents {
    /// The incidents since the last call to this function. Unreadable lines are skipped.
    pub(super) fn take(&mut self) -> Vec<Incident> {
        let mut text = String::new();
        let read = self.file.seek(SeekFrom::Start(self.position)).and_then(|_| self.file.read_to_string(&mut text));
        // The last line may be incomplete.
        let (Ok(_), Some(end)) = (read, text.rfind('\n')) else { return Vec::new() };
        self.position += end as u64 + 1;
        text[..end].lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }
}

/// Writes an incident. Ignores failures.
#[cfg(target_os = "linux")]
pub(super) fn note(mut file: &File, incident: &Incident) {
    use std::io::Write as _;
    if let Ok(mut line) = serde_json::to_string(incident) {
        line.push('\n');
        let _ = file.write_all(line.as_bytes());
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn incidents_are_read_once_each_and_whole() {
        let folder = tempfile::TempDir::new().unwrap();
        let board = folder.path().join("calls");
        let mut incidents = Setup { writable: None, memory: Some(7) }.write(&board).unwrap();
        assert_eq!(Setup::read(&board).unwrap().memory, Some(7));
        assert_eq!(incidents.take(), []);
        let file = Setup::incidents(&board).unwrap();
        let first = Incident::Left { programs: vec!["a".to_owned()], are_ended: true };
        note(&file, &first);
        let second = Incident::NoSandbox("b".to_owned());
        note(&file, &second);
        std::io::Write::write_all(&mut &file, b"\"half").unwrap();
        assert_eq!(incidents.take(), [first, second]);
        assert_eq!(incidents.take(), []);
    }
}
