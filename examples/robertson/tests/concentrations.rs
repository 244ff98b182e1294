//! Compares the fractions with published values.

use fmu::simulation::ContinuousSimulation;
use robertson::Robertson;

/// Reference: the values at 40 s in Hairer and Wanner, "Solving Ordinary Differential Equations II", section IV.10, and
/// in the SUNDIALS documentation. Tolerance: 1e-6 of each value; the error tolerance of a single step is 1e-8.
#[test]
fn fractions_match_the_literature() {
    for steps in [1, 40, 1000] {
        let mut run = ContinuousSimulation::new(Robertson).expect("it starts");
        for _ in 0..steps {
            run.step(&(), 40.0 / f64::from(steps)).expect("a step");
        }
        let x = run.state();
        for (found, expected) in [x.a, x.b, x.c].into_iter().zip([0.715_827_068_8, 9.185_534_765e-6, 0.284_163_745_8]) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} and {expected} in {steps} steps");
        }
        // The sum is conserved except for rounding, because the three rates add up to zero in each stage of the solver.
        assert!((x.a + x.b + x.c - 1.0).abs() < 1e-12, "{}", x.a + x.b + x.c - 1.0);
    }
}

/// Reference: at the end only the third species is left (Hairer and Wanner: a = 2.08e-8 at 1e11 s).
#[test]
fn the_reaction_can_be_followed_to_its_end() {
    let mut run = ContinuousSimulation::new(Robertson).expect("it starts");
    run.step(&(), 1e11).expect("a step");
    let a = run.state().a;
    assert!((a / 2.083e-8 - 1.0).abs() < 1e-2, "{a}");
}
