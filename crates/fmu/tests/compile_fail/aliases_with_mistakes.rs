use fmu::prelude::*;

#[derive(State)]
pub struct X<T> {
    /// Height (m)
    #[var(alias("h_s", display = "s"))]
    height: T,
    /// Positions (m)
    #[var(alias("p"))]
    position: [T; 2],
}

#[derive(Inputs)]
pub struct U {
    /// Count
    #[var(alias("n", display = "ft"))]
    count: i32,
    /// Name of the field before (1)
    #[var(alias("count"))]
    other: f64,
}

#[derive(Parameters)]
pub struct P {
    /// Gain (1)
    #[var(start = 1.0, alias = "k")]
    gain: f64,
}

#[derive(Parameters)]
pub struct Q {
    /// Gain (1)
    #[var(start = 1.0, alias("k", unit = "1"))]
    gain: f64,
}

fn main() {}
