//! `HeavyVehicle`: a three-axle heavy truck with walking beams at its rear axles, at a prescribed speed. Tire loads
//! couple the vertical and the lateral motion; either can also run alone.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, eqs. 1-11 with the corrections that the README lists.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::arithmetic::Divisor;
use chassis_vehicle::data::heavy_vehicle as data;
use chassis_vehicle::prelude::*;
use chassis_vehicle::tire::MagicFormula;
use fmu::prelude::*;

/// Simulated motions, and their coupling.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coupling {
    /// vertical and lateral motion, coupled by tire loads and roll
    Coupled = 0,
    /// vertical motion alone: steering has no effect
    VerticalOnly = 1,
    /// lateral motion alone, with roll and quasi-static axles: the road has no effect
    LateralOnly = 2,
}

/// Symbols as in the equations of the README.
#[derive(Parameters, Clone, Debug)]
pub struct HeavyVehicle {
    /// Simulated motions
    #[var("coupling", start = Coupling::Coupled)]
    coupling: Coupling,
    /// assumed: truck of the 25 t class
    #[var(BODY_MASS, start = data::BODY_MASS)]
    m_b: f64,
    /// calibrated
    #[var(BODY_ROLL_INERTIA, start = data::ROLL_INERTIA)]
    i_x: f64,
    /// calibrated
    #[var(BODY_PITCH_INERTIA, start = data::PITCH_INERTIA)]
    i_y: f64,
    /// assumed: about m l1 l2
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    /// assumed: small
    #[var(BODY_ROLL_YAW_INERTIA, start = data::ROLL_YAW_INERTIA)]
    i_xz: f64,
    /// dual wheels together, without the beam; assumed
    #[var(WHEEL_MASS, start = data::WHEEL_MASS)]
    m_t: ThreeAxles<f64>,
    /// assumed
    #[var(BEAM_MASS, start = data::BEAM_MASS)]
    m_beam: f64,
    /// assumed
    #[var(BEAM_PITCH_INERTIA, start = data::BEAM_PITCH_INERTIA)]
    i_beam: f64,
    /// assumed: 7 % of critical damping of the beam's pitch
    #[var(BEAM_PITCH_DAMPING, start = data::BEAM_PITCH_DAMPING)]
    c_b: f64,
    /// assumed
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    l1: f64,
    /// assumed: 28 % of the load in front
    #[var(CG_TO_REAR_SUSPENSION, start = data::CG_TO_REAR_SUSPENSION)]
    l2: f64,
    /// assumed: usual tandem spacing
    #[var(MIDDLE_TO_REAR_AXLE, start = data::MIDDLE_TO_REAR)]
    l3: f64,
    /// assumed
    #[var(HALF_TRACK_LEFT, start = data::HALF_TRACK)]
    b1: f64,
    /// assumed
    #[var(HALF_TRACK_RIGHT, start = data::HALF_TRACK)]
    b2: f64,
    /// calibrated
    #[var(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h: f64,
    /// calibrated
    #[var(ROLL_CENTER_HEIGHT, start = data::ROLL_CENTER_HEIGHT)]
    h_rc: f64,
    /// assumed: radius of a 12R20 tire
    #[var(WHEEL_CENTER_HEIGHT, start = data::WHEEL_CENTER_HEIGHT)]
    h_u: f64,
    /// calibrated; in the rear, one strut per side carries both axles
    #[var(SUSPENSION_STIFFNESS, start = data::SUSPENSION_STIFFNESS)]
    k: TwoAxles<f64>,
    /// calibrated; in the rear, one strut per side carries both axles
    #[var(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    c: TwoAxles<f64>,
    /// assumed: springs alone
    #[var(ANTI_ROLL_BAR_STIFFNESS, start = 0.0)]
    k_a: TwoAxles<f64>,
    /// all tires of a wheel position together; assumed: dual tires on the middle and rear axle
    #[var(TIRE_STIFFNESS, start = data::TIRE_STIFFNESS)]
    k_t: ThreeAxles<f64>,
    /// Tires of one wheel position; assumed: dual tires on the middle and rear axle
    #[var("tire.count", unit = "1", start = data::TIRE_COUNT, min = 1.0)]
    n: ThreeAxles<f64>,
    /// Load on the truck tire divided by the load on the car tire of the magic formula; forces have the same ratio
    /// (assumed)
    #[var("tire.load_scale", unit = "1", start = data::TIRE_LOAD_SCALE, positive)]
    lambda: f64,
    /// assumed: dry road
    #[var(TIRE_FORCE_SCALE, start = 1.0, tunable)]
    mu: f64,
    /// Greatest load in the magic formula, after scaling; the peak force decreases above 22.87 kN
    #[var("tire.fit_load_limit", unit = "kN", start = 22.0, positive)]
    f_max: f64,
    /// used in slip and sideslip angles
    #[var(MINIMUM_SPEED, start = data::MINIMUM_SPEED)]
    u_min: f64,
    /// C (paper, eq. 9)
    #[var("magic_formula.shape", unit = "1", start = MagicFormula::PASSENGER_CAR.c, positive)]
    c_mf: f64,
    /// a1: peak per squared load (paper, Table 1)
    #[var("magic_formula.peak_quadratic", unit = "N/kN2", start = MagicFormula::PASSENGER_CAR.a[0])]
    a1: f64,
    /// a2: peak per load (paper, Table 1)
    #[var("magic_formula.peak_linear", unit = "N/kN", start = MagicFormula::PASSENGER_CAR.a[1])]
    a2: f64,
    /// a3: greatest cornering stiffness (paper, Table 1)
    #[var("magic_formula.stiffness_maximum", unit = "N/deg", start = MagicFormula::PASSENGER_CAR.a[2])]
    a3: f64,
    /// a4: load dependence of the cornering stiffness (paper, Table 1)
    #[var("magic_formula.stiffness_shape", unit = "1", start = MagicFormula::PASSENGER_CAR.a[3])]
    a4: f64,
    /// a5: growth of the cornering stiffness with the load (paper, Table 1)
    #[var("magic_formula.stiffness_load_slope", unit = "1/kN", start = MagicFormula::PASSENGER_CAR.a[4])]
    a5: f64,
    /// a6: curvature per squared load (paper, Table 1)
    #[var("magic_formula.curvature_quadratic", unit = "1/kN2", start = MagicFormula::PASSENGER_CAR.a[5])]
    a6: f64,
    /// a7: curvature per load (paper, Table 1)
    #[var("magic_formula.curvature_linear", unit = "1/kN", start = MagicFormula::PASSENGER_CAR.a[6])]
    a7: f64,
    /// a8: curvature without load (paper, Table 1)
    #[var("magic_formula.curvature_constant", unit = "1", start = MagicFormula::PASSENGER_CAR.a[7])]
    a8: f64,
    /// standard value, rounded
    #[var(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Runge-Kutta of order 4; the fastest mode has 12 Hz
    #[var(MAX_STEP, start = 0.00025)]
    max_step: f64,
}

