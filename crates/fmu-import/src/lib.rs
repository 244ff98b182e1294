//! Reads, loads and validates FMUs of FMI 2.0 and 3.0 of any origin, for co-simulation and model exchange.
//!
//! FMUs are seen as a stranger sees them: through the `.fmu` file and its C functions. From the bottom up:
//!
//! - [`description`] reads `modelDescription.xml`, [`archive`] the zip file around it,
//! - [`fmu`] and [`loader`] open the binary and give its functions a safe interface,
//! - [`check`](mod@check) validates an FMU by its description and by what it does, [`linearize`](mod@linearize) makes
//!   linear models, [`trim`](mod@trim) finds steady states,
//! - [`worker`] does such work in other processes, which may crash,
//! - [`terminal`] makes text of an FMU safe to print, [`names`] finds near names, [`temporary`] keeps files that are not to
//!   stay.

pub mod archive;
pub mod c_api;
pub mod check;
pub mod description;
pub mod fmu;
pub mod linearize;
pub mod loader;
pub mod named_values;
pub mod names;
pub mod temporary;
pub mod terminal;
pub mod trim;
pub mod wasm;
#[cfg(not(target_family = "wasm"))]
pub mod worker;
pub mod xml;

mod directory;
mod python;
mod signature;

/// The example in the readme compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
