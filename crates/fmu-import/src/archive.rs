//! The `.fmu` file: a zip archive with a description, binaries and resources (FMI 2.0.4, section 2.3; FMI 3.0.2, section 2.5).

use crate::description::{FmiVersion, Interface, ModelDescription};
use crate::directory::{self, DirectoryError, Entry};
use crate::signature::Signature;
use crate::temporary::Folder;
use crate::terminal;
use object::{FileKind, Object as _, ObjectSegment as _, ReadCache};
use std::collections::HashSet;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read, Seek, Write as _};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Largest unpacked size of one entry, bytes.
const MAX_ENTRY: u64 = 1 << 30;
/// Largest unpacked size of all entries of an archive, bytes.
const MAX_UNPACKED: u64 = 2 << 30;
/// Largest ratio of unpacked to packed bytes. Libraries have 2 to 5, tables of numbers 20, zeros 1000.
const MAX_RATIO: u64 = 200;
/// Unpacked size up to which any ratio is accepted, bytes.
const ANY_RATIO: u64 = 64 << 20;

/// Error of reading or unpacking an archive: it cannot be read, is damaged or rejected, its description is invalid, or it
/// lacks what was asked for.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ArchiveError {
    /// The archive, or a file that was to be written.
    path: PathBuf,
    problem: String,
}

impl ArchiveError {
    /// An error about a file.
    pub fn new(path: &Path, problem: impl Display) -> Self {
        Self { path: path.to_path_buf(), problem: problem.to_string() }
    }

    /// A name leads out of the folder the archive is unpacked to, an entry is not what the archive says, zip readers
    /// disagree about the archive, or it is too large.
    fn rejected(path: &Path, reason: impl Display) -> Self {
        Self::new(path, format!("rejected: {reason}"))
    }
}

fn at<E: Display>(path: &Path) -> impl Fn(E) -> ArchiveError {
    |cause| ArchiveError::new(path, cause)
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_string() } else { names.join(", ") }
}

/// FMI 2.0 name of the platform this program runs on: the folder below `binaries/`.
///
/// FMI 2.0 names only 32 and 64 bit x86 on Windows and Linux, and 64 bit macOS; other machines use
/// the names of FMI 3.0, as fmpy does.
pub fn platform() -> &'static str {
    platform_of(FmiVersion::V2)
}

/// Name of the platform this program runs on in a version of FMI.
pub fn platform_of(fmi: FmiVersion) -> &'static str {
    let [v2, v3] = match (std::env::consts::OS, std::env::consts::ARCH) {
        ("linux", "x86_64") => ["linux64", "x86_64-linux"],
        ("linux", "x86") => ["linux32", "x86-linux"],
        ("linux", "aarch64") => ["aarch64-linux"; 2],
        ("windows", "x86_64") => ["win64", "x86_64-windows"],
        ("windows", "x86") => ["win32", "x86-windows"],
        ("windows", "aarch64") => ["unknown", "aarch64-windows"],
        ("macos", "x86_64") => ["darwin64", "x86_64-darwin"],
        ("macos", "aarch64") => ["darwin64", "aarch64-darwin"],
        _ => ["unknown"; 2],
    };
    if fmi == FmiVersion::V2 { v2 } else { v3 }
}

/// An open `.fmu` file.
pub struct Archive<R = BufReader<File>> {
    path: PathBuf,
    zip: ZipArchive<R>,
    /// Paths of the entries, in their order, with slashes.
    names: Vec<String>,
}

/// Unpacked files of an FMU; removed from the disk when dropped.
#[derive(Debug)]
pub struct Unpacked {
    /// Shared library of this platform.
    pub binary: PathBuf,
    /// Folder of the resources; empty where the FMU has none.
    pub resources: PathBuf,
    /// Version, interface and types of the description, for the calls of the library.
    pub(crate) signature: Signature,
    _folder: Option<Folder>,
}

impl Unpacked {
    /// Files that another process has unpacked and will remove.
    pub(crate) fn elsewhere(binary: PathBuf, resources: PathBuf, signature: Signature) -> Self {
        Self { binary, resources, signature, _folder: None }
    }
}

