//! FMI 3.0, and model exchange in both versions, with an FMU built from C. The reference is the closed-form solution.
#![cfg(unix)]

#[path = "support/decay.rs"]
mod decay;

use decay::Decay;
use fmu_import::description::{FmiVersion, Interface};
use fmu_import::fmu::{Fmu, FmuError};
use fmu_import::loader::{CallProblem, Instance, Status};
use std::path::Path;
use tempfile::TempDir;

const X: u32 = 1;
const DX: u32 = 2;
const K: u32 = 3;
const U: u32 = 4;
const Y: u32 = 5;
const COUNT: u32 = 6;

fn started(build: &Decay<'_>, interface: Interface) -> (TempDir, Instance) {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open_for(build.pack(folder.path()), interface).unwrap();
    let mut instance = fmu.instantiate("one").unwrap();
    instance.setup_experiment(0.0, Some(2.0)).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    (folder, instance)
}

fn real(instance: &mut Instance, reference: u32) -> f64 {
    let mut value = [f64::NAN];
    instance.get_real(&[reference], &mut value).unwrap();
    value[0]
}

/// x(t) and the number of events: x falls from 1 to 0.5 in ln(2) / k, then repeatedly from 1.5 to 0.5 in ln(3) / k.
fn solution(k: f64, time: f64) -> (f64, i32) {
    let first = 2_f64.ln() / k;
    if time < first {
        return ((-k * time).exp(), 0);
    }
    let period = 3_f64.ln() / k;
    let events = ((time - first) / period).floor();
    (1.5 * (-k * (time - first - events * period)).exp(), events as i32 + 1)
}

#[test]
fn steps_of_co_simulation_follow_the_closed_form() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let (_folder, mut instance) = started(&Decay::new(fmi), Interface::CoSimulation);
        for step in 0..200 {
            let time = 0.01 * f64::from(step);
            instance.do_step(time, 0.01).unwrap();
            let (x, events) = solution(2.0, time + 0.01);
            assert!((real(&mut instance, X) - x).abs() < 1e-12, "{fmi}: {step}");
            let mut count = [0];
            instance.get_integer(&[COUNT], &mut count).unwrap();
            assert_eq!(count, [events], "{fmi}: {step}");
        }
        assert_eq!(solution(2.0, 2.0).1, 4);
        instance.terminate().unwrap();
    }
}

#[test]
fn all_types_of_fmi_3_are_read_and_set() {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(Decay::new(FmiVersion::V3).pack(folder.path())).unwrap();
    let mut instance = fmu.instantiate("one").unwrap();
    let at = |name: &str| fmu.description().variable(name).unwrap().reference;
    instance.set_integer(&[at("small"), at("wide")], &[-5, 100]).unwrap();
    let too_large = instance.set_integer(&[at("small")], &[200]).unwrap_err();
    assert_eq!(too_large.to_string(), "`one`: fmi3SetInt8: a value does not fit the type of the variable");
    instance.set_string(&[at("label")], &["käse"]).unwrap();
    instance.set_boolean(&[at("bits")], &[0, 1]).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();

    // Scalars and arrays in one call; a Float32 is converted.
    instance.set_real(&[at("u"), at("v")], &[3.0, 10.0, 20.0, 30.0]).unwrap();
    let mut values = [0.0; 6];
    instance.get_real(&[at("y"), at("w"), at("y32"), at("u")], &mut values).unwrap();
    assert_eq!(values, [4.0, 10.0, 20.0, 30.0, 1.5, 3.0]);
    let mut values = [0; 5];
    instance.get_integer(&[at("small"), at("wide"), at("sum"), at("mode"), at("next")], &mut values).unwrap();
    assert_eq!(values, [-5, 100, 95, 1, 2]);
    instance.set_integer(&[at("mode")], &[2]).unwrap();
    instance.get_integer(&[at("next")], &mut values[..1]).unwrap();
    assert_eq!(values[0], 3);
    let mut bits = [7; 4];
    instance.set_boolean(&[at("flag")], &[1]).unwrap();
    instance.get_boolean(&[at("flag"), at("not"), at("bits")], &mut bits).unwrap();
    assert_eq!(bits, [1, 0, 0, 1]);
    let strings = instance.get_string(&[at("label"), at("resources")]).unwrap();
    assert_eq!(strings[0], "käse");
    assert!(strings[1].ends_with('/'), "{}", strings[1]);
    assert_eq!(std::fs::read_to_string(Path::new(&strings[1]).join("note.txt")).unwrap(), "here");

    // The number of values must equal the number of elements, and each function accepts only variables of its type.
    let error = instance.get_real(&[at("w")], &mut [0.0; 2]).unwrap_err();
    assert!(matches!(error.problem, CallProblem::Arguments(_)), "{error}");
    let error = instance.get_integer(&[at("w")], &mut [0; 3]).unwrap_err();
    assert_eq!(error.to_string(), "`one`: fmi3GetInt32: the variable has another type");
    let error = instance.get_real(&[77], &mut [0.0]).unwrap_err();
    assert_eq!(error.problem, CallProblem::Status(Status::Error));
    assert_eq!(error.to_string(), "`one`: fmi3GetFloat64 returned fmi3Error");
}

