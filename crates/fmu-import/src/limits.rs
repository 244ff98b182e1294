//! Size limits for files and plans: far above any realistic need, far below the capacity of a machine.

use std::io;
use std::path::Path;

/// Maximum size of a scenario, study or parameter set, in bytes.
pub const TEXT_FILE: u64 = 4_000_000;
/// Maximum size of a CSV file of input signals, in bytes.
pub const INPUT_FILE: u64 = 256_000_000;
/// Maximum size of a file with the value of a Binary, in bytes. The plan contains the value.
pub const BINARY_FILE: u64 = 16_000_000;
/// Maximum length of a line in these files, in bytes.
pub const LINE: usize = 100_000;
/// Maximum number of steps in a run.
pub const STEPS: u64 = 100_000_000;
/// Maximum number of recorded values in a run, rows times signals. With 8 bytes each, this is 1 GB of memory per run.
pub const RECORDED: u64 = 125_000_000;
/// Maximum number of runs in a scenario: cases times points times seeds.
pub const RUNS: usize = 10_000;

/// Reads a text file with at most `limit` bytes, in lines of at most [`LINE`] bytes. Fails if the file cannot be read,
/// is larger, has a longer line, or is not UTF-8.
pub fn read_text(path: &Path, limit: u64) -> io::Result<String> {
    let reject = |message: String| io::Error::new(io::ErrorKind::InvalidData, message);
    let text = String::from_utf8(read_bytes(path, limit)?).map_err(|error| reject(error.to_string()))?;
    for (number, line) in text.lines().enumerate() {
        if line.len() > LINE {
            return Err(reject(format!("line {} has {} bytes, the limit is {LINE}", number + 1, line.len())));
        }
    }
    Ok(text)
}

/// Reads a file with at most `limit` bytes.
pub fn read_bytes(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    files::read(path, limit)
}

fn too_large(size: Option<u64>, limit: u64) -> io::Error {
    let size = size.map_or_else(|| "the file is too large".to_string(), |size| format!("the file has {size} bytes"));
    io::Error::new(io::ErrorKind::InvalidData, format!("{size}, the limit is {limit}"))
}

#[cfg(not(target_family = "wasm"))]
mod files {
    use super::too_large;
    use std::fs::File;
    use std::io::{self, Read as _};
    use std::path::Path;

    pub(super) fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
        let file = File::open(path)?;
        let told = file.metadata()?.len();
        if told > limit {
            return Err(too_large(Some(told), limit));
        }
        let mut bytes = Vec::new();
        // The size of a device or a pipe is unknown.
        let read = file.take(limit + 1).read_to_end(&mut bytes)? as u64;
        if read > limit { Err(too_large(None, limit)) } else { Ok(bytes) }
    }
}

/// WebAssembly has no files; the program that contains this crate provides their texts.
#[cfg(target_family = "wasm")]
mod files {
    use super::too_large;
    use std::collections::BTreeMap;
    use std::io;
    use std::path::{Component, Path};
    use std::sync::{Mutex, PoisonError};

    static TEXTS: Mutex<BTreeMap<String, String>> = Mutex::new(BTreeMap::new());

    pub(super) fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
        let texts = TEXTS.lock().unwrap_or_else(PoisonError::into_inner);
        let text = texts.get(&plain(path)).ok_or(io::ErrorKind::NotFound)?;
        let size = text.len() as u64;
        if size > limit { Err(too_large(Some(size), limit)) } else { Ok(text.clone().into_bytes()) }
    }

    fn plain(path: &Path) -> String {
        let mut parts: Vec<String> = Vec::new();
        for part in path.components() {
            match part {
                Component::ParentDir => drop(parts.pop()),
                Component::CurDir => {}
                other => parts.push(other.as_os_str().to_string_lossy().into_owned()),
            }
        }
        parts.join("/")
    }

    /// Provides the text of a file.
    pub fn provide(path: String, text: String) {
        TEXTS.lock().unwrap_or_else(PoisonError::into_inner).insert(path, text);
    }
}

#[cfg(target_family = "wasm")]
pub use files::provide;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_lines_are_limited() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let error = |content: &str, limit| {
            std::fs::write(&path, content).unwrap();
            read_text(&path, limit).unwrap_err().to_string()
        };
        assert_eq!(error("123456", 5), "the file has 6 bytes, the limit is 5");
        let long = format!("a\n{}\n", "x".repeat(LINE + 1));
        assert_eq!(error(&long, TEXT_FILE), "line 2 has 100001 bytes, the limit is 100000");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_text(&path, 5).unwrap(), "12345");
        // A sparse file that does not fit in memory.
        std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert!(read_text(&path, INPUT_FILE).unwrap_err().to_string().contains("the limit is 256000000"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_endless_device_is_rejected() {
        let error = read_text(Path::new("/dev/zero"), 1000).unwrap_err().to_string();
        assert_eq!(error, "the file is too large, the limit is 1000");
    }
}
