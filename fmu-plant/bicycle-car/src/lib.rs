//! `BicycleCar`: a single-track car with roll at a prescribed speed. With linear tires, its steady state, frequency
//! response and roll gradient are known in closed form, so it can validate a test bench.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the README.
#[derive(Parameters, Clone, Debug)]
pub struct BicycleCar {
    /// m
    #[var(VEHICLE_MASS, start = 1500.0)]
    m: f64,
    /// I_z
    #[var(VEHICLE_YAW_INERTIA, start = 2500.0)]
    i_z: f64,
    /// a
    #[var(CG_TO_FRONT_AXLE, start = 1.2)]
    a: f64,
    /// b
    #[var(CG_TO_REAR_AXLE, start = 1.5)]
    b: f64,
    /// C_f, C_r
    #[var(AXLE_CORNERING_STIFFNESS, start = [90_000.0, 110_000.0])]
    c: TwoAxles<f64>,
    /// 0 for linear tires
    #[var(TIRE_FRICTION, start = 0.0)]
    mu_0: f64,
    /// Only for the load transfer ratio
    #[var(TRACK, start = 1.5)]
    track: f64,
    /// h, only for the load transfer ratio
    #[var(CG_HEIGHT, start = 0.55)]
    h: f64,
    /// m_s
    #[var(BODY_MASS, start = 1300.0)]
    m_s: f64,
    /// h_s
    #[var(BODY_CG_TO_ROLL_AXIS, start = 0.45)]
    h_s: f64,
    /// I_x
    #[var(BODY_ROLL_AXIS_INERTIA, start = 600.0)]
    i_x: f64,
    /// K_phi: moment of springs and anti-roll bars per roll angle
    #[var("body.roll_stiffness", unit = "N.m/rad", start = 60_000.0, min = 0.0, display = "kN.m/rad")]
    k_phi: f64,
    /// D_phi: moment of the dampers per roll rate
    #[var("body.roll_damping", unit = "N.m.s/rad", start = 4000.0, min = 0.0)]
    d_phi: f64,
    /// standard value, rounded
    #[var(GRAVITY, start = 9.81, positive)]
    g: f64,
    /// in the slip angles and the sideslip angle
    #[var(MINIMUM_SPEED, start = 0.5)]
    u_min: f64,
    /// Runge-Kutta of order 4
    #[var(MAX_STEP, start = 0.001)]
    max_step: f64,
}

/// Inputs.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[var(DRIVER_SPEED, start = 80.0 / 3.6)]
    u: T,
    #[var(STEER)]
    delta: FrontAxle<T>,
    /// acts on both axles
    #[var(ROAD_FRICTION, start = 1.0)]
    mu: FrontLeftWheel<T>,
}

/// State: motion in the road plane, position, roll.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[var(VEHICLE_LATERAL_VELOCITY)]
    v: T,
    #[var(VEHICLE_YAW_RATE)]
    r: T,
    #[var(VEHICLE_YAW)]
    psi: T,
    #[var(VEHICLE_POSITION_X)]
    x: T,
    #[var(VEHICLE_POSITION_Y)]
    y: T,
    #[var(BODY_ROLL)]
    phi: T,
    #[var(BODY_ROLL_RATE)]
    p: T,
}

/// Outputs that are not states.
#[derive(Outputs, Clone, Debug)]
pub struct Y<T> {
    #[var(VEHICLE_SPEED)]
    u: T,
    #[var(VEHICLE_SIDESLIP)]
    beta: T,
    #[var(VEHICLE_YAW_ACCELERATION)]
    rd: T,
    #[var(VEHICLE_LATERAL_ACCELERATION)]
    a_y: T,
    #[var(VEHICLE_LOAD_TRANSFER_RATIO)]
    ratio: T,
}

/// Single-track car with linear or saturating tires and roll, at a prescribed speed
#[fmu::model(stop_time = 5.0, step_size = 0.001)]
impl Continuous for BicycleCar {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        equations::derivatives(self, at.state, at.inputs)
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        equations::outputs(self, at.state, at.inputs)
    }
}
