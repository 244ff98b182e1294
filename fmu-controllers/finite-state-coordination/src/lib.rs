//! `FiniteStateCoordination`: detects six driving states. For each, it selects the active laws, the gains of the
//! suspension law and the target slip of the antilock logic.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", Tables 1-5 and rules 1-5.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::data::esp_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Control case.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// no control: everything is off
    None = 0,
    /// independent laws: all on, with constant gains and target slip
    Individual = 1,
    /// by driving states
    Coordination = 2,
}

/// Symbols as in the paper, if the paper has a symbol.
#[derive(Parameters, Clone, Debug)]
pub struct FiniteStateCoordination {
    /// Control case
    #[var("strategy", start = Strategy::Coordination)]
    strategy: Strategy,
    /// Time constant of the filter of the accelerations; 0 for none (assumed)
    #[var("filter.time_constant", unit = "s", start = 0.05, min = 0.0, tunable, display = "ms")]
    tau: f64,
    /// Longitudinal acceleration or deceleration above which the car accelerates or brakes (assumed)
    #[var("threshold.longitudinal_acceleration_on", unit = "m/s2", start = 0.5, min = 0.0, tunable)]
    ax_on: f64,
    /// Longitudinal acceleration or deceleration below which accelerating or braking ends (assumed)
    #[var("threshold.longitudinal_acceleration_off", unit = "m/s2", start = 0.3, min = 0.0, tunable)]
    ax_off: f64,
    /// Lateral acceleration above which the car turns (assumed)
    #[var("threshold.lateral_acceleration_on", unit = "m/s2", start = 0.4, min = 0.0, tunable)]
    ay_on: f64,
    /// Lateral acceleration below which turning ends (assumed)
    #[var("threshold.lateral_acceleration_off", unit = "m/s2", start = 0.25, min = 0.0, tunable)]
    ay_off: f64,
    /// Position of the brake pedal above which the driver brakes (assumed)
    #[var("threshold.brake_pedal", unit = "1", start = 0.05, tunable)]
    brake_on: f64,
    /// K_p of the suspension law at all wheels where no rule changes it (assumed: 20 % of the mass above a wheel)
    #[var("base_gain.proportional", unit = "kg", start = 60.0, tunable)]
    k_p0: f64,
    /// K_i of the suspension law at all wheels where no table changes it (paper, middle columns of Tables 2-5)
    #[var("base_gain.integral", unit = "kg", start = 0.8, tunable)]
    k_i0: f64,
    /// K_d of the suspension law at all wheels where no table changes it (paper, middle columns of Tables 2-5)
    #[var("base_gain.derivative", unit = "kg", start = 3.0, tunable)]
    k_d0: f64,
    /// sigma_1: K_p at the axle that sinks (assumed: 1.5 times the base)
    #[var("pitch_rule.large_gain", unit = "kg", start = 90.0, tunable)]
    sigma_1: f64,
    /// sigma_2: K_p at the axle that rises (assumed: 1.25 times the base)
    #[var("pitch_rule.small_gain", unit = "kg", start = 75.0, tunable)]
    sigma_2: f64,
    /// alpha_1: pitch rate above which the rule acts (assumed)
    #[var("pitch_rule.rate_threshold", unit = "rad/s", start = 0.01, min = 0.0, tunable)]
    alpha_1: f64,
    /// alpha_2: pitch acceleration above which the rule acts (assumed: a third of the paper's RMS without control)
    #[var("pitch_rule.acceleration_threshold", unit = "rad/s2", start = 0.1, min = 0.0, tunable)]
    alpha_2: f64,
    /// lambda_1: K_p at the side that rises (assumed: 1.5 times the base)
    #[var("roll_rule.large_gain", unit = "kg", start = 90.0, tunable)]
    lambda_1: f64,
    /// lambda_2: K_p at the side that sinks (assumed: 1.25 times the base)
    #[var("roll_rule.small_gain", unit = "kg", start = 75.0, tunable)]
    lambda_2: f64,
    /// beta_1: roll rate above which the rule acts (assumed)
    #[var("roll_rule.rate_threshold", unit = "rad/s", start = 0.001, min = 0.0, tunable)]
    beta_1: f64,
    /// beta_2: roll acceleration above which the rule acts (assumed: a third of the paper's RMS without control)
    #[var("roll_rule.acceleration_threshold", unit = "rad/s2", start = 0.01, min = 0.0, tunable)]
    beta_2: f64,
    /// beta_3: as beta_1, in state 6
    #[var("roll_rule.rate_threshold_accelerating", unit = "rad/s", start = 0.001, min = 0.0, tunable)]
    beta_3: f64,
    /// beta_4: as beta_2, in state 6
    #[var("roll_rule.acceleration_threshold_accelerating", unit = "rad/s2", start = 0.01, min = 0.0, tunable)]
    beta_4: f64,
    /// epsilon_0: pitch acceleration above which state 5 blends both rules (assumed: as alpha_2)
    #[var("blend_rule.pitch_acceleration_threshold", unit = "rad/s2", start = 0.1, min = 0.0, tunable)]
    epsilon_0: f64,
    /// gamma_0: roll acceleration above which state 5 blends both rules (assumed: as beta_2)
    #[var("blend_rule.roll_acceleration_threshold", unit = "rad/s2", start = 0.01, min = 0.0, tunable)]
    gamma_0: f64,
    /// Target slip of individual control (assumed: peak of the tire's brake force at 60 km/h)
    #[var("slip.initial", unit = "1", start = SLIP_0, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_0: f64,
    /// Target slip at the reference speed (assumed)
    #[var("slip.reference", unit = "1", start = 0.18, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_ref: f64,
    /// Reference speed of the target slip (assumed)
    #[var("slip.reference_speed", unit = "m/s", start = data::SPEED, min = 0.0, tunable, display = "km/h")]
    v_ref: f64,
    /// Reduction of the target slip in state 5 at the largest lateral acceleration (assumed)
    #[var("slip.lateral_reduction", unit = "1", start = 0.4, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_lat: f64,
    /// Smallest target slip (assumed)
    #[var("slip.minimum", unit = "1", start = 0.08, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_lo: f64,
    /// Largest target slip (assumed)
    #[var("slip.maximum", unit = "1", start = 0.30, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_hi: f64,
    /// mu
    #[var(TIRE_FRICTION, start = data::FRICTION, tunable)]
    mu: f64,
    #[var(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Exchange left and right in Tables 4 and 5
    #[var("rules.swap_sides", start = false)]
    swap_sides: bool,
    /// T (assumed)
    #[var(SAMPLE_TIME, start = 0.005)]
    sample_time: f64,
}

