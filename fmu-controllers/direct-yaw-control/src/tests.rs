//! Check numbers, closed forms, symmetry and limits of yaw control.

use proptest::prelude::*;

use super::*;

fn derived(p: &DirectYawControl) -> D {
    equations::derived(p).unwrap()
}

fn sample(p: &DirectYawControl, x: &mut X, u: &U) -> Y {
    p.update(Sample { time: 0.0, state: x, inputs: u, derived: &derived(p) })
}

/// Straight ahead at 60 km/h, enabled.
fn driving() -> U {
    U { enable: true, u: data::SPEED, ..U::default() }
}

#[test]
fn the_linear_model_has_the_check_numbers() {
    let stability = derived(&DirectYawControl::default()).stability;
    assert!((stability - 7.999_03e-4).abs() < 5e-10);
    assert!((stability.sqrt().recip() - 35.357).abs() < 5e-4); // characteristic speed, m/s
}

#[test]
fn the_references_reach_the_steady_turn_and_its_limits() {
    let p = DirectYawControl::default();
    let settled = |delta: f64| {
        let mut x = X::default();
        for _ in 0..1000 {
            sample(&p, &mut x, &U { delta, ..driving() });
        }
        x
    };
    // Check number: yaw rate gain at 60 km/h in 1/s. After 5 s, which are 50 time constants, the turn is steady.
    let x = settled(0.01);
    assert!((x.r_d / 0.01 - 5.827_63).abs() < 5e-6);
    // The friction limits are 0.85 mu g/u for the yaw rate and atan(0.02 mu g) for sideslip.
    let x = settled(-0.5);
    assert!((x.r_d + 0.85 * 0.77 * 9.81 / data::SPEED).abs() < 1e-12);
    assert!((x.beta_d.abs() - (0.02_f64 * 0.77 * 9.81).atan()).abs() < 1e-12);
}

#[test]
fn the_reference_is_a_first_order_lag() {
    // The first sample covers 1 - exp(-T/tau) of the step, even while the control is disabled.
    let p = DirectYawControl::default();
    let mut x = X::default();
    let y = sample(&p, &mut x, &U { delta: 0.01, enable: false, ..driving() });
    assert!((y.r_d - 0.058_276_3 * (1.0 - (-0.05_f64).exp())).abs() < 1e-8);
    assert_eq!((y.dm, *y.pressure), (0.0, [0.0; 4]));
}

#[test]
fn the_moment_makes_the_surface_fall_as_the_reaching_law_says() {
    // With this moment, the surface of the linear model follows d(sigma)/dt = -k_s sigma - eta sat(sigma/layer). The
    // rates of the model are written out here with numbers. Tolerance: a few rounding errors.
    let p = DirectYawControl { layer: 0.5, ..DirectYawControl::default() };
    let d = derived(&p);
    let mut x = X { r_d: 0.1, beta_d: -0.01 };
    let u = U { delta: 0.02, beta: 0.005, r: 0.05, ..driving() };
    let y = sample(&p, &mut x, &u);
    assert!(y.dm.abs() < p.moment_max && y.dm.abs() > p.deadband, "{}", y.dm);
    let (front, rear) = (u.beta + 1.10 * u.r / u.u - u.delta, u.beta - 1.24 * u.r / u.u);
    let (f_f, f_r) = (-76_000.0 * front, -84_000.0 * rear);
    let beta_rate = (f_f + f_r) / (1360.0 * u.u) - u.r;
    let yaw_acceleration = (1.10 * f_f - 1.24 * f_r + y.dm) / 1497.64;
    let gain = u.u / (2.34 * (1.0 + d.stability * u.u * u.u));
    let beta_gain = (1.24 - 1.10 * 1360.0 * u.u * u.u / (84_000.0 * 2.34)) / (2.34 * (1.0 + d.stability * u.u * u.u));
    let rates = [(gain * u.delta - x.r_d) / 0.1, (beta_gain * u.delta - x.beta_d) / 0.1];
    let c = -0.0107 / 0.0124;
    let sigma = u.r - x.r_d + c * (u.beta - x.beta_d);
    let sigma_rate = yaw_acceleration - rates[0] + c * (beta_rate - rates[1]);
    assert!((sigma_rate + 5.0 * sigma + 1.0 * sigma / 0.5).abs() < 1e-12, "{sigma_rate} {sigma}");
}

