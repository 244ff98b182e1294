//! Reads and loads FMUs of FMI 2.0 and 3.0 of any origin, for co-simulation and model exchange.
//!
//! FMUs are used through the `.fmu` file and its C functions only, like those of any other tool. From the bottom up:
//!
//! - [`description`] reads `modelDescription.xml`, [`archive`] the zip file around it,
//! - [`fmu`] and [`loader`] open the binary and give its functions a safe interface,
//! - [`worker`] starts and watches processes that execute FMUs, which may crash,
//! - [`parameter_set`] reads and writes SSP files of values, [`limits`] bounds the size of files,
//! - [`terminal`] makes text of an FMU safe to print, [`names`] finds similar names, [`temporary`] manages temporary files.

pub mod archive;
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