impl Archive {
    /// Opens an archive and checks the names of its entries and the sizes that it states.
    ///
    /// # Errors
    /// The file cannot be read, is not a zip archive, has too many entries, states a size that would not be unpacked,
    /// has two entries of one name or in one place, or has an entry that is encrypted, a link, or whose name is not a path
    /// within the archive.
    pub fn open(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::open(path).map_err(at(path))?;
        if file.metadata().map_err(at(path))?.is_dir() {
            return Err(ArchiveError::rejected(path, "it is a folder, an FMU is a zip archive"));
        }
        Self::read(path, BufReader::new(file))
    }
}

impl<R: Read + Seek> Archive<R> {
    /// Reads an archive as [`Archive::open`] does, of a file that is open or in memory. `path` names it in messages.
    pub fn read(path: &Path, mut file: R) -> Result<Self, ArchiveError> {
        let rejected = |reason| ArchiveError::rejected(path, reason);
        let entries = directory::read(&mut file).map_err(at(path))?;
        check_sizes(&entries).map_err(rejected)?;
        file.rewind().map_err(at(path))?;
        let zip = ZipArchive::new(file).map_err(|cause| at(path)(DirectoryError::Damaged(cause.to_string())))?;
        let names = check_entries(&entries, &zip).map_err(rejected)?;
        Ok(Self { path: path.to_path_buf(), zip, names })
    }

