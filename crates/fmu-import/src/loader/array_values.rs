//! Storage for values of FMI 3.0 that FMI 2.0 has no function for.

use crate::c_api::Reference;
use crate::c_api::v3::RawBoolean;
use crate::description::Value;
use std::collections::HashMap;

/// Values of arrays whose elements are read or written.
#[derive(Default)]
pub(super) struct Whole {
    pub(super) reals: Part<f64>,
    /// Also Booleans, which have this type in FMI 2.0.
    pub(super) integers: Part<i32>,
    pub(super) wide: Part<i64>,
}

#[derive(Default)]
pub(super) struct Part<T> {
    /// Of the array that a call transfers.
    pub(super) values: Vec<T>,
    /// Of arrays that were set before the initialization, when the FMU cannot be asked.
    pub(super) given: HashMap<Reference, Vec<T>>,
}

/// A type of values, with the storage for those of an array.
pub(super) trait Kept: Copy + Default {
    fn part(whole: &mut Whole) -> &mut Part<Self>;
    fn of(start: &Value) -> Option<Self>;
}
impl Kept for f64 {
    fn part(whole: &mut Whole) -> &mut Part<Self> {
        &mut whole.reals
    }
    fn of(start: &Value) -> Option<Self> {
        if let Value::Real(value) = start { Some(*value) } else { None }
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
impl Kept for i64 {
    fn part(whole: &mut Whole) -> &mut Part<Self> {
        &mut whole.wide
    }
    fn of(start: &Value) -> Option<Self> {
        if let Value::Integer(value) = start { Some(*value) } else { None }
    }
}

/// Values of the types of FMI 3.0 while they are converted, so that only the first transfer of an array allocates.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    pub(super) bytes: Vec<RawBoolean>,
    pub(super) bools: Vec<bool>,
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
buffered!(f32 i8 u8 i16 u16 i32 u32 i64 u64);
