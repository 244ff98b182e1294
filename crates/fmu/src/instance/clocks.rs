//! Clocks of FMI 3.0: activation, intervals, and access to clocked variables.

use super::{CallResult, Instance};
use crate::calls::{Function, Interface, Mode};
use crate::clocks::{self, InputClock, Interval, Schedule, Setting, Span, Timing};
use crate::runner::{Model, Run};
use crate::timeline::{Timeline, is_within_tolerance};
use crate::variable::{Kind, Variable};

/// Answer of fmi3GetIntervalDecimal: what the interval is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Qualifier {
    /// A countdown clock that was not started.
    NotYetKnown = 0,
    /// The interval that was returned before.
    Unchanged = 1,
    /// A new interval.
    Changed = 2,
}

impl<M: Model> Instance<M> {
    /// The clock with a reference. Fails if there is none.
    fn clock(&self, function: Function, reference: u32) -> CallResult<&Variable> {
        match self.layout().by_reference(reference) {
            Some(variable) if matches!(variable.declaration.kind, Kind::Clock(_)) => Ok(variable),
            _ => Err(self.unknown_reference(function, reference)),
        }
    }

    /// The input clock with a reference and its present timing, with its position among them.
    fn input_clock(&self, function: Function, reference: u32) -> CallResult<(usize, InputClock)> {
        let variable = self.clock(function, reference)?;
        match variable.declaration.kind {
            Kind::Clock(Some(_)) => {
                let position = variable.index - self.layout().clocks.at.booleans;
                Ok((position, clocks::present(M::CLOCKS, position, self.layout(), &self.values)))
            }
            _ => {
                let message =
                    format_args!("'{}' is an output clock, which only the model activates", variable.declaration.name);
                Err(self.error(function, message))
            }
        }
    }

    fn schedule(&mut self, clock: usize) -> CallResult<&mut Schedule> {
        self.derive()?;
        Ok(&mut M::schedules(self.context().run)[clock])
    }

    /// fmi3SetClock. Fails, without activating a clock, if a reference is not an input clock, or if a time-based clock
    /// does not tick at the present time.
    pub fn set_clock(&mut self, references: &[u32], values: impl Iterator<Item = bool> + Clone) -> CallResult {
        let function = Function::SetClock;
        self.check(function)?;
        let time = self.timeline.time;
        for (&reference, is_active) in references.iter().zip(values.clone()) {
            let (position, clock) = self.input_clock(function, reference)?;
            let schedule = *self.schedule(position)?;
            if !is_active || clock.timing == Timing::Triggered || schedule.is_due(time) {
                continue;
            }
            let rule = match schedule.next.is_finite() {
                true => format!("ticks next at {} s", schedule.next),
                false => "was not started".to_owned(),
            };
            return Err(self.error(function, format_args!("the clock '{}' {rule}; it is {time} s now", clock.name)));
        }
        for (&reference, is_active) in references.iter().zip(values) {
            let index = self.clock(function, reference)?.index;
            self.values.booleans[index] = is_active;
        }
        self.forget_results();
        Ok(())
    }

    /// fmi3GetClock. Fails if a reference is not a clock, or like [`Self::get_real`].
    pub fn get_clock(&mut self, reference: u32) -> CallResult<bool> {
        let function = Function::GetClock;
        self.check(function)?;
        let index = self.clock(function, reference)?.index;
        self.check_clocked(function, &[reference])?;
        self.refresh(false, true, false)?;
        Ok(self.values.booleans[index])
    }

    /// Notes that the importer knows whether these output clocks tick: scheduled execution reports a tick once.
    pub fn ticks_are_known(&mut self, references: &[u32]) {
        if self.protocol.interface == Interface::ScheduledExecution {
            for reference in references {
                let clock = self.layout().by_reference(*reference).map(|variable| variable.index);
                clock.into_iter().for_each(|index| self.values.booleans[index] = false);
            }
        }
    }

    /// fmi3ActivateModelPartition: runs the part of an input clock at `time` in s. Returns true if an output clock has
    /// ticked or a countdown clock was started. Fails, without changes, if the reference is not an input clock, if
    /// `time` is not later than the last tick of the clock or goes past the stop time, or if the part fails.
    pub fn activate(&mut self, reference: u32, time: f64) -> CallResult<bool> {
        let function = Function::ActivateModelPartition;
        self.check(function)?;
        let (clock, InputClock { name, .. }) = self.input_clock(function, reference)?;
        let Timeline { start, stop, .. } = self.timeline;
        if !time.is_finite() {
            let message = format_args!("activationTime of the clock '{name}' must be finite, got {time} s");
            return Err(self.error(function, message));
        }
        if let Some(stop) = stop
            && !is_within_tolerance(time - stop, time, time - start)
        {
            let rule = format_args!("must not be after stopTime = {stop} s");
            let message = format_args!("activationTime of the clock '{name}' {rule}, got {time} s");
            return Err(self.error(function, message));
        }
        self.derive()?;
        let needs_update = M::activate(self.context(), clock, time).map_err(|error| self.error(function, error))?;
        self.timeline.time = self.timeline.time.max(time);
        Ok(needs_update)
    }

