//! The numbers that the equations of a continuous-time model are written in.
//!
//! The same generic function runs on several types: [`f64`] simulates, [`Dual64`](crate::Dual64) differentiates exactly
//! along one direction, [`Dependencies`] finds out which inputs and states a result depends on, and a type of the exporter
//! finds and freezes the relations of model exchange.
//!
//! [`Scalar`] has no comparison on purpose: a branch that looks at a value would hide the other side from
//! [`Dependencies`]. Use [`Scalar::if_greater`], [`Scalar::min`], [`Scalar::max`], [`Scalar::sign`] and [`Scalar::clamp`].
//! Branching on a Boolean, an enumeration or a bounded Integer is fine, because the model structure is the union over all
//! their values. [`Scalar::value`] gives a plain number to compare; the model structure then says that everything depends on
//! everything.
//!
//! A number and a `T` combine with the `T` first: `x * 2.0`, `-x + 1.0`. For a number first write `T::from(1.0) - x`.

use std::cell::Cell;
use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use fmu_math as math;

use crate::table::Table;

/// A real number in the equations of a continuous-time model.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a number of the equations",
    note = "the equations are generic over `T: Scalar`; a plain number becomes one with `T::from(…)`"
)]
pub trait Scalar:
    Copy
    + Debug
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + Sum
    + 'static
{
    /// Sine of an angle in radians.
    fn sin(self) -> Self;
    /// Cosine of an angle in radians.
    fn cos(self) -> Self;
    /// Tangent of an angle in radians.
    fn tan(self) -> Self;
    /// Arcsine, in [-pi/2, pi/2].
    fn asin(self) -> Self;
    /// Arccosine, in [0, pi].
    fn acos(self) -> Self;
    /// Arctangent, in (-pi/2, pi/2).
    fn atan(self) -> Self;
    /// The angle of the point (`x`, `self`), in (-pi, pi].
    fn atan2(self, x: Self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Square root of a non-negative number.
    fn sqrt(self) -> Self;
    /// Exponential function.
    fn exp(self) -> Self;
    /// Natural logarithm of a positive number.
    fn ln(self) -> Self;
    /// `self` to a constant power.
    fn powf(self, exponent: f64) -> Self;
    /// `self` to a constant integer power.
    fn powi(self, exponent: i32) -> Self;
    /// Length of the vector (`self`, `other`).
    fn hypot(self, other: Self) -> Self;
    /// Remainder of the division by a constant, in [0, |`modulus`|).
    fn rem_euclid(self, modulus: f64) -> Self;
    /// Greatest integer not above `self`.
    fn floor(self) -> Self;
    /// `then` where `self > threshold`, else `otherwise`. Both are computed.
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self;
    /// The value of a table.
    fn interpolate(self, table: &Table) -> Self;
    /// The number without its derivative, to compare it.
    fn value(self) -> f64;

    /// Sine and cosine, which together take little more time than one of them.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    /// Sines and cosines of an array, bit-identical to those of its elements, but faster: two at a time for `f64`.
    #[inline]
    fn sin_cos_each<const N: usize>(x: [Self; N]) -> ([Self; N], [Self; N]) {
        (x.map(Self::sin), x.map(Self::cos))
    }
    /// [`Scalar::sin`] of each element, as in [`Scalar::sin_cos_each`].
    #[inline]
    fn sin_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        x.map(Self::sin)
    }
    /// [`Scalar::atan`] of each element, as in [`Scalar::sin_cos_each`].
    #[inline]
    fn atan_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        x.map(Self::atan)
    }
    /// [`Scalar::atan2`] of each pair of elements, as in [`Scalar::sin_cos_each`].
    #[inline]
    fn atan2_each<const N: usize>(y: [Self; N], x: [Self; N]) -> [Self; N] {
        std::array::from_fn(|i| y[i].atan2(x[i]))
    }
    /// [`Scalar::tanh`] of each element, as in [`Scalar::sin_cos_each`].
    #[inline]
    fn tanh_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        x.map(Self::tanh)
    }

    /// The greater of the two.
    #[inline]
    fn max(self, other: Self) -> Self {
        self.if_greater(other, self, other)
    }
    /// The smaller of the two.
    #[inline]
    fn min(self, other: Self) -> Self {
        self.if_greater(other, other, self)
    }
    /// `self` within [`low`, `high`].
    #[inline]
    fn clamp(self, low: Self, high: Self) -> Self {
        Scalar::min(Scalar::max(self, low), high)
    }
    /// Magnitude.
    #[inline]
    fn abs(self) -> Self {
        Self::from(0.0).if_greater(self, -self, self)
    }
    /// 1 above zero, -1 below, 0 at zero.
    #[inline]
    fn sign(self) -> Self {
        let zero = Self::from(0.0);
        self.if_greater(zero, Self::from(1.0), zero.if_greater(self, Self::from(-1.0), zero))
    }
    /// The square.
    #[inline]
    fn squared(self) -> Self {
        self * self
    }
}

macro_rules! forward {
    ($path:ident: $($function:ident),*) => {$(
        #[inline]
        fn $function(self) -> Self {
            $path::$function(self)
        }
    )*};
}

