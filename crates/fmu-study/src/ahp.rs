//! Weights from judgments: the analytic hierarchy process.
//!
//! A judgment matrix states how much more important each feature is than every other feature, on Saaty's scale from 1
//! (equally important) to 9 (extremely more important). Mirrored entries are reciprocals of each other. The weights are
//! the principal eigenvector of the matrix; the largest eigenvalue shows how far the judgments contradict each other.
//!
//! Reference: Applied Sciences 2020, 10, 1852, equations 26 to 28 and Table 3; Saaty, The Analytic Hierarchy Process,
//! 1980. The printed equation 27 lacks the division by the order of the matrix.

/// Mean consistency index of random matrices of order 1 to 10: from Table 3 up to order 8, from Saaty for 9 and 10.
const RANDOM_INDEX: [f64; 10] = [0.0, 0.0, 0.58, 0.9, 1.12, 1.24, 1.32, 1.41, 1.45, 1.49];

/// Judgments with a consistency ratio above this are rejected.
const MAX_RATIO: f64 = 0.10;

/// Maximum deviation from 1 for the product of two mirrored entries. It allows 0.333333 for 1/3.
const RECIPROCAL_SLACK: f64 = 1e-5;

/// Weights, and measures of the consistency of the judgments.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Weights {
    /// Weights in the order of the matrix; their sum is 1.
    pub weights: Vec<f64>,
    /// Largest eigenvalue. It equals the order of the matrix if the judgments are consistent, and is larger otherwise.
    pub lambda_max: f64,
    /// Consistency index (lambda_max - n)/(n - 1).
    pub index: f64,
    /// Consistency ratio: the index divided by that of random judgments; 0 for up to two features.
    pub ratio: f64,
}

/// Computes the weights from a judgment matrix.
///
/// # Errors
/// The matrix is not a judgment matrix, or its consistency ratio is above 0.10.
pub fn weights(matrix: &[Vec<f64>]) -> Result<Weights, String> {
    check(matrix)?;
    let n = matrix.len();
    let found = evaluate(matrix);
    let Weights { weights: q, lambda_max, ratio, .. } = &found;
    if *ratio > MAX_RATIO {
        // Factor by which an entry is too large or too small.
        let misfit = |i: usize, j: usize| (matrix[i][j] * q[j] / q[i]).max(q[i] / (q[j] * matrix[i][j]));
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        let (i, j) = pairs.max_by(|a, b| misfit(a.0, a.1).total_cmp(&misfit(b.0, b.1))).unwrap_or_default();
        return Err(format!(
            "the judgments contradict each other: consistency ratio {ratio:.3} (lambda_max {lambda_max:.4}), at most \
             {MAX_RATIO:.2} is accepted; row {}, column {} fits worst: {:.3}, where the weights ask for {:.2}",
            i + 1,
            j + 1,
            matrix[i][j],
            q[i] / q[j]
        ));
    }
    Ok(found)
}

/// Computes the weights, whether or not the judgments are consistent.
fn evaluate(matrix: &[Vec<f64>]) -> Weights {
    let n = matrix.len();
    let q = principal_eigenvector(matrix);
    let lambda_max = multiply(matrix, &q).iter().zip(&q).map(|(t, q)| t / q).sum::<f64>() / n as f64;
    // Rounding may make lambda_max of consistent judgments slightly less than n.
    let index = if n > 1 { ((lambda_max - n as f64) / (n as f64 - 1.0)).max(0.0) } else { 0.0 };
    let ratio = if n > 2 { index / RANDOM_INDEX[n - 1] } else { 0.0 };
    Weights { weights: q, lambda_max, index, ratio }
}

fn check(matrix: &[Vec<f64>]) -> Result<(), String> {
    let n = matrix.len();
    if !(1..=RANDOM_INDEX.len()).contains(&n) {
        return Err(format!("a judgment matrix compares 1 to 10 features, this one {n}"));
    }
    if let Some(row) = matrix.iter().position(|row| row.len() != n) {
        return Err(format!("row {} of the judgment matrix has {} entries, expected {n}", row + 1, matrix[row].len()));
    }
    for (i, row) in matrix.iter().enumerate() {
        for (j, &value) in row.iter().enumerate() {
            let (row, column) = (i + 1, j + 1);
            let slack = 1.0 + RECIPROCAL_SLACK;
            if !(1.0 / (9.0 * slack)..=9.0 * slack).contains(&value) {
                return Err(format!("the judgment in row {row}, column {column} is {value}, expected 1/9 to 9"));
            }
        }
    }
    for (i, row) in matrix.iter().enumerate() {
        for (j, &value) in row.iter().enumerate().skip(i) {
            let other = matrix[j][i];
            if (value * other - 1.0).abs() > RECIPROCAL_SLACK {
                let (row, column) = (i + 1, j + 1);
                return Err(format!(
                    "the judgments in row {row}, column {column} and row {column}, column {row} are {value} and {other}, \
                     expected reciprocals (and 1 on the diagonal)"
                ));
            }
        }
    }
    Ok(())
}

fn multiply(matrix: &[Vec<f64>], q: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| row.iter().zip(q).map(|(t, q)| t * q).sum()).collect()
}

