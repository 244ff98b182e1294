//! Tests against reference values, which an independent implementation computed, and closed forms.

use fmu::Dual64;
use proptest::prelude::*;

use super::*;

fn at<'a>(state: &'a X<f64>, inputs: &'a U<f64>) -> At<'a, f64, BrakeAndDriveActuators> {
    At { time: 0.0, state, inputs, derived: &(), discrete: &() }
}

fn outputs(u: &U<f64>) -> Y<f64> {
    BrakeAndDriveActuators::default().outputs(at(&X::default(), u))
}

#[test]
fn the_pedal_has_the_reference_values() {
    // The expected pressures, in MPa, are compared to their last printed digit.
    for (brake, expected) in [(1.0, 10.440_576), (0.5, 5.170_288), (0.0, 0.0), (0.005, 0.0), (-1.0, 0.0)] {
        let actual = outputs(&U { brake, ..U::default() }).p_master;
        assert!((actual - expected).abs() <= 5e-7, "{actual} {expected}");
    }
}

#[test]
fn the_drive_is_limited_by_torque_and_power() {
    let torque = |throttle: f64, omega: f64| {
        let y = outputs(&U { throttle, omega: FourWheels([omega + 1.0, omega - 1.0, 500.0, 500.0]), ..U::default() });
        assert_eq!((y.t_d[0], y.t_d[2], y.t_d[3]), (y.t_d[1], 0.0, 0.0));
        y.t_d[0]
    };
    // The torque is 1100 N m up to 75 kW / 1100 N m = 68 rad/s; half of it acts at each wheel.
    assert_eq!(torque(1.0, 0.0), 550.0);
    assert_eq!(torque(1.0, 68.0), 550.0);
    assert_eq!(torque(1.0, 100.0), 375.0);
    assert_eq!(torque(0.5, 100.0), 187.5);
    assert_eq!((torque(-1.0, 10.0), torque(2.0, 10.0)), (0.0, 550.0));
    // When the wheels roll backward, only the torque limit acts.
    assert_eq!(torque(1.0, -100.0), 550.0);
}

#[test]
fn torques_are_proportional_to_the_pressures() {
    // The torques are 167.48 (front) and 66.396 N m (rear) per MPa, except for rounding.
    let x = X { p: FourWheels([1.0, 2.0, 3.0, 4.0]) };
    let t_b = BrakeAndDriveActuators::default().outputs(at(&x, &U::default())).t_b;
    for (actual, expected) in t_b.iter().zip([167.48, 334.96, 199.188, 265.584]) {
        assert!((actual - expected).abs() < 1e-12);
    }
}

proptest! {
    /// The exact step solves the differential equation: its derivative with respect to the step size is p' at its end,
    /// and two partial steps give the result of one. The tolerances cover a few roundings of pressures up to 12 MPa.
    #[test]
    fn the_step_is_the_solution(
        p_0 in prop::array::uniform4(0.0..12.0_f64), p_cmd in prop::array::uniform4(0.0..12.0_f64),
        h in 1e-5..0.1_f64, part in 0.0..1.0_f64,
    ) {
        let p = BrakeAndDriveActuators::default();
        let u = U { p_cmd: FourWheels(p_cmd), ..U::default() };
        let x = X { p: FourWheels(p_0) };
        let whole = p.advance(at(&x, &u), h);
        let first = p.advance(at(&x, &u), part * h);
        let second = p.advance(at(&first, &u), (1.0 - part) * h);
        let rate = p.derivatives(at(&whole, &u));
        for i in 0..4 {
            prop_assert!((whole.p[i] - second.p[i]).abs() < 1e-13);
            // The derivative of p_cmd + (p_0 - p_cmd) exp(-h/tau), computed with a dual number.
            let slope = Scalar::exp(-Dual64::new(h, 1.0) / p.tau_p) * (p_0[i] - p_cmd[i]);
            prop_assert!((rate.p[i] - slope.eps).abs() < 1e-10);
        }
    }
}
