//! `FrontSteeringActuator`: the steered front axle of a three-axle vehicle, which follows the driver within its limits.
//! These limits are the same as in `DualSlidingModeSteering`.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eqs. 14 and 15.

#[cfg(test)]
mod tests;

use chassis_control::front_steering::{Limits, ReferenceModel, Vehicle};
use chassis_vehicle::data::rescue_vehicle as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the paper; C = -k > 0.
#[derive(Parameters, Clone, Debug)]
pub struct FrontSteeringActuator {
    #[var(VEHICLE_MASS, start = data::MASS)]
    m: f64,
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
    /// Largest lateral acceleration of the steady turn that the front axle can demand
    #[var("reference.lateral_acceleration_limit", unit = "m/s2", start = 3.743, positive, tunable)]
    ay_limit: f64,
    /// Rate limit of the front axle; 0 or less for none
    #[var("steer.rate_limit.front", unit = "rad/s", start = 10.0 * DEG, tunable, display = "deg/s")]
    front_rate: f64,
    /// Angle limit of the front axle
    #[var("steer.angle_limit.front", unit = "rad", start = 32.0 * DEG, min = 0.0, tunable, display = "deg")]
    front_limit: f64,
    /// Steady turn in which the lateral acceleration is limited
    #[var("reference.model", start = ReferenceModel::ZeroSideslip)]
    reference_model: ReferenceModel,
    /// T
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

/// Driver's demand and speed.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(DRIVER_STEER)]
    steer: f64,
    #[var(VEHICLE_SPEED)]
    u: f64,
}

/// Angle of the front axle.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(STEER)]
    delta: FrontAxle<f64>,
}

/// The last angle.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    df: f64,
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

/// Steered front axle of a three-axle vehicle: follows the driver within limits on angle, rate and lateral acceleration
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for FrontSteeringActuator {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn derived(&self) -> Result<D, String> {
        let vehicle = Vehicle::new(self.m, self.g, [self.a, self.l12, self.l23], *self.c_tire)?;
        Ok(D { vehicle, w_f: vehicle.w_f })
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, inputs) = (sample.state, sample.inputs);
        let limits = Limits {
            model: self.reference_model,
            ay_limit: self.ay_limit,
            angle: self.front_limit,
            rate: self.front_rate,
        };
        let u = inputs.u.max(self.u_min);
        x.df = limits.sample(&sample.derived.vehicle, inputs.steer, u, x.df, self.sample_time).df;
        Y { delta: FrontAxle([x.df]) }
    }
}
