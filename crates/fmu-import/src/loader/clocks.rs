//! Clocks of FMI 3.0 in co-simulation (FMI 3.0.2, sections 2.2.9, 2.3.5 and 4.2).
//!
//! The loader activates time-based clocks inside [`Instance::do_step`], as an FMU of FMI 2.0 takes its samples: a clock
//! that is due at the start of a step ticks with the inputs from before the step; one that is due at the end ticks in
//! the next step. Between two ticks, clocked variables keep their values. Triggered input clocks never tick.

use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::instance::Instance;
use crate::c_api::Reference;
use crate::c_api::v3::RawBoolean;
use crate::description::{IntervalVariability as Kind, Value};
use crate::signature::{InputClock, Signature};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ffi::c_int;

/// Two times are the same instant if they differ by at most this fraction of the step, or four units in the last place.
const SLACK: f64 = 1e-6;
const ROUNDINGS: f64 = 4.0;
/// Maximum number of event iterations at one time.
const MOST_ITERATIONS: u32 = 100;
/// Qualifiers of `fmi3GetIntervalDecimal`.
const NOT_YET_KNOWN: c_int = 0;
const CHANGED: c_int = 2;
/// Ends the bytes of a saved state with clocks.
const MARK: &[u8; 8] = b"\0clocks\n";

const ENDLESS: CallProblem = CallProblem::Arguments("more than 100 event iterations at one time");
const WRONG_NUMBER: CallProblem = CallProblem::Arguments("the number of values must equal the number of elements");
const WRONG_TYPE: CallProblem = CallProblem::Arguments("the variable has another type");
const WRONG_INTERVAL: CallProblem = CallProblem::Arguments(
    "the FMU returned an interval that is not a finite number, or not above 0 for a periodic clock",
);

/// Clocks of an instance.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Clocks {
    inputs: Vec<Ticks>,
    /// True between events, when clocked variables cannot be accessed.
    is_held: bool,
    /// The values of clocked variables.
    held: HashMap<Reference, Vec<Value>>,
    /// Clocked inputs that were set since the last tick of their clocks.
    pending: Vec<Reference>,
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
    /// The clocks of an FMU; `None` if it has none.
    pub(super) fn of(signature: &Signature) -> Option<Box<Self>> {
        let ticks = |clock: &InputClock| Ticks {
            clock: clock.clone(),
            base: 0.0,
            count: 0,
            interval: clock.interval.unwrap_or(0.0),
            next: None,
        };
        (!signature.clocks.is_empty()).then(|| {
            let inputs = signature.clocks.iter().map(ticks).collect();
            Box::new(Self { inputs, is_held: false, held: HashMap::new(), pending: Vec::new() })
        })
    }

    /// Appends the clocks to the bytes of a saved state.
    pub(super) fn append(&self, bytes: &mut Vec<u8>) {
        let clocks = serde_json::to_vec(self).unwrap_or_default();
        bytes.extend(&clocks);
        bytes.extend((clocks.len() as u64).to_le_bytes());
        bytes.extend(MARK);
    }

    /// Separates the bytes of the FMU from the clocks.
    pub(super) fn split(bytes: &[u8]) -> Option<(&[u8], Box<Self>)> {
        let bytes = bytes.strip_suffix(MARK)?;
        let (bytes, length) = bytes.split_last_chunk()?;
        let at = bytes.len().checked_sub(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        Some((&bytes[..at], serde_json::from_slice(&bytes[at..]).ok()?))
    }

    fn next(&self) -> Option<f64> {
        self.inputs.iter().filter_map(|ticks| ticks.next).reduce(f64::min)
    }
}

fn slack(time: f64, step: f64) -> f64 {
    SLACK * step.min(1.0) + ROUNDINGS * (time.abs().next_up() - time.abs())
}

impl Instance {
    /// Returns true if clocked variables are among these, and cannot be accessed now.
    pub(super) fn has_clocked(&self, refs: &[Reference]) -> bool {
        self.clocks.as_ref().is_some_and(|clocks| clocks.is_held && refs.iter().any(|r| clocks.held.contains_key(r)))
    }

