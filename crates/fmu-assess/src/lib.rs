#![doc = include_str!("../README.md")]

pub mod assess;
mod bench;
mod course;
pub mod evaluators;
mod executor;
mod json;
mod maneuvers;
mod metric;
mod numerics;
mod options;
pub mod report;
mod trace;
pub mod vehicle;
mod wiring;

pub use evaluators::{Evaluation, Evaluator};
pub use metric::{Definition, Direction, Metric, Reason, Value};
pub use options::{Fallback, Form, OptionError, OptionRule};
pub use trace::{ReadError, Trace, TraceError};
pub use wiring::{SetupError, Subject};
