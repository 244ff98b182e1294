//! Reading and setting values.

use std::ffi::CStr;

use super::{CallError, CallResult, Instance, text, texts};
use crate::calls::{Function, Interface, Mode, Version};
use crate::number::{self, Number, Size, is_finite, is_finite_f32};
use crate::runner::Model;
use crate::store::ValueStore;
use crate::variable::{Declaration, Kind, Role, Variable};
use crate::variables::Variables as _;

/// FMI name of the variable type that a function reads or sets.
fn type_of(function: Function, version: Version) -> &'static str {
    match function {
        Function::GetInt64 | Function::SetInt64 => "Int64 or Enumeration",
        Function::ActivateModelPartition
        | Function::GetIntervalDecimal
        | Function::GetIntervalFraction
        | Function::SetIntervalDecimal
        | Function::SetIntervalFraction
        | Function::GetShiftDecimal
        | Function::GetShiftFraction
        | Function::SetShiftDecimal
        | Function::SetShiftFraction => "Clock",
        _ => &function.name(version)["fmi2Set".len()..],
    }
}

/// Validates the number in a word for a variable.
fn word_rule(variable: &Variable, word: u64, given: Option<Size>) -> Result<(), String> {
    let kind = &variable.declaration.kind;
    // In FMI 2.0, the importer may pass an Integer that is not a value of the type, such as -1 for `u64`.
    let is_same = match (kind, given) {
        (Kind::Integer { size, .. }, Some(given)) => size.value(word) == given.value(word),
        _ => true,
    };
    if is_same && variable.accepts(word) { Ok(()) } else { Err(word_error(variable, &number::word_text(given, word))) }
}

/// The message for a number that a variable cannot have.
#[cold]
#[inline(never)]
fn word_error(variable: &Variable, value: &str) -> String {
    let expected = match &variable.declaration.kind {
        Kind::Integer { items, .. } if !items.is_empty() => {
            let names: Vec<_> = items.iter().map(|item| format!("{} ({})", item.value, item.name)).collect();
            names.join(" or ")
        }
        Kind::Integer { size, min, max, .. } => {
            let range = if variable.has_limits() { *min..=*max } else { size.range() };
            format!("in [{}, {}]", number::text(*range.start()), number::text(*range.end()))
        }
        Kind::Float32(real) if variable.has_limits() && (real.min, real.max) != (None, None) => {
            let range = real.range();
            format!("a finite number in [{}, {}]", range.start(), range.end())
        }
        _ => "a finite Float32".to_owned(),
    };
    format!("must be {expected}, got {value}")
}

