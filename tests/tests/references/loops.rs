//! Closed loops of PathDriver and a vehicle, through the master, against an independent implementation of both.

use super::table::Table;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use std::fmt::Write as _;
use std::path::Path;

/// Share of each column's peak. The reference takes the plant's outputs after initialization for the first sample of the driver,
/// whose speed a plant with prescribed speed has one step later here; and its vehicles are integrated more finely.
const TOLERANCE: f64 = 1e-4;

struct Loop {
    file: &'static str,
    plant: &'static str,
    /// Parameters of the driver and of the plant, as TOML.
    driver: &'static str,
    parameters: &'static str,
    has_pedals: bool,
}

/// The scenario of a loop: driver, brakes and drive if there are pedals, plant.
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
        // No row at the start: what a row says of the driver was held during the step before it.
        let found = &recording.column(index).unwrap()[1..];
        assert_eq!(found.len(), expected.len(), "{name}");
        let difference = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if difference > TOLERANCE * peak {
            worst.push(format!("{name}: {difference:e} of {peak:e}"));
        }
    }
    assert!(worst.is_empty(), "{}: {}", case.file, worst.join(", "));
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
    });
}
