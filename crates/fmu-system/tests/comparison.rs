//! Comparison of signals. Reference: `tests/references/comparison`, small signals with metrics computed by NumPy.

use fmu_system::comparison::{Comparison, Samples, Tube};
use serde_json::Value;
use std::path::Path;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// Tolerance 1e-9, as in the README of the reference; shifts are compared to 1e-9 s.
#[test]
fn all_metrics_of_the_reference_are_met() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/references/comparison/metrics.json");
    let cases: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    for (name, case) in cases.as_object().unwrap() {
        let [times, measured, simulated] = ["time", "measured", "simulated"].map(|key| numbers(&case[key]));
        let option = |key: &str, part: &str| case["options"][key][part].as_f64().unwrap_or(0.0);
        let has = |key: &str| !case["options"][key].is_null();
        let comparison = Comparison {
            window: None,
            tolerance: has("tolerance").then(|| ["absolute", "relative"].map(|part| option("tolerance", part))),
            tube: has("tube").then(|| Tube::Size(option("tube", "width"), option("tube", "height"))),
            max_shift: case["options"]["max_shift"].as_f64(),
        };
        let [simulated, measured] = [&simulated, &measured].map(|values| Samples { times: &times, values });
        let found = comparison.metrics(simulated, measured);
        let expected = case["expected"].as_object().unwrap();
        assert_eq!(found.len(), expected.len(), "{name}");
        for (metric, expected) in expected {
            match (found[metric.as_str()], expected.as_f64()) {
                (Some(found), Some(expected)) => {
                    let tolerance = 1e-9 * expected.abs().max(1.0);
                    assert!((found - expected).abs() <= tolerance, "{name}, {metric}: {found}, not {expected}");
                }
                (found, expected) => assert_eq!(found, expected, "{name}, {metric}"),
            }
        }
    }
}

/// The simulation is linear between its rows, and samples outside of it or of the window do not count. Closed form: the
/// simulation is t, the measurement t + 1.
#[test]
fn samples_are_those_in_the_window_and_the_simulation() {
    let (times, values): (Vec<f64>, Vec<f64>) = (0..11).map(|k| (f64::from(k), f64::from(k) + 1.0)).unzip();
    let (simulated, reference) =
        (Samples { times: &[0.5, 9.5], values: &[0.5, 9.5] }, Samples { times: &times, values: &values });
    for (window, count) in [(None, 9.0), (Some([2.0, 4.0]), 3.0), (Some([2.1, 20.0]), 7.0), (Some([3.0, 3.0]), 1.0)] {
        let metrics = Comparison { window, ..Comparison::default() }.metrics(simulated, reference);
        assert_eq!(metrics["samples"], Some(count));
        assert_eq!(metrics["bias"], (count > 1.0).then_some(-1.0));
    }
    let nothing = Samples { times: &[], values: &[] };
    assert_eq!(Comparison::default().metrics(nothing, reference)["samples"], Some(0.0));
}

/// csv-compare's size of a tube is relative to the extents of the reference. Closed form: a ramp from 0 to 10 over 10 s;
/// half width 1 s and half height 1, so the tube ends 2 above the ramp, and 1 at the end of the ramp.
#[test]
fn a_relative_tube_follows_the_extent() {
    let (times, values): (Vec<f64>, Vec<f64>) = (0..11).map(|k| (f64::from(k), f64::from(k))).unzip();
    let above: Vec<f64> = values.iter().map(|value| value + 1.5).collect();
    let (simulated, reference) =
        (Samples { times: &times, values: &above }, Samples { times: &times, values: &values });
    let metrics = Comparison { tube: Some(Tube::Relative(0.1)), ..Comparison::default() }.metrics(simulated, reference);
    assert_eq!(metrics["tube_share"], Some(10.0 / 11.0));
    assert_eq!(metrics["tube_exit"], Some(10.0));
    assert!((metrics["tube_excess"].unwrap() - 0.5).abs() < 1e-12);
}
