//! Which function may be called when, for every function, every state and every FMU.
//!
//! Reference: the table "allowed function calls" of FMI 2.0.4, section 4.2.4, written down here once more by hand,
//! with the rules of the project's ARCHITECTURE.md on top: after a failed step nothing may be set, saved or stepped; no
//! step is ever pending, so fmi2CancelStep is always rejected; questions without an answer are discarded.

use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality};
use fmu_import::loader::{CallError, CallProblem, Instance, SavedState, Status};
use tests::{Fmu, all, ok};

/// Where an instance can stand, as the standard numbers its columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Instantiated,
    Initialization,
    StepComplete,
    StepFailed,
    Terminated,
}
use State::{Initialization, Instantiated, StepComplete, StepFailed, Terminated};

const STATES: [State; 5] = [Instantiated, Initialization, StepComplete, StepFailed, Terminated];

type Call = fn(&Fmu, &mut Instance, SavedState) -> Result<(), CallError>;

/// A row: function; a sign for each of [`STATES`]: its letter where the call succeeds, d where it is discarded, a point
/// where it is rejected; the call, which gets a state that was saved in Instantiated.
const TABLE: &[(&str, &str, Call)] = &[
    ("fmi2SetDebugLogging", "insft", |_, i, _| i.set_debug_logging(true, &["logStatusError"])),
    ("fmi2SetupExperiment", "i....", |_, i, _| i.setup_experiment(0.0, Some(10.0))),
    ("fmi2EnterInitializationMode", "i....", |_, i, _| i.enter_initialization_mode()),
    ("fmi2ExitInitializationMode", ".n...", |_, i, _| i.exit_initialization_mode()),
    ("fmi2Terminate", "..sf.", |_, i, _| i.terminate()),
    ("fmi2Reset", "insft", |_, i, _| i.reset()),
    ("fmi2GetReal", ".nsft", |f, i, _| i.get_real(&f.reals(), &mut vec![0.0; f.reals().len()])),
    ("fmi2GetInteger", ".nsft", |f, i, _| {
        let references = of_type(f, BaseType::Integer);
        i.get_integer(&references, &mut vec![0; references.len()])
    }),
    ("fmi2GetBoolean", ".nsft", |f, i, _| {
        let references = of_type(f, BaseType::Boolean);
        i.get_boolean(&references, &mut vec![0; references.len()])
    }),
    ("fmi2GetString", ".nsft", |f, i, _| i.get_string(&of_type(f, BaseType::String)).map(drop)),
    ("fmi2SetReal", "ins..", |f, i, _| {
        let references = f.references(Causality::Input);
        i.set_real(&references, &vec![1.0; references.len()])
    }),
    // No unit has inputs of these types: an empty array is in order where the function is.
    ("fmi2SetInteger", "ins..", |_, i, _| i.set_integer(&[], &[])),
    ("fmi2SetBoolean", "ins..", |_, i, _| i.set_boolean(&[], &[])),
    ("fmi2SetString", "ins..", |_, i, _| i.set_string(&[], &[])),
    // The standard lets a failed instance be saved; what a step left behind is not worth it (ARCHITECTURE, Status).
    ("fmi2GetFMUstate", "ins.t", |_, i, _| i.save_state().map(drop)),
    ("fmi2SetFMUstate", "insft", |_, i, s| i.restore_state(&s)),
    ("fmi2FreeFMUstate", "insft", |_, i, s| i.free_state(s)),
    ("fmi2SerializedFMUstateSize, fmi2SerializeFMUstate", "insft", |_, i, s| i.serialize_state(&s).map(drop)),
    ("fmi2DeSerializeFMUstate", "insft", |f, i, _| {
        let mut other = f.started();
        let saved = ok(other.save_state());
        i.deserialize_state(&ok(other.serialize_state(&saved))).map(drop)
    }),
    ("fmi2GetDirectionalDerivative", ".nsft", |f, i, _| {
        let (unknown, known) = (f.references(Causality::Output), f.references(Causality::Input));
        i.get_directional_derivative(&unknown[..1], &known, &vec![1.0; known.len()], &mut [0.0])
    }),
    ("fmi2SetRealInputDerivatives", ".....", |_, i, _| i.set_real_input_derivatives(&[], &[], &[])),
    ("fmi2GetRealOutputDerivatives", ".....", |_, i, _| i.get_real_output_derivatives(&[], &[], &mut [])),
    ("fmi2DoStep", "..s..", |_, i, _| i.do_step(0.0, 0.001)),
    ("fmi2CancelStep", ".....", |_, i, _| i.cancel_step()),
    ("fmi2GetStatus", "..ddd", |_, i, _| i.do_step_status().map(drop)),
    ("fmi2GetIntegerStatus", "..ddd", |_, i, _| i.integer_status(0).map(drop)),
    ("fmi2GetStringStatus", "..ddd", |_, i, _| i.pending_status().map(drop)),
    ("fmi2GetRealStatus", "..sft", |_, i, _| i.last_successful_time().map(drop)),
    ("fmi2GetBooleanStatus", "..sft", |_, i, _| i.wants_termination().map(drop)),
];

