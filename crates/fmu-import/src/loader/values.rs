//! Values and derivatives of variables.

use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::functions::{Functions, v2, v3};
use super::instance::Instance;
use super::special::{TOO_LARGE, WholeNumber};
use super::strings::text;
use crate::c_api::{self, Reference};
use crate::description::{BaseType, FmiVersion, Value, Variable};
use std::ptr;

/// Maximum number of dependencies of a variable.
const MOST_DEPENDENCIES: usize = 10_000_000;
const NOT_SLOPE: CallProblem = CallProblem::Arguments("the order of an input's derivative must be 1");

impl Instance {
    /// The values of all elements of a variable.
    pub fn get_values(&mut self, variable: &Variable) -> Result<Vec<Value>, CallError> {
        self.values_of(variable.reference, variable.base_type, variable.size)
    }

    pub(super) fn values_of(
        &mut self,
        reference: Reference,
        base_type: BaseType,
        size: usize,
    ) -> Result<Vec<Value>, CallError> {
        let reference = [reference];
        Ok(match base_type {
            BaseType::Real => {
                let mut values = vec![0.0; size];
                self.get_real(&reference, &mut values)?;
                values.into_iter().map(Value::Real).collect()
            }
            BaseType::Integer => {
                let mut values = vec![0_i128; size];
                self.get_integer(&reference, &mut values)?;
                values.into_iter().filter_map(Value::integer).collect()
            }
            BaseType::Boolean => {
                let mut values = vec![0; size];
                self.get_boolean(&reference, &mut values)?;
                values.into_iter().map(|value| Value::Boolean(value != 0)).collect()
            }
            BaseType::String => self.get_string(&reference)?.into_iter().map(Value::String).collect(),
            BaseType::Binary => self.get_binary(&reference)?.into_iter().map(|hex| Value::Binary { hex }).collect(),
        })
    }

    /// Sets the values of all elements of a variable, which must have the type of the variable.
    pub fn set_values(&mut self, variable: &Variable, values: &[Value]) -> Result<(), CallError> {
        self.set_values_of(variable.reference, variable.base_type, values)
    }

    pub(super) fn set_values_of(
        &mut self,
        reference: Reference,
        base_type: BaseType,
        values: &[Value],
    ) -> Result<(), CallError> {
        let reference = [reference];
        match base_type {
            BaseType::Real => {
                let values: Vec<f64> = values.iter().filter_map(Value::real).collect();
                self.set_real(&reference, &values)
            }
            BaseType::Integer => {
                let values: Vec<i128> = values.iter().filter_map(Value::whole).collect();
                self.set_integer(&reference, &values)
            }
            BaseType::Boolean => {
                let values: Vec<i32> = values.iter().map(|value| i32::from(*value == Value::Boolean(true))).collect();
                self.set_boolean(&reference, &values)
            }
            BaseType::String => {
                let text = |value: &Value| if let Value::String(text) = value { Some(text.clone()) } else { None };
                let texts: Vec<String> = values.iter().filter_map(text).collect();
                self.set_string(&reference, &texts.iter().map(String::as_str).collect::<Vec<_>>())
            }
            BaseType::Binary => {
                let bytes = |value: &Value| if let Value::Binary { hex } = value { Some(hex.clone()) } else { None };
                let values: Vec<Vec<u8>> = values.iter().filter_map(bytes).collect();
                self.set_binary(&reference, &values)
            }
        }
    }

    /// Sets a scalar, which must have the value's type.
    pub fn set_value(&mut self, reference: Reference, value: &Value) -> Result<(), CallError> {
        match value {
            Value::Real(value) => self.set_real(&[reference], &[*value]),
            Value::Integer(value) => self.set_integer(&[reference], &[i128::from(*value)]),
            Value::Unsigned(value) => self.set_integer(&[reference], &[i128::from(*value)]),
            Value::Boolean(value) => self.set_boolean(&[reference], &[i32::from(*value)]),
            Value::String(value) => self.set_string(&[reference], &[value]),
            Value::Binary { hex } => self.set_binary(&[reference], &[hex]),
        }
    }

