use fmu::prelude::*;

#[derive(Inputs)]
pub struct U {
    /// Speed (m/s)
    #[var(constant = 1.0)]
    speed: f64,
}

#[derive(Outputs)]
pub struct Y<T> {
    /// Speed (m/s)
    #[var(start = 1.0, constant = 1.0)]
    speed: T,
    /// Speeds (m/s)
    #[var(constant = 1.0)]
    speeds: [T; 2],
    /// Name
    #[var(constant = "a")]
    name: String,
    /// Count
    #[var(constant = true)]
    count: i32,
    /// Gear
    #[var(constant = 3, max = 2)]
    gear: u8,
}

fn main() {}
