//! A linear system x' = A x + B u, y = C x + D u, whose numbers of inputs, states and outputs are structural parameters.
//! Names and start values are those of the Reference FMU StateSpace.

use fmu::prelude::*;

/// Greatest number of inputs, states and outputs.
const MOST: usize = 5;

/// Parameters: the sizes and the matrices.
#[derive(Parameters)]
pub struct StateSpace {
    /// Number of inputs
    #[var(structural, start = 3, max = 5, tunable)]
    pub m: u64,
    /// Number of states
    #[var(structural, start = 3, max = 5, tunable)]
    pub n: u64,
    /// Number of outputs
    #[var(structural, start = 3, max = 5, tunable)]
    pub r: u64,
    /// Matrix coefficient A (1)
    #[var("A", size = ["n", "n"], start = identity, tunable)]
    pub a: Matrix<f64, MOST, MOST>,
    /// Matrix coefficient B (1)
    #[var("B", size = ["n", "m"], start = identity, tunable)]
    pub b: Matrix<f64, MOST, MOST>,
    /// Matrix coefficient C (1)
    #[var("C", size = ["r", "n"], start = identity, tunable)]
    pub c: Matrix<f64, MOST, MOST>,
    /// Matrix coefficient D (1)
    #[var("D", size = ["r", "m"], start = identity, tunable)]
    pub d: Matrix<f64, MOST, MOST>,
    /// Initial state vector (1)
    #[var(size = "n", start = 0.0)]
    pub x0: Array<f64, MOST>,
}

/// The inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Input vector (1)
    #[var(size = "m", start = [1.0, 2.0, 3.0, 0.0, 0.0])]
    pub u: Array<T, MOST>,
}

/// The outputs.
#[derive(Outputs)]
pub struct Y<T> {
    /// Output vector (1)
    #[var(size = "r")]
    pub y: Array<T, MOST>,
}

/// The states.
#[derive(State)]
pub struct X<T> {
    /// State vector (1)
    #[var(size = "n", calculated, local)]
    pub x: Array<T, MOST>,
}

/// The sum of a row of one matrix times a vector, and of a row of another matrix times another vector.
fn sum<T: Scalar>(a: &[f64], x: &[T], b: &[f64], u: &[T]) -> T {
    let terms = a.iter().zip(x).chain(b.iter().zip(u));
    terms.fold(T::from(0.0), |sum, (&a, &x)| sum + x * a)
}

/// Linear system whose sizes can change
#[fmu::model(stop_time = 10.0, step_size = 1.0)]
impl Continuous for StateSpace {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    type State<T: Scalar> = X<T>;

    fn initialize(&self, (): &(), state: &mut X<f64>) {
        state.x = self.x0;
    }

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let (x, u) = (&at.state.x, &at.inputs.u);
        X { x: Array::from_fn(x.len(), |i| sum(&self.a[i], x, &self.b[i], u)) }
    }

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        let (x, u) = (&at.state.x, &at.inputs.u);
        Y { y: Array::from_fn(self.c.len(), |i| sum(&self.c[i], x, &self.d[i], u)) }
    }
}

#[cfg(test)]
mod tests {
    use fmu::simulation::ContinuousSimulation;

    use super::*;

    /// Runs a model to 1 s with these inputs. A step of 0.001 s with the classical Runge-Kutta method has an error below
    /// e × 0.001^4 / 120 = 2.3e-14; sums of 1,000 steps round by less than 1e-12.
    fn run(model: StateSpace, u: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut run = ContinuousSimulation::new(model).unwrap();
        let inputs = U { u: Array::from_fn(u.len(), |i| u[i]) };
        for _ in 0..1000 {
            run.step(&inputs, 0.001).unwrap();
        }
        (run.state().x.to_vec(), run.outputs(&inputs).y.to_vec())
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        }
    }

    /// x' = x + u with x(0) = 0: y = x + u = u exp(t).
    #[test]
    fn three_independent_states_grow_exponentially() {
        let (_, y) = run(StateSpace::default(), &[1.0, 2.0, 3.0]);
        let e = std::f64::consts::E;
        assert_near(&y, &[e, 2.0 * e, 3.0 * e]);
    }

    /// x1' = x2 + 1, x2' = -x1: x = (sin t, cos t - 1).
    #[test]
    fn two_states_oscillate() {
        let values = [[0.0, 1.0], [-1.0, 0.0]];
        let a = Array::from_fn(2, |i| Array::from_fn(2, |j| values[i][j]));
        let d = Array::from_fn(2, |_| Array::from_fn(2, |_| 0.0));
        let (x, y) = run(StateSpace { m: 2, n: 2, r: 2, a, d, ..StateSpace::default() }, &[1.0, 0.0]);
        let expected = [1.0_f64.sin(), 1.0_f64.cos() - 1.0];
        assert_near(&x, &expected);
        assert_near(&y, &expected);
    }

    /// Without states, y = D u.
    #[test]
    fn a_system_without_states_passes_its_inputs_on() {
        let (x, y) = run(StateSpace { n: 0, ..StateSpace::default() }, &[1.0, 2.0, 3.0]);
        assert_near(&x, &[]);
        assert_near(&y, &[1.0, 2.0, 3.0]);
    }
}
