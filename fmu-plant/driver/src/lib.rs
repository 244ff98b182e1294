//! `Driver`: steering, speed and pedals as functions of time: the maneuvers of the vehicle tests, or a file.

mod equations;
#[cfg(test)]
mod tests;

use std::path::Path;

use chassis_vehicle::prelude::*;
use chassis_vehicle::table::{self, Table};
use fmu::prelude::*;

/// Steering maneuver.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maneuver {
    /// no steering
    Straight = 0,
    /// to an angle that is held: step steer, J-turn
    RampStep = 1,
    /// to one side, then fast to the other
    Fishhook = 2,
    /// one sine period, later one of the opposite sign
    DoubleLaneChange = 3,
    /// sine periods, timed or between cones
    Slalom = 4,
    /// one sine period, held at its second peak: the test of electronic stability control
    SineWithDwell = 5,
    /// sine with rising frequency
    SineSweep = 6,
    /// column in the file table.file
    Table = 7,
}

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct Driver {
    /// How the driver steers
    #[var("maneuver", start = Maneuver::RampStep)]
    maneuver: Maneuver,
    /// A: amplitude of the steering angle, positive to the left first
    #[var("steer.amplitude", unit = "rad", start = 0.1, display = "deg")]
    a: f64,
    /// Start of the steering
    #[var("steer.start", unit = "s", start = 1.0, min = 0.0)]
    t_0: f64,
    /// Duration of the first ramp in ramp_step and fishhook; 0 for a step
    #[var("steer.rise_time", unit = "s", start = 0.2, min = 0.0)]
    d: f64,
    /// Start of the reversal in fishhook, or of the second period in double_lane_change
    #[var("steer.reversal_start", unit = "s", start = 6.0, min = 0.0)]
    t_1: f64,
    /// Duration of the ramp to the other side in fishhook; 0 for a step
    #[var("steer.reversal_time", unit = "s", start = 0.4, min = 0.0)]
    d_2: f64,
    /// Amplitude on the other side in fishhook
    #[var("steer.reversal_amplitude", unit = "rad", start = 0.1, display = "deg")]
    a_2: f64,
    /// Period in double_lane_change and slalom; if 0, slalom takes one period for two cone distances
    #[var("steer.period", unit = "s", start = 4.0, min = 0.0)]
    period: f64,
    /// Number of periods in slalom; 0 for no end
    #[var("steer.cycles", start = 0, min = 0, max = i32::MAX)]
    cycles: i32,
    /// Distance between cones in slalom if steer.period is 0
    #[var("steer.cone_distance", unit = "m", start = 50.0, min = 0.0)]
    cone_distance: f64,
    /// Frequency in sine_with_dwell, first frequency in sine_sweep
    #[var("steer.frequency", unit = "Hz", start = 0.7, min = 0.0)]
    f: f64,
    /// Hold time at the second peak in sine_with_dwell
    #[var("steer.dwell_time", unit = "s", start = 0.5, min = 0.0)]
    dwell: f64,
    /// Last frequency in sine_sweep
    #[var("steer.final_frequency", unit = "Hz", start = 4.0, min = 0.0)]
    f_1: f64,
    /// Time from the first to the last frequency in sine_sweep
    #[var("steer.duration", unit = "s", start = 20.0, min = 0.0)]
    duration: f64,
    /// Speed before the speed ramp
    #[var("speed.initial", unit = "m/s", start = 60.0 / 3.6, min = 0.0, display = "km/h")]
    v_0: f64,
    /// Speed after the speed ramp
    #[var("speed.final", unit = "m/s", start = 0.0, min = 0.0, display = "km/h")]
    v_1: f64,
    /// Start of the speed ramp; the start value is later than any run, so the speed is constant
    #[var("speed.start", unit = "s", start = 1e6, min = 0.0)]
    t_v: f64,
    /// Duration of the speed ramp; 0 for a step
    #[var("speed.rise_time", unit = "s", start = 1.0, min = 0.0)]
    d_v: f64,
    /// Throttle pedal after its ramp
    #[var("throttle.amplitude", unit = "1", start = 0.0, min = 0.0, max = 1.0)]
    a_throttle: f64,
    /// Start of the throttle ramp
    #[var("throttle.start", unit = "s", start = 1.0, min = 0.0)]
    t_throttle: f64,
    /// Duration of the throttle ramp; 0 for a step
    #[var("throttle.rise_time", unit = "s", start = 0.2, min = 0.0)]
    d_throttle: f64,
    /// Brake pedal after its ramp
    #[var("brake.amplitude", unit = "1", start = 0.0, min = 0.0, max = 1.0)]
    a_brake: f64,
    /// Start of the brake ramp
    #[var("brake.start", unit = "s", start = 1.0, min = 0.0)]
    t_brake: f64,
    /// Duration of the brake ramp; 0 for a step
    #[var("brake.rise_time", unit = "s", start = 0.15, min = 0.0)]
    d_brake: f64,
    /// CSV file for the maneuver table, with the column time in s and any of driver.steer, driver.speed,
    /// driver.throttle, driver.brake; a relative path starts at the resources folder of the FMU
    #[var("table.file", start = "")]
    table_file: String,
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// No inputs: the driver depends on time only.
#[derive(Inputs, Clone, Debug)]
pub struct U {}

/// Driver demands.
#[derive(Outputs, Clone, Debug, PartialEq)]
pub struct Y {
    #[var(DRIVER_STEER)]
    steer: f64,
    #[var(DRIVER_SPEED)]
    speed: f64,
    #[var(DRIVER_THROTTLE)]
    throttle: f64,
    #[var(DRIVER_BRAKE)]
    brake: f64,
}

/// The file for the maneuver table.
#[derive(Derived, Clone, Debug)]
pub struct D {
    table: Option<Table>,
}

/// Steering, speed and pedals as functions of time: vehicle test maneuvers, or a file
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for Driver {
    type Derived = D;
    type Inputs = U;
    type Outputs = Y;
    const SOURCE: Option<Influence> = Some(equations::influence);

    fn derived(&self) -> Result<D, String> {
        equations::derived(self, None)
    }
    fn load(&self, resources: &Path) -> Result<D, String> {
        if self.maneuver != Maneuver::Table {
            return self.derived();
        }
        let (path, text) = table::read_file("table.file", &self.table_file, resources)?;
        let demands = equations::parse_table(&text, &path).map_err(|error| format!("'table.file': {error}"))?;
        equations::derived(self, Some(demands))
    }
    fn fingerprint(d: &D) -> u64 {
        d.table.as_ref().map_or(0, Table::content_hash)
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        equations::sample(self, sample.derived, sample.time)
    }
}
