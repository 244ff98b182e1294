//! Zip archives of unknown origin, such as the `.fmu` file, which contains a description, binaries and resources (FMI
//! 2.0.4, section 2.3; FMI 3.0.2, section 2.5).

use crate::description::{FmiVersion, Interface, ModelDescription, StructuralParameters, Terminal};
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

/// Maximum unpacked size of one entry, bytes.
const MAX_ENTRY: u64 = 1 << 30;
/// Maximum unpacked size of all entries together, bytes.
const MAX_UNPACKED: u64 = 2 << 30;
/// Maximum ratio of unpacked to packed bytes. Typical ratios: libraries 2 to 5, tables of numbers 20, zeros 1000.
const MAX_RATIO: u64 = 200;
/// Unpacked size up to which any ratio is accepted, bytes.
const ANY_RATIO: u64 = 64 << 20;

/// Error while reading or unpacking an archive: it cannot be read, is damaged or rejected, its description is invalid,
/// or the requested interface or platform is missing.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ArchiveError {
    /// The archive, or the file that could not be written.
    path: PathBuf,
    problem: String,
}

impl ArchiveError {
    /// An error about a file.
    pub fn new(path: &Path, problem: impl Display) -> Self {
        Self { path: path.to_path_buf(), problem: problem.to_string() }
    }

    /// The archive is hostile, ambiguous or too large.
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

/// FMI 2.0 name of the platform on which this program runs. The folder in `binaries/` has this name.
///
/// FMI 2.0 defines names only for 32- and 64-bit x86 on Windows and Linux, and for 64-bit macOS. Other platforms have
/// their FMI 3.0 names, as in FMPy.
pub fn platform() -> &'static str {
    platform_of(FmiVersion::V2)
}

/// Name of the platform on which this program runs, as an FMI version defines it.
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

/// An open archive.
pub struct Archive<R = BufReader<File>> {
    path: PathBuf,
    zip: ZipArchive<R>,
    /// Paths of the entries, with slashes, in the order of the archive.
    names: Vec<String>,
}

/// Unpacked files of an FMU, deleted when dropped.
#[derive(Debug)]
pub struct Unpacked {
    /// Shared library for this platform.
    pub binary: PathBuf,
    /// Folder `resources`; empty if the FMU has none.
    pub resources: PathBuf,
    /// Version, interface and types from the description, which calls to the library need.
    pub(crate) signature: Signature,
    _folder: Option<Folder>,
}

impl Unpacked {
    /// Files that another process unpacked and will delete.
    pub(crate) fn elsewhere(binary: PathBuf, resources: PathBuf, signature: Signature) -> Self {
        Self { binary, resources, signature, _folder: None }
    }
}

impl Archive {
    /// Opens an archive and checks the names of its entries and their declared sizes. Fails if the file cannot be read
    /// or is not a zip archive, if there are too many entries, if two have the same name or overlap, or if an entry is
    /// too large, encrypted, a link, or not a path within the archive.
    pub fn open(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::open(path).map_err(at(path))?;
        if file.metadata().map_err(at(path))?.is_dir() {
            return Err(ArchiveError::rejected(path, "it is a folder, not a zip archive"));
        }
        Self::read(path, BufReader::new(file))
    }
}

impl<R: Read + Seek> Archive<R> {
    /// Like [`Archive::open`], for a file that is open or in memory. Messages contain `path`.
    pub fn read(path: &Path, mut file: R) -> Result<Self, ArchiveError> {
        let rejected = |reason| ArchiveError::rejected(path, reason);
        let entries = directory::read(&mut file).map_err(at(path))?;
        check_sizes(&entries).map_err(rejected)?;
        file.rewind().map_err(at(path))?;
        let zip = ZipArchive::new(file).map_err(|cause| at(path)(DirectoryError::Damaged(cause.to_string())))?;
        let names = check_entries(&entries, &zip).map_err(rejected)?;
        Ok(Self { path: path.to_path_buf(), zip, names })
    }

    /// Names of entries that contain backslashes. Zip archives must not contain such names (APPNOTE 6.3.10, section
    /// 4.4.17.1), but they are read as if the backslashes were slashes.
    pub fn names_with_backslashes(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(|name| Some(name.ok()?.to_string()));
        names.filter(|name| name.contains('\\')).collect()
    }