#[test]
fn brakes_of_one_side_make_the_moment() {
    // dM = 2 F_d track/2: two wheels on one side, each with F_d = pressure C/R, at half the track. Exact up to
    // rounding.
    let p = DirectYawControl::default();
    let y = sample(&p, &mut X::default(), &U { r: -0.02, ..driving() });
    assert!(y.dm > p.deadband && y.dm < p.moment_max);
    assert_eq!((y.pressure[1], y.pressure[3]), (0.0, 0.0));
    for (pressure, gain) in [(y.pressure[0], data::BRAKE_GAIN[0]), (y.pressure[2], data::BRAKE_GAIN[1])] {
        let force = pressure * 1e6 * gain / data::RADIUS;
        assert!((force * data::TRACK / y.dm - 1.0).abs() < 1e-14);
    }
    // Small moments brake no wheel. Large moments are limited; at the rear, the pressure limit acts.
    let small = sample(
        &DirectYawControl { deadband: 1e5, ..DirectYawControl::default() },
        &mut X::default(),
        &U { r: -0.02, ..driving() },
    );
    assert_eq!((small.dm, *small.pressure), (y.dm, [0.0; 4]));
    let great = sample(&p, &mut X::default(), &U { delta: -0.5, ..driving() });
    assert_eq!((great.dm, great.pressure[1], great.pressure[2], great.pressure[3]), (6000.0, 0.0, 8.0, 0.0));
    assert!((great.pressure[0] - 0.29 * 6000.0 / 1.36 / 167.48).abs() < 1e-14);
}

#[test]
fn a_slow_car_is_left_alone() {
    let p = DirectYawControl::default();
    for u in [3.0, 0.0, -5.0] {
        let y = sample(&p, &mut X::default(), &U { r: 0.5, delta: 0.3, u, ..driving() });
        assert_eq!((y.dm, *y.pressure), (0.0, [0.0; 4]));
        assert!(y.r_d.is_finite());
    }
}

#[test]
fn an_oversteering_car_has_finite_references() {
    // For K < 0, 1 + K u^2 would change its sign at the critical speed; it is kept at 0.05.
    let p = DirectYawControl { k: TwoAxles([120_000.0, 60_000.0]), ..DirectYawControl::default() };
    assert!(derived(&p).stability < 0.0);
    let mut x = X::default();
    for u in [10.0, 20.0, 40.0] {
        let y = sample(&p, &mut x, &U { u, delta: 0.01, ..driving() });
        assert!(y.r_d > 0.0 && y.dm.is_finite());
    }
}

#[test]
fn a_surface_without_yaw_rate_is_rejected() {
    let message = equations::derived(&DirectYawControl { s2: 0.0, ..DirectYawControl::default() }).unwrap_err();
    assert!(message.starts_with("'surface.weight.yaw_rate' must not be 0"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Exchanging left and right mirrors the result bit for bit. Pressures stay within their limits and act on one side
    /// only.
    #[test]
    fn control_is_odd_and_limited(
        r_d in -1.0..1.0, beta_d in -0.2..0.2, delta in -0.5..0.5, u in 0.0..50.0, beta in -0.5..0.5, r in -2.0..2.0,
    ) {
        let p = DirectYawControl::default();
        let (mut left, mut right) = (X { r_d, beta_d }, X { r_d: -r_d, beta_d: -beta_d });
        let y = sample(&p, &mut left, &U { enable: true, delta, u, beta, r });
        let mirror = sample(&p, &mut right, &U { enable: true, delta: -delta, u, beta: -beta, r: -r });
        prop_assert_eq!((y.dm, y.r_d, y.beta_d), (-mirror.dm, -mirror.r_d, -mirror.beta_d));
        prop_assert_eq!(*y.pressure, [1, 0, 3, 2].map(|i| mirror.pressure[i]));
        prop_assert!(y.dm.abs() <= p.moment_max);
        for i in 0..4 {
            prop_assert!((0.0..=p.pressure_max).contains(&y.pressure[i]));
            prop_assert!(y.pressure[i] == 0.0 || y.dm * left_is_positive(i) > 0.0);
        }
    }
}
