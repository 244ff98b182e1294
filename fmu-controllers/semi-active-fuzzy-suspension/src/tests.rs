//! Check numbers, the balance of the allocated forces, the limits of a damper, and symmetry of the law.

use approx::assert_abs_diff_eq;
use fmu::Variables;
use proptest::prelude::*;

use super::*;

const CONSTRAINTS: [Constraint; 3] = [Constraint::Active, Constraint::Command, Constraint::Damper];

fn with(constraint: Constraint) -> SemiActiveFuzzySuspension {
    SemiActiveFuzzySuspension { constraint, ..SemiActiveFuzzySuspension::default() }
}

fn derived(p: &SemiActiveFuzzySuspension) -> D {
    p.derived().unwrap()
}

fn sample(p: &SemiActiveFuzzySuspension, d: &D, x: &mut X, u: &U) -> Y {
    p.update(Sample { time: 0.0, state: x, inputs: u, derived: d })
}

#[test]
fn a_body_at_rest_needs_no_force() {
    for constraint in CONSTRAINTS {
        let p = with(constraint);
        let u = U { v: Struts([0.1, -0.2, 0.3, -0.1]), ..U::default() };
        let y = sample(&p, &derived(&p), &mut X::default(), &u);
        assert_eq!((*y.f, y.f_h, y.m_p, y.m_r), ([0.0; 4], 0.0, 0.0, 0.0));
    }
}

#[test]
fn each_motion_is_opposed_with_the_rules_of_its_rate() {
    // A rate of a third of the range means |E| = 1, and EC is 0. The increments are then dKp = 0.99996779 and
    // dKi = -0.99996779 (independent implementation, 8 digits), and the demand is -(K_p + K_i T) rate. Tolerance: 1e-8
    // of the demand.
    let demand = |kp: f64, kp_scale: f64, ki: f64, ki_scale: f64, rate: f64| {
        -(kp + kp_scale * 0.99996779 + (ki - ki_scale * 0.99996779) * 0.001) * rate
    };
    let p = SemiActiveFuzzySuspension::default();
    let u = U { zd: 0.05, thetad: -0.1 / 3.0, phid: 0.1 / 3.0, ..U::default() };
    let y = sample(&p, &derived(&p), &mut X::default(), &u);
    assert_abs_diff_eq!(y.f_h, demand(60e3, 10e3, 30e3, 5e3, 0.05), epsilon = 4e-5);
    assert_abs_diff_eq!(y.m_p, demand(250e3, 40e3, 100e3, 20e3, -0.1 / 3.0), epsilon = 1e-4);
    assert_abs_diff_eq!(y.m_r, demand(60e3, 10e3, 30e3, 5e3, 0.1 / 3.0), epsilon = 3e-5);
    // With an acceleration alone, E = 0 and EC = -1, and only the derivative gain acts.
    let y = sample(&p, &derived(&p), &mut X::default(), &U { zdd: 1.0, ..U::default() });
    let dk = derived(&p).pid.increments(0.0, -1.0);
    assert_eq!(y.f_h, -(1500.0 + 300.0 * dk.derivative));
}

#[test]
fn the_integral_part_decays() {
    // Without motion, the integral part is I exp(-leak n T) (closed form). Tolerance: rounding errors of forces of 100
    // N.
    let p = SemiActiveFuzzySuspension::default();
    let (d, mut x) = (derived(&p), X { i: [100.0, -200.0, 300.0] });
    for _ in 0..1000 {
        sample(&p, &d, &mut x, &U::default());
    }
    for (i, start) in [100.0, -200.0, 300.0].into_iter().enumerate() {
        assert_abs_diff_eq!(x.i[i], start * (-1.0_f64).exp(), epsilon = 1e-10);
    }
}

