//! C types of FMI 2.0, and of FMI 3.0 in [`v3`]. The functions are called in [`crate::loader`].
//!
//! Source: FMI 2.0.4, sections 2.1, 3.2 and 4.2, and its headers `fmi2TypesPlatform.h` ("default") and
//! `fmi2FunctionTypes.h`.

pub mod v3;

use std::ffi::{c_char, c_int, c_uint, c_void};

/// `fmi2Component`: an instance, opaque to the caller.
pub type Component = *mut c_void;
/// `fmi2FMUstate`: a saved state of an instance, opaque to the caller.
pub type State = *mut c_void;
/// `fmi2ValueReference`.
pub type Reference = c_uint;
/// `fmi2Boolean`: 0 is false, 1 is true.
pub type Boolean = c_int;
/// `fmi2Status` from C code, which may contain any number.
pub type RawStatus = c_int;

/// `fmi2True`.
pub const TRUE: Boolean = 1;
/// `fmi2False`.
pub const FALSE: Boolean = 0;
/// `fmi2ModelExchange` of `fmi2Type`.
pub const MODEL_EXCHANGE: c_int = 0;
/// `fmi2CoSimulation` of `fmi2Type`.
pub const CO_SIMULATION: c_int = 1;

/// `fmi2CallbackLogger`: environment, instance name, status, category, printf format, values.
pub type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, RawStatus, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub struct CallbackFunctions {
    /// Receives messages.
    pub logger: Logger,
    /// Allocates zeroed memory. The arguments are the number of objects and the size of one object in bytes.
    pub allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    /// Frees memory from `allocate_memory`; null is allowed.
    pub free_memory: unsafe extern "C" fn(*mut c_void),
    /// Called at the end of an asynchronous step; `None` if steps are synchronous.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, RawStatus)>,
    /// First argument of `logger`.
    pub environment: *mut c_void,
}

/// Type of a function that takes an instance and returns a status.
macro_rules! call {
    ($($argument:ty),*) => { unsafe extern "C" fn($crate::c_api::Component, $($argument),*) -> $crate::c_api::RawStatus };
}
use call;

/// `fmi2GetVersion`, `fmi2GetTypesPlatform`.
pub type GetText = unsafe extern "C" fn() -> *const c_char;
/// `fmi2Instantiate`: name, type, GUID, resource location, callbacks, visible, logging on.
pub type Instantiate = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const CallbackFunctions,
    Boolean,
    Boolean,
) -> Component;
/// `fmi2FreeInstance`.
pub type FreeInstance = unsafe extern "C" fn(Component);
/// `fmi2SetDebugLogging`: on, number of categories, categories.
pub type SetDebugLogging = call!(Boolean, usize, *const *const c_char);
/// `fmi2SetupExperiment`: tolerance defined, tolerance, start, stop defined, stop.
pub type SetupExperiment = call!(Boolean, f64, f64, Boolean, f64);
/// `fmi2EnterInitializationMode`, `fmi2ExitInitializationMode`, `fmi2Terminate`, `fmi2Reset`.
pub type Transition = call!();
/// `fmi2GetReal` and similar functions: references, their number, values.
pub type Get<T> = call!(*const Reference, usize, *mut T);
/// `fmi2SetReal` and similar functions: references, their number, values.
pub type Set<T> = call!(*const Reference, usize, *const T);
/// `fmi2GetFMUstate`, `fmi2FreeFMUstate`.
pub type AccessState = call!(*mut State);
/// `fmi2SetFMUstate`.
pub type SetState = call!(State);
/// `fmi2SerializedFMUstateSize`.
pub type SerializedStateSize = call!(State, *mut usize);
/// `fmi2SerializeFMUstate`.
pub type SerializeState = call!(State, *mut c_char, usize);
/// `fmi2DeSerializeFMUstate`.
pub type DeserializeState = call!(*const c_char, usize, *mut State);
/// `fmi2GetDirectionalDerivative`: unknowns, knowns, seed of the knowns, result for the unknowns.
pub type GetDirectionalDerivative = call!(*const Reference, usize, *const Reference, usize, *const f64, *mut f64);
/// `fmi2SetRealInputDerivatives`: references, their number, orders, values.
pub type SetInputDerivatives = call!(*const Reference, usize, *const c_int, *const f64);
/// `fmi2GetRealOutputDerivatives`: references, their number, orders, values.
pub type GetOutputDerivatives = call!(*const Reference, usize, *const c_int, *mut f64);
/// `fmi2DoStep`: time, step, true if no earlier state will be restored.
pub type DoStep = call!(f64, f64, Boolean);
/// `fmi2GetStatus` and similar functions: kind of status (`fmi2StatusKind`), value.
pub type GetStatus<T> = call!(c_int, *mut T);
/// `fmi2SetTime`.
pub type SetTime = call!(f64);
/// `fmi2SetContinuousStates`: values, their number.
pub type SetNumbers = call!(*const f64, usize);
/// `fmi2GetDerivatives`, `fmi2GetContinuousStates`, `fmi2GetEventIndicators`, `fmi2GetNominalsOfContinuousStates`: values,
/// their number.
pub type GetNumbers = call!(*mut f64, usize);
/// `fmi2NewDiscreteStates`.
pub type NewDiscreteStates = call!(*mut EventInfo);
/// `fmi2CompletedIntegratorStep`: true if no earlier state will be restored; results: enter Event Mode, terminate.
pub type CompletedIntegratorStep = call!(Boolean, *mut Boolean, *mut Boolean);

/// `fmi2EventInfo`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct EventInfo {
    /// Discrete states must be updated again.
    pub new_discrete_states_needed: Boolean,
    /// The FMU requests the end of the simulation.
    pub terminate_simulation: Boolean,
    /// Nominal values of continuous states have changed.
    pub nominals_of_continuous_states_changed: Boolean,
    /// Continuous states have changed.
    pub values_of_continuous_states_changed: Boolean,
    /// A time event follows.
    pub next_event_time_defined: Boolean,
    /// Time of the next event, s.
    pub next_event_time: f64,
}
