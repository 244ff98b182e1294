//! Linear quadratic regulators: the continuous algebraic Riccati equation with cross term.
//!
//! For the plant `dx/dt = A x + B u` the feedback that minimizes
//!
//! ```text
//! J = integral over t from 0 to infinity of (x'Q x + 2 x'N u + u'R u) dt
//! ```
//!
//! is `u = -K x` with
//!
//! ```text
//! A'P + P A - (P B + N) R^-1 (B'P + N') + Q = 0,    P symmetric, A - B K stable
//! K = R^-1 (B'P + N')
//! ```
//!
//! [`care`] solves this equation, [`lqr_output_weighted`] solves it for a cost on outputs. Both allocate and take about
//! a millisecond for 20 states: call them at initialization, not in a sample.
//!
//! # Method
//!
//! 1. Inputs are scaled so that R has a unit diagonal; its Cholesky factor removes R and N:
//!    `A <- A - B R^-1 N'`, `Q <- Q - N R^-1 N'`, `G = B R^-1 B'`.
//! 2. States are scaled by powers of 2 so that the rows and columns of the Hamiltonian matrix
//!    `[A, -G; -Q, -A']` have similar norms. The result then hardly depends on the units of the
//!    states and inputs.
//! 3. Structure-preserving doubling (Chu, Fan and Lin) starts from a Cayley transform. Its shift is near the geometric
//!    mean of the smallest and largest modulus of the Hamiltonian's eigenvalues. Every iterate is kept symmetric. The
//!    iteration converges quadratically, usually within 10 steps.
//! 4. One step of Newton's method (Kleinman) removes the rounding errors of the doubling.
//! 5. The residual and the closed-loop poles are computed and checked.
//!
//! # Solvable problems
//!
//! A solution is found if R is positive definite, (A, B) is stabilizable, the Hamiltonian matrix has no eigenvalue on
//! the imaginary axis, and the cost depends on every unstable mode of `A - B R^-1 N'`. If the cost ignores an unstable
//! mode, a solution exists, but doubling does not find it: add a weight for that mode. A stabilizing solution does not
//! exist if (A, B) is not stabilizable or an eigenvalue is on the imaginary axis. All three cases end in the error "no
//! convergence".
//!
//! Badly conditioned problems (many unstable modes with one input, long chains of integrators) end in an error about
//! the residual or the poles, not in a wrong gain.
//!
//! # References
//!
//! * E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, "A structure-preserving doubling algorithm for
//!   continuous-time algebraic Riccati equations", Linear Algebra and its Applications 396, 2005,
//!   55-80, doi:10.1016/j.laa.2004.10.010.
//! * D. L. Kleinman, "On an iterative technique for Riccati equation computations", IEEE
//!   Transactions on Automatic Control 13(1), 1968, 114-115, doi:10.1109/TAC.1968.1098829.
//! * B. D. O. Anderson, J. B. Moore, *Optimal Control: Linear Quadratic Methods*, Dover, 2007,
//!   ISBN 0-486-45766-4 (the regulator, its existence, the cross term).

use fmu::math;
pub use fmu_math::eigenvalues;
use nalgebra::{Complex, DMatrix, DVector};

/// Largest accepted relative residual of the Riccati equation.
pub const MAX_RESIDUAL: f64 = 1e-10;

/// Largest number of doubling steps. Without an eigenvalue on the imaginary axis, every step squares the error: 26
/// steps reach rounding level even if a pole is a million times nearer to the axis than the shift. With such an
/// eigenvalue, every step only halves the error. Rounding errors move the eigenvalue off the axis by the square root of
/// their size; 26 steps end before this makes the iteration converge.
const MAX_DOUBLINGS: usize = 26;

const NOT_POSITIVE_DEFINITE: &str = "Riccati design: the weight R of the inputs is not positive definite";
const NO_CONVERGENCE: &str = "Riccati design: no convergence; (A, B) is not stabilizable, the Hamiltonian matrix has \
                              eigenvalues on the imaginary axis, or the cost ignores an unstable mode";

/// A linear quadratic regulator.
#[derive(Clone, Debug, PartialEq)]
pub struct Regulator {
    /// P, the symmetric solution of the Riccati equation; `x'P x` is the cost that starts at the state x (n x n).
    pub p: DMatrix<f64>,
    /// K in the feedback `u = -K x`, in units of u per units of x (m x n).
    pub gain: DMatrix<f64>,
    /// Frobenius norm of the equation's left side, divided by the sum of the norms of its terms, in scaled coordinates;
    /// at most [`MAX_RESIDUAL`].
    pub residual: f64,
    /// Eigenvalues of `A - B K` in 1/s, all with negative real part, slowest (largest real part)
    /// first.
    pub poles: Vec<Complex<f64>>,
}

