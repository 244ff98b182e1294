//! `FiniteStateCoordination`: tells six driving states apart and chooses, by state, which laws are on, the gains of the
//! suspension law and the target slip of the antilock logic.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", Tables 1-5 and rules 1-5.

mod equations;
#[cfg(test)]
mod tests;

use chassis::data::esp_car as data;
use chassis::prelude::*;
use fmi2::prelude::*;

/// The controller.
pub struct FiniteStateCoordination;

/// Which control case runs.
#[derive(Mode, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// no control: everything is off
    None = 0,
    /// every law for itself: all on, with constant gains and target slip
    Individual = 1,
    /// by driving states
    Coordination = 2,
}

/// Symbols as in the paper, where it has one.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// Control case
    #[par("strategy", mode, start = Strategy::Coordination)]
    strategy: Strategy,
    /// Time constant of the filter of the accelerations; 0 for none (assumed)
    #[par("filter.time_constant", unit = S, start = 0.05, min = 0.0, tunable, display = "ms")]
    tau: f64,
    /// Longitudinal acceleration or deceleration above which the car accelerates or brakes (assumed)
    #[par("threshold.longitudinal_acceleration_on", unit = M_PER_S2, start = 0.5, min = 0.0, tunable)]
    ax_on: f64,
    /// Longitudinal acceleration or deceleration down to which this lasts (assumed)
    #[par("threshold.longitudinal_acceleration_off", unit = M_PER_S2, start = 0.3, min = 0.0, tunable)]
    ax_off: f64,
    /// Lateral acceleration above which the car turns (assumed)
    #[par("threshold.lateral_acceleration_on", unit = M_PER_S2, start = 0.4, min = 0.0, tunable)]
    ay_on: f64,
    /// Lateral acceleration down to which this lasts (assumed)
    #[par("threshold.lateral_acceleration_off", unit = M_PER_S2, start = 0.25, min = 0.0, tunable)]
    ay_off: f64,
    /// Position of the brake pedal above which the driver brakes (assumed)
    #[par("threshold.brake_pedal", unit = ONE, start = 0.05, tunable)]
    brake_on: f64,
    /// K_p of the suspension law at all wheels where no rule says otherwise (assumed: 20 % of the mass above a wheel)
    #[par("base_gain.proportional", unit = KG, start = 60.0, tunable)]
    k_p0: f64,
    /// K_i of the suspension law at all wheels where no table says otherwise (paper, middle columns of Tables 2-5)
    #[par("base_gain.integral", unit = KG, start = 0.8, tunable)]
    k_i0: f64,
    /// K_d of the suspension law at all wheels where no table says otherwise (paper, middle columns of Tables 2-5)
    #[par("base_gain.derivative", unit = KG, start = 3.0, tunable)]
    k_d0: f64,
    /// sigma_1: K_p at the axle that sinks (assumed: 1.5 times the base)
    #[par("pitch_rule.large_gain", unit = KG, start = 90.0, tunable)]
    sigma_1: f64,
    /// sigma_2: K_p at the axle that rises (assumed: 1.25 times the base)
    #[par("pitch_rule.small_gain", unit = KG, start = 75.0, tunable)]
    sigma_2: f64,
    /// alpha_1: pitch rate above which the rule acts (assumed)
    #[par("pitch_rule.rate_threshold", unit = RAD_PER_S, start = 0.01, min = 0.0, tunable)]
    alpha_1: f64,
    /// alpha_2: pitch acceleration above which the rule acts (assumed: a third of the paper's RMS without control)
    #[par("pitch_rule.acceleration_threshold", unit = RAD_PER_S2, start = 0.1, min = 0.0, tunable)]
    alpha_2: f64,
    /// lambda_1: K_p at the side that rises (assumed: 1.5 times the base)
    #[par("roll_rule.large_gain", unit = KG, start = 90.0, tunable)]
    lambda_1: f64,
    /// lambda_2: K_p at the side that sinks (assumed: 1.25 times the base)
    #[par("roll_rule.small_gain", unit = KG, start = 75.0, tunable)]
    lambda_2: f64,
    /// beta_1: roll rate above which the rule acts (assumed)
    #[par("roll_rule.rate_threshold", unit = RAD_PER_S, start = 0.001, min = 0.0, tunable)]
    beta_1: f64,
    /// beta_2: roll acceleration above which the rule acts (assumed: a third of the paper's RMS without control)
    #[par("roll_rule.acceleration_threshold", unit = RAD_PER_S2, start = 0.01, min = 0.0, tunable)]
    beta_2: f64,
    /// beta_3: as beta_1, in state 6
    #[par("roll_rule.rate_threshold_accelerating", unit = RAD_PER_S, start = 0.001, min = 0.0, tunable)]
    beta_3: f64,
    /// beta_4: as beta_2, in state 6
    #[par("roll_rule.acceleration_threshold_accelerating", unit = RAD_PER_S2, start = 0.01, min = 0.0, tunable)]
    beta_4: f64,
    /// epsilon_0: pitch acceleration above which state 5 blends both rules (assumed: as alpha_2)
    #[par("blend_rule.pitch_acceleration_threshold", unit = RAD_PER_S2, start = 0.1, min = 0.0, tunable)]
    epsilon_0: f64,
    /// gamma_0: roll acceleration above which state 5 blends both rules (assumed: as beta_2)
    #[par("blend_rule.roll_acceleration_threshold", unit = RAD_PER_S2, start = 0.01, min = 0.0, tunable)]
    gamma_0: f64,
    /// Target slip of individual control (assumed: peak of the tire at 60 km/h)
    #[par("slip.initial", unit = ONE, start = SLIP_0, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_0: f64,
    /// Target slip at the reference speed (assumed)
    #[par("slip.reference", unit = ONE, start = 0.18, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_ref: f64,
    /// Reference speed of the target slip (assumed)
    #[par("slip.reference_speed", unit = M_PER_S, start = data::SPEED, min = 0.0, tunable, display = "km/h")]
    v_ref: f64,
    /// Loss of target slip in state 5 at the greatest lateral acceleration (assumed)
    #[par("slip.lateral_reduction", unit = ONE, start = 0.4, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_lat: f64,
    /// Least target slip (assumed)
    #[par("slip.minimum", unit = ONE, start = 0.08, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_lo: f64,
    /// Greatest target slip (assumed)
    #[par("slip.maximum", unit = ONE, start = 0.30, min = 0.0, max = 1.0, tunable, display = "%")]
    slip_hi: f64,
    /// mu
    #[par(TIRE_FRICTION, start = data::FRICTION, tunable)]
    mu: f64,
    #[par(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// Exchange left and right in Tables 4 and 5
    #[par("rules.swap_sides", start = false)]
    swap_sides: bool,
    /// T (assumed)
    #[par(SAMPLE_TIME, start = 0.005)]
    sample_time: f64,
}

