//! `RollLqrSuspension`: suspension forces from a linear quadratic regulator. Its cost weights the roll angle and
//! acceleration, suspension and tire deflections, and the forces.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eq. 37.

#[cfg(test)]
mod tests;

use chassis_control::lqr_suspension::{Accepted, Feedback, Gains, VehicleParameters, Weighted};
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// The design model and the weights by Bryson's rule: 1/(largest accepted value)^2.
#[derive(Parameters, Clone, Debug)]
pub struct RollLqrSuspension {
    #[var(flatten)]
    vehicle: VehicleParameters,
    /// Largest accepted roll angle; determines the reduction of the roll angle
    #[var("accepted.roll_angle", unit = "rad", start = std::f64::consts::PI / 180.0, positive, display = "deg")]
    phi: f64,
    /// Largest accepted roll acceleration
    #[var("accepted.roll_acceleration", unit = "rad/s2", start = 0.347, min = 1e-3)]
    phidd: f64,
    /// Largest accepted suspension deflection (calibrated to Table 4)
    #[var("accepted.suspension_deflection", unit = "m", start = 0.0347, min = 1e-4, display = "mm")]
    d_s: f64,
    /// Largest accepted tire deflection: the static deflection
    #[var("accepted.tire_deflection", unit = "m", start = 0.0589, min = 1e-4, display = "mm")]
    d_t: f64,
    /// Largest accepted actuator force
    #[var("accepted.suspension_force", unit = "N", start = 20_000.0, positive, display = "kN")]
    force: f64,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// The proposed forces.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    /// U_phi of the paper
    #[var(ROLL_FORCE)]
    u_phi: SixWheels<f64>,
}

/// Active suspension of a three-axle vehicle by a linear quadratic regulator for roll, suspension and tires
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for RollLqrSuspension {
    type Derived = Gains;
    type Inputs = Feedback;
    type Outputs = Y;

    fn derived(&self) -> Result<Gains, String> {
        let outputs = [
            Accepted { quantity: Weighted::Roll, value: self.phi },
            Accepted { quantity: Weighted::RollAcceleration, value: self.phidd },
            Accepted { quantity: Weighted::SuspensionDeflections, value: self.d_s },
            Accepted { quantity: Weighted::TireDeflections, value: self.d_t },
        ];
        Gains::derived(&self.vehicle, &outputs, self.force)
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { u_phi: sample.derived.force(sample.inputs) }
    }
}