#[test]
fn a_soft_damper_can_be_commanded_only_by_the_whole_damper() {
    // c_0 = 12 000, c_min = 3000, c_max = 40 000 N s/m in front. At v = 0.1 m/s, the damper can produce 300 to 4000 N
    // against the motion; the plant already produces 1200 N of it.
    let force = |constraint, f| equations::constrained(&with(constraint), 0, f, 0.1);
    assert_eq!(force(Constraint::Active, 5000.0), 5000.0);
    assert_eq!(force(Constraint::Command, 5000.0), 0.0);
    assert_abs_diff_eq!(force(Constraint::Damper, 5000.0), 900.0, epsilon = 1e-12);
    for constraint in [Constraint::Command, Constraint::Damper] {
        assert_abs_diff_eq!(force(constraint, -5000.0), -2800.0, epsilon = 1e-12);
        assert_eq!(force(constraint, -1000.0), -1000.0);
        assert_eq!(equations::constrained(&with(constraint), 0, -1000.0, 0.0), 0.0);
    }
    // The force limit is applied last.
    for constraint in CONSTRAINTS {
        assert_eq!(equations::constrained(&with(constraint), 1, -1e6, 10.0), -30_000.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// The strut forces have the demanded sum and moments. Tolerance: rounding errors of forces of 1e5 N with lever
    /// arms of a few m.
    #[test]
    fn the_allocation_balances(
        f_h in -6e4..6e4_f64, m_p in -15e4..15e4_f64, m_r in -4e4..4e4_f64, eps in 0.0..1.0_f64,
    ) {
        let p = SemiActiveFuzzySuspension { eps, ..SemiActiveFuzzySuspension::default() };
        let f = equations::allocation(&p, [f_h, m_p, m_r]);
        prop_assert!((f.iter().sum::<f64>() - f_h).abs() < 1e-9);
        prop_assert!((-p.l1 * (f[0] + f[1]) + p.l2 * (f[2] + f[3]) - m_p).abs() < 1e-9);
        prop_assert!((p.b / 2.0 * (f[0] - f[1] + f[2] - f[3]) - m_r).abs() < 1e-9);
    }

    /// The command alone dissipates power (constraint 1), or damper and command together act as a damper within its
    /// limits (constraint 2). Tolerance: 1e-12 of the power, for rounding.
    #[test]
    fn a_damper_never_drives(f in -1e5..1e5_f64, v in -2.0..2.0_f64, rear: bool) {
        let axle = usize::from(rear);
        let p = SemiActiveFuzzySuspension::default();
        let (c_0, power) = (p.c_0[axle], 1e-12 * p.c_max[axle] * v * v);
        let command = equations::constrained(&with(Constraint::Command), axle, f, v);
        prop_assert!(command * v <= 0.0);
        prop_assert!(command * v >= -(p.c_max[axle] - c_0) * v * v - power);
        let damper = equations::constrained(&p, axle, f, v) * v - c_0 * v * v;
        prop_assert!(damper <= -p.c_min[axle] * v * v + power && damper >= -p.c_max[axle] * v * v - power);
        // Forces stay within the limit, and a feasible demand is met.
        for force in [command, equations::constrained(&p, axle, f, v)] {
            prop_assert!(force.abs() <= 30_000.0);
        }
        let possible = -0.5 * (p.c_max[axle] - c_0) * v;
        if possible.abs() <= 30_000.0 {
            prop_assert_eq!(equations::constrained(&p, axle, possible, v), possible);
        }
    }

    /// Mirrored inputs (roll negated, sides exchanged) give mirrored forces, and negated inputs give negated forces,
    /// both bit for bit: the mirrored rules are odd, and the sums in the allocation round alike.
    #[test]
    fn left_and_right_are_alike(
        motions in prop::collection::vec(prop::array::uniform10(-1.0..1.0_f64), 1..20), mode in 0..3_usize,
    ) {
        let p = with(CONSTRAINTS[mode]);
        let d = derived(&p);
        let (mut x, mut mirror, mut turned) = (X::default(), X::default(), X::default());
        for m in motions {
            let v = [m[6], m[7], m[8], m[9]];
            let u = U {
                zd: 0.2 * m[0], thetad: 0.1 * m[1], phid: 0.1 * m[2],
                zdd: 3.0 * m[3], thetadd: 2.0 * m[4], phidd: m[5],
                v: Struts(v),
            };
            let y = sample(&p, &d, &mut x, &u);
            let um = U { phid: -u.phid, phidd: -u.phidd, v: Struts([v[1], v[0], v[3], v[2]]), ..u.clone() };
            let ym = sample(&p, &d, &mut mirror, &um);
            prop_assert_eq!([y.f[1], y.f[0], y.f[3], y.f[2]], *ym.f);
            prop_assert_eq!((y.f_h, y.m_p, -y.m_r), (ym.f_h, ym.m_p, ym.m_r));
            let ut = U::from_reals(&u.reals().iter().map(|value| -value).collect::<Vec<_>>());
            prop_assert_eq!(y.f.map(|force| -force), *sample(&p, &d, &mut turned, &ut).f);
        }
    }
}

#[test]
fn dampers_without_a_range_are_rejected() {
    let message = |p: SemiActiveFuzzySuspension| equations::derived(&p).err();
    let weak = TwoAxles([40_000.0, 2000.0]);
    assert_eq!(
        message(SemiActiveFuzzySuspension { c_max: weak, ..SemiActiveFuzzySuspension::default() }).unwrap(),
        "'damper.maximum_damping.rear' must be at least 'damper.minimum_damping.rear' (4000 N.s/m), got 2000 N.s/m"
    );
    let soft = TwoAxles([10_000.0, 80_000.0]);
    assert_eq!(
        message(SemiActiveFuzzySuspension { c_max: soft, ..with(Constraint::Command) }).unwrap(),
        "'damper.maximum_damping.front' must be at least 'suspension.damping.front' (12000 N.s/m), got 10000 N.s/m: \
         the command alone can only add damping"
    );
    // The adjustable damper can be softer than the damper of the plant.
    assert_eq!(message(SemiActiveFuzzySuspension { c_max: soft, ..SemiActiveFuzzySuspension::default() }), None);
}
