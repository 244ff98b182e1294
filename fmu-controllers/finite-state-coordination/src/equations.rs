//! One sample of the coordination: driving state (Table 1), gains of the suspension law (Tables 2-5, rules 1-5), target
//! slip. Numbers of tables and rules refer to the paper; the README lists corrections.
//!
//! | symbol | meaning |
//! |---|---|
//! | a_x, a_y | filtered longitudinal and lateral acceleration |
//! | theta, phi | pitch and roll; each d at the end is a derivative with respect to time |
//! | K_p, K_i, K_d | gains of the suspension law |
//! | sigma, lambda, alpha, beta, epsilon_0, gamma_0 | gains and thresholds of the rules |
//! | u | speed |

use chassis_control::limit::lag;
use chassis_vehicle::positions::{FourWheels, axle_of};

use crate::{FiniteStateCoordination, Strategy, U, X, Y};

/// The driving states of Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    Uniform = 1,
    Accelerating = 2,
    Braking = 3,
    Turning = 4,
    TurningAndBraking = 5,
    TurningAndAccelerating = 6,
}

/// K_i and K_d of a pair of wheels, each for accelerations below and above the thresholds.
struct Row {
    k_i: [f64; 2],
    k_d: [f64; 2],
}

/// Rows of Tables 2 and 3: front axle, rear axle.
const TABLE_2: [Row; 2] = [Row { k_i: [0.98, 1.20], k_d: [3.10, 3.21] }, Row { k_i: [1.00, 1.10], k_d: [3.11, 3.30] }];
#[expect(clippy::approx_constant, reason = "a gain of the paper that happens to look like pi")]
const TABLE_3: [Row; 2] = [Row { k_i: [1.00, 1.12], k_d: [3.18, 3.14] }, Row { k_i: [1.06, 1.00], k_d: [3.16, 3.24] }];
/// Rows of Tables 4 and 5: left side, right side.
const TABLE_4: [Row; 2] = [Row { k_i: [1.06, 1.10], k_d: [3.10, 3.12] }, Row { k_i: [1.16, 1.04], k_d: [3.18, 3.10] }];
const TABLE_5: [Row; 2] = [Row { k_i: [0.98, 1.00], k_d: [3.01, 3.06] }, Row { k_i: [1.10, 1.00], k_d: [3.15, 3.02] }];
/// Rule 5: all wheels.
const K_I_5: f64 = 1.0;
const K_D_5: f64 = 3.16;

/// Lower limit of the speed in the target slip, m/s.
const LEAST_SPEED: f64 = 2.0;

/// Side of wheel `i`: 0 left, 1 right.
fn side_of(i: usize) -> usize {
    i % 2
}

/// Table 1 with hysteresis: a state ends at a lower acceleration than it begins.
pub(crate) fn state(p: &FiniteStateCoordination, x: &mut X, inputs: &U) -> State {
    x.a_x = lag(x.a_x, inputs.a_x, p.tau, p.sample_time);
    x.a_y = lag(x.a_y, inputs.a_y, p.tau, p.sample_time);
    // Braking requires the pedal: braking by yaw control alone does not count.
    let pedal = inputs.brake > p.brake_on;
    let exceeds = |a: f64, was: bool| a > p.ax_on || (was && a > p.ax_off);
    (x.accelerates, x.brakes) = (!pedal && exceeds(x.a_x, x.accelerates), pedal && exceeds(-x.a_x, x.brakes));
    x.turns = x.a_y.abs() > p.ay_on || (x.turns && x.a_y.abs() >= p.ay_off);
    match (x.turns, x.brakes, x.accelerates) {
        (false, false, false) => State::Uniform,
        (false, false, true) => State::Accelerating,
        (false, true, _) => State::Braking,
        (true, false, false) => State::Turning,
        (true, true, _) => State::TurningAndBraking,
        (true, false, true) => State::TurningAndAccelerating,
    }
}

/// K_i and K_d of a pair of wheels, depending on the pitch or roll acceleration.
fn banded(p: &FiniteStateCoordination, row: &Row, acceleration: f64, threshold: f64) -> (f64, f64) {
    if acceleration < -threshold {
        (row.k_i[0], row.k_d[0])
    } else if acceleration > threshold {
        (row.k_i[1], row.k_d[1])
    } else {
        (p.k_i0, p.k_d0)
    }
}

/// K_p of two pairs of wheels. If rate and acceleration are both above their thresholds, the first pair gets `large`
/// and the second `small`. If both are below the negative thresholds, the pairs are exchanged.
fn opposed(p: &FiniteStateCoordination, motion: [f64; 2], thresholds: [f64; 2], large: f64, small: f64) -> [f64; 2] {
    let both = |sign: f64| (0..2).all(|i| sign * motion[i] > thresholds[i]);
    if both(1.0) {
        [large, small]
    } else if both(-1.0) {
        [small, large]
    } else {
        [p.k_p0; 2]
    }
}

