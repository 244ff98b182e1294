//! Driving states, tables and rules against the paper, and limits of the outputs.

use proptest::prelude::{ProptestConfig, prop, prop_assert, prop_assert_eq, proptest};

use super::equations::State;
use super::*;

/// Without filter, so the state follows the accelerations at once.
fn unfiltered() -> FiniteStateCoordination {
    FiniteStateCoordination { tau: 0.0, ..FiniteStateCoordination::default() }
}

fn sample(p: &FiniteStateCoordination, x: &mut X, u: &U) -> Y {
    p.update(Sample { time: 0.0, state: x, inputs: u, derived: &() })
}

/// Next driving state for the accelerations and the brake pedal.
fn state(x: &mut X, a_x: f64, a_y: f64, brake: f64) -> i32 {
    sample(&unfiltered(), x, &U { a_x, a_y, brake, u: data::SPEED, ..U::default() }).state
}

#[test]
fn six_states_are_told_apart() {
    // Table 1.
    for (a_x, a_y, brake, expected) in [
        (0.0, 0.0, 0.0, 1),
        (1.0, 0.0, 0.0, 2),
        (-1.0, 0.0, 1.0, 3),
        (0.0, 1.0, 0.0, 4),
        (-1.0, -1.0, 1.0, 5),
        (1.0, -1.0, 0.0, 6),
        // Neither deceleration without the pedal, nor the pedal without deceleration, nor acceleration with the pedal
        // changes the state.
        (-1.0, 0.0, 0.0, 1),
        (0.0, 0.0, 1.0, 1),
        (1.0, 0.0, 1.0, 1),
    ] {
        assert_eq!(state(&mut X::default(), a_x, a_y, brake), expected, "{a_x} {a_y} {brake}");
    }
}

#[test]
fn states_last_until_the_lower_threshold() {
    let mut x = X::default();
    let run = [(0.45, 1), (0.55, 2), (0.35, 2), (0.29, 1), (0.35, 1)];
    for (a_x, expected) in run {
        assert_eq!(state(&mut x, a_x, 0.0, 0.0), expected, "accelerating, {a_x}");
    }
    for (a_x, expected) in run {
        let expected = if expected == 2 { 3 } else { expected };
        assert_eq!(state(&mut x, -a_x, 0.0, 1.0), expected, "braking, {a_x}");
    }
    for (a_y, expected) in [(0.3, 1), (-0.41, 4), (0.26, 4), (-0.24, 1), (0.3, 1)] {
        assert_eq!(state(&mut x, 0.0, a_y, 0.0), expected, "turning, {a_y}");
    }
    // After braking, the lower threshold for braking does not apply to accelerating.
    state(&mut x, -1.0, 0.0, 1.0);
    assert_eq!(state(&mut x, 0.4, 0.0, 0.0), 1);
}

#[test]
fn accelerations_are_filtered() {
    // Each sample covers 1 - exp(-5 ms/50 ms) of the difference to 2 m/s2. The third exceeds 0.4 m/s2: 2 (1 -
    // exp(-0.3)) = 0.518.
    let p = FiniteStateCoordination::default();
    let mut x = X::default();
    let states: Vec<_> = (0..3).map(|_| sample(&p, &mut x, &U { a_y: 2.0, ..U::default() }).state).collect();
    assert_eq!(states, [1, 1, 4]);
    // Tolerance: a few rounding errors.
    assert!((x.a_y - 2.0 * (1.0 - (-0.3_f64).exp())).abs() < 1e-15);
}

#[test]
fn laws_are_on_by_state() {
    for (a_x, a_y, brake, antilock, yaw_control) in [
        (0.0, 0.0, 0.0, false, false),
        (1.0, 0.0, 0.0, false, false),
        (-1.0, 0.0, 1.0, true, false),
        (0.0, 1.0, 0.0, false, true),
        (-1.0, 1.0, 1.0, true, true),
        (1.0, 1.0, 0.0, false, true),
    ] {
        let y = sample(&unfiltered(), &mut X::default(), &U { a_x, a_y, brake, ..U::default() });
        assert_eq!((y.suspension, y.antilock, y.yaw_control), (true, antilock, yaw_control));
    }
}

