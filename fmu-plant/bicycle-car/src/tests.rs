//! Tests against the closed forms in the README, and against "reference values": values from an independent
//! implementation, compared to their last printed digit.

use fmu::ContinuousState as _;
use fmu::simulation::ContinuousSimulation;
use fmu::{Dual64, Variables};
use proptest::prelude::*;

use super::*;

/// 80 km/h.
const SPEED: f64 = 80.0 / 3.6;
const STATES: usize = <X<f64> as Variables<f64>>::COUNTS.reals;

fn input(u: f64, delta: f64) -> U<f64> {
    U { u, delta: FrontAxle([delta]), mu: FrontLeftWheel([1.0]) }
}

/// Asserts that `found` rounds to `printed`, whose last digit has the place value `last`.
#[track_caller]
fn assert_printed(found: f64, printed: f64, last: f64) {
    assert!((found - printed).abs() <= 0.5000001 * last, "{found} is not {printed}");
}

/// K in rad/(m/s2).
fn understeer_gradient(p: &BicycleCar) -> f64 {
    let [c_f, c_r] = p.c.0;
    p.m * (p.b * c_r - p.a * c_f) / ((p.a + p.b) * c_f * c_r)
}

/// State and outputs after `time` seconds with constant inputs, starting straight ahead.
fn settled(p: &BicycleCar, u: &U<f64>, time: f64) -> (X<f64>, Y<f64>) {
    let mut run = ContinuousSimulation::new(p.clone()).unwrap();
    for _ in 0..(time * 1e3) as u32 {
        run.step(u, 1e-3).unwrap();
    }
    let y = run.outputs(u);
    (run.state(), y)
}

/// Column `j` of the Jacobian matrix of the derivatives, straight ahead. The columns are the states, then the steering
/// angle. Dual numbers make the result exact.
fn column(p: &BicycleCar, u: f64, j: usize) -> Vec<f64> {
    let seed = |i: usize| f64::from(u8::from(i == j));
    let x: Vec<_> = (0..STATES).map(|i| Dual64::new(0.0, seed(i))).collect();
    let u = U { u: u.into(), delta: FrontAxle([Dual64::new(0.0, seed(STATES))]), mu: FrontLeftWheel([1.0.into()]) };
    equations::derivatives(p, &X::from_reals(&x), &u).reals().into_iter().map(|rate| rate.eps).collect()
}

/// A and B of the lateral motion x' = A x + B delta, with the states x = (lateral velocity, yaw rate).
fn lateral_motion(p: &BicycleCar, u: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    let [v, r, delta] = [0, 1, STATES].map(|j| column(p, u, j));
    ([[v[0], r[0]], [v[1], r[1]]], [delta[0], delta[1]])
}

/// Frequency response from the steering angle to yaw rate and lateral acceleration at the angular frequency `w` in
/// rad/s: gain and phase of each, from (s I - A)^-1 B.
fn response(p: &BicycleCar, w: f64) -> [[f64; 2]; 2] {
    let ([[a, b], [c, d]], [e, f]) = lateral_motion(p, SPEED);
    // Complex numbers as pairs.
    let times = |x: [f64; 2], y: [f64; 2]| [x[0] * y[0] - x[1] * y[1], x[0] * y[1] + x[1] * y[0]];
    let over = |x: [f64; 2], y: [f64; 2]| times(x, [y[0], -y[1]]).map(|part| part / (y[0] * y[0] + y[1] * y[1]));
    let determinant = {
        let product = times([-a, w], [-d, w]);
        [product[0] - b * c, product[1]]
    };
    let v = over([-d * e + b * f, w * e], determinant);
    let r = over([c * e - a * f, w * f], determinant);
    // a_y = v' + u r
    let a_y = [-w * v[1] + SPEED * r[0], w * v[0] + SPEED * r[1]];
    [r, a_y].map(|h| [(h[0] * h[0] + h[1] * h[1]).sqrt(), h[1].atan2(h[0])])
}

/// After 10 s, transients with a decay rate of 6 1/s have fallen to e^-60. The tolerances cover rounding and the
/// relative difference between an angle of 1e-4 rad and its sine, below 1e-8.
#[test]
fn steady_state_is_the_closed_form() {
    let p = BicycleCar::default();
    let (l, k) = (p.a + p.b, understeer_gradient(&p));
    assert_printed(k, 0.003198653, 1e-9);
    assert_printed((l / k).sqrt(), 29.05349, 1e-5);
    let delta = 1e-4;
    let (x, y) = settled(&p, &input(SPEED, delta), 10.0);
    let yaw_gain = SPEED / (l + k * SPEED * SPEED);
    assert!((x.r / delta / yaw_gain - 1.0).abs() < 1e-12);
    assert_printed(x.r / delta, 5.192615, 1e-6);
    assert_printed(y.a_y / delta, 115.39145, 1e-5);
    // beta = (b - m a u^2/(C_r L)) r/u
    let beta = (p.b - p.m * p.a * SPEED * SPEED / (p.c[1] * l)) * x.r / SPEED;
    assert!((y.beta / beta - 1.0).abs() < 1e-8);
    assert_printed(y.beta / delta, -0.3488406, 1e-7);
    let roll = p.m_s * p.h_s / (p.k_phi - p.m_s * p.g * p.h_s);
    assert!((x.phi / y.a_y / roll - 1.0).abs() < 1e-12);
    assert_printed(x.phi / y.a_y, 0.010781194, 1e-9);
    assert!((y.ratio / y.a_y - 2.0 * 0.55 / (9.81 * 1.5)).abs() < 1e-15);
    assert_eq!(y.u, SPEED);
    // The path is a circle, whose center does not move.
    let radius = (SPEED * SPEED + x.v * x.v).sqrt() / x.r;
    let center = |x: &X<f64>| {
        let course = x.psi + x.v.atan2(SPEED);
        [x.x - radius * course.sin(), x.y + radius * course.cos()]
    };
    let (later, _) = settled(&p, &input(SPEED, delta), 15.0);
    let [found, expected] = [center(&later), center(&x)];
    assert!((found[0] - expected[0]).abs() < 1e-7 && (found[1] - expected[1]).abs() < 1e-7, "{found:?}, {expected:?}");
}

