//! Collects all mistakes in a declaration to report them together.

use syn::{Error, Result};

/// The mistakes found so far.
#[derive(Default)]
pub(crate) struct Errors(Option<Error>);

impl Errors {
    pub(crate) fn add(&mut self, error: Error) {
        match &mut self.0 {
            Some(all) => all.combine(error),
            None => self.0 = Some(error),
        }
    }

    /// Returns the value, or `None` after recording the mistake.
    pub(crate) fn keep<V>(&mut self, result: Result<V>) -> Option<V> {
        result.map_err(|error| self.add(error)).ok()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_none()
    }

    /// The value if there was no mistake.
    pub(crate) fn finish<V>(self, value: V) -> Result<V> {
        match self.0 {
            Some(all) => Err(all),
            None => Ok(value),
        }
    }
}