    /// Names of entries that are separated by backslashes, which zip archives must not have (APPNOTE 6.3.10, section 4.4.17.1).
    /// They are read as if they were slashes.
    pub fn names_with_backslashes(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(|name| Some(name.ok()?.to_string()));
        names.filter(|name| name.contains('\\')).collect()
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// The text of `modelDescription.xml`.
    ///
    /// # Errors
    /// The entry is missing, unreadable, too large, or not UTF-8.
    pub fn description_text(&mut self) -> Result<String, ArchiveError> {
        const NAME: &str = "modelDescription.xml";
        let limit = crate::xml::MAX_BYTES as u64;
        let Some(index) = self.index(NAME) else {
            // A folder was zipped instead of its contents.
            let deeper = self.names.iter().find(|name| name.ends_with(&format!("/{NAME}")));
            let instead = deeper.map_or(String::new(), |name| format!(", but `{name}`"));
            return Err(ArchiveError::rejected(&self.path, format!("it has no {NAME} at its top{instead}")));
        };
        let bytes = self.content(index, NAME, NAME, limit)?;
        String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to() + 1;
            let reason = format!("{NAME} is not UTF-8 (byte {at}), the encoding of a model description");
            ArchiveError::rejected(&self.path, reason)
        })
    }

    /// The content of an entry; `None` if there is none of this name.
    pub fn entry(&mut self, name: &str) -> Result<Option<Vec<u8>>, ArchiveError> {
        let index = self.index(name);
        index.map(|index| self.content(index, name, &format!("the entry `{name}`"), u64::MAX)).transpose()
    }

    /// The content of an entry, which has at most `limit` bytes. `what` names it in messages.
    fn content(&mut self, index: usize, name: &str, what: &str, limit: u64) -> Result<Vec<u8>, ArchiveError> {
        let path = &self.path;
        let entry = self.zip.by_index(index).map_err(|cause| unreadable(path, name, cause))?;
        let stated = entry.size();
        if stated > limit {
            return Err(ArchiveError::rejected(path, format!("{what} has {stated} bytes, at most {limit} are read")));
        }
        let mut bytes = Vec::new();
        entry.take(stated.saturating_add(1)).read_to_end(&mut bytes).map_err(|cause| unreadable(path, name, cause))?;
        if bytes.len() as u64 == stated { Ok(bytes) } else { Err(other_size(path, what, stated)) }
    }

    /// Reads and parses `modelDescription.xml`.
    ///
    /// # Errors
    /// Those of [`Self::description_text`], or it is not a description of FMI 2.0 or 3.0.
    pub fn description(&mut self) -> Result<ModelDescription, ArchiveError> {
        let text = self.description_text()?;
        ModelDescription::parse(&text)
            .map_err(|cause| ArchiveError::new(&self.path, format!("modelDescription.xml: {cause}")))
    }

    /// Platforms the archive has binaries for, sorted.
    pub fn platforms(&self) -> Vec<String> {
        let mut platforms: Vec<String> = self
            .names
            .iter()
            .filter_map(|name| {
                let (platform, file) = name.strip_prefix("binaries/")?.split_once('/')?;
                (!file.is_empty()).then(|| platform.to_string())
            })
            .collect();
        platforms.sort();
        platforms.dedup();
        platforms
    }

    /// Unpacks the binaries of this platform and the resources into a new temporary folder, to use an interface of the FMU.
    /// The description is that of the archive.
    ///
    /// # Errors
    /// The FMU lacks the interface, the archive has no binary for this platform, is damaged, or the temporary folder cannot
    /// be written.
    pub fn unpack(&mut self, description: &ModelDescription, interface: Interface) -> Result<Unpacked, ArchiveError> {
        let identifier = description.model_identifier(interface).ok_or_else(|| {
            let mut found: Vec<String> = description.interfaces().iter().map(ToString::to_string).collect();
            found.extend(description.has_scheduled_execution.then(|| "scheduled execution".to_owned()));
            let found = listed(&found);
            ArchiveError::new(&self.path, format!("the FMU has no interface for {interface}; it has {found}"))
        })?;
        let platform = platform_of(description.fmi);
        let file = format!("{identifier}{}", std::env::consts::DLL_SUFFIX);
        let folder_name = format!("binaries/{platform}/");
        let library = format!("{folder_name}{file}");
        if self.index(&library).is_none() {
            let found = listed(&self.platforms());
            let problem = format!("no binary for {platform} ({library}); the FMU has {found}");
            return Err(ArchiveError::new(&self.path, problem));
        }
        let folder = Folder::new().map_err(at(&std::env::temp_dir()))?;
        let resources = folder.path().join("resources");
        std::fs::create_dir_all(&resources).map_err(at(&resources))?;
        for (i, name) in self.names.iter().enumerate() {
            let entry = self.zip.by_index(i).map_err(|cause| unreadable(&self.path, name, cause))?;
            let wanted = name.starts_with(&folder_name) || name.starts_with("resources/");
            if !wanted || name.ends_with('/') {
                continue;
            }
            let target = folder.path().join(name);
            if let Some(parent) = target.parent() {
                std::fs::create_dir_all(parent).map_err(at(parent))?;
            }
            // `create_new`: no entry may replace another one.
            let mut output = File::create_new(&target).map_err(at(&target))?;
            // The size in the archive may be wrong, so the unpacked bytes are counted.
            let stated = entry.size();
            let mut source = BufReader::with_capacity(1 << 16, entry.take(stated.saturating_add(1)));
            let mut copied = 0;
            loop {
                let bytes = match source.fill_buf() {
                    Ok([]) => break,
                    Ok(bytes) => bytes,
                    Err(cause) if cause.kind() == io::ErrorKind::Interrupted => continue,
                    Err(cause) => return Err(unreadable(&self.path, name, cause)),
                };
                output.write_all(bytes).map_err(at(&target))?;
                let count = bytes.len();
                copied += count as u64;
                source.consume(count);
            }
            if copied != stated {
                return Err(other_size(&self.path, &format!("the entry `{name}`"), stated));
            }
        }
        // Joined part by part: Windows loads no library from a path with slashes.
        let binary = folder.path().join("binaries").join(platform).join(file);
        if !is_whole(&binary).map_err(at(&binary))? {
            let reason = format!("the library `{library}` is damaged or cut off");
            return Err(ArchiveError::rejected(&self.path, reason));
        }
        let signature = Signature::new(description, interface);
        Ok(Unpacked { binary, resources, signature, _folder: Some(folder) })
    }
}

fn unreadable(path: &Path, entry: &str, cause: impl Into<io::Error>) -> ArchiveError {
    ArchiveError::new(path, format!("the entry `{entry}` is damaged or not readable: {}", cause.into()))
}

fn other_size(path: &Path, what: &str, stated: u64) -> ArchiveError {
    ArchiveError::rejected(path, format!("{what} does not have the {stated} bytes that the archive states"))
}

/// Returns true if a library is complete. The loader maps the segments of an ELF file unchecked, and the system ends a
/// process that reads beyond the end of the file. Other damage and other formats are reported by the system.
fn is_whole(library: &Path) -> io::Result<bool> {
    let file = File::open(library)?;
    let length = file.metadata()?.len();
    let content = ReadCache::new(file);
    if !matches!(object::FileKind::parse(&content), Ok(FileKind::Elf32 | FileKind::Elf64)) {
        return Ok(true);
    }
    // In a truncated library the list of sections is missing, because it is at the end.
    let Ok(library) = object::File::parse(&content) else { return Ok(false) };
    let is_there = |(offset, size): (u64, u64)| offset.checked_add(size).is_some_and(|end| end <= length);
    Ok(library.segments().all(|segment| is_there(segment.file_range())))
}

