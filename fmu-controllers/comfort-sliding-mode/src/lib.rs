//! `ComfortSlidingMode`: keeps the body still with the left suspension, by a sliding mode of a quarter car. The right
//! suspension gets a constant share of the left force.
//!
//! Applied Sciences 2020, 10, 1852, eqs. 15-23 (called RCSMC there).
//!
//! | symbol | meaning |
//! |---|---|
//! | x1, x2 | height of the left wheel, heave of the body |
//! | x3, x4 | their rates |
//! | n1, n2, n3 | weights of x1, x2, x3 in the surface S; x4 has the weight 1 |
//! | e | force of spring and damper on the body |
//! | NA, NB | rate of S without force, and its change per force |
//! | mu, eta | switching gain and linear reaching rate |
//! | f | actuator force of a side; zeta is the ratio of right to left force |

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
pub struct ComfortSlidingMode {
    #[var(BODY_MASS, start = data::BODY_MASS)]
    m_s: f64,
    #[var(WHEEL_MASS_SIDE, start = data::WHEEL_MASS)]
    m_u: f64,
    #[var(SUSPENSION_STIFFNESS_SIDE, start = data::SUSPENSION_STIFFNESS)]
    k_s: f64,
    #[var(SUSPENSION_DAMPING_SIDE, start = data::SUSPENSION_DAMPING)]
    c_s: f64,
    #[var(TIRE_STIFFNESS_SIDE, start = data::TIRE_STIFFNESS)]
    k_t: f64,
    /// n1: weight of the wheel height in the surface, which is stable only below n2 n3; a lower value damps the wheel
    /// more (Table 5)
    #[var("surface.weight.wheel_height", unit = "1/s", start = -0.575, tunable)]
    n1: f64,
    /// n2: weight of heave in the surface, which is stable only above 0; the rate at which heave returns (Table 5)
    #[var("surface.weight.heave", unit = "1/s", start = 0.6559, tunable)]
    n2: f64,
    /// n3: weight of the wheel velocity in the surface, which is stable only below the ratio of wheel to body mass
    /// (Table 5)
    #[var("surface.weight.wheel_velocity", unit = "1", start = 0.0, tunable)]
    n3: f64,
    /// eta: linear reaching rate; raise it to hold the body more firmly (Table 5)
    #[var("reaching.rate", unit = "1/s", start = 11.0, min = 0.0, tunable)]
    eta: f64,
    /// mu: switching gain (Table 5)
    #[var("switching.gain", unit = "m/s2", start = 0.0005, min = 0.0, tunable)]
    mu: f64,
    /// Boundary layer; widen it if the force chatters (0: sign function, as in the paper)
    #[var("switching.boundary_layer", unit = "m/s", start = 0.0, min = 0.0, tunable)]
    width: f64,
    /// zeta: right force over left force (Table 5)
    #[var("allocation.right_to_left_ratio", unit = "1", start = 0.444, tunable)]
    zeta: f64,
    /// Limit of the left force; 0 for none, as in the paper
    #[var("actuator.force_limit", unit = "N", start = 0.0, min = 0.0, tunable, display = "kN")]
    limit: f64,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// The state of the quarter car.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(WHEEL_HEIGHT)]
    x1: LeftSide<f64>,
    #[var(BODY_HEAVE)]
    x2: f64,
    #[var(WHEEL_VELOCITY)]
    x3: LeftSide<f64>,
    #[var(BODY_HEAVE_RATE)]
    x4: f64,
}

/// Forces, and the surface for inspection.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(COMFORT_FORCE)]
    f: Sides<f64>,
    #[var(SLIDING_SURFACE_COMFORT)]
    s: f64,
}

/// Rate of the surface per force of the left actuator, 1/kg.
fn surface_rate_per_force(p: &ComfortSlidingMode) -> f64 {
    1.0 / p.m_s - p.n3 / p.m_u
}

/// Ride comfort of a half car by a sliding mode of its left quarter; the right force is a constant share of the left
/// one
#[fmu::model(stop_time = 10.0, step_size = 0.001)]
impl Discrete for ComfortSlidingMode {
    type Inputs = U;
    type Outputs = Y;

    fn check(&self, _: &Sample<Self>) -> Result<(), String> {
        // The weight is tunable, so every sample checks it.
        let singular = self.m_u / self.m_s;
        // At the singular weight, the effects of the force on body and wheel cancel in the surface. 1e-9 allows for
        // rounding.
        if (surface_rate_per_force(self) * self.m_s).abs() > 1e-9 {
            return Ok(());
        }
        Err(format!(
            "'surface.weight.wheel_velocity' must differ from 'wheel.mass.side'/'body.mass' = {singular}, got {}: no force \
             moves the surface",
            self.n3
        ))
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        let u = sample.inputs;
        let ([x1], x2, [x3], x4) = (*u.x1, u.x2, *u.x3, u.x4);
        let s = self.n1 * x1 + self.n2 * x2 + self.n3 * x3 + x4;
        let e = spring_damper(self.k_s, self.c_s, x2 - x1, x4 - x3);
        let na = self.n1 * x3 + self.n2 * x4 + self.n3 * (-self.k_t * x1 - e) / self.m_u + e / self.m_s;
        let nb = surface_rate_per_force(self);
        let f_l = (reaching_law(s, self.eta, self.mu, self.width) - na) / nb;
        let f_l = limit::magnitude(f_l, limit::positive_or_none(self.limit));
        Y { f: Sides([f_l, self.zeta * f_l]), s }
    }
}
