//! Exponential function and hyperbolic functions.
//!
//! exp(x) = 2^n exp(r) with |r| <= ln(2)/2. The hyperbolic functions use exp(x) and exp(x) - 1, each in two parts,
//! which keeps them accurate near zero.

use crate::bits::{INFINITY, ROUNDER, SIGN, abs, canonical, choose, fast_sum, flip, magnitude, min, sign, spread, sum};
use crate::coefficients::{EXPM1, INV_LN2, LN2_HI, LN2_LO, TANH};
use crate::lanes::polynomial11;

/// Up to this argument, the result and its reciprocal are normal numbers.
const LIMIT: u64 = 708f64.to_bits();

#[inline(always)]
fn outside(x: f64) -> u64 {
    LIMIT.wrapping_sub(magnitude(x))
}

/// Returns n in the lowest bits, and r in two parts.
#[inline(always)]
pub(crate) fn reduce(x: f64, x_low: f64) -> (u64, f64, f64) {
    let shifted = x * INV_LN2 + ROUNDER;
    let n = shifted - ROUNDER;
    // The product and the difference are exact.
    let (high, low) = fast_sum(x - n * LN2_HI, -(n * LN2_LO));
    (shifted.to_bits(), high, low + x_low)
}

/// 2^n, which must be a normal number; n is in the lowest bits.
#[inline(always)]
pub(crate) fn power_of_two(n: u64) -> f64 {
    f64::from_bits(n.wrapping_add(1023) << 52)
}

/// The exponential function is infinite above this.
pub(crate) const OVERFLOW: f64 = 710.0;
/// The exponential function is 0 below this.
pub(crate) const UNDERFLOW: f64 = -746.0;

/// `value` times 2^n; n is in the lowest bits. In two steps, because 2^n may be out of range.
#[inline(always)]
pub(crate) fn scaled(value: f64, n: u64) -> f64 {
    let half = ((n as i64) << 13 >> 13) / 2;
    value * power_of_two(half as u64) * power_of_two(n.wrapping_sub(half as u64))
}

#[inline(always)]
pub(crate) fn exponential(high: f64, low: f64) -> (f64, f64) {
    let tail = high * high * polynomial11(&EXPM1, high);
    let (one, error) = fast_sum(1.0, high);
    (one, error + (tail + low * (one + tail)))
}

/// Returns n in the lowest bits, and exp(r). Here, r needs no second part: its rounding error changes the result by at
/// most 1/4 ulp.
#[inline(always)]
fn exp_parts(x: f64) -> (u64, f64) {
    let shifted = x * INV_LN2 + ROUNDER;
    let n = shifted - ROUNDER;
    let r = (x - n * LN2_HI) - n * LN2_LO;
    (shifted.to_bits(), 1.0 + (r + r * r * polynomial11(&EXPM1, r)))
}

#[inline(always)]
fn exp_kernel(x: f64) -> f64 {
    let (n, value) = exp_parts(x);
    value * power_of_two(n)
}

/// Up to this argument (below ln(2)/2), n is 0 and r is the argument itself.
const NEAR: u64 = 0.346f64.to_bits();

#[inline(always)]
fn far(x: f64) -> u64 {
    NEAR.wrapping_sub(magnitude(x))
}

/// [`exp_kernel`] near 0.
#[inline(always)]
fn exp_near(x: f64) -> f64 {
    1.0 + (x + x * x * polynomial11(&EXPM1, x))
}

/// Overflow, underflow, and results that are not normal numbers.
#[cold]
fn exp_full(x: f64) -> f64 {
    if x.is_nan() {
        return f64::NAN;
    }
    if x > OVERFLOW {
        return f64::INFINITY;
    }
    if x < UNDERFLOW {
        return 0.0;
    }
    let (n, value) = exp_parts(x);
    scaled(value, n)
}

/// Exponential function, within 1 ulp, subnormal results included.
#[inline(never)]
#[must_use]
pub fn exp(x: f64) -> f64 {
    if far(x) >> 63 == 0 {
        return exp_near(x);
    }
    if outside(x) >> 63 == 0 { exp_kernel(x) } else { canonical(exp_full(x)) }
}

/// [`exp`] of each element, bit-identical.
#[inline(always)]
#[must_use]
pub fn exp_each<const N: usize>(mut x: [f64; N]) -> [f64; N] {
    #[cold]
    #[inline(never)]
    fn singles(x: &mut [f64]) {
        x.iter_mut().for_each(|x| *x = exp(*x));
    }
    if x.iter().fold(0, |any, &x| any | outside(x)) >> 63 == 0 {
        for x in &mut x {
            *x = exp_kernel(*x);
        }
    } else {
        // A copy, because the compiler would keep a borrowed array in memory instead of registers.
        let mut copy: [f64; N] = core::array::from_fn(|i| x[i]);
        singles(&mut copy);
        x = core::array::from_fn::<_, N, _>(|i| copy[i]);
    }
    x
}

/// exp(x) - 1 in two parts, for x >= 0.
#[inline(always)]
fn exp_minus_one(x: f64) -> (f64, f64) {
    let (n, high, low) = reduce(x, 0.0);
    let tail = high * high * polynomial11(&EXPM1, high);
    let (rest, rest_low) = fast_sum(high, tail);
    let rest_low = rest_low + low * (1.0 + rest);
    let scale = power_of_two(n);
    let (whole, whole_low) = fast_sum(scale, -1.0);
    let (sum, sum_low) = fast_sum(whole, scale * rest);
    (sum, sum_low + (whole_low + scale * rest_low))
}

