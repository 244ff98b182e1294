use fmi2::prelude::*;

#[derive(Mode, Clone, Copy)]
pub enum Law {
    /// Proportional
    Linear = 1,
    /// Progressive
    Hardening = 1,
}

fn main() {}
