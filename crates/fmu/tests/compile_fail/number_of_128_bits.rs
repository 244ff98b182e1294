use fmu::prelude::*;

#[derive(Inputs)]
pub struct U {
    /// Number of pulses
    pulses: u128,
}

fn main() {}
