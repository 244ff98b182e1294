//! Gains against the check numbers; the design model and its loops are tested in `lqr-suspension`.

use fmi2::Block;

use super::*;

/// Gains of the wheels fl, ml, rl: per heave, pitch, roll; per wheel height; per their rates. Check numbers of an
/// independent implementation (LAPACK), 8 digits.
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

/// What the unit answers to one state being 1 and the others 0, for all of them: the columns of -K.
fn answers(p: &P) -> Vec<[f64; 6]> {
    let d = IntegratedLqrSuspension::design(p).unwrap();
    (0..20)
        .map(|j| {
            let mut state = [0.0; 20];
            state[j] = 1.0;
            *IntegratedLqrSuspension::update(p, &d, &mut (), &Feedback::read(&state), 0.0).u_z
        })
        .collect()
}

/// The wheel or wheel state on the other side.
fn other_side(column: usize) -> usize {
    match column {
        3..9 => 3 + ((column - 3) ^ 1),
        12..18 => 12 + ((column - 12) ^ 1),
        _ => column,
    }
}

#[test]
fn the_gains_are_the_check_numbers() {
    // To 1e-6 of the largest element; a right row is the left one with the sides exchanged and roll turned round.
    let columns = answers(&P::default());
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
    let d = IntegratedLqrSuspension::design(&P::default()).unwrap();
    let names: Vec<_> = <Gains as fmi2::block::Design>::declare().into_iter().map(|gain| gain.name).collect();
    let mut values = vec![0.0; names.len()];
    fmi2::block::Design::write(&d, &mut values);
    let gain = |name: &str| values[names.iter().position(|known| known == name).unwrap()];
    let columns = answers(&P::default());
    // The same numbers, hence to the bit: rows are wheels, columns are states.
    assert_eq!(gain("gain.pitch.ml"), -columns[1][2]);
    assert_eq!(gain("gain.wheel_velocity.rr.fl"), -columns[12][5]);
}

#[test]
fn an_accepted_value_whose_weight_is_no_number_is_refused_by_name() {
    let cases = [
        ("accepted.heave_acceleration", P { zdd: 1e-200, ..P::default() }),
        ("accepted.pitch_acceleration", P { thetadd: 1e-200, ..P::default() }),
        ("accepted.roll_acceleration", P { phidd: 1e-200, ..P::default() }),
        ("accepted.suspension_deflection", P { d: 1e-200, ..P::default() }),
        ("accepted.tire_deflection", P { t: 1e-200, ..P::default() }),
        ("accepted.suspension_force", P { force: 1e-200, ..P::default() }),
    ];
    for (name, p) in cases {
        let expected = format!("'{name}' = 1e-200, a number in [1e-150, 1e150] was expected");
        assert_eq!(IntegratedLqrSuspension::design(&p).unwrap_err(), expected);
        // The message names a parameter that exists.
        assert!(<P as fmi2::block::Parameters>::declare().iter().any(|parameter| parameter.name == name));
    }
}