    /// Reads variables; clocked ones have the values of their last tick.
    pub(super) fn get_held<T>(
        &mut self,
        refs: &[Reference],
        values: &mut [T],
        of: impl Fn(&Value) -> Option<T>,
        get: impl Fn(&mut Self, &[Reference], &mut [T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_held(refs, values.len())?;
        let mut rest = values;
        for reference in refs {
            let (own, others) = rest.split_at_mut(self.elements(&[*reference]));
            rest = others;
            let Some(held) = self.clocks.as_ref().and_then(|clocks| clocks.held.get(reference)) else {
                get(self, &[*reference], own)?;
                continue;
            };
            for (own, value) in own.iter_mut().zip(held) {
                let Some(value) = of(value) else { return Err(self.failure(Function::GetReal, WRONG_TYPE)) };
                *own = value;
            }
        }
        Ok(())
    }

    /// Sets variables; clocked inputs are set at the next tick of their clocks.
    pub(super) fn set_held<T>(
        &mut self,
        refs: &[Reference],
        values: &[T],
        to: impl Fn(&T) -> Option<Value>,
        set: impl Fn(&mut Self, &[Reference], &[T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_held(refs, values.len())?;
        let mut rest = values;
        for reference in refs {
            let (own, others) = rest.split_at(self.elements(&[*reference]));
            rest = others;
            match &mut self.clocks {
                Some(clocks) if clocks.held.contains_key(reference) => {
                    let Some(values) = own.iter().map(&to).collect::<Option<Vec<_>>>() else {
                        return Err(self.failure(Function::SetReal, WRONG_TYPE));
                    };
                    clocks.held.insert(*reference, values);
                    if !clocks.pending.contains(reference) {
                        clocks.pending.push(*reference);
                    }
                }
                _ => set(self, &[*reference], own)?,
            }
        }
        Ok(())
    }

    fn check_held(&mut self, refs: &[Reference], values: usize) -> Result<(), CallError> {
        if self.elements(refs) == values { Ok(()) } else { Err(self.failure(Function::GetReal, WRONG_NUMBER)) }
    }

    /// In Initialization Mode: asks for intervals and shifts, and reads the clocked variables.
    pub(super) fn start_clocks(&mut self, start: f64) -> Result<(), CallError> {
        let library = std::sync::Arc::clone(self.library());
        let mut held = HashMap::new();
        for variable in &library.signature.clocked {
            let values = self.values_of(variable.reference, variable.base_type, variable.size)?;
            held.insert(variable.reference, values);
        }
        let Some(mut clocks) = self.clocks.take() else { return Ok(()) };
        let started = self.start_ticks(&mut clocks, start);
        clocks.held = held;
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
                    ticks.interval = self.interval(reference)?.0;
                    shift = self.shift(reference)?;
                }
                if !(ticks.interval > 0.0 && ticks.interval.is_finite() && shift.is_finite()) {
                    return Err(self.failure(Function::GetIntervalDecimal, WRONG_INTERVAL));
                }
                ticks.base = start + shift;
                ticks.next = Some(ticks.base);
            } else if ticks.clock.kind != Kind::Triggered {
                let (interval, qualifier) = self.interval(reference)?;
                ticks.next = self.known(interval, qualifier)?.map(|interval| start + interval);
            }
        }
        Ok(())
    }

    /// A new interval in s; `None` if it is not known or unchanged.
    fn known(&mut self, interval: f64, qualifier: c_int) -> Result<Option<f64>, CallError> {
        match qualifier {
            CHANGED if interval >= 0.0 && interval.is_finite() => Ok(Some(interval)),
            CHANGED => Err(self.failure(Function::GetIntervalDecimal, WRONG_INTERVAL)),
            _ => Ok(None),
        }
    }

    fn interval(&mut self, clock: Reference) -> Result<(f64, c_int), CallError> {
        let (mut interval, mut qualifier) = (0.0, NOT_YET_KNOWN);
        // SAFETY: live instance; one clock, and its interval is written through valid pointers.
        self.call_v3(Function::GetIntervalDecimal, |f, c| unsafe {
            Some(f.get_interval?(c, &raw const clock, 1, &raw mut interval, &raw mut qualifier))
        })?;
        Ok((interval, qualifier))
    }

    fn shift(&mut self, clock: Reference) -> Result<f64, CallError> {
        let mut shift = 0.0;
        // SAFETY: live instance; one clock, and its shift is written through a valid pointer.
        self.call_v3(Function::GetShiftDecimal, |f, c| unsafe {
            Some(f.get_shift?(c, &raw const clock, 1, &raw mut shift))
        })?;
        Ok(shift)
    }

    /// After the initialization, in Event Mode.
    pub(super) fn enter_first_step_mode(&mut self) -> Result<(), CallError> {
        for _ in 0..MOST_ITERATIONS {
            if !self.update_event()? {
                return self.enter_step_mode();
            }
        }
        Err(self.failure(Function::NewDiscreteStates, ENDLESS))
    }

    fn enter_step_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_v3(Function::EnterStepMode, |f, c| unsafe { Some(f.end_event?(c)) })?;
        if let Some(clocks) = &mut self.clocks {
            clocks.is_held = true;
        }
        Ok(())
    }

