//! The rescue vehicle with all its controllers: the packed FMUs, wired and stepped by the importer.
//!
//! References: Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562, and the numbers that the independent
//! implementation behind `references/` printed for steady states. The tests contain these numbers as strings with the
//! printed digits. The tolerance is one unit of the last digit: half of it for rounding, the rest for the transient
//! that remains after 14 s. All other values are compared bit by bit or follow from a formula.

use fmu_import::description::Causality;
use fmu_import::loader::Instance;
use fmu_system::fmus::Fmus;
use fmu_system::master::{Recording, execute};
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, Problem, ResolveError, resolve, resolve_text};
use fmu_system::run::Order;
use std::collections::HashMap;
use std::path::Path;
use tests::{Fmu, bits, folder, ok, reals, workspace};

/// Communication step in s.
const STEP: f64 = 0.001;

const DRIVER: &str = r#"
[[component]]
name = "driver"
fmu = "Driver"
parameters = { maneuver = 1, "steer.start" = 1.0, "steer.amplitude" = 0.05, "speed.initial" = { value = 35.0, unit = "km/h" } }
"#;

const CONTROLLERS: &str = r#"
[[component]]
name = "coordination"
fmu = "FuzzyCoordination"
[[component]]
name = "steering"
fmu = "DualSlidingModeSteering"
[[component]]
name = "integrated"
fmu = "IntegratedLqrSuspension"
[[component]]
name = "roll"
fmu = "RollLqrSuspension"
[[component]]
name = "mixer"
fmu = "SuspensionMixer"
"#;

const SMOOTH: &str = r#"
[[component]]
name = "plant"
fmu = "RescueVehicle"
inputs = { "road_height.*" = 0.0, "road_friction.*" = 1.0 }
"#;

/// A class C road under the plant; the driver prescribes its speed.
const ROUGH: &str = r#"
[[component]]
name = "road"
fmu = "Road"
parameters = { profile = 1, tracks = 1, "roughness.class" = 3, "roughness.start" = 2, "geometry.axle_offset.middle" = 2.95, "geometry.axle_offset.rear" = 4.6 }
[[component]]
name = "plant"
fmu = "RescueVehicle"
[[connection]]
from = "driver:driver.speed"
to = "road:vehicle.speed"
"#;

/// A scenario on a smooth road, with the stop time `stop`.
fn smooth(stop: f64, rest: &str) -> String {
    scenario(stop, &[DRIVER, CONTROLLERS, SMOOTH, rest])
}

fn scenario(stop: f64, parts: &[&str]) -> String {
    format!("title = \"Test\"\n[simulation]\nstop = {stop:?}\nstep = {STEP:?}\n{}", parts.concat())
}

/// The plan of a scenario.
#[track_caller]
fn plan(text: &str, options: &Options) -> Plan {
    resolve_text(Path::new("test.toml"), text, &FmuFolder::new([folder()]), options).unwrap_or_else(|error| fail(error))
}

/// Fails with all mistakes found in a scenario.
#[track_caller]
fn fail(error: ResolveError) -> ! {
    match error {
        ResolveError::Problems(mistakes) => {
            let lines: Vec<_> = mistakes.problems.iter().map(Problem::line).collect();
            panic!("{}", lines.join("\n"))
        }
        other => panic!("{other}"),
    }
}

/// An executed plan.
struct Results {
    plan: Plan,
    recordings: Vec<Recording>,
}

impl Results {
    #[track_caller]
    fn of(plan: Plan) -> Self {
        let fmus = Fmus::load(&plan.runs).unwrap_or_else(|error| panic!("{error}"));
        let one = |run| execute(&plan.simulation, run, &fmus).unwrap_or_else(|error| panic!("{error}"));
        let recordings = plan.runs.iter().map(one).collect();
        Self { plan, recordings }
    }

    #[track_caller]
    fn run(text: &str) -> Self {
        Self::of(plan(text, &Options::default()))
    }

    /// Values of a signal in a run.
    #[track_caller]
    fn column(&self, run: &str, signal: &str) -> &[f64] {
        let run = self.plan.runs.iter().position(|one| one.id == run).unwrap_or_else(|| panic!("no run {run}"));
        let column = self.plan.columns.iter().position(|one| one.name == signal);
        let column = column.unwrap_or_else(|| panic!("no column {signal}"));
        self.recordings[run].column(column).expect("the case has the component")
    }

