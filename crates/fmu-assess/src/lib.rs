#![doc = include_str!("../README.md")]
#![cfg_attr(
    target_family = "wasm",
    allow(
        dead_code,
        reason = "`assess`, which is left out of WebAssembly because it needs processes, calls the rest of each maneuver"
    )
)]

#[cfg(not(target_family = "wasm"))]
pub mod assess;
mod bench;
mod components;
pub mod evaluators;
#[cfg(not(target_family = "wasm"))]
mod executor;
pub mod json;
mod maneuvers;
mod metric;
mod numerics;
mod options;
mod plant;
pub mod report;
mod results;
mod run_result;
mod run_spec;
pub mod signals;
pub mod single;
mod subject;
mod systems;
mod trace;
pub mod vehicle;
mod wiring;

pub use components::SetupError;
pub use evaluators::{Evaluation, Evaluator};
pub use metric::{Definition, Direction, Metric, Reason, Value};
pub use options::{Fallback, Form, OptionRule};
pub use results::{RunRecord, Skipped, Suite};
pub use subject::{ACTUATORS, Subject};
pub use trace::{Reading, Resample, Trace};
