//! The solvers of continuous-time models.

use crate::dual::Dual64;
use crate::model::{At, Continuous, Solver};
use crate::variables::{ContinuousState, Counts, Values, ValuesMut, Variables};

/// Model, inputs and the rest that stays as it is while a solver advances the state.
pub(crate) struct Problem<'a, M: Continuous> {
    pub(crate) model: &'a M,
    pub(crate) inputs: &'a M::Inputs<f64>,
    pub(crate) derived: &'a M::Derived,
}

impl<M: Continuous> Problem<'_, M> {
    #[inline]
    pub(crate) fn at<'a>(
        &'a self,
        time: f64,
        state: &'a M::State<f64>,
        discrete: &'a M::DiscreteState,
    ) -> At<'a, f64, M> {
        At { time, state, inputs: self.inputs, derived: self.derived, discrete }
    }

    /// One step of fixed length: Runge-Kutta of order 4, or the solution in closed form.
    #[inline]
    pub(crate) fn fixed(&self, time: f64, x: &M::State<f64>, discrete: &M::DiscreteState, h: f64) -> M::State<f64> {
        if matches!(M::SOLVER, Solver::Exact) {
            return self.model.advance(self.at(time, x, discrete), h);
        }
        let f = |time, x: &M::State<f64>| self.model.derivatives(self.at(time, x, discrete));
        let k1 = f(time, x);
        let k2 = f(time + 0.5 * h, &x.combine(&k1, |x, k| x + 0.5 * h * k));
        let k3 = f(time + 0.5 * h, &x.combine(&k2, |x, k| x + 0.5 * h * k));
        let k4 = f(time + h, &x.combine(&k3, |x, k| x + h * k));
        let slope = k1.combine(&k2, |a, b| a + 2.0 * b).combine(&k3, |a, b| a + 2.0 * b).combine(&k4, |a, b| a + b);
        x.combine(&slope, |x, s| x + h / 6.0 * s)
    }

    /// One step of the solver with error control, with an estimate of its error.
    pub(crate) fn estimated(
        &self,
        time: f64,
        x: &M::State<f64>,
        discrete: &M::DiscreteState,
        h: f64,
        scratch: &mut Scratch,
    ) -> Option<(M::State<f64>, M::State<f64>)> {
        if matches!(M::SOLVER, Solver::Rosenbrock { .. }) {
            self.rodas(time, x, discrete, h, scratch)
        } else {
            Some(self.dormand_prince(time, x, discrete, h))
        }
    }

    /// Dormand and Prince 1980, the coefficients of RK5(4)7M.
    fn dormand_prince(
        &self,
        time: f64,
        x: &M::State<f64>,
        discrete: &M::DiscreteState,
        h: f64,
    ) -> (M::State<f64>, M::State<f64>) {
        let f = |c: f64, x: &M::State<f64>| self.model.derivatives(self.at(time + c * h, x, discrete));
        // x + h (a1 k1 + a2 k2 + …)
        let sum = |parts: &[(f64, &M::State<f64>)]| {
            let mut sum = x.copied();
            for &(a, k) in parts {
                sum = sum.combine(k, |x, k| x + h * a * k);
            }
            sum
        };
        let k1 = f(0.0, x);
        let k2 = f(1.0 / 5.0, &sum(&[(1.0 / 5.0, &k1)]));
        let k3 = f(3.0 / 10.0, &sum(&[(3.0 / 40.0, &k1), (9.0 / 40.0, &k2)]));
        let k4 = f(4.0 / 5.0, &sum(&[(44.0 / 45.0, &k1), (-56.0 / 15.0, &k2), (32.0 / 9.0, &k3)]));
        let k5 = f(
            8.0 / 9.0,
            &sum(&[(19372.0 / 6561.0, &k1), (-25360.0 / 2187.0, &k2), (64448.0 / 6561.0, &k3), (-212.0 / 729.0, &k4)]),
        );
        let k6 = f(
            1.0,
            &sum(&[
                (9017.0 / 3168.0, &k1),
                (-355.0 / 33.0, &k2),
                (46732.0 / 5247.0, &k3),
                (49.0 / 176.0, &k4),
                (-5103.0 / 18656.0, &k5),
            ]),
        );
        let end = sum(&[
            (35.0 / 384.0, &k1),
            (500.0 / 1113.0, &k3),
            (125.0 / 192.0, &k4),
            (-2187.0 / 6784.0, &k5),
            (11.0 / 84.0, &k6),
        ]);
        let k7 = f(1.0, &end);
        let parts = [
            (71.0 / 57600.0, &k1),
            (-71.0 / 16695.0, &k3),
            (71.0 / 1920.0, &k4),
            (-17253.0 / 339200.0, &k5),
            (22.0 / 525.0, &k6),
            (-1.0 / 40.0, &k7),
        ];
        let mut error = x.combine(x, |_, _| 0.0);
        for (e, k) in parts {
            error = error.combine(k, |error, k| error + h * e * k);
        }
        (end, error)
    }

    /// RODAS: Hairer, Wanner, "Solving Ordinary Differential Equations II", 1996, section IV.7, with the coefficients of
    /// their program. `None` if the matrix is singular.
    fn rodas(
        &self,
        time: f64,
        x: &M::State<f64>,
        discrete: &M::DiscreteState,
        h: f64,
        scratch: &mut Scratch,
    ) -> Option<(M::State<f64>, M::State<f64>)> {
        const GAMMA: f64 = 0.25;
        const A: [&[f64]; 5] = [
            &[],
            &[1.544],
            &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
            &[3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7],
            &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895],
        ];
        const C: [&[f64]; 6] = [
            &[],
            &[-5.6688],
            &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
            &[-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16],
            &[7.496_443_313_967_647, -10.246_804_314_643_52, -33.999_903_528_199_05, 11.708_908_932_061_6],
            &[
                8.083_246_795_921_522,
                -7.981_132_988_064_893,
                -31.521_594_328_743_71,
                16.319_305_431_231_36,
                -6.058_818_238_834_054,
            ],
        ];
        /// Times of the stages, and their coefficients of the derivative with respect to time.
        const TIMES: [f64; 6] = [0.0, 0.386, 0.21, 0.63, 1.0, 1.0];
        const D: [f64; 6] = [0.25, -0.1043, 0.1035, -0.036_200_000_000_000_23, 0.0, 0.0];

        let n = M::State::<f64>::COUNTS.reals;
        self.linearize(time, x, discrete, scratch);
        let Scratch { matrix, slope, pivots, stages, state, other, .. } = scratch;
        // (1/(h gamma) - J) u = f + sum (c/h) u + h d f_t
        matrix.iter_mut().for_each(|entry| *entry = -*entry);
        for i in 0..n {
            matrix[i * n + i] += 1.0 / (h * GAMMA);
        }
        factorize(matrix, pivots, n)?;
        write::<M>(x, state);
        let mut end = x.copied();
        for stage in 0..6 {
            let (known, rest) = stages.split_at_mut(stage * n);
            let u = &mut rest[..n];
            // The argument of the last two stages is the sum of the one before and its increment.
            let argument: M::State<f64> = match stage {
                0..=4 => {
                    other.copy_from_slice(state);
                    for (j, a) in A[stage].iter().enumerate() {
                        (0..n).for_each(|i| other[i] += a * known[j * n + i]);
                    }
                    M::State::read(Values::of_reals(other), Counts::ZERO)
                }
                _ => {
                    write::<M>(&end, other);
                    (0..n).for_each(|i| other[i] += known[(stage - 1) * n + i]);
                    M::State::read(Values::of_reals(other), Counts::ZERO)
                }
            };
            write::<M>(&self.model.derivatives(self.at(time + TIMES[stage] * h, &argument, discrete)), u);
            for i in 0..n {
                for (j, c) in C[stage].iter().enumerate() {
                    u[i] += c / h * known[j * n + i];
                }
                u[i] += h * D[stage] * slope[i];
            }
            solve(matrix, pivots, n, u);
            end = argument;
        }
        let error = M::State::read(Values::of_reals(&stages[5 * n..]), Counts::ZERO);
        Some((end.combine(&error, |x, e| x + e), error))
    }

    /// The Jacobian of the derivatives with respect to the state, row by row, and their derivative with respect to time:
    /// exact, by dual numbers.
    fn linearize(&self, time: f64, x: &M::State<f64>, discrete: &M::DiscreteState, scratch: &mut Scratch) {
        let n = M::State::<f64>::COUNTS.reals;
        scratch.resize::<M>();
        let inputs = dual_inputs::<M>(self.inputs, scratch);
        let Scratch { matrix, slope, state, duals, results, .. } = scratch;
        write::<M>(x, state);
        for column in 0..=n {
            for (i, dual) in duals.iter_mut().enumerate() {
                *dual = Dual64::new(state[i], f64::from(u8::from(i == column)));
            }
            let at = At {
                time: Dual64::new(time, f64::from(u8::from(column == n))),
                state: &M::State::read(Values::of_reals(duals), Counts::ZERO),
                inputs: &inputs,
                derived: self.derived,
                discrete,
            };
            self.model.derivatives(at).write(&mut ValuesMut::of_reals(results), Counts::ZERO);
            for (row, result) in results.iter().enumerate() {
                if column < n {
                    matrix[row * n + column] = result.eps;
                } else {
                    slope[row] = result.eps;
                }
            }
        }
    }
}