    /// `fmi2GetReal`, `fmi3GetFloat64`. An array has one value per element.
    pub fn get_real(&mut self, refs: &[Reference], values: &mut [f64]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            return self.get_held(refs, values, Value::real, Self::get_real);
        }
        if self.has_special(refs) {
            if self.has_elements(refs) {
                return self.get_elements(refs, values, Self::get_real);
            }
            return self.get_special_reals(refs, values);
        }
        self.same_length(Function::GetReal, refs.len(), values.len())?;
        self.get_plain(Function::GetReal, refs, values, |f| f.get_real, |f| f.get_float64)
    }

    /// `fmi2GetInteger`, `fmi3GetInt32`, and the functions for other integer types. Fails if a value does not fit in
    /// `T`.
    pub fn get_integer<T: WholeNumber>(&mut self, refs: &[Reference], values: &mut [T]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            let of = |value: &Value| value.whole().and_then(T::from_whole);
            return self.get_held(refs, values, of, Self::get_integer);
        }
        if self.has_special(refs) {
            if self.has_elements(refs) {
                return self.get_elements(refs, values, Self::get_integer);
            }
            return self.get_special_integers(refs, values);
        }
        if let Some(values) = T::plain_mut(values) {
            return self.get_plain_integers(refs, values);
        }
        let mut plain = std::mem::take(&mut self.buffers.i32);
        plain.resize(values.len(), 0);
        let result = self.get_plain_integers(refs, &mut plain);
        for (value, plain) in values.iter_mut().zip(&plain) {
            *value = T::from_whole(i128::from(*plain)).unwrap_or(*value);
        }
        self.buffers.i32 = plain;
        result
    }

    fn get_plain_integers(&mut self, refs: &[Reference], values: &mut [i32]) -> Result<(), CallError> {
        self.same_length(Function::GetInteger, refs.len(), values.len())?;
        self.get_plain(Function::GetInteger, refs, values, |f| f.get_integer, |f| f.get_int32)
    }

    /// `fmi2GetBoolean`, `fmi3GetBoolean`; 0 is false, every other value is true.
    pub fn get_boolean(&mut self, refs: &[Reference], values: &mut [c_api::Boolean]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            let of = |value: &Value| if let Value::Boolean(is) = value { Some((*is).into()) } else { None };
            return self.get_held(refs, values, of, Self::get_boolean);
        }
        if self.fmi() == FmiVersion::V3 {
            if self.has_special(refs) && self.has_elements(refs) {
                return self.get_elements(refs, values, Self::get_boolean);
            }
            return self.get_bools(refs, values);
        }
        self.same_length(Function::GetBoolean, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call_v2(Function::GetBoolean, |f, c| unsafe {
            Some((f.get_boolean)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr()))
        })
    }

    /// `fmi2GetString`, `fmi3GetString`: one String per element.
    pub fn get_string(&mut self, refs: &[Reference]) -> Result<Vec<String>, CallError> {
        if self.has_clocked(refs) {
            let of = |value: &Value| if let Value::String(text) = value { Some(text.clone()) } else { None };
            let get = |this: &mut Self, refs: &[Reference], values: &mut [String]| {
                values.clone_from_slice(&this.get_string(refs)?);
                Ok(())
            };
            let mut values = vec![String::new(); self.elements(refs)];
            self.get_held(refs, &mut values, of, get)?;
            return Ok(values);
        }
        if self.has_special(refs) && self.has_elements(refs) {
            return self.get_list_elements(refs, Self::get_string);
        }
        let mut pointers = vec![ptr::null(); self.elements(refs)];
        self.get_plain(Function::GetString, refs, &mut pointers, |f| f.get_string, |f| f.get_string)?;
        // SAFETY: the FMU filled in C strings that stay valid until its next function is called.
        Ok(pointers.into_iter().map(|p| unsafe { text(p) }).collect())
    }

    /// Reads variables with the same C type in both versions. Panics if there are fewer values than variables.
    fn get_plain<T>(
        &mut self,
        function: Function,
        refs: &[Reference],
        values: &mut [T],
        in_v2: impl FnOnce(&v2::Functions) -> c_api::Get<T>,
        in_v3: impl FnOnce(&v3::Functions) -> c_api::v3::Get<T>,
    ) -> Result<(), CallError> {
        // SAFETY: live instance; both arrays have the stated length.
        self.call(function, |f, c| unsafe {
            match f {
                Functions::V2(f) => in_v2(f)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr()),
                Functions::V3(f) => in_v3(f)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr(), values.len()),
            }
        })
    }

    /// Sets the variables that [`Self::get_plain`] reads.
    fn set_plain<T>(
        &mut self,
        function: Function,
        refs: &[Reference],
        values: &[T],
        in_v2: impl FnOnce(&v2::Functions) -> c_api::Set<T>,
        in_v3: impl FnOnce(&v3::Functions) -> c_api::v3::Set<T>,
    ) -> Result<(), CallError> {
        assert!(values.len() >= refs.len(), "a value for each variable");
        // SAFETY: live instance; both arrays have the stated length (FMI 2.0: asserted); strings outlive the call.
        self.call(function, |f, c| unsafe {
            match f {
                Functions::V2(f) => in_v2(f)(c, refs.as_ptr(), refs.len(), values.as_ptr()),
                Functions::V3(f) => in_v3(f)(c, refs.as_ptr(), refs.len(), values.as_ptr(), values.len()),
            }
        })
    }

    /// `fmi2SetReal`, `fmi3SetFloat64`. An array has one value per element.
    pub fn set_real(&mut self, refs: &[Reference], values: &[f64]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            return self.set_held(refs, values, |value| Some(Value::Real(*value)), Self::set_real);
        }
        if self.integration.is_some() {
            self.keep_inputs(refs, values);
            if !self.is_set_now(refs, values, Self::get_real)? {
                return Ok(());
            }
        }
        if self.has_special(refs) {
            if self.has_elements(refs) {
                return self.set_elements(refs, values, Self::get_real, Self::set_real);
            }
            return self.set_special_reals(refs, values);
        }
        self.same_length(Function::SetReal, refs.len(), values.len())?;
        self.set_plain(Function::SetReal, refs, values, |f| f.set_real, |f| f.set_float64)
    }

    /// `fmi2SetInteger`, `fmi3SetInt32`; also sets enumerations and the other integer types of FMI 3.0. Also fails if a
    /// value does not fit in the variable's type.
    pub fn set_integer<T: WholeNumber>(&mut self, refs: &[Reference], values: &[T]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            let to = |value: &T| value.whole().and_then(Value::integer);
            return self.set_held(refs, values, to, Self::set_integer);
        }
        if self.integration.is_some() && !self.is_set_now(refs, values, Self::get_integer)? {
            return Ok(());
        }
        if self.has_special(refs) {
            if self.has_elements(refs) {
                return self.set_elements(refs, values, Self::get_integer, Self::set_integer);
            }
            return self.set_special_integers(refs, values);
        }
        if let Some(values) = T::plain(values) {
            return self.set_plain_integers(refs, values);
        }
        let mut plain = std::mem::take(&mut self.buffers.i32);
        plain.clear();
        plain.extend(values.iter().filter_map(|value| i32::try_from(value.whole()?).ok()));
        let result = if plain.len() == values.len() {
            self.set_plain_integers(refs, &plain)
        } else {
            Err(self.failure(Function::SetInteger, TOO_LARGE))
        };
        self.buffers.i32 = plain;
        result
    }

    fn set_plain_integers(&mut self, refs: &[Reference], values: &[i32]) -> Result<(), CallError> {
        self.same_length(Function::SetInteger, refs.len(), values.len())?;
        self.set_plain(Function::SetInteger, refs, values, |f| f.set_integer, |f| f.set_int32)
    }

    /// `fmi2SetBoolean`, `fmi3SetBoolean`; values are 0 or 1.
    pub fn set_boolean(&mut self, refs: &[Reference], values: &[c_api::Boolean]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            return self.set_held(refs, values, |value| Some(Value::Boolean(*value != 0)), Self::set_boolean);
        }
        if self.integration.is_some() && !self.is_set_now(refs, values, Self::get_boolean)? {
            return Ok(());
        }
        if self.fmi() == FmiVersion::V3 {
            if self.has_special(refs) && self.has_elements(refs) {
                return self.set_elements(refs, values, Self::get_boolean, Self::set_boolean);
            }
            return self.set_bools(refs, values);
        }
        self.same_length(Function::SetBoolean, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call_v2(Function::SetBoolean, |f, c| unsafe {
            Some((f.set_boolean)(c, refs.as_ptr(), refs.len(), values.as_ptr()))
        })
    }

    /// `fmi2SetString`, `fmi3SetString`: one String per element.
    pub fn set_string(&mut self, refs: &[Reference], values: &[&str]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            let to = |value: &&str| Some(Value::String((*value).to_owned()));
            return self.set_held(refs, values, to, Self::set_string);
        }
        self.is_set_now(refs, &[], Self::get_real)?;
        if self.has_special(refs) && self.has_elements(refs) {
            let texts: Vec<String> = values.iter().map(|text| (*text).to_owned()).collect();
            let of = |start: &Value| if let Value::String(text) = start { Some(text.clone()) } else { None };
            let set = |this: &mut Self, refs: &[Reference], texts: &[String]| {
                this.set_string(refs, &texts.iter().map(String::as_str).collect::<Vec<_>>())
            };
            return self.set_list_elements(refs, &texts, |whole| &mut whole.texts, of, Self::get_string, set);
        }
        self.same_length(Function::SetString, self.elements(refs), values.len())?;
        let (_owned, pointers) = self.c_strings(Function::SetString, values)?;
        self.set_plain(Function::SetString, refs, &pointers, |f| f.set_string, |f| f.set_string)
    }

    /// `fmi2GetDirectionalDerivative`, `fmi3GetDirectionalDerivative`: `result` = d(unknowns)/d(knowns) * `seed`. An
    /// array has one number per element in `seed` and `result`. If the FMU discards the call without a message, the
    /// call is repeated with debug logging, to get the reason.
    pub fn get_directional_derivative(
        &mut self,
        unknowns: &[Reference],
        knowns: &[Reference],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        match self.directional_derivative(unknowns, knowns, seed, result) {
            Err(error) if error.is_discarded() && error.messages.is_empty() => {
                if self.set_debug_logging(true, &[]).is_err() {
                    return Err(error);
                }
                let repeated = self.directional_derivative(unknowns, knowns, seed, result);
                let _ = self.set_debug_logging(false, &[]);
                repeated
            }
            result => result,
        }
    }

    fn directional_derivative(
        &mut self,
        unknowns: &[Reference],
        knowns: &[Reference],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetDirectionalDerivative;
        self.same_length(NAME, self.elements(knowns), seed.len())?;
        self.same_length(NAME, self.elements(unknowns), result.len())?;
        let (u, k) = ((unknowns.as_ptr(), unknowns.len()), (knowns.as_ptr(), knowns.len()));
        // SAFETY: live instance; all arrays have the stated lengths.
        self.call_present(NAME, |f, c| unsafe {
            match f {
                Functions::V2(f) => {
                    let get = f.get_directional_derivative?;
                    Some(get(c, u.0, u.1, k.0, k.1, seed.as_ptr(), result.as_mut_ptr()))
                }
                Functions::V3(f) => {
                    let get = f.get_directional_derivative?;
                    Some(get(c, u.0, u.1, k.0, k.1, seed.as_ptr(), seed.len(), result.as_mut_ptr(), result.len()))
                }
            }
        })
    }

    /// `fmi3GetAdjointDerivative`: `result` = `seed` * d(unknowns)/d(knowns), with one number per array element.
    pub fn get_adjoint_derivative(
        &mut self,
        unknowns: &[Reference],
        knowns: &[Reference],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetAdjointDerivative;
        self.same_length(NAME, self.elements(unknowns), seed.len())?;
        self.same_length(NAME, self.elements(knowns), result.len())?;
        let (u, k) = ((unknowns.as_ptr(), unknowns.len()), (knowns.as_ptr(), knowns.len()));
        // SAFETY: live instance; all arrays have the stated lengths.
        self.call_v3(NAME, |f, c| unsafe {
            let get = f.get_adjoint_derivative?;
            Some(get(c, u.0, u.1, k.0, k.1, seed.as_ptr(), seed.len(), result.as_mut_ptr(), result.len()))
        })
    }

    /// `fmi3GetVariableDependencies`: the dependencies of a variable at present, each as its element, the variable on
    /// which it depends, and the element of that one. Elements count from 1; 0 is all elements.
    pub fn get_dependencies(&mut self, of: Reference) -> Result<Vec<(usize, Reference, usize)>, CallError> {
        let (number_of, function) = (Function::GetNumberOfVariableDependencies, Function::GetVariableDependencies);
        let mut n = 0;
        // SAFETY: live instance; the number is written through a valid pointer.
        self.call_v3(number_of, |f, c| unsafe { Some(f.get_number_of_dependencies?(c, of, &raw mut n)) })?;
        if n > MOST_DEPENDENCIES {
            return Err(self.failure(number_of, CallProblem::Arguments("there are more than 10000000 dependencies")));
        }
        let (mut elements, mut independents, mut theirs, mut kinds) = (vec![0; n], vec![0; n], vec![0; n], vec![0; n]);
        let arrays = (elements.as_mut_ptr(), independents.as_mut_ptr(), theirs.as_mut_ptr(), kinds.as_mut_ptr());
        // SAFETY: live instance; all arrays have the stated length.
        self.call_v3(function, |f, c| unsafe {
            let (own, variables, their, kinds) = arrays;
            Some(f.get_dependencies?(c, of, own, variables, their, kinds, n))
        })?;
        Ok(elements.into_iter().zip(independents).zip(theirs).map(|((own, of), its)| (own, of, its)).collect())
    }

    /// `fmi2SetRealInputDerivatives`; one order per reference, from 1. If [`Self::do_step`] integrates the states, the
    /// input follows its slope during the step; other orders are errors.
    pub fn set_real_input_derivatives(
        &mut self,
        refs: &[Reference],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::SetInputDerivatives;
        self.same_length(NAME, refs.len(), values.len())?;
        self.same_length(NAME, refs.len(), orders.len())?;
        if self.integration.is_some() {
            let is_slope = orders.iter().all(|order| *order == 1);
            return if is_slope { self.keep_slopes(refs, values) } else { Err(self.failure(NAME, NOT_SLOPE)) };
        }
        // SAFETY: live instance; all arrays have the stated length.
        self.call_v2(NAME, |f, c| unsafe {
            Some(f.set_real_input_derivatives?(c, refs.as_ptr(), refs.len(), orders.as_ptr(), values.as_ptr()))
        })
    }

    /// `fmi2GetRealOutputDerivatives`, `fmi3GetOutputDerivatives`; one order per reference, from 1.
    pub fn get_real_output_derivatives(
        &mut self,
        refs: &[Reference],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetOutputDerivatives;
        self.same_length(NAME, self.elements(refs), values.len())?;
        self.same_length(NAME, refs.len(), orders.len())?;
        // SAFETY: live instance; all arrays have the stated length.
        self.call_present(NAME, |f, c| unsafe {
            let (references, count, orders, numbers) =
                (refs.as_ptr(), refs.len(), orders.as_ptr(), values.as_mut_ptr());
            match f {
                Functions::V2(f) => Some(f.get_real_output_derivatives?(c, references, count, orders, numbers)),
                Functions::V3(f) => {
                    Some(f.get_output_derivatives?(c, references, count, orders, numbers, values.len()))
                }
            }
        })
    }
}
