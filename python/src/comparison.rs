//! Comparison of signals in NumPy arrays. `chassis_fmu.comparison` is the interface in Python and checks the arrays.

use crate::metrics::Array;
use fmu_system::comparison::{Comparison, Metrics, Samples, Tube};
use pyo3::prelude::*;

#[pyfunction]
pub(crate) fn compare(
    simulated: (Array<'_>, Array<'_>),
    measured: (Array<'_>, Array<'_>),
    window: Option<[f64; 2]>,
    tolerance: Option<[f64; 2]>,
    tube: Option<(f64, Option<f64>)>,
    max_shift: Option<f64>,
) -> PyResult<Metrics> {
    let comparison = Comparison {
        window,
        tolerance,
        tube: tube.map(|(first, height)| height.map_or(Tube::Relative(first), |height| Tube::Size(first, height))),
        max_shift,
    };
    let simulated = Samples { times: simulated.0.as_slice()?, values: simulated.1.as_slice()? };
    let measured = Samples { times: measured.0.as_slice()?, values: measured.1.as_slice()? };
    Ok(comparison.metrics(simulated, measured))
}