fn write<M: Continuous>(x: &M::State<f64>, values: &mut [f64]) {
    x.write(&mut ValuesMut::of_reals(values), Counts::ZERO);
}

/// The inputs as dual numbers that do not vary.
fn dual_inputs<M: Continuous>(inputs: &M::Inputs<f64>, scratch: &mut Scratch) -> M::Inputs<Dual64> {
    let Scratch { inputs: reals, integers, booleans, strings, .. } = scratch;
    inputs.write(&mut ValuesMut { reals, integers, booleans, strings }, Counts::ZERO);
    scratch.input_duals.clear();
    scratch.input_duals.extend(scratch.inputs.iter().map(|&value| Dual64::from(value)));
    let values = Values {
        reals: &scratch.input_duals,
        integers: &scratch.integers,
        booleans: &scratch.booleans,
        strings: &scratch.strings,
    };
    M::Inputs::read(values, Counts::ZERO)
}

/// Working memory of the solvers; keeps nothing from one step to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    matrix: Vec<f64>,
    slope: Vec<f64>,
    pivots: Vec<usize>,
    stages: Vec<f64>,
    pub(crate) state: Vec<f64>,
    pub(crate) other: Vec<f64>,
    duals: Vec<Dual64>,
    results: Vec<Dual64>,
    inputs: Vec<f64>,
    input_duals: Vec<Dual64>,
    integers: Vec<i32>,
    booleans: Vec<bool>,
    strings: Vec<String>,
}