    /// Paths of the entries, with slashes.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Reads an entry as text. Returns `None` if the archive does not contain it.
    pub fn text_of(&mut self, name: &str) -> Result<Option<String>, ArchiveError> {
        self.index(name).map(|index| self.text(index, name)).transpose()
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// The text of `modelDescription.xml`. Fails if the entry is missing, unreadable, too large, or not UTF-8.
    pub fn description_text(&mut self) -> Result<String, ArchiveError> {
        const NAME: &str = "modelDescription.xml";
        let Some(index) = self.index(NAME) else {
            // Probably a folder was zipped instead of its contents.
            let deeper = self.names.iter().find(|name| name.ends_with(&format!("/{NAME}")));
            let instead = deeper.map_or(String::new(), |name| format!(", but `{name}`"));
            return Err(ArchiveError::rejected(&self.path, format!("it has no {NAME} at its root{instead}")));
        };
        self.text(index, NAME)
    }

    /// The text of an XML file.
    fn text(&mut self, index: usize, name: &str) -> Result<String, ArchiveError> {
        let bytes = self.content(index, name, name, crate::xml::MAX_BYTES as u64)?;
        String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to() + 1;
            let reason = format!("{name} must be encoded in UTF-8, but byte {at} is invalid");
            ArchiveError::rejected(&self.path, reason)
        })
    }

    /// The content of an entry; `None` if there is no entry with this name.
    pub fn entry(&mut self, name: &str) -> Result<Option<Vec<u8>>, ArchiveError> {
        let index = self.index(name);
        index.map(|index| self.content(index, name, &format!("the entry `{name}`"), u64::MAX)).transpose()
    }

    /// The content of an entry with at most `limit` bytes. Messages contain `what`.
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

    /// Reads and parses `modelDescription.xml`. Fails like [`Self::description_text`] and [`ModelDescription::parse`].
    pub fn description(&mut self) -> Result<ModelDescription, ArchiveError> {
        self.description_with(&StructuralParameters::new())
    }

    /// Like [`Self::description`], with values of structural parameters, see [`ModelDescription::parse_with`].
    pub fn description_with(&mut self, structure: &StructuralParameters) -> Result<ModelDescription, ArchiveError> {
        let text = self.description_text()?;
        ModelDescription::parse_with(&text, structure)
            .map_err(|cause| ArchiveError::new(&self.path, format!("modelDescription.xml: {cause}")))
    }

    /// Reads the terminals of FMI 3.0; empty without a `terminalsAndIcons.xml`. Fails like [`Terminal::parse_all`], or if
    /// the file is unreadable, too large, or not UTF-8.
    pub fn terminals(&mut self) -> Result<Vec<Terminal>, ArchiveError> {
        const NAME: &str = "terminalsAndIcons/terminalsAndIcons.xml";
        let Some(index) = self.index(NAME) else { return Ok(Vec::new()) };
        let text = self.text(index, NAME)?;
        Terminal::parse_all(&text).map_err(|cause| ArchiveError::new(&self.path, format!("{NAME}: {cause}")))
    }

    /// Platforms for which the archive contains binaries, sorted.
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

    /// Unpacks resources and binaries for this platform. `description` must come from this archive. Fails if the FMU
    /// does not have the interface or a binary for this platform, if the archive is damaged, or if the temporary folder
    /// cannot be written.
    pub fn unpack(&mut self, description: &ModelDescription, interface: Interface) -> Result<Unpacked, ArchiveError> {
        let identifier = description.model_identifier(interface).ok_or_else(|| {
            let found: Vec<String> = description.interfaces().iter().map(ToString::to_string).collect();
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
            // `create_new`, because an entry must not replace another entry.
            let mut output = File::create_new(&target).map_err(at(&target))?;
            // The declared size may be wrong, so the unpacked bytes are counted.
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
        // Joined part by part, because Windows does not load a library from a path with slashes.
        let binary = folder.path().join("binaries").join(platform).join(file);
        if !is_whole(&binary).map_err(at(&binary))? {
            let reason = format!("the library `{library}` is damaged or truncated");
            return Err(ArchiveError::rejected(&self.path, reason));
        }
        let signature = Signature::new(description, interface);
        Ok(Unpacked { binary, resources, signature, _folder: Some(folder) })
    }
}

fn unreadable(path: &Path, entry: &str, cause: impl Into<io::Error>) -> ArchiveError {
    ArchiveError::new(path, format!("the entry `{entry}` is damaged or unreadable: {}", cause.into()))
}

fn other_size(path: &Path, what: &str, stated: u64) -> ArchiveError {
    ArchiveError::rejected(path, format!("the size of {what} is not the {stated} bytes that the archive declares"))
}

/// Returns false if an ELF library is truncated. The loader maps its segments without checks, and the system kills a
/// process that reads beyond the end of the file. Other damage and other formats are reported by the system.
fn is_whole(library: &Path) -> io::Result<bool> {
    let file = File::open(library)?;
    let length = file.metadata()?.len();
    let content = ReadCache::new(file);
    if !matches!(object::FileKind::parse(&content), Ok(FileKind::Elf32 | FileKind::Elf64)) {
        return Ok(true);
    }
    // Parsing fails if the section headers, at the end of the file, are missing.
    let Ok(library) = object::File::parse(&content) else { return Ok(false) };
    let is_there = |(offset, size): (u64, u64)| offset.checked_add(size).is_some_and(|end| end <= length);
    Ok(library.segments().all(|segment| is_there(segment.file_range())))
}

/// Checks the declared unpacked size of each entry and their sum. [`Archive::unpack`] never writes more than declared.
fn check_sizes(entries: &[Entry]) -> Result<(), String> {
    let (mut size, mut compressed) = (0_u64, 0_u64);
    for entry in entries {
        let what = format!("the entry `{}` unpacks", String::from_utf8_lossy(&entry.name));
        check_size(&what, entry.size, entry.compressed, MAX_ENTRY)?;
        size = size.saturating_add(entry.size);
        compressed = compressed.saturating_add(entry.compressed);
    }
    check_size("its entries unpack", size, compressed, MAX_UNPACKED)
}

/// Checks a size and its ratio; messages begin with `what`.
fn check_size(what: &str, size: u64, compressed: u64, most: u64) -> Result<(), String> {
    if size > most {
        return Err(format!("{what} to {size} bytes, at most {most} are accepted"));
    }
    if size > ANY_RATIO && size / MAX_RATIO > compressed {
        return Err(format!(
            "{what} from {compressed} to {size} bytes; above {ANY_RATIO} bytes, the ratio must not exceed {MAX_RATIO}"
        ));
    }
    Ok(())
}

/// Returns the paths of the entries. Fails if the `zip` crate sees other entries, or if an entry is not acceptable.
fn check_entries<R: Read + io::Seek>(entries: &[Entry], zip: &ZipArchive<R>) -> Result<Vec<String>, String> {
    if zip.len() != entries.len() {
        return Err(format!("it lists {} entries, but {} can be read", entries.len(), zip.len()));
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
            return Err(format!(
                "zip readers do not agree about the entry `{name}`: one reads {listed:?}, another {read:?}"
            ));
        }
        let problem = match path_within(&name) {
            _ if entry.encrypted() => "is encrypted",
            _ if entry.is_symlink() => "is a link",
            None => "is not a path within the archive",
            Some(_) if terminal::is_unsafe(&name) => "has control characters in its name",
            // Different names can refer to the same file: `a/b` and `a/./b`, or a name in two encodings.
            Some(path) if !paths.insert(path.trim_end_matches('/').to_owned()) => "appears twice",
            Some(path) => {
                names.push(path);
                continue;
            }
        };
        return Err(format!("the entry `{name}` {problem}"));
    }
    Ok(names)
}

