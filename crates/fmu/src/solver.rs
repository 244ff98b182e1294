//! The solvers of continuous-time models.

use std::convert::Infallible;

use fmu_math::sparse::{SparseLu, Structure, groups};
use fmu_math::{dense, ode};

use crate::bytes::Buffer;
use crate::dual::Dual64;
use crate::model::{At, Continuous, Solver};
use crate::scalar::{Dependencies, Scalar};
use crate::store::{ByType, Counts, Length, ValueStore, Values, ValuesMut};
use crate::variable::{Layout, Role};
use crate::variables::{ContinuousState, Variables};

/// Model, inputs and derived parameters. All but the inputs are constant while a solver advances the state.
pub(crate) struct Problem<'a, M: Continuous> {
    pub(crate) model: &'a M,
    pub(crate) inputs: M::Inputs<f64>,
    pub(crate) derived: &'a M::Derived,
    pub(crate) lengths: &'a [Length],
    /// `None` if the inputs are held.
    pub(crate) line: Option<Line<'a>>,
}

/// Inputs that are linear in time over a step.
pub(crate) struct Line<'a> {
    values: Values<'a, f64>,
    at: Counts,
    /// Start of the step in s.
    start: f64,
    first: &'a [f64],
    slopes: &'a [f64],
    /// The real inputs at the last requested time.
    reals: Vec<f64>,
}

impl<'a> Line<'a> {
    /// The inputs of a step that starts at `start` in s with the present values; uses the memory of `reals`.
    #[cold]
    pub(crate) fn new(layout: &Layout, values: &'a ValueStore, start: f64, reals: Vec<f64>) -> Self {
        let (first, slopes) = (&values.reals[layout.inputs.reals()], &values.reals[layout.slopes()]);
        Self { values: values.view(), at: layout.inputs.at, start, first, slopes, reals }
    }

    #[cold]
    fn move_to(&mut self, time: f64) {
        let after = time - self.start;
        self.reals.clear();
        self.reals.extend(self.first.iter().zip(self.slopes).map(|(first, slope)| first + slope * after));
    }

    #[cold]
    fn read<I: Variables<f64>>(&mut self, time: f64, inputs: &mut I) {
        self.move_to(time);
        *inputs = I::read(Values { reals: &self.reals, ..self.values }, Counts { reals: 0, ..self.at });
    }

    /// The real inputs at a time in s.
    #[cold]
    pub(crate) fn into_reals(mut self, time: f64) -> Vec<f64> {
        self.move_to(time);
        self.reals
    }
}

/// One solver step: start time, length, and the discrete state, which is constant during the step.
pub(crate) struct Interval<'a, M: Continuous> {
    pub(crate) time: f64,
    pub(crate) h: f64,
    pub(crate) discrete: &'a M::DiscreteState,
}