impl<M: Model> Instance<M> {
    #[cold]
    pub(super) fn unknown_reference(&self, function: Function, reference: u32) -> CallError {
        let version = self.protocol.version;
        let expected = type_of(function, version);
        let what = match self.layout().by_reference(reference) {
            Some(variable) => {
                let found = variable.declaration.kind.type_name(version);
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
        self.check_clocked(Function::GetReal, references)?;
        let layout = self.layout();
        let last = references.iter().fold(0, |last, &reference| last.max(reference));
        // After the Float64s.
        let has_others = last as usize >= layout.reals() && !references.is_empty();
        if has_others {
            let is_real =
                |&reference: &u32| (reference as usize) < layout.reals() || self.is_float32_of_fmi2(reference);
            if let Some(&reference) = references.iter().find(|reference| !is_real(reference)) {
                return Err(self.unknown_reference(Function::GetReal, reference));
            }
        }
        let waits = |index| layout.derived.reals().contains(&index) || self.is_calculated_state(index);
        let calculated =
            self.is_stale() && (has_others || references.iter().any(|&reference| waits(reference as usize)));
        // With the clocked states, which follow the outputs.
        let first = layout.outputs.at.reals as u32;
        let count = layout.states.at.reals as u32 - first;
        let is_output = |&reference: &u32| reference.wrapping_sub(first) < count;
        let outputs = self.outputs_are_due() && (has_others || references.iter().any(is_output));
        let is_derivative = |&reference: &u32| layout.derivatives.position(reference).is_some();
        let derivatives =
            last as usize >= layout.derivatives.at.reals && (!has_others || references.iter().any(is_derivative));
        self.refresh(calculated, outputs, derivatives)?;
        let mut reals = &*self.values.reals;
        if M::INTERPOLATES {
            reals = &reals[..self.description.layout.reals()];
        }
        let is_bad = |&&reference: &&u32| !reals.get(reference as usize).is_none_or(|real| is_finite(*real));
        if self.has_not_finite
            && let Some(&reference) = references.iter().find(is_bad)
        {
            return Err(self.is_not_finite(Function::GetReal, self.not_finite(reference as usize)));
        }
        if has_others {
            let mut others = references.iter().filter(|&&reference| reference as usize >= reals.len());
            others.try_for_each(|&reference| self.float32(Function::GetReal, reference).map(drop))?;
        }
        for (value, &reference) in values.iter_mut().zip(references) {
            match reals.get(reference as usize) {
                Some(real) => *value = *real,
                None => *value = self.float32(Function::GetReal, reference)?.into(),
            }
        }
        Ok(())
    }

    /// The value of a Float32, if it is finite.
    fn float32(&self, function: Function, reference: u32) -> CallResult<f32> {
        let word = self.values.words[reference as usize - self.layout().first.words];
        if is_finite_f32(word) {
            return Ok(f32::of(word));
        }
        let name = self.layout().by_reference(reference).map_or("", |variable| &variable.declaration.name);
        let (value, time) = (f64::from(f32::of(word)), self.timeline.time);
        Err(self.is_not_finite(function, format!("'{name}' = {value} at time {time} s, not a finite number")))
    }

    /// In model exchange, a solver may go on with a shorter step.
    #[cold]
    fn is_not_finite(&self, function: Function, message: String) -> CallError {
        match self.protocol.interface {
            Interface::ModelExchange => self.discard(function, message),
            _ => self.error(function, message),
        }
    }

    /// Returns true for a Float32 in FMI 2.0, which declares it as a Real.
    fn is_float32_of_fmi2(&self, reference: u32) -> bool {
        let variable = self.layout().by_reference(reference);
        let is_float32 = variable.is_some_and(|variable| matches!(variable.declaration.kind, Kind::Float32(_)));
        self.protocol.version == Version::Fmi2 && is_float32
    }

    /// fmi3GetFloat64, which can also read the time and event indicators. Fails like [`Self::get_real`].
    pub fn get_float64(&mut self, references: &[u32], values: &mut [f64]) -> CallResult {
        let (time, indicators) = (self.layout().end, self.layout().indicators.total() as u32);
        // Fast path if neither the time nor an event indicator is requested: these have the greatest references.
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
                0 => *value = self.timeline.time,
                number if number <= indicators => *value = found[number as usize - 1],
                _ => self.get_real(&[*reference], std::slice::from_mut(value))?,
            }
        }
        Ok(())
    }

    #[cold]
    pub(super) fn not_finite(&self, index: usize) -> String {
        let (name, value, time) = (self.layout().real_name(index), self.values.reals[index], self.timeline.time);
        format!("'{name}' = {value} at time {time} s, not a finite number")
    }

    /// Index of a value that is not a real number of 64 bits. `is_of` returns true for the type of the function.
    #[inline]
    fn other(&self, function: Function, reference: u32, is_of: impl Fn(&Kind) -> bool) -> CallResult<usize> {
        match self.layout().by_reference(reference) {
            Some(variable) if is_of(&variable.declaration.kind) => Ok(variable.index),
            _ => Err(self.unknown_reference(function, reference)),
        }
    }

