//! Values of FMI 3.0 that the plain getters and setters cannot transfer: arrays, and types without a C type of FMI 2.0.
//!
//! A call of the FMU transfers one of these variables, so that it has no order of types to keep. Scalars are converted on
//! the stack.

use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::functions::{Functions, v3};
use super::instance::Instance;
use crate::c_api::v3::{Get, RawBoolean, Set};
use crate::c_api::{self, Reference};
use crate::description::{BaseType, DataType, FmiVersion};
use crate::signature::Special;

/// Booleans that are converted at once, without memory from the heap.
const CHUNK: usize = 64;
const OTHER_NUMBER: CallProblem = CallProblem::Arguments("the number of values is not that of the elements");
const OTHER_TYPE: CallProblem = CallProblem::Arguments("the variable is of another type");
const NOT_32_BITS: CallProblem = CallProblem::Arguments("a value does not fit a signed integer of 32 bits");
const TOO_LARGE: CallProblem = CallProblem::Arguments("a value does not fit the type of the variable");

impl Instance {
    /// Whether one of the variables is an array or needs a function of its own.
    pub(super) fn has_special(&self, refs: &[Reference]) -> bool {
        // Both versions read the version anyway; one of FMI 2.0 looks no further.
        self.fmi() == FmiVersion::V3 && self.signature().has_special(refs)
    }

    /// Number of elements of variables.
    pub(super) fn elements(&self, refs: &[Reference]) -> usize {
        self.signature().elements(refs)
    }

    fn special(&self, reference: Reference, plain: DataType) -> Special {
        self.signature().special(reference).unwrap_or(Special { data_type: plain, size: 1 })
    }

    pub(super) fn get_special_reals(&mut self, refs: &[Reference], values: &mut [f64]) -> Result<(), CallError> {
        self.check_elements(Function::GetReal, refs, values.len())?;
        let mut rest = values;
        for &reference in refs {
            let Special { data_type, size } = self.special(reference, DataType::Float64);
            let (own, others) = rest.split_at_mut(size);
            rest = others;
            match data_type {
                DataType::Float64 => self.get_as(Function::GetReal, reference, own, |f| Some(f.get_float64), Some)?,
                DataType::Float32 => {
                    self.get_as(Function::GetFloat32, reference, own, |f| f.get_float32, |v: f32| Some(f64::from(v)))?;
                }
                _ => return Err(self.failure(Function::GetReal, OTHER_TYPE)),
            }
        }
        Ok(())
    }

    pub(super) fn set_special_reals(&mut self, refs: &[Reference], values: &[f64]) -> Result<(), CallError> {
        self.check_elements(Function::SetReal, refs, values.len())?;
        let mut rest = values;
        for &reference in refs {
            let Special { data_type, size } = self.special(reference, DataType::Float64);
            let (own, others) = rest.split_at(size);
            rest = others;
            match data_type {
                DataType::Float64 => self.set_as(Function::SetReal, reference, own, |f| Some(f.set_float64), Some)?,
                DataType::Float32 => {
                    let narrow = |value: f64| Some(value as f32).filter(|v| v.is_finite() == value.is_finite());
                    self.set_as(Function::SetFloat32, reference, own, |f| f.set_float32, narrow)?;
                }
                _ => return Err(self.failure(Function::SetReal, OTHER_TYPE)),
            }
        }
        Ok(())
    }

