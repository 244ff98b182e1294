//! Runs of a scenario with changed values, in this process or in worker processes.

use fmu_import::description::{BaseType, Value, Variable};
use fmu_import::fmu::Fmu;
use fmu_import::worker::{Launch, Settings, memory_share};
use fmu_system::batch::{Batch, Change, Row, Sample};
use fmu_system::failure::Failure;
use fmu_system::fmus::{Fmus, FmusError};
use fmu_system::master::{self, Recording};
use fmu_system::parameter::{self, Settable};
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, OtherFmu, file_of, resolve};
use fmu_system::run::{Component, Exact, Run, Simulation};
use fmu_system::worker::Pool;
use numpy::{IntoPyArray as _, PyArray1};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyList};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

create_exception!(chassis_fmu._native, ScenarioError, PyException, "A scenario or a value that cannot be used.");
create_exception!(
    chassis_fmu._native,
    RunFailedError,
    PyException,
    "A run that failed: time (s) or None, and a message."
);

pub(crate) fn error(error: impl std::fmt::Display) -> PyErr {
    ScenarioError::new_err(error.to_string())
}

pub(crate) fn run_failure(failed: Failure) -> PyErr {
    RunFailedError::new_err((failed.time, failed.message))
}

/// A study with `[[vary]]` as JSON; `runs` replaces its number of samples.
#[pyfunction]
pub(crate) fn study(file: PathBuf, folders: Vec<PathBuf>, runs: Option<u64>) -> PyResult<String> {
    let found = fmu_system::study::read(&file, &FmuFolder::new(folders), runs);
    found.map(|study| study.json().to_string()).map_err(|problem| error(problem.lines().join("\n")))
}

/// A value from Python. `bool` is tried before `int`, because it is a subclass of `int`.
#[derive(FromPyObject)]
pub(crate) enum Given {
    Boolean(bool),
    Integer(i128),
    Real(f64),
    Bytes(PyBackedBytes),
    Text(String),
}

impl Given {
    /// Converts to a value of a variable. Integers are valid for Reals, names of enum values for Integers.
    fn of(self, variable: &Variable) -> Result<Value, String> {
        let value = match (self, variable.base_type) {
            (Self::Integer(value), BaseType::Real) => Value::Real(value as f64),
            (Self::Integer(value), _) => Value::integer(value)
                .ok_or_else(|| format!("`{}` is {value}, expected a whole number of 64 bits", variable.name))?,
            (Self::Bytes(bytes), _) => Value::Binary { hex: bytes.to_vec() },
            (Self::Real(value), BaseType::Integer) if value.fract() == 0.0 && value.abs() <= f64::from(i32::MAX) => {
                Value::Integer(value as i64)
            }
            (Self::Real(value), _) => Value::Real(value),
            (Self::Boolean(value), _) => Value::Boolean(value),
            (Self::Text(name), BaseType::Integer) => {
                let known = variable.named_values();
                let Some((value, _)) = known.iter().find(|(_, known)| *known == name) else {
                    let names: Vec<String> = known.iter().map(|(_, name)| format!("`{name}`")).collect();
                    return Err(format!("`{}` is \"{name}\", expected one of {}", variable.name, names.join(", ")));
                };
                Value::Integer((*value).into())
            }
            (Self::Text(value), _) => Value::String(value),
        };
        Ok(value)
    }
}

/// Converts a value for Python.
fn given<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Real(value) => value.into_pyobject(py)?.into_any(),
        Value::Integer(value) => value.into_pyobject(py)?.into_any(),
        Value::Unsigned(value) => value.into_pyobject(py)?.into_any(),
        Value::Boolean(value) => value.into_pyobject(py)?.to_owned().into_any(),
        Value::String(value) => value.into_pyobject(py)?.into_any(),
        Value::Binary { hex } => PyBytes::new(py, hex).into_any(),
    })
}

