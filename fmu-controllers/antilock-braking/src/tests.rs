//! The logic step by step, and its limits and symmetry.

use proptest::prelude::*;

use super::*;

/// Full braking at 15 m/s with the same slip at all wheels.
fn braking(slip: f64) -> U {
    U {
        enable: true,
        target: FourWheels([0.2; 4]),
        master: 10.0,
        u: 15.0,
        omega: FourWheels([15.0 * (1.0 - slip) / data::RADIUS; 4]),
        ..U::default()
    }
}

fn sample(p: &AntilockBraking, x: &mut X, u: &U) -> (f64, bool) {
    let y = p.update(Sample { time: 0.0, state: x, inputs: u, derived: &() });
    (y.cmd[0], y.active[0])
}

#[track_caller]
fn assert_command(actual: (f64, bool), expected: (f64, bool)) {
    // Tolerance: rounding errors of 10 MPa in a sum of a few steps.
    assert!((actual.0 - expected.0).abs() < 1e-13 && actual.1 == expected.1, "{actual:?} is not {expected:?}");
}

#[test]
fn a_wheel_that_slips_too_much_is_released_held_and_braked_again() {
    let (p, mut x) = (AntilockBraking::default(), X::default());
    // Below and within the band, the wheel gets the driver's pressure and is not modulated yet.
    assert_command(sample(&p, &mut x, &braking(0.1)), (10.0, false));
    assert_command(sample(&p, &mut x, &braking(0.2199)), (10.0, false));
    // Above the band, the pressure falls by 60 MPa/s times 5 ms in every sample, beginning with this one.
    assert_command(sample(&p, &mut x, &braking(0.25)), (9.7, true));
    assert_command(sample(&p, &mut x, &braking(0.3)), (9.4, true));
    // The wheel speeds up by more than 10 m/s2 (0.06 m/s in 5 ms), so its pressure is held although the slip is above
    // the band.
    assert_command(sample(&p, &mut x, &braking(0.3 - 0.06 / 15.0)), (9.4, true));
    // Within the band, the pressure is held.
    assert_command(sample(&p, &mut x, &braking(0.21)), (9.4, true));
    assert_command(sample(&p, &mut x, &braking(0.1801)), (9.4, true));
    // Below the band, the pressure rises by 20 MPa/s until it reaches the driver's pressure.
    for expected in [9.5, 9.6, 9.7, 9.8, 9.9] {
        assert_command(sample(&p, &mut x, &braking(0.1)), (expected, true));
    }
    // Rounding decides whether 10 MPa is reached in this sample or the next.
    sample(&p, &mut x, &braking(0.1));
    assert_command(sample(&p, &mut x, &braking(0.1)), (10.0, false));
}

#[test]
fn a_driver_who_lets_go_ends_the_modulation() {
    let (p, mut x) = (AntilockBraking::default(), X::default());
    sample(&p, &mut x, &braking(0.1));
    sample(&p, &mut x, &braking(0.4));
    assert_command(sample(&p, &mut x, &U { master: 3.0, ..braking(0.4) }), (3.0, false));
    assert_command(sample(&p, &mut x, &U { master: 0.0, ..braking(0.4) }), (0.0, false));
}

#[test]
fn switched_off_or_slow_the_request_passes() {
    let p = AntilockBraking::default();
    for u in [U { enable: false, ..braking(1.0) }, U { u: 1.4, ..braking(1.0) }] {
        let mut x = X { active: [true; 4], cmd: [1.0; 4], ..X::default() };
        assert_command(sample(&p, &mut x, &u), (10.0, false));
    }
    // The request is the sum of driver and yaw control, limited to 0 to 12 MPa.
    let off = U { enable: false, p_dyc: FourWheels([1.0, 5.0, 0.0, -20.0]), ..braking(0.0) };
    let y = p.update(Sample { time: 0.0, state: &mut X::default(), inputs: &off, derived: &() });
    assert_eq!(*y.cmd, [11.0, 12.0, 10.0, 0.0]);
}

#[test]
fn the_lead_time_looks_ahead() {
    // The slip rises from 0.05 to 0.11 within 5 ms, so it would be 0.23 after another 10 ms.
    let p = AntilockBraking { lead: 0.01, ..AntilockBraking::default() };
    let mut x = X::default();
    assert_command(sample(&p, &mut x, &braking(0.05)), (10.0, false));
    assert_command(sample(&p, &mut x, &braking(0.11)), (9.7, true));
    // In the first sample, the extrapolation starts from a slip of 0, and the modulation from a pressure of 0.
    assert_command(
        sample(&AntilockBraking { lead: 0.005, ..AntilockBraking::default() }, &mut X::default(), &braking(0.12)),
        (0.0, true),
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// For any sequence, commands stay between 0 and the request, and below the request while modulated. During
    /// modulation, pressures change at most at their rates. Exchanging left and right in the inputs exchanges them in
    /// the outputs, bit for bit.
    #[test]
    fn commands_stay_within_the_request(
        samples in prop::collection::vec(
            (0.0..20.0_f64, 0.0..14.0_f64, prop::array::uniform4(0.0..3.0_f64), prop::array::uniform4(0.0..70.0_f64)), 1..30,
        ),
    ) {
        let p = AntilockBraking::default();
        let (mut x, mut mirrored) = (X::default(), X::default());
        for (u, master, p_dyc, omega) in samples {
            let before = x.clone();
            let inputs = U { u, master, p_dyc: FourWheels(p_dyc), omega: FourWheels(omega), ..braking(0.0) };
            let y = p.update(Sample { time: 0.0, state: &mut x, inputs: &inputs, derived: &() });
            for (i, p_dyc) in p_dyc.iter().enumerate() {
                let req = (master + p_dyc).min(p.p_max);
                prop_assert!((0.0..=req).contains(&y.cmd[i]));
                if y.active[i] {
                    prop_assert!(y.cmd[i] < req);
                    let change = y.cmd[i] - before.cmd[i];
                    // Tolerance: rounding of a pressure of up to 14 MPa.
                    prop_assert!((-0.3 - 1e-14..=0.1 + 1e-14).contains(&change), "{change}");
                } else {
                    prop_assert_eq!(y.cmd[i], req);
                }
            }
            let swap = |family: [f64; 4]| FourWheels([1, 0, 3, 2].map(|i| family[i]));
            let other = U { p_dyc: swap(p_dyc), omega: swap(omega), ..inputs };
            let z = p.update(Sample { time: 0.0, state: &mut mirrored, inputs: &other, derived: &() });
            prop_assert_eq!((*y.cmd, *y.active), (*swap(*z.cmd), [1, 0, 3, 2].map(|i| z.active[i])));
        }
    }
}
