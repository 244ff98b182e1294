//! FMUs that reach beyond their process: what they start ends with their worker, the sandbox denies what could harm others, and
//! what they change of their process is found.
#![cfg(target_os = "linux")]

#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;
use zoo::Zoo;

const SCENARIO: &str = r#"
title = "Zoo"
[simulation]
stop = 1.0
step = 0.1
[[component]]
name = "zoo"
fmu = "Zoo"
inputs = { u = 2.0, ui = 1, ub = true, ue = "eco", us = "text" }
[[case]]
name = "one"
title = "One"
[record]
signals = ["y"]
"#;

/// A folder with the FMU, the scenario and a folder for temporary files.
fn folder(zoo: &Zoo<'_>) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::create_dir(folder.path().join("temporary")).unwrap();
    std::fs::write(folder.path().join("zoo.toml"), SCENARIO).unwrap();
    zoo.pack(folder.path());
    folder
}

fn command(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    command.args(arguments).current_dir(folder).env("NO_COLOR", "1").env("TMPDIR", folder.join("temporary"));
    command.output().unwrap()
}

fn check(folder: &Path, options: &[&str]) -> String {
    let output = command(folder, &[&["check", "Zoo.fmu"], options].concat());
    [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat()
}

fn run(folder: &Path, options: &[&str]) -> (bool, String) {
    let output = command(folder, &[&["run", "zoo.toml", "--fmus", ".", "--no-warnings"], options].concat());
    (output.status.success(), String::from_utf8(output.stderr).unwrap())
}

/// The processes, other than zombies, whose command line or environment has a path of the folder.
fn survivors(folder: &Path) -> Vec<String> {
    let folder = folder.to_str().unwrap();
    let entries = std::fs::read_dir("/proc").unwrap().filter_map(Result::ok);
    let ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    ids.filter_map(|id| {
        let read = |file: &str| std::fs::read(format!("/proc/{id}/{file}")).unwrap_or_default();
        let text = String::from_utf8_lossy(&[read("cmdline"), read("environ")].concat()).into_owned();
        text.contains(folder).then(|| text.replace('\0', " "))
    })
    .collect()
}

#[test]
fn nothing_that_an_fmu_started_outlives_the_command() {
    // A copy that continues ends by itself, or is ended.
    let left = ["fork", "daemon", "chain", "guards", "headless"].map(|habit| (habit, true));
    for (habit, is_left) in left.into_iter().chain([("copy", false)]) {
        let folder = folder(&Zoo { at: 0.5, ..Zoo::new(habit) });
        let report = check(folder.path(), &[]);
        assert_eq!(survivors(folder.path()), [""; 0], "{habit}");
        assert!(report.contains("warning: processes: ") || !is_left, "{habit}: {report}");
        assert!(!report.contains("error:"), "{habit}: {report}");
        let (is_success, said) = run(folder.path(), &[]);
        assert_eq!(survivors(folder.path()), [""; 0], "{habit}");
        assert!(is_success, "{habit}: {said}");
        assert!(said.contains("that an FMU had started") || !is_left, "{habit}: {said}");
        // None of these starts a program: what is left is this one. Where the first thread has ended, the system does not tell.
        assert!(said.contains("(a copy of cargo-fmu") || habit == "headless" || !is_left, "{habit}: {said}");
    }
}

/// The supervisor ends them also when a step takes too long, and when the FMU crashes.
#[test]
fn nothing_outlives_a_worker_that_hangs_or_crashes() {
    for habit in ["daemon_hang", "daemon_crash"] {
        let folder = folder(&Zoo { at: 0.5, ..Zoo::new(habit) });
        let (is_success, said) = run(folder.path(), &["--timeout", "0.5"]);
        assert!(!is_success, "{habit}: {said}");
        assert!(said.contains("that an FMU had started"), "{habit}: {said}");
        assert_eq!(survivors(folder.path()), [""; 0], "{habit}: {said}");
    }
}

#[test]
fn the_sandbox_denies_what_could_harm_others_and_reports_it() {
    let outside = TempDir::new().unwrap();
    let file = outside.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let file = file.canonicalize().unwrap();
    let path = file.to_str().unwrap();
    for (habit, denied) in [
        ("write", format!("the sandbox denied changing the file {path} (openat)")),
        ("attributes", format!("the sandbox denied changing the file {path} (chmod)")),
        ("program", format!("the sandbox denied starting the program {path} (execve)")),
        ("network", "the sandbox denied a connection to other programs or machines (socket AF_INET)".to_owned()),
        ("signal", "the sandbox denied sending the signal 18 to the process ".to_owned()),
        ("shared", "the sandbox denied the system call shmat".to_owned()),
        ("schedule", "the sandbox denied the scheduling of other processes (setpriority)".to_owned()),
    ] {
        std::fs::write(&file, "mine").unwrap();
        let mode = std::fs::metadata(&file).unwrap().permissions();
        let folder = folder(&Zoo { file: path, ..Zoo::new(habit) });
        let report = check(folder.path(), &[]);
        assert!(report.contains(&format!("warning: sandbox: {denied}")), "{habit}: {report}");
        assert!(report.contains("during fmi2DoStep (--no-sandbox allows it)"), "{habit}: {report}");
        assert!(!report.contains("error:"), "{habit}: {report}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine", "{habit}");

        let (is_success, said) = run(folder.path(), &["--sandbox"]);
        assert!(is_success, "{habit}: {said}");
        assert!(said.contains(&format!("note: `zoo` (./Zoo.fmu): {denied}")), "{habit}: {said}");
        assert!(folder.path().join("results/zoo/runs/one.csv").exists(), "{habit}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine", "{habit}");
        assert_eq!(std::fs::metadata(&file).unwrap().permissions(), mode, "{habit}");

        // Without a sandbox the same FMU does what was denied.
        let report = check(folder.path(), &["--no-sandbox"]);
        assert!(!report.contains("the sandbox denied"), "{habit}: {report}");
        let is_written = std::fs::read_to_string(&file).unwrap() == "written by an FMU";
        assert_eq!(is_written, habit == "write", "{habit}");
        assert_eq!(std::fs::metadata(&file).unwrap().permissions() != mode, habit == "attributes", "{habit}");
    }
}

/// Another thread could make the path lead elsewhere, so the sandbox denies this in the FMU's own folder, too.
#[test]
fn a_denied_mode_of_a_temporary_file_is_reported() {
    let folder = folder(&Zoo::new("unpack"));
    let report = check(folder.path(), &[]);
    for call in ["fchmod", "chmod"] {
        let expected = format!("/temporary/zoo ({call}), during fmi2DoStep (--no-sandbox allows it)");
        assert!(report.contains(&expected), "{report}");
    }
    let report = check(folder.path(), &["--no-sandbox"]);
    assert!(report.contains("Zoo.fmu: no error, no warning"), "{report}");
}

#[test]
fn the_sandbox_does_not_touch_what_an_fmu_may_do() {
    for habit in ["none", "private"] {
        let folder = folder(&Zoo::new(habit));
        let report = check(folder.path(), &[]);
        assert!(report.contains("Zoo.fmu: no error, no warning"), "{habit}: {report}");
        let (is_success, said) = run(folder.path(), &["--sandbox"]);
        assert!(is_success && !said.contains("note:"), "{habit}: {said}");
        let csv = || std::fs::read(folder.path().join("results/zoo/runs/one.csv")).unwrap();
        let expected = csv();
        assert!(run(folder.path(), &["--no-sandbox"]).0);
        assert_eq!(csv(), expected, "{habit}");
    }
}

#[test]
fn a_file_in_the_working_directory_is_kept_there_and_reported() {
    let folder = folder(&Zoo { file: "dslog.txt", ..Zoo::new("write") });
    for options in [&[][..], &["--no-sandbox"]] {
        let report = check(folder.path(), options);
        let expected = "warning: files: writes to the working directory of its master: dslog.txt";
        assert!(report.contains(expected), "{options:?}: {report}");
        assert!(!report.contains("denied") && !folder.path().join("dslog.txt").exists(), "{options:?}: {report}");
    }
}

#[test]
fn a_removed_working_directory_is_a_finding() {
    let folder = folder(&Zoo::new("remove"));
    let report = check(folder.path(), &["--no-sandbox"]);
    assert!(report.contains("warning: files: removes the working directory of its master"), "{report}");
    let report = check(folder.path(), &[]);
    assert!(report.contains("Zoo.fmu: no error, no warning"), "the sandbox keeps it: {report}");
}

#[test]
fn changes_of_the_process_are_found() {
    for (habit, change) in [
        ("round", "fmi2DoStep changes the rounding mode of its process"),
        ("traps", "fmi2DoStep changes the traps of floating-point operations of its process"),
        ("locale", "changes the locale of its process from `C` to `C.UTF-8`"),
        ("umask", "changes the umask of its process from "),
        ("folder", "changes the working directory of its process to /"),
        ("environment", "changes environment variables of its process: ZOO"),
    ] {
        let folder = folder(&Zoo::new(habit));
        let report = check(folder.path(), &[]);
        assert!(report.contains(&format!("warning: runs: {change}")), "{habit}: {report}");
    }
}

/// The times are k h, rounded to the nearest number, even if an FMU changes the rounding mode.
#[test]
fn an_fmu_does_not_change_the_numbers_of_the_master() {
    let results = |habit| {
        let folder = folder(&Zoo::new(habit));
        let (is_success, said) = run(folder.path(), &[]);
        assert!(is_success, "{said}");
        (std::fs::read_to_string(folder.path().join("results/zoo/runs/one.csv")).unwrap(), said)
    };
    let (expected, _) = results("none");
    let (found, said) = results("round");
    assert_eq!(found, expected);
    assert!(said.contains("fmi2DoStep changes the rounding mode of its process; it is restored"), "{said}");
}

#[test]
fn an_fmu_without_end_of_memory_costs_its_run_only() {
    let folder = folder(&Zoo { at: 0.5, ..Zoo::new("memory") });
    let (is_success, said) = run(folder.path(), &["--memory", "200M"]);
    assert!(!is_success && said.contains("SIGABRT"), "{said}");
    assert!(said.contains("--memory sets another limit"), "{said}");
}
