//! Linear quadratic design for the active suspension of a three-axle vehicle, shared by the controllers
//! `IntegratedLqrSuspension` and `RollLqrSuspension`.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eqs. 9-13 and 32-39, Appendix A. Springs, dampers and tire
//! springs are part of the design model. The paper leaves them out, so its pair (A, B) is not stabilizable.

mod model;
#[cfg(test)]
mod tests;

use crate::riccati::{Regulator, lqr_output_weighted};
use chassis_vehicle::data::rescue_vehicle as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;
use nalgebra::{DMatrix, DVector};

pub use model::{LATERAL_STATES, STATES, output_rows, state_space};

/// Copies of the plant's parameters, with the same names, so a parameter set can be applied to both.
#[derive(Parameters, Clone, Debug)]
#[expect(missing_docs, reason = "the plant's documentation explains the symbols")]
pub struct VehicleParameters {
    #[var(VEHICLE_MASS, start = data::MASS)]
    pub m: f64,
    #[var(WHEEL_MASS, start = data::WHEEL_MASS)]
    pub m_w: f64,
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    pub a: f64,
    #[var(FRONT_TO_MIDDLE_AXLE, start = data::FRONT_TO_MIDDLE)]
    pub l12: f64,
    #[var(MIDDLE_TO_REAR_AXLE, start = data::MIDDLE_TO_REAR)]
    pub l23: f64,
    #[var(TRACK, start = data::TRACK)]
    pub b_t: f64,
    #[var(BODY_CG_TO_ROLL_AXIS, start = data::CG_TO_ROLL_AXIS)]
    pub h_s: f64,
    #[var(BODY_ROLL_AXIS_INERTIA, start = data::ROLL_AXIS_INERTIA)]
    pub i_x: f64,
    #[var(BODY_PITCH_AXIS_INERTIA, start = data::PITCH_AXIS_INERTIA)]
    pub i_y: f64,
    #[var(SUSPENSION_STIFFNESS, start = data::SUSPENSION_STIFFNESS)]
    pub k_s: f64,
    #[var(SUSPENSION_DAMPING, start = data::SUSPENSION_DAMPING)]
    pub c_s: f64,
    #[var(TIRE_STIFFNESS, start = data::TIRE_STIFFNESS)]
    pub k_t: f64,
    #[var(GRAVITY, start = data::GRAVITY)]
    pub g: f64,
    /// used with `design.lateral_states`
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    pub i_z: f64,
    /// used with `design.lateral_states`
    #[var(BODY_PRODUCT_OF_INERTIA, start = data::PRODUCT_OF_INERTIA)]
    pub i_xz: f64,
    /// used with `design.lateral_states`
    #[var(TIRE_CORNERING_STIFFNESS, start = data::CORNERING_STIFFNESS)]
    pub c: ThreeAxles<f64>,
    /// Sideslip and yaw rate are states of the design model and fed back, as eq. 9 of the paper suggests
    #[var("design.lateral_states", start = false)]
    pub lateral_states: bool,
    /// Speed of the design model with lateral states
    #[var("design.speed", unit = "m/s", start = data::SPEED, positive, display = "km/h")]
    pub speed: f64,
}

impl VehicleParameters {
    /// Wheel positions relative to the center of mass, m: x forward, y to the left.
    fn positions(&self) -> ([f64; 6], [f64; 6]) {
        let x = [self.a, self.a - self.l12, self.a - self.l12 - self.l23];
        (std::array::from_fn(|i| x[axle_of(i)]), std::array::from_fn(|i| self.b_t / 2.0 * left_is_positive(i)))
    }
}

/// The measured state.
#[derive(Inputs, Clone, Debug)]
pub struct Feedback {
    #[var(BODY_HEAVE)]
    z: f64,
    #[var(BODY_PITCH)]
    theta: f64,
    #[var(BODY_ROLL)]
    phi: f64,
    #[var(WHEEL_HEIGHT)]
    z_w: SixWheels<f64>,
    #[var(BODY_HEAVE_RATE)]
    zd: f64,
    #[var(BODY_PITCH_RATE)]
    thetad: f64,
    #[var(BODY_ROLL_RATE)]
    phid: f64,
    #[var(WHEEL_VELOCITY)]
    zd_w: SixWheels<f64>,
    /// used with `design.lateral_states`
    #[var(VEHICLE_SIDESLIP)]
    beta: f64,
    /// used with `design.lateral_states`
    #[var(VEHICLE_YAW_RATE)]
    r: f64,
}

/// The gain matrix K in U = -K X, by column: force at each wheel per unit of the state.
#[derive(Derived, Clone, Debug)]
pub struct Gains {
    /// Force per heave
    #[var("gain.heave", unit = "N/m")]
    z: SixWheels<f64>,
    /// Force per pitch
    #[var("gain.pitch", unit = "N/rad")]
    theta: SixWheels<f64>,
    /// Force per roll
    #[var("gain.roll", unit = "N/rad")]
    phi: SixWheels<f64>,
    /// Force per wheel height
    #[var("gain.wheel_height", unit = "N/m")]
    z_w: SixWheels<SixWheels<f64>>,
    /// Force per heave rate
    #[var("gain.heave_rate", unit = "N.s/m")]
    zd: SixWheels<f64>,
    /// Force per pitch rate
    #[var("gain.pitch_rate", unit = "N.s/rad")]
    thetad: SixWheels<f64>,
    /// Force per roll rate
    #[var("gain.roll_rate", unit = "N.s/rad")]
    phid: SixWheels<f64>,
    /// Force per wheel velocity
    #[var("gain.wheel_velocity", unit = "N.s/m")]
    zd_w: SixWheels<SixWheels<f64>>,
    /// Force per sideslip angle
    #[var("gain.sideslip", unit = "N/rad")]
    beta: SixWheels<f64>,
    /// Force per yaw rate
    #[var("gain.yaw_rate", unit = "N.s/rad")]
    r: SixWheels<f64>,
}

