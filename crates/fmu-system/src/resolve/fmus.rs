//! Sources of FMUs for the resolver.

use fmu_import::archive::{read_description, read_description_with};
use fmu_import::description::{Causality, ModelDescription, StructuralParameters, Variable};
use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An FMU that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Path of the file, as written to the plan.
    pub path: String,
    /// Its description.
    pub description: Arc<ModelDescription>,
}

impl Found {
    /// The FMU with these structural parameters, see [`ModelDescription::parse_with`].
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn with_structure(self, structure: &StructuralParameters) -> Result<Self, String> {
        if structure.is_empty() {
            return Ok(self);
        }
        let description = read_description_with(Path::new(&self.path), structure);
        let description = description.map_err(|error| error.to_string())?.with_elements();
        Ok(Self { description: Arc::new(description), ..self })
    }
}

/// Source of FMUs for the resolver.
pub trait Descriptions {
    /// Finds the FMU with this file stem; `None` if there is none.
    ///
    /// # Errors
    /// The FMU exists but cannot be read; the message contains the reason.
    fn find(&self, name: &str) -> Result<Option<Found>, String>;

    /// File stems of all FMUs.
    fn names(&self) -> Vec<String>;

    /// Names of the FMUs that `cargo fmu pack` can build, whether or not they exist.
    fn buildable(&self) -> Vec<String> {
        Vec::new()
    }

    /// A folder beside those that were searched that contains this FMU, in another version of FMI.
    fn beside(&self, _name: &str) -> Option<String> {
        None
    }

    /// Describes the place that was searched, for messages.
    fn place(&self) -> String;
}

/// Lists up to three FMUs that have variables with these names and this causality, for a message. FMUs with the most of
/// these variables come first.
pub fn fmus_with(source: &dyn Descriptions, causality: Causality, names: &[&str]) -> Option<String> {
    let has = |fmu: &String| {
        let found = source.find(fmu).ok()??;
        let is_one = |v: &&Variable| v.causality == causality && names.contains(&v.name.as_str());
        let count = found.description.variables.iter().filter(is_one).count();
        (count > 0).then(|| (Reverse(count), format!("`{fmu}`")))
    };
    let mut fmus: Vec<_> = source.names().iter().filter_map(has).collect();
    fmus.sort();
    let best: Vec<String> = fmus.into_iter().take(3).map(|(_, fmu)| fmu).collect();
    (!best.is_empty()).then(|| best.join(", "))
}

/// FMUs in folders. If several folders have an FMU with the same name, the first folder is used.
#[derive(Debug)]
pub struct FmuFolder {
    folders: Vec<PathBuf>,
    buildable: fn() -> Vec<String>,
    read: RefCell<HashMap<String, Found>>,
}

impl FmuFolder {
    /// Searches these folders. They are read on the first lookup.
    pub fn new<P: Into<PathBuf>>(folders: impl IntoIterator<Item = P>) -> Self {
        Self { folders: folders.into_iter().map(Into::into).collect(), buildable: Vec::new, read: RefCell::default() }
    }

    /// Sets the function that names the FMUs that `cargo fmu pack` can build. It is called only if an FMU is missing.
    #[must_use]
    pub fn with_buildable(self, buildable: fn() -> Vec<String>) -> Self {
        Self { buildable, ..self }
    }
}

impl Descriptions for FmuFolder {
    fn find(&self, name: &str) -> Result<Option<Found>, String> {
        if let Some(found) = self.read.borrow().get(name) {
            return Ok(Some(found.clone()));
        }
        let file = format!("{name}.fmu");
        let Some(path) = self.folders.iter().map(|folder| folder.join(&file)).find(|path| path.exists()) else {
            return Ok(None);
        };
        let description = read_description(&path).map_err(|error| error.to_string())?.with_elements();
        let found = Found { path: path.to_string_lossy().into_owned(), description: Arc::new(description) };
        self.read.borrow_mut().insert(name.to_string(), found.clone());
        Ok(Some(found))
    }

    fn names(&self) -> Vec<String> {
        let entries = self.folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
        let mut names: Vec<String> = entries
            .filter_map(|entry| {
                let path = entry.ok()?.path();
                let stem = path.file_stem()?.to_str()?.to_string();
                (path.extension()? == "fmu").then_some(stem)
            })
            .collect();
        names.sort();
        names
    }

    fn buildable(&self) -> Vec<String> {
        (self.buildable)()
    }

    fn beside(&self, name: &str) -> Option<String> {
        // The folders of `cargo fmu pack` for FMI 2.0 and 3.0.
        let other = |folder: &PathBuf| match folder.file_name()?.to_str()? {
            "fmu" => Some(folder.with_file_name("fmu3")),
            "fmu3" => Some(folder.with_file_name("fmu")),
            _ => None,
        };
        let file = format!("{name}.fmu");
        let mut others = self.folders.iter().filter_map(other).filter(|folder| folder.join(&file).exists());
        others.next().map(|folder| folder.to_string_lossy().into_owned())
    }

    fn place(&self) -> String {
        let folders: Vec<_> = self.folders.iter().map(|f| f.to_string_lossy().into_owned()).collect();
        folders.join(", ")
    }
}

/// FMUs in folders that a scenario brings, before those of another source.
pub(super) struct WithFolders<'a> {
    pub(super) folders: FmuFolder,
    pub(super) others: &'a dyn Descriptions,
}

impl Descriptions for WithFolders<'_> {
    fn find(&self, name: &str) -> Result<Option<Found>, String> {
        self.folders.find(name).transpose().or_else(|| self.others.find(name).transpose()).transpose()
    }

    fn names(&self) -> Vec<String> {
        [self.folders.names(), self.others.names()].concat()
    }

    fn buildable(&self) -> Vec<String> {
        self.others.buildable()
    }

    fn beside(&self, name: &str) -> Option<String> {
        self.others.beside(name)
    }

    fn place(&self) -> String {
        self.others.place()
    }
}

/// Descriptions in memory, without files.
impl Descriptions for BTreeMap<String, Arc<ModelDescription>> {
    fn find(&self, name: &str) -> Result<Option<Found>, String> {
        Ok(self
            .get(name)
            .map(|description| Found { path: format!("{name}.fmu"), description: Arc::clone(description) }))
    }

    fn names(&self) -> Vec<String> {
        self.keys().cloned().collect()
    }

    fn place(&self) -> String {
        "memory".to_string()
    }
}
