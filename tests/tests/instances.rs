//! Instances do not depend on each other, on earlier runs, or on their process.
//!
//! Reference: FMI 2.0.4, sections 2.1.5 and 2.1.8 (instances, states), and the project's guarantee that equal calls
//! give bit-identical runs. Comparisons are exact unless noted.

use fmu_import::description::Causality;
use fmu_import::loader::Instance;
use std::process::Command;
use tests::signals::{Excitation, Random, run};
use tests::{Fmu, all, bits, ok, reals};

const STEP: f64 = 0.001;

fn state(instance: &mut Instance) -> Vec<u8> {
    let saved = ok(instance.save_state());
    ok(instance.serialize_state(&saved))
}

#[test]
fn instances_on_several_threads_run_as_they_would_alone() {
    const STEPS: u32 = 300;
    let fmus = all();
    let alone = |fmu: &Fmu, seed| run(fmu, &mut fmu.started(), &Excitation::of(fmu, seed), 0.0, 0..STEPS, STEP);
    let expected: Vec<_> = fmus.iter().map(|fmu| [1, 2].map(|seed| alone(fmu, seed))).collect();
    // Two instances of every FMU at the same time, each created and freed in its own thread.
    let found = std::thread::scope(|scope| {
        let threads: Vec<_> = fmus.iter().map(|fmu| [1, 2].map(|seed| scope.spawn(move || alone(fmu, seed)))).collect();
        threads.into_iter().map(|pair| pair.map(|thread| thread.join().expect("no panic"))).collect::<Vec<_>>()
    });
    for ((fmu, expected), found) in fmus.iter().zip(expected).zip(found) {
        assert!(expected == found, "{}: another result beside other instances", fmu.name);
    }
}

#[test]
fn instances_stepped_in_turns_do_not_mix() {
    for fmu in all() {
        let excitations = [1, 2].map(|seed| Excitation::of(&fmu, seed));
        let expected = excitations.each_ref().map(|e| run(&fmu, &mut fmu.started(), e, 0.0, 0..20, STEP));
        let mut instances = [fmu.started(), fmu.started()];
        let mut found = [Vec::new(), Vec::new()];
        for k in 0..20 {
            for ((instance, excitation), found) in instances.iter_mut().zip(&excitations).zip(&mut found) {
                found.extend(run(&fmu, instance, excitation, 0.0, k..k + 1, STEP));
            }
        }
        assert!(expected == found, "{}: instances stepped in turns mix", fmu.name);
    }
}

#[test]
fn an_instance_may_move_to_another_thread() {
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 1);
        let expected = run(&fmu, &mut fmu.started(), &excitation, 0.0, 0..20, STEP);
        let mut instance = fmu.started();
        let mut found = run(&fmu, &mut instance, &excitation, 0.0, 0..10, STEP);
        found.extend(tests::raw::on_another_thread(instance, |instance| {
            run(&fmu, instance, &excitation, 0.0, 10..20, STEP)
        }));
        assert!(expected == found, "{}", fmu.name);
    }
}

#[test]
fn a_restored_state_goes_on_to_the_last_bit() {
    const END: u32 = 120;
    let mut random = Random(3);
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 5);
        let expected = run(&fmu, &mut fmu.started(), &excitation, 0.0, 0..END, STEP);
        let width = expected.len() / END as usize;
        for _ in 0..4 {
            let at = random.below(u64::from(END)) as u32;
            let detour = 1 + random.below(30) as u32;
            let rest = &expected[at as usize * width..];
            let mut instance = fmu.started();
            drop(run(&fmu, &mut instance, &excitation, 0.0, 0..at, STEP));
            let saved = ok(instance.save_state());
            let bytes = ok(instance.serialize_state(&saved));
            // The same instance steps with other inputs and then returns to the saved state. This is done twice,
            // because a state can be reused.
            for seed in [6, 7] {
                drop(run(&fmu, &mut instance, &Excitation::of(&fmu, seed), 0.0, at..at + detour, STEP));
                ok(instance.restore_state(&saved));
                assert_eq!(state(&mut instance), bytes, "{}: the state is the saved one", fmu.name);
            }
            assert!(run(&fmu, &mut instance, &excitation, 0.0, at..END, STEP) == rest, "{} at {at}", fmu.name);
            // The instance also returns to the saved state from Terminated.
            ok(instance.terminate());
            ok(instance.restore_state(&saved));
            assert!(run(&fmu, &mut instance, &excitation, 0.0, at..END, STEP) == rest, "{} at {at}", fmu.name);
            // A new instance that was never initialized also continues from the bytes.
            let mut other = fmu.instance();
            let copy = ok(other.deserialize_state(&bytes));
            ok(other.restore_state(&copy));
            assert!(run(&fmu, &mut other, &excitation, 0.0, at..END, STEP) == rest, "{} at {at}", fmu.name);
        }
    }
}

