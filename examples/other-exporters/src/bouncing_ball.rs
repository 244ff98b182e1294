//! A ball that falls from 1 m and bounces, over 2.5 s: eleven bounces.

use std::hint::black_box;

use crate::Model;

/// Communication step (s).
const STEP: f64 = 0.01;
const GRAVITY: f64 = 9.81;
const RESTITUTION: f64 = 0.7;

/// Exact height at a time before the ball comes to rest, computed from the times of the bounces.
fn height(time: f64) -> f64 {
    let mut bounce = (2.0 / GRAVITY).sqrt();
    if time < bounce {
        return 1.0 - 0.5 * GRAVITY * time * time;
    }
    let mut rebound = RESTITUTION * (2.0 * GRAVITY).sqrt();
    while bounce + 2.0 * rebound / GRAVITY <= time {
        bounce += 2.0 * rebound / GRAVITY;
        rebound *= RESTITUTION;
    }
    let flight = time - bounce;
    rebound * flight - 0.5 * GRAVITY * flight * flight
}

/// A communication step, in closed form: the ball follows a parabola between two bounces.
#[inline(never)]
fn step((mut height, mut velocity): (f64, f64)) -> (f64, f64) {
    let mut rest = STEP;
    loop {
        let impact = (velocity * velocity + 2.0 * GRAVITY * height).sqrt();
        let fall = (velocity + impact) / GRAVITY;
        if fall > rest {
            return (height + rest * (velocity - 0.5 * GRAVITY * rest), velocity - GRAVITY * rest);
        }
        rest -= fall;
        (height, velocity) = (0.0, RESTITUTION * impact);
    }
}

/// A run as a user would write it without FMI.
fn function(inputs: &[Vec<f64>]) {
    let mut ball = (1.0, 0.0);
    for _ in inputs {
        ball = black_box(step(black_box(ball)));
    }
}

/// The model; `outputs` is the name of the height.
pub(crate) fn model(outputs: &'static [&'static str]) -> Model {
    let inputs = vec![Vec::new(); 250];
    Model {
        step: STEP,
        input_names: &[],
        output_names: outputs,
        exact: (1..=inputs.len()).map(|k| vec![height(k as f64 * STEP)]).collect(),
        inputs,
        function,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_function_follows_the_closed_form() {
        let mut ball = (1.0, 0.0);
        for exact in model(&["h"]).exact {
            ball = step(ball);
            assert!((ball.0 - exact[0]).abs() < 1e-12, "{} {}", ball.0, exact[0]);
        }
    }
}
