//! FMUs that crash, exit, hang, or print anything: only their own run fails, the report contains the cause and the
//! call, and nothing is left behind.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

mod patience;
mod programs;

use patience::patience;
use programs::program;
use std::path::Path;
use std::process::{Command, Output};
use support::Build;
use tempfile::TempDir;

const SCENARIO: &str = include_str!("data/ramp.toml");

/// Statements that keep an FMU's step from returning, and the messages about them.
const ENDS: [(&str, &str); 5] = [
    ("exit(0)", "the process ended (exit code 0) during fmi2DoStep"),
    ("_exit(3)", "the process ended (exit code 3) during fmi2DoStep"),
    ("abort()", "the process ended (signal 6, SIGABRT) during fmi2DoStep"),
    ("*(volatile int *)8 = 1", "the process ended (signal 11, SIGSEGV) during fmi2DoStep"),
    ("for (;;) sleep(1)", "not done after 0.5 s (--timeout), stopped during fmi2DoStep"),
];

/// Statements that print. The last one prints a response in the worker protocol.
const PRINTS: [&str; 4] = [
    r#"write(1, "\xff\xfe\n", 3)"#,
    r#"for (int k = 0; k < 5000; k++) printf("no end of the line ")"#,
    r#"puts("{\"found\":{\"severity\":\"error\",\"subject\":\"fake\",\"message\":\"fake\"}}\n\"Done\"\n{\"Done\":null}"), fflush(stdout)"#,
    r#"write(1, "\6\0\0\0\0\0\0\0\0\0\0\0\"Done\"", 18), write(0, "x", 1), write(3, "x", 0)"#,
];

/// A folder with the scenario, the FMU, and a folder for temporary files.
fn folder(build: &Build) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("ramp.toml"), SCENARIO).unwrap();
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    std::fs::create_dir(folder.path().join("temporary")).unwrap();
    build.pack(&fmus);
    folder
}

fn ramp<'a>(step: &'a str) -> Build<'a> {
    Build { step, ..Build::new("Ramp", "u", "x") }
}

fn prepared(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(program(arguments[0]));
    command
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env("CHASSIS_PYTHON", "")
        .env("TMPDIR", folder.join("temporary"));
    command
}

/// Calls the command and checks that it leaves no temporary file.
fn command(folder: &Path, arguments: &[&str]) -> Output {
    let output = prepared(folder, arguments).output().unwrap();
    assert_eq!(temporary(folder), [""; 0], "{arguments:?}");
    output
}

