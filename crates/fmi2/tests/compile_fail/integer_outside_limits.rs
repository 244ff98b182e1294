use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    #[par("spring.count", start = 4, min = 1, max = 3)]
    pub n: i32,
}

fn main() {}