/// Finds the stabilizing solution of the Riccati equation in the [module](self).
///
/// * `a`: A, n x n, n >= 1, in 1/s times the units of the states.
/// * `b`: B, n x m, m >= 1.
/// * `q`: Q, n x n; only its symmetric part is used.
/// * `r`: R, m x m, positive definite; only its symmetric part is used.
/// * `n`: N, n x m; zero if the cost has no cross term.
///
/// Q need not be positive semidefinite, as long as the equation has a stabilizing solution.
///
/// # Errors
///
/// The sizes do not match, an element is infinite or NaN, R is not positive definite (up to rounding), no solution is
/// found (see the [module](self)), or the result fails its checks.
///
/// # Example
///
/// Double integrator, Q = I, R = 1: K = [1, sqrt 3].
///
/// ```
/// use chassis_control::riccati::care;
/// use nalgebra::{dmatrix, DMatrix};
/// let regulator = care(
///     &dmatrix![0.0, 1.0; 0.0, 0.0],
///     &dmatrix![0.0; 1.0],
///     &DMatrix::identity(2, 2),
///     &dmatrix![1.0],
///     &DMatrix::zeros(2, 1),
/// )?;
/// assert!((regulator.gain - dmatrix![1.0, 3.0_f64.sqrt()]).amax() < 1e-12);
/// # Ok::<(), String>(())
/// ```
pub fn care(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    n: &DMatrix<f64>,
) -> Result<Regulator, String> {
    let (states, inputs) = (a.nrows().max(1), b.ncols().max(1));
    check("A", a, states, states)?;
    check("B", b, states, inputs)?;
    check("Q", q, states, states)?;
    check("R", r, inputs, inputs)?;
    check("N", n, states, inputs)?;

    // The diagonal of S R S is 1 up to a factor of 2; u = S u_scaled.
    let diagonal = r.diagonal();
    if diagonal.iter().any(|&x| x <= 0.0) {
        return Err(NOT_POSITIVE_DEFINITE.to_owned());
    }
    let input_scale = diagonal.map(|x| power_of_two(x.sqrt().recip()));
    let scaled_r =
        DMatrix::from_fn(inputs, inputs, |i, j| input_scale[i] * symmetric_element(r, i, j) * input_scale[j]);
    let factor = scaled_r
        .cholesky()
        .map(|cholesky| cholesky.unpack())
        .filter(|l| l.diagonal().min().powi(2) > inputs as f64 * f64::EPSILON)
        .ok_or(NOT_POSITIVE_DEFINITE)?;

    // With R = L L': the transposes of B L^-T and N L^-T.
    let whitened = |m: &DMatrix<f64>| {
        let scaled = DMatrix::from_diagonal(&input_scale) * m.transpose();
        factor.solve_lower_triangular(&scaled)
    };
    let b_rows = whitened(b).ok_or(NOT_POSITIVE_DEFINITE)?;
    let n_rows = whitened(n).ok_or(NOT_POSITIVE_DEFINITE)?;
    let mut equation = Equation {
        a: a - b_rows.tr_mul(&n_rows),
        g: symmetric(b_rows.tr_mul(&b_rows)),
        q: symmetric(q - n_rows.tr_mul(&n_rows)),
    };

    let state_scale = equation.balance();
    let mut p = equation.solve().ok_or(NO_CONVERGENCE)?;
    // Newton's method: the correction solves a Lyapunov equation, a Riccati equation without quadratic term.
    let correction =
        Equation { a: equation.closed_loop(&p), g: DMatrix::zeros(states, states), q: equation.residual(&p) };
    p += correction.solve().ok_or(NO_CONVERGENCE)?;

    let residual = equation.relative_residual(&p);
    let poles = eigenvalues(&equation.closed_loop(&p)).ok_or(NO_CONVERGENCE)?;
    accept(residual, &poles)?;

    // x = D x_scaled, hence P = D^-1 P_scaled D^-1.
    let unscale = state_scale.map(f64::recip);
    let p = DMatrix::from_fn(states, states, |i, j| unscale[i] * p[(i, j)] * unscale[j]);
    let gain = factor.tr_solve_lower_triangular(&(b_rows * &p + n_rows)).ok_or(NOT_POSITIVE_DEFINITE)?;
    let gain = DMatrix::from_diagonal(&input_scale) * gain;
    Ok(Regulator { p, gain, residual, poles })
}

/// Linear quadratic regulator for a cost on outputs `y = D x + E u` and on the inputs:
///
/// ```text
/// J = integral of (y'Q0 y + u'R0 u) dt
/// Q = D'Q0 D,   N = D'Q0 E,   R = E'Q0 E + R0
/// ```
///
/// With Bryson's rule, Q0 and R0 are diagonal with the elements `1 / (largest accepted value)^2`.
///
/// * `a`, `b`: A (n x n) and B (n x m) of the plant.
/// * `d`, `e`: D (p x n) and E (p x m) of the outputs.
/// * `q0`: weight of the outputs, p x p; only its symmetric part is used.
/// * `r0`: weight of the inputs, m x m; only its symmetric part is used. It can be zero if `E'Q0 E` alone is positive
///   definite.
///
/// # Errors
///
/// As in [`care`], with the names D, E, Q0, R0 for wrong sizes.
pub fn lqr_output_weighted(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    d: &DMatrix<f64>,
    e: &DMatrix<f64>,
    q0: &DMatrix<f64>,
    r0: &DMatrix<f64>,
) -> Result<Regulator, String> {
    let (states, inputs, outputs) = (a.nrows(), b.ncols(), d.nrows());
    check("D", d, outputs, states)?;
    check("E", e, outputs, inputs)?;
    check("Q0", q0, outputs, outputs)?;
    check("R0", r0, inputs, inputs)?;
    let q0 = symmetric(q0.clone());
    let weighted_e = &q0 * e;
    let q = d.tr_mul(&(q0 * d));
    let n = d.tr_mul(&weighted_e);
    let r = e.tr_mul(&weighted_e) + r0;
    care(a, b, &q, &r, &n)
}

/// The equation `A'X + X A - X G X + Q = 0` with symmetric G and Q.
struct Equation {
    a: DMatrix<f64>,
    g: DMatrix<f64>,
    q: DMatrix<f64>,
}