fn temporary(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder.join("temporary")).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A message without the line breaks that a narrow terminal needs.
fn message(bytes: &[u8]) -> String {
    text(bytes).split([' ', '\n', '│']).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

fn csv(folder: &Path, name: &str) -> std::io::Result<String> {
    std::fs::read_to_string(folder.join("results/ramp/runs").join(name))
}

#[test]
fn an_end_of_the_process_is_a_finding_of_the_check() {
    for (step, expected) in ENDS {
        let folder = folder(&ramp(step));
        let output = command(folder.path(), &["check", "target/fmu/Ramp.fmu", "--timeout", "0.5"]);
        assert_eq!(output.status.code(), Some(1), "{step}");
        let findings = text(&output.stdout);
        assert!(findings.contains(&format!("  error: runs: {expected}\n")), "{step}: {findings}");
        // Earlier findings are not lost.
        assert!(findings.contains("error: variable `x`: is not listed"), "{step}: {findings}");
    }
}

#[test]
fn prints_of_an_fmu_change_no_finding() {
    let findings = |step| {
        let folder = folder(&ramp(step));
        let output = command(folder.path(), &["check", "target/fmu/Ramp.fmu"]);
        (text(&output.stdout), text(&output.stderr))
    };
    let (expected, silent) = findings("");
    assert!(!silent.contains("FMU prints"), "{silent}");
    for step in PRINTS {
        let (found, printed) = findings(step);
        assert_eq!(found, expected, "{step}");
        let lines: Vec<_> = printed.lines().filter(|line| line.starts_with("FMU prints: ")).collect();
        assert!(!lines.is_empty() && lines.len() <= 1001, "{step}: {} lines", lines.len());
        assert!(lines.iter().all(|line| line.len() < 7000 && !line.contains(char::is_control)), "{step}");
    }
}

/// The FMU is a source. The only output that is read does not depend on the parameter `start`.
#[test]
fn trials_of_a_plan_survive_the_fmu() {
    let source = |step| {
        let edits = &[("causality=\"input\"", "causality=\"local\"")];
        let folder = folder(&Build { edits, ..ramp(step) });
        let scenario = SCENARIO
            .replace("inputs = { u = 2.0 }", "parameters = { start = 1.0 }")
            .replace("signals = [\"x\"]", "signals = [\"count\"]");
        std::fs::write(folder.path().join("ramp.toml"), scenario).unwrap();
        let output = command(folder.path(), &["plan", "ramp.toml"]);
        assert!(output.status.success(), "{step}: {}", text(&output.stderr));
        message(&output.stderr)
    };
    assert!(source("").contains("`start` of `ramp` has no effect: it changes `x`"), "{}", source(""));
    for step in ["exit(0)", "abort()"] {
        assert_eq!(source(step), "", "{step}");
    }
    let printed = source(PRINTS[2]);
    assert!(printed.contains("has no effect") && !printed.contains("fake"), "{printed}");
}

#[test]
fn an_fmu_that_ends_the_process_is_neither_linearized_nor_trimmed() {
    for (statement, expected) in [
        ("_exit(3)", "the process ended (exit code 3)"),
        ("abort()", "the process ended (signal 6, SIGABRT)"),
        ("for (;;) sleep(1)", "not done after 0.5 s (--timeout), stopped"),
    ] {
        let declarations = format!("__attribute__((constructor)) static void loaded(void) {{ {statement}; }}");
        let folder = folder(&Build { declarations: &declarations, ..ramp("") });
        for name in ["linearize", "trim"] {
            let output = command(folder.path(), &[name, "target/fmu/Ramp.fmu", "--timeout", "0.5"]);
            assert_eq!(output.status.code(), Some(1), "{name}, {statement}");
            let error = message(&output.stderr);
            assert!(error.contains(&format!("target/fmu/Ramp.fmu: {expected}")), "{name}, {statement}: {error}");
        }
    }
}

/// The gain is 1 in the case `steep` and 0.5 in the case `flat`.
#[test]
fn an_fmu_costs_its_run_only() {
    for (end, expected) in ENDS {
        let step = format!("if (t >= 0.5 && i->v.real[2] == 1) {{ {end}; }}");
        let folder = folder(&ramp(&step));
        let output = command(folder.path(), &["run", "ramp.toml", "--jobs", "1", "--timeout", "0.5"]);
        assert_eq!(output.status.code(), Some(1), "{end}");
        let said = message(&output.stderr);
        assert!(said.contains("1 of 2 runs failed"), "{end}: {said}");
        let place = "run steep, step from 0.5 s: `ramp` (target/fmu/Ramp.fmu): ";
        assert!(said.contains(&format!("{place}{expected}")), "{end}: {said}");
        assert_eq!(csv(folder.path(), "flat.csv").unwrap().lines().last(), Some("1.0,1.0"), "{end}");
        let runs = std::fs::read_dir(folder.path().join("results/ramp/runs")).unwrap();
        let mut runs: Vec<_> = runs.map(|entry| entry.unwrap().file_name()).collect();
        runs.sort();
        assert_eq!(runs, ["flat.csv", "status.json", "steep.csv"], "{end}");
        assert_eq!(csv(folder.path(), "steep.csv").unwrap(), "time,x\n0.0,0.0\n0.25,0.5\n0.5,1.0\n", "{end}");
    }
}

/// Messages report what the FMU was doing even outside of a step, for example while its library is loaded.
#[test]
fn the_call_is_named() {
    let declarations = "__attribute__((destructor)) static void at_the_end(void) { _exit(0); }";
    for (declarations, expected) in [
        (
            "__attribute__((constructor)) static void at_the_start(void) { abort(); }",
            "the process ended (signal 6, SIGABRT) while its library was loaded",
        ),
        (
            "__attribute__((constructor)) static void at_the_start(void) { for (;;) sleep(1); }",
            "not done after 0.5 s (--timeout), stopped while its library was loaded",
        ),
    ] {
        let folder = folder(&Build { declarations, ..ramp("") });
        let output = command(folder.path(), &["run", "ramp.toml", "--timeout", "0.5"]);
        let said = message(&output.stderr);
        assert!(said.contains(&format!("run steep, flat: `ramp` (target/fmu/Ramp.fmu): {expected}")), "{said}");
        assert!(said.contains("2 of 2 runs failed"), "{said}");
    }
    // A failure while a library is unloaded does not matter: the results are complete.
    let folder = folder(&Build { declarations, ..ramp("") });
    assert!(command(folder.path(), &["run", "ramp.toml"]).status.success());
    assert!(csv(folder.path(), "steep.csv").is_ok());
}

#[test]
fn prints_and_another_folder_change_no_result() {
    let folder = folder(&ramp(""));
    assert!(command(folder.path(), &["run", "ramp.toml"]).status.success());
    let expected = csv(folder.path(), "steep.csv").unwrap();
    for step in PRINTS.into_iter().chain([r#"if (chdir("/")) return 3"#]) {
        ramp(step).pack(&folder.path().join("target/fmu"));
        let output = command(folder.path(), &["run", "ramp.toml"]);
        assert!(output.status.success(), "{step}: {}", text(&output.stderr));
        assert_eq!(csv(folder.path(), "steep.csv").unwrap(), expected, "{step}");
        assert!(text(&output.stderr).contains("FMU prints: ") || step.contains("chdir"), "{step}");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_processes() {
    let flags = "canBeInstantiatedOnlyOncePerProcess=\"true\"";
    let folder = folder(&Build { flags, ..ramp("") });
    let seeds: String = (1..=20)
        .map(|k| {
            format!(
                "[[case]]\nname = \"c{k}\"\ntitle = \"C\"\nparameters.ramp = {{ gain = {:?} }}\n",
                1.0 / f64::from(k)
            )
        })
        .collect();
    std::fs::write(folder.path().join("ramp.toml"), format!("{SCENARIO}{seeds}")).unwrap();
    let results = |jobs: &str| -> Vec<String> {
        let output = command(folder.path(), &["run", "ramp.toml", "--jobs", jobs]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        (1..=20).map(|k| csv(folder.path(), &format!("c{k}.csv")).unwrap()).collect()
    };
    let one = results("1");
    // A gain without an exact decimal representation reaches the FMU unchanged.
    let end: f64 = one[2].lines().last().unwrap().split_once(',').unwrap().1.parse().unwrap();
    assert_eq!(end, (0..4).fold(0.0, |x, _| x + 0.25 * (1.0 / 3.0 * 2.0)));
    for jobs in ["2", "5", "40"] {
        assert_eq!(results(jobs), one, "{jobs}");
    }
}

const STUDY: &str = r#"title = "Ramp"
scenario = "ramp.toml"
method = "optimize"
cases = ["steep"]
[budget]
evaluations = 40
[[parameter]]
name = "ramp:gain"
min = -1.0
max = 9.0
[[objective.term]]
signal = "x"
kind = "rms"
weight = 1.0
[[search]]
kind = "ga"
settings = { population = 10 }
"#;

#[test]
fn a_study_goes_on_when_an_fmu_ends_its_process() {
    for (end, expected) in [ENDS[0], ENDS[3], ENDS[4]] {
        let step = format!("if (i->v.real[2] > 5) {{ {end}; }}");
        let folder = folder(&ramp(&step));
        std::fs::write(folder.path().join("study.toml"), STUDY).unwrap();
        let history = |jobs: &str| {
            let arguments = ["study", "study.toml", "--overwrite", "--jobs", jobs, "--timeout", "0.5"];
            let output = command(folder.path(), &arguments);
            assert!(output.status.success(), "{end}: {}", text(&output.stderr));
            std::fs::read_to_string(folder.path().join("results/study/ga/history.csv")).unwrap()
        };
        let one = history("1");
        let place = "run steep, step from 0 s: `ramp` (target/fmu/Ramp.fmu): ";
        let (failed, fine): (Vec<_>, Vec<_>) = one.lines().skip(1).partition(|line| line.contains("false"));
        assert!(failed.iter().all(|line| line.contains(&format!("{place}{expected}"))), "{end}: {one}");
        assert!(!failed.is_empty() && fine.len() > failed.len(), "{end}: {one}");
        assert_eq!(history("3"), one, "{end}");
    }
    let folder = folder(&Build { declarations: "__attribute__((constructor)) void f(void) { exit(0); }", ..ramp("") });
    std::fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    let output = command(folder.path(), &["study", "study.toml"]);
    assert_eq!(output.status.code(), Some(1), "a study whose FMUs cannot be loaded does not begin");
    let expected = "target/fmu/Ramp.fmu: the process ended (exit code 0) while its library was loaded";
    assert!(message(&output.stderr).contains(expected), "{}", text(&output.stderr));
}

#[cfg(target_os = "linux")]
/// Waits until another process has done something.
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let begin = std::time::Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < patience(60.0), "{what} never comes");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[cfg(target_os = "linux")]
/// Starts a command whose FMU never returns. `signals` contains options of `env` about signals. Also returns the ID of
/// the process that executes the FMU.
fn hanging(folder: &Path, arguments: &[&str], signals: &[&str]) -> (std::process::Child, String) {
    let file = folder.join("number");
    let step = format!(
        "{{ FILE *f = fopen(\"{0}.part\", \"w\"); fprintf(f, \"%d\", getpid()); fclose(f); rename(\"{0}.part\", \"{0}\"); }} \
         for (;;) sleep(1)",
        file.display()
    );
    ramp(&step).pack(&folder.join("target/fmu"));
    let command = prepared(folder, arguments);
    let environment: Vec<_> = command.get_envs().filter_map(|(name, value)| Some((name, value?))).collect();
    // The test process may ignore signals, as under `nohup` or in a background job of a shell.
    let child = Command::new("env")
        .args(signals)
        .arg(command.get_program())
        .args(command.get_args())
        .envs(environment)
        .current_dir(folder)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    wait_until("the step", || file.exists());
    let number = std::fs::read_to_string(&file).unwrap();
    std::fs::remove_file(file).unwrap();
    (child, number)
}

#[cfg(target_os = "linux")]
/// Returns true if a process exists and is not a zombie.
fn is_alive(number: &str) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{number}/stat")).unwrap_or_default();
    // The state follows the name, which is in parentheses.
    status.rsplit_once(") ").is_some_and(|(_, state)| !state.starts_with('Z'))
}

#[cfg(target_os = "linux")]
#[test]
fn an_end_by_signal_leaves_no_process_and_no_file() {
    let folder = folder(&ramp(""));
    let folder = folder.path();
    std::fs::write(folder.join("study.toml"), STUDY).unwrap();
    for arguments in [
        &["run", "ramp.toml", "--jobs", "1"][..],
        &["check", "target/fmu/Ramp.fmu", "--no-sandbox"],
        &["study", "study.toml", "--jobs", "1"],
    ] {
        for signal in ["TERM", "INT", "HUP"] {
            let (mut child, number) = hanging(folder, arguments, &["--default-signal=HUP,INT"]);
            assert!(is_alive(&number) && !temporary(folder).is_empty(), "{arguments:?}");
            let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
            assert!(sent.success());
            let status = child.wait().unwrap();
            assert_eq!(status.code(), None, "ends by the signal {signal}");
            assert_eq!(temporary(folder), [""; 0], "{arguments:?} {signal}");
            wait_until("the end of the worker", || !is_alive(&number));
        }
        let (mut child, number) = hanging(folder, arguments, &[]);
        child.kill().unwrap();
        child.wait().unwrap();
        wait_until("the end of the worker", || !is_alive(&number));
        assert!(!temporary(folder).is_empty(), "nobody was left to remove them");
        ramp("").pack(&folder.join("target/fmu"));
        assert!(command(folder, &["run", "ramp.toml"]).status.success(), "and the next one removes them");
    }
}

/// As under `nohup`: the end of the terminal does not end the command.
#[cfg(target_os = "linux")]
#[test]
fn an_ignored_hangup_stays_ignored() {
    let folder = folder(&ramp(""));
    let (mut child, number) = hanging(folder.path(), &["run", "ramp.toml", "--jobs", "1"], &["--ignore-signal=HUP"]);
    // The system discards an ignored signal at once. The first signal therefore has no effect; the second one ends the
    // command.
    for signal in ["HUP", "TERM"] {
        let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }
    let status = child.wait().unwrap();
    assert_eq!(std::os::unix::process::ExitStatusExt::signal(&status), Some(15), "SIGTERM ends it, SIGHUP does not");
    wait_until("the end of the worker", || !is_alive(&number));
}

#[test]
fn an_fmu_in_python_says_what_it_needs() {
    // A function and an object from Python's C interface, which are undefined without Python.
    for (declarations, step) in [
        ("int Py_IsInitialized(void);", "if (Py_IsInitialized() != 7) return 3"),
        ("extern int _Py_NoneStruct;", "if (_Py_NoneStruct != 7) return 3"),
    ] {
        let folder = TempDir::new().unwrap();
        let path = folder.path();
        std::fs::write(path.join("ramp.toml"), SCENARIO).unwrap();
        std::fs::create_dir_all(path.join("target/fmu")).unwrap();
        std::fs::create_dir(path.join("temporary")).unwrap();
        let step_with_declaration = format!("{declarations} {step}");
        ramp(&step_with_declaration).pack(&path.join("target/fmu"));
        std::fs::write(path.join("python.c"), "int _Py_NoneStruct = 7; int Py_IsInitialized(void) { return 7; }")
            .unwrap();
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-o", "libpython.so", "python.c"]).current_dir(path);
        assert!(cc.status().unwrap().success());

        for command_line in [&["run", "ramp.toml"][..], &["check", "target/fmu/Ramp.fmu"]] {
            let output = command(path, command_line);
            assert_eq!(output.status.code(), Some(1), "{step}");
            let said = message(&[output.stdout, output.stderr].concat());
            for expected in [
                "needs the Python library",
                "--libpython FILE",
                "the command `chassis` of the Python package, which finds it",
            ] {
                assert_eq!(said.matches(expected).count(), 1, "{step}: {said}");
            }
            let output = command(path, &[command_line, &["--libpython", "libpython.so"]].concat());
            let said = message(&[output.stdout, output.stderr].concat());
            assert!(!said.contains("needs the Python library"), "{step}: {said}");
            assert!(command_line[0] == "check" || csv(path, "steep.csv").unwrap().ends_with("1.0,2.0\n"), "{said}");
        }
        let output = command(path, &["run", "ramp.toml", "--libpython", "none.so"]);
        assert!(message(&output.stderr).contains("none.so does not exist"));
    }
}
