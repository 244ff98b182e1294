//! `IntegratedLqrSuspension`: suspension forces of a linear quadratic regulator that weighs heave, pitch and roll
//! accelerations, suspension and tire deflections, and the forces.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eq. 36.

#[cfg(test)]
mod tests;

use chassis::prelude::*;
use fmi2::prelude::*;
use lqr_suspension::{Accepted, Feedback, Gains, VehicleParameters, Weighted};

/// The controller.
pub struct IntegratedLqrSuspension;

/// The design model and the weights by Bryson's rule: 1/(largest accepted value)^2.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    #[parameters]
    vehicle: VehicleParameters,
    /// Largest accepted heave acceleration
    #[par("accepted.heave_acceleration", unit = M_PER_S2, start = 1.0, min = 1e-3)]
    zdd: f64,
    /// Largest accepted pitch acceleration
    #[par("accepted.pitch_acceleration", unit = RAD_PER_S2, start = 1.0, min = 1e-3)]
    thetadd: f64,
    /// Largest accepted roll acceleration (calibrated on Table 4)
    #[par("accepted.roll_acceleration", unit = RAD_PER_S2, start = 0.347, min = 1e-3)]
    phidd: f64,
    /// Largest accepted suspension deflection (calibrated on Table 4)
    #[par("accepted.suspension_deflection", unit = M, start = 0.0347, min = 1e-4, display = "mm")]
    d: f64,
    /// Largest accepted tire deflection: the static one
    #[par("accepted.tire_deflection", unit = M, start = 0.0589, min = 1e-4, display = "mm")]
    t: f64,
    /// Largest accepted actuator force
    #[par("accepted.suspension_force", unit = N, start = 20_000.0, positive, display = "kN")]
    force: f64,
    /// assumed
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// The proposed force.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    /// U_z of the paper
    #[signal(INTEGRATED_FORCE)]
    u_z: SixWheels<f64>,
}

/// Active suspension of a three-axle vehicle by a linear quadratic regulator for heave, pitch, roll, suspension and
/// tires
#[model(stop_time = 20.0, step_size = 0.001)]
impl Sampled for IntegratedLqrSuspension {
    type Parameters = P;
    type Design = Gains;
    type Inputs = Feedback;
    type Outputs = Y;

    fn design(p: &P) -> Result<Gains, String> {
        let outputs = [
            Accepted { quantity: Weighted::HeaveAcceleration, value: p.zdd },
            Accepted { quantity: Weighted::PitchAcceleration, value: p.thetadd },
            Accepted { quantity: Weighted::RollAcceleration, value: p.phidd },
            Accepted { quantity: Weighted::SuspensionDeflections, value: p.d },
            Accepted { quantity: Weighted::TireDeflections, value: p.t },
        ];
        Gains::design(&p.vehicle, &outputs, p.force)
    }
    fn update(_: &P, d: &Gains, (): &mut (), x: &Feedback, _t: f64) -> Y {
        Y { u_z: d.force(x) }
    }
}

fmi2::export!(sampled IntegratedLqrSuspension);
