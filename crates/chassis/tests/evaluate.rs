//! `chassis bench evaluate` as a user calls it: output, messages, exit codes.

use serde_json::Value;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn reference(name: &str) -> PathBuf {
    workspace().join("tests/references/assessment").join(name)
}

fn evaluate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_chassis"))
        .args(["bench", "evaluate"])
        .args(arguments)
        .env("NO_COLOR", "1")
        .env("CHASSIS_PYTHON", "")
        .env("COLUMNS", "200")
        .output()
        .unwrap()
}

/// A message without the line breaks that a narrow terminal needs.
fn message(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    text.split([' ', '\n', '│']).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The standard output, which must be one JSON document.
#[track_caller]
fn document(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", message(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A folder with a recording.
fn recording(text: &str) -> (TempDir, String) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("run.csv");
    std::fs::write(&path, text).unwrap();
    (folder, path.to_str().unwrap().to_owned())
}

/// Expected: `tests/references/assessment`, computed by an independent implementation.
#[test]
fn metrics_are_printed_as_one_document() {
    let path = reference("step_steer.csv.gz");
    let output = evaluate(&["step_steer", path.to_str().unwrap()]);
    let found = document(&output);
    assert!(output.stderr.is_empty());
    assert_eq!(found["t0"], 1.051);
    assert_eq!(found["yaw_rate"]["overshoot"], 0.092_686_772_5);

    let mut text = String::new();
    flate2::read::GzDecoder::new(&*std::fs::read(path).unwrap()).read_to_string(&mut text).unwrap();
    let (_folder, plain) = recording(&text);
    assert_eq!(evaluate(&["step_steer", &plain]).stdout, output.stdout);
    // A file from a spreadsheet has a byte order mark and Windows line ends.
    let (_folder, windows) = recording(&format!("\u{feff}{}", text.replace('\n', "\r\n")));
    assert_eq!(evaluate(&["step_steer", &windows]).stdout, output.stdout);
}

/// All options in the reference data are accepted, including options that describe the recording.
#[test]
fn every_evaluator_reads_its_recording() {
    let text = std::fs::read_to_string(reference("evaluators.json")).unwrap();
    let entries: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    for (name, entry) in &entries {
        let path = reference(&format!("{name}.csv.gz"));
        let options = entry["options"].to_string();
        let evaluator = entry["evaluator"].as_str().unwrap();
        let found = document(&evaluate(&[evaluator, path.to_str().unwrap(), "--options", &options]));
        // `closed_form` is additional theory, not a metric.
        let expected = entry["expected"].as_object().unwrap().iter().filter(|(metric, _)| *metric != "closed_form");
        for (metric, expected) in expected {
            let found = found.get(metric).unwrap_or_else(|| panic!("{name}: {metric} is missing"));
            assert_eq!(found.is_null(), expected.is_null(), "{name}: {metric}");
            assert_eq!(found.is_object(), expected.is_object(), "{name}: {metric}");
        }
    }
}

/// A recording as a logger writes it: other names, units, decimal commas, text next to numbers. The metrics are equal
/// to those of the reference, whose numbers have nine digits.
#[test]
fn a_file_of_a_logger_gives_the_same_metrics() {
    let path = reference("step_steer.csv.gz");
    let mut text = String::new();
    flate2::read::GzDecoder::new(&*std::fs::read(&path).unwrap()).read_to_string(&mut text).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let at = header.split(',').position(|name| name == "vehicle.yaw_rate").unwrap();
    let header = header.replace("time", "Zeit").replace("vehicle.yaw_rate", "Gier [°/s]").replace(',', ";") + ";Marker";
    let rows = rows.lines().map(|row| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        if let Ok(rate) = cells[at].parse::<f64>() {
            cells[at] = rate.to_degrees().to_string();
        }
        cells.join(";").replace('.', ",") + ";x"
    });
    let german = std::iter::once(header).chain(rows).collect::<Vec<_>>().join("\r\n");
    let (folder, file) = recording(&german);
    let vehicle = folder.path().join("logger.toml");
    std::fs::write(
        &vehicle,
        "[signals]\ntime = \"Zeit\"\n\"vehicle.yaw_rate\" = \"Gier\"\n\"body.roll\" = { unit = \"rad\" }\n",
    )
    .unwrap();
    let output = evaluate(&["step_steer", &file, "--vehicle", vehicle.to_str().unwrap()]);
    let (found, expected) = (document(&output), document(&evaluate(&["step_steer", path.to_str().unwrap()])));
    for metric in ["gain", "overshoot", "response_time"] {
        let number = |of: &Value| of["yaw_rate"][metric].as_f64().unwrap();
        let (found, expected) = (number(&found), number(&expected));
        assert!((found - expected).abs() <= 1e-8 * expected.abs(), "{metric}: {found}, not {expected}");
    }
    let message = message(&output);
    assert!(message.contains("note: the column `Gier` is converted to rad/s (factor 0.017453293)"), "{message}");
}