/// Checks the unpacked size of each entry and of all entries. `Err`: the size and the limit that it exceeds.
///
/// The sizes are those stated in the archive. [`Archive::unpack`] writes no more than stated.
fn check_sizes(entries: &[Entry]) -> Result<(), String> {
    let is_bomb = |size: u64, compressed: u64| size > ANY_RATIO && size / MAX_RATIO > compressed;
    let (mut size, mut compressed) = (0_u64, 0_u64);
    for entry in entries {
        let name = || String::from_utf8_lossy(&entry.name);
        if entry.size > MAX_ENTRY {
            let message = format!("the entry `{}` unpacks to {} bytes, at most {MAX_ENTRY} are", name(), entry.size);
            return Err(format!("{message} accepted"));
        }
        if is_bomb(entry.size, entry.compressed) {
            return Err(format!(
                "the entry `{}` unpacks from {} to {} bytes; above {ANY_RATIO} bytes, at most {MAX_RATIO} times as many are accepted",
                name(),
                entry.compressed,
                entry.size
            ));
        }
        size = size.saturating_add(entry.size);
        compressed = compressed.saturating_add(entry.compressed);
    }
    if size > MAX_UNPACKED {
        return Err(format!("its entries unpack to {size} bytes, at most {MAX_UNPACKED} are accepted"));
    }
    if is_bomb(size, compressed) {
        return Err(format!(
            "its entries unpack from {compressed} to {size} bytes; above {ANY_RATIO} bytes, at most {MAX_RATIO} times as many are accepted"
        ));
    }
    Ok(())
}

/// Returns the paths of the entries if the `zip` crate sees the same ones and each is a file or folder within the archive.
/// `Err`: the entry that is not.
fn check_entries<R: Read + io::Seek>(entries: &[Entry], zip: &ZipArchive<R>) -> Result<Vec<String>, String> {
    if zip.len() != entries.len() {
        return Err(format!("the list of its entries has {}, of which {} can be read", entries.len(), zip.len()));
    }
    let (mut paths, mut names) = (HashSet::new(), Vec::new());
    for (i, listed) in entries.iter().enumerate() {
        let name = String::from_utf8_lossy(&listed.name);
        let entry = zip.by_index_data(i).map_err(|cause| format!("the entry `{name}`: {cause}"))?;
        let read = Entry {
            name: entry.name_raw().to_vec(),
            compressed: entry.compressed_size(),
            size: entry.size(),
            header: entry.header_start(),
        };
        if read != *listed {
            return Err(format!("two zip readers see different entries: `{name}` is {listed:?} and {read:?}"));
        }
        if entry.encrypted() {
            return Err(format!("the entry `{name}` is encrypted"));
        }
        if entry.is_symlink() {
            return Err(format!("the entry `{name}` is a link"));
        }
        let Some(path) = path_within(&name) else {
            return Err(format!("the entry `{name}` is not a path within the archive"));
        };
        if terminal::is_unsafe(&name) {
            return Err(format!("the entry `{name}` has control characters in its name"));
        }
        // Also `a/b` and `a/./b`, or a name in another encoding: they are one file.
        if !paths.insert(path.trim_end_matches('/').to_owned()) {
            return Err(format!("the entry `{name}` appears twice"));
        }
        names.push(path);
    }
    Ok(names)
}

/// Returns the path for the name of an entry, with slashes, including one at the end of a folder; `None` if it leads out of
/// the archive. Some tools write backslashes. A drive letter has a meaning on Windows only.
fn path_within(name: &str) -> Option<String> {
    let name = name.replace('\\', "/");
    let is_folder = name.ends_with('/');
    let parts: Vec<&str> = name.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    let leads_out = name.starts_with('/') || name.contains([':', '\0']) || parts.contains(&"..") || parts.is_empty();
    (!leads_out).then(|| parts.join("/") + if is_folder { "/" } else { "" })
}

