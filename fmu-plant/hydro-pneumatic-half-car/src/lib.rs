//! `HydroPneumaticHalfCar`: a rescue vehicle with adjustable hydro-pneumatic suspension as a half car seen from the
//! front on a bicycle model with load-dependent tires, at a prescribed speed.
//!
//! Applied Sciences 2020, 10, 1852 (switch control between two sliding modes), eqs. 1-7 with the corrections that the
//! README lists.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::arithmetic::Divisor;
use chassis_vehicle::data::hydro_pneumatic_half_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct HydroPneumaticHalfCar {
    /// paper, Table 1
    #[var(BODY_MASS, start = data::BODY_MASS)]
    m_s: f64,
    /// paper, Table 1
    #[var(WHEEL_MASS_SIDE, start = data::WHEEL_MASS)]
    m_u: f64,
    /// paper, Table 1
    #[var(TRACK, start = data::TRACK)]
    t: f64,
    /// paper, Table 1
    #[var(SUSPENSION_STIFFNESS_SIDE, start = data::SUSPENSION_STIFFNESS)]
    k_s: f64,
    /// paper, Table 1
    #[var(SUSPENSION_DAMPING_SIDE, start = data::SUSPENSION_DAMPING)]
    c_s: f64,
    /// paper, Table 1
    #[var(TIRE_STIFFNESS_SIDE, start = data::TIRE_STIFFNESS)]
    k_t: f64,
    /// paper, Table 1
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    /// paper, Table 1
    #[var(BODY_ROLL_AXIS_INERTIA, start = data::ROLL_AXIS_INERTIA)]
    i_x: f64,
    /// paper, Table 1
    #[var(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h: f64,
    /// paper, Table 1, where it is called the height of the center of mass
    #[var(ROLL_CENTER_HEIGHT, start = data::ROLL_CENTER_HEIGHT)]
    h_r: f64,
    /// paper, Table 1
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    l_f: f64,
    /// paper, Table 1
    #[var(CG_TO_REAR_AXLE, start = data::CG_TO_REAR)]
    l_r: f64,
    /// Factor on the peak of the lateral tire force; the slope at the origin does not change (1: textbook tire)
    #[var("tire.peak_scale", unit = "1", start = 1.0, min = 0.0)]
    mu: f64,
    /// A tire cannot pull on the road; if false, tire springs are linear as in the paper
    #[var("tire.lift_off", start = true)]
    lift_off: bool,
    /// c: share of the roll acceleration that acts on the lateral motion (0: paper, 1: coupled)
    #[var("model.roll_lateral_coupling", unit = "1", start = 0.0, min = 0.0, max = 1.0)]
    c: f64,
    /// Share of the lateral force that goes through the roll center directly to the wheels (1: consistent with the load
    /// transfer of eq. 7, 0: eq. 5 as printed)
    #[var("model.geometric_load_transfer", unit = "1", start = 1.0, min = 0.0, max = 1.0)]
    geometric: f64,
    /// standard value, rounded
    #[var(GRAVITY, start = data::GRAVITY, positive)]
    g: f64,
    /// Runge-Kutta of order 4; relative error 3e-9 in smooth runs, 2e-6 where wheels lift off
    #[var(MAX_STEP, start = 0.00025)]
    max_step: f64,
}

/// Inputs.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[var(DRIVER_SPEED, start = data::SPEED)]
    v: T,
    #[var(STEER)]
    delta: FrontAxle<T>,
    #[var(SUSPENSION_FORCE)]
    f: Sides<T>,
    #[var(ROAD_HEIGHT)]
    z_q: Sides<T>,
    #[var(ROAD_FRICTION, start = 1.0)]
    friction: Sides<T>,
}

/// State: positions, then rates, then the motion in the road plane.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[var(BODY_HEAVE)]
    z_s: T,
    #[var(BODY_ROLL)]
    phi: T,
    #[var(WHEEL_HEIGHT)]
    z_u: Sides<T>,
    #[var(BODY_HEAVE_RATE)]
    zd_s: T,
    #[var(BODY_ROLL_RATE)]
    phid: T,
    #[var(WHEEL_VELOCITY)]
    zd_u: Sides<T>,
    #[var(VEHICLE_SIDESLIP)]
    beta: T,
    #[var(VEHICLE_YAW_RATE)]
    gamma: T,
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
    v: T,
    #[var(VEHICLE_YAW_ACCELERATION)]
    gammad: T,
    #[var(VEHICLE_LATERAL_ACCELERATION)]
    a_y: T,
    #[var(VEHICLE_LOAD_TRANSFER_ESTIMATE)]
    ltr: T,
    #[var(VEHICLE_LOAD_TRANSFER_RATIO)]
    ratio: T,
    #[var(BODY_HEAVE_ACCELERATION)]
    zdd_s: T,
    #[var(BODY_ROLL_ACCELERATION)]
    phidd: T,
    #[var(SUSPENSION_DEFLECTION)]
    d_s: Sides<T>,
    #[var(SUSPENSION_VELOCITY)]
    dd_s: Sides<T>,
    #[var(TIRE_DEFLECTION)]
    d_t: Sides<T>,
    #[var(TIRE_LOAD)]
    n: Sides<T>,
    #[var(TIRE_SLIP_ANGLE)]
    alpha: TwoAxles<T>,
    #[var(TIRE_LATERAL_FORCE)]
    f_y: FourWheels<T>,
}

/// Parameters derived from geometry and masses.
#[derive(Derived, Clone, Debug)]
pub struct D {
    /// Mass of the whole vehicle
    #[var("vehicle.mass", unit = "kg")]
    m: f64,
    /// Tire load of one side at rest, front and rear tire together
    #[var("tire.static_load.side", unit = "N", display = "kN")]
    n0: f64,
    /// Share of a tire in the load of its side.
    share: [f64; 4],
    t: Divisor,
    m_s: Divisor,
    m_u: Divisor,
    i_x: Divisor,
    i_z: Divisor,
    /// Mass that the lateral force accelerates while the body rolls: m - c (m_s h)^2/I_x.
    m_y: Divisor,
}

/// Rescue vehicle with hydro-pneumatic suspension: half car (heave, roll, wheels) on a bicycle model (sideslip, yaw)
/// at a prescribed speed
#[fmu::model(stop_time = 10.0, step_size = 0.001)]
impl Continuous for HydroPneumaticHalfCar {
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
