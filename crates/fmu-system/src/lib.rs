//! Runs systems of co-simulation FMUs of FMI 2.0 and 3.0.
//!
//! - [`resolve`](mod@resolve) turns a scenario file (TOML) into a [`plan`]: every run with every parameter, wire
//!   and recorded column settled, nothing left to look up; [`parameter_set`] reads and writes values beside it,
//!   [`problem`] shows mistakes with their place,
//! - [`mod@run`] is what a [`master`] executes in this process, [`worker`] in others, which may crash; [`fmus`] are the FMUs
//!   of runs, [`results`] writes recordings, [`trial`] finds parameters without an effect,
//! - [`report`] is what the results are to show; nothing that executes runs knows of it; [`metrics`] computes the numbers,
//! - [`export`] writes a run for other masters, [`compat`] tells which FMUs fit which plants by their signals.
//!
//! A tool that evaluates a system many times (a tuner, a benchmark) resolves once, opens the FMUs
//! once and then executes changed copies of a run in memory:
//!
//! ```no_run
//! use fmu_import::description::Value;
//! use fmu_system::{fmus::Fmus, master, resolve::{FmuFolder, Options, resolve}};
//! use std::path::Path;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = FmuFolder::new(["target/fmu"]);
//! let plan = resolve(Path::new("scenarios/step_steer.toml"), &folder, &Options::default())?;
//! let fmus = Fmus::load(&plan.runs)?;
//! for gain in [1.0, 2.0, 4.0] {
//!     let mut run = plan.runs[0].clone();
//!     run.set_parameter(&fmus, "steering", "switching.gain", Value::Real(gain))?;
//!     let recording = master::execute(&plan.simulation, &run, &fmus)?;
//!     println!("{gain}: {:?}", recording.column(0).and_then(|c| c.last()));
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Without the feature `fmus`, the crate has only the [`metrics`].

#[cfg(feature = "fmus")]
pub mod compat;
#[cfg(feature = "fmus")]
pub mod export;
#[cfg(feature = "fmus")]
pub mod fmus;
#[cfg(feature = "fmus")]
pub mod limits;
#[cfg(feature = "fmus")]
pub mod master;
pub mod metrics;
#[cfg(feature = "fmus")]
pub mod parameter;
#[cfg(feature = "fmus")]
pub mod parameter_set;
#[cfg(feature = "fmus")]
pub mod plan;
#[cfg(feature = "fmus")]
pub mod problem;
#[cfg(feature = "fmus")]
pub mod report;
#[cfg(feature = "fmus")]
pub mod resolve;
#[cfg(feature = "fmus")]
pub mod results;
#[cfg(feature = "fmus")]
pub mod run;
#[cfg(feature = "fmus")]
pub mod trial;
#[cfg(feature = "fmus")]
pub mod worker;

#[cfg(feature = "fmus")]
mod input_file;
#[cfg(feature = "fmus")]
mod scenario;
