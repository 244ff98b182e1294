use fmu::prelude::*;

#[derive(Parameters)]
pub struct Counter;

#[derive(Outputs)]
pub struct Y {
    /// Number of ticks
    ticks: i32,
}

/// Counter
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Counter {
    type Outputs = Y;

    /// Counts
    #[clock(countdown, priority = -1)]
    fn count(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }

    /// Counts, too
    #[clock(triggered, priority)]
    fn count_too(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }

    /// Counts further
    #[clock(triggered, priority = 4294967296)]
    fn count_further(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }
}

fn main() {}
