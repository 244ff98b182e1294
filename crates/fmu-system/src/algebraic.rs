//! Solves algebraic loops: systems of equations z = G(z) whose right-hand side is evaluated by FMUs.
//!
//! Fixed-point iteration comes first, because it ends loops that exist only where an FMU does not declare on which
//! inputs its outputs depend. All others are solved with Newton's method.

use nalgebra::{DMatrix, DVector};

/// Largest residual of a solution, relative to the larger one of value and nominal value.
const TOLERANCE: f64 = 1e-9;
/// Maximum condition number of a Jacobian from derivatives, and of one from differences, whose rounding errors are about
/// 1e-10. Above it, the Jacobian is singular.
const MAX_CONDITION: [f64; 2] = [1e12, 1e10];
/// Step of central differences, relative to the larger one of value and nominal value.
const DIFFERENCE: f64 = 1e-6;
const FIXED_POINT_ITERATIONS: usize = 5;
const NEWTON_ITERATIONS: usize = 50;
const HALVINGS: i32 = 8;

/// The equations z = G(z).
pub trait Equations {
    /// Error of the evaluation.
    type Error;

    /// Returns G(z).
    ///
    /// # Errors
    /// It cannot be evaluated.
    fn evaluate(&mut self, z: &[f64]) -> Result<Vec<f64>, Self::Error>;

    /// Returns dG/dz at the last z, by columns: `[j][i]` is dG_i/dz_j. `None` if it is only known by differences.
    ///
    /// # Errors
    /// It cannot be evaluated.
    fn derivatives(&mut self) -> Result<Option<Vec<Vec<f64>>>, Self::Error>;
}

/// Error of [`solve`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unsolved<E> {
    /// No solution was found.
    #[error("no solution ({reason}); residual {residual} after {iterations} fixed-point iterations")]
    NoSolution {
        /// `singular Jacobian` or `no convergence`.
        reason: &'static str,
        /// Largest residual in nominal values after the fixed-point iteration.
        residual: f64,
        /// Number of fixed-point iterations.
        iterations: usize,
    },
    /// The equations could not be evaluated.
    #[error(transparent)]
    Evaluation(#[from] E),
}

/// Returns the solution that is reached from `start`: a fixed-point iteration, then Newton's method with a step that is
/// halved until the residual falls. `nominal` has the magnitudes of the unknowns, above 0.
///
/// # Errors
/// The iteration does not converge, the Jacobian is singular, or the equations cannot be evaluated.
pub fn solve<S: Equations>(equations: &mut S, start: &[f64], nominal: &[f64]) -> Result<Vec<f64>, Unsolved<S::Error>> {
    let scale = |z: &[f64], i: usize| z[i].abs().max(nominal[i]);
    let largest = |g: &[f64], z: &[f64], scale: &dyn Fn(usize) -> f64| {
        (0..z.len())
            .map(|i| (g[i] - z[i]).abs() / scale(i))
            .fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a })
    };
    let is_solved = |g: &[f64], z: &[f64]| largest(g, z, &|i| scale(z, i)) <= TOLERANCE;
    let residual = |g: &[f64], z: &[f64]| largest(g, z, &|i| nominal[i]);

    let mut z = start.to_vec();
    let mut remaining = f64::NAN;
    for _ in 0..FIXED_POINT_ITERATIONS {
        let g = equations.evaluate(&z)?;
        if is_solved(&g, &z) {
            return Ok(z);
        }
        remaining = residual(&g, &z);
        z = g;
    }
    let none = |reason| Unsolved::NoSolution { reason, residual: remaining, iterations: FIXED_POINT_ITERATIONS };
    let singular = || none("singular Jacobian");

    z = start.to_vec();
    let mut g = equations.evaluate(&z)?;
    for iteration in 0..NEWTON_ITERATIONS {
        if is_solved(&g, &z) {
            return Ok(z);
        }
        let (columns, condition) = match equations.derivatives()? {
            Some(columns) => (columns, MAX_CONDITION[0]),
            None => (differences(equations, &z, |i| DIFFERENCE * scale(&z, i))?, MAX_CONDITION[1]),
        };
        let size = z.len();
        let matrix = DMatrix::from_fn(size, size, |i, j| f64::from(u8::from(i == j)) - columns[j][i]);
        let defect = DVector::from_fn(size, |i, _| g[i] - z[i]);
        if !matrix.iter().chain(defect.iter()).all(|value| value.is_finite()) {
            return Err(singular());
        }
        let decomposed = matrix.svd(true, true);
        let (most, least) = (decomposed.singular_values.max(), decomposed.singular_values.min());
        if least * condition <= most {
            // Later on, the iteration has come to a point from which the residual does not fall.
            return Err(if iteration == 0 { singular() } else { none("no convergence") });
        }
        let Ok(change) = decomposed.solve(&defect, 0.0) else { return Err(singular()) };
        let before = residual(&g, &z);
        let mut trial = None;
        for halving in 0..=HALVINGS {
            let next: Vec<f64> = (0..size).map(|i| z[i] + change[i] * 0.5_f64.powi(halving)).collect();
            let found = equations.evaluate(&next)?;
            if residual(&found, &next) < before {
                trial = Some((next, found));
                break;
            }
        }
        let Some(better) = trial else { return Err(none("no convergence")) };
        (z, g) = better;
    }
    if is_solved(&g, &z) { Ok(z) } else { Err(none("no convergence")) }
}

