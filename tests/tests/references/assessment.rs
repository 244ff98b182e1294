//! Evaluators of the test bench, with recorded signals whose metrics an independent implementation has computed.

use super::table::Table;
use fmu_assess::{Trace, evaluators};
use serde_json::{Map, Value};

/// Relative tolerance of an expected number; for an expected 0, [`ZERO`] is the absolute tolerance.
const TOLERANCE: f64 = 1e-6;
const ZERO: f64 = 1e-9;
/// Tolerance for closed loops, whose expected numbers come from an integration with smaller steps.
const LOOP: f64 = 1e-3;

/// Tolerance for a mirrored recording, which differs only by rounding.
const MIRRORED: f64 = 1e-12;

/// Entry with theoretical values, which are not compared; see `references/README.md`.
const THEORY: &str = "closed_form";

fn expected() -> Map<String, Value> {
    let path = tests::workspace().join("tests/references/assessment/evaluators.json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).expect("it is an object of JSON")
}

/// Computes the metrics of a file with the evaluator and options of its entry.
fn evaluate(name: &str, entry: &Value) -> Value {
    let table = Table::read(&format!("assessment/{name}"));
    let signals = table.names.iter().filter(|column| *column != "time");
    let trace = signals.fold(Trace::new(table.column("time")), |trace, column| {
        trace.with(column.clone(), table.column(column)).expect("columns are of the same length")
    });
    let evaluator = evaluators::find(entry["evaluator"].as_str().expect("a name")).expect("there is such an evaluator");
    let evaluation = evaluator.evaluate(&trace, &entry["options"]).unwrap_or_else(|error| panic!("{name}: {error}"));
    serde_json::from_str(&evaluation.to_json()).expect("it is JSON")
}

/// Compares all expected numbers; returns the largest deviation, as a fraction of the tolerance.
fn compare(place: &str, expected: &Value, found: &Value, tolerance: f64) -> f64 {
    match (expected, found) {
        (Value::Object(expected), Value::Object(_)) => {
            let members = expected.iter().filter(|(name, _)| *name != THEORY);
            members
                .map(|(name, value)| compare(&format!("{place}.{name}"), value, &found[name], tolerance))
                .fold(0.0, f64::max)
        }
        (Value::Array(expected), Value::Array(values)) => {
            assert_eq!(expected.len(), values.len(), "{place}");
            let pairs = expected.iter().zip(values);
            pairs.map(|(expected, value)| compare(place, expected, value, tolerance)).fold(0.0, f64::max)
        }
        (Value::Number(number), Value::Number(value)) => {
            let (number, value) = (number.as_f64().expect("a double"), value.as_f64().expect("a double"));
            let limit = if number == 0.0 { ZERO } else { tolerance * number.abs() };
            let usage = (value - number).abs() / limit;
            assert!(usage <= 1.0, "{place}: {value} instead of {number}, {usage} times the tolerance");
            usage
        }
        _ => {
            assert_eq!(found, expected, "{place}");
            0.0
        }
    }
}

#[test]
fn evaluators_find_the_expected_metrics() {
    let entries = expected();
    assert_eq!(entries.len(), 12);
    for (name, entry) in &entries {
        let tolerance = if name.starts_with("loop_") { LOOP } else { TOLERANCE };
        let found = evaluate(name, entry);
        let usage = compare(name, &entry["expected"], &found, tolerance);
        println!("{name}: {:.1e} of the tolerance", usage);
    }
}

/// The sections of the coned track follow the standard, unless the options of the evaluator contain them.
#[test]
fn sections_may_be_given() {
    let entries = expected();
    let mut entry = entries["cones"].clone();
    let found = evaluate("cones", &entry);
    entry["options"]["lanes"] = entry["lanes"].clone();
    assert_eq!(evaluate("cones", &entry), found);
    // The same track for a vehicle 1 m further to the left.
    for lane in entry["options"]["lanes"].as_array_mut().expect("a list") {
        for edge in [2, 3] {
            lane[edge] = (lane[edge].as_f64().expect("a number") - 1.0).into();
        }
    }
    let moved = evaluate("cones", &entry);
    assert_eq!(moved["passed"], Value::Bool(false));
    assert_eq!(moved["first_hit"][1], 1.0);
}

/// A mirrored recording has the same metrics, except that the direction changes its sign.
#[test]
fn a_mirrored_recording_has_the_same_metrics() {
    let entries = expected();
    let is_mirrored = |column: &str| {
        let lateral = [
            "steer",
            "yaw",
            "yaw_rate",
            "lateral_acceleration",
            "sideslip",
            "position_y",
            "roll",
            "load_transfer_ratio",
        ];
        lateral.iter().any(|name| column.ends_with(&format!(".{name}"))) || column == "path.lateral_deviation"
    };
    for name in ["slowly_increasing_steer", "step_steer", "swd_stable", "swd_unstable", "cones", "frequency_response"] {
        let entry = &entries[name];
        let table = Table::read(&format!("assessment/{name}"));
        let trace = table.names.iter().filter(|column| *column != "time").fold(
            Trace::new(table.column("time")),
            |trace, column| {
                let sign = if is_mirrored(column) { -1.0 } else { 1.0 };
                let values: Vec<f64> = table.column(column).iter().map(|value| sign * value).collect();
                trace.with(column.clone(), values).expect("columns are of the same length")
            },
        );
        let mut options = entry["options"].clone();
        if name == "cones" {
            options["path.mirror"] = 1.into();
        }
        let evaluator = evaluators::find(entry["evaluator"].as_str().expect("a name")).expect("an evaluator");
        let evaluation = evaluator.evaluate(&trace, &options).expect("the options are allowed");
        let mut found: Value = serde_json::from_str(&evaluation.to_json()).expect("it is JSON");
        if let Some(direction) = found.get("direction").and_then(Value::as_f64) {
            found["direction"] = (-direction).into();
        }
        compare(name, &entry["expected"], &found, TOLERANCE);
        compare(name, &evaluate(name, entry), &found, MIRRORED);
    }
}

/// Wherever a run ends, the evaluator does not panic, and it lists all metrics.
#[test]
fn a_recording_may_end_anywhere() {
    for (name, entry) in &expected() {
        let table = Table::read(&format!("assessment/{name}"));
        let evaluator = evaluators::find(entry["evaluator"].as_str().expect("a name")).expect("an evaluator");
        let columns: Vec<(String, Vec<f64>)> =
            table.names.iter().map(|column| (column.clone(), table.column(column))).collect();
        let times = table.column("time");
        let whole = times.len();
        for rows in (0..whole).step_by(whole / 40).chain([1, 2, 3, whole - 1]) {
            let signals = columns.iter().filter(|(column, _)| column != "time");
            let trace = signals.fold(Trace::new(&times[..rows]), |trace, (column, values)| {
                trace.with(column.as_str(), &values[..rows]).expect("columns are of the same length")
            });
            let evaluation = evaluator.evaluate(&trace, &entry["options"]).expect("the options are allowed");
            assert!(evaluation.metrics.len() >= evaluator.metrics.len(), "{name}, {rows} rows");
        }
    }
}
