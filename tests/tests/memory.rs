//! Memory use of FMUs, observed from outside the process: steps do not allocate, and there are no leaks or invalid
//! accesses.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const EXERCISE: &str = env!("CARGO_BIN_EXE_exercise");
const STACK: &str = env!("CARGO_BIN_EXE_stack");

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

/// Set, step and get never use the heap, in any FMU. Real-time masters and long co-simulations rely on this.
#[cfg(target_env = "gnu")]
#[test]
fn a_step_allocates_nothing() {
    let paths = tests::paths();
    let output = exercise(Command::new(EXERCISE).arg("steps").args(&paths).env("LD_PRELOAD", counting_library()));
    let text = String::from_utf8(output.stdout).expect("the helper prints text");
    assert_eq!(text.lines().count(), paths.len());
    for line in text.lines() {
        let [name, in_steps, before] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        // Loading and initialization allocate memory, so the number before the steps shows that the counter works.
        assert!(before.parse::<u64>().is_ok_and(|count| count > 100), "{name}: nothing was counted: {before}");
        assert_eq!(in_steps, "0", "{name}: allocations in 300 steps of set, step and get");
    }
}

/// Memory for recorded signals is reserved before the first step, and stepping does not allocate: a run with twice as
/// many steps has the same number of allocations.
#[cfg(target_env = "gnu")]
#[test]
fn a_step_of_the_native_master_allocates_nothing() {
    stepping_allocates_nothing(&tests::workspace().join("scenarios/rescue_vehicle_step_steer.toml"));
}

/// The master integrates the plant. The inputs are constant and the solver needs no Jacobian, because the exporter's FMUs
/// allocate in Event Mode and for directional derivatives.
#[cfg(target_env = "gnu")]
#[test]
fn a_step_in_model_exchange_allocates_nothing() {
    const TEXT: &str = r#"
title = "Test"
[simulation]
stop = 2.0
step = 0.001
[[component]]
name = "plant"
fmu = "RescueVehicle"
interface = "model-exchange"
[component.inputs]
"road_height.*" = 0.0
"road_friction.*" = 1.0
"driver.speed" = 5.0
"steer.front" = 0.05
"steer.middle" = 0.0
"steer.rear" = 0.0
"suspension_force.*" = 0.0
[[case]]
name = "only"
title = "Only"
[record]
signals = ["vehicle.yaw_rate"]
"#;
    let scenario = tempfile::NamedTempFile::with_suffix(".toml").expect("a temporary file");
    std::fs::write(scenario.path(), TEXT).expect("a file");
    stepping_allocates_nothing(scenario.path());
}

#[cfg(target_env = "gnu")]
fn stepping_allocates_nothing(scenario: &Path) {
    let mut command = Command::new(EXERCISE);
    let command =
        command.arg("master").arg(scenario).args(["0.5", "0.5", "1", "2"]).env("LD_PRELOAD", counting_library());
    let text = String::from_utf8(exercise(command).stdout).expect("the helper prints text");
    let lines: Vec<_> = text.lines().filter_map(|line| line.split_once(' ')).collect();
    // The first run is not compared: it also allocates data that the process keeps, such as the list of instances.
    let [("501", _), ("501", half), ("1001", one), ("2001", two)] = lines[..] else { panic!("{text}") };
    // Creating the instances of eight FMUs allocates memory, so this number shows that the counter works.
    assert!(half.parse::<u64>().is_ok_and(|count| count > 100), "nothing was counted: {half}");
    assert_eq!([one, two], [half; 2], "allocations of runs of 500, 1000 and 2000 steps");
}

/// In a complete use of every FMU, valgrind finds no invalid access, no use of uninitialized values, and no lost
/// memory.
#[test]
// Ignored by default because scripts/test needs Rust, Python and a C compiler only. `.ci/run` installs valgrind.
#[ignore = "needs valgrind; .ci/run installs it and runs this test"]
fn valgrind_finds_nothing() {
    exercise(tests::valgrind().arg(EXERCISE).arg("life").args(tests::paths()));
}

/// Memory that a library keeps in addition to its instances is freed when the library is unloaded, so a master that
/// loads FMUs repeatedly does not grow. After unloading, nothing points to such memory, so valgrind would report it as
/// lost.
#[test]
// Ignored by default because scripts/test needs Rust, Python and a C compiler only. `.ci/run` installs valgrind.
#[ignore = "needs valgrind; .ci/run installs it and runs this test"]
fn an_unloaded_library_leaves_nothing_behind() {
    exercise(tests::valgrind().arg(EXERCISE).arg("reload").args(tests::paths()));
}

/// Stack of each FMU in kB, from the table in docs/robustness.md.
fn documented_stack() -> BTreeMap<String, usize> {
    let path = tests::workspace().join("docs/robustness.md");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let row = |line: &str| {
        let (name, size) = line.strip_prefix("| `")?.split_once("` | ")?;
        Some((name.to_owned(), size.strip_suffix(" kB |")?.parse().ok()?))
    };
    text.lines().filter_map(row).collect()
}

/// A thread with the documented stack size, plus 8 kB as a margin for other compilers and C libraries, is sufficient
/// for all calls of an FMU.
#[test]
fn no_fmu_needs_more_stack_than_documented() {
    const MARGIN: usize = 8;
    let documented = documented_stack();
    for path in tests::paths() {
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8");
        let size =
            documented.get(name).unwrap_or_else(|| panic!("docs/robustness.md does not state the stack of {name}"));
        exercise(Command::new(STACK).args(["--within", &(size + MARGIN).to_string()]).arg(&path));
    }
}

/// Shows that the test above can fail: a stack that is too small ends the process.
#[test]
fn too_small_a_stack_is_noticed() {
    let path = tests::folder().join("AllWheelSteering.fmu");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut small = Command::new(STACK);
    small.args(["--within", "16", "--below", "12"]).arg(path).env("TMPDIR", folder.path());
    let output = small.output().expect("the program runs");
    assert!(!output.status.success(), "4 kB of stack were enough");
}
