//! The discrete state of a model, kept from one sample or event to the next.

use crate::declare::Name;
use crate::number::Number as _;
use crate::store::{Counts, ValuesMut};
use crate::variable::Declaration;

/// The discrete state of a model. Derive [`DiscreteState`](crate::derive::DiscreteState), `Clone` and `Default`.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be a discrete state",
    note = "add `#[derive(DiscreteState, Clone, Default)]`"
)]
pub trait DiscreteState: 'static {
    /// Passes every value to the sink.
    #[doc(hidden)]
    fn save(&self, _sink: &mut dyn FnMut(Word<'_>)) {}
    /// Restores the values in the same order. Fails if a value is missing, has another type, or is invalid.
    #[doc(hidden)]
    fn load(&mut self, _source: &mut Words<'_>) -> Result<(), String> {
        Ok(())
    }
    /// Name and value of the first real number that is not finite. Skips fields with `always_finite`, because searching
    /// a large buffer after every sample would take time.
    #[doc(hidden)]
    #[inline]
    fn not_finite(&self) -> Option<(&'static str, f64)> {
        None
    }
    /// Names of the clocked states: the fields with `#[var(clock = …)]`.
    #[doc(hidden)]
    const NAMES: &'static [Name] = &[];
    /// Adds the clocked states.
    #[doc(hidden)]
    fn declare(_all: &mut Vec<Declaration>) {}
    /// Writes the clocked states to a position.
    #[doc(hidden)]
    #[inline]
    fn write(&self, _values: &mut ValuesMut<'_, f64>, _at: Counts) {}
}

impl DiscreteState for () {}

/// One value of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Word<'a> {
    /// A real number.
    Real(f64),
    /// A count, an index or an Integer. Signed integers are sign-extended.
    Whole(u64),
    /// A Boolean, or the value of an enumeration.
    Choice(u64),
    /// A String, or bytes.
    Bytes(&'a [u8]),
}

impl Word<'_> {
    /// Appends the value to the bytes of a state: a byte for its type, then the value.
    pub(crate) fn write(self, bytes: &mut Vec<u8>) {
        let (mark, number) = match self {
            Self::Real(value) => (0, value.to_bits()),
            Self::Whole(value) => (1, value),
            Self::Bytes(value) => (2, value.len() as u64),
            Self::Choice(value) => (3, value),
        };
        bytes.push(mark);
        bytes.extend(number.to_le_bytes());
        if let Self::Bytes(value) = self {
            bytes.extend(value);
        }
    }
}

/// The bytes of a state that have not been read.
pub struct Words<'a>(pub(crate) &'a [u8]);

impl<'a> Words<'a> {
    pub(crate) fn bytes_of(&mut self, length: u64) -> Result<&'a [u8], String> {
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let (first, rest) = self.0.split_at_checked(length).ok_or("the bytes end too early")?;
        self.0 = rest;
        Ok(first)
    }
    pub(crate) fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.bytes_of(N as u64).map(|bytes| bytes.try_into().expect("so many bytes"))
    }
    pub(crate) fn u64(&mut self) -> Result<u64, String> {
        self.take().map(u64::from_le_bytes)
    }
    fn next(&mut self) -> Result<Word<'a>, String> {
        match self.take()? {
            [0] => self.u64().map(f64::from_bits).map(Word::Real),
            [1] => self.u64().map(Word::Whole),
            [2] => {
                let length = self.u64()?;
                self.bytes_of(length).map(Word::Bytes)
            }
            [3] => self.u64().map(Word::Choice),
            [kind] => Err(format!("unknown kind of value {kind}")),
        }
    }
    /// Reads a real number. Fails if the next value is missing or has another type.
    pub fn real(&mut self, name: &str) -> Result<f64, String> {
        match self.next()? {
            Word::Real(value) => Ok(value),
            other => Err(format!("'{name}' must be a real number, got {other:?}")),
        }
    }
    /// Reads a whole number. Fails like [`Self::real`].
    pub fn whole(&mut self, name: &str) -> Result<u64, String> {
        match self.next()? {
            Word::Whole(value) => Ok(value),
            other => Err(format!("'{name}' must be a whole number, got {other:?}")),
        }
    }
    /// Reads a Boolean or the value of an enumeration. Fails like [`Self::real`].
    pub fn choice(&mut self, name: &str) -> Result<u64, String> {
        match self.next()? {
            Word::Choice(value) => Ok(value),
            other => Err(format!("'{name}' must be a Boolean or the value of an enumeration, got {other:?}")),
        }
    }
    /// Reads bytes. Fails like [`Self::real`].
    pub fn bytes(&mut self, name: &str) -> Result<&'a [u8], String> {
        match self.next()? {
            Word::Bytes(value) => Ok(value),
            other => Err(format!("'{name}' must be a String or bytes, got {other:?}")),
        }
    }
}

/// The type of a field of a discrete state.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be a field of a discrete state",
    note = "fields are `f64`, `f32`, integers of 8 to 64 bits, `Bytes`, `bool`, `String`, enums with \
            `#[derive(Enumeration)]`, and arrays and boxes of these; a model with other state implements `Stateful`"
)]
pub trait StateField {
    /// Passes every value to the sink.
    fn save(&self, sink: &mut dyn FnMut(Word<'_>));
    /// Restores the field. Fails if a value is missing, has another type, or is invalid.
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String>;
    /// The first real number that is not finite.
    #[inline]
    fn not_finite(&self) -> Option<f64> {
        None
    }
}

impl StateField for f64 {
    #[inline]
    fn not_finite(&self) -> Option<f64> {
        (!self.is_finite()).then_some(*self)
    }
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Real(*self));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        *self = source.real(name)?;
        Ok(())
    }
}

impl StateField for f32 {
    #[inline]
    fn not_finite(&self) -> Option<f64> {
        (!self.is_finite()).then_some((*self).into())
    }
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Real((*self).into()));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        *self = source.real(name)? as Self;
        Ok(())
    }
}

macro_rules! integer_state_fields {
    ($($type:ty)*) => {$(
        impl StateField for $type {
            fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
                sink(Word::Whole(self.word()));
            }
            fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
                let word = source.whole(name)?;
                *self = Self::of(word);
                if self.word() == word { Ok(()) } else { Err(format!("'{name}' must fit in {} bits, got {word}", Self::BITS)) }
            }
        }
    )*};
}
integer_state_fields! { i8 u8 i16 u16 i32 u32 i64 u64 }

impl StateField for bool {
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Choice(u64::from(*self)));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        *self = match source.choice(name)? {
            0 => false,
            1 => true,
            other => return Err(format!("'{name}' must be 0 or 1, got {other}")),
        };
        Ok(())
    }
}

impl StateField for String {
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Bytes(self.as_bytes()));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        *self = Self::from_utf8(source.bytes(name)?.to_vec()).map_err(|_| format!("'{name}' must be UTF-8"))?;
        Ok(())
    }
}

/// A large array in a box does not need space on the stack when the state is moved.
impl<F: StateField> StateField for Box<F> {
    #[inline]
    fn not_finite(&self) -> Option<f64> {
        (**self).not_finite()
    }
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        (**self).save(sink);
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        (**self).load(name, source)
    }
}

impl<F: StateField, const N: usize> StateField for [F; N] {
    #[inline]
    fn not_finite(&self) -> Option<f64> {
        self.iter().find_map(F::not_finite)
    }
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        self.iter().for_each(|field| field.save(sink));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        self.iter_mut().try_for_each(|field| field.load(name, source))
    }
}
