//! Clocks of FMI 3.0 in co-simulation (FMI 3.0.2, sections 2.2.8, 2.3.5 and 4.2).
//!
//! The loader activates time-based clocks inside [`Instance::do_step`], as an FMU of FMI 2.0 takes its samples: a clock
//! that is due at the start of a step ticks with the inputs from before the step; one that is due at the end ticks in
//! the next step. Between two ticks, clocked variables keep their values. Triggered input clocks do not tick.
//!
//! A master that connects clocks of several instances handles their events itself ([`Instance::share_events`]): it ends
//! its steps at the next tick of any instance ([`Instance::next_tick`], [`Instance::step`]). At each tick, it lets
//! instances begin an event, activates clocks, evaluates and updates the instances, and ends the event.

use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::instance::Instance;
use super::model_exchange::EventUpdate;
use super::special::OTHER_TYPE;
use crate::c_api::Reference;
use crate::c_api::v3::RawBoolean;
use crate::description::{Interface, IntervalVariability as Kind, Value};
use crate::signature::{Clocked, InputClock, Signature};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ffi::c_int;
use std::sync::Arc;

/// Two times are the same instant if they differ by at most this fraction of the step, or four units in the last place.
const SLACK: f64 = 1e-6;
const ROUNDINGS: f64 = 4.0;
/// Maximum number of event iterations at one time, and of evaluations of an instance in an iteration.
pub const MOST_ITERATIONS: usize = 100;
/// Qualifiers of `fmi3GetIntervalDecimal`.
const NOT_YET_KNOWN: c_int = 0;
pub(super) const CHANGED: c_int = 2;
/// Ends the bytes of a saved state with clocks.
const MARK: &[u8; 8] = b"\0clocks\n";

const BROKEN: CallProblem =
    CallProblem::Arguments("an event has failed before; restore a saved state, or reset the instance");
const WRONG_INTERVAL: CallProblem = CallProblem::Arguments(
    "the FMU returned an interval that is not a finite number, or not above 0 for a periodic clock",
);

/// An interval for which the loader has asked the FMU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AskedInterval {
    /// The clock.
    pub clock: Reference,
    /// Qualifier: 0 not yet known, 1 unchanged, 2 changed.
    pub qualifier: c_int,
    /// True if the clock has a next tick whatever the answer.
    pub was_pending: bool,
}

/// Clocks of an instance.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Clocks {
    inputs: Vec<Ticks>,
    /// True between events, when clocked variables cannot be accessed.
    is_held: bool,
    /// The values of clocked variables; for an output clock, whether it has ticked in the last step.
    held: BTreeMap<Reference, Vec<Held>>,
    /// Clocked inputs that were set since the last tick of their clocks.
    pending: Vec<Reference>,
    /// Input clocks that are active in the present iteration of an event, and output clocks that tick.
    #[serde(skip)]
    pub(super) active: Vec<Reference>,
    #[serde(skip)]
    pub(super) fired: Vec<Reference>,
    /// Intervals since the last iteration of an event, or in the last activation.
    #[serde(skip)]
    pub(super) asked: Vec<AskedInterval>,
    /// Time of the next time event in s, if the FMU has announced one.
    next_event: Option<f64>,
    /// True if the caller handles the events.
    #[serde(skip)]
    is_shared: bool,
    /// True in Event Mode, and after an event that failed.
    is_in_event: bool,
}

/// A value that is kept between two ticks.
#[derive(Debug, Clone, Serialize, Deserialize)]
enum Held {
    /// The bits of a Real, because JSON has neither infinity nor NaN.
    Real(u64),
    Other(Value),
}

impl Held {
    fn of(value: Value) -> Self {
        if let Value::Real(number) = value { Self::Real(number.to_bits()) } else { Self::Other(value) }
    }

    fn value(&self) -> Value {
        match self {
            Self::Real(bits) => Value::Real(f64::from_bits(*bits)),
            Self::Other(value) => value.clone(),
        }
    }
}

/// The times at which a clock ticks.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Ticks {
    clock: InputClock,
    /// Time from which the ticks of a periodic clock are counted, and the number of the next tick.
    base: f64,
    count: u64,
    interval: f64,
    /// Time of the next tick in s, if it is known.
    next: Option<f64>,
}

