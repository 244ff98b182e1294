//! Wrong arguments are rejected with fmi2Error and, if there is a logger, with a message. They change nothing.
//!
//! Reference: FMI 2.0.4, sections 2.1.3 (status) and 2.2.7 (which variables can be set when), and ARCHITECTURE.md
//! ("Status"): the message of a rejected call names the value, the place and the rule; the call changes nothing and
//! keeps the FMU state.

use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, Value, Variability, Variable};
use fmu_import::loader::{CallError, Instance};
use std::ffi::CString;
use tests::raw::{self, Arguments, EventArguments, Raw, RawInstance, RawState, Text, Truth};
use tests::signals::{Random, start};
use tests::{Fmu, all, is_fixed, ok, reals, rejected};

/// A number that no FMU uses as a value reference.
const UNKNOWN: Reference = 4_000_000_000;

type Rejected = Result<(), CallError>;

fn state(instance: &mut Instance) -> Vec<u8> {
    let saved = ok(instance.save_state());
    ok(instance.serialize_state(&saved))
}

/// Checks that a call is rejected with a message that contains `words`, and changes nothing.
fn rejects(instance: &mut Instance, words: &[&str], call: impl FnOnce(&mut Instance) -> Rejected) {
    let before = state(instance);
    let message = rejected(call(instance));
    for word in words {
        assert!(message.contains(word), "'{word}' is missing in: {message}");
    }
    assert_eq!(state(instance), before, "a rejected call changed something: {message}");
}

fn variables_of(fmu: &Fmu, base_type: BaseType) -> impl Iterator<Item = &Variable> {
    fmu.description.variables.iter().filter(move |variable| variable.base_type == base_type)
}

/// An instance in Initialization Mode.
fn initializing(fmu: &Fmu) -> Instance {
    let mut instance = fmu.instance();
    ok(instance.enter_initialization_mode());
    instance
}