    pub(super) fn get_special_integers(&mut self, refs: &[Reference], values: &mut [i32]) -> Result<(), CallError> {
        use Function as F;
        self.check_elements(F::GetInteger, refs, values.len())?;
        let mut rest = values;
        for &reference in refs {
            let Special { data_type, size } = self.special(reference, DataType::Int32);
            let (own, others) = rest.split_at_mut(size);
            rest = others;
            match data_type {
                DataType::Int32 => self.get_as(F::GetInteger, reference, own, |f| Some(f.get_int32), Some),
                DataType::Int8 => self.get_as(F::GetInt8, reference, own, |f| f.get_int8, |v: i8| Some(v.into())),
                DataType::UInt8 => self.get_as(F::GetUInt8, reference, own, |f| f.get_uint8, |v: u8| Some(v.into())),
                DataType::Int16 => self.get_as(F::GetInt16, reference, own, |f| f.get_int16, |v: i16| Some(v.into())),
                DataType::UInt16 => {
                    self.get_as(F::GetUInt16, reference, own, |f| f.get_uint16, |v: u16| Some(v.into()))
                }
                DataType::UInt32 => {
                    self.get_as(F::GetUInt32, reference, own, |f| f.get_uint32, |v: u32| v.try_into().ok())
                }
                DataType::Int64 | DataType::Enumeration => {
                    self.get_as(F::GetInt64, reference, own, |f| f.get_int64, |v: i64| v.try_into().ok())
                }
                DataType::UInt64 => {
                    self.get_as(F::GetUInt64, reference, own, |f| f.get_uint64, |v: u64| v.try_into().ok())
                }
                _ => Err(self.failure(F::GetInteger, OTHER_TYPE)),
            }?;
        }
        Ok(())
    }

    pub(super) fn set_special_integers(&mut self, refs: &[Reference], values: &[i32]) -> Result<(), CallError> {
        use Function as F;
        self.check_elements(F::SetInteger, refs, values.len())?;
        let mut rest = values;
        for &reference in refs {
            let Special { data_type, size } = self.special(reference, DataType::Int32);
            let (own, others) = rest.split_at(size);
            rest = others;
            match data_type {
                DataType::Int32 => self.set_as(F::SetInteger, reference, own, |f| Some(f.set_int32), Some),
                DataType::Int8 => self.set_as(F::SetInt8, reference, own, |f| f.set_int8, |v| i8::try_from(v).ok()),
                DataType::UInt8 => self.set_as(F::SetUInt8, reference, own, |f| f.set_uint8, |v| u8::try_from(v).ok()),
                DataType::Int16 => self.set_as(F::SetInt16, reference, own, |f| f.set_int16, |v| i16::try_from(v).ok()),
                DataType::UInt16 => {
                    self.set_as(F::SetUInt16, reference, own, |f| f.set_uint16, |v| u16::try_from(v).ok())
                }
                DataType::UInt32 => {
                    self.set_as(F::SetUInt32, reference, own, |f| f.set_uint32, |v| u32::try_from(v).ok())
                }
                DataType::Int64 | DataType::Enumeration => {
                    self.set_as(F::SetInt64, reference, own, |f| f.set_int64, |v| Some(i64::from(v)))
                }
                DataType::UInt64 => {
                    self.set_as(F::SetUInt64, reference, own, |f| f.set_uint64, |v| u64::try_from(v).ok())
                }
                _ => Err(self.failure(F::SetInteger, OTHER_TYPE)),
            }?;
        }
        Ok(())
    }

    pub(super) fn get_bools(&mut self, refs: &[Reference], values: &mut [c_api::Boolean]) -> Result<(), CallError> {
        self.check_elements(Function::GetBoolean, refs, values.len())?;
        let is_special = self.has_special(refs);
        let mut rest = values;
        for refs in refs.chunks(if is_special { 1 } else { CHUNK }) {
            let (own, others) = rest.split_at_mut(self.boolean_elements(Function::GetBoolean, refs, is_special)?);
            rest = others;
            let mut few = [0; CHUNK];
            let mut many = Vec::new();
            let bytes: &mut [RawBoolean] = match few.get_mut(..own.len()) {
                Some(few) => few,
                None => {
                    many.resize(own.len(), 0);
                    &mut many
                }
            };
            // SAFETY: live instance; both arrays have the stated length.
            self.call_v3(Function::GetBoolean, |f, c| unsafe {
                Some((f.get_boolean)(c, refs.as_ptr(), refs.len(), bytes.as_mut_ptr(), bytes.len()))
            })?;
            for (value, byte) in own.iter_mut().zip(bytes) {
                *value = (*byte).into();
            }
        }
        Ok(())
    }

