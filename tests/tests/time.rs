//! At times far from 0, as on real clocks, no step is rejected, and no sample is lost or taken twice.
//!
//! Reference: ARCHITECTURE.md, "Time". All comparisons are exact.

use tests::signals::{Excitation, run};
use tests::state_bytes::{Place, state};
use tests::{Fmu, all, ok, rejected};

/// Four months, and a Unix time in 2023, in s. Times of this size are rounded to 2e-9 s and 2e-7 s, respectively.
const LARGE: [f64; 2] = [1e7, 1.7e9];

/// Communication step in s.
const STEP: f64 = 0.001;

#[test]
fn a_run_at_a_large_time_is_the_same_as_at_0() {
    const STEPS: u32 = 3000;
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 7);
        let from = |start| run(&fmu, &mut fmu.started_at(start), &excitation, start, 0..STEPS, STEP);
        let expected = from(0.0);
        for start in LARGE {
            let found = from(start);
            assert_eq!(found.len(), expected.len());
            // Only the driver's maneuver is a function of the time, and a double cannot represent 1.7e9 s + 1 ms
            // exactly.
            assert!(fmu.name == "Driver" || found == expected, "{} from {start} s", fmu.name);
        }
    }
}

#[test]
fn no_sample_is_lost_or_taken_twice() {
    // Communication steps in units of 0.1 ms: as long as a sample, longer, shorter, and neither a multiple nor a
    // fraction of a sample.
    const UNIT: f64 = 1e-4;
    for fmu in all().into_iter().filter(|fmu| !fmu.is_plant()) {
        let place = Place::of(&fmu.description.guid);
        let sample_time = (tests::real(&fmu, &mut fmu.started(), "sample_time") / UNIT).round() as u64;
        for start in LARGE {
            for step in [10_u64, 100, 25, 7] {
                let mut instance = fmu.started_at(start);
                let h = step as f64 * UNIT;
                for k in 0..200_u64 {
                    ok(instance.do_step(start + k as f64 * h, h));
                    let due = ((k + 1) * step).div_ceil(sample_time);
                    let name = &fmu.name;
                    assert_eq!(place.samples(&mut instance), due, "{name}: step {k} of {h} s from {start} s");
                }
            }
        }
    }
}

/// A state whose counter of samples is far ahead of its time would never take a sample again.
#[test]
fn a_state_whose_samples_do_not_agree_with_its_time_is_rejected() {
    for fmu in all() {
        let place = Place::of(&fmu.description.guid);
        for start in [0.0, 1.7e9] {
            let mut instance = fmu.started_at(start);
            drop(run(&fmu, &mut instance, &Excitation::of(&fmu, 1), start, 0..20, STEP));
            let before = state(&mut instance);
            let samples = place.samples(&mut instance);
            assert_eq!(samples > 0, !fmu.is_plant(), "{}: {samples} samples in 20 ms", fmu.name);
            for crafted in [u64::MAX, samples + 1000] {
                let bytes = place.with_samples(&mut instance, crafted);
                let message = rejected(instance.deserialize_state(&bytes));
                assert!(message.contains(&format!("the sample counter is {crafted}, but")), "{}: {message}", fmu.name);
            }
            // The unchanged state is accepted.
            let saved = ok(instance.deserialize_state(&before));
            ok(instance.restore_state(&saved));
            assert!(state(&mut instance) == before, "{}", fmu.name);
        }
    }
}

#[test]
fn a_time_that_is_not_that_of_the_instance_is_rejected() {
    for start in LARGE {
        let fmu = Fmu::named("RescueVehicle");
        let mut instance = fmu.started_at(start);
        assert!(rejected(instance.do_step(start + 1e-4, STEP)).contains("but the instance is at"));
    }
}