/// Converts the values of a column for Python.
fn values(py: Python<'_>, numbers: Vec<f64>, exact: Option<Exact>) -> PyResult<Bound<'_, PyAny>> {
    Ok(match exact {
        None => numbers.into_pyarray(py).into_any(),
        Some(Exact::Binaries { values, .. }) => {
            PyList::new(py, values.iter().map(|value| PyBytes::new(py, value)))?.into_any()
        }
        Some(Exact::Integers(values)) => {
            let signed: Result<Vec<i64>, _> = values.iter().map(|value| i64::try_from(*value)).collect();
            match signed {
                Ok(signed) => signed.into_pyarray(py).into_any(),
                // Only a UInt64 has greater values.
                Err(_) => values.iter().map(|value| *value as u64).collect::<Vec<_>>().into_pyarray(py).into_any(),
            }
        }
    })
}

/// A changed value: component, variable, value.
pub(crate) type Changed = (String, String, Given);

/// A finished run: sample, run, numbers, status, time, component, variable, message, seconds.
type Done =
    (usize, usize, Vec<Option<f64>>, &'static str, Option<f64>, Option<String>, Option<String>, Option<String>, f64);

fn done(row: Row) -> Done {
    let Row { sample, run, result, seconds } = row;
    match result {
        Ok(numbers) => (sample, run, numbers, "ok", None, None, None, None, seconds),
        Err(failure) => {
            let status = failure.status();
            let Failure { time, component, variable, message, .. } = failure;
            (sample, run, Vec::new(), status, time, component, variable.map(String::from), Some(message), seconds)
        }
    }
}

/// A resolved scenario with its FMUs.
#[pyclass(frozen, module = "chassis_fmu._native")]
pub(crate) struct System {
    /// The plan, which records the signals of the scenario.
    plan: Plan,
    batch: Batch,
    /// The FMUs loaded in this process.
    loaded: OnceLock<Batch>,
    pool: Mutex<Option<Arc<Pool>>>,
}

#[pymethods]
impl System {
    #[new]
    fn new(
        py: Python<'_>,
        file: PathBuf,
        folders: Vec<PathBuf>,
        stop: Option<f64>,
        step: Option<f64>,
        fmus: BTreeMap<String, (String, bool)>,
    ) -> PyResult<Self> {
        let fmus =
            fmus.into_iter().map(|(component, (fmu, keep_parameters))| OtherFmu { component, fmu, keep_parameters });
        let options = Options { stop, step, fmus: fmus.collect(), ..Options::default() };
        py.detach(|| {
            let plan = resolve(&file, &FmuFolder::new(folders), &options)
                .map_err(|problem| error(problem.lines().join("\n")))?;
            let fmus = Fmus::unpack(&plan.runs).map_err(error)?;
            let batch = Batch::new(plan.clone(), fmus);
            Ok(Self { plan, batch, loaded: OnceLock::new(), pool: Mutex::default() })
        })
    }

    /// The plan as JSON.
    fn plan(&self) -> PyResult<String> {
        serde_json::to_string(&self.plan).map_err(error)
    }

    /// Properties of a settable variable in the first run that contains it: base type, unit, other units with factor
    /// and offset, limits, value, description.
    fn variable<'py>(&self, py: Python<'py>, component: &str, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let Settable { variable, value, units } = self.settable(component, name).map_err(error)?;
        let units: Vec<(String, f64, f64)> =
            units.into_iter().map(|unit| (unit.name, unit.factor, unit.offset)).collect();
        let base = variable.base_type.to_string();
        let value = value.map(|value| given(py, &value)).transpose()?;
        let known = (base, variable.unit, units, variable.min, variable.max, value, variable.description);
        Ok(known.into_pyobject(py)?.into_any())
    }

    /// Prepares worker processes, which start when they are first needed.
    fn start(&self, program: PathBuf, jobs: NonZeroUsize, timeout: f64, libpython: Option<PathBuf>) -> PyResult<()> {
        let launch = Launch { program, arguments: vec![OsString::from("worker")] };
        let timeout = Duration::try_from_secs_f64(timeout).map_err(error)?;
        let settings = Settings {
            libpython,
            memory: memory_share(jobs),
            noticed: Arc::new(|line| eprintln!("note: {line}")),
            ..Settings::new(launch, timeout, Arc::new(|line| eprintln!("FMU prints: {line}")))
        };
        let pool = Pool::new(settings, jobs, self.batch.fmus());
        *self.pool.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(pool));
        Ok(())
    }

    /// Executes samples in worker processes; each has a list of changes and the indices of runs in the plan. `take` is
    /// called with each completed row, and returns true to continue.
    fn execute(&self, py: Python<'_>, samples: Vec<(Vec<Changed>, Vec<usize>)>, take: Py<PyAny>) -> PyResult<()> {
        let samples = self.samples(samples)?;
        let pool = self.pool()?;
        let failed = Mutex::new(None);
        py.detach(|| {
            self.batch.execute(&pool, &samples, &|row| {
                let more = Python::attach(|py| take.call1(py, (done(row),)).and_then(|more| more.extract::<bool>(py)));
                more.unwrap_or_else(|error| {
                    *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    false
                })
            });
        });
        failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }

    /// Executes the runs of a sample in this process.
    fn execute_here(&self, py: Python<'_>, changes: Vec<Changed>, runs: Vec<usize>) -> PyResult<Vec<Done>> {
        let samples = self.samples(vec![(changes, runs)])?;
        let batch = self.here()?;
        Ok(py.detach(|| batch.execute_here(0, &samples[0])).into_iter().map(done).collect())
    }

    /// Executes runs in worker processes; each has a list of changes and the index of a run in the plan. `take` is
    /// called for each completed run, with its index, its times and columns, and a message if it failed.
    fn record(&self, py: Python<'_>, runs: Vec<(Vec<Changed>, usize)>, take: Py<PyAny>) -> PyResult<()> {
        let samples = self.samples(runs.into_iter().map(|(changes, run)| (changes, vec![run])).collect())?;
        let runs: Vec<(Vec<Change>, usize)> =
            samples.into_iter().map(|sample| (sample.changes, sample.runs[0])).collect();
        let pool = self.pool()?;
        let columns: Vec<_> = self.plan.runs.iter().map(|run| run.columns.clone()).collect();
        let failed = Mutex::new(None);
        py.detach(|| {
            self.batch.record(&pool, &columns, &runs, &|index, outcome| {
                let taken = Python::attach(|py| match outcome {
                    Ok(Recording { time, columns, .. }) => {
                        let columns: Vec<_> =
                            columns.into_iter().map(|column| column.map(|values| values.into_pyarray(py))).collect();
                        take.call1(py, (index, time.into_pyarray(py), columns, py.None()))
                    }
                    Err(failure) => take.call1(py, (index, py.None(), Vec::<Option<f64>>::new(), failure.message)),
                });
                if let Err(error) = taken {
                    *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                }
            });
        });
        failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }

    /// Executes a run in this process and returns its times and columns. A column of an Int64 or UInt64 has this type,
    /// and a column of a Binary is a list of `bytes`.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        changes: Vec<Changed>,
        run: usize,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Vec<Option<Bound<'py, PyAny>>>)> {
        let changed = self.changed(changes, run)?;
        let fmus = self.fmus_here()?;
        let recorded = py.detach(|| master::execute(&self.plan.simulation, &changed, fmus));
        let Recording { time, columns, mut exact, .. } = recorded.map_err(run_failure)?;
        let columns = columns
            .into_iter()
            .enumerate()
            .map(|(index, numbers)| numbers.map(|numbers| values(py, numbers, exact.remove(&index))).transpose());
        Ok((time.into_pyarray(py), columns.collect::<PyResult<_>>()?))
    }
}