    /// Last value of a signal in a run.
    #[track_caller]
    fn last(&self, run: &str, signal: &str) -> f64 {
        *self.column(run, signal).last().expect("there are rows")
    }

    #[track_caller]
    fn assert_finite(&self) {
        for (run, recording) in self.plan.runs.iter().zip(&self.recordings) {
            for (column, values) in self.plan.columns.iter().zip(&recording.columns) {
                let values = values.as_ref().expect("all cases have all components");
                let broken = values.iter().position(|value| !value.is_finite());
                assert_eq!(broken, None, "{}: {} is not finite in this row", run.id, column.name);
            }
        }
    }
}

/// Root mean square.
fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |peak, value| peak.max(value.abs()))
}

/// Compares a value with a printed number, with the tolerance that is stated at the top of this file.
#[track_caller]
fn assert_printed(what: &str, found: f64, printed: &str) {
    let expected: f64 = printed.parse().expect("a printed number");
    let decimals = printed.split_once('.').map_or(0, |(_, digits)| digits.len());
    let unit = 10.0_f64.powi(-i32::try_from(decimals).expect("few digits"));
    assert!((found - expected).abs() <= unit, "{what} = {found}, expected {printed}");
}

/// With a constant steering angle of 0.05 rad and linear tires, compares the yaw rate divided by the tangent of the
/// front angle, the sideslip, and the angles of the rear axles.
#[test]
fn yaw_gain_at_four_speeds() {
    let text = smooth(
        15.0,
        r#"
[[case]]
name = "zero_sideslip"
title = "Reference without sideslip"
parameters.plant = { "tire.model" = 0 }
[[case]]
name = "ordinary"
title = "Reference of the ordinary two-axle model"
parameters.plant = { "tire.model" = 0 }
parameters.steering = { "reference.model" = 0 }
[[point]]
name = "s5"
title = "5 km/h"
value = 5.0
parameters.driver = { "speed.initial" = { value = 5.0, unit = "km/h" } }
[[point]]
name = "s15"
title = "15 km/h"
value = 15.0
parameters.driver = { "speed.initial" = { value = 15.0, unit = "km/h" } }
[[point]]
name = "s25"
title = "25 km/h"
value = 25.0
parameters.driver = { "speed.initial" = { value = 25.0, unit = "km/h" } }
[[point]]
name = "s35"
title = "35 km/h"
value = 35.0
parameters.driver = { "speed.initial" = { value = 35.0, unit = "km/h" } }
[sweep]
title = "Speed"
unit = "km/h"
[record]
signals = ["plant:vehicle.yaw_rate", "plant:vehicle.sideslip", "steering:steer.*"]
"#,
    );
    let results = Results::run(&text);
    results.assert_finite();
    let gains = [
        ("s5", 5.0, "0.543544", "0.321808"),
        ("s15", 15.0, "1.454898", "0.965424"),
        ("s25", 25.0, "1.994858", "1.609040"),
        ("s35", 35.0, "2.206037", "2.252655"),
    ];
    for (point, speed, zero_sideslip, ordinary) in gains {
        let run = format!("zero_sideslip@{point}");
        let front = results.last(&run, "steer.front");
        let gain = results.last(&run, "vehicle.yaw_rate") / front.tan();
        assert_printed(&format!("{run}: yaw gain"), gain, zero_sideslip);
        // The yaw gain from the formula u/(a + m_f u^2/C_F) with the data in the model's README: the front axle carries
        // a third of 36 t, the cornering stiffness of its tires is 2 * 300 kN/rad, and a = 7.55/3 m. Because of the
        // integral action, the only error is the remaining transient.
        let u: f64 = speed / 3.6;
        let formula = u / (7.55 / 3.0 + 12_000.0 * u * u / 600_000.0);
        assert!((gain / formula - 1.0).abs() < 1e-6, "{run}: {gain}, the formula gives {formula}");
        let run = format!("ordinary@{point}");
        let gain = results.last(&run, "vehicle.yaw_rate") / results.last(&run, "steer.front");
        assert_printed(&format!("{run}: yaw gain"), gain, ordinary);
    }
    let run = "zero_sideslip@s35";
    assert_printed("yaw rate", results.last(run, "vehicle.yaw_rate"), "0.110394");
    assert_printed("sideslip", results.last(run, "vehicle.sideslip"), "0.000000");
    assert_printed("middle axle", results.last(run, "steer.middle"), "0.0167");
    assert_printed("rear axle", results.last(run, "steer.rear"), "-0.0023");
}