/// Target slip before the first sample, and with individual control.
const SLIP_0: f64 = 0.20;

/// Pedals and measurements.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(VEHICLE_SPEED)]
    u: f64,
    #[var(VEHICLE_LONGITUDINAL_ACCELERATION)]
    a_x: f64,
    #[var(VEHICLE_LATERAL_ACCELERATION)]
    a_y: f64,
    #[var(BODY_PITCH_RATE)]
    thetad: f64,
    #[var(BODY_PITCH_ACCELERATION)]
    thetadd: f64,
    #[var(BODY_ROLL_RATE)]
    phid: f64,
    #[var(BODY_ROLL_ACCELERATION)]
    phidd: f64,
    #[var(DRIVER_BRAKE)]
    brake: f64,
    /// not used by the rules
    #[var(DRIVER_THROTTLE)]
    throttle: f64,
}

/// Driving state, active laws, gains and target slips.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(COORDINATION_STATE)]
    state: i32,
    #[var(ENABLE_SUSPENSION)]
    suspension: bool,
    #[var(SUSPENSION_PROPORTIONAL_GAIN)]
    k_p: FourWheels<f64>,
    #[var(SUSPENSION_INTEGRAL_GAIN)]
    k_i: FourWheels<f64>,
    #[var(SUSPENSION_DERIVATIVE_GAIN)]
    k_d: FourWheels<f64>,
    #[var(ENABLE_ANTILOCK)]
    antilock: bool,
    #[var(TARGET_SLIP, start = SLIP_0)]
    target: FourWheels<f64>,
    #[var(ENABLE_YAW_CONTROL)]
    yaw_control: bool,
}

/// Filtered accelerations, and the driving state at the last sample.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    a_x: f64,
    a_y: f64,
    accelerates: bool,
    brakes: bool,
    turns: bool,
}

/// Coordination of semi-active suspension, antilock brakes and yaw control of a car by six driving states
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Discrete for FiniteStateCoordination {
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        equations::sample(self, sample.state, sample.inputs)
    }
}
