//! Functions of model exchange, and the update of discrete states.

use super::modes::{CONTINUOUS, EVENT};
use super::{Checked, Fuzzer, MARK, Next, ensure};
use crate::raw::{DISCARD, OK, UpdateFlags};
use fmu_import::description::Interface;

/// A function that fills an array of numbers.
struct Numbers {
    function: &'static str,
    is_of_states: bool,
    /// True if the function can return fmi2Discard because a number is not finite; the content of the array is then
    /// undefined.
    may_be_discarded: bool,
    is_positive: bool,
}

const NUMBERS: [Numbers; 4] = [
    Numbers { function: "fmi2GetDerivatives", is_of_states: true, may_be_discarded: true, is_positive: false },
    Numbers { function: "fmi2GetEventIndicators", is_of_states: false, may_be_discarded: true, is_positive: false },
    Numbers { function: "fmi2GetContinuousStates", is_of_states: true, may_be_discarded: false, is_positive: false },
    Numbers {
        function: "fmi2GetNominalsOfContinuousStates",
        is_of_states: true,
        may_be_discarded: false,
        is_positive: true,
    },
];

impl Fuzzer<'_> {
    /// Calls a function of model exchange, usually one that is allowed in the FMU state.
    pub(super) fn exchange(&mut self, at: usize) -> Checked {
        let mode = self.slots[at].mode;
        match self.random.below(12) {
            0..2 => self.set_time(at),
            2..5 if mode == CONTINUOUS || self.chance(4) => self.set_continuous_states(at),
            2..5 if mode == EVENT => self.update(at),
            5 => self.completed_integrator_step(at),
            6 => self.update(at),
            _ => self.numbers(at),
        }
    }

    /// Values for the states, usually valid ones.
    fn state_values(&mut self, at: usize) -> Vec<f64> {
        let states: Vec<_> =
            (self.states.iter()).flat_map(|&state| std::iter::repeat_n(state, self.size(at, &[state]))).collect();
        let mut values = vec![0.0; states.len()];
        let status = self.slots[at].instance.numbers("fmi2GetContinuousStates", Some(&mut values), states.len());
        let _ = self.slots[at].instance.take_log();
        let is_near = status == OK && self.chance(2);
        for (value, reference) in values.iter_mut().zip(states) {
            *value = match self.random.below(60) {
                0 => self.wild(),
                _ if is_near => *value + 1e-3 * self.random.symmetric() * (1.0 + value.abs()),
                _ => self.value(reference),
            };
        }
        values
    }

    /// A length to state for an array: usually `length`, sometimes a wrong length.
    fn length(&mut self, length: usize) -> usize {
        match self.random.below(40) {
            0 => usize::MAX,
            1 => length + 1,
            2 => length.saturating_sub(1),
            3 => 0,
            _ => length,
        }
    }

    fn set_time(&mut self, at: usize) -> Checked {
        let time = match self.random.below(10) {
            0 | 1 => self.wild(),
            2 => 0.0,
            _ => 1e-3 * self.random.below(2000) as f64,
        };
        let call = self.call(at, "fmi2SetTime", format!("{time:e}"), Next::Same, |instance| instance.set_time(time))?;
        ensure(call != OK || time.is_finite(), || format!("the time {time} was accepted"))
    }

    fn set_continuous_states(&mut self, at: usize) -> Checked {
        let mut values = self.state_values(at);
        let expected = values.len();
        let count = self.length(expected);
        values.push(0.0);
        let states = self.maybe(values.as_slice());
        let text = format!("{count} {states:?}");
        let function = "fmi2SetContinuousStates";
        let status =
            self.call(at, function, text, Next::Same, |instance| instance.set_continuous_states(states, count))?;
        let is_right = count == expected && values[..expected].iter().all(|value| value.is_finite());
        ensure(status != OK || is_right, || format!("{function} accepted {count} of {values:?}"))
    }

    fn numbers(&mut self, at: usize) -> Checked {
        let Numbers { function, is_of_states, may_be_discarded, is_positive } =
            NUMBERS[self.random.below(NUMBERS.len() as u64) as usize];
        let expected = if is_of_states { self.size(at, &self.states) } else { self.indicators };
        let count = self.length(expected);
        let mut values = vec![MARK; expected + 2];
        let is_null = self.chance(40);
        let target = (!is_null).then_some(values.as_mut_slice());
        let text = format!("{count} null {is_null}");
        let status = self.call(at, function, text, Next::Same, |instance| instance.numbers(function, target, count))?;
        let used = if status == OK || (status == DISCARD && may_be_discarded) { expected } else { 0 };
        ensure(status != OK || (count == expected && (!is_null || expected == 0)), || {
            format!("{function} returned {status} for {count} values")
        })?;
        ensure(values[used..].iter().all(|value| *value == MARK), || {
            format!("{function} returned {status} and wrote what it should not: {values:?}")
        })?;
        let is_valid = |value: &f64| value.is_finite() && *value != MARK && (!is_positive || *value > 0.0);
        ensure(status != OK || is_null || values[..used].iter().all(is_valid), || {
            format!("{function} returned {values:?}")
        })
    }

    pub(super) fn update(&mut self, at: usize) -> Checked {
        const BEFORE: UpdateFlags = UpdateFlags { flags: [77; 5], next_event_time: MARK };
        let mut update = BEFORE;
        let is_null = self.chance(40);
        let target = (!is_null).then_some(&mut update);
        let function = "fmi2NewDiscreteStates";
        let text = format!("null {is_null}");
        let status = self.call(at, function, text, Next::Same, |instance| instance.update(target))?;
        if status != OK {
            return ensure(update == BEFORE, || format!("{function} returned {status} and wrote {update:?}"));
        }
        let [needed, terminate, nominals, _, defined] = update.flags;
        let is_right = !is_null
            && update.flags.iter().all(|flag| matches!(flag, 0 | 1))
            && [needed, nominals] == [0; 2]
            && terminate <= self.can_finish.into()
            && update.next_event_time.is_finite()
            && update.next_event_time != MARK;
        ensure(is_right, || format!("{function} wrote {update:?}, null {is_null}"))?;
        let is_known = self.time.is_some() || self.slots[at].interface == Interface::CoSimulation;
        let now = if is_known { self.now(at) } else { f64::NEG_INFINITY };
        ensure(defined == 0 || update.next_event_time > now, || {
            format!("{function} at {now:e} s set the next event to {:e} s", update.next_event_time)
        })
    }

    fn completed_integrator_step(&mut self, at: usize) -> Checked {
        let mut flags = [77; 2];
        let is_null = self.chance(40);
        let target = (!is_null).then_some(&mut flags);
        let function = "fmi2CompletedIntegratorStep";
        let text = format!("null {is_null}");
        let status =
            self.call(at, function, text, Next::Same, |instance| instance.completed_integrator_step(target))?;
        let expected = if status == OK && !is_null { [0; 2] } else { [77; 2] };
        ensure(flags == expected && (status != OK || !is_null), || {
            format!("{function} returned {status} and wrote {flags:?}")
        })
    }
}
