use fmi2::prelude::*;

#[derive(Clone, Copy)]
pub enum Law {
    Linear,
}

#[derive(Parameters, Clone)]
pub struct P {
    /// Stiffness of the spring
    #[par("spring.law", mode, start = Law::Linear)]
    pub law: Law,
}

fn main() {}
