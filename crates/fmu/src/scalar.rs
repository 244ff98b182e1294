//! Number types for the equations of continuous-time models.
//!
//! The same generic function runs on several types: [`f64`] simulates, [`Dual64`](crate::Dual64) differentiates exactly
//! along one direction, `Dependencies` finds the inputs and states that a result depends on, and `Relational` freezes
//! the relations in model exchange.
//!
//! [`Scalar`] has no comparison operators, because a branch on a value would hide the other branch from `Dependencies`.
//! Use [`Scalar::if_greater`], [`Scalar::min`], [`Scalar::max`], [`Scalar::sign`] and [`Scalar::clamp`]. You can branch
//! on a Boolean, an enumeration or a bounded Integer, because the model structure is the union over all their values.
//! [`Scalar::value`] returns a plain number that can be compared. The model structure then declares that everything
//! depends on everything.
//!
//! In operations with a plain number, the `T` is on the left: `x * 2.0`, `-x + 1.0`; or write `T::from(1.0) - x`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::iter::Sum;
use std::mem::ManuallyDrop;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use fmu_math as math;
use fmu_math::sparse::Structure;

use crate::table::Table;

/// A real number in the equations of a continuous-time model.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a number type for equations",
    note = "the equations are generic over `T: Scalar`; convert a plain number with `T::from(…)`"
)]
pub trait Scalar:
    Copy
    + Debug
    + Default
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
    + for<'a> Sum<&'a Self>
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
    /// `then` if `self > threshold`, otherwise `otherwise`. Both are computed.
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self;
    /// The value of the table at `self`.
    fn interpolate(self, table: &Table) -> Self;
    /// The value as a plain number, which can be compared.
    fn value(self) -> f64;

    /// Sine and cosine; hardly slower than one of them.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    /// [`Scalar::sin_cos`] of each element. Bit-identical, but faster for `f64`: computes two elements at a time.
    #[inline]
    fn sin_cos_each<const N: usize>(x: [Self; N]) -> ([Self; N], [Self; N]) {
        (x.map(Self::sin), x.map(Self::cos))
    }
    /// [`Scalar::sin`] of each element, see [`Scalar::sin_cos_each`].
    #[inline]
    fn sin_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        x.map(Self::sin)
    }
    /// [`Scalar::atan`] of each element, see [`Scalar::sin_cos_each`].
    #[inline]
    fn atan_each<const N: usize>(x: [Self; N]) -> [Self; N] {
        x.map(Self::atan)
    }
    /// [`Scalar::atan2`] of each pair of elements, see [`Scalar::sin_cos_each`].
    #[inline]
    fn atan2_each<const N: usize>(y: [Self; N], x: [Self; N]) -> [Self; N] {
        std::array::from_fn(|i| y[i].atan2(x[i]))
    }
    /// [`Scalar::tanh`] of each element, see [`Scalar::sin_cos_each`].
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
    /// `self`, limited to [`low`, `high`].
    #[inline]
    fn clamp(self, low: Self, high: Self) -> Self {
        Scalar::min(Scalar::max(self, low), high)
    }
    /// Magnitude.
    #[inline]
    fn abs(self) -> Self {
        Self::from(0.0).if_greater(self, -self, self)
    }
    /// 1 if positive, -1 if negative, 0 at zero.
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

/// Implements `+=`, `-=` and sums with a number type's addition and subtraction.
macro_rules! assign_and_sum {
    ([$($generics:tt)*] $number:ty) => {
        assign_and_sum!(@assign [$($generics)*] $number);
        impl<$($generics)*> std::iter::Sum for $number {
            fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
                terms.fold(Self::from(0.0), std::ops::Add::add)
            }
        }
    };
    (@assign [$($generics:tt)*] $number:ty) => {
        impl<$($generics)*> std::ops::AddAssign for $number {
            #[inline]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<$($generics)*> std::ops::SubAssign for $number {
            #[inline]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
        impl<'a, $($generics)*> std::iter::Sum<&'a Self> for $number {
            fn sum<I: Iterator<Item = &'a Self>>(terms: I) -> Self {
                terms.copied().sum()
            }
        }
    };
}
pub(crate) use assign_and_sum;

/// A symbolic number type: represents the expression of a number instead of its value.
pub(crate) trait Symbol: From<f64> {
    fn of<const N: usize>(operation: &str, operands: [Self; N]) -> Self;
    /// The value of the table at `self`.
    fn look_up(self, table: &Table) -> Self;
    fn inspect();
}

