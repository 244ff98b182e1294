//! Loads the shared library of an FMU and gives its C functions a safe interface.
//!
//! One safe [`Instance`] serves FMI 2.0 and 3.0, co-simulation and model exchange. This is the only unsafe code of the crate. Each block
//! states what the compiler cannot check. What remains is trust in the binary itself: a library that violates the FMI interface can do
//! anything to the process, as in every importer that loads FMUs into its own process.

#![allow(unsafe_code)]

mod array_values;
mod callbacks;
pub mod calls;
pub mod description_options;
mod error;
mod floats;
mod functions;
mod instance;
mod library;
#[cfg(target_os = "linux")]
pub(crate) mod linux;
mod model_exchange;
mod special;
mod states;
mod status;
mod strings;
#[cfg_attr(target_family = "wasm", path = "loader/system/wasm.rs")]
mod system;
mod values;

pub use callbacks::{memory_callbacks, stray_messages};
pub use error::{CallError, CallProblem, LoadError, Message, Status};
pub use floats::take_restored;
pub use instance::Instance;
pub use library::{Library, exported_descriptions, not_exported};
pub use model_exchange::{CompletedStep, EventUpdate};
pub use special::WholeNumber;
pub use states::SavedState;
pub use system::flush_prints;
pub use system::locale;