impl Scratch {
    pub(crate) fn resize<M: Continuous>(&mut self) {
        let n = M::State::<f64>::COUNTS.reals;
        let inputs = M::Inputs::<f64>::COUNTS;
        self.state.resize(n, 0.0);
        self.other.resize(n, 0.0);
        if matches!(M::SOLVER, Solver::Rosenbrock { .. }) {
            self.matrix.resize(n * n, 0.0);
            self.slope.resize(n, 0.0);
            self.pivots.resize(n, 0);
            self.stages.resize(6 * n, 0.0);
            self.duals.resize(n, Dual64::from(0.0));
            self.results.resize(n, Dual64::from(0.0));
            self.inputs.resize(inputs.reals, 0.0);
            self.input_duals.reserve(inputs.reals);
            self.integers.resize(inputs.integers, 0);
            self.booleans.resize(inputs.booleans, false);
            self.strings.resize(inputs.strings, String::new());
        }
    }
}

/// LU decomposition in place with row exchanges (Golub, Van Loan, "Matrix Computations", section 3.4). `None` if the matrix is
/// singular.
fn factorize(matrix: &mut [f64], pivots: &mut [usize], n: usize) -> Option<()> {
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| matrix[a * n + k].abs().total_cmp(&matrix[b * n + k].abs()))?;
        let largest = matrix[pivot * n + k];
        if largest == 0.0 || !largest.is_finite() {
            return None;
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
    Some(())
}

/// Solves for one right side in place.
fn solve(matrix: &[f64], pivots: &[usize], n: usize, b: &mut [f64]) {
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
