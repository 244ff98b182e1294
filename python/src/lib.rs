//! Native code of the Python package `chassis_fmu`: metrics of arrays, algebraic loops, and runs of scenarios. `chassis_fmu/_native.pyi`
//! declares the types for Python.

mod algebraic;
mod comparison;
mod metrics;
mod session;
mod system;

use pyo3::pymodule;

#[pymodule(gil_used = false)]
mod _native {
    #[pymodule_export]
    use super::algebraic::{NoSolutionError, solve};
    #[pymodule_export]
    use super::comparison::compare;
    #[pymodule_export]
    use super::metrics::{
        MetricError, cross, formula, holds, is_enough, limits, number, running, scientific, spectrum, transfer, unit,
        value, window,
    };
    #[pymodule_export]
    use super::session::Session;
    #[pymodule_export]
    use super::system::{RunFailedError, ScenarioError, System, study};
}
