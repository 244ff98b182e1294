//! Storage for FMI 3.0 values for which FMI 2.0 has no function.

use crate::c_api::Reference;
use crate::description::Value;
use std::collections::HashMap;

/// Values of entire arrays, which are needed to read or write single elements.
#[derive(Default)]
pub(super) struct Whole {
    pub(super) reals: Part<f64>,
    /// Includes Booleans, whose C type is the same in FMI 2.0.
    pub(super) integers: Part<i32>,
    pub(super) exact: Part<i128>,
    pub(super) texts: HashMap<Reference, Vec<String>>,
    pub(super) binaries: HashMap<Reference, Vec<Vec<u8>>>,
}

#[derive(Default)]
pub(super) struct Part<T> {
    /// Values of the array in the present call.
    pub(super) values: Vec<T>,
    /// Values of arrays that were set before initialization. At that time, the FMU does not allow reading them.
    pub(super) given: HashMap<Reference, Vec<T>>,
}

/// A type of array elements.
pub(super) trait Kept: Copy + Default + PartialEq {
    fn part(whole: &mut Whole) -> &mut Part<Self>;
    fn of(start: &Value) -> Option<Self>;
}
impl Kept for f64 {
    fn part(whole: &mut Whole) -> &mut Part<Self> {
        &mut whole.reals
    }
    fn of(start: &Value) -> Option<Self> {
        start.real()
    }
}
impl Kept for i32 {
    fn part(whole: &mut Whole) -> &mut Part<Self> {
        &mut whole.integers
    }
    fn of(start: &Value) -> Option<Self> {
        match start {
            Value::Integer(value) => Self::try_from(*value).ok(),
            Value::Boolean(value) => Some((*value).into()),
            _ => None,
        }
    }
}
impl Kept for i128 {
    fn part(whole: &mut Whole) -> &mut Part<Self> {
        &mut whole.exact
    }
    fn of(start: &Value) -> Option<Self> {
        start.whole()
    }
}

/// Memory for type conversions. It is reused, so only the first transfer of an array allocates.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    /// Binaries of an entire array.
    pub(super) binaries: Vec<Vec<u8>>,
    /// Sizes of Binaries.
    pub(super) sizes: Vec<usize>,
    /// Bytes of Binaries, valid only in the call that reads them.
    pub(super) pointers: Vec<*const u8>,
    bool: Vec<bool>,
    f32: Vec<f32>,
    i8: Vec<i8>,
    u8: Vec<u8>,
    i16: Vec<i16>,
    u16: Vec<u16>,
    pub(super) i32: Vec<i32>,
    u32: Vec<u32>,
    i64: Vec<i64>,
    u64: Vec<u64>,
}

pub(super) trait Buffered: Copy + Default {
    fn of(buffers: &mut Buffers) -> &mut Vec<Self>;
}

macro_rules! buffered {
    ($($name:ident)*) => {$(
        impl Buffered for $name {
            fn of(buffers: &mut Buffers) -> &mut Vec<Self> {
                &mut buffers.$name
            }
        }
    )*};
}
buffered!(bool f32 i8 u8 i16 u16 i32 u32 i64 u64);
