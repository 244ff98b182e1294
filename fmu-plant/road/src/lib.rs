//! `Road`: height and friction of the road under each wheel, as functions of the distance traveled. The README has the
//! equations.

mod equations;
#[cfg(test)]
mod tests;

use std::path::Path;

use chassis_vehicle::prelude::*;
use chassis_vehicle::table;
use fmu::prelude::*;

/// Source of the height of the left track.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// height 0 everywhere
    Flat = 0,
    /// first-order shaped noise over distance, generated during the run
    ShapedNoise = 1,
    /// sum of 800 cosines, faded in over the first 20 m
    Harmonics = 2,
    /// column in the file table.file
    Table = 3,
}

/// Relation of the right track to the left one.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracks {
    /// right as left
    Same = 0,
    /// of the same kind but independent; with a table, its column height_right
    Independent = 1,
    /// correlated by track.coherence
    Mixed = 2,
    /// right follows left through an all-pass with the delay geometry.track
    Delayed = 3,
}

/// Roughness at the start of the road.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoughnessStart {
    /// rough everywhere
    Stationary = 0,
    /// flat up to the front axle
    ZeroUpToFrontAxle = 1,
    /// flat up to the rearmost axle
    ZeroUpToRearAxle = 2,
}

/// Shape of the obstacle.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObstacleShape {
    /// no obstacle
    None = 0,
    /// (1 - cos)/2 over its length
    Bump = 1,
    /// up over the first quarter of its length, down over the last
    Trapezoid = 2,
    /// higher from its start on
    Step = 3,
}

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct Road {
    /// Height of the left track
    #[var("profile", start = Profile::ShapedNoise)]
    profile: Profile,
    /// Height of the right track
    #[var("tracks", start = Tracks::Independent)]
    tracks: Tracks,
    /// Seed of the random numbers: another seed gives another road of the same kind
    #[var("seed", start = 1, min = 0, max = i32::MAX)]
    seed: i32,
    /// rho: correlation of mixed tracks; their magnitude-squared coherence is rho^2
    #[var("track.coherence", unit = "1", start = 0.995, min = 0.0, max = 1.0)]
    rho: f64,
    /// Roughness class of ISO 8608, 1 (A) to 8 (H); 0 to use roughness.coefficient
    #[var("roughness.class", start = 3, min = 0, max = 8)]
    class: i32,
    /// Gd: one-sided spectral density at 0.1 1/m, for roughness.class 0
    #[var("roughness.coefficient", unit = "m3", start = 256e-6, min = 0.0)]
    g_d: f64,
    /// n00: wavenumber below which the density of shaped noise levels off
    #[var("roughness.cutoff", unit = "1/m", start = 0.011, positive)]
    n_00: f64,
    /// ds: grid of shaped noise, linear in between
    #[var("roughness.spacing", unit = "m", start = 0.01, positive, display = "mm")]
    ds: f64,
    /// Shaped noise at the start
    #[var("roughness.start", start = RoughnessStart::Stationary)]
    start: RoughnessStart,
    /// From the distance reached at this time on, shaped noise has roughness.change_class; 0 for never
    #[var("roughness.change_time", unit = "s", start = 0.0, min = 0.0)]
    t_change: f64,
    /// Roughness class of ISO 8608 after roughness.change_time, 1 (A) to 8 (H)
    #[var("roughness.change_class", start = 6, min = 1, max = 8)]
    class_change: i32,
    /// Distance of the {} behind the front axle
    #[var("geometry.axle_offset", unit = "m", start = 0.0, min = 0.0)]
    l: RearAxles<f64>,
    /// delay of delayed tracks
    #[var(TRACK, start = 1.56)]
    t_track: f64,
    /// Obstacle on top of the profile
    #[var("obstacle.shape", start = ObstacleShape::None)]
    obstacle: ObstacleShape,
    /// The obstacle is a function of time, under all axles at once, instead of distance
    #[var("obstacle.in_time", start = false)]
    obstacle_in_time: bool,
    /// Start of the obstacle, in m; in s with obstacle.in_time
    #[var("obstacle.start", unit = Unit::NONE, start = 20.0)]
    x_0: f64,
    /// Length of a bump or trapezoid, in m; in s with obstacle.in_time
    #[var("obstacle.length", unit = Unit::NONE, start = 5.0, min = 0.0)]
    x_l: f64,
    /// Height of the obstacle on the left, negative for a hole
    #[var("obstacle.height.left", unit = "m", start = 0.03, display = "mm")]
    a_left: f64,
    /// Height of the obstacle on the right, negative for a hole
    #[var("obstacle.height.right", unit = "m", start = 0.03, display = "mm")]
    a_right: f64,
    /// Factor on the tire friction on the left
    #[var("friction.left", unit = "1", start = 1.0, min = 0.0, tunable)]
    mu_left: f64,
    /// Factor on the tire friction on the right
    #[var("friction.right", unit = "1", start = 1.0, min = 0.0, tunable)]
    mu_right: f64,
    /// Distance from which each axle has the changed friction; 0 for never
    #[var("friction.change_start", unit = "m", start = 0.0, min = 0.0, tunable)]
    x_mu: f64,
    /// Factor on the tire friction on the left from friction.change_start on
    #[var("friction.changed_left", unit = "1", start = 1.0, min = 0.0, tunable)]
    mu_changed_left: f64,
    /// Factor on the tire friction on the right from friction.change_start on
    #[var("friction.changed_right", unit = "1", start = 1.0, min = 0.0, tunable)]
    mu_changed_right: f64,
    /// CSV file for the profile table, columns distance, height_left, height_right in m; a relative path starts at the
    /// resources folder of the FMU
    #[var("table.file", start = "")]
    table_file: String,
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Speed of the vehicle.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(VEHICLE_SPEED)]
    u: f64,
}

