//! Runs systems of co-simulation FMUs of FMI 2.0 and 3.0.
//!
//! - [`resolve`](mod@resolve) turns a scenario file (TOML) into a [`plan`]: every run with all its parameters,
//!   connections and recorded columns; [`problem`] shows mistakes with their place,
//! - a [`mod@run`] is executed by a [`master`] in this process, by a [`session`] step by step, or by a [`worker`] in
//!   another process, which may crash; [`fmus`] holds the FMUs of runs, [`results`] writes recordings, [`trial`] finds
//!   parameters without an effect, [`steady`] finds the steady states in which components start, [`algebraic`] solves
//!   algebraic loops,
//! - [`batch`] reduces many runs with other values to the numbers of their metrics, [`converge`] estimates the error of
//!   the communication step,
//! - [`report`] defines what the results show and is independent of the execution of runs; [`metrics`] computes the
//!   numbers, [`requirements`] compares them with their limits, [`typography`] formats numbers and units,
//! - [`data`] reads CSV files of any origin,
//! - [`export`] writes a run for other masters, [`mod@import`] reads the systems of other tools, [`compat`] finds the FMUs whose signals fit a plant.
//!
//! A tool that evaluates a system many times (an optimizer, a benchmark) resolves the scenario once, opens the FMUs
//! once, and then executes changed copies of a run in memory:
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

pub mod algebraic;
#[cfg(not(target_family = "wasm"))]
pub mod batch;
pub mod comparison;
pub mod compat;
pub mod converge;
pub mod data;
pub mod export;
pub mod failure;
pub mod fmus;
pub mod import;
pub mod master;
pub mod metrics;
pub mod parameter;
pub mod plan;
pub mod problem;
pub mod report;
pub mod requirements;
pub mod resolve;
pub mod results;
pub mod run;
pub mod schema;
pub mod session;
pub mod spanned;
pub mod steady;
pub mod study;
pub mod trial;
pub mod typography;
#[cfg(not(target_family = "wasm"))]
pub mod worker;

mod scenario;
