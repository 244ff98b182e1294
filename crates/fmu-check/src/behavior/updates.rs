//! Intermediate updates and early return in co-simulation of FMI 3.0 (FMI 3.0.2, sections 4.2.1 and 4.2.2).

use super::{CheckResult, Report, Trial, found, is_plain};
use crate::Finding;
use fmu_import::c_api::Reference;
use fmu_import::description::{Causality, DataType, Variable};
use fmu_import::loader::{CallProblem, Instance, Update};

/// Slack for times, in steps: FMUs add up step sizes, which are rounded.
pub(super) const SLACK: f64 = 1e-6;
/// Length of the step that returns early, in communication steps.
const LONG: f64 = 10.0;
/// Maximum number of variables that are read in an update.
const MOST: usize = 100;

impl Trial<'_> {
    pub(super) fn updates(&self, report: Report<'_>) -> CheckResult<()> {
        if !self.unit.provides_intermediate_update || !self.description.clocks.is_empty() {
            return Ok(());
        }
        let is_read = |v: &&Variable| {
            let is_number = is_plain(v) && v.data_type == DataType::Float64;
            v.intermediate_update && is_number && v.causality != Causality::Input
        };
        let read: Vec<&Variable> = self.description.variables.iter().filter(is_read).take(MOST).collect();
        let required: Vec<Reference> = read.iter().map(|variable| variable.reference).collect();
        let expected = self.go(&mut self.started("without updates")?, 0..self.steps, 1)?;
        let mut instance = self.updating("with updates", &required, false)?;
        let (mut outputs, mut count) = (Vec::new(), 0);
        for k in 0..self.steps {
            self.set(&mut instance, &self.inputs, &self.input(k))?;
            let (time, mut updates) = (self.start + self.step * k as f64, Vec::new());
            self.made.set(self.made.get() + 1);
            instance.step_with_updates((time, self.step), &required, false, &mut updates)?;
            self.read_outputs(&mut instance, &mut outputs)?;
            if let Some(message) = self.mistake(time, &updates, &read) {
                found(report, Finding::error("intermediateUpdate", message));
                return Ok(());
            }
            count += updates.len();
        }
        drop(instance);
        if count == 0 {
            let message = format!("is promised, but {} steps have no intermediate update", self.steps);
            found(report, Finding::warning("providesIntermediateUpdate", message));
            return Ok(());
        }
        self.compare(report, "intermediate updates", "change the results", &expected, &outputs);
        if self.unit.can_return_early_after_intermediate_update { self.early_return(&required, report) } else { Ok(()) }
    }

    /// An instance that makes intermediate updates and can be stepped.
    fn updating(&self, name: &str, required: &[Reference], early: bool) -> CheckResult<Instance> {
        self.instances.set(self.instances.get() + 1);
        let guid = &self.description.guid;
        let mut instance = Instance::instantiate_with_updates(self.library, name, guid, required, early)?;
        instance.setup_experiment(self.start, None)?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        Ok(instance)
    }

    /// Describes the first mistake in the updates of a step that starts at `time`.
    fn mistake(&self, time: f64, updates: &[Update], read: &[&Variable]) -> Option<String> {
        let (mut last, end, slack) = (time, time + self.step, SLACK * self.step);
        for update in updates {
            let now = update.time;
            if !(time - slack..=end + slack).contains(&now) {
                return Some(format!("is called at {now} s in the step from {time} s to {end} s"));
            }
            if update.is_finished && now < last - slack {
                return Some(format!(
                    "is called at {now} s after {last} s, although that step of the solver was finished"
                ));
            }
            last = if update.is_finished { now } else { last };
            let mut values = update.values.iter().zip(read);
            if let Some((value, variable)) = values.find(|(value, _)| !value.is_finite()) {
                return Some(format!("is called at {now} s, where `{}` is {value}", variable.name));
            }
        }
        None
    }

    /// Requests an early return in a step with several steps of the solver, and makes the rest of the step.
    fn early_return(&self, required: &[Reference], report: Report<'_>) -> CheckResult<()> {
        const SUBJECT: &str = "canReturnEarlyAfterIntermediateUpdate";
        let mut instance = self.updating("early return", required, true)?;
        self.set(&mut instance, &self.inputs, &self.input(0))?;
        let step = LONG * self.step;
        let (end, slack, mut updates) = (self.start + step, SLACK * step, Vec::new());
        self.made.set(self.made.get() + 1);
        let reached = match instance.step_with_updates((self.start, step), required, true, &mut updates) {
            // The FMU may also return for reasons of its own.
            Err(error) if error.problem == CallProblem::EarlyReturn => instance.last_successful_time()?,
            Err(error) => return Err(error),
            Ok(()) => end,
        };
        let requested = updates.iter().find(|update| update.can_return_early);
        let message = match requested {
            Some(update) if reached > update.time + slack => {
                format!("is promised, but a return requested at {} s ends the step at {reached} s", update.time)
            }
            None if updates.first().is_some_and(|update| update.time < end - slack) && reached >= end - slack => {
                "is promised, but no intermediate update of a step allows it".to_owned()
            }
            _ if reached >= end - slack => return Ok(()),
            _ => {
                let rest = instance.do_step(reached, end - reached);
                return rest
                    .or_else(|error| if error.problem == CallProblem::EarlyReturn { Ok(()) } else { Err(error) });
            }
        };
        let severity = if requested.is_some() { Finding::error } else { Finding::warning };
        found(report, severity(SUBJECT, message));
        Ok(())
    }
}
