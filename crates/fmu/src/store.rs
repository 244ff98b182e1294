//! Values of variables by type.

use crate::bytes::Buffer;

/// Data for each variable type: values, counts or positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByType<R, W, B, S, Y, L = ()> {
    /// Reals.
    pub reals: R,
    /// Integers, enumerations and Float32s, see [`Number`](crate::number::Number).
    pub words: W,
    /// Booleans.
    pub booleans: B,
    /// Strings.
    pub strings: S,
    /// Binaries.
    pub binaries: Y,
    /// Lengths of the arrays whose size is a structural parameter; only values to read have them.
    pub lengths: L,
}

/// The present value of a structural parameter, which is the length of arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Length {
    /// [`hash`](crate::declare::hash) of the name of the parameter.
    pub(crate) parameter: u64,
    pub(crate) value: usize,
}

/// Number of values of each type; also a position in the values of each type.
pub type Counts = ByType<usize, usize, usize, usize, usize>;

/// Values to read; the reals have the number type of the equations.
pub type Values<'a, T> = ByType<&'a [T], &'a [u64], &'a [bool], &'a [String], &'a [Buffer], &'a [Length]>;

/// Values to write; the reals have the number type of the equations.
pub type ValuesMut<'a, T> = ByType<&'a mut [T], &'a mut [u64], &'a mut [bool], &'a mut [String], &'a mut [Buffer]>;

/// The values of all variables.
pub type ValueStore = ByType<Box<[f64]>, Box<[u64]>, Box<[bool]>, Box<[String]>, Box<[Buffer]>, Box<[Length]>>;

impl Counts {
    /// No values.
    pub const ZERO: Self = Self { reals: 0, words: 0, booleans: 0, strings: 0, binaries: 0, lengths: () };
    /// One Real.
    pub const REAL: Self = Self { reals: 1, ..Self::ZERO };
    /// One integer, enumeration or Float32.
    pub const WORD: Self = Self { words: 1, ..Self::ZERO };
    /// One Boolean.
    pub const BOOLEAN: Self = Self { booleans: 1, ..Self::ZERO };
    /// One String.
    pub const STRING: Self = Self { strings: 1, ..Self::ZERO };
    /// One Binary.
    pub const BINARY: Self = Self { binaries: 1, ..Self::ZERO };

    /// The sum, type by type.
    pub const fn plus(self, other: Self) -> Self {
        Self {
            reals: self.reals + other.reals,
            words: self.words + other.words,
            booleans: self.booleans + other.booleans,
            strings: self.strings + other.strings,
            binaries: self.binaries + other.binaries,
            lengths: (),
        }
    }

    /// The counts for `count` copies.
    pub const fn times(self, count: usize) -> Self {
        Self {
            reals: self.reals * count,
            words: self.words * count,
            booleans: self.booleans * count,
            strings: self.strings * count,
            binaries: self.binaries * count,
            lengths: (),
        }
    }
}

impl<'a, T> Values<'a, T> {
    /// Reals only.
    pub const fn of_reals(reals: &'a [T]) -> Self {
        Self::of_states(reals, &[])
    }

    /// Reals only, in arrays of these lengths.
    pub(crate) const fn of_states(reals: &'a [T], lengths: &'a [Length]) -> Self {
        Self { reals, words: &[], booleans: &[], strings: &[], binaries: &[], lengths }
    }

    /// The value of a structural parameter; of an unknown one, such as in a struct of variables outside an instance, the
    /// greatest number.
    #[inline]
    pub fn length(&self, parameter: u64) -> usize {
        self.lengths.iter().find(|length| length.parameter == parameter).map_or(usize::MAX, |length| length.value)
    }
}

impl<'a, T> ValuesMut<'a, T> {
    /// Reals only.
    pub const fn of_reals(reals: &'a mut [T]) -> Self {
        Self { reals, words: &mut [], booleans: &mut [], strings: &mut [], binaries: &mut [], lengths: () }
    }
}

impl ValueStore {
    /// View for reading.
    #[inline]
    pub fn view(&self) -> Values<'_, f64> {
        Values {
            reals: &self.reals,
            words: &self.words,
            booleans: &self.booleans,
            strings: &self.strings,
            binaries: &self.binaries,
            lengths: &self.lengths,
        }
    }

    /// View for writing.
    #[inline]
    pub fn view_mut(&mut self) -> ValuesMut<'_, f64> {
        let Self { reals, words, booleans, strings, binaries, .. } = self;
        ValuesMut { reals, words, booleans, strings, binaries, lengths: () }
    }

    /// View for reading, with reals of another number type.
    pub(crate) fn with_reals<'a, T>(&'a self, reals: &'a [T]) -> Values<'a, T> {
        let Self { words, booleans, strings, binaries, lengths, .. } = self;
        Values { reals, words, booleans, strings, binaries, lengths }
    }
}