/// Reads the description of an FMU without unpacking the rest.
pub fn read_description(path: &Path) -> Result<ModelDescription, ArchiveError> {
    Archive::open(path)?.description()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use tempfile::TempDir;
    use zip::write::{SimpleFileOptions, ZipWriter};

    const VEHICLE: &str = include_str!("../tests/data/Vehicle.xml");

    fn fmu(folder: &TempDir, entries: &[(&str, &str)]) -> PathBuf {
        let path = folder.path().join("Vehicle.fmu");
        let mut zip = ZipWriter::new(File::create(&path).unwrap());
        for (name, content) in entries {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content.as_bytes()).unwrap();
        }
        zip.finish().unwrap();
        path
    }

    #[test]
    fn binary_and_resources_are_unpacked_and_removed() {
        let folder = TempDir::new().unwrap();
        let binary = format!("binaries/{}/Vehicle{}", platform(), std::env::consts::DLL_SUFFIX);
        let path = fmu(
            &folder,
            &[
                ("modelDescription.xml", VEHICLE),
                (&binary, "code"),
                ("binaries/other/Vehicle.x", "not for us"),
                ("resources/tables/tire.csv", "1,2"),
                ("documentation/index.html", "not needed"),
            ],
        );
        let mut archive = Archive::open(&path).unwrap();
        let description = archive.description().unwrap();
        assert_eq!(description.model_name, "Vehicle");
        let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap();
        assert_eq!(std::fs::read_to_string(&unpacked.binary).unwrap(), "code");
        let table = unpacked.resources.join("tables/tire.csv");
        assert_eq!(std::fs::read_to_string(&table).unwrap(), "1,2");
        assert!(!unpacked.resources.join("../documentation").exists());
        assert!(!unpacked.resources.join("../binaries/other").exists());
        drop(unpacked);
        assert!(!table.exists());
    }

    #[test]
    fn a_missing_binary_names_the_platforms_there_are() {
        let folder = TempDir::new().unwrap();
        let path = fmu(
            &folder,
            &[
                ("modelDescription.xml", VEHICLE),
                ("binaries/amiga68k/Vehicle.library", ""),
                ("binaries/vms/Vehicle.exe", ""),
            ],
        );
        let mut archive = Archive::open(&path).unwrap();
        let description = archive.description().unwrap();
        let text = archive.unpack(&description, Interface::CoSimulation).unwrap_err().to_string();
        assert!(text.contains(&format!("no binary for {}", platform())), "{text}");
        assert!(text.ends_with("the FMU has amiga68k, vms"), "{text}");
        let text = archive.unpack(&description, Interface::ModelExchange).unwrap_err().to_string();
        assert!(text.ends_with("the FMU has no interface for model exchange; it has co-simulation"), "{text}");
    }

    /// FMI 3.0 names platforms differently.
    #[test]
    fn binaries_of_fmi_3_are_found() {
        let folder = TempDir::new().unwrap();
        let tank = include_str!("../tests/data/Tank.xml");
        let binary = |fmi| format!("binaries/{}/Tank{}", platform_of(fmi), std::env::consts::DLL_SUFFIX);
        assert_ne!(platform_of(FmiVersion::V2), platform_of(FmiVersion::V3));
        let (old, new) = (binary(FmiVersion::V2), binary(FmiVersion::V3));
        let path = fmu(&folder, &[("modelDescription.xml", tank), (&old, "old"), (&new, "new")]);
        let mut archive = Archive::open(&path).unwrap();
        let description = archive.description().unwrap();
        let unpacked = archive.unpack(&description, Interface::ModelExchange).unwrap();
        assert_eq!(std::fs::read_to_string(&unpacked.binary).unwrap(), "new");
    }

    #[test]
    fn archives_that_reach_out_are_rejected() {
        for name in ["../evil", "resources/../../evil", "/evil", "resources\\..\\evil"] {
            let folder = TempDir::new().unwrap();
            let path = fmu(&folder, &[("modelDescription.xml", VEHICLE), (name, "x")]);
            let error = Archive::open(&path).err().expect(name).to_string();
            assert!(error.contains("not a path within"), "{name}: {error}");
        }
    }

    /// Archive of a tool that writes names with the separators of Windows.
    #[test]
    fn backslashes_are_separators() {
        let folder = TempDir::new().unwrap();
        let binary = format!("binaries\\{}\\Vehicle{}", platform(), std::env::consts::DLL_SUFFIX);
        let table = "resources\\tables\\tire.csv";
        let entries =
            [("modelDescription.xml", VEHICLE), (&binary, "code"), (table, "1,2"), ("resources\\empty\\", "")];
        let mut archive = Archive::open(&fmu(&folder, &entries)).unwrap();
        assert_eq!(archive.platforms(), [platform()]);
        assert_eq!(archive.names_with_backslashes(), [&*binary, table, "resources\\empty\\"]);
        assert_eq!(archive.entry("resources/tables/tire.csv").unwrap().as_deref(), Some(&b"1,2"[..]));
        let description = archive.description().unwrap();
        let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap();
        assert_eq!(std::fs::read_to_string(&unpacked.binary).unwrap(), "code");
        assert_eq!(std::fs::read_to_string(unpacked.resources.join("tables/tire.csv")).unwrap(), "1,2");
        // The same file by both separators.
        let entries = [("modelDescription.xml", VEHICLE), (table, "1"), ("resources/tables/tire.csv", "2")];
        let error = Archive::open(&fmu(&folder, &entries)).err().unwrap().to_string();
        assert!(error.ends_with("the entry `resources/tables/tire.csv` appears twice"), "{error}");
    }

    #[test]
    fn more_than_the_limits_is_rejected() {
        let entry = |compressed: u64, size: u64| Entry { name: b"x".to_vec(), compressed, size, header: 0 };
        let rejected = |entries: &[Entry]| check_sizes(entries).unwrap_err();
        assert_eq!(
            rejected(&[entry(1 << 30, (1 << 30) + 1)]),
            "the entry `x` unpacks to 1073741825 bytes, at most 1073741824 are accepted"
        );
        let message = rejected(&[entry(1 << 30, 1 << 30), entry(1 << 30, 1 << 30), entry(1, 1)]);
        assert_eq!(message, "its entries unpack to 2147483649 bytes, at most 2147483648 are accepted");
        let message = rejected(&[entry(1_000_000, 300_000_000)]);
        let ratio = "; above 67108864 bytes, at most 200 times as many are accepted";
        assert_eq!(message, format!("the entry `x` unpacks from 1000000 to 300000000 bytes{ratio}"));
        let message = rejected(&[entry(100_000, 60_000_000), entry(100_000, 60_000_000)]);
        assert_eq!(message, format!("its entries unpack from 200000 to 120000000 bytes{ratio}"));
        assert_eq!(check_sizes(&[entry(1 << 29, 1 << 30), entry(10, 60_000_000)]), Ok(()));
    }

    #[test]
    fn one_file_by_two_names_and_control_characters_are_rejected() {
        for (name, expected) in [
            ("resources/./table.csv", "the entry `resources/./table.csv` appears twice"),
            ("resources/a\u{1b}[2Jb", "has control characters in its name"),
            ("resources/gpj.\u{202e}exe", "has control characters in its name"),
        ] {
            let folder = TempDir::new().unwrap();
            let path = fmu(&folder, &[("modelDescription.xml", VEHICLE), ("resources/table.csv", "1"), (name, "2")]);
            let error = Archive::open(&path).err().expect(name).to_string();
            assert!(error.contains(expected), "{name}: {error}");
        }
    }

    #[test]
    fn files_that_are_no_fmu_are_clear_errors() {
        let folder = TempDir::new().unwrap();
        let text = folder.path().join("text.fmu");
        std::fs::write(&text, "not a zip").unwrap();
        let error = read_description(&text).unwrap_err().to_string();
        assert!(error.contains("text.fmu: not a readable FMU: no zip archive"), "{error}");
        let missing = folder.path().join("missing.fmu");
        let error = read_description(&missing).unwrap_err().to_string();
        let cause = std::fs::read(&missing).unwrap_err();
        assert_eq!(error, format!("{}: {cause}", missing.display()));
        let empty = fmu(&folder, &[("readme.txt", "")]);
        let error = read_description(&empty).unwrap_err().to_string();
        assert!(error.ends_with("it has no modelDescription.xml at its top"), "{error}");
        let broken = fmu(&folder, &[("modelDescription.xml", "<a>")]);
        let error = read_description(&broken).unwrap_err().to_string();
        assert!(error.contains("modelDescription.xml: line 1"), "{error}");
    }
}
