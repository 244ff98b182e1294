//! Fuzzing with a fixed seed, in a separate process. `tests::fuzz` describes the checks, docs/robustness.md how to make
//! longer runs.

use std::path::PathBuf;
use std::process::{Command, Output};

const FUZZ: &str = env!("CARGO_BIN_EXE_fuzz");

fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(
        output.status.success(),
        "{command:?} ends with {}:\n{}\n{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// The numbers of calls by function and status in the output, without the times.
fn answers(output: &Output) -> Vec<String> {
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().filter(|line| line.starts_with("fmi")).map(str::to_owned).collect()
}

/// Fuzzes FMUs, and checks that every function succeeded at least once, because calls that are always rejected test
/// little.
fn no_call_breaks(paths: &[PathBuf], functions: usize, never: &[&str], discarded: &[&str]) {
    // The same calls on every machine.
    let output = run(Command::new(FUZZ).args(["--calls", "25000"]).args(paths));
    let answers = answers(&output);
    assert_eq!(answers.len(), functions, "all functions of the standard but those that get no instance");
    for line in answers {
        let (function, counts) = line.split_once(": ").expect("a function and its counts");
        let counts: Vec<u64> = counts.split(", ").map(|count| count.parse().expect("a count")).collect();
        let column = usize::from(discarded.contains(&function));
        assert!(counts[column] > 0 || never.contains(&function), "{line}");
    }
}

#[test]
fn no_call_breaks_an_fmu() {
    let never = ["fmi2CancelStep", "fmi2GetRealOutputDerivatives"];
    let discarded = ["fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"];
    no_call_breaks(&tests::paths(), 42, &never, &discarded);
}

#[test]
fn no_call_breaks_an_fmu_of_fmi_3() {
    no_call_breaks(&tests::paths_of_fmi3(), 74, &[], &[]);
}

#[test]
fn equal_seeds_make_equal_calls() {
    let paths = tests::paths();
    let again = |seed| answers(&run(Command::new(FUZZ).args(["--calls", "5000", "--seed", seed]).args(&paths[..2])));
    assert_eq!(again("7"), again("7"));
    assert_ne!(again("7"), again("8"));
}

/// No calls lead to an invalid access, a use of uninitialized values, or lost memory.
#[cfg(target_os = "linux")]
#[test]
// Ignored by default, because scripts/test requires only Rust, Python and a C compiler. `.ci/run` installs valgrind.
#[ignore = "needs valgrind; .ci/run installs it and runs this test"]
fn valgrind_finds_nothing() {
    run(tests::valgrind().arg(FUZZ).args(["--calls", "500", "--seed", "2"]).args(tests::paths()));
    run(tests::valgrind().arg(FUZZ).args(["--calls", "500", "--seed", "2"]).args(tests::paths_of_fmi3()));
}