/// The road under the wheels; a half car uses the values of the front axle.
#[derive(Outputs, Clone, Debug, PartialEq)]
pub struct Y {
    #[var(ROAD_HEIGHT)]
    z: SixWheels<f64>,
    #[var(ROAD_HEIGHT)]
    z_side: Sides<f64>,
    #[var(ROAD_FRICTION, start = 1.0)]
    mu: SixWheels<f64>,
    #[var(ROAD_FRICTION, start = 1.0)]
    mu_side: Sides<f64>,
    #[var(ROAD_DISTANCE)]
    s: f64,
}

/// Distance of the front axle, and the shaped noise generated so far.
#[derive(DiscreteState, Clone, Debug, PartialEq)]
pub struct X {
    s: f64,
    /// Accumulated rounding error of `s` (compensated summation). Because of it, the distance does not depend on the
    /// sample time.
    s_excess: f64,
    /// Number of grid points generated so far, and index of the next random numbers.
    points: u64,
    /// The two independent processes at the newest grid point, m.
    noise: [f64; 2],
    /// State of the all-pass of delayed tracks at the newest grid point (m, 1).
    all_pass: [f64; 2],
    /// True if further grid points have the changed class.
    changed: bool,
    /// Ring buffer of the left track's heights, m: grid point `k` is at index `k` modulo the length.
    #[var(always_finite)]
    left: Box<[f64; equations::HISTORY]>,
    /// Ring buffer of the right track's heights, m.
    #[var(always_finite)]
    right: Box<[f64; equations::HISTORY]>,
}

/// The part of the height that is computed before the run.
#[derive(Derived, Clone, Debug)]
pub struct D {
    surface: equations::Surface,
}

/// Height and friction of the road under each wheel, as functions of the distance traveled
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for Road {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;
    const SOURCE: Option<Influence> = Some(equations::influence);

    fn derived(&self) -> Result<D, String> {
        equations::derived(self, None)
    }
    fn load(&self, resources: &Path) -> Result<D, String> {
        if self.profile != Profile::Table {
            return self.derived();
        }
        let (path, text) = table::read_file("table.file", &self.table_file, resources)?;
        let heights = equations::parse_table(&text, &path).map_err(|error| format!("'table.file': {error}"))?;
        equations::derived(self, Some(heights))
    }
    fn fingerprint(d: &D) -> u64 {
        d.surface.content_hash()
    }
    fn check(&self, sample: &Sample<Self>) -> Result<(), String> {
        equations::check(self, sample.derived, sample.state, sample.inputs)
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        equations::sample(self, sample.derived, sample.state, sample.inputs, sample.time)
    }
}
