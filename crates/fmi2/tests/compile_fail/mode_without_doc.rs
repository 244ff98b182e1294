use fmi2::prelude::*;

#[derive(Mode, Clone, Copy)]
pub enum Law {
    /// Proportional
    Linear,
    Hardening,
}

fn main() {}
