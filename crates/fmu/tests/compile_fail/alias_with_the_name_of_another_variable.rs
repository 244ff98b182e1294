use fmu::prelude::*;
#[derive(Parameters)]
pub struct Gain {
    /// Gain (1)
    #[var(start = 1.0)]
    k: f64,
}
#[derive(Inputs)]
pub struct U {
    /// Control error (1)
    #[var(alias("y"))]
    u: f64,
}
#[derive(Outputs)]
pub struct Y {
    /// Command (1)
    y: f64,
}
/// Gain
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Gain {
    type Inputs = U;
    type Outputs = Y;
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { y: self.k * sample.inputs.u }
    }
}
fn main() {}
