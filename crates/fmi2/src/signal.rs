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

/// The values a parameter may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Zero or more.
    NonNegative,
    /// More than zero; the minimum in the description is 0 and zero itself is refused at the end of initialization.
    Positive,
}
