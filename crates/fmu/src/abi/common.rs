//! The functions that are the same in FMI 2.0 and FMI 3.0.

use std::collections::HashSet;
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::c::{c_char, c_int, size_t};
use super::float_environment::argument;
use super::{
    Component, Export, FmuState, Handle, Log, Status, call, float_environment, functions, scheduled, text, updates,
    words,
};
use crate::calls::{Function, Interface};
use crate::description::{LOG_CATEGORIES, LOG_ERROR, LOG_EVENTS};
use crate::instance::Instance;
use crate::runner::Model as _;

pub(super) fn provides<E: Export>(interface: Interface) -> bool {
    let has_model = match interface {
        Interface::CoSimulation => true,
        Interface::ModelExchange => E::Model::MODEL_EXCHANGE,
        Interface::ScheduledExecution => scheduled::is_provided::<E>(),
    };
    has_model && E::FORMAT.interfaces.contains(interface)
}

/// Creates an instance, or logs the reason for the failure and returns a null pointer.
pub(super) unsafe fn create<E: Export>(
    function: &str,
    mut log: Log,
    name: *const c_char,
    make: impl FnOnce() -> Result<Instance<E::Model>, String>,
) -> Component {
    let run = AssertUnwindSafe(|| {
        // SAFETY: a string from the caller.
        let name = unsafe { text(name) }.map_err(|e| format!("instanceName is {e}"))?;
        log.name = CString::new(name).expect("a C string has no inner zeros");
        if name.is_empty() {
            return Err("instanceName is empty".to_owned());
        }
        make()
    });
    let callers = float_environment::enter();
    let result = catch_unwind(run);
    float_environment::leave(callers);
    let message = match result {
        Ok(Ok(instance)) => {
            return scheduled::allocate(Handle::<E> {
                instance,
                log,
                snapshots: HashSet::default(),
                returns_early: false,
                updates: None,
                elements: Vec::new(),
            });
        }
        Ok(Err(message)) => message,
        Err(panic) => format!("internal error: {}", words(&*panic)),
    };
    log.write(Status::Error, LOG_ERROR, &format!("{function}: {message}"));
    std::ptr::null_mut()
}

/// Rejects a GUID or instantiation token that is not the FMU's.
pub(super) unsafe fn check_guid<E: Export>(name: &str, guid: *const c_char) -> Result<(), String> {
    // SAFETY: a string from the caller.
    let guid = unsafe { text(guid) }.map_err(|e| format!("{name} is {e}"))?;
    let expected = &E::description().guid;
    if guid == expected {
        return Ok(());
    }
    Err(format!("{name} must be {expected}, got {guid}; the library and modelDescription.xml do not belong together"))
}

/// fmi2FreeInstance; a null pointer is ignored.
pub unsafe fn free_instance<E: Export>(component: Component) {
    let handle = component.cast::<Handle<E>>();
    if !handle.is_null() && handle.is_aligned() {
        // SAFETY: made by `scheduled::allocate`, not freed yet. A model with intermediate updates has no scheduled
        // execution, so no other thread changes the handle.
        if updates::are_provided::<E>()
            && let h = unsafe { &*handle }
            && updates::is_calling(h)
        {
            let message = "fmi3FreeInstance called in Intermediate Update Mode; the instance was not freed";
            h.log.write(Status::Error, LOG_ERROR, message);
            return;
        }
        // SAFETY: as above.
        if unsafe { scheduled::rejects_free::<E>(component) } {
            return;
        }
        // A panic here cannot be reported: the logger is dropped, too.
        let callers = float_environment::enter();
        // SAFETY: made by `scheduled::allocate`, freed once.
        let _ = catch_unwind(AssertUnwindSafe(move || unsafe { scheduled::free::<E>(component) }));
        float_environment::leave(callers);
    }
}

