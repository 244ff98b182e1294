//! The part of the lab (`web/lab`) that handles systems of FMUs, compiled to WebAssembly: it resolves scenarios and
//! maneuvers, makes the calls of each step, keeps recordings and saved states, and computes metrics. It uses the same
//! crates as `cargo fmu` for all of this.
//!
//! The page's worker sends requests as JSON (`requests.rs`) and advances systems by a number of steps. The module of
//! each FMU has its own memory. `fmu_import::loader` describes how the worker connects these memories.

mod adjust;
mod catalog;
mod columns;
mod drive;
mod export;
pub mod exports;
mod fmus;
mod free;
mod lab;
mod metrics;
mod requests;
mod running;

pub use lab::Lab;
