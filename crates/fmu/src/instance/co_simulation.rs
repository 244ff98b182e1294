//! Co-simulation: communication steps.

use super::{CallError, CallResult, Instance};
use crate::calls::{Function, Mode};
use crate::clock;
use crate::runner::{Kind as ModelKind, MOST_PARTS, Model, Step};

impl<M: Model> Instance<M> {
    /// fmi2DoStep. A step with an invalid time or step size is rejected and changes nothing. If a result is not finite,
    /// the values from before the step are restored and the instance is in Step Failed.
    pub fn do_step(&mut self, time: f64, step: f64) -> CallResult {
        self.advance(time, step, false).map(drop)
    }

    /// fmi3DoStep that ends at the first event. Returns true if there was one. Fails like [`Self::do_step`].
    pub fn do_step_to_event(&mut self, time: f64, step: f64) -> CallResult<bool> {
        self.advance(time, step, M::HAS_EVENTS)
    }

    #[inline]
    fn advance(&mut self, time: f64, step: f64, stops_at_events: bool) -> CallResult<bool> {
        self.check(Function::DoStep)?;
        let version = self.protocol.version;
        let rejected =
            |message: String| Err(CallError::Error(format!("{}: {message}", Function::DoStep.name(version))));
        let is_length = step > 0.0 && step <= f64::MAX;
        if !is_length {
            return rejected(format!("communicationStepSize must be finite and above 0, got {step} s"));
        }
        let is_on_time = clock::is_within_tolerance((time - self.clock.time).abs(), time, step);
        if !is_on_time {
            return rejected(format!(
                "currentCommunicationPoint = {time} s, but the instance is at {} s; the difference must not exceed 1e-6 \
                 of the step or 4 units in the last place of the time",
                self.clock.time
            ));
        }
        let end = time + step;
        let advances = end > time && end > self.clock.time && end <= f64::MAX;
        if !advances {
            return rejected(format!("a step of {step} s at {time} s does not advance the time"));
        }
        if let Some(stop) = self.clock.stop
            && !clock::is_within_tolerance(end - stop, end, step)
        {
            return rejected(format!("the step from {time} s to {end} s goes past stopTime = {stop} s"));
        }
        if let Some(message) = self.check_ticks(end, step)? {
            return rejected(message);
        }
        let (start, reached, sample) = (self.clock.start, self.clock.time, self.clock.sample);
        let importer_ticks = M::HAS_CLOCKS && self.uses_event_mode;
        let span = Step { start, reached, time, step, sample, stops_at_events, importer_ticks };
        let parts = M::parts(&self.description.layout, &self.values, span);
        if parts.is_nan() || parts > MOST_PARTS {
            return rejected(format!(
                "a step of {step} s needs {parts} integration steps or samples; at most {MOST_PARTS} are possible"
            ));
        }
        if self.derived_are_old {
            self.derive()?;
        }
        let parts = u64::from(parts as u32); // faster than to u64; fits, because the limit is below 2^32
        let result = M::step(self.context(), span, parts);
        self.forget_results();
        let stopped = match result {
            Ok(stopped) => stopped,
            Err(error) => {
                self.enter(Mode::StepFailed);
                return rejected(format!(
                    "{error}; the state at {time} s was restored and the instance cannot continue"
                ));
            }
        };
        self.clock.time = stopped.unwrap_or(end);
        if M::KIND == ModelKind::Discrete {
            self.clock.sample += parts;
        }
        Ok(stopped.is_some())
    }

    /// fmi3EnterStepMode.
    pub fn enter_step_mode(&mut self) -> CallResult {
        self.check(Function::EnterStepMode)?;
        self.enter(Mode::Step);
        self.forget_results();
        Ok(())
    }
}
