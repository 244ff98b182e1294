//! Tests the steady states of the plants that `cargo fmu trim` finds: compares them with closed forms, computes them at
//! 50 operating points of each plant, and starts co-simulations in them, which must stay there.

use fmu_import::description::Causality;
use serde_json::Value;
use std::process::Command;
use std::sync::OnceLock;
use tests::{Fmu, cargo_fmu, folder, ok, reals};

/// Limit on the derivatives, relative to the nominal values, 1/s.
const RESIDUAL: f64 = 1e-10;
/// Limit on the distance from the steady state within [`TIME`], relative to the nominal value.
const DRIFT: f64 = 1e-8;
const TIME: f64 = 5.0;
const STEP: f64 = 0.01;

/// The output of the command, or its error message.
fn trimmed(name: &str, settings: &[(String, f64)], options: &[&str]) -> Result<Value, String> {
    static COMMAND: OnceLock<std::path::PathBuf> = OnceLock::new();
    let mut command = Command::new(COMMAND.get_or_init(cargo_fmu));
    command.args(["fmu", "trim", "--json"]).arg(folder().join(format!("{name}.fmu"))).args(options);
    for (name, value) in settings {
        command.arg("--set").arg(format!("{name}={value:?}"));
    }
    let output = command.output().expect("the command runs");
    if !output.status.success() {
        assert_eq!(output.status.code(), Some(1));
        // Removes line breaks and frames from the message.
        let text = String::from_utf8_lossy(&output.stderr);
        let words = text.split_whitespace().filter(|word| !["│", "×", "Error:"].contains(word));
        return Err(words.collect::<Vec<_>>().join(" "));
    }
    Ok(serde_json::from_slice(&output.stdout).expect("the command prints JSON"))
}

fn settings(values: &[(&str, f64)]) -> Vec<(String, f64)> {
    values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
}

/// Value of a state or free input.
fn value(steady: &Value, name: &str) -> f64 {
    let all = ["states", "inputs"].into_iter().flat_map(|list| steady[list].as_array().expect("a list"));
    let found = all.into_iter().find(|entry| entry["name"] == name);
    found.and_then(|entry| entry["value"].as_f64()).unwrap_or_else(|| panic!("`{name}` is not there: {steady}"))
}

fn names_of(steady: &Value, role: &str) -> Vec<String> {
    let states = steady["states"].as_array().expect("a list").iter();
    states
        .filter(|state| state["role"] == role)
        .map(|state| state["name"].as_str().expect("a name").to_owned())
        .collect()
}

/// Largest change in a state at rest, relative to its nominal value, in a co-simulation from the steady state.
fn drift(fmu: &Fmu, steady: &Value, parameters: &[(&str, f64)]) -> f64 {
    let mut instance = fmu.instance();
    ok(instance.setup_experiment(0.0, Some(TIME)));
    let starts = steady["starts"].as_object().expect("a table").iter();
    let starts = starts.map(|(name, value)| (name.as_str(), value.as_f64().expect("a Real")));
    for (name, value) in starts.chain(parameters.iter().copied()) {
        let variable = fmu.description.variable(name).expect("the FMU has it");
        ok(instance.set_real(&[variable.reference], &[value]));
    }
    ok(instance.enter_initialization_mode());
    ok(instance.exit_initialization_mode());
    let resting: Vec<_> = ["rests", "held"]
        .into_iter()
        .flat_map(|role| names_of(steady, role))
        .map(|name| fmu.description.variable(&name).expect("the FMU has it"))
        .collect();
    let references: Vec<_> = resting.iter().map(|variable| variable.reference).collect();
    let start: Vec<f64> = resting.iter().map(|variable| value(steady, &variable.name)).collect();
    let mut largest = 0.0_f64;
    let steps = (TIME / STEP).round() as usize;
    for step in 0..=steps {
        let now = reals(&mut instance, &references);
        for ((variable, start), now) in resting.iter().zip(&start).zip(now) {
            assert!(now.is_finite(), "{}: `{}`", fmu.name, variable.name);
            largest = largest.max((now - start).abs() / variable.nominal.unwrap_or(1.0).abs());
        }
        if step < steps {
            ok(instance.do_step(step as f64 * STEP, STEP));
        }
    }
    largest
}

