//! The FMUs of a system.

use crate::run::{Component, Run};
use fmu_import::archive::read_description_with;
use fmu_import::description::ModelDescription;
use fmu_import::fmu::{Fmu, FmuError};
use fmu_import::loader::{CallError, CallProblem, Instance};
use std::path::{Path, PathBuf};

const HELP_LOOP: &str = "break it with a delay, or give the input another start value";

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
    /// Outputs that depend on each other have no consistent start values.
    #[error("the algebraic loop at the start {problem}: {path}; {detail}; {HELP_LOOP}")]
    Loop {
        /// `has no solution (REASON)` or `does not settle`.
        problem: &'static str,
        /// The loop: `a:y -> b:u -> b:y -> a:u`.
        path: String,
        /// Details of the problem.
        detail: String,
    },
    /// The iteration of a step does not converge.
    #[error(
        "{signals} still change by {change:.1e} after {passes} passes of a step; choose a smaller step, or a larger \
         `tolerance` or `limit` in `iterate`"
    )]
    Unsettled {
        /// Their names.
        signals: String,
        /// Largest relative change in the last pass.
        change: f64,
        /// Number of passes.
        passes: u64,
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

impl FmusError {
    /// True if a shorter step may succeed: an FMU has discarded the step or a value at its end, or signals have not
    /// converged.
    pub(crate) fn is_of_long_step(&self) -> bool {
        match self {
            Self::Fmu(FmuError::Call(call)) => call.is_discarded() || call.problem == CallProblem::EarlyReturn,
            other => matches!(other, Self::Unsettled { .. }),
        }
    }

    /// The call, if an FMU has discarded a step.
    pub(crate) fn discarded(&self) -> Option<&CallError> {
        let Self::Fmu(FmuError::Call(call)) = self else { return None };
        (self.is_of_long_step() && matches!(call.function, "fmi2DoStep" | "fmi3DoStep")).then_some(call)
    }
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
        Ok(read_description_with(Path::new(&component.fmu), &component.structure).map_err(FmuError::from)?)
    }
}

/// The FMUs of a plan, each opened once.
#[derive(Debug, Clone, Default)]
pub struct Fmus(Vec<Fmu>);

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
        let mut fmus = Self::default();
        for component in components {
            if fmus.get(component).is_ok() {
                continue;
            }
            let fmu = Fmu::unpack_by_element(&component.fmu, &component.structure, component.interface())?;
            if fmu.description().guid != component.guid {
                return Err(FmusError::Changed {
                    path: fmu.path().to_path_buf(),
                    found: fmu.description().guid.clone(),
                    expected: component.guid.clone(),
                });
            }
            fmus.0.push(fmu);
        }
        Ok(fmus)
    }

    /// Returns the FMU of a component, with its structural parameters.
    pub fn get(&self, component: &Component) -> Result<&Fmu, FmusError> {
        let is_found = |found: &&Fmu| component.uses(found.binary());
        self.0.iter().find(is_found).ok_or_else(|| FmusError::NotLoaded(component.fmu.clone()))
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Fmu> {
        self.0.iter()
    }
}

impl Instances for Fmus {
    fn of(&self, component: &Component) -> Result<Instance, FmusError> {
        Ok(self.get(component)?.instantiate(&component.name)?)
    }
}