#[test]
fn states_and_derivatives_of_fmi_3() {
    let build = Decay::new(FmiVersion::V3);
    let (_folder, mut instance) = started(&build, Interface::CoSimulation);
    instance.do_step(0.0, 0.25).unwrap();
    let saved = instance.save_state().unwrap();
    let bytes = instance.serialize_state(&saved).unwrap();
    let x = real(&mut instance, X);
    instance.do_step(0.25, 0.5).unwrap();
    assert_ne!(real(&mut instance, X), x);
    instance.restore_state(&saved).unwrap();
    assert_eq!(real(&mut instance, X), x);
    let (_other_folder, mut other) = started(&build, Interface::CoSimulation);
    let read = other.deserialize_state(&bytes).unwrap();
    other.restore_state(&read).unwrap();
    assert_eq!(real(&mut other, X), x);
    instance.free_state(saved).unwrap();

    // d(der(x), w)/d(x, v): [-k 0 0 0; 1 x 0 0; 2 0 x 0; 3 0 0 x].
    let (unknowns, knowns) = ([DX, 19], [X, 18]);
    let mut result = [0.0; 4];
    instance.get_directional_derivative(&unknowns, &knowns, &[1.0, 10.0, 0.0, 100.0], &mut result).unwrap();
    assert_eq!(result, [-2.0, 1.0 + 10.0 * x, 2.0, 3.0 + 100.0 * x]);
    instance.get_adjoint_derivative(&unknowns, &knowns, &[1.0, 10.0, 0.0, 100.0], &mut result).unwrap();
    assert_eq!(result, [-2.0 + 10.0 + 300.0, 10.0 * x, 0.0, 100.0 * x]);
    let error = instance.get_adjoint_derivative(&unknowns, &knowns, &[1.0], &mut result).unwrap_err();
    assert!(matches!(error.problem, CallProblem::Arguments(_)), "{error}");

    let (_folder, mut old) = started(&Decay::new(FmiVersion::V2), Interface::CoSimulation);
    let error = old.get_adjoint_derivative(&[DX], &[X], &[1.0], &mut [0.0]).unwrap_err();
    assert_eq!(error.problem, CallProblem::NotExported);
}

/// The test integrates with the classical Runge-Kutta method between events, which it finds by bisection.
#[test]
fn model_exchange_follows_the_closed_form() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let (_folder, mut instance) = started(&Decay::new(fmi), Interface::ModelExchange);
        assert_eq!((instance.number_of_states(), instance.number_of_event_indicators()), (1, 1));
        if fmi == FmiVersion::V3 {
            assert_eq!(instance.get_number_of_states().unwrap(), 1);
            assert_eq!(instance.get_number_of_event_indicators().unwrap(), 1);
        }
        settle(&mut instance);
        let mut nominal = [0.0];
        instance.get_nominals(&mut nominal).unwrap();
        assert_eq!(nominal, [1.0]);
        let mut x = [0.0];
        instance.get_continuous_states(&mut x).unwrap();
        assert_eq!(x, [1.0]);
        let (mut time, mut events) = (0.0, 0);
        for step in 1..=200 {
            let end = 0.01 * f64::from(step);
            let reached = advance(&mut instance, time, x[0], end - time);
            if reached > 0.5 {
                x[0] = reached;
            } else {
                // Bisection until the interval around x = 0.5 no longer shrinks.
                let (mut low, mut high) = (0.0, end - time);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    let is_before = advance(&mut instance, time, x[0], middle) > 0.5;
                    if is_before { low = middle } else { high = middle }
                }
                x[0] = advance(&mut instance, time, x[0], high);
                instance.set_time(time + high).unwrap();
                instance.set_continuous_states(&x).unwrap();
                let mut indicator = [1.0];
                instance.get_event_indicators(&mut indicator).unwrap();
                assert!(indicator[0] <= 0.0);
                instance.enter_event_mode().unwrap();
                assert!(settle(&mut instance));
                instance.get_continuous_states(&mut x).unwrap();
                events += 1;
                x[0] = advance(&mut instance, time + high, x[0], end - time - high);
            }
            time = end;
            instance.set_time(time).unwrap();
            instance.set_continuous_states(&x).unwrap();
            assert!(!instance.completed_integrator_step().unwrap().enters_event_mode);
            let expected = solution(2.0, time);
            assert!((x[0] - expected.0).abs() < 1e-7, "{fmi}: {step}: {} {}", x[0], expected.0);
            assert_eq!(events, expected.1);
        }
        assert_eq!(events, 4);
    }
}

