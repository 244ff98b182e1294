use fmi2::prelude::*;

#[derive(Inputs, Clone)]
pub struct Inputs<T> {
    /// Roll angle
    #[var("body.roll", unit = RAD, min = 0.0)]
    pub phi: T,
}

fn main() {}
