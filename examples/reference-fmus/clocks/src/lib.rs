//! The model Clocks of the Reference FMUs: names, start values and clocks are theirs.

use fmu::prelude::*;

/// Parameters
#[derive(Parameters)]
pub struct Clocks;

/// Inputs
#[derive(Inputs)]
pub struct U {
    /// Added to `result2` when `inClock2` ticks
    pub input2: i32,
}

/// Outputs
#[derive(Outputs)]
pub struct Y {
    /// Ticks when the number of all ticks becomes a multiple of 5
    #[var("outClock")]
    pub out_clock: Clock,
    /// Number of ticks of `inClock1`
    #[var("inClock1Ticks", clock = "inClock1")]
    pub in_clock1_ticks: i32,
    /// Number of ticks of `inClock2`
    #[var("inClock2Ticks", clock = "inClock2")]
    pub in_clock2_ticks: i32,
    /// Number of ticks of `inClock3`
    #[var("inClock3Ticks", clock = "inClock3")]
    pub in_clock3_ticks: i32,
    /// Number of ticks of all input clocks
    #[var("totalInClockTicks", clock = ["inClock1", "inClock2", "inClock3"])]
    pub total_in_clock_ticks: i32,
    /// Sum of the values of `input2` at the ticks of `inClock2`
    #[var(clock = "inClock2")]
    pub result2: i32,
    /// Result of the part of `inClock3`
    #[var(clock = "inClock3")]
    pub output3: i32,
}

impl Y {
    /// Counts a tick of any clock.
    fn count(&mut self) {
        self.total_in_clock_ticks += 1;
        if self.total_in_clock_ticks % 5 == 0 {
            self.out_clock.fire();
        }
    }
}

/// Counts the ticks of its clocks
#[fmu::model(stop_time = 10.0, step_size = 1.0)]
impl Discrete for Clocks {
    type Inputs = U;
    type Outputs = Y;

    /// Every second
    #[clock("inClock1", interval = 1, priority = 0)]
    fn in_clock1(&self, mut tick: Tick<Self>) {
        tick.outputs.in_clock1_ticks += 1;
        tick.outputs.count();
        if tick.time == 4.0 {
            tick.start(ClocksClock::InClock3, 0.0);
        }
    }

    /// When the importer activates it
    #[clock("inClock2", triggered, priority = 1)]
    fn in_clock2(&self, tick: Tick<Self>) {
        tick.outputs.in_clock2_ticks += 1;
        tick.outputs.count();
        tick.outputs.result2 += tick.inputs.input2;
    }

    /// When `inClock1` has started it
    #[clock("inClock3", countdown, priority = 2)]
    fn in_clock3(&self, tick: Tick<Self>) {
        tick.outputs.in_clock3_ticks += 1;
        tick.outputs.output3 = 1000;
        tick.outputs.count();
    }
}
