//! `Dahlquist`: a model of the Reference FMUs of the Modelica Association, with its names. The README has the equation.

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct Dahlquist {
    /// Rate of the decay
    #[var(unit = Unit::NONE, start = 1.0)]
    pub k: f64,
}

/// State.
#[derive(State)]
pub struct X<T> {
    /// the only state
    #[var(unit = Unit::NONE, start = 1.0, nominal = 1.0)]
    pub x: T,
}

/// This model implements the Dahlquist test equation
#[fmu::model(stop_time = 10.0, step_size = 0.1)]
impl Continuous for Dahlquist {
    type State<T: Scalar> = X<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { x: -at.state.x * self.k }
    }
}
