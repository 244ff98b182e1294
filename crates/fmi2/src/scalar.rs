//! The numbers a plant's equations are written in.
//!
//! The same generic function runs on three of them: [`f64`] simulates, [`Dual64`] differentiates exactly along one
//! direction, and [`Dependencies`] finds out which inputs and states a result depends on.
//!
//! [`Scalar`] has no comparison on purpose: a branch that looks at a value would hide the other side from
//! [`Dependencies`]. Use [`Scalar::if_greater`], [`Scalar::min`], [`Scalar::max`] and [`Scalar::clamp`]; branching on
//! a *parameter* with `if` and `match` is fine, because the model structure is the union over all modes.

use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

pub use num_dual::Dual64;
use num_dual::DualNum;

/// A real number in the equations of a plant.
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
    /// Arctangent, in (-pi/2, pi/2).
    fn atan(self) -> Self;
    /// The angle of the point (`x`, `self`), in (-pi, pi].
    fn atan2(self, x: Self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Square root of a non-negative number.
    fn sqrt(self) -> Self;
    /// Exponential function.
    fn exp(self) -> Self;
    /// `self` to a constant power.
    fn powf(self, exponent: f64) -> Self;
    /// `then` where `self > threshold`, else `otherwise`. Both are computed.
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self;
    /// The number without its derivative; 0 for [`Dependencies`].
    fn value(self) -> f64;

    /// The greater of the two.
    fn max(self, other: Self) -> Self {
        self.if_greater(other, self, other)
    }
    /// The smaller of the two.
    fn min(self, other: Self) -> Self {
        self.if_greater(other, other, self)
    }
    /// `self` within [`low`, `high`].
    fn clamp(self, low: Self, high: Self) -> Self {
        Scalar::min(Scalar::max(self, low), high)
    }
    /// Magnitude.
    fn abs(self) -> Self {
        Self::from(0.0).if_greater(self, -self, self)
    }
    /// The square.
    fn squared(self) -> Self {
        self * self
    }
}

impl Scalar for f64 {
    #[inline]
    fn sin(self) -> Self {
        f64::sin(self)
    }
    #[inline]
    fn cos(self) -> Self {
        f64::cos(self)
    }
    #[inline]
    fn atan(self) -> Self {
        f64::atan(self)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    #[inline]
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
    #[inline]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        f64::powf(self, exponent)
    }
    #[inline]
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        if self > threshold { then } else { otherwise }
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
    #[inline]
    fn abs(self) -> Self {
        f64::abs(self)
    }
}

/// The dual number of this value whose derivative is `slope` times that of `x`. Where `x` does not change, neither
/// does a function of it, even where the function has no finite slope: a vehicle at rest stays differentiable.
fn chain(x: Dual64, value: f64, slope: f64) -> Dual64 {
    Dual64::new(value, if x.eps == 0.0 { 0.0 } else { slope * x.eps })
}

/// A dual number: value and derivative along one direction.
impl Scalar for Dual64 {
    fn sin(self) -> Self {
        DualNum::sin(&self)
    }
    fn cos(self) -> Self {
        DualNum::cos(&self)
    }
    fn atan(self) -> Self {
        DualNum::atan(&self)
    }
    fn atan2(self, x: Self) -> Self {
        // Not by way of the quotient, which has no derivative where x is 0.
        let distance = self.re * self.re + x.re * x.re;
        let turn = x.re * self.eps - self.re * x.eps;
        // At the origin the angle has no derivative; 0 keeps a vehicle at rest differentiable.
        Dual64::new(self.re.atan2(x.re), if distance == 0.0 { 0.0 } else { turn / distance })
    }
    fn tanh(self) -> Self {
        // 1 - tanh^2 instead of a quotient of hyperbolic functions, which overflows for large arguments.
        let value = self.re.tanh();
        chain(self, value, 1.0 - value * value)
    }
    fn sqrt(self) -> Self {
        let value = self.re.sqrt();
        chain(self, value, 0.5 / value)
    }
    fn exp(self) -> Self {
        DualNum::exp(&self)
    }
    fn powf(self, exponent: f64) -> Self {
        let slope = if exponent == 0.0 { 0.0 } else { exponent * self.re.powf(exponent - 1.0) };
        chain(self, self.re.powf(exponent), slope)
    }
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        if self.re > threshold.re { then } else { otherwise }
    }
    fn value(self) -> f64 {
        self.re
    }
}

