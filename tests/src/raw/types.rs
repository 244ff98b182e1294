//! The functions of FMI 3.0 for types that no variable of these FMUs has.

use super::{OK, RawInstance, pointer, pointer_mut};
use fmu_import::c_api::{Component, RawStatus, Reference};
use std::ffi::{c_int, c_void};

type Pointer = *mut c_void;
type OneArray = unsafe extern "C" fn(Component, *const Reference, usize, Pointer) -> RawStatus;
type TwoArrays = unsafe extern "C" fn(Component, *const Reference, usize, Pointer, Pointer) -> RawStatus;
type ThreeArrays = unsafe extern "C" fn(Component, *const Reference, usize, Pointer, Pointer, Pointer) -> RawStatus;
type Counted = unsafe extern "C" fn(Component, *const Reference, usize, Pointer, usize) -> RawStatus;
type CountedPairs = unsafe extern "C" fn(Component, *const Reference, usize, Pointer, Pointer, usize) -> RawStatus;

/// Arguments that follow the value references and their number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Arrays of values.
    Arrays(u8),
    /// An array and the number of its values.
    Counted,
    /// Sizes, values and their number.
    CountedPairs,
}

/// Functions for types without variables.
pub const TYPES_WITHOUT_VARIABLES: [(&str, Shape); 26] = [
    ("fmi3GetFloat32", Shape::Counted),
    ("fmi3SetFloat32", Shape::Counted),
    ("fmi3GetInt8", Shape::Counted),
    ("fmi3SetInt8", Shape::Counted),
    ("fmi3GetUInt8", Shape::Counted),
    ("fmi3SetUInt8", Shape::Counted),
    ("fmi3GetInt16", Shape::Counted),
    ("fmi3SetInt16", Shape::Counted),
    ("fmi3GetUInt16", Shape::Counted),
    ("fmi3SetUInt16", Shape::Counted),
    ("fmi3GetUInt32", Shape::Counted),
    ("fmi3SetUInt32", Shape::Counted),
    ("fmi3GetUInt64", Shape::Counted),
    ("fmi3SetUInt64", Shape::Counted),
    ("fmi3GetBinary", Shape::CountedPairs),
    ("fmi3SetBinary", Shape::CountedPairs),
    ("fmi3GetClock", Shape::Arrays(1)),
    ("fmi3SetClock", Shape::Arrays(1)),
    ("fmi3GetIntervalDecimal", Shape::Arrays(2)),
    ("fmi3GetIntervalFraction", Shape::Arrays(3)),
    ("fmi3GetShiftDecimal", Shape::Arrays(1)),
    ("fmi3GetShiftFraction", Shape::Arrays(2)),
    ("fmi3SetIntervalDecimal", Shape::Arrays(1)),
    ("fmi3SetIntervalFraction", Shape::Arrays(2)),
    ("fmi3SetShiftDecimal", Shape::Arrays(1)),
    ("fmi3SetShiftFraction", Shape::Arrays(2)),
];

impl RawInstance<'_> {
    /// Calls one of [`TYPES_WITHOUT_VARIABLES`], with the same array in place of each array of values. The array has an
    /// element of the size of the largest type for each value reference.
    pub fn without_variables(
        &self,
        (name, shape): (&str, Shape),
        references: Option<&[Reference]>,
        count: usize,
        values: &mut [u64],
        value_count: usize,
    ) -> RawStatus {
        let raw = self.raw;
        let references = pointer(references, count);
        let values: Pointer = values.as_mut_ptr().cast();
        // SAFETY: arrays of the stated lengths, or null; all pointers to values are passed in the same way.
        unsafe {
            match shape {
                Shape::Arrays(1) => raw.function::<OneArray>(name)(self.component, references, count, values),
                Shape::Arrays(2) => raw.function::<TwoArrays>(name)(self.component, references, count, values, values),
                Shape::Arrays(_) => {
                    raw.function::<ThreeArrays>(name)(self.component, references, count, values, values, values)
                }
                Shape::Counted => raw.function::<Counted>(name)(self.component, references, count, values, value_count),
                Shape::CountedPairs => {
                    let function = raw.function::<CountedPairs>(name);
                    function(self.component, references, count, values, values, value_count)
                }
            }
        }
    }
}

