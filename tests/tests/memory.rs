//! What FMUs do with memory, watched from outside the process: no allocation in a step, nothing lost, no access where
//! nothing is.
#![cfg(target_os = "linux")]

use std::path::PathBuf;
use std::process::{Command, Output};

const EXERCISE: &str = env!("CARGO_BIN_EXE_exercise");

fn exercise(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?} ends with {}:\n{messages}", output.status);
    output
}

/// The library that counts allocations; cargo builds it with the tests as an example of this package.
fn counting_library() -> PathBuf {
    let folder = PathBuf::from(EXERCISE).parent().expect("the helper lies in a folder").join("examples");
    let library = folder.join("libcount_allocations.so");
    assert!(library.exists(), "{} is missing: run `cargo build --package tests --examples`", library.display());
    library
}

/// Real-time masters and long co-simulations count on it: set, step and get use no heap at all, in any FMU.
#[cfg(target_env = "gnu")]
#[test]
fn a_step_allocates_nothing() {
    let paths = tests::paths();
    let output = exercise(Command::new(EXERCISE).arg("steps").args(&paths).env("LD_PRELOAD", counting_library()));
    let text = String::from_utf8(output.stdout).expect("the helper prints text");
    assert_eq!(text.lines().count(), paths.len());
    for line in text.lines() {
        let [name, in_steps, before] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        // Loading and initializing allocates: that it was counted shows that the counter works.
        assert!(before.parse::<u64>().is_ok_and(|count| count > 100), "{name}: nothing was counted: {before}");
        assert_eq!(in_steps, "0", "{name}: allocations in 300 steps of set, step and get");
    }
}

/// A whole life of every FMU: no invalid access, no use of values that were never set, nothing lost.
#[test]
#[ignore = "needs valgrind; .ci/run installs it and runs this test"]
fn valgrind_finds_nothing() {
    exercise(tests::valgrind().arg(EXERCISE).arg("life").args(tests::paths()));
}

/// What a library keeps beside its instances goes with it: a master that loads FMUs again and again does not grow.
/// Nothing points any more to what an unloaded library has left behind, so it would count as lost.
#[test]
#[ignore = "needs valgrind; .ci/run installs it and runs this test"]
fn an_unloaded_library_leaves_nothing_behind() {
    exercise(tests::valgrind().arg(EXERCISE).arg("reload").args(tests::paths()));
}