#[test]
fn natural_frequency_and_damping_match_the_reference_values() {
    let ([[a, b], [c, d]], _) = lateral_motion(&BicycleCar::default(), SPEED);
    let frequency = (a * d - b * c).sqrt();
    assert_printed(frequency, 7.859538, 1e-6);
    assert_printed(-(a + d) / (2.0 * frequency), 0.813521, 1e-6);
}

#[test]
fn frequency_response_matches_the_reference_values() {
    let p = BicycleCar::default();
    let at = |hertz: f64| response(&p, std::f64::consts::TAU * hertz);
    for (hertz, gain, phase) in [
        (0.2, 5.2217420, -0.0932278),
        (0.5, 5.3065341, -0.2584324),
        // The specification prints 5.0392855; the formula gives 5.0392857735.
        (1.0, 5.0392858, -0.5978427),
        (2.0, 3.3672309, -1.0728276),
        (3.0, 2.3042379, -1.2585164),
    ] {
        let [found, _] = at(hertz);
        assert_printed(found[0], gain, 1e-7);
        assert_printed(found[1], phase, 1e-7);
    }
    let falls = |signal: usize, bandwidth: f64| {
        let share = |hertz: f64| at(hertz)[signal][0] / at(0.0)[signal][0] * 2.0_f64.sqrt();
        assert!(share(bandwidth - 1e-6) > 1.0 && share(bandwidth + 1e-6) < 1.0, "{bandwidth} Hz");
    };
    falls(0, 1.802095);
    falls(1, 0.814440);
}

/// Time at which the signal first rises through a level after row `from`, interpolated linearly. Rows are 1 ms apart;
/// the first row is at 1 ms.
fn rises(signal: &[f64], level: f64, from: usize) -> f64 {
    let k = (from + 1..signal.len()).find(|&k| signal[k - 1] < level && level <= signal[k]).unwrap();
    (k as f64 + (level - signal[k - 1]) / (signal[k] - signal[k - 1])) * 1e-3
}

/// Reference values for a ramp to 0.02 rad within 0.1 s, starting at 1 s, at 80 km/h. Each row contains the steering
/// angle that was held during the preceding step.
#[test]
fn step_response_has_the_metrics_of_the_specification() {
    let mut run = ContinuousSimulation::new(BicycleCar::default()).unwrap();
    let (mut steer, mut yaw_rate, mut a_y, mut roll, mut beta) = (vec![], vec![], vec![], vec![], vec![]);
    for k in 0..5000 {
        let u = input(SPEED, 0.02 * ((f64::from(k) * 1e-3 - 1.0) / 0.1).clamp(0.0, 1.0));
        run.step(&u, 1e-3).unwrap();
        let (x, y) = (run.state(), run.outputs(&u));
        steer.push(u.delta[0]);
        yaw_rate.push(x.r);
        a_y.push(y.a_y);
        roll.push(x.phi);
        beta.push(y.beta);
    }
    let steady = |signal: &[f64]| signal[4000..].iter().sum::<f64>() / 1000.0;
    let peak = |signal: &[f64]| signal.iter().copied().fold(0.0, f64::max);
    let peak_time = |signal: &[f64]| {
        let k = signal.iter().position(|&value| value == peak(signal)).unwrap();
        (k + 1) as f64 * 1e-3
    };
    let t_0 = rises(&steer, 0.01, 0);
    // Rounding decides whether the ramp passes half its height in this row or at the start of the next.
    assert!((t_0 - 1.051).abs() < 1e-9, "{t_0}");
    let response_time = |signal: &[f64]| rises(signal, 0.9 * steady(signal), 1048) - t_0;
    assert_printed(steady(&yaw_rate), 0.1038523, 1e-7);
    assert_printed(response_time(&yaw_rate), 0.1917388, 1e-7);
    assert!((peak_time(&yaw_rate) - t_0 - 0.397).abs() < 1e-9);
    assert_printed(peak(&yaw_rate) / steady(&yaw_rate) - 1.0, 0.0501010, 1e-7);
    assert_printed(response_time(&a_y), 0.3802910, 1e-7);
    assert_printed(peak(&roll) / steady(&roll) - 1.0, 0.0384425, 1e-7);
    assert_printed((peak_time(&yaw_rate) - t_0) * steady(&beta).abs(), 0.00276975, 1e-8);
}

