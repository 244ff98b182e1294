//! Model exchange: the importer integrates, the instance evaluates the equations and handles events.

use std::ops::Range;

use super::{CallError, CallResult, Instance};
use crate::calls::{Function, Interface, Mode};
use crate::runner::{Model, Run, Update};
use crate::variable::Block;

impl<M: Model> Instance<M> {
    /// fmi2EnterEventMode. Fails in co-simulation without Event Mode.
    pub fn enter_event_mode(&mut self) -> CallResult {
        let function = Function::EnterEventMode;
        self.check(function)?;
        if self.protocol.interface == Interface::CoSimulation && !self.uses_event_mode {
            return Err(self.error(function, "eventModeUsed was false when the instance was made"));
        }
        self.enter(Mode::Event);
        self.forget_results();
        Ok(())
    }

    /// fmi2NewDiscreteStates: handles all events at the present time in one call. Fails, without changing anything, if
    /// a number is not finite, if the model rejects the event, or if there are too many events.
    pub fn new_discrete_states(&mut self) -> CallResult<Update> {
        let function = Function::NewDiscreteStates;
        self.check(function)?;
        self.derive()?;
        let mut timeline = self.timeline;
        let result = M::handle_events(self.context(), &mut timeline);
        self.timeline = timeline;
        self.forget_results();
        result.map_err(|error| self.error(function, error))
    }

    /// fmi2EnterContinuousTimeMode. From now until the next event, relations keep their sides, and discrete outputs
    /// keep their values.
    pub fn enter_continuous_time_mode(&mut self) -> CallResult {
        self.check(Function::EnterContinuousTimeMode)?;
        self.deactivate_clocks();
        self.refresh(false, true, false)?;
        self.derive()?;
        let Run { ctx, run, values } = self.context();
        M::freeze_relations(ctx, run, values);
        self.enter(Mode::ContinuousTime);
        self.forget_results();
        Ok(())
    }

    /// fmi2SetTime. The time may be after the stop time. Fails if the time is not finite or is before the start.
    pub fn set_time(&mut self, time: f64) -> CallResult {
        let function = Function::SetTime;
        self.check(function)?;
        let start = self.timeline.start;
        if !(time.is_finite() && time >= start) {
            let message = format_args!("time must be finite and not before startTime = {start}, got {time} s");
            return Err(self.error(function, message));
        }
        if time.to_bits() != self.timeline.time.to_bits() {
            self.timeline.time = time;
            self.forget_results();
        }
        Ok(())
    }

    /// fmi2SetContinuousStates. Fails if the number of states is wrong. Returns fmi2Discard for a state that is not
    /// finite: a solver may try such a state and then shorten its step.
    pub fn set_continuous_states(&mut self, states: &[f64]) -> CallResult {
        let function = Function::SetContinuousStates;
        let range = self.range(function, self.layout().states, states)?;
        if let Some(at) = states.iter().position(|state| !state.is_finite()) {
            let name = self.layout().real_name(range.start + self.state_at(at));
            return Err(self.discard(function, format_args!("'{name}' must be finite, got {}", states[at])));
        }
        let reals = &mut self.values.reals[range];
        match &self.present_states {
            None => reals.copy_from_slice(states),
            Some(present) => present.iter().zip(states).for_each(|(&at, &state)| reals[at] = state),
        }
        self.forget_results();
        Ok(())
    }

    /// fmi2GetContinuousStates. Fails if the number of states is wrong or the parameters are inconsistent.
    pub fn continuous_states(&mut self, states: &mut [f64]) -> CallResult {
        let range = self.range(Function::GetContinuousStates, self.layout().states, states)?;
        // The start values of states may follow from the parameters.
        self.derive()?;
        self.read_states(range, states);
        Ok(())
    }

    /// fmi2GetNominalsOfContinuousStates. Fails if the number of states is wrong.
    pub fn nominals(&self, nominals: &mut [f64]) -> CallResult {
        let range = self.range(Function::GetNominalsOfContinuousStates, self.layout().states, nominals)?;
        for (at, nominal) in nominals.iter_mut().enumerate() {
            *nominal = self.layout().nominal(range.start + self.state_at(at));
        }
        Ok(())
    }

    /// fmi2GetDerivatives. Fails if the number of states is wrong. Returns fmi2Discard if a derivative is not finite.
    pub fn state_derivatives(&mut self, derivatives: &mut [f64]) -> CallResult {
        let function = Function::GetDerivatives;
        let range = self.range(function, self.layout().derivatives, derivatives)?;
        self.refresh(false, false, true)?;
        if let Some(index) = range.clone().find(|&index| !self.values.reals[index].is_finite()) {
            return Err(self.discard(function, self.not_finite(index)));
        }
        self.read_states(range, derivatives);
        Ok(())
    }

    /// fmi2GetEventIndicators. Fails if the number of indicators is wrong. Returns fmi2Discard if an indicator is not
    /// finite.
    pub fn event_indicators(&mut self, indicators: &mut [f64]) -> CallResult {
        let function = Function::GetEventIndicators;
        self.check(function)?;
        self.indicators(function, indicators)
    }

    /// The event indicators. Outside Continuous-Time Mode, the sides of the relations follow from the present values.
    pub(super) fn indicators(&mut self, function: Function, indicators: &mut [f64]) -> CallResult {
        let count = self.layout().indicators.total();
        self.check_length(function, "event indicators", count, indicators.len())?;
        self.derive()?;
        let is_frozen = self.mode == Mode::ContinuousTime;
        let Run { ctx, run, values } = self.context();
        if is_frozen {
            M::event_indicators(ctx, run, values, indicators);
        } else {
            // Uses a copy, because reading must not change the state.
            let mut run = run.clone();
            M::freeze_relations(ctx, &mut run, values);
            M::event_indicators(ctx, &mut run, values, indicators);
        }
        if let Some(at) = indicators.iter().position(|value| !value.is_finite()) {
            let message = format_args!("event indicator {at} is {} at time {} s", indicators[at], self.timeline.time);
            return Err(self.discard(function, message));
        }
        Ok(())
    }

    /// fmi3GetNumberOfContinuousStates. It changes with structural parameters.
    pub(crate) fn state_count(&self) -> usize {
        self.present_states.as_ref().map_or(self.layout().states.counts.reals, Vec::len)
    }

    /// Position in memory of a present state.
    fn state_at(&self, number: usize) -> usize {
        self.present_states.as_ref().map_or(number, |present| present[number])
    }

    /// Reads the present states, or their derivatives, from the reals of a block.
    fn read_states(&self, range: Range<usize>, values: &mut [f64]) {
        let reals = &self.values.reals[range];
        match &self.present_states {
            None => values.copy_from_slice(reals),
            Some(present) => values.iter_mut().zip(present).for_each(|(value, &at)| *value = reals[at]),
        }
    }

    /// Indices of the reals of the states or derivatives. Fails if `array` does not have the number of present states.
    fn range(&self, function: Function, block: Block, array: &[f64]) -> CallResult<Range<usize>> {
        self.check(function)?;
        self.check_length(function, "states", self.state_count(), array.len())?;
        Ok(block.reals())
    }

    fn check_length(&self, function: Function, what: &str, expected: usize, got: usize) -> CallResult {
        if expected == got {
            return Ok(());
        }
        Err(self.error(function, format_args!("the model has {expected} {what}, the array has the length {got}")))
    }

    pub(super) fn discard(&self, function: Function, message: impl std::fmt::Display) -> CallError {
        CallError::Discard(format!("{}: {message}", function.name(self.protocol.version)))
    }
}