impl System {
    pub(crate) fn simulation(&self) -> &Simulation {
        &self.plan.simulation
    }

    /// The FMUs, loaded in this process.
    pub(crate) fn fmus_here(&self) -> PyResult<&Fmus> {
        Ok(self.here()?.fmus())
    }

    fn settable(&self, component: &str, name: &str) -> Result<Settable, String> {
        let describe = |component: &Component| {
            self.batch.fmus().get(component).map(Fmu::description).map_err(|error| error.to_string())
        };
        parameter::settable_of(&self.plan, describe, component, name)
    }

    fn pool(&self) -> PyResult<Arc<Pool>> {
        let pool = self.pool.lock().unwrap_or_else(PoisonError::into_inner).clone();
        pool.ok_or_else(|| error("no worker processes: call `start` first"))
    }

    /// A run of the plan with changed values.
    pub(crate) fn changed(&self, changes: Vec<Changed>, run: usize) -> PyResult<Run> {
        let samples = self.samples(vec![(changes, vec![run])])?;
        let mut changed = self.here()?.changed(run, &samples[0].changes).map_err(error)?;
        changed.columns.clone_from(&self.plan.runs[run].columns);
        Ok(changed)
    }

    fn here(&self) -> PyResult<&Batch> {
        if let Some(batch) = self.loaded.get() {
            return Ok(batch);
        }
        let fmus = Fmus::load(&self.plan.runs).map_err(|e: FmusError| error(e))?;
        Ok(self.loaded.get_or_init(|| Batch::new(self.plan.clone(), fmus)))
    }

    fn samples(&self, samples: Vec<(Vec<Changed>, Vec<usize>)>) -> PyResult<Vec<Sample>> {
        samples
            .into_iter()
            .map(|(changes, runs)| {
                if let Some(run) = runs.iter().find(|run| **run >= self.plan.runs.len()) {
                    return Err(error(format!("the plan has no run {run}")));
                }
                let changes = changes.into_iter().map(|change| self.change(change)).collect::<PyResult<_>>()?;
                Ok(Sample { changes, runs })
            })
            .collect()
    }

    /// Converts a change to the type of the variable, from the first run that contains it.
    fn change(&self, (component, name, value): Changed) -> PyResult<Change> {
        let components = self.plan.runs.iter().flat_map(|run| &run.components);
        for found in components.filter(|other| other.name == component) {
            let fmu = self.batch.fmus().get(found).map_err(error)?;
            if let Some(variable) = fmu.description().variable(&name) {
                let mut value = value.of(variable).map_err(|message| error(format!("`{component}`: {message}")))?;
                if let Value::String(text) = &mut value
                    && let Some(path) = file_of(Path::new(&self.plan.file), text)
                {
                    *text = path;
                }
                return Ok(Change { component, variable: name, value });
            }
        }
        let mut known: Vec<&str> = Vec::new();
        for found in self.plan.runs.iter().flat_map(|run| &run.components) {
            if !known.contains(&found.name.as_str()) {
                known.push(&found.name);
            }
        }
        if !known.contains(&component.as_str()) {
            let hint = fmu_import::names::suggestion(&component, known.iter().copied());
            let hint = hint.map_or(String::new(), |hint| format!("; {hint}"));
            let known = known.join("`, `");
            return Err(error(format!("unknown component `{component}`, expected one of `{known}`{hint}")));
        }
        let unknown = self.settable(&component, &name).err();
        Err(error(unknown.unwrap_or_else(|| format!("`{component}` has no variable `{name}`"))))
    }
}
