//! `EspCar`: a two-axle car with 14 degrees of freedom (motion in the plane, heave, roll and pitch of the body, height
//! and rotation of four wheels).
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", eqs. 1-7, 11 and 13 with the corrections that the README lists.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::arithmetic::Divisor;
use chassis_vehicle::data::esp_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// The symbols are those of the paper, if it has a symbol for the parameter.
#[derive(Parameters, Clone, Debug)]
pub struct EspCar {
    /// m_s (paper, Table 6)
    #[var(BODY_MASS, start = data::BODY_MASS)]
    m_s: f64,
    /// m_u (paper, Table 6)
    #[var(WHEEL_MASS, start = data::WHEEL_MASS)]
    m_u: TwoAxles<f64>,
    /// a (paper, Table 6)
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    a: f64,
    /// b (paper, Table 6)
    #[var(CG_TO_REAR_AXLE, start = data::CG_TO_REAR)]
    b: f64,
    /// paper, Table 6, where it is called wheelbase
    #[var(TRACK, start = data::TRACK)]
    track: f64,
    /// h (paper, Table 6)
    #[var(CG_HEIGHT, start = data::CG_HEIGHT)]
    h: f64,
    /// H (paper, Table 6), also over the pitch axis
    #[var(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h_b: f64,
    /// h_u (assumed: radius of the wheels)
    #[var(WHEEL_CENTER_HEIGHT, start = data::WHEEL_CENTER_HEIGHT)]
    h_u: f64,
    /// I_x (paper, Table 6)
    #[var(BODY_ROLL_INERTIA, start = data::ROLL_INERTIA)]
    i_x: f64,
    /// I_y (paper, Table 6)
    #[var(BODY_PITCH_INERTIA, start = data::PITCH_INERTIA)]
    i_y: f64,
    /// I_z (paper, Table 6)
    #[var(BODY_YAW_INERTIA, start = data::BODY_YAW_INERTIA)]
    i_z: f64,
    /// k_s (paper, Table 6)
    #[var(SUSPENSION_STIFFNESS, start = data::SUSPENSION_STIFFNESS)]
    k_s: TwoAxles<f64>,
    /// c_s (paper, Table 6)
    #[var(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    c_s: TwoAxles<f64>,
    /// k_a (paper, Table 6)
    #[var(ANTI_ROLL_BAR_STIFFNESS, start = data::ANTI_ROLL_BAR)]
    k_a: TwoAxles<f64>,
    /// k_t (paper, Table 6)
    #[var(TIRE_STIFFNESS, start = data::TIRE_STIFFNESS)]
    k_t: f64,
    /// R (assumed)
    #[var(WHEEL_RADIUS, start = data::RADIUS)]
    radius: f64,
    /// J_w (assumed)
    #[var(WHEEL_SPIN_INERTIA, start = data::SPIN_INERTIA)]
    j_w: f64,
    /// C_alpha at the load at rest (assumed)
    #[var(TIRE_CORNERING_STIFFNESS, start = data::CORNERING_STIFFNESS)]
    c_alpha: TwoAxles<f64>,
    /// C_kappa: longitudinal force of one tire per slip at the load at rest (assumed)
    #[var("tire.slip_stiffness", unit = "N", start = data::SLIP_STIFFNESS, positive, display = "kN")]
    c_kappa: TwoAxles<f64>,
    /// q: loss of stiffness with the load; the stiffness is greatest at (1 + q)/(2 q) times the load at rest (assumed)
    #[var("tire.load_dependence", unit = "1", start = 0.2, min = 0.0, max = 0.5)]
    q: f64,
    /// mu_0 at rest (calibrated to a braking distance in Table 7)
    #[var(TIRE_FRICTION, start = data::FRICTION, tunable)]
    mu_0: f64,
    /// A_s: loss of friction per sliding speed (assumed)
    #[var("tire.friction_reduction", unit = "s/m", start = 0.015, min = 0.0, tunable)]
    a_s: f64,
    /// Least friction of a sliding tire, relative to the friction at rest (assumed)
    #[var("tire.friction_floor", unit = "1", start = 0.2, min = 0.0, max = 1.0, tunable)]
    mu_floor: f64,
    /// v_eps: speed below which slips are smoothed
    #[var("numerics.speed_smoothing", unit = "m/s", start = 0.5, positive)]
    v_eps: f64,
    /// w_eps: wheel speed below which the brake torque is smoothed
    #[var("numerics.spin_smoothing", unit = "rad/s", start = 0.5, positive)]
    w_eps: f64,
    /// standard value, rounded
    #[var(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Initial longitudinal speed; the wheels roll
    #[var("vehicle.initial_speed", unit = "m/s", start = data::SPEED, min = 0.0, display = "km/h")]
    u_0: f64,
    /// Initial slip: relative difference between the wheel speed and the speed of a wheel that rolls straight ahead
    #[var("wheel.initial_slip", unit = "1", start = 0.0)]
    s_0: FourWheels<f64>,
    /// Runge-Kutta of order 4
    #[var(MAX_STEP, start = 0.0001)]
    max_step: f64,
}

