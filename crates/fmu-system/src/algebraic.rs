//! Solves algebraic loops: systems of equations z = G(z) whose right-hand side is evaluated by FMUs.
//!
//! Fixed-point iteration comes first, because it ends loops that exist only where an FMU does not declare on which
//! inputs its outputs depend. All others are solved with Newton's method.

use crate::typography::significant;
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};

/// Largest residual of a solution, relative to the larger one of value and nominal value.
const TOLERANCE: f64 = 1e-9;
/// Maximum condition number of a Jacobian from derivatives, and of one from differences, whose rounding errors are about
/// 1e-10. Above it, the Jacobian is singular.
const MAX_CONDITION: [f64; 2] = [1e12, 1e10];
/// Step of central differences, relative to the larger one of value and nominal value.
const DIFFERENCE: f64 = 1e-6;
/// Assumed rounding errors of G, relative to its values.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
const FIXED_POINT_ITERATIONS: usize = 5;
const NEWTON_ITERATIONS: usize = 50;
const HALVINGS: i32 = 8;
const SINGULAR: &str = "has no solution (singular Jacobian)";
const NO_CONVERGENCE: &str = "has no solution (no convergence)";
/// Maximum number of unknowns.
pub(crate) const MAX_UNKNOWNS: usize = 1000;

/// The equations z = G(z).
pub trait Equations {
    /// Error of the evaluation.
    type Error;

    /// Returns G(z), NaN where it is not defined.
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
    #[error("{problem}: {detail}")]
    NoSolution {
        /// `has no solution (REASON)`.
        problem: &'static str,
        /// Largest residual in nominal values after the fixed-point iteration, in words.
        detail: String,
    },
    /// The equations could not be evaluated.
    #[error(transparent)]
    Evaluation(#[from] E),
}

/// Returns the solution that is reached from `start`: a fixed-point iteration, then Newton's method with a step that is
/// halved until the residual falls. A last step follows a solution by Newton's method, because the error can be larger
/// than the residual. `nominal` has the magnitudes of the unknowns, above 0.
///
/// # Errors
/// The iteration does not converge, the Jacobian is singular, or the equations cannot be evaluated.
pub fn solve<S: Equations>(equations: &mut S, start: &[f64], nominal: &[f64]) -> Result<Vec<f64>, Unsolved<S::Error>> {
    let scales = |z: &[f64]| -> Vec<f64> { z.iter().zip(nominal).map(|(z, nominal)| z.abs().max(*nominal)).collect() };
    let largest = |g: &[f64], z: &[f64], scale: &[f64]| {
        (0..z.len())
            .map(|i| (g[i] - z[i]).abs() / scale[i])
            .fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a })
    };
    let is_solved = |g: &[f64], z: &[f64]| largest(g, z, &scales(z)) <= TOLERANCE;
    let residual = |g: &[f64], z: &[f64]| largest(g, z, nominal);

    let mut z = start.to_vec();
    let mut remaining = f64::NAN;
    for _ in 0..FIXED_POINT_ITERATIONS {
        let g = equations.evaluate(&z)?;
        if is_solved(&g, &z) {
            return Ok(z);
        }
        let now = residual(&g, &z);
        if !now.is_finite() {
            break;
        }
        (remaining, z) = (now, g);
    }

    z = start.to_vec();
    let mut g = equations.evaluate(&z)?;
    // Rounding errors can make a singular Jacobian invertible. Its steps lead far away, where the residual is small
    // relative to the values, so that the end of the iteration is a solution only if a Jacobian was regular.
    let mut is_regular = false;
    for _ in 0..=NEWTON_ITERATIONS {
        let (is_solved, before) = (is_solved(&g, &z), residual(&g, &z));
        if before == 0.0 {
            return Ok(z);
        }
        let mut trial = None;
        if let Some((step, is_certain)) = newton_step(equations, &z, &g, &scales(&z))? {
            is_regular |= is_certain;
            for halving in 0..=HALVINGS {
                let next: Vec<f64> = z.iter().zip(&step).map(|(z, step)| z + step * 0.5_f64.powi(halving)).collect();
                let found = equations.evaluate(&next)?;
                if residual(&found, &next) < before {
                    trial = Some((next, found));
                    break;
                }
            }
        }
        match trial {
            better if is_solved && is_regular => return Ok(better.map_or(z, |(next, _)| next)),
            Some(better) => (z, g) = better,
            None => break,
        }
    }
    let problem = if is_regular { NO_CONVERGENCE } else { SINGULAR };
    let found = match remaining.is_finite() {
        true => format!("residual {}", significant(remaining, 6)),
        false => "values that are not finite".to_owned(),
    };
    let detail = format!("{found} after {FIXED_POINT_ITERATIONS} fixed-point iterations");
    Err(Unsolved::NoSolution { problem, detail })
}

