//! Numerical examples of eq. 40 of the paper, and its symmetry.

use proptest::prelude::*;

use super::*;

fn mixed(p: &SuspensionMixer, u: &U) -> [f64; 6] {
    *p.update(Sample { time: 0.0, state: &mut (), inputs: u, derived: &() }).f_u
}

#[test]
fn forces_add_by_their_shares() {
    let u = U {
        k1: 0.25,
        k2: 0.5,
        u_z: SixWheels([4000.0, -4000.0, 0.0, 8.0, 1.0, 2.0]),
        u_phi: SixWheels([2000.0, 1000.0, -600.0, 2.0, 3.0, -4.0]),
    };
    // Exact, because the shares are powers of 2.
    assert_eq!(mixed(&SuspensionMixer::default(), &u), [2000.0, -500.0, -300.0, 3.0, 1.75, -1.5]);
}

#[test]
fn forces_stop_at_the_limit() {
    let u = U { k1: 1.0, k2: 1.0, u_z: SixWheels([90e3, -90e3, 5e4, -5e4, 0.0, 1.0]), u_phi: SixWheels([20e3; 6]) };
    assert_eq!(mixed(&SuspensionMixer::default(), &u), [100e3, -70e3, 70e3, -30e3, 20e3, 20_001.0]);
    assert_eq!(mixed(&SuspensionMixer { limit: 0.0, ..SuspensionMixer::default() }, &u), [0.0; 6]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Wheels are mixed independently: exchanged sides and negated inputs give exchanged and negated forces, bit for
    /// bit.
    #[test]
    fn mixing_is_symmetric_and_odd(
        k1 in 0.0..1.0, k2 in 0.0..1.0, u_z in prop::array::uniform6(-2e5..2e5), u_phi in prop::array::uniform6(-2e5..2e5),
    ) {
        let p = SuspensionMixer::default();
        let forces = mixed(&p, &U { k1, k2, u_z: SixWheels(u_z), u_phi: SixWheels(u_phi) });
        let swapped = |family: [f64; 6]| SixWheels::from_fn(|i| family[i ^ 1]);
        let mirror = mixed(&p, &U { k1, k2, u_z: swapped(u_z), u_phi: swapped(u_phi) });
        prop_assert_eq!(forces, *swapped(mirror));
        let turned = mixed(&p, &U { k1, k2, u_z: SixWheels(u_z.map(|f| -f)), u_phi: SixWheels(u_phi.map(|f| -f)) });
        prop_assert_eq!(forces, turned.map(|f| -f));
    }
}