/// Implements [`Scalar`] for a [`Symbol`].
macro_rules! symbolic {
    ($number:ident) => {
        symbolic!(@operators $number: Add add, Sub sub, Mul mul, Div div);
        impl std::ops::Neg for $number {
            type Output = Self;
            fn neg(self) -> Self {
                Self::of("neg", [self])
            }
        }
        assign_and_sum!([] $number);
        impl Scalar for $number {
            symbolic!(@functions sin() cos() tan() asin() acos() atan() sinh() cosh() tanh() sqrt() exp() ln() floor());
            symbolic!(@functions atan2(x: Self) hypot(other: Self) powf(x: f64) rem_euclid(x: f64));
            fn powi(self, n: i32) -> Self {
                Self::of("powi", [self, f64::from(n).into()])
            }
            fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
                Self::of("if_greater", [self, threshold, then, otherwise])
            }
            fn interpolate(self, table: &Table) -> Self {
                self.look_up(table)
            }
            fn value(self) -> f64 {
                Self::inspect();
                0.0
            }
        }
    };
    (@operators $number:ident: $($operator:ident $function:ident),*) => {$(
        impl std::ops::$operator for $number {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                Self::of(stringify!($function), [self, other])
            }
        }
        impl std::ops::$operator<f64> for $number {
            type Output = Self;
            fn $function(self, other: f64) -> Self {
                Self::of(stringify!($function), [self, other.into()])
            }
        }
    )*};
    (@functions $($function:ident($($argument:ident: $type:ty)?))*) => {$(
        fn $function(self $(, $argument: $type)?) -> Self {
            Self::of(stringify!($function), [self $(, $argument.into())?])
        }
    )*};
}
pub(crate) use symbolic;

macro_rules! forward {
    ($path:ident: $($function:ident($($argument:ident: $type:ty)?) $to:ident),*) => {$(
        #[inline]
        fn $function(self $(, $argument: $type)?) -> Self {
            $path::$to(self $(, $argument)?)
        }
    )*};
    (each: $($function:ident),*) => {$(
        #[inline(always)]
        fn $function<const N: usize>(x: [Self; N]) -> [Self; N] {
            math::$function(x)
        }
    )*};
}

impl Scalar for f64 {
    // Functions from `fmu-math`, because the results of the standard library differ between platforms in the last
    // digits.
    forward!(math: sin() sin, cos() cos, tan() tan, asin() asin, acos() acos, atan() atan, atan2(x: Self) atan2);
    forward!(math: sinh() sinh, cosh() cosh, tanh() tanh, exp() exp, ln() ln, powf(exponent: f64) pow);
    forward!(math: powi(exponent: i32) powi, hypot(other: Self) hypot);
    forward!(each: sin_each, atan_each, tanh_each);
    // The results of these functions are exact on every platform.
    forward!(f64: sqrt() sqrt, floor() floor, abs() abs, rem_euclid(modulus: f64) rem_euclid);
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        math::sin_cos(self)
    }
    #[inline(always)]
    fn sin_cos_each<const N: usize>(x: [Self; N]) -> ([Self; N], [Self; N]) {
        math::sin_cos_each(x)
    }
    #[inline(always)]
    fn atan2_each<const N: usize>(y: [Self; N], x: [Self; N]) -> [Self; N] {
        math::atan2_each(y, x)
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

/// The set of known variables that a result can depend on, for any values of the parameters.
///
/// The result of an operation has the union of its operands' sets, even if the operation is a branch or a product with
/// zero. A set is the number of a node in this thread's trace, which records the two sets that form each union. It is
/// as small as a number; tracing a large model therefore needs little stack.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Dependencies(u32);

#[derive(Debug, Default)]
struct Trace {
    /// Unions of two sets. Index `i` is set `i + 1`; set 0 is empty.
    nodes: Vec<(u32, u32)>,
    /// True if the equations have read values.
    has_inspections: bool,
}

/// Marks a node for one known variable; the other element of the node is the variable's number.
const VARIABLE: u32 = u32::MAX;

thread_local! {
    /// Empty between two traces. Not dropped when the thread ends, see `IN_USE` in [`crate::relation`].
    static TRACE: RefCell<ManuallyDrop<Trace>> = RefCell::new(ManuallyDrop::new(Trace::default()));
}

/// Removes the trace when it is dropped, even after a panic.
struct Loan(Trace);

impl Loan {
    fn swap(&mut self) {
        TRACE.with_borrow_mut(|trace| std::mem::swap(&mut **trace, &mut self.0));
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        self.swap();
    }
}

impl Trace {
    fn push(&mut self, node: (u32, u32)) -> Dependencies {
        self.nodes.push(node);
        Dependencies(u32::try_from(self.nodes.len()).expect("fewer than 2^32 operations"))
    }

    /// Calls `found` once for each variable in a set. Visited nodes have `mark` in `stamps`; `stack` is working memory.
    fn visit(
        &self,
        set: Dependencies,
        mark: u32,
        stamps: &mut [u32],
        stack: &mut Vec<u32>,
        mut found: impl FnMut(u32),
    ) {
        stack.push(set.0);
        while let Some(number) = stack.pop() {
            let Some(at) = (number as usize).checked_sub(1).filter(|&at| stamps[at] != mark) else { continue };
            stamps[at] = mark;
            match self.nodes[at] {
                (variable, VARIABLE) => found(variable),
                (one, other) => stack.extend([other, one]),
            }
        }
    }
}

impl Dependencies {
    /// The set that contains only the known variable `index`.
    pub(crate) fn on(index: usize) -> Self {
        let index = u32::try_from(index).expect("fewer than 2^32 known variables");
        TRACE.with_borrow_mut(|trace| trace.push((index, VARIABLE)))
    }

    fn variables(self) -> BTreeSet<usize> {
        TRACE.with_borrow(|trace| {
            let mut all = BTreeSet::new();
            trace.visit(self, 1, &mut vec![0; trace.nodes.len()], &mut Vec::new(), |variable| {
                all.insert(variable as usize);
            });
            all
        })
    }

    pub(crate) fn union(self, other: Self) -> Self {
        match (self.0, other.0) {
            (one, other) if one == other => self,
            (_, 0) => self,
            (0, _) => other,
            (one, two) => {
                TRACE.with_borrow_mut(|trace| match (trace.nodes[one as usize - 1], trace.nodes[two as usize - 1]) {
                    // One set is already part of the other, as in a sum that adds the same variable repeatedly.
                    ((a, b), _) if b != VARIABLE && (a == two || b == two) => self,
                    (_, (a, b)) if b != VARIABLE && (a == one || b == one) => other,
                    _ => trace.push((one, two)),
                })
            }
        }
    }

    /// Returns the known variables on which each result of the equations depends, with a line for each result. Returns
    /// `None` if the equations call [`Scalar::value`], because they may branch on the value.
    pub(crate) fn trace(equations: impl FnOnce() -> Vec<Self>) -> Option<Structure> {
        let mut loan = Loan(Trace::default());
        loan.swap();
        let results = equations();
        TRACE.with_borrow(|trace| {
            let (mut stamps, mut stack) = (vec![0; trace.nodes.len()], Vec::new());
            let mut line = Vec::new();
            let mut structure = Structure::default();
            for (set, mark) in results.into_iter().zip(1..) {
                line.clear();
                trace.visit(set, mark, &mut stamps, &mut stack, |variable| line.push(variable));
                structure.push(line.iter().copied());
            }
            (!trace.has_inspections).then_some(structure)
        })
    }
}

/// A set of known variables, stored as an ascending list.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct DependencySet(Vec<u32>);

impl DependencySet {
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|&index| index as usize)
    }

    /// The first `count` variables.
    pub(crate) fn all(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    pub(crate) fn contains(&self, index: usize) -> bool {
        self.0.binary_search_by(|&other| (other as usize).cmp(&index)).is_ok()
    }

    /// Adds variables, which may be in any order.
    pub(crate) fn extend(&mut self, others: &[u32]) {
        if self.0 != others {
            self.0.extend_from_slice(others);
            self.0.sort_unstable();
            self.0.dedup();
        }
    }
}

