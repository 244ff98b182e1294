//! FMUs compute in the default floating-point environment, independent of the importer's.
//!
//! Reference: the same run in the default environment, bit for bit. A trap would end the test with SIGFPE.
#![cfg(target_arch = "x86_64")]

use tests::raw::FloatEnvironment;
use tests::signals::Excitation;
use tests::{Fmu, all, all_of_fmi3, bits, ok};

const STEP: f64 = 0.001;

/// Steps of a run, multiplied by `FMU_TEST_FACTOR`.
fn steps() -> u32 {
    60 * std::env::var("FMU_TEST_FACTOR").map_or(1, |factor| factor.parse::<u32>().unwrap())
}

/// Returns the outputs of all steps. Every call is made in `environment`, and must not change it.
fn run(fmu: &Fmu, environment: FloatEnvironment) -> Vec<u64> {
    let kept = |left, what| assert_eq!(left, environment, "{}: {what} changes the environment", fmu.name);
    let excitation = Excitation::of(fmu, 11);
    let mut inputs = vec![0.0; excitation.references.len()];
    let (mut instance, left) = environment.around(|| fmu.started());
    kept(left, "initialization");
    let mut all = Vec::new();
    for k in 0..steps() {
        let time = f64::from(k) * STEP;
        excitation.values(time, &mut inputs);
        let ((), left) = environment.around(|| {
            ok(instance.set_real(&excitation.references, &inputs));
            ok(instance.do_step(time, STEP));
        });
        kept(left, "a step");
        let (outputs, left) = environment.around(|| fmu.outputs(&mut instance));
        kept(left, "reading");
        all.extend(bits(&outputs));
    }
    all
}

#[test]
fn results_do_not_depend_on_the_environment_of_the_host() {
    // The importer computes the times of ticks inside its own functions, which would trap.
    let without_clocks = |fmu: &Fmu| fmu.description.clocks.is_empty();
    for fmu in all().into_iter().chain(all_of_fmi3()).filter(without_clocks) {
        let expected = run(&fmu, FloatEnvironment::DEFAULT);
        for environment in [
            FloatEnvironment::TRAPS,
            FloatEnvironment::DOWN,
            FloatEnvironment::UP,
            FloatEnvironment::TO_ZERO,
            FloatEnvironment::FLUSH,
        ] {
            assert!(run(&fmu, environment) == expected, "{} {environment:?}", fmu.name);
        }
    }
}
