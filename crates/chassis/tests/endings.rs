//! Incomplete runs: an FMU fails, ends the simulation, or returns a value that is not finite. The rows up to this time
//! are kept, and `status.json` marks the run as incomplete. No command treats it as a complete run.
#![cfg(unix)]

#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

use fmu_import::description::FmiVersion;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;
use zoo::Zoo;

/// The input `us` has no constant, because it is a String, which keeps its start value.
const SCENARIO: &str = r#"
title = "Endings"
[simulation]
stop = 1.0
step = 0.1
[[component]]
name = "p"
fmu = "Zoo"
inputs = { u = 2.0, ui = 0, ub = false, ue = "eco" }
[record]
signals = ["p:y"]
[[case]]
name = "a"
title = "A"
[[metric]]
name = "share"
title = "Share above 3"
signal = "p:y"
kind = "share"
threshold = 3.0
max = 0.1
"#;

/// Runs a scenario with an FMU that shows a habit from 0.5 s on.
fn run(fmi: FmiVersion, habit: &str, scenario: &str, arguments: &[&str]) -> (TempDir, Output) {
    let folder = TempDir::new().unwrap();
    Zoo { fmi, at: 0.5, ..Zoo::new(habit) }.pack(folder.path());
    std::fs::write(folder.path().join("ends.toml"), scenario).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_chassis"));
    command.args(["run", "ends.toml", "--fmus", ".", "--no-warnings", "--jobs", "1"]).args(arguments);
    let output = command.current_dir(folder.path()).env("NO_COLOR", "1").env("CHASSIS_PYTHON", "").output().unwrap();
    (folder, output)
}

/// An error message without line breaks.
fn unwrapped(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn times(folder: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(folder.join("results/ends/runs/a.csv")).unwrap();
    text.lines().skip(1).map(|line| line.split(',').next().unwrap().parse().unwrap()).collect()
}

fn status(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("results/ends/runs/status.json")).unwrap();
    serde_json::from_str::<Value>(&text).unwrap()["runs"][0].clone()
}

/// If no run is complete, the page of an earlier call is kept, but the JUnit file is replaced.
#[test]
fn no_page_is_made_without_a_complete_run() {
    use std::os::unix::fs::PermissionsExt;
    for (habit, has_page) in [("none", true), ("error", false)] {
        let folder = TempDir::new().unwrap();
        Zoo { at: 0.5, ..Zoo::new(habit) }.pack(folder.path());
        std::fs::write(folder.path().join("ends.toml"), SCENARIO).unwrap();
        let python = folder.path().join("python");
        std::fs::write(&python, format!("#!/bin/sh\ncat > {}\n", folder.path().join("request").display())).unwrap();
        std::fs::set_permissions(&python, PermissionsExt::from_mode(0o755)).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_chassis"));
        command.args(["run", "ends.toml", "--fmus", ".", "--no-warnings", "--no-fail", "--junit", "ends.xml"]);
        let output = command.current_dir(folder.path()).env("CHASSIS_PYTHON", &python).output().unwrap();
        assert_eq!(output.status.success(), has_page, "{}", unwrapped(&output.stderr));
        let request = std::fs::read(folder.path().join("request")).ok();
        let numbers = request.map(|text| serde_json::from_slice::<Value>(&text).unwrap()["numbers"].clone());
        assert_eq!(numbers.is_some(), has_page, "{numbers:?}");
        assert!(numbers.is_none_or(|numbers| numbers["a"][0].is_number()));
        let suite = std::fs::read_to_string(folder.path().join("ends.xml")).unwrap();
        let errors = if has_page { "errors=\"0\" skipped=\"0\"" } else { "errors=\"1\" skipped=\"1\"" };
        assert!(suite.contains(errors), "{suite}");
    }
}

/// A crash after the last step loses nothing that was simulated.
#[test]
fn a_crash_at_the_end_keeps_all_rows() {
    for (habit, function) in [("end_crash", "fmi2Terminate"), ("free_crash", "fmi2FreeInstance")] {
        let (folder, output) = run(FmiVersion::V2, habit, SCENARIO, &[]);
        let said = unwrapped(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{habit}: {said}");
        assert!(said.contains(function) && said.contains("; the rows end at 1 s"), "{habit}: {said}");
        assert_eq!(times(folder.path()).len(), 11, "{habit}");
    }
}

/// File names of other tools: with blanks, dots and dashes.
#[test]
fn fmus_have_any_file_name() {
    let folder = TempDir::new().unwrap();
    let fmu = Zoo::new("none").pack(folder.path());
    std::fs::rename(fmu, folder.path().join("My Zoo-1.2.fmu")).unwrap();
    std::fs::write(folder.path().join("ends.toml"), SCENARIO.replace("\"Zoo\"", "\"My Zoo-1.2\"")).unwrap();
    for arguments in [&["plan", "ends.toml", "--fmus", "."][..], &["run", "ends.toml", "--fmus", ".", "--no-fail"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_chassis"));
        let output = command
            .args(arguments)
            .current_dir(folder.path())
            .env("NO_COLOR", "1")
            .env("CHASSIS_PYTHON", "")
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", unwrapped(&output.stderr));
    }
    assert_eq!(times(folder.path()).len(), 11);
}

/// Reference: FMI 2.0, section 4.2.2 (fmi2Discard with fmi2Terminated and fmi2LastSuccessfulTime), FMI 3.0,
/// `terminateSimulation`.
#[test]
fn an_fmu_ends_the_simulation() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        for order in ["sequential", "jacobi"] {
            for (habit, last) in [("end", 0.5), ("end_before", 0.4)] {
                let junit = ["--order", order, "--junit", "ends.xml"];
                let (folder, output) = run(fmi, habit, SCENARIO, &junit);
                let said = String::from_utf8(output.stderr).unwrap();
                assert_eq!(output.status.code(), Some(0), "{said}");
                let note = format!("note: run a, at {last} s: `p`: the FMU ended the simulation in");
                assert!(said.contains(&note), "{said}");
                assert!(said.contains(&format!("; the rows end at {last} s")), "{said}");
                let rows = times(folder.path());
                assert_eq!((rows.len(), rows.last()), (if habit == "end" { 6 } else { 5 }, Some(&last)));
                let found = status(folder.path());
                assert_eq!(found["status"], "terminated");
                assert_eq!(
                    (&found["file"], &found["end"], &found["at"]),
                    (&json!("a.csv"), &json!(last), &json!(last))
                );
                assert_eq!(found["component"], "p");
                // Requirements are not evaluated for missing rows.
                let said = String::from_utf8(output.stdout).unwrap();
                assert!(said.contains("Not evaluated  Share above 3") && said.contains("0 of 1 runs"), "{said}");
                let suite = std::fs::read_to_string(folder.path().join("ends.xml")).unwrap();
                assert!(suite.contains("errors=\"0\" skipped=\"1\""), "{suite}");
            }
        }
    }
}

