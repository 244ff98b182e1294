//! Connections between Real and Boolean, on FMUs built from C in a temporary folder.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_system::export::System;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::{Connected, Plan, TypeChange};
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use fmu_system::run::Order;
use std::path::Path;
use support::Build;
use tempfile::TempDir;

/// A ramp x(t) = t reverses an integrator above 0.5; a second integrator integrates the flag of the first.
const SCENARIO: &str = r#"
title = "Conversion"
[simulation]
stop = 1.5
step = 0.25
[[component]]
name = "ramp"
fmu = "Ramp"
inputs = { one = 1.0 }
[[component]]
name = "reversed"
fmu = "Reversed"
inputs = { one = 1.0 }
[[component]]
name = "total"
fmu = "Total"
[[connection]]
from = "ramp:x"
to = "reversed:inverted"
[[connection]]
from = "reversed:moved"
to = "total:flag"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["reversed:y", "total:z"]
"#;

const WITHOUT_UNIT: (&str, &str) = ("<Real unit=\"m\"/>", "<Real/>");
const BOOLEAN_INPUT: (&str, &str) = (
    "name=\"inverted\" valueReference=\"0\" causality=\"parameter\" variability=\"fixed\"",
    "name=\"inverted\" valueReference=\"0\" causality=\"input\" variability=\"discrete\"",
);

fn fmus() -> TempDir {
    let folder = TempDir::new().unwrap();
    Build { edits: &[WITHOUT_UNIT], ..Build::new("Ramp", "one", "x") }.pack(folder.path());
    Build { edits: &[BOOLEAN_INPUT], ..Build::new("Reversed", "one", "y") }.pack(folder.path());
    Build::new("Total", "flag", "z").pack(folder.path());
    folder
}

fn plan_of(folder: &TempDir, text: &str, options: &Options) -> Result<Plan, ResolveError> {
    resolve_text(Path::new("conversion.toml"), text, &FmuFolder::new([folder.path()]), options)
}

/// The mistakes: message and help.
fn mistakes(folder: &TempDir, text: &str, options: &Options) -> Vec<(String, Option<String>)> {
    match plan_of(folder, text, options).unwrap_err() {
        ResolveError::Problems(problems) => {
            let help = |problem| miette::Diagnostic::help(problem).map(|help| help.to_string());
            problems.problems.iter().map(|problem| (problem.to_string(), help(problem))).collect()
        }
        other => panic!("{other}"),
    }
}

/// Closed form: steps and slopes are powers of two, so all sums are exact. At x = 0.5 the input is still off.
#[test]
fn an_explicit_connection_converts_in_both_directions() {
    let folder = fmus();
    let forward = [0.0, 0.25, 0.5, 0.25, 0.0, -0.25, -0.5];
    let total = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5];
    // In the order `jacobi`, each connection adds a delay of one step.
    let later = [0.0, 0.25, 0.5, 0.75, 0.5, 0.25, 0.0];
    let total_later = [0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25];
    for (order, y, z) in [(Order::Sequential, forward, total), (Order::Jacobi, later, total_later)] {
        let plan = plan_of(&folder, SCENARIO, &Options { order: Some(order), ..Options::default() }).unwrap();
        let recording = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
        assert_eq!(recording.column(0), Some(&y[..]), "{order:?}");
        assert_eq!(recording.column(1), Some(&z[..]), "{order:?}");
    }
}

#[test]
fn the_plan_lists_conversions() {
    let plan = plan_of(&fmus(), SCENARIO, &Options::default()).unwrap();
    let change = |component: &str, variable: &str| {
        let is_meant = |c: &&Connected| c.input.component == component && c.input.variable == variable;
        plan.wiring[0].inputs.iter().find(is_meant).unwrap().type_change
    };
    assert_eq!(change("reversed", "inverted"), Some(TypeChange::RealToBoolean));
    assert_eq!(change("total", "flag"), Some(TypeChange::BooleanToReal));
    assert_eq!(change("ramp", "one"), None);
}