/// Handles an event. Returns true if states changed.
fn settle(instance: &mut Instance) -> bool {
    let mut changed = false;
    loop {
        let update = instance.new_discrete_states().unwrap();
        assert!(!update.terminates && update.next_event.is_none());
        changed |= update.states_changed;
        if !update.is_needed_again {
            break;
        }
    }
    instance.enter_continuous_time_mode().unwrap();
    changed
}

/// x after a step of the classical Runge-Kutta method.
fn advance(instance: &mut Instance, time: f64, x: f64, h: f64) -> f64 {
    let mut slope = |time: f64, x: f64| {
        let mut derivative = [0.0];
        instance.set_time(time).unwrap();
        instance.set_continuous_states(&[x]).unwrap();
        instance.get_derivatives(&mut derivative).unwrap();
        derivative[0]
    };
    let a = slope(time, x);
    let b = slope(time + 0.5 * h, x + 0.5 * h * a);
    let c = slope(time + 0.5 * h, x + 0.5 * h * b);
    let d = slope(time + h, x + h * c);
    x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
}

#[test]
fn errors_contain_the_function_names_of_the_version() {
    let folder = TempDir::new().unwrap();
    let wrong = Decay { edits: &[("{decay}", "{other}")], ..Decay::new(FmiVersion::V3) };
    let error = Fmu::open(wrong.pack(folder.path())).unwrap().instantiate("one").unwrap_err();
    let expected = "`one`: fmi3InstantiateCoSimulation returned no instance\n  fmi3Error: wrong token, 100 %";
    assert_eq!(error.to_string(), expected);
    let error = Fmu::open_for(wrong.pack(folder.path()), Interface::ModelExchange).unwrap().instantiate("one");
    assert!(error.unwrap_err().to_string().starts_with("`one`: fmi3InstantiateModelExchange returned no instance"));

    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let (_folder, mut instance) = started(&Decay::new(fmi), Interface::ModelExchange);
        let error = instance.do_step(0.0, 0.1).unwrap_err();
        assert_eq!(error.problem, CallProblem::Interface(Interface::ModelExchange));
        let error = instance.get_derivatives(&mut [0.0; 2]).unwrap_err();
        assert!(matches!(error.problem, CallProblem::Arguments(_)), "{error}");
        let (_folder, mut instance) = started(&Decay::new(fmi), Interface::CoSimulation);
        let error = instance.enter_event_mode().unwrap_err();
        assert_eq!(error.problem, CallProblem::Interface(Interface::CoSimulation));
    }
    let line = include_str!("data/decay2.xml").lines().find(|line| line.contains("<CoSimulation")).unwrap();
    let only_exchange = Decay { edits: &[(line, "")], ..Decay::new(FmiVersion::V2) };
    let error = Fmu::open(only_exchange.pack(folder.path())).unwrap_err();
    assert!(matches!(error, FmuError::Archive(_)), "{error}");
    assert!(
        error.to_string().ends_with("the FMU has no interface for co-simulation; it has model exchange"),
        "{error}"
    );
}

/// A step that ends the simulation is complete (FMI 3.0.2, section 4.2.1). An early return is an error, because the
/// importer did not allow it.
#[test]
fn steps_that_end_otherwise_are_errors() {
    let ends = Decay { defects: &["ENDS=0.5"], ..Decay::new(FmiVersion::V3) };
    let (_folder, mut instance) = started(&ends, Interface::CoSimulation);
    instance.do_step(0.0, 0.25).unwrap();
    assert_eq!(instance.wants_termination(), Ok(false));
    let error = instance.do_step(0.75, 0.25).unwrap_err();
    assert_eq!(error.problem, CallProblem::Terminated);
    assert_eq!(error.to_string(), "`one`: the FMU ended the simulation in fmi3DoStep");
    assert_eq!((instance.wants_termination(), instance.last_successful_time()), (Ok(true), Ok(1.0)));
    let early = Decay { defects: &["EARLY"], ..Decay::new(FmiVersion::V3) };
    let (_folder, mut instance) = started(&early, Interface::CoSimulation);
    assert_eq!(instance.do_step(0.0, 0.25).unwrap_err().problem, CallProblem::EarlyReturn);
}

/// Booleans are converted in blocks; all values must reach the right variables.
#[test]
fn many_booleans_take_several_calls() {
    let (_folder, mut instance) = started(&Decay::new(FmiVersion::V3), Interface::CoSimulation);
    instance.set_boolean(&[9], &[1]).unwrap();
    let references: Vec<u32> = (0..200).map(|i| 9 + i % 2).collect();
    let mut values = vec![7; 200];
    instance.get_boolean(&references, &mut values).unwrap();
    assert!(values.iter().enumerate().all(|(i, value)| *value == i32::from(i % 2 == 0)));
    instance.set_real(&[K, U], &[1.0, 2.0]).unwrap();
    assert_eq!(real(&mut instance, Y), 3.0);
}
