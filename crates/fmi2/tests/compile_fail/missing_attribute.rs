use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    // #[par(…)] was forgotten
    pub k: f64,
}

fn main() {}