impl Scalar for f64 {
    // Not the functions of the standard library, whose last digits depend on the platform.
    forward!(math: sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, exp, ln);
    // These are exact.
    forward!(f64: sqrt, floor, abs);
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        math::sin_cos(self)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        math::atan2(self, x)
    }
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        math::pow(self, exponent)
    }
    #[inline]
    fn powi(self, exponent: i32) -> Self {
        math::powi(self, exponent)
    }
    #[inline]
    fn hypot(self, other: Self) -> Self {
        math::hypot(self, other)
    }
    #[inline(always)]
    fn sin_cos_each<const N: usize>(x: [Self; N]) -> ([Self; N], [Self; N]) {
        math::sin_cos_each(x)
    }
    #[inline(always)]
    fn sin_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        math::sin_each(x)
    }
    #[inline(always)]
    fn atan_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        math::atan_each(x)
    }
    #[inline(always)]
    fn atan2_each<const N: usize>(y: [Self; N], x: [Self; N]) -> [Self; N] {
        math::atan2_each(y, x)
    }
    #[inline(always)]
    fn tanh_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        math::tanh_each(x)
    }
    #[inline]
    fn rem_euclid(self, modulus: f64) -> Self {
        f64::rem_euclid(self, modulus)
    }
    #[inline]
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        if self > threshold { then } else { otherwise }
    }
    #[inline]
    fn interpolate(self, table: &Table) -> Self {
        table.at(self).0
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
}

/// A set of known variables that a result depends on, for any value of the parameters.
///
/// Every operation unites the sets of its operands; both sides of a branch count, and so does a product with zero. A set has
/// a fixed size so that it can be copied like a number; a model with more known variables is evaluated in parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dependencies([u64; Self::WORDS]);

thread_local! {
    static INSPECTED: Cell<bool> = const { Cell::new(false) };
}

impl Dependencies {
    const WORDS: usize = 4;
    /// How many known variables a set can hold.
    pub const CAPACITY: usize = 64 * Self::WORDS;

    /// The set that holds only the known variable `index`.
    ///
    /// # Panics
    /// If `index` is not below [`Self::CAPACITY`].
    #[must_use]
    pub fn on(index: usize) -> Self {
        let mut words = [0; Self::WORDS];
        words[index / 64] = 1 << (index % 64);
        Self(words)
    }

    /// Whether the known variable `index` is in the set.
    #[must_use]
    pub fn contains(self, index: usize) -> bool {
        self.0[index / 64] & (1 << (index % 64)) != 0
    }

    /// What is in either set.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] | other.0[i]))
    }

    /// Forgets whether equations have looked at values.
    pub(crate) fn forget_inspections() {
        INSPECTED.set(false);
    }

    /// Whether equations have looked at values, by [`Scalar::value`].
    pub(crate) fn has_inspections() -> bool {
        INSPECTED.get()
    }
}

/// A set of known variables of any size.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DependencySet(Vec<u64>);

impl DependencySet {
    /// Adds the known variable `index`.
    pub fn insert(&mut self, index: usize) {
        if self.0.len() <= index / 64 {
            self.0.resize(index / 64 + 1, 0);
        }
        self.0[index / 64] |= 1 << (index % 64);
    }

    /// Whether the known variable `index` is in the set.
    #[must_use]
    pub fn contains(&self, index: usize) -> bool {
        self.0.get(index / 64).is_some_and(|word| word & (1 << (index % 64)) != 0)
    }

    /// Adds what is in the other set.
    pub fn extend(&mut self, other: &Self) {
        if self.0.len() < other.0.len() {
            self.0.resize(other.0.len(), 0);
        }
        self.0.iter_mut().zip(&other.0).for_each(|(word, other)| *word |= other);
    }
}

impl From<f64> for Dependencies {
    fn from(_: f64) -> Self {
        Self::default()
    }
}

macro_rules! unite {
    ($($operator:ident $function:ident),*) => {$(
        impl $operator for Dependencies {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                self.union(other)
            }
        }
        impl $operator<f64> for Dependencies {
            type Output = Self;
            fn $function(self, _: f64) -> Self {
                self
            }
        }
    )*};
}
unite!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Dependencies {
    type Output = Self;
    fn neg(self) -> Self {
        self
    }
}
impl AddAssign for Dependencies {
    fn add_assign(&mut self, other: Self) {
        *self = self.union(other);
    }
}
impl SubAssign for Dependencies {
    fn sub_assign(&mut self, other: Self) {
        *self = self.union(other);
    }
}
impl Sum for Dependencies {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Self::default(), Self::union)
    }
}

macro_rules! keep {
    ($($function:ident),*) => {$(
        fn $function(self) -> Self {
            self
        }
    )*};
}

impl Scalar for Dependencies {
    keep!(sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, sqrt, exp, ln, floor);
    fn atan2(self, x: Self) -> Self {
        self.union(x)
    }
    fn powf(self, _: f64) -> Self {
        self
    }
    fn powi(self, _: i32) -> Self {
        self
    }
    fn hypot(self, other: Self) -> Self {
        self.union(other)
    }
    fn rem_euclid(self, _: f64) -> Self {
        self
    }
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        self.union(threshold).union(then).union(otherwise)
    }
    fn interpolate(self, _: &Table) -> Self {
        self
    }
    fn value(self) -> f64 {
        INSPECTED.set(true);
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependencies_unite_both_sides_of_a_branch_and_count_a_product_with_zero() {
        let [a, b, c, d] = [0, 63, 64, 255].map(Dependencies::on);
        let result = a.if_greater(b, c, d * 0.0);
        for index in [0, 63, 64, 255] {
            assert!(result.contains(index), "{index}");
        }
        assert!(!result.contains(1));
    }

    #[test]
    fn sets_of_any_size_grow() {
        let mut set = DependencySet::default();
        set.insert(1000);
        let mut other = DependencySet::default();
        other.insert(3);
        other.extend(&set);
        assert!(other.contains(3) && other.contains(1000) && !other.contains(999) && !other.contains(5000));
    }

    #[test]
    fn signs_are_those_of_the_number() {
        assert_eq!([-2.5, 0.0, 3.0].map(|x: f64| Scalar::sign(x)), [-1.0, 0.0, 1.0]);
    }
}
