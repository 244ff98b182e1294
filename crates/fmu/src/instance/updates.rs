//! Co-simulation in FMI 3.0: communication steps that pause for intermediate updates.

use super::{CallResult, Instance};
use crate::calls::{Function, Mode};
use crate::runner::{Model, Progress, Step};

/// A communication step that pauses after each integrator step. Its memory is used again for the next step.
#[derive(Debug, Default)]
pub struct PausingStep {
    /// The step, and the number of its parts.
    step: Option<(Step, u64)>,
    progress: Progress,
    /// True if the step has stopped at an event.
    at_event: bool,
    /// Values before the step, restored if it fails.
    reals: Vec<f64>,
    words: Vec<u64>,
}

impl PausingStep {
    /// Returns true if the step has reached its end, an event at which it stops, or the time of an early return.
    pub fn is_complete(&self) -> bool {
        self.at_event || self.progress.time >= self.progress.end
    }

    /// Returns true if the step has stopped at an event.
    pub fn is_at_event(&self) -> bool {
        self.at_event
    }

    /// Returns true if the step has stopped before its end.
    pub fn is_early(&self) -> bool {
        self.step.is_some_and(|(step, _)| self.progress.time < step.time + step.step)
    }
}

impl<M: Model> Instance<M> {
    /// fmi3DoStep with intermediate updates: begins the step. Rejects what [`Self::do_step`] rejects.
    pub fn begin_step(&mut self, time: f64, step: f64, returns_early: bool, paused: &mut PausingStep) -> CallResult {
        let (step, parts) = self.check_step(time, step, returns_early && self.uses_event_mode)?;
        paused.step = Some((step, parts));
        paused.progress = Progress::new(step);
        paused.at_event = false;
        paused.reals.clear();
        paused.reals.extend_from_slice(&self.values.reals);
        paused.words.clear();
        paused.words.extend_from_slice(&self.values.words);
        Ok(())
    }

    /// Takes one integrator step, which ends at the next event if there is one, and enters Intermediate Update Mode.
    /// Fails like [`Self::do_step`].
    pub fn advance_to_update(&mut self, paused: &mut PausingStep) -> CallResult {
        self.check(Function::DoStep)?;
        let Some((step, parts)) = paused.step else { unreachable!("a step was begun") };
        let result = M::step_to_update(self.context(), step, parts, &mut paused.progress);
        self.forget_results();
        match result {
            Ok(stopped) => paused.at_event = stopped.is_some(),
            Err(error) => return self.fail_step(paused, error),
        }
        self.timeline.time = paused.progress.time;
        self.enter(Mode::IntermediateUpdate);
        Ok(())
    }

    /// Ends the step at `time`, or at the present time if that is later. A time after the end of the step has no
    /// effect. If the time is NaN, fails like a step.
    pub fn return_early(&mut self, time: f64, paused: &mut PausingStep) -> CallResult {
        if time.is_nan() {
            return self.fail_step(paused, "earlyReturnTime must be a number, got NaN".to_owned());
        }
        paused.progress.end = paused.progress.end.min(time.max(paused.progress.time));
        Ok(())
    }

    /// Restores the values and the discrete state from before the step, and enters Step Failed.
    pub fn fail_step(&mut self, paused: &PausingStep, error: String) -> CallResult {
        self.values.reals.copy_from_slice(&paused.reals);
        self.values.words.copy_from_slice(&paused.words);
        if let Some(run) = &mut self.run {
            M::undo_events(run);
        }
        let Some((step, _)) = paused.step else { unreachable!("a step was begun") };
        self.timeline.time = step.reached;
        self.forget_results();
        Err(self.step_failed(step.time, &error))
    }

    /// Returns true in Intermediate Update Mode.
    #[inline]
    pub fn is_updating(&self) -> bool {
        self.mode == Mode::IntermediateUpdate
    }

    /// Intermediate Update Mode: forbids reading, which must precede setting.
    pub fn forbid_reading(&mut self) {
        self.allowed &= !READING;
    }

    /// Returns to Step Mode, unless the model has panicked in the intermediate update.
    pub fn leave_update(&mut self) {
        if self.is_updating() {
            self.enter(Mode::Step);
        }
    }
}

/// The functions that read values in Intermediate Update Mode, with a bit for each.
const READING: u128 = {
    let (mut functions, mut at) = (0, 0);
    while at < Function::ALL.len() {
        if Function::ALL[at].reads() {
            functions |= 1 << Function::ALL[at] as u32;
        }
        at += 1;
    }
    functions
};
