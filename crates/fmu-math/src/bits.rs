//! Operations on the bits of numbers, and sums and products with their rounding errors.
//!
//! Conditions are masks: all ones or all zeros. Unlike `if`, a mask cannot become a branch, so the lanes of an array stay
//! together.

/// The bit of the sign.
pub(crate) const SIGN: u64 = 1 << 63;
/// The bits of infinity.
pub(crate) const INFINITY: u64 = f64::INFINITY.to_bits();
/// 1.5 * 2^52. Added to a small number it rounds that to an integer, which the lowest bits then hold.
pub(crate) const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// The bits of the magnitude.
#[inline(always)]
pub(crate) fn magnitude(x: f64) -> u64 {
    x.to_bits() & !SIGN
}

/// The magnitude.
#[inline(always)]
pub(crate) fn abs(x: f64) -> f64 {
    f64::from_bits(magnitude(x))
}

/// The bit of the sign of `x`.
#[inline(always)]
pub(crate) fn sign(x: f64) -> u64 {
    x.to_bits() & SIGN
}

/// `x` with its sign changed if `sign` has that bit.
#[inline(always)]
pub(crate) fn flip(x: f64, sign: u64) -> f64 {
    f64::from_bits(x.to_bits() ^ sign)
}

/// All ones if the highest bit is set, else zero.
#[inline(always)]
pub(crate) fn spread(bits: u64) -> u64 {
    0u64.wrapping_sub(bits >> 63)
}

/// All ones if the condition holds. For a comparison of numbers that is one instruction for two lanes.
#[inline(always)]
pub(crate) fn mask(condition: bool) -> u64 {
    0u64.wrapping_sub(u64::from(condition))
}

/// The smaller number; `b` if one of them is NaN.
#[inline(always)]
pub(crate) fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater number; `b` if one of them is NaN.
#[inline(always)]
pub(crate) fn max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// `x` where the mask is set, else 0.
#[inline(always)]
pub(crate) fn keep(mask: u64, x: f64) -> f64 {
    f64::from_bits(x.to_bits() & mask)
}

/// `yes` where the mask is set, else `no`.
#[inline(always)]
pub(crate) fn choose(mask: u64, yes: f64, no: f64) -> f64 {
    f64::from_bits(no.to_bits() ^ ((no.to_bits() ^ yes.to_bits()) & mask))
}

/// The sum and its rounding error, if `|a| >= |b|` or `a` is 0.
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

/// The product and its rounding error (Dekker), as long as neither the product nor its error leaves the normal range.
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

/// The NaN with one representation, because platforms make different ones.
#[inline(always)]
pub(crate) fn canonical(x: f64) -> f64 {
    if x.is_nan() { f64::NAN } else { x }
}
