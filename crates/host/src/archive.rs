//! The `.fmu` file: a zip archive with a description, binaries and resources (FMI 2.0.4, section 2.3).

use crate::description::{ModelDescription, XmlError};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use zip::ZipArchive;
use zip::result::ZipError;

/// Most files an archive may hold.
const MAX_ENTRIES: usize = 100_000;
/// Most bytes that are unpacked from one archive.
const MAX_UNPACKED: u64 = 4 << 30;

/// Why an archive cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The file cannot be opened or read, or a temporary file cannot be written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// File that was read or written.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// The file is not a zip archive, or a damaged one.
    #[error("{}: not a readable FMU: {cause}", path.display())]
    Zip {
        /// The archive.
        path: PathBuf,
        /// Why.
        cause: ZipError,
    },
    /// A name leads out of the folder the archive is unpacked to, or the archive is too large.
    #[error("{}: refused: {reason}", path.display())]
    Refused {
        /// The archive.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// The description is missing or wrong.
    #[error("{}: modelDescription.xml: {cause}", path.display())]
    Description {
        /// The archive.
        path: PathBuf,
        /// Where and why.
        cause: XmlError,
    },
    /// No binary for this machine.
    #[error(
        "{}: no binary for {wanted} (binaries/{wanted}/{file}); the FMU has {}",
        path.display(),
        if found.is_empty() { "none".to_string() } else { found.join(", ") }
    )]
    NoBinary {
        /// The archive.
        path: PathBuf,
        /// Platform of this machine.
        wanted: &'static str,
        /// File name expected.
        file: String,
        /// Platforms that the archive has.
        found: Vec<String>,
    },
}

/// FMI 2.0 name of the platform this program runs on: the folder below `binaries/`.
///
/// FMI 2.0 names only 32 and 64 bit x86 on Windows and Linux, and 64 bit macOS; other machines use
/// the names of FMI 3.0, as fmpy does.
#[must_use]
pub const fn platform() -> &'static str {
    if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        "linux64"
    } else if cfg!(all(target_os = "linux", target_arch = "x86")) {
        "linux32"
    } else if cfg!(all(target_os = "windows", target_arch = "x86_64")) {
        "win64"
    } else if cfg!(all(target_os = "windows", target_arch = "x86")) {
        "win32"
    } else if cfg!(target_os = "macos") {
        "darwin64"
    } else if cfg!(all(target_os = "linux", target_arch = "aarch64")) {
        "aarch64-linux"
    } else {
        "unknown"
    }
}

/// An open `.fmu` file.
pub struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
}

/// What was unpacked; removed from the disk when dropped.
#[derive(Debug)]
pub struct Unpacked {
    /// Shared library of this platform.
    pub binary: PathBuf,
    /// Folder of the resources; empty where the FMU has none.
    pub resources: PathBuf,
    _folder: TempDir,
}

impl Archive {
    /// Opens an archive and checks the names of its entries.
    ///
    /// # Errors
    /// The file cannot be read, is not a zip archive, has too many entries, or has an entry that is
    /// a link or whose name is not a path within the archive.
    pub fn open(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::open(path).map_err(|cause| ArchiveError::Io { path: path.to_path_buf(), cause })?;
        let zip_error = |cause| ArchiveError::Zip { path: path.to_path_buf(), cause };
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(zip_error)?;
        let refused = |reason| ArchiveError::Refused { path: path.to_path_buf(), reason };
        if zip.len() > MAX_ENTRIES {
            return Err(refused(format!("{} entries, at most {MAX_ENTRIES} are accepted", zip.len())));
        }
        for i in 0..zip.len() {
            let entry = zip.by_index(i).map_err(zip_error)?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            // Zip names use slashes; a backslash or a drive letter has a meaning on Windows only.
            if entry.enclosed_name().is_none() || name.starts_with('/') || name.contains(['\\', ':']) {
                return Err(refused(format!("the entry `{name}` is not a path within the archive")));
            }
            if entry.is_symlink() {
                return Err(refused(format!("the entry `{name}` is a link")));
            }
        }
        Ok(Self { path: path.to_path_buf(), zip })
    }

    /// The text of `modelDescription.xml`.
    ///
    /// # Errors
    /// The entry is missing, unreadable, too large, or not UTF-8.
    pub fn description_text(&mut self) -> Result<String, ArchiveError> {
        let limit = crate::xml::MAX_BYTES as u64;
        let entry = self
            .zip
            .by_name("modelDescription.xml")
            .map_err(|cause| ArchiveError::Zip { path: self.path.clone(), cause })?;
        let mut text = String::new();
        entry
            .take(limit + 1)
            .read_to_string(&mut text)
            .map_err(|cause| ArchiveError::Io { path: self.path.join("modelDescription.xml"), cause })?;
        Ok(text)
    }

    /// Reads and parses `modelDescription.xml`.
    ///
    /// # Errors
    /// Those of [`Self::description_text`], or it is not a description of FMI 2.0.
    pub fn description(&mut self) -> Result<ModelDescription, ArchiveError> {
        let text = self.description_text()?;
        ModelDescription::parse(&text).map_err(|cause| ArchiveError::Description { path: self.path.clone(), cause })
    }

