//! Runs advanced step by step, with FMUs built from C in a temporary folder. The tests of the master cover plain runs.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::run::Order;
use fmu_system::session::Session;
use std::path::Path;
use support::Build;
use tempfile::TempDir;

/// Two integrators in a ring, x' = y and y' = -x.
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
parameters = { gain = -1.0 }
[[case]]
name = "free"
title = "Free"
[record]
signals = ["x"]
"#;

fn ring(defects: &[&str]) -> TempDir {
    let folder = TempDir::new().unwrap();
    Build { defects, ..Build::new("Position", "y", "x") }.pack(folder.path());
    Build::new("Velocity", "x", "y").pack(folder.path());
    folder
}

fn plan(folder: &TempDir, options: &Options) -> Plan {
    resolve_text(Path::new("ring.toml"), RING, &FmuFolder::new([folder.path()]), options).unwrap()
}

fn new(plan: &Plan, fmus: &Fmus) -> Session {
    Session::new(&plan.simulation, &plan.runs[0], fmus).unwrap()
}

/// The column after each step until the stop time.
fn rest(session: &mut Session) -> Vec<f64> {
    let mut rows = Vec::new();
    while !session.is_over() {
        session.step().unwrap();
        rows.push(session.column(0).unwrap());
    }
    rows
}

/// The reference is the run without restoring.
#[test]
fn a_restored_session_repeats_its_steps_and_input_series() {
    let folder = ring(&[]);
    let file = folder.path().join("in.csv");
    std::fs::write(&file, "time,y\n0,1\n0.3,0\n0.5,2\n1,3\n").unwrap();
    for inputs in [None, Some(file)] {
        let plan = plan(&folder, &Options { inputs, ..Options::default() });
        let fmus = Fmus::load(&plan.runs).unwrap();
        let expected = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
        let expected = expected.column(0).unwrap();
        let mut session = new(&plan, &fmus);
        assert_eq!(session.column(0), Some(expected[0]));
        let start = session.save().unwrap();
        for _ in 0..40 {
            session.step().unwrap();
        }
        let later = session.save().unwrap();
        assert_eq!(rest(&mut session), expected[41..]);
        for (state, steps) in [(&start, 0), (&later, 40), (&start, 0)] {
            session.restore(state).unwrap();
            assert_eq!(session.steps(), steps);
            assert_eq!(rest(&mut session), expected[steps as usize + 1..]);
        }
        session.free(later).unwrap();
        assert!(new(&plan, &fmus).restore(&start).is_err(), "the state is of another session");
        // No warning but that of the start, where the FMU sets its output to `start`.
        let warnings = session.terminate().unwrap();
        assert!(warnings.iter().all(|(_, it)| it.text.contains("at the end of initialization")), "{warnings:?}");
    }
}

/// The reference is the recurrence with the value that is set. It has the same operations, so the results are
/// bit-identical.
#[test]
fn an_overwritten_input_replaces_its_connection_in_both_orders() {
    let folder = ring(&[]);
    for order in [Order::Sequential, Order::Jacobi] {
        let plan = plan(&folder, &Options { order: Some(order), ..Options::default() });
        let fmus = Fmus::load(&plan.runs).unwrap();
        let description = fmus.get(&plan.runs[0].components[0]).unwrap().description().clone();
        let mut session = new(&plan, &fmus);
        let wired = session.save().unwrap();
        let input = session.overwrite("position", description.variable("y").unwrap()).unwrap();
        session.set(input, 0.5);
        let mut x = 1.0;
        for row in rest(&mut session) {
            x += 0.01 * (1.0 * 0.5);
            assert_eq!(row, x);
        }
        // In the state saved before the overwriting, the connection applies.
        session.restore(&wired).unwrap();
        let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
        assert_eq!(rest(&mut session), recording.column(0).unwrap()[1..]);

        let mut rejected = |component, name| {
            let variable = description.variable(name).unwrap();
            session.overwrite(component, variable).unwrap_err().to_string()
        };
        assert_eq!(rejected("speed", "y"), "the run has no component `speed`");
        assert_eq!(rejected("position", "x"), "`position`: `x` is an output; only inputs can be overwritten");
    }
}

#[test]
fn an_fmu_that_cannot_save_its_state_is_an_error() {
    let folder = ring(&["NO_STATE"]);
    let plan = plan(&folder, &Options::default());
    let fmus = Fmus::load(&plan.runs).unwrap();
    let error = new(&plan, &fmus).save().unwrap_err().to_string();
    assert!(error.contains("position") && error.contains("fmi2GetFMUstate"), "{error}");
}
