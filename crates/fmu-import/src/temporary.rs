//! Folders for temporary files. They are private to the user, and are deleted even if the process is killed.
//!
//! A process has a root folder, `cargo-fmu-ID` in the system's folder for temporary files, and keeps the file
//! `cargo-fmu-ID.lock` next to it locked. The root folder is deleted when its last folder is dropped, by [`remove`],
//! and on SIGINT, SIGTERM and SIGHUP after [`remove_on_signals`]. If a process is killed, the system releases its lock;
//! the next process that creates a folder then deletes the root folder.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

const PREFIX: &str = "cargo-fmu-";
const LOCK: &str = ".lock";

/// A folder, deleted when dropped.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    // The root folder is deleted together with its last folder.
    _root: Arc<Root>,
}

#[derive(Debug)]
struct Root {
    path: PathBuf,
    lock: PathBuf,
    _locked: File,
}

static ROOT: Mutex<Weak<Root>> = Mutex::new(Weak::new());

fn root() -> MutexGuard<'static, Weak<Root>> {
    ROOT.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Folder {
    /// Creates a folder that only the user can access.
    pub fn new() -> io::Result<Self> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let mut current = root();
        let root = match current.upgrade() {
            Some(root) => root,
            None => {
                let root = Arc::new(Root::new(&std::path::absolute(std::env::temp_dir())?)?);
                *current = Arc::downgrade(&root);
                root
            }
        };
        let path = root.path.join(COUNT.fetch_add(1, Ordering::Relaxed).to_string());
        make_private(&path)?;
        Ok(Self { path, _root: root })
    }

    /// Absolute path.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A failure is ignored, because dropping the root tries again.
        let _ = std::fs::remove_dir_all(&self.path);
    }
}

impl Root {
    fn new(parent: &Path) -> io::Result<Self> {
        loop {
            let (locked, lock) = tempfile::Builder::new().prefix(PREFIX).suffix(LOCK).tempfile_in(parent)?.keep()?;
            // Before the file was locked, another process may have found it and deleted it as stale.
            if locked.try_lock().is_err() || !lock.exists() {
                continue;
            }
            remove_stale(parent, &locked.metadata()?);
            let path = folder_of(&lock);
            make_private(&path)?;
            return Ok(Self { path, lock, _locked: locked });
        }
    }

    fn remove(&self) {
        // The lock file is deleted last, and only if the folder is gone. Otherwise a later process tries again.
        if std::fs::remove_dir_all(&self.path).is_ok() {
            let _ = std::fs::remove_file(&self.lock);
        }
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        self.remove();
    }
}

fn folder_of(lock: &Path) -> PathBuf {
    let name = lock.file_name().unwrap_or_default().to_string_lossy();
    lock.with_file_name(name.strip_suffix(LOCK).unwrap_or(&name))
}

/// Deletes the folders of ended processes of the same user.
fn remove_stale(parent: &Path, own: &Metadata) {
    for entry in std::fs::read_dir(parent).into_iter().flatten().filter_map(Result::ok) {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        // Links and pipes are skipped; opening a pipe would block.
        let is_ours = || entry.metadata().is_ok_and(|found| found.is_file() && is_same_owner(&found, own));
        if !(name.starts_with(PREFIX) && name.ends_with(LOCK) && is_ours()) {
            continue;
        }
        let lock = entry.path();
        let Ok(file) = OpenOptions::new().write(true).open(&lock) else { continue };
        if file.try_lock().is_ok() {
            let folder = folder_of(&lock);
            if std::fs::remove_dir_all(&folder).is_ok() || !folder.exists() {
                let _ = std::fs::remove_file(&lock);
            }
        }
    }
}

#[cfg(unix)]
fn is_same_owner(found: &Metadata, own: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    found.uid() == own.uid()
}

/// On other systems, every user has a private folder for temporary files.
#[cfg(not(unix))]
fn is_same_owner(_: &Metadata, _: &Metadata) -> bool {
    true
}

#[cfg(unix)]
fn make_private(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::DirBuilderExt as _;
    std::fs::DirBuilder::new().mode(0o700).create(path)
}

#[cfg(not(unix))]
fn make_private(path: &Path) -> io::Result<()> {
    std::fs::create_dir(path)
}

/// Deletes the folders of this process, which is about to end.
pub fn remove() {
    if let Some(root) = root().upgrade() {
        root.remove();
    }
}

/// Deletes the folders of this process when a signal requests its end; the signal then ends the process. On systems
/// other than Unix, the next process deletes them.
pub fn remove_on_signals() -> io::Result<()> {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
        let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
        // `nohup` starts a command with this signal ignored; it must stay ignored.
        if !is_ignored(SIGHUP) {
            signals.add_signal(SIGHUP)?;
        }
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
            for signal in signals.forever() {
                remove();
                // Does not return for these signals.
                let _ = signal_hook::low_level::emulate_default_handler(signal);
            }
        })?;
    }
    Ok(())
}

/// Returns true if this process ignores a signal. Known on Linux only; false elsewhere.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Writes a file, and its folder, through a temporary file beside it: the file is complete or does not exist.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut part = tempfile::Builder::new().prefix(".").suffix(".part").tempfile_in(folder)?;
    part.write_all(bytes)?;
    part.as_file().sync_all()?;
    // Only its owner can read a temporary file; the results get the usual permissions.
    #[cfg(unix)]
    part.as_file().set_permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644))?;
    part.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use tempfile::TempDir;

    fn names(folder: &Path) -> BTreeSet<String> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn only_folders_of_ended_processes_are_stale() {
        let parent = TempDir::new().unwrap();
        let alive = Root::new(parent.path()).unwrap();
        std::fs::write(alive.path.join("used"), "").unwrap();
        // Files of a killed process, and files with similar names.
        for name in ["cargo-fmu-dead", "cargo-fmu-mine", "other"] {
            std::fs::create_dir(parent.path().join(name)).unwrap();
            std::fs::write(parent.path().join(name).join("file"), "").unwrap();
        }
        for name in ["cargo-fmu-dead.lock", "cargo-fmu-empty.lock", "other.lock"] {
            std::fs::write(parent.path().join(name), "").unwrap();
        }
        let next = Root::new(parent.path()).unwrap();
        let mut expected: BTreeSet<String> = ["cargo-fmu-mine", "other", "other.lock"].map(String::from).into();
        for root in [&alive, &next] {
            let name = root.path.file_name().unwrap().to_string_lossy().into_owned();
            expected.extend([format!("{name}.lock"), name]);
        }
        assert_eq!(names(parent.path()), expected);
        assert!(alive.path.join("used").exists());
        drop((alive, next));
        assert_eq!(names(parent.path()), ["cargo-fmu-mine", "other", "other.lock"].map(String::from).into());
    }

    #[cfg(unix)]
    #[test]
    fn only_the_user_can_access_the_folder() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = Folder::new().unwrap();
        for path in [folder.path(), folder.path().parent().unwrap()] {
            assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o700, "{}", path.display());
        }
        let path = folder.path().to_path_buf();
        drop(folder);
        assert!(!path.exists());
    }
}
