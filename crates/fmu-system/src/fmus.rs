//! The FMUs of a system.

use crate::run::{Component, Run};
use fmu_import::archive::read_description;
use fmu_import::description::ModelDescription;
use fmu_import::fmu::{Fmu, FmuError};
use fmu_import::loader::{CallError, Instance};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Error while loading or using the FMUs of a system.
#[derive(Debug, thiserror::Error)]
pub enum FmusError {
    /// An FMU cannot be opened, loaded or instantiated.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The file is not the one that the plan was made for.
    #[error("{}: the FMU has changed since the plan was made: GUID {found}, expected {expected}", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// GUID of the file.
        found: String,
        /// GUID in the plan.
        expected: String,
    },
    /// No steady state can be found for a component.
    #[error("`{component}` cannot start in a steady state: {message}")]
    Steady {
        /// Name of the component.
        component: String,
        /// Reason.
        message: String,
    },
    /// A value that an FMU returned, or that the caller gives an input, is not finite.
    #[error("`{variable}` is {value}")]
    NotFinite {
        /// Name of the component.
        component: String,
        /// Name of the variable.
        variable: String,
        /// The value.
        value: f64,
    },
    /// The FMU was not loaded.
    #[error("the FMU {0} is not among those loaded")]
    NotLoaded(String),
}

impl From<CallError> for FmusError {
    fn from(error: CallError) -> Self {
        Self::Fmu(error.into())
    }
}

/// Creates the instances for a master.
pub trait Instances {
    /// Creates an instance for a component of a plan. The instance gets the component's name.
    ///
    /// # Errors
    /// The FMU does not exist, cannot be loaded, returns no instance, or allows only one instance, which already
    /// exists.
    fn of(&self, component: &Component) -> Result<Instance, FmusError>;

    /// Returns the description of the FMU of a component.
    fn description(&self, component: &Component) -> Result<ModelDescription, FmusError> {
        Ok(read_description(Path::new(&component.fmu)).map_err(FmuError::from)?)
    }
}

/// The FMUs of a plan, each opened once.
#[derive(Debug, Clone, Default)]
pub struct Fmus(BTreeMap<String, Fmu>);

impl Fmus {
    /// Opens all FMUs of these runs.
    ///
    /// # Errors
    /// The errors of [`Fmu::open`], or a GUID that differs from the GUID in the plan.
    pub fn load(runs: &[Run]) -> Result<Self, FmusError> {
        let fmus = Self::unpack(runs)?;
        for fmu in fmus.iter() {
            fmu.load()?;
        }
        Ok(fmus)
    }

    /// Opens all FMUs of these runs, for a process whose workers load them: see [`Fmu::unpack`].
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn unpack(runs: &[Run]) -> Result<Self, FmusError> {
        Self::of_components(runs.iter().flat_map(|run| &run.components))
    }

    /// Opens the FMUs of these components, as [`Self::unpack`] does.
    pub(crate) fn of_components<'a>(components: impl IntoIterator<Item = &'a Component>) -> Result<Self, FmusError> {
        let mut fmus = BTreeMap::new();
        for component in components {
            if fmus.contains_key(&component.fmu) {
                continue;
            }
            let fmu = Fmu::unpack_by_element(&component.fmu)?;
            if fmu.description().guid != component.guid {
                return Err(FmusError::Changed {
                    path: fmu.path().to_path_buf(),
                    found: fmu.description().guid.clone(),
                    expected: component.guid.clone(),
                });
            }
            fmus.insert(component.fmu.clone(), fmu);
        }
        Ok(Self(fmus))
    }

    /// Returns the FMU with this path, as written in the plan.
    pub fn get(&self, path: &str) -> Result<&Fmu, FmusError> {
        self.0.get(path).ok_or_else(|| FmusError::NotLoaded(path.to_string()))
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Fmu> {
        self.0.values()
    }
}

impl Instances for Fmus {
    fn of(&self, component: &Component) -> Result<Instance, FmusError> {
        Ok(self.get(&component.fmu)?.instantiate(&component.name)?)
    }
}
