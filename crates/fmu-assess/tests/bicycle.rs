//! Evaluators on a linear bicycle model, whose response is known in closed form.

use fmu_assess::{Evaluation, Trace, Value, evaluators};
use rustfft::num_complex::Complex;
use serde_json::json;
use std::f64::consts::{PI, TAU};

const MASS: f64 = 1500.0;
const INERTIA: f64 = 2500.0;
const A: f64 = 1.2;
const B: f64 = 1.5;
const FRONT: f64 = 90_000.0;
const REAR: f64 = 110_000.0;
const SPEED: f64 = 80.0 / 3.6;
const BODY_MASS: f64 = 1300.0;
const ROLL_ARM: f64 = 0.45;
const ROLL_INERTIA: f64 = 600.0;
const ROLL_STIFFNESS: f64 = 60_000.0;
const ROLL_DAMPING: f64 = 4000.0;
const GRAVITY: f64 = 9.81;

/// Lateral velocity, yaw rate, roll angle, roll rate.
type State = [f64; 4];

fn lateral_acceleration([v, r, ..]: State, steer: f64) -> f64 {
    let (front, rear) = forces(v, r, steer);
    (front + rear) / MASS
}

fn forces(v: f64, r: f64, steer: f64) -> (f64, f64) {
    (-FRONT * ((v + A * r) / SPEED - steer), -REAR * (v - B * r) / SPEED)
}

fn derivative(state: State, steer: f64) -> State {
    let [v, r, roll, roll_rate] = state;
    let (front, rear) = forces(v, r, steer);
    let acceleration = (front + rear) / MASS;
    let moment = BODY_MASS * ROLL_ARM * acceleration + (BODY_MASS * GRAVITY * ROLL_ARM - ROLL_STIFFNESS) * roll;
    [
        acceleration - SPEED * r,
        (A * front - B * rear) / INERTIA,
        roll_rate,
        (moment - ROLL_DAMPING * roll_rate) / ROLL_INERTIA,
    ]
}

