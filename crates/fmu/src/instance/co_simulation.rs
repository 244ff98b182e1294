//! Co-simulation: communication steps.

use super::{CallError, CallResult, Instance};
use crate::calls::{Function, Mode};
use crate::runner::{Kind as ModelKind, MOST_PARTS, Model, Step};
use crate::timeline;

impl<M: Model> Instance<M> {
    /// fmi2DoStep. A step with an invalid time or step size is rejected and changes nothing. If a result is not finite,
    /// the values from before the step are restored and the instance is in Step Failed.
    pub fn do_step(&mut self, time: f64, step: f64) -> CallResult {
        self.advance(time, step, false).map(drop)
    }

    /// fmi3DoStep that may end early: at the first event, if the importer handles events, or at the event with which the
    /// model has ended the simulation. Returns true if there was one. Fails like [`Self::do_step`].
    pub fn do_step_to_event(&mut self, time: f64, step: f64) -> CallResult<bool> {
        self.advance(time, step, M::HAS_EVENTS && self.uses_event_mode)
    }

    /// Returns true if the model has ended the simulation.
    #[inline]
    pub fn is_finished(&self) -> bool {
        M::CAN_FINISH && self.run.as_ref().is_some_and(|run| M::is_finished(&self.parameters, run))
    }

    #[inline]
    fn advance(&mut self, time: f64, step: f64, stops_at_events: bool) -> CallResult<bool> {
        let (span, parts) = self.check_step(time, step, stops_at_events)?;
        let result = M::step(self.context(), span, parts);
        self.forget_results();
        let stopped = match result {
            Ok(stopped) => stopped,
            Err(error) => return Err(self.step_failed(time, &error)),
        };
        self.timeline.time = stopped.unwrap_or(time + step);
        if M::KIND == ModelKind::Discrete {
            self.timeline.sample += parts;
        }
        Ok(stopped.is_some())
    }

    /// Enters Step Failed.
    #[cold]
    pub(super) fn step_failed(&mut self, time: f64, error: &str) -> CallError {
        self.enter(Mode::StepFailed);
        let message = format_args!("{error}; the state at {time} s was restored and the instance cannot continue");
        self.error(Function::DoStep, message)
    }

    /// Validates a step, and returns it with the number of its parts. Computes the derived parameters, if necessary.
    /// Always inlined, because a call would take longer than the tests.
    #[inline(always)]
    pub(super) fn check_step(&mut self, time: f64, step: f64, stops_at_events: bool) -> CallResult<(Step, u64)> {
        self.check(Function::DoStep)?;
        let rejected = |message: std::fmt::Arguments<'_>| Err(self.error(Function::DoStep, message));
        let is_length = step > 0.0 && step <= f64::MAX;
        if !is_length {
            return rejected(format_args!("communicationStepSize must be finite and above 0, got {step} s"));
        }
        let is_on_time = timeline::is_within_tolerance((time - self.timeline.time).abs(), time, step);
        if !is_on_time {
            return rejected(format_args!(
                "currentCommunicationPoint = {time} s, but the instance is at {} s; the difference must not exceed 1e-6 \
                 of the step or 4 units in the last place of the time",
                self.timeline.time
            ));
        }
        let end = time + step;
        let advances = end > time && end > self.timeline.time && end <= f64::MAX;
        if !advances {
            return rejected(format_args!("a step of {step} s at {time} s does not advance the time"));
        }
        if let Some(stop) = self.timeline.stop
            && !timeline::is_within_tolerance(end - stop, end, step)
        {
            return rejected(format_args!("the step from {time} s to {end} s goes past stopTime = {stop} s"));
        }
        let (start, reached, sample) = (self.timeline.start, self.timeline.time, self.timeline.sample);
        let importer_ticks = M::HAS_CLOCKS && self.uses_event_mode;
        let has_slopes = M::INTERPOLATES && self.has_slopes;
        let span = Step { start, reached, time, step, sample, stops_at_events, importer_ticks, has_slopes };
        let parts = M::parts(&self.description.layout, &self.values, span);
        if parts.is_nan() || parts > MOST_PARTS {
            return rejected(format_args!(
                "a step of {step} s needs {parts} integration steps or samples; at most {MOST_PARTS} are possible"
            ));
        }
        if self.derived_are_old {
            self.derive()?;
        }
        if let Some(message) = self.check_ticks(end, step)? {
            return Err(self.error(Function::DoStep, message));
        }
        Ok((span, u64::from(parts as u32))) // faster than to u64; fits, because the limit is below 2^32
    }

    /// fmi3EnterStepMode.
    pub fn enter_step_mode(&mut self) -> CallResult {
        self.check(Function::EnterStepMode)?;
        self.deactivate_clocks();
        self.enter(Mode::Step);
        self.forget_results();
        Ok(())
    }
}
