//! Bounces of the ball. Reference: the closed form t_1 = sqrt(-2 h_0 / g), v_n = e^n sqrt(-2 g h_0),
//! t_n+1 = t_n - 2 v_n / g, evaluated to nine decimals.

use fmu::simulation::ContinuousSimulation;
use reference_bouncing_ball::{ReferenceBouncingBall, V_MIN};

/// Times of the first five bounces, s.
const TIMES: [f64; 5] = [0.451_523_641, 1.083_656_738, 1.526_149_907, 1.835_895_124, 2.052_716_777];
/// Velocities before and after the first bounce, m/s.
const FIRST: (f64, f64) = (-4.429_446_918, 3.100_612_843);

/// Tolerance: half of the last decimal of the references.
#[test]
fn the_first_bounces_happen_at_the_times_of_the_closed_form() {
    for step in [0.01, 0.003] {
        let ball = ReferenceBouncingBall::default();
        let (g, e) = (ball.g, ball.e);
        let mut run = ContinuousSimulation::new(ball).expect("it starts");
        let mut bounces = 0;
        while run.time() < 2.1 {
            let velocity = run.state().v;
            run.step(&(), step).expect("a step");
            let (time, state) = (run.time(), run.state());
            if state.v > velocity {
                // The parabola after the bounce starts at the ground: h = v t + g t^2 / 2 with the velocity at the bounce.
                let rebound = (state.v * state.v - 2.0 * g * state.h).sqrt();
                let before = -rebound / e;
                let bounce = time - (state.v - rebound) / g;
                assert!((bounce - TIMES[bounces]).abs() < 0.5e-9, "bounce {bounces}: {bounce} s");
                if bounces == 0 {
                    assert!((before - FIRST.0).abs() < 0.5e-9 && (rebound - FIRST.1).abs() < 0.5e-9);
                }
                bounces += 1;
            }
        }
        assert_eq!(bounces, TIMES.len());
    }
}

/// The rebound is slower than 0.1 m/s after the 11th bounce, because 0.7^11 * 4.429 = 0.0876 and 0.7^10 * 4.429 = 0.125.
/// This bounce happens at t_1 (1 + 2 (e + ... + e^10)) = 2.4991 s.
#[test]
fn the_ball_rests_after_the_eleventh_bounce() {
    let mut run = ContinuousSimulation::new(ReferenceBouncingBall::default()).expect("it starts");
    let sum: f64 = (1..=10).map(|n| 0.7_f64.powi(n)).sum();
    let last = (2.0_f64 / 9.81).sqrt() * (1.0 + 2.0 * sum);
    run.step(&(), last - 1e-6).expect("a step");
    assert!(run.state().v < -V_MIN && run.state().h > 0.0);
    run.step(&(), 2e-6).expect("a step");
    assert_eq!((run.state().h, run.state().v), (0.0, 0.0));
    run.step(&(), 1.0).expect("a step");
    assert_eq!((run.state().h, run.state().v), (0.0, 0.0));
}
