//! `modelDescription.xml` is complete and consistent, and avoids constructs that importers are known to reject.
//!
//! Reference: FMI 2.0.4, sections 2.2 (description) and 2.1.2 (required functions).

use fmu_import::archive::platform;
use fmu_import::description::{BaseType, Causality, Initial, Unknown, Variable};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read as _;
use tests::{Fmu, all, ok, paths, symbols};
use zip::ZipArchive;

/// All functions in the standard for both interfaces. An FMU must export them even if it does not support them.
const FUNCTIONS: [&str; 44] = [
    "fmi2CancelStep",
    "fmi2CompletedIntegratorStep",
    "fmi2DeSerializeFMUstate",
    "fmi2DoStep",
    "fmi2EnterContinuousTimeMode",
    "fmi2EnterEventMode",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2FreeFMUstate",
    "fmi2FreeInstance",
    "fmi2GetBoolean",
    "fmi2GetBooleanStatus",
    "fmi2GetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetDirectionalDerivative",
    "fmi2GetEventIndicators",
    "fmi2GetFMUstate",
    "fmi2GetInteger",
    "fmi2GetIntegerStatus",
    "fmi2GetNominalsOfContinuousStates",
    "fmi2GetReal",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetRealStatus",
    "fmi2GetStatus",
    "fmi2GetString",
    "fmi2GetStringStatus",
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi2Instantiate",
    "fmi2NewDiscreteStates",
    "fmi2Reset",
    "fmi2SerializeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SetBoolean",
    "fmi2SetContinuousStates",
    "fmi2SetDebugLogging",
    "fmi2SetFMUstate",
    "fmi2SetInteger",
    "fmi2SetReal",
    "fmi2SetRealInputDerivatives",
    "fmi2SetString",
    "fmi2SetTime",
    "fmi2SetupExperiment",
    "fmi2Terminate",
];

#[test]
fn descriptions_are_complete() {
    for fmu in all() {
        let description = &fmu.description;
        let name = &fmu.name;
        let unit = description.co_simulation.as_ref().expect("a co-simulation FMU");
        // File, model and library have the same name.
        assert_eq!((&description.model_name, &unit.model_identifier), (name, name));
        assert!(description.description.as_ref().is_some_and(|text| text.len() > 20), "{name}: description");
        for text in [&description.author, &description.version, &description.license, &description.generation_tool] {
            assert!(text.as_ref().is_some_and(|text| !text.is_empty()), "{name}: an attribute is missing");
        }
        // A date, which the standard does not require, would make the bytes depend on the time of packing.
        assert!(description.generation_date_and_time.is_none(), "{name}: a date");
        assert_eq!(description.variable_naming_convention, "structured");
        // The FMUs declare exactly the capabilities that the tests in this folder cover.
        assert!(unit.can_handle_variable_communication_step_size && unit.can_not_use_memory_management_functions);
        assert!(unit.can_get_and_set_fmu_state && unit.can_serialize_fmu_state);
        assert!(!unit.can_be_instantiated_only_once_per_process && !unit.needs_execution_tool);
        // The actuators compute their steps from held inputs in closed form, without a solver.
        let has_solver = description.variables.iter().any(|variable| variable.name == "max_step");
        assert_eq!(unit.can_interpolate_inputs, has_solver, "{name}");
        assert!(!unit.can_run_asynchronously);
        assert_eq!(unit.max_output_derivative_order, 0);
        let exchange = description.model_exchange.as_ref().expect("a model exchange FMU");
        assert_eq!(exchange.model_identifier, unit.model_identifier);
        assert!(exchange.can_get_and_set_fmu_state && exchange.can_serialize_fmu_state);
        assert!(exchange.can_not_use_memory_management_functions && !exchange.needs_completed_integrator_step);
        assert!(!exchange.can_be_instantiated_only_once_per_process && !exchange.needs_execution_tool);
        assert_eq!(exchange.provides_directional_derivative, unit.provides_directional_derivative);
        let experiment = description.default_experiment;
        assert_eq!(experiment.start_time, Some(0.0), "{name}: start");
        let (Some(stop), Some(step)) = (experiment.stop_time, experiment.step_size) else {
            panic!("{name}: the default experiment has no end or no step")
        };
        assert!(
            stop > 0.0 && step > 0.0 && (stop / step - (stop / step).round()).abs() < 1e-6,
            "{name}: {stop} {step}"
        );
        assert_eq!(description.log_categories, ["logStatusError", "logStatusDiscard", "logEvents"]);
        // libcosim uses the GUID as a folder name.
        assert!(!description.guid.contains(['/', '\\']), "{name}: {}", description.guid);
        // The library accepts the GUID in the description; another test checks that it rejects other GUIDs.
        drop(fmu.instance());
        description.variables.iter().for_each(|variable| check_variable(&fmu, variable));
        for unit in &description.units {
            let base = unit.base.unwrap_or_else(|| panic!("{name}: unit {} without base units", unit.name));
            assert!(base.factor > 0.0, "{name}: unit {}", unit.name);
            assert!(unit.display_units.iter().all(|display| display.factor > 0.0), "{name}: unit {}", unit.name);
        }
        check_structure(&fmu);
    }
}

