//! The command as a user calls it: output, messages, exit codes.

use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

#[cfg(unix)]
#[path = "../../host/tests/support/mod.rs"]
#[allow(dead_code)]
mod support;

const SCENARIO: &str = r#"title = "Ramp"
[simulation]
stop = 1.0
step = 0.25
[[unit]]
name = "ramp"
fmu = "Ramp"
inputs = { u = 2.0 }
[[case]]
name = "steep"
title = "Steep"
[[case]]
name = "flat"
title = "Flat"
parameters.ramp = { gain = 0.5 }
[record]
signals = ["x"]
"#;

fn command(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cargo-fmu"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn folder(scenario: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("ramp.toml"), scenario).unwrap();
    folder
}

#[test]
fn wrong_usage_ends_with_2() {
    let folder = folder(SCENARIO);
    for arguments in [
        &["fly"][..],
        &["run"],
        &["run", "ramp.toml", "--seeds", "0"],
        &["run", "ramp.toml", "--jobs", "0"],
        &["plan", "ramp.toml", "--order", "random"],
    ] {
        assert_eq!(command(folder.path(), arguments).status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn mistakes_end_with_1_and_mark_the_place() {
    let folder = folder(&SCENARIO.replace("stop", "stopp"));
    let output = command(folder.path(), &["fmu", "plan", "ramp.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
    let error = text(&output.stderr);
    assert!(error.contains("ramp.toml:3:1"), "{error}");
    assert!(error.contains("unknown field `stopp`"), "{error}");

    let output = command(folder.path(), &["run", "missing.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("missing.toml"));
}

#[test]
fn a_missing_fmu_says_what_to_do() {
    let folder = folder(SCENARIO);
    let output = command(folder.path(), &["run", "ramp.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let error = text(&output.stderr);
    assert!(error.contains("there is no Ramp.fmu in target/fmu"), "{error}");
    assert!(error.contains("cargo fmu pack Ramp"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_scenario_is_planned_and_run() {
    let folder = folder(SCENARIO);
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    support::Build::new("Ramp", "u", "x").pack(&fmus);

    let output = command(folder.path(), &["plan", "ramp.toml", "--stop", "0.5"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let plan = text(&output.stdout);
    assert!(plan.starts_with(r#"{"format":1,"name":"ramp","file":"ramp.toml","title":"Ramp""#), "{plan}");
    assert!(plan.contains(r#""stop":0.5,"step":0.25,"steps":2,"order":"sequential""#), "{plan}");
    assert!(plan.contains(r#""fmu":"target/fmu/Ramp.fmu""#), "{plan}");

    let output = command(folder.path(), &["run", "ramp.toml", "--jobs", "2"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary = text(&output.stdout);
    assert!(summary.contains("2 of 2 runs over 1 s"), "{summary}");
    let result = |name: &str| std::fs::read_to_string(folder.path().join("results/ramp/runs").join(name));
    assert_eq!(result("steep.csv").unwrap(), "time,x\n0.0,0.0\n0.25,0.5\n0.5,1.0\n0.75,1.5\n1.0,2.0\n");
    assert_eq!(result("flat.csv").unwrap().lines().last(), Some("1.0,1.0"));

    // A run that fails leaves no file, not even that of an earlier call.
    let failing = SCENARIO.replace("gain = 0.5", "failure = 1");
    std::fs::write(folder.path().join("ramp.toml"), failing).unwrap();
    let output = command(folder.path(), &["run", "ramp.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let error = text(&output.stderr);
    assert!(error.contains("1 of 2 runs failed"), "{error}");
    assert!(error.contains("x left 90% of its range"), "{error}");
    assert!(result("steep.csv").is_ok());
    assert!(result("flat.csv").is_err());
}