/// A demand above the maximum angle gives the angle that the speed allows.
#[test]
fn front_axle_is_limited_by_the_speed() {
    // After 1 s, the angle rises to 32 degrees within 3.2 s, at 10 degrees per second.
    let text = smooth(
        5.0,
        r#"
[[case]]
name = "limit"
title = "Limit"
parameters.driver = { "steer.amplitude" = { value = 34.0, unit = "deg" } }
[[point]]
name = "s5"
title = "5 km/h"
value = 5.0
parameters.driver = { "speed.initial" = { value = 5.0, unit = "km/h" } }
[[point]]
name = "s15"
title = "15 km/h"
value = 15.0
parameters.driver = { "speed.initial" = { value = 15.0, unit = "km/h" } }
[[point]]
name = "s25"
title = "25 km/h"
value = 25.0
parameters.driver = { "speed.initial" = { value = 25.0, unit = "km/h" } }
[[point]]
name = "s35"
title = "35 km/h"
value = 35.0
parameters.driver = { "speed.initial" = { value = 35.0, unit = "km/h" } }
[sweep]
title = "Speed"
unit = "km/h"
[record]
signals = ["steering:steer.*", "plant:vehicle.*", "plant:tire_*"]
"#,
    );
    let results = Results::run(&text);
    results.assert_finite();
    for (point, degrees) in [("s5", "32.0000"), ("s15", "31.6931"), ("s25", "15.1198"), ("s35", "9.8995")] {
        let run = format!("limit@{point}");
        let front = results.column(&run, "steer.front");
        assert_printed(&format!("{run}: limit"), peak(front).to_degrees(), degrees);
        assert_eq!(front.last().copied(), Some(peak(front)), "{run}: the limit is kept");
    }
}

const STEP_CASES: &str = r#"
[[case]]
name = "individual"
title = "Individual control"
parameters.driver = { "steer.amplitude" = { value = 30.0, unit = "deg" } }
parameters.coordination = { strategy = 1 }
[[case]]
name = "coordination"
title = "Coordinated control"
parameters.driver = { "steer.amplitude" = { value = 30.0, unit = "deg" } }
[record]
signals = ["plant:vehicle.*", "plant:body.roll", "plant:body.heave", "plant:wheel_height.*", "steering:steer.*", "mixer:suspension_force.*"]
"#;

const LEFT_AND_RIGHT: [(&str, &str); 3] = [("fl", "fr"), ("ml", "mr"), ("rl", "rr")];

/// Checks the steady state 14 s after a step of the steering on a smooth road.
#[track_caller]
fn assert_steady_step(results: &Results) {
    results.assert_finite();
    let run = "individual";
    for (signal, printed) in [
        ("vehicle.lateral_acceleration", "3.74299"),
        ("vehicle.yaw_rate", "0.384994"),
        ("body.roll", "0.072609"),
        ("vehicle.load_transfer_ratio", "0.320582"),
        ("steer.front", "0.172778"),
        ("steer.middle", "0.132928"),
        ("steer.rear", "-0.021089"),
    ] {
        assert_printed(&format!("{run}: {signal}"), results.last(run, signal), printed);
    }
    assert_printed("roll", results.last("coordination", "body.roll"), "0.063542");
    assert_printed("load transfer", results.last("coordination", "vehicle.load_transfer_ratio"), "0.314181");
    // Figure 11 of the paper: in a left turn, the actuators push up on the right and pull down on the left; with
    // coordination, their forces are greater.
    for (run, force) in [("individual", "442.60"), ("coordination", "2861.93")] {
        for (left, right) in LEFT_AND_RIGHT {
            for (wheel, sign) in [(left, -1.0), (right, 1.0)] {
                let found = sign * results.last(run, &format!("suspension_force.{wheel}"));
                assert_printed(&format!("{run}: force at {wheel}"), found, force);
            }
        }
    }
    for (left, right) in LEFT_AND_RIGHT {
        for (wheel, sign) in [(left, 1.0), (right, -1.0)] {
            let found = sign * results.last("individual", &format!("wheel_height.{wheel}"));
            assert_printed(&format!("wheel height {wheel}"), found, "0.0188694");
        }
    }
}

