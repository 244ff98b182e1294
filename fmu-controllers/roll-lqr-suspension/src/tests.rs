//! Compares the gains with check numbers. Tests in `chassis_control::lqr_suspension` cover the design model and the
//! closed loops.

use fmu::testing::store::{Counts, ValuesMut};
use fmu::{Derived as _, Variables as _};

use super::*;

/// One block for each of the wheels fl, ml, rl. The lines contain the gains for heave, pitch, roll; for the six wheel
/// heights; and for the rates of all these. Check numbers from an independent implementation (LAPACK), 8 digits.
#[rustfmt::skip]
const K: [[f64; 18]; 3] = [
    [
        378252.4, -971468.15, 9309.9017,
        -176424.65, -112256.69, 34889.331, -68687.787, 59258.377, -44318.74,
        40041.021, -124816.16, 30429.647,
        123.54526, -2617.6787, 3420.788, -3065.7677, 3170.1619, -3316.3937,
    ],
    [
        378252.4, 167272.66, 9309.9017,
        34889.331, -68687.787, -140357.68, -76189.717, 23191.406, -80385.711,
        40041.021, 21491.525, 30429.647,
        3420.788, -3065.7677, -247.38932, -2988.6133, 3541.0965, -2945.4591,
    ],
    [
        378252.4, 804195.49, 9309.9017,
        59258.377, -44318.74, 23191.406, -80385.711, -164726.72, -100558.76,
        40041.021, 103324.64, 30429.647,
        3170.1619, -3316.3937, 3541.0965, -2945.4591, 3.236716, -2737.9873,
    ],
];

/// The columns of -K: the forces for each state equal to 1, with the other states 0.
fn answers(p: &RollLqrSuspension) -> Vec<[f64; 6]> {
    let d = p.derived().unwrap();
    (0..20)
        .map(|j| {
            let mut state = [0.0; 20];
            state[j] = 1.0;
            *p.update(Sample { time: 0.0, state: &mut (), inputs: &Feedback::from_reals(&state), derived: &d }).u_phi
        })
        .collect()
}

/// State number with left and right wheels exchanged.
fn other_side(column: usize) -> usize {
    match column {
        3..9 => 3 + ((column - 3) ^ 1),
        12..18 => 12 + ((column - 12) ^ 1),
        _ => column,
    }
}

#[test]
fn the_gains_are_the_check_numbers() {
    // Tolerance: 1e-6 of the largest element. The row of a right wheel is the row of the left wheel with the sides
    // exchanged and the sign of the roll gains reversed.
    let columns = answers(&RollLqrSuspension::default());
    let largest = K.iter().flatten().fold(0.0_f64, |most, k| most.max(k.abs()));
    for (axle, row) in K.iter().enumerate() {
        for (j, &k) in row.iter().enumerate() {
            let mirror = if j == 2 || j == 11 { -k } else { k };
            let (left, right) = (-columns[j][2 * axle], -columns[other_side(j)][2 * axle + 1]);
            assert!((left - k).abs() <= 1e-6 * largest, "axle {axle}, left, state {j}: {left}, expected {k}");
            assert!(
                (right - mirror).abs() <= 1e-6 * largest,
                "axle {axle}, right, state {j}: {right}, expected {mirror}"
            );
        }
    }
    // Without lateral states in the design model, sideslip and yaw rate are not fed back.
    assert_eq!((columns[18], columns[19]), ([0.0; 6], [0.0; 6]));
}

#[test]
fn the_gains_can_be_read() {
    let d = RollLqrSuspension::default().derived().unwrap();
    let mut declared = Vec::new();
    Gains::declare(&mut declared);
    let names: Vec<_> = declared.into_iter().map(|gain| gain.name).collect();
    let mut values = vec![0.0; names.len()];
    d.write(&mut ValuesMut::of_reals(&mut values), Counts::ZERO);
    let gain = |name: &str| values[names.iter().position(|known| known == name).unwrap()];
    let columns = answers(&RollLqrSuspension::default());
    // Rows are wheels, columns are states. The numbers are the same, so the comparison is exact.
    assert_eq!(gain("gain.pitch.ml"), -columns[1][2]);
    assert_eq!(gain("gain.wheel_velocity.rr.fl"), -columns[12][5]);
}

#[test]
fn an_accepted_value_whose_weight_is_no_number_is_rejected_by_name() {
    let cases = [
        ("accepted.roll_angle", RollLqrSuspension { phi: 1e-200, ..RollLqrSuspension::default() }),
        ("accepted.roll_acceleration", RollLqrSuspension { phidd: 1e-200, ..RollLqrSuspension::default() }),
        ("accepted.suspension_deflection", RollLqrSuspension { d_s: 1e-200, ..RollLqrSuspension::default() }),
        ("accepted.tire_deflection", RollLqrSuspension { d_t: 1e-200, ..RollLqrSuspension::default() }),
        ("accepted.suspension_force", RollLqrSuspension { force: 1e-200, ..RollLqrSuspension::default() }),
    ];
    for (name, p) in cases {
        let expected = format!("'{name}' must be a number in [1e-150, 1e150], got 1e-200");
        assert_eq!(p.derived().unwrap_err(), expected);
        // The message names a parameter that exists.
        assert!(RollLqrSuspension::declarations().iter().any(|parameter| parameter.name == name));
    }
}
