use fmi2::prelude::*;

#[derive(Inputs, Clone)]
pub struct U<T> {
    /// Height of the road (m)
    #[var(local)]
    pub z_r: T,
}

fn main() {}
