//! `SuspensionMixer`: the suspension force as the weighted sum of the integrated and the roll law.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, eq. 40: U_i = K1 U_z,i + K2 U_phi,i, limited.

#[cfg(test)]
mod tests;

use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct SuspensionMixer {
    /// Limit of a suspension force; assumed, never reached in the paper's experiments
    #[var("actuator.force_limit", unit = "N", start = 100_000.0, min = 0.0, tunable, display = "kN")]
    limit: f64,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Forces of the two laws, and their shares.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(WEIGHT_INTEGRATED)]
    k1: f64,
    #[var(WEIGHT_ROLL)]
    k2: f64,
    #[var(INTEGRATED_FORCE)]
    u_z: SixWheels<f64>,
    #[var(ROLL_FORCE)]
    u_phi: SixWheels<f64>,
}

/// The mixed force.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(SUSPENSION_FORCE)]
    f_u: SixWheels<f64>,
}

/// Mixes the suspension forces of the integrated and the roll law by their weights
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for SuspensionMixer {
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let u = sample.inputs;
        Y { f_u: SixWheels::from_fn(|i| (u.k1 * u.u_z[i] + u.k2 * u.u_phi[i]).clamp(-self.limit, self.limit)) }
    }
}