/// Tests all combinations of 5 speeds, 5 steering angles and 2 friction coefficients. The residual is at most
/// [`RESIDUAL`]; at the points in `restless` (speed, angle, friction), there is a message that names a state instead. A
/// co-simulation from a stable point stays there.
fn fifty_points(
    name: &str,
    speeds: [f64; 5],
    angles: [f64; 5],
    parameters: &[(&str, f64)],
    restless: &[(f64, f64, f64)],
) {
    let fmu = Fmu::named(name);
    let frictions = fmu.with(Causality::Input).filter(|input| input.name.starts_with("road_friction."));
    let frictions: Vec<String> = frictions.map(|input| input.name.clone()).collect();
    assert!(!frictions.is_empty());
    let (mut residual, mut moved, mut stable, mut unstable) = (0.0_f64, 0.0_f64, 0, Vec::new());
    let mut failed = Vec::new();
    for speed in speeds {
        for angle in angles {
            for friction in [0.5, 1.0] {
                let mut given = settings(&[("driver.speed", speed), ("steer.front", angle)]);
                given.extend(frictions.iter().map(|input| (input.clone(), friction)));
                match trimmed(name, &given, &[]) {
                    Ok(steady) => {
                        residual = residual.max(steady["residual"].as_f64().expect("a number"));
                        if steady["growth"].as_f64().is_some_and(|growth| growth <= 0.0) {
                            stable += 1;
                            let distance = drift(&fmu, &steady, parameters);
                            assert!(distance < DRIFT, "{name} at {speed} m/s, {angle} rad, {friction}: {distance:e}");
                            moved = moved.max(distance);
                        } else {
                            unstable.push((speed, angle, friction));
                        }
                    }
                    Err(message) => {
                        let named = message.split('`').nth(1).unwrap_or_default();
                        let is_state = fmu.states().iter().any(|state| state.name == named);
                        let is_restless =
                            message.contains("cannot rest") || message.contains("outside the valid range of the model");
                        assert!(is_state && is_restless, "{message}");
                        failed.push((speed, angle, friction));
                    }
                }
            }
        }
    }
    println!(
        "{name}: residual {residual:e}, drift {moved:e} at {stable} stable points; not stable {unstable:?}; restless {failed:?}"
    );
    assert!(residual <= RESIDUAL, "{name}: {residual:e}");
    assert_eq!(failed, restless, "{name}");
}

/// Start value of a parameter.
fn parameter(fmu: &Fmu, name: &str) -> f64 {
    match fmu.description.variable(name).and_then(|variable| variable.start.clone()) {
        Some(fmu_import::description::Value::Real(value)) => value,
        other => panic!("`{name}`: {other:?}"),
    }
}

#[track_caller]
fn assert_close(found: f64, expected: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{found} {expected}");
}

/// Reference: closed forms in the car's README for yaw gain u/(L + K u^2), lateral acceleration and roll gradient.
#[test]
fn a_single_track_car_turns_as_in_closed_form() {
    let fmu = Fmu::named("BicycleCar");
    let of = |name: &str| parameter(&fmu, name);
    let (m, a, b) = (of("vehicle.mass"), of("geometry.cg_to_front_axle"), of("geometry.cg_to_rear_axle"));
    let (c_f, c_r) = (of("axle.cornering_stiffness.front"), of("axle.cornering_stiffness.rear"));
    let k = m * (b * c_r - a * c_f) / ((a + b) * c_f * c_r);
    let arm = of("body.mass") * of("geometry.body_cg_to_roll_axis");
    let roll_gradient = arm / (of("body.roll_stiffness") - arm * of("gravity"));
    for (u, delta) in [(5.0, 0.1), (22.0, -0.02), (40.0, 0.001)] {
        let steady = trimmed("BicycleCar", &settings(&[("driver.speed", u), ("steer.front", delta)]), &[]).unwrap();
        let r = u * delta / (a + b + k * u * u);
        assert_close(value(&steady, "vehicle.yaw_rate"), r, 1e-13);
        assert_close(value(&steady, "body.roll"), roll_gradient * u * r, 1e-13);
        assert_eq!(names_of(&steady, "drifts"), ["vehicle.yaw", "vehicle.position_x", "vehicle.position_y"]);
        assert_eq!(steady["undetermined"], serde_json::json!([]));
    }
}