#[test]
fn steady_state_after_a_step_steer() {
    let results = Results::run(&smooth(15.0, STEP_CASES));
    assert_steady_step(&results);
    // Before the step, nothing disturbs the vehicle on the smooth road, so both strategies are bit-identical.
    let before = (1.0 / STEP) as usize;
    for signal in ["body.roll", "vehicle.yaw_rate", "vehicle.lateral_acceleration", "suspension_force.fl"] {
        for run in ["individual", "coordination"] {
            assert_eq!(peak(&results.column(run, signal)[..before]), 0.0, "{run}: {signal} before the step");
        }
    }
}

#[test]
fn both_suspension_laws_fully_on_are_unstable() {
    // The driver steers by only 1e-6 rad, but the response grows until the actuators are at their limit of 100 kN.
    const LIMIT: f64 = 100_000.0;
    let text = smooth(
        6.0,
        r#"
[[case]]
name = "both"
title = "Both laws"
parameters.coordination = { strategy = 1, "fixed_weight.integrated" = 1.0, "fixed_weight.roll" = 1.0 }
parameters.driver = { "steer.amplitude" = 1e-6 }
[[case]]
name = "one"
title = "One law"
parameters.coordination = { strategy = 1, "fixed_weight.integrated" = 1.0, "fixed_weight.roll" = 0.0 }
parameters.driver = { "steer.amplitude" = 1e-6 }
[record]
signals = ["mixer:suspension_force.*", "plant:body.*", "plant:wheel_*", "plant:tire_*"]
"#,
    );
    let results = Results::run(&text);
    results.assert_finite();
    for wheel in LEFT_AND_RIGHT.iter().flat_map(|(left, right)| [left, right]) {
        let signal = format!("suspension_force.{wheel}");
        assert_eq!(peak(results.column("both", &signal)), LIMIT, "{signal}");
        // 1e-6 rad times the force per steering angle in the steady state above, 443 N/0.17 rad, is 2.6e-3 N; a stable
        // loop stays within a small multiple of this.
        assert!(peak(results.column("one", &signal)) < 1.0, "{signal}");
    }
}

#[test]
fn standing_vehicle() {
    let text = scenario(
        5.0,
        &[
            DRIVER,
            CONTROLLERS,
            ROUGH,
            r#"
[[case]]
name = "standing"
title = "Standing"
parameters.driver = { "speed.initial" = 0.0, "steer.amplitude" = { value = 30.0, unit = "deg" } }
[[case]]
name = "individual"
title = "Standing, steering controller on"
parameters.driver = { "speed.initial" = 0.0, "steer.amplitude" = { value = 30.0, unit = "deg" } }
parameters.coordination = { strategy = 1 }
[record]
signals = ["coordination:weight.steering", "steering:*", "plant:*"]
"#,
        ],
    );
    let results = Results::run(&text);
    // Slip angles use a minimum speed, so nothing is divided by 0.
    results.assert_finite();
    // The driver's speed is 0 from the first sample on; row 0 holds the start values.
    let coordinated = |signal: &str| peak(&results.column("standing", signal)[1..]);
    assert_eq!(coordinated("weight.steering"), 0.0, "the coordination leaves the axles behind alone");
    for axle in ["steer.middle", "steer.rear"] {
        assert_eq!(coordinated(axle), 0.0, "{axle}");
    }
    for wheel in LEFT_AND_RIGHT.iter().flat_map(|(left, right)| [left, right]) {
        for run in ["standing", "individual"] {
            let slip = peak(results.column(run, &format!("tire_slip_angle.{wheel}")));
            // A slip angle is an arctangent minus the angle of an axle, which is at most 32 degrees.
            assert!(slip <= std::f64::consts::FRAC_PI_2 + 32.0_f64.to_radians(), "{run}: slip angle {slip} of {wheel}");
        }
    }
}

