//! Runs and trial runs in worker processes: see [`fmu_import::worker`].
//!
//! `protocol` defines requests and responses, [`serve`] is the worker's side, and `pool` is the side that starts
//! workers and replaces workers that have ended.

mod pool;
mod protocol;
mod serve;

pub use crate::failure::{Failure, FailureKind};
pub use pool::{Finish, Pool, Task};
pub use serve::serve;

use crate::run::{Run, Simulation, Trial};
use fmu_import::worker::{Ended, Process, Settings, Watch};
use protocol::{Request, Response};
use std::time::Duration;

/// Job name of workers that [`serve`].
pub const JOB: &str = "system";

/// Time limit for all trials of a scenario. The trials of the project's scenarios take a fraction of a second.
const TRIALS: Duration = Duration::from_secs(20);

/// Makes the trial runs of a scenario in a worker and returns their warnings. Trials that fail or take too long give no
/// warnings, which does no harm.
pub fn trials(settings: &Settings, simulation: &Simulation, trials: &[Trial]) -> Vec<String> {
    if trials.is_empty() {
        return Vec::new();
    }
    let Ok(mut process) = Process::start(settings, JOB, true) else { return Vec::new() };
    process.send(&Request::Trials { simulation: *simulation, trials: trials.to_vec() }, &[]);
    match process.receive(&mut Watch::of_all(TRIALS), &mut |_| ()) {
        Ok(Response::Warnings(warnings)) => warnings,
        _ => Vec::new(),
    }
}

/// Finds, in a worker, the steady states in which components start, so that another master can set them.
///
/// # Errors
/// The worker cannot be started, an FMU ends it, a run cannot be initialized, or there is no steady state.
pub fn find_steady_starts(settings: &Settings, simulation: &Simulation, runs: &mut [Run]) -> Result<(), String> {
    let mut open = runs.iter_mut().filter(|run| run.needs_steady_starts()).peekable();
    if open.peek().is_none() {
        return Ok(());
    }
    let mut process =
        Process::start(settings, JOB, true).map_err(|error| format!("cannot start a worker process: {error}"))?;
    for run in open {
        process.send(&Request::Steady { simulation: *simulation, run: Box::new(run.clone()) }, &[]);
        match process.receive(&mut Watch::of_all(settings.timeout), &mut |_| ()) {
            Ok(Response::Steady(found)) => {
                for (component, steady) in run.components.iter_mut().zip(found) {
                    component.steady = steady;
                }
            }
            Ok(Response::Failed { failure, .. }) => return Err(failure.message),
            Ok(_) => return Err("the worker process sent an unexpected response".to_owned()),
            Err(Ended { message, .. }) => return Err(format!("run {}: {message}", run.id)),
        }
    }
    Ok(())
}