/// K_p, K_i and K_d of every wheel.
pub(crate) fn gains(p: &FiniteStateCoordination, state: State, inputs: &U) -> [FourWheels<f64>; 3] {
    let U { thetad, thetadd, phid, phidd, .. } = *inputs;
    let base = [p.k_p0, p.k_i0, p.k_d0].map(|gain| FourWheels([gain; 4]));
    let pitch_rule = || {
        let axles = opposed(p, [thetad, thetadd], [p.alpha_1, p.alpha_2], p.sigma_1, p.sigma_2);
        FourWheels::from_fn(|i| axles[axle_of(i)])
    };
    let roll_rule = |thresholds: [f64; 2]| {
        let sides = opposed(p, [phid, phidd], thresholds, p.lambda_1, p.lambda_2);
        FourWheels::from_fn(|i| sides[side_of(i)])
    };
    let by_axle = |table: &[Row; 2]| {
        let axles = [0, 1].map(|j| banded(p, &table[j], thetadd, p.alpha_2));
        [FourWheels::from_fn(|i| axles[axle_of(i)].0), FourWheels::from_fn(|i| axles[axle_of(i)].1)]
    };
    let by_side = |table: &[Row; 2], threshold: f64| {
        let sides = [0, 1].map(|j| banded(p, &table[if p.swap_sides { 1 - j } else { j }], phidd, threshold));
        [FourWheels::from_fn(|i| sides[side_of(i)].0), FourWheels::from_fn(|i| sides[side_of(i)].1)]
    };
    let with = |k_p: FourWheels<f64>, [k_i, k_d]: [FourWheels<f64>; 2]| [k_p, k_i, k_d];
    match state {
        State::Uniform => base,
        State::Accelerating => with(pitch_rule(), by_axle(&TABLE_2)),
        State::Braking => with(pitch_rule(), by_axle(&TABLE_3)),
        State::Turning => with(roll_rule([p.beta_1, p.beta_2]), by_side(&TABLE_4, p.beta_2)),
        State::TurningAndAccelerating => with(roll_rule([p.beta_3, p.beta_4]), by_side(&TABLE_5, p.beta_4)),
        State::TurningAndBraking => {
            let (pitch, roll) = (thetadd.abs(), phidd.abs());
            let rules = [pitch_rule(), roll_rule([p.beta_1, p.beta_2])];
            let epsilon = if pitch > p.epsilon_0 && roll > p.gamma_0 {
                pitch / (pitch + roll)
            } else if pitch >= roll {
                1.0
            } else {
                0.0
            };
            let k_p = FourWheels::from_fn(|i| epsilon * rules[0][i] + (1.0 - epsilon) * rules[1][i]);
            let is_rough = roll > p.beta_2 && pitch > p.alpha_2;
            let rest = if is_rough { [K_I_5, K_D_5].map(|gain| FourWheels([gain; 4])) } else { [base[1], base[2]] };
            with(k_p, rest)
        }
    }
}

/// Target slip. The slip at which the brake force is largest grows as the speed falls. When braking in a turn, a lower
/// target leaves grip for the lateral force.
pub(crate) fn target_slip(p: &FiniteStateCoordination, state: State, a_y: f64, u: f64) -> f64 {
    let straight = p.slip_ref * (p.v_ref / u.max(LEAST_SPEED)).sqrt();
    let turning =
        if state == State::TurningAndBraking { 1.0 - p.slip_lat * (a_y.abs() / (p.mu * p.g)).min(1.0) } else { 1.0 };
    (straight * turning).max(p.slip_lo).min(p.slip_hi)
}

pub(crate) fn sample(p: &FiniteStateCoordination, x: &mut X, inputs: &U) -> Y {
    match p.strategy {
        Strategy::None => constant(false, [0.0; 3], 0.0),
        Strategy::Individual => constant(true, [p.k_p0, p.k_i0, p.k_d0], p.slip_0),
        Strategy::Coordination => {
            let state = state(p, x, inputs);
            let [k_p, k_i, k_d] = gains(p, state, inputs);
            let target = target_slip(p, state, x.a_y, inputs.u);
            Y {
                state: state as i32,
                suspension: true,
                k_p,
                k_i,
                k_d,
                antilock: x.brakes,
                target: FourWheels([target; 4]),
                yaw_control: x.turns,
            }
        }
    }
}

/// All laws on or off, with the same gains and target slip at all wheels.
fn constant(enable: bool, gains: [f64; 3], slip: f64) -> Y {
    let [k_p, k_i, k_d] = gains.map(|gain| FourWheels([gain; 4]));
    Y {
        state: 0,
        suspension: enable,
        k_p,
        k_i,
        k_d,
        antilock: enable,
        target: FourWheels([slip; 4]),
        yaw_control: enable,
    }
}
