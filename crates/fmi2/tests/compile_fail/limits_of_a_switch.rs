use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    #[par("spring.on", start = true, min = 0.0)]
    pub on: bool,
}

fn main() {}
