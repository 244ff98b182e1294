//! Comparisons of numbers.

/// The smaller of two numbers that are not NaN. One instruction, unlike `f64::min`.
#[inline]
pub(super) fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN.
#[inline]
pub(super) fn greatest(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
pub(super) fn contains_nan<const N: usize>(values: &[f64; N]) -> bool {
    // Checks all values, without a branch for each.
    values.iter().fold(false, |any, x| any | x.is_nan())
}