/// Every tenth row is missing. The metrics are those of the reference nevertheless, because the response is smooth.
#[test]
fn rows_that_are_lost_are_interpolated_by_option() {
    let path = reference("step_steer.csv.gz");
    let mut text = String::new();
    flate2::read::GzDecoder::new(&*std::fs::read(&path).unwrap()).read_to_string(&mut text).unwrap();
    let kept: Vec<&str> =
        text.lines().enumerate().filter(|(row, _)| *row < 2 || row % 10 != 5).map(|(_, line)| line).collect();
    let (_folder, file) = recording(&kept.join("\n"));
    let output = evaluate(&["step_steer", &file]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(message(&output).matches("the rows have a gap").count(), 1);
    let output = evaluate(&["step_steer", &file, "--resample"]);
    let (found, expected) = (document(&output), document(&evaluate(&["step_steer", path.to_str().unwrap()])));
    let number = |of: &Value| of["yaw_rate"]["gain"].as_f64().unwrap();
    assert!((number(&found) / number(&expected) - 1.0).abs() < 1e-4, "{} {}", number(&found), number(&expected));
    let message = message(&output);
    assert_eq!(message.matches("note: the rows are interpolated every").count(), 1, "{message}");
}

/// A name in the vehicle file that no evaluator reads is reported, never ignored.
#[test]
fn names_of_signals_in_a_vehicle_file_are_checked() {
    let (folder, path) = recording("time,driver.steer\n");
    let vehicle = folder.path().join("logger.toml");
    for (signals, code, expected) in [
        ("\"vehicle.yaw_ratee\" = { unit = \"deg/s\" }", 1, "did you mean `vehicle.yaw_rate`?"),
        ("\"tire_load.*\" = { unit = \"kN\" }", 1, "has a pattern, `tire_load.*`: name each signal"),
        ("\"suspension.travel.fl\" = \"x\"", 0, "`suspension.travel.fl`, which no evaluator reads"),
        ("\"vehicle.yaw_rate\" = {}", 1, "has neither `variable` nor `unit`"),
    ] {
        std::fs::write(&vehicle, format!("[signals]\n{signals}\n")).unwrap();
        let output = evaluate(&["step_steer", &path, "--vehicle", vehicle.to_str().unwrap()]);
        let said = message(&output).replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn what_cannot_be_computed_is_null_with_a_reason() {
    let (_folder, path) = recording("time,driver.steer\n");
    let output = evaluate(&["step_steer", &path]);
    let found = document(&output);
    assert_eq!(found["t0"], Value::Null);
    assert_eq!(found["yaw_rate"]["gain"], Value::Null);
    let message = message(&output);
    // One line for each cause, with the number of metrics; the last line reports that there are no metrics.
    let all = "note: 22 metrics, from t0 to tb_factor, are null: the recording has no rows";
    assert_eq!(message.matches("the recording has no rows").count(), 1, "{message}");
    assert!(message.contains(all) && message.contains("warning: no metric has a value"), "{message}");
}

#[test]
fn mistakes_name_the_place_and_what_to_do() {
    let (_folder, path) = recording("time,driver.steer\n0,0\n0.1,fast\n");
    let (_other, unnamed) = recording("driver.steer;a\n0;0\n");
    let (_gap, gap) = recording("time,driver.steer\n0,0\n0.01,0\n0.02,0\n0.1,0\n");
    for (arguments, code, expected) in [
        (&["step_steer", &path][..], 2, "run.csv:3: `fast` at line 3, column `driver.steer`, is not a number"),
        (&["step_steer", &unnamed], 2, "the file has no column `time`, but `driver.steer`, `a`"),
        (&["step_steer", "missing.csv"], 2, "missing.csv: the file cannot be read"),
        (&["step_steer", &gap], 2, "the rows have a gap from 0.02 s to 0.1 s"),
        (&["step_steer", &path, "--options", "{"], 1, "--options: EOF while parsing"),
    ] {
        let output = evaluate(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert!(output.stdout.is_empty());
        let message = message(&output);
        assert!(message.contains(expected), "{message}");
    }
    let (_folder, path) = recording("time,driver.steer\n");
    for (options, expected) in [
        ("{}", "--options: `sine_with_dwell` needs the option `steer.ratio`"),
        ("{\"steer.ratio\": -16}", "must be a positive number, got -16"),
        ("{\"ratio\": 16}", "`sine_with_dwell` has no option `ratio`"),
        ("[]", "the options must be an object"),
    ] {
        let output = evaluate(&["sine_with_dwell", &path, "--options", options]);
        assert_eq!(output.status.code(), Some(1), "{options}");
        assert!(output.stdout.is_empty());
        let message = message(&output);
        assert!(message.contains(expected), "{message}");
        assert!(message.contains("chassis bench evaluate sine_with_dwell --list"), "{message}");
    }
}

#[test]
fn wrong_usage_ends_with_2() {
    for arguments in [&["step_stear", "run.csv"][..], &["step_steer"], &[]] {
        let output = evaluate(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty());
    }
}

/// The page of the guide contains what `--list` prints, which comes from the tables of the evaluators.
#[test]
fn the_guide_has_the_reference_of_all_evaluators() {
    let output = evaluate(&["--list"]);
    assert_eq!(output.status.code(), Some(0));
    let printed = String::from_utf8(output.stdout).unwrap();
    let page = std::fs::read_to_string(workspace().join("docs/guide/src/assess.md")).unwrap();
    assert!(
        page.ends_with(&printed),
        "docs/guide/src/assess.md has to end with what `chassis bench evaluate --list` prints"
    );
    let one = String::from_utf8(evaluate(&["cones", "--list"]).stdout).unwrap();
    assert!(one.starts_with("### `cones`") && printed.contains(&one));
}
