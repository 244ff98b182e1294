//! `SemiActiveFuzzySuspension`: adjustable dampers reduce heave, pitch and roll of a heavy truck, controlled by three
//! PID controllers whose gains follow fuzzy rules.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, section 3.

mod equations;
#[cfg(test)]
mod tests;

use chassis_control::fuzzy_pid::{FuzzyPid, Rules};
use chassis_vehicle::data::heavy_vehicle as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Constraint of the actuators.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// any force: fully active
    Active = 0,
    /// the command alone dissipates power
    Command = 1,
    /// damper and command together act as a damper within its limits; the command can soften it
    Damper = 2,
}

fmu::named_array! {
    /// The three motions of the body.
    pub Motions[3] {
        heave: "heave",
        pitch: "pitch",
        roll: "roll",
    }
}

fmu::named_array! {
    /// The two rotations of the body.
    pub Rotations[2] {
        pitch: "pitch",
        roll: "roll",
    }
}

/// Parameters. Except for the vehicle data, all values are assumed; the paper prints none.
#[derive(Parameters, Clone, Debug)]
pub struct SemiActiveFuzzySuspension {
    /// Capability of the actuators
    #[var("constraint", start = Constraint::Damper)]
    constraint: Constraint,
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    l1: f64,
    #[var(CG_TO_REAR_SUSPENSION, start = data::CG_TO_REAR_SUSPENSION)]
    l2: f64,
    /// sum of the plant's half tracks
    #[var(TRACK, start = 2.0 * data::HALF_TRACK)]
    b: f64,
    /// c_0: the damping that the plant applies without command
    #[var(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    c_0: TwoAxles<f64>,
    /// Smallest damping of one damper
    #[var("damper.minimum_damping", unit = "N.s/m", start = [3000.0, 4000.0], min = 0.0, display = "kN.s/m")]
    c_min: TwoAxles<f64>,
    /// Largest damping of one damper
    #[var("damper.maximum_damping", unit = "N.s/m", start = [40_000.0, 80_000.0], min = 0.0, display = "kN.s/m")]
    c_max: TwoAxles<f64>,
    /// Force limit of one strut
    #[var("actuator.force_limit", unit = "N", start = 30_000.0, min = 0.0, tunable, display = "kN")]
    force_limit: f64,
    /// Share of the front struts in the roll moment
    #[var("allocation.front_roll_share", unit = "1", start = 0.3, min = 0.0, max = 1.0, tunable)]
    eps: f64,
    /// Rules for the gains
    #[var("fuzzy.rule_table", start = Rules::Mirrored)]
    rule_table: Rules,
    /// Rate of heave at the edge of the rules' domain
    #[var("fuzzy.error_range.heave", unit = "m/s", start = 0.15, positive, tunable)]
    error_range_heave: f64,
    /// Rate of the rotation at the edge of the rules' domain
    #[var("fuzzy.error_range", unit = "rad/s", start = 0.1, positive, tunable, display = "deg/s")]
    error_range: Rotations<f64>,
    /// Acceleration of heave at the edge of the rules' domain
    #[var("fuzzy.rate_range.heave", unit = "m/s2", start = 3.0, positive, tunable)]
    rate_range_heave: f64,
    /// Acceleration of the rotation at the edge of the rules' domain
    #[var("fuzzy.rate_range", unit = "rad/s2", start = [1.5, 1.0], positive, tunable, display = "deg/s2")]
    rate_range: Rotations<f64>,
    /// kp: force per velocity before the fuzzy correction; raise it to damp heave
    #[var("pid.proportional_gain.heave", unit = "N.s/m", start = 60_000.0, min = 0.0, tunable)]
    kp_heave: f64,
    /// kp: moment per rate before the fuzzy correction; raise it to damp the rotation
    #[var("pid.proportional_gain", unit = "N.m.s/rad", start = [250_000.0, 60_000.0], min = 0.0, tunable)]
    kp: Rotations<f64>,
    /// ki: force per height before the fuzzy correction
    #[var("pid.integral_gain.heave", unit = "N/m", start = 30_000.0, min = 0.0, tunable)]
    ki_heave: f64,
    /// ki: moment per angle before the fuzzy correction
    #[var("pid.integral_gain", unit = "N.m/rad", start = [100_000.0, 30_000.0], min = 0.0, tunable)]
    ki: Rotations<f64>,
    /// kd: force per acceleration before the fuzzy correction
    #[var("pid.derivative_gain.heave", unit = "kg", start = 1500.0, min = 0.0, tunable)]
    kd_heave: f64,
    /// kd: moment per acceleration before the fuzzy correction
    #[var("pid.derivative_gain", unit = "N.m.s2/rad", start = [6000.0, 1500.0], min = 0.0, tunable)]
    kd: Rotations<f64>,
    /// Change of the proportional gain per unit of the rules' output, which is between -3 and 3
    #[var("fuzzy.proportional_scale.heave", unit = "N.s/m", start = 10_000.0, min = 0.0, tunable)]
    kp_scale_heave: f64,
    /// Change of the proportional gain per unit of the rules' output, which is between -3 and 3
    #[var("fuzzy.proportional_scale", unit = "N.m.s/rad", start = [40_000.0, 10_000.0], min = 0.0, tunable)]
    kp_scale: Rotations<f64>,
    /// Change of the integral gain per unit of the rules' output
    #[var("fuzzy.integral_scale.heave", unit = "N/m", start = 5000.0, min = 0.0, tunable)]
    ki_scale_heave: f64,
    /// Change of the integral gain per unit of the rules' output
    #[var("fuzzy.integral_scale", unit = "N.m/rad", start = [20_000.0, 5000.0], min = 0.0, tunable)]
    ki_scale: Rotations<f64>,
    /// Change of the derivative gain per unit of the rules' output
    #[var("fuzzy.derivative_scale.heave", unit = "kg", start = 300.0, min = 0.0, tunable)]
    kd_scale_heave: f64,
    /// Change of the derivative gain per unit of the rules' output
    #[var("fuzzy.derivative_scale", unit = "N.m.s2/rad", start = [1200.0, 300.0], min = 0.0, tunable)]
    kd_scale: Rotations<f64>,
    /// Smallest heave force
    #[var("pid.output_minimum.heave", unit = "N", start = -60_000.0, max = 0.0, tunable, display = "kN")]
    output_minimum_heave: f64,
    /// Smallest moment
    #[var("pid.output_minimum", unit = "N.m", start = [-150_000.0, -40_000.0], max = 0.0, tunable, display = "kN.m")]
    output_minimum: Rotations<f64>,
    /// Largest heave force
    #[var("pid.output_maximum.heave", unit = "N", start = 60_000.0, min = 0.0, tunable, display = "kN")]
    output_maximum_heave: f64,
    /// Largest moment
    #[var("pid.output_maximum", unit = "N.m", start = [150_000.0, 40_000.0], min = 0.0, tunable, display = "kN.m")]
    output_maximum: Rotations<f64>,
    /// Largest magnitude of the integral part of the heave force
    #[var("pid.integral_limit.heave", unit = "N", start = 10_000.0, min = 0.0, tunable, display = "kN")]
    integral_limit_heave: f64,
    /// Largest magnitude of the integral part of the moment
    #[var("pid.integral_limit", unit = "N.m", start = [30_000.0, 10_000.0], min = 0.0, tunable, display = "kN.m")]
    integral_limit: Rotations<f64>,
    /// Rate at which the integral part decays, so the body is not held at an angle
    #[var("pid.leak_rate", unit = "1/s", start = 1.0, min = 0.0, tunable)]
    leak_rate: Motions<f64>,
    /// T
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Motion of the body, and of the struts; `rl`, `rr` are on the walking beams.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(BODY_HEAVE_RATE)]
    zd: f64,
    #[var(BODY_PITCH_RATE)]
    thetad: f64,
    #[var(BODY_ROLL_RATE)]
    phid: f64,
    #[var(BODY_HEAVE_ACCELERATION)]
    zdd: f64,
    #[var(BODY_PITCH_ACCELERATION)]
    thetadd: f64,
    #[var(BODY_ROLL_ACCELERATION)]
    phidd: f64,
    #[var(SUSPENSION_VELOCITY)]
    v: Struts<f64>,
}

/// Forces, and the demands of the PIDs before allocation and limits.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(SUSPENSION_FORCE)]
    f: Struts<f64>,
    #[var(DEMAND_HEAVE_FORCE)]
    f_h: f64,
    #[var(DEMAND_PITCH_MOMENT)]
    m_p: f64,
    #[var(DEMAND_ROLL_MOMENT)]
    m_r: f64,
}

/// Integral parts of heave, pitch and roll.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    i: [f64; 3],
}

/// The rules, tabulated.
#[derive(Derived, Clone, Debug)]
pub struct D {
    pid: FuzzyPid,
}

/// Forces of adjustable dampers against heave, pitch and roll of a heavy truck, from three fuzzy PIDs
#[fmu::model(stop_time = 13.0, step_size = 0.001)]
impl Discrete for SemiActiveFuzzySuspension {
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
