use fmu::prelude::*;

#[derive(Parameters)]
pub struct Counter {
    /// Interval (s)
    #[var(start = 1.0)]
    period: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// Number of ticks
    ticks: i32,
}

/// Counter
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Counter {
    type Outputs = Y;

    /// Fixed and tunable
    #[clock(interval = 1 / 10, fixed, tunable)]
    fn both(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }

    /// With the interval of a parameter
    #[clock(interval_of = "period", tunable)]
    fn follower(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }

    /// Aperiodic
    #[clock(changing, interval = 0.1, fixed)]
    fn changing(&self, tick: Tick<Self>) {
        tick.outputs.ticks += 1;
    }
}

fn main() {}
