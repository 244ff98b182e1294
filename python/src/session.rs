//! A run that Python advances step by step.

use crate::system::{Changed, System, error, run_failure};
use fmu_system::session::{self, Overwrite, Saved};
use numpy::{IntoPyArray as _, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A run that advances step by step. Inputs can be overwritten, signals read, and states saved and restored.
#[pyclass(frozen, module = "chassis_fmu._native")]
pub(crate) struct Session(Mutex<Inner>);

struct Inner {
    session: session::Session,
    inputs: Vec<Overwrite>,
    /// Indices of the columns that `read` returns.
    columns: Vec<usize>,
    saved: BTreeMap<u64, Saved>,
    /// Key of the next saved state.
    next: u64,
}

#[pymethods]
impl Session {
    /// Instantiates and initializes a run of the plan in this process. `step` overwrites `inputs`, `read` returns
    /// `columns`.
    #[new]
    fn new(
        py: Python<'_>,
        system: &System,
        run: usize,
        changes: Vec<Changed>,
        inputs: Vec<(String, String)>,
        columns: Vec<usize>,
    ) -> PyResult<Self> {
        let changed = system.changed(changes, run)?;
        let fmus = system.fmus_here()?;
        let simulation = system.simulation();
        let mut session = py.detach(|| session::Session::new(simulation, &changed, fmus)).map_err(run_failure)?;
        if let Some(column) = columns.iter().find(|column| session.column(**column).is_none()) {
            return Err(error(format!("the run does not record column {column}")));
        }
        let mut overwritten = Vec::new();
        for (component, name) in inputs {
            let found = changed.components.iter().find(|other| other.name == component);
            let Some(found) = found else { return Err(error(format!("the run has no component `{component}`"))) };
            let description = fmus.get(found).map_err(error)?.description();
            let Some(variable) = description.variable(&name) else {
                let known = description.variables.iter().map(|variable| variable.name.as_str());
                let hint =
                    fmu_import::names::suggestion(&name, known).map_or(String::new(), |hint| format!("; {hint}"));
                return Err(error(format!("`{component}`: {} has no input `{name}`{hint}", description.model_name)));
            };
            overwritten.push(session.overwrite(&component, variable).map_err(error)?);
        }
        Ok(Self(Mutex::new(Inner { session, inputs: overwritten, columns, saved: BTreeMap::new(), next: 0 })))
    }

    /// Time, s.
    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        self.inner(py).session.time()
    }

    /// Number of completed communication steps.
    #[getter]
    fn steps(&self, py: Python<'_>) -> u64 {
        self.inner(py).session.steps()
    }

    /// True if the stop time is reached.
    #[getter]
    fn is_over(&self, py: Python<'_>) -> bool {
        self.inner(py).session.is_over()
    }

    /// Makes communication steps, up to the stop time. `values` overwrites the inputs for these and later steps; None
    /// keeps the previous values.
    #[pyo3(signature = (count=1, values=None))]
    fn step(&self, py: Python<'_>, count: u64, values: Option<PyReadonlyArray1<'_, f64>>) -> PyResult<()> {
        let values = values.map(|values| values.as_array().to_vec());
        let mut inner = self.inner(py);
        let Inner { session, inputs, .. } = &mut *inner;
        if let Some(values) = values {
            if values.len() != inputs.len() {
                let (given, expected) = (values.len(), inputs.len());
                return Err(error(format!("{given} values for {expected} inputs: give one for each")));
            }
            for (input, value) in inputs.iter().zip(values) {
                session.set(*input, value);
            }
        }
        let done = py.detach(|| {
            for _ in 0..count {
                if session.is_over() {
                    break;
                }
                session.step()?;
            }
            Ok(())
        });
        done.map_err(run_failure)
    }

    /// The values of the columns at the current time.
    fn read<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let inner = self.inner(py);
        let values: Vec<f64> =
            inner.columns.iter().map(|column| inner.session.column(*column).unwrap_or(f64::NAN)).collect();
        values.into_pyarray(py)
    }

    /// Saves the state of the whole run and returns its key.
    fn save(&self, py: Python<'_>) -> PyResult<u64> {
        let mut inner = self.inner(py);
        let saved = inner.session.save().map_err(run_failure)?;
        let key = inner.next;
        inner.saved.insert(key, saved);
        inner.next += 1;
        Ok(key)
    }

    /// Restores a saved state.
    fn restore(&self, py: Python<'_>, key: u64) -> PyResult<()> {
        let mut inner = self.inner(py);
        let Inner { session, saved, .. } = &mut *inner;
        let Some(saved) = saved.get(&key) else { return Err(unknown(key)) };
        session.restore(saved).map_err(run_failure)
    }

    /// Frees a saved state.
    fn free(&self, py: Python<'_>, key: u64) -> PyResult<()> {
        let mut inner = self.inner(py);
        let Some(saved) = inner.saved.remove(&key) else { return Err(unknown(key)) };
        inner.session.free(saved).map_err(run_failure)
    }
}

impl Session {
    /// Locks the session. Releases the interpreter's lock while it waits, because the thread that holds the session's
    /// lock may be waiting for the interpreter's lock.
    fn inner(&self, py: Python<'_>) -> MutexGuard<'_, Inner> {
        use pyo3::sync::MutexExt as _;
        self.0.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }
}

fn unknown(key: u64) -> PyErr {
    error(format!("the session has no saved state {key}: it was freed, or another session saved it"))
}
