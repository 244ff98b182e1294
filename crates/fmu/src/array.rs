//! Arrays whose length is a structural parameter.

use std::ops::{Deref, DerefMut};

use crate::declare::Spec;
use crate::discrete_state::{StateField, Word, Words};
use crate::store::{Counts, Values, ValuesMut};
use crate::variable::Declaration;
use crate::variables::{Field, RealField, Starts};

/// An array of up to `N` elements, the type of a variable whose length is a structural parameter (FMI 3.0):
/// `#[var(size = "n")]`. It dereferences to a slice of the present elements.
///
/// ```
/// let squares = fmu::Array::<f64, 5>::from_fn(3, |i| (i * i) as f64);
/// assert_eq!(squares[..], [0.0, 1.0, 4.0]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Array<F, const N: usize> {
    length: usize,
    elements: [F; N],
}

/// A matrix of up to `ROWS` × `COLUMNS` elements: `#[var(size = ["m", "n"])]`. Each row is an [`Array`].
pub type Matrix<F, const ROWS: usize, const COLUMNS: usize> = Array<Array<F, COLUMNS>, ROWS>;

/// The start value `identity` of a matrix.
#[doc(hidden)]
pub struct Identity;

impl<const ROWS: usize, const COLUMNS: usize> From<Identity> for Starts<Starts<f64, COLUMNS>, ROWS> {
    fn from(_: Identity) -> Self {
        let row = |i| Starts::Each((0..COLUMNS).map(|j| f64::from(u8::from(i == j))).collect());
        Self::Each((0..ROWS).map(row).collect())
    }
}

impl<F: Default, const N: usize> Array<F, N> {
    /// `length` elements, computed from their indices.
    ///
    /// # Panics
    /// If `length` is above `N`. In an FMU, the current call then fails with the message of the panic.
    #[inline]
    pub fn from_fn(length: usize, mut f: impl FnMut(usize) -> F) -> Self {
        assert!(length <= N, "{length} elements are too many for an array of at most {N}");
        Self { length, elements: std::array::from_fn(|i| if i < length { f(i) } else { F::default() }) }
    }
}

impl<F, const N: usize> Array<F, N> {
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn with_length(self, [length]: [usize; 1]) -> Self {
        Self { length: length.min(N), ..self }
    }
}

impl<F, const ROWS: usize, const COLUMNS: usize> Matrix<F, ROWS, COLUMNS> {
    #[doc(hidden)]
    #[inline]
    #[must_use]
    pub fn with_lengths(self, [rows, columns]: [usize; 2]) -> Self {
        Self { elements: self.elements.map(|row| row.with_length([columns])), ..self }.with_length([rows])
    }
}

impl<F: Default, const N: usize> Default for Array<F, N> {
    /// No elements.
    fn default() -> Self {
        Self::from_fn(0, |_| F::default())
    }
}

impl<F: PartialEq, const N: usize> PartialEq for Array<F, N> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<F, const N: usize> Deref for Array<F, N> {
    type Target = [F];
    #[inline]
    fn deref(&self) -> &[F] {
        &self.elements[..self.length]
    }
}

impl<F, const N: usize> DerefMut for Array<F, N> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [F] {
        &mut self.elements[..self.length]
    }
}

/// In memory, there are values for all `N` elements. Elements that are not present are not written: the derivatives of
/// such states stay 0.
#[diagnostic::do_not_recommend]
impl<T, F: Field<T>, const N: usize> Field<T> for Array<F, N>
where
    F::Start: Clone,
{
    type Start = Starts<F::Start, N>;
    const COUNTS: Counts = F::COUNTS.times(N);
    const IS_REAL: bool = F::IS_REAL;
    fn declare(spec: &Spec, start: Option<Self::Start>, all: &mut Vec<Declaration>) {
        <[F; N]>::declare(spec, start, all);
    }
    #[inline]
    fn read(values: Values<'_, T>, at: Counts) -> Self {
        Self { length: N, elements: Field::read(values, at) }
    }
    #[inline]
    fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
        for (i, element) in self.iter().enumerate() {
            element.write(values, at.plus(F::COUNTS.times(i)));
        }
    }
}

impl<T, F: RealField<T>, const N: usize> RealField<T> for Array<F, N>
where
    F::Start: Clone,
{
    #[inline]
    fn combine(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
        Self { length: self.length, elements: self.elements.combine(&other.elements, f) }
    }
}

impl<F: StateField, const N: usize> StateField for Array<F, N> {
    #[inline]
    fn not_finite(&self) -> Option<f64> {
        self.iter().find_map(F::not_finite)
    }
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Whole(self.length as u64));
        self.elements.save(sink);
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        let length = source.whole(name)?;
        self.length = usize::try_from(length)
            .ok()
            .filter(|&length| length <= N)
            .ok_or_else(|| format!("'{name}' must have at most {N} elements, got {length}"))?;
        self.elements.load(name, source)
    }
}