/// Reference: statics. Equal forces F of all actuators lift the body by F/k, and a road that is higher by h lifts it by
/// h.
#[test]
fn forces_and_the_road_lift_the_body() {
    let fmu = Fmu::named("RescueVehicle");
    let inputs = |quantity: &str, value: f64| -> Vec<(String, f64)> {
        let of = fmu.with(Causality::Input).filter(|input| input.name.starts_with(quantity));
        of.map(|input| (input.name.clone(), value)).collect()
    };
    let given = [inputs("suspension_force.", 1200.0), inputs("road_height.", 0.03)].concat();
    assert_eq!(given.len(), 12);
    let steady = trimmed("RescueVehicle", &given, &[]).unwrap();
    assert_close(value(&steady, "body.heave"), 0.03 + 1200.0 / parameter(&fmu, "suspension.stiffness"), 1e-12);
    assert_close(value(&steady, "wheel_height.ml"), 0.03, 1e-12);
}

/// On a straight road without drag, the drive torques balance the brake torques, which act fully at this speed. If only
/// one axle is driven, each drive torque is twice as large.
#[test]
fn drive_torques_balance_the_brakes() {
    let wheels = ["fl", "fr", "rl", "rr"];
    let mut given = settings(&[("driver.speed", 25.0)]);
    given.extend(wheels.map(|wheel| (format!("brake_torque.{wheel}"), 80.0)));
    let steady = trimmed("EspCar", &given, &[]).unwrap();
    for wheel in wheels {
        assert_close(value(&steady, &format!("drive_torque.{wheel}")), 80.0, 1e-10);
        assert_close(value(&steady, &format!("wheel_speed.{wheel}")), 25.0 / 0.29, 1e-10);
    }
    assert_eq!(names_of(&steady, "held"), ["vehicle.speed"]);
    let steady = trimmed("EspCar", &given, &["--free", "drive_torque.rl, drive_torque.rr"]).unwrap();
    for wheel in ["rl", "rr"] {
        assert_close(value(&steady, &format!("drive_torque.{wheel}")), 160.0, 1e-10);
    }
}

/// Without friction, nothing determines the lateral velocity of a car with linear tires. The car cannot turn, because
/// its lateral velocity would grow without limit: v' = -u r.
#[test]
fn what_the_equations_leave_open_is_listed() {
    let given = settings(&[("road_friction.fl", 0.0), ("steer.front", 0.1)]);
    let steady = trimmed("BicycleCar", &given, &[]).unwrap();
    assert_eq!(steady["undetermined"], serde_json::json!(["vehicle.lateral_velocity"]));
    assert_eq!(value(&steady, "vehicle.lateral_velocity"), 0.0);
    assert_eq!(value(&steady, "vehicle.yaw_rate"), 0.0);
    // With a held yaw rate, the lateral velocity grows.
    let message =
        trimmed("BicycleCar", &settings(&[("vehicle.yaw_rate", 0.3), ("road_friction.fl", 0.0)]), &[]).unwrap_err();
    assert!(message.contains("`vehicle.lateral_velocity` cannot rest"), "{message}");
}

#[test]
fn a_state_that_cannot_rest_is_named() {
    let one_wheel = settings(&[("driver.speed", 20.0), ("drive_torque.rl", 0.0), ("brake_torque.rl", 100.0)]);
    let message = trimmed("EspCar", &one_wheel, &[]).unwrap_err();
    assert!(message.starts_with("EspCar: `vehicle.speed` cannot rest: "), "{message}");
    assert!(message.ends_with("It is held, and no input is free to keep it (--free)."), "{message}");
    let message = trimmed("Driver", &[], &[]).unwrap_err();
    assert!(message.contains("Driver has no steady state: it lists no continuous states"), "{message}");
    for (given, options, expected) in [
        (("driver.sped", 20.0), &[][..], "EspCar has no variable `driver.sped`"),
        (("tire_load.fl", 20.0), &[], "`tire_load.fl` must be a parameter, an input or a state"),
        (("steer.front", 0.0), &["--free", "steer.front"], "`steer.front` has a value by --set"),
        (("steer.front", 0.0), &["--free", "tire.friction"], "`tire.friction` must be an input"),
        (("vehicle.speed", 10.0), &["--set", "driver.speed=12"], "`vehicle.speed` is set twice"),
        (
            ("wheel.initial_slip.fl", 0.2),
            &[],
            "--set wheel.initial_slip.fl: the steady state determines this parameter",
        ),
    ] {
        let message = trimmed("EspCar", &settings(&[given]), options).unwrap_err();
        assert!(message.contains(expected), "{message}");
    }
}

