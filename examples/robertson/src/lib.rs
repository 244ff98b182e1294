//! `Robertson`: a stiff reaction. The README has the equations.

use fmu::prelude::*;

/// Reaction with the rate constants of the literature.
#[derive(Parameters)]
pub struct Robertson;

/// Fractions of the three species.
#[derive(State)]
pub struct X<T> {
    /// Fraction of the first species (1)
    #[var(start = 1.0, nominal = 1.0)]
    pub a: T,
    /// Fraction of the second species (1)
    #[var(nominal = 1e-5)]
    pub b: T,
    /// Fraction of the third species (1)
    #[var(nominal = 1.0)]
    pub c: T,
}

/// Reaction of Robertson, a stiff problem
#[fmu::model(stop_time = 40.0, step_size = 1.0, solver = Rosenbrock { tolerance: 1e-8 })]
impl Continuous for Robertson {
    type State<T: Scalar> = X<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let &X { a, b, c } = at.state;
        let (first, second, third) = (a * 0.04, b * c * 1e4, b * b * 3e7);
        X { a: second - first, b: first - second - third, c: third }
    }
}
