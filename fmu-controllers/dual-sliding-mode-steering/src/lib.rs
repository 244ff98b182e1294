//! `DualSlidingModeSteering`: steers the middle and rear axles of a three-axle vehicle to keep sideslip at zero and the
//! yaw rate at its reference, by two integral sliding modes.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eqs. 14-31.

mod equations;
#[cfg(test)]
mod tests;

use chassis_control::front_steering::{ReferenceModel, Vehicle};
use chassis_vehicle::data::rescue_vehicle as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Computation of the slip angles of the axles.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlipAngleModel {
    /// small angles, as in the paper
    SmallAngle = 0,
    /// arctangent, accurate at low speed with large angles
    Arctangent = 1,
}

/// Symbols as in the paper; C = -k > 0.
#[derive(Parameters, Clone, Debug)]
pub struct DualSlidingModeSteering {
    #[var(VEHICLE_MASS, start = data::MASS)]
    m: f64,
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    a: f64,
    #[var(FRONT_TO_MIDDLE_AXLE, start = data::FRONT_TO_MIDDLE)]
    l12: f64,
    #[var(MIDDLE_TO_REAR_AXLE, start = data::MIDDLE_TO_REAR)]
    l23: f64,
    #[var(TIRE_CORNERING_STIFFNESS, start = data::CORNERING_STIFFNESS)]
    c_tire: ThreeAxles<f64>,
    #[var(GRAVITY, start = data::GRAVITY, positive)]
    g: f64,
    #[var(MINIMUM_SPEED, start = data::MINIMUM_SPEED)]
    u_min: f64,
    /// zeta: rate at which the error decays on the surface; raise it to remove a lasting error
    #[var("surface.integral_gain", unit = "1/s", start = 1.0, min = 0.0, tunable)]
    zeta: SlidingModes<f64>,
    /// K: linear reaching rate; raise it for a faster return to the surface
    #[var("reaching.rate", unit = "1/s", start = 4.0, min = 0.0, tunable)]
    k: SlidingModes<f64>,
    /// eps: switching gain of the sideslip law
    #[var("switching.gain.sideslip", unit = "rad/s", start = 0.02, min = 0.0, tunable)]
    eps_b: f64,
    /// eps: switching gain of the yaw rate law
    #[var("switching.gain.yaw_rate", unit = "rad/s2", start = 0.05, min = 0.0, tunable)]
    eps_r: f64,
    /// Boundary layer of the sideslip law; widen it if the axles chatter, 0 is a sign function
    #[var("switching.boundary_layer.sideslip", unit = "rad", start = 0.01, min = 0.0, tunable)]
    width_b: f64,
    /// Boundary layer of the yaw rate law; widen it if the axles chatter, 0 is a sign function
    #[var("switching.boundary_layer.yaw_rate", unit = "rad/s", start = 0.02, min = 0.0, tunable)]
    width_r: f64,
    /// Largest lateral acceleration that the reference demands (calibrated to Table 4)
    #[var("reference.lateral_acceleration_limit", unit = "m/s2", start = 3.743, positive, tunable)]
    ay_limit: f64,
    /// Time constant of the yaw rate reference
    #[var("reference.time_constant", unit = "s", start = 0.2, positive, tunable)]
    tau: f64,
    /// Rate limit of the front axle; 0 or less for none (calibrated to Table 4: 10 deg/s)
    #[var("steer.rate_limit.front", unit = "rad/s", start = 10.0 * DEG, tunable, display = "deg/s")]
    front_rate: f64,
    /// Rate limit of the middle and rear axle; 0 or less for none
    #[var("steer.rate_limit.rear", unit = "rad/s", start = 30.0 * DEG, tunable, display = "deg/s")]
    rate: f64,
    /// Angle limit of the front axle (paper: 32 deg)
    #[var("steer.angle_limit.front", unit = "rad", start = 32.0 * DEG, min = 0.0, tunable, display = "deg")]
    front_limit: f64,
    /// Angle limit of the middle and rear axle
    #[var("steer.angle_limit.rear", unit = "rad", start = 32.0 * DEG, min = 0.0, tunable, display = "deg")]
    limit: f64,
    /// Steady turn that defines the yaw rate reference
    #[var("reference.model", start = ReferenceModel::ZeroSideslip)]
    reference_model: ReferenceModel,
    /// Computation of the slip angles of the axles
    #[var("slip_angle.model", start = SlipAngleModel::Arctangent)]
    slip_angle_model: SlipAngleModel,
    /// T
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

fmu::named_array! {
    /// The two sliding modes.
    pub SlidingModes[2] {
        sideslip: "sideslip",
        yaw_rate: "yaw rate",
    }
}

/// Driver's demand, measurements and weight.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(DRIVER_STEER)]
    steer: f64,
    #[var(VEHICLE_SPEED)]
    u: f64,
    #[var(VEHICLE_SIDESLIP)]
    beta: f64,
    #[var(VEHICLE_YAW_RATE)]
    r: f64,
    #[var(WEIGHT_STEERING)]
    k3: f64,
}

/// Axle angles, and internal signals for plots.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(STEER)]
    delta: ThreeAxles<f64>,
    #[var(SLIDING_SURFACE_SIDESLIP)]
    s_b: f64,
    #[var(SLIDING_SURFACE_YAW_RATE)]
    s_r: f64,
    #[var(REFERENCE_YAW_RATE)]
    r_d: f64,
    #[var(STEER_REQUEST)]
    request: RearAxles<f64>,
}

/// Integrals of the errors, reference, and the last axle angles.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    i_b: f64,
    i_r: f64,
    r_d: f64,
    df: f64,
    dm: f64,
    dr: f64,
}

/// Parameters derived from geometry, masses and tires.
#[derive(Derived, Clone, Debug)]
pub struct D {
    /// The vehicle in a steady turn.
    vehicle: Vehicle,
    /// Load of the front axle at rest
    #[var("axle.static_load.front", unit = "N", display = "kN")]
    w_f: f64,
}

/// Multi-axle steering of a three-axle vehicle by two integral sliding modes: zero sideslip and reference yaw rate
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for DualSlidingModeSteering {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn derived(&self) -> Result<D, String> {
        equations::derived(self)
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        equations::sample(self, sample.derived, sample.state, sample.inputs)
    }
}
