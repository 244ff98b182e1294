//! `HandlingSlidingMode`: both suspensions hold the roll angle at zero by a sliding mode, with opposite forces.
//!
//! Applied Sciences 2020, 10, 1852, eqs. 9-14 (there HDSMC), derived again because of contradictory signs.

mod equations;
#[cfg(test)]
mod tests;

use chassis::data::hydro_pneumatic_half_car as data;
use chassis::prelude::*;
use fmi2::prelude::*;

/// The controller.
pub struct HandlingSlidingMode;

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    #[par(BODY_MASS, start = data::BODY_MASS)]
    m_s: f64,
    #[par(BODY_ROLL_AXIS_INERTIA, start = data::ROLL_AXIS_INERTIA)]
    i_x: f64,
    #[par(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h: f64,
    #[par(TRACK, start = data::TRACK)]
    t: f64,
    #[par(SUSPENSION_STIFFNESS_SIDE, start = data::SUSPENSION_STIFFNESS)]
    k_s: f64,
    #[par(SUSPENSION_DAMPING_SIDE, start = data::SUSPENSION_DAMPING)]
    c_s: f64,
    #[par(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// rho: rate at which roll decays on the surface (Table 5)
    #[par("surface.weight.roll", unit = PER_S, start = 5.0, min = 0.0, tunable)]
    rho: f64,
    /// eta: linear reaching rate; raise it for a faster return to the surface (Table 5)
    #[par("reaching.rate", unit = PER_S, start = 25.0, min = 0.0, tunable)]
    eta: f64,
    /// mu: switching gain; raise it against errors of the model, lower it against chatter (Table 5)
    #[par("switching.gain", unit = RAD_PER_S2, start = 3.0, min = 0.0, tunable)]
    mu: f64,
    /// kappa1: switching gain per roll angle (Table 5)
    #[par("switching.roll_gain", unit = PER_S2, start = 0.0012, min = 0.0, tunable)]
    kappa1: f64,
    /// kappa2: switching gain per roll rate (Table 5)
    #[par("switching.roll_rate_gain", unit = PER_S, start = 0.0014, min = 0.0, tunable)]
    kappa2: f64,
    /// Boundary layer; widen it if the forces chatter, 0.3 is recommended (0: a pure sign, as in the paper)
    #[par("switching.boundary_layer", unit = RAD_PER_S, start = 0.0, min = 0.0, tunable)]
    width: f64,
    /// Share of the damper's roll moment that the law cancels; 1 as in the paper, 0 is recommended: it keeps the wheels
    /// damped
    #[par("damper.cancellation", unit = ONE, start = 1.0, min = 0.0, max = 1.0, tunable)]
    cancellation: f64,
    /// Limit of the forces; 0 for none, as in the paper
    #[par("actuator.force_limit", unit = N, start = 0.0, min = 0.0, tunable, display = "kN")]
    limit: f64,
    /// assumed
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Roll, and what turns the body about the roll axis.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(BODY_ROLL)]
    phi: f64,
    #[signal(BODY_ROLL_RATE)]
    phid: f64,
    #[signal(SUSPENSION_DEFLECTION)]
    d: Sides<f64>,
    #[signal(SUSPENSION_VELOCITY)]
    dd: Sides<f64>,
    #[signal(VEHICLE_LATERAL_ACCELERATION)]
    a_y: f64,
}

/// Forces, and the surface for inspection.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(HANDLING_FORCE)]
    f: Sides<f64>,
    #[signal(SLIDING_SURFACE_HANDLING)]
    s: f64,
}

/// Roll control of a half car by a sliding mode with opposite suspension forces
#[model(stop_time = 10.0, step_size = 0.001)]
impl Sampled for HandlingSlidingMode {
    type Parameters = P;
    type Inputs = U;
    type Outputs = Y;

    fn update(p: &P, (): &(), (): &mut (), u: &U, _t: f64) -> Y {
        equations::forces(p, u)
    }
}

fmi2::export!(sampled HandlingSlidingMode);