/// Converts the name of an entry to a path with slashes; a folder's path ends with a slash. Returns `None` if the path
/// leads out of the archive. Backslashes, which some tools write, count as slashes. Colons are rejected on all systems,
/// because on Windows they follow a drive letter.
pub fn path_within(name: &str) -> Option<String> {
    let name = name.replace('\\', "/");
    let is_folder = name.ends_with('/');
    let parts: Vec<&str> = name.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    let leads_out = name.starts_with('/') || name.contains([':', '\0']) || parts.contains(&"..") || parts.is_empty();
    (!leads_out).then(|| parts.join("/") + if is_folder { "/" } else { "" })
}

/// Reads the description of an FMU without unpacking the FMU.
pub fn read_description(path: &Path) -> Result<ModelDescription, ArchiveError> {
    read_description_with(path, &StructuralParameters::new())
}

/// Like [`read_description`], with values of structural parameters, see [`ModelDescription::parse_with`].
pub fn read_description_with(path: &Path, structure: &StructuralParameters) -> Result<ModelDescription, ArchiveError> {
    Archive::open(path)?.description_with(structure)
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

    /// In FMI 3.0, platforms have other names than in FMI 2.0.
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
    fn paths_out_of_the_archive_are_rejected() {
        for name in ["../evil", "resources/../../evil", "/evil", "resources\\..\\evil"] {
            let folder = TempDir::new().unwrap();
            let path = fmu(&folder, &[("modelDescription.xml", VEHICLE), (name, "x")]);
            let error = Archive::open(&path).err().expect(name).to_string();
            assert!(error.contains("not a path within"), "{name}: {error}");
        }
    }

    /// An archive from a tool that writes backslashes, as on Windows.
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
        // Two entries for the same file: one with backslashes, the other with slashes.
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
        let ratio = "; above 67108864 bytes, the ratio must not exceed 200";
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
    fn other_files_are_clear_errors() {
        let folder = TempDir::new().unwrap();
        let text = folder.path().join("text.fmu");
        std::fs::write(&text, "not a zip").unwrap();
        let error = read_description(&text).unwrap_err().to_string();
        assert!(error.contains("text.fmu: not a readable archive: not a zip archive"), "{error}");
        let missing = folder.path().join("missing.fmu");
        let error = read_description(&missing).unwrap_err().to_string();
        let cause = std::fs::read(&missing).unwrap_err();
        assert_eq!(error, format!("{}: {cause}", missing.display()));
        let empty = fmu(&folder, &[("readme.txt", "")]);
        let error = read_description(&empty).unwrap_err().to_string();
        assert!(error.ends_with("it has no modelDescription.xml at its root"), "{error}");
        let broken = fmu(&folder, &[("modelDescription.xml", "<a>")]);
        let error = read_description(&broken).unwrap_err().to_string();
        assert!(error.contains("modelDescription.xml: line 1"), "{error}");
    }
}