/// Where a call leads that succeeds and changes the state.
const TRANSITIONS: [(&str, State); 5] = [
    ("fmi2EnterInitializationMode", Initialization),
    ("fmi2ExitInitializationMode", StepComplete),
    ("fmi2Terminate", Terminated),
    ("fmi2Reset", Instantiated),
    ("fmi2SetFMUstate", Instantiated),
];

fn of_type(fmu: &Fmu, base_type: BaseType) -> Vec<Reference> {
    fmu.description.variables.iter().filter(|v| v.base_type == base_type).map(|v| v.reference).collect()
}

/// A new instance in a state, with a state saved before; `None` if no input makes a step of this FMU fail.
fn bring(fmu: &Fmu, state: State, failing: Option<&[f64]>) -> Option<(Instance, SavedState)> {
    let mut instance = if state == StepFailed { fmu.instance_with(failing?) } else { fmu.instance() };
    let saved = ok(instance.save_state());
    if state != Instantiated {
        ok(instance.enter_initialization_mode());
    }
    if matches!(state, StepComplete | StepFailed | Terminated) {
        ok(instance.exit_initialization_mode());
    }
    match state {
        StepFailed => drop(tests::rejected(instance.do_step(0.0, Fmu::FAILING_STEP))),
        Terminated => ok(instance.terminate()),
        _ => {}
    }
    Some((instance, saved))
}

/// Where an instance stands, found by trying what only one state allows; the instance is used up.
fn probe(mut instance: Instance) -> State {
    let time = instance.last_successful_time().unwrap_or(0.0);
    if instance.setup_experiment(0.0, None).is_ok() {
        Instantiated
    } else if instance.exit_initialization_mode().is_ok() {
        Initialization
    } else if instance.do_step(time, 0.001).is_ok() {
        StepComplete
    } else if instance.terminate().is_ok() {
        StepFailed
    } else {
        Terminated
    }
}

/// Everything that can be known of an instance: its saved bytes, or its values where it cannot be saved.
fn content(fmu: &Fmu, instance: &mut Instance) -> Vec<u8> {
    match instance.save_state() {
        Ok(saved) => ok(instance.serialize_state(&saved)),
        Err(_) => tests::reals(instance, &fmu.reals()).into_iter().flat_map(f64::to_le_bytes).collect(),
    }
}

#[test]
fn every_function_in_every_state() {
    let mut failed = Vec::new();
    for fmu in all() {
        let failing = fmu.failing_inputs();
        for (position, state) in STATES.into_iter().enumerate() {
            for (function, signs, call) in TABLE {
                let Some((mut instance, saved)) = bring(&fmu, state, failing.as_deref()) else { continue };
                if state == StepFailed && failed.last() != Some(&fmu.name) {
                    failed.push(fmu.name.clone());
                }
                let is_known = *function != "fmi2GetDirectionalDerivative" || fmu.is_plant();
                let sign = if is_known { signs.as_bytes()[position] } else { b'.' };
                let place = format!("{}: {function} in {state:?}", fmu.name);
                let before = content(&fmu, &mut instance);
                let result = call(&fmu, &mut instance, saved);
                let expected = match (sign, result) {
                    (b'.', Err(CallError { problem: CallProblem::Status(Status::Error), messages, .. })) => {
                        let text = messages.first().map(|message| message.text.clone()).unwrap_or_default();
                        let first = function.split(',').next().expect("a name");
                        assert!(text.starts_with(first), "{place}: the message does not say what was called: {text}");
                        assert_eq!(content(&fmu, &mut instance), before, "{place}: a rejected call changed something");
                        state
                    }
                    (b'd', Err(CallError { problem: CallProblem::Status(Status::Discard), .. })) => state,
                    (b'i' | b'n' | b's' | b'f' | b't', Ok(())) => {
                        TRANSITIONS.iter().find(|(name, _)| name == function).map_or(state, |(_, next)| *next)
                    }
                    (_, result) => {
                        panic!("{place}: sign {:?} was expected, the answer is {result:?}", char::from(sign))
                    }
                };
                assert_eq!(probe(instance), expected, "{place}: the state after the call");
            }
        }
    }
    // The plants can be driven out of the range of numbers; if no unit could, nothing would be tested here.
    assert!(failed.iter().any(|name| name == "RescueVehicle"), "no failed step of RescueVehicle, only of {failed:?}");
    println!("states after a failed step were reached in {}", failed.join(", "));
}

#[test]
fn a_message_says_where_a_call_was_made_and_where_it_may_be() {
    for fmu in all() {
        let mut instance = fmu.instance();
        assert_eq!(
            tests::rejected(instance.do_step(0.0, 0.001)),
            "fmi2DoStep called in Instantiated, allowed in Step Mode",
            "{}",
            fmu.name
        );
    }
}

#[test]
fn the_start_may_be_left_out() {
    // fmi2SetupExperiment is not asked for: the start is 0 and there is no stop.
    for fmu in all() {
        let mut instance = fmu.instance();
        ok(instance.enter_initialization_mode());
        ok(instance.exit_initialization_mode());
        ok(instance.do_step(0.0, 0.001));
        assert_eq!(ok(instance.last_successful_time()), 0.001, "{}", fmu.name);
    }
}
