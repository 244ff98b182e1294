//! The functions that are the same in FMI 2.0 and FMI 3.0.

use std::collections::HashSet;
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::c::{c_char, c_int, size_t};
use super::float_environment::argument;
use super::{
    Component, Export, FmuState, Handle, Log, Status, array, array_mut, call, error, float_environment, target, text,
    words,
};
use crate::calls::{Function, Interface};
use crate::description::{LOG_CATEGORIES, LOG_ERROR, LOG_EVENTS};
use crate::instance::Instance;
use crate::runner::Model as _;

/// Returns true if the FMU provides an interface.
pub(super) fn provides<E: Export>(interface: Interface) -> bool {
    match interface {
        Interface::CoSimulation => E::FORMAT.interfaces.co_simulation,
        Interface::ModelExchange => E::FORMAT.interfaces.model_exchange && E::Model::MODEL_EXCHANGE,
    }
}

/// Makes an instance, or logs the reason for the failure and returns a null pointer.
pub(super) unsafe fn create<E: Export>(
    function: &str,
    mut log: Log,
    name: *const c_char,
    make: impl FnOnce() -> Result<Instance<E::Model>, String>,
) -> Component {
    let run = AssertUnwindSafe(|| {
        // SAFETY: a string of the caller.
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
            return Box::into_raw(Box::new(Handle::<E> {
                instance,
                log,
                snapshots: HashSet::default(),
                returns_early: false,
                elements: Vec::new(),
            }))
            .cast();
        }
        Ok(Err(message)) => message,
        Err(panic) => format!("internal error: {}", words(&*panic)),
    };
    log.write(Status::Error as c_int, LOG_ERROR, &format!("{function}: {message}"));
    std::ptr::null_mut()
}

/// Rejects another GUID or instantiation token than that of the FMU.
pub(super) unsafe fn check_guid<E: Export>(name: &str, guid: *const c_char) -> Result<(), String> {
    // SAFETY: a string of the caller.
    let guid = unsafe { text(guid) }.map_err(|e| format!("{name} is {e}"))?;
    let expected = &E::description().guid;
    if guid == expected {
        return Ok(());
    }
    Err(format!("{name} must be {expected}, got {guid}; the library and modelDescription.xml do not belong together"))
}

/// fmi2SetDebugLogging, fmi3SetDebugLogging.
pub(super) unsafe fn set_log_categories<E: Export>(
    component: Component,
    is_on: bool,
    count: size_t,
    categories: *const *const c_char,
) -> Status {
    let function = Function::SetDebugLogging;
    let run = |handle: &mut Handle<E>| {
        // SAFETY: the caller's array.
        let names = unsafe { array::<E, _>(function, "categories", categories, count) }?;
        let mut wanted = [is_on && names.is_empty(); LOG_CATEGORIES.len()];
        for &name in names {
            // SAFETY: the caller's strings.
            let name = unsafe { text(name) }.map_err(|e| error::<E>(function, &format!("a category is {e}")))?;
            let known = LOG_CATEGORIES.iter().position(|(known, _)| *known == name).ok_or_else(|| {
                let all: Vec<_> = LOG_CATEGORIES.iter().map(|(known, _)| *known).collect();
                error::<E>(function, &format!("category '{name}' is unknown, expected one of {}", all.join(", ")))
            })?;
            wanted[known] = is_on;
        }
        handle.log.wanted = wanted;
        Ok(())
    };
    // SAFETY: see the module's documentation; the same holds for every call below.
    unsafe { call::<E>(component, function, run) }
}

/// fmi2FreeInstance; a null pointer is ignored.
pub unsafe fn free_instance<E: Export>(component: Component) {
    let handle = component.cast::<Handle<E>>();
    if !handle.is_null() && handle.is_aligned() {
        // SAFETY: made by Box::into_raw in `instantiate`, freed once.
        let handle = unsafe { Box::from_raw(handle) };
        // Nothing is left to report to if dropping panicked.
        let callers = float_environment::enter();
        let _ = catch_unwind(AssertUnwindSafe(move || drop(handle)));
        float_environment::leave(callers);
    }
}

/// fmi2ExitInitializationMode.
pub unsafe fn exit_initialization_mode<E: Export>(component: Component) -> Status {
    unsafe {
        call::<E>(component, Function::ExitInitializationMode, |h| {
            h.instance.exit_initialization()?;
            h.log.write(Status::Ok as c_int, LOG_EVENTS, "initialized");
            Ok(())
        })
    }
}

/// fmi2Terminate.
pub unsafe fn terminate<E: Export>(component: Component) -> Status {
    unsafe {
        call::<E>(component, Function::Terminate, |h| {
            h.instance.terminate()?;
            h.log.write(Status::Ok as c_int, LOG_EVENTS, &format!("terminated at {} s", h.instance.time()));
            Ok(())
        })
    }
}

/// fmi2Reset.
pub unsafe fn reset<E: Export>(component: Component) -> Status {
    unsafe {
        call::<E>(component, Function::Reset, |h| {
            h.instance.reset()?;
            h.log.write(Status::Ok as c_int, LOG_EVENTS, "reset");
            Ok(())
        })
    }
}

/// fmi2GetFMUstate: into a new state, or into one that was saved before.
pub unsafe fn get_fmu_state<E: Export>(component: Component, state: *mut FmuState) -> Status {
    let function = Function::GetFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let state = target::<E, _>(function, "FMUstate", state)?;
            if state.is_null() {
                let snapshot = h.instance.snapshot()?;
                *state = h.hand_out(snapshot);
            } else {
                let known = h.snapshot(function, *state)?;
                *known = h.instance.snapshot()?;
            }
            Ok(())
        })
    }
}

