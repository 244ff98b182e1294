use fmu::prelude::*;

#[derive(Parameters)]
pub struct Counter;

#[derive(Outputs)]
pub struct Y {
    /// Number of ticks
    #[var(clock = "count")]
    ticks: i32,
}

/// Counter
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Counter {
    type Outputs = Y;

    fn update(&self, _: Sample<Self>) -> Y {
        Y { ticks: 1 }
    }

    /// Counts
    #[clock(interval = 0.1)]
    fn count(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }
}

fn main() {}