type Clocks = unsafe extern "C" fn(Component, *const Reference, usize, *mut u8) -> RawStatus;
type Times = unsafe extern "C" fn(Component, *const Reference, usize, *mut f64) -> RawStatus;
type Intervals = unsafe extern "C" fn(Component, *const Reference, usize, *mut f64, *mut c_int) -> RawStatus;
type GetBinary =
    unsafe extern "C" fn(Component, *const Reference, usize, *mut usize, *mut *const u8, usize) -> RawStatus;
type SetBinary =
    unsafe extern "C" fn(Component, *const Reference, usize, *const usize, *const *const u8, usize) -> RawStatus;

impl RawInstance<'_> {
    /// fmi3GetClock or fmi3SetClock.
    pub fn clocks(&self, name: &str, references: &[Reference], values: Option<&mut [u8]>) -> RawStatus {
        let (count, function) = (references.len(), self.raw.function::<Clocks>(name));
        // SAFETY: arrays of the stated lengths, or null.
        unsafe { function(self.component, references.as_ptr(), count, pointer_mut(values, count)) }
    }

    /// fmi3GetIntervalDecimal.
    pub fn intervals(
        &self,
        references: &[Reference],
        values: Option<&mut [f64]>,
        qualifiers: Option<&mut [c_int]>,
    ) -> RawStatus {
        let (count, function) = (references.len(), self.raw.function::<Intervals>("fmi3GetIntervalDecimal"));
        let (values, qualifiers) = (pointer_mut(values, count), pointer_mut(qualifiers, count));
        // SAFETY: as above.
        unsafe { function(self.component, references.as_ptr(), count, values, qualifiers) }
    }

    /// fmi3SetIntervalDecimal, fmi3GetShiftDecimal or fmi3SetShiftDecimal.
    pub fn clock_times(&self, name: &str, references: &[Reference], values: Option<&mut [f64]>) -> RawStatus {
        let (count, function) = (references.len(), self.raw.function::<Times>(name));
        // SAFETY: as above.
        unsafe { function(self.component, references.as_ptr(), count, pointer_mut(values, count)) }
    }

    /// fmi3GetBinary of `count` values, which are copied if the status is fmi3OK.
    pub fn get_binary(&self, references: &[Reference], count: usize) -> (RawStatus, Vec<Vec<u8>>) {
        let (mut sizes, mut values) = (vec![0; count], vec![std::ptr::null(); count]);
        let function = self.raw.function::<GetBinary>("fmi3GetBinary");
        let (length, first) = (references.len(), references.as_ptr());
        // SAFETY: arrays of the stated lengths.
        let status = unsafe { function(self.component, first, length, sizes.as_mut_ptr(), values.as_mut_ptr(), count) };
        let found = if status == OK { &values[..] } else { &[] };
        // SAFETY: the FMU has just filled in pointers to bytes that live until its next function is called.
        let read = |(&value, &size): (&*const u8, &usize)| unsafe { std::slice::from_raw_parts(value, size) }.to_vec();
        (status, found.iter().zip(&sizes).map(read).collect())
    }

    /// fmi3SetBinary of values, each with its stated size: its length, or more than memory can hold.
    pub fn set_binary(&self, references: &[Reference], values: &[Option<Vec<u8>>], sizes: &[usize]) -> RawStatus {
        let function = self.raw.function::<SetBinary>("fmi3SetBinary");
        let pointers: Vec<_> = values.iter().zip(sizes).map(|(value, &size)| pointer(value.as_deref(), size)).collect();
        let (length, first, count) = (references.len(), references.as_ptr(), values.len());
        // SAFETY: arrays of the stated lengths; a value may be null.
        unsafe { function(self.component, first, length, sizes.as_ptr(), pointers.as_ptr(), count) }
    }
}