impl Equation {
    /// Scales the states, x = D x_scaled, by powers of 2 so that the norms of row i of [A, G] and column i of [A; Q]
    /// differ by at most a factor of 2. Returns the diagonal of D.
    ///
    /// This is the balancing of Parlett and Reinsch, restricted to scalings that keep the matrix Hamiltonian.
    fn balance(&mut self) -> DVector<f64> {
        let states = self.a.nrows();
        let mut scale = DVector::from_element(states, 1.0);
        // Usually 3 to 5 sweeps; the bound only prevents an endless loop.
        for _ in 0..50 {
            let mut changed = false;
            for i in 0..states {
                let own = self.a[(i, i)] * self.a[(i, i)];
                let row = self.a.row(i).norm_squared() - own + self.g.row(i).norm_squared();
                let column = self.a.column(i).norm_squared() - own + self.q.row(i).norm_squared();
                if !(row > 0.0 && column > 0.0) {
                    continue;
                }
                let factor = power_of_two((row / column).sqrt().sqrt());
                if factor == 1.0 || !factor.is_normal() {
                    continue;
                }
                changed = true;
                scale[i] *= factor;
                self.a.row_mut(i).unscale_mut(factor);
                self.a.column_mut(i).scale_mut(factor);
                self.g.row_mut(i).unscale_mut(factor);
                self.g.column_mut(i).unscale_mut(factor);
                self.q.row_mut(i).scale_mut(factor);
                self.q.column_mut(i).scale_mut(factor);
            }
            if !changed {
                break;
            }
        }
        scale
    }

    /// The matrix `[A, -G; -Q, -A']`.
    fn hamiltonian(&self) -> DMatrix<f64> {
        let n = self.a.nrows();
        let mut h = DMatrix::zeros(2 * n, 2 * n);
        h.view_mut((0, 0), (n, n)).copy_from(&self.a);
        h.view_mut((0, n), (n, n)).copy_from(&-&self.g);
        h.view_mut((n, 0), (n, n)).copy_from(&-&self.q);
        h.view_mut((n, n), (n, n)).copy_from(&-self.a.transpose());
        h
    }

    /// The stabilizing solution by structure-preserving doubling; None if it does not converge.
    fn solve(&self) -> Option<DMatrix<f64>> {
        let states = self.a.nrows();
        let (mut a, mut g, mut h) = self.cayley()?;
        for _ in 0..MAX_DOUBLINGS {
            // With W = I + G H:  A <- A W^-1 A,  G <- G + A W^-1 G A',  H <- H + A'H W^-1 A.
            let w = (DMatrix::identity(states, states) + &g * &h).lu();
            let w_a = w.solve(&a)?;
            let w_g = w.solve(&g)?;
            let step = symmetric(a.tr_mul(&(&h * &w_a)));
            g = symmetric(g + &a * w_g * a.transpose());
            h += &step;
            a = &a * w_a;
            // A is the transition matrix of the closed loop over 2^k steps. If A vanishes, so does the next change to
            // H, which is of second order in A. A small change to H alone is not enough: it could also mean that the
            // cost ignores an unstable mode.
            let rounding = 10.0 * states as f64 * f64::EPSILON;
            if step.norm() <= rounding * h.norm() && a.norm() <= f64::EPSILON.sqrt() {
                return Some(h);
            }
            if !(a.norm().is_finite() && g.norm().is_finite() && h.norm().is_finite()) {
                return None;
            }
        }
        None
    }

    /// Start of the doubling: a Cayley transform gives A, G, H of the discrete-time equation with the same solution.
    fn cayley(&self) -> Option<(DMatrix<f64>, DMatrix<f64>, DMatrix<f64>)> {
        let n = self.a.nrows();
        let hamiltonian = self.hamiltonian();
        let moduli = eigenvalues(&hamiltonian)?.into_iter().map(|z| math::hypot(z.re, z.im));
        let (slowest, fastest) = moduli.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        // An eigenvalue 0 must not make the shift 0. With such an eigenvalue, the equation has no solution, which the
        // doubling detects.
        let shift = (slowest.max(1e-12 * fastest) * fastest).sqrt();
        let shift = if shift > 0.0 { shift } else { 1.0 };

        // M = [A - s I, G; -Q, A' - s I] is the Hamiltonian matrix with the sign of its right half changed, minus s I.
        // M^-1 contains all three matrices. M is singular for some values of s, so the best conditioned of three shifts
        // is used.
        let inverse = [1.0, 1.25, 0.8]
            .into_iter()
            .filter_map(|factor| {
                let shift = shift * factor;
                let mut m = hamiltonian.clone();
                m.columns_mut(n, n).neg_mut();
                for i in 0..2 * n {
                    m[(i, i)] -= shift;
                }
                m.try_inverse().map(|inverse| inverse * (2.0 * shift))
            })
            .filter(|inverse| inverse.norm().is_finite())
            .min_by(|x, y| x.norm().total_cmp(&y.norm()))?;
        let a = DMatrix::identity(n, n) + inverse.view((0, 0), (n, n));
        let g = -inverse.view((0, n), (n, n));
        let h = inverse.view((n, 0), (n, n)).into_owned();
        Some((a, symmetric(g), symmetric(h)))
    }

    /// `A - G X`.
    fn closed_loop(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        &self.a - &self.g * x
    }

    /// Left side of the equation.
    fn residual(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let x_a = x * &self.a;
        symmetric(&x_a + x_a.transpose() - x * &self.g * x + &self.q)
    }

    /// Norm of the left side over the sum of the norms of its terms; 0 if all are 0.
    fn relative_residual(&self, x: &DMatrix<f64>) -> f64 {
        let terms = 2.0 * (x * &self.a).norm() + (x * &self.g * x).norm() + self.q.norm();
        if terms == 0.0 { 0.0 } else { self.residual(x).norm() / terms }
    }
}

/// Final check of a design. `poles` are sorted, slowest first. NaN is rejected.
fn accept(residual: f64, poles: &[Complex<f64>]) -> Result<(), String> {
    let slowest = poles.first().map_or(f64::NAN, |pole| pole.re);
    if slowest.is_nan() || slowest >= 0.0 {
        return Err(format!(
            "Riccati design: the closed loop has a pole with real part {slowest:e} 1/s, expected all below 0"
        ));
    }
    if residual.is_nan() || residual > MAX_RESIDUAL {
        return Err(format!("Riccati design: relative residual {residual:e}, expected at most {MAX_RESIDUAL:e}"));
    }
    Ok(())
}

