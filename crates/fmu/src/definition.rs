//! Definitions of variables that several models share, as in a catalog of signals or parameters.

use crate::unit::Unit;

/// A variable that has the same meaning in every model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// Name in the model description; an array appends the names of its elements.
    pub name: &'static str,
    /// Unit of measure.
    pub unit: Unit,
    /// Name of the display unit, one of [`Unit::display`].
    pub display: Option<&'static str>,
    /// Usual magnitude, in the unit.
    pub nominal: Option<f64>,
    /// Valid values.
    pub range: Range,
    /// One sentence; `{}` is replaced by the element of an array.
    pub description: &'static str,
}

/// Minimum of a parameter that must be above zero, in the unit of the parameter. FMI cannot express that the limit
/// itself is excluded.
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
    /// At least this number.
    AtLeast(f64),
}

/// Minimum of the integration step and the sample time in s. A communication step of 1 s then has at most 10^6 parts.
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
