//! `YawRateReference`: the yaw rate that a heavy truck would have in a turn without sideslip, behind a first-order lag.
//!
//! Lu, Wang, Zhang, "Multiobjective Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral
//! Coupling Dynamics", 2022, eqs. 12-16, rederived because of contradictory signs.

mod equations;
#[cfg(test)]
mod tests;

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
    /// assumed: slope of the tire of the plant at its load at rest
    #[var(TIRE_CORNERING_STIFFNESS, start = data::FRONT_CORNERING_STIFFNESS)]
    kc: FrontAxle<f64>,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Driver demand and speed.
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

/// The reference of the next sample.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    w: f64,
}

/// Yaw rate of a heavy truck in a turn without sideslip, behind a first-order lag
#[fmu::model(stop_time = 13.0, step_size = 0.001)]
impl Discrete for YawRateReference {
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        equations::sample(self, sample.state, sample.inputs)
    }
}
