//! Compares the controller with its equations.

use dc_motor_controller::{DcMotorController, U};
use fmu::simulation::DiscreteSimulation;

/// Reference: u_n = k_p e + k_i n T e for a constant error e. The tolerance covers the rounding of 100 additions.
#[test]
fn a_constant_error_is_integrated() {
    let DcMotorController { proportional_gain, integral_gain, .. } = DcMotorController::default();
    let mut run = DiscreteSimulation::new(DcMotorController::default()).expect("it starts");
    let inputs = U { reference_speed: 20.0, speed: 5.0, enabled: true };
    for n in 0..100 {
        let y = run.sample(&inputs).expect("a sample");
        let expected = 15.0 * (proportional_gain + integral_gain * f64::from(n) * run.sample_time());
        assert!((y.voltage - expected).abs() < 1e-12, "sample {n}: {}", y.voltage - expected);
        assert!(!y.saturated);
    }
}

#[test]
fn the_voltage_and_its_integral_stop_at_the_limit() {
    let mut run = DiscreteSimulation::new(DcMotorController::default()).expect("it starts");
    for _ in 0..1000 {
        let y = run.sample(&U { reference_speed: -500.0, speed: 0.0, enabled: true }).expect("a sample");
        assert_eq!((y.voltage, y.saturated), (-24.0, true));
    }
    assert_eq!(run.state().integral, 0.0);
}

#[test]
fn a_controller_that_is_off_forgets_its_integral() {
    let mut run = DiscreteSimulation::new(DcMotorController::default()).expect("it starts");
    let on = U { reference_speed: 10.0, ..U::default() };
    let first = run.sample(&on).expect("a sample").voltage;
    assert!(run.sample(&on).expect("a sample").voltage > first);
    let off = run.sample(&U { enabled: false, ..on }).expect("a sample");
    assert_eq!((off.voltage, off.saturated), (0.0, false));
    assert_eq!(run.sample(&U { reference_speed: 10.0, ..U::default() }).expect("a sample").voltage, first);
}