#[test]
fn a_state_is_saved_again_into_the_same_place() {
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 5);
        let mut instance = fmu.started();
        let saved = ok(instance.save_state());
        drop(run(&fmu, &mut instance, &excitation, 0.0, 0..10, STEP));
        ok(instance.save_state_again(&saved));
        let expected = run(&fmu, &mut instance, &excitation, 0.0, 10..20, STEP);
        ok(instance.restore_state(&saved));
        assert!(run(&fmu, &mut instance, &excitation, 0.0, 10..20, STEP) == expected, "{}", fmu.name);
        ok(instance.free_state(saved));
    }
}

#[test]
fn a_state_goes_on_in_another_process() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 9);
        let mut instance = fmu.started();
        drop(run(&fmu, &mut instance, &excitation, 0.0, 0..37, STEP));
        let file = folder.path().join(&fmu.name);
        std::fs::write(&file, state(&mut instance)).expect("the state can be written");
        let expected = run(&fmu, &mut instance, &excitation, 0.0, 37..80, STEP);
        let output = Command::new(env!("CARGO_BIN_EXE_exercise"))
            .arg("continue")
            .args([&fmu.path, &file])
            .args(["9", "37", "80"])
            .output()
            .expect("the helper runs");
        assert!(output.status.success(), "{}: {}", fmu.name, String::from_utf8_lossy(&output.stderr));
        assert!(words(&output.stdout) == expected, "{}: another process continues differently", fmu.name);
    }
}

/// The bits that the helper printed.
fn words(text: &[u8]) -> Vec<u64> {
    let text = std::str::from_utf8(text).expect("the helper prints text");
    text.split_whitespace().map(|word| u64::from_str_radix(word, 16).expect("the helper prints bits")).collect()
}

#[test]
fn an_instance_that_was_reset_is_like_new() {
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 11);
        let fresh = state(&mut fmu.instance());
        let expected = run(&fmu, &mut fmu.started(), &excitation, 0.0, 0..30, STEP);
        let mut instance = fmu.instance();
        // Changes everything: time, inputs, states, and all tunable parameters whose limits allow a change.
        ok(instance.setup_experiment(5.0, Some(100.0)));
        for variable in fmu.with(Causality::Parameter) {
            let value = 1.01 * tests::signals::start(variable);
            // A value outside the limits is rejected, which does not matter here.
            let _ = instance.set_real(&[variable.reference], &[value]);
        }
        ok(instance.enter_initialization_mode());
        // The changed parameters can be incompatible; then the reset starts from Initialization Mode.
        if instance.exit_initialization_mode().is_ok() {
            drop(run(&fmu, &mut instance, &Excitation::of(&fmu, 12), 5.0, 0..30, STEP));
        }
        ok(instance.reset());
        assert!(state(&mut instance) == fresh, "{}: the state after a reset", fmu.name);
        ok(instance.setup_experiment(0.0, None));
        ok(instance.enter_initialization_mode());
        ok(instance.exit_initialization_mode());
        assert!(run(&fmu, &mut instance, &excitation, 0.0, 0..30, STEP) == expected, "{}", fmu.name);
    }
}

/// FMUs whose outputs are functions of the time, and therefore depend on the start time.
const TIME_DEPENDENT: [&str; 1] = ["Driver"];

#[test]
fn a_start_at_another_time_changes_nothing() {
    // At 10000 s, times are not exact multiples of the step of 1 ms, and the step is 5.5e8 times the spacing of the
    // floating-point numbers.
    const START: f64 = 1e4;
    for fmu in all() {
        let excitation = Excitation::of(&fmu, 13);
        let expected = run(&fmu, &mut fmu.started(), &excitation, 0.0, 0..200, STEP);
        let mut instance = fmu.started_at(START);
        let found = run(&fmu, &mut instance, &excitation, START, 0..200, STEP);
        assert_eq!(ok(instance.last_successful_time()), START + 199.0 * STEP + STEP, "{}", fmu.name);
        if !TIME_DEPENDENT.contains(&fmu.name.as_str()) {
            assert!(found == expected, "{}: the result depends on the start time", fmu.name);
        }
    }
}