/// Inputs.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[var(STEER)]
    delta: FrontAxle<T>,
    #[var(ROAD_HEIGHT)]
    z_r: FourWheels<T>,
    #[var(ROAD_FRICTION, start = 1.0)]
    friction: FourWheels<T>,
    #[var(SUSPENSION_FORCE)]
    f: FourWheels<T>,
    #[var(BRAKE_TORQUE)]
    t_b: FourWheels<T>,
    #[var(DRIVE_TORQUE)]
    t_d: FourWheels<T>,
}

/// State: position and motion in the road plane, body, wheels.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[var(VEHICLE_POSITION_X)]
    x: T,
    #[var(VEHICLE_POSITION_Y)]
    y: T,
    #[var(VEHICLE_YAW)]
    psi: T,
    #[var(VEHICLE_SPEED, calculated)]
    u: T,
    #[var(VEHICLE_LATERAL_VELOCITY)]
    v: T,
    #[var(VEHICLE_YAW_RATE)]
    r: T,
    #[var(BODY_HEAVE)]
    z: T,
    #[var(BODY_ROLL)]
    phi: T,
    #[var(BODY_PITCH)]
    theta: T,
    #[var(BODY_HEAVE_RATE)]
    zd: T,
    #[var(BODY_ROLL_RATE)]
    phid: T,
    #[var(BODY_PITCH_RATE)]
    thetad: T,
    #[var(WHEEL_HEIGHT)]
    z_u: FourWheels<T>,
    #[var(WHEEL_VELOCITY)]
    zd_u: FourWheels<T>,
    #[var(WHEEL_SPEED, calculated)]
    omega: FourWheels<T>,
}

/// Outputs that are not states.
#[derive(Outputs, Clone, Debug)]
pub struct Y<T> {
    #[var(VEHICLE_LONGITUDINAL_ACCELERATION)]
    a_x: T,
    #[var(VEHICLE_LATERAL_ACCELERATION)]
    a_y: T,
    #[var(VEHICLE_SIDESLIP)]
    beta: T,
    #[var(VEHICLE_YAW_ACCELERATION)]
    rd: T,
    #[var(VEHICLE_LOAD_TRANSFER_RATIO)]
    ltr: T,
    #[var(BODY_HEAVE_ACCELERATION)]
    zdd: T,
    #[var(BODY_ROLL_ACCELERATION)]
    phidd: T,
    #[var(BODY_PITCH_ACCELERATION)]
    thetadd: T,
    #[var(CORNER_ACCELERATION)]
    corner: FourWheels<T>,
    #[var(SUSPENSION_DEFLECTION)]
    d_s: FourWheels<T>,
    #[var(SUSPENSION_VELOCITY)]
    dd_s: FourWheels<T>,
    #[var(TIRE_DEFLECTION)]
    d_t: FourWheels<T>,
    #[var(TIRE_LOAD)]
    f_z: FourWheels<T>,
    #[var(TIRE_LONGITUDINAL_FORCE)]
    f_xw: FourWheels<T>,
    #[var(TIRE_LATERAL_FORCE)]
    f_yw: FourWheels<T>,
    #[var(TIRE_SLIP_ANGLE)]
    alpha: FourWheels<T>,
    #[var(TIRE_LONGITUDINAL_SLIP)]
    s: FourWheels<T>,
}

/// Parameters derived from geometry and masses.
#[derive(Derived, Clone, Debug)]
pub struct D {
    /// Mass of the whole vehicle
    #[var("vehicle.mass", unit = "kg")]
    m: f64,
    /// Yaw inertia of the whole vehicle about its center of mass
    #[var("vehicle.yaw_inertia", unit = "kg.m2")]
    i_vehicle: f64,
    /// Tire load at rest
    #[var("tire.static_load", unit = "N", display = "kN")]
    f_z0: FourWheels<f64>,
    /// m_U: mass of all wheels, kg.
    m_w: f64,
    /// Distance of the body's center of mass ahead of the reference point, m.
    e: f64,
    /// Height of the roll axis, m.
    h_ra: f64,
    /// S_1: moment of the wheels' masses about the reference point, kg m.
    s_1: f64,
    /// Distance of the center of the wheels' masses ahead of the reference point, m.
    x_w: f64,
    /// Longitudinal and lateral position of each wheel, m.
    x: [f64; 4],
    y: [f64; 4],
    /// Moment of inertia of the wheels about the vertical axis through the reference point, kg m2.
    i_w: f64,
    /// F_z0: load of each tire at rest.
    static_load: [Divisor; 4],
    m_s: Divisor,
    m_u: [Divisor; 2],
    j_w: Divisor,
    w_eps: Divisor,
    track: Divisor,
    wheelbase: Divisor,
    /// Inverse mass matrices of (ud, thetadd) and (vd, phidd).
    u_theta: [[f64; 2]; 2],
    v_phi: [[f64; 2]; 2],
}

/// Two-axle car: motion in the plane, heave, roll and pitch of the body, height and rotation of four wheels
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Continuous for EspCar {
    type Derived = D;
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn derived(&self) -> Result<D, String> {
        equations::derived(self)
    }
    fn initialize(&self, _: &D, x: &mut X<f64>) {
        x.u = self.u_0;
        x.omega = FourWheels::from_fn(|i| self.u_0 / self.radius * (1.0 + self.s_0[i]));
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        equations::derivatives(self, at.derived, at.state, at.inputs)
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        equations::outputs(self, at.derived, at.state, at.inputs)
    }
}
