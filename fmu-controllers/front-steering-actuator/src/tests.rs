//! Compares the front axle with the equations in the README, written out here.

use approx::assert_abs_diff_eq;

use super::*;

/// Angle after one sample, rad.
fn sample(p: &FrontSteeringActuator, x: &mut X, steer: f64, u: f64) -> f64 {
    p.update(Sample { time: 0.0, derived: &p.derived().unwrap(), state: x, inputs: &U { steer, u } }).delta[0]
}

/// The equations in the order of the README, with numbers of the rescue vehicle. Its axles carry equal loads, so W_F/g
/// is a third of the mass. Tolerance: a few rounding errors of angles below 1 rad.
#[test]
fn the_axle_follows_the_equations() {
    let p = FrontSteeringActuator::default();
    let (a, w_f, c_f, t) = (p.a, 12_000.0, 600_000.0, 0.001);
    let mut x = X::default();
    let mut last = 0.0;
    for k in 0..20_000 {
        let time = f64::from(k) * t;
        let (steer, speed) = (0.5 * (0.8 * time).sin(), 12.0 * (0.3 * time).sin().abs());
        let u = speed.max(0.5);
        let gain = u / (a + w_f * u * u / c_f);
        let limit = (3.743 / u / gain).atan().min(32.0_f64.to_radians());
        let step = 10.0_f64.to_radians() * t;
        let expected = last + (steer.clamp(-limit, limit) - last).clamp(-step, step);
        let found = sample(&p, &mut x, steer, speed);
        assert_abs_diff_eq!(found, expected, epsilon = 1e-15);
        last = found;
    }
}

/// After a step of pi/6 at 35 km/h, the angle rises by 10 deg/s up to 9.8995 deg (check number from an independent
/// implementation, 4 decimals).
#[test]
fn a_step_slews_to_the_angle_of_the_largest_lateral_acceleration() {
    let p = FrontSteeringActuator::default();
    let mut x = X::default();
    for n in 1..=2000 {
        let angle = sample(&p, &mut x, std::f64::consts::FRAC_PI_6, 35.0 / 3.6).to_degrees();
        assert_abs_diff_eq!(angle, (0.01 * f64::from(n)).min(9.8995), epsilon = 1e-4);
    }
}

/// Without a rate limit, the axle follows at once. Left and right are mirror images.
#[test]
fn without_a_rate_limit_only_the_angle_is_limited() {
    for reference_model in [ReferenceModel::TwoDegreesOfFreedom, ReferenceModel::ZeroSideslip] {
        let p = FrontSteeringActuator { front_rate: 0.0, reference_model, ..FrontSteeringActuator::default() };
        let at = |steer| sample(&p, &mut X::default(), steer, 10.0);
        assert_eq!(at(0.05), 0.05);
        assert!(at(0.4) < 0.2);
        assert_eq!(at(-0.4), -at(0.4));
    }
}
