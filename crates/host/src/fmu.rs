//! An FMU ready for use: description and loaded binary.

use crate::archive::{Archive, ArchiveError};
use crate::description::{CoSimulation, ModelDescription};
use crate::loader::{CallError, Instance, Library, LoadError};
use crate::plan::Plan;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Why an FMU cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// Its archive.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// Its binary.
    #[error("{}: {cause}", path.display())]
    Load {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: LoadError,
    },
    /// A call.
    #[error(transparent)]
    Call(#[from] CallError),
    /// It is made for model exchange only.
    #[error("{}: the FMU has no co-simulation interface", .0.display())]
    NoCoSimulation(PathBuf),
    /// Its second instance in this process.
    #[error("{}: the FMU allows only one instance at a time", .0.display())]
    OnlyOnce(PathBuf),
    /// The file is not the one the plan was made for.
    #[error("{}: the FMU has changed since the plan was made: GUID {found}, expected {expected}", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// Its GUID.
        found: String,
        /// GUID of the plan.
        expected: String,
    },
    /// It was not loaded.
    #[error("the FMU {0} is not among those loaded")]
    NotLoaded(String),
}

/// An opened FMU; a clone is another handle to the same one.
#[derive(Debug, Clone)]
pub struct Fmu(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    path: PathBuf,
    description: ModelDescription,
    co_simulation: CoSimulation,
    library: Arc<Library>,
}

impl Fmu {
    /// Opens a `.fmu` file: reads its description, unpacks it and loads its binary.
    ///
    /// # Errors
    /// The file is no usable FMU 2.0 for co-simulation on this machine.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FmuError> {
        let path = path.as_ref();
        let mut archive = Archive::open(path)?;
        let description = archive.description()?;
        let co_simulation =
            description.co_simulation.clone().ok_or_else(|| FmuError::NoCoSimulation(path.to_path_buf()))?;
        let library = Library::load(archive.unpack(&co_simulation.model_identifier)?)
            .map_err(|cause| FmuError::Load { path: path.to_path_buf(), cause })?;
        Ok(Self(Arc::new(Inner { path: path.to_path_buf(), description, co_simulation, library })))
    }

    /// Its description.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.0.description
    }

    /// The file it was opened from.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// The co-simulation interface of the description.
    #[must_use]
    pub fn co_simulation(&self) -> &CoSimulation {
        &self.0.co_simulation
    }

    /// A new instance. It keeps the library loaded.
    ///
    /// # Errors
    /// The FMU returns none, or allows only one and has it.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        if self.0.co_simulation.can_be_instantiated_only_once_per_process && self.0.library.instances() > 0 {
            return Err(FmuError::OnlyOnce(self.0.path.clone()));
        }
        Ok(Instance::instantiate(&self.0.library, name, &self.0.description.guid, false)?)
    }
}

/// The FMUs of a plan, each opened once.
#[derive(Debug, Clone, Default)]
pub struct Fmus(BTreeMap<String, Fmu>);

impl Fmus {
    /// Opens all FMUs that the runs of a plan name.
    ///
    /// # Errors
    /// As [`Fmu::open`]; also if a GUID is not that of the plan.
    pub fn load(plan: &Plan) -> Result<Self, FmuError> {
        let mut fmus = BTreeMap::new();
        for unit in plan.runs.iter().flat_map(|run| &run.units) {
            if fmus.contains_key(&unit.fmu) {
                continue;
            }
            let fmu = Fmu::open(&unit.fmu)?;
            if fmu.description().guid != unit.guid {
                return Err(FmuError::Changed {
                    path: fmu.path().to_path_buf(),
                    found: fmu.description().guid.clone(),
                    expected: unit.guid.clone(),
                });
            }
            fmus.insert(unit.fmu.clone(), fmu);
        }
        Ok(Self(fmus))
    }

    /// The FMU of that path, as written in the plan.
    ///
    /// # Errors
    /// It was not loaded.
    pub fn get(&self, path: &str) -> Result<&Fmu, FmuError> {
        self.0.get(path).ok_or_else(|| FmuError::NotLoaded(path.to_string()))
    }

    /// Whether any of them allows only one instance at a time, so that runs cannot overlap.
    #[must_use]
    pub fn any_only_once(&self) -> bool {
        self.0.values().any(|fmu| fmu.co_simulation().can_be_instantiated_only_once_per_process)
    }
}
