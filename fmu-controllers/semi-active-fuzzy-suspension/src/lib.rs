//! `SemiActiveFuzzySuspension`: adjustable dampers calm heave, pitch and roll of a heavy truck, by three PID controllers
//! whose gains follow fuzzy rules.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, section 3.

mod equations;
#[cfg(test)]
mod tests;

use chassis::data::heavy_vehicle as data;
use chassis::prelude::*;
use control::fuzzy_pid::{FuzzyPid, Rules};
use fmi2::prelude::*;

/// The controller.
pub struct SemiActiveFuzzySuspension;

/// What the actuators can do.
#[derive(Mode, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// any force: fully active
    Active = 0,
    /// the commanded force alone takes power from the suspension
    Command = 1,
    /// damper and command together are a damper with a coefficient within its limits; the command can soften it
    Damper = 2,
}

fmi2::family! {
    /// The three motions of the body.
    pub Motions[3] {
        heave: "heave",
        pitch: "pitch",
        roll: "roll",
    }
}

fmi2::family! {
    /// The two rotations of the body.
    pub Rotations[2] {
        pitch: "pitch",
        roll: "roll",
    }
}

/// Parameters; those that are not the vehicle's are assumed, the paper prints none.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// What the actuators can do
    #[par("constraint", mode, start = Constraint::Damper)]
    constraint: Constraint,
    #[par(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    l1: f64,
    #[par(CG_TO_REAR_SUSPENSION, start = data::CG_TO_REAR_SUSPENSION)]
    l2: f64,
    /// both half tracks of the plant
    #[par(TRACK, start = 2.0 * data::HALF_TRACK)]
    b: f64,
    /// c_0: the damping that the plant applies without command
    #[par(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    c_0: TwoAxles<f64>,
    /// Least damping of one damper
    #[par("damper.minimum_damping", unit = N_S_PER_M, start = [3000.0, 4000.0], min = 0.0, display = "kN.s/m")]
    c_min: TwoAxles<f64>,
    /// Greatest damping of one damper
    #[par("damper.maximum_damping", unit = N_S_PER_M, start = [40_000.0, 80_000.0], min = 0.0, display = "kN.s/m")]
    c_max: TwoAxles<f64>,
    /// Limit of the force of one strut
    #[par("actuator.force_limit", unit = N, start = 30_000.0, min = 0.0, tunable, display = "kN")]
    force_limit: f64,
    /// Share of the front struts in the roll moment
    #[par("allocation.front_roll_share", unit = ONE, start = 0.3, min = 0.0, max = 1.0, tunable)]
    eps: f64,
    /// Rules for the gains
    #[par("fuzzy.rule_table", mode, start = Rules::Mirrored)]
    rule_table: Rules,
    /// Rate of heave at the edge of the rules' domain
    #[par("fuzzy.error_range.heave", unit = M_PER_S, start = 0.15, positive, tunable)]
    error_range_heave: f64,
    /// Rate of the rotation at the edge of the rules' domain
    #[par("fuzzy.error_range", unit = RAD_PER_S, start = 0.1, positive, tunable, display = "deg/s")]
    error_range: Rotations<f64>,
    /// Acceleration of heave at the edge of the rules' domain
    #[par("fuzzy.rate_range.heave", unit = M_PER_S2, start = 3.0, positive, tunable)]
    rate_range_heave: f64,
    /// Acceleration of the rotation at the edge of the rules' domain
    #[par("fuzzy.rate_range", unit = RAD_PER_S2, start = [1.5, 1.0], positive, tunable, display = "deg/s2")]
    rate_range: Rotations<f64>,
    /// kp: force per velocity before the fuzzy correction; raise it to damp heave
    #[par("pid.proportional_gain.heave", unit = N_S_PER_M, start = 60_000.0, min = 0.0, tunable)]
    kp_heave: f64,
    /// kp: moment per rate before the fuzzy correction; raise it to damp the rotation
    #[par("pid.proportional_gain", unit = N_M_S_PER_RAD, start = [250_000.0, 60_000.0], min = 0.0, tunable)]
    kp: Rotations<f64>,
    /// ki: force per height before the fuzzy correction
    #[par("pid.integral_gain.heave", unit = N_PER_M, start = 30_000.0, min = 0.0, tunable)]
    ki_heave: f64,
    /// ki: moment per angle before the fuzzy correction
    #[par("pid.integral_gain", unit = N_M_PER_RAD, start = [100_000.0, 30_000.0], min = 0.0, tunable)]
    ki: Rotations<f64>,
    /// kd: force per acceleration before the fuzzy correction
    #[par("pid.derivative_gain.heave", unit = KG, start = 1500.0, min = 0.0, tunable)]
    kd_heave: f64,
    /// kd: moment per acceleration before the fuzzy correction
    #[par("pid.derivative_gain", unit = N_M_S2_PER_RAD, start = [6000.0, 1500.0], min = 0.0, tunable)]
    kd: Rotations<f64>,
    /// Change of the proportional gain per unit of the rules' output, which is within -3 and 3
    #[par("fuzzy.proportional_scale.heave", unit = N_S_PER_M, start = 10_000.0, min = 0.0, tunable)]
    kp_scale_heave: f64,
    /// Change of the proportional gain per unit of the rules' output, which is within -3 and 3
    #[par("fuzzy.proportional_scale", unit = N_M_S_PER_RAD, start = [40_000.0, 10_000.0], min = 0.0, tunable)]
    kp_scale: Rotations<f64>,
    /// Change of the integral gain per unit of the rules' output
    #[par("fuzzy.integral_scale.heave", unit = N_PER_M, start = 5000.0, min = 0.0, tunable)]
    ki_scale_heave: f64,
    /// Change of the integral gain per unit of the rules' output
    #[par("fuzzy.integral_scale", unit = N_M_PER_RAD, start = [20_000.0, 5000.0], min = 0.0, tunable)]
    ki_scale: Rotations<f64>,
    /// Change of the derivative gain per unit of the rules' output
    #[par("fuzzy.derivative_scale.heave", unit = KG, start = 300.0, min = 0.0, tunable)]
    kd_scale_heave: f64,
    /// Change of the derivative gain per unit of the rules' output
    #[par("fuzzy.derivative_scale", unit = N_M_S2_PER_RAD, start = [1200.0, 300.0], min = 0.0, tunable)]
    kd_scale: Rotations<f64>,
    /// Least heave force
    #[par("pid.output_minimum.heave", unit = N, start = -60_000.0, max = 0.0, tunable, display = "kN")]
    output_minimum_heave: f64,
    /// Least moment
    #[par("pid.output_minimum", unit = N_M, start = [-150_000.0, -40_000.0], max = 0.0, tunable, display = "kN.m")]
    output_minimum: Rotations<f64>,
    /// Greatest heave force
    #[par("pid.output_maximum.heave", unit = N, start = 60_000.0, min = 0.0, tunable, display = "kN")]
    output_maximum_heave: f64,
    /// Greatest moment
    #[par("pid.output_maximum", unit = N_M, start = [150_000.0, 40_000.0], min = 0.0, tunable, display = "kN.m")]
    output_maximum: Rotations<f64>,
    /// Greatest magnitude of the integral part of the heave force
    #[par("pid.integral_limit.heave", unit = N, start = 10_000.0, min = 0.0, tunable, display = "kN")]
    integral_limit_heave: f64,
    /// Greatest magnitude of the integral part of the moment
    #[par("pid.integral_limit", unit = N_M, start = [30_000.0, 10_000.0], min = 0.0, tunable, display = "kN.m")]
    integral_limit: Rotations<f64>,
    /// Rate at which the integral part decays: the vehicle is not held at an angle
    #[par("pid.leak_rate", unit = PER_S, start = 1.0, min = 0.0, tunable)]
    leak_rate: Motions<f64>,
    /// T
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Motion of the body, and of the struts; `rl`, `rr` stand on the balance beams.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(BODY_HEAVE_RATE)]
    zd: f64,
    #[signal(BODY_PITCH_RATE)]
    thetad: f64,
    #[signal(BODY_ROLL_RATE)]
    phid: f64,
    #[signal(BODY_HEAVE_ACCELERATION)]
    zdd: f64,
    #[signal(BODY_PITCH_ACCELERATION)]
    thetadd: f64,
    #[signal(BODY_ROLL_ACCELERATION)]
    phidd: f64,
    #[signal(SUSPENSION_VELOCITY)]
    v: Struts<f64>,
}

/// Forces, and what the PIDs want before the forces are shared out and cut.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(SUSPENSION_FORCE)]
    f: Struts<f64>,
    #[signal(DEMAND_HEAVE_FORCE)]
    f_h: f64,
    #[signal(DEMAND_PITCH_MOMENT)]
    m_p: f64,
    #[signal(DEMAND_ROLL_MOMENT)]
    m_r: f64,
}

/// Integral parts of heave, pitch and roll.
#[derive(Memory, Clone, Debug, Default)]
pub struct X {
    i: [f64; 3],
}

/// The rules, tabulated.
#[derive(Design, Clone, Debug)]
pub struct D {
    pid: FuzzyPid,
}

/// Forces of adjustable dampers against heave, pitch and roll of a heavy truck, by three fuzzy PIDs
#[model(stop_time = 13.0, step_size = 0.001)]
impl Sampled for SemiActiveFuzzySuspension {
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

fmi2::export!(sampled SemiActiveFuzzySuspension);
