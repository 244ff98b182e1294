//! `DirectYawControl`: the yaw moment that makes a car follow the turn demanded by its driver, from a sliding mode of
//! sideslip and yaw rate, and the brake pressures on one side that produce this moment.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", eqs. 9, 10 and 19-22.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::data::esp_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the paper; K_f, K_r > 0.
#[derive(Parameters, Clone, Debug)]
pub struct DirectYawControl {
    /// m
    #[var(VEHICLE_MASS, start = data::MASS)]
    m: f64,
    /// I_z
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    a: f64,
    #[var(CG_TO_REAR_AXLE, start = data::CG_TO_REAR)]
    b: f64,
    #[var(TRACK, start = data::TRACK)]
    track: f64,
    /// R
    #[var(WHEEL_RADIUS, start = data::RADIUS)]
    radius: f64,
    /// K_f, K_r: twice the stiffness of a tire
    #[var(AXLE_CORNERING_STIFFNESS, start = [2.0 * data::CORNERING_STIFFNESS[0], 2.0 * data::CORNERING_STIFFNESS[1]])]
    k: TwoAxles<f64>,
    /// S1 of the sliding surface (paper, after eq. 20)
    #[var("surface.weight.sideslip", unit = "1", start = -0.0107)]
    s1: f64,
    /// S2 of the sliding surface, not 0 (paper, after eq. 20)
    #[var("surface.weight.yaw_rate", unit = "1", start = 0.0124)]
    s2: f64,
    /// k_s: linear reaching rate (assumed)
    #[var("reaching.rate", unit = "1/s", start = 5.0, min = 0.0, tunable)]
    k_s: f64,
    /// eta: size of the switching term (assumed)
    #[var("switching.gain", unit = "rad/s2", start = 1.0, min = 0.0, tunable)]
    eta: f64,
    /// Width of the switching term's saturation; 0 is the paper's sign function, which chatters (assumed)
    #[var("switching.boundary_layer", unit = "rad/s", start = 0.05, min = 0.0, tunable)]
    layer: f64,
    /// tau: first-order lag of the references (assumed)
    #[var("reference.time_constant", unit = "s", start = 0.1, positive, tunable)]
    tau: f64,
    /// mu
    #[var(TIRE_FRICTION, start = data::FRICTION, tunable)]
    mu: f64,
    #[var(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Speed up to which there is no yaw moment (assumed)
    #[var("activation.minimum_speed", unit = "m/s", start = 3.0, positive, tunable, display = "km/h")]
    speed_min: f64,
    /// Yaw moment up to which no wheel is braked (assumed)
    #[var("moment.deadband", unit = "N.m", start = 100.0, min = 0.0, tunable)]
    deadband: f64,
    /// Largest yaw moment (assumed)
    #[var("moment.limit", unit = "N.m", start = 6000.0, min = 0.0, tunable, display = "kN.m")]
    moment_max: f64,
    /// Largest brake pressure (assumed)
    #[var("pressure.limit", unit = "MPa", start = 8.0, min = 0.0, tunable, display = "bar")]
    pressure_max: f64,
    /// C, as in BrakeAndDriveActuators
    #[var(BRAKE_GAIN, start = data::BRAKE_GAIN)]
    gain: TwoAxles<f64>,
    /// T (assumed)
    #[var(SAMPLE_TIME, start = 0.005)]
    sample_time: f64,
}

/// Driver's demand and measurements.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(ENABLE_YAW_CONTROL)]
    enable: bool,
    #[var(DRIVER_STEER)]
    delta: f64,
    #[var(VEHICLE_SPEED)]
    u: f64,
    #[var(VEHICLE_SIDESLIP)]
    beta: f64,
    #[var(VEHICLE_YAW_RATE)]
    r: f64,
}

/// Moment, pressures and references.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(DEMAND_YAW_MOMENT)]
    dm: f64,
    #[var(YAW_CONTROL_PRESSURE)]
    pressure: FourWheels<f64>,
    #[var(REFERENCE_YAW_RATE)]
    r_d: f64,
    #[var(REFERENCE_SIDESLIP)]
    beta_d: f64,
}

/// References.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    r_d: f64,
    beta_d: f64,
}

/// The linear model with two degrees of freedom and the slope of the surface.
#[derive(Derived, Clone, Debug)]
pub struct D {
    /// Stability factor of the linear model: positive for an understeering vehicle
    #[var("vehicle.stability_factor", unit = "s2/m2")]
    stability: f64,
    /// S1/S2, 1/s.
    c: f64,
}

/// Yaw moment of a car from a sliding mode of sideslip and yaw rate, and the brake pressures on one side that produce
/// it
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Discrete for DirectYawControl {
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