/// At small slip angles, the saturating tire has the same slope as the linear tire. The relative difference between
/// tanh(x) and x is x^2/3, which is 1e-8 for alpha = 1e-5 rad and C/(mu F_z) = 15 1/rad.
#[test]
fn saturating_tires_start_with_the_cornering_stiffness() {
    let linear = BicycleCar::default();
    let saturating = BicycleCar { mu_0: 0.9, ..linear.clone() };
    let [(a, _), (b, _)] = [&linear, &saturating].map(|p| settled(p, &input(SPEED, 1e-5), 2.0));
    for (a, b) in a.reals().into_iter().zip(b.reals()) {
        assert!((a - b).abs() <= 1e-7 * a.abs(), "{a}, {b}");
    }
    assert_ne!(a.r, b.r);
}

/// The greatest lateral acceleration is the product of gravity and the friction coefficients of tire and road. At a
/// large argument x of tanh, a share of 1 - 2 e^-2x of this product is reached.
#[test]
fn saturating_tires_hold_no_more_than_the_friction() {
    let p = BicycleCar { mu_0: 0.9, ..BicycleCar::default() };
    let x = X { v: -SPEED, ..X::default() };
    for mu in [1.0, 0.5, 0.1] {
        let u = U { mu: FrontLeftWheel([mu]), ..input(SPEED, 1.0) };
        let a_y = equations::outputs(&p, &x, &u).a_y;
        assert!((a_y / (mu * 0.9 * 9.81) - 1.0).abs() < 1e-6, "{a_y}");
    }
    let ice = U { mu: FrontLeftWheel([0.0]), ..input(SPEED, 1.0) };
    for x in [x, X::default()] {
        assert_eq!(equations::outputs(&p, &x, &ice).a_y, 0.0);
        assert_eq!(equations::outputs(&BicycleCar::default(), &x, &ice).a_y, 0.0);
    }
}

#[test]
fn below_the_minimum_speed_slip_angles_are_computed_with_the_minimum_speed() {
    let p = BicycleCar::default();
    let x = X { v: 0.1, r: 0.2, ..X::default() };
    let [rest, floor, above] = [0.0, 0.5, 0.6].map(|u| equations::outputs(&p, &x, &input(u, 0.01)));
    assert_eq!([rest.a_y, rest.rd, rest.beta], [floor.a_y, floor.rd, floor.beta]);
    assert_eq!(rest.u, 0.0);
    assert_ne!(above.a_y, floor.a_y);
    // Expected forces from the formula F = -C ((v +- a r)/0.5 - delta), where 0.5 is the minimum speed.
    let [f_f, f_r] = [-90e3 * ((0.1 + 1.2 * 0.2) / 0.5 - 0.01), -110e3 * ((0.1 - 1.5 * 0.2) / 0.5)];
    assert!((rest.a_y - (f_f + f_r) / 1500.0).abs() < 1e-12);
    assert!((rest.rd - (1.2 * f_f - 1.5 * f_r) / 2500.0).abs() < 1e-12);
}

#[test]
fn the_load_transfer_ratio_ends_at_1() {
    let outputs = |v: f64| equations::outputs(&BicycleCar::default(), &X { v, ..X::default() }, &input(20.0, 0.0));
    assert_eq!([outputs(-9.0).ratio, outputs(9.0).ratio], [1.0, -1.0]);
    assert!(outputs(-1.0).ratio < 1.0);
}

proptest! {
    /// Mirrored inputs give mirrored results, bit for bit, because either all terms of a sum change sign or none does.
    #[test]
    fn mirrored_vehicle_is_mirrored(
        mu_0 in prop_oneof![Just(0.0), 0.1..1.5_f64], u in 0.0..40.0_f64, delta in -0.3..0.3_f64, mu in 0.1..1.0_f64,
        values in proptest::collection::vec(-1.0..1.0_f64, STATES)
    ) {
        let p = BicycleCar { mu_0, ..BicycleCar::default() };
        let x = X::from_reals(&values);
        let mirrored = |x: &X<f64>| X { x: x.x, ..X::from_reals(&x.reals().iter().map(|value| -value).collect::<Vec<_>>()) };
        let inputs = |delta| U { mu: FrontLeftWheel([mu]), ..input(u, delta) };
        let [left, right] = [(x.copied(), delta), (mirrored(&x), -delta)].map(|(x, delta)| {
            (equations::derivatives(&p, &x, &inputs(delta)), equations::outputs(&p, &x, &inputs(delta)))
        });
        prop_assert_eq!(mirrored(&left.0).reals(), right.0.reals());
        let Y { u, beta, rd, a_y, ratio } = left.1;
        prop_assert_eq!(vec![u, -beta, -rd, -a_y, -ratio], right.1.reals());
    }
}