/// Target slip before the first sample and of individual control.
const SLIP_0: f64 = 0.20;

/// What the driver does and what is measured.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(VEHICLE_SPEED)]
    u: f64,
    #[signal(VEHICLE_LONGITUDINAL_ACCELERATION)]
    a_x: f64,
    #[signal(VEHICLE_LATERAL_ACCELERATION)]
    a_y: f64,
    #[signal(BODY_PITCH_RATE)]
    thetad: f64,
    #[signal(BODY_PITCH_ACCELERATION)]
    thetadd: f64,
    #[signal(BODY_ROLL_RATE)]
    phid: f64,
    #[signal(BODY_ROLL_ACCELERATION)]
    phidd: f64,
    #[signal(DRIVER_BRAKE)]
    brake: f64,
    /// not used by the rules
    #[signal(DRIVER_THROTTLE)]
    throttle: f64,
}

/// State, switches, gains and target slips.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(COORDINATION_STATE)]
    state: f64,
    #[signal(ENABLE_SUSPENSION)]
    suspension: f64,
    #[signal(SUSPENSION_PROPORTIONAL_GAIN)]
    k_p: FourWheels<f64>,
    #[signal(SUSPENSION_INTEGRAL_GAIN)]
    k_i: FourWheels<f64>,
    #[signal(SUSPENSION_DERIVATIVE_GAIN)]
    k_d: FourWheels<f64>,
    #[signal(ENABLE_ANTILOCK)]
    antilock: f64,
    #[signal(TARGET_SLIP, start = SLIP_0)]
    target: FourWheels<f64>,
    #[signal(ENABLE_YAW_CONTROL)]
    yaw_control: f64,
}

/// Filtered accelerations, and how the car was driven at the last sample.
#[derive(Memory, Clone, Debug, Default)]
pub struct X {
    a_x: f64,
    a_y: f64,
    accelerates: bool,
    brakes: bool,
    turns: bool,
}

/// Coordination of semi-active suspension, antilock brakes and yaw control of a car by six driving states
#[model(stop_time = 6.0, step_size = 0.001)]
impl Sampled for FiniteStateCoordination {
    type Parameters = P;
    type Memory = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(p: &P, (): &(), x: &mut X, u: &U, _t: f64) -> Y {
        equations::sample(p, x, u)
    }
}

fmi2::export!(sampled FiniteStateCoordination);