    /// Index of the word that stores a number. In FMI 3.0, each function accepts variables of one type only.
    fn number(&self, function: Function, size: Option<Size>, reference: u32) -> CallResult<usize> {
        self.other(function, reference, |kind| match (kind, size) {
            (Kind::Float32(_), size) => size.is_none(),
            (Kind::Integer { .. }, Some(_)) if self.protocol.version == Version::Fmi2 => true,
            (Kind::Integer { is_enumeration: true, .. }, size) => size == Some(Size::Int64),
            (Kind::Integer { size, .. }, wanted) => Some(*size) == wanted,
            _ => false,
        })
    }

    fn boolean(&self, function: Function, reference: u32) -> CallResult<usize> {
        // In FMI 2.0, an output clock is a Boolean.
        let is_clock = |kind: &Kind| self.protocol.version == Version::Fmi2 && matches!(kind, Kind::Clock(None));
        self.other(function, reference, |kind| matches!(kind, Kind::Boolean { .. }) || is_clock(kind))
    }

    fn string(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, |kind| matches!(kind, Kind::String { .. }))
    }

    fn binary(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, |kind| matches!(kind, Kind::Binary { .. }))
    }

    /// The functions of FMI 3.0 for numbers other than Float64, of a [size](Number::SIZE): returns the word. Fails if the
    /// reference is unknown or the result is not finite.
    pub fn get_number(&mut self, function: Function, size: Option<Size>, reference: u32) -> CallResult<u64> {
        let index = self.readable(function, reference, |this, function, one| this.number(function, size, one))?;
        if size.is_none() {
            self.float32(function, reference)?;
        }
        Ok(self.values.words[index])
    }

    /// fmi2GetInteger. Fails if the reference is unknown or the number does not fit in 32 bits.
    pub fn get_integer(&mut self, reference: u32) -> CallResult<i32> {
        const FUNCTION: Function = Function::GetInteger;
        let index = self.readable(FUNCTION, reference, |this, function, one| this.number(function, i32::SIZE, one))?;
        let word = self.values.words[index];
        let Some(Declaration { name, kind: Kind::Integer { size, .. }, .. }) =
            self.layout().by_reference(reference).map(|variable| &variable.declaration)
        else {
            unreachable!("an Integer was found")
        };
        let value = size.value(word);
        i32::try_from(value).map_err(|_| {
            self.error(
                FUNCTION,
                format_args!("'{name}' = {} does not fit in the 32 bits of an Integer of FMI 2.0", number::text(value)),
            )
        })
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

    /// fmi3GetBinary. The bytes are valid until the next call.
    pub fn get_binary(&mut self, reference: u32) -> CallResult<&[u8]> {
        let index = self.readable(Function::GetBinary, reference, Self::binary)?;
        Ok(&self.values.binaries[index])
    }

    /// Index of a value that is not a real number of 64 bits. First updates outputs and calculated parameters if
    /// necessary.
    #[inline]
    fn readable(
        &mut self,
        function: Function,
        reference: u32,
        index: impl Fn(&Self, Function, u32) -> CallResult<usize>,
    ) -> CallResult<usize> {
        self.check(function)?;
        let index = index(self, function, reference)?;
        self.check_clocked(function, &[reference])?;
        let layout = self.layout();
        let outputs = layout.outputs.has_others() || (M::HAS_CLOCKS && layout.clocked.has_others());
        let calculated = layout.derived.has_others() && self.is_stale();
        self.refresh(calculated, outputs, false)?;
        Ok(index)
    }

    fn settable(&self, function: Function, reference: u32) -> CallResult<&Variable> {
        let Some(variable) = self.layout().by_reference(reference) else {
            return Err(self.unknown_reference(function, reference));
        };
        let before_start = self.is_before_start();
        let is_continuous = self.mode == Mode::ContinuousTime;
        let is_configured = matches!(self.mode, Mode::Configuration | Mode::Reconfiguration);
        let Declaration { tunable, details, .. } = variable.declaration;
        let is_structural = details.structural && self.protocol.version == Version::Fmi3;
        let (allowed, what) = match variable.role {
            _ if is_structural => {
                (is_configured && (tunable || self.mode == Mode::Configuration), "a structural parameter")
            }
            _ if is_configured => (false, "not a structural parameter"),
            // Same effect as fmi2SetContinuousStates; CasADi sets states this way.
            Role::State if is_continuous => (true, ""),
            Role::Input => (true, ""),
            Role::Parameter if variable.declaration.tunable => (!is_continuous, "a tunable parameter"),
            Role::Parameter => (before_start, "a fixed parameter"),
            Role::State if variable.declaration.calculated => {
                (false, "a state whose start value follows from the parameters")
            }
            Role::State => (before_start, "a continuous state"),
            Role::Output if details.constant => (false, "a constant"),
            // Variables with an exact start value may be set before the start (standard, section 2.1.7).
            Role::Output if !M::CALCULATES_OUTPUTS => (before_start, "an output with a start value"),
            Role::Output => (false, "an output"),
            Role::Calculated => (false, "a calculated parameter"),
            Role::Derivative => (false, "the derivative of a state"),
            Role::Clocked | Role::Previous | Role::Clock => (false, "a clock or a clocked state"),
        };
        if allowed {
            return Ok(variable);
        }
        let when = match variable.role {
            _ if is_structural && tunable => "settable only in Configuration Mode and Reconfiguration Mode",
            _ if is_structural => "settable only in Configuration Mode",
            _ if is_configured => "not settable in this mode",
            Role::Calculated | Role::Derivative | Role::Clocked | Role::Previous | Role::Clock => "never settable",
            Role::Output if M::CALCULATES_OUTPUTS || details.constant => "never settable",
            Role::State if variable.declaration.calculated => "never settable",
            Role::Parameter if variable.declaration.tunable => "not settable in Continuous-Time Mode",
            _ => "settable only in Instantiated and Initialization Mode",
        };
        let (name, mode) = (&variable.declaration.name, self.mode.name());
        Err(self.error(function, format_args!("'{name}' is {what}, {when}; the instance is in {mode}")))
    }

    /// The value references of the present elements of a variable. An unknown reference is passed on; the functions
    /// reject it.
    pub(crate) fn elements_of(&self, reference: u32, elements: &mut Vec<u32>) {
        match self.layout().sized_array(reference) {
            Some(array) if M::Parameters::HAS_STRUCTURE => {
                elements.extend(array.elements(&self.values.lengths).map(|position| reference + position as u32));
            }
            _ => {
                let length = self.description.lengths.get(reference as usize).map_or(1, |&length| length.max(1));
                elements.extend((0..length).map(|i| reference.wrapping_add(i)));
            }
        }
    }

    /// Updates the parameters after a fixed or tunable parameter has changed.
    pub(super) fn parameters_changed(&mut self) {
        if M::Parameters::HAS_STRUCTURE {
            self.resize();
        }
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
        self.check_clocked(Function::SetReal, references)?;
        let layout = self.layout();
        let inputs = layout.inputs.reals();
        // Fast path: inputs and finite numbers, without branches. The limits of inputs are not enforced.
        let (first, count) = (layout.inputs.at.reals as u32, layout.inputs.counts.reals as u32);
        let are_inputs = references.iter().fold(true, |all, reference| all & (reference.wrapping_sub(first) < count));
        if are_inputs && values.iter().fold(true, |all, value| all & is_finite(*value)) {
            for (&reference, &value) in references.iter().zip(values) {
                self.values.reals[reference as usize] = value;
            }
            if M::INTERPOLATES && self.has_slopes {
                self.forget_slopes(references);
            }
            self.values_changed();
            return Ok(());
        }
        for (&reference, &value) in references.iter().zip(values) {
            let index = reference as usize;
            if index >= layout.reals() {
                if !self.is_float32_of_fmi2(reference) {
                    return Err(self.unknown_reference(Function::SetReal, reference));
                }
                let variable = self.settable(Function::SetReal, reference)?;
                let name = &variable.declaration.name;
                word_rule(variable, (value as f32).word(), None)
                    .map_err(|rule| self.error(Function::SetReal, format_args!("'{name}' {rule}")))?;
                continue;
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
        let (reals, solver, mut is_changed) = (layout.reals(), layout.solver, false);
        for (&reference, &value) in references.iter().zip(values) {
            let index = reference as usize;
            if index >= reals {
                let variable = self.layout().by_reference(reference);
                let (index, role) = variable.map(|found| (found.index, found.role)).expect("checked above");
                let old = std::mem::replace(&mut self.values.words[index], (value as f32).word());
                is_changed |= role == Role::Parameter && old != (value as f32).word();
                continue;
            }
            is_changed |= parameters.contains(&index) && self.values.reals[index].to_bits() != value.to_bits();
            self.is_tolerance_set |= M::HAS_ERROR_CONTROL && solver == Some(index);
            self.values.reals[index] = value;
        }
        if is_changed {
            self.parameters_changed();
        }
        if M::INTERPOLATES && self.has_slopes {
            self.forget_slopes(references);
        }
        self.values_changed();
        Ok(())
    }

    /// A value that is set is held, until its slope is set.
    #[cold]
    fn forget_slopes(&mut self, references: &[u32]) {
        for &reference in references {
            if let Some(index) = self.slope_of(reference) {
                self.values.reals[index] = 0.0;
            }
        }
        self.update_slopes();
    }

    pub(super) fn update_slopes(&mut self) {
        self.has_slopes = self.values.reals[self.layout().slopes()].iter().any(|&slope| slope != 0.0);
    }

    /// Index of the slope of a continuous input.
    fn slope_of(&self, reference: u32) -> Option<usize> {
        let layout = self.layout();
        let input = layout.by_reference(reference).filter(|variable| variable.is_continuous_input())?;
        Some(layout.slopes().start + input.index - layout.inputs.at.reals)
    }

    /// fmi2SetRealInputDerivatives: from the next communication point on, each input is linear in time, until it is set.
    /// Fails, without setting anything, if a reference is not a continuous input, an order is not 1, or a value is not
    /// finite.
    pub fn set_real_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> CallResult {
        const FUNCTION: Function = Function::SetRealInputDerivatives;
        self.check(FUNCTION)?;
        for ((&reference, order), value) in references.iter().zip(orders).zip(values) {
            let Some(variable) = self.layout().by_reference(reference) else {
                return Err(self.unknown_reference(FUNCTION, reference));
            };
            let name = &variable.declaration.name;
            let problem = if self.slope_of(reference).is_none() {
                format!("'{name}' must be a continuous input of type Real")
            } else if *order != 1 {
                format!("the order of the derivative of '{name}' must be 1, got {order}")
            } else if !is_finite(*value) {
                format!("the derivative of '{name}' must be finite, got {value}")
            } else {
                continue;
            };
            return Err(self.error(FUNCTION, problem));
        }
        for (&reference, &value) in references.iter().zip(values) {
            let index = self.slope_of(reference).expect("checked above");
            self.values.reals[index] = value;
        }
        self.update_slopes();
        Ok(())
    }

    /// fmi2SetInteger. Fails like [`Self::set_numbers`].
    #[cfg(feature = "testing")]
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> CallResult {
        self.set_numbers(Function::SetInteger, i32::SIZE, references, values.iter().map(|value| value.word()))
    }

    /// fmi2SetInteger, and the functions of FMI 3.0 for numbers other than Float64, of a [size](Number::SIZE). Fails,
    /// without setting anything, if a reference is unknown, a variable cannot be set in this mode, or a value is outside
    /// its limits.
    pub fn set_numbers(
        &mut self,
        function: Function,
        size: Option<Size>,
        references: &[u32],
        words: impl Iterator<Item = u64> + Clone,
    ) -> CallResult {
        let index = |this: &Self, function, reference| this.number(function, size, reference);
        let rule = |variable: &Variable, word| word_rule(variable, word, size);
        self.set_others(function, references, words, index, rule, |all, index, word| {
            std::mem::replace(&mut all.words[index], word) != word
        })
    }

    /// The functions for types of which no variable can be set. Fails if there is a reference.
    pub fn set_nothing(&self, function: Function, size: Option<Size>, references: &[u32]) -> CallResult {
        self.check(function)?;
        let Some(&reference) = references.first() else { return Ok(()) };
        match function {
            Function::SetBoolean => self.boolean(function, reference)?,
            Function::SetString => self.string(function, reference)?,
            Function::SetBinary => self.binary(function, reference)?,
            _ => self.number(function, size, reference)?,
        };
        self.settable(function, reference).map(drop)
    }

    /// fmi2SetBoolean. Fails, without setting anything, if a reference is unknown or cannot be set in this mode.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> CallResult {
        let (function, rule) = (Function::SetBoolean, |_: &Variable, _: &bool| Ok(()));
        self.set_others(function, references, values.iter(), Self::boolean, rule, |all, index, value| {
            std::mem::replace(&mut all.booleans[index], *value) != *value
        })
    }

    /// fmi2SetString. Fails, without setting anything, if a reference is unknown, a variable cannot be set in this
    /// mode, or a string contains a zero byte.
    pub fn set_string(&mut self, references: &[u32], values: &[String]) -> CallResult {
        let rule = |_: &Variable, value: &String| match value.contains('\0') {
            true => Err("must not contain a zero byte".to_owned()),
            false => Ok(()),
        };
        self.set_others(Function::SetString, references, values.iter(), Self::string, rule, |all, index, value| {
            let old = &mut all.strings[index];
            let is_changed = old != value;
            old.clone_from(value);
            is_changed
        })?;
        self.texts = texts(&self.values.strings);
        Ok(())
    }

    /// fmi3SetBinary. Fails, without setting anything, if a reference is unknown, a variable cannot be set in this
    /// mode, or a value has more bytes than the variable can hold.
    pub fn set_binary<'v>(&mut self, references: &[u32], values: impl Iterator<Item = &'v [u8]> + Clone) -> CallResult {
        let rule = |variable: &Variable, value: &[u8]| match variable.declaration.kind {
            Kind::Binary { most, .. } if value.len() > most => {
                Err(format!("must have at most {most} bytes, got {}", value.len()))
            }
            _ => Ok(()),
        };
        self.set_others(Function::SetBinary, references, values, Self::binary, rule, |all, index, value| {
            let old = &mut all.binaries[index];
            let is_changed = **old != *value;
            old.set(value);
            is_changed
        })
    }

    /// Sets values that are not real numbers of 64 bits. `index` returns the position of a value, `rule` validates it,
    /// and `set` returns true if it has changed.
    fn set_others<V>(
        &mut self,
        function: Function,
        references: &[u32],
        values: impl Iterator<Item = V> + Clone,
        index: impl Fn(&Self, Function, u32) -> CallResult<usize>,
        rule: impl Fn(&Variable, V) -> Result<(), String>,
        set: impl Fn(&mut ValueStore, usize, V) -> bool,
    ) -> CallResult {
        self.check(function)?;
        self.check_clocked(function, references)?;
        for (&reference, value) in references.iter().zip(values.clone()) {
            index(self, function, reference)?;
            let variable = self.settable(function, reference)?;
            let name = &variable.declaration.name;
            rule(variable, value).map_err(|rule| self.error(function, format_args!("'{name}' {rule}")))?;
        }
        let mut is_changed = false;
        for (&reference, value) in references.iter().zip(values) {
            let index = index(self, function, reference)?;
            is_changed |= set(&mut self.values, index, value);
        }
        let mut variables = references.iter().filter_map(|&reference| self.layout().by_reference(reference));
        if is_changed && variables.any(|variable| variable.role == Role::Parameter) {
            self.parameters_changed();
        }
        self.values_changed();
        Ok(())
    }
}
