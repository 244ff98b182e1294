//! Compares closed loops of PathDriver and a vehicle, executed by the master, with an independent implementation of
//! both.

use super::table::Table;
use fmu_assess::{Evaluation, Trace, Value, evaluators};
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use std::fmt::Write as _;
use std::path::Path;

/// Tolerance, as a share of each column's peak. In the reference, the first sample of the driver uses the plant's
/// outputs after initialization, so a plant with a prescribed speed gets this speed one step earlier than in these
/// runs. The vehicles of the reference are also integrated with smaller steps.
const TOLERANCE: f64 = 1e-4;

/// Relative tolerance for metrics, because the reference integrates its vehicles with smaller steps.
const METRIC: f64 = 1e-3;
const MARGIN: f64 = 2e-3;

struct Loop {
    file: &'static str,
    plant: &'static str,
    /// Parameters of the driver and of the plant, as TOML.
    driver: &'static str,
    parameters: &'static str,
    has_pedals: bool,
    /// Steering-wheel angle divided by front-wheel angle.
    ratio: f64,
}

/// The scenario of a loop: the driver, the brakes and the drive if the plant needs them, and the plant.
fn scenario(case: &Loop, columns: &[String], stop: f64) -> String {
    let plant = fmu_import::archive::read_description(&tests::folder().join(format!("{}.fmu", case.plant))).unwrap();
    let inputs: Vec<&str> = (plant.variables.iter())
        .filter(|variable| variable.causality == fmu_import::description::Causality::Input)
        .map(|variable| variable.name.as_str())
        .collect();
    let mut text = format!("title = \"Loop\"\n[simulation]\nstop = {stop:?}\nstep = 0.001\n");
    let _ =
        writeln!(text, "[[component]]\nname = \"driver\"\nfmu = \"PathDriver\"\nparameters = {{ {} }}", case.driver);
    if case.has_pedals {
        text.push_str("[[component]]\nname = \"actuators\"\nfmu = \"BrakeAndDriveActuators\"\n");
    }
    let constants: Vec<String> = ["suspension_force", "road_height", "road_friction", "steer.middle", "steer.rear"]
        .iter()
        .filter(|group| inputs.iter().any(|name| name.starts_with(*group)))
        .map(|group| {
            let name = if group.starts_with("steer") { (*group).to_owned() } else { format!("{group}.*") };
            format!("\"{name}\" = {}", if *group == "road_friction" { "1.0" } else { "0.0" })
        })
        .collect();
    let _ = writeln!(
        text,
        "[[component]]\nname = \"plant\"\nfmu = \"{}\"\nparameters = {{ {} }}\ninputs = {{ {} }}",
        case.plant,
        case.parameters,
        constants.join(", ")
    );
    text.push_str("[[connection]]\nfrom = \"driver:driver.steer\"\nto = \"plant:steer.front\"\n");
    if case.has_pedals {
        for place in ["fl", "fr", "rl", "rr"] {
            let to = format!("actuators:brake_pressure_command.{place}");
            let _ = writeln!(text, "[[connection]]\nfrom = \"actuators:brake.master_pressure\"\nto = \"{to}\"");
        }
    }
    let signals: Vec<String> = columns
        .iter()
        .map(|name| {
            let component = if name.starts_with("driver.") || name.starts_with("path.") { "driver" } else { "plant" };
            format!("\"{component}:{name}\"")
        })
        .collect();
    let _ = writeln!(text, "[[case]]\nname = \"loop\"\ntitle = \"Loop\"\n[record]\nsignals = [{}]", signals.join(", "));
    text
}

