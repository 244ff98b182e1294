//! Check numbers, the demanded motion, and the stability of the surface.
//!
//! "Check numbers" were computed by an independent implementation of the law and are compared to their last printed
//! digit.

use approx::assert_abs_diff_eq;
use nalgebra::Matrix3;
use proptest::prelude::*;

use super::*;

fn check(p: &ComfortSlidingMode) -> Result<(), String> {
    p.check(&Sample { time: 0.0, derived: &(), state: &mut (), inputs: &U::default() })
}

fn forces(p: &ComfortSlidingMode, u: &U) -> Y {
    p.update(Sample { time: 0.0, derived: &(), state: &mut (), inputs: u })
}

/// The paper's second parameter set, Table 5, found by a genetic algorithm.
fn genetic() -> ComfortSlidingMode {
    ComfortSlidingMode {
        n1: -2.55,
        n2: 9.7,
        n3: -0.063,
        eta: 14.939,
        mu: 0.15,
        zeta: 0.39,
        ..ComfortSlidingMode::default()
    }
}

fn inputs(x1: f64, x2: f64, x3: f64, x4: f64) -> U {
    U { x1: LeftSide([x1]), x2, x3: LeftSide([x3]), x4 }
}

/// Coefficients of the characteristic polynomial on the surface S = 0, highest power first. The actuator force cancels
/// in the sum of the two force balances: m_u x3' + m_s x4' = -k_t x1. With x4 = -(n1 x1 + n2 x2 + n3 x3), this is a
/// system of third order in x1, x2.
fn sliding_polynomial(p: &ComfortSlidingMode) -> [f64; 4] {
    let d = p.m_u - p.m_s * p.n3;
    [d, p.m_u * p.n2 - p.m_s * p.n1, p.k_t, p.k_t * p.n2]
}

