//! Dual numbers: a value and its derivative along one direction.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::scalar::{Scalar, assign_and_sum};

/// A value and its derivative along one direction; arithmetic computes both (forward differentiation).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<T> {
    /// The value.
    pub re: T,
    /// The derivative.
    pub eps: T,
}

/// A [`Dual`] of plain numbers.
pub type Dual64 = Dual<f64>;

impl<T> Dual<T> {
    /// A value with its derivative.
    #[must_use]
    pub const fn new(re: T, eps: T) -> Self {
        Self { re, eps }
    }
}

impl<T: Scalar> Dual<T> {
    fn quotient(self, other: Self) -> Self {
        let value = self.re / other.re;
        Self::new(value, (self.eps - value * other.eps) / other.re)
    }

    /// Applies a function with this value and slope (chain rule). If the derivative of `self` is 0, so is the
    /// derivative of the result, even where the slope is infinite. A vehicle at rest therefore stays differentiable.
    fn chain(self, value: T, slope: T) -> Self {
        Self::new(value, if self.eps.value() == 0.0 { T::from(0.0) } else { slope * self.eps })
    }
}

impl<T: Scalar> From<f64> for Dual<T> {
    fn from(value: f64) -> Self {
        Self::new(T::from(value), T::from(0.0))
    }
}

macro_rules! operators {
    ($($operator:ident $function:ident: $a:ident $b:ident $dual:expr, $plain:expr;)*) => {$(
        impl<T: Scalar> $operator for Dual<T> {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                $dual
            }
        }
        impl<T: Scalar> $operator<f64> for Dual<T> {
            type Output = Self;
            fn $function(self, other: f64) -> Self {
                let ($a, $b) = (self, other);
                $plain
            }
        }
    )*};
}
operators! {
    Add add: a b Self::new(a.re + b.re, a.eps + b.eps), Self::new(a.re + b, a.eps);
    Sub sub: a b Self::new(a.re - b.re, a.eps - b.eps), Self::new(a.re - b, a.eps);
    Mul mul: a b Self::new(a.re * b.re, a.eps * b.re + b.eps * a.re), Self::new(a.re * b, a.eps * b);
    Div div: a b Self::quotient(a, b), Self::new(a.re / b, a.eps / b);
}

impl<T: Scalar> Neg for Dual<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.re, -self.eps)
    }
}
assign_and_sum!([T: Scalar] Dual<T>);

/// Functions y(x) and their slopes.
macro_rules! functions {
    ($($function:ident: $x:ident $y:ident = $value:expr, $slope:expr;)*) => {$(
        fn $function(self) -> Self {
            let $x = self.re;
            let $y = $value;
            self.chain($y, $slope)
        }
    )*};
}

impl<T: Scalar> Scalar for Dual<T> {
    functions! {
        sin: x y = x.sin(), x.cos();
        cos: x y = x.cos(), -x.sin();
        tan: x y = x.tan(), y * y + 1.0;
        asin: x y = x.asin(), T::from(1.0) / (T::from(1.0) - x * x).sqrt();
        acos: x y = x.acos(), T::from(-1.0) / (T::from(1.0) - x * x).sqrt();
        atan: x y = x.atan(), T::from(1.0) / (x * x + 1.0);
        sinh: x y = x.sinh(), x.cosh();
        cosh: x y = x.cosh(), x.sinh();
        // 1 - tanh^2 instead of a quotient of hyperbolic functions, which overflows for large arguments.
        tanh: x y = x.tanh(), T::from(1.0) - y * y;
        sqrt: x y = x.sqrt(), T::from(0.5) / y;
        exp: x y = x.exp(), y;
        ln: x y = x.ln(), T::from(1.0) / x;
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.re.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    fn atan2(self, x: Self) -> Self {
        // The quotient self/x would have no derivative at x = 0.
        let distance = self.re * self.re + x.re * x.re;
        let turn = x.re * self.eps - self.re * x.eps;
        // The angle has no derivative at the origin; 0 keeps a vehicle at rest differentiable.
        Self::new(self.re.atan2(x.re), if distance.value() == 0.0 { T::from(0.0) } else { turn / distance })
    }
    fn powf(self, exponent: f64) -> Self {
        let slope = if exponent == 0.0 { T::from(0.0) } else { self.re.powf(exponent - 1.0) * exponent };
        self.chain(self.re.powf(exponent), slope)
    }
    fn powi(self, exponent: i32) -> Self {
        let slope = if exponent == 0 { T::from(0.0) } else { self.re.powi(exponent - 1) * f64::from(exponent) };
        self.chain(self.re.powi(exponent), slope)
    }
    fn hypot(self, other: Self) -> Self {
        let value = self.re.hypot(other.re);
        let slope = self.re * self.eps + other.re * other.eps;
        Self::new(value, if value.value() == 0.0 { T::from(0.0) } else { slope / value })
    }
    fn rem_euclid(self, modulus: f64) -> Self {
        Self::new(self.re.rem_euclid(modulus), self.eps)
    }
    fn floor(self) -> Self {
        Self::new(self.re.floor(), T::from(0.0))
    }
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        let is_greater = self.re.if_greater(threshold.re, T::from(1.0), T::from(0.0));
        if is_greater.value() > 0.0 { then } else { otherwise }
    }
    // Compares the values: `T::if_greater` would add relations (see `Relational`).
    fn max(self, other: Self) -> Self {
        if self.value() > other.value() { self } else { other }
    }
    fn min(self, other: Self) -> Self {
        if self.value() > other.value() { other } else { self }
    }
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }
    fn interpolate(self, table: &crate::Table) -> Self {
        let (_, slope) = table.at(self.value());
        self.chain(self.re.interpolate(table), T::from(slope))
    }
    fn value(self) -> f64 {
        self.re.value()
    }
}

