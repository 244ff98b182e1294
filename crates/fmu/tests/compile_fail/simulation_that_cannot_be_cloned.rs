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
    count: i32,
}

/// Counts
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Stateful for Counter {
    type Simulation = std::sync::Mutex<i32>;
    type Inputs = U;
    type Outputs = Y;

    fn start(&self, _: &std::path::Path) -> Result<std::sync::Mutex<i32>, String> {
        Ok(0.into())
    }
    fn step(&self, simulation: &mut std::sync::Mutex<i32>, inputs: &U, _time: f64, _step: f64) -> Result<(), String> {
        *simulation.get_mut().unwrap() += inputs.by;
        Ok(())
    }
    fn outputs(&self, _: &std::sync::Mutex<i32>) -> Y {
        Y { count: 0 }
    }
}

fn main() {}
