use fmi2::prelude::*;

fmi2::family! {
    /// Left and right.
    pub Sides[2] {
        l: "left",
        r: "right",
    }
}

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    #[par("spring.stiffness", unit = N_PER_M, start = [1.0, 7.0], max = 5.0)]
    pub k: Sides<f64>,
}

fn main() {}
