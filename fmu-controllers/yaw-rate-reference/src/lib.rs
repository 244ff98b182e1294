//! `YawRateReference`: the yaw rate that a heavy truck would have in a turn without sideslip, behind a first-order lag.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, eqs. 12-16, rederived because of contradictory signs.
//!
//! | symbol | meaning |
//! |---|---|
//! | m, I_z | mass and yaw inertia of the vehicle |
//! | l1, l2 | distances from the center of mass to the front axle and to the trunnion between the rear axles; L is their sum |
//! | kc | cornering stiffness of one front wheel |
//! | u, delta | speed, front-axle angle demanded by the driver |
//! | k, tau | yaw rate of the steady turn per steering angle, time constant |
//! | w | yaw rate reference |

#[cfg(test)]
mod tests;

use chassis_control::limit;
use chassis_vehicle::data::heavy_vehicle as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct YawRateReference {
    #[var(VEHICLE_MASS, start = data::MASS)]
    m: f64,
    #[var(VEHICLE_YAW_INERTIA, start = data::YAW_INERTIA)]
    i_z: f64,
    #[var(CG_TO_FRONT_AXLE, start = data::CG_TO_FRONT)]
    l1: f64,
    #[var(CG_TO_REAR_SUSPENSION, start = data::CG_TO_REAR_SUSPENSION)]
    l2: f64,
    /// assumed: slope of the plant's tire at its static load
    #[var(TIRE_CORNERING_STIFFNESS, start = data::FRONT_CORNERING_STIFFNESS)]
    kc: FrontAxle<f64>,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Driver's demand and speed.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(DRIVER_STEER)]
    delta: f64,
    #[var(VEHICLE_SPEED)]
    u: f64,
}

/// The references.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(REFERENCE_YAW_RATE)]
    w: f64,
    /// always 0
    #[var(REFERENCE_SIDESLIP)]
    beta: f64,
}

/// The reference for the next sample.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    w: f64,
}

/// Gain k in 1/s and time constant tau in s at the speed `u`.
fn gain_and_time_constant(p: &YawRateReference, u: f64) -> (f64, f64) {
    let l = p.l1 + p.l2;
    let den = 2.0 * p.kc[0] * p.l1 * l + p.m * p.l2 * u * u;
    (2.0 * p.kc[0] * u * l / den, p.i_z * u / den)
}

/// Yaw rate of a heavy truck in a turn without sideslip, behind a first-order lag
#[fmu::model(stop_time = 13.0, step_size = 0.001)]
impl Discrete for YawRateReference {
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, u) = (sample.state, sample.inputs);
        let (k, tau) = gain_and_time_constant(self, u.u);
        let y = Y { w: x.w, beta: 0.0 };
        x.w = limit::lag(x.w, k * u.delta, tau, self.sample_time);
        y
    }
}