/// Inputs. The struts `rl` and `rr` are on the walking beams.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[var(DRIVER_SPEED, start = data::SPEED)]
    u: T,
    #[var(STEER)]
    delta: ThreeAxles<T>,
    #[var(SUSPENSION_FORCE)]
    f: Struts<T>,
    #[var(ROAD_HEIGHT)]
    q: SixWheels<T>,
    #[var(ROAD_FRICTION, start = 1.0)]
    friction: SixWheels<T>,
}

/// State: positions, then rates, then the motion in the road plane. The heights of the wheels and beams are states of
/// the vertical model only, because the axles of the lateral model have no mass. These states are therefore local
/// variables, and both models compute the heights that importers see as outputs.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[var(BODY_HEAVE)]
    z: T,
    #[var(BODY_PITCH)]
    theta: T,
    #[var(BODY_ROLL)]
    phi: T,
    /// Height of the unsprung mass in the vertical motion
    #[var("state.wheel_height", unit = "m", nominal = 0.02, local)]
    z_f: FrontWheels<T>,
    /// Height of the trunnion of the walking beam in the vertical motion
    #[var("state.beam_height", unit = "m", nominal = 0.02, local)]
    z_b: Sides<T>,
    #[var(BEAM_PITCH)]
    th_b: Sides<T>,
    #[var(BODY_HEAVE_RATE)]
    zd: T,
    #[var(BODY_PITCH_RATE)]
    thetad: T,
    #[var(BODY_ROLL_RATE)]
    phid: T,
    /// Rate of the height of the unsprung mass in the vertical motion
    #[var("state.wheel_velocity", unit = "m/s", nominal = 0.5, local)]
    zd_f: FrontWheels<T>,
    /// Rate of the height of the trunnion in the vertical motion
    #[var("state.beam_velocity", unit = "m/s", nominal = 0.2, local)]
    zd_b: Sides<T>,
    #[var(BEAM_PITCH_RATE)]
    thd_b: Sides<T>,
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
    #[var(WHEEL_HEIGHT)]
    z_w: SixWheels<T>,
    #[var(WHEEL_VELOCITY)]
    zd_w: SixWheels<T>,
    #[var(BEAM_HEIGHT)]
    z_b: Sides<T>,
    #[var(SUSPENSION_DEFLECTION)]
    d_s: Struts<T>,
    #[var(SUSPENSION_VELOCITY)]
    dd_s: Struts<T>,
    #[var(TIRE_DEFLECTION)]
    d_t: SixWheels<T>,
    #[var(TIRE_LOAD)]
    f_z: SixWheels<T>,
    #[var(TIRE_SLIP_ANGLE)]
    alpha: SixWheels<T>,
    #[var(TIRE_LATERAL_FORCE)]
    f_y: SixWheels<T>,
}