    /// `fmi3UpdateDiscreteStates`. Returns true if another iteration is needed.
    fn update_event(&mut self) -> Result<bool, CallError> {
        let mut flags: [RawBoolean; 5] = [0; 5];
        let [again, terminate, nominals, states, next_defined] = &mut flags;
        let mut next = 0.0;
        // SAFETY: live instance; the outcome is written through valid pointers.
        self.call_v3(Function::NewDiscreteStates, |f, c| unsafe {
            Some(f.update_event?(c, again, terminate, nominals, states, next_defined, &raw mut next))
        })?;
        match flags {
            [_, 0, ..] => Ok(flags[0] != 0),
            _ => Err(self.failure(Function::NewDiscreteStates, CallProblem::Terminated)),
        }
    }

    /// `fmi3DoStep` from tick to tick.
    pub(super) fn step_with_clocks(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        let end = time + step;
        let mut now = time;
        loop {
            let next = self.clocks.as_ref().and_then(|clocks| clocks.next());
            if next.is_some_and(|next| next <= now + slack(now, step)) {
                self.event(now, step)?;
            }
            let next = self.clocks.as_ref().and_then(|clocks| clocks.next());
            let until = next.filter(|next| *next < end - slack(end, step)).unwrap_or(end);
            self.step(now, until - now)?;
            now = until;
            if self.step_end.event != 0 {
                self.event(now, step)?;
            }
            if now >= end {
                return Ok(());
            }
        }
    }

    /// An event: all clocks that are due tick, until no clock is due and the FMU needs no further iteration.
    fn event(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_v3(Function::EnterEventMode, |f, c| unsafe { Some(f.begin_event?(c)) })?;
        let Some(mut clocks) = self.clocks.take() else { return Ok(()) };
        // Without clocks, the variables are accessed directly.
        let result = self.iterate(&mut clocks, time, step);
        self.clocks = Some(clocks);
        result?;
        self.enter_step_mode()
    }

    fn iterate(&mut self, clocks: &mut Clocks, time: f64, step: f64) -> Result<(), CallError> {
        let library = std::sync::Arc::clone(self.library());
        let is_due = |ticks: &Ticks| ticks.next.is_some_and(|next| next <= time + slack(time, step));
        for _ in 0..MOST_ITERATIONS {
            let due: Vec<Reference> =
                clocks.inputs.iter().filter(|ticks| is_due(ticks)).map(|ticks| ticks.clock.reference).collect();
            let is_active = |clocks: &[Reference]| clocks.iter().any(|clock| due.contains(clock));
            if !due.is_empty() {
                let active = vec![true; due.len()];
                // SAFETY: live instance; both arrays have the stated length.
                self.call_v3(Function::SetClock, |f, c| unsafe {
                    Some(f.set_clock?(c, due.as_ptr(), due.len(), active.as_ptr()))
                })?;
                let accessible = || library.signature.clocked.iter().filter(|variable| is_active(&variable.clocks));
                for variable in accessible().filter(|variable| variable.is_input) {
                    if let Some(at) = clocks.pending.iter().position(|reference| *reference == variable.reference) {
                        clocks.pending.swap_remove(at);
                        let values = &clocks.held[&variable.reference];
                        self.set_values_of(variable.reference, variable.base_type, values)?;
                    }
                }
                for variable in accessible().filter(|variable| !variable.is_input) {
                    let values = self.values_of(variable.reference, variable.base_type, variable.size)?;
                    clocks.held.insert(variable.reference, values);
                }
            }
            let is_needed_again = self.update_event()?;
            for ticks in &mut clocks.inputs {
                let has_ticked = due.contains(&ticks.clock.reference);
                if has_ticked {
                    ticks.advance();
                }
                match ticks.clock.kind {
                    Kind::Countdown => {}
                    Kind::Changing if has_ticked => {}
                    Kind::Tunable if ticks.clock.interval.is_none() => {
                        let (interval, qualifier) = self.interval(ticks.clock.reference)?;
                        if let Some(interval) = self.known(interval, qualifier)?.filter(|one| *one != ticks.interval) {
                            // The next tick is one new interval after the last one.
                            let last = ticks.base + ticks.count.saturating_sub(1) as f64 * ticks.interval;
                            if ticks.count > 0 {
                                (ticks.base, ticks.count) = (last, 1);
                                ticks.next = Some((last + interval).max(time));
                            }
                            ticks.interval = interval;
                        }
                        continue;
                    }
                    _ => continue,
                }
                let (interval, qualifier) = self.interval(ticks.clock.reference)?;
                if let Some(interval) = self.known(interval, qualifier)? {
                    ticks.next = Some(time + interval);
                }
            }
            if !is_needed_again && !clocks.inputs.iter().any(is_due) {
                return Ok(());
            }
        }
        Err(self.failure(Function::NewDiscreteStates, ENDLESS))
    }
}
