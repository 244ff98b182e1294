//! Numerics that the evaluators share: filter, crossings, lines, statistics.

mod crossing;
mod line;
mod lowpass;
mod rows;
mod statistics;

pub(crate) use crossing::{at, up};
pub(crate) use line::Line;
pub(crate) use lowpass::lowpass;
pub(crate) use rows::{Rows, UNEVENNESS, no_rows};
pub(crate) use statistics::{
    derivative, first_largest, largest, largest_magnitude, mean, sign, smallest, standard_deviation,
};

/// Acceleration of gravity in the definitions of the maneuvers, m/s2.
pub(crate) const GRAVITY: f64 = 9.81;