/// One step with constant steering angle: four Runge-Kutta substeps.
fn advance(mut state: State, steer: f64, step: f64) -> State {
    let h = step / 4.0;
    let moved = |state: State, slope: State, h: f64| std::array::from_fn(|i| state[i] + h * slope[i]);
    for _ in 0..4 {
        let k1 = derivative(state, steer);
        let k2 = derivative(moved(state, k1, h / 2.0), steer);
        let k3 = derivative(moved(state, k2, h / 2.0), steer);
        let k4 = derivative(moved(state, k3, h), steer);
        state = std::array::from_fn(|i| state[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    state
}

/// A recorded run: a row after each step, with the steering angle held during the step.
fn run(step: f64, rows: u32, steer: impl Fn(f64) -> f64) -> Trace<'static> {
    let (mut state, mut columns) = ([0.0; 4], vec![Vec::new(); 6]);
    for row in 1..=rows {
        let held = steer(f64::from(row - 1) * step);
        state = advance(state, held, step);
        let [v, r, roll, _] = state;
        let values = [f64::from(row) * step, held, r, lateral_acceleration(state, held), roll, (v / SPEED).atan()];
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    let names = ["driver.steer", "vehicle.yaw_rate", "vehicle.lateral_acceleration", "body.roll", "vehicle.sideslip"];
    let mut columns = columns.into_iter();
    let trace = Trace::new(columns.next().unwrap());
    names.into_iter().zip(columns).fold(trace, |trace, (name, column)| trace.with(name, column).unwrap())
}

fn evaluate(name: &str, trace: &Trace<'_>) -> Evaluation {
    evaluators::find(name).unwrap().evaluate(trace, &json!({})).unwrap()
}

#[track_caller]
fn number(evaluation: &Evaluation, name: &str) -> f64 {
    match evaluation.value(name) {
        Some(Value::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    }
}

#[track_caller]
fn numbers(evaluation: &Evaluation, name: &str) -> Vec<f64> {
    match evaluation.value(name) {
        Some(Value::Numbers(numbers)) => numbers.iter().map(|number| number.unwrap()).collect(),
        other => panic!("{name}: {other:?}"),
    }
}

/// Reference: check numbers for a ramp to 0.02 rad between 1 s and 1.1 s, with rows of 1 ms over 5 s. Tolerance: half
/// of the last digit.
#[test]
fn step_steer() {
    let trace = run(0.001, 5_000, |time| 0.02 * ((time - 1.0) / 0.1).clamp(0.0, 1.0));
    let evaluation = evaluate("step_steer", &trace);
    for (name, expected, tolerance) in [
        ("t0", 1.051, 1e-9),
        ("steer", 0.02, 1e-12),
        ("yaw_rate.steady", 0.103_852_3, 5e-8),
        // Closed form u/(L + K u^2), plus the remaining oscillation in the last second.
        ("yaw_rate.gain", 5.192_615, 1e-6),
        ("yaw_rate.response_time", 0.191_738_8, 5e-8),
        ("yaw_rate.peak_response_time", 0.397, 1e-9),
        ("yaw_rate.overshoot", 0.050_101_0, 5e-8),
        ("lateral_acceleration.gain", 115.391_45, 1e-4),
        ("lateral_acceleration.response_time", 0.380_291_0, 5e-8),
        ("roll.overshoot", 0.038_442_5, 5e-8),
        ("tb_factor", 0.002_769_75, 5e-9),
    ] {
        let found = number(&evaluation, name);
        assert!((found - expected).abs() <= tolerance, "{name}: {found}, expected {expected}");
    }
}

/// Response of yaw rate and lateral acceleration to the steering angle at a frequency, Hz.
fn closed_form(frequency: f64) -> [Complex<f64>; 2] {
    let s = Complex::new(0.0, TAU * frequency);
    let (a11, a12) = (-(FRONT + REAR) / (MASS * SPEED), -(A * FRONT - B * REAR) / (MASS * SPEED) - SPEED);
    let a21 = -(A * FRONT - B * REAR) / (INERTIA * SPEED);
    let a22 = -(A * A * FRONT + B * B * REAR) / (INERTIA * SPEED);
    let (b1, b2) = (FRONT / MASS, A * FRONT / INERTIA);
    let determinant = (s - a11) * (s - a22) - a12 * a21;
    let v = ((s - a22) * b1 + a12 * b2) / determinant;
    let r = ((s - a11) * b2 + a21 * b1) / determinant;
    [r, s * v + r * SPEED]
}

/// Check numbers for the closed form, to the last digit.
#[test]
fn closed_form_of_the_yaw_rate() {
    for (frequency, gain, phase) in [
        (0.2, 5.221_742_0, -0.093_227_8),
        (0.5, 5.306_534_1, -0.258_432_4),
        (1.0, 5.039_285_5, -0.597_842_7),
        (2.0, 3.367_230_9, -1.072_827_6),
        (3.0, 2.304_237_9, -1.258_516_4),
    ] {
        let [yaw_rate, _] = closed_form(frequency);
        assert!((yaw_rate.norm() - gain).abs() < 5.1e-7, "{frequency} Hz: {}", yaw_rate.norm());
        assert!((yaw_rate.arg() - phase).abs() < 1e-7, "{frequency} Hz: {}", yaw_rate.arg());
    }
}

/// Reference: the closed form. Tolerance: the error with 2 ms rows. It is larger for the lateral acceleration, which
/// has a direct feedthrough and is sampled after the step.
#[test]
fn frequency_response() {
    let lines = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.3, 2.6, 3.0, 3.5, 4.0];
    let multisine = |time: f64| {
        let wave = lines.iter().enumerate().map(|(i, f)| {
            let i = (i + 1) as f64;
            (TAU * f * (time - 1.0) - PI * i * (i - 1.0) / 20.0).sin()
        });
        if time < 1.0 - 1e-9 { 0.0 } else { 0.003 * wave.sum::<f64>() }
    };
    let evaluation = evaluate("frequency_response", &run(0.002, 16_000, multisine));
    assert_eq!(numbers(&evaluation, "frequency"), lines);
    for (index, name, gain_tolerance, phase_tolerance) in
        [(0, "yaw_rate", 2.1e-4, 5e-5), (1, "lateral_acceleration", 0.009, 0.03)]
    {
        let (gains, phases) =
            (numbers(&evaluation, &format!("{name}.gain")), numbers(&evaluation, &format!("{name}.phase")));
        for ((frequency, gain), phase) in lines.iter().zip(gains).zip(phases) {
            let expected = closed_form(*frequency)[index];
            let share = gain / expected.norm() - 1.0;
            assert!(share.abs() < gain_tolerance, "{name}, {frequency} Hz: gain {gain}, share {share}");
            let difference = phase - expected.arg();
            assert!(difference.abs() < phase_tolerance, "{name}, {frequency} Hz: phase {phase}, {difference}");
        }
    }
    // Tolerance: the gain is interpolated between the frequencies of the multisine; the exact gain is 3 dB lower at
    // 1.802 Hz.
    assert!((number(&evaluation, "yaw_rate.bandwidth") - 1.802_095).abs() < 0.02);
    assert!((number(&evaluation, "yaw_rate.reference_gain") / closed_form(0.2)[0].norm() - 1.0).abs() < 2.1e-4);
}
