use fmu::prelude::*;

#[derive(Outputs)]
pub struct Y {
    /// Running
    #[var(quantity = "Running")]
    running: bool,
    /// Count
    #[var(unbounded)]
    count: i32,
    /// Angle (rad)
    #[var(relative_quantity = true)]
    angle: f64,
}

fn main() {}
