//! Sums of many numbers.

/// Rounding of a sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Summation {
    /// Rounded once: the result is the double nearest to the exact sum, for any order of the numbers.
    Exact,
    /// Rounded after each number, in order. The objectives of studies are computed in this way, because a study is
    /// continued from its journal only if its objectives stay bit-identical.
    InOrder,
}

impl Summation {
    /// The sum; 0 without numbers.
    pub(super) fn of(self, values: impl Iterator<Item = f64> + Clone) -> f64 {
        match self {
            Self::Exact => exact(values),
            Self::InOrder => values.sum(),
        }
    }

    /// The sum divided by the number of values; NaN without values.
    pub(super) fn mean(self, values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
        let count = values.len() as f64;
        self.of(values) / count
    }
}

/// Returns the double nearest to the sum; ties go to even. If a number or a partial sum is not finite, returns the sum
/// in order.
///
/// The partial sums hold the exact sum as numbers that do not overlap (J. R. Shewchuk, "Adaptive Precision
/// Floating-Point Arithmetic and Fast Robust Geometric Predicates", Discrete & Computational Geometry 18, 1997).
pub(super) fn exact(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let mut partials: Vec<f64> = Vec::new();
    for value in values.clone() {
        let mut carried = value;
        let mut kept = 0;
        for index in 0..partials.len() {
            let (sum, error) = two_sum(carried, partials[index]);
            if error != 0.0 {
                partials[kept] = error;
                kept += 1;
            }
            carried = sum;
        }
        if !carried.is_finite() {
            return values.sum();
        }
        partials.truncate(kept);
        partials.push(carried);
    }
    rounded(&partials)
}

/// The sum of two numbers and its rounding error: together they are exact.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let (large, small) = if a.abs() < b.abs() { (b, a) } else { (a, b) };
    let sum = large + small;
    (sum, small - (sum - large))
}

/// The double nearest to the sum of numbers that do not overlap and rise in magnitude.
fn rounded(partials: &[f64]) -> f64 {
    let mut rest = partials.iter().rev().copied();
    let mut sum = rest.next().unwrap_or(0.0);
    let mut error = 0.0;
    while error == 0.0
        && let Some(partial) = rest.next()
    {
        (sum, error) = two_sum(sum, partial);
    }
    // A tie was rounded to even. If the next partial sum has the sign of the rounding error, the other neighbor is
    // nearer.
    if let Some(next) = rest.next()
        && (next < 0.0) == (error < 0.0)
    {
        let double = 2.0 * error;
        let neighbor = sum + double;
        if neighbor - sum == double {
            return neighbor;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(values: &[f64]) -> f64 {
        exact(values.iter().copied())
    }

    /// Expected values computed by hand: cancellation, loss in sequential summation, and ties that the smallest number
    /// decides.
    #[test]
    fn sums_are_rounded_once() {
        assert_eq!(sum(&[]), 0.0);
        assert_eq!(sum(&[1e100, 1.0, -1e100]), 1.0);
        assert_eq!(Summation::InOrder.of([1e100, 1.0, -1e100].into_iter()), 0.0);
        assert_eq!(sum(&[0.1; 10]), 1.0);
        // 1 + 2^-53 is a tie that goes to 1; the smallest number moves it up or leaves it.
        let half = f64::EPSILON / 2.0;
        assert_eq!(sum(&[1.0, half]), 1.0);
        assert_eq!(sum(&[1.0, half, 1e-30]), 1.0 + f64::EPSILON);
        assert_eq!(sum(&[1.0, half, -1e-30]), 1.0);
        assert_eq!(sum(&[-1.0, -half, -1e-30]), -1.0 - f64::EPSILON);
        // The tie above 1 + 2^-52 goes to 1 + 2^-51.
        assert_eq!(sum(&[1.0 + f64::EPSILON, half]), 1.0 + 2.0 * f64::EPSILON);
        assert_eq!(sum(&[1.0 + f64::EPSILON, half, -1e-30]), 1.0 + f64::EPSILON);
    }

    #[test]
    fn sums_that_are_not_finite() {
        assert_eq!(sum(&[1.0, f64::INFINITY, 1.0]), f64::INFINITY);
        assert!(sum(&[f64::INFINITY, f64::NEG_INFINITY]).is_nan());
        assert!(sum(&[1.0, f64::NAN]).is_nan());
        assert_eq!(sum(&[f64::MAX, f64::MAX]), f64::INFINITY);
    }
}
