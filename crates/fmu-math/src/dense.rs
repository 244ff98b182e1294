//! Dense matrices: LU factors with row exchanges (Golub, Van Loan, "Matrix Computations", section 3.4).

/// Factors a matrix of `n` rows, stored row by row, in place. Returns false if it is singular.
///
/// # Panics
/// If `matrix` is shorter than n^2 or `pivots` than n.
#[inline]
#[must_use]
pub fn factorize(matrix: &mut [f64], pivots: &mut [usize], n: usize) -> bool {
    for k in 0..n {
        let Some(pivot) = (k..n).max_by(|&a, &b| matrix[a * n + k].abs().total_cmp(&matrix[b * n + k].abs())) else {
            return false;
        };
        let largest = matrix[pivot * n + k];
        if largest == 0.0 || !largest.is_finite() {
            return false;
        }
        pivots[k] = pivot;
        (0..n).for_each(|column| matrix.swap(k * n + column, pivot * n + column));
        for row in k + 1..n {
            let factor = matrix[row * n + k] / matrix[k * n + k];
            matrix[row * n + k] = factor;
            for column in k + 1..n {
                matrix[row * n + column] -= factor * matrix[k * n + column];
            }
        }
    }
    true
}

/// Replaces `b` by the solution of A x = b, with the factors of A from [`factorize`].
///
/// # Panics
/// If a slice is shorter than `n` requires.
#[inline]
pub fn solve(matrix: &[f64], pivots: &[usize], n: usize, b: &mut [f64]) {
    (0..n).for_each(|k| b.swap(k, pivots[k]));
    for row in 1..n {
        for column in 0..row {
            b[row] -= matrix[row * n + column] * b[column];
        }
    }
    for row in (0..n).rev() {
        for column in row + 1..n {
            b[row] -= matrix[row * n + column] * b[column];
        }
        b[row] /= matrix[row * n + row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 y = 4 and 3 x + y = 5 need a row exchange.
    #[test]
    fn a_zero_on_the_diagonal_is_no_problem() {
        let (mut matrix, mut pivots, mut b) = ([0.0, 2.0, 3.0, 1.0], [0; 2], [4.0, 5.0]);
        assert!(factorize(&mut matrix, &mut pivots, 2));
        solve(&matrix, &pivots, 2, &mut b);
        assert_eq!(b, [1.0, 2.0]);
        assert!(!factorize(&mut [1.0, 2.0, 2.0, 4.0], &mut pivots, 2));
        assert!(!factorize(&mut [f64::NAN, 0.0, 0.0, 1.0], &mut pivots, 2));
    }
}