/// fmi2SetFMUstate.
pub unsafe fn set_fmu_state<E: Export>(component: Component, state: FmuState) -> Status {
    let function = Function::SetFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let snapshot = h.snapshot(function, state)?;
            h.instance.restore(&*snapshot)?;
            h.log.write(Status::Ok as c_int, LOG_EVENTS, &format!("state at {} s restored", h.instance.time()));
            Ok(())
        })
    }
}

/// fmi2FreeFMUstate; a null pointer is ignored.
pub unsafe fn free_fmu_state<E: Export>(component: Component, state: *mut FmuState) -> Status {
    let function = Function::FreeFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            if state.is_null() {
                return Ok(());
            }
            let state = target::<E, _>(function, "FMUstate", state)?;
            if state.is_null() {
                return Ok(());
            }
            let snapshot = h.snapshot(function, *state)?;
            h.snapshots.remove(&snapshot);
            drop(Box::from_raw(snapshot));
            *state = std::ptr::null_mut();
            Ok(())
        })
    }
}

/// fmi2SerializedFMUstateSize.
pub unsafe fn serialized_fmu_state_size<E: Export>(component: Component, state: FmuState, size: *mut size_t) -> Status {
    let function = Function::SerializedFMUstateSize;
    unsafe {
        call::<E>(component, function, |h| {
            let snapshot = h.snapshot(function, state)?;
            *target::<E, _>(function, "size", size)? = h.instance.serialize(&*snapshot)?.len();
            Ok(())
        })
    }
}

/// fmi2SerializeFMUstate.
pub unsafe fn serialize_fmu_state<E: Export>(
    component: Component,
    state: FmuState,
    bytes: *mut impl Sized,
    size: size_t,
) -> Status {
    let function = Function::SerializeFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let snapshot = h.snapshot(function, state)?;
            let written = h.instance.serialize(&*snapshot)?;
            if size < written.len() {
                return Err(error::<E>(function, &format!("size must be at least {}, got {size}", written.len())));
            }
            array_mut::<E, _>(function, "serializedState", bytes.cast::<u8>(), written.len())?
                .copy_from_slice(&written);
            Ok(())
        })
    }
}

/// fmi2DeSerializeFMUstate.
pub unsafe fn deserialize_fmu_state<E: Export>(
    component: Component,
    bytes: *const impl Sized,
    size: size_t,
    state: *mut FmuState,
) -> Status {
    let function = Function::DeSerializeFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let state = target::<E, _>(function, "FMUstate", state)?;
            let snapshot =
                h.instance.deserialize(array::<E, _>(function, "serializedState", bytes.cast::<u8>(), size)?)?;
            if state.is_null() {
                *state = h.hand_out(snapshot);
            } else {
                let known = h.snapshot(function, *state)?;
                *known = snapshot;
            }
            Ok(())
        })
    }
}

/// fmi2EnterEventMode.
pub unsafe fn enter_event_mode<E: Export>(component: Component) -> Status {
    unsafe { call::<E>(component, Function::EnterEventMode, |h| h.instance.enter_event_mode()) }
}

/// fmi2EnterContinuousTimeMode.
pub unsafe fn enter_continuous_time_mode<E: Export>(component: Component) -> Status {
    unsafe { call::<E>(component, Function::EnterContinuousTimeMode, |h| h.instance.enter_continuous_time_mode()) }
}

/// fmi2SetTime.
pub unsafe fn set_time<E: Export>(component: Component, time: f64) -> Status {
    unsafe { call::<E>(component, Function::SetTime, |h| h.instance.set_time(argument(time))) }
}

/// fmi2SetContinuousStates.
pub unsafe fn set_continuous_states<E: Export>(component: Component, states: *const f64, count: size_t) -> Status {
    let function = Function::SetContinuousStates;
    unsafe {
        call::<E>(component, function, |h| {
            h.instance.set_continuous_states(array::<E, _>(function, "x", states, count)?)
        })
    }
}

macro_rules! arrays {
    ($($(#[$doc:meta])* $name:ident $function:ident $argument:literal $fill:ident;)*) => {$(
        $(#[$doc])*
        pub unsafe fn $name<E: Export>(component: Component, values: *mut f64, count: size_t) -> Status {
            let function = Function::$function;
            unsafe {
                call::<E>(component, function, |h| {
                    h.instance.$fill(array_mut::<E, _>(function, $argument, values, count)?)
                })
            }
        }
    )*};
}
arrays! {
    /// fmi2GetDerivatives.
    get_derivatives GetDerivatives "derivatives" state_derivatives;
    /// fmi2GetEventIndicators.
    get_event_indicators GetEventIndicators "eventIndicators" event_indicators;
    /// fmi2GetContinuousStates.
    get_continuous_states GetContinuousStates "x" continuous_states;
    /// fmi2GetNominalsOfContinuousStates.
    get_nominals_of_continuous_states GetNominalsOfContinuousStates "x_nominal" nominals;
}

/// fmi2CompletedIntegratorStep: no step ends with an event that the indicators do not show.
pub unsafe fn completed_integrator_step<E: Export>(
    component: Component,
    _no_set_before: impl Copy,
    enter_event_mode: *mut impl From<bool>,
    terminate: *mut impl From<bool>,
) -> Status {
    let function = Function::CompletedIntegratorStep;
    unsafe {
        call::<E>(component, function, |_| {
            let event = target::<E, _>(function, "enterEventMode", enter_event_mode)?;
            let end = target::<E, _>(function, "terminateSimulation", terminate)?;
            (*event, *end) = (false.into(), false.into());
            Ok(())
        })
    }
}
