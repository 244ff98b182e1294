//! FMI 3.0 values that the plain getters and setters cannot transfer: arrays, and types without a C type in FMI 2.0.
//!
//! Each call to the FMU transfers one of these variables. An array element
//! ([`ModelDescription::with_elements`](crate::description::ModelDescription::with_elements)) is read and written
//! together with its entire array.

use super::array_values::{Buffered, Kept, Whole};
use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::functions::{Functions, v2, v3};
use super::instance::Instance;
use crate::c_api::v3::{Get, Set};
use crate::c_api::{self, Reference};
use crate::description::{BaseType, DataType, FmiVersion, Value};
use crate::signature::Special;
use std::collections::HashMap;
use std::sync::Arc;

const OTHER_NUMBER: CallProblem = CallProblem::Arguments("the number of values must equal the number of elements");
pub(super) const OTHER_TYPE: CallProblem = CallProblem::Arguments("the variable has another type");
pub(super) const TOO_LARGE: CallProblem = CallProblem::Arguments("a value does not fit the type of the variable");

impl Instance {
    /// Returns true if the variable has an integer type wider than `i32`.
    pub fn is_wide(&self, reference: Reference) -> bool {
        let data_type = self.signature().special(reference).map(|special| special.data_type);
        matches!(data_type, Some(DataType::UInt32)) || self.is_exact(reference)
    }

    /// Returns true if the variable has an integer type with values that an `f64` cannot represent.
    pub fn is_exact(&self, reference: Reference) -> bool {
        let data_type = self.signature().special(reference).map(|special| special.data_type);
        matches!(data_type, Some(DataType::Int64 | DataType::UInt64))
    }

    pub(super) fn has_elements(&self, refs: &[Reference]) -> bool {
        refs.iter().any(|reference| self.signature().element(*reference).is_some())
    }

