use fmu::prelude::*;
use std::path::Path;
fmu::named_array! {
    /// Wheels
    pub Axle[2] { l: "left", r: "right" }
}
#[derive(Parameters)]
pub struct Cart {
    /// Mass (kg)
    #[var(start = 1.0)]
    mass: f64,
}
#[derive(State)]
pub struct X<T> {
    /// Position (m)
    x: [T; 3],
    /// Load (m)
    w: Axle<T>,
}
#[derive(Inputs)]
pub struct U<T> {
    /// Force (N)
    p: T,
}
#[derive(Outputs)]
pub struct Y<T> {
    /// Distance (m)
    y: T,
}
#[derive(Derived)]
pub struct D {
    a: f64,
}
/// Cart
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Cart {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let s = at.state.x.iter().sum::<T>() + at.inputs.p;
        X { x: [s; 3], w: Axle([s; 2]) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { y: at.inputs.p }
    }
    fn initialize(&self, d: &D, x: &mut X<f64>) {
        x.x[0] = d.a;
    }
}
fn main() {}
