//! Convergence of the main scenario with the communication step.

use fmu_system::converge::{assess, levels};
use fmu_system::fmus::Fmus;
use fmu_system::master::execute;
use fmu_system::resolve::{FmuFolder, Options, resolve};
use serde_json::Value;

/// The case `coordination` on the first road, with this step in s.
fn report(step: f64, has_sample_times: bool) -> (Value, String) {
    let file = tests::workspace().join("scenarios/rescue_vehicle_step_steer.toml");
    let options = Options { seeds: Some(1), ..Options::default() };
    let mut plan = resolve(&file, &FmuFolder::new([tests::folder()]), &options).expect("the scenario is valid");
    plan.runs.retain(|run| run.case == "coordination");
    plan.simulation.step = step;
    plan.simulation.steps = (plan.simulation.stop / step).round() as u64;
    let fmus = Fmus::load(&plan.runs).expect("the FMUs can be loaded");
    let levels = levels(&plan, &fmus, has_sample_times).expect("sample times can be changed");
    let recordings: Vec<_> = levels
        .iter()
        .map(|(simulation, runs)| vec![Some(execute(simulation, &runs[0], &fmus).expect("the run ends"))])
        .collect();
    if !has_sample_times {
        let of = |level: usize, every: usize| {
            let columns = recordings[level][0].iter().flat_map(|recording| recording.columns.iter().flatten());
            columns.map(|column| column.iter().step_by(every).map(|x| x.to_bits()).collect()).collect::<Vec<Vec<_>>>()
        };
        assert_eq!(of(0, 1) == of(1, 1) && of(0, 1) == of(2, 4), step == 0.001, "the same bits on the common rows");
    }
    let report = assess(&plan, &fmus, &recordings, 0.01).expect("the metrics have numbers").remove(0);
    (serde_json::to_value(&report).expect("numbers and texts"), report.text())
}

/// Compares members of JSON with a reference.
#[track_caller]
fn assert_near(name: &str, found: &Value, expected: &Value, members: &[(&str, &str)], tolerance: f64) {
    for (member, of_reference) in members {
        let (found, expected) = (&found[member], &expected[of_reference]);
        let is_near = match (found.as_f64(), expected.as_f64()) {
            (Some(found), Some(expected)) => (found - expected).abs() <= tolerance * expected.abs(),
            _ => found == expected,
        };
        assert!(is_near, "{name}, {member}: {found}, expected {expected}");
    }
}

/// Values to 1e-9, and orders and errors, which come from differences of close values, to 1e-6.
#[track_caller]
fn assert_assessed(name: &str, found: &Value, expected: &Value) {
    for level in 0..3 {
        let [value, reference] = [&found["values"], &expected["common_rows"]].map(|values| values[level].as_f64());
        let (value, reference) = (value.expect("a number"), reference.expect("a number"));
        assert!((value - reference).abs() <= 1e-9 * reference, "{name}, {level}: {value}, expected {reference}");
    }
    let same = ["class", "order", "limit", "error", "relative"].map(|member| (member, member));
    assert_near(name, found, expected, &same, 1e-6);
}

/// References (`references/rescue_vehicle/converge.json`): columns of an earlier version of this master, which an
/// independent loop over FMPy reproduces, and metrics that were recomputed in another language.
#[test]
fn the_error_of_the_main_scenario_is_known() {
    let file = tests::workspace().join("tests/references/rescue_vehicle/converge.json");
    let text = std::fs::read_to_string(file).expect("the reference can be read");
    let reference: Value = serde_json::from_str(&text).expect("the reference is JSON");
    for (step, key) in [(0.001, "step_0.001"), (0.004, "step_0.004")] {
        let (report, text) = report(step, false);
        let metrics = report["metrics"].as_array().expect("a list");
        assert_eq!(metrics.len(), 5);
        for metric in metrics {
            let name = metric["metric"].as_str().expect("a name");
            let expected = &reference[name][key];
            assert_assessed(name, metric, expected);
            let changes = [("recording", "recording"), ("order_change", "jacobi_change")];
            assert_near(name, metric, expected, &changes, 1e-6);
            let signal = name.strip_suffix("_rms").expect("the metrics are of one kind");
            let is_signal =
                |column: &&Value| ["body", "vehicle"].iter().any(|part| column[0] == format!("{part}.{signal}"));
            let found = report["signals"].as_array().and_then(|signals| signals.iter().find(is_signal));
            let same = ["d12", "d24", "order", "error", "relative"].map(|member| (member, member));
            assert_near(name, &found.expect("recorded")[1], &expected["signal"], &same, 1e-6);
        }
        let roll = &metrics[1];
        assert_eq!(roll["metric"], "roll_acceleration_rms");
        let (recommended, parts) = if step == 0.001 {
            let fixed = "`plant`: the exchange is fixed by the sample times of `driver`, `mixer`, `road`, `steering`: a \
                         smaller step changes nothing";
            assert_eq!(report["notes"], serde_json::json!([fixed]));
            (None, ["roll_acceleration_rms does not depend on the step", "roll_acceleration_rms 4.81 %"])
        } else {
            let several = "`coordination`, `driver`, `integrated`, `mixer`, `road`, `roll`, `steering` take several samples \
                           per step with the same inputs; the result differs for h below their sample_time, 0.001 s";
            assert_eq!(report["notes"], serde_json::json!([several]));
            (Some(0.0005), ["roll_acceleration_rms changes by 12.6 % as the step goes to 0 (order 1.24)", "0.0005 s"])
        };
        assert_eq!(roll["recommended_step"].as_f64(), recommended);
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    }
    for metric in report(0.001, true).0["metrics"].as_array().expect("a list") {
        let name = metric["metric"].as_str().expect("a name");
        assert_assessed(name, &metric["sample_times"], &reference[name]["controllers_sample_time_0.001"]);
    }
}