    /// Reads variables, including array elements. For consecutive elements of an array, the array is read once.
    pub(super) fn get_elements<T: Kept>(
        &mut self,
        refs: &[Reference],
        mut values: &mut [T],
        get: impl Fn(&mut Self, &[Reference], &mut [T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_elements(Function::GetReal, refs, values.len())?;
        for refs in self.by_array(refs) {
            let own = values.split_off_mut(..self.elements(refs)).unwrap_or_default();
            let Some((first, size)) = self.signature().element(refs[0]) else {
                get(self, refs, own)?;
                continue;
            };
            let mut array = std::mem::take(&mut T::part(&mut self.whole).values);
            array.resize(size, T::default());
            get(self, &[first.array], &mut array)?;
            for (value, reference) in own.iter_mut().zip(refs) {
                *value = self.signature().element(*reference).map_or(*value, |(element, _)| array[element.index]);
            }
            T::part(&mut self.whole).values = array;
        }
        Ok(())
    }

    /// Writes variables, including array elements. Other elements of the array keep their values.
    pub(super) fn set_elements<T: Kept>(
        &mut self,
        refs: &[Reference],
        mut values: &[T],
        get: impl Fn(&mut Self, &[Reference], &mut [T]) -> Result<(), CallError>,
        set: impl Fn(&mut Self, &[Reference], &[T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_elements(Function::SetReal, refs, values.len())?;
        for refs in self.by_array(refs) {
            let own = values.split_off(..self.elements(refs)).unwrap_or_default();
            let Some((first, size)) = self.signature().element(refs[0]) else {
                set(self, refs, own)?;
                continue;
            };
            let mut array = std::mem::take(&mut T::part(&mut self.whole).values);
            array.resize(size, T::default());
            // Variables cannot be read before the initialization (FMI 3.0.2, section 2.3.2).
            let is_given = !self.has_entered && self.given(first.array, &mut array);
            if !is_given {
                get(self, &[first.array], &mut array)?;
            }
            for (value, reference) in own.iter().zip(refs) {
                if let Some((element, _)) = self.signature().element(*reference) {
                    array[element.index] = *value;
                }
            }
            set(self, &[first.array], &array)?;
            let part = T::part(&mut self.whole);
            if is_given {
                part.given.insert(first.array, array.clone());
            }
            part.values = array;
        }
        Ok(())
    }

    /// Like [`Self::set_elements`], for Strings and Binaries. `given` are the values that were set before initialization.
    pub(super) fn set_list_elements<V: Clone>(
        &mut self,
        refs: &[Reference],
        mut values: &[V],
        given: impl Fn(&mut Whole) -> &mut HashMap<Reference, Vec<V>>,
        of: impl Fn(&Value) -> Option<V>,
        get: impl Fn(&mut Self, &[Reference]) -> Result<Vec<V>, CallError>,
        set: impl Fn(&mut Self, &[Reference], &[V]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        self.check_elements(Function::SetString, refs, values.len())?;
        for reference in refs {
            let own = values.split_off(..self.elements(&[*reference])).unwrap_or_default();
            let Some((element, size)) = self.signature().element(*reference) else {
                set(self, &[*reference], own)?;
                continue;
            };
            let starts: Vec<V> = self.signature().starts(element.array).iter().filter_map(&of).collect();
            let known = given(&mut self.whole).get(&element.array).cloned().or(Some(starts));
            // Variables cannot be read before the initialization (FMI 3.0.2, section 2.3.2).
            let mut array = match known.filter(|known| !self.has_entered && known.len() == size) {
                Some(known) => known,
                None => get(self, &[element.array])?,
            };
            array[element.index].clone_from(&own[0]);
            set(self, &[element.array], &array)?;
            if !self.has_entered {
                given(&mut self.whole).insert(element.array, array);
            }
        }
        Ok(())
    }

    /// Reads Strings or Binaries, including array elements.
    pub(super) fn get_list_elements<V: Clone>(
        &mut self,
        refs: &[Reference],
        get: impl Fn(&mut Self, &[Reference]) -> Result<Vec<V>, CallError>,
    ) -> Result<Vec<V>, CallError> {
        let mut values = Vec::new();
        for reference in refs {
            match self.signature().element(*reference) {
                None => values.append(&mut get(self, &[*reference])?),
                Some((element, _)) => values.push(get(self, &[element.array])?.swap_remove(element.index)),
            }
        }
        Ok(values)
    }

    /// Before initialization, gets the values to which an array was set, or else its start values. Returns false if
    /// there are none.
    fn given<T: Kept>(&mut self, array: Reference, values: &mut [T]) -> bool {
        if let Some(given) = T::part(&mut self.whole).given.get(&array) {
            values.copy_from_slice(given);
            return true;
        }
        let starts: Vec<T> = self.signature().starts(array).iter().filter_map(T::of).collect();
        let is_whole = starts.len() == values.len();
        if is_whole {
            values.copy_from_slice(&starts);
        }
        is_whole
    }

    /// Splits a list of variables into parts: consecutive elements of one array, or variables that are not elements.
    fn by_array<'r>(&self, refs: &'r [Reference]) -> impl Iterator<Item = &'r [Reference]> + use<'r> {
        let library = Arc::clone(self.library());
        let array = move |reference: Reference| library.signature.element(reference).map(|(element, _)| element.array);
        refs.chunk_by(move |one, next| array(*one) == array(*next))
    }

    /// Returns true if one of the variables is an array or needs a special function.
    pub(super) fn has_special(&self, refs: &[Reference]) -> bool {
        // FMI 2.0 has no such variables; the test of the version avoids the search.
        self.fmi() == FmiVersion::V3 && self.signature().has_special(refs)
    }

    pub(super) fn elements(&self, refs: &[Reference]) -> usize {
        self.signature().elements(refs)
    }

    fn special(&self, reference: Reference, plain: DataType) -> Special {
        self.signature().special(reference).unwrap_or(Special { data_type: plain, size: 1, element: None })
    }

    pub(super) fn get_special_reals(&mut self, refs: &[Reference], mut values: &mut [f64]) -> Result<(), CallError> {
        self.check_elements(Function::GetReal, refs, values.len())?;
        for &reference in refs {
            let Special { data_type, size, .. } = self.special(reference, DataType::Float64);
            let own = values.split_off_mut(..size).unwrap_or_default();
            match data_type {
                DataType::Float64 => self.get_array(reference, own),
                DataType::Float32 => {
                    self.get_as(Function::GetFloat32, &[reference], own, |f| f.get_float32, |v: f32| Ok(v.into()))
                }
                _ => Err(self.failure(Function::GetReal, OTHER_TYPE)),
            }?;
        }
        Ok(())
    }

    pub(super) fn set_special_reals(&mut self, refs: &[Reference], mut values: &[f64]) -> Result<(), CallError> {
        self.check_elements(Function::SetReal, refs, values.len())?;
        for &reference in refs {
            let Special { data_type, size, .. } = self.special(reference, DataType::Float64);
            let own = values.split_off(..size).unwrap_or_default();
            match data_type {
                DataType::Float64 => self.set_array(reference, own),
                DataType::Float32 => {
                    let narrow = |value: f64| Some(value as f32).filter(|v| v.is_finite() == value.is_finite());
                    self.set_as(Function::SetFloat32, &[reference], own, |f| f.set_float32, narrow)
                }
                _ => Err(self.failure(Function::SetReal, OTHER_TYPE)),
            }?;
        }
        Ok(())
    }

    pub(super) fn get_special_integers<T: WholeNumber>(
        &mut self,
        refs: &[Reference],
        mut values: &mut [T],
    ) -> Result<(), CallError> {
        use Function as F;
        self.check_elements(F::GetInteger, refs, values.len())?;
        for &reference in refs {
            let Special { data_type, size, .. } = self.special(reference, DataType::Int32);
            let own = values.split_off_mut(..size).unwrap_or_default();
            match data_type {
                DataType::Int32 => self.get_whole_as(F::GetInteger, reference, own, |f| Some(f.get_int32)),
                DataType::Int8 => self.get_whole_as(F::GetInt8, reference, own, |f| f.get_int8),
                DataType::UInt8 => self.get_whole_as(F::GetUInt8, reference, own, |f| f.get_uint8),
                DataType::Int16 => self.get_whole_as(F::GetInt16, reference, own, |f| f.get_int16),
                DataType::UInt16 => self.get_whole_as(F::GetUInt16, reference, own, |f| f.get_uint16),
                DataType::UInt32 => self.get_whole_as(F::GetUInt32, reference, own, |f| f.get_uint32),
                DataType::Int64 | DataType::Enumeration => {
                    self.get_whole_as(F::GetInt64, reference, own, |f| f.get_int64)
                }
                DataType::UInt64 => self.get_whole_as(F::GetUInt64, reference, own, |f| f.get_uint64),
                _ => Err(self.failure(F::GetInteger, OTHER_TYPE)),
            }?;
        }
        Ok(())
    }

    pub(super) fn set_special_integers<T: WholeNumber>(
        &mut self,
        refs: &[Reference],
        mut values: &[T],
    ) -> Result<(), CallError> {
        use Function as F;
        self.check_elements(F::SetInteger, refs, values.len())?;
        for &reference in refs {
            let Special { data_type, size, .. } = self.special(reference, DataType::Int32);
            let own = values.split_off(..size).unwrap_or_default();
            match data_type {
                DataType::Int32 => self.set_whole_as(F::SetInteger, reference, own, |f| Some(f.set_int32)),
                DataType::Int8 => self.set_whole_as(F::SetInt8, reference, own, |f| f.set_int8),
                DataType::UInt8 => self.set_whole_as(F::SetUInt8, reference, own, |f| f.set_uint8),
                DataType::Int16 => self.set_whole_as(F::SetInt16, reference, own, |f| f.set_int16),
                DataType::UInt16 => self.set_whole_as(F::SetUInt16, reference, own, |f| f.set_uint16),
                DataType::UInt32 => self.set_whole_as(F::SetUInt32, reference, own, |f| f.set_uint32),
                DataType::Int64 | DataType::Enumeration => {
                    self.set_whole_as(F::SetInt64, reference, own, |f| f.set_int64)
                }
                DataType::UInt64 => self.set_whole_as(F::SetUInt64, reference, own, |f| f.set_uint64),
                _ => Err(self.failure(F::SetInteger, OTHER_TYPE)),
            }?;
        }
        Ok(())
    }

    fn get_whole_as<S: Buffered + Into<i128>, T: WholeNumber>(
        &mut self,
        function: Function,
        reference: Reference,
        values: &mut [T],
        select: impl FnOnce(&v3::Functions) -> Option<Get<S>>,
    ) -> Result<(), CallError> {
        self.get_as(function, &[reference], values, select, |value| T::from_whole(value.into()).ok_or(T::NOT_HELD))
    }

    fn set_whole_as<S: Buffered + TryFrom<i128>, T: WholeNumber>(
        &mut self,
        function: Function,
        reference: Reference,
        values: &[T],
        select: impl FnOnce(&v3::Functions) -> Option<Set<S>>,
    ) -> Result<(), CallError> {
        self.set_as(function, &[reference], values, select, |value: T| S::try_from(value.whole()?).ok())
    }

    pub(super) fn get_bools(&mut self, refs: &[Reference], mut values: &mut [c_api::Boolean]) -> Result<(), CallError> {
        const NAME: Function = Function::GetBoolean;
        self.check_elements(NAME, refs, values.len())?;
        let is_special = self.has_special(refs);
        for refs in refs.chunks(if is_special { 1 } else { refs.len().max(1) }) {
            let own = values.split_off_mut(..self.boolean_elements(NAME, refs, is_special)?).unwrap_or_default();
            self.get_as(NAME, refs, own, |f| Some(f.get_boolean), |byte| Ok(byte.into()))?;
        }
        Ok(())
    }

    pub(super) fn set_bools(&mut self, refs: &[Reference], mut values: &[c_api::Boolean]) -> Result<(), CallError> {
        const NAME: Function = Function::SetBoolean;
        self.check_elements(NAME, refs, values.len())?;
        let is_special = self.has_special(refs);
        for refs in refs.chunks(if is_special { 1 } else { refs.len().max(1) }) {
            let own = values.split_off(..self.boolean_elements(NAME, refs, is_special)?).unwrap_or_default();
            self.set_as(NAME, refs, own, |f| Some(f.set_boolean), |value| Some(value != 0))?;
        }
        Ok(())
    }

    /// Number of Booleans that a call with these variables transfers.
    fn boolean_elements(
        &mut self,
        function: Function,
        refs: &[Reference],
        is_special: bool,
    ) -> Result<usize, CallError> {
        match refs {
            [reference] if is_special => {
                let Special { data_type, size, .. } = self.special(*reference, DataType::Boolean);
                let is_boolean = data_type.base_type() == Some(BaseType::Boolean);
                if is_boolean { Ok(size) } else { Err(self.failure(function, OTHER_TYPE)) }
            }
            _ => Ok(refs.len()),
        }
    }

    pub(super) fn check_elements(
        &mut self,
        function: Function,
        refs: &[Reference],
        values: usize,
    ) -> Result<(), CallError> {
        if self.elements(refs) == values { Ok(()) } else { Err(self.failure(function, OTHER_NUMBER)) }
    }

    pub(super) fn call_v2(
        &mut self,
        function: Function,
        call: impl FnOnce(&v2::Functions, c_api::Component) -> Option<c_api::RawStatus>,
    ) -> Result<(), CallError> {
        self.call_present(function, |f, component| match f {
            Functions::V2(f) => call(f, component),
            Functions::V3(_) => None,
        })
    }

    pub(super) fn call_v3(
        &mut self,
        function: Function,
        call: impl FnOnce(&v3::Functions, c_api::Component) -> Option<c_api::RawStatus>,
    ) -> Result<(), CallError> {
        self.call_present(function, |f, component| match f {
            Functions::V2(_) => None,
            Functions::V3(f) => call(f, component),
        })
    }

    fn get_as<S: Buffered, T: Copy>(
        &mut self,
        function: Function,
        refs: &[Reference],
        values: &mut [T],
        select: impl FnOnce(&v3::Functions) -> Option<Get<S>>,
        convert: impl Fn(S) -> Result<T, &'static str>,
    ) -> Result<(), CallError> {
        let mut buffer = std::mem::take(S::of(&mut self.buffers));
        buffer.clear();
        buffer.resize(values.len(), S::default());
        // SAFETY: live instance; both arrays have the stated length.
        let mut result = self.call_v3(function, |f, c| unsafe {
            Some(select(f)?(c, refs.as_ptr(), refs.len(), buffer.as_mut_ptr(), buffer.len()))
        });
        for (value, read) in values.iter_mut().zip(&buffer) {
            if result.is_err() {
                break;
            }
            match convert(*read) {
                Ok(converted) => *value = converted,
                Err(problem) => result = Err(self.failure(function, CallProblem::Arguments(problem))),
            }
        }
        *S::of(&mut self.buffers) = buffer;
        result
    }

    fn set_as<S: Buffered, T: Copy>(
        &mut self,
        function: Function,
        refs: &[Reference],
        values: &[T],
        select: impl FnOnce(&v3::Functions) -> Option<Set<S>>,
        convert: impl Fn(T) -> Option<S>,
    ) -> Result<(), CallError> {
        let mut buffer = std::mem::take(S::of(&mut self.buffers));
        buffer.clear();
        buffer.extend(values.iter().map_while(|value| convert(*value)));
        let result = if buffer.len() == values.len() {
            // SAFETY: live instance; both arrays have the stated length.
            self.call_v3(function, |f, c| unsafe {
                Some(select(f)?(c, refs.as_ptr(), refs.len(), buffer.as_ptr(), buffer.len()))
            })
        } else {
            Err(self.failure(function, TOO_LARGE))
        };
        *S::of(&mut self.buffers) = buffer;
        result
    }
}

/// A type that can represent Integers exactly: `i32`, `i128` (all types), and `f64` up to 2^53.
#[allow(private_bounds, reason = "only the loader stores values")]
pub trait WholeNumber: Kept {
    /// Error message for a value that the type cannot represent.
    const NOT_HELD: &'static str;
    /// Converts a number; `None` if the type cannot represent it.
    fn from_whole(number: i128) -> Option<Self>;
    /// Converts to a number; `None` if the value is not a whole number.
    fn whole(self) -> Option<i128>;
    /// The values, if `Self` is the C type of an Integer in FMI 2.0.
    fn plain(_values: &[Self]) -> Option<&[i32]> {
        None
    }
    /// Like [`Self::plain`].
    fn plain_mut(_values: &mut [Self]) -> Option<&mut [i32]> {
        None
    }
}

impl WholeNumber for i32 {
    const NOT_HELD: &'static str = "a value does not fit in a signed 32-bit integer";

    fn plain(values: &[Self]) -> Option<&[i32]> {
        Some(values)
    }

    fn plain_mut(values: &mut [Self]) -> Option<&mut [i32]> {
        Some(values)
    }

    fn from_whole(number: i128) -> Option<Self> {
        number.try_into().ok()
    }

    fn whole(self) -> Option<i128> {
        Some(self.into())
    }
}

impl WholeNumber for i128 {
    const NOT_HELD: &'static str = "a value has more than 64 bits";

    fn from_whole(number: i128) -> Option<Self> {
        Some(number)
    }

    fn whole(self) -> Option<i128> {
        Some(self)
    }
}

impl WholeNumber for f64 {
    const NOT_HELD: &'static str = "a value is beyond 2^53 and cannot be represented exactly in a signal";

    fn from_whole(number: i128) -> Option<Self> {
        (number.unsigned_abs() <= 1 << f64::MANTISSA_DIGITS).then_some(number as Self)
    }

    fn whole(self) -> Option<i128> {
        (self.fract() == 0.0 && self.abs() <= (1_u64 << Self::MANTISSA_DIGITS) as Self).then_some(self as i128)
    }
}
