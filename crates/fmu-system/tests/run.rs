//! Runs, complete and failed, with FMUs built from C in a temporary folder.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_import::description::Value;
use fmu_import::loader::Status;
use fmu_system::batch::{Batch, Change, Sample};
use fmu_system::fmus::Fmus;
use fmu_system::master::{self, Recording};
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use fmu_system::results;
use fmu_system::run::Order;
use std::path::Path;
use support::Build;
use tempfile::TempDir;

/// Two integrators in a ring, x' = y and y' = -x: a harmonic oscillator.
const RING: &str = r#"
title = "Ring"
[simulation]
stop = 1.0
step = 0.01
[[component]]
name = "position"
fmu = "Position"
parameters = { start = 1.0 }
[[component]]
name = "velocity"
fmu = "Velocity"
parameters = { gain = -1.0, label = "v" }
[[case]]
name = "free"
title = "Free"
[[case]]
name = "stiff"
title = "Stiff"
parameters.velocity = { gain = -4.0 }
[[case]]
name = "inverted"
title = "Inverted"
parameters.velocity = { gain = 1.0, inverted = true }
[[case]]
name = "alone"
title = "Alone"
without = ["velocity"]
inputs.position = { y = 2.0 }
[record]
signals = ["x", "y", "velocity:count", "velocity:moved"]
"#;

fn ring() -> TempDir {
    let folder = TempDir::new().unwrap();
    Build::new("Position", "y", "x").pack(folder.path());
    Build::new("Velocity", "x", "y").pack(folder.path());
    folder
}

fn plan(folder: &TempDir, text: &str, options: &Options) -> Plan {
    let source = FmuFolder::new([folder.path()]);
    resolve_text(Path::new("ring.toml"), text, &source, options).unwrap()
}

fn run(plan: &Plan, fmus: &Fmus, id: &str) -> Recording {
    let run = plan.runs.iter().find(|r| r.id == id).unwrap();
    master::execute(&plan.simulation, run, fmus).unwrap()
}

/// The recurrence of the ring in Rust: (x, y) after each step.
fn oscillator(gain: f64, order: Order) -> Vec<(f64, f64)> {
    let (mut x, mut y) = (1.0_f64, 0.0_f64);
    let mut rows = vec![(x, y)];
    for _ in 0..100 {
        let before = x;
        x += 0.01 * (1.0 * y);
        let seen = if order == Order::Jacobi { before } else { x };
        y += 0.01 * (gain * seen);
        rows.push((x, y));
    }
    rows
}

/// Bit-identical: the operations and their order are the same.
#[test]
fn a_closed_loop_follows_the_order_of_the_components() {
    let folder = ring();
    for order in [Order::Sequential, Order::Jacobi] {
        let options = Options { order: Some(order), ..Options::default() };
        let plan = plan(&folder, RING, &options);
        let fmus = Fmus::load(&plan.runs).unwrap();
        for (case, gain) in [("free", -1.0), ("stiff", -4.0), ("inverted", -1.0)] {
            let recording = run(&plan, &fmus, case);
            let rows: Vec<_> = recording.columns[0]
                .as_ref()
                .unwrap()
                .iter()
                .copied()
                .zip(recording.columns[1].as_ref().unwrap().iter().copied())
                .collect();
            assert_eq!(rows, oscillator(gain, order), "{case} {order:?}");
        }
    }
}

#[test]
fn columns_times_and_absent_components() {
    let folder = ring();
    let every = RING.replace("[record]\n", "[record]\nevery = 30\n");
    let plan = plan(&folder, &every, &Options::default());
    let names: Vec<_> = plan.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["x", "y", "count", "moved"]);
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = run(&plan, &fmus, "free");
    assert_eq!(recording.time, [0.0, 30.0 * 0.01, 60.0 * 0.01, 90.0 * 0.01]);
    assert_eq!(recording.column(2), Some(&[0.0, 30.0, 60.0, 90.0][..]));
    assert_eq!(recording.column(3), Some(&[0.0, 1.0, 1.0, 1.0][..]));
    let recording = run(&plan, &fmus, "alone");
    assert_eq!(recording.column(1), None);
    // x = 1 + 2t is summed in steps of 0.02, with at most 90 roundings of half an ulp of 3.
    let end = recording.column(0).unwrap()[3];
    assert!((end - 2.8).abs() < 90.0 * f64::EPSILON * 2.0, "{end}");
}

