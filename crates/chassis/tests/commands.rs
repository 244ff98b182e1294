//! The command as a user calls it: output, messages, exit codes.

mod programs;

use programs::program;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

#[cfg(unix)]
#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

const SCENARIO: &str = include_str!("data/ramp.toml");

fn command(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(program(arguments[0]))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env("CHASSIS_PYTHON", "")
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A message without the line breaks that a narrow terminal needs.
fn message(bytes: &[u8]) -> String {
    text(bytes).split([' ', '\n', '│']).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

fn folder(scenario: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("ramp.toml"), scenario).unwrap();
    folder
}

#[cfg(unix)]
fn pack_ramp(folder: &TempDir) {
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    support::Build::new("Ramp", "u", "x").pack(&fmus);
}

/// Calls of `chassis` or `cargo fmu` in a folder, with their exit codes and all that they print.
fn session(folder: &Path, calls: &[&str]) -> String {
    let call = |line: &&str| {
        let mut words = line.split(' ');
        let is_exporter = words.next() == Some("cargo-fmu");
        let output = Command::new(program(if is_exporter { "check" } else { "run" }))
            .args(words)
            .current_dir(folder)
            .envs([("NO_COLOR", "1"), ("CHASSIS_PYTHON", "")])
            .output()
            .unwrap();
        format!("$ {line}\n{}{}[{}]\n", text(&output.stdout), text(&output.stderr), output.status.code().unwrap())
    };
    calls.iter().map(call).collect::<Vec<_>>().join("\n")
}

/// SSP 1.0, section 5: a system as a scenario, which then runs as any other, and the same without a folder.
#[cfg(unix)]
#[test]
fn systems_of_other_tools_are_imported() {
    let folder = folder(SCENARIO);
    support::Build::new("Ramp", "u", "x").pack(folder.path());
    let call = |line: &str| {
        let output = command(folder.path(), &line.split(' ').collect::<Vec<_>>());
        (output.status.code(), message(&output.stdout) + &message(&output.stderr))
    };
    assert_eq!(call("export ramp.toml --fmus . --out out").0, Some(0));
    let (code, said) = call("import out/ramp.ssp --out new/system");
    assert_eq!((code, said.as_str()), (Some(0), "chassis run new/system/ramp.toml --fmus new/system/fmus"));
    for (line, folder) in [("new/system/ramp.toml --fmus new/system/fmus", "a"), ("out/ramp.ssp", "b")] {
        assert_eq!(call(&format!("run {line} --no-page --out {folder}")).0, Some(0), "{line}");
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name).join("ramp/runs/system.csv")).unwrap();
    assert_eq!(read("a"), read("b"));
    let (code, said) = call("import out/ramp.ssp --out new/system");
    assert!(code == Some(1) && said.contains("new/system: the folder is not empty; choose another one"), "{said}");
    let (code, said) = call("plan out/ramp.ssp --step 0.3");
    assert!(code == Some(1) && said.contains("are 3.3333333333333335 steps of 0.3 s"), "{said}");
    let (code, said) = call("plan ramp.toml --fmus . --variant other");
    assert!(code == Some(1) && said.contains("`--variant` chooses a file of an SSP file, but there is none"), "{said}");
}

#[test]
fn help() {
    let folder = TempDir::new().unwrap();
    let printed = session(
        folder.path(),
        &[
            "chassis --help",
            "chassis plan --help",
            "chassis run --help",
            "chassis export --help",
            "chassis import --help",
            "chassis compare --help",
            "chassis study --help",
            "chassis bench --help",
            "chassis bench run --help",
            "chassis bench evaluate --help",
            "chassis fits --help",
            "chassis pack --help",
            "chassis new --help",
            "chassis lab --help",
            "chassis completions --help",
            "chassis schema --help",
            "cargo-fmu --help",
            "cargo-fmu pack --help",
            "cargo-fmu inspect --help",
            "cargo-fmu check --help",
            "cargo-fmu linearize --help",
            "cargo-fmu trim --help",
            "cargo-fmu new --help",
        ],
    );
    insta::assert_snapshot!(printed);
}

#[test]
fn wrong_usage() {
    let printed = session(
        folder(SCENARIO).path(),
        &[
            "chassis fly",
            "chassis run",
            "chassis run ramp.toml --seeds 0",
            "chassis run ramp.toml --jobs 0",
            "chassis run ramp.toml --timeout 0",
            "chassis run missing.toml",
            "chassis run ramp.toml --fmus target/fmu",
            "chassis plan ramp.toml --order random",
            "chassis plan ramp.toml --stop -3",
            "chassis run ramp.toml --stop -3",
            "chassis export ramp.toml --out out --stop -3",
            "chassis plan ramp.toml --stop 1e12",
            "chassis run ramp.toml --stop 1e12",
            "chassis export ramp.toml --out out --stop 1e12",
            "chassis study study.toml --budget 0",
            "chassis study study.toml --resume --overwrite",
            "chassis study study.toml --shard 3/2",
            "chassis study study.toml --shard 0/2",
            "cargo-fmu check Ramp.fmu --timeout soon",
            "cargo-fmu pack --platforms amiga68k",
        ],
    );
    insta::assert_snapshot!(printed);
}

#[test]
fn mistakes_mark_the_place() {
    let folder = folder(&SCENARIO.replace("stop", "stopp"));
    let printed = session(folder.path(), &["chassis plan ramp.toml"]);
    insta::assert_snapshot!(printed);
    assert!(command(folder.path(), &["plan", "ramp.toml"]).stdout.is_empty());
}

