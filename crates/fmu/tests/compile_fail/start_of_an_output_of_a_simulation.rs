use fmu::prelude::*;

#[derive(Parameters)]
pub struct Counter;

#[derive(Inputs)]
pub struct U {
    /// Increment
    by: i32,
}

#[derive(Outputs)]
pub struct Y {
    /// Count
    #[var(start = 1)]
    count: i32,
}

/// Counts
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Stateful for Counter {
    type Simulation = i32;
    type Inputs = U;
    type Outputs = Y;

    fn start(&self, _: &std::path::Path) -> Result<i32, String> {
        Ok(0)
    }
    fn step(&self, simulation: &mut i32, inputs: &U, _time: f64, _step: f64) -> Result<(), String> {
        *simulation += inputs.by;
        Ok(())
    }
    fn outputs(&self, simulation: &i32) -> Y {
        Y { count: *simulation }
    }
}

fn main() {}
