//! Metrics of NumPy arrays, which are not copied. `chassis_fmu.evaluation.metrics` is the interface in Python.

use fmu_system::metrics::{self, Columns, Definition, Kind};
use fmu_system::{requirements, typography};
use numpy::{IntoPyArray as _, PyArray1, PyReadonlyArray1};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use serde::Deserialize;
use serde::de::IntoDeserializer as _;
use std::collections::BTreeMap;
use std::fmt::Display;

create_exception!(chassis_fmu._native, MetricError, PyException, "A metric that cannot be computed.");

pub(crate) type Array<'py> = PyReadonlyArray1<'py, f64>;

/// The columns of a recording, by their index in the plan.
pub(crate) type Arrays<'py> = BTreeMap<usize, Array<'py>>;

/// Reads the name and definition of a plan's metric from JSON.
fn read(metric: &[u8]) -> PyResult<(String, Definition)> {
    #[derive(Deserialize)]
    struct Named {
        name: String,
    }
    let Named { name } = serde_json::from_slice(metric).map_err(|error| MetricError::new_err(error.to_string()))?;
    let definition = serde_json::from_slice(metric).map_err(|error| failed(&name, error))?;
    Ok((name, definition))
}

fn failed(name: &str, error: impl Display) -> PyErr {
    MetricError::new_err(format!("metric {name}: {error}"))
}

fn slices<'a>(arrays: &'a Arrays<'_>) -> PyResult<Columns<'a>> {
    arrays.iter().map(|(index, array)| Ok((*index, array.as_slice()?))).collect()
}

#[pyfunction]
pub(crate) fn value(
    metric: &[u8],
    times: Array<'_>,
    columns: Arrays<'_>,
    baseline: Option<Arrays<'_>>,
    step: f64,
) -> PyResult<Option<f64>> {
    let (name, definition) = read(metric)?;
    let baseline = baseline.as_ref().map(slices).transpose()?;
    let value = definition.value(times.as_slice()?, &slices(&columns)?, baseline.as_ref(), step);
    value.map_err(|error| failed(&name, error))
}

/// The formula of a kind of metric, as text.
#[pyfunction]
pub(crate) fn formula(kind: &str) -> PyResult<&'static str> {
    let found: Result<Kind, serde::de::value::Error> = Kind::deserialize(kind.into_deserializer());
    Ok(found.map_err(|error| MetricError::new_err(error.to_string()))?.formula())
}

/// Returns true if a number is within its limits.
#[pyfunction]
pub(crate) fn holds(min: Option<f64>, max: Option<f64>, value: Option<f64>) -> bool {
    requirements::holds([min, max], value)
}

/// Returns true if a sufficient share of runs is within the limits.
#[pyfunction]
pub(crate) fn is_enough(kept: usize, of: usize, share: f64) -> bool {
    requirements::is_enough(kept, of, share)
}

/// First row, row after the last one, and the values of these rows.
pub(crate) type Running<'py> = (usize, usize, Bound<'py, PyArray1<f64>>);

#[pyfunction]
pub(crate) fn running<'py>(
    py: Python<'py>,
    metric: &[u8],
    times: Array<'py>,
    columns: Arrays<'py>,
    step: f64,
) -> PyResult<Option<Running<'py>>> {
    let (name, definition) = read(metric)?;
    let running = definition.running(times.as_slice()?, &slices(&columns)?, step);
    let running = running.map_err(|error| failed(&name, error))?;
    Ok(running.map(|metrics::Running { rows, values }| (rows.start, rows.end, values.into_pyarray(py))))
}

/// Frequencies and densities.
pub(crate) type Spectrum<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

#[pyfunction]
pub(crate) fn spectrum<'py>(py: Python<'py>, times: Array<'py>, values: Array<'py>) -> PyResult<Spectrum<'py>> {
    let spectrum = metrics::spectrum(times.as_slice()?, values.as_slice()?);
    let metrics::Spectrum { frequencies, densities } = spectrum.map_err(|e| MetricError::new_err(e.to_string()))?;
    Ok((frequencies.into_pyarray(py), densities.into_pyarray(py)))
}

/// Frequencies, densities of input and output, real and imaginary part of the cross density.
pub(crate) type Cross<'py> = [Bound<'py, PyArray1<f64>>; 5];

#[pyfunction]
pub(crate) fn cross<'py>(
    py: Python<'py>,
    times: Array<'py>,
    given: Array<'py>,
    found: Array<'py>,
) -> PyResult<Cross<'py>> {
    let cross = metrics::cross(times.as_slice()?, given.as_slice()?, found.as_slice()?);
    let metrics::Cross { frequencies, input, output, real, imaginary } =
        cross.map_err(|e| MetricError::new_err(e.to_string()))?;
    Ok([frequencies, input, output, real, imaginary].map(|values| values.into_pyarray(py)))
}

/// Gain, phase and coherence.
pub(crate) type Transfer<'py> = [Bound<'py, PyArray1<f64>>; 3];

#[pyfunction]
pub(crate) fn transfer<'py>(
    py: Python<'py>,
    given: Array<'py>,
    found: Array<'py>,
    real: Array<'py>,
    imaginary: Array<'py>,
) -> PyResult<Transfer<'py>> {
    let copied = |array: Array<'_>| array.as_slice().map(<[f64]>::to_vec);
    let (input, output) = (copied(given)?, copied(found)?);
    let (real, imaginary) = (copied(real)?, copied(imaginary)?);
    // The frequencies do not affect the result.
    let frequencies = vec![0.0; input.len()];
    let metrics::Transfer { gain, phase, coherence } =
        metrics::Cross { frequencies, input, output, real, imaginary }.transfer();
    Ok([gain, phase, coherence].map(|values| values.into_pyarray(py)))
}

#[pyfunction]
pub(crate) fn window(times: Array<'_>, window: Option<[f64; 2]>, step: f64) -> PyResult<(usize, usize)> {
    let rows = metrics::window(times.as_slice()?, window, step);
    Ok((rows.start, rows.end))
}

/// Formats a number with `digits` decimals, or with four significant digits.
#[pyfunction]
pub(crate) fn number(value: f64, digits: Option<u8>) -> String {
    typography::number(value, digits)
}

/// Formats a number with up to six significant digits.
#[pyfunction]
pub(crate) fn scientific(value: f64) -> String {
    typography::significant(value, 6)
}

/// Formats a unit.
#[pyfunction]
pub(crate) fn unit(name: &str) -> String {
    typography::unit(name)
}

/// Formats limits with a formatted unit; one of them can be missing.
#[pyfunction]
pub(crate) fn limits(min: Option<f64>, max: Option<f64>, unit: &str) -> String {
    typography::limits([min, max], unit)
}
