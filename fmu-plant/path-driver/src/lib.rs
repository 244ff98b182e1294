//! `PathDriver`: a driver for standard maneuvers. It follows a path (circle, the lane changes of ISO 3888, a file) by
//! looking ahead, or steers by time (slowly increasing steer, fishhook with roll-rate feedback), and keeps a speed with
//! its pedals.
//!
//! [`tracks`] contains the cones of ISO 3888, for evaluating a run.

mod path;
mod speed;
mod steering;
#[cfg(test)]
mod tests;
pub mod tracks;

use std::path::Path as FilePath;

use chassis_vehicle::prelude::*;
use chassis_vehicle::table::{self, Columns};
use fmu::prelude::*;

use path::{Path, Place};
use steering::{Delay, Steering};

/// Maneuver of the driver.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maneuver {
    /// follows the line y = 0
    Straight = 0,
    /// straight, clothoid, circle
    Circle = 1,
    /// through the cones of ISO 3888-1
    DoubleLaneChange = 2,
    /// through the cones of ISO 3888-2
    ObstacleAvoidance = 3,
    /// one period of a sine of lateral acceleration: ISO 14791, SAE J2179
    SingleLaneChange = 4,
    /// follows the points in the file table.file
    Table = 5,
    /// steers at a constant rate to an angle: FMVSS 126, ISO 4138; no path
    SlowlyIncreasingSteer = 6,
    /// steers to one side, waits until the roll rate is small, then steers to the other: NHTSA; no path
    Fishhook = 7,
}

