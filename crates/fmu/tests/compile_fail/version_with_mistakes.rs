use fmu::prelude::*;

#[derive(State)]
pub struct X<T> {
    /// Height (m)
    #[var(fmi = 3)]
    height: T,
}

#[derive(Inputs)]
pub struct U {
    /// Count
    #[var(fmi = 1)]
    count: i32,
}

#[derive(DiscreteState, Clone, Default)]
pub struct S {
    #[var(fmi = 3)]
    sum: f64,
}

fn main() {}
