//! Reading and setting values.

use std::ffi::CStr;

use super::{CallError, CallResult, Instance, text, texts};
use crate::calls::{Function, Interface, Mode, Version};
use crate::runner::Model;
use crate::store::ValueStore;
use crate::variable::{Declaration, Kind, Role, Variable, name_in};

/// Returns true if a number is finite. Tests the bits, and so does not depend on the floating-point environment of the
/// host, see [`Instance::may_compute`].
#[inline]
const fn is_finite(value: f64) -> bool {
    value.to_bits() << 1 < f64::INFINITY.to_bits() << 1
}

/// FMI 2.0 name of the variable type that a function sets.
fn type_set_by(function: Function) -> &'static str {
    let name = if function == Function::SetInt64 { Function::SetInteger } else { function }.name(Version::Fmi2);
    &name["fmi2Set".len()..]
}

impl<M: Model> Instance<M> {
    #[cold]
    fn unknown_reference(&self, function: Function, reference: u32, expected: &str) -> CallError {
        let version = self.protocol.version;
        let expected = name_in(version, expected);
        let what = match self.layout().by_reference(reference) {
            Some(variable) => {
                let found = name_in(version, variable.declaration.kind.type_name());
                format!("'{}' of type {found}", variable.declaration.name)
            }
            None => "no variable".to_owned(),
        };
        let message = format_args!("value reference {reference} must be a variable of type {expected}, it is {what}");
        self.error(function, message)
    }