/// Symbols as in the README.
#[derive(Parameters, Clone, Debug)]
pub struct PathDriver {
    /// What the driver does
    #[var("maneuver", start = Maneuver::DoubleLaneChange)]
    maneuver: Maneuver,
    /// x0: length of the straight line before the maneuver
    #[var("path.start", unit = "m", start = 50.0, min = 0.0)]
    x_0: f64,
    /// R: radius of circle
    #[var("path.radius", unit = "m", start = 100.0, positive)]
    r: f64,
    /// Lc: length of the clothoid before circle; 0 for a step in the curvature
    #[var("path.turn_in", unit = "m", start = 30.0, min = 0.0)]
    l_c: f64,
    /// Length of the arc in circle
    #[var("path.arc", unit = "m", start = 600.0, min = 0.0)]
    arc: f64,
    /// Length of the path after the maneuver; circle and table have none
    #[var("path.run_out", unit = "m", start = 100.0, min = 0.0)]
    run_out: f64,
    /// Mirrors the path, to the right first; no effect on table
    #[var("path.mirror", start = false)]
    mirror: bool,
    /// w: width of the vehicle, which determines the lane widths of ISO 3888
    #[var("path.vehicle_width", unit = "m", start = 1.61, min = 0.0)]
    w: f64,
    /// o: length by which the transition between two lanes of ISO 3888 extends into both; at most half of the second
    /// lane
    #[var("path.overlap", unit = "m", start = 6.0, min = 0.0)]
    o: f64,
    /// Distance of the path from the middle of the second lane of ISO 3888, towards the first
    #[var("path.cut", unit = "m", start = 0.1)]
    cut: f64,
    /// H: lateral offset of single_lane_change, positive to the left
    #[var("path.offset", unit = "m", start = 1.4637)]
    h: f64,
    /// Ls: length of single_lane_change; the start value is 2.5 s at 88 km/h
    #[var("path.change_distance", unit = "m", start = 2.5 * 88.0 / 3.6, positive)]
    l_s: f64,
    /// Deviation beyond which the path is lost
    #[var("path.lost_distance", unit = "m", start = 10.0, min = 0.0)]
    lost_distance: f64,
    /// CSV file with the points for table, columns x and y in m; a relative path starts at the resources folder of the
    /// FMU
    #[var("table.file", start = "")]
    table_file: String,
    /// Tp: time that the driver looks ahead
    #[var("preview.time", unit = "s", start = 0.8, min = 0.0)]
    t_p: f64,
    /// Least distance that the driver looks ahead
    #[var("preview.minimum_distance", unit = "m", start = 3.0, positive)]
    l_p_min: f64,
    /// g: factor on the steering angle against the deviation ahead
    #[var("preview.gain", unit = "1", start = 1.0, min = 0.0)]
    g: f64,
    /// Factor on the steering angle for the curvature of the path
    #[var("feedforward.gain", unit = "1", start = 1.0)]
    g_ff: f64,
    /// Delay of the vehicle, by which the driver steers earlier
    #[var("feedforward.time", unit = "s", start = 0.1, min = 0.0)]
    t_ff: f64,
    /// k_i: rate of the integral of the deviation
    #[var("lateral.integral_gain", unit = "1/s", start = 0.0, min = 0.0)]
    k_i: f64,
    /// L: wheelbase that the driver assumes
    #[var("geometry.wheelbase", unit = "m", start = 2.34, positive)]
    l: f64,
    /// K: understeer gradient that the driver assumes, road-wheel angle per lateral acceleration
    #[var("vehicle.understeer_gradient", unit = "rad.s2/m", start = 0.0)]
    k: f64,
    /// Td: delay of the driver, rounded to whole samples; at most 10000 samples
    #[var("response.delay", unit = "s", start = 0.05, min = 0.0, display = "ms")]
    t_d: f64,
    /// Tr: time constant of the driver's lag; none if it is not above 0
    #[var("response.time_constant", unit = "s", start = 0.05, display = "ms")]
    t_r: f64,
    /// Steering-wheel angle divided by road-wheel angle
    #[var("steer.ratio", unit = "1", start = 16.0, positive)]
    ratio: f64,
    /// Greatest angle of the steering wheel
    #[var("steer.wheel_angle_limit", unit = "rad", start = 12.0, min = 0.0, display = "deg")]
    angle_limit: f64,
    /// Greatest rate of the steering wheel while the driver follows a path
    #[var("steer.wheel_rate_limit", unit = "rad/s", start = 17.453292519943295, min = 0.0, display = "deg/s")]
    rate_limit: f64,
    /// Start of the steering in slowly_increasing_steer and fishhook
    #[var("steer.start", unit = "s", start = 1.0, min = 0.0)]
    t_0: f64,
    /// omega: rate of the steering wheel in slowly_increasing_steer and fishhook
    #[var("steer.wheel_rate", unit = "rad/s", start = 0.23561944901923448, min = 0.0, display = "deg/s")]
    omega: f64,
    /// A: amplitude of the steering wheel in slowly_increasing_steer and fishhook, positive to the left first
    #[var("steer.wheel_amplitude", unit = "rad", start = 4.71238898038469, display = "deg")]
    a: f64,
    /// Time from which the steering angle is held; the start value is later than any run
    #[var("steer.hold_start", unit = "s", start = 1e6, min = 0.0)]
    hold_start: f64,
    /// Roll rate at which fishhook steers to the other side; if negative, it always waits for steer.maximum_dwell
    #[var("roll_rate.threshold", unit = "rad/s", start = 0.02617993877991494, display = "deg/s")]
    roll_rate_threshold: f64,
    /// Longest time that fishhook waits before it steers to the other side
    #[var("steer.maximum_dwell", unit = "s", start = 3.0, min = 0.0)]
    maximum_dwell: f64,
    /// Hold time on the other side in fishhook
    #[var("steer.hold_time", unit = "s", start = 3.0, min = 0.0)]
    hold_time: f64,
    /// Duration of the return to straight ahead in fishhook
    #[var("steer.return_time", unit = "s", start = 2.0, min = 0.0)]
    return_time: f64,
    /// The pedals keep driver.speed; if false, they stay at 0 until brake.start
    #[var("speed.control", start = false)]
    speed_control: bool,
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
    /// k_pv: acceleration per speed error
    #[var("speed.proportional_gain", unit = "1/s", start = 1.5, min = 0.0)]
    k_pv: f64,
    /// k_iv: acceleration per integral of the speed error
    #[var("speed.integral_gain", unit = "1/s2", start = 0.5, min = 0.0)]
    k_iv: f64,
    /// Acceleration that the driver expects from the fully pressed accelerator pedal
    #[var("throttle.full_acceleration", unit = "m/s2", start = 2.5, positive)]
    a_throttle: f64,
    /// Deceleration that the driver expects from the fully pressed brake pedal
    #[var("brake.full_deceleration", unit = "m/s2", start = 8.0, positive)]
    a_brake: f64,
    /// Deceleration up to which the driver only releases the accelerator pedal
    #[var("brake.deadband", unit = "m/s2", start = 0.3, min = 0.0)]
    deadband: f64,
    /// Station from which both pedals are released; negative for never
    #[var("release.distance", unit = "m", start = -1.0)]
    release: f64,
    /// Brake pedal from brake.start on, after its ramp
    #[var("brake.amplitude", unit = "1", start = 0.0, min = 0.0, max = 1.0)]
    brake: f64,
    /// Start of the brake ramp, which ends speed control; the start value is later than any run
    #[var("brake.start", unit = "s", start = 1e6, min = 0.0)]
    t_brake: f64,
    /// Duration of the brake ramp; 0 for a step
    #[var("brake.rise_time", unit = "s", start = 0.15, min = 0.0)]
    d_brake: f64,
    /// T
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Motion of the vehicle as perceived by the driver.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(VEHICLE_POSITION_X)]
    x: f64,
    #[var(VEHICLE_POSITION_Y)]
    y: f64,
    #[var(VEHICLE_YAW)]
    yaw: f64,
    #[var(VEHICLE_SPEED)]
    v: f64,
    #[var(BODY_ROLL_RATE)]
    roll_rate: f64,
}

