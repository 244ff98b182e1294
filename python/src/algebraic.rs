//! The solver of algebraic loops, for the master that calls FMUs from Python.

use fmu_system::algebraic::{self, Equations, Unsolved};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    chassis_fmu._native,
    NoSolutionError,
    PyException,
    "An algebraic loop without a solution: problem, details."
);

struct Functions<'py> {
    evaluate: Bound<'py, PyAny>,
    derivatives: Option<Bound<'py, PyAny>>,
}

impl Equations for Functions<'_> {
    type Error = PyErr;

    fn evaluate(&mut self, z: &[f64]) -> PyResult<Vec<f64>> {
        let found: Option<_> = self.evaluate.call1((z.to_vec(),))?.extract()?;
        Ok(found.unwrap_or_else(|| vec![f64::NAN; z.len()]))
    }

    fn derivatives(&mut self) -> PyResult<Option<Vec<Vec<f64>>>> {
        self.derivatives.as_ref().map_or(Ok(None), |derivatives| derivatives.call0()?.extract())
    }
}

/// Solves z = evaluate(z); see `fmu_system::algebraic`. Both functions may return None: not defined at this z.
#[pyfunction]
#[pyo3(signature = (start, nominal, evaluate, derivatives))]
pub(crate) fn solve<'py>(
    start: Vec<f64>,
    nominal: Vec<f64>,
    evaluate: Bound<'py, PyAny>,
    derivatives: Option<Bound<'py, PyAny>>,
) -> PyResult<Vec<f64>> {
    algebraic::solve(&mut Functions { evaluate, derivatives }, &start, &nominal).map_err(|error| match error {
        Unsolved::Evaluation(error) => error,
        Unsolved::NoSolution { problem, detail } => NoSolutionError::new_err((problem, detail)),
    })
}
