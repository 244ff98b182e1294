//! Closed forms, symmetry and limits of the suspension law.

use proptest::prelude::*;

use super::*;

/// Enabled, with the same values at all wheels.
fn inputs(gains: [f64; 3], a: f64, v: f64) -> U {
    let four = |value| FourWheels([value; 4]);
    U { enable: true, k_p: four(gains[0]), k_i: four(gains[1]), k_d: four(gains[2]), a: four(a), v: four(v) }
}

fn force(p: &SemiActivePidSuspension, x: &mut X, u: &U) -> f64 {
    p.update(Sample { time: 0.0, state: x, inputs: u, derived: &() }).f[0]
}

fn active() -> SemiActivePidSuspension {
    SemiActivePidSuspension { constraint: Constraint::None, f_leak: 0.0, ..SemiActivePidSuspension::default() }
}

#[test]
fn without_leak_the_sum_of_increments_is_a_pid_law() {
    // f = -(K_p a + K_i sum a + K_d (a - a1)); exact with powers of 2.
    let (p, mut x) = (active(), X::default());
    let gains = [8.0, 0.5, 2.0];
    assert_eq!(force(&p, &mut x, &inputs(gains, 1.0, 0.0)), -10.5);
    assert_eq!(force(&p, &mut x, &inputs(gains, 3.0, 0.0)), -(24.0 + 2.0 + 4.0));
    assert_eq!(
        force(&SemiActivePidSuspension { gain: 2.0, ..p }, &mut x, &inputs(gains, -1.0, 0.0)),
        -2.0 * (-8.0 + 1.5 - 8.0)
    );
}

#[test]
fn the_integral_is_a_skyhook_damper() {
    // K_i/T_s times the velocity of the body: 0.8 kg / 1 ms = 800 N s/m. 100 samples of 2 m/s2 give 0.2 m/s. Tolerance:
    // rounding.
    let (p, mut x) = (active(), X::default());
    let mut f = 0.0;
    for _ in 0..100 {
        f = force(&p, &mut x, &inputs([0.0, 0.8, 0.0], 2.0, 0.0));
    }
    assert!((f + 800.0 * 0.2).abs() < 1e-10, "{f}");
}

#[test]
fn the_law_leaks_and_is_limited() {
    // The law decays by the factor exp(-2 pi 0.1 Hz 1 ms) per sample. It reaches e^-1 after 1/(2 pi 0.1 Hz) = 1.5915 s,
    // rounded to 1592 samples (an error of 3e-4).
    let p = SemiActivePidSuspension { constraint: Constraint::None, ..SemiActivePidSuspension::default() };
    let mut x = X { u: [100.0; 4], ..X::default() };
    let mut f = 0.0;
    for _ in 0..1592 {
        f = force(&p, &mut x, &inputs([60.0, 0.8, 3.0], 0.0, 0.0));
    }
    assert!((f / (-100.0 * (-1.0_f64).exp()) - 1.0).abs() < 5e-4, "{f}");
    // Neither the force nor the accumulated law exceeds the limit, so the force falls as soon as the acceleration
    // changes its sign.
    for _ in 0..100 {
        f = force(&p, &mut x, &inputs([0.0, 80.0, 0.0], 5.0, 0.0));
    }
    assert_eq!((f, x.u[0]), (-1500.0, 1500.0));
    assert!(force(&p, &mut x, &inputs([0.0, 80.0, 0.0], -5.0, 0.0)) > -1101.0);
}

#[test]
fn a_damper_makes_only_forces_against_its_velocity() {
    // The added damping is limited to 3000 N s/m, and the force to 1500 N.
    let p = SemiActivePidSuspension::default();
    let with = |a: f64, v: f64| force(&p, &mut X::default(), &inputs([0.0, 1000.0, 0.0], a, v));
    assert_eq!(with(1.0, 0.1), -300.0);
    assert_eq!(with(1.0, 2.0), -1000.0);
    assert_eq!(with(10.0, 2.0), -1500.0);
    assert_eq!(with(1.0, -0.1), 0.0);
    assert_eq!(with(-1.0, -0.1), 300.0);
    assert_eq!(with(1.0, 0.0), 0.0);
}

#[test]
fn switched_off_it_forgets() {
    let p = active();
    let mut x = X { u: [100.0; 4], a1: [3.0; 4], a2: [2.0; 4] };
    let off = U { enable: false, ..inputs([60.0, 0.8, 3.0], 1.5, 0.0) };
    assert_eq!(force(&p, &mut x, &off), 0.0);
    assert_eq!((x.u, x.a1, x.a2), ([0.0; 4], [1.5; 4], [1.5; 4]));
    // After the law is switched on again at the same acceleration, only the integral part acts.
    assert_eq!(force(&p, &mut x, &inputs([60.0, 2.0, 3.0], 1.5, 0.0)), -3.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// For any sequence, no wheel feeds power into the suspension, forces stay within both limits, and negated inputs
    /// give negated forces bit for bit.
    #[test]
    fn forces_are_dissipative_limited_and_odd(
        gains in prop::array::uniform3(0.0..200.0_f64),
        samples in prop::collection::vec((prop::array::uniform4(-20.0..20.0_f64), prop::array::uniform4(-1.0..1.0_f64)), 1..20),
    ) {
        let p = SemiActivePidSuspension::default();
        let (mut x, mut turned) = (X::default(), X::default());
        for (a, v) in samples {
            let u = U { a: FourWheels(a), v: FourWheels(v), ..inputs(gains, 0.0, 0.0) };
            let f = p.update(Sample { time: 0.0, state: &mut x, inputs: &u, derived: &() }).f;
            for i in 0..4 {
                prop_assert!(f[i] * v[i] <= 0.0 && f[i].abs() <= p.f_max && f[i].abs() <= p.c_add * v[i].abs());
                prop_assert!(x.u[i].abs() <= p.f_max);
            }
            let opposite = U { a: FourWheels(a.map(|a| -a)), v: FourWheels(v.map(|v| -v)), ..u };
            let g = p.update(Sample { time: 0.0, state: &mut turned, inputs: &opposite, derived: &() }).f;
            prop_assert_eq!(*f, g.map(|g| -g));
        }
    }
}