#[cfg(test)]
mod tests {
    use fmu_math as math;

    use super::*;

    fn pair(dual: Dual64) -> (f64, f64) {
        (dual.re, dual.eps)
    }

    /// A function of dual numbers, the same function of plain numbers, and its derivative.
    type Case = (fn(Dual64) -> Dual64, fn(f64) -> f64, fn(f64) -> f64);

    #[test]
    fn derivatives_agree_with_closed_forms() {
        // The values must equal the results with plain numbers. The derivatives are compared with closed forms; a
        // relative error of 4e-15 corresponds to a few rounding errors.
        let cases: &[Case] = &[
            (Scalar::sin, math::sin, f64::cos),
            (Scalar::cos, math::cos, |x| -x.sin()),
            (Scalar::tan, math::tan, |x| 1.0 / x.cos().powi(2)),
            (Scalar::asin, math::asin, |x| (1.0 - x * x).powf(-0.5)),
            (Scalar::acos, math::acos, |x| -(1.0 - x * x).powf(-0.5)),
            (Scalar::atan, math::atan, |x| 1.0 / (1.0 + x * x)),
            (Scalar::sinh, math::sinh, f64::cosh),
            (Scalar::cosh, math::cosh, f64::sinh),
            (Scalar::tanh, math::tanh, |x| x.cosh().powi(-2)),
            (Scalar::sqrt, f64::sqrt, |x| 0.5 * x.powf(-0.5)),
            (Scalar::exp, math::exp, f64::exp),
            (Scalar::ln, math::ln, f64::recip),
            (|x| x.powf(2.5), |x| math::pow(x, 2.5), |x| 2.5 * x.powf(1.5)),
            (|x| x.powi(-3), |x| math::powi(x, -3), |x| -3.0 * x.powi(-4)),
            (|x| x.hypot(Dual64::from(2.0)), |x| math::hypot(x, 2.0), |x| x / x.hypot(2.0)),
            (|x| (x * x + 1.0) / x - 3.0, |x| (x * x + 1.0) / x - 3.0, |x| 1.0 - 1.0 / (x * x)),
            (|x| x.rem_euclid(0.4), |x| x.rem_euclid(0.4), |_| 1.0),
            (Scalar::floor, f64::floor, |_| 0.0),
        ];
        for x in [0.1, 0.55, 0.93] {
            for (i, (dual, value, slope)) in cases.iter().enumerate() {
                let result = dual(Dual64::new(x, 1.0));
                assert_eq!(result.re, value(x), "case {i} at {x}");
                let expected = slope(x);
                assert!((result.eps - expected).abs() <= 4e-15 * expected.abs(), "case {i} at {x}: {result:?}");
            }
        }
    }

    #[test]
    fn duals_carry_the_derivative_of_the_active_branch() {
        let x = Dual64::new(0.5, 1.0);
        assert_eq!(Scalar::max(x, Dual64::from(2.0)).eps, 0.0);
        assert_eq!(Scalar::abs(-x).eps, 1.0);
        assert_eq!(Scalar::tanh(Dual64::new(800.0, 1.0)).eps, 0.0);
    }

    #[test]
    fn duals_have_the_value_of_the_number_and_its_slope_at_the_edges_of_a_domain() {
        let zero = Dual64::from(0.0);
        let seeded = |value| Dual64::new(value, 1.0);
        // d atan2(y, x) = (x dy - y dx)/(x^2 + y^2)
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
        assert_eq!(pair(Scalar::hypot(seeded(0.0), zero)), (0.0, 0.0));
    }

    /// |x| for a generic number type, as in equations.
    fn magnitude<T: Scalar>(x: T) -> T {
        x.abs()
    }

    #[test]
    fn a_magnitude_has_no_sign() {
        // If the magnitude were -0, equations could get atan2(-0, -1) = -pi instead of pi.
        assert!(magnitude(0.0_f64).is_sign_positive());
        assert!(magnitude(-0.0_f64).is_sign_positive());
        assert!(magnitude(Dual64::new(0.0, 1.0)).re.is_sign_positive());
        assert_eq!(magnitude(Dual64::new(-2.0, 1.0)).eps, -1.0);
    }
}