impl<M: Continuous> Problem<'_, M> {
    /// Moves inputs that are linear in time to a time in s.
    #[inline]
    pub(crate) fn move_to<K: Keep<M>>(&mut self, time: f64) {
        if K::LINEAR
            && let Some(line) = &mut self.line
        {
            line.read(time, &mut self.inputs);
        }
    }

    #[inline]
    pub(crate) fn at<'a>(
        &'a self,
        time: f64,
        state: &'a M::State<f64>,
        discrete: &'a M::DiscreteState,
    ) -> At<'a, f64, M> {
        At { time, state, inputs: &self.inputs, derived: self.derived, discrete }
    }

    /// Computes the derivatives for a state on the heap.
    #[inline]
    fn evaluate<T: Scalar>(&self, time: T, x: &[T], inputs: &M::Inputs<T>, discrete: &M::DiscreteState, to: &mut [T]) {
        if M::State::<f64>::COUNTS.reals > MOST_IN_PLACE {
            self.evaluate_apart(time, x, inputs, discrete, to);
        } else {
            self.evaluate_here(time, x, inputs, discrete, to);
        }
    }

    #[inline]
    fn evaluate_here<T: Scalar>(
        &self,
        time: T,
        x: &[T],
        inputs: &M::Inputs<T>,
        discrete: &M::DiscreteState,
        to: &mut [T],
    ) {
        let state = &M::State::read(Values::of_states(x, self.lengths), Counts::ZERO);
        let at = At { time, state, inputs, derived: self.derived, discrete };
        self.model.derivatives(at).write(&mut ValuesMut::of_reals(to), Counts::ZERO);
    }

    /// Not inlined: only this stack frame contains the model's structs.
    #[inline(never)]
    fn evaluate_apart<T: Scalar>(
        &self,
        time: T,
        x: &[T],
        inputs: &M::Inputs<T>,
        discrete: &M::DiscreteState,
        to: &mut [T],
    ) {
        self.evaluate_here(time, x, inputs, discrete, to);
    }

    /// The derivatives as a function of time and state.
    #[inline]
    fn derivatives<K: Keep<M>>(
        &mut self,
        discrete: &M::DiscreteState,
    ) -> impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), Infallible> {
        |time, x, to| {
            self.move_to::<K>(time);
            self.evaluate(time, x, &self.inputs, discrete, to);
            Ok(())
        }
    }

    #[inline(never)]
    fn advance_on_heap(&self, time: f64, x: &[f64], discrete: &M::DiscreteState, h: f64, end: &mut [f64]) {
        let state = M::State::read(Values::of_states(x, self.lengths), Counts::ZERO);
        self.model.advance(self.at(time, &state, discrete), h).write(&mut ValuesMut::of_reals(end), Counts::ZERO);
    }

    /// Computes the Jacobian with respect to the state, and the derivative with respect to time, exactly with dual
    /// numbers. One evaluation computes all columns in a group.
    fn linearize<K: Keep<M>>(&self, time: f64, x: &[f64], discrete: &M::DiscreteState, scratch: &mut Scratch) {
        if !scratch.is_traced {
            self.trace(discrete, scratch);
        }
        let Scratch { jacobian, slope, duals, results, inputs: memory, input_duals, .. } = scratch;
        let inputs = inputs_of::<Dual64, M>(self, memory, input_duals);
        let n = M::State::<f64>::COUNTS.reals;
        let (duals, results, slope) = (&mut duals[..n], &mut results[..n], &mut slope[..n]);
        for (dual, x) in duals.iter_mut().zip(x) {
            *dual = Dual64::from(*x);
        }
        match jacobian {
            Jacobian::Dense { matrix, .. } => {
                let matrix = &mut matrix[..n * n];
                for column in 0..n {
                    duals[column].eps = 1.0;
                    self.evaluate(Dual64::from(time), duals, &inputs, discrete, results);
                    duals[column].eps = 0.0;
                    for (row, result) in results.iter().enumerate() {
                        matrix[row * n + column] = result.eps;
                    }
                }
            }
            Jacobian::Sparse(sparse) => {
                let Sparse { by_column, values, groups, .. } = &mut **sparse;
                for group in 0..groups.lines() {
                    let columns = || groups.line(group).iter().map(|&column| column as usize);
                    columns().for_each(|column| duals[column].eps = 1.0);
                    self.evaluate(Dual64::from(time), duals, &inputs, discrete, results);
                    columns().for_each(|column| duals[column].eps = 0.0);
                    for column in columns() {
                        for (value, &row) in values[by_column.range(column)].iter_mut().zip(by_column.line(column)) {
                            *value = results[row as usize].eps;
                        }
                    }
                }
            }
        }
        let mut partial = |inputs: &M::Inputs<Dual64>| {
            self.evaluate(Dual64::new(time, 1.0), duals, inputs, discrete, results);
            slope.iter_mut().zip(&*results).for_each(|(slope, result)| *slope = result.eps);
        };
        if let Some(line) = self.line.as_ref().filter(|_| K::LINEAR) {
            input_duals.iter_mut().zip(line.slopes).for_each(|(dual, slope)| dual.eps = *slope);
            let Inputs { words, booleans, strings, binaries, .. } = memory;
            let all = Values { reals: input_duals, words, booleans, strings, binaries, lengths: self.lengths };
            partial(&M::Inputs::read(all, Counts::ZERO));
        } else if jacobian.follows_time() {
            partial(&inputs);
        } else if K::LINEAR {
            slope.fill(0.0);
        }
    }

    /// Finds the structure of the Jacobian. Equations may branch on parameters, discrete state and inputs that are not
    /// real; the structure is valid for their present values.
    pub(crate) fn trace(&self, discrete: &M::DiscreteState, scratch: &mut Scratch) {
        let n = M::State::<f64>::COUNTS.reals;
        scratch.is_traced = true;
        if n < LEAST_SPARSE {
            return;
        }
        let rows = Dependencies::trace(|| self.dependencies(discrete, &mut scratch.inputs));
        if scratch.traced.as_ref() != Some(&rows) {
            scratch.slope.fill(0.0);
            scratch.jacobian = rows.as_ref().and_then(Jacobian::sparse).unwrap_or_else(|| Jacobian::dense(n));
            scratch.traced = Some(rows);
        }
    }

    /// Dependencies of each derivative on the states, and on the time as the last known variable.
    #[inline(never)]
    fn dependencies(&self, discrete: &M::DiscreteState, memory: &mut Inputs) -> Vec<Dependencies> {
        let n = M::State::<f64>::COUNTS.reals;
        let known: Vec<_> = (0..n).map(Dependencies::on).collect();
        let inputs = &inputs_of::<Dependencies, M>(self, memory, &mut Vec::new());
        let state = &M::State::read(Values::of_states(&known, self.lengths), Counts::ZERO);
        let at = At { time: Dependencies::on(n), state, inputs, derived: self.derived, discrete };
        self.model.derivatives(at).reals()
    }
}

