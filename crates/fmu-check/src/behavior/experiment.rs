//! The default experiment, and runs that start at another time.

use super::{CheckResult, Report, Trial, describe, found, middle, stop_time};
use crate::{Finding, Topic};
use fmu_import::loader::{CallError, CallProblem, Instance, Status};
use std::time::Instant;

/// If the remaining time of the experiment is less than this fraction of a step, it is a rounding error.
const NOTHING: f64 = 1e-9;

pub(super) const EXPERIMENT: &str = "the default experiment";

impl Trial<'_> {
    /// Runs the default experiment once, from its start to its stop, with the start values of the inputs.
    pub(super) fn experiment(&self, report: Report<'_>) -> CheckResult<()> {
        let Some(stop) = stop_time(self.description, self.start) else { return Ok(()) };
        let begin = Instant::now();
        let mut instance = self.instance("experiment")?;
        instance.setup_experiment(self.start, Some(stop))?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        let takes_any_step = self.unit.can_handle_variable_communication_step_size;
        let mut outputs = Vec::new();
        for k in 0.. {
            progress();
            let time = self.start + self.step * k as f64;
            let rest = stop - time;
            let is_short = rest < (1.0 - NOTHING) * self.step;
            if rest <= NOTHING * self.step || is_short && !takes_any_step {
                break;
            }
            if begin.elapsed() > self.options.experiment {
                let limit = self.options.experiment.as_secs_f64();
                let message = format!("was cut at {time} s of {stop} s after {limit} s (--timeout)");
                found(report, Finding::note(EXPERIMENT, message));
                break;
            }
            self.made.set(self.made.get() + 1);
            // A step that exceeds the declared stop by a rounding error ends at the stop.
            let step = if time + self.step > stop { rest } else { self.step };
            if let Err(error) = instance.do_step(time, step) {
                if ends_simulation(&mut instance, &error) {
                    let message = format!("the FMU ended the simulation in the step at {time} s, before {stop} s");
                    found(report, Finding::note(EXPERIMENT, message));
                } else {
                    let message = format!("fails at {time} s of {stop} s: {}", describe(&error));
                    found(report, Finding::error(EXPERIMENT, message).about(Topic::Simulation));
                }
                break;
            }
            outputs.clear();
            self.read_outputs(&mut instance, &mut outputs)?;
            if let Some(i) = outputs.iter().position(|value| !value.is_finite()) {
                let (name, end) = (&self.elements[i], time + step);
                let message = format!("`{name}` is {} at {end} s of {stop} s", outputs[i]);
                found(report, Finding::error(EXPERIMENT, message).about(Topic::Simulation));
                break;
            }
        }
        Ok(())
    }

    /// Runs from the middle of the default experiment. An FMU may reject this start time, but its users should know
    /// that.
    pub(super) fn another_start(&self, report: Report<'_>) -> CheckResult<()> {
        let run = |trial: &Self| {
            let mut instance = trial.started("start")?;
            match trial.go(&mut instance, 0..trial.steps, 1) {
                Ok(outputs) => Ok(outputs.iter().position(|value| !value.is_finite())),
                Err(error) if ends_simulation(&mut instance, &error) => Ok(None),
                Err(error) => Err(error),
            }
        };
        // Other trials report failures of a run from the declared start.
        if run(self) != Ok(None) {
            return Ok(());
        }
        let later = Self { start: middle(self.description, self.start, self.step), ..self.clone() };
        let outcome: Result<_, CallError> = run(&later);
        self.instances.set(later.instances.get());
        self.made.set(later.made.get());
        let problem = match outcome {
            Ok(None) => return Ok(()),
            Ok(Some(i)) => format!("`{}` is not finite", self.elements[i % self.elements.len()]),
            Err(error) => describe(&error),
        };
        let message = format!("fails if started at {} s, not if started at {} s: {problem}", later.start, self.start);
        found(report, Finding::warning("another start time", message).about(Topic::Simulation));
        Ok(())
    }
}

/// Restarts the timeout that another process may have set for this one. The timeout is meant for a step, and an
/// experiment may take longer.
pub(super) fn progress() {
    if let Some(board) = fmu_import::loader::calls::board() {
        board.pulse();
    }
}

/// Returns true if this error of a step means that the FMU ends the simulation.
pub(super) fn ends_simulation(instance: &mut Instance, error: &CallError) -> bool {
    let may_end = matches!(error.problem, CallProblem::Status(Status::Discard) | CallProblem::Terminated);
    may_end && instance.wants_termination() == Ok(true)
}
