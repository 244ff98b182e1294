//! Recorded signals.

use fmu_import::loader::Message;

/// Recorded signals of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Time of each row, s.
    pub time: Vec<f64>,
    /// Values of each of the columns of the run; `None` where the case leaves the component out.
    pub columns: Vec<Option<Vec<f64>>>,
    /// Warnings that components logged during a successful run, with the name of the component.
    pub messages: Vec<(String, Message)>,
    /// Time the run took, instantiation included, s.
    pub seconds: f64,
}

impl Recording {
    /// Values of a column of the plan.
    #[must_use]
    pub fn column(&self, index: usize) -> Option<&[f64]> {
        self.columns.get(index)?.as_deref()
    }
}