#[test]
fn input_series_jump_at_equal_times() {
    let folder = ring();
    let file = folder.path().join("in.csv");
    // 0.30 is the time of step 30, up to rounding. Rounding has no effect, because a step gets the value at its middle.
    std::fs::write(&file, "time,y\n-1,1\n0.3,1\n0.3,0\n0.5,0\n0.5,2\n1,2\n").unwrap();
    let options = Options { inputs: Some(file), ..Options::default() };
    let text = RING.replace("signals = [\"x\", \"y\", \"velocity:count\", \"velocity:moved\"]", "signals = [\"x\"]");
    let plan = plan(&folder, &text, &options);
    assert_eq!(plan.runs[0].components.len(), 1, "the velocity is dropped");
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = run(&plan, &fmus, "free");
    let mut x = 1.0;
    let mut expected = vec![x];
    for k in 0..100 {
        x += 0.01
            * (if k < 30 {
                1.0
            } else if k < 50 {
                0.0
            } else {
                2.0
            });
        expected.push(x);
    }
    assert_eq!(recording.column(0).unwrap(), expected);
}

/// The reference is the straight line y = t; each step gets the value at its middle.
#[test]
fn a_replaced_signal_is_recorded_as_the_wire_has_it() {
    let folder = ring();
    let file = folder.path().join("in.csv");
    let options = Options { inputs: Some(file.clone()), ..Options::default() };
    let middle = |k: u32| (f64::from(k) - 0.5) * 0.01;
    let text = RING.replace("\"velocity:count\", \"velocity:moved\"", "");
    // The column names the output, the output of one component, or the only input that reads it.
    for column in ["y", "velocity:y", "position:y"] {
        std::fs::write(&file, format!("time,{column}\n0,0\n1,1\n")).unwrap();
        let plan = plan(&folder, &text, &options);
        assert_eq!(plan.columns.iter().map(|column| column.from_file).collect::<Vec<_>>(), [false, true], "{column}");
        let names: Vec<&str> = plan.runs[0].components.iter().map(|component| component.name.as_str()).collect();
        assert_eq!(names, ["position"], "{column}");
        let recording = run(&plan, &Fmus::load(&plan.runs).unwrap(), "free");
        let (x, y) = (recording.column(0).unwrap(), recording.column(1).unwrap());
        assert_eq!(y[0], 0.0);
        for k in 1..=100 {
            assert!((y[k as usize] - middle(k)).abs() < 1e-15, "{column}, row {k}: {}", y[k as usize]);
        }
        // The sum over the midpoint values is the integral of the line.
        assert!((x[100] - 1.5).abs() < 1e-14, "{}", x[100]);
    }
}

/// The reference is the same line. No component has the output.
#[test]
fn an_input_from_a_file_is_recorded_without_any_component() {
    let folder = ring();
    let file = folder.path().join("in.csv");
    std::fs::write(&file, "time,y\n0,0\n1,1\n").unwrap();
    let options = Options { inputs: Some(file), ..Options::default() };
    let (position, _) = RING.split_once("[[component]]\nname = \"velocity\"").unwrap();
    let scenario = |signals: &str| {
        let metric = "[[metric]]\nname = \"last\"\ntitle = \"Last\"\nsignal = \"y\"\nkind = \"final\"\n";
        format!("{position}[[case]]\nname = \"free\"\ntitle = \"Free\"\n[record]\nsignals = [{signals}]\n{metric}")
    };
    for signals in ["\"x\", \"y\"", "\"x\", \"position:y\""] {
        let plan = plan(&folder, &scenario(signals), &options);
        assert_eq!(plan.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>(), ["x", "y"]);
        assert!(plan.columns[1].from_file);
        let recording = run(&plan, &Fmus::load(&plan.runs).unwrap(), "free");
        assert!((recording.column(1).unwrap()[100] - 0.995).abs() < 1e-15);
    }
    // A constant is not recorded.
    let constant = scenario("\"x\", \"y\"").replacen("{ start = 1.0 }", "{ start = 1.0 }\ninputs = { y = 1.0 }", 1);
    let source = FmuFolder::new([folder.path()]);
    let error = resolve_text(Path::new("ring.toml"), &constant, &source, &Options::default()).unwrap_err();
    let ResolveError::Problems(problems) = error else { panic!("{error}") };
    assert!(problems.problems[0].to_string().contains("`y` is an input, not an output"), "{problems:?}");
}

