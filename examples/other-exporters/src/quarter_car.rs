//! The quarter car from `examples/quarter-car` over 10 s.

use std::hint::black_box;

use crate::Model;

/// Communication step (s).
const STEP: f64 = 0.001;
/// Steps of the reference solution per communication step. They divide the error of the Runge-Kutta method by 32^4.
const FINE: usize = 32;

/// Road and actuator force in step `k`, which are constant during a communication step.
fn excitation(k: usize) -> [f64; 2] {
    let phase = std::f64::consts::TAU * (k % 1024) as f64 / 1024.0;
    [0.05 * (3.0 * phase).sin(), 100.0 * (7.0 * phase).sin()]
}

fn derivatives(x: [f64; 4], [z_r, f_a]: [f64; 2]) -> [f64; 4] {
    let f = 20_000.0 * (x[0] - x[2]) + 1_500.0 * (x[1] - x[3]) - f_a;
    [x[1], -f / 400.0, x[3], (f - 180_000.0 * (x[2] - z_r)) / 40.0]
}

/// A step of the classical Runge-Kutta method. Returns the outputs after the step.
#[inline(never)]
fn step(x: &mut [f64; 4], u: [f64; 2], h: f64) -> [f64; 5] {
    let along = |k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let k1 = derivatives(*x, u);
    let k2 = derivatives(along(k1, 0.5 * h), u);
    let k3 = derivatives(along(k2, 0.5 * h), u);
    let k4 = derivatives(along(k3, h), u);
    *x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    [x[0], x[1], x[2], x[3], derivatives(*x, u)[1]]
}

/// A run as a user would write it without FMI.
fn function(inputs: &[Vec<f64>]) {
    let mut x = [0.0; 4];
    for u in inputs {
        black_box(step(&mut x, black_box([u[0], u[1]]), STEP));
    }
}

/// Outputs after each communication step, with `parts` Runge-Kutta steps in each.
fn solution(inputs: &[Vec<f64>], parts: usize) -> Vec<Vec<f64>> {
    let mut x = [0.0; 4];
    let mut outputs =
        |u: &Vec<f64>| (0..parts).fold([0.0; 5], |_, _| step(&mut x, [u[0], u[1]], STEP / parts as f64)).to_vec();
    inputs.iter().map(&mut outputs).collect()
}

pub(crate) fn model() -> Model {
    let inputs: Vec<_> = (0..10_000).map(|k| excitation(k).to_vec()).collect();
    Model {
        step: STEP,
        input_names: &["z_r", "f_a"],
        output_names: &["z_s", "v_s", "z_u", "v_u", "a_s"],
        exact: solution(&inputs, FINE),
        inputs,
        function,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// The method has order 4, so halving the step reduces the error to a sixteenth.
    #[test]
    fn the_solution_converges_to_the_exact_one() {
        let model = model();
        let inputs = &model.inputs[..2000];
        let exact = &model.exact[..2000];
        let (one, two) = (difference(&solution(inputs, 1), exact), difference(&solution(inputs, 2), exact));
        assert!((15.0..18.0).contains(&(one / two)), "{one} {two}");
        assert!(difference(&solution(inputs, 2 * FINE), exact) < 1e-6 * one);
    }
}