/// If the FMU ends the simulation at the stop time, the run is complete.
#[test]
fn an_end_at_the_stop_time_is_a_whole_run() {
    let scenario = SCENARIO.replace("stop = 1.0", "stop = 0.5");
    let (folder, output) = run(FmiVersion::V2, "end", &scenario, &[]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!((times(folder.path()).len(), &status(folder.path())["status"]), (6, &json!("completed")));
    assert!(String::from_utf8(output.stdout).unwrap().contains("Passed  Share above 3"));
}

#[test]
fn a_run_that_fails_keeps_its_rows() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        for (habit, kind, place, text) in [
            ("error", "failed", "run a, step from 0.4 s: `p`: ", "Error"),
            ("discard", "discarded", "run a, step from 0.4 s: `p`: ", "Discard"),
            ("nan", "failed", "run a, at 0.5 s: `p`: `y` is NaN", "; the rows end at 0.4 s"),
        ] {
            let (folder, output) = run(fmi, habit, SCENARIO, &["--junit", "ends.xml"]);
            let said = unwrapped(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{habit}: {said}");
            assert!(said.contains(place) && said.contains(text) && said.contains("; the rows end at 0.4 s"), "{said}");
            assert_eq!(times(folder.path()).len(), 5, "{habit}");
            let found = status(folder.path());
            assert_eq!((&found["status"], &found["end"]), (&json!(kind), &json!(0.4)), "{habit}");
            let said = String::from_utf8(output.stdout).unwrap();
            assert!(said.contains("Not evaluated  Share above 3"), "{habit}: {said}");
            let suite = std::fs::read_to_string(folder.path().join("ends.xml")).unwrap();
            assert!(suite.contains("errors=\"1\" skipped=\"1\""), "{suite}");
        }
    }
}

/// After a crash, the run is repeated up to the time of the crash. With the second habit, the FMU rejects the
/// termination of the repeated run, which ends before the stop time.
#[test]
fn a_run_that_crashes_keeps_its_rows() {
    for habit in ["crash", "crash_strict"] {
        let (folder, output) = run(FmiVersion::V2, habit, SCENARIO, &[]);
        let said = unwrapped(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{habit}: {said}");
        assert!(said.contains("SIGSEGV") && said.contains("; the rows end at 0.4 s"), "{habit}: {said}");
        assert_eq!(times(folder.path()).len(), 5, "{habit}");
        let runs = std::fs::read_dir(folder.path().join("results/ends/runs")).unwrap();
        let hidden = runs.filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
        assert_eq!(hidden.count(), 0, "{habit}");
    }
}

/// A value that is not finite fails the run even if the signal is not recorded.
#[test]
fn a_wire_that_is_not_finite_fails_the_run() {
    let other = "[[component]]\nname = \"q\"\nfmu = \"Zoo\"\nparameters = { habit = \"none\" }\n\
        inputs = { ui = 0, ub = false, ue = \"eco\" }\n[[connection]]\nfrom = \"p:y\"\nto = \"q:u\"\n[record]";
    let scenario = SCENARIO
        .replace("[record]", other)
        .replace("\"p:y\"]", "\"q:yi\"]")
        .replace("signal = \"p:y\"", "signal = \"q:yi\"");
    let (folder, output) = run(FmiVersion::V2, "nan", &scenario, &[]);
    let said = unwrapped(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("run a, at 0.5 s: `p`: `y` is NaN"), "{said}");
    assert_eq!(times(folder.path()).len(), 5);
}

/// 199 * 0.1 + 0.1 is 20.000000000000004 in double arithmetic, beyond the FMU's stop time.
#[test]
fn no_step_goes_beyond_the_stop_time() {
    let scenario = SCENARIO.replace("stop = 1.0", "stop = 20.0");
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let (folder, output) = run(fmi, "strict", &scenario, &[]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8(output.stderr).unwrap());
        let rows = times(folder.path());
        assert_eq!((rows.len(), rows.last()), (201, Some(&20.0)));
    }
}

#[test]
fn the_folder_is_tried_before_the_runs() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("taken"), "").unwrap();
    let (_, output) = run(FmiVersion::V2, "none", SCENARIO, &["--out", folder.path().join("taken").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    let said = unwrapped(&output.stderr);
    assert!(said.contains("nothing was simulated"), "{said}");
}
