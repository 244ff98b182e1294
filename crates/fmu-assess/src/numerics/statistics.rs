//! Statistics of a signal, and its derivative.

pub(crate) fn mean(x: &[f64]) -> Option<f64> {
    (!x.is_empty()).then(|| x.iter().sum::<f64>() / x.len() as f64)
}

/// Root of the mean square about the mean, over all values; `None` without values.
pub(crate) fn standard_deviation(x: &[f64]) -> Option<f64> {
    let mean = mean(x)?;
    Some((x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / x.len() as f64).sqrt())
}

pub(crate) fn largest(x: &[f64]) -> Option<f64> {
    first_largest(x).map(|row| x[row])
}

pub(crate) fn smallest(x: &[f64]) -> Option<f64> {
    x.iter().copied().reduce(f64::min)
}

pub(crate) fn largest_magnitude(x: &[f64]) -> Option<f64> {
    x.iter().map(|x| x.abs()).reduce(f64::max)
}

/// The first row with the largest value.
pub(crate) fn first_largest(x: &[f64]) -> Option<usize> {
    (0..x.len()).reduce(|best, row| if x[row] > x[best] { row } else { best })
}

/// Sign: 1, -1, or 0 for 0.
pub(crate) fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// Derivative of a signal; `rate` is the sampling rate, Hz. Central differences, one-sided at the ends.
pub(crate) fn derivative(x: &[f64], rate: f64) -> Vec<f64> {
    let last = x.len().saturating_sub(1);
    let slope = |row: usize| {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(last));
        if before == after { 0.0 } else { (x[after] - x[before]) * rate / (after - before) as f64 }
    };
    (0..x.len()).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values computed by hand.
    #[test]
    fn numbers_of_a_signal() {
        let x = [1.0, -4.0, 3.0, 3.0, 2.0];
        assert_eq!(mean(&x), Some(1.0));
        assert_eq!(standard_deviation(&x), Some((34.0_f64 / 5.0).sqrt()));
        assert_eq!((largest(&x), smallest(&x), largest_magnitude(&x)), (Some(3.0), Some(-4.0), Some(4.0)));
        assert_eq!(first_largest(&x), Some(2));
        assert_eq!([sign(-2.0), sign(0.0), sign(-0.0), sign(3.0)], [-1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn nothing_has_no_number() {
        assert_eq!((mean(&[]), standard_deviation(&[]), largest(&[]), smallest(&[])), (None, None, None, None));
        assert_eq!((largest_magnitude(&[]), first_largest(&[])), (None, None));
        assert!(derivative(&[], 10.0).is_empty());
        assert_eq!(derivative(&[1.0], 10.0), [0.0]);
    }

    /// Central differences are exact for parabolas: the derivative of t^2 is 2 t. At the ends, the one-sided difference
    /// is the derivative half a step inside.
    #[test]
    fn derivatives_of_a_parabola() {
        assert_eq!(derivative(&[0.0, 1.0, 4.0, 9.0], 1.0), [1.0, 2.0, 4.0, 5.0]);
        assert_eq!(derivative(&[0.0, 1.0], 10.0), [10.0, 10.0]);
    }
}