fn inputs_of<T: Scalar, M: Continuous>(
    Problem { inputs, lengths, .. }: &Problem<'_, M>,
    memory: &mut Inputs,
    typed: &mut Vec<T>,
) -> M::Inputs<T> {
    let Inputs { reals, words, booleans, strings, binaries, .. } = memory;
    inputs.write(&mut ValuesMut { reals, words, booleans, strings, binaries, lengths: () }, Counts::ZERO);
    typed.clear();
    typed.extend(reals.iter().map(|&value| T::from(value)));
    M::Inputs::read(Values { reals: typed, words, booleans, strings, binaries, lengths }, Counts::ZERO)
}

/// With a fixed step and at most this many states, states are stored as the model's struct, without the heap.
const MOST_IN_PLACE: usize = 64;

/// Stiff models with at least this many states use the structure of the Jacobian.
const LEAST_SPARSE: usize = 32;

/// Storage of states during the integration.
pub(crate) trait Keep<M: Continuous> {
    type State;
    /// True if inputs can be linear in time.
    const LINEAR: bool;
    fn load(values: Values<'_, f64>, at: Counts, scratch: &mut Scratch) -> Self::State;
    fn store(x: &Self::State, values: &mut ValuesMut<'_, f64>, at: Counts);
    /// Passes a state to the model.
    fn show<R>(x: &Self::State, lengths: &[Length], f: impl FnOnce(&M::State<f64>) -> R) -> R;
    /// Passes a state to the model, which may change it.
    fn change<R>(x: &mut Self::State, lengths: &[Length], f: impl FnOnce(&mut M::State<f64>) -> R) -> R;
    /// One step of fixed length with the classical Runge-Kutta method or the solution in closed form.
    fn fixed(
        problem: &mut Problem<'_, M>,
        x: &Self::State,
        interval: Interval<'_, M>,
        scratch: &mut Scratch,
    ) -> Self::State;
    /// One step of a solver with error control; its error is in `scratch`. `None` if the step's matrix is singular.
    fn estimated(
        problem: &mut Problem<'_, M>,
        x: &Self::State,
        interval: Interval<'_, M>,
        scratch: &mut Scratch,
    ) -> Option<Self::State>;
    /// [`ode::error_norm`] of the error in `scratch`.
    fn error_norm(x: &Self::State, end: &Self::State, tolerance: f64, scratch: &Scratch) -> f64;
    /// Takes back the memory of a state for later use.
    fn recycle(_x: Self::State, _scratch: &mut Scratch) {}
}

pub(crate) const fn is_in_place<M: Continuous>() -> bool {
    matches!(M::SOLVER, Solver::RungeKutta | Solver::Exact) && M::State::<f64>::COUNTS.reals <= MOST_IN_PLACE
}

/// Stores states as the model's struct, for small models with fixed steps.
pub(crate) struct InPlace<const LINEAR: bool>;

impl<M: Continuous, const LINEAR: bool> Keep<M> for InPlace<LINEAR> {
    type State = M::State<f64>;
    const LINEAR: bool = LINEAR;
    #[inline]
    fn load(values: Values<'_, f64>, at: Counts, _: &mut Scratch) -> Self::State {
        M::State::read(values, at)
    }
    #[inline]
    fn store(x: &Self::State, values: &mut ValuesMut<'_, f64>, at: Counts) {
        x.write(values, at);
    }
    #[inline]
    fn show<R>(x: &Self::State, _: &[Length], f: impl FnOnce(&M::State<f64>) -> R) -> R {
        f(x)
    }
    #[inline]
    fn change<R>(x: &mut Self::State, _: &[Length], f: impl FnOnce(&mut M::State<f64>) -> R) -> R {
        f(x)
    }
    #[inline]
    fn fixed(problem: &mut Problem<'_, M>, x: &Self::State, interval: Interval<'_, M>, _: &mut Scratch) -> Self::State {
        let Interval { time, h, discrete } = interval;
        if matches!(M::SOLVER, Solver::Exact) {
            return problem.model.advance(problem.at(time, x, discrete), h);
        }
        let mut f = |time, x: &M::State<f64>| {
            problem.move_to::<Self>(time);
            problem.model.derivatives(problem.at(time, x, discrete))
        };
        let k1 = f(time, x);
        let k2 = f(time + 0.5 * h, &x.combine(&k1, |x, k| x + 0.5 * h * k));
        let k3 = f(time + 0.5 * h, &x.combine(&k2, |x, k| x + 0.5 * h * k));
        let k4 = f(time + h, &x.combine(&k3, |x, k| x + h * k));
        let slope = k1.combine(&k2, |a, b| a + 2.0 * b).combine(&k3, |a, b| a + 2.0 * b).combine(&k4, |a, b| a + b);
        x.combine(&slope, |x, s| x + h / 6.0 * s)
    }
    fn estimated(_: &mut Problem<'_, M>, _: &Self::State, _: Interval<'_, M>, _: &mut Scratch) -> Option<Self::State> {
        unreachable!("a solver with error control keeps its states on the heap")
    }
    fn error_norm(_: &Self::State, _: &Self::State, _: f64, _: &Scratch) -> f64 {
        unreachable!("a solver with error control keeps its states on the heap")
    }
}

/// Stores states on the heap, so that large models need little stack.
pub(crate) struct OnHeap<const LINEAR: bool>;

impl<M: Continuous, const LINEAR: bool> Keep<M> for OnHeap<LINEAR> {
    type State = Vec<f64>;
    const LINEAR: bool = LINEAR;
    fn load(values: Values<'_, f64>, at: Counts, scratch: &mut Scratch) -> Self::State {
        let mut x = scratch.take();
        let n = x.len();
        x.copy_from_slice(&values.reals[at.reals..][..n]);
        x
    }
    fn store(x: &Self::State, values: &mut ValuesMut<'_, f64>, at: Counts) {
        values.reals[at.reals..][..x.len()].copy_from_slice(x);
    }
    #[inline(never)]
    fn show<R>(x: &Self::State, lengths: &[Length], f: impl FnOnce(&M::State<f64>) -> R) -> R {
        f(&M::State::read(Values::of_states(x, lengths), Counts::ZERO))
    }
    #[inline(never)]
    fn change<R>(x: &mut Self::State, lengths: &[Length], f: impl FnOnce(&mut M::State<f64>) -> R) -> R {
        let mut state = M::State::read(Values::of_states(x, lengths), Counts::ZERO);
        let result = f(&mut state);
        state.write(&mut ValuesMut::of_reals(x), Counts::ZERO);
        result
    }
    fn fixed(
        problem: &mut Problem<'_, M>,
        x: &Self::State,
        interval: Interval<'_, M>,
        scratch: &mut Scratch,
    ) -> Self::State {
        let Interval { time, h, discrete } = interval;
        let mut end = scratch.take();
        if matches!(M::SOLVER, Solver::Exact) {
            problem.advance_on_heap(time, x, discrete, h, &mut end);
        } else {
            let f = problem.derivatives::<Self>(discrete);
            let Ok(()) = ode::runge_kutta(f, time, x, h, &mut end, &mut scratch.work);
        }
        end
    }
    fn estimated(
        problem: &mut Problem<'_, M>,
        x: &Self::State,
        interval: Interval<'_, M>,
        scratch: &mut Scratch,
    ) -> Option<Self::State> {
        let Interval { time, h, discrete } = interval;
        // A constant length lets the compiler unroll the loops for small models.
        let n = M::State::<f64>::COUNTS.reals;
        let x = &x[..n];
        if !matches!(M::SOLVER, Solver::Rosenbrock { .. }) {
            let mut end = scratch.take();
            let f = problem.derivatives::<Self>(discrete);
            let Ok(()) = ode::dormand_prince(f, time, x, h, &mut end, &mut scratch.error, &mut scratch.work);
            return Some(end);
        }
        problem.move_to::<Self>(time);
        problem.linearize::<Self>(time, x, discrete, scratch);
        if !scratch.jacobian.factorize(ode::rodas_diagonal(h), n) {
            return None;
        }
        let mut end = scratch.take();
        let Scratch { jacobian, slope, work, error, .. } = scratch;
        let f = problem.derivatives::<Self>(discrete);
        let solve = |b: &mut [f64]| jacobian.solve(b);
        let (slope, end_of, error) = (&slope[..n], &mut end[..n], &mut error[..n]);
        let Ok(()) = ode::rodas(f, solve, time, x, slope, h, end_of, error, &mut work[..ode::RODAS_WORK * n]);
        Some(end)
    }
    fn error_norm(x: &Self::State, end: &Self::State, tolerance: f64, scratch: &Scratch) -> f64 {
        scratch.weight * ode::error_norm(x, end, &scratch.error, &scratch.nominals, tolerance)
    }
    fn recycle(x: Self::State, scratch: &mut Scratch) {
        scratch.states.push(x);
    }
}

/// The Jacobian of a stiff model, replaced by the LU factors of the step's matrix.
enum Jacobian {
    Dense { matrix: Vec<f64>, pivots: Vec<usize> },
    Sparse(Box<Sparse>),
}

struct Sparse {
    by_column: Structure,
    /// Values of the elements, column by column.
    values: Vec<f64>,
    /// Positions of the diagonal elements in `values`.
    diagonal: Vec<u32>,
    /// Groups of columns that one evaluation computes.
    groups: Structure,
    /// True if a derivative depends on the time.
    follows_time: bool,
    lu: SparseLu,
}

impl Default for Jacobian {
    fn default() -> Self {
        Self::dense(0)
    }
}

impl Jacobian {
    fn dense(n: usize) -> Self {
        Self::Dense { matrix: vec![0.0; n * n], pivots: vec![0; n] }
    }

    /// Returns a sparse Jacobian for these [`Problem::dependencies`], or `None` if a dense matrix is faster.
    fn sparse(dependencies: &Structure) -> Option<Self> {
        let n = dependencies.lines();
        let is_state = |&&known: &&u32| (known as usize) < n;
        let mut rows = Structure::default();
        for row in 0..n {
            rows.push(dependencies.line(row).iter().filter(is_state).copied().chain([row as u32]));
        }
        let by_column = rows.transposed(n);
        let lu = SparseLu::new(&by_column, n * n / 8)?;
        let element = |i: usize| {
            let at = by_column.line(i).binary_search(&(i as u32)).expect("the diagonal was added");
            (by_column.range(i).start + at) as u32
        };
        Some(Self::Sparse(Box::new(Sparse {
            values: vec![0.0; by_column.elements()],
            diagonal: (0..n).map(element).collect(),
            groups: groups(&rows, n),
            follows_time: (0..n).any(|row| dependencies.line(row).contains(&(n as u32))),
            by_column,
            lu,
        })))
    }

    fn follows_time(&self) -> bool {
        match self {
            Self::Dense { .. } => true,
            Self::Sparse(sparse) => sparse.follows_time,
        }
    }

    /// Factorizes `diagonal` I - J in place of the Jacobian J. Returns false if the matrix is singular.
    #[inline]
    fn factorize(&mut self, diagonal: f64, n: usize) -> bool {
        match self {
            Self::Dense { matrix, pivots } => {
                let (matrix, pivots) = (&mut matrix[..n * n], &mut pivots[..n]);
                matrix.iter_mut().for_each(|element| *element = -*element);
                (0..n).for_each(|i| matrix[i * n + i] += diagonal);
                dense::factorize(matrix, pivots, n)
            }
            Self::Sparse(sparse) => {
                let Sparse { by_column, values, diagonal: own, lu, .. } = &mut **sparse;
                values.iter_mut().for_each(|element| *element = -*element);
                own.iter().for_each(|&at| values[at as usize] += diagonal);
                lu.factorize(by_column, values)
            }
        }
    }

    #[inline]
    fn solve(&mut self, b: &mut [f64]) {
        let n = b.len();
        match self {
            Self::Dense { matrix, pivots } => dense::solve(&matrix[..n * n], &pivots[..n], n, b),
            Self::Sparse(sparse) => sparse.lu.solve(b),
        }
    }
}

pub(crate) type Inputs = ByType<Vec<f64>, Vec<u64>, Vec<bool>, Vec<String>, Vec<Buffer>>;

/// Working memory of the solvers. Data that remains valid from one step to the next depends only on the equations.
#[derive(Default)]
pub(crate) struct Scratch {
    n: usize,
    /// Unused states.
    states: Vec<Vec<f64>>,
    work: Vec<f64>,
    error: Vec<f64>,
    nominals: Vec<f64>,
    /// Square root of the number of states in memory over the number of present states. With this factor, the norm of
    /// the error is the mean over the present states.
    pub(crate) weight: f64,
    jacobian: Jacobian,
    /// The structure for which the Jacobian was allocated; `Some(None)` if everything depends on everything.
    traced: Option<Option<Structure>>,
    /// True if the structure is valid for the present parameters, discrete state and inputs.
    is_traced: bool,
    /// Hash of the values that equations may branch on, at the last step.
    pub(crate) branches: u64,
    slope: Vec<f64>,
    duals: Vec<Dual64>,
    results: Vec<Dual64>,
    inputs: Inputs,
    input_duals: Vec<Dual64>,
    /// Memory for [`Line`].
    pub(crate) moved: Vec<f64>,
}

/// Maximum number of states in use at the same time.
const STATES: usize = 5;

impl Scratch {
    pub(crate) fn new<M: Continuous>(layout: &Layout) -> Self {
        if is_in_place::<M>() {
            return Self::default();
        }
        let n = M::State::<f64>::COUNTS.reals;
        let is_stiff = matches!(M::SOLVER, Solver::Rosenbrock { .. });
        let parts = match M::SOLVER {
            Solver::RungeKutta => ode::RUNGE_KUTTA_WORK,
            Solver::DormandPrince { .. } => ode::DORMAND_PRINCE_WORK,
            Solver::Rosenbrock { .. } => ode::RODAS_WORK,
            Solver::Exact => 0,
        };
        let linear = if is_stiff { n } else { 0 };
        let counts = if is_stiff { M::Inputs::<f64>::COUNTS } else { Counts::ZERO };
        let inputs = layout.variables.iter().filter(|variable| is_stiff && variable.role == Role::Input);
        let binaries = inputs.filter_map(|input| input.declaration.kind.buffer()).collect();
        Self {
            n,
            states: vec![vec![0.0; n]; STATES],
            work: vec![0.0; parts * n],
            error: vec![0.0; n],
            nominals: layout.states.reals().map(|index| layout.nominal(index)).collect(),
            weight: 1.0,
            jacobian: Jacobian::dense(if linear < LEAST_SPARSE { linear } else { 0 }),
            traced: None,
            is_traced: false,
            branches: 0,
            slope: vec![0.0; linear],
            duals: vec![Dual64::from(0.0); linear],
            results: vec![Dual64::from(0.0); linear],
            inputs: Inputs {
                reals: vec![0.0; counts.reals],
                words: vec![0; counts.words],
                booleans: vec![false; counts.booleans],
                strings: vec![String::new(); counts.strings],
                binaries,
                lengths: (),
            },
            input_duals: vec![Dual64::from(0.0); counts.reals],
            moved: Vec::new(),
        }
    }

    /// Returns true if the memory is not allocated, as in a copy of a saved state.
    #[inline]
    pub(crate) fn is_missing<M: Continuous>(&self) -> bool {
        !is_in_place::<M>() && self.nominals.len() < M::State::<f64>::COUNTS.reals
    }

    fn take(&mut self) -> Vec<f64> {
        self.states.pop().unwrap_or_else(|| vec![0.0; self.n])
    }

    /// Discards the structure of the Jacobian, because values that equations may branch on have changed.
    pub(crate) fn forget_structure(&mut self) {
        self.is_traced = false;
    }
}