#[cfg(unix)]
#[test]
fn a_scenario_is_planned_and_run() {
    let folder = folder(SCENARIO);
    pack_ramp(&folder);

    let output = command(folder.path(), &["plan", "ramp.toml", "--stop", "0.5"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(
        text(&output.stdout),
        "Ramp\nramp.toml: 2 cases = 2 runs, each from 0 s to 0.5 s in 2 steps of 0.25 s, sequential\n\
         1 signal recorded every step, 0 metrics, 0 figures\n\n\
         Components in order of execution\n  ramp  Ramp  FMI 2.0, sets 0 parameters\n\n\
         Wiring, case steep\n  ramp  u  <- constant 2\n\n\
         Outputs that nothing reads, case steep\n  ramp: count, moved\n"
    );
    let output = command(folder.path(), &["plan", "ramp.toml", "--stop", "0.5", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let plan = text(&output.stdout);
    assert!(plan.starts_with(r#"{"format":9,"name":"ramp","file":"ramp.toml","title":"Ramp""#), "{plan}");
    assert!(plan.contains(r#""stop":0.5,"step":0.25,"steps":2,"order":"sequential""#), "{plan}");
    assert!(plan.contains(r#""fmu":"target/fmu/Ramp.fmu""#), "{plan}");

    let output = command(folder.path(), &["run", "ramp.toml", "--jobs", "2"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary = text(&output.stdout);
    assert!(summary.contains("2 of 2 runs over 1 s"), "{summary}");
    let result = |name: &str| std::fs::read_to_string(folder.path().join("results/ramp/runs").join(name));
    assert_eq!(result("steep.csv").unwrap(), "time,x\n0.0,0.0\n0.25,0.5\n0.5,1.0\n0.75,1.5\n1.0,2.0\n");
    assert_eq!(result("flat.csv").unwrap().lines().last(), Some("1.0,1.0"));

    // A failed run is marked. It keeps its rows up to the failure, but no rows from an earlier call.
    let failing = SCENARIO.replace("gain = 0.5", "failure = 1");
    std::fs::write(folder.path().join("ramp.toml"), failing).unwrap();
    let output = command(folder.path(), &["run", "ramp.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let error = text(&output.stderr);
    assert!(error.contains("1 of 2 runs failed"), "{error}");
    assert!(error.contains("x left 90% of its range"), "{error}");
    assert!(result("steep.csv").is_ok());
    let rows = result("flat.csv").unwrap();
    assert!(rows.starts_with("time,x\n0.0,0.0\n") && !rows.contains("\n1.0,"), "{rows}");
    assert!(result("status.json").unwrap().contains(r#""status": "failed""#));
}

#[cfg(unix)]
#[test]
fn a_run_in_real_time_has_the_same_results() {
    let folder = folder(SCENARIO);
    pack_ramp(&folder);
    let place = folder.path().join("results/ramp/runs");
    let read = |name: &str| std::fs::read_to_string(place.join(name)).unwrap();
    assert!(command(folder.path(), &["run", "ramp.toml"]).status.success());
    let expected = read("steep.csv");
    assert!(!read("status.json").contains("real_time"));

    let output = command(folder.path(), &["run", "ramp.toml", "--case", "steep", "--realtime", "10"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("\nreal time x 10: "), "{}", text(&output.stdout));
    assert_eq!(read("steep.csv"), expected);
    let status: serde_json::Value = serde_json::from_str(&read("status.json")).unwrap();
    let run = &status["runs"][0];
    assert_eq!((&run["status"], &run["real_time"]["factor"]), (&"completed".into(), &10.0.into()));
    let [late, largest, total] = ["late_steps", "largest_delay", "total_delay"].map(|key| &run["real_time"][key]);
    let [late, largest, total] = [late, largest, total].map(|number| number.as_f64().unwrap());
    assert!(late <= 4.0 && largest <= total && total <= late * largest + 1e-12, "{status}");

    for (arguments, problem) in [
        (&["--realtime"][..], "--realtime executes one run, but the scenario has 2 help: choose one with --case"),
        (&["--case", "sleep"], "the scenario has no case `sleep` help: choose one of steep, flat"),
        (&["--realtime", "0"], "must be a number above 0, such as 0.5"),
        (&["--realtime", "--engine", "native"], "cannot be used with"),
    ] {
        let output = command(folder.path(), &[&["run", "ramp.toml"], arguments].concat());
        assert!(message(&output.stderr).contains(problem), "{}", text(&output.stderr));
    }
}

/// The run takes 2 s. A pause counts as time that passes, but not as a delay.
#[cfg(target_os = "linux")]
#[test]
fn a_run_in_real_time_is_paused_with_its_command() {
    use std::thread::sleep;
    use std::time::{Duration, Instant};
    let folder = folder(SCENARIO);
    pack_ramp(&folder);
    let began = Instant::now();
    let mut child = Command::new(program("run"))
        .args(["run", "ramp.toml", "--case", "steep", "--realtime", "0.5"])
        .current_dir(folder.path())
        .env("CHASSIS_PYTHON", "")
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let signal = |name: &str| Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    let state = || std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    sleep(Duration::from_millis(200));
    assert!(signal("-TSTP").success());
    while !state().contains(") T ") {
        sleep(Duration::from_millis(1));
    }
    let pause = Duration::from_secs(2);
    sleep(pause);
    assert!(signal("-CONT").success());
    assert!(child.wait().unwrap().success());
    assert!(began.elapsed() >= Duration::from_secs(2) + pause / 2, "the run went on in the pause");
    let status = std::fs::read_to_string(folder.path().join("results/ramp/runs/status.json")).unwrap();
    let status: serde_json::Value = serde_json::from_str(&status).unwrap();
    let largest = status["runs"][0]["real_time"]["largest_delay"].as_f64().unwrap();
    assert!(largest < pause.as_secs_f64(), "{status}");
}

/// Reference: the recurrence of two Euler integrators, x' = y and y' = -x, in sequence and at once. Both are exact.
#[cfg(unix)]
#[test]
fn the_error_of_the_step_is_estimated() {
    const RING: &str = "title = \"Ring\"\n[simulation]\nstop = 1.0\nstep = 0.1\n\
        [[component]]\nname = \"position\"\nfmu = \"Position\"\nparameters = { start = 1.0 }\n\
        [[component]]\nname = \"velocity\"\nfmu = \"Velocity\"\nparameters = { gain = -1.0 }\n\
        [[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"x\"]\nevery = 5\n\
        [[metric]]\nname = \"rms\"\ntitle = \"RMS\"\nsignal = \"x\"\nkind = \"rms\"\n";
    let folder = folder(RING);
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    support::Build::new("Position", "y", "x").pack(&fmus);
    support::Build::new("Velocity", "x", "y").pack(&fmus);
    let rms = |n: u32, is_sequential: bool, every: u32| {
        let (h, mut x, mut y) = (0.1 / f64::from(n), 1.0, 0.0);
        let mut squares = vec![x * x];
        for step in 1..=10 * n {
            let before = x;
            x += h * y;
            y -= h * if is_sequential { x } else { before };
            if step % every == 0 {
                squares.push(x * x);
            }
        }
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let call = |arguments: &[&str]| command(folder.path(), &[&["run", "ramp.toml", "--converge"], arguments].concat());
    let output = call(&[]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let file = std::fs::read_to_string(folder.path().join("results/ramp/converge.json")).unwrap();
    let written: serde_json::Value = serde_json::from_str(&file).unwrap();
    assert_eq!(written["steps"], serde_json::json!([0.1, 0.05, 0.025]));
    assert_eq!((&written["order"], &written["other_order"]), (&"sequential".into(), &"jacobi".into()));
    let run = &written["runs"][0];
    let metric = &run["metrics"][0];
    let near = |found: &serde_json::Value, expected: f64| {
        assert!((found.as_f64().unwrap() - expected).abs() < 1e-12, "{found}, expected {expected}");
    };
    let [m1, m2, m4] = [1, 2, 4].map(|n| rms(n, true, 5 * n));
    for (found, expected) in metric["values"].as_array().unwrap().iter().zip([m1, m2, m4]) {
        near(found, expected);
    }
    near(&metric["other_order"], rms(1, false, 5));
    near(&metric["order_change"], (rms(1, false, 5) - m1) / m1);
    near(&metric["recording"], (rms(4, true, 5) - m4) / m1);
    near(&metric["order"], ((m1 - m2) / (m2 - m4)).log2());
    assert_eq!((&metric["above_limit"], &metric["order_matters"]), (&true.into(), &false.into()));
    assert_eq!((&metric["class"], &run["signals"][0][0]), (&"regular".into(), &"x".into()));
    let printed = text(&output.stdout);
    assert!(!printed.contains("matters"), "the other order changes less than the error: {printed}");
    for part in ["h = 0.1 s", "regular", "as the step goes to 0 (order 1.01)", "recommended step: 0.02 s"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    // The runs with the step of the scenario are its results.
    let rows = std::fs::read_to_string(folder.path().join("results/ramp/runs/only.csv")).unwrap();
    assert_eq!(rows.lines().count(), 4, "{rows}");

    let output = call(&["--converge-fail"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        message(&output.stderr).contains("the error of the step is above 1 %: rms of run only"),
        "{}",
        text(&output.stderr)
    );
    let output = call(&["--converge-fail", "--limit", "50%"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(!text(&output.stdout).contains("recommended"), "{}", text(&output.stdout));

    // A component that takes samples, but has no sample time, is another system with each step.
    let sampled = RING.replace("name = \"velocity\"\n", "name = \"velocity\"\nkind = \"discrete\"\n");
    std::fs::write(folder.path().join("ramp.toml"), sampled).unwrap();
    let printed = text(&call(&["--sample-times"]).stdout);
    let note = "`velocity` updates once per communication step, so the systems with h, h/2 and h/4 differ";
    assert!(printed.contains(note) && printed.contains("controllers' sample times"), "{printed}");

    std::fs::write(folder.path().join("ramp.toml"), RING.replace("start = 1.0", "failure = 1")).unwrap();
    let output = call(&[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output.stderr).contains("1 of 1 runs failed"), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("rms is not defined with each step"), "{}", text(&output.stdout));
    for (arguments, problem) in [
        (&["--limit", "one"][..], "must be a percentage above 0, such as 1%"),
        (&["--limit=-1%"], "must be a percentage above 0, such as 1%"),
    ] {
        let output = call(arguments);
        assert!(message(&output.stderr).contains(problem), "{}", text(&output.stderr));
    }
    let output = command(folder.path(), &["import", "ramp.toml", "--out", "imported"]);
    assert!(message(&output.stderr).contains("must be an SSP file, got a scenario"), "{}", text(&output.stderr));
}

#[cfg(unix)]
#[test]
fn an_fmu_is_validated() {
    let folder = tempfile::tempdir().unwrap();
    support::Build::new("Ramp", "u", "x").pack(folder.path());
    let output = command(folder.path(), &["check", "Ramp.fmu"]);
    assert_eq!(output.status.code(), Some(1));
    let findings = text(&output.stdout);
    assert!(findings.starts_with("Ramp.fmu: ") && findings.contains(" errors, no warning"), "{findings}");
    assert!(findings.contains("error: fmi2CancelStep: is not exported"), "{findings}");
    assert!(findings.contains("error: variable `x`: is not listed in ModelStructure/Outputs"), "{findings}");
    // The behavior of the FMU is correct.
    assert!(!findings.contains("fmi2Reset:") && !findings.contains("error: two instances"), "{findings}");
    // The report lists what was checked: the nine variables, and the behavior.
    assert!(
        findings.contains(
            "\n  description: 25 elements checked against the schema; variables: 9; entries of the model structure: 0"
        ),
        "{findings}"
    );
    let binary = findings.lines().find(|line| line.starts_with("  binary: ")).unwrap();
    assert!(
        binary.ends_with(
            "start values, runs, another start time, reset before initialization, reset after a run, two instances, \
             dependencies at the start, the end of a run, stack"
        ),
        "{binary}"
    );
    let steps: usize = binary.split(", ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(steps > 100, "{binary}");

    support::Build { step: "abort()", ..support::Build::new("Crash", "u", "x") }.pack(folder.path());
    let output = command(folder.path(), &["check", "Crash.fmu", "Ramp.fmu"]);
    assert_eq!(output.status.code(), Some(1));
    let findings = text(&output.stdout);
    assert!(findings.contains("error: runs: the process ended (signal 6, SIGABRT) during fmi2DoStep"), "{findings}");
    assert!(findings.contains("Ramp.fmu: "), "the next one is checked all the same: {findings}");
}

#[cfg(target_os = "linux")]
#[test]
fn what_other_platforms_lack_is_said_before_anything_is_built() {
    // This workspace has nothing to build, so a build would fail with another message.
    let folder = workspace("");
    let pack = |arguments: &[&str], path: &str| {
        let output = Command::new(program("pack"))
            .args([&["pack"], arguments].concat())
            .current_dir(folder.path())
            .envs([("NO_COLOR", "1"), ("PATH", path), ("RUSTC", "no/rustc/here")])
            .envs(
                ["WIN64", "LINUX64", "AARCH64_LINUX", "WASM32"]
                    .map(|name| (format!("CHASSIS_FMU_{name}_RUST"), "no/rust/here")),
            )
            .output()
            .unwrap();
        assert!(!output.status.success());
        // Lines may break within long words.
        message(&output.stderr).replace(' ', "")
    };
    let contains = |error: &str, expected: &str| {
        assert!(error.contains(&expected.replace(' ', "")), "{expected}: {error}");
    };
    let error = pack(&["--platforms", "linux64,win32"], "");
    contains(&error, "'win32'");
    contains(&error, "[possible values: linux64, win64, aarch64-linux, x86_64-darwin, aarch64-darwin, wasm32]");
    let error = pack(&["--platforms", "linux64,win64"], "");
    contains(&error, "the linker x86_64-w64-mingw32-gcc is not on the PATH");
    contains(&error, "no/rust/here/bin/cargo does not exist");
    contains(&error, "gcc-mingw-w64-x86-64-win32 cargo-web rustc-web rust-web-src");
    contains(&error, "`rustup target add x86_64-pc-windows-gnu`");
    contains(&error, "CHASSIS_FMU_WIN64_RUST=FOLDER");
    let error = pack(&["--platforms", "linux64,wasm32"], "");
    contains(&error, "wasm32 cannot be built here");
    contains(&error, "no/rust/here/bin/cargo does not exist");
    contains(&error, "CHASSIS_FMU_WASM32_RUST=FOLDER");
    let (this, other, target) = if cfg!(target_arch = "x86_64") {
        ("linux64", "aarch64-linux", "aarch64-unknown-linux-gnu")
    } else {
        ("aarch64-linux", "linux64", "x86_64-unknown-linux-gnu")
    };
    let error = pack(&["--platforms", &format!("{this},{other}")], "");
    contains(&error, &format!("{other} cannot be built here: cargo-zigbuild is neither in"));
    contains(&error, &format!("the Rust in use has no standard library for {target}"));
    contains(&error, "no/rust/here/bin/cargo does not exist");
    contains(&error, "`scripts/setup --all`, which installs cargo-zigbuild and zig");
    contains(&error, &format!("`rustup target add {target}`"));
    contains(&error, "`apt-get install --no-install-recommends cargo-web rustc-web rust-web-src`");
    contains(&error, &format!("CHASSIS_FMU_{}_RUST=FOLDER", other.to_uppercase().replace('-', "_")));
    for name in ["aarch64-darwin", "x86_64-darwin"] {
        let error = pack(&["--platforms", name], "");
        contains(&error, &format!("a binary for {name} cannot be built on {this}: only a Mac has the linker"));
        contains(&error, "Run the same command on a Mac");
    }
    let error = pack(&["--platforms", "darwin64"], "");
    contains(&error, "a binary for x86_64-darwin cannot be built on");
    let error = pack(&["--platforms", "aarch64-darwin,x86_64-darwin"], "");
    contains(&error, "FMI 2.0 has one folder for both, binaries/darwin64");
    let error = pack(&["--platforms", "win64", "--portable"], "");
    contains(&error, "--portable applies to Linux binaries, but --platforms lists no Linux platform");
}

/// A workspace with a package of this name that could be packed as an FMU.
fn workspace_with_model(package: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let library = folder.path().join(package).join("src");
    std::fs::create_dir_all(&library).unwrap();
    std::fs::write(library.join("lib.rs"), "").unwrap();
    let manifest = format!(
        "[package]\nname = \"{package}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[lib]\ncrate-type = [\"cdylib\"]\n\
         [dependencies]\nfmu = \"1\"\n"
    );
    std::fs::write(folder.path().join(package).join("Cargo.toml"), manifest).unwrap();
    let workspace = format!("[workspace]\nresolver = \"3\"\nmembers = [\"{package}\"]\n");
    std::fs::write(folder.path().join("Cargo.toml"), workspace).unwrap();
    std::fs::write(folder.path().join("Cargo.lock"), "version = 4\n").unwrap();
    folder
}

#[test]
fn only_near_names_are_suggested() {
    let folder = workspace_with_model("suspension-mixer");
    let error = |arguments: &[&str]| {
        let output = command(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        message(&output.stderr)
    };
    for name in ["check", "inspect", "linearize", "trim"] {
        let far = error(&[name, "Nope"]);
        assert!(far.contains("there is no model named 'Nope' in this workspace"), "{far}");
        assert!(!far.contains("did you mean"), "{far}");
        assert!(far.contains("; its models are SuspensionMixer"), "{far}");
        let near = error(&[name, "SuspensionMixr"]);
        assert!(near.contains("; did you mean `SuspensionMixer`?"), "{near}");
        let packed = error(&[name, "SuspensionMixer"]);
        assert!(packed.contains("run `cargo fmu pack SuspensionMixer`"), "{packed}");
        for path in ["Nope.fmu", "some/Nope", "./Nope"] {
            let missing = error(&[name, path]);
            assert!(missing.contains(&format!("there is no file {path}")), "{missing}");
        }
    }
    // The files are not archives, so the error shows to which file a name refers. If both exist, this is the FMI 2.0
    // file.
    for version in ["fmu3", "fmu"] {
        let packed = folder.path().join("target").join(version);
        std::fs::create_dir_all(&packed).unwrap();
        std::fs::write(packed.join("SuspensionMixer.fmu"), "").unwrap();
        let broken = error(&["inspect", "SuspensionMixer"]);
        assert!(broken.contains(&format!("target/{version}/SuspensionMixer.fmu")), "{broken}");
    }
}

#[test]
fn fmus_that_are_not_packed_are_one_mistake() {
    let folder = workspace_with_model("suspension-mixer");
    for (file, fmu) in [("ramp.toml", "\"SuspensionMixer\""), ("typo.toml", "\"SuspensionMixr\"")] {
        std::fs::write(folder.path().join(file), SCENARIO.replace("\"Ramp\"", fmu)).unwrap();
    }
    let printed = session(folder.path(), &["chassis plan ramp.toml", "chassis plan typo.toml"]);
    insta::assert_snapshot!(printed);
}

/// An empty workspace with a table `[workspace.metadata.fmu]`.
fn workspace(settings: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let manifest = format!("[workspace]\nresolver = \"3\"\n[workspace.metadata.fmu]\n{settings}\n");
    std::fs::write(folder.path().join("Cargo.toml"), manifest).unwrap();
    std::fs::write(folder.path().join("Cargo.lock"), "version = 4\n").unwrap();
    folder
}

#[cfg(target_os = "linux")]
#[test]
fn a_portable_binary_is_a_setting_that_needs_a_linker() {
    const NO_MODEL: &str = "this workspace has no package";
    let pack = |folder: &TempDir, arguments: &[&str]| {
        let output = Command::new(program("pack"))
            .args([&["pack"], arguments].concat())
            .current_dir(folder.path())
            // With an empty PATH, neither cargo-zigbuild nor zig is found.
            .envs([("NO_COLOR", "1"), ("PATH", "")])
            .output()
            .unwrap();
        assert!(!output.status.success());
        message(&output.stderr)
    };
    let portable = workspace("portable = true");
    let error = pack(&portable, &[]);
    assert!(error.contains("`portable = true` in [workspace.metadata.fmu] of Cargo.toml asks for"), "{error}");
    assert!(error.contains("cargo-zigbuild is neither in"), "{error}");
    assert!(error.contains("Run `scripts/setup --all`") && error.contains("pass --no-portable"), "{error}");
    // The setting applies only to linux64, and the command line takes precedence.
    assert!(pack(&portable, &["--no-portable"]).contains(NO_MODEL));
    assert!(pack(&portable, &["--portable", "--no-portable"]).contains(NO_MODEL));
    assert!(pack(&portable, &["--no-portable", "--portable"]).contains("--portable asks for linux64 binaries"));
    assert!(pack(&portable, &["--platforms", "darwin64"]).contains("x86_64-darwin cannot be built on"));

    let native = workspace("");
    assert!(pack(&native, &[]).contains(NO_MODEL));
    assert!(pack(&native, &["--portable"]).contains("--portable asks for linux64 binaries"));
    let error = pack(&workspace("portabel = true"), &[]);
    assert!(
        error.contains("[workspace.metadata.fmu]: unknown field `portabel`, expected one of `portable`"),
        "{error}"
    );

    // A cargo-zigbuild without zig is not enough.
    let bin = portable.path().join(".venv/bin");
    std::fs::create_dir_all(&bin).unwrap();
    let program = bin.join("cargo-zigbuild");
    std::fs::write(&program, "#!/bin/sh\n").unwrap();
    std::fs::set_permissions(&program, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let error = pack(&portable, &[]);
    assert!(error.contains("is installed, but cannot find zig"), "{error}");
    std::fs::copy(&program, bin.join("python3")).unwrap();
    assert!(pack(&portable, &[]).contains(NO_MODEL), "a Python beside it has the package");
}

const STUDY: &str = r#"title = "Ramp"
scenario = "ramp.toml"
method = "optimize"
cases = ["steep"]
[budget]
evaluations = 120
[[parameter]]
name = "ramp:gain"
min = -1.0
max = 9.0
[[parameter]]
name = "ramp:start"
min = -1.0
max = 1.0
[[objective.term]]
signal = "x"
kind = "rms"
weight = 1.0
[[search]]
kind = "pacsa"
[[search]]
kind = "cmaes"
"#;

/// A folder with a study of a ramp. The ramp has many steps, so that the study takes long enough to be interrupted.
#[cfg(unix)]
fn study() -> TempDir {
    let folder = folder(&SCENARIO.replace("step = 0.25", "step = 1e-5").replace("[\"x\"]", "[\"x\"]\nevery = 1000"));
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    support::Build::new("Ramp", "u", "x").pack(&fmus);
    std::fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    folder
}

#[cfg(unix)]
#[test]
fn a_study_is_carried_out() {
    let folder = study();
    let output = command(folder.path(), &["study", "study.toml", "--budget", "30"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary = text(&output.stdout);
    assert!(summary.contains("PACSA: 30 evaluations (0 not feasible)"), "{summary}");
    assert!(!summary.contains("no method improved"), "{summary}");
    assert!(summary.contains("ramp:start = ") && summary.contains("results/study/summary.json"), "{summary}");

    // A scenario with the best values has the best objective, which is the RMS of the recorded signal.
    let summary = std::fs::read_to_string(folder.path().join("results/study/summary.json")).unwrap();
    let objectives = summary.split("\"objective\": ").skip(1).map(|rest| rest.split([',', '\n']).next().unwrap());
    let best = objectives.map(|number| number.parse::<f64>().unwrap()).fold(f64::INFINITY, f64::min);
    let scenario = std::fs::read_to_string(folder.path().join("ramp.toml")).unwrap();
    let tuned = scenario.replacen("title", "parameter_set = \"results/study/best.ssv\"\ntitle", 1);
    std::fs::write(folder.path().join("tuned.toml"), tuned).unwrap();
    let output = command(folder.path(), &["run", "tuned.toml"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let recorded = std::fs::read_to_string(folder.path().join("results/tuned/runs/steep.csv")).unwrap();
    let x: Vec<f64> = recorded.lines().skip(1).map(|row| row.split_once(',').unwrap().1.parse().unwrap()).collect();
    // The test adds in the same order as the study, so the results are bit-identical.
    assert_eq!((x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt(), best);

    let output = command(folder.path(), &["study", "study.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let error = message(&output.stderr);
    assert!(error.contains("`--resume` continues it, `--overwrite` starts over"), "{error}");
    let output = command(folder.path(), &["study", "study.toml", "--resume", "--budget", "20"]);
    assert_eq!(output.status.code(), Some(1));
    let error = message(&output.stderr);
    assert!(error.contains("has 30 evaluations, more than the budget of 20"), "{error}");
    let output = command(folder.path(), &["study", "study.toml", "--overwrite", "--budget", "20"]);
    assert!(output.status.success(), "{}", text(&output.stderr));

    // All gains in this study are far above the gain in the scenario.
    std::fs::write(folder.path().join("far.toml"), STUDY.replace("min = -1.0\nmax = 9.0", "min = 8.0\nmax = 9.0"))
        .unwrap();
    let output = command(folder.path(), &["study", "far.toml", "--budget", "8"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary = text(&output.stdout);
    assert!(summary.starts_with("As in the scenario: "), "{summary}");
    assert!(summary.contains("no method improved on the scenario's own values\n"), "{summary}");

    std::fs::write(folder.path().join("study.toml"), STUDY.replace("pacsa", "pasca")).unwrap();
    let output = command(folder.path(), &["study", "study.toml", "--resume"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("study.toml:20:8"), "{}", text(&output.stderr));
}

/// The study is killed after some evaluations, without a chance to clean up, and resumed with another number of
/// processes.
#[cfg(unix)]
#[test]
fn a_killed_study_goes_on_to_the_same_results() {
    let files =
        ["pacsa/history.csv", "pacsa/state.json", "cmaes/history.csv", "cmaes/best.ssv", "summary.json", "best.ssv"];
    let read = |folder: &TempDir| {
        files.map(|name| std::fs::read_to_string(folder.path().join("results/study").join(name)).unwrap())
    };
    let whole = study();
    assert!(command(whole.path(), &["study", "study.toml"]).status.success());
    let expected = read(&whole);

    let killed = study();
    // Copy the FMU: a second build may differ, because a compiler may embed paths or the time.
    let fmu = "target/fmu/Ramp.fmu";
    std::fs::copy(whole.path().join(fmu), killed.path().join(fmu)).unwrap();
    for lines in [5, 30, 90] {
        let mut child = Command::new(program("study"))
            .args(["study", "study.toml", "--resume", "--jobs", "3"])
            .env("CHASSIS_PYTHON", "")
            .current_dir(killed.path())
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let history = killed.path().join("results/study/pacsa/history.csv");
        while child.try_wait().unwrap().is_none() {
            let written = std::fs::read_to_string(&history).unwrap_or_default();
            if written.lines().count() > lines {
                child.kill().unwrap();
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        assert!(!child.wait().unwrap().success(), "killed, not finished");
    }
    assert!(command(killed.path(), &["study", "study.toml", "--resume"]).status.success());
    assert_eq!(read(&killed), expected);
}

/// Writes an FMU that contains only a description, with Real variables `name causality unit`. With `has_state`, the
/// first one is a state.
fn described(folder: &Path, name: &str, variables: &[&str], has_state: bool) {
    let variables: String = variables
        .iter()
        .enumerate()
        .map(|(reference, text)| {
            let [name, causality, unit] = text.split(' ').collect::<Vec<_>>().try_into().unwrap();
            format!(
                "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\"><Real unit=\"{unit}\"/>\
                 </ScalarVariable>"
            )
        })
        .collect();
    let derivatives = if has_state { "<Derivatives><Unknown index=\"1\"/></Derivatives>" } else { "" };
    let description = format!(
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{name}\"><CoSimulation modelIdentifier=\"{name}\"/>\
         <ModelVariables>{variables}</ModelVariables><ModelStructure>{derivatives}</ModelStructure></fmiModelDescription>"
    );
    let mut zip = zip::ZipWriter::new(std::fs::File::create(folder.join(format!("{name}.fmu"))).unwrap());
    zip.start_file("modelDescription.xml", zip::write::SimpleFileOptions::default()).unwrap();
    std::io::Write::write_all(&mut zip, description.as_bytes()).unwrap();
    zip.finish().unwrap();
}

#[test]
fn systems_are_shown_as_a_matrix() {
    let folder = TempDir::new().unwrap();
    for name in ["mine", "theirs"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    let (mine, theirs) = (folder.path().join("mine"), folder.path().join("theirs"));
    let systems = |arguments: &[&str]| {
        let output = command(folder.path(), &[&["fits", "--fmus", "mine", "--fmus", "theirs"], arguments].concat());
        (output.status.success(), text(&output.stdout), text(&output.stderr))
    };
    let (_, _, error) = systems(&[]);
    assert!(error.contains("there is no FMU in mine, theirs"), "{error}");
    described(&theirs, "Steering", &["yaw_rate input rad/s", "steer output rad"], false);
    let (_, _, error) = systems(&[]);
    assert!(error.contains("found no plant"), "{error}");

    described(&theirs, "Car", &["yaw_rate output rad/s", "steer input rad"], true);
    described(&theirs, "Sled", &["yaw_rate output deg/s", "steer input rad"], true);
    described(&mine, "Lamp", &["yaw_rate input rad/s", "light output lm"], false);
    let (_, matrix, _) = systems(&[]);
    assert_eq!(matrix, "          Car   Sled\nLamp      idle  lacks 1\nSteering  fits  lacks 1\n");
    let (_, details, _) = systems(&["--missing", "Steering"]);
    let expected = "          Car   Sled\nSteering  fits  lacks 1\n\nSteering, Sled:\n  \
                    yaw_rate (rad/s): Sled has it in deg/s, expected in rad/s\n";
    assert_eq!(details, expected);
    let (_, details, _) = systems(&["--missing", "Lamp", "Car"]);
    assert!(details.contains("Lamp, Car: nothing that acts on Car reads the outputs of Lamp"), "{details}");

    // The folder that is given first takes precedence.
    described(&mine, "Steering", &["yaw_rate input rad/s", "light output lm"], false);
    let (_, matrix, _) = systems(&["Steering", "Car"]);
    assert_eq!(matrix, "          Car\nSteering  idle\n");

    let (is_fine, _, error) = systems(&["Stering"]);
    assert!(!is_fine && error.contains("there is no FMU named 'Stering'; did you mean `Steering`?"), "{error}");
    // Without `--fmus`, the folder of packed FMUs is used.
    std::fs::create_dir(folder.path().join("target")).unwrap();
    std::fs::rename(theirs, folder.path().join("target/fmu")).unwrap();
    let output = command(folder.path(), &["fits"]);
    assert_eq!(text(&output.stdout), "          Car   Sled\nSteering  fits  lacks 1\n", "{}", text(&output.stderr));
}

#[cfg(unix)]
#[test]
fn a_system_is_written_for_other_masters() {
    let folder = folder(SCENARIO);
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    support::Build::new("Ramp", "u", "x").pack(&fmus);
    let system = |arguments: &[&str]| {
        command(folder.path(), &[&["export", "ramp.toml", "--out", "out/flat"], arguments].concat())
    };
    for (arguments, expected) in [
        (&["--case", "flatt"][..], "has no case `flatt`; did you mean `flat`?"),
        (&["--case", "quick"], "it has steep, flat"),
        (&["--point", "fast"], "has no point `fast`; it has none"),
        (&["--seed", "-1"], "has no seed `-1`"),
        (
            &["--stop", "0.3"],
            "from start 0 s to stop 0.3 s are 1.2 steps of 0.25 s, which must be a whole number above 0",
        ),
    ] {
        let output = system(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(message(&output.stderr).contains(expected), "{}", text(&output.stderr));
        assert!(!folder.path().join("out").exists(), "{arguments:?}");
    }
    let output = system(&["--case", "flat", "--stop", "0.5"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("run flat for other masters, step 0.25 s, until 0.5 s"));
    let osp = std::fs::read_to_string(folder.path().join("out/flat/OspSystemStructure.xml")).unwrap();
    // The file contains the parameter of the case and the constant for the input.
    for expected in ["variable=\"gain\"", "value=\"0.5\"", "variable=\"u\"", "value=\"2.0\""] {
        assert!(osp.contains(expected), "{osp}");
    }
    assert!(folder.path().join("out/flat/ramp.ssp").is_file());

    let output = system(&[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        message(&output.stderr).contains("the folder is not empty; `--overwrite` replaces"),
        "{}",
        text(&output.stderr)
    );
    assert_eq!(system(&["--overwrite"]).status.code(), Some(0));
}

/// A mistake in a study with `[[vary]]` is marked; Python is not needed for that.
#[test]
fn mistakes_of_studies_are_marked() {
    let folder = folder(SCENARIO);
    let study = "title = 'a'\nscenario = 'ramp.toml'\nmethod = 'sampel'\n[[vary]]\nname = 'x'\n";
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    let output = command(folder.path(), &["study", "study.toml"]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    for expected in ["study.toml:3:10", "method = 'sampel'", "unknown word `sampel`", "did you mean `sample`?"] {
        assert!(error.contains(expected), "{error}");
    }
}

/// A study without `[[vary]]` rejects the options of studies with samples.
#[test]
fn options_of_samples_belong_to_studies_with_samples() {
    let calls =
        ["--dask", "--runs=3", "--shard=1/2", "--merge"].map(|option| format!("chassis study study.toml {option}"));
    let printed = session(study().path(), &calls.each_ref().map(String::as_str));
    insta::assert_snapshot!(printed);
}

/// Without the Python package there are results, but no page. Options that need the package fail with a message.
#[cfg(unix)]
#[test]
fn a_page_needs_python() {
    let folder = folder(SCENARIO);
    let fmus = folder.path().join("target/fmu");
    std::fs::create_dir_all(&fmus).unwrap();
    support::Build::new("Ramp", "u", "x").pack(&fmus);
    let output = command(folder.path(), &["run", "ramp.toml"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(
        text(&output.stderr).contains("note: no page is written, because pages need the Python package `chassis_fmu`")
    );
    for arguments in [&["--engine", "fmpy"][..], &["--parquet"], &["--from-csv", "."]] {
        let output = command(folder.path(), &[&["run", "ramp.toml"], arguments].concat());
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(message(&output.stderr).contains("needs the Python package `chassis_fmu`"), "{arguments:?}");
    }
}

/// Commands and options of earlier versions fail with a message that contains the new name.
#[test]
fn renamed_commands_say_so() {
    let folder = TempDir::new().unwrap();
    let printed = session(
        folder.path(),
        &[
            "cargo-fmu tune x.toml",
            "cargo-fmu system x.toml",
            "cargo-fmu plan x.toml",
            "cargo-fmu run x.toml",
            "cargo-fmu assess EspCar",
            "cargo-fmu evaluate braking",
            "cargo-fmu compat EspCar",
            "cargo-fmu pack --for x.toml",
            "cargo-fmu new x --kind scenario --plant EspCar",
            "chassis assess x",
            "chassis evaluate x",
            "chassis compat x",
            "chassis run ramp.toml --native",
        ],
    );
    insta::assert_snapshot!(printed);
}

/// The committed schemas are the ones that the command prints, and the files in the repository refer to them.
#[test]
fn schemas_are_committed_and_named() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for (kind, folders) in [
        ("scenario", ["scenarios", "scenarios/systems"].as_slice()),
        ("study", &["studies"]),
        ("vehicle", &["crates/fmu-assess/src/vehicles"]),
    ] {
        let schema = root.join(format!("python/chassis_fmu/schemas/{kind}.json"));
        let printed = command(&root, &["schema", kind]).stdout;
        let committed = std::fs::read_to_string(&schema).unwrap_or_default();
        assert!(text(&printed) == committed, "run `chassis schema {kind} > {}`", schema.display());
        let files = folders.iter().flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap());
        let files = files.map(|file| file.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "toml"));
        for file in files {
            let first = std::fs::read_to_string(&file).unwrap();
            let named = first.lines().next().and_then(|line| line.strip_prefix("#:schema "));
            let named = file.parent().unwrap().join(named.unwrap_or_else(|| panic!("{}", file.display())));
            assert_eq!(named.canonicalize().unwrap(), schema.canonicalize().unwrap(), "{}", file.display());
        }
    }
}

/// Closed form: the simulation is the measurement, 0.1 s late and in other units. A file without units has those of the
/// other one.
#[test]
fn two_files_are_compared() {
    let folder = TempDir::new().unwrap();
    let sine = |time: f64| (2.0 * time).sin();
    let rows = |delay: f64, factor: f64| {
        let row = |k: i32| format!("{},{}\n", f64::from(k) / 100.0, factor * sine(f64::from(k) / 100.0 - delay));
        (0..=1000).map(row).collect::<String>()
    };
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("simulated.csv", format!("time,car:yaw_rate\n{}", rows(0.1, std::f64::consts::PI / 180.0)));
    write("measured.csv", format!("Time,YawRate [deg/s]\n{}", rows(0.0, 1.0)));
    write("rad.csv", format!("time,car:yaw_rate [rad/s]\n{}", rows(0.1, std::f64::consts::PI / 180.0)));
    let compare = |options: &[&str]| {
        let arguments = ["compare", "rad.csv", "measured.csv", "--signal", "car:yaw_rate", "--column", "YawRate"];
        let output = command(folder.path(), &[&arguments, options].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_str::<serde_json::Value>(&text(&output.stdout)).unwrap()
    };
    let found = compare(&["--unit", "deg/s", "--max-shift", "0.5", "--window", "1,9", "--tolerance", "0.2,0.1"]);
    let near = |name: &str, expected: f64, tolerance: f64| {
        let value = found[name].as_f64().unwrap_or_else(|| panic!("{found}"));
        assert!((value - expected).abs() <= tolerance, "{name}: {value}, not {expected}");
    };
    assert_eq!(found["samples"], 801);
    // The parabola through three samples of the correlation errs by less than a thousandth of the sampling time.
    near("shift", 0.1, 1e-5);
    near("max_error", 2.0 * 0.1_f64.sin(), 1e-4);
    assert_eq!(found["share_within"], 1.0);
    assert!(found["tube_share"].is_null());
    let without_unit = compare(&[]);
    assert!(without_unit["max_error"].as_f64().unwrap() < 2.0 * 0.1_f64.sin() * std::f64::consts::PI / 180.0 + 1e-6);
    assert!(without_unit["shift"].is_null());

    let failed = |arguments: &[&str]| {
        let output = command(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        message(&output.stderr)
    };
    let unknown = failed(&["compare", "simulated.csv", "measured.csv", "--signal", "car:yaw_rate"]);
    assert!(unknown.contains("car:yaw_rate"), "{unknown}");
    let unit = failed(&["compare", "rad.csv", "rad.csv", "--signal", "car:yaw_rate", "--unit", "m"]);
    assert!(unit.contains("measure different quantities"), "{unit}");
    for (option, value, expected) in [
        ("--window", "2,1", "give two numbers, the lesser one first"),
        ("--tolerance", "-1", "give one or two numbers that are not below 0"),
        ("--tube", "1,x", "`x` is not a number"),
        ("--max-shift", "0", "must be above 0"),
    ] {
        let option = format!("{option}={value}");
        let mistake = failed(&["compare", "rad.csv", "rad.csv", "--signal", "car:yaw_rate", &option]);
        assert!(mistake.contains(expected), "{mistake}");
    }
}
