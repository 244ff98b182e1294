//! Bit operations on numbers, and sums and products with their rounding errors.
//!
//! Conditions are masks: all ones or all zeros. Unlike `if`, a mask cannot become a branch, so the compiler can
//! vectorize loops over the elements of an array.

pub(crate) const SIGN: u64 = 1 << 63;
pub(crate) const INFINITY: u64 = f64::INFINITY.to_bits();
/// 1.5 * 2^52. If a small number is added to this constant, the lowest bits of the sum contain the small number,
/// rounded to an integer.
pub(crate) const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// The bit pattern of the magnitude.
#[inline(always)]
pub(crate) fn magnitude(x: f64) -> u64 {
    x.to_bits() & !SIGN
}

#[inline(always)]
pub(crate) fn abs(x: f64) -> f64 {
    f64::from_bits(magnitude(x))
}

/// The sign bit of `x`.
#[inline(always)]
pub(crate) fn sign(x: f64) -> u64 {
    x.to_bits() & SIGN
}

/// `x` with the opposite sign if the sign bit of `sign` is set.
#[inline(always)]
pub(crate) fn flip(x: f64, sign: u64) -> f64 {
    f64::from_bits(x.to_bits() ^ sign)
}

/// All ones if the highest bit is set, otherwise zero.
#[inline(always)]
pub(crate) fn spread(bits: u64) -> u64 {
    0u64.wrapping_sub(bits >> 63)
}

/// All ones if the condition holds, otherwise zero. Vector comparisons return such masks, so the compiler can evaluate
/// two conditions with one instruction.
#[inline(always)]
pub(crate) fn mask(condition: bool) -> u64 {
    0u64.wrapping_sub(u64::from(condition))
}

/// The smaller number; `b` if one of them is NaN.
#[inline(always)]
pub(crate) fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger number; `b` if one of them is NaN.
#[inline(always)]
pub(crate) fn max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// `x` if the mask is set, otherwise 0.
#[inline(always)]
pub(crate) fn keep(mask: u64, x: f64) -> f64 {
    f64::from_bits(x.to_bits() & mask)
}

/// `yes` if the mask is set, otherwise `no`.
#[inline(always)]
pub(crate) fn choose(mask: u64, yes: f64, no: f64) -> f64 {
    f64::from_bits(no.to_bits() ^ ((no.to_bits() ^ yes.to_bits()) & mask))
}

/// The sum and its rounding error, for `|a| >= |b|` or `a` = 0.
#[inline(always)]
pub(crate) fn fast_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, (a - sum) + b)
}

/// The sum and its rounding error.
#[inline(always)]
pub(crate) fn sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let second = sum - a;
    (sum, (a - (sum - second)) + (b - second))
}

/// The first 26 significant bits.
#[inline(always)]
pub(crate) fn upper(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & !0x7ff_ffff)
}

/// The product and its rounding error (Dekker). Both results must be in the range of normal numbers.
#[inline(always)]
pub(crate) fn product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let (a1, b1) = (upper(a), upper(b));
    let (a2, b2) = (a - a1, b - b1);
    (product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2)
}

/// The square root, which is exact on every platform.
#[inline(always)]
pub(crate) fn sqrt(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return x.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrt(x);
}

/// Replaces any NaN with `f64::NAN`, because platforms produce different NaNs.
#[inline(always)]
pub(crate) fn canonical(x: f64) -> f64 {
    if x.is_nan() { f64::NAN } else { x }
}