/// The power of 2 nearest to a positive number on a logarithmic scale. Multiplication by it is exact.
fn power_of_two(x: f64) -> f64 {
    // The factor sqrt(2) rounds to the nearest power. log2 and exp2 are not used, because their last digits depend on
    // the platform.
    f64::from_bits((x * std::f64::consts::SQRT_2).to_bits() & !((1 << 52) - 1))
}

/// Element of `(m + m') / 2`.
fn symmetric_element(m: &DMatrix<f64>, i: usize, j: usize) -> f64 {
    0.5 * (m[(i, j)] + m[(j, i)])
}

/// `(m + m') / 2`.
fn symmetric(m: DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| symmetric_element(&m, i, j))
}

fn check(name: &str, matrix: &DMatrix<f64>, rows: usize, columns: usize) -> Result<(), String> {
    let (n, m) = matrix.shape();
    if (n, m) != (rows, columns) {
        return Err(format!("Riccati design: {name} is {n} x {m}, expected {rows} x {columns}"));
    }
    let Some(at) = matrix.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    // Elements are stored column by column.
    let (row, column, value) = (at % n, at / n, matrix[at]);
    Err(format!("Riccati design: element in row {row}, column {column} of {name} is {value}, expected a finite number"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;
    use proptest::prelude::*;

    /// Vertical model of the rescue vehicle (Chen et al., Mathematics 2022, 10, 3562, appendix A, corrected as
    /// described in the README of `IntegratedLqrSuspension`). States: heave, pitch, roll, six wheel heights (fl fr ml
    /// mr rl rr), and their rates. Inputs: the six suspension forces.
    struct RescueVehicle {
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        /// Rows that map the states to the six suspension deflections.
        deflection: DMatrix<f64>,
    }

    impl RescueVehicle {
        fn new() -> Self {
            let (m, m_w, g, h_s) = (36_000.0, 600.0, 9.81, 1.0);
            let (i_x, i_y) = (60_000.0, 160_000.0);
            let (k_s, c_s, k_t) = (250_000.0, 25_000.0, 1.0e6);
            let (l_12, l_23, track) = (2.95, 1.65, 2.55);
            let front = 7.55 / 3.0;
            let (middle, rear) = (front - l_12, front - l_12 - l_23);
            let x = [front, front, middle, middle, rear, rear];
            let y = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0].map(|side| side * track / 2.0);
            let m_s = m - 6.0 * m_w;

            let mut a = DMatrix::zeros(18, 18);
            let mut b = DMatrix::zeros(18, 6);
            let mut deflection = DMatrix::zeros(6, 18);
            for i in 0..9 {
                a[(i, 9 + i)] = 1.0;
            }
            a[(10, 1)] = m_s * g * h_s / i_y;
            a[(11, 2)] = m_s * g * h_s / i_x;
            for i in 0..6 {
                // The deflection and the effect of an upward force on the body have the same lever arms.
                let arms = [1.0, -x[i], y[i]];
                for (j, arm) in arms.into_iter().enumerate() {
                    deflection[(i, j)] = arm;
                }
                deflection[(i, 3 + i)] = -1.0;
                for (row, effect) in
                    [(9, arms[0] / m_s), (10, arms[1] / i_y), (11, arms[2] / i_x), (12 + i, -1.0 / m_w)]
                {
                    b[(row, i)] = effect;
                    for j in 0..9 {
                        a[(row, j)] -= effect * k_s * deflection[(i, j)];
                        a[(row, 9 + j)] -= effect * c_s * deflection[(i, j)];
                    }
                }
                a[(12 + i, 3 + i)] -= k_t / m_w;
            }
            Self { a, b, deflection }
        }

        /// Regulator for these outputs: those listed in `first`, the six deflections, and the six wheel heights.
        fn regulator(&self, first: &[First], weights: &[f64]) -> Regulator {
            let outputs = first.len() + 12;
            let mut d = DMatrix::zeros(outputs, 18);
            let mut e = DMatrix::zeros(outputs, 6);
            for (row, choice) in first.iter().enumerate() {
                match *choice {
                    First::State(i) => d[(row, i)] = 1.0,
                    First::Acceleration(i) => {
                        d.row_mut(row).copy_from(&self.a.row(i));
                        e.row_mut(row).copy_from(&self.b.row(i));
                    }
                }
            }
            for i in 0..6 {
                d.row_mut(first.len() + i).copy_from(&self.deflection.row(i));
                d[(first.len() + 6 + i, 3 + i)] = 1.0;
            }
            let bryson = |accepted: f64| accepted.powi(-2);
            let mut q0 = DMatrix::zeros(outputs, outputs);
            for (i, accepted) in weights.iter().copied().chain([0.0347; 6]).chain([0.0589; 6]).enumerate() {
                q0[(i, i)] = bryson(accepted);
            }
            let r0 = DMatrix::identity(6, 6) * bryson(20_000.0);
            lqr_output_weighted(&self.a, &self.b, &d, &e, &q0, &r0).unwrap()
        }
    }

    enum First {
        State(usize),
        Acceleration(usize),
    }

    /// All six rows of a gain matrix, from the rows of the left wheels. The row of a right wheel is the row of the left
    /// wheel with the wheels of each axle exchanged and the signs of roll and roll rate reversed.
    fn mirrored(left: [[f64; 18]; 3]) -> DMatrix<f64> {
        DMatrix::from_fn(6, 18, |row, column| {
            let values = left[row / 2];
            if row % 2 == 0 {
                return values[column];
            }
            match column {
                2 | 11 => -values[column],
                0 | 1 | 9 | 10 => values[column],
                _ => {
                    values[if column % 2 == 1 && column < 9 || column % 2 == 0 && column > 11 {
                        column + 1
                    } else {
                        column - 1
                    }]
                }
            }
        })
    }

    /// Check numbers for the poles of the model without control, printed to 5 decimals. They check the model in this
    /// test and the eigenvalues.
    #[test]
    fn rescue_vehicle_has_the_printed_open_loop_poles() {
        let poles = eigenvalues(&RescueVehicle::new().a).unwrap();
        let expected = [
            (-1.11562, 5.00581),
            (-1.34663, 5.18733),
            (-1.53572, 6.08773),
            (-20.83333, 40.61164),
            (-20.83333, 40.61164),
            (-20.83333, 40.61164),
            (-21.41485, 39.17688),
            (-21.51874, 38.87143),
            (-21.61243, 38.60507),
        ];
        for (pair, (re, im)) in poles.chunks(2).zip(expected) {
            assert!((pair[0].re - re).abs() < 6e-6 && (pair[0].im - im).abs() < 6e-6);
            assert!((pair[1].re - re).abs() < 6e-6 && (pair[1].im + im).abs() < 6e-6);
        }
    }

    /// Check numbers for the gains of the two regulators, computed with LAPACK and printed to 8 digits. Tolerance: 1e-6
    /// of the largest element. The largest real parts of the poles are printed to 4 decimals.
    #[test]
    fn rescue_vehicle_gains_match_the_reference() {
        let vehicle = RescueVehicle::new();
        let integrated = vehicle
            .regulator(&[First::Acceleration(9), First::Acceleration(10), First::Acceleration(11)], &[1.0, 1.0, 0.347]);
        let roll = vehicle.regulator(&[First::State(2), First::Acceleration(11)], &[1f64.to_radians(), 0.347]);
        #[rustfmt::skip]
        let k_integrated = mirrored([
            [96565.021,-757808.34,-32887.248,-91963.16,-30134.938,84139.289,-21777.567,88813.751,-17103.106,27011.816,-114946.86,24006.052,3022.3609,296.74577,5158.3773,-1312.5696,4258.2518,-2212.6951],
            [96565.021,130483.56,-32887.248,84139.289,-21777.567,-85044.806,-23216.585,81895.398,-24021.459,27011.816,19792.175,24006.052,5158.3773,-1312.5696,1690.1463,-1035.4689,5590.4664,-880.4804],
            [96565.021,627324.79,-32887.248,88813.751,-17103.106,81895.398,-24021.459,-89719.268,-27891.047,27011.816,95154.688,24006.052,4258.2518,-2212.6951,5590.4664,-880.4804,2590.2718,-135.34339],
        ]);
        #[rustfmt::skip]
        let k_roll = mirrored([
            [378252.4,-971468.15,9309.9017,-176424.65,-112256.69,34889.331,-68687.787,59258.377,-44318.74,40041.021,-124816.16,30429.647,123.54526,-2617.6787,3420.788,-3065.7677,3170.1619,-3316.3937],
            [378252.4,167272.66,9309.9017,34889.331,-68687.787,-140357.68,-76189.717,23191.406,-80385.711,40041.021,21491.525,30429.647,3420.788,-3065.7677,-247.38932,-2988.6133,3541.0965,-2945.4591],
            [378252.4,804195.49,9309.9017,59258.377,-44318.74,23191.406,-80385.711,-164726.72,-100558.76,40041.021,103324.64,30429.647,3170.1619,-3316.3937,3541.0965,-2945.4591,3.236716,-2737.9873],
        ]);
        for (name, regulator, expected, slowest) in
            [("integrated", integrated, k_integrated, "-3.1400"), ("roll", roll, k_roll, "-2.9949")]
        {
            let error = (&regulator.gain - &expected).amax() / expected.amax();
            assert!(error < 1e-6, "{name}: gain error {error:e}");
            assert_eq!(format!("{:.4}", regulator.poles[0].re), slowest, "{name}");
            assert_eq!(regulator.poles.len(), 18);
        }
    }

    /// Relative residual of the Riccati equation as written in the documentation, with an explicit inverse of R.
    fn residual_as_documented([a, b, q, r, n]: [&DMatrix<f64>; 5], regulator: &Regulator) -> f64 {
        let p = &regulator.p;
        let quadratic = (p * b + n) * r.clone().try_inverse().unwrap() * (b.transpose() * p + n.transpose());
        let left = a.transpose() * p + p * a - &quadratic + q;
        left.norm() / (2.0 * (p * a).norm() + quadratic.norm() + q.norm())
    }

    fn largest_real_part(m: &DMatrix<f64>) -> f64 {
        eigenvalues(m).unwrap()[0].re
    }

    fn scalar(x: f64) -> DMatrix<f64> {
        DMatrix::from_element(1, 1, x)
    }

    fn scalar_care(a: f64, b: f64, q: f64, r: f64, n: f64) -> Result<Regulator, String> {
        care(&scalar(a), &scalar(b), &scalar(q), &scalar(r), &scalar(n))
    }

    /// Chain of n integrators with the input at its end and a weight on all states or only on the first.
    fn integrator_chain(n: usize, all: bool) -> Result<Regulator, String> {
        let a = DMatrix::from_fn(n, n, |i, j| f64::from(j == i + 1));
        let b = DMatrix::from_fn(n, 1, |i, _| f64::from(i + 1 == n));
        let q = DMatrix::from_fn(n, n, |i, j| f64::from(i == j && (all || i == 0)));
        care(&a, &b, &q, &scalar(1.0), &DMatrix::zeros(n, 1))
    }

    /// With weight 1 on the first state of a chain of n integrators, the poles are the roots of the Butterworth
    /// polynomial of order n, evenly spaced on the left half of the unit circle. Tolerance: with 8 states, the
    /// condition number of the poles is about 1e3.
    #[test]
    fn integrator_chain_gives_butterworth_poles() {
        let n = 8;
        let regulator = integrator_chain(n, false).unwrap();
        let last = std::f64::consts::PI / (2 * n) as f64;
        assert!((regulator.poles[0].re + last.sin()).abs() < 1e-12);
        for pole in &regulator.poles {
            assert!((math::hypot(pole.re, pole.im) - 1.0).abs() < 1e-12);
        }
        let slower_first = regulator.poles.windows(2).all(|pair| pair[0].re >= pair[1].re);
        assert!(slower_first);
    }

    #[test]
    fn output_weights_are_the_weights_of_the_documentation() {
        let a = dmatrix![0.0, 1.0; -2.0, -0.3];
        let b = dmatrix![0.0; 1.5];
        let d = dmatrix![-2.0, -0.3; 1.0, 0.0; 0.0, 1.0];
        let e = dmatrix![1.5; 0.0; 0.2];
        let q0 = dmatrix![2.0, 0.1, 0.0; 0.3, 4.0, 0.0; 0.0, 0.0, 1.0];
        let r0 = scalar(0.7);
        let by_outputs = lqr_output_weighted(&a, &b, &d, &e, &q0, &r0).unwrap();
        // Only the symmetric part of Q0 is used.
        let q0 = 0.5 * (&q0 + q0.transpose());
        let q = d.transpose() * &q0 * &d;
        let n = d.transpose() * &q0 * &e;
        let r = e.transpose() * &q0 * &e + r0;
        let direct = care(&a, &b, &q, &r, &n).unwrap();
        assert!((by_outputs.gain - direct.gain).amax() < 1e-14);
        assert!((by_outputs.p - direct.p).amax() < 1e-14);
    }

    #[test]
    fn designs_without_solution_are_rejected() {
        let unsolvable = [
            ("unstable mode without input", scalar_care(1.0, 0.0, 1.0, 1.0, 0.0)),
            ("integrator without input", scalar_care(0.0, 0.0, 1.0, 1.0, 0.0)),
            ("integrator without weight", scalar_care(0.0, 1.0, 0.0, 1.0, 0.0)),
            ("unstable mode without weight", scalar_care(1.0, 1.0, 0.0, 1.0, 0.0)),
            ("weight removed by the cross term", scalar_care(1.0, 1.0, 1.0, 1.0, 1.0)),
            ("double eigenvalue 0", scalar_care(-1.0, 1.0, -1.0, 1.0, 0.0)),
            ("eigenvalues +-i", scalar_care(-1.0, 1.0, -2.0, 1.0, 0.0)),
            ("overflow", scalar_care(1e200, 1e200, 1e200, 1.0, 0.0)),
            (
                "position without weight",
                care(
                    &dmatrix![0.0, 1.0; 0.0, 0.0],
                    &dmatrix![0.0; 1.0],
                    &dmatrix![0.0, 0.0; 0.0, 1.0],
                    &scalar(1.0),
                    &DMatrix::zeros(2, 1),
                ),
            ),
            (
                "undamped oscillator without input",
                care(
                    &dmatrix![0.0, 1.0; -1.0, 0.0],
                    &DMatrix::zeros(2, 1),
                    &DMatrix::identity(2, 2),
                    &scalar(1.0),
                    &DMatrix::zeros(2, 1),
                ),
            ),
        ];
        for (what, result) in unsolvable {
            assert_eq!(result.unwrap_err(), NO_CONVERGENCE, "{what}");
        }
    }

    #[test]
    fn badly_conditioned_designs_are_rejected() {
        // Residuals of up to 1e-10 are accepted.
        let error = integrator_chain(20, false).unwrap_err();
        assert!(
            error.starts_with("Riccati design: relative residual ") && error.ends_with(" at most 1e-10"),
            "{error}"
        );
        // With 23 to 39 states, rounding makes the closed loop unstable; 30 is far from both ends.
        let error = integrator_chain(30, false).unwrap_err();
        let real_part = error.strip_prefix("Riccati design: the closed loop has a pole with real part ");
        let real_part = real_part.and_then(|rest| rest.split(' ').next());
        assert!(real_part.is_some_and(|text| text.parse::<f64>().unwrap() > 0.0), "{error}");
        let pole = |re| [Complex::new(re, 0.0)];
        assert!(accept(1e-11, &pole(-1.0)).is_ok());
        for (residual, re) in [(f64::NAN, -1.0), (2e-10, -1.0), (0.0, f64::NAN), (0.0, 0.0)] {
            assert!(accept(residual, &pole(re)).is_err());
        }
    }

    #[test]
    fn solvable_designs_at_the_edge_are_solved() {
        // Stable and without weight, so no control is needed.
        let idle = scalar_care(-1.0, 1.0, 0.0, 1.0, 0.0).unwrap();
        assert_eq!((idle.p[(0, 0)], idle.gain[(0, 0)]), (0.0, 0.0));
        // Stable without input: P = q / (2 |a|), the Lyapunov equation.
        let slow = scalar_care(-1e-9, 0.0, 1.0, 1.0, 0.0).unwrap();
        assert!((slow.p[(0, 0)] * 2e-9 - 1.0).abs() < 1e-12);
        // An indefinite cost can have a stabilizing solution: P = -1 + sqrt(1 - 0.5).
        let indefinite = scalar_care(-1.0, 1.0, -0.5, 1.0, 0.0).unwrap();
        assert!((indefinite.p[(0, 0)] + 1.0 - 0.5f64.sqrt()).abs() < 1e-14);
        // Two time scales that differ by a factor of 1e10.
        let stiff = care(
            &dmatrix![-1e-10, 0.0; 0.0, -1.0],
            &dmatrix![1e-10; 1.0],
            &DMatrix::identity(2, 2),
            &scalar(1.0),
            &DMatrix::zeros(2, 1),
        );
        assert!(stiff.unwrap().poles[0].re < -1e-10);
    }

    #[test]
    fn bad_input_is_named() {
        let good = [
            DMatrix::identity(2, 2),
            DMatrix::identity(2, 1),
            DMatrix::identity(2, 2),
            DMatrix::identity(1, 1),
            DMatrix::zeros(2, 1),
        ];
        let solve = |m: &[DMatrix<f64>; 5]| care(&m[0], &m[1], &m[2], &m[3], &m[4]);
        for (i, name) in ["A", "B", "Q", "R", "N"].into_iter().enumerate() {
            let mut bad = good.clone();
            bad[i] = bad[i].clone().insert_row(0, 0.0);
            let (rows, columns) = bad[i].shape();
            let error = solve(&bad).unwrap_err();
            assert!(error.starts_with(&format!("Riccati design: {name} is {rows} x {columns}, ")), "{error}");

            let mut bad = good.clone();
            bad[i][(0, 0)] = f64::NAN;
            let message =
                format!("Riccati design: element in row 0, column 0 of {name} is NaN, expected a finite number");
            assert_eq!(solve(&bad).unwrap_err(), message);
            bad[i][(0, 0)] = 1.0;
            let last = bad[i].shape();
            bad[i][(last.0 - 1, last.1 - 1)] = f64::INFINITY;
            let place = format!("row {}, column {} of {name} is inf", last.0 - 1, last.1 - 1);
            assert!(solve(&bad).unwrap_err().contains(&place), "{place}");
        }
        let empty = DMatrix::zeros(0, 0);
        let error = care(&empty, &empty, &empty, &empty, &empty).unwrap_err();
        assert_eq!(error, "Riccati design: A is 0 x 0, expected 1 x 1");
        let no_input = DMatrix::zeros(2, 0);
        let error = care(&good[0], &no_input, &good[2], &empty, &no_input).unwrap_err();
        assert_eq!(error, "Riccati design: B is 2 x 0, expected 2 x 1");
        for (name, position) in [("D", 2), ("E", 3), ("Q0", 4), ("R0", 5)] {
            let mut m = [&good[0], &good[1], &good[0], &good[4], &good[0], &good[3]];
            let wrong = DMatrix::zeros(2, 5);
            m[position] = &wrong;
            let error = lqr_output_weighted(m[0], m[1], m[2], m[3], m[4], m[5]).unwrap_err();
            assert!(error.starts_with(&format!("Riccati design: {name} is 2 x 5, expected ")), "{error}");
        }
        assert_eq!(
            lqr_output_weighted(&good[0], &good[1], &good[0], &good[4], &empty, &good[3]).unwrap_err(),
            "Riccati design: Q0 is 0 x 0, expected 2 x 2"
        );
    }

    #[test]
    fn weights_of_the_inputs_must_be_positive_definite() {
        let two = DMatrix::identity(2, 2);
        for r in [
            dmatrix![0.0, 0.0; 0.0, 1.0],
            dmatrix![-1.0, 0.0; 0.0, 1.0],
            dmatrix![1.0, 1.0; 1.0, 1.0],
            dmatrix![1.0, 2.0; 2.0, 1.0],
            // Singular in exact arithmetic, but rounding makes the pivot positive.
            dmatrix![0.01, 0.03; 0.03, 0.09],
        ] {
            let result = care(&two, &two, &two, &r, &DMatrix::zeros(2, 2));
            assert_eq!(result.unwrap_err(), NOT_POSITIVE_DEFINITE, "{r}");
        }
        // Inputs with very different units are accepted.
        let r = DMatrix::from_diagonal(&DVector::from_vec(vec![1e-12, 1e12]));
        assert!(care(&two, &two, &two, &r, &DMatrix::zeros(2, 2)).is_ok());
    }

    fn random_matrix(rows: usize, columns: usize) -> impl Strategy<Value = DMatrix<f64>> {
        proptest::collection::vec(-1.0..1.0f64, rows * columns)
            .prop_map(move |values| DMatrix::from_vec(rows, columns, values))
    }

    /// Q, R, N of the positive definite cost |D x + E u|^2 + 0.01 |x|^2 + 0.1 |u|^2.
    fn cost(d: &DMatrix<f64>, e: &DMatrix<f64>) -> [DMatrix<f64>; 3] {
        let [state, input] = [d, e].map(|m| DMatrix::identity(m.ncols(), m.ncols()));
        [d.tr_mul(d) + 0.01 * state, e.tr_mul(e) + 0.1 * input, d.tr_mul(e)]
    }

    /// Any plant and cost: A, B, Q, R, N. Some are very badly conditioned: an unstable mode can be almost
    /// uncontrollable.
    fn any_design() -> impl Strategy<Value = [DMatrix<f64>; 5]> {
        (1usize..6, 1usize..4).prop_flat_map(|(states, inputs)| {
            (
                random_matrix(states, states),
                random_matrix(states, inputs),
                random_matrix(states + inputs, states),
                random_matrix(states + inputs, inputs),
            )
                .prop_map(|(a, b, d, e)| {
                    let [q, r, n] = cost(&d, &e);
                    [a, b, q, r, n]
                })
        })
    }

    /// A mechanical system, stable or not: A, B, Q, R, N with states (positions, speeds). An actuator for every degree
    /// of freedom keeps the design well conditioned.
    fn mechanical_design() -> impl Strategy<Value = [DMatrix<f64>; 5]> {
        (1usize..5).prop_flat_map(|freedoms| {
            (
                random_matrix(freedoms, 2 * freedoms),
                random_matrix(freedoms, freedoms),
                random_matrix(3 * freedoms, 2 * freedoms),
                random_matrix(3 * freedoms, freedoms),
            )
                .prop_map(move |(forces, actuators, d, e)| {
                    let speeds = DMatrix::identity(freedoms, freedoms);
                    let mut a = DMatrix::zeros(2 * freedoms, 2 * freedoms);
                    a.view_mut((0, freedoms), (freedoms, freedoms)).copy_from(&speeds);
                    a.rows_mut(freedoms, freedoms).copy_from(&forces);
                    let mut b = DMatrix::zeros(2 * freedoms, freedoms);
                    // Diagonally dominant, hence far from singular.
                    b.rows_mut(freedoms, freedoms).copy_from(&(speeds + actuators * (0.5 / freedoms as f64)));
                    let [q, r, n] = cost(&d, &e);
                    [a, b, q, r, n]
                })
        })
    }

    proptest! {
        /// With a cross term, the equation holds, the loop is stable, and P is symmetric and positive semidefinite (the
        /// cost cannot be negative). Tolerances: rounding times the condition number of these designs, with a reserve.
        #[test]
        fn mechanical_designs_are_solved([a, b, q, r, n] in mechanical_design()) {
            let regulator = care(&a, &b, &q, &r, &n).unwrap();
            prop_assert!(residual_as_documented([&a, &b, &q, &r, &n], &regulator) < 1e-12);
            prop_assert!(largest_real_part(&(&a - &b * &regulator.gain)) < 0.0);
            prop_assert_eq!(regulator.poles.len(), a.nrows());
            prop_assert_eq!(&regulator.p, &regulator.p.transpose());
            let smallest = regulator.p.clone().symmetric_eigenvalues().min();
            prop_assert!(smallest >= -1e-12 * regulator.p.norm());
        }

        /// A returned regulator solves the equation, however ill-conditioned the problem. Tolerance: ten times the
        /// accepted residual, because of the unscaled coordinates and the explicit inverse of R.
        #[test]
        fn any_returned_regulator_solves_the_equation([a, b, q, r, n] in any_design()) {
            if let Ok(regulator) = care(&a, &b, &q, &r, &n) {
                prop_assert!(residual_as_documented([&a, &b, &q, &r, &n], &regulator) < 10.0 * MAX_RESIDUAL);
                prop_assert!(regulator.poles[0].re < 0.0);
            }
        }

        /// Changing the units of states and inputs by factors from 1e-6 to 1e6 scales the gain by these factors and
        /// leaves the poles unchanged. Tolerance: rounding times the condition number of the designs, or its root for
        /// poles close to a double pole.
        #[test]
        fn units_do_not_matter(
            [a, b, q, r, n] in mechanical_design(),
            exponents in proptest::collection::vec(-6.0..6.0f64, 12),
        ) {
            let unit = |from: usize, length: usize| {
                DVector::from_fn(length, |i, _| 10f64.powf(exponents[from + i]))
            };
            let (state, input) = (unit(0, a.nrows()), unit(8, b.ncols()));
            let [x, u] = [&state, &input].map(DMatrix::from_diagonal);
            let x_inverse = DMatrix::from_diagonal(&state.map(f64::recip));
            let plain = care(&a, &b, &q, &r, &n).unwrap();
            let scaled = care(
                &(&x_inverse * &a * &x),
                &(&x_inverse * &b * &u),
                &(&x * &q * &x),
                &(&u * &r * &u),
                &(&x * &n * &u),
            )
            .unwrap();
            let gain = u * scaled.gain * x_inverse;
            prop_assert!((&gain - &plain.gain).norm() <= 1e-10 * plain.gain.norm());
            prop_assert!((scaled.poles[0].re - plain.poles[0].re).abs() <= 1e-5 * math::hypot(plain.poles[0].re, plain.poles[0].im));
        }

        /// With one state and d = sqrt((a - b n / r)^2 + b^2 / r (q - n^2 / r)), the pole is -d and K = (a + d) / b
        /// (from the quadratic equation for P). Tolerance: a few rounding errors, amplified by cancellation in a + d.
        #[test]
        fn one_state_matches_the_closed_form(
            a in -5.0..5.0f64, b in 0.1..5.0f64, root_q in 0.1..3.0f64, r in 0.1..5.0f64, share in -0.9..0.9f64,
        ) {
            // |n| < sqrt(q r): positive definite.
            let q = root_q * root_q;
            let n = share * root_q * r.sqrt();
            let regulator = scalar_care(a, b, q, r, n).unwrap();
            let d = ((a - b * n / r).powi(2) + b * b / r * (q - n * n / r)).sqrt();
            prop_assert!((regulator.poles[0].re + d).abs() < 1e-12 * (a.abs() + d));
            prop_assert!((regulator.gain[(0, 0)] * b - (a + d)).abs() < 1e-12 * (a.abs() + d));
        }

        /// Double integrator with weights over 12 decades: K = [sqrt(q1 / r), sqrt(q2 / r + 2 sqrt(q1 / r))] (Anderson
        /// and Moore; by comparing coefficients).
        #[test]
        fn double_integrator_matches_the_closed_form(
            position in -6.0..6.0f64, rate in -6.0..6.0f64, input in -6.0..6.0f64,
        ) {
            let [q1, q2, r] = [position, rate, input].map(|x| 10f64.powf(x));
            let regulator = care(
                &dmatrix![0.0, 1.0; 0.0, 0.0],
                &dmatrix![0.0; 1.0],
                &dmatrix![q1, 0.0; 0.0, q2],
                &scalar(r),
                &DMatrix::zeros(2, 1),
            )
            .unwrap();
            let k1 = (q1 / r).sqrt();
            let k2 = (q2 / r + 2.0 * k1).sqrt();
            prop_assert!((regulator.gain[(0, 0)] / k1 - 1.0).abs() < 1e-10);
            prop_assert!((regulator.gain[(0, 1)] / k2 - 1.0).abs() < 1e-10);
        }
    }
}