/// A weighted output of the design model. By Bryson's rule, its weight is 1/value^2.
#[derive(Clone, Copy, Debug)]
pub struct Accepted {
    /// Weighted quantity.
    pub quantity: Weighted,
    /// Largest accepted value, in the SI unit of the quantity, > 0.
    pub value: f64,
}

/// Quantities that a cost can weight; deflections are weighted at each of the six wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighted {
    /// Heave acceleration, m/s2.
    HeaveAcceleration,
    /// Pitch acceleration, rad/s2.
    PitchAcceleration,
    /// Roll angle, rad.
    Roll,
    /// Roll acceleration, rad/s2.
    RollAcceleration,
    /// Suspension deflections, m.
    SuspensionDeflections,
    /// Tire deflections on a flat road, m.
    TireDeflections,
}

impl Weighted {
    /// Name of the parameter with the largest accepted value.
    pub const fn parameter(self) -> &'static str {
        match self {
            Self::HeaveAcceleration => "accepted.heave_acceleration",
            Self::PitchAcceleration => "accepted.pitch_acceleration",
            Self::Roll => "accepted.roll_angle",
            Self::RollAcceleration => "accepted.roll_acceleration",
            Self::SuspensionDeflections => "accepted.suspension_deflection",
            Self::TireDeflections => "accepted.tire_deflection",
        }
    }
}

impl Gains {
    /// Solves the regulator problem. The cost weights `outputs` and the forces, whose largest accepted value is
    /// `force`, N.
    ///
    /// # Errors
    /// An accepted value is out of range, the mass matrix is not positive definite, or the Riccati equation has no
    /// stabilizing solution. The message names the parameter or property and the violated rule.
    pub fn derived(p: &VehicleParameters, outputs: &[Accepted], force: f64) -> Result<Self, String> {
        let regulator = regulator(p, outputs, force)?;
        let k = &regulator.gain;
        let column = |j: usize| SixWheels::from_fn(|i| k[(i, j)]);
        let wheels = |first: usize| SixWheels::from_fn(|i| SixWheels::from_fn(|j| k[(i, first + j)]));
        let lateral = |j: usize| if p.lateral_states { column(j) } else { SixWheels::default() };
        Ok(Self {
            z: column(0),
            theta: column(1),
            phi: column(2),
            z_w: wheels(3),
            zd: column(9),
            thetad: column(10),
            phid: column(11),
            zd_w: wheels(12),
            beta: lateral(18),
            r: lateral(19),
        })
    }

    /// U = -K X (the minimum of eqs. 38, 39), N.
    pub fn force(&self, x: &Feedback) -> SixWheels<f64> {
        let wheels = |gains: &SixWheels<f64>, values: &SixWheels<f64>| -> f64 {
            gains.iter().zip(values.iter()).map(|(k, x)| k * x).sum()
        };
        SixWheels::from_fn(|i| {
            -(self.z[i] * x.z
                + self.theta[i] * x.theta
                + self.phi[i] * x.phi
                + wheels(&self.z_w[i], &x.z_w)
                + self.zd[i] * x.zd
                + self.thetad[i] * x.thetad
                + self.phid[i] * x.phid
                + wheels(&self.zd_w[i], &x.zd_w)
                + self.beta[i] * x.beta
                + self.r[i] * x.r)
        })
    }
}

/// The regulator of the design model.
///
/// # Errors
/// As [`Gains::derived`].
pub fn regulator(p: &VehicleParameters, outputs: &[Accepted], force: f64) -> Result<Regulator, String> {
    for &Accepted { quantity, value } in outputs {
        check_weight(quantity.parameter(), value)?;
    }
    check_weight("accepted.suspension_force", force)?;
    let (a, b) = state_space(p, p.lateral_states.then_some(p.speed))?;
    let (d, e, weights) = output_rows(p, &a, &b, outputs);
    let q0 = DMatrix::from_diagonal(&DVector::from_vec(weights));
    let r0 = DMatrix::identity(6, 6) / (force * force);
    lqr_output_weighted(&a, &b, &d, &e, &q0, &r0)
        .map_err(|error| format!("no suspension gains for these vehicle data and these values of 'accepted': {error}"))
}

/// Checks that the weight 1/value^2 is finite and not 0.
fn check_weight(parameter: &str, value: f64) -> Result<(), String> {
    if (1e-150..=1e150).contains(&value) {
        return Ok(());
    }
    Err(format!("'{parameter}' must be a number in [1e-150, 1e150], got {value:e}"))
}
