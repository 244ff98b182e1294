//! Parameters that every unit of a kind has.

use crate::derive::Parameters;
use crate::signal::{Quantity, Range};
use crate::unit::S;

/// Least integration step and sample time in s: a communication step of 1 s has 10^6 of them, the most there may be.
const LEAST_STEP: f64 = 1e-6;

/// Time from one sample of a sampled unit to the next.
pub const SAMPLE_TIME: Quantity = Quantity {
    name: "sample_time",
    unit: S,
    display: Some("ms"),
    range: Range::AtLeast(LEAST_STEP),
    description: "Time from one sample to the next",
};

/// Longest integration step of a plant.
pub const MAX_STEP: Quantity = Quantity {
    name: "max_step",
    unit: S,
    display: Some("ms"),
    range: Range::AtLeast(LEAST_STEP),
    description: "Longest integration step; a communication step is divided into equal parts not longer than this",
};

/// The parameters of a plant that has none of its own.
#[derive(Parameters, Clone, Debug)]
pub struct MaxStep {
    #[par(MAX_STEP, start = 0.001)]
    max_step: f64,
}

/// The parameters of a sampled unit that has none of its own.
#[derive(Parameters, Clone, Debug)]
pub struct SampleTime {
    #[par(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}
