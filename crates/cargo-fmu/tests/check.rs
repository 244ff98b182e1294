//! `cargo fmu check` and `inspect` on FMUs with the habits of other tools.
#![cfg(unix)]

#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

use std::path::Path;
use std::process::{Command, Output};

use fmu_import::description::FmiVersion;
use zoo::Zoo;

fn command(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    command.args(arguments).current_dir(folder).env("NO_COLOR", "1").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// An FMU that simulates but has a model identifier that the standard does not allow, and one that follows the standard
/// but does not simulate.
#[test]
fn the_two_questions_have_their_own_summary_and_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    Zoo { identifier: "Zoo-Dash.1", ..Zoo::new("none") }.pack(folder.path());
    for (arguments, code) in [
        (&["check", "Zoo.fmu"][..], 1),
        (&["check", "Zoo.fmu", "--fail-on", "standard"], 1),
        (&["check", "Zoo.fmu", "--fail-on", "simulation"], 0),
    ] {
        let output = command(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        let summary = "Zoo.fmu: 1 error, no warning\n  it simulates: yes (no error, no warning)\n  \
                       it follows the standard: no (1 error, no warning)\n";
        assert!(text(&output.stdout).starts_with(summary), "{}", text(&output.stdout));
    }
    let listed = command(folder.path(), &["inspect", "Zoo.fmu"]);
    assert!(listed.status.success() && text(&listed.stdout).contains("\nInputs (5)\n"), "{}", text(&listed.stdout));

    Zoo { at: 0.97, ..Zoo::new("error") }.pack(folder.path());
    for (fail_on, code) in [("simulation", 1), ("standard", 0), ("all", 1)] {
        let output = command(folder.path(), &["check", "Zoo.fmu", "--fail-on", fail_on]);
        assert_eq!(output.status.code(), Some(code), "{fail_on}");
        let found = text(&output.stdout);
        assert!(found.contains("\n  it simulates: no (1 error, no warning)\n"), "{found}");
        assert!(found.contains("\n  it follows the standard: yes (no error, no warning)\n"), "{found}");
    }
}

#[test]
fn an_fmu_without_an_instance_does_not_count_as_simulating() {
    let folder = tempfile::tempdir().unwrap();
    let interface = r#"<CoSimulation modelIdentifier="Zoo" canHandleVariableCommunicationStepSize="true"/>"#;
    let edits = [(interface, r#"<ScheduledExecution modelIdentifier="Zoo"/>"#)];
    Zoo { fmi: FmiVersion::V3, edits: &edits, ..Zoo::new("none") }.pack(folder.path());
    let output = command(folder.path(), &["check", "Zoo.fmu"]);
    let found = text(&output.stdout);
    assert!(found.contains("\n  it simulates: no (1 error, no warning)\n"), "{found}");
    assert!(found.contains("\n  error: fmi3InstantiateScheduledExecution: "), "{found}");
}

/// The time limit applies to a step, so an endless experiment is cut off and not reported as hanging.
#[test]
fn a_long_experiment_is_cut() {
    let folder = tempfile::tempdir().unwrap();
    let long = [("stopTime=\"1\"", "stopTime=\"1e12\"")];
    Zoo { at: 1e99, edits: &long, ..Zoo::new("none") }.pack(folder.path());
    let output = command(folder.path(), &["check", "Zoo.fmu", "--timeout", "2"]);
    let found = text(&output.stdout);
    let note = "\n  note: the default experiment: was cut at ";
    assert!(found.contains(note) && found.ends_with(" s of 1000000000000 s after 2 s (--timeout)\n"), "{found}");
    assert_eq!(output.status.code(), Some(0), "{found}");
    assert!(found.contains(", the end of a run, stack\n"), "{found}");
}

/// A crash in one trial does not prevent the other trials.
#[test]
fn the_check_goes_on_after_a_crash() {
    let folder = tempfile::tempdir().unwrap();
    Zoo { at: 1e9, ..Zoo::new("reset_crash") }.pack(folder.path());
    let output = command(folder.path(), &["check", "Zoo.fmu"]);
    let found = text(&output.stdout);
    let crash = "\n  error: reset before initialization: the process ended (signal 11, SIGSEGV) during fmi2Reset\n";
    assert!(found.starts_with("Zoo.fmu: 1 error, no warning\n") && found.ends_with(crash), "{found}");
    assert!(found.contains("the default experiment, reset after a run, two instances, "), "{found}");
    assert!(found.contains(", the end of a run, stack\n"), "{found}");
}

/// The FMU prints 500 lines in each of about twenty instances.
#[test]
fn a_banner_does_not_fill_the_report() {
    let folder = tempfile::tempdir().unwrap();
    for habit in ["chatter", "talk"] {
        Zoo::new(habit).pack(folder.path());
        let output = command(folder.path(), &["check", "Zoo.fmu"]);
        assert!(output.status.success(), "{habit}: {}", text(&output.stdout));
        let printed = text(&output.stderr);
        let lines = text(&output.stdout).lines().count() + printed.lines().count();
        assert!(lines < 30, "{habit}: {lines}");
        assert_eq!(
            printed.contains("more: only the first 20 different ones are shown"),
            habit == "chatter",
            "{printed}"
        );
    }
}

/// `inspect` lists FMUs that other commands reject, prints the reason, and exits with 1.
#[test]
fn an_fmu_that_cannot_be_used_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, reason) in [
        ("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\"", "FMI version 1.0, expected 2.0 or 3.0"),
        ("declaredType=\"Mode\"", "declaredType=\"Mood\"", "type `Mood` is not defined"),
    ] {
        Zoo { edits: &[(from, to)], ..Zoo::new("none") }.pack(folder.path());
        let output = command(folder.path(), &["inspect", "Zoo.fmu"]);
        assert_eq!(output.status.code(), Some(1));
        let words =
            |bytes: &[u8]| text(bytes).split([' ', '\n', '│']).filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ");
        assert!(words(&output.stderr).contains(reason), "{}", text(&output.stderr));
        let listed = text(&output.stdout);
        assert!(listed.starts_with("Zoo\nFMI             ") && listed.contains("\nVariables (15)\n"), "{listed}");
        assert!(listed.contains("\n  habit  parameter"), "{listed}");
    }
}
