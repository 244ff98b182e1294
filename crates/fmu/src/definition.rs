//! Definitions that several models share: an entry of a catalogue of signals or parameters.

use crate::unit::Unit;

/// A variable that means the same in every model that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// Name in the model description; an array appends the names of its elements.
    pub name: &'static str,
    /// Unit of measure.
    pub unit: Unit,
    /// Unit to display values in, one of [`Unit::display`].
    pub display: Option<&'static str>,
    /// Usual magnitude in the unit, to an order of magnitude.
    pub nominal: Option<f64>,
    /// Valid values.
    pub range: Range,
    /// One sentence; `{}` is replaced by the element of an array.
    pub description: &'static str,
}

/// Least value of a parameter that must be above zero, in its unit: FMI has no exclusive limits, and smaller numbers
/// overflow where a model divides by a power of them.
pub const LEAST_POSITIVE: f64 = 1e-6;

/// The values a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Zero or more.
    NonNegative,
    /// At least [`LEAST_POSITIVE`].
    Positive,
    /// This number or more.
    AtLeast(f64),
}

/// Least integration step and sample time in s: a communication step of 1 s has 10^6 of them, the most there may be.
const LEAST_STEP: f64 = 1e-6;

/// Time from one sample of a discrete-time model to the next.
pub const SAMPLE_TIME: Definition = Definition {
    name: "sample_time",
    unit: Unit::S,
    display: Some("ms"),
    nominal: None,
    range: Range::AtLeast(LEAST_STEP),
    description: "Time from one sample to the next",
};

/// Longest integration step of a continuous-time model.
pub const MAX_STEP: Definition = Definition {
    name: "max_step",
    unit: Unit::S,
    display: Some("ms"),
    nominal: None,
    range: Range::AtLeast(LEAST_STEP),
    description: "Longest integration step; a communication step is divided into equal parts not longer than this",
};

/// Relative tolerance of a solver with error control.
pub const TOLERANCE: Definition = Definition {
    name: "tolerance",
    unit: Unit::ONE,
    display: None,
    nominal: None,
    range: Range::AtLeast(1e-13),
    description: "Relative tolerance of the solver; the absolute one of a state is this times its nominal value",
};
