//! Reads and loads FMUs of any origin: FMI 2.0 and 3.0, co-simulation and model exchange.
//!
//! This crate uses only the `.fmu` file and its C functions, also for FMUs of this project. From the bottom up:
//!
//! - [`description`] reads `modelDescription.xml`, and [`archive`] the zip file that contains it.
//! - [`fmu`] and [`loader`] load the binary and provide a safe interface to its functions.
//! - [`worker`] starts and supervises processes that execute FMUs, which may crash.
//! - [`parameter_set`] reads and writes SSP parameter sets; [`limits`] limits the size of files.
//! - [`terminal`] makes text from FMUs safe to print, [`names`] finds similar names, [`temporary`] manages temporary
//!   files.

pub mod archive;
pub mod bytes;
pub mod c_api;
pub mod description;
pub mod fmu;
pub mod limits;
pub mod loader;
pub mod named_values;
pub mod names;
pub mod parameter_set;
pub mod temporary;
pub mod terminal;
pub mod wasm;
#[cfg(not(target_family = "wasm"))]
pub mod worker;
pub mod xml;

mod directory;
mod python;
mod signature;

/// Compiles the example in the readme.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
