//! `RescueVehicle`: a three-axle emergency rescue vehicle with 11 degrees of freedom (heave, pitch, roll, six wheels,
//! lateral velocity, yaw rate) at a prescribed speed.
//!
//! Chen, Gong, Zhao, Liu, Jia, "Coordination Control of Multi-Axis Steering and Active Suspension System for
//! High-Mobility Emergency Rescue Vehicles", Mathematics 2022, 10, 3562, eqs. 1-7 with the corrections that the README
//! lists.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::arithmetic::Divisor;
use chassis_vehicle::data::rescue_vehicle as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Dependence of the lateral tire force on the slip angle.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum TireModel {
    /// proportional to the slip angle, as in the paper
    Linear = 0,
    /// limited by friction and tire load
    Saturating = 1,
}

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct RescueVehicle {
    /// paper, Table 6
    #[var(VEHICLE_MASS, start = data::MASS)]
    m: f64,
    /// assumed: 10 % of the vehicle is unsprung
    #[var(WHEEL_MASS, start = data::WHEEL_MASS)]
    m_w: f64,
    /// paper, Table 6
    #[var(FRONT_TO_MIDDLE_AXLE, start = data::FRONT_TO_MIDDLE)]
    l12: f64,
    /// paper, Table 6
    #[var(MIDDLE_TO_REAR_AXLE, start = data::MIDDLE_TO_REAR)]
    l23: f64,
    /// assumed: equal static axle loads
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    a: f64,
    /// paper, Table 6
    #[var(TRACK, start = data::TRACK)]
    b_t: f64,
    /// assumed
    #[var(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h_s: f64,
    /// assumed: gyration radius 0.92 m
    #[var(BODY_ROLL_AXIS_INERTIA, start = data::ROLL_AXIS_INERTIA)]
    i_x: f64,
    /// assumed: gyration radius 2.0 m
    #[var(BODY_PITCH_AXIS_INERTIA, start = data::PITCH_AXIS_INERTIA)]
    i_y: f64,
    /// assumed: gyration radius 2.3 m
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    /// assumed: small
    #[var(BODY_PRODUCT_OF_INERTIA, start = data::PRODUCT_OF_INERTIA)]
    i_xz: f64,
    /// assumed: heave at 0.97 Hz
    #[var(SUSPENSION_STIFFNESS, start = data::SUSPENSION_STIFFNESS)]
    k_s: f64,
    /// assumed: damping ratio of heave about 0.3
    #[var(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    c_s: f64,
    /// assumed: load divided by 0.16 times the section height
    #[var(TIRE_STIFFNESS, start = data::TIRE_STIFFNESS)]
    k_t: f64,
    /// assumed: 5.1 times the static load per rad
    #[var(TIRE_CORNERING_STIFFNESS, start = data::CORNERING_STIFFNESS)]
    c: ThreeAxles<f64>,
    /// assumed: dry unpaved road
    #[var(TIRE_FRICTION, start = data::FRICTION, tunable)]
    mu: f64,
    /// used in slip and sideslip angles
    #[var(MINIMUM_SPEED, start = data::MINIMUM_SPEED)]
    u_min: f64,
    /// Lateral tire law
    #[var("tire.model", start = TireModel::Saturating)]
    tire_model: TireModel,
    /// A tire cannot pull on the road; if false, tire springs are linear as in the paper
    #[var("tire.lift_off", start = true)]
    lift_off: bool,
    /// standard value, rounded
    #[var(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Runge-Kutta of order 4; relative error 3e-10 in smooth runs, 1e-6 where wheels lift off
    #[var(MAX_STEP, start = 0.00025)]
    max_step: f64,
}

/// Inputs. The wheels 1 to 6 of the paper are fl, fr, ml, mr, rl and rr.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[var(DRIVER_SPEED, start = data::SPEED)]
    u: T,
    #[var(STEER)]
    delta: ThreeAxles<T>,
    #[var(SUSPENSION_FORCE)]
    f_u: SixWheels<T>,
    #[var(ROAD_HEIGHT)]
    z_r: SixWheels<T>,
    #[var(ROAD_FRICTION, start = 1.0)]
    friction: SixWheels<T>,
}

/// State: positions, then rates, then the motion in the road plane.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[var(BODY_HEAVE)]
    z: T,
    #[var(BODY_PITCH)]
    theta: T,
    #[var(BODY_ROLL)]
    phi: T,
    #[var(WHEEL_HEIGHT)]
    z_w: SixWheels<T>,
    #[var(BODY_HEAVE_RATE)]
    zd: T,
    #[var(BODY_PITCH_RATE)]
    thetad: T,
    #[var(BODY_ROLL_RATE)]
    phid: T,
    #[var(WHEEL_VELOCITY)]
    zd_w: SixWheels<T>,
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
    ltr: T,
    #[var(BODY_HEAVE_ACCELERATION)]
    zdd: T,
    #[var(BODY_PITCH_ACCELERATION)]
    thetadd: T,
    #[var(BODY_ROLL_ACCELERATION)]
    phidd: T,
    #[var(SUSPENSION_DEFLECTION)]
    d_s: SixWheels<T>,
    #[var(SUSPENSION_VELOCITY)]
    dd_s: SixWheels<T>,
    #[var(TIRE_DEFLECTION)]
    d_t: SixWheels<T>,
    #[var(TIRE_LOAD)]
    n: SixWheels<T>,
    #[var(TIRE_SLIP_ANGLE)]
    alpha: SixWheels<T>,
    #[var(TIRE_LATERAL_FORCE)]
    f_y: SixWheels<T>,
}

/// Parameters derived from geometry and masses.
#[derive(Derived, Clone, Debug)]
pub struct D {
    /// Sprung mass
    #[var("body.mass", unit = "kg")]
    m_s: f64,
    /// Static tire load
    #[var("tire.static_load", unit = "N", display = "kN")]
    fz0: SixWheels<f64>,
    /// Longitudinal and lateral position of each wheel, m.
    x: [f64; 6],
    y: [f64; 6],
    /// Inverse of the mass matrix of (vd, phidd, rd).
    inverse: [[f64; 3]; 3],
    /// Cornering stiffness of each tire.
    c: [f64; 6],
    /// m_s
    sprung_mass: Divisor,
    m_w: Divisor,
    i_y: Divisor,
}

/// Three-axle emergency rescue vehicle: heave, pitch, roll, six wheels, lateral and yaw motion at a prescribed speed
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Continuous for RescueVehicle {
    type Derived = D;
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn derived(&self) -> Result<D, String> {
        equations::derived(self)
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        equations::derivatives(self, at.derived, at.state, at.inputs)
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        equations::outputs(self, at.derived, at.state, at.inputs)
    }
}