#[test]
fn parameters_can_be_changed_between_runs() {
    let folder = ring();
    let plan = plan(&folder, RING, &Options::default());
    let fmus = Fmus::load(&plan.runs).unwrap();
    let mut changed = plan.runs[0].clone();
    let mut set = |name, value| changed.set_parameter(&fmus, "velocity", name, value);
    set("gain", Value::Real(-4.0)).unwrap();
    let error = set("gian", Value::Real(1.0)).unwrap_err().to_string();
    assert_eq!(error, "`velocity`: Velocity has no parameter `gian`");
    let error = set("gain", Value::Real(11.0)).unwrap_err().to_string();
    assert!(error.ends_with("`gain` is 11.0, expected at most 10"), "{error}");
    let recording = master::execute(&plan.simulation, &changed, &fmus).unwrap();
    assert_eq!(recording.columns, run(&plan, &fmus, "stiff").columns);
}

/// The reference is the scenario's cases, which set the same values as the samples.
#[test]
fn samples_are_what_the_scenario_would_say() {
    let folder = ring();
    let text = RING.replace("title = \"Stiff\"", "title = \"Stiff\"\nbaseline = \"free\"");
    let metrics = "[[metric]]\nname = \"y\"\ntitle = \"y\"\nsignal = \"y\"\nkind = \"final\"\n\
                   [[metric]]\nname = \"change\"\ntitle = \"change\"\nsignal = \"y\"\nkind = \"final\"\nfrom_baseline = true\n\
                   [[metric]]\nname = \"half\"\ntitle = \"half\"\nvalue = \"y / 2\"\n";
    let plan = plan(&folder, &(text + metrics), &Options::default());
    let fmus = Fmus::load(&plan.runs).unwrap();
    let last = |id: &str| *run(&plan, &fmus, id).columns[1].as_ref().unwrap().last().unwrap();
    let index = |id: &str| plan.runs.iter().position(|run| run.id == id).unwrap();
    let batch = Batch::new(plan.clone(), fmus.clone());
    let change = |component: &str, variable: &str, value| Change {
        component: component.to_owned(),
        variable: variable.to_owned(),
        value: Value::Real(value),
    };
    let execute = |changes: Vec<Change>, id: &str| {
        let rows = batch.execute_here(7, &Sample { changes, runs: vec![index(id)] });
        assert_eq!((rows.len(), rows[0].sample, rows[0].run), (1, 7, index(id)));
        rows.into_iter().next().unwrap()
    };
    let stiff = execute(Vec::new(), "stiff");
    let (y, free) = (last("stiff"), last("free"));
    assert_eq!(stiff.result, Ok(vec![Some(y), Some(y - free), Some(y / 2.0)]));
    // A changed parameter in the case `free`. This case has no baseline, so its change from the baseline is undefined.
    let row = execute(vec![change("velocity", "gain", -4.0)], "free");
    assert_eq!(row.result, Ok(vec![Some(y), None, Some(y / 2.0)]));
    // The change also applies to the baseline's run.
    let row = execute(vec![change("velocity", "gain", -1.0)], "stiff");
    assert_eq!(row.result, Ok(vec![Some(free), Some(0.0), Some(free / 2.0)]));
    // A changed constant input: x = 1 + 2 y after a second. A change to a component that the case omits is ignored.
    let row = execute(vec![change("position", "y", 4.0), change("velocity", "gain", 3.0)], "alone");
    assert_eq!(row.result, Ok(vec![None, None, None]));
    let changed = batch.changed(index("alone"), &[change("position", "y", 4.0)]).unwrap();
    assert_eq!(changed.components[0].constants[0].value, Value::Real(4.0));

    for (wrong, expected) in [
        (change("position", "y", 1.0), "`position`: the input `y` cannot be set: another signal writes it"),
        (change("velocity", "gian", 1.0), "`velocity`: Velocity has no parameter `gian`"),
        (change("velocity", "gain", 11.0), "`velocity`: `gain` is 11.0, expected at most 10"),
    ] {
        let failure = execute(vec![wrong], "free").result.expect_err(expected);
        assert!(failure.status() == "rejected" && failure.message.starts_with(expected), "{failure}");
    }
}