/// Variables without a fixed unit. Their values are in m or s, depending on another parameter, or in the unit of the
/// connected signal. They declare no unit, not even "1".
const WITHOUT_UNIT: [&str; 13] = [
    "obstacle.start",
    "obstacle.length",
    "sensor.true_value",
    "sensor.measured_value",
    "sensor.bias",
    "sensor.noise",
    "sensor.resolution",
    "actuator.command",
    "actuator.value",
    "actuator.rate_limit",
    "actuator.minimum",
    "actuator.maximum",
    "actuator.initial_value",
];

/// Returns true if a variable, or the variable that it is the derivative of, has no fixed unit.
fn is_without_unit(variable: &Variable) -> bool {
    let name = variable.name.as_str();
    let name = name.strip_prefix("der(").and_then(|name| name.strip_suffix(')')).unwrap_or(name);
    WITHOUT_UNIT.contains(&name)
}

/// A name in this project's form of the convention `structured`: words and positions in lower case, joined by dots.
fn is_plain_name(name: &str) -> bool {
    let name = name.strip_prefix("der(").and_then(|name| name.strip_suffix(')')).unwrap_or(name);
    name.split('.').all(|word| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    })
}

fn check_variable(fmu: &Fmu, variable: &Variable) {
    let place = format!("{}: {}", fmu.name, variable.name);
    assert!(is_plain_name(&variable.name), "{place}: the name");
    let text = variable.description.as_deref().unwrap_or_default();
    assert!(text.len() > 3 && text == text.trim(), "{place}: the description '{text}'");
    if variable.base_type == BaseType::Real && !is_without_unit(variable) {
        let unit = variable.unit.as_deref().unwrap_or_else(|| panic!("{place} has no unit"));
        let unit = fmu.description.unit(unit).unwrap_or_else(|| panic!("{place}: unit {unit} is not defined"));
        if let Some(display) = &variable.display_unit {
            let is_known = unit.display_units.iter().any(|known| known.name == *display);
            assert!(is_known, "{place}: display unit {display} is not defined");
        }
    }
    if is_without_unit(variable) {
        assert_eq!(variable.unit, None, "{place}: a unit");
    }
    // Every input, every parameter and every exact variable has a start value. Calculated variables have no start
    // value, and inputs have no `initial`.
    let is_set = variable.causality == Causality::Input || variable.initial == Some(Initial::Exact);
    assert_eq!(variable.start.is_some(), is_set, "{place}: start value");
    assert_eq!(variable.initial.is_none(), variable.causality == Causality::Input, "{place}: initial");
}

fn check_structure(fmu: &Fmu) {
    let description = &fmu.description;
    let name = &fmu.name;
    let listed = |list: &[Unknown]| list.iter().map(|unknown| unknown.variable).collect::<BTreeSet<_>>();
    let positions = |wanted: &dyn Fn(&Variable) -> bool| {
        let all = description.variables.iter().enumerate();
        all.filter(|(_, variable)| wanted(variable)).map(|(position, _)| position).collect::<BTreeSet<_>>()
    };
    assert_eq!(listed(&description.outputs), positions(&|v| v.causality == Causality::Output), "{name}: Outputs");
    assert_eq!(listed(&description.derivatives), positions(&|v| v.derivative_of.is_some()), "{name}: Derivatives");
    let calculated = positions(&|v| v.initial == Some(Initial::Calculated));
    assert_eq!(listed(&description.initial_unknowns), calculated, "{name}: InitialUnknowns");
    // Without a list, an importer must assume that an unknown depends on everything, and would find algebraic loops
    // that do not exist.
    for unknown in description.outputs.iter().chain(&description.derivatives).chain(&description.initial_unknowns) {
        assert!(unknown.dependencies.is_some(), "{name}: {}", description.variables[unknown.variable].name);
    }
    // No two variables share a value reference (aliases); one importer rejects aliases among outputs.
    let references: BTreeSet<_> = description.variables.iter().map(|v| (v.base_type, v.reference)).collect();
    assert_eq!(references.len(), description.variables.len(), "{name}: two variables share a value reference");
}

#[test]
fn every_function_of_the_standard_is_there() {
    // Importers look up all functions when they load the library, even those that the FMU does not support.
    let suffix = std::env::consts::DLL_SUFFIX;
    for path in paths() {
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8");
        let mut zip = ZipArchive::new(File::open(&path).expect("the FMU can be read")).expect("a zip archive");
        let mut library = Vec::new();
        let mut entry = zip.by_name(&format!("binaries/{}/{name}{suffix}", platform())).expect("a library");
        entry.read_to_end(&mut library).expect("the library can be unpacked");
        let found = symbols::exported(&library);
        // On macOS, C symbols begin with an underscore.
        let found: Vec<_> = found.iter().map(|name| name.trim_start_matches('_')).collect();
        assert_eq!(found, FUNCTIONS, "{name}");
    }
}

/// An FMU works from a copy of its file, because it stores nothing elsewhere.
#[test]
fn a_copy_of_the_file_is_as_good() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for fmu in all() {
        // A folder name with a space and a non-ASCII letter.
        let place = folder.path().join("a b\u{e4}");
        std::fs::create_dir_all(&place).expect("a folder");
        let copy = place.join(format!("{}.fmu", fmu.name));
        std::fs::copy(&fmu.path, &copy).expect("a copy");
        let other = Fmu::open(&copy);
        let mut instances = [fmu.started(), other.started()];
        for instance in &mut instances {
            ok(instance.do_step(0.0, 0.001));
        }
        let [a, b] = instances.each_mut().map(|instance| tests::bits(&tests::reals(instance, &fmu.reals())));
        assert!(a == b, "{}", fmu.name);
    }
}
