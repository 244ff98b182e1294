//! Named signals and quantities: what a catalogue is made of.

use crate::unit::Unit;

/// What a signal is for. A master wires by name; the role says who may write it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// What the driver asks for.
    Driver,
    /// Road and friction.
    Environment,
    /// What a plant measures.
    Measurement,
    /// What acts on a plant.
    Command,
    /// Between controllers, or shown for inspection.
    Internal,
}

/// An entry of a signal catalogue: an output and an input of the same signal mean the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Name in the model description; a family appends `.` and the place.
    pub name: &'static str,
    /// Unit of measure.
    pub unit: Unit,
    /// Unit in which it is best shown, one of [`Unit::display`].
    pub display: Option<&'static str>,
    /// Usual magnitude in the unit, to an order of magnitude.
    pub nominal: f64,
    /// Who writes it.
    pub role: Role,
    /// One sentence; `{}` stands for the place of a family.
    pub description: &'static str,
}

/// An entry of a parameter catalogue: it means the same in every FMU that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Name in the model description; a family appends `.` and the place.
    pub name: &'static str,
    /// Unit of measure.
    pub unit: Unit,
    /// Unit in which it is best shown, one of [`Unit::display`].
    pub display: Option<&'static str>,
    /// What values it may take.
    pub range: Range,
    /// One sentence; `{}` stands for the place of a family.
    pub description: &'static str,
}

/// Least value of a parameter that must be more than zero, in its unit: FMI has no limits that are excluded, and
/// smaller numbers overflow where a model divides by a power of them.
pub const LEAST_POSITIVE: f64 = 1e-6;

/// The values a parameter may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Zero or more.
    NonNegative,
    /// More than zero: at least [`LEAST_POSITIVE`].
    Positive,
    /// This number or more.
    AtLeast(f64),
}