const ROUGH_CASES: &str = r#"
[[case]]
name = "individual"
title = "Individual control"
parameters.coordination = { strategy = 1 }
[[case]]
name = "coordination"
title = "Coordinated control"
[seeds]
parameter = "road:seed"
values = [1, 2]
[record]
signals = ["*"]
"#;

/// A short drive on a rough road, with all signals recorded.
fn rough() -> String {
    let driver = DRIVER.replace("\"steer.start\" = 1.0", "\"steer.start\" = 0.2");
    scenario(0.8, &[&driver, CONTROLLERS, ROUGH, ROUGH_CASES])
}

#[track_caller]
fn assert_same(a: &Recording, b: &Recording, what: &str) {
    assert_eq!(bits(&a.time), bits(&b.time), "{what}: time");
    let all = |recording: &Recording| recording.columns.iter().map(|c| c.as_deref().map(bits)).collect::<Vec<_>>();
    assert_eq!(all(a), all(b), "{what}");
}

#[test]
fn results_do_not_depend_on_threads() {
    let plan = plan(&rough(), &Options::default());
    assert_eq!(plan.runs.len(), 4);
    let fmus = Fmus::load(&plan.runs).unwrap_or_else(|error| panic!("{error}"));
    let one = |run| execute(&plan.simulation, run, &fmus).unwrap_or_else(|error| panic!("{error}"));
    let alone: Vec<_> = plan.runs.iter().map(one).collect();
    // All runs take place at the same time, with libraries that are loaded once.
    let together: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = plan.runs.iter().map(|run| scope.spawn(move || one(run))).collect();
        threads.into_iter().map(|thread| thread.join().expect("it does not panic")).collect()
    });
    for (run, (recording, expected)) in plan.runs.iter().zip(together.iter().zip(&alone)) {
        assert_same(recording, expected, &run.id);
    }
}

/// The reference is the loop as a user would write it: signals by name, components in order, without a bus or a plan.
#[test]
fn sequential_order_is_the_obvious_loop() {
    let mut plan = plan(&rough(), &Options::default());
    plan.runs.retain(|run| run.id == "coordination#2");
    let results = Results::of(plan);
    let plan = &results.plan;
    let steps = usize::try_from(plan.simulation.steps).expect("few steps");

    let names = [
        "Driver",
        "FuzzyCoordination",
        "DualSlidingModeSteering",
        "IntegratedLqrSuspension",
        "RollLqrSuspension",
        "SuspensionMixer",
        "Road",
        "RescueVehicle",
    ];
    let fmus: Vec<_> = names.iter().map(|name| Fmu::named(name)).collect();
    let mut instances: Vec<_> = fmus.iter().map(Fmu::instance).collect();
    let mut signals: HashMap<String, f64> = HashMap::new();
    let read = |signals: &mut HashMap<String, f64>, fmu: &Fmu, instance: &mut Instance| {
        for output in fmu.with(Causality::Output) {
            signals.insert(output.name.clone(), reals(instance, &[output.reference])[0]);
        }
    };
    let set = |signals: &HashMap<String, f64>, fmu: &Fmu, instance: &mut Instance| {
        for input in fmu.with(Causality::Input) {
            let source = if fmu.name == "Road" { "driver.speed" } else { input.name.as_str() };
            ok(instance.set_real(&[input.reference], &[signals[source]]));
        }
    };
    for (fmu, instance) in fmus.iter().zip(&mut instances) {
        ok(instance.setup_experiment(0.0, Some(plan.simulation.stop)));
        let mut real = |name: &str, value: f64| ok(instance.set_real(&[fmu.reference(name)], &[value]));
        if fmu.name == "Driver" {
            real("steer.start", 0.2);
            real("steer.amplitude", 0.05);
            real("speed.initial", 35.0 / 3.6);
            ok(instance.set_integer(&[fmu.reference("maneuver")], &[1]));
        } else if fmu.name == "Road" {
            real("geometry.axle_offset.middle", 2.95);
            real("geometry.axle_offset.rear", 4.6);
            for (name, value) in
                [("profile", 1), ("tracks", 1), ("seed", 2), ("roughness.class", 3), ("roughness.start", 2)]
            {
                ok(instance.set_integer(&[fmu.reference(name)], &[value]));
            }
        }
        ok(instance.enter_initialization_mode());
    }
    for (fmu, instance) in fmus.iter().zip(&mut instances) {
        read(&mut signals, fmu, instance);
    }
    for (fmu, instance) in fmus.iter().zip(&mut instances) {
        set(&signals, fmu, instance);
        read(&mut signals, fmu, instance);
    }
    for instance in &mut instances {
        ok(instance.exit_initialization_mode());
    }
    for (fmu, instance) in fmus.iter().zip(&mut instances) {
        read(&mut signals, fmu, instance);
    }
    let compare = |signals: &HashMap<String, f64>, row: usize| {
        for (column, values) in plan.columns.iter().zip(&results.recordings[0].columns) {
            let (value, expected) = (values.as_ref().expect("all components are there")[row], signals[&column.name]);
            assert_eq!(value.to_bits(), expected.to_bits(), "{} in row {row}: {value}, {expected}", column.name);
        }
    };
    compare(&signals, 0);
    for k in 0..steps {
        for (fmu, instance) in fmus.iter().zip(&mut instances) {
            set(&signals, fmu, instance);
            ok(instance.do_step(k as f64 * STEP, STEP));
            read(&mut signals, fmu, instance);
        }
        compare(&signals, k + 1);
    }
}