/// Driver demands, and the position of the vehicle on the path.
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
    #[var(DRIVER_STEERING_WHEEL)]
    steering_wheel: f64,
    #[var(PATH_LATERAL_DEVIATION)]
    e: f64,
    #[var(PATH_HEADING_ERROR)]
    psi_e: f64,
    #[var(PATH_DISTANCE)]
    s: f64,
    #[var(PATH_FINISHED)]
    finished: bool,
    #[var(PATH_LOST)]
    lost: bool,
}

/// Discrete state of the driver.
#[derive(DiscreteState, Clone, Debug, Default, PartialEq)]
pub struct X {
    /// n: number of the next sample.
    n: u64,
    /// j: segment of the path that the vehicle was on.
    segment: u64,
    /// Steering angle before delay and lag, rad; it does not change after the path has been lost.
    raw: f64,
    /// `raw` in the last samples.
    #[var(always_finite)]
    past: Delay,
    /// Steering angle after delay and lag, rad.
    lagged: f64,
    /// driver.steer, rad.
    steer: f64,
    /// I: integral of the lateral deviation, m.
    integral: f64,
    /// z: integral of the speed error, m/s2.
    z: f64,
    finished: bool,
    lost: bool,
    /// The pedals stay released.
    released: bool,
    /// Phase of the fishhook, and the sample with which it began.
    phase: steering::Phase,
    phase_start: u64,
}

/// The path, and the derived parameters of the steering.
#[derive(Derived, Clone, Debug)]
pub struct D {
    path: Path,
    steering: Steering,
    table_hash: u64,
}

/// Driver for standard maneuvers: follows a path or steers by time, and keeps a speed
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for PathDriver {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    const SOURCE: Option<Influence> =
        Some(|output, parameter| output == "driver.speed" && parameter.starts_with("speed."));

    /// Sets only the speed. The other outputs depend on the vehicle and are 0 until the first sample.
    fn start(&self, _: f64, _: &D, _: &U) -> Y {
        Y {
            steer: 0.0,
            speed: speed::reference(self, 0.0),
            throttle: 0.0,
            brake: 0.0,
            steering_wheel: 0.0,
            e: 0.0,
            psi_e: 0.0,
            s: 0.0,
            finished: false,
            lost: false,
        }
    }
    fn derived(&self) -> Result<D, String> {
        self.designed(None)
    }
    fn load(&self, resources: &FilePath) -> Result<D, String> {
        if self.maneuver != Maneuver::Table {
            return self.derived();
        }
        let (path, text) = table::read_file("table.file", &self.table_file, resources)?;
        let points = Columns::parse(&text, &path, &["x", "y"]).map_err(|error| format!("'table.file': {error}"))?;
        self.designed(Some((&path, &points)))
    }
    fn fingerprint(d: &D) -> u64 {
        d.table_hash
    }
    fn initial_state(&self, d: &D) -> X {
        X { past: Delay::of(d.steering.delay_samples), ..X::default() }
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        let Sample { state: x, inputs: u, derived: d, .. } = sample;
        let t = x.n as f64 * self.sample_time;
        let v = u.v.max(0.0);
        let place = d.path.project(&mut x.segment, [u.x, u.y], u.yaw);
        match self.maneuver {
            Maneuver::SlowlyIncreasingSteer => steering::slowly_increasing(self, d, x, t),
            Maneuver::Fishhook => steering::fishhook(self, d, x, u.roll_rate, t),
            _ => {
                x.lost |= place.e.abs() > self.lost_distance;
                x.finished |= place.s >= d.path.end;
                steering::follow(self, d, x, &place, v, t);
            }
        }
        let [throttle, brake] = speed::pedals(self, x, v, place.s, t);
        x.n = x.n.wrapping_add(1);
        let Place { e, psi_e, s } = place;
        Y {
            steer: x.steer,
            speed: speed::reference(self, t),
            throttle,
            brake,
            steering_wheel: self.ratio * x.steer,
            e,
            psi_e,
            s,
            finished: x.finished,
            lost: x.lost,
        }
    }
}

impl PathDriver {
    /// Checks the parameters and computes the path. `table` is the name and the points of the file for the maneuver
    /// `Table`.
    fn designed(&self, table: Option<(&str, &Columns)>) -> Result<D, String> {
        let table_hash = table.map_or(0, |(_, points)| points.content_hash());
        Ok(D { path: Path::new(self, table)?, steering: Steering::new(self)?, table_hash })
    }
}