/// A series for the output has values of the output's type, which the connection converts.
#[test]
fn input_series_are_converted_as_the_outputs_they_replace() {
    let folder = fmus();
    let file = folder.path().join("in.csv");
    let options = Options { inputs: Some(file.clone()), ..Options::default() };
    std::fs::write(&file, "time,ramp:x\n0,0.4\n0.5,0.6\n100,0.6\n").unwrap();
    let plan = plan_of(&folder, SCENARIO, &options).unwrap();
    let recording = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
    assert_eq!(recording.column(0), Some(&[0.0, 0.25, 0.5, 0.25, 0.0, -0.25, -0.5][..]));

    std::fs::write(&file, "time,reversed:inverted\n0,0.4\n100,1\n").unwrap();
    let message = plan_of(&folder, SCENARIO, &options).unwrap_err().to_string();
    let expected = "`reversed:inverted` has the value 0.4 at 0 s, but the input `inverted` of `reversed` is Boolean";
    assert!(message.contains(expected), "{message}");
    std::fs::write(&file, "time,reversed:moved\n0,0.4\n100,1\n").unwrap();
    let message = plan_of(&folder, SCENARIO, &options).unwrap_err().to_string();
    let expected = "`reversed:moved` has the value 0.4 at 0 s, but the output `moved` of `reversed` is Boolean";
    assert!(message.contains(expected), "{message}");
}

#[test]
fn only_plain_numbers_convert() {
    let folder = fmus();
    for (from, to, expected) in [
        (
            "ramp:x",
            "total:z",
            "`total:z` is in m; only a Real without a unit converts to or from Boolean, but its target \
             `reversed:inverted` is Boolean",
        ),
        ("ramp:x", "ramp:count", "`ramp:count` is Integer, but its target `reversed:inverted` is Boolean"),
        ("reversed:moved", "reversed:count", "`reversed:count` is Integer, but its target `total:flag` is Real"),
    ] {
        let text = SCENARIO.replace(&format!("from = \"{from}\""), &format!("from = \"{to}\""));
        let [(message, _)] = &mistakes(&folder, &text, &Options::default())[..] else { panic!("{from} {to}") };
        assert_eq!(message, expected);
    }
}

#[test]
fn factors_are_for_reals() {
    let folder = fmus();
    let text = SCENARIO.replace("to = \"total:flag\"", "to = \"total:flag\"\nfactor = 2.0");
    let [(message, None)] = &mistakes(&folder, &text, &Options::default())[..] else { panic!("another problem") };
    let expected = "`reversed:moved` is Boolean, but its target `total:flag` is Real; `factor` and `offset` are for \
                    connections of Reals";
    assert_eq!(message, expected);
}

#[test]
fn wiring_by_name_does_not_convert() {
    let folder = fmus();
    Build { edits: &[WITHOUT_UNIT], ..Build::new("Ramp", "one", "inverted_by") }.pack(folder.path());
    let edits = [BOOLEAN_INPUT, ("name=\"inverted\"", "name=\"inverted_by\"")];
    Build { edits: &edits, ..Build::new("Reversed", "one", "y") }.pack(folder.path());
    let text = SCENARIO.replace("[[connection]]\nfrom = \"ramp:x\"\nto = \"reversed:inverted\"\n", "");
    assert_eq!(
        mistakes(&folder, &text, &Options::default()),
        [(
            "`ramp:inverted_by` is Real, but its target `reversed:inverted_by` is Boolean".to_string(),
            Some(
                "to convert the value, add a [[connection]] with from = \"ramp:inverted_by\" and to = \
                 \"reversed:inverted_by\""
                    .to_string()
            )
        )]
    );
}

#[test]
fn other_masters_do_not_get_a_conversion() {
    let folder = fmus();
    let plan = plan_of(&folder, SCENARIO, &Options::default()).unwrap();
    assert_eq!(
        System::new(&plan, &plan.runs[0]).unwrap_err().to_string(),
        "the connection from `ramp:x` (Real) to `reversed:inverted` (Boolean) converts the value, which neither SSP 1.0 nor \
         OSP structures can express; connect variables of the same type"
    );
    let other =
        SCENARIO.replace("from = \"ramp:x\"\nto = \"reversed:inverted\"", "from = \"ramp:x\"\nto = \"total:flag\"");
    let other = other.replace("[[connection]]\nfrom = \"reversed:moved\"\nto = \"total:flag\"\n", "");
    let other = other.replace(
        "inputs = { one = 1.0 }\n[[component]]\nname = \"total\"",
        "inputs = { one = 1.0, inverted = true }\n[[component]]\nname = \"total\"",
    );
    let plan = plan_of(&folder, &other, &Options::default()).unwrap();
    System::new(&plan, &plan.runs[0]).unwrap();
}