    /// Scheduled execution: enters Clock Update Mode for a call in the importer's `clockUpdate`, or leaves it.
    pub(crate) fn set_updating(&mut self, is_updating: bool) {
        if matches!(self.mode, Mode::ClockActivation | Mode::ClockUpdate) {
            self.enter(if is_updating { Mode::ClockUpdate } else { Mode::ClockActivation });
        }
    }

    /// fmi3GetIntervalDecimal: the interval in s, and what it is worth. Fails if the reference is not a time-based
    /// input clock, or if the parameters are inconsistent.
    pub fn interval(&mut self, reference: u32) -> CallResult<(f64, Qualifier)> {
        let function = Function::GetIntervalDecimal;
        self.check(function)?;
        let (position, clock) = self.input_clock(function, reference)?;
        if clock.timing == Timing::Triggered {
            return Err(
                self.error(function, format_args!("'{}' is a triggered clock, which has no interval", clock.name))
            );
        }
        let is_scheduled = self.protocol.interface == Interface::ScheduledExecution;
        if is_scheduled && !self.is_before_start() {
            self.derive()?;
            M::update_intervals(self.context()).map_err(|error| self.error(function, error))?;
        }
        let schedule = *self.schedule(position)?;
        let is_countdown = matches!(clock.timing, Timing::Countdown(_));
        let qualifier = match schedule.is_new {
            _ if is_countdown && schedule.next.is_infinite() => Qualifier::NotYetKnown,
            // The importer knows the interval from the description.
            true if !matches!(clock.timing, Timing::Periodic { interval: Interval::Constant(_), .. }) => {
                Qualifier::Changed
            }
            _ => Qualifier::Unchanged,
        };
        // In scheduled execution, an interval counts from the activation that has set it, whatever other threads do.
        let time = self.timeline.time;
        let interval = if is_scheduled { schedule.interval } else { schedule.interval_at(clock.timing, time) };
        Ok((if qualifier == Qualifier::NotYetKnown { 0.0 } else { interval }, qualifier))
    }

    /// Notes that the importer knows the intervals of these clocks. Fails like [`Self::interval`].
    pub fn intervals_are_known(&mut self, function: Function, references: &[u32]) -> CallResult {
        for &reference in references {
            let (position, _) = self.input_clock(function, reference)?;
            self.schedule(position)?.is_new = false;
        }
        // Active clocks were perhaps evaluated from schedules that the importer did not know.
        self.forget_results();
        Ok(())
    }

    /// fmi3GetIntervalFraction: counter and resolution. Fails like [`Self::interval`], or if the clock has no fraction.
    pub fn interval_fraction(&mut self, reference: u32) -> CallResult<((u64, u64), Qualifier)> {
        let function = Function::GetIntervalFraction;
        self.check(function)?;
        match self.input_clock(function, reference)?.1.timing {
            Timing::Periodic { interval: Interval::Constant(Span::Fraction(counter, resolution)), .. } => {
                Ok(((counter, resolution), self.interval(reference)?.1))
            }
            _ => Err(self.no_fraction(function, reference)),
        }
    }

    fn no_fraction(&self, function: Function, reference: u32) -> super::CallError {
        let name = self.layout().by_reference(reference).map_or("", |variable| &variable.declaration.name);
        let what = if function == Function::GetShiftFraction { "shift" } else { "interval" };
        let message = format_args!("the {what} of the clock '{name}' is not a fraction: use the function for decimals");
        self.error(function, message)
    }

    fn shift_of(&self, function: Function, reference: u32) -> CallResult<Span> {
        self.check(function)?;
        match self.input_clock(function, reference)?.1 {
            InputClock { timing: Timing::Periodic { shift, .. }, .. } => Ok(shift),
            InputClock { name, .. } => {
                Err(self.error(function, format_args!("'{name}' is not a periodic clock, and has no shift")))
            }
        }
    }

    /// fmi3GetShiftDecimal: time of the first tick after the start in s. Fails if the reference is not a periodic
    /// clock.
    pub fn shift(&self, reference: u32) -> CallResult<f64> {
        self.shift_of(Function::GetShiftDecimal, reference).map(Span::seconds)
    }

    /// fmi3GetShiftFraction: counter and resolution. Fails like [`Self::shift`], or if the clock has no fraction.
    pub fn shift_fraction(&self, reference: u32) -> CallResult<(u64, u64)> {
        let function = Function::GetShiftFraction;
        match self.shift_of(function, reference)? {
            Span::Fraction(counter, resolution) => Ok((counter, resolution)),
            Span::Decimal(_) => Err(self.no_fraction(function, reference)),
        }
    }

