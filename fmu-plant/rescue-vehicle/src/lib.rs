//! `RescueVehicle`: a three-axle emergency rescue vehicle with 11 degrees of freedom (heave, pitch, roll, six wheels,
//! lateral velocity, yaw rate) at a prescribed speed.
//!
//! Chen, Gong, Zhao, Liu, Jia, "Coordination Control of Multi-Axis Steering and Active Suspension System for
//! High-Mobility Emergency Rescue Vehicles", Mathematics 2022, 10, 3562, eqs. 1-7 with the corrections that the
//! package's README lists.

mod equations;
#[cfg(test)]
mod tests;

use chassis::data::rescue_vehicle as data;
use chassis::prelude::*;
use fmi2::prelude::*;

/// The plant.
pub struct RescueVehicle;

/// How the lateral tire force depends on the slip angle.
#[derive(Mode, Clone, Copy, Debug, PartialEq, Eq)]
pub enum TireModel {
    /// proportional to the slip angle, as in the paper
    Linear = 0,
    /// limited by friction and tire load
    Saturating = 1,
}

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// paper, Table 6
    #[par(VEHICLE_MASS, start = data::MASS)]
    m: f64,
    /// assumed: 10 % of the vehicle is unsprung
    #[par(WHEEL_MASS, start = data::WHEEL_MASS)]
    m_w: f64,
    /// paper, Table 6
    #[par(FRONT_TO_MIDDLE_AXLE, start = data::FRONT_TO_MIDDLE)]
    l12: f64,
    /// paper, Table 6
    #[par(MIDDLE_TO_REAR_AXLE, start = data::MIDDLE_TO_REAR)]
    l23: f64,
    /// assumed: equal static loads of the axles
    #[par(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    a: f64,
    /// paper, Table 6
    #[par(TRACK, start = data::TRACK)]
    b_t: f64,
    /// assumed
    #[par(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h_s: f64,
    /// assumed: gyration radius 0.92 m
    #[par(BODY_ROLL_AXIS_INERTIA, start = data::ROLL_AXIS_INERTIA)]
    i_x: f64,
    /// assumed: gyration radius 2.0 m
    #[par(BODY_PITCH_AXIS_INERTIA, start = data::PITCH_AXIS_INERTIA)]
    i_y: f64,
    /// assumed: gyration radius 2.3 m
    #[par(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    /// assumed: small
    #[par(BODY_PRODUCT_OF_INERTIA, start = data::PRODUCT_OF_INERTIA)]
    i_xz: f64,
    /// assumed: heave at 0.97 Hz
    #[par(SUSPENSION_STIFFNESS, start = data::SUSPENSION_STIFFNESS)]
    k_s: f64,
    /// assumed: damping ratio of heave about 0.3
    #[par(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    c_s: f64,
    /// assumed: load over 0.16 times the section height
    #[par(TIRE_STIFFNESS, start = data::TIRE_STIFFNESS)]
    k_t: f64,
    /// assumed: 5.1 per rad of the static load
    #[par(TIRE_CORNERING_STIFFNESS, start = data::CORNERING_STIFFNESS)]
    c: ThreeAxles<f64>,
    /// assumed: dry unpaved road
    #[par(TIRE_FRICTION, start = data::FRICTION, tunable)]
    mu: f64,
    /// used in slip and sideslip angles
    #[par(MINIMUM_SPEED, start = data::MINIMUM_SPEED)]
    u_min: f64,
    /// Lateral tire law
    #[par("tire.model", mode, start = TireModel::Saturating)]
    tire_model: TireModel,
    /// A tire cannot pull on the road; if false, tire springs are linear as in the paper
    #[par("tire.lift_off", start = true)]
    lift_off: bool,
    /// standard value, rounded
    #[par(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Runge-Kutta of order 4; relative error 3e-10 in smooth runs, 1e-6 where wheels lift off
    #[par(MAX_STEP, start = 0.00025)]
    max_step: f64,
}