    pub(super) fn set_bools(&mut self, refs: &[Reference], values: &[c_api::Boolean]) -> Result<(), CallError> {
        self.check_elements(Function::SetBoolean, refs, values.len())?;
        let is_special = self.has_special(refs);
        let mut rest = values;
        for refs in refs.chunks(if is_special { 1 } else { CHUNK }) {
            let (own, others) = rest.split_at(self.boolean_elements(Function::SetBoolean, refs, is_special)?);
            rest = others;
            let mut few = [false; CHUNK];
            let mut many = Vec::new();
            let bools: &mut [bool] = match few.get_mut(..own.len()) {
                Some(few) => few,
                None => {
                    many.resize(own.len(), false);
                    &mut many
                }
            };
            for (bool, value) in bools.iter_mut().zip(own) {
                *bool = *value != 0;
            }
            // SAFETY: live instance; both arrays have the stated length.
            self.call_v3(Function::SetBoolean, |f, c| unsafe {
                Some((f.set_boolean)(c, refs.as_ptr(), refs.len(), bools.as_ptr(), bools.len()))
            })?;
        }
        Ok(())
    }

    /// Number of elements of Booleans that one call transfers.
    fn boolean_elements(
        &mut self,
        function: Function,
        refs: &[Reference],
        is_special: bool,
    ) -> Result<usize, CallError> {
        match refs {
            [reference] if is_special => {
                let Special { data_type, size } = self.special(*reference, DataType::Boolean);
                let is_boolean = data_type.base_type() == Some(BaseType::Boolean);
                if is_boolean { Ok(size) } else { Err(self.failure(function, OTHER_TYPE)) }
            }
            _ => Ok(refs.len()),
        }
    }

    fn check_elements(&mut self, function: Function, refs: &[Reference], values: usize) -> Result<(), CallError> {
        if self.elements(refs) == values { Ok(()) } else { Err(self.failure(function, OTHER_NUMBER)) }
    }

    fn call_v3(
        &mut self,
        function: Function,
        call: impl FnOnce(&v3::Functions, c_api::Component) -> Option<c_api::RawStatus>,
    ) -> Result<(), CallError> {
        self.call_present(function, |f, component| match f {
            Functions::V2(_) => None,
            Functions::V3(f) => call(f, component),
        })
    }

    /// Reads the elements of a variable and converts them.
    fn get_as<S: Copy + Default, T>(
        &mut self,
        function: Function,
        reference: Reference,
        values: &mut [T],
        select: impl FnOnce(&v3::Functions) -> Option<Get<S>>,
        convert: impl Fn(S) -> Option<T>,
    ) -> Result<(), CallError> {
        let mut one = [S::default()];
        let mut many = Vec::new();
        let read: &mut [S] = if values.len() == 1 {
            &mut one
        } else {
            many.resize(values.len(), S::default());
            &mut many
        };
        // SAFETY: live instance; both arrays have the stated length.
        self.call_v3(function, |f, c| unsafe {
            Some(select(f)?(c, &raw const reference, 1, read.as_mut_ptr(), read.len()))
        })?;
        for (value, read) in values.iter_mut().zip(read) {
            *value = convert(*read).ok_or_else(|| self.failure(function, NOT_32_BITS))?;
        }
        Ok(())
    }

    /// Converts the elements of a variable and writes them.
    fn set_as<S: Copy + Default, T: Copy>(
        &mut self,
        function: Function,
        reference: Reference,
        values: &[T],
        select: impl FnOnce(&v3::Functions) -> Option<Set<S>>,
        convert: impl Fn(T) -> Option<S>,
    ) -> Result<(), CallError> {
        let mut one = [S::default()];
        let mut many = Vec::new();
        let written: &mut [S] = if values.len() == 1 {
            &mut one
        } else {
            many.resize(values.len(), S::default());
            &mut many
        };
        for (written, value) in written.iter_mut().zip(values) {
            *written = convert(*value).ok_or_else(|| self.failure(function, TOO_LARGE))?;
        }
        // SAFETY: live instance; both arrays have the stated length.
        self.call_v3(function, |f, c| unsafe {
            Some(select(f)?(c, &raw const reference, 1, written.as_ptr(), written.len()))
        })
    }
}