/// A co-simulation that starts with the parameter set starts in the steady state. The linear model at the steady state
/// has the same stability.
#[test]
fn parameter_sets_and_linear_models_start_there() {
    let folder_of_file = tempfile::tempdir().expect("a folder");
    let file = folder_of_file.path().join("turn.ssv");
    let given = settings(&[("driver.speed", 20.0), ("steer.front", 0.05)]);
    let steady = trimmed("EspCar", &given, &["--out", file.to_str().expect("UTF-8")]).unwrap();
    let set = fmu_import::parameter_set::ParameterSet::read(&file).unwrap();
    let starts = steady["starts"].as_object().unwrap();
    assert_eq!(set.parameters.len(), starts.len());
    for parameter in &set.parameters {
        let fmu_import::description::Value::Real(value) = parameter.value else { panic!("{parameter:?}") };
        assert_eq!(starts[&parameter.name].as_f64(), Some(value), "{}", parameter.name);
    }
    for name in ["vehicle.initial_speed", "wheel.initial_slip.fl", "body.roll", "drive_torque.rr", "steer.front"] {
        assert!(starts.contains_key(name), "{name}");
    }
    let linear = |options: &[&str]| -> Value {
        let mut command = Command::new(cargo_fmu());
        command.args(["fmu", "linearize", "--json"]).arg(folder().join("EspCar.fmu"));
        command.args(["--set", "driver.speed=20", "--set", "steer.front=0.05"]).args(options);
        serde_json::from_slice(&tests::successful(&mut command).stdout).expect("JSON")
    };
    let drifting = 3;
    let poles = linear(&["--trim"])["poles"].as_array().unwrap().clone();
    let largest = poles.iter().map(|pole| pole[0].as_f64().unwrap());
    let largest = largest.filter(|real| real.abs() > 1e-8).fold(f64::NEG_INFINITY, f64::max);
    assert!(poles.len() > drifting);
    assert_close(largest, steady["growth"].as_f64().unwrap(), 1e-6);
}

#[test]
fn the_rescue_vehicle_rests_at_fifty_points() {
    fifty_points("RescueVehicle", [2.0, 8.0, 14.0, 20.0, 26.0], [0.0, 0.01, 0.03, 0.08, 0.2], &[], &[]);
}

#[test]
fn the_heavy_vehicle_rests_at_fifty_points() {
    fifty_points("HeavyVehicle", [2.0, 8.0, 14.0, 20.0, 26.0], [0.0, 0.01, 0.03, 0.08, 0.2], &[], &[]);
}

#[test]
fn the_half_car_rests_at_fifty_points() {
    // At these points, the only steady state is that of a car on its roof.
    let restless = [(20.0, 0.2, 1.0), (26.0, 0.2, 1.0)];
    fifty_points("HydroPneumaticHalfCar", [2.0, 8.0, 14.0, 20.0, 26.0], [0.0, 0.01, 0.03, 0.08, 0.2], &[], &restless);
}

/// Uses a step of 0.5 ms, which is accurate above 5 m/s (README of the car) and makes the test five times faster.
#[test]
fn the_car_rests_at_fifty_points() {
    let parameters = [("max_step", 5e-4)];
    fifty_points("EspCar", [6.0, 12.0, 18.0, 24.0, 30.0], [0.0, 0.01, 0.03, 0.08, 0.2], &parameters, &[]);
}

/// A car in a turn with a driver and a steering actuator, which starts at its declared state: straight ahead.
const SCENARIO: &str = r#"
title = "Turn"
description = "A turn that is held"
reference = "none"

[simulation]
stop = 5.0
step = 0.01

[[component]]
name = "plant"
fmu = "RescueVehicle"
start = "steady"
inputs = { "driver.speed" = { value = 50.0, unit = "km/h" }, "steer.front" = 0.02, "steer.middle" = 0.0, "steer.rear" = 0.0, "road_height.*" = 0.01, "road_friction.*" = 0.9, "suspension_force.*" = 0.0 }

[[case]]
name = "heavy"
title = "Heavy"
parameters.plant = { "vehicle.mass" = 40000.0 }

[[case]]
name = "usual"
title = "As declared"

[record]
signals = ["body.roll", "body.heave", "vehicle.yaw_rate", "vehicle.yaw"]
"#;

fn plan(text: &str) -> fmu_system::plan::Plan {
    use fmu_system::resolve::{FmuFolder, Options, resolve_text};
    let options = Options::default();
    resolve_text(std::path::Path::new("turn.toml"), text, &FmuFolder::new([folder()]), &options)
        .unwrap_or_else(|error| panic!("{error:?}"))
}

