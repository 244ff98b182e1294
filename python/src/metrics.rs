//! Metrics of arrays, which are not copied. `chassis_fmu.evaluation.metrics` is the interface for users.

use fmu_system::metrics::{self, Columns, Combine, Definition, Expression, Kind};
use fmu_system::requirements::{self, Rows};
use numpy::{IntoPyArray as _, PyArray1, PyReadonlyArray1};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use serde::Deserialize;
use serde::de::IntoDeserializer as _;
use std::collections::BTreeMap;
use std::fmt::Display;

create_exception!(chassis_fmu._native, MetricError, PyException, "A metric that has no number.");

pub(crate) type Array<'py> = PyReadonlyArray1<'py, f64>;

/// The columns of a recording, by their index in the plan.
pub(crate) type Arrays<'py> = BTreeMap<usize, Array<'py>>;

/// `chassis_fmu.files.plan.Metric`.
#[derive(FromPyObject)]
pub(crate) struct Metric {
    name: String,
    columns: Vec<usize>,
    combine: Option<String>,
    weights: Vec<f64>,
    kind: String,
    window: Option<[f64; 2]>,
    until: Option<Until>,
    minus: Option<usize>,
    from_baseline: bool,
    band: Option<[f64; 2]>,
    threshold: Option<f64>,
    factor: f64,
    offset: f64,
}

/// `chassis_fmu.files.plan.Until`.
#[derive(FromPyObject)]
struct Until {
    column: usize,
    above: bool,
    level: f64,
}

impl Metric {
    fn error(&self, error: impl Display) -> PyErr {
        MetricError::new_err(format!("metric {}: {error}", self.name))
    }

    fn definition(&self) -> PyResult<Definition> {
        Ok(Definition {
            columns: self.columns.clone(),
            combine: self.combine.as_deref().map(|name| self.named::<Combine>(name)).transpose()?,
            weights: self.weights.clone(),
            kind: self.named::<Kind>(&self.kind)?,
            window: self.window,
            until: self.until.as_ref().map(|&Until { column, above, level }| metrics::Until { column, above, level }),
            minus: self.minus,
            from_baseline: self.from_baseline,
            band: self.band,
            threshold: self.threshold,
            factor: self.factor,
            offset: self.offset,
        })
    }

    /// The variant of an enum that has a name in plans.
    fn named<'a, T: Deserialize<'a>>(&self, name: &'a str) -> PyResult<T> {
        let found: Result<T, serde::de::value::Error> = T::deserialize(name.into_deserializer());
        found.map_err(|error| self.error(error))
    }
}

fn slices<'a>(arrays: &'a Arrays<'_>) -> PyResult<Columns<'a>> {
    arrays.iter().map(|(index, array)| Ok((*index, array.as_slice()?))).collect()
}

#[pyfunction]
pub(crate) fn value(
    metric: Metric,
    times: Array<'_>,
    columns: Arrays<'_>,
    baseline: Option<Arrays<'_>>,
    step: f64,
) -> PyResult<Option<f64>> {
    let baseline = baseline.as_ref().map(slices).transpose()?;
    let value = metric.definition()?.value(times.as_slice()?, &slices(&columns)?, baseline.as_ref(), step);
    value.map_err(|error| metric.error(error))
}

/// The formula of a kind of metric in words.
#[pyfunction]
pub(crate) fn formula(kind: &str) -> PyResult<&'static str> {
    Ok(named(kind)?.formula())
}

fn named(kind: &str) -> PyResult<Kind> {
    let found: Result<Kind, serde::de::value::Error> = Kind::deserialize(kind.into_deserializer());
    found.map_err(|error| MetricError::new_err(error.to_string()))
}

/// Compares numbers of runs with limits: status, worst number, runs without a number.
#[pyfunction]
pub(crate) fn requirement_status(
    min: Option<f64>,
    max: Option<f64>,
    share: f64,
    numbers: Vec<Option<f64>>,
    runs: usize,
    is_cut_off: bool,
    kind: Option<&str>,
) -> PyResult<(&'static str, Option<f64>, usize)> {
    let rows = if is_cut_off { Rows::Cut(kind.map(named).transpose()?) } else { Rows::All };
    let outcome = requirements::evaluate([min, max], share, &numbers, runs, rows);
    Ok((outcome.status.name(), outcome.worst, outcome.missing))
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

/// The value of an expression, with the numbers of metrics by name.
#[pyfunction]
pub(crate) fn evaluate(text: &str, values: BTreeMap<String, Option<f64>>) -> PyResult<Option<f64>> {
    let names: Vec<&str> = values.keys().map(String::as_str).collect();
    let expression = Expression::parse(text, |name| names.iter().position(|known| *known == name));
    let expression = expression.map_err(|error| MetricError::new_err(format!("{text}: {}", error.problem)))?;
    Ok(expression.value(|index| values[names[index]]))
}

/// First row, row after the last one, and the values between them.
pub(crate) type Running<'py> = (usize, usize, Bound<'py, PyArray1<f64>>);

#[pyfunction]
pub(crate) fn running<'py>(
    py: Python<'py>,
    metric: Metric,
    times: Array<'py>,
    columns: Arrays<'py>,
    step: f64,
) -> PyResult<Option<Running<'py>>> {
    let running = metric.definition()?.running(times.as_slice()?, &slices(&columns)?, step);
    let running = running.map_err(|error| metric.error(error))?;
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
    // The frequencies have no effect.
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