#[test]
fn the_other_strategies_are_constant() {
    let u = U { a_x: -3.0, a_y: 3.0, brake: 1.0, thetadd: 1.0, phidd: 1.0, u: 10.0, ..U::default() };
    let y = sample(
        &FiniteStateCoordination { strategy: Strategy::None, ..FiniteStateCoordination::default() },
        &mut X::default(),
        &u,
    );
    assert_eq!((y.state, y.suspension, y.antilock, y.yaw_control), (0, false, false, false));
    assert_eq!((*y.k_p, *y.k_i, *y.k_d, *y.target), ([0.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]));
    let y = sample(
        &FiniteStateCoordination { strategy: Strategy::Individual, ..FiniteStateCoordination::default() },
        &mut X::default(),
        &u,
    );
    assert_eq!((y.state, y.suspension, y.antilock, y.yaw_control), (0, true, true, true));
    assert_eq!((*y.k_p, *y.k_i, *y.k_d, *y.target), ([60.0; 4], [0.8; 4], [3.0; 4], [0.2; 4]));
}

fn gains(p: &FiniteStateCoordination, state: State, u: &U) -> [[f64; 4]; 3] {
    equations::gains(p, state, u).map(|family| *family)
}

#[test]
#[expect(clippy::approx_constant, reason = "3.14 stands in Table 3")]
fn the_tables_are_those_of_the_paper() {
    let p = FiniteStateCoordination::default();
    let pitch = |thetadd: f64| U { thetadd, ..U::default() };
    let roll = |phidd: f64| U { phidd, ..U::default() };
    let axles = |front: f64, rear: f64| [front, front, rear, rear];
    let sides = |left: f64, right: f64| [left, right, left, right];
    for (state, u, k_i, k_d) in [
        (State::Accelerating, pitch(-0.11), axles(0.98, 1.00), axles(3.10, 3.11)),
        (State::Accelerating, pitch(0.11), axles(1.20, 1.10), axles(3.21, 3.30)),
        (State::Braking, pitch(-0.11), axles(1.00, 1.06), axles(3.18, 3.16)),
        (State::Braking, pitch(0.11), axles(1.12, 1.00), axles(3.14, 3.24)),
        (State::Turning, roll(-0.011), sides(1.06, 1.16), sides(3.10, 3.18)),
        (State::Turning, roll(0.011), sides(1.10, 1.04), sides(3.12, 3.10)),
        (State::TurningAndAccelerating, roll(-0.011), sides(0.98, 1.10), sides(3.01, 3.15)),
        (State::TurningAndAccelerating, roll(0.011), sides(1.00, 1.00), sides(3.06, 3.02)),
        // Between the thresholds, and in the other states, the base gains apply.
        (State::Accelerating, pitch(0.1), [0.8; 4], [3.0; 4]),
        (State::Turning, roll(-0.01), [0.8; 4], [3.0; 4]),
        (State::Uniform, U { thetadd: 1.0, phidd: 1.0, ..U::default() }, [0.8; 4], [3.0; 4]),
        // Rule 5: both accelerations.
        (State::TurningAndBraking, U { thetadd: -0.11, phidd: 0.011, ..U::default() }, [1.0; 4], [3.16; 4]),
        (State::TurningAndBraking, pitch(0.11), [0.8; 4], [3.0; 4]),
    ] {
        assert_eq!(gains(&p, state, &u)[1..], [k_i, k_d], "{state:?} {u:?}");
    }
    let swapped = FiniteStateCoordination { swap_sides: true, ..FiniteStateCoordination::default() };
    assert_eq!(gains(&swapped, State::Turning, &roll(-0.011))[1..], [sides(1.16, 1.06), sides(3.18, 3.10)]);
    assert_eq!(gains(&swapped, State::Accelerating, &pitch(-0.11))[1], axles(0.98, 1.00));
}