functions! {
    fn set_debug_logging[SetDebugLogging](h, call, is_on: impl Into<c_int>, count: size_t, categories: *const *const c_char) {
        let is_on = is_on.into() != 0;
        let names = call.array("categories", categories, count)?;
        let mut wanted = [is_on && names.is_empty(); LOG_CATEGORIES.len()];
        for &name in names {
            let name = text(name).map_err(|e| call.error(format_args!("a category is {e}")))?;
            let known = LOG_CATEGORIES.iter().position(|(known, _)| *known == name).ok_or_else(|| {
                let all = LOG_CATEGORIES.map(|(known, _)| known).join(", ");
                call.error(format_args!("category '{name}' is unknown, expected one of {all}"))
            })?;
            wanted[known] = is_on;
        }
        h.log.wanted = wanted;
        Ok(())
    }

    fn exit_initialization_mode[ExitInitializationMode](h, _) {
        h.instance.exit_initialization()?;
        h.log.write(Status::Ok, LOG_EVENTS, "initialized");
        Ok(())
    }

    fn terminate[Terminate](h, _) {
        h.instance.terminate()?;
        h.log.write(Status::Ok, LOG_EVENTS, &format!("terminated at {} s", h.instance.time()));
        Ok(())
    }

    fn reset[Reset](h, call) {
        if updates::is_calling(h) {
            return Err(call.error("must not be called in an intermediate update; first return from the callback"));
        }
        h.instance.reset()?;
        h.log.write(Status::Ok, LOG_EVENTS, "reset");
        Ok(())
    }

    /// fmi2GetFMUstate: creates a state, or overwrites one that was saved before.
    fn get_fmu_state[GetFMUstate](h, call, state: *mut FmuState) {
        let state = call.target("FMUstate", state)?;
        if state.is_null() {
            let snapshot = h.instance.snapshot()?;
            *state = h.hand_out(snapshot);
        } else {
            let known = call.snapshot(h, *state)?;
            *known = h.instance.snapshot()?;
        }
        Ok(())
    }

    fn set_fmu_state[SetFMUstate](h, call, state: FmuState) {
        let snapshot = call.snapshot(h, state)?;
        h.instance.restore(&*snapshot)?;
        h.log.write(Status::Ok, LOG_EVENTS, &format!("state at {} s restored", h.instance.time()));
        Ok(())
    }

    /// fmi2FreeFMUstate; a null pointer is ignored.
    fn free_fmu_state[FreeFMUstate](h, call, state: *mut FmuState) {
        if state.is_null() {
            return Ok(());
        }
        let state = call.target("FMUstate", state)?;
        if state.is_null() {
            return Ok(());
        }
        let snapshot = call.snapshot(h, *state)?;
        h.snapshots.remove(&snapshot);
        drop(Box::from_raw(snapshot));
        *state = std::ptr::null_mut();
        Ok(())
    }

    fn serialized_fmu_state_size[SerializedFMUstateSize](h, call, state: FmuState, size: *mut size_t) {
        let snapshot = call.snapshot(h, state)?;
        *call.target("size", size)? = h.instance.serialize(&*snapshot)?.len();
        Ok(())
    }

    fn serialize_fmu_state[SerializeFMUstate](h, call, state: FmuState, bytes: *mut impl Sized, size: size_t) {
        let snapshot = call.snapshot(h, state)?;
        let written = h.instance.serialize(&*snapshot)?;
        if size < written.len() {
            return Err(call.error(format_args!("size must be at least {}, got {size}", written.len())));
        }
        call.array_mut("serializedState", bytes.cast::<u8>(), written.len())?.copy_from_slice(&written);
        Ok(())
    }

    fn deserialize_fmu_state[DeSerializeFMUstate](h, call, bytes: *const impl Sized, size: size_t, state: *mut FmuState) {
        let state = call.target("FMUstate", state)?;
        let snapshot = h.instance.deserialize(call.array("serializedState", bytes.cast::<u8>(), size)?)?;
        if state.is_null() {
            *state = h.hand_out(snapshot);
        } else {
            let known = call.snapshot(h, *state)?;
            *known = snapshot;
        }
        Ok(())
    }

    fn enter_event_mode[EnterEventMode](h, _) { h.instance.enter_event_mode() }

    fn enter_continuous_time_mode[EnterContinuousTimeMode](h, _) { h.instance.enter_continuous_time_mode() }

    fn set_time[SetTime](h, _, time: f64) { h.instance.set_time(argument(time)) }

    fn set_continuous_states[SetContinuousStates](h, call, states: *const f64, count: size_t) {
        h.instance.set_continuous_states(call.array("x", states, count)?)
    }

    fn get_derivatives[GetDerivatives](h, call, values: *mut f64, count: size_t) {
        h.instance.state_derivatives(call.array_mut("derivatives", values, count)?)
    }

    fn get_event_indicators[GetEventIndicators](h, call, values: *mut f64, count: size_t) {
        h.instance.event_indicators(call.array_mut("eventIndicators", values, count)?)
    }

    fn get_continuous_states[GetContinuousStates](h, call, values: *mut f64, count: size_t) {
        h.instance.continuous_states(call.array_mut("x", values, count)?)
    }

    fn get_nominals_of_continuous_states[GetNominalsOfContinuousStates](h, call, values: *mut f64, count: size_t) {
        h.instance.nominals(call.array_mut("x_nominal", values, count)?)
    }

    /// fmi2CompletedIntegratorStep: never requests Event Mode, because every state event has an indicator.
    fn completed_integrator_step[CompletedIntegratorStep](
        h, call, _no_set_before: impl Copy, enter_event_mode: *mut impl From<bool>, terminate: *mut impl From<bool>
    ) {
        let event = call.target("enterEventMode", enter_event_mode)?;
        let end = call.target("terminateSimulation", terminate)?;
        (*event, *end) = (false.into(), false.into());
        if E::Model::HAS_CLOCKS { h.instance.check_integrator_step() } else { Ok(()) }
    }
}
