//! fmi2Reset and parallel instances: values must not survive a reset or appear in another instance.

use super::{CheckResult, Report, Trial, describe, found};
use crate::Finding;
use fmu_import::description::Value;
use fmu_import::loader::{CallProblem, Instance};

#[derive(Clone, Copy)]
enum Before {
    /// Every variable that can be set is set to another value.
    Settings,
    /// Every variable that can be set is set to another value. Then the FMU makes as many steps as it accepts with
    /// these values.
    SettingsAndSteps,
    /// After a run with the start values, inputs and tunable parameters are set to other values.
    StepsAndSettings,
}

struct Fresh {
    variables: Vec<usize>,
    starts: Vec<Value>,
    outputs: Vec<f64>,
}

impl Trial<'_> {
    pub(super) fn reset_before_initialization(&self, report: Report<'_>) -> CheckResult<()> {
        self.resets(&[Before::Settings], "before initialization", report)
    }

    /// Checks that a reset after a run discards all settings and all effects of the run.
    pub(super) fn reset_after_run(&self, report: Report<'_>) -> CheckResult<()> {
        self.resets(&[Before::SettingsAndSteps, Before::StepsAndSettings], "after a run", report)
    }

    /// Checks that after a reset, every start value and a whole run are the same as in a fresh instance.
    fn resets(&self, cases: &[Before], when: &str, report: Report<'_>) -> CheckResult<()> {
        let variables = self.exact();
        let mut instance = self.initializing("fresh")?;
        let starts = self.values(&mut instance, &variables)?;
        instance.exit_initialization_mode()?;
        let fresh = Fresh { starts, outputs: self.go(&mut instance, 0..self.steps, 1)?, variables };
        drop(instance);
        for before in cases {
            let mut instance = self.used(*before)?;
            match instance.reset() {
                // A value made the FMU return the status fatal, after which it cannot be reset.
                Err(error) if error.problem == CallProblem::Dead => continue,
                reset => reset?,
            }
            if !self.is_fresh(&mut instance, &fresh, when, report) {
                break;
            }
        }
        Ok(())
    }

    /// Returns an instance that has been used and is about to be reset. Some errors are ignored, because the values may
    /// be invalid, and fmi2Reset clears an error.
    fn used(&self, before: Before) -> CheckResult<Instance> {
        if let Before::StepsAndSettings = before {
            let mut instance = self.started("reset")?;
            self.go(&mut instance, 0..self.steps, 1)?;
            self.change(&mut instance, &self.settable_between_steps());
            return Ok(instance);
        }
        let mut instance = self.instance("reset")?;
        self.change(&mut instance, &self.settable());
        if let Before::SettingsAndSteps = before {
            let started = instance
                .setup_experiment(self.start, None)
                .and_then(|()| instance.enter_initialization_mode())
                .and_then(|()| instance.exit_initialization_mode());
            drop(started.and_then(|()| self.go(&mut instance, 0..self.steps, 1)));
        }
        Ok(instance)
    }

    /// Returns true if an instance equals a fresh one after its reset; reports the difference.
    fn is_fresh(&self, instance: &mut Instance, fresh: &Fresh, when: &str, report: Report<'_>) -> bool {
        let starts = instance
            .setup_experiment(self.start, None)
            .and_then(|()| instance.enter_initialization_mode())
            .and_then(|()| self.values(instance, &fresh.variables));
        let outputs = starts.and_then(|starts| {
            if let Some(kept) = self.difference(&fresh.variables, &fresh.starts, &starts) {
                let message = format!(
                    "{when}, leaves `{}` at {}, its start value is {}{}",
                    kept.name,
                    kept.after,
                    kept.before,
                    kept.others()
                );
                found(report, Finding::error(self.function("fmi2Reset", "fmi3Reset"), message));
                return Ok(None);
            }
            instance.exit_initialization_mode()?;
            self.go(instance, 0..self.steps, 1).map(Some)
        });
        match outputs {
            Ok(None) => false,
            Ok(Some(outputs)) => {
                let message = format!("{when}, does not restore the start: the same run then has other results");
                self.compare(report, self.function("fmi2Reset", "fmi3Reset"), &message, &fresh.outputs, &outputs)
            }
            Err(error) => {
                let message = format!("{when}: after it, {}", describe(&error));
                found(report, Finding::error(self.function("fmi2Reset", "fmi3Reset"), message));
                false
            }
        }
    }

    pub(super) fn instances(&self, report: Report<'_>) -> CheckResult<()> {
        if self.is_single() {
            return Ok(());
        }
        let variables = self.exact();
        let mut first = self.initializing("first")?;
        let before = self.values(&mut first, &variables)?;
        let mut second = self.instance("second")?;
        self.change(&mut second, &self.settable());
        let after = self.values(&mut first, &variables)?;
        if let Some(shared) = self.difference(&variables, &before, &after) {
            let (name, others) = (shared.name, shared.others());
            let message = format!(
                "share `{name}`: set in one, it changes from {} to {} in the other{others}",
                shared.before, shared.after
            );
            found(report, Finding::error("two instances", message));
            return Ok(());
        }
        drop(second);
        first.exit_initialization_mode()?;
        let mut alone = self.started("alone")?;
        let expected = self.go(&mut alone, 0..self.steps, 1)?;
        drop(alone);
        // Between the steps of this instance, another instance makes steps at later times.
        let mut other = self.started("other")?;
        self.go(&mut other, 0..self.steps, 1)?;
        let mut outputs = Vec::new();
        for k in 0..self.steps {
            outputs.extend(self.go(&mut first, k..k + 1, 1)?);
            self.go(&mut other, self.steps + k..self.steps + k + 1, 1)?;
        }
        self.compare(report, "two instances", "give different results for the same calls", &expected, &outputs);
        Ok(())
    }
}
