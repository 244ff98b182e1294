//! Runs against reference data: an independent implementation of the same equations made it (`references/`, README).

use host::c_api::Reference;
use host::loader::Instance;
use std::collections::HashMap;
use tests::reference::{Table, worst};
use tests::{Fmu, ok, real, reals};

/// Step of all files in s.
const STEP: f64 = 0.001;

/// What one row of a file does with an FMU.
#[derive(Clone, Copy, Debug)]
enum Call {
    /// Set the inputs that the bus knows.
    Set(&'static str),
    /// Read the outputs onto the bus.
    Read(&'static str),
    /// Step over one row.
    Step(&'static str),
}
use Call::{Read, Set, Step};

/// A comparison.
struct Case {
    file: &'static str,
    /// Columns that are inputs; `*` at the end stands for anything.
    inputs: &'static [&'static str],
    /// Columns that are not compared.
    ignored: &'static [&'static str],
    /// Columns whose signal has another name; only these are compared if there are any.
    renamed: &'static [(&'static str, &'static str)],
    parameters: &'static [(&'static str, &'static str, f64)],
    program: &'static [Call],
    /// Largest |error| over largest |value| of a column.
    tolerance: f64,
}

const NOTHING: Case =
    Case { file: "", inputs: &[], ignored: &[], renamed: &[], parameters: &[], program: &[], tolerance: 0.0 };

const PLANT: Case = Case {
    inputs: &["driver.speed", "steer.*", "suspension_force.*", "road_height.*"],
    program: &[Set("RescueVehicle"), Read("RescueVehicle"), Step("RescueVehicle")],
    // The reference integrates with 16 substeps of RK4 per row, the FMU with 4: 3e-10 in smooth runs; 8 digits printed.
    tolerance: 1e-6,
    ..NOTHING
};

const FEEDBACK: &[&str] = &["body.*", "wheel_*", "vehicle.*"];

const LOOP: Case = Case {
    inputs: &["driver.*", "road_height.*"],
    program: &[
        Set("RescueVehicle"),
        Read("RescueVehicle"),
        Set("FuzzyCoordination"),
        Step("FuzzyCoordination"),
        Read("FuzzyCoordination"),
        Set("DualSlidingModeSteering"),
        Step("DualSlidingModeSteering"),
        Read("DualSlidingModeSteering"),
        Set("IntegratedLqrSuspension"),
        Step("IntegratedLqrSuspension"),
        Read("IntegratedLqrSuspension"),
        Set("RollLqrSuspension"),
        Step("RollLqrSuspension"),
        Read("RollLqrSuspension"),
        Set("SuspensionMixer"),
        Step("SuspensionMixer"),
        Read("SuspensionMixer"),
        Set("RescueVehicle"),
        Read("RescueVehicle"),
        Step("RescueVehicle"),
    ],
    // The inputs have 8 digits, and feedback amplifies their rounding.
    tolerance: 1e-5,
    ..NOTHING
};

const STEERING: Case = Case {
    inputs: &["driver.steer", "vehicle.*", "weight.steering"],
    program: &[Set("DualSlidingModeSteering"), Step("DualSlidingModeSteering"), Read("DualSlidingModeSteering")],
    // Printed with 8 digits.
    tolerance: 1e-6,
    ..NOTHING
};

const COORDINATION: Case = Case {
    inputs: &["driver.steer", "vehicle.speed"],
    program: &[Set("FuzzyCoordination"), Step("FuzzyCoordination"), Read("FuzzyCoordination")],
    // No state and 12 digits; the output sets are tabulated at 101 points in both.
    tolerance: 1e-7,
    ..NOTHING
};

#[test]
fn plant_in_ordinary_driving() {
    compare(&Case { file: "rescue_vehicle/plant_nominal", ..PLANT });
}

#[test]
fn plant_with_wheels_in_the_air_and_saturated_tires() {
    // Where a wheel lifts off, the derivative has a kink and RK4 loses its order: 1e-6 with 0.25 ms, times 100.
    compare(&Case { file: "rescue_vehicle/plant_limits", tolerance: 1e-4, ..PLANT });
}

#[test]
fn plant_with_the_linear_laws_of_the_paper() {
    const LINEAR: &[(&str, &str, f64)] =
        &[("RescueVehicle", "tire.model", 0.0), ("RescueVehicle", "tire.lift_off", 0.0)];
    compare(&Case { file: "rescue_vehicle/plant_linear_tire", parameters: LINEAR, ..PLANT });
}

#[test]
fn dual_sliding_mode_steering() {
    compare(&Case { file: "rescue_vehicle/dsm", ..STEERING });
}

#[test]
fn lqr_suspensions() {
    // No memory: every row stands alone. 12 digits, but the gains come from two different Riccati solvers.
    let case = Case { file: "rescue_vehicle/lqr", inputs: FEEDBACK, tolerance: 1e-6, ..NOTHING };
    const INTEGRATED: &[Call] =
        &[Set("IntegratedLqrSuspension"), Step("IntegratedLqrSuspension"), Read("IntegratedLqrSuspension")];
    compare(&Case { program: INTEGRATED, ignored: &["roll_force.*"], ..case });
    const ROLL: &[Call] = &[Set("RollLqrSuspension"), Step("RollLqrSuspension"), Read("RollLqrSuspension")];
    compare(&Case { program: ROLL, ignored: &["integrated_force.*"], ..case });
}

#[test]
fn fuzzy_coordination() {
    compare(&Case {
        file: "rescue_vehicle/coordination",
        ignored: &["as_printed.*"],
        // The file has rows at 1 deg, which is the threshold, rounded down in print.
        parameters: &[("FuzzyCoordination", "steering.activation_angle", 0.017_453_29)],
        ..COORDINATION
    });
}

#[test]
fn fuzzy_coordination_with_the_rules_as_printed() {
    compare(&Case {
        file: "rescue_vehicle/coordination",
        renamed: &[("as_printed.weight.integrated", "weight.integrated"), ("as_printed.weight.roll", "weight.roll")],
        parameters: &[("FuzzyCoordination", "rules.as_printed", 1.0)],
        ..COORDINATION
    });
}

#[test]
fn closed_loop_with_individual_control_in_a_step_steer() {
    const INDIVIDUAL: &[(&str, &str, f64)] = &[("FuzzyCoordination", "strategy", 1.0)];
    compare(&Case { file: "rescue_vehicle/loop_step_individual", parameters: INDIVIDUAL, ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_a_step_steer() {
    compare(&Case { file: "rescue_vehicle/loop_step_coordination", ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_a_lane_change() {
    compare(&Case { file: "rescue_vehicle/loop_lane_change_coordination", ..LOOP });
}

#[test]
fn gain_matrices_of_the_lqr_suspensions() {
    let path = tests::workspace().join("tests/references/rescue_vehicle/gains.json");
    let text = std::fs::read_to_string(path).expect("the file is there");
    let gains: serde_json::Value = serde_json::from_str(&text).expect("the file is JSON");
    const WHEELS: [&str; 6] = ["fl", "fr", "ml", "mr", "rl", "rr"];
    let single = |state: &str| vec![format!("gain.{state}")];
    let wheels = |state: &str| WHEELS.iter().map(|wheel| format!("gain.{state}.{wheel}")).collect();
    // The order of the states in the file.
    let states: Vec<String> = [
        single("heave"),
        single("pitch"),
        single("roll"),
        wheels("wheel_height"),
        single("heave_rate"),
        single("pitch_rate"),
        single("roll_rate"),
        wheels("wheel_velocity"),
        single("sideslip"),
        single("yaw_rate"),
    ]
    .concat();
    for (name, key) in [("IntegratedLqrSuspension", "K_integrated"), ("RollLqrSuspension", "K_roll")] {
        let expected: Vec<Vec<f64>> = serde_json::from_value(gains[key].clone()).expect("a matrix");
        let fmu = Fmu::named(name);
        let mut instance = fmu.started();
        let largest = expected.iter().flatten().fold(0.0_f64, |largest, gain| largest.max(gain.abs()));
        assert!(largest > 1000.0, "{name}: the reference matrix is not empty");
        for (i, wheel) in WHEELS.iter().enumerate() {
            for (j, state) in states.iter().enumerate() {
                let found = real(&fmu, &mut instance, &format!("{state}.{wheel}"));
                // Two Riccati solvers, each with a residual near 1e-9 of the solution.
                let error = (found - expected[i][j]).abs() / largest;
                assert!(error <= 1e-6, "{name}: {state}.{wheel} = {found}, {} was expected", expected[i][j]);
            }
        }
    }
}

fn matches(name: &str, patterns: &[&str]) -> bool {
    patterns.iter().any(|pattern| match pattern.strip_suffix('*') {
        Some(start) => name.starts_with(start),
        None => name == *pattern,
    })
}

/// An FMU with its wires: value references and places on the bus.
struct Unit {
    instance: Instance,
    inputs: Wires,
    outputs: Wires,
}

#[derive(Default)]
struct Wires {
    references: Vec<Reference>,
    places: Vec<usize>,
    values: Vec<f64>,
}

impl Wires {
    fn add(&mut self, reference: Reference, place: usize) {
        self.references.push(reference);
        self.places.push(place);
        self.values.push(0.0);
    }
}

impl Unit {
    fn set(&mut self, bus: &[f64]) {
        let wires = &mut self.inputs;
        wires.values.iter_mut().zip(&wires.places).for_each(|(value, &place)| *value = bus[place]);
        ok(self.instance.set_real(&wires.references, &wires.values));
    }

    fn read(&mut self, bus: &mut [f64]) {
        let wires = &mut self.outputs;
        ok(self.instance.get_real(&wires.references, &mut wires.values));
        wires.values.iter().zip(&wires.places).for_each(|(&value, &place)| bus[place] = value);
    }
}

/// Runs a case and compares every column that is no input.
fn compare(case: &Case) {
    use host::description::Causality;
    let table = Table::read(case.file);
    let is_input = |name: &str| matches(name, case.inputs);
    // The compared columns, with the signals they hold.
    let compared: Vec<(&str, &str)> = if case.renamed.is_empty() {
        let names = table.names.iter().map(String::as_str);
        names
            .filter(|name| *name != "time" && !is_input(name) && !matches(name, case.ignored))
            .map(|name| (name, name))
            .collect()
    } else {
        case.renamed.to_vec()
    };
    let mut names = Vec::new();
    for call in case.program {
        let (Set(name) | Read(name) | Step(name)) = call;
        if !names.contains(name) {
            names.push(name);
        }
    }
    let fmus: Vec<_> = names.iter().map(|name| Fmu::named(name)).collect();

    // The bus: the inputs of the file, then the outputs of the units; equal names are wired.
    let mut bus_of: HashMap<&str, usize> = HashMap::new();
    for name in &table.names {
        if is_input(name) {
            let place = bus_of.len();
            bus_of.insert(name, place);
        }
    }
    let fed = bus_of.len();
    for output in fmus.iter().flat_map(|fmu| fmu.with(Causality::Output)) {
        let place = bus_of.len();
        bus_of.entry(&output.name).or_insert(place);
    }
    for (_, signal) in &compared {
        assert!(bus_of.contains_key(signal), "{}: no unit has the output {signal}", case.file);
    }
    let mut used = vec![false; bus_of.len()];
    let mut units: HashMap<&str, Unit> = HashMap::new();
    for fmu in &fmus {
        let mut unit = Unit { instance: fmu.instance(), inputs: Wires::default(), outputs: Wires::default() };
        for input in fmu.with(Causality::Input) {
            if let Some(&place) = bus_of.get(input.name.as_str()) {
                unit.inputs.add(input.reference, place);
                used[place] = true;
            }
        }
        for output in fmu.with(Causality::Output) {
            let place = bus_of[output.name.as_str()];
            // The file's inputs are never overwritten.
            if place >= fed {
                unit.outputs.add(output.reference, place);
            }
        }
        for (_, name, value) in case.parameters.iter().filter(|parameter| parameter.0 == fmu.name) {
            set_parameter(fmu, &mut unit.instance, name, *value);
        }
        units.insert(&fmu.name, unit);
    }
    // Every input of the file goes somewhere; sideslip and yaw rate are inputs of an LQR for another design only.
    assert!(used[..fed].iter().all(|&used| used), "{}: an input column goes nowhere", case.file);

    let mut bus = vec![0.0; bus_of.len()];
    let feeds: Vec<_> =
        table.names.iter().map(|name| bus_of.get(name.as_str()).copied().filter(|&place| place < fed)).collect();
    let feed = |bus: &mut [f64], row: &[f64]| {
        feeds.iter().zip(row).for_each(|(place, &value)| {
            if let Some(place) = *place {
                bus[place] = value;
            }
        });
    };
    feed(&mut bus, &table.rows[0]);
    for name in &names {
        let unit = units.get_mut(*name).expect("all were inserted");
        ok(unit.instance.setup_experiment(0.0, None));
        ok(unit.instance.enter_initialization_mode());
        unit.set(&bus);
        ok(unit.instance.exit_initialization_mode());
    }
    let mut found = Vec::with_capacity(table.rows.len());
    for (k, row) in table.rows.iter().enumerate() {
        feed(&mut bus, row);
        for call in case.program {
            let (Set(name) | Read(name) | Step(name)) = call;
            let unit = units.get_mut(name).expect("all were inserted");
            match call {
                Set(_) => unit.set(&bus),
                Read(_) => unit.read(&mut bus),
                Step(_) => ok(unit.instance.do_step(k as f64 * STEP, STEP)),
            }
        }
        found.push(compared.iter().map(|(_, signal)| bus[bus_of[signal]]).collect::<Vec<_>>());
    }
    let columns: Vec<_> = compared.iter().map(|(name, _)| table.column(name).expect("a column of the file")).collect();
    let expected: Vec<Vec<f64>> =
        table.rows.iter().map(|row| columns.iter().map(|&column| row[column]).collect()).collect();
    let labels: Vec<_> = compared.iter().map(|(name, _)| (*name).to_owned()).collect();
    let (name, error) = worst(&labels, &expected, &found);
    println!("{}: {} columns, worst {name}: {error:.1e}", case.file, labels.len());
    assert!(error <= case.tolerance, "{}: {name} is off by {error:.1e} of its peak", case.file);
}

fn set_parameter(fmu: &Fmu, instance: &mut Instance, name: &str, value: f64) {
    use host::description::BaseType;
    let variable = fmu.description.variable(name).unwrap_or_else(|| panic!("{} has no parameter {name}", fmu.name));
    match variable.base_type {
        BaseType::Real => ok(instance.set_real(&[variable.reference], &[value])),
        BaseType::Integer => ok(instance.set_integer(&[variable.reference], &[value as i32])),
        BaseType::Boolean => ok(instance.set_boolean(&[variable.reference], &[i32::from(value != 0.0)])),
        BaseType::String => panic!("{name} is a text"),
    }
}

#[test]
fn the_plant_starts_at_rest() {
    // Without inputs everything but loads, speed and friction is exactly 0, at any speed.
    let fmu = Fmu::named("RescueVehicle");
    let mut instance = fmu.started();
    for k in 0..100 {
        ok(instance.do_step(f64::from(k) * STEP, STEP));
    }
    let states: Vec<_> = fmu.states().into_iter().filter(|state| state.name != "vehicle.position_x").collect();
    let references: Vec<_> = states.iter().map(|state| state.reference).collect();
    let values = reals(&mut instance, &references);
    for (state, value) in states.iter().zip(values) {
        assert_eq!(value, 0.0, "{}", state.name);
    }
    // 36 t on six wheels: 36000 * 9.81 / 6 N, rounded differently at most in the last digits.
    let load = real(&fmu, &mut instance, "tire_load.mr");
    assert!((load - 58_860.0).abs() < 1e-9 * 58_860.0, "tire_load.mr = {load}");
}