/// Power iteration. A positive matrix has a single eigenvalue of largest magnitude, with a positive eigenvector, so the
/// iteration converges from any positive start. Judgments are between 1/9 and 9, so a few dozen steps are enough.
fn principal_eigenvector(matrix: &[Vec<f64>]) -> Vec<f64> {
    let mut q = vec![1.0 / matrix.len() as f64; matrix.len()];
    for _ in 0..1000 {
        let product = multiply(matrix, &q);
        let sum: f64 = product.iter().sum();
        let next: Vec<f64> = product.iter().map(|v| v / sum).collect();
        let change = next.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        q = next;
        if change < 1e-16 {
            break;
        }
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ride matrix, which gives Table 4, in the order of equation 24.
    fn ride() -> Vec<Vec<f64>> {
        vec![
            vec![1.0, 4.0, 4.0, 4.0, 7.0, 7.0],
            vec![0.25, 1.0, 0.5, 0.5, 2.0, 2.0],
            vec![0.25, 2.0, 1.0, 1.0, 3.0, 3.0],
            vec![0.25, 2.0, 1.0, 1.0, 3.0, 3.0],
            vec![1.0 / 7.0, 0.5, 1.0 / 3.0, 1.0 / 3.0, 1.0, 1.0],
            vec![1.0 / 7.0, 0.5, 1.0 / 3.0, 1.0 / 3.0, 1.0, 1.0],
        ]
    }

    /// Reference: the results of another program's eigenvalue solver, printed with four digits. The tolerance is half a
    /// unit in the last digit.
    #[test]
    fn the_ride_matrix() {
        let w = weights(&ride()).unwrap();
        for (found, expected) in w.weights.iter().zip([0.4772, 0.0978, 0.1579, 0.1579, 0.0546, 0.0546]) {
            assert!((found - expected).abs() < 5e-5, "{found} {expected}");
        }
        assert!((w.lambda_max - 6.0697).abs() < 5e-5);
        assert!((w.index - 0.01395).abs() < 5e-6);
        assert!((w.ratio - 0.0112).abs() < 5e-5);
    }

    /// The weights, multiplied by the scale factors of equation 25, agree with Table 4 (ride) within the paper's
    /// rounding, 0.2 % of the largest weight.
    #[test]
    fn the_ride_weights_are_those_of_table_4() {
        let gamma = [1.0, 0.6079, 826.56, 13_225.0, 184_819.6, 9_184.0];
        // The printed tau_4 lacks its decimal point; the value is 2100.00.
        let table_4 = [0.48, 0.06, 131.3, 2100.0, 9777.0, 485.8];
        let w = weights(&ride()).unwrap();
        for i in 0..6 {
            assert!((w.weights[i] - table_4[i] / gamma[i]).abs() < 0.003, "{i}");
        }
    }

    /// Consistent judgments are ratios of weights. The method returns these weights, and lambda_max is the order of the
    /// matrix, both up to rounding.
    #[test]
    fn consistent_judgments_give_their_weights_back() {
        let expected = [0.6, 0.3, 0.1];
        let matrix: Vec<Vec<f64>> = expected.iter().map(|a| expected.iter().map(|b| a / b).collect()).collect();
        let w = weights(&matrix).unwrap();
        for (found, expected) in w.weights.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15);
        }
        assert!((w.lambda_max - 3.0).abs() < 1e-14 && w.ratio < 1e-14);
    }

    /// Two judgments cannot contradict each other.
    #[test]
    fn one_and_two_features() {
        assert_eq!(weights(&[vec![1.0]]).unwrap().weights, [1.0]);
        let w = weights(&[vec![1.0, 3.0], vec![1.0 / 3.0, 1.0]]).unwrap();
        assert!((w.weights[0] - 0.75).abs() < 1e-15 && w.ratio == 0.0);
    }

    /// The judgments a > b > c > a are rejected. The message contains the consistency ratio and the worst entry.
    #[test]
    fn contradictory_judgments_are_rejected() {
        let circle = [vec![1.0, 5.0, 0.2], vec![0.2, 1.0, 5.0], vec![5.0, 0.2, 1.0]];
        // By symmetry the weights are equal and lambda_max is the sum of a row.
        let Weights { ratio, lambda_max, .. } = evaluate(&circle);
        assert!((lambda_max - 6.2).abs() < 1e-12 && (ratio - 1.6 / 0.58).abs() < 1e-12);
        let text = weights(&circle).unwrap_err();
        assert!(text.contains("ratio 2.759") && text.contains("at most 0.10"), "{text}");
    }

    #[test]
    fn what_is_no_judgment_matrix_is_rejected() {
        for (matrix, expected) in [
            (vec![], "compares 1 to 10 features, this one 0"),
            (vec![vec![1.0]; 11], "this one 11"),
            (vec![vec![1.0, 2.0], vec![0.5]], "row 2 of the judgment matrix has 1 entries, expected 2"),
            (vec![vec![1.0, 10.0], vec![0.1, 1.0]], "row 1, column 2 is 10, expected 1/9 to 9"),
            (vec![vec![1.0, -2.0], vec![-0.5, 1.0]], "row 1, column 2 is -2"),
            (vec![vec![1.0, f64::NAN], vec![0.5, 1.0]], "is NaN"),
            (vec![vec![1.0, 2.0], vec![2.0, 1.0]], "are 2 and 2, expected reciprocals"),
            (vec![vec![2.0]], "row 1, column 1 and row 1, column 1 are 2 and 2"),
        ] {
            let error = weights(&matrix).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
