//! Sources: discrete-time FMUs whose outputs are calculated during initialization.
//!
//! Reference: FMI 2.0.4, sections 2.2.7 (initial) and 2.2.8 (InitialUnknowns), and the first step itself.

use fmu_import::description::{BaseType, Causality, Initial, Variable};
use fmu_import::loader::Instance;
use std::collections::BTreeSet;
use std::sync::LazyLock;
use tempfile::TempDir;
use tests::{Fmu, all, bits, ok, reals};

/// A parameter to set before the start.
#[derive(Clone, Copy)]
enum Setting {
    Real(&'static str, f64),
    Integer(&'static str, i32),
    Boolean(&'static str, i32),
    Text(&'static str, &'static str),
}
use Setting::{Boolean, Integer, Real, Text};

/// A run that shows which parameters affect the outputs: the FMU, and the parameters to set before.
type Trial = (&'static str, &'static [Setting]);

/// Together, the trials show every dependency that the descriptions list.
const TRIALS: &[Trial] = &[
    ("Driver", &[Integer("maneuver", 1), Real("throttle.amplitude", 0.5), Real("brake.amplitude", 0.5)]),
    ("Driver", &[Integer("maneuver", 2), Real("speed.start", 2.1), Real("speed.final", 9.0)]),
    ("Driver", &[Integer("maneuver", 3)]),
    ("Driver", &[Integer("maneuver", 4), Integer("steer.cycles", 1)]),
    ("Driver", &[Integer("maneuver", 4), Real("steer.period", 0.0), Real("speed.start", 2.1)]),
    ("Driver", &[Integer("maneuver", 5)]),
    ("Driver", &[Integer("maneuver", 6), Real("steer.duration", 5.0)]),
    ("Driver", &[Integer("maneuver", 7), Text("table.file", "Driver.csv")]),
    ("Road", &[Integer("tracks", 2), Real("roughness.change_time", 2.1), Integer("roughness.start", 2)]),
    ("Road", &[Integer("tracks", 3), Integer("roughness.class", 0)]),
    ("Road", &[Integer("profile", 3), Text("table.file", "Road.csv"), Integer("obstacle.shape", 1)]),
    (
        "Road",
        &[
            Real("friction.change_start", 21.3),
            Real("friction.changed_left", 0.4),
            Real("friction.changed_right", 0.3),
            Real("geometry.axle_offset.middle", 2.1),
            Real("geometry.axle_offset.rear", 4.0),
        ],
    ),
];

/// The tables of the trials, and variants with other values.
const TABLES: [(&str, &str); 4] = [
    ("Driver.csv", "time,driver.steer,driver.speed,driver.throttle,driver.brake\n0,0.1,8,0.2,0.9\n8,0.2,9,0.3,0.4\n"),
    ("Driver_other.csv", "time,driver.steer,driver.speed,driver.throttle,driver.brake\n0,0,1,0,0\n8,0.1,2,1,1\n"),
    ("Road.csv", "distance,height_left,height_right\n0,0.01,0.02\n60,0.3,0.2\n"),
    ("Road_other.csv", "distance,height_left,height_right\n0,0,0.01\n60,0.1,0.1\n"),
];

/// The FMUs whose outputs have the values of the first sample from the start on. `PathDriver` is excluded, because this
/// applies only to its speed, and `Sensor`, because its output depends on its input.
fn sources() -> Vec<Fmu> {
    let is_source = |fmu: &Fmu| {
        let follows_inputs = fmu.description.initial_unknowns.iter().any(|unknown| {
            let known = unknown.dependencies.iter().flatten().map(|&index| &fmu.description.variables[index]);
            known.into_iter().any(|known| known.causality == Causality::Input)
        });
        let mut outputs = fmu.with(Causality::Output);
        !fmu.is_plant()
            && !follows_inputs
            && fmu.name != "PathDriver"
            && outputs.all(|output| output.initial == Some(Initial::Calculated))
    };
    all().into_iter().filter(is_source).collect()
}

/// Path of one of the tables.
fn file(name: &str) -> String {
    static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (name, text) in TABLES {
            std::fs::write(folder.path().join(name), text).expect("a table");
        }
        folder
    });
    FOLDER.path().join(name).display().to_string()
}

fn set(fmu: &Fmu, instance: &mut Instance, setting: Setting) {
    match setting {
        Real(name, value) => ok(instance.set_real(&[fmu.reference(name)], &[value])),
        Integer(name, value) => ok(instance.set_integer(&[fmu.reference(name)], &[value])),
        Boolean(name, value) => ok(instance.set_boolean(&[fmu.reference(name)], &[value])),
        Text(name, value) => ok(instance.set_string(&[fmu.reference(name)], &[&file(value)])),
    }
}

/// Other values of a parameter that the FMU accepts.
fn others(fmu: &Fmu, instance: &mut Instance, variable: &Variable) -> Vec<Setting> {
    let name: &'static str = Box::leak(variable.name.clone().into_boxed_str());
    let reference = [variable.reference];
    match variable.base_type {
        BaseType::Real => {
            let mut value = [0.0];
            ok(instance.get_real(&reference, &mut value));
            let most = variable.max.unwrap_or(f64::INFINITY);
            let higher = value[0] * 1.37 + 0.011;
            vec![Real(name, if higher > most { value[0] * 0.63 } else { higher })]
        }
        BaseType::Integer => {
            let mut value = [0];
            ok(instance.get_integer(&reference, &mut value));
            let (min, max) = (variable.min.unwrap_or(0.0) as i32, variable.max.unwrap_or(0.0) as i32);
            [value[0] + 1, value[0] - 1]
                .into_iter()
                .filter(|v| (min..=max).contains(v))
                .map(|v| Integer(name, v))
                .collect()
        }
        BaseType::Boolean => vec![Boolean(name, 1), Boolean(name, 0)],
        BaseType::String => {
            vec![Text(name, if fmu.name == "Road" { "Road_other.csv" } else { "Driver_other.csv" })]
        }
        BaseType::Binary => Vec::new(),
    }
}

#[test]
fn the_sources_are_driver_and_road() {
    let names: Vec<_> = sources().into_iter().map(|fmu| fmu.name).collect();
    assert_eq!(names, ["Driver", "Road"]);
}

/// The outputs are the same in Initialization Mode, after it, and after the first step, at any start time and for any
/// inputs.
#[test]
fn outputs_before_the_start_are_those_of_the_first_sample() {
    for fmu in sources() {
        let outputs = fmu.references(Causality::Output);
        let inputs = fmu.references(Causality::Input);
        for (_, settings) in TRIALS.iter().filter(|(name, _)| *name == fmu.name) {
            for start in [0.0, 3.0] {
                let mut instance = fmu.instance();
                settings.iter().for_each(|setting| set(&fmu, &mut instance, *setting));
                ok(instance.setup_experiment(start, None));
                ok(instance.enter_initialization_mode());
                let first = bits(&reals(&mut instance, &outputs));
                ok(instance.set_real(&inputs, &vec![33.0; inputs.len()]));
                assert_eq!(bits(&reals(&mut instance, &outputs)), first, "{}: inputs", fmu.name);
                ok(instance.exit_initialization_mode());
                assert_eq!(bits(&reals(&mut instance, &outputs)), first, "{}: after it", fmu.name);
                ok(instance.do_step(start, 0.001));
                assert_eq!(bits(&reals(&mut instance, &outputs)), first, "{}: first step", fmu.name);
            }
        }
    }
}

/// Every parameter that changes an output at any time in a run is among the dependencies of this output in
/// InitialUnknowns, and every dependency changes the output.
#[test]
fn initial_unknowns_name_the_parameters_that_act_at_any_time() {
    for fmu in sources() {
        let variables = &fmu.description.variables;
        let outputs: Vec<_> = fmu.with(Causality::Output).collect();
        let references = fmu.references(Causality::Output);
        let inputs = fmu.references(Causality::Input);
        // 8 s in steps of 0.1 s, with one sample per step unless a setting changes `sample_time`.
        let run = |settings: &[Setting]| -> Option<Vec<f64>> {
            let mut instance = fmu.instance();
            set(&fmu, &mut instance, Real("sample_time", 0.1));
            settings.iter().for_each(|setting| set(&fmu, &mut instance, *setting));
            ok(instance.setup_experiment(0.0, None));
            ok(instance.enter_initialization_mode());
            instance.exit_initialization_mode().ok()?;
            ok(instance.set_real(&inputs, &vec![7.3; inputs.len()]));
            let mut all = Vec::new();
            for k in 0..80 {
                ok(instance.do_step(f64::from(k) * 0.1, 0.1));
                all.extend(reals(&mut instance, &references));
            }
            Some(all)
        };
        let mut seen = BTreeSet::new();
        for (_, settings) in TRIALS.iter().filter(|(name, _)| *name == fmu.name) {
            let base = run(settings).expect("the trial runs");
            let mut instance = fmu.instance();
            settings.iter().for_each(|setting| set(&fmu, &mut instance, *setting));
            ok(instance.enter_initialization_mode());
            for parameter in fmu.with(Causality::Parameter) {
                for other in others(&fmu, &mut instance, parameter) {
                    let Some(found) = run(&[*settings, &[other]].concat()) else { continue };
                    for (k, (a, b)) in base.iter().zip(&found).enumerate() {
                        if a.to_bits() != b.to_bits() {
                            seen.insert((outputs[k % outputs.len()].name.as_str(), parameter.name.as_str()));
                        }
                    }
                }
            }
        }
        let mut declared = BTreeSet::new();
        for unknown in &fmu.description.initial_unknowns {
            let list = unknown.dependencies.as_ref().expect("every unknown lists its dependencies");
            let names = list.iter().map(|&index| &variables[index]);
            for variable in names {
                assert_eq!(variable.causality, Causality::Parameter, "{}: {}", fmu.name, variable.name);
                declared.insert((variables[unknown.variable].name.as_str(), variable.name.as_str()));
            }
        }
        let missing: Vec<_> = seen.difference(&declared).collect();
        assert!(missing.is_empty(), "{}: act, but are not declared: {missing:?}", fmu.name);
        let idle: Vec<_> = declared.difference(&seen).collect();
        assert!(idle.is_empty(), "{}: declared, but nothing reacts: {idle:?}", fmu.name);
    }
}