/// In a chain without feedback, the input of a component is delayed by one step for each component before it; nothing
/// else changes.
#[test]
fn jacobi_order_delays_a_chain_by_one_step_per_component() {
    let chain = format!(
        "{DRIVER}{CHAIN}{}",
        r#"
[[connection]]
from = "driver:driver.steer"
to = "plant:steer.front"
[[case]]
name = "chain"
title = "Chain"
[record]
signals = ["*"]
"#
    );
    const CHAIN: &str = r#"
[[component]]
name = "coordination"
fmu = "FuzzyCoordination"
[[component]]
name = "plant"
fmu = "RescueVehicle"
inputs = { "road_height.*" = 0.0, "road_friction.*" = 1.0, "suspension_force.*" = 0.0, "steer.middle" = 0.0, "steer.rear" = 0.0 }
[[component]]
name = "roll"
fmu = "RollLqrSuspension"
[[connection]]
from = "driver:driver.speed"
to = "coordination:vehicle.speed"
"#;
    // The driver steers after 0.1 s. Between the initial transient and that time, all signals are constant.
    let text = scenario(0.5, &[&chain.replace("\"steer.start\" = 1.0", "\"steer.start\" = 0.1")]);
    let ordered = |order| Results::of(plan(&text, &Options { order: Some(order), ..Options::default() }));
    let (sequential, jacobi) = (ordered(Order::Sequential), ordered(Order::Jacobi));
    let from = (0.05 / STEP) as usize;
    let mut compared = 0;
    for (i, column) in sequential.plan.columns.iter().enumerate() {
        let delay = match column.name.as_str() {
            // Positions also depend on the speed in the first step, so they are not only delayed.
            "vehicle.position_x" | "vehicle.position_y" => continue,
            name if name.starts_with("driver.") => 0,
            name if name.starts_with("roll_force") => 2,
            _ => 1,
        };
        let early = sequential.recordings[0].column(i).expect("it is recorded");
        let late = jacobi.recordings[0].column(i).expect("it is recorded");
        assert_eq!(bits(&early[from..early.len() - delay]), bits(&late[from + delay..]), "{}", column.name);
        compared += 1;
    }
    assert!(compared > 50, "the whole plant is recorded");
}

