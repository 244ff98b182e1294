//! `FrontSteeringActuator`: the steered front axle of a three-axle vehicle, which follows the driver within its limits.
//! These limits are those inside `DualSlidingModeSteering`.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eqs. 14 and 15.

mod equations;
#[cfg(test)]
mod tests;

use chassis::data::rescue_vehicle as data;
use chassis::prelude::*;
use fmi2::prelude::*;
use front_steering::{ReferenceModel, Vehicle};

/// The actuator.
pub struct FrontSteeringActuator;

/// Symbols as in the paper; C = -k > 0.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    #[par(VEHICLE_MASS, start = data::MASS)]
    m: f64,
    #[par(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    a: f64,
    #[par(FRONT_TO_MIDDLE_AXLE, start = data::FRONT_TO_MIDDLE)]
    l12: f64,
    #[par(MIDDLE_TO_REAR_AXLE, start = data::MIDDLE_TO_REAR)]
    l23: f64,
    #[par(TIRE_CORNERING_STIFFNESS, start = data::CORNERING_STIFFNESS)]
    c: ThreeAxles<f64>,
    #[par(GRAVITY, start = data::GRAVITY, positive)]
    g: f64,
    #[par(MINIMUM_SPEED, start = data::MINIMUM_SPEED)]
    u_min: f64,
    /// Largest lateral acceleration of the steady turn that the front axle may ask for
    #[par("reference.lateral_acceleration_limit", unit = M_PER_S2, start = 3.743, positive, tunable)]
    ay_limit: f64,
    /// Rate limit of the front axle; 0 or less for none
    #[par("steer.rate_limit.front", unit = RAD_PER_S, start = 10.0 * DEG, tunable, display = "deg/s")]
    front_rate: f64,
    /// Angle limit of the front axle
    #[par("steer.angle_limit.front", unit = RAD, start = 32.0 * DEG, min = 0.0, tunable, display = "deg")]
    front_limit: f64,
    /// Steady turn in which the lateral acceleration is limited
    #[par("reference.model", mode, start = ReferenceModel::ZeroSideslip)]
    reference_model: ReferenceModel,
    /// T
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

/// What is asked for, and the speed it is asked at.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(DRIVER_STEER)]
    steer: f64,
    #[signal(VEHICLE_SPEED)]
    u: f64,
}

/// Angle of the front axle.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(STEER)]
    delta: FrontAxle<f64>,
}

/// The last angle.
#[derive(Memory, Clone, Debug, Default)]
pub struct X {
    df: f64,
}

/// What follows from geometry, masses and tires.
#[derive(Design, Clone, Debug)]
pub struct D {
    /// The vehicle in a steady turn.
    vehicle: Vehicle,
    /// Load of the front axle at rest
    #[calculated("axle.static_load.front", unit = N, display = "kN")]
    w_f: f64,
}

/// Steered front axle of a three-axle vehicle: follows the driver within limits of angle, rate and lateral acceleration
#[model(stop_time = 20.0, step_size = 0.001)]
impl Sampled for FrontSteeringActuator {
    type Parameters = P;
    type Design = D;
    type Memory = X;
    type Inputs = U;
    type Outputs = Y;

    fn design(p: &P) -> Result<D, String> {
        equations::design(p)
    }
    fn update(p: &P, d: &D, x: &mut X, u: &U, _t: f64) -> Y {
        equations::sample(p, d, x, u)
    }
}

fmi2::export!(sampled FrontSteeringActuator);
