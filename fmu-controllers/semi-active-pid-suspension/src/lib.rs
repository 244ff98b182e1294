//! `SemiActivePidSuspension`: suspension forces that calm the body above each wheel, by an accumulated incremental PID
//! law of its vertical acceleration, as far as an adjustable damper can make them.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", eq. 18.

mod equations;
#[cfg(test)]
mod tests;

use chassis::prelude::*;
use fmi2::prelude::*;

/// The controller.
pub struct SemiActivePidSuspension;

/// What the actuators can do.
#[derive(Mode, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// any force within its limit: active suspension
    None = 0,
    /// forces against the velocity of the suspension only: adjustable dampers
    Dissipative = 1,
}

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// F_max: greatest suspension force, also the limit of the accumulated law (assumed: valve damper of a car)
    #[par("actuator.force_limit", unit = N, start = 1500.0, min = 0.0, tunable, display = "kN")]
    f_max: f64,
    /// c_add: greatest damping that the valve adds (assumed)
    #[par("damper.maximum_added_damping", unit = N_S_PER_M, start = 3000.0, min = 0.0, tunable, display = "kN.s/m")]
    c_add: f64,
    /// f_leak: frequency below which the accumulated law forgets (assumed: guard against drift)
    #[par("pid.leak_frequency", unit = HZ, start = 0.1, min = 0.0, tunable)]
    f_leak: f64,
    /// Factor on the accumulated law
    #[par("pid.output_gain", unit = ONE, start = 1.0, tunable)]
    gain: f64,
    /// What the actuators can do
    #[par("constraint", mode, start = Constraint::Dissipative)]
    constraint: Constraint,
    /// T_s (assumed: at this sample time the paper's gains act)
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Gains, and what is measured at each wheel.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(ENABLE_SUSPENSION)]
    enable: f64,
    #[signal(SUSPENSION_PROPORTIONAL_GAIN)]
    k_p: FourWheels<f64>,
    #[signal(SUSPENSION_INTEGRAL_GAIN)]
    k_i: FourWheels<f64>,
    #[signal(SUSPENSION_DERIVATIVE_GAIN)]
    k_d: FourWheels<f64>,
    #[signal(CORNER_ACCELERATION)]
    a: FourWheels<f64>,
    #[signal(SUSPENSION_VELOCITY)]
    v: FourWheels<f64>,
}

/// Suspension forces.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(SUSPENSION_FORCE)]
    f: FourWheels<f64>,
}

/// The accumulated law of each wheel, and its last two accelerations.
#[derive(Memory, Clone, Debug, Default)]
pub struct X {
    u: [f64; 4],
    a1: [f64; 4],
    a2: [f64; 4],
}

/// Semi-active suspension of a car: accumulated incremental PID of the body's acceleration above each wheel, clipped
/// to what a damper can do
#[model(stop_time = 6.0, step_size = 0.001)]
impl Sampled for SemiActivePidSuspension {
    type Parameters = P;
    type Memory = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(p: &P, (): &(), x: &mut X, u: &U, _t: f64) -> Y {
        equations::sample(p, x, u)
    }
}

fmi2::export!(sampled SemiActivePidSuspension);