    /// Platforms the archive has binaries for, sorted.
    #[must_use]
    pub fn platforms(&self) -> Vec<String> {
        let mut platforms: Vec<String> = self
            .zip
            .file_names()
            .filter_map(|name| {
                let name = name.ok()?;
                let (platform, file) = name.strip_prefix("binaries/")?.split_once('/')?;
                (!file.is_empty()).then(|| platform.to_string())
            })
            .collect();
        platforms.sort();
        platforms.dedup();
        platforms
    }

    /// Unpacks the binaries of this platform and the resources into a new temporary folder.
    ///
    /// `model_identifier` is the file stem of the binary.
    ///
    /// # Errors
    /// The archive has no binary for this platform, is damaged, unpacks to more than 4 GiB, or the
    /// temporary folder cannot be written.
    pub fn unpack(&mut self, model_identifier: &str) -> Result<Unpacked, ArchiveError> {
        let file = format!("{model_identifier}{}", std::env::consts::DLL_SUFFIX);
        let folder_name = format!("binaries/{}/", platform());
        if self.zip.index_for_name(&format!("{folder_name}{file}")).is_none() {
            return Err(ArchiveError::NoBinary {
                path: self.path.clone(),
                wanted: platform(),
                file,
                found: self.platforms(),
            });
        }
        let io_error = |path: &Path| {
            let path = path.to_path_buf();
            move |cause| ArchiveError::Io { path, cause }
        };
        let folder = tempfile::Builder::new().prefix("fmu-").tempdir().map_err(io_error(&std::env::temp_dir()))?;
        let resources = folder.path().join("resources");
        std::fs::create_dir_all(&resources).map_err(io_error(&resources))?;
        let mut left = MAX_UNPACKED;
        for i in 0..self.zip.len() {
            let entry = self.zip.by_index(i).map_err(|cause| ArchiveError::Zip { path: self.path.clone(), cause })?;
            let Some(name) = entry.enclosed_name() else {
                continue;
            };
            let wanted = name.starts_with(&folder_name) || name.starts_with("resources");
            if !wanted || entry.is_dir() {
                continue;
            }
            let target = folder.path().join(name);
            if let Some(parent) = target.parent() {
                std::fs::create_dir_all(parent).map_err(io_error(parent))?;
            }
            // `create_new`: no entry may replace another one.
            let mut output = File::create_new(&target).map_err(io_error(&target))?;
            // The size in the archive may lie, so what is really unpacked is counted.
            let written = io::copy(&mut entry.take(left + 1), &mut output).map_err(io_error(&target))?;
            left = left.checked_sub(written).ok_or_else(|| ArchiveError::Refused {
                path: self.path.clone(),
                reason: format!("it unpacks to more than {MAX_UNPACKED} bytes"),
            })?;
        }
        // Joined part by part: Windows loads no library from a path with slashes.
        let binary = folder.path().join("binaries").join(platform()).join(file);
        Ok(Unpacked { binary, resources, _folder: folder })
    }
}

/// Reads the description of an FMU without unpacking the rest.
///
/// # Errors
/// As [`Archive::open`] and [`Archive::description`].
pub fn read_description(path: &Path) -> Result<ModelDescription, ArchiveError> {
    Archive::open(path)?.description()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
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
        assert_eq!(archive.description().unwrap().model_name, "Vehicle");
        let unpacked = archive.unpack("Vehicle").unwrap();
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
        let error = Archive::open(&path).unwrap().unpack("Vehicle").unwrap_err();
        let text = error.to_string();
        assert!(text.contains(&format!("no binary for {}", platform())), "{text}");
        assert!(text.ends_with("the FMU has amiga68k, vms"), "{text}");
    }

    #[test]
    fn archives_that_reach_out_are_refused() {
        for name in ["../evil", "resources/../../evil", "/evil", "resources\\..\\evil"] {
            let folder = TempDir::new().unwrap();
            let path = fmu(&folder, &[("modelDescription.xml", VEHICLE), (name, "x")]);
            let error = Archive::open(&path).err().expect(name).to_string();
            assert!(error.contains("not a path within"), "{name}: {error}");
        }
    }

    #[test]
    fn files_that_are_no_fmu_are_clear_errors() {
        let folder = TempDir::new().unwrap();
        let text = folder.path().join("text.fmu");
        std::fs::write(&text, "not a zip").unwrap();
        assert!(matches!(read_description(&text), Err(ArchiveError::Zip { .. })));
        let missing = folder.path().join("missing.fmu");
        assert!(matches!(read_description(&missing), Err(ArchiveError::Io { .. })));
        let empty = fmu(&folder, &[("readme.txt", "")]);
        assert!(matches!(read_description(&empty), Err(ArchiveError::Zip { .. })));
        let broken = fmu(&folder, &[("modelDescription.xml", "<a>")]);
        let error = read_description(&broken).unwrap_err().to_string();
        assert!(error.contains("modelDescription.xml: line 1"), "{error}");
    }
}