#[test]
fn jacobi_order_settles_to_the_same_state() {
    // Delays of a few milliseconds in the loops change the transient, but not the steady state.
    let text = smooth(15.0, STEP_CASES);
    let ordered =
        |order, stop| Results::of(plan(&text, &Options { order: Some(order), stop: Some(stop), ..Options::default() }));
    let jacobi = ordered(Order::Jacobi, 15.0);
    assert_steady_step(&jacobi);
    let sequential = ordered(Order::Sequential, 2.0);
    let rolls = [&sequential, &jacobi].map(|results| results.column("individual", "body.roll"));
    assert_ne!(bits(rolls[0]), bits(&rolls[1][..rolls[0].len()]), "the orders differ on the way");
}

/// The experiment of Table 4 and Figure 6 in the paper.
struct StepSteer(Results);

impl StepSteer {
    #[track_caller]
    fn run(options: &Options) -> Self {
        let file = workspace().join("scenarios/rescue_vehicle_step_steer.toml");
        let plan = resolve(&file, &FmuFolder::new([folder()]), options).unwrap_or_else(|error| fail(error));
        let results = Results::of(plan);
        results.assert_finite();
        Self(results)
    }

    /// Root mean square of a signal with individual control, and its relative change with coordination, on each road.
    fn rms_and_change(&self, signal: &str) -> Vec<[f64; 2]> {
        let of = |case: &str, seed: &i32| rms(self.0.column(&format!("{case}#{seed}"), signal));
        let one = |seed| {
            let individual = of("individual", seed);
            [individual, of("coordination", seed) / individual - 1.0]
        };
        self.0.plan.seeds.iter().map(one).collect()
    }
}

#[test]
fn claims_of_the_paper_on_a_shortened_step_steer() {
    // One road instead of eight, and only 3 s of the turn.
    let results = StepSteer::run(&Options { stop: Some(8.0), seeds: Some(1), ..Options::default() });
    let change = |signal: &str| results.rms_and_change(signal)[0][1];
    // Reproduced: coordination reduces the roll angle.
    assert!(change("body.roll") < 0.0, "roll angle: {}", change("body.roll"));
    // Reproduced: the lateral acceleration does not change. Not reproduced: the paper reports that the yaw acceleration
    // falls by 23 %, but here the suspension hardly affects the yaw motion. The independent implementation printed
    // changes of at most 0.1 %, for other roads and suspensions; the limit of 0.5 % is far from both 0.1 % and 23 %.
    for signal in ["vehicle.lateral_acceleration", "vehicle.yaw_acceleration"] {
        assert!(change(signal).abs() < 0.005, "{signal}: {}", change(signal));
    }
}

#[test]
fn table_4_on_eight_roads() {
    let results = StepSteer::run(&Options::default());
    let roads = results.0.plan.seeds.len() as f64;
    assert_eq!(roads, 8.0);
    // Means and standard deviations that the independent implementation printed for eight roads of the same class, for
    // the root mean square with individual control and for its change with coordination.
    for (signal, rms, change) in [
        ("body.roll", [0.0619, 0.0016], [-0.123, 0.001]),
        ("body.roll_acceleration", [0.173, 0.011], [-0.007, 0.005]),
        ("vehicle.yaw_acceleration", [0.0761, 0.0002], [0.0005, 0.0002]),
    ] {
        let found = results.rms_and_change(signal);
        for (i, (what, [mean, deviation])) in [("rms", rms), ("change", change)].into_iter().enumerate() {
            let found_mean = found.iter().map(|road| road[i]).sum::<f64>() / roads;
            let variance = found.iter().map(|road| (road[i] - found_mean).powi(2)).sum::<f64>() / (roads - 1.0);
            // The roads of the reference come from other random numbers, so only the means can be compared. They must
            // agree to within four standard errors of their difference.
            let tolerance = 4.0 * ((variance + deviation * deviation) / roads).sqrt();
            println!("{signal}, {what}: {found_mean:.5} +- {:.5}, expected {mean} +- {deviation}", variance.sqrt());
            assert!((found_mean - mean).abs() <= tolerance, "{signal}: mean {what} {found_mean}, expected {mean}");
        }
    }
}

