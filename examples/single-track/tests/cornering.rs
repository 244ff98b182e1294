//! Compares steady cornering with closed forms.

use fmu::simulation::ContinuousSimulation;
use single_track::{SingleTrack, U};

const STEP: f64 = 0.01;

/// Turns the front wheels to `angle` within a second and waits until the motion is steady. Returns yaw rate and lateral
/// acceleration.
fn corner(model: SingleTrack, angle: f64) -> (f64, f64) {
    let mut run = ContinuousSimulation::new(model).expect("it starts");
    for k in 0..2000 {
        let steer_rate = if k < 100 { angle } else { 0.0 };
        run.step(&U { steer_rate }, STEP).expect("a step");
    }
    (run.state().yaw_rate, run.outputs(&U { steer_rate: 0.0 }).lateral_acceleration)
}

/// Reference: r = u delta / (l + m u^2 (b C_r - a C_f) / (l C_f C_r)), the yaw rate of the linear single-track model.
/// Tolerance: the tires lose (C alpha / (mu F_z))^2 / 3 of their stiffness, which is 1e-6 at a slip angle of 1e-4 rad.
#[test]
fn a_small_steering_angle_has_the_yaw_rate_of_the_linear_model() {
    let p = SingleTrack::default();
    let (length, angle) = (p.front + p.rear, 1e-4);
    let understeer = p.mass * (p.rear * p.rear_stiffness - p.front * p.front_stiffness)
        / (length * p.front_stiffness * p.rear_stiffness);
    let expected = p.speed * angle / (length + understeer * p.speed.powi(2));
    let (yaw_rate, acceleration) = corner(p.clone(), angle);
    assert!((yaw_rate / expected - 1.0).abs() < 3e-6, "{yaw_rate} {expected}");
    assert!((acceleration / (p.speed * expected) - 1.0).abs() < 3e-6, "{acceleration}");
}

/// Reference: friction times gravity, the limit of both axles together. The car understeers: its front axle reaches the
/// limit first. Tolerance: tanh(C alpha / (mu F_z)) of the front axle is 0.92 at a slip angle of 0.1 rad.
#[test]
fn a_large_steering_angle_reaches_the_friction() {
    let p = SingleTrack::default();
    let limit = p.friction * 9.81;
    let (_, acceleration) = corner(p, 0.15);
    assert!(acceleration < limit && acceleration > 0.9 * limit, "{acceleration} {limit}");
}
