//! `RollLqrSuspension`: suspension forces of a linear quadratic regulator that weighs the roll angle and acceleration,
//! suspension and tire deflections, and the forces.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eq. 37.

#[cfg(test)]
mod tests;

use chassis::prelude::*;
use fmi2::prelude::*;
use lqr_suspension::{Accepted, Feedback, Gains, VehicleParameters, Weighted};

/// The controller.
pub struct RollLqrSuspension;

/// The design model and the weights by Bryson's rule: 1/(largest accepted value)^2.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    #[parameters]
    vehicle: VehicleParameters,
    /// Largest accepted roll angle; decides how much the roll angle shrinks
    #[par("accepted.roll_angle", unit = RAD, start = std::f64::consts::PI / 180.0, positive, display = "deg")]
    phi: f64,
    /// Largest accepted roll acceleration
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
    /// U_phi of the paper
    #[signal(ROLL_FORCE)]
    u_phi: SixWheels<f64>,
}

/// Active suspension of a three-axle vehicle by a linear quadratic regulator for roll, suspension and tires
#[model(stop_time = 20.0, step_size = 0.001)]
impl Sampled for RollLqrSuspension {
    type Parameters = P;
    type Design = Gains;
    type Inputs = Feedback;
    type Outputs = Y;

    fn design(p: &P) -> Result<Gains, String> {
        let outputs = [
            Accepted { quantity: Weighted::Roll, value: p.phi },
            Accepted { quantity: Weighted::RollAcceleration, value: p.phidd },
            Accepted { quantity: Weighted::SuspensionDeflections, value: p.d },
            Accepted { quantity: Weighted::TireDeflections, value: p.t },
        ];
        Gains::design(&p.vehicle, &outputs, p.force)
    }
    fn update(_: &P, d: &Gains, (): &mut (), x: &Feedback, _t: f64) -> Y {
        Y { u_phi: d.force(x) }
    }
}

fmi2::export!(sampled RollLqrSuspension);
