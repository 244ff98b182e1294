//! FMU states: saved, restored, and serialized.

use super::{CheckResult, Report, Trial, found};
use crate::Finding;
use fmu_import::description::{BaseType, Causality, Value, Variable};
use fmu_import::loader::{Instance, SavedState};

impl Trial<'_> {
    /// Checks that a run from a restored state continues as before, also if the state is restored from bytes in a new
    /// instance.
    pub(super) fn states(&self, report: Report<'_>) -> CheckResult<()> {
        if !self.unit.can_get_and_set_fmu_state {
            return Ok(());
        }
        let restored = self.function("fmi2SetFMUstate", "fmi3SetFMUState");
        let read = self.function("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState");
        let configuration = self.configuration();
        let middle = self.steps / 2;
        let mut instance = self.configured_by(&configuration, "state")?;
        self.go(&mut instance, 0..middle, 1)?;
        let saved = instance.save_state()?;
        let then = self.values(&mut instance, &self.given())?;
        let expected = self.go(&mut instance, middle..self.steps, 1)?;
        // Parameters and inputs are changed, because a state contains them, too. After a rejected value, only outputs
        // are compared.
        if !self.change(&mut instance, &self.settable_between_steps()).is_empty() {
            return self.go_on(&mut instance, &saved, None, &expected, restored, report).map(drop);
        }
        if !self.go_on(&mut instance, &saved, Some(&then), &expected, restored, report)? {
            return Ok(());
        }
        if !self.unit.can_serialize_fmu_state {
            return instance.free_state(saved);
        }
        let bytes = instance.serialize_state(&saved)?;
        instance.free_state(saved)?;
        drop(instance);
        let mut other = self.started("bytes")?;
        let saved = other.deserialize_state(&bytes)?;
        self.go_on(&mut other, &saved, Some(&then), &expected, read, report)?;
        other.free_state(saved)
    }

    /// Restores a state from the middle of a run; returns true if values and outputs are the same as the first time.
    fn go_on(
        &self,
        instance: &mut Instance,
        saved: &SavedState,
        then: Option<&[Value]>,
        expected: &[f64],
        function: &str,
        report: Report<'_>,
    ) -> CheckResult<bool> {
        instance.restore_state(saved)?;
        if let Some(then) = then {
            let variables = self.given();
            let now = self.values(instance, &variables)?;
            if let Some(lost) = self.difference(&variables, then, &now) {
                let (name, others) = (lost.name, lost.others());
                let message = format!(
                    "leaves `{name}` at {}, it was {} when the state was saved{others}",
                    lost.after, lost.before
                );
                found(report, Finding::error(function, message));
                return Ok(false);
            }
        }
        let again = self.go(instance, self.steps / 2..self.steps, 1)?;
        let message = if function.ends_with("SetFMUstate") || function.ends_with("SetFMUState") {
            "a restored state continues differently"
        } else {
            "a state read from its bytes continues differently in another instance"
        };
        Ok(self.compare(report, function, message, expected, &again))
    }

    /// Parameters that can differ from their start values in a whole run: as many as possible, to detect a state that
    /// lacks some of them. Strings are excluded, because they may be names of files.
    fn configuration(&self) -> Vec<usize> {
        let of = |types: &[BaseType]| {
            let is_wanted =
                |variable: &Variable| variable.causality == Causality::Parameter && types.contains(&variable.base_type);
            self.filtered(is_wanted)
        };
        let candidates = [of(&[BaseType::Real, BaseType::Integer, BaseType::Boolean]), of(&[BaseType::Real])];
        let is_sound = |parameters: &Vec<usize>| {
            let run = self
                .configured_by(parameters, "configuration")
                .and_then(|mut instance| self.go(&mut instance, 0..self.steps, 1));
            run.is_ok_and(|outputs| outputs.iter().all(|output| output.is_finite()))
        };
        candidates.into_iter().find(is_sound).unwrap_or_default()
    }

    fn configured_by(&self, parameters: &[usize], name: &str) -> CheckResult<Instance> {
        let mut instance = self.instance(name)?;
        self.change(&mut instance, parameters);
        instance.setup_experiment(self.start, None)?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        Ok(instance)
    }
}
