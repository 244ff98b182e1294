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
        96565.021, -757808.34, -32887.248,
        -91963.16, -30134.938, 84139.289, -21777.567, 88813.751, -17103.106,
        27011.816, -114946.86, 24006.052,
        3022.3609, 296.74577, 5158.3773, -1312.5696, 4258.2518, -2212.6951,
    ],
    [
        96565.021, 130483.56, -32887.248,
        84139.289, -21777.567, -85044.806, -23216.585, 81895.398, -24021.459,
        27011.816, 19792.175, 24006.052,
        5158.3773, -1312.5696, 1690.1463, -1035.4689, 5590.4664, -880.4804,
    ],
    [
        96565.021, 627324.79, -32887.248,
        88813.751, -17103.106, 81895.398, -24021.459, -89719.268, -27891.047,
        27011.816, 95154.688, 24006.052,
        4258.2518, -2212.6951, 5590.4664, -880.4804, 2590.2718, -135.34339,
    ],
];

/// The columns of -K: the forces for each state equal to 1, with the other states 0.
fn answers(p: &IntegratedLqrSuspension) -> Vec<[f64; 6]> {
    let d = p.derived().unwrap();
    (0..20)
        .map(|j| {
            let mut state = [0.0; 20];
            state[j] = 1.0;
            *p.update(Sample { time: 0.0, state: &mut (), inputs: &Feedback::from_reals(&state), derived: &d }).u_z
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
    let columns = answers(&IntegratedLqrSuspension::default());
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
    let d = IntegratedLqrSuspension::default().derived().unwrap();
    let mut declared = Vec::new();
    Gains::declare(&mut declared);
    let names: Vec<_> = declared.into_iter().map(|gain| gain.name).collect();
    let mut values = vec![0.0; names.len()];
    d.write(&mut ValuesMut::of_reals(&mut values), Counts::ZERO);
    let gain = |name: &str| values[names.iter().position(|known| known == name).unwrap()];
    let columns = answers(&IntegratedLqrSuspension::default());
    // Rows are wheels, columns are states. The numbers are the same, so the comparison is exact.
    assert_eq!(gain("gain.pitch.ml"), -columns[1][2]);
    assert_eq!(gain("gain.wheel_velocity.rr.fl"), -columns[12][5]);
}

#[test]
fn an_accepted_value_whose_weight_is_no_number_is_rejected_by_name() {
    let cases = [
        ("accepted.heave_acceleration", IntegratedLqrSuspension { zdd: 1e-200, ..IntegratedLqrSuspension::default() }),
        (
            "accepted.pitch_acceleration",
            IntegratedLqrSuspension { thetadd: 1e-200, ..IntegratedLqrSuspension::default() },
        ),
        ("accepted.roll_acceleration", IntegratedLqrSuspension { phidd: 1e-200, ..IntegratedLqrSuspension::default() }),
        (
            "accepted.suspension_deflection",
            IntegratedLqrSuspension { d_s: 1e-200, ..IntegratedLqrSuspension::default() },
        ),
        ("accepted.tire_deflection", IntegratedLqrSuspension { d_t: 1e-200, ..IntegratedLqrSuspension::default() }),
        ("accepted.suspension_force", IntegratedLqrSuspension { force: 1e-200, ..IntegratedLqrSuspension::default() }),
    ];
    for (name, p) in cases {
        let expected = format!("'{name}' must be a number in [1e-150, 1e150], got 1e-200");
        assert_eq!(p.derived().unwrap_err(), expected);
        // The message names a parameter that exists.
        assert!(IntegratedLqrSuspension::declarations().iter().any(|parameter| parameter.name == name));
    }
}