/// Returns the step of Newton's method, and true if the rounding errors of the Jacobian do not make it singular; `None`
/// for a singular Jacobian. The result does not depend on the units of the unknowns.
fn newton_step<S: Equations>(
    equations: &mut S,
    z: &[f64],
    g: &[f64],
    scale: &[f64],
) -> Result<Option<(Vec<f64>, bool)>, S::Error> {
    let (columns, max_condition, rounding) = match equations.derivatives()? {
        Some(columns) => (columns, MAX_CONDITION[0], 0.0),
        None => (differences(equations, z, |i| DIFFERENCE * scale[i])?, MAX_CONDITION[1], ROUNDING),
    };
    let size = z.len();
    let entry = |i: usize, j: usize| (f64::from(u8::from(i == j)) - columns[j][i]) * scale[j] / scale[i];
    let mut matrix = DMatrix::from_fn(size, size, entry);
    let defect = DVector::from_fn(size, |i, _| (g[i] - z[i]) / scale[i]);
    if !(matrix.norm_squared() + defect.norm_squared()).is_finite() {
        return Ok(None);
    }
    let balance = balance_parlett_reinsch(&mut matrix);
    let decomposed = matrix.svd(true, true);
    let (most, least) = (decomposed.singular_values.max(), decomposed.singular_values.min());
    if least * max_condition <= most {
        return Ok(None);
    }
    let error = rounding * DVector::from_fn(size, |i, _| g[i] / scale[i]).component_div(&balance).norm();
    let is_certain = least > error * balance.norm() / DIFFERENCE;
    let step = decomposed.solve(&defect.component_div(&balance), 0.0);
    Ok(step.ok().map(|step| ((0..size).map(|i| step[i] * balance[i] * scale[i]).collect(), is_certain)))
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
            Err(Unsolved::NoSolution { problem, .. }) => Err(problem),
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
        for (a, problem) in [
            ((|u| u + 1.0) as fn(f64) -> f64, SINGULAR),
            // Differences have errors of 6e-8 and 4e-10.
            (|u| u + 1000.0, SINGULAR),
            (|u| u + 6.0, SINGULAR),
            (|u| u * u + 1.0, NO_CONVERGENCE),
            (|u| libm::sqrt(u - 1.0), SINGULAR),
            (|u| 1e200 * u + 1.0, SINGULAR),
        ] {
            assert_eq!(solution(a, same), Err(problem));
        }
    }

    /// The error of a solution is its residual divided by 1 - 0.9999.
    #[test]
    fn ill_conditioned_loops_are_solved_accurately() {
        for (a, offset) in [
            ((|u| 0.9999 * u + 1.0) as fn(f64) -> f64, 1.0),
            (|u| 0.9999 * u + 1e-3, 1e-3),
            (|u| 0.9999 * u + 1e5, 1e5),
        ] {
            let (found, expected) = (solution(a, |u| u).unwrap(), offset / (1.0 - 0.9999));
            assert!((found - expected).abs() <= 1e-11 * expected, "{found}, not {expected}");
        }
    }

    /// Unknowns of 1e6 and 3e-6: the equations are those of 1 and 1 in other units. The tolerance depends on the nominal
    /// values, the regularity does not.
    #[test]
    fn units_of_unknowns_make_no_loop_singular() {
        let mut functions = Functions(|u| 1.65e11 * u + 5e5, |u| 1.5e-12 * u + 1.5e-6);
        let expected = (1.65e11 * 1.5e-6 + 5e5) / (1.0 - 1.65e11 * 1.5e-12);
        for (nominal, tolerance) in [([1e6, 1e-6], 1e-8), ([1.0, 1.0], 1e-4)] {
            let found = solve(&mut functions, &[0.0, 0.0], &nominal).unwrap()[0];
            assert!((found - expected).abs() <= tolerance * expected, "{found}, not {expected}");
        }
        assert_eq!(solution(|u| 1e12 * u + 1e6, |u| 1e-12 * u), Err(SINGULAR));
    }
}