/// A closed loop with a sensor at its start values is bit-identical to the loop without a sensor. With noise and delay,
/// the results differ.
#[test]
fn a_sensor_with_its_start_values_changes_no_bit() {
    let file = workspace().join("scenarios/rescue_vehicle_sensor_actuator.toml");
    let options = Options { stop: Some(7.0), seeds: Some(1), ..Options::default() };
    let results =
        Results::of(resolve(&file, &FmuFolder::new([folder()]), &options).unwrap_or_else(|error| fail(error)));
    for signal in ["vehicle.yaw_rate", "vehicle.sideslip", "steer.rear"] {
        let [ideal, sensor, real] =
            ["ideal#1", "start_values#1", "sensor#1"].map(|run| bits(results.column(run, signal)));
        assert_eq!(sensor, ideal, "{signal}");
        assert_ne!(real, ideal, "{signal}");
    }
    // The sensor outputs the yaw rate at the start of a step, the plant the yaw rate at the end of the step.
    let measured = results.column("start_values#1", "sensor.measured_value");
    let yaw_rate = results.column("start_values#1", "vehicle.yaw_rate");
    assert_eq!(bits(&measured[1..]), bits(&yaw_rate[..yaw_rate.len() - 1]));
}

/// Files with 20 and with 1,000 rows per second steer the vehicle by 2° at 0.5 Hz. Reference for the recorded angle:
/// the angle of the file in the middle of each step, computed here. The roll accelerations with the two files must
/// agree to within 1 % (RMS), which is twice the effect of the straight lines between 20 rows per second.
#[test]
fn a_sampled_steering_angle_is_as_good_as_the_sine() {
    let driver = r#"
[[component]]
name = "driver"
fmu = "Driver"
parameters = { maneuver = "ramp_step", "steer.amplitude" = { value = 2.0, unit = "deg" } }
"#;
    let car = r#"
[[component]]
name = "road"
fmu = "Road"
parameters = { profile = "flat" }
[[component]]
name = "car"
fmu = "RescueVehicle"
inputs = { "*force*" = 0.0, "steer.middle" = 0.0, "steer.rear" = 0.0 }
[[connection]]
from = "driver:driver.steer"
to = "car:steer.front"
[record]
signals = ["driver:driver.steer", "car:body.roll_acceleration"]
[[case]]
name = "steered"
title = "Steered"
"#;
    let folder = tempfile::TempDir::new().unwrap();
    let sine = |time: f64| 2f64.to_radians() * (std::f64::consts::PI * time).sin();
    let [coarse, fine] = [20, 1000].map(|rate| {
        let file = folder.path().join(format!("{rate}.csv"));
        let times = (0..=3 * rate).map(|k| f64::from(k) / f64::from(rate));
        let rows: String = times.map(|time| format!("{time},{}\n", sine(time))).collect();
        std::fs::write(&file, format!("time,driver.steer\n{rows}")).unwrap();
        let options = Options { inputs: Some(file), ..Options::default() };
        let results = Results::of(plan(&scenario(3.0, &[driver, car]), &options));
        let angle = results.column("steered", "driver.steer");
        for (k, found) in angle.iter().enumerate().skip(1) {
            // Interpolates linearly between the two rows around the middle of step k.
            let middle = (k as f64 - 0.5) * STEP * f64::from(rate);
            let [from, to] = [middle.floor(), middle.floor() + 1.0].map(|row| sine(row / f64::from(rate)));
            let expected = from + (to - from) * middle.fract();
            assert!((found - expected).abs() < 1e-14, "{rate} rows a second, row {k}: {found}, not {expected}");
        }
        results.column("steered", "body.roll_acceleration").to_vec()
    });
    let difference: Vec<f64> = coarse.iter().zip(&fine).map(|(a, b)| a - b).collect();
    assert!(rms(&difference) < 0.01 * rms(&fine), "{} of {}", rms(&difference), rms(&fine));
}

#[test]
fn every_scenario_resolves() {
    let entries = std::fs::read_dir(workspace().join("scenarios")).expect("the folder is there");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("the folder can be read").path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
    assert!(!files.is_empty());
    let folder = FmuFolder::new([folder()]);
    for file in files {
        let plan = resolve(&file, &folder, &Options::default()).unwrap_or_else(|error| fail(error));
        assert!(!plan.runs.is_empty() && !plan.columns.is_empty(), "{}: nothing to do", file.display());
    }
}