/// Each case starts in its own steady state, and so does a run with a changed value. Reference: `cargo fmu trim` for
/// the plant alone.
#[test]
fn scenarios_start_steady() {
    use fmu_import::description::Value;
    let plan = plan(SCENARIO);
    let fmus = fmu_system::fmus::Fmus::load(&plan.runs).unwrap();
    let names: Vec<&str> = plan.columns.iter().map(|column| column.name.as_str()).collect();
    let of = |name: &str| names.iter().position(|column| *column == name).expect("it is recorded");
    let mut rolls = Vec::new();
    for (run, mass) in [(0, None), (1, None), (0, Some(39_000.0))] {
        let mut run = plan.runs[run].clone();
        assert!(run.needs_steady_starts());
        run.find_steady_starts(&plan.simulation, &fmus).unwrap();
        assert!(!run.needs_steady_starts());
        if let Some(mass) = mass {
            run.set_parameter(&fmus, "plant", "vehicle.mass", Value::Real(mass)).unwrap();
            assert!(run.needs_steady_starts(), "the state of another mass is another one");
        }
        let recording = fmu_system::master::execute(&plan.simulation, &run, &fmus).unwrap();
        let column = |name: &str| recording.column(of(name)).expect("it is recorded").to_vec();
        let roll = column("body.roll");
        for (name, nominal) in [("body.roll", 0.05), ("body.heave", 0.05), ("vehicle.yaw_rate", 0.5)] {
            let values = column(name);
            assert!(values[0].abs() > 1e-3, "{name}: {}", values[0]);
            let distance = values.iter().map(|value| (value - values[0]).abs()).fold(0.0, f64::max);
            assert!(distance < DRIFT * nominal, "{name}: {distance:e}");
        }
        let yaw = column("vehicle.yaw");
        assert_eq!(yaw[0], 0.0);
        let turned = column("vehicle.yaw_rate")[0] * TIME;
        assert_close(*yaw.last().unwrap(), turned, 1e-9);
        rolls.push(roll[0]);
    }
    let mut given = settings(&[("driver.speed", 50.0 / 3.6)]);
    let fmu = Fmu::named("RescueVehicle");
    for (quantity, value) in [("steer.front", 0.02), ("road_height.", 0.01), ("road_friction.", 0.9)] {
        let inputs = fmu.with(Causality::Input).filter(|input| input.name.starts_with(quantity));
        given.extend(inputs.map(|input| (input.name.clone(), value)));
    }
    assert_close(rolls[1], value(&trimmed("RescueVehicle", &given, &[]).unwrap(), "body.roll"), 1e-13);
    given.push(("vehicle.mass".to_owned(), 39_000.0));
    assert_close(rolls[2], value(&trimmed("RescueVehicle", &given, &[]).unwrap(), "body.roll"), 1e-13);
    assert!(rolls[0] > rolls[2] && rolls[2] > rolls[1], "a heavier vehicle rolls more: {rolls:?}");
}

/// The plant starts with the first outputs of the other components: the speed from a driver, and the angle from an
/// actuator in its declared state.
#[test]
fn a_plant_starts_with_what_the_others_write_first() {
    let driver = r#"
[[component]]
name = "driver"
fmu = "Driver"
parameters = { "speed.initial" = 12.0 }

[[case]]
name = "heavy""#;
    let text = SCENARIO.replacen("\n[[case]]\nname = \"heavy\"", driver, 1);
    let text = text.replace("\"driver.speed\" = { value = 50.0, unit = \"km/h\" }, ", "");
    let plan = plan(&text);
    let mut run = plan.runs[1].clone();
    let fmus = fmu_system::fmus::Fmus::load(&plan.runs).unwrap();
    run.find_steady_starts(&plan.simulation, &fmus).unwrap();
    let steady = run.components[0].steady.clone().expect("it starts steady");
    let roll = steady.iter().find(|setting| setting.name == "body.roll").expect("a state");
    let mut given = settings(&[("driver.speed", 12.0)]);
    let fmu = Fmu::named("RescueVehicle");
    for (quantity, value) in [("steer.front", 0.02), ("road_height.", 0.01), ("road_friction.", 0.9)] {
        let inputs = fmu.with(Causality::Input).filter(|input| input.name.starts_with(quantity));
        given.extend(inputs.map(|input| (input.name.clone(), value)));
    }
    let expected = value(&trimmed("RescueVehicle", &given, &[]).unwrap(), "body.roll");
    assert_eq!(roll.value, fmu_import::description::Value::Real(expected));
}

