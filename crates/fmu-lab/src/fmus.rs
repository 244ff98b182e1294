//! The FMUs of the lab, and instances of them.

use crate::requests::Failure;
use fmu_import::archive::{Archive, ArchiveError};
use fmu_import::description::ModelDescription;
use fmu_import::fmu::Binary;
use fmu_import::loader::{Instance, Library};
use fmu_import::wasm;
use fmu_system::fmus::{FmusError, Instances};
use fmu_system::run::Component;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Descriptions by name, in which the resolver looks up FMUs.
pub(crate) type Descriptions = BTreeMap<String, Arc<ModelDescription>>;

#[derive(Debug, Default)]
pub(crate) struct Fmus {
    pub(crate) descriptions: Descriptions,
    texts: BTreeMap<String, String>,
    /// Names of the FMUs that a visitor has dropped onto the page.
    pub(crate) dropped: Vec<String>,
}

/// Name of an FMU from its path in a plan.
pub(crate) fn name_of(path: &str) -> &str {
    path.strip_suffix(".fmu").unwrap_or(path)
}

impl Fmus {
    pub(crate) fn add(&mut self, name: String, text: String) -> Result<(), Failure> {
        let description = ModelDescription::parse(&text)
            .map_err(|error| Failure::new(format!("{name}: modelDescription.xml: {error}")))?;
        self.descriptions.insert(name.clone(), Arc::new(description.with_elements()));
        self.texts.insert(name, text);
        Ok(())
    }

    /// Returns the description of an FMU by its path in a plan.
    pub(crate) fn described(&self, path: &str) -> Option<&Arc<ModelDescription>> {
        self.descriptions.get(name_of(path))
    }

    pub(crate) fn text(&self, name: &str) -> Option<&str> {
        self.texts.get(name).map(String::as_str)
    }

    /// Reads an archive that a visitor has dropped. Returns the name and text of the description, and the module.
    pub(crate) fn read(&self, file: &str, bytes: &[u8]) -> Result<(String, String, Vec<u8>), Failure> {
        const PACK: &str = "FMUs for the lab contain WebAssembly: cargo fmu pack --platforms linux64,wasm32";
        let failed =
            |error: ArchiveError| Failure::with_help(format!("{error}."), "Choose another file, or pack it again.");
        let mut archive = Archive::read(Path::new(file), Cursor::new(bytes)).map_err(failed)?;
        let text = archive.description_text().map_err(failed)?;
        let description = archive.description().map_err(failed)?;
        let Some(identifier) = description.model_identifier(description.stepped_interface()) else {
            return Err(Failure::with_help(
                format!("{file} has neither co-simulation nor scheduled execution"),
                "Export the model for co-simulation.",
            ));
        };
        let entry = wasm::entry(identifier);
        let Some(module) = archive.entry(&entry).map_err(failed)? else {
            let platforms = archive.platforms();
            let found = if platforms.is_empty() { "none".to_owned() } else { platforms.join(", ") };
            return Err(Failure::with_help(
                format!("{file} has no binary for a browser ({entry}); it has binaries for {found}."),
                PACK,
            ));
        };
        if wasm::Names::read(&module).is_none() {
            return Err(Failure::with_help(format!("{file}: {entry} is not a WebAssembly module."), PACK));
        }
        // The FMU is named after its file, but it never replaces an FMU of the lab.
        let stem = name_of(file).to_owned();
        let name = if self.texts.contains_key(&stem) { format!("{stem} (dropped)") } else { stem };
        Ok((name, text, module))
    }
}

/// Instances of one system. Each system has its own modules, so that a trap in an FMU does not affect the other system.
pub(crate) struct Modules {
    prefix: usize,
    descriptions: Descriptions,
    loaded: RefCell<BTreeMap<String, (Binary, Arc<Library>)>>,
}

impl Modules {
    pub(crate) fn new(prefix: usize, descriptions: Descriptions) -> Self {
        Self { prefix, descriptions, loaded: RefCell::default() }
    }
}

impl Instances for Modules {
    fn of(&self, component: &Component) -> Result<Instance, FmusError> {
        let name = name_of(&component.fmu);
        let mut loaded = self.loaded.borrow_mut();
        if !loaded.contains_key(name) {
            let description = self.description(component)?;
            let library = PathBuf::from(format!("{}/{name}", self.prefix));
            let path = PathBuf::from(&component.fmu);
            let binary = Binary::of_host(path, &description, library, description.stepped_interface());
            let library = binary.load_elsewhere()?;
            loaded.insert(name.to_owned(), (binary, library));
        }
        let (binary, library) = &loaded[name];
        Ok(binary.instantiate(library, &component.name)?)
    }

    fn description(&self, component: &Component) -> Result<ModelDescription, FmusError> {
        let found = self.descriptions.get(name_of(&component.fmu));
        found.map(|description| (**description).clone()).ok_or_else(|| FmusError::NotLoaded(component.fmu.clone()))
    }
}
