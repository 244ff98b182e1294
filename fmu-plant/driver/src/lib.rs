//! `Driver`: steering, speed and pedals as functions of time: the maneuvers of the vehicle tests, or a file.

mod equations;
#[cfg(test)]
mod tests;

use std::path::Path;

use chassis::prelude::*;
use chassis::table::{self, Table};
use fmi2::prelude::*;

/// The driver.
pub struct Driver;

/// How the driver steers.
#[derive(Mode, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maneuver {
    /// no steering
    Straight = 0,
    /// to an angle that is held: step steer, J-turn
    RampStep = 1,
    /// to one side, then fast to the other
    Fishhook = 2,
    /// one sine period, later one of the opposite sign
    DoubleLaneChange = 3,
    /// sine periods, of time or between cones
    Slalom = 4,
    /// one sine period that waits at its second peak: the test of electronic stability control
    SineWithDwell = 5,
    /// sine of a rising frequency
    SineSweep = 6,
    /// column of the file table.file
    Table = 7,
}

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// How the driver steers
    #[par("maneuver", mode, start = Maneuver::RampStep)]
    maneuver: Maneuver,
    /// A: amplitude of the steering angle, positive to the left first
    #[par("steer.amplitude", unit = RAD, start = 0.1, display = "deg")]
    a: f64,
    /// Start of the steering
    #[par("steer.start", unit = S, start = 1.0, min = 0.0)]
    t_0: f64,
    /// Duration of the first ramp of ramp_step and fishhook; 0 for a step
    #[par("steer.rise_time", unit = S, start = 0.2, min = 0.0)]
    d: f64,
    /// Start of the way back of fishhook, of the second period of double_lane_change
    #[par("steer.reversal_start", unit = S, start = 6.0, min = 0.0)]
    t_1: f64,
    /// Duration of the ramp to the other side of fishhook; 0 for a step
    #[par("steer.reversal_time", unit = S, start = 0.4, min = 0.0)]
    d_2: f64,
    /// Amplitude on the other side of fishhook
    #[par("steer.reversal_amplitude", unit = RAD, start = 0.1, display = "deg")]
    a_2: f64,
    /// Period of double_lane_change and slalom; 0 in slalom for two cone distances of driver.speed
    #[par("steer.period", unit = S, start = 4.0, min = 0.0)]
    period: f64,
    /// Number of periods of slalom; 0 for no end
    #[par("steer.cycles", start = 0, min = 0, max = i32::MAX)]
    cycles: i32,
    /// Distance from cone to cone of slalom with steer.period 0
    #[par("steer.cone_distance", unit = M, start = 50.0, min = 0.0)]
    cone_distance: f64,
    /// Frequency of sine_with_dwell, first frequency of sine_sweep
    #[par("steer.frequency", unit = HZ, start = 0.7, min = 0.0)]
    f: f64,
    /// Time at the second peak of sine_with_dwell
    #[par("steer.dwell_time", unit = S, start = 0.5, min = 0.0)]
    dwell: f64,
    /// Last frequency of sine_sweep
    #[par("steer.final_frequency", unit = HZ, start = 4.0, min = 0.0)]
    f_1: f64,
    /// Time from the first to the last frequency of sine_sweep
    #[par("steer.duration", unit = S, start = 20.0, min = 0.0)]
    duration: f64,
    /// Speed before the speed ramp
    #[par("speed.initial", unit = M_PER_S, start = 60.0 / 3.6, min = 0.0, display = "km/h")]
    v_0: f64,
    /// Speed after the speed ramp
    #[par("speed.final", unit = M_PER_S, start = 0.0, min = 0.0, display = "km/h")]
    v_1: f64,
    /// Start of the speed ramp; the start value lies beyond any run, the speed is constant
    #[par("speed.start", unit = S, start = 1e6, min = 0.0)]
    t_v: f64,
    /// Duration of the speed ramp; 0 for a step
    #[par("speed.rise_time", unit = S, start = 1.0, min = 0.0)]
    d_v: f64,
    /// Throttle pedal after its ramp
    #[par("throttle.amplitude", unit = ONE, start = 0.0, min = 0.0, max = 1.0)]
    a_throttle: f64,
    /// Start of the throttle ramp
    #[par("throttle.start", unit = S, start = 1.0, min = 0.0)]
    t_throttle: f64,
    /// Duration of the throttle ramp; 0 for a step
    #[par("throttle.rise_time", unit = S, start = 0.2, min = 0.0)]
    d_throttle: f64,
    /// Brake pedal after its ramp
    #[par("brake.amplitude", unit = ONE, start = 0.0, min = 0.0, max = 1.0)]
    a_brake: f64,
    /// Start of the brake ramp
    #[par("brake.start", unit = S, start = 1.0, min = 0.0)]
    t_brake: f64,
    /// Duration of the brake ramp; 0 for a step
    #[par("brake.rise_time", unit = S, start = 0.15, min = 0.0)]
    d_brake: f64,
    /// CSV file of the maneuver table, column time in s and any of driver.steer, driver.speed, driver.throttle,
    /// driver.brake; a relative path starts at the resources folder of the FMU
    #[par("table.file", start = "")]
    table_file: String,
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// The driver looks at nothing but the time.
#[derive(Inputs, Clone, Debug)]
pub struct U {}

/// What the driver asks for.
#[derive(Outputs, Clone, Debug, PartialEq)]
pub struct Y {
    #[signal(DRIVER_STEER)]
    steer: f64,
    #[signal(DRIVER_SPEED)]
    speed: f64,
    #[signal(DRIVER_THROTTLE)]
    throttle: f64,
    #[signal(DRIVER_BRAKE)]
    brake: f64,
}

/// The file of the maneuver table.
#[derive(Design, Clone, Debug)]
pub struct D {
    table: Option<Table>,
}

/// Steering, speed and pedals as functions of time: vehicle test maneuvers, or a file
#[model(stop_time = 20.0, step_size = 0.001)]
impl Sampled for Driver {
    type Parameters = P;
    type Design = D;
    type Inputs = U;
    type Outputs = Y;
    const SOURCE: Option<Influence> = Some(equations::influence);

    fn design(p: &P) -> Result<D, String> {
        equations::design(p, None)
    }
    fn load(p: &P, resources: &Path) -> Result<D, String> {
        if p.maneuver != Maneuver::Table {
            return Self::design(p);
        }
        let (path, text) = table::read_file("table.file", &p.table_file, resources)?;
        let demands = equations::parse_table(&text, &path).map_err(|error| format!("'table.file': {error}"))?;
        equations::design(p, Some(demands))
    }
    fn fingerprint(d: &D) -> u64 {
        d.table.as_ref().map_or(0, Table::content_hash)
    }
    fn update(p: &P, d: &D, (): &mut (), _: &U, t: f64) -> Y {
        equations::sample(p, d, t)
    }
}

fmi2::export!(sampled Driver);