#[test]
fn a_signal_that_is_not_finite_is_a_row_without_numbers() {
    let folder = ring();
    let metric = "[[metric]]\nname = \"y\"\ntitle = \"y\"\nsignal = \"y\"\nkind = \"final\"\n";
    // A gain of 10 on 1e307 overflows in the first step.
    let plan = plan(&folder, &format!("{RING}{metric}"), &Options::default());
    let batch = Batch::new(plan.clone(), Fmus::load(&plan.runs).unwrap());
    let change = |component: &str, variable: &str, value| Change {
        component: component.to_owned(),
        variable: variable.to_owned(),
        value: Value::Real(value),
    };
    let changes = vec![change("position", "start", f64::MAX), change("velocity", "gain", 10.0)];
    let rows = batch.execute_here(0, &Sample { changes, runs: vec![0] });
    let failure = rows[0].result.as_ref().unwrap_err();
    assert!(failure.status() == "diverged" && failure.time.is_some_and(|time| time > 0.0), "{failure}");
    assert!(failure.message.starts_with("`y` is "), "{failure}");
    assert!(failure.component.is_some() && failure.variable.as_deref() == Some("y"), "{failure:?}");
}

#[test]
fn a_failing_component_stops_the_run_and_says_why() {
    let folder = ring();
    for (failure, status) in
        [(1, "fmi2Error"), (2, "fmi2Fatal"), (3, "fmi2Discard"), (5, "fmi2Pending"), (7, "the unknown status 7")]
    {
        let text = RING.replace("start = 1.0", &format!("start = 1.0, failure = {failure}"));
        let plan = plan(&folder, &text, &Options::default());
        let fmus = Fmus::load(&plan.runs).unwrap();
        let error = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap_err().to_string();
        let (first, logged) = error.split_once('\n').unwrap();
        let expected = format!("run free, step from 0.5 s: `position`: fmi2DoStep returned {status}");
        assert_eq!(logged, "  fmi2Error: x left 90% of its range");
        // Only a discarded step can be made in shorter ones.
        let help = first.strip_prefix(&expected).unwrap();
        assert!(
            if failure == 3 { help.starts_with("; choose a smaller `step`; ") } else { help.is_empty() },
            "{error}"
        );
    }
}

#[test]
fn warnings_are_kept() {
    let folder = ring();
    let text = RING.replace("start = 1.0", "start = 1.0, failure = 9");
    let plan = plan(&folder, &text, &Options::default());
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = run(&plan, &fmus, "free");
    // The first warning is that of the start: the FMU sets its output to `start` when the initialization ends.
    let (component, message) = &recording.messages[1];
    assert_eq!((component.as_str(), message.text.as_str()), ("position", "100% done"));
    assert_eq!(message.status, Status::Warning);
}

#[test]
fn a_changed_fmu_is_noticed() {
    let folder = ring();
    let mut plan = plan(&folder, RING, &Options::default());
    plan.runs[0].components[0].guid = "{older}".to_string();
    let error = Fmus::load(&plan.runs).unwrap_err().to_string();
    assert!(error.contains("changed since the plan was made"), "{error}");
}

#[test]
fn a_run_becomes_a_file() {
    let folder = ring();
    let plan = plan(&folder, RING, &Options::default());
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = run(&plan, &fmus, "alone");
    let path = folder.path().join("results").join(results::file_name(&plan.runs[3]));
    let names: Vec<_> = plan.columns.iter().map(|column| column.name.clone()).collect();
    results::write_csv(&path, &names, &recording).unwrap();
    let text = std::fs::read_to_string(folder.path().join("results/alone.csv")).unwrap();
    assert!(text.starts_with("time,x\n0.0,1.0\n0.01,1.02\n"), "{text}");
    assert_eq!(text.lines().count(), 102);
}