#[test]
fn discrete_time_models_take_the_same_samples_in_steps_of_any_length() {
    // The inputs are constant in blocks of 10 ms, which are divided into ten steps of 1 ms in one run and at random in
    // the other run. The samples are the same in both runs, so the outputs at the end of a block are bit-identical.
    const BLOCK: f64 = 0.01;
    let mut random = Random(17);
    for fmu in all().iter().filter(|fmu| !fmu.is_plant()) {
        let excitation = Excitation::of(fmu, 19);
        let mut inputs = vec![0.0; excitation.references.len()];
        let mut even = fmu.started();
        let mut uneven = fmu.started();
        let mut whole = fmu.started();
        for block in 0..20_u32 {
            let (begin, end) = (f64::from(block) * BLOCK, f64::from(block + 1) * BLOCK);
            excitation.values(begin, &mut inputs);
            for instance in [&mut even, &mut uneven, &mut whole] {
                ok(instance.set_real(&excitation.references, &inputs));
            }
            for k in 0..10 {
                ok(even.do_step(begin + f64::from(k) * STEP, STEP));
            }
            let mut time = begin;
            while time < end {
                // A random step takes 1 us to 4 ms, and leaves no remainder that is too small for a step.
                let step = 1e-6 + 2e-3 * (1.0 + random.symmetric());
                let next = if time + step > end - 1e-6 { end } else { time + step };
                ok(uneven.do_step(time, next - time));
                time = next;
            }
            ok(whole.do_step(begin, end - begin));
            let expected = bits(&fmu.outputs(&mut even));
            assert!(bits(&fmu.outputs(&mut uneven)) == expected, "{}: uneven steps, block {block}", fmu.name);
            assert!(bits(&fmu.outputs(&mut whole)) == expected, "{}: whole blocks, block {block}", fmu.name);
        }
    }
}

#[test]
fn plants_reach_the_same_state_in_steps_of_any_length() {
    // The integrator's step is at most max_step for any communication step. Uneven steps lead to different substeps,
    // which only changes the error of RK4: 3e-10 of the peak in smooth runs of the trucks, 2e-8 for the car with its
    // stiff wheel spin. Tolerance: 1e-7.
    const BLOCK: f64 = 0.01;
    for fmu in all().iter().filter(|fmu| fmu.is_plant()) {
        // A new generator for each FMU: its random steps then do not depend on the other FMUs.
        let mut random = Random(23);
        let excitation = Excitation::of(fmu, 29);
        let states: Vec<_> = fmu.states().iter().map(|state| state.reference).collect();
        let mut inputs = vec![0.0; excitation.references.len()];
        let (mut even, mut uneven) = (fmu.started(), fmu.started());
        let mut peaks = vec![0.0_f64; states.len()];
        let mut errors = vec![0.0_f64; states.len()];
        for block in 0..20_u32 {
            let (begin, end) = (f64::from(block) * BLOCK, f64::from(block + 1) * BLOCK);
            excitation.values(begin, &mut inputs);
            for instance in [&mut even, &mut uneven] {
                ok(instance.set_real(&excitation.references, &inputs));
            }
            ok(even.do_step(begin, end - begin));
            let mut time = begin;
            while time < end {
                let step = 1e-6 + 2e-3 * (1.0 + random.symmetric());
                let next = if time + step > end - 1e-6 { end } else { time + step };
                ok(uneven.do_step(time, next - time));
                time = next;
            }
            let (expected, found) = (reals(&mut even, &states), reals(&mut uneven, &states));
            for i in 0..states.len() {
                peaks[i] = peaks[i].max(expected[i].abs());
                errors[i] = errors[i].max((expected[i] - found[i]).abs());
            }
        }
        for ((state, peak), error) in fmu.states().iter().zip(peaks).zip(errors) {
            assert!(error <= 1e-7 * peak, "{}: {} differs by {error:e}, peak {peak:e}", fmu.name, state.name);
        }
    }
}

#[test]
fn libraries_in_one_space_of_names_do_not_mix() {
    // With RTLD_GLOBAL, the functions of all FMUs have the same names in one namespace; each FMU must call its own
    // functions.
    let paths = tests::paths();
    let both_orders = [paths.clone(), paths.iter().rev().cloned().collect()];
    let expected: std::collections::HashMap<_, _> = all()
        .iter()
        .map(|fmu| (fmu.name.clone(), run(fmu, &mut fmu.started(), &Excitation::of(fmu, 1), 0.0, 0..20, STEP)))
        .collect();
    for order in both_orders {
        let output =
            Command::new(env!("CARGO_BIN_EXE_exercise")).arg("global").args(&order).output().expect("the helper runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).expect("the helper prints text");
        assert_eq!(text.lines().count(), order.len());
        for line in text.lines() {
            let (name, rest) = line.split_once(' ').expect("a name and bits");
            assert!(words(rest.as_bytes()) == expected[name], "{name}: another result with RTLD_GLOBAL");
        }
    }
}
