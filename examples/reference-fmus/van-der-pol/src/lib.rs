//! `ReferenceVanDerPol`: a model of the Reference FMUs of the Modelica Association, with its names. The README has the
//! equations.

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct ReferenceVanDerPol {
    /// Damping
    #[var(unit = Unit::NONE, start = 1.0)]
    pub mu: f64,
}

/// State.
#[derive(State)]
pub struct X<T> {
    /// the first state
    #[var(unit = Unit::NONE, start = 2.0, nominal = 1.0)]
    pub x0: T,
    /// the second state
    #[var(unit = Unit::NONE, start = 0.0, nominal = 1.0)]
    pub x1: T,
}

/// This model implements the van der Pol oscillator
#[fmu::model(stop_time = 20.0, step_size = 0.01)]
impl Continuous for ReferenceVanDerPol {
    type State<T: Scalar> = X<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let &X { x0, x1 } = at.state;
        X { x0: x1, x1: (-x0 * x0 + 1.0) * x1 * self.mu - x0 }
    }
}
