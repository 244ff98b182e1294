//! Compares the bounces with their closed form.

use bouncing_ball::BouncingBall;
use fmu::simulation::ContinuousSimulation;

/// Bounces until the ball is at rest, each with its time and rebound velocity: v_n = e^n sqrt(2 g h_0),
/// t_1 = sqrt(2 h_0 / g), t_n+1 = t_n + 2 v_n / g.
fn bounces(ball: &BouncingBall) -> Vec<(f64, f64)> {
    let mut time = (2.0 / ball.g).sqrt();
    let mut velocity = ball.restitution * (2.0 * ball.g).sqrt();
    let mut all = Vec::new();
    while velocity >= ball.least_velocity {
        all.push((time, velocity));
        time += 2.0 * velocity / ball.g;
        velocity *= ball.restitution;
    }
    all.push((time, 0.0));
    all
}

/// Tolerance: the parabola is integrated exactly, and the time of an event is found to one part in 1e15 of a step. Each
/// of the 18 bounces inherits the velocity error of the previous bounce, so 1e-9 leaves a margin of a factor of about
/// 1e5.
#[test]
fn bounces_happen_at_the_times_of_the_closed_form() {
    for step in [0.01, 0.003, 0.37] {
        let ball = BouncingBall::default();
        let g = ball.g;
        let expected = bounces(&ball);
        let mut run = ContinuousSimulation::new(ball).expect("it starts");
        let mut seen = 0;
        while run.time() < 3.0 {
            run.step(&(), step).expect("a step");
            let (time, state, contact) = (run.time(), run.state(), run.outputs(&()));
            let count = expected.iter().filter(|(bounce, _)| *bounce <= time).count();
            assert_eq!(contact.bounces as usize, count, "at {time} s in steps of {step} s");
            assert_eq!(contact.at_rest, count == expected.len());
            if contact.at_rest {
                assert_eq!((state.height, state.velocity), (0.0, 0.0));
            } else if count > 0 {
                let (bounce, rebound) = expected[count - 1];
                // The time of the last bounce follows from the current velocity.
                let found = time - (rebound - state.velocity) / g;
                assert!((found - bounce).abs() < 1e-9, "bounce {count}: {} s", found - bounce);
                let flight = time - bounce;
                assert!((state.height - (rebound * flight - 0.5 * g * flight * flight)).abs() < 1e-9);
                seen = seen.max(count);
            }
        }
        assert!(run.outputs(&()).at_rest && seen >= 5, "{seen} bounces seen in steps of {step} s");
    }
}

/// Infinitely many bounces would end at t_1 + 2 v_1 / (g (1 - e)) = 2.558 s. A step far beyond this time is possible
/// because the ball comes to rest before that.
#[test]
fn the_ball_comes_to_rest() {
    let mut run = ContinuousSimulation::new(BouncingBall::default()).expect("it starts");
    run.step(&(), 100.0).expect("a step over all bounces");
    assert!(run.outputs(&()).at_rest);
    assert_eq!((run.state().height, run.state().velocity), (0.0, 0.0));
}