/// Returns true if all roots of the polynomial (eigenvalues of its companion matrix) are in the left half plane.
fn is_stable([a3, a2, a1, a0]: [f64; 4]) -> bool {
    let companion = Matrix3::new(-a2 / a3, -a1 / a3, -a0 / a3, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    companion.complex_eigenvalues().iter().all(|root| root.re < 0.0)
}

#[test]
fn the_forces_have_the_check_numbers() {
    let u = inputs(0.01, 0.02, -0.1, 0.05);
    let y = forces(&ComfortSlidingMode::default(), &u);
    assert_abs_diff_eq!(y.f[0], -603.8105750, epsilon = 5e-8);
    assert_abs_diff_eq!(y.f[1], -268.0918953, epsilon = 5e-8);
    assert_abs_diff_eq!(y.s, 0.057368, epsilon = 1e-15);
    let y = forces(&genetic(), &u);
    assert_abs_diff_eq!(y.f[0], -2970.221626, epsilon = 5e-7);
    assert_abs_diff_eq!(y.f[1], -1158.386434, epsilon = 5e-7);
    assert_abs_diff_eq!(y.s, 0.2248, epsilon = 1e-15);
}

#[test]
fn at_rest_there_is_no_force() {
    let y = forces(&ComfortSlidingMode::default(), &U::default());
    assert_eq!((y.f.0, y.s), ([0.0; 2], 0.0));
}

#[test]
fn the_limit_holds_for_the_left_force_and_its_share() {
    let p = ComfortSlidingMode { limit: 500.0, ..ComfortSlidingMode::default() };
    let y = forces(&p, &inputs(0.01, 0.02, -0.1, 0.05));
    assert_eq!(y.f.0, [-500.0, p.zeta * -500.0]);
}

#[test]
fn both_parameter_sets_slide_stably() {
    // Coefficients: check numbers.
    let [d, a2, a1, a0] = sliding_polynomial(&ComfortSlidingMode::default());
    assert_abs_diff_eq!(d, 50.0, epsilon = 1e-12);
    assert_abs_diff_eq!(a2, 909.67, epsilon = 1e-9);
    assert_abs_diff_eq!(a2 / d, 18.19, epsilon = 5e-3);
    assert_abs_diff_eq!(a1 / d, 3800.0, epsilon = 1e-9);
    assert_abs_diff_eq!(a0 / d, 2492.0, epsilon = 0.5);
    let [d, a2, ..] = sliding_polynomial(&genetic());
    assert_abs_diff_eq!(d, 146.08, epsilon = 0.006);
    assert_abs_diff_eq!(a2, 4373.75, epsilon = 1e-9);
    for p in [ComfortSlidingMode::default(), genetic()] {
        assert!(is_stable(sliding_polynomial(&p)));
        // A negative n1 damps the wheel.
        assert!(p.n1 < 0.0);
    }
}

#[test]
fn the_conditions_of_the_paper_accept_an_unstable_surface() {
    // Eq. 22 requires D > 0, m_u n2 - m_s n1 > 0 and n2 > 0. With n1 = 0.01 1/s, these hold, but n2 n3 - n1 < 0.
    let p = ComfortSlidingMode { n1: 0.01, ..ComfortSlidingMode::default() };
    let [d, a2, a1, a0] = sliding_polynomial(&p);
    assert!(d > 0.0 && a2 > 0.0 && a1 > 0.0 && a0 > 0.0);
    assert!(!is_stable(sliding_polynomial(&p)));
}

#[test]
fn a_surface_that_no_force_moves_is_rejected() {
    let p = ComfortSlidingMode { n3: 50.0 / 1525.0, ..ComfortSlidingMode::default() };
    assert_eq!(
        check(&p).unwrap_err(),
        "'surface.weight.wheel_velocity' must differ from 'wheel.mass.side'/'body.mass' = 0.03278688524590164, got \
         0.03278688524590164: no force moves the surface"
    );
    assert!(check(&ComfortSlidingMode { n3: 0.033, ..ComfortSlidingMode::default() }).is_ok());
    assert!(check(&ComfortSlidingMode::default()).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// The force makes the surface follow the reaching law; the rate of the surface is computed independently, from
    /// Newton's law. Rounding errors are below 1e-10 for rates of up to 1e4 m/s2.
    #[test]
    fn the_surface_is_reached_as_demanded(
        x in prop::array::uniform4(-1.0..1.0f64), n3 in -0.1..0.02, width in 0.0..0.5, genetic_set: bool,
    ) {
        let p = ComfortSlidingMode { n3, width, ..if genetic_set { genetic() } else { ComfortSlidingMode::default() } };
        let [x1, x2, x3, x4] = x;
        let y = forces(&p, &inputs(x1, x2, x3, x4));
        let strut = p.k_s * (x1 - x2) + p.c_s * (x3 - x4) + y.f[0];
        let (wheel, body) = ((-p.k_t * x1 - strut) / p.m_u, strut / p.m_s);
        let rate = p.n1 * x3 + p.n2 * x4 + p.n3 * wheel + body;
        let sign = if width > 0.0 { (y.s / width).clamp(-1.0, 1.0) } else { y.s.signum() };
        prop_assert!((rate + p.eta * y.s + p.mu * sign).abs() < 1e-10);
        prop_assert_eq!(y.f[1], p.zeta * y.f[0]);
    }

    /// Inputs of opposite sign give outputs of opposite sign, bit for bit.
    #[test]
    fn the_law_is_odd(x in prop::array::uniform4(-1.0..1.0f64), limit in 0.0..2000.0) {
        let p = ComfortSlidingMode { limit, ..ComfortSlidingMode::default() };
        let y = forces(&p, &inputs(x[0], x[1], x[2], x[3]));
        let mirror = forces(&p, &inputs(-x[0], -x[1], -x[2], -x[3]));
        prop_assert_eq!((y.f.0, y.s), (mirror.f.map(|f| -f), -mirror.s));
    }

    /// The motion on the surface decays if and only if eq. 22 and the missing condition, n2 n3 - n1 > 0, hold.
    #[test]
    fn four_inequalities_are_necessary_and_sufficient(n1 in -3.0..0.5, n2 in -1.0..10.0, n3 in -0.1..0.1) {
        let p = ComfortSlidingMode { n1, n2, n3, ..ComfortSlidingMode::default() };
        let [d, a2, a1, a0] = sliding_polynomial(&p);
        // Near the stability limit, rounding determines the sign of the eigenvalues.
        prop_assume!(d.abs() > 1e-3 && n2.abs() > 1e-3 && (n2 * n3 - n1).abs() > 1e-3);
        let inequalities = a2 / d > 0.0 && a1 / d > 0.0 && a0 / d > 0.0 && n2 * n3 - n1 > 0.0;
        prop_assert_eq!(inequalities, is_stable([d, a2, a1, a0]));
    }
}
