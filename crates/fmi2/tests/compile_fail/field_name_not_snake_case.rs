use fmi2::prelude::*;

#[derive(Inputs, Clone)]
pub struct U<T> {
    /// Force of the actuator (N)
    #[allow(non_snake_case)]
    pub F_a: T,
}

fn main() {}
