//! An FMU ready for use: description and binary.

use crate::archive::{Archive, ArchiveError, Unpacked};
use crate::description::{CoSimulation, ModelDescription};
use crate::loader::{CallError, Instance, Library, LoadError};
use crate::plan::{Plan, Unit};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

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

/// The unpacked binary of an FMU, and what a process needs to make instances of it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Binary {
    /// The `.fmu` file.
    pub(crate) fmu: PathBuf,
    guid: String,
    only_once: bool,
    library: PathBuf,
    resources: PathBuf,
}

impl Binary {
    fn load(&self, unpacked: Arc<Unpacked>) -> Result<Arc<Library>, FmuError> {
        Library::load(unpacked).map_err(|cause| FmuError::Load { path: self.fmu.clone(), cause })
    }

    /// Loads what another process has unpacked.
    pub(crate) fn load_elsewhere(&self) -> Result<Arc<Library>, FmuError> {
        self.load(Unpacked::elsewhere(self.library.clone(), self.resources.clone()).into())
    }

    pub(crate) fn instantiate(&self, library: &Arc<Library>, name: &str) -> Result<Instance, FmuError> {
        if self.only_once && library.instances() > 0 {
            return Err(FmuError::OnlyOnce(self.fmu.clone()));
        }
        Ok(Instance::instantiate(library, name, &self.guid, false)?)
    }

    /// Whether the library calls a Python that it does not bring along.
    pub(crate) fn needs_python(&self) -> bool {
        crate::python::undefined_symbol(&self.library).is_some()
    }
}

/// What a master gets instances from.
pub trait Instances {
    /// A new instance for a unit of a plan, with its name.
    ///
    /// # Errors
    /// The FMU is not there, cannot be loaded, returns no instance, or allows only one and has it.
    fn of(&self, unit: &Unit) -> Result<Instance, FmuError>;
}

/// An opened FMU; a clone is another handle to the same one.
#[derive(Debug, Clone)]
pub struct Fmu(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    description: ModelDescription,
    co_simulation: CoSimulation,
    binary: Binary,
    unpacked: Arc<Unpacked>,
    library: OnceLock<Arc<Library>>,
}

impl Fmu {
    /// Opens a `.fmu` file: reads its description, unpacks it and loads its binary.
    ///
    /// # Errors
    /// The file is no usable FMU 2.0 for co-simulation on this machine.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FmuError> {
        let fmu = Self::unpack(path)?;
        fmu.library()?;
        Ok(fmu)
    }

    /// Opens a `.fmu` file as [`Self::open`] does, but loads its binary when the first instance is made: in a process that
    /// makes none, nothing of the binary is executed.
    ///
    /// # Errors
    /// The file is no FMU 2.0 for co-simulation, or has no binary for this machine.
    pub fn unpack(path: impl AsRef<Path>) -> Result<Self, FmuError> {
        let path = path.as_ref();
        let mut archive = Archive::open(path)?;
        let description = archive.description()?;
        let co_simulation =
            description.co_simulation.clone().ok_or_else(|| FmuError::NoCoSimulation(path.to_path_buf()))?;
        let unpacked = Arc::new(archive.unpack(&co_simulation.model_identifier)?);
        let binary = Binary {
            fmu: path.to_path_buf(),
            guid: description.guid.clone(),
            only_once: co_simulation.can_be_instantiated_only_once_per_process,
            library: unpacked.binary.clone(),
            resources: unpacked.resources.clone(),
        };
        Ok(Self(Arc::new(Inner { description, co_simulation, binary, unpacked, library: OnceLock::new() })))
    }

    fn library(&self) -> Result<&Arc<Library>, FmuError> {
        let Inner { binary, unpacked, library, .. } = &*self.0;
        if let Some(loaded) = library.get() {
            return Ok(loaded);
        }
        let loaded = binary.load(Arc::clone(unpacked))?;
        Ok(library.get_or_init(|| loaded))
    }

    pub(crate) fn binary(&self) -> &Binary {
        &self.0.binary
    }

    /// Its description.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.0.description
    }

    /// The file it was opened from.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0.binary.fmu
    }

    /// The co-simulation interface of the description.
    #[must_use]
    pub fn co_simulation(&self) -> &CoSimulation {
        &self.0.co_simulation
    }

    /// A new instance. It keeps the library loaded.
    ///
    /// # Errors
    /// The binary cannot be loaded, the FMU returns no instance, or allows only one and has it.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        self.0.binary.instantiate(self.library()?, name)
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
        let fmus = Self::unpack(plan)?;
        for fmu in fmus.iter() {
            fmu.library()?;
        }
        Ok(fmus)
    }

    /// Opens all FMUs that the runs of a plan name, for a process that lets others load them: see [`Fmu::unpack`].
    ///
    /// # Errors
    /// As [`Fmu::unpack`]; also if a GUID is not that of the plan.
    pub fn unpack(plan: &Plan) -> Result<Self, FmuError> {
        Self::of_units(plan.runs.iter().flat_map(|run| &run.units))
    }

    /// Opens the FMUs of these units, as [`Self::unpack`] does.
    pub(crate) fn of_units<'a>(units: impl IntoIterator<Item = &'a Unit>) -> Result<Self, FmuError> {
        let mut fmus = BTreeMap::new();
        for unit in units {
            if fmus.contains_key(&unit.fmu) {
                continue;
            }
            let fmu = Fmu::unpack(&unit.fmu)?;
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

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Fmu> {
        self.0.values()
    }
}

impl Instances for Fmus {
    fn of(&self, unit: &Unit) -> Result<Instance, FmuError> {
        self.get(&unit.fmu)?.instantiate(&unit.name)
    }
}
