//! `VanDerPol`: a complete model in 21 lines. The README has the equations.

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct VanDerPol {
    /// Damping (1/s)
    #[var(start = 1.0, min = 0.0, tunable)]
    pub mu: f64,
}

/// State.
#[derive(State)]
pub struct X<T> {
    /// Displacement (1)
    #[var(start = 2.0, nominal = 1.0)]
    pub x: T,
    /// Velocity (1/s)
    #[var(nominal = 1.0)]
    pub v: T,
}

/// Van der Pol oscillator
#[fmu::model(stop_time = 20.0, step_size = 0.01)]
impl Continuous for VanDerPol {
    type State<T: Scalar> = X<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let &X { x, v } = at.state;
        X { x: v, v: (-x * x + 1.0) * self.mu * v - x }
    }
}
