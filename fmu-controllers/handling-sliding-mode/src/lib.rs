//! `HandlingSlidingMode`: holds the roll angle at zero by a sliding mode, with opposite forces on the left and right.
//!
//! Applied Sciences 2020, 10, 1852, eqs. 9-14 (called HDSMC there), rederived because of contradictory signs.
//!
//! | symbol | meaning |
//! |---|---|
//! | phi, phid | roll angle and rate |
//! | s, rho | sliding surface phid + rho phi |
//! | d_s, dd_s | suspension deflection of a side and its rate |
//! | F | force of spring and damper of a side, pushing the body up |
//! | a_y | lateral acceleration |
//! | mu + kap | switching gain; kap grows with the magnitudes of phi (kappa1) and phid (kappa2) |
//! | eta | linear reaching rate |
//! | f | actuator force of a side |

#[cfg(test)]
mod tests;

use chassis_control::limit;
use chassis_control::sliding_mode::reaching_law;
use chassis_vehicle::data::hydro_pneumatic_half_car as data;
use chassis_vehicle::prelude::*;
use chassis_vehicle::suspension::spring_damper;
use fmu::prelude::*;

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct HandlingSlidingMode {
    #[var(BODY_MASS, start = data::BODY_MASS)]
    m_s: f64,
    #[var(BODY_ROLL_AXIS_INERTIA, start = data::ROLL_AXIS_INERTIA)]
    i_x: f64,
    #[var(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    h: f64,
    #[var(TRACK, start = data::TRACK)]
    t: f64,
    #[var(SUSPENSION_STIFFNESS_SIDE, start = data::SUSPENSION_STIFFNESS)]
    k_s: f64,
    #[var(SUSPENSION_DAMPING_SIDE, start = data::SUSPENSION_DAMPING)]
    c_s: f64,
    #[var(GRAVITY, start = data::GRAVITY)]
    g: f64,
    /// rho: rate at which roll decays on the surface (Table 5)
    #[var("surface.weight.roll", unit = "1/s", start = 5.0, min = 0.0, tunable)]
    rho: f64,
    /// eta: linear reaching rate; raise it for a faster return to the surface (Table 5)
    #[var("reaching.rate", unit = "1/s", start = 25.0, min = 0.0, tunable)]
    eta: f64,
    /// mu: switching gain; raise it to reject model errors, lower it to reduce chatter (Table 5)
    #[var("switching.gain", unit = "rad/s2", start = 3.0, min = 0.0, tunable)]
    mu: f64,
    /// kappa1: switching gain per roll angle (Table 5)
    #[var("switching.roll_gain", unit = "1/s2", start = 0.0012, min = 0.0, tunable)]
    kappa1: f64,
    /// kappa2: switching gain per roll rate (Table 5)
    #[var("switching.roll_rate_gain", unit = "1/s", start = 0.0014, min = 0.0, tunable)]
    kappa2: f64,
    /// Boundary layer; widen it if the forces chatter, 0.3 is recommended (0: sign function, as in the paper)
    #[var("switching.boundary_layer", unit = "rad/s", start = 0.0, min = 0.0, tunable)]
    width: f64,
    /// Share of the damper's roll moment that the law cancels; 1 as in the paper, 0 is recommended: it keeps the wheels
    /// damped
    #[var("damper.cancellation", unit = "1", start = 1.0, min = 0.0, max = 1.0, tunable)]
    cancellation: f64,
    /// Limit of the forces; 0 for none, as in the paper
    #[var("actuator.force_limit", unit = "N", start = 0.0, min = 0.0, tunable, display = "kN")]
    limit: f64,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Roll motion, and the measurements that determine the moments about the roll axis.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(BODY_ROLL)]
    phi: f64,
    #[var(BODY_ROLL_RATE)]
    phid: f64,
    #[var(SUSPENSION_DEFLECTION)]
    d_s: Sides<f64>,
    #[var(SUSPENSION_VELOCITY)]
    dd_s: Sides<f64>,
    #[var(VEHICLE_LATERAL_ACCELERATION)]
    a_y: f64,
}

/// Forces, and the surface for inspection.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(HANDLING_FORCE)]
    f: Sides<f64>,
    #[var(SLIDING_SURFACE_HANDLING)]
    s: f64,
}

/// Roll control of a half car by a sliding mode with opposite suspension forces
#[fmu::model(stop_time = 10.0, step_size = 0.001)]
impl Discrete for HandlingSlidingMode {
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let u = sample.inputs;
        let U { phi, phid, a_y, .. } = *u;
        let s = self.rho * phi + phid;
        let f: [f64; 2] =
            std::array::from_fn(|i| spring_damper(self.k_s, self.cancellation * self.c_s, u.d_s[i], u.dd_s[i]));
        let kap = self.kappa1 * phi.abs() + self.kappa2 * phid.abs();
        // The roll acceleration that brings s to 0, and the roll moment without the actuators.
        let wanted = reaching_law(s, self.eta, self.mu + kap, self.width) - self.rho * phid;
        let passive = self.t / 2.0 * (f[0] - f[1]) + self.m_s * self.h * (a_y + self.g * fmu::math::sin(phi));
        let f_l = limit::magnitude((self.i_x * wanted - passive) / self.t, limit::positive_or_none(self.limit));
        Y { f: Sides([f_l, -f_l]), s }
    }
}