    /// fmi3SetIntervalDecimal, fmi3SetIntervalFraction, fmi3SetShiftDecimal and fmi3SetShiftFraction. Fails, without
    /// changes, if a reference is not a clock that leaves its timing to the importer in this mode, if an interval is not
    /// above 0, if a shift is below 0, or for a fraction if the clock does not support it.
    pub fn set_timing(
        &mut self,
        function: Function,
        references: &[u32],
        spans: impl Iterator<Item = Span> + Clone,
    ) -> CallResult {
        self.check(function)?;
        let is_shift = matches!(function, Function::SetShiftDecimal | Function::SetShiftFraction);
        let (what, least) = if is_shift { ("shift", "at least") } else { ("interval", "above") };
        for (&reference, span) in references.iter().zip(spans.clone()) {
            let (position, InputClock { name, timing, .. }) = self.input_clock(function, reference)?;
            let (declared, seconds) = (M::CLOCKS[position].timing.interval(), span.seconds());
            let has_fractions = matches!(declared, Some(Interval::Constant(Span::Fraction(..))));
            let is_valid = seconds.is_finite() && (seconds > 0.0 || (is_shift && seconds >= 0.0));
            let problem = match (timing, declared) {
                (_, Some(Interval::Of(name))) => format!("cannot be set: set the parameter '{name}' instead"),
                _ if !timing.is_settable() => "cannot be set: the model determines it".to_owned(),
                (Timing::Periodic { setting: Setting::Fixed, .. }, _) if !self.is_before_start() => {
                    "cannot be set after Initialization Mode, because the clock is fixed".to_owned()
                }
                _ if matches!(span, Span::Fraction(..)) && !has_fractions => {
                    "cannot be set as a fraction (supportsFraction is false)".to_owned()
                }
                _ if !is_valid => format!("must be finite and {least} 0 s, got {seconds} s"),
                _ => continue,
            };
            return Err(self.error(function, format_args!("the {what} of the clock '{name}' {problem}")));
        }
        for (&reference, span) in references.iter().zip(spans) {
            let (position, _) = self.input_clock(function, reference)?;
            if let Some(at) = clocks::words(M::CLOCKS, position, self.layout()) {
                let at = at + if is_shift { 2 } else { 0 };
                self.values.words[at..at + 2].copy_from_slice(&span.words());
            }
        }
        if self.is_before_start() {
            // The ticks count from the start.
            self.run = None;
        }
        self.forget_results();
        Ok(())
    }

    /// Rejects access to a clocked variable while its clock is not active (FMI 3.0, section 2.2.8). Without Event Mode,
    /// clocks tick inside the steps, and clocked variables are ordinary ones.
    pub(super) fn check_clocked(&self, function: Function, references: &[u32]) -> CallResult {
        let has_event_mode = self.uses_event_mode || self.protocol.interface == Interface::ModelExchange;
        if !M::HAS_CLOCKS || !has_event_mode || self.is_before_start() {
            return Ok(());
        }
        let layout = self.layout();
        let clocked = references.iter().filter_map(|&reference| layout.by_reference(reference));
        for variable in clocked.filter(|variable| !variable.declaration.details.clocks.is_empty()) {
            let is_active =
                self.mode == Mode::Event && layout.clocks_of(variable).any(|clock| self.values.booleans[clock.index]);
            if !is_active {
                let (name, of, mode) =
                    (&variable.declaration.name, variable.declaration.details.clocks, self.mode.name());
                let (clock, of) = (if of.len() == 1 { "its clock" } else { "one of its clocks" }, of.join("', '"));
                let message = format_args!(
                    "'{name}' can be read and set only in Event Mode while {clock} '{of}' is active; the instance is in {mode}"
                );
                return Err(self.error(function, message));
            }
        }
        Ok(())
    }

    /// Model exchange: rejects an integrator step past a tick.
    pub fn check_integrator_step(&mut self) -> CallResult {
        self.derive()?;
        let time = self.timeline.time;
        match M::missed_tick(self.context(), time, f64::INFINITY) {
            Some(message) => Err(self.error(Function::CompletedIntegratorStep, message)),
            None => Ok(()),
        }
    }

    /// Deactivates the input clocks. Without fmi3UpdateDiscreteStates, which the standard requires at the end of an
    /// event, they have no effect.
    pub(super) fn deactivate_clocks(&mut self) {
        if M::HAS_CLOCKS {
            let clocks = self.layout().clocks.booleans();
            self.values.booleans[clocks].fill(false);
            self.forget_results();
        }
    }

    /// Rejects a step of `step` s to `end` that goes past a tick of a clock that the importer activates.
    pub(super) fn check_ticks(&mut self, end: f64, step: f64) -> CallResult<Option<String>> {
        if !M::HAS_CLOCKS || !self.uses_event_mode {
            return Ok(None);
        }
        self.derive()?;
        let Run { ctx, run, values } = self.context();
        Ok(M::missed_tick(Run { ctx, run, values }, end, step))
    }
}
