//! Natural logarithm.
//!
//! x = 2^k m with m from sqrt(1/2) to sqrt(2). With f = m - 1 and s = f/(2 + f), ln(m) = f - f^2/2 + s (f^2/2 +
//! R(s^2)), as in fdlibm. This form is accurate near 1. The polynomial R is fitted by `tools/coefficients.py`.

use crate::bits::{INFINITY, SIGN, canonical};
use crate::coefficients::{LN, LN2_HI, LN2_LO};
use crate::lanes::polynomial7;

const NORMAL: u64 = f64::MIN_POSITIVE.to_bits();
/// The bits of sqrt(1/2).
const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;

/// The highest bit is set unless `x` is a positive normal number.
#[inline(always)]
pub(crate) fn outside(x: f64) -> u64 {
    let bits = x.to_bits();
    bits | bits.wrapping_sub(NORMAL) | (INFINITY - 1).wrapping_sub(bits)
}

/// Returns k and m for a positive normal number.
#[inline(always)]
pub(crate) fn split(x: f64) -> (f64, f64) {
    // 1024 is added to make the exponent positive. Numbers from 2^52 to 2^53 contain an integer in their lowest bits.
    const BIAS: f64 = 4_503_599_627_370_496.0;
    let shifted = x.to_bits().wrapping_sub(SQRT_HALF).wrapping_add(1024 << 52);
    let exponent = shifted >> 52;
    let k = f64::from_bits(exponent | BIAS.to_bits()) - (BIAS + 1024.0);
    let m = f64::from_bits(x.to_bits().wrapping_sub(exponent.wrapping_sub(1024) << 52));
    (k, m)
}

#[inline(always)]
fn combine(k: f64, m: f64) -> f64 {
    let f = m - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let half = 0.5 * f * f;
    let tail = s * (half + z * polynomial7(&LN, z));
    k * LN2_HI - ((half - (tail + k * LN2_LO)) - f)
}

#[cold]
fn ln_full(x: f64) -> f64 {
    if x == 0.0 {
        f64::NEG_INFINITY
    } else if x.is_nan() || x.to_bits() & SIGN != 0 {
        f64::NAN
    } else if x == f64::INFINITY {
        x
    } else {
        let (k, m) = split(x * 18_014_398_509_481_984.0);
        combine(k - 54.0, m)
    }
}

/// Natural logarithm, within 0.9 ulp; minus infinity for ±0, NaN for negative numbers.
#[inline(never)]
#[must_use]
pub fn ln(x: f64) -> f64 {
    if outside(x) >> 63 == 0 {
        let (k, m) = split(x);
        combine(k, m)
    } else {
        canonical(ln_full(x))
    }
}