#[test]
fn unknown_references_and_wrong_types_are_rejected() {
    for fmu in all() {
        let mut instance = initializing(&fmu);
        let first = fmu.references(Causality::Output)[0];
        // The first reference is valid: rejecting the second must not leave its value set or written.
        let mut written = [7.0, 7.0];
        let message = rejected(instance.get_real(&[first, UNKNOWN], &mut written));
        assert!(message.contains("4000000000") && message.contains("Real"), "{}: {message}", fmu.name);
        assert_eq!(written, [7.0, 7.0], "{}: a rejected call wrote a value", fmu.name);
        rejects(&mut instance, &["4000000000"], |i| i.set_real(&[UNKNOWN], &[1.0]));
        rejects(&mut instance, &["4000000000"], |i| i.get_integer(&[UNKNOWN], &mut [0]));
        rejects(&mut instance, &["4000000000"], |i| i.set_integer(&[UNKNOWN], &[1]));
        rejects(&mut instance, &["4000000000"], |i| i.get_boolean(&[UNKNOWN], &mut [0]));
        rejects(&mut instance, &["4000000000"], |i| i.set_boolean(&[UNKNOWN], &[1]));
        rejects(&mut instance, &["4000000000"], |i| i.get_string(&[UNKNOWN]).map(drop));
        rejects(&mut instance, &["4000000000"], |i| i.set_string(&[UNKNOWN], &["a"]));
        // The reference belongs to a variable of another type, which the message names.
        let name = fmu.description.variables.iter().find(|v| v.reference == first).expect("it exists").name.clone();
        rejects(&mut instance, &[&name, "Integer"], |i| i.get_integer(&[first], &mut [0]));
        rejects(&mut instance, &[&name, "Boolean"], |i| i.set_boolean(&[first], &[1]));
        rejects(&mut instance, &[&name, "String"], |i| i.get_string(&[first]).map(drop));
        for base_type in [BaseType::Integer, BaseType::Boolean, BaseType::String] {
            for variable in variables_of(&fmu, base_type) {
                rejects(&mut instance, &[&variable.name, "Real"], |i| i.get_real(&[variable.reference], &mut [0.0]));
                rejects(&mut instance, &[&variable.name, "Real"], |i| i.set_real(&[variable.reference], &[1.0]));
            }
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_rejected() {
    for fmu in all() {
        let mut instance = initializing(&fmu);
        let settable = |v: &&Variable| matches!(v.causality, Causality::Input | Causality::Parameter);
        for variable in variables_of(&fmu, BaseType::Real).filter(settable) {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                rejects(&mut instance, &[&variable.name, "finite"], |i| i.set_real(&[variable.reference], &[value]));
            }
        }
        // If one of several values is rejected, none of these values is set.
        let inputs = fmu.references(Causality::Input);
        if inputs.len() > 1 {
            rejects(&mut instance, &["NaN"], |i| i.set_real(&inputs[..2], &[1.0, f64::NAN]));
        }
    }
}

#[test]
fn numbers_outside_their_limits_are_rejected() {
    let (mut reals_checked, mut integers_checked) = (0, 0);
    for fmu in all() {
        let mut instance = initializing(&fmu);
        for variable in fmu.with(Causality::Parameter) {
            let reference = [variable.reference];
            match variable.base_type {
                BaseType::Real => {
                    for (limit, outside) in [
                        (variable.min, variable.min.map(|min| min - 1e-6 * min.abs().max(1.0))),
                        (variable.max, variable.max.map(|max| max + 1e-6 * max.abs().max(1.0))),
                    ] {
                        let (Some(limit), Some(outside)) = (limit, outside) else { continue };
                        rejects(&mut instance, &[&variable.name, "must be"], |i| i.set_real(&reference, &[outside]));
                        // The limit itself is an allowed value. Whether a simulation with this value is possible is
                        // checked at the end of initialization.
                        ok(instance.set_real(&reference, &[limit]));
                        ok(instance.set_real(&reference, &[start(variable)]));
                        reals_checked += 1;
                    }
                }
                BaseType::Integer => {
                    for outside in [variable.min.map(|min| min - 1.0), variable.max.map(|max| max + 1.0)] {
                        let Some(outside) = outside.filter(|value| value.abs() < 2e9) else { continue };
                        rejects(&mut instance, &[&variable.name, "must be"], |i| {
                            i.set_integer(&reference, &[outside as i32])
                        });
                        integers_checked += 1;
                    }
                }
                BaseType::Boolean | BaseType::String | BaseType::Binary => {}
            }
        }
    }
    assert!(reals_checked > 50 && integers_checked > 5, "{reals_checked} reals, {integers_checked} integers");
}

/// The start value of a variable, set through the function of its type.
fn set_start(instance: &mut Instance, variable: &Variable) -> Rejected {
    let reference = [variable.reference];
    match &variable.start {
        Some(Value::Real(value)) => instance.set_real(&reference, &[*value]),
        Some(Value::Integer(value)) => instance.set_integer(&reference, &[i32::try_from(*value).unwrap()]),
        Some(Value::Boolean(value)) => instance.set_boolean(&reference, &[i32::from(*value)]),
        Some(value) => instance.set_value(variable.reference, value),
        None => instance.set_real(&reference, &[0.0]),
    }
}

#[test]
fn every_variable_can_be_set_when_the_standard_says_so_and_not_otherwise() {
    for fmu in all() {
        let mut before = fmu.instance();
        let mut initializing = initializing(&fmu);
        let mut stepping = fmu.started();
        for variable in &fmu.description.variables {
            let has_start = variable.start.is_some();
            let (at_start, later) = match variable.causality {
                Causality::Input => (true, true),
                Causality::Parameter => (true, variable.variability == Variability::Tunable),
                // States, and the held outputs of discrete-time models, have initial = exact.
                Causality::Output | Causality::Local => (has_start, false),
                Causality::CalculatedParameter | Causality::Independent | Causality::StructuralParameter => {
                    (false, false)
                }
            };
            for (instance, allowed) in [(&mut before, at_start), (&mut initializing, at_start), (&mut stepping, later)]
            {
                if allowed {
                    if let Err(error) = set_start(instance, variable) {
                        panic!("{}: {error}", fmu.name);
                    }
                } else {
                    rejects(instance, &[&variable.name], |i| set_start(i, variable));
                }
            }
            if is_fixed(variable) {
                rejects(&mut stepping, &["fixed", "Initialization Mode"], |i| set_start(i, variable));
            }
        }
    }
}

#[test]
fn start_values_are_those_of_the_description() {
    for fmu in all() {
        let mut instance = initializing(&fmu);
        for variable in &fmu.description.variables {
            let reference = [variable.reference];
            match &variable.start {
                Some(Value::Real(value)) => {
                    assert_eq!(reals(&mut instance, &reference), [*value], "{}: {}", fmu.name, variable.name);
                }
                Some(Value::Integer(value)) => {
                    let mut found = [0];
                    ok(instance.get_integer(&reference, &mut found));
                    assert_eq!(i64::from(found[0]), *value, "{}: {}", fmu.name, variable.name);
                }
                Some(Value::Boolean(value)) => {
                    let mut found = [0];
                    ok(instance.get_boolean(&reference, &mut found));
                    assert_eq!(found, [i32::from(*value)], "{}: {}", fmu.name, variable.name);
                }
                Some(Value::String(value)) => {
                    assert_eq!(&ok(instance.get_string(&reference))[0], value, "{}: {}", fmu.name, variable.name);
                }
                Some(value) => {
                    assert_eq!(
                        ok(instance.get_values(variable)),
                        std::slice::from_ref(value),
                        "{}: {}",
                        fmu.name,
                        variable.name
                    );
                }
                None => {}
            }
        }
    }
}

#[test]
fn impossible_times_are_rejected() {
    for fmu in all() {
        let mut instance = fmu.instance();
        rejects(&mut instance, &["startTime"], |i| i.setup_experiment(f64::NAN, None));
        rejects(&mut instance, &["startTime"], |i| i.setup_experiment(f64::INFINITY, None));
        rejects(&mut instance, &["stopTime"], |i| i.setup_experiment(1.0, Some(0.5)));
        rejects(&mut instance, &["stopTime"], |i| i.setup_experiment(0.0, Some(f64::NAN)));
        ok(instance.setup_experiment(0.0, Some(0.01)));
        ok(instance.enter_initialization_mode());
        ok(instance.exit_initialization_mode());
        for step in [0.0, -0.001, f64::NAN, f64::INFINITY] {
            rejects(&mut instance, &["communicationStepSize"], |i| i.do_step(0.0, step));
        }
        // The time must agree with the instance's time to within a millionth of the step.
        for time in [0.001, -0.001, 2e-9, f64::NAN] {
            rejects(&mut instance, &["currentCommunicationPoint"], |i| i.do_step(time, 0.001));
        }
        rejects(&mut instance, &["stopTime"], |i| i.do_step(0.0, 0.0101));
        ok(instance.do_step(5e-10, 0.001));
        ok(instance.do_step(0.001, 0.009));
        rejects(&mut instance, &["stopTime"], |i| i.do_step(0.01, 0.001));

        // The step is smaller than the spacing of numbers at this time, so the time would not advance.
        let mut late = fmu.started_at(1e9);
        rejects(&mut late, &["does not advance"], |i| i.do_step(1e9, 1e-9));
        // More than a million substeps or samples in one call are rejected as a mistake in units. A plant that is
        // solved exactly has no substeps.
        if ["max_step", "sample_time"].iter().any(|name| fmu.description.variable(name).is_some()) {
            let mut long = fmu.started();
            rejects(&mut long, &["integration steps or samples"], |i| i.do_step(0.0, 1e6));
        }
    }
}

#[test]
fn an_fmu_is_made_only_of_what_belongs_to_it() {
    for fmu in all() {
        let other = Instance::instantiate(&fmu.library, "a", "{00000000-0000-0000-0000-000000000000}", false);
        let message = rejected(other);
        assert!(
            message.contains(&fmu.description.guid),
            "{}: the message does not contain the expected GUID: {message}",
            fmu.name
        );
        assert!(
            rejected(Instance::instantiate(&fmu.library, "", &fmu.description.guid, false)).contains("instanceName")
        );
    }
}

#[test]
fn null_pointers_are_rejected_or_ignored_but_never_followed() {
    for fmu in all() {
        let raw = Raw::load(&fmu);
        assert_eq!(raw.texts(), ["2.0", "default"], "{}", fmu.name);
        let guid = CString::new(raw.guid()).expect("no zero inside");
        let good = Arguments {
            name: Some(c"a"),
            kind: 1,
            guid: Some(&guid),
            resources: Some(c"file:///r"),
            callbacks: true,
            events: EventArguments::default(),
        };
        for bad in [
            Arguments { name: None, ..good },
            Arguments { name: Some(c""), ..good },
            Arguments { name: Some(c"\xff\xfe"), ..good },
            Arguments { guid: None, ..good },
            Arguments { guid: Some(c"{}"), ..good },
            Arguments { guid: Some(c"\xff"), ..good },
            Arguments { resources: Some(c"file:///\xff"), ..good },
            Arguments { kind: -1, ..good },
            Arguments { kind: 2, ..good },
            Arguments { callbacks: false, ..good },
        ] {
            assert!(raw.instantiate(bad).is_none(), "{}: {bad:?}", fmu.name);
        }
        // Many masters pass no logger, and no folder to FMUs without resources.
        let instance = raw.instantiate(Arguments { resources: None, ..good }).expect("no folder is needed");
        let output = [fmu.references(Causality::Output)[0]];
        everything_is_rejected(&raw.null(), &output);

        assert_eq!(instance.setup_experiment(0.0), raw::OK);
        assert_eq!(instance.transition("fmi2EnterInitializationMode"), raw::OK);
        null_arrays(&instance, &output);
        null_states(&raw, &instance, good);
        assert_eq!(instance.transition("fmi2ExitInitializationMode"), raw::OK);
        assert_eq!(instance.do_step(0.0, 0.001), raw::OK);
        assert_eq!(instance.real_status(2, None), raw::ERROR);
        assert_eq!(instance.boolean_status(3, None), raw::ERROR);
        assert_eq!(instance.status(99), raw::DISCARD);
        let mut time = 0.0;
        assert_eq!(instance.real_status(99, Some(&mut time)), raw::DISCARD);
        assert_eq!(instance.real_status(2, Some(&mut time)), raw::OK);
        assert_eq!(time, 0.001);
    }
}

/// Every function rejects a null pointer as the instance.
fn everything_is_rejected(null: &RawInstance<'_>, output: &[Reference]) {
    let mut state = RawState::NULL;
    let transitions = ["EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset", "CancelStep"];
    for name in transitions {
        assert_eq!(null.transition(&format!("fmi2{name}")), raw::ERROR, "{name}");
    }
    assert_eq!(null.get(Some(output), 1, Some(&mut [0.0])), raw::ERROR);
    assert_eq!(null.get(Some(output), 1, Some(&mut [0])), raw::ERROR);
    assert_eq!(null.get(Some(output), 1, Some(&mut [Truth(0)])), raw::ERROR);
    assert_eq!(null.get(Some(output), 1, Some(&mut [Text::new(None)])), raw::ERROR);
    assert_eq!(null.set(Some(output), 1, Some(&[0.0])), raw::ERROR);
    assert_eq!(null.set(Some(output), 1, Some(&[0])), raw::ERROR);
    assert_eq!(null.set(Some(output), 1, Some(&[Truth(0)])), raw::ERROR);
    assert_eq!(null.set(Some(output), 1, Some(&[Text::new(None)])), raw::ERROR);
    assert_eq!(null.setup_experiment(0.0), raw::ERROR);
    assert_eq!(null.do_step(0.0, 0.001), raw::ERROR);
    assert_eq!(null.set_debug_logging(0, None), raw::ERROR);
    assert_eq!(null.get_state(Some(&mut state)), raw::ERROR);
    assert_eq!(null.set_state(state), raw::ERROR);
    assert_eq!(null.free_state(Some(&mut state)), raw::ERROR);
    assert_eq!(null.state_size(state, Some(&mut 0)), raw::ERROR);
    assert_eq!(null.serialize(state, Some(&mut [0]), 1), raw::ERROR);
    assert_eq!(null.deserialize(Some(&[0]), 1, Some(&mut state)), raw::ERROR);
    assert_eq!(null.status(0), raw::ERROR);
    assert_eq!(null.real_status(2, Some(&mut 0.0)), raw::ERROR);
    assert_eq!(null.boolean_status(3, Some(&mut 0)), raw::ERROR);
    assert_eq!(null.directional_derivative(Some(output), Some(output), Some(&[1.0]), Some(&mut [0.0])), raw::ERROR);
}

/// A null array is rejected if the stated number of values is not 0, and accepted if it is 0.
fn null_arrays(instance: &RawInstance<'_>, output: &[Reference]) {
    assert_eq!(instance.get::<f64>(None, 1, Some(&mut [0.0])), raw::ERROR);
    assert_eq!(instance.get::<f64>(Some(output), 1, None), raw::ERROR);
    assert_eq!(instance.get::<i32>(None, 1, Some(&mut [0])), raw::ERROR);
    assert_eq!(instance.get::<i32>(Some(output), 1, None), raw::ERROR);
    assert_eq!(instance.get::<Truth>(None, 1, Some(&mut [Truth(0)])), raw::ERROR);
    assert_eq!(instance.get::<Truth>(Some(output), 1, None), raw::ERROR);
    assert_eq!(instance.get::<Text<'_>>(None, 1, None), raw::ERROR);
    assert_eq!(instance.set::<f64>(None, 1, Some(&[0.0])), raw::ERROR);
    assert_eq!(instance.set::<f64>(Some(output), 1, None), raw::ERROR);
    assert_eq!(instance.set::<i32>(None, 1, Some(&[0])), raw::ERROR);
    assert_eq!(instance.set::<Truth>(None, 1, Some(&[Truth(0)])), raw::ERROR);
    assert_eq!(instance.set(Some(output), 1, Some(&[Text::new(None)])), raw::ERROR);
    assert_eq!(instance.set(Some(output), 1, Some(&[Text::new(Some(c"\xff"))])), raw::ERROR);
    assert_eq!(instance.get::<f64>(None, 0, None), raw::OK);
    assert_eq!(instance.get::<i32>(None, 0, None), raw::OK);
    assert_eq!(instance.get::<Truth>(None, 0, None), raw::OK);
    assert_eq!(instance.get::<Text<'_>>(None, 0, None), raw::OK);
    assert_eq!(instance.set::<f64>(None, 0, None), raw::OK);
    assert_eq!(instance.set::<i32>(None, 0, None), raw::OK);
    assert_eq!(instance.set::<Truth>(None, 0, None), raw::OK);
    assert_eq!(instance.set::<Text<'_>>(None, 0, None), raw::OK);
    assert_eq!(instance.set_debug_logging(1, None), raw::ERROR);
    assert_eq!(instance.set_debug_logging(1, Some(&[Text::new(None)])), raw::ERROR);
    assert_eq!(instance.set_debug_logging(1, Some(&[Text::new(Some(c"no such category"))])), raw::ERROR);
    assert_eq!(instance.set_debug_logging(0, None), raw::OK);
    for missing in 0..4 {
        let (mut value, seed) = ([0.0], [1.0]);
        let status = instance.directional_derivative(
            (missing != 0).then_some(output),
            (missing != 1).then_some(output),
            (missing != 2).then_some(&seed),
            (missing != 3).then_some(&mut value),
        );
        assert_eq!(status, raw::ERROR, "array {missing} of fmi2GetDirectionalDerivative is null");
    }
}

/// States that are null, freed, from another instance, or of the wrong size are rejected.
fn null_states(raw: &Raw, instance: &RawInstance<'_>, arguments: Arguments<'_>) {
    assert_eq!(instance.get_state(None), raw::ERROR);
    assert_eq!(instance.set_state(RawState::NULL), raw::ERROR);
    assert_eq!(instance.free_state(None), raw::OK, "like free(NULL)");
    assert_eq!(instance.free_state(Some(&mut { RawState::NULL })), raw::OK, "like free(NULL)");
    let mut size = 0;
    assert_eq!(instance.state_size(RawState::NULL, Some(&mut size)), raw::ERROR);

    let mut saved = RawState::NULL;
    assert_eq!(instance.get_state(Some(&mut saved)), raw::OK);
    assert!(!saved.is_null());
    assert_eq!(instance.state_size(saved, None), raw::ERROR);
    assert_eq!(instance.state_size(saved, Some(&mut size)), raw::OK);
    let mut bytes = vec![0; size];
    assert_eq!(instance.serialize(saved, None, size), raw::ERROR);
    assert_eq!(instance.serialize(saved, Some(&mut bytes), size - 1), raw::ERROR);
    assert_eq!(instance.serialize(saved, Some(&mut bytes), 0), raw::ERROR);
    assert!(bytes.iter().all(|&byte| byte == 0), "a rejected call wrote bytes");
    assert_eq!(instance.serialize(saved, Some(&mut bytes), size), raw::OK);

    let mut copy = RawState::NULL;
    assert_eq!(instance.deserialize(None, size, Some(&mut copy)), raw::ERROR);
    assert_eq!(instance.deserialize(Some(&bytes), size, None), raw::ERROR);
    assert_eq!(instance.deserialize(Some(&bytes), 0, Some(&mut copy)), raw::ERROR);
    assert!(copy.is_null(), "a rejected call gave out a state");

    // A state belongs to the instance that saved it, until it is freed.
    let other = raw.instantiate(arguments).expect("a second instance");
    assert_eq!(other.set_state(saved), raw::ERROR, "a state of another instance");
    let freed = saved;
    assert_eq!(instance.free_state(Some(&mut saved)), raw::OK);
    assert!(saved.is_null(), "the pointer is set to null");
    assert_eq!(instance.set_state(freed), raw::ERROR, "a state that was freed");
    assert_eq!(instance.state_size(freed, Some(&mut size)), raw::ERROR, "a state that was freed");
    assert_eq!(instance.free_state(Some(&mut { freed })), raw::ERROR, "freed twice");
}

#[test]
fn damaged_bytes_of_a_state_are_rejected() {
    let fmus = all();
    let mut random = Random(7);
    for (number, fmu) in fmus.iter().enumerate() {
        let mut instance = fmu.started();
        ok(instance.do_step(0.0, 0.001));
        let good = state(&mut instance);
        let mut check = |bytes: &[u8]| {
            rejects(&mut instance, &["fmi2DeSerializeFMUstate"], |i| i.deserialize_state(bytes).map(drop));
        };
        check(&[]);
        check(&good[..good.len() - 1]);
        check(&good[..8]);
        check(&[&good[..], &[0]].concat());
        check(&vec![0; good.len()]);
        // A bit is flipped in each byte at the beginning and at the end, and in random bytes in between.
        let middle = (0..64).map(|_| random.below(good.len() as u64) as usize);
        for position in (0..64).chain(good.len() - 16..good.len()).chain(middle) {
            let mut bytes = good.clone();
            bytes[position] ^= 1 << (position % 8);
            check(&bytes);
        }
        // The state of another FMU.
        let mut other = fmus[(number + 1) % fmus.len()].started();
        if fmus.len() > 1 {
            check(&state(&mut other));
        }
        let saved = ok(instance.deserialize_state(&good));
        ok(instance.restore_state(&saved));
        assert_eq!(state(&mut instance), good, "{}: the good bytes restore the same state", fmu.name);
    }
}