/// A car without drive torques slows down in a turn; the message names run, component and state. `start = "steady"` for
/// a component without states is an error.
#[test]
fn scenarios_that_cannot_start_steady_have_a_message() {
    let constants = "\"steer.front\" = 0.05, \"road_height.*\" = 0.0, \"road_friction.*\" = 1.0, \"suspension_force.*\" = 0.0, \
                     \"brake_torque.*\" = 0.0, \"drive_torque.*\" = 0.0";
    let (before, rest) = SCENARIO.split_once("fmu = \"RescueVehicle\"").unwrap();
    let (_, after) = rest.split_once("}, \"steer.front\"").unwrap();
    let (_, after) = after.split_once("}\n").unwrap();
    let car = format!("{before}fmu = \"EspCar\"\nstart = \"steady\"\ninputs = {{ {constants} }}\n{after}");
    let car = car.replace("parameters.plant = { \"vehicle.mass\" = 40000.0 }", "");
    let plan = plan(&car);
    let fmus = fmu_system::fmus::Fmus::load(&plan.runs).unwrap();
    let error = fmu_system::master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap_err().to_string();
    let expected = "run heavy: `plant` cannot start in a steady state: EspCar: `vehicle.speed` cannot rest: ";
    assert!(error.starts_with(expected), "{error}");
    let driver = SCENARIO.replace("start = \"steady\"", "").replacen(
        "\n[[case]]",
        "\n[[component]]\nname = \"driver\"\nfmu = \"Driver\"\nstart = \"steady\"\n[[case]]",
        1,
    );
    let options = fmu_system::resolve::Options::default();
    let source = fmu_system::resolve::FmuFolder::new([folder()]);
    let resolve = |text: &str| fmu_system::resolve::resolve_text("turn.toml".as_ref(), text, &source, &options);
    let Err(fmu_system::resolve::ResolveError::Problems(problems)) = resolve(&driver) else { panic!("no problem") };
    let lines: Vec<String> = problems.problems.iter().map(fmu_system::problem::Problem::explained).collect();
    assert!(lines.join("\n").contains("Driver has no steady state: it lists no directional derivatives"), "{lines:?}");
    let unknown = SCENARIO.replace("\"steady\"", "\"resting\"");
    let Err(fmu_system::resolve::ResolveError::Problems(problems)) = resolve(&unknown) else { panic!("no problem") };
    let lines: Vec<String> = problems.problems.iter().map(fmu_system::problem::Problem::explained).collect();
    assert!(lines.join("\n").contains("unknown word `resting`, expected `declared` or `steady`"), "{lines:?}");
    // Straight ahead, the car rolls steadily.
    let straight = car.replace("\"steer.front\" = 0.05", "\"steer.front\" = 0.0");
    let plan = self::plan(&straight);
    let fmus = fmu_system::fmus::Fmus::load(&plan.runs).unwrap();
    fmu_system::master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
}

/// The speed of a car at a standstill is set by a parameter that must not be negative; rounding errors of the speed
/// must not violate this limit.
#[test]
fn roundings_do_not_leave_the_range_of_a_variable() {
    for steer in [0.0, 0.1] {
        let steady = trimmed("EspCar", &settings(&[("driver.speed", 0.0), ("steer.front", steer)]), &[]);
        let steady = steady.unwrap_or_else(|message| panic!("{message}"));
        assert!(value(&steady, "vehicle.speed").abs() < 1e-9, "{steady}");
        assert!(steady["starts"]["vehicle.initial_speed"].as_f64().expect("a number") >= 0.0, "{steady}");
    }
}

/// At this point, the equations of the half car would be steady with the car on its roof, for which they are not valid.
#[test]
fn a_state_that_the_model_is_not_for_is_no_steady_state() {
    let message = trimmed("HydroPneumaticHalfCar", &settings(&[("driver.speed", 30.0), ("steer.front", 0.3)]), &[]);
    let message = message.expect_err("it has rolled over");
    let expected = "`body.roll` can only rest at 2.944 rad, outside the valid range of the model";
    assert!(message.contains(expected), "{message}");
    assert!(message.contains("Choose another operating point"), "{message}");
}
