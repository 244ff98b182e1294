//! Loads the shared library of an FMU and provides a safe interface to its C functions.
//!
//! [`Instance`] is the interface for FMI 2.0 and 3.0, co-simulation and model exchange. All unsafe code of this crate
//! is in this module; each block states what the compiler cannot check. The binary itself must be trusted: as in every
//! importer that loads FMUs into its own process, a library that violates FMI can do anything to the process.

#![allow(unsafe_code)]

mod array_values;
mod binary;
mod callbacks;
pub mod calls;
mod clocks;
pub mod description_options;
mod error;
mod floats;
mod functions;
mod instance;
mod integration;
mod library;
#[cfg(target_os = "linux")]
pub(crate) mod linux;
mod model_exchange;
mod scheduled;
mod special;
mod states;
mod status;
mod strings;
mod structure;
#[cfg_attr(target_family = "wasm", path = "loader/system/wasm.rs")]
mod system;
mod updates;
mod values;

pub use callbacks::{memory_callbacks, stray_messages};
pub use clocks::{AskedInterval, MOST_ITERATIONS};
pub use error::{CallError, CallProblem, FailedCall, LoadError, Message, Status};
pub use floats::take_restored;
pub use instance::Instance;
pub use integration::{Method, Solver};
pub use library::{Library, exported_descriptions, not_exported};
pub use model_exchange::{CompletedStep, EventUpdate};
pub use scheduled::Activation;
pub use special::WholeNumber;
pub use states::SavedState;
pub use system::flush_prints;
pub use system::locale;
pub use updates::Update;
