use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Longest integration step (m)
    #[par(start = 0.001)]
    pub max_step: f64,
}

fn main() {}
