//! Loads the shared library of an FMU and gives its C functions a safe interface.
//!
//! One safe [`Instance`] serves FMI 2.0 and 3.0, co-simulation and model exchange. The only unsafe code of the crate. What the compiler cannot check is stated at each block; what
//! remains is trust in the binary itself: a library that does not keep to the FMI interface can
//! do anything to the process, as with every importer that loads FMUs into itself.

#![allow(unsafe_code)]

mod callbacks;
pub mod calls;
pub mod description_options;
mod error;
pub(crate) mod floats;
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

pub(crate) use callbacks::{memory_callbacks, stray_messages};
pub use error::{CallError, CallProblem, LoadError, Message, Status};
pub use instance::Instance;
pub use library::{Library, exported_descriptions, not_exported};
pub use model_exchange::{CompletedStep, EventUpdate};
pub use special::WholeNumber;
pub use states::SavedState;
pub use system::flush_prints;
pub(crate) use system::locale;
