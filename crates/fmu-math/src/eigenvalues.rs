//! Eigenvalues of a matrix by nalgebra's QR iteration.

use nalgebra::{Complex, DMatrix, Schur};

/// Eigenvalues of a square matrix, sorted by descending real part, then by descending imaginary part; None if the QR
/// iteration does not converge or an element is not finite.
///
/// nalgebra's `complex_eigenvalues` has no iteration limit and may never return.
///
/// # Panics
///
/// If the matrix is not square.
pub fn eigenvalues(m: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    let n = m.nrows();
    if !m.norm().is_finite() {
        return None;
    }
    let schur = |m| Schur::try_new(m, f64::EPSILON, 100 * n).map(|schur| schur.unpack().1);
    let direct = schur(m.clone()).map(|t| quasi_diagonal(&t));
    let mut values = direct.or_else(|| {
        // nalgebra's iteration has no exceptional shifts and sometimes stalls, especially if eigenvalues come in pairs
        // +-x, as in a Hamiltonian matrix. It converges for the inverse of M - s I, whose eigenvalues are 1 / (x - s).
        [1.5, -2.5].into_iter().find_map(|factor| {
            let s = factor * m.norm();
            let inverse = (m - DMatrix::identity(n, n) * s).try_inverse()?;
            let inverted = quasi_diagonal(&schur(inverse)?);
            Some(inverted.into_iter().map(|x| s + x.inv()).collect())
        })
    })?;
    values.sort_by(|x, y| y.re.total_cmp(&x.re).then(y.im.total_cmp(&x.im)));
    Some(values)
}

/// Eigenvalues of a block upper triangular matrix with blocks of up to 2 x 2 on the diagonal.
fn quasi_diagonal(t: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let n = t.nrows();
    let mut values = Vec::with_capacity(n);
    while values.len() < n {
        let i = values.len();
        if i + 1 == n || t[(i + 1, i)] == 0.0 {
            values.push(Complex::new(t[(i, i)], 0.0));
            continue;
        }
        // A 2 x 2 block: mean +- sqrt(discriminant).
        let mean = 0.5 * (t[(i, i)] + t[(i + 1, i + 1)]);
        let half = 0.5 * (t[(i, i)] - t[(i + 1, i + 1)]);
        let square: f64 = half * half + t[(i, i + 1)] * t[(i + 1, i)];
        let root = if square < 0.0 { Complex::new(0.0, (-square).sqrt()) } else { Complex::new(square.sqrt(), 0.0) };
        values.push(root + mean);
        values.push(-root + mean);
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{hypot, sin_cos};

    /// A cyclic permutation has the n-th roots of 1 as eigenvalues, and nalgebra's iteration does not converge for it
    /// (its issues 611 and 1528). Tolerance: rounding for a matrix of norm sqrt(12), twice because of the inverse.
    #[test]
    fn eigenvalues_of_a_cyclic_matrix() {
        let n = 12;
        let cyclic = DMatrix::from_fn(n, n, |i, j| f64::from(j == (i + 1) % n));
        let stuck = Schur::try_new(cyclic.clone(), f64::EPSILON, 100 * n).is_none();
        assert!(stuck, "the detour over the inverse is no longer tested");
        let mut left = eigenvalues(&cyclic).unwrap();
        assert_eq!(left.len(), n);
        for k in 0..n {
            let (im, re) = sin_cos(std::f64::consts::TAU * k as f64 / n as f64);
            let near = left.iter().position(|z| hypot(z.re - re, z.im - im) < 1e-13);
            left.swap_remove(near.unwrap_or_else(|| panic!("{re} + {im}i is missing in {left:?}")));
        }
    }
}
