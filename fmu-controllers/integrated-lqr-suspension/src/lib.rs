//! `IntegratedLqrSuspension`: suspension forces from a linear quadratic regulator. Its cost weights heave, pitch and
//! roll accelerations, suspension and tire deflections, and the forces.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eq. 36.

#[cfg(test)]
mod tests;

use chassis_control::lqr_suspension::{Accepted, Feedback, Gains, VehicleParameters, Weighted};
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// The design model and the weights by Bryson's rule: 1/(largest accepted value)^2.
#[derive(Parameters, Clone, Debug)]
pub struct IntegratedLqrSuspension {
    #[var(flatten)]
    vehicle: VehicleParameters,
    /// Largest accepted heave acceleration
    #[var("accepted.heave_acceleration", unit = "m/s2", start = 1.0, min = 1e-3)]
    zdd: f64,
    /// Largest accepted pitch acceleration
    #[var("accepted.pitch_acceleration", unit = "rad/s2", start = 1.0, min = 1e-3)]
    thetadd: f64,
    /// Largest accepted roll acceleration (calibrated to Table 4)
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
    /// U_z of the paper
    #[var(INTEGRATED_FORCE)]
    u_z: SixWheels<f64>,
}

/// Active suspension of a three-axle vehicle by a linear quadratic regulator for heave, pitch, roll, suspension and
/// tires
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for IntegratedLqrSuspension {
    type Derived = Gains;
    type Inputs = Feedback;
    type Outputs = Y;

    fn derived(&self) -> Result<Gains, String> {
        let outputs = [
            Accepted { quantity: Weighted::HeaveAcceleration, value: self.zdd },
            Accepted { quantity: Weighted::PitchAcceleration, value: self.thetadd },
            Accepted { quantity: Weighted::RollAcceleration, value: self.phidd },
            Accepted { quantity: Weighted::SuspensionDeflections, value: self.d_s },
            Accepted { quantity: Weighted::TireDeflections, value: self.d_t },
        ];
        Gains::derived(&self.vehicle, &outputs, self.force)
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { u_z: sample.derived.force(sample.inputs) }
    }
}
