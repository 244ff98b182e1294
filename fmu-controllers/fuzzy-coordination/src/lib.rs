//! `FuzzyCoordination`: the shares of the suspension laws and the activation of the multi-axle steering, from
//! steering demand and speed.
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, Tables 2 and 3, with the printed outputs exchanged (see README).

mod equations;
#[cfg(test)]
mod tests;

use chassis_control::fuzzy::{LabelMap, Output, Partition, RuleTable};
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Control case.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// constant weights, no coordination
    Individual = 1,
    /// weights by fuzzy rules
    Coordination = 2,
}

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct FuzzyCoordination {
    /// Control case
    #[var("strategy", start = Strategy::Coordination)]
    strategy: Strategy,
    /// Share of the integrated law in individual control
    #[var("fixed_weight.integrated", unit = "1", start = 1.0, tunable)]
    fixed_integrated: f64,
    /// Share of the roll law in individual control; unstable with both laws fully on
    #[var("fixed_weight.roll", unit = "1", start = 0.0, tunable)]
    fixed_roll: f64,
    /// Multi-axle steering in individual control: on when above 0.5
    #[var("fixed_weight.steering", unit = "1", start = 1.0, tunable)]
    fixed_steering: f64,
    /// Steering demand at which coordination switches the multi-axle steering on
    #[var("steering.activation_angle", unit = "rad", start = std::f64::consts::PI / 180.0, min = 0.0, tunable, display = "deg")]
    delta_0: f64,
    /// Assign Tables 2 and 3 to the shares as printed in the paper
    #[var("rules.as_printed", start = false)]
    as_printed: bool,
    /// assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Inputs of the rules.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(DRIVER_STEER)]
    steer: f64,
    #[var(VEHICLE_SPEED)]
    speed: f64,
}

/// The shares.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(WEIGHT_INTEGRATED)]
    k1: f64,
    #[var(WEIGHT_ROLL)]
    k2: f64,
    #[var(WEIGHT_STEERING)]
    k3: f64,
}

/// The rule base with its tabulated output sets.
#[derive(Derived, Clone, Debug)]
pub struct D {
    angle: Partition<5>,
    speed: Partition<5>,
    rules: RuleTable<5, 5, 7>,
    mirrored: LabelMap<7, 7>,
    output: Output<7>,
}

/// Shares of the integrated and the roll suspension law and activation of multi-axle steering, by fuzzy rules on
/// steering demand and speed
#[fmu::model(stop_time = 20.0, step_size = 0.001)]
impl Discrete for FuzzyCoordination {
    type Derived = D;
    type Inputs = U;
    type Outputs = Y;

    fn derived(&self) -> Result<D, String> {
        equations::rule_base()
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        equations::weights(self, sample.derived, sample.inputs)
    }
}
