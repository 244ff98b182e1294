use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring (N/mm)
    #[par(start = 1.0)]
    pub k: f64,
}

fn main() {}