/// Parameters derived from geometry, masses and tires.
#[derive(Derived, Clone, Debug)]
pub struct D {
    /// Mass of the whole vehicle
    #[var("vehicle.mass", unit = "kg")]
    m: f64,
    /// Static tire load
    #[var("tire.static_load", unit = "N", display = "kN")]
    f0: SixWheels<f64>,
    /// Unsprung mass of each axle, including its half of the beams, kg.
    m_u: [f64; 3],
    /// Position of each axle in front of the center of mass, and of the front struts and the beams, m.
    x: [f64; 3],
    x_s: [f64; 2],
    /// Positions of the left and the right side, as distances to the left of the center of mass, and the distance
    /// between the sides, m.
    y: [f64; 2],
    b: f64,
    /// Lateral model, front and rear: roll stiffness of springs and bar and of the tires in N m/rad, and the share of
    /// the roll angle that a spring takes.
    k_s: [f64; 2],
    k_tire: [f64; 2],
    kappa: [f64; 2],
    /// Inverse of the mass matrix of (vd, rd, phidd).
    inverse: [[f64; 3]; 3],
    /// n lambda: load on a wheel position relative to the car tire of the magic formula, as a factor and as a divisor.
    share: [f64; 6],
    load_scale: [Divisor; 6],
    /// Distance between the sides.
    track: Divisor,
    m_b: Divisor,
    i_y: Divisor,
    /// Mass of a front wheel.
    m_t: Divisor,
    /// Mass and pitch inertia of a beam with its wheels.
    m_bw: Divisor,
    j_bw: Divisor,
    magic: MagicFormula,
}

/// Three-axle heavy truck with walking-beam suspension: heave, pitch, roll, front wheels, beams, lateral and yaw motion at
/// a prescribed speed
#[fmu::model(stop_time = 13.0, step_size = 0.001)]
impl Continuous for HeavyVehicle {
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