impl Ticks {
    fn is_periodic(&self) -> bool {
        matches!(self.clock.kind, Kind::Constant | Kind::Fixed | Kind::Tunable)
    }

    fn is_due(&self, time: f64, step: f64) -> bool {
        let part = if self.interval > 0.0 { step.min(self.interval) } else { step };
        self.next.is_some_and(|next| next <= time + slack(time, part))
    }

    /// Sets a new interval, which counts from `time` for an aperiodic clock, from the last tick for a periodic one.
    fn set_interval(&mut self, interval: f64, time: f64) {
        if !self.is_periodic() {
            self.next = Some(time + interval);
        } else if self.count > 0 {
            // A tick that would be in the past is due now, and the next one follows after the new interval.
            let last = self.base + (self.count - 1) as f64 * self.interval;
            (self.base, self.count) = (last.max(time - interval), 1);
            self.next = Some((self.base + interval).max(time));
        }
        self.interval = interval;
    }

    /// Moves on after a tick.
    fn advance(&mut self) {
        self.next = None;
        if self.is_periodic() {
            self.count += 1;
            self.next = Some(self.base + self.count as f64 * self.interval);
        }
    }
}

impl Clocks {
    /// The clocks of an FMU; `None` if it has none or is used for model exchange, unless its events are used.
    pub(super) fn of(signature: &Signature, uses_events: bool) -> Option<Box<Self>> {
        let ticks = |clock: &InputClock| Ticks {
            clock: clock.clone(),
            base: 0.0,
            count: 0,
            interval: clock.interval.unwrap_or(0.0),
            next: None,
        };
        let has_ticks = signature.has_clocks && signature.interface != Interface::ModelExchange;
        (has_ticks || uses_events).then(|| {
            let inputs = signature.clocks.iter().map(ticks).collect();
            let held = |clock: &(Reference, _)| (clock.0, vec![Held::Other(Value::Boolean(false))]);
            let held = signature.output_clocks.iter().map(held).collect();
            Box::new(Self { inputs, held, ..Self::default() })
        })
    }

    /// Appends the clocks to the bytes of a saved state.
    pub(super) fn append(&self, bytes: &mut Vec<u8>) {
        let clocks = serde_json::to_vec(self).unwrap_or_default();
        bytes.extend(&clocks);
        bytes.extend((clocks.len() as u64).to_le_bytes());
        bytes.extend(MARK);
    }

    /// Separates the bytes of the FMU from the clocks. `None` if they are not those of this FMU.
    pub(super) fn split<'b>(bytes: &'b [u8], signature: &Signature) -> Option<(&'b [u8], Box<Self>)> {
        let bytes = bytes.strip_suffix(MARK)?;
        let (bytes, length) = bytes.split_last_chunk()?;
        let at = bytes.len().checked_sub(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        let clocks: Box<Self> = serde_json::from_slice(&bytes[at..]).ok()?;
        let is_whole =
            !clocks.is_held || signature.clocked.iter().all(|variable| clocks.held.contains_key(&variable.reference));
        let has_inputs = clocks.inputs.iter().map(|ticks| &ticks.clock).eq(&signature.clocks);
        (is_whole && has_inputs).then_some((&bytes[..at], clocks))
    }

    /// Sets whether an output clock has ticked in the last step.
    pub(super) fn mark(&mut self, clock: Reference, has_ticked: bool) {
        if let Some([held]) = self.held.get_mut(&clock).map(Vec::as_mut_slice) {
            *held = Held::Other(Value::Boolean(has_ticked));
        }
    }

    /// Time of the next tick or time event in s.
    fn next(&self) -> Option<f64> {
        self.inputs.iter().filter_map(|ticks| ticks.next).chain(self.next_event).reduce(f64::min)
    }

    fn is_due(&self, time: f64, step: f64) -> bool {
        let is_event_due = self.next_event.is_some_and(|next| next <= time + slack(time, step));
        is_event_due || self.inputs.iter().any(|ticks| ticks.is_due(time, step))
    }

    /// Returns true if the FMU must be asked for intervals, because parameters may have changed.
    fn has_tunable(&self) -> bool {
        self.inputs.iter().any(|ticks| ticks.clock.kind == Kind::Tunable && ticks.clock.interval.is_none())
    }
}

