//! Recorded signals.

mod read;

pub use read::{Reading, Resample};

use crate::components::SetupError;
use std::borrow::Cow;

/// A column that an evaluator reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Name. A `*` stands for wheels, axles or sides.
    pub name: &'static str,
    /// Unit of measure.
    pub unit: &'static str,
    /// Without a needed column the evaluator computes no metric.
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
/// Signals have the names and units of the library (`vehicle.yaw_rate` in rad/s), times are in s. Rows are evenly spaced. A trace may
/// contain anything: an evaluator reports what it cannot use.
#[derive(Debug, Clone, Default)]
pub struct Trace<'a> {
    times: Cow<'a, [f64]>,
    columns: Vec<(Cow<'a, str>, Cow<'a, [f64]>)>,
}

impl<'a> Trace<'a> {
    /// A trace without columns, from its times, s.
    pub fn new(times: impl Into<Cow<'a, [f64]>>) -> Self {
        Self { times: times.into(), columns: Vec::new() }
    }

    /// Adds a column.
    ///
    /// # Errors
    /// The column has another number of rows than the times, or there is one of the same name.
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

    /// A column by its name.
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