impl PartialEq for Dependencies {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0 || self.variables() == other.variables()
    }
}

impl From<f64> for Dependencies {
    fn from(_: f64) -> Self {
        Self::default()
    }
}

impl Symbol for Dependencies {
    fn of<const N: usize>(_: &str, operands: [Self; N]) -> Self {
        operands.into_iter().fold(Self::default(), Self::union)
    }
    fn look_up(self, _: &Table) -> Self {
        self
    }
    fn inspect() {
        TRACE.with_borrow_mut(|trace| trace.has_inspections = true);
    }
}
symbolic!(Dependencies);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependencies_unite_both_sides_of_a_branch_and_count_a_product_with_zero() {
        let [a, b, c, d] = [0, 63, 64, 255].map(Dependencies::on);
        let result = a.if_greater(b, c, d * 0.0);
        for index in [0, 63, 64, 255] {
            assert!(result.variables().contains(&index), "{index}");
        }
        assert!(!result.variables().contains(&1));
    }

    #[test]
    fn sets_of_any_size_grow() {
        let mut set = DependencySet::default();
        set.extend(&[1000]);
        set.extend(&[3, 1000]);
        assert!(set.contains(3) && set.contains(1000) && !set.contains(999) && !set.contains(5000));
        assert_eq!(set.iter().collect::<Vec<_>>(), [3, 1000]);
        assert_eq!(DependencySet::all(2).iter().collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn signs_are_those_of_the_number() {
        assert_eq!([-2.5, 0.0, 3.0].map(|x: f64| Scalar::sign(x)), [-1.0, 0.0, 1.0]);
    }

    #[test]
    fn every_operation_of_a_scalar_keeps_its_dependencies() {
        let [a, b] = [Dependencies::on(3), Dependencies::on(200)];
        let both = a.union(b);
        let mut sum = a;
        sum += b;
        let mut difference = a;
        difference -= b;
        for result in [
            a + b,
            a - b,
            a * b,
            a / b,
            sum,
            difference,
            [a, b].into_iter().sum(),
            Scalar::max(a, b),
            Scalar::min(a, b),
            Scalar::clamp(a, b, Dependencies::from(1.0)),
            Scalar::atan2(a, b),
        ] {
            assert_eq!(result, both);
        }
        for result in [
            -a,
            a + 1.0,
            a - 1.0,
            a * 0.0,
            a / 2.0,
            Scalar::sin(a),
            Scalar::cos(a),
            Scalar::atan(a),
            Scalar::tanh(a),
            Scalar::sqrt(a),
            Scalar::exp(a),
            Scalar::powf(a, 0.0),
            Scalar::abs(a),
            a.squared(),
        ] {
            assert_eq!(result, a);
        }
    }
}
