//! FMUs that affect more than their own instance: processes that they start end with their worker, the sandbox denies
//! what could harm others, and the check finds what they change in their process.
#![cfg(target_os = "linux")]

#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

mod programs;

use programs::program;
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
    let mut command = Command::new(program(arguments[0]));
    command
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env("CHASSIS_PYTHON", "")
        .env("TMPDIR", folder.join("temporary"));
    command.output().unwrap()
}

fn check(folder: &Path, options: &[&str]) -> String {
    let output = command(folder, &[&["check", "Zoo.fmu"], options].concat());
    [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat()
}

fn run(folder: &Path, options: &[&str]) -> (bool, String) {
    let output =
        command(folder, &[&["run", "zoo.toml", "--fmus", ".", "--no-warnings", "--no-page"], options].concat());
    (output.status.success(), String::from_utf8(output.stderr).unwrap())
}

/// Starts a program for which some system calls do not exist, as on an older kernel: `older CALLS PROGRAM...`, with the
/// numbers of the calls separated by commas.
const OLDER_KERNEL: &str = r#"
#include <errno.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <unistd.h>

int main(int count, char **arguments)
{
    struct sock_filter filter[16];
    unsigned short length = 0;
    if (count < 3)
        return 2;
    filter[length++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr));
    for (char *at = arguments[1]; *at != 0 && length < 14; at += *at == ',') {
        unsigned call = (unsigned)strtoul(at, &at, 10);
        filter[length++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1);
        filter[length++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS);
    }
    filter[length++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    struct sock_fprog program = {length, filter};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program))
        return 2;
    execv(arguments[2], arguments + 2);
    return 2;
}
"#;

/// Number of `landlock_create_ruleset`.
const LANDLOCK: i64 = 444;

/// Runs the command on a kernel without some system calls.
fn without(calls: &[i64], folder: &Path, arguments: &[&str]) -> Output {
    let (source, older) = (folder.join("older.c"), folder.join("older"));
    std::fs::write(&source, OLDER_KERNEL).unwrap();
    assert!(Command::new("cc").arg("-o").args([&older, &source]).status().unwrap().success());
    let numbers: Vec<String> = calls.iter().map(i64::to_string).collect();
    let mut command = Command::new(&older);
    command.arg(numbers.join(",")).arg(program(arguments[0])).args(arguments).current_dir(folder);
    command.env("NO_COLOR", "1").env("CHASSIS_PYTHON", "").env("TMPDIR", folder.join("temporary")).output().unwrap()
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
    // A forked copy of the worker (`copy`) can end by itself or be ended.
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
        // None of these FMUs starts another program, so every process that is left behind is a copy of `chassis`.
        assert!(said.contains("(a copy of chassis)") || !is_left, "{habit}: {said}");
    }
}

/// The supervisor also ends these processes when a step takes too long or the FMU crashes.
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

        // Without a sandbox, the same FMU succeeds with the action that the sandbox denied.
        let report = check(folder.path(), &["--no-sandbox"]);
        assert!(!report.contains("the sandbox denied"), "{habit}: {report}");
        let is_written = std::fs::read_to_string(&file).unwrap() == "written by an FMU";
        assert_eq!(is_written, habit == "write", "{habit}");
        assert_eq!(std::fs::metadata(&file).unwrap().permissions() != mode, habit == "attributes", "{habit}");
    }
}

/// Changing the mode of a file is denied even in the FMU's own folder, because another thread could make the path lead
/// elsewhere.
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

/// On kernels without Landlock or seccomp, an FMU runs without that protection, and a note reports it. The numbers of
/// the system calls are from the kernel's documentation (<https://docs.kernel.org/userspace-api/landlock.html>).
#[test]
fn an_older_kernel_is_a_note() {
    let call = if cfg!(target_arch = "x86_64") { 317 } else { 277 };
    let folder = folder(&Zoo::new("none"));
    for (calls, lacks) in [
        (vec![LANDLOCK], vec!["has no Landlock"]),
        (vec![LANDLOCK, call], vec!["has no Landlock", "does not filter system calls"]),
    ] {
        for arguments in [["check", "Zoo.fmu"].as_slice(), &["run", "zoo.toml", "--fmus", ".", "--sandbox"]] {
            let output = without(&calls, folder.path(), arguments);
            let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
            assert!(output.status.success(), "{calls:?}: {said}");
            let notes: Vec<&str> = said.lines().filter(|line| line.starts_with("note: ")).collect();
            for lack in &lacks {
                assert!(notes.iter().any(|note| note.contains(lack)), "{calls:?}: {said}");
            }
            assert!(!said.contains("has no listener for calls"), "{calls:?}: {said}");
        }
    }
}

/// FMUs cannot write through a link out of a writable folder, even if the target of the link does not exist, nor
/// through a folder that does not exist.
#[test]
fn a_link_to_a_new_file_is_denied() {
    let outside = TempDir::new().unwrap();
    let (target, results) = (outside.path().canonicalize().unwrap().join("new"), TempDir::new().unwrap());
    let link = results.path().canonicalize().unwrap().join("link");
    let chain = link.with_file_name("chain");
    std::os::unix::fs::symlink(&target, &link).unwrap();
    std::os::unix::fs::symlink(&link, &chain).unwrap();
    for file in [&link, &chain, &link.with_file_name("none/file")] {
        let folder = folder(&Zoo { file: file.to_str().unwrap(), ..Zoo::new("write") });
        for calls in [[].as_slice(), &[LANDLOCK]] {
            let out = results.path().to_str().unwrap();
            let arguments = ["run", "zoo.toml", "--fmus", ".", "--no-warnings", "--sandbox", "--out", out];
            let output = without(calls, folder.path(), &arguments);
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(output.status.success() && !target.exists(), "{calls:?}, {}: {said}", file.display());
            let is_denied = said.contains("the sandbox denied changing ");
            assert_eq!(is_denied, !file.ends_with("none/file"), "{calls:?}, {}: {said}", file.display());
        }
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

/// The times are multiples of the step, rounded to nearest, even if an FMU changes the rounding mode.
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