#[test]
fn rules_raise_the_proportional_gain_where_rate_and_acceleration_agree() {
    let p =
        FiniteStateCoordination { lambda_1: 100.0, lambda_2: 80.0, beta_3: 0.5, ..FiniteStateCoordination::default() };
    let motion = |thetad, thetadd, phid, phidd| U { thetad, thetadd, phid, phidd, ..U::default() };
    let k_p = |state, u: U| gains(&p, state, &u)[0];
    let pitching = motion(0.02, 0.2, 0.0, 0.0);
    for state in [State::Accelerating, State::Braking] {
        assert_eq!(k_p(state, pitching.clone()), [90.0, 90.0, 75.0, 75.0]);
        assert_eq!(k_p(state, motion(-0.02, -0.2, 0.0, 0.0)), [75.0, 75.0, 90.0, 90.0]);
        assert_eq!(k_p(state, motion(-0.02, 0.2, 0.0, 0.0)), [60.0; 4]);
    }
    let rolling = motion(0.0, 0.0, 0.002, 0.02);
    assert_eq!(k_p(State::Turning, rolling.clone()), [100.0, 80.0, 100.0, 80.0]);
    assert_eq!(k_p(State::Turning, motion(0.0, 0.0, -0.002, -0.02)), [80.0, 100.0, 80.0, 100.0]);
    // State 6 has separate thresholds.
    assert_eq!(k_p(State::TurningAndAccelerating, rolling.clone()), [60.0; 4]);
    assert_eq!(k_p(State::TurningAndAccelerating, motion(0.0, 0.0, 0.6, 0.02)), [100.0, 80.0, 100.0, 80.0]);
    assert_eq!(k_p(State::Uniform, pitching.clone()), [60.0; 4]);
    // State 5 uses the rule for the larger acceleration, or blends both rules in proportion to the accelerations (0.3
    // and 0.1: three quarters of the pitch rule).
    assert_eq!(k_p(State::TurningAndBraking, pitching), [90.0, 90.0, 75.0, 75.0]);
    assert_eq!(k_p(State::TurningAndBraking, rolling), [100.0, 80.0, 100.0, 80.0]);
    let both = k_p(State::TurningAndBraking, motion(0.02, 0.3, 0.002, 0.1));
    for (actual, expected) in both.into_iter().zip([92.5, 87.5, 81.25, 76.25]) {
        // Tolerance: rounding of 0.3 + 0.1.
        assert!((actual - expected).abs() < 1e-12, "{actual} {expected}");
    }
}

#[test]
fn the_target_slip_falls_with_speed_and_in_turns() {
    let p = FiniteStateCoordination::default();
    let slip = |state, a_y: f64, u: f64| equations::target_slip(&p, state, a_y, u);
    // 0.18 at 60 km/h, proportional to 1/sqrt(speed); limited to 0.30 below 21.6 km/h.
    assert!((slip(State::Braking, 0.0, data::SPEED) - 0.18).abs() < 1e-15);
    assert!((slip(State::Braking, 0.0, data::SPEED * 4.0) - 0.09).abs() < 1e-15);
    assert_eq!(slip(State::Braking, 0.0, 0.0), 0.30);
    assert_eq!(slip(State::Braking, 0.0, 400.0), 0.08);
    // 40 % less at the friction limit, 20 % less at half of it, but only in state 5.
    let limit = 0.77 * 9.81;
    for (a_y, share) in [(limit, 0.6), (-3.0 * limit, 0.6), (limit / 2.0, 0.8)] {
        assert!((slip(State::TurningAndBraking, a_y, data::SPEED) - 0.18 * share).abs() < 1e-15);
    }
    assert!((slip(State::Turning, limit, data::SPEED) - 0.18).abs() < 1e-15);
    // Contradictory limits and zero friction do not panic.
    let odd = FiniteStateCoordination { slip_lo: 0.5, slip_hi: 0.1, mu: 0.0, ..FiniteStateCoordination::default() };
    assert_eq!(equations::target_slip(&odd, State::TurningAndBraking, 0.0, 10.0), 0.1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// For any sequence, gains and target slips stay within the ranges of tables and parameters, and the active laws
    /// match the state.
    #[test]
    fn results_belong_to_the_state(
        samples in prop::collection::vec((prop::array::uniform6(-2.0..2.0_f64), 0.0..0.1_f64, 0.0..40.0_f64), 1..30),
    ) {
        let p = FiniteStateCoordination::default();
        let mut x = X::default();
        for ([a_x, a_y, thetad, thetadd, phid, phidd], brake, speed) in samples {
            let y = sample(&p, &mut x, &U { u: speed, a_x, a_y, thetad, thetadd, phid, phidd, brake, throttle: 0.0 });
            prop_assert!((1..=6).contains(&y.state));
            let is = |states: &[i32]| states.contains(&y.state);
            prop_assert_eq!((y.antilock, y.yaw_control), (is(&[3, 5]), is(&[4, 5, 6])));
            for i in 0..4 {
                prop_assert!((60.0..=90.0).contains(&y.k_p[i]) && (0.8..=1.2).contains(&y.k_i[i]));
                prop_assert!((3.0..=3.3).contains(&y.k_d[i]) && (0.08..=0.3).contains(&y.target[i]));
            }
        }
    }
}
