//! Compares the response to a step of the voltage with its closed form.

use dc_motor::{DcMotor, U};
use fmu::simulation::ContinuousSimulation;

/// Reference: x' = A x + b from rest. With the eigenvalues p and q of A, the end value x_e = -A^-1 b and x'(0) = b, x =
/// x_e + (q x_e + b) / (p - q) e^(p t) - (p x_e + b) / (p - q) e^(q t). Tolerance: with p = -95 1/s, a step of 1 ms has
/// an error of (p h)^5 / 120 = 6e-8, which decays within 10 steps. The tolerance is ten times this error, relative to
/// the greatest values.
#[test]
fn current_and_speed_follow_the_closed_form() {
    let DcMotor { resistance, inductance, constant, inertia, friction } = DcMotor::default();
    let u = U { voltage: 12.0, load_torque: 0.1 };
    let sum = -resistance / inductance - friction / inertia;
    let determinant = (resistance * friction + constant * constant) / (inductance * inertia);
    let root = (0.25 * sum * sum - determinant).sqrt();
    assert!(root.is_finite(), "real eigenvalues");
    let (p, q) = (0.5 * sum - root, 0.5 * sum + root);
    let divisor = resistance * friction + constant * constant;
    let end = [
        (friction * u.voltage + constant * u.load_torque) / divisor,
        (constant * u.voltage - resistance * u.load_torque) / divisor,
    ];
    let slope = [u.voltage / inductance, -u.load_torque / inertia];

    let mut run = ContinuousSimulation::new(DcMotor::default()).expect("it starts");
    for _ in 0..2000 {
        run.step(&u, 1e-3).expect("a step");
        let time = run.time();
        let expected = [0, 1].map(|i| {
            let (x, b) = (end[i], slope[i]);
            x + (q * x + b) / (p - q) * (p * time).exp() - (p * x + b) / (p - q) * (q * time).exp()
        });
        let state = run.state();
        assert!((state.current - expected[0]).abs() < 6e-7 * 24.0, "{} A at {time} s", state.current - expected[0]);
        assert!((state.speed - expected[1]).abs() < 6e-7 * 220.0, "{} rad/s at {time} s", state.speed - expected[1]);
        assert_eq!(run.outputs(&u).torque, constant * state.current);
    }
}