    /// fmi2GetReal. Fails, without writing, for an unknown reference, inconsistent parameters, or a non-finite result.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> CallResult {
        self.check(Function::GetReal)?;
        let layout = self.layout();
        let last = references.iter().fold(0, |last, &reference| last.max(reference));
        if last as usize >= layout.reals() && !references.is_empty() {
            return Err(self.unknown_reference(Function::GetReal, last, "Real"));
        }
        let waits = |index| layout.derived.reals().contains(&index) || self.is_calculated_state(index);
        let calculated = self.is_stale() && references.iter().any(|&reference| waits(reference as usize));
        let (first, count) = (layout.outputs.at.reals as u32, layout.outputs.counts.reals as u32);
        let is_output = |&reference: &u32| reference.wrapping_sub(first) < count;
        let outputs = self.outputs_are_due() && references.iter().any(is_output);
        self.refresh(calculated, outputs, last as usize >= layout.derivatives.at.reals)?;
        let reals = &self.values.reals;
        if self.has_not_finite
            && let Some(&reference) = references.iter().find(|&&reference| !reals[reference as usize].is_finite())
        {
            let message = self.not_finite(reference as usize);
            return Err(match self.protocol.interface {
                Interface::CoSimulation => self.error(Function::GetReal, message),
                Interface::ModelExchange => self.discard(Function::GetReal, message),
            });
        }
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = reals[reference as usize];
        }
        Ok(())
    }

    /// fmi3GetFloat64, which can also read the time and event indicators. Fails like [`Self::get_real`].
    pub fn get_float64(&mut self, references: &[u32], values: &mut [f64]) -> CallResult {
        let (time, indicators) = (self.layout().end, self.layout().indicators.total() as u32);
        // Fast path without time and event indicators, which have the greatest references.
        if references.iter().fold(0, |last, &reference| last.max(reference)) < time {
            return self.get_real(references, values);
        }
        let is_special = |&reference: &u32| reference.wrapping_sub(time) <= indicators;
        self.check(Function::GetReal)?;
        let mut found = vec![0.0; indicators as usize];
        if M::MODEL_EXCHANGE && references.iter().any(|reference| is_special(reference) && *reference != time) {
            self.indicators(Function::GetReal, &mut found)?;
        }
        // References are checked before the first value is written.
        for reference in references.iter().filter(|reference| !is_special(reference)) {
            self.get_real(&[*reference], &mut [0.0])?;
        }
        for (value, reference) in values.iter_mut().zip(references) {
            match reference.wrapping_sub(time) {
                0 => *value = self.clock.time,
                number if number <= indicators => *value = found[number as usize - 1],
                _ => self.get_real(&[*reference], std::slice::from_mut(value))?,
            }
        }
        Ok(())
    }

    pub(crate) fn length_of(&self, reference: u32) -> u32 {
        self.description.lengths.get(reference as usize).copied().unwrap_or(1)
    }

    /// Rejects an enumeration where FMI 3.0 expects an Int32, and vice versa.
    pub(crate) fn check_integer(&self, function: Function, reference: u32) -> CallResult {
        let is_enumeration = self
            .layout()
            .by_reference(reference)
            .is_some_and(|variable| matches!(variable.declaration.kind, Kind::Integer { is_enumeration: true, .. }));
        let wants_enumeration = matches!(function, Function::GetInt64 | Function::SetInt64);
        if is_enumeration == wants_enumeration {
            return Ok(());
        }
        let expected = if wants_enumeration { "Enumeration" } else { "Integer" };
        Err(self.unknown_reference(function, reference, expected))
    }

    #[cold]
    pub(super) fn not_finite(&self, index: usize) -> String {
        let (name, value, time) = (self.layout().real_name(index), self.values.reals[index], self.clock.time);
        format!("'{name}' = {value} at time {time} s, not a finite number")
    }

    fn other(&self, function: Function, reference: u32, first: u32, end: u32, expected: &str) -> CallResult<usize> {
        if (first..end).contains(&reference) {
            Ok((reference - first) as usize)
        } else {
            Err(self.unknown_reference(function, reference, expected))
        }
    }

    fn integer(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, self.layout().first_integer, self.layout().first_boolean, "Integer")
    }

    fn boolean(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, self.layout().first_boolean, self.layout().first_string, "Boolean")
    }

    fn string(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, self.layout().first_string, self.layout().end, "String")
    }

    /// fmi2GetInteger.
    pub fn get_integer(&mut self, reference: u32) -> CallResult<i32> {
        let index = self.readable(Function::GetInteger, reference, Self::integer)?;
        Ok(self.values.integers[index])
    }

    /// fmi2GetBoolean.
    pub fn get_boolean(&mut self, reference: u32) -> CallResult<bool> {
        let index = self.readable(Function::GetBoolean, reference, Self::boolean)?;
        Ok(self.values.booleans[index])
    }

    /// fmi2GetString. The string stays valid until the value changes, a string is set or a state is restored.
    pub fn get_string(&mut self, reference: u32) -> CallResult<&CStr> {
        let index = self.readable(Function::GetString, reference, Self::string)?;
        if self.texts[index].to_bytes() != self.values.strings[index].as_bytes() {
            self.texts[index] = text(&self.values.strings[index]);
        }
        Ok(&self.texts[index])
    }

    /// Index of a value that is not a real number. First updates outputs and calculated parameters if necessary.
    #[inline]
    fn readable(
        &mut self,
        function: Function,
        reference: u32,
        index: impl Fn(&Self, Function, u32) -> CallResult<usize>,
    ) -> CallResult<usize> {
        self.check(function)?;
        let index = index(self, function, reference)?;
        let layout = self.layout();
        let (calculated, outputs) = (layout.derived.has_others() && self.is_stale(), layout.outputs.has_others());
        self.refresh(calculated, outputs, false)?;
        Ok(index)
    }

    fn settable(&self, function: Function, reference: u32) -> CallResult<&Variable> {
        let Some(variable) = self.layout().by_reference(reference) else {
            return Err(self.unknown_reference(function, reference, type_set_by(function)));
        };
        let before_start = self.is_before_start();
        let is_continuous = self.mode == Mode::ContinuousTime;
        let (allowed, what) = match variable.role {
            // Same effect as fmi2SetContinuousStates; CasADi sets states this way.
            Role::State if is_continuous => (true, ""),
            Role::Input => (true, ""),
            Role::Parameter if variable.declaration.tunable => (!is_continuous, "a tunable parameter"),
            Role::Parameter => (before_start, "a fixed parameter"),
            Role::State if variable.declaration.calculated => {
                (false, "a state whose start value follows from the parameters")
            }
            Role::State => (before_start, "a continuous state"),
            // Variables with an exact start value may be set before the start (standard, section 2.1.7).
            Role::Output if !M::CALCULATES_OUTPUTS => (before_start, "an output with a start value"),
            Role::Output => (false, "an output"),
            Role::Calculated => (false, "a calculated parameter"),
            Role::Derivative => (false, "the derivative of a state"),
        };
        if allowed {
            return Ok(variable);
        }
        let when = match variable.role {
            Role::Calculated | Role::Derivative => "never settable",
            Role::Output if M::CALCULATES_OUTPUTS => "never settable",
            Role::State if variable.declaration.calculated => "never settable",
            Role::Parameter if variable.declaration.tunable => "not settable in Continuous-Time Mode",
            _ => "settable only in Instantiated and Initialization Mode",
        };
        let (name, mode) = (&variable.declaration.name, self.mode.name());
        Err(self.error(function, format_args!("'{name}' is {what}, {when}; the instance is in {mode}")))
    }

    /// Updates the parameters after one has changed, fixed or tunable.
    pub(super) fn parameters_changed(&mut self) {
        self.parameters = M::parameters(&self.values);
        self.derived_are_old = true;
        if self.is_before_start() {
            self.run = None;
        }
    }

    /// fmi2SetReal. Fails, without setting anything, if a reference is unknown, a variable cannot be set in this mode,
    /// or a value is not finite or outside its limits.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> CallResult {
        self.check(Function::SetReal)?;
        let layout = self.layout();
        let inputs = layout.inputs.reals();
        // Fast path: inputs and finite numbers, without branches; inputs have no limits.
        let (first, count) = (layout.inputs.at.reals as u32, layout.inputs.counts.reals as u32);
        let are_inputs = references.iter().fold(true, |all, reference| all & (reference.wrapping_sub(first) < count));
        if are_inputs && values.iter().fold(true, |all, value| all & is_finite(*value)) {
            for (&reference, &value) in references.iter().zip(values) {
                self.values.reals[reference as usize] = value;
            }
            self.values_changed();
            return Ok(());
        }
        for (&reference, &value) in references.iter().zip(values) {
            let index = reference as usize;
            if index >= layout.reals() {
                return Err(self.unknown_reference(Function::SetReal, reference, "Real"));
            }
            if !is_finite(value) {
                let message = format!("'{}' must be finite, got {value}", layout.real_name(index));
                // A solver may try such a value and then shorten its step.
                let is_tried = self.mode == Mode::ContinuousTime && layout.states.reals().contains(&index);
                return Err(if is_tried {
                    self.discard(Function::SetReal, message)
                } else {
                    self.error(Function::SetReal, message)
                });
            }
            if inputs.contains(&index) {
                continue;
            }
            let variable = self.settable(Function::SetReal, reference)?;
            if variable.role == Role::State && self.mode == Mode::ContinuousTime {
                // The limits of a state apply to its start value only.
                continue;
            }
            let Kind::Real(real) = &variable.declaration.kind else { unreachable!("reals come first") };
            let range = real.range();
            if !range.contains(&value) {
                let (name, value) = (&variable.declaration.name, real.unit.with(value));
                let message = format_args!("'{name}' must be in [{}, {}], got {value}", range.start(), range.end());
                return Err(self.error(Function::SetReal, message));
            }
        }
        // Importers also set parameters to their present values. This must not cause computations.
        let parameters = layout.parameters.reals();
        let (solver, mut is_changed) = (layout.solver, false);
        for (&reference, &value) in references.iter().zip(values) {
            let index = reference as usize;
            is_changed |= parameters.contains(&index) && self.values.reals[index].to_bits() != value.to_bits();
            self.is_tolerance_set |= M::HAS_ERROR_CONTROL && solver == Some(index);
            self.values.reals[index] = value;
        }
        if is_changed {
            self.parameters_changed();
        }
        self.values_changed();
        Ok(())
    }

    /// fmi2SetInteger. Fails, without setting anything, if a reference is unknown, a variable cannot be set in this
    /// mode, or a value is outside its limits.
    #[cfg(feature = "testing")]
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> CallResult {
        self.set_integer_by(Function::SetInteger, references, values)
    }

    /// Sets Integers. `function` is `SetInt64` for enumerations in FMI 3.0.
    pub(crate) fn set_integer_by(&mut self, function: Function, references: &[u32], values: &[i32]) -> CallResult {
        let rule = |kind: &Kind, value: &i32| {
            let Kind::Integer { min, max, items, .. } = kind else { unreachable!("an Integer was found") };
            if kind.takes(*value) {
                return Ok(());
            }
            let names: Vec<_> = items.iter().map(|c| format!("{} ({})", c.value, c.name)).collect();
            let expected = if names.is_empty() { format!("in [{min}, {max}]") } else { names.join(" or ") };
            Err(format!("must be {expected}, got {value}"))
        };
        self.set_others(function, references, values, Self::integer, rule, |all| &mut all.integers)
    }

    /// fmi2SetBoolean. Fails, without setting anything, if a reference is unknown or cannot be set in this mode.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> CallResult {
        let (function, rule) = (Function::SetBoolean, |_: &Kind, _: &bool| Ok(()));
        self.set_others(function, references, values, Self::boolean, rule, |all| &mut all.booleans)
    }

    /// fmi2SetString. Fails, without setting anything, if a reference is unknown, a variable cannot be set in this
    /// mode, or a string contains a zero byte.
    pub fn set_string(&mut self, references: &[u32], values: &[String]) -> CallResult {
        let rule = |_: &Kind, value: &String| match value.contains('\0') {
            true => Err("must not contain a zero byte".to_owned()),
            false => Ok(()),
        };
        self.set_others(Function::SetString, references, values, Self::string, rule, |all| &mut all.strings)?;
        self.texts = texts(&self.values.strings);
        Ok(())
    }

    /// Sets values that are not real. `index` returns the position of a value in the list `of`; `rule` validates it.
    fn set_others<V: PartialEq + Clone>(
        &mut self,
        function: Function,
        references: &[u32],
        values: &[V],
        index: impl Fn(&Self, Function, u32) -> CallResult<usize>,
        rule: impl Fn(&Kind, &V) -> Result<(), String>,
        of: impl Fn(&mut ValueStore) -> &mut [V],
    ) -> CallResult {
        self.check(function)?;
        for (&reference, value) in references.iter().zip(values) {
            index(self, function, reference)?;
            let Declaration { kind, name, .. } = &self.settable(function, reference)?.declaration;
            rule(kind, value).map_err(|rule| self.error(function, format_args!("'{name}' {rule}")))?;
        }
        let mut is_changed = false;
        for (&reference, value) in references.iter().zip(values) {
            let index = index(self, function, reference)?;
            let old = &mut of(&mut self.values)[index];
            is_changed |= old != value;
            old.clone_from(value);
        }
        let mut variables = references.iter().filter_map(|&reference| self.layout().by_reference(reference));
        if is_changed && variables.any(|variable| variable.role == Role::Parameter) {
            self.parameters_changed();
        }
        self.values_changed();
        Ok(())
    }
}