/// dG/dz by central differences with these steps, by columns.
fn differences<S: Equations>(
    equations: &mut S,
    z: &[f64],
    step: impl Fn(usize) -> f64,
) -> Result<Vec<Vec<f64>>, S::Error> {
    let column = |j: usize| {
        let mut at = |sign: f64| {
            let mut moved = z.to_vec();
            moved[j] += sign * step(j);
            Ok((moved[j], equations.evaluate(&moved)?))
        };
        let ((above, more), (below, less)) = (at(1.0)?, at(-1.0)?);
        Ok(more.iter().zip(less).map(|(more, less)| (more - less) / (above - below)).collect())
    };
    (0..z.len()).map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    struct Functions(fn(f64) -> f64, fn(f64) -> f64);

    impl Equations for Functions {
        type Error = Infallible;

        fn evaluate(&mut self, z: &[f64]) -> Result<Vec<f64>, Infallible> {
            Ok(vec![self.0(z[1]), self.1(z[0])])
        }

        fn derivatives(&mut self) -> Result<Option<Vec<Vec<f64>>>, Infallible> {
            Ok(None)
        }
    }

    fn solution(a: fn(f64) -> f64, b: fn(f64) -> f64) -> Result<f64, &'static str> {
        match solve(&mut Functions(a, b), &[0.0, 0.0], &[1.0, 1.0]) {
            Ok(z) => Ok(z[0]),
            Err(Unsolved::NoSolution { reason, residual, iterations: 5 }) => {
                assert_ne!(residual, 0.0);
                Err(reason)
            }
            Err(other) => panic!("{other:?}"),
        }
    }

    /// Two functions in a loop. The solutions are closed forms, or 16 digits of another solver; the tolerance is that of
    /// the solution, and a margin for the distance of the two functions.
    #[test]
    fn loops_have_their_closed_forms() {
        let same = |u| u;
        for (a, b, expected) in [
            ((|u| 0.5 * u + 1.0) as fn(f64) -> f64, same as fn(f64) -> f64, 2.0),
            (|u| -3.0 * u + 4.0, same, 1.0),
            (|u| 2.0 - 0.5 * u * u * u, |u| 1.2 * u, 1.036_868_969_729_86),
            (libm::cos, same, 0.739_085_133_215_161),
            // Not a loop: fixed-point iteration ends with the exact value.
            (|_| 3.0, |u| 2.0 * u, 3.0),
        ] {
            let found = solution(a, b).unwrap();
            assert!((found - expected).abs() <= 1e-8 * expected, "{found}, not {expected}");
        }
        assert_eq!(solution(|u| u + 1.0, same), Err("singular Jacobian"));
        assert_eq!(solution(|u| u * u + 1.0, same), Err("no convergence"));
        assert_eq!(solution(|u| libm::sqrt(u - 1.0), same), Err("singular Jacobian"));
    }
}
