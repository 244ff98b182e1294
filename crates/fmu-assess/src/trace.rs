//! Recorded signals.

mod read;

pub use read::{Reading, Resample};

use crate::components::SetupError;
use std::borrow::Cow;

/// A column that an evaluator reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Name. A `*` matches any wheel, axle or side.
    pub name: &'static str,
    /// Unit of measure.
    pub unit: &'static str,
    /// True if no metric can be computed without the column.
    pub is_needed: bool,
}

impl Column {
    pub(crate) const fn needed(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit, is_needed: true }
    }

    pub(crate) const fn optional(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit, is_needed: false }
    }
}

/// Recorded signals: a column of times and named columns of the same length.
///
/// Signals have the names and units of the library (`vehicle.yaw_rate` in rad/s). Times are in s and should be evenly
/// spaced. A trace is not checked: evaluators report what they cannot use.
#[derive(Debug, Clone, Default)]
pub struct Trace<'a> {
    times: Cow<'a, [f64]>,
    columns: Vec<(Cow<'a, str>, Cow<'a, [f64]>)>,
}

impl<'a> Trace<'a> {
    /// Creates a trace without columns; times are in s.
    pub fn new(times: impl Into<Cow<'a, [f64]>>) -> Self {
        Self { times: times.into(), columns: Vec::new() }
    }

    /// Adds a column.
    ///
    /// # Errors
    /// The number of rows differs from the number of times, or the name exists.
    pub fn with(
        mut self,
        name: impl Into<Cow<'a, str>>,
        values: impl Into<Cow<'a, [f64]>>,
    ) -> Result<Self, SetupError> {
        let (name, values) = (name.into(), values.into());
        if values.len() != self.times.len() {
            let (rows, times) = (values.len(), self.times.len());
            return Err(SetupError::new(format!(
                "the column `{name}` has {rows} rows, the times have {times}; give every column a value for each time"
            )));
        }
        if self.column(&name).is_some() {
            return Err(SetupError::new(format!("the trace has two columns `{name}`; remove or rename one")));
        }
        self.columns.push((name, values));
        Ok(self)
    }

    /// Times, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Finds a column by its name.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(known, _)| known == name).map(|(_, values)| &**values)
    }

    /// Names of the columns, without the times.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| &**name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_fit_the_times() {
        let values = [1.0, 2.0];
        let trace = Trace::new(&[0.0, 0.1][..]).with("a", &values[..]).unwrap();
        assert_eq!(trace.column("a"), Some(&values[..]));
        assert_eq!(trace.column("b"), None);
        assert_eq!(trace.names().collect::<Vec<_>>(), ["a"]);
        let error = trace.clone().with("a", vec![0.0; 2]).unwrap_err();
        assert_eq!(error.to_string(), "the trace has two columns `a`; remove or rename one");
        let error = trace.with("b", vec![0.0; 3]).unwrap_err();
        assert!(error.to_string().starts_with("the column `b` has 3 rows, the times have 2"), "{error}");
    }
}
