use fmi2::prelude::*;

#[derive(Mode, Clone, Copy)]
pub enum Law {
    /// Proportional
    Linear,
}

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    #[par("spring.law", unit = ONE, start = Law::Linear)]
    pub law: Law,
}

fn main() {}