/// Compares the metrics of a run with those of the reference.
fn compare_metrics(file: &str, recording: &master::Recording, names: &[&str], ratio: f64) {
    let path = tests::workspace().join("tests/references/driving/loops.json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let entries: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    let entry = &entries[file.rsplit('/').next().expect("a name")];
    let columns: Vec<(&str, &[f64])> =
        names.iter().enumerate().map(|(index, name)| (*name, &recording.column(index).unwrap()[1..])).collect();
    let mut trace = Trace::new(&recording.time[1..]);
    for (name, values) in &columns {
        trace = trace.with(*name, *values).unwrap();
    }
    let steer = columns.iter().find(|(name, _)| *name == "driver.steer").expect("it is recorded").1;
    let trace =
        trace.with("driver.steering_wheel", steer.iter().map(|steer| ratio * steer).collect::<Vec<_>>()).unwrap();
    let evaluator = evaluators::find(entry["evaluator"].as_str().expect("a name")).expect("an evaluator");
    // In this loop, the track is mirrored.
    let mut options = entry["options"].clone();
    if file.ends_with("rescue_vehicle_iso3888_1") {
        options["path.mirror"] = 1.into();
    }
    let found = evaluator.evaluate(&trace, &options).expect("the options are allowed");
    for (name, expected) in entry["expected"].as_object().expect("an object") {
        let found = found.value(name).unwrap_or_else(|| panic!("there is no metric {name}"));
        let near = |found: f64, expected: f64, limit: f64| {
            assert!((found - expected).abs() <= limit, "{file}: {name} is {found} instead of {expected}");
        };
        match (expected, found) {
            (serde_json::Value::Number(number), Value::Number(found)) => {
                let expected = number.as_f64().expect("a number");
                near(*found, expected, METRIC * expected.abs());
            }
            (serde_json::Value::Bool(expected), Value::Boolean(found)) => assert_eq!(found, expected, "{file}: {name}"),
            (serde_json::Value::Null, Value::Null(_)) => (),
            (serde_json::Value::Array(expected), Value::Numbers(found)) => {
                assert_eq!(found.len(), expected.len(), "{file}: {name}");
                for (found, expected) in found.iter().zip(expected) {
                    let expected = expected.as_f64().expect("a number");
                    let limit = if name == "margins" { MARGIN } else { METRIC * expected.abs() };
                    near(found.expect("a number"), expected, limit);
                }
            }
            (expected, found) => panic!("{file}: {name} is {found:?} instead of {expected}"),
        }
    }
}

fn compare(case: &Loop) {
    let table = Table::read(case.file);
    let columns: Vec<String> = table.names[1..].to_vec();
    let times = table.column("time");
    let stop = times[times.len() - 1];
    let text = scenario(case, &columns, stop);
    let plan = resolve_text(Path::new("loop.toml"), &text, &FmuFolder::new([tests::folder()]), &Options::default())
        .unwrap_or_else(|error| panic!("{error:?}\n{text}"));
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    let mut worst = Vec::new();
    for name in &columns {
        let index = plan.columns.iter().position(|column| column.name == *name).expect("it is recorded");
        let expected = table.column(name);
        let peak = expected.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        // The reference has no row at the start. Each row contains the values of the driver that were held during the
        // preceding step.
        let found = &recording.column(index).unwrap()[1..];
        assert_eq!(found.len(), expected.len(), "{name}");
        let difference = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if difference > TOLERANCE * peak {
            worst.push(format!("{name}: {difference:e} of {peak:e}"));
        }
    }
    assert!(worst.is_empty(), "{}: {}", case.file, worst.join(", "));
    let names: Vec<&str> = plan.columns.iter().map(|column| column.name.as_str()).collect();
    compare_metrics(case.file, &recording, &names, case.ratio);
}

/// The margins of BicycleCar in ISO 3888-1 at 20 m/s on a road with friction 0.9. `step` is the communication step and
/// the driver's sample time, s.
fn margins(step: f64) -> Vec<f64> {
    let text = format!(
        r#"
title = "Margins"
[simulation]
stop = 13.0
step = {step:?}
[[component]]
name = "driver"
fmu = "PathDriver"
[component.parameters]
maneuver = 2
"path.vehicle_width" = 1.75
"geometry.wheelbase" = 2.7
"vehicle.understeer_gradient" = 0.003198653
"speed.initial" = 20.0
sample_time = {step:?}
[[component]]
name = "plant"
fmu = "BicycleCar"
parameters = {{ "tire.friction" = 0.9 }}
inputs = {{ "road_friction.fl" = 1.0 }}
[[connection]]
from = "driver:driver.steer"
to = "plant:steer.front"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["plant:vehicle.*"]
"#
    );
    let plan = resolve_text(Path::new("margins.toml"), &text, &FmuFolder::new([tests::folder()]), &Options::default())
        .unwrap_or_else(|error| panic!("{error:?}\n{text}"));
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    let trace = plan.columns.iter().enumerate().fold(Trace::new(&recording.time[1..]), |trace, (index, column)| {
        trace.with(column.name.clone(), &recording.column(index).unwrap()[1..]).unwrap()
    });
    let options = serde_json::json!({
        "maneuver": 2, "path.start": 50.0, "vehicle.width": 1.75, "footprint.front": 2.05, "footprint.rear": 2.35,
    });
    let found: Evaluation = evaluators::find("cones").unwrap().evaluate(&trace, &options).unwrap();
    let Some(Value::Numbers(margins)) = found.value("margins") else { panic!("{found:?}") };
    margins.iter().map(|margin| margin.expect("the car reaches all sections")).collect()
}

/// Reference: the limit of small steps. Delay and lag of the driver do not depend on the sample time, so the margins at
/// 1 and 2 ms agree within 2e-5 m, the tolerance in the specification.
#[test]
fn margins_do_not_depend_on_the_sample_time() {
    let (fine, coarse) = (margins(0.001), margins(0.002));
    assert_eq!((fine.len(), coarse.len()), (3, 3));
    for (fine, coarse) in fine.iter().zip(&coarse) {
        assert!((fine - coarse).abs() <= 2e-5, "{fine} {coarse}");
    }
    // The vehicle drives at the limit of the track.
    assert!(fine.iter().all(|margin| margin.abs() < 0.5), "{fine:?}");
}

#[test]
fn esp_car_through_iso3888_1() {
    compare(&Loop {
        file: "driving/loop_esp_car_iso3888_1",
        plant: "EspCar",
        driver: "maneuver = 2, \"path.vehicle_width\" = 1.61, \"geometry.wheelbase\" = 2.34, \
                 \"vehicle.understeer_gradient\" = 0.00187177302, \"steer.ratio\" = 16.0, \
                 \"speed.initial\" = 20.833333333333332, \"speed.control\" = true, \"path.start\" = 50.0, \
                 \"path.overlap\" = 6.0",
        parameters: "\"vehicle.initial_speed\" = 20.833333333333332",
        has_pedals: true,
        ratio: 16.0,
    });
}

#[test]
fn rescue_vehicle_through_iso3888_1_mirrored() {
    compare(&Loop {
        file: "driving/loop_rescue_vehicle_iso3888_1",
        plant: "RescueVehicle",
        driver: "maneuver = 2, \"path.vehicle_width\" = 2.8, \"geometry.wheelbase\" = 4.316, \
                 \"vehicle.understeer_gradient\" = 0.0, \"steer.ratio\" = 20.0, \
                 \"speed.initial\" = 11.11111111111111, \"speed.control\" = false, \"path.start\" = 50.0, \
                 \"path.overlap\" = 6.0, \"path.mirror\" = true",
        parameters: "",
        has_pedals: false,
        ratio: 20.0,
    });
}

#[test]
fn heavy_vehicle_in_a_lane_change() {
    compare(&Loop {
        file: "assessment/loop_heavy_vehicle_lane_change",
        plant: "HeavyVehicle",
        driver: "maneuver = 4, \"path.vehicle_width\" = 2.15, \"geometry.wheelbase\" = 5.39, \
                 \"vehicle.understeer_gradient\" = 0.011, \"steer.ratio\" = 20.0, \
                 \"speed.initial\" = 19.444444444444443, \"speed.control\" = false, \"path.start\" = 50.0, \
                 \"path.change_distance\" = 48.61111111111111, \"path.offset\" = 1.4637",
        parameters: "",
        has_pedals: false,
        ratio: 20.0,
    });
}
