//! Check numbers, the demanded motion, and robustness.
//!
//! "Check numbers" were computed by an independent implementation of the law and are compared to their last printed
//! digit.

use approx::assert_abs_diff_eq;
use proptest::prelude::*;

use super::*;

fn forces(p: &HandlingSlidingMode, u: &U) -> Y {
    p.update(Sample { time: 0.0, derived: &(), state: &mut (), inputs: u })
}

/// Inputs of the check numbers.
const TURN: U = U { phi: 0.05, phid: 0.1, d_s: Sides([0.03, -0.02]), dd_s: Sides([0.1, -0.05]), a_y: 4.0 };

/// The recommended values: boundary layer 0.3 rad/s, damper not canceled.
fn damped() -> HandlingSlidingMode {
    HandlingSlidingMode { width: 0.3, cancellation: 0.0, ..HandlingSlidingMode::default() }
}

/// The paper's parameter sets: Table 5 (found by PACSA, and by a genetic algorithm) and Table 6.
fn sets() -> [HandlingSlidingMode; 3] {
    [
        HandlingSlidingMode::default(),
        HandlingSlidingMode {
            rho: 4.73,
            mu: 2.99,
            eta: 24.92,
            kappa1: 0.73,
            kappa2: 0.0025,
            ..HandlingSlidingMode::default()
        },
        HandlingSlidingMode { kappa1: 0.1, kappa2: 0.1, ..HandlingSlidingMode::default() },
    ]
}

/// Roll acceleration of the plant's body with the actuator forces `f`: I_x phidd = M + m_s h a_y, where M includes the
/// moment of the weight.
fn roll_acceleration(p: &HandlingSlidingMode, u: &U, f: &[f64; 2]) -> f64 {
    let push = |i: usize| -p.k_s * u.d_s[i] - p.c_s * u.dd_s[i] + f[i];
    let moment = p.t / 2.0 * (push(0) - push(1)) + p.m_s * p.g * p.h * u.phi.sin();
    (moment + p.m_s * p.h * u.a_y) / p.i_x
}

#[test]
fn the_forces_have_the_check_numbers() {
    let y = forces(&HandlingSlidingMode::default(), &TURN);
    assert_abs_diff_eq!(y.f[0], -4639.036789, epsilon = 5e-7);
    assert_abs_diff_eq!(y.s, 0.35, epsilon = 1e-15);
    // s is outside the boundary layer, so only the damper changes the force.
    assert_abs_diff_eq!(forces(&damped(), &TURN).f[0], -4712.536789, epsilon = 5e-7);
    let y = forces(&damped(), &U { phi: 0.02, phid: 0.05, ..TURN });
    assert_abs_diff_eq!(y.f[0], -2592.727496, epsilon = 5e-7);
    assert_abs_diff_eq!(y.s, 0.15, epsilon = 1e-15);
}

#[test]
fn at_rest_there_is_no_force() {
    let y = forces(&HandlingSlidingMode::default(), &U::default());
    assert_eq!((y.f.0, y.s), ([0.0; 2], 0.0));
}

#[test]
fn the_limit_holds_for_both_forces() {
    let y = forces(&HandlingSlidingMode { limit: 4000.0, ..HandlingSlidingMode::default() }, &TURN);
    assert_eq!(y.f.0, [-4000.0, 4000.0]);
}

#[test]
fn the_sets_of_the_paper_satisfy_the_robust_condition() {
    // Eq. 13 with the missing rho, for the paper's largest roll angle, 0.2 rad. Bounds: check numbers.
    for (p, bound) in sets().into_iter().zip([0.2016, 0.348, 0.32]) {
        let least = (1.0 + p.kappa1 + p.rho * p.kappa2) * 0.2;
        assert_abs_diff_eq!(least, bound, epsilon = 1e-3);
        assert!(p.eta > p.kappa2 && p.mu > least);
    }
}

fn any_inputs() -> impl Strategy<Value = U> {
    let sides = |size: f64| prop::array::uniform2(-size..size).prop_map(Sides);
    (-0.2..0.2, -2.0..2.0, sides(0.1), sides(1.0), -8.0..8.0).prop_map(|(phi, phid, d_s, dd_s, a_y)| U {
        phi,
        phid,
        d_s,
        dd_s,
        a_y,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// With exact data, the roll acceleration is -(rho + eta) phid - rho eta phi - (mu + kap) sign(s): poles at -rho
    /// and -eta. Rounding errors of accelerations of 1e3 rad/s2 are about 1e-11.
    #[test]
    fn roll_moves_as_demanded(u in any_inputs(), width in 0.0..0.5) {
        let p = HandlingSlidingMode { width, ..HandlingSlidingMode::default() };
        let y = forces(&p, &u);
        let sign = if width > 0.0 { (y.s / width).clamp(-1.0, 1.0) } else { y.s.signum() };
        let switching = (p.mu + p.kappa1 * u.phi.abs() + p.kappa2 * u.phid.abs()) * sign;
        let wanted = -(p.rho + p.eta) * u.phid - p.rho * p.eta * u.phi - switching;
        prop_assert!((roll_acceleration(&p, &u, &y.f) - wanted).abs() < 1e-10);
    }

    /// The part of the damping that is not canceled adds its roll moment and nothing else.
    #[test]
    fn the_damper_is_cancelled_by_its_share(u in any_inputs(), cancellation in 0.0..1.0) {
        let p = HandlingSlidingMode { cancellation, ..HandlingSlidingMode::default() };
        let all = forces(&HandlingSlidingMode::default(), &u);
        let part = forces(&p, &u);
        let damper = -(1.0 - cancellation) * p.c_s * p.t / 2.0 * (u.dd_s[0] - u.dd_s[1]) / p.i_x;
        let left = roll_acceleration(&p, &u, &part.f) - roll_acceleration(&p, &u, &all.f);
        prop_assert!((left - damper).abs() < 1e-10);
    }

    /// V = (phi^2 + s^2)/2 falls for roll angles of up to 0.2 rad and errors in the roll acceleration of up to kappa1
    /// |phi| + kappa2 |phid|.
    #[test]
    fn the_lyapunov_function_falls(u in any_inputs(), error in -1.0..1.0, set in 0..3_usize) {
        let p = &sets()[set];
        prop_assume!(u.phi != 0.0 || u.phid != 0.0);
        let y = forces(p, &u);
        let disturbance = error * (p.kappa1 * u.phi.abs() + p.kappa2 * u.phid.abs());
        let phidd = roll_acceleration(p, &u, &y.f) + disturbance;
        let rate = u.phi * u.phid + y.s * (phidd + p.rho * u.phid);
        prop_assert!(rate < 0.0, "{rate}");
    }

    /// Right turns mirror left turns bit for bit. The two forces are opposite.
    #[test]
    fn the_law_is_symmetric(u in any_inputs(), limit in 0.0..8000.0, cancellation in 0.0..1.0) {
        let p = HandlingSlidingMode { limit, cancellation, ..HandlingSlidingMode::default() };
        let swapped = |sides: Sides<f64>| Sides([sides[1], sides[0]]);
        let y = forces(&p, &u);
        let mirror = U { phi: -u.phi, phid: -u.phid, d_s: swapped(u.d_s), dd_s: swapped(u.dd_s), a_y: -u.a_y };
        let m = forces(&p, &mirror);
        prop_assert_eq!((y.f, y.s), (swapped(m.f), -m.s));
        prop_assert_eq!(y.f[0], -y.f[1]);
    }
}
