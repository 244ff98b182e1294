#![doc = include_str!("../README.md")]

pub mod evaluators;
mod json;
mod metric;
mod numerics;
mod options;
mod trace;

pub use evaluators::{Evaluation, Evaluator};
pub use metric::{Definition, Direction, Metric, Reason, Value};
pub use options::{Fallback, Form, OptionError, OptionRule};
pub use trace::{ReadError, Trace, TraceError};