/// Inputs; x_i, y_i, and the wheels 1 to 6 of the paper in the order fl, fr, ml, mr, rl, rr.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[signal(DRIVER_SPEED, start = data::SPEED)]
    u: T,
    #[signal(STEER)]
    delta: ThreeAxles<T>,
    #[signal(SUSPENSION_FORCE)]
    f_u: SixWheels<T>,
    #[signal(ROAD_HEIGHT)]
    z_r: SixWheels<T>,
    #[signal(ROAD_FRICTION, start = 1.0)]
    friction: SixWheels<T>,
}

/// State: positions, then rates, then the motion in the road plane.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[signal(BODY_HEAVE)]
    z: T,
    #[signal(BODY_PITCH)]
    theta: T,
    #[signal(BODY_ROLL)]
    phi: T,
    #[signal(WHEEL_HEIGHT)]
    z_w: SixWheels<T>,
    #[signal(BODY_HEAVE_RATE)]
    zd: T,
    #[signal(BODY_PITCH_RATE)]
    thetad: T,
    #[signal(BODY_ROLL_RATE)]
    phid: T,
    #[signal(WHEEL_VELOCITY)]
    zd_w: SixWheels<T>,
    #[signal(VEHICLE_LATERAL_VELOCITY)]
    v: T,
    #[signal(VEHICLE_YAW_RATE)]
    r: T,
    #[signal(VEHICLE_YAW)]
    psi: T,
    #[signal(VEHICLE_POSITION_X)]
    x: T,
    #[signal(VEHICLE_POSITION_Y)]
    y: T,
}

/// Outputs that are not states.
#[derive(Outputs, Clone, Debug)]
pub struct Y<T> {
    #[signal(VEHICLE_SPEED)]
    u: T,
    #[signal(VEHICLE_SIDESLIP)]
    beta: T,
    #[signal(VEHICLE_YAW_ACCELERATION)]
    rd: T,
    #[signal(VEHICLE_LATERAL_ACCELERATION)]
    a_y: T,
    #[signal(VEHICLE_LOAD_TRANSFER_RATIO)]
    ltr: T,
    #[signal(BODY_HEAVE_ACCELERATION)]
    zdd: T,
    #[signal(BODY_PITCH_ACCELERATION)]
    thetadd: T,
    #[signal(BODY_ROLL_ACCELERATION)]
    phidd: T,
    #[signal(SUSPENSION_DEFLECTION)]
    d: SixWheels<T>,
    #[signal(SUSPENSION_VELOCITY)]
    dd: SixWheels<T>,
    #[signal(TIRE_DEFLECTION)]
    t: SixWheels<T>,
    #[signal(TIRE_LOAD)]
    n: SixWheels<T>,
    #[signal(TIRE_SLIP_ANGLE)]
    alpha: SixWheels<T>,
    #[signal(TIRE_LATERAL_FORCE)]
    f_y: SixWheels<T>,
}

/// What follows from geometry and masses.
#[derive(Design, Clone, Debug)]
pub struct D {
    /// Sprung mass
    #[calculated("body.mass", unit = KG)]
    m_s: f64,
    /// Static tire load
    #[calculated("tire.static_load", unit = N, display = "kN")]
    fz0: SixWheels<f64>,
    /// Longitudinal and lateral position of each wheel, m.
    x: [f64; 6],
    y: [f64; 6],
    /// Inverse of the mass matrix of (vd, phidd, rd).
    inverse: [[f64; 3]; 3],
}

/// Three-axle emergency rescue vehicle: heave, pitch, roll, six wheels, lateral and yaw motion at a prescribed speed
#[model(stop_time = 20.0, step_size = 0.001)]
impl Plant for RescueVehicle {
    type Parameters = P;
    type Design = D;
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn design(p: &P) -> Result<D, String> {
        equations::design(p)
    }
    fn derivatives<T: Scalar>(p: &P, d: &D, x: &X<T>, u: &U<T>) -> X<T> {
        equations::derivatives(p, d, x, u)
    }
    fn outputs<T: Scalar>(p: &P, d: &D, x: &X<T>, u: &U<T>) -> Y<T> {
        equations::outputs(p, d, x, u)
    }
}

fmi2::export!(plant RescueVehicle);
