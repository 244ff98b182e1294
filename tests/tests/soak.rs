//! Short runs of `soak` with many instances, steps and states; docs/robustness.md describes the long runs.
#![cfg(target_os = "linux")]

use std::process::Command;

fn soak(arguments: &[&str], fmus: &[std::path::PathBuf]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_soak"));
    let output = command.args(arguments).args(fmus).output().expect("the program runs");
    assert!(
        output.status.success(),
        "{arguments:?}: {}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn a_thousand_instances_in_64_threads_do_not_grow() {
    soak(&["many", "1000", "64", "12"], &tests::paths());
}

#[test]
fn a_million_steps_do_not_drift() {
    let plant = tests::folder().join("HydroPneumaticHalfCar.fmu");
    soak(&["steps", "1000000"], &[plant]);
}

#[test]
fn states_of_random_instants_go_on_in_another_process() {
    soak(&["restore", "40"], &tests::paths());
}
