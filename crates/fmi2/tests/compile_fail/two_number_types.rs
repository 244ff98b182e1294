use fmi2::prelude::*;

#[derive(State, Clone)]
pub struct State<T, U> {
    /// Roll angle
    #[var("body.roll", unit = RAD)]
    pub phi: T,
    /// Roll rate
    #[var("body.roll_rate", unit = RAD_PER_S)]
    pub p: U,
}

fn main() {}
