use fmu::prelude::*;

#[derive(Parameters)]
pub struct Cart {
    /// Mass (kg)
    #[var(start = 1.0)]
    mass: f64,
}

#[derive(State)]
pub struct X<T> {
    /// Position (m)
    x: T,
}

#[derive(Inputs)]
pub struct U<T> {
    /// Momentum (kg.m/s)
    p: T,
}

#[derive(Outputs)]
pub struct Y<T> {
    /// Distance (m)
    #[var(intermediate)]
    y: T,
}

/// Cart
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Cart {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { x: at.inputs.p / self.mass }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { y: at.state.x.abs() }
    }
}

fn main() {}