fn slack(time: f64, part: f64) -> f64 {
    SLACK * part.min(1.0) + ROUNDINGS * (time.abs().next_up() - time.abs())
}

impl Instance {
    /// Returns true if clocked variables are among these, and cannot be accessed now.
    pub(super) fn has_clocked(&self, refs: &[Reference]) -> bool {
        self.clocks.as_ref().is_some_and(|clocks| refs.iter().any(|r| clocks.held.contains_key(r)))
    }

    /// Reads variables; clocked ones have the values of their last tick.
    pub(super) fn get_held<T>(
        &mut self,
        refs: &[Reference],
        mut values: &mut [T],
        of: impl Fn(&Value) -> Option<T>,
        get: impl Fn(&mut Self, &[Reference], &mut [T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_elements(Function::GetReal, refs, values.len())?;
        for reference in refs {
            let own = values.split_off_mut(..self.elements(&[*reference])).unwrap_or_default();
            let Some(held) = self.clocks.as_ref().and_then(|clocks| clocks.held.get(reference)) else {
                get(self, &[*reference], own)?;
                continue;
            };
            for (own, value) in own.iter_mut().zip(held) {
                let Some(value) = of(&value.value()) else { return Err(self.failure(Function::GetReal, OTHER_TYPE)) };
                *own = value;
            }
        }
        Ok(())
    }

    /// Sets variables; clocked inputs are set at the next tick of their clocks.
    pub(super) fn set_held<T>(
        &mut self,
        refs: &[Reference],
        mut values: &[T],
        to: impl Fn(&T) -> Option<Value>,
        set: impl Fn(&mut Self, &[Reference], &[T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_elements(Function::GetReal, refs, values.len())?;
        for reference in refs {
            let own = values.split_off(..self.elements(&[*reference])).unwrap_or_default();
            match &mut self.clocks {
                Some(clocks) if clocks.held.contains_key(reference) => {
                    let values: Vec<Value> = own.iter().filter_map(&to).collect();
                    let old = &clocks.held[reference];
                    let is_same = |(new, old): (&Value, &Held)| new.base_type() == old.value().base_type();
                    if values.len() != old.len() || !values.iter().zip(old).all(is_same) {
                        return Err(self.failure(Function::SetReal, OTHER_TYPE));
                    }
                    clocks.held.insert(*reference, values.into_iter().map(Held::of).collect());
                    if !clocks.pending.contains(reference) {
                        clocks.pending.push(*reference);
                    }
                }
                _ => set(self, &[*reference], own)?,
            }
        }
        Ok(())
    }

    /// In Initialization Mode: asks for intervals and shifts, and reads the clocked variables.
    pub(super) fn start_clocks(&mut self, start: f64) -> Result<(), CallError> {
        let library = Arc::clone(self.library());
        let mut held = BTreeMap::new();
        for variable in &library.signature.clocked {
            let values = self.values_of(variable.reference, variable.base_type, variable.size)?;
            held.insert(variable.reference, values.into_iter().map(Held::of).collect());
        }
        let Some(mut clocks) = self.clocks.take() else { return Ok(()) };
        let started = self.start_ticks(&mut clocks, start);
        clocks.held.extend(held);
        self.clocks = Some(clocks);
        started
    }

    fn start_ticks(&mut self, clocks: &mut Clocks, start: f64) -> Result<(), CallError> {
        for ticks in &mut clocks.inputs {
            let reference = ticks.clock.reference;
            (ticks.base, ticks.count) = (start, 0);
            if ticks.is_periodic() {
                let mut shift = ticks.clock.shift;
                if ticks.clock.interval.is_none() {
                    ticks.interval = self.get_interval(reference)?.0;
                    shift = self.get_shift(reference)?;
                }
                if !(ticks.interval > 0.0 && ticks.interval.is_finite() && shift.is_finite()) {
                    return Err(self.failure(Function::GetIntervalDecimal, WRONG_INTERVAL));
                }
                ticks.base = start + shift;
                ticks.next = Some(ticks.base);
            } else if ticks.clock.kind != Kind::Triggered {
                let (interval, qualifier) = self.get_interval(reference)?;
                if let Some(interval) = self.known(interval, qualifier, false)? {
                    ticks.set_interval(interval, start);
                }
            }
        }
        Ok(())
    }

    /// A new interval in s; `None` if it is not known or unchanged.
    fn known(&mut self, interval: f64, qualifier: c_int, is_periodic: bool) -> Result<Option<f64>, CallError> {
        let is_valid = interval.is_finite() && (interval > 0.0 || (interval == 0.0 && !is_periodic));
        match qualifier {
            CHANGED if is_valid => Ok(Some(interval)),
            CHANGED => Err(self.failure(Function::GetIntervalDecimal, WRONG_INTERVAL)),
            _ => Ok(None),
        }
    }

    /// `fmi3GetIntervalDecimal`: the interval in s and its qualifier, see [`AskedInterval`].
    pub fn get_interval(&mut self, clock: Reference) -> Result<(f64, c_int), CallError> {
        let (mut interval, mut qualifier) = (0.0, NOT_YET_KNOWN);
        // SAFETY: live instance; one clock, and its interval is written through valid pointers.
        self.call_v3(Function::GetIntervalDecimal, |f, c| unsafe {
            Some(f.get_interval?(c, &raw const clock, 1, &raw mut interval, &raw mut qualifier))
        })?;
        Ok((interval, qualifier))
    }

    /// `fmi3SetIntervalDecimal`; the interval is in s.
    pub fn set_interval(&mut self, clock: Reference, interval: f64) -> Result<(), CallError> {
        // SAFETY: live instance; one clock and its interval.
        self.call_v3(Function::SetIntervalDecimal, |f, c| unsafe {
            Some(f.set_interval?(c, &raw const clock, 1, &raw const interval))
        })
    }

    /// `fmi3GetClock`: true if the clock is active.
    pub fn get_clock(&mut self, clock: Reference) -> Result<bool, CallError> {
        let mut is_active: RawBoolean = 0;
        // SAFETY: live instance; one clock, and its state is written through a valid pointer.
        self.call_v3(Function::GetClock, |f, c| unsafe {
            Some(f.get_clock?(c, &raw const clock, 1, &raw mut is_active))
        })?;
        Ok(is_active != 0)
    }

    /// `fmi3SetClock` that deactivates an input clock which was activated in this iteration of an event.
    pub fn deactivate(&mut self, clock: Reference) -> Result<(), CallError> {
        if let Some(clocks) = &mut self.clocks {
            clocks.active.retain(|active| *active != clock);
        }
        self.set_clocks(&[clock], &[false])
    }

    fn set_clocks(&mut self, clocks: &[Reference], are_active: &[bool]) -> Result<(), CallError> {
        // SAFETY: live instance; both arrays have the stated length.
        self.call_v3(Function::SetClock, |f, c| unsafe {
            Some(f.set_clock?(c, clocks.as_ptr(), clocks.len(), are_active.as_ptr()))
        })
    }

    /// Accesses clocked variables in the FMU itself, whether or not one of their clocks is active.
    pub fn unheld<T: Default>(
        &mut self,
        access: impl FnOnce(&mut Self) -> Result<T, CallError>,
    ) -> Result<T, CallError> {
        self.with_clocks(|this, _| access(this))
    }

    /// `fmi3GetShiftDecimal`: the time of the first tick after the start in s.
    pub fn get_shift(&mut self, clock: Reference) -> Result<f64, CallError> {
        let mut shift = 0.0;
        // SAFETY: live instance; one clock, and its shift is written through a valid pointer.
        self.call_v3(Function::GetShiftDecimal, |f, c| unsafe {
            Some(f.get_shift?(c, &raw const clock, 1, &raw mut shift))
        })?;
        Ok(shift)
    }

    /// After the initialization, in Event Mode. Clocks that are due at the start tick in the first step.
    pub(super) fn enter_first_step_mode(&mut self) -> Result<(), CallError> {
        let start = self.experiment().0;
        let Some(clocks) = &mut self.clocks else { return Ok(()) };
        clocks.is_held = true;
        if self.integration.is_some() {
            return Ok(());
        }
        clocks.is_in_event = true;
        if clocks.is_shared || self.is_scheduled() { Ok(()) } else { self.handle_event(start, 1.0, false) }
    }

    /// `fmi3DoStep` from tick to tick.
    pub(super) fn step_with_clocks(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        let end = time + step;
        let mut now = time;
        self.begin_step()?;
        let mut is_needed = self.is_event_needed(now, step);
        loop {
            if is_needed {
                self.begin_event()?;
                self.handle_event(now, step, true)?;
            }
            let until = self.next_tick(now, end, step).unwrap_or(end);
            self.step(now, until - now)?;
            now = until;
            if self.wants_event() {
                self.begin_event()?;
                self.handle_event(now, step, true)?;
            }
            if now >= end {
                return Ok(());
            }
            is_needed = self.is_due(now, step);
        }
    }

    /// Handles an event and enters Step Mode. All clocks that are due tick, until none is due and the FMU needs no
    /// further iteration.
    fn handle_event(&mut self, time: f64, step: f64, has_ticks: bool) -> Result<(), CallError> {
        let mut due = Vec::new();
        for _ in 0..MOST_ITERATIONS {
            due = if has_ticks { self.due_clocks(time, step) } else { due };
            self.activate(&due)?;
            self.evaluate()?;
            let mut is_needed_again = self.update(time)?;
            is_needed_again |= has_ticks && !self.due_clocks(time, step).is_empty();
            if !is_needed_again {
                return self.end_event();
            }
        }
        let names = self.signature().clocks.iter().filter(|clock| due.contains(&clock.reference));
        let names: Vec<String> = names.map(|clock| format!("`{}`", clock.name)).collect();
        Err(self.endless(&names))
    }

    /// The error after [`MOST_ITERATIONS`] iterations of an event, in the last of which these clocks have ticked.
    #[cold]
    pub fn endless(&mut self, clocks: &[String]) -> CallError {
        let names = if clocks.is_empty() { "no clock".to_owned() } else { clocks.join(", ") };
        let reason = format!(
            "more than {MOST_ITERATIONS} event iterations at one time, in each of which these clocks tick: {names}; \
             start one of them with an interval above 0"
        );
        self.failed_event(reason)
    }

    /// The error of an event that cannot be completed for this reason.
    #[cold]
    pub fn failed_event(&mut self, reason: String) -> CallError {
        self.failure(Function::NewDiscreteStates, CallProblem::Events(reason))
    }

    /// Lets the caller handle the events from the end of the initialization on, in place of [`Self::do_step`]. Then
    /// [`Self::exit_initialization_mode`] begins an event.
    pub fn share_events(&mut self) {
        if let Some(clocks) = &mut self.clocks {
            clocks.is_shared = true;
        }
    }

    /// Returns true if the FMU has clocks in co-simulation.
    pub fn has_clocks(&self) -> bool {
        self.clocks.is_some() && self.signature().interface == Interface::CoSimulation
    }

    /// Intervals for which the loader has asked in the last iteration of an event, or in the last activation.
    pub fn asked_intervals(&self) -> &[AskedInterval] {
        self.clocks.as_ref().map_or(&[], |clocks| &clocks.asked)
    }

    /// Returns true if a variable belongs to clocks.
    pub fn is_clocked(&self, variable: Reference) -> bool {
        let whole = self.signature().element(variable).map_or(variable, |(element, _)| element.array);
        self.signature().clocked.iter().any(|clocked| clocked.reference == whole)
    }

    /// Returns true if a clock is active, or an output clock ticks, in the present iteration of an event.
    pub fn is_active(&self, clock: Reference) -> bool {
        self.clocks.as_ref().is_some_and(|clocks| clocks.active.contains(&clock) || clocks.fired.contains(&clock))
    }

    /// Names of the active input clocks.
    pub fn active_clocks(&self) -> impl Iterator<Item = &str> {
        let clocks = self.signature().clocks.iter().filter(|clock| self.is_active(clock.reference));
        clocks.map(|clock| clock.name.as_str())
    }

    /// Returns true in Event Mode, and after an event that failed.
    pub fn is_in_event(&self) -> bool {
        self.clocks.as_ref().is_some_and(|clocks| clocks.is_in_event)
    }

    /// Before a step and its events. Fails after an event that failed.
    pub fn begin_step(&mut self) -> Result<(), CallError> {
        if self.is_in_event() {
            return Err(self.failure(Function::DoStep, BROKEN));
        }
        self.clear_ticks();
        Ok(())
    }

    /// Before a step: no output clock has ticked in it.
    pub(super) fn clear_ticks(&mut self) {
        let library = Arc::clone(self.library());
        if let Some(clocks) = &mut self.clocks {
            library.signature.output_clocks.iter().for_each(|(clock, _)| clocks.mark(*clock, false));
        }
    }

    /// Time of the next tick or time event in s, if it is after `now` and before `end` by more than rounding errors.
    /// The communication step in s determines their size.
    pub fn next_tick(&self, now: f64, end: f64, step: f64) -> Option<f64> {
        let next = self.clocks.as_ref().and_then(|clocks| clocks.next());
        next.filter(|next| *next > now && *next < end - slack(end, step))
    }

    pub(super) fn is_due(&self, time: f64, step: f64) -> bool {
        self.clocks.as_ref().is_some_and(|clocks| clocks.is_due(time, step))
    }

    /// Returns true if a step that starts at `time` must start with an event: a clock or a time event is due, or an
    /// interval may have changed with a parameter.
    pub fn is_event_needed(&self, time: f64, step: f64) -> bool {
        self.is_due(time, step) || self.clocks.as_ref().is_some_and(|clocks| clocks.has_tunable())
    }

    /// Returns true if the FMU requested an event in the last step, and none has begun since then.
    pub fn wants_event(&self) -> bool {
        self.step_end.event != 0
    }

    /// Time-based clocks that are due; in scheduled execution, in the order of their priorities.
    pub fn due_clocks(&self, time: f64, step: f64) -> Vec<Reference> {
        let inputs = self.clocks.iter().flat_map(|clocks| &clocks.inputs);
        inputs.filter(|ticks| ticks.is_due(time, step)).map(|ticks| ticks.clock.reference).collect()
    }

    /// `fmi3EnterEventMode`, unless the instance is in it.
    pub fn begin_event(&mut self) -> Result<(), CallError> {
        match &mut self.clocks {
            Some(clocks) if !clocks.is_in_event => clocks.is_in_event = true,
            _ => return Ok(()),
        }
        self.step_end.event = 0;
        // SAFETY: live instance.
        self.call_v3(Function::EnterEventMode, |f, c| unsafe { Some(f.begin_event?(c)) })
    }

    /// `fmi3SetClock`: activates input clocks in an event.
    pub fn activate(&mut self, input_clocks: &[Reference]) -> Result<(), CallError> {
        if input_clocks.is_empty() {
            return Ok(());
        }
        if let Some(clocks) = &mut self.clocks {
            clocks.active.extend(input_clocks);
        }
        self.set_clocks(input_clocks, &vec![true; input_clocks.len()])
    }

    /// Sets the inputs of the active clocks, and reads the outputs of these clocks and of the output clocks that tick.
    pub fn evaluate(&mut self) -> Result<(), CallError> {
        self.with_clocks(|this, clocks| {
            this.set_pending(clocks)?;
            let library = Arc::clone(this.library());
            clocks.fired.clear();
            for (clock, on) in &library.signature.output_clocks {
                let is_active = |on: &Reference| clocks.active.contains(on) || clocks.fired.contains(on);
                if (on.is_empty() || on.iter().any(is_active)) && this.get_clock(*clock)? {
                    clocks.fired.push(*clock);
                }
            }
            this.read_clocked(clocks)
        })
    }

    /// Sets the inputs of the active clocks that have new values.
    pub(super) fn set_pending(&mut self, clocks: &mut Clocks) -> Result<(), CallError> {
        let library = Arc::clone(self.library());
        let is_set = |one: &&Clocked| one.is_input && one.clocks.iter().any(|clock| clocks.active.contains(clock));
        for variable in library.signature.clocked.iter().filter(is_set) {
            if let Some(at) = clocks.pending.iter().position(|reference| *reference == variable.reference) {
                let values: Vec<Value> = clocks.held[&variable.reference].iter().map(Held::value).collect();
                self.set_values_of(variable.reference, variable.base_type, &values)?;
                clocks.pending.swap_remove(at);
            }
        }
        Ok(())
    }

    /// Reads the outputs of the active clocks and of the output clocks that tick.
    pub(super) fn read_clocked(&mut self, clocks: &mut Clocks) -> Result<(), CallError> {
        let library = Arc::clone(self.library());
        let is_active = |clock: &Reference| clocks.active.contains(clock) || clocks.fired.contains(clock);
        let is_read = |one: &&Clocked| !one.is_input && one.clocks.iter().any(is_active);
        for variable in library.signature.clocked.iter().filter(is_read) {
            let values = self.values_of(variable.reference, variable.base_type, variable.size)?;
            clocks.held.insert(variable.reference, values.into_iter().map(Held::of).collect());
        }
        Ok(())
    }

    /// `fmi3UpdateDiscreteStates`, which deactivates all clocks; then asks for intervals, which count from `time` in s.
    /// Returns true if the FMU needs another iteration.
    pub fn update(&mut self, time: f64) -> Result<bool, CallError> {
        let update = self.update_clocks(time)?;
        if update.terminates {
            return Err(self.failure(Function::NewDiscreteStates, CallProblem::Terminated));
        }
        if let Some(clocks) = &mut self.clocks {
            clocks.next_event = update.next_event;
        }
        Ok(update.is_needed_again)
    }

    /// Like [`Self::update`], but leaves time events and the end of the simulation to the caller.
    pub(super) fn update_clocks(&mut self, time: f64) -> Result<EventUpdate, CallError> {
        let update = self.new_discrete_states()?;
        if !update.terminates {
            self.with_clocks(|this, clocks| {
                std::mem::take(&mut clocks.fired).into_iter().for_each(|clock| clocks.mark(clock, true));
                this.advance_clocks(clocks, time, None)?;
                clocks.active.clear();
                Ok(())
            })?;
        }
        Ok(update)
    }

    /// Moves the active clocks on, and asks for intervals. `countdowns` are those of countdown clocks, if the FMU was
    /// asked before.
    pub(super) fn advance_clocks(
        &mut self,
        clocks: &mut Clocks,
        time: f64,
        countdowns: Option<&BTreeMap<Reference, (f64, c_int)>>,
    ) -> Result<(), CallError> {
        clocks.asked.clear();
        for ticks in &mut clocks.inputs {
            let clock = ticks.clock.reference;
            let has_ticked = clocks.active.contains(&clock);
            if has_ticked {
                ticks.advance();
            }
            let (interval, qualifier) = match (ticks.clock.kind, countdowns) {
                (Kind::Countdown, Some(known)) if !known.contains_key(&clock) => continue,
                (Kind::Countdown, Some(known)) => known[&clock],
                (Kind::Countdown, None) => self.get_interval(clock)?,
                (Kind::Changing, _) if has_ticked => self.get_interval(clock)?,
                (Kind::Tunable, _) if ticks.clock.interval.is_none() => self.get_interval(clock)?,
                _ => continue,
            };
            clocks.asked.push(AskedInterval { clock, qualifier, was_pending: ticks.next.is_some() });
            if let Some(interval) = self.known(interval, qualifier, ticks.is_periodic())? {
                ticks.set_interval(interval, time);
            }
        }
        Ok(())
    }

    /// `fmi3EnterStepMode` after an event.
    pub fn end_event(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_v3(Function::EnterStepMode, |f, c| unsafe { Some(f.end_event?(c)) })?;
        if let Some(clocks) = &mut self.clocks {
            clocks.is_in_event = false;
        }
        Ok(())
    }

    /// Accesses the clocks. In the meantime, clocked variables are not held but those of the FMU.
    pub(super) fn with_clocks<T: Default>(
        &mut self,
        access: impl FnOnce(&mut Self, &mut Clocks) -> Result<T, CallError>,
    ) -> Result<T, CallError> {
        let Some(mut clocks) = self.clocks.take() else { return Ok(T::default()) };
        let result = access(self, &mut clocks);
        self.clocks = Some(clocks);
        result
    }
}
