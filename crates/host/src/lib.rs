//! Runs systems of FMI 2.0 co-simulation FMUs.
//!
//! The host sees FMUs as a stranger would: through the `.fmu` file and its C functions. It knows
//! nothing of the exporter that made them. From the bottom up:
//!
//! - [`description`] reads `modelDescription.xml`, [`archive`] the zip file around it,
//! - [`fmu`] and [`loader`] open the binary and give its functions a safe interface,
//! - [`check`](mod@check) judges an FMU by its description and by what it does,
//! - [`resolve`](mod@resolve) turns a scenario file (TOML) into a [`plan`]: every run with every parameter, wire
//!   and recorded column settled, nothing left to look up; [`parameter_set`] reads and writes values beside it,
//!   [`problem`] shows mistakes with their place; [`systems`] tells which FMUs fit which plants by their signals,
//! - [`master`] executes the runs of a plan in this process, [`worker`] in others, which may crash; [`results`] writes them,
//!   [`export`] writes a run for other masters, [`linearize`](mod@linearize) makes linear models, [`temporary`] keeps files that are not to stay,
//! - [`terminal`] makes text of an FMU safe to print.
//!
//! A tool that evaluates a system many times (a tuner, a benchmark) resolves once, opens the FMUs
//! once and then executes changed copies of a run in memory:
//!
//! ```no_run
//! use host::{fmu::Fmus, master, plan::Value, resolve::{FmuFolder, Options, resolve}};
//! use std::path::Path;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = FmuFolder::new(["target/fmu"]);
//! let plan = resolve(Path::new("scenarios/step_steer.toml"), &folder, &Options::default())?;
//! let fmus = Fmus::load(&plan)?;
//! for gain in [1.0, 2.0, 4.0] {
//!     let mut run = plan.runs[0].clone();
//!     run.set_parameter(&fmus, "steering", "switching.gain", Value::Real(gain))?;
//!     let recording = master::execute(&plan.simulation, &run, &fmus)?;
//!     println!("{gain}: {:?}", recording.column(0).and_then(|c| c.last()));
//! }
//! # Ok(())
//! # }
//! ```

pub mod archive;
pub mod c_api;
pub mod check;
pub mod description;
pub mod export;
pub mod fmu;
pub mod limits;
pub mod linearize;
pub mod loader;
pub mod master;
pub mod parameter_set;
pub mod plan;
pub mod problem;
pub mod resolve;
pub mod results;
pub mod systems;
pub mod temporary;
pub mod terminal;
pub mod trial;
pub mod worker;

mod directory;
mod feeds;
mod findings;
mod named_values;
mod python;
mod scenario;
mod xml;
