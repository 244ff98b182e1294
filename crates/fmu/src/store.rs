//! Values of variables by type.

/// Data for each variable type: values, counts or positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByType<R, I, B, S> {
    /// Reals.
    pub reals: R,
    /// Integers and enumerations.
    pub integers: I,
    /// Booleans.
    pub booleans: B,
    /// Strings.
    pub strings: S,
}

/// Number of values of each type; also a position in the values of each type.
pub type Counts = ByType<usize, usize, usize, usize>;

/// Values to read; the reals have the number type of the equations.
pub type Values<'a, T> = ByType<&'a [T], &'a [i32], &'a [bool], &'a [String]>;

/// Values to write; the reals have the number type of the equations.
pub type ValuesMut<'a, T> = ByType<&'a mut [T], &'a mut [i32], &'a mut [bool], &'a mut [String]>;

/// The values of all variables.
pub type ValueStore = ByType<Box<[f64]>, Box<[i32]>, Box<[bool]>, Box<[String]>>;

impl Counts {
    /// No values.
    pub const ZERO: Self = Self { reals: 0, integers: 0, booleans: 0, strings: 0 };
    /// One Real.
    pub const REAL: Self = Self { reals: 1, ..Self::ZERO };
    /// One Integer.
    pub const INTEGER: Self = Self { integers: 1, ..Self::ZERO };
    /// One Boolean.
    pub const BOOLEAN: Self = Self { booleans: 1, ..Self::ZERO };
    /// One String.
    pub const STRING: Self = Self { strings: 1, ..Self::ZERO };

    /// The sum, type by type.
    pub const fn plus(self, other: Self) -> Self {
        Self {
            reals: self.reals + other.reals,
            integers: self.integers + other.integers,
            booleans: self.booleans + other.booleans,
            strings: self.strings + other.strings,
        }
    }

    /// The counts for `count` copies.
    pub const fn times(self, count: usize) -> Self {
        Self {
            reals: self.reals * count,
            integers: self.integers * count,
            booleans: self.booleans * count,
            strings: self.strings * count,
        }
    }
}

impl<'a, T> Values<'a, T> {
    /// Reals only.
    pub const fn of_reals(reals: &'a [T]) -> Self {
        Self { reals, integers: &[], booleans: &[], strings: &[] }
    }
}

impl<'a, T> ValuesMut<'a, T> {
    /// Reals only.
    pub const fn of_reals(reals: &'a mut [T]) -> Self {
        Self { reals, integers: &mut [], booleans: &mut [], strings: &mut [] }
    }
}

impl ValueStore {
    /// View for reading.
    #[inline]
    pub fn view(&self) -> Values<'_, f64> {
        Values { reals: &self.reals, integers: &self.integers, booleans: &self.booleans, strings: &self.strings }
    }

    /// View for writing.
    #[inline]
    pub fn view_mut(&mut self) -> ValuesMut<'_, f64> {
        let Self { reals, integers, booleans, strings } = self;
        ValuesMut { reals, integers, booleans, strings }
    }

    /// View for reading, with reals of another number type.
    pub(crate) fn with_reals<'a, T>(&'a self, reals: &'a [T]) -> Values<'a, T> {
        Values { reals, integers: &self.integers, booleans: &self.booleans, strings: &self.strings }
    }
}
