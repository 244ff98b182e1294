//! Compares the closed loop with the exact solution between samples.

use std::path::Path;

use dc_motor_drive::{DcMotorDrive, U};
use fmu::Stateful as _;
use nalgebra::{Matrix4, Vector4};

/// Reference: the motor with a held voltage as a matrix exponential of [A B; 0 0], the controller as its recurrence.
/// Tolerance: the error of each Runge-Kutta step of 1 ms is 6e-8, relative to 100 rad/s and 48 A. About ten of these
/// errors add up.
#[test]
fn speed_and_current_follow_the_exact_solution() {
    let model = DcMotorDrive::default();
    let (m, c) = (model.motor.clone(), model.controller.clone());
    let inputs = U { reference_speed: 100.0, load_torque: 0.2, enabled: true };
    let matrix = Matrix4::new(
        -m.resistance / m.inductance,
        -m.constant / m.inductance,
        1.0 / m.inductance,
        0.0,
        m.constant / m.inertia,
        -m.friction / m.inertia,
        0.0,
        -1.0 / m.inertia,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    );
    const SAMPLE_TIME: f64 = 0.002;
    // Matrix exponential by its series, which has converged after 30 terms.
    let (mut advance, mut term) = (Matrix4::identity(), Matrix4::identity());
    for k in 1..=30 {
        term *= matrix * (SAMPLE_TIME / f64::from(k));
        advance += term;
    }
    let (mut x, mut integral) = (Vector4::new(0.0, 0.0, 0.0, inputs.load_torque), 0.0);

    let mut drive = model.start(Path::new("")).expect("it starts");
    for k in 0..200 {
        model.step(&mut drive, &inputs, 0.01 * f64::from(k), 0.01).expect("a step");
        for _ in 0..5 {
            let error = inputs.reference_speed - x[1];
            let voltage = c.proportional_gain * error + c.integral_gain * integral;
            if voltage.abs() <= c.voltage_limit {
                integral += error * SAMPLE_TIME;
            }
            x[2] = voltage.clamp(-c.voltage_limit, c.voltage_limit);
            x = advance * x;
        }
        let y = model.outputs(&drive);
        assert!((y.current - x[0]).abs() < 6e-7 * 48.0, "{} A in step {k}", y.current - x[0]);
        assert!((y.speed - x[1]).abs() < 6e-7 * 100.0, "{} rad/s in step {k}", y.speed - x[1]);
    }
}

/// Reference: in the steady state, the integral has removed the control error, so k i = b w + M and v = R i + k w.
/// Tolerance: after 30 s, nothing is left of the slowest mode, which has a time constant of 0.1 s.
#[test]
fn the_load_does_not_change_the_steady_speed() {
    let model = DcMotorDrive::default();
    let mut drive = model.start(Path::new("")).expect("it starts");
    let inputs = U { load_torque: 0.3, ..U::default() };
    for k in 0..3000 {
        model.step(&mut drive, &inputs, 0.01 * f64::from(k), 0.01).expect("a step");
    }
    let (y, motor) = (model.outputs(&drive), &model.motor);
    let current = (motor.friction * 100.0 + inputs.load_torque) / motor.constant;
    assert!((y.speed - 100.0).abs() < 1e-9, "{}", y.speed);
    assert!((y.current - current).abs() < 1e-9, "{}", y.current);
    assert!((y.voltage - motor.resistance * current - motor.constant * 100.0).abs() < 1e-9, "{}", y.voltage);
}

/// The samples stay the same if communication steps are not multiples of the sample time. The tolerance is that of the
/// first test, because the integration steps differ.
#[test]
fn samples_do_not_depend_on_the_communication_steps() {
    let model = DcMotorDrive::default();
    let ends = [0.01, 0.0007, 0.5].map(|step: f64| {
        let mut drive = model.start(Path::new("")).expect("it starts");
        let steps = (0.7 / step).floor() as u32;
        for k in 0..steps {
            model.step(&mut drive, &U::default(), step * f64::from(k), step).expect("a step");
        }
        let rest = 0.7 - step * f64::from(steps);
        if rest > 1e-9 {
            model.step(&mut drive, &U::default(), 0.7 - rest, rest).expect("a step");
        }
        model.outputs(&drive).speed
    });
    // In the last case, the run of 0.7 s consists of a step of 0.5 s and a step of 0.2 s.
    for speed in &ends[1..] {
        assert!((speed - ends[0]).abs() < 6e-7 * 100.0, "{ends:?}");
    }
}