/// Below this argument, the hyperbolic tangent is computed with a polynomial.
const STRAIGHT: u64 = 0.55f64.to_bits();
/// From this argument on, the hyperbolic tangent is 1.
const FLAT: f64 = 22.0;

/// The highest bit is set for NaN.
#[inline(always)]
fn tanh_outside(x: f64) -> u64 {
    INFINITY.wrapping_sub(magnitude(x))
}

#[inline(always)]
fn is_straight(x: f64) -> u64 {
    magnitude(x).wrapping_sub(STRAIGHT)
}

#[inline(always)]
fn is_flat(x: f64) -> u64 {
    FLAT.to_bits().wrapping_sub(magnitude(x))
}

#[inline(always)]
fn tanh_straight(x: f64) -> f64 {
    let z = x * x;
    let ax = abs(x);
    flip(ax + ax * (z * polynomial11(&TANH, z)), sign(x))
}

/// 1 - 2/(exp(2 |x|) + 1), with the sign of x.
#[inline(always)]
fn tanh_bent(x: f64) -> f64 {
    let ax = min(abs(x), FLAT);
    let (n, high, low) = reduce(ax + ax, 0.0);
    let (one, rest) = exponential(high, low);
    let (value, value_low) = fast_sum(one, rest);
    let scale = power_of_two(n);
    let (d, d_low) = fast_sum(value * scale, 1.0);
    let quotient = 2.0 / d;
    // Corrects the rounding error of the denominator; 1/d is quotient/2.
    let correction = quotient * (0.5 * quotient * (d_low + value_low * scale));
    let (result, error) = fast_sum(1.0, -quotient);
    flip(result + (error + correction), sign(x))
}

#[inline(always)]
fn sinh_kernel(x: f64) -> f64 {
    let (n, n_low) = exp_minus_one(abs(x));
    let (d, d_low) = sum(n, 1.0);
    let quotient = n / d;
    let quotient_low = (n_low - quotient * (d_low + n_low)) / d;
    let (sum, sum_low) = fast_sum(n, quotient);
    flip(0.5 * (sum + (sum_low + (n_low + quotient_low))), sign(x))
}

#[inline(always)]
fn cosh_kernel(x: f64) -> f64 {
    let (n, high, low) = reduce(abs(x), 0.0);
    let (one, rest) = exponential(high, low);
    let scale = power_of_two(n);
    let (value, value_low) = fast_sum(one, rest);
    let (value, value_low) = (value * scale, value_low * scale);
    let (sum, sum_low) = fast_sum(value, 1.0 / value);
    0.5 * (sum + (sum_low + value_low))
}

/// Hyperbolic sine, within 1.2 ulp.
#[inline(never)]
#[must_use]
pub fn sinh(x: f64) -> f64 {
    if outside(x) >> 63 == 0 { sinh_kernel(x) } else { canonical(libm::sinh(x)) }
}

/// Hyperbolic cosine, within 0.9 ulp.
#[inline(never)]
#[must_use]
pub fn cosh(x: f64) -> f64 {
    if outside(x) >> 63 == 0 { cosh_kernel(x) } else { canonical(libm::cosh(x)) }
}

/// Hyperbolic tangent, within 0.9 ulp.
#[inline(never)]
#[must_use]
pub fn tanh(x: f64) -> f64 {
    if tanh_outside(x) >> 63 != 0 {
        f64::NAN
    } else if is_straight(x) >> 63 != 0 {
        tanh_straight(x)
    } else if is_flat(x) >> 63 != 0 {
        flip(1.0, sign(x))
    } else {
        tanh_bent(x)
    }
}

/// [`tanh`] of each element, bit-identical.
#[inline(always)]
#[must_use]
pub fn tanh_each<const N: usize>(mut x: [f64; N]) -> [f64; N] {
    let (mut outside, mut straight, mut bent, mut flat) = (0, SIGN, SIGN, SIGN);
    for &x in &x {
        outside |= tanh_outside(x);
        straight &= is_straight(x);
        bent &= !is_straight(x);
        flat &= is_flat(x);
    }
    if outside >> 63 != 0 {
        x.map(tanh)
    } else if straight >> 63 != 0 {
        x.iter_mut().for_each(|x| *x = tanh_straight(*x));
        x
    } else if flat >> 63 != 0 {
        // A frequent case: friction at rotating wheels.
        x.map(|x| flip(1.0, sign(x)))
    } else if bent >> 63 != 0 {
        x.iter_mut().for_each(|x| *x = tanh_bent(*x));
        x
    } else {
        x.iter_mut().for_each(|x| *x = choose(spread(is_straight(*x)), tanh_straight(*x), tanh_bent(*x)));
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the fast path with the general kernel: near zero, at the end of the range, and in between.
    #[test]
    fn the_fast_path_has_the_bits_of_the_general_kernel() {
        let end = f64::from_bits(NEAR);
        let tiny = [0.0, -0.0, f64::from_bits(1), f64::MIN_POSITIVE, 1e-300, 1e-20, 1e-8];
        let spaced = (0..200_000).map(|i| f64::from(i) * (end / 200_000.0));
        for x in tiny.into_iter().chain(spaced).chain([end]).flat_map(|x| [x, -x]) {
            assert_eq!(far(x) >> 63, 0, "{x:e}");
            assert_eq!(exp_near(x).to_bits(), exp_kernel(x).to_bits(), "{x:e}");
        }
        assert_eq!(far(end.next_up()) >> 63, 1);
        assert_eq!(far(f64::NAN) >> 63, 1);
    }
}