/// The set of known variables (inputs, then states) that a result depends on, for any value of the parameters.
///
/// Every operation unites the sets of its operands; both sides of a branch count, and so does a product with zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dependencies([u64; Self::WORDS]);

impl Dependencies {
    const WORDS: usize = 4;
    /// How many known variables a model may have.
    pub const CAPACITY: usize = 64 * Self::WORDS;

    /// The set that holds only the known variable `index`.
    ///
    /// # Panics
    /// If `index` is not below [`Self::CAPACITY`].
    pub fn on(index: usize) -> Self {
        let mut words = [0; Self::WORDS];
        words[index / 64] = 1 << (index % 64);
        Self(words)
    }

    /// Whether the known variable `index` is in the set.
    pub fn contains(self, index: usize) -> bool {
        self.0[index / 64] & (1 << (index % 64)) != 0
    }

    /// What is in either set.
    pub fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] | other.0[i]))
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

impl Scalar for Dependencies {
    fn sin(self) -> Self {
        self
    }
    fn cos(self) -> Self {
        self
    }
    fn atan(self) -> Self {
        self
    }
    fn atan2(self, x: Self) -> Self {
        self.union(x)
    }
    fn tanh(self) -> Self {
        self
    }
    fn sqrt(self) -> Self {
        self
    }
    fn exp(self) -> Self {
        self
    }
    fn powf(self, _: f64) -> Self {
        self
    }
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        self.union(threshold).union(then).union(otherwise)
    }
    fn value(self) -> f64 {
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
    fn duals_carry_the_derivative_of_the_active_branch() {
        // Closed forms; 1e-15 relative is a few roundings.
        let x = Dual64::new(0.5, 1.0);
        assert!((x.tanh().eps - 1.0 / 0.5_f64.cosh().powi(2)).abs() < 1e-15);
        assert_eq!(Scalar::max(x, Dual64::from(2.0)).eps, 0.0);
        assert_eq!(Scalar::abs(-x).eps, 1.0);
        assert_eq!(Dual64::new(800.0, 1.0).tanh().eps, 0.0);
    }

    #[test]
    fn duals_have_the_value_of_the_number_and_its_slope_at_the_edges_of_a_domain() {
        // Closed forms. Dual64 compares equal by value alone, hence the pairs.
        let pair = |dual: Dual64| (dual.re, dual.eps);
        let zero = Dual64::from(0.0);
        let seeded = |value| Dual64::new(value, 1.0);
        // d atan2(y, x) = (x dy - y dx)/(x^2 + y^2); by way of y/x it would be 0/0 where x = 0.
        assert_eq!(Scalar::atan2(Dual64::from(2.0), seeded(0.0)).eps, -0.5);
        assert_eq!(Scalar::atan2(seeded(2.0), zero).eps, 0.0);
        assert_eq!(pair(Scalar::atan2(seeded(0.0), Dual64::from(-2.0))), (std::f64::consts::PI, -0.5));
        assert_eq!(Scalar::atan2(seeded(0.0), zero).eps, 0.0);
        assert_eq!(pair(Scalar::sqrt(zero)), (0.0, 0.0));
        assert_eq!(pair(Scalar::sqrt(seeded(4.0))), (2.0, 0.25));
        assert_eq!(pair(Scalar::sqrt(seeded(0.0))), (0.0, f64::INFINITY));
        assert_eq!(pair(Scalar::powf(seeded(0.0), 1.5)), (0.0, 0.0));
        assert_eq!(pair(Scalar::powf(zero, 0.5)), (0.0, 0.0));
        assert_eq!(pair(Scalar::powf(seeded(4.0), 1.5)), (8.0, 3.0));
        assert_eq!(pair(Scalar::powf(seeded(-3.0), 2.0)), (9.0, -6.0));
        assert_eq!(pair(Scalar::powf(seeded(0.0), 0.0)), (1.0, 0.0));
    }

    /// |x| as equations call it: through the bound on the number type.
    fn magnitude<T: Scalar>(x: T) -> T {
        x.abs()
    }

    #[test]
    fn a_magnitude_has_no_sign() {
        // -0 would turn up again as atan2(-0, -1) = -pi.
        assert!(magnitude(0.0_f64).is_sign_positive());
        assert!(magnitude(-0.0_f64).is_sign_positive());
        assert!(magnitude(Dual64::new(0.0, 1.0)).re.is_sign_positive());
        assert_eq!(magnitude(Dual64::new(-2.0, 1.0)).eps, -1.0);
    }
}
