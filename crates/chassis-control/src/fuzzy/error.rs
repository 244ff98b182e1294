//! Errors.

use super::membership::Membership;
use std::fmt;

/// Error in the definition of a fuzzy system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FuzzyError {
    /// A fuzzy set has invalid parameters.
    Membership {
        /// Index of the label.
        index: usize,
        /// The set.
        set: Membership,
        /// The requirement that the set violates.
        requirement: &'static str,
    },
    /// A rule table or label map names a label that does not exist.
    Label {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
        /// The entry.
        label: usize,
        /// Number of labels.
        labels: usize,
    },
    /// The output grid is empty or not finite.
    Grid {
        /// First point.
        low: f64,
        /// Last point.
        high: f64,
        /// Number of points.
        points: usize,
    },
    /// An output label has grade 0 at every grid point.
    NoSupport {
        /// Index of the label.
        label: usize,
    },
}

impl fmt::Display for FuzzyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Membership { index, set, requirement } => {
                write!(f, "fuzzy set of label {index} ({set:?}): {requirement}")
            }
            Self::Label { row, column, label, labels } => write!(
                f,
                "fuzzy rule in row {row}, column {column}: label {label} does not exist, expected 0 to {}",
                labels.saturating_sub(1)
            ),
            Self::Grid { low, high, points } => write!(
                f,
                "fuzzy output grid of {points} points from {low} to {high}: expected at least 2 points and finite ends, the first below the last"
            ),
            Self::NoSupport { label } => write!(
                f,
                "fuzzy output label {label}: grade 0 at every grid point, expected a set that covers at least one"
            ),
        }
    }
}

impl std::error::Error for FuzzyError {}
