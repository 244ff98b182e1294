use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    #[par("spring.stiffness" unit = N_PER_M, start = 1.0)]
    pub k: f64,
}

fn main() {}
