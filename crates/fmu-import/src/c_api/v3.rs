//! The C types of FMI 3.0.
//!
//! Source: FMI 3.0.2, section 2.2, and its headers `fmi3PlatformTypes.h` and `fmi3FunctionTypes.h`. Types that are the
//! same in FMI 2.0 are in the parent module.

use super::{Component, RawStatus, Reference, State, call};
use std::ffi::{c_char, c_int, c_void};

/// `fmi3Boolean` from C code: the byte of a `bool`, which may contain any number.
pub type RawBoolean = u8;

/// `fmi3LogMessageCallback`: environment, status, category, message.
pub type LogMessage = unsafe extern "C" fn(*mut c_void, RawStatus, *const c_char, *const c_char);
/// `fmi3IntermediateUpdateCallback`: environment, time, variables can be set, variables can be read, step of the solver is
/// finished, early return is possible, early return requested, its time.
pub type IntermediateUpdate =
    unsafe extern "C" fn(*mut c_void, f64, RawBoolean, RawBoolean, RawBoolean, RawBoolean, *mut RawBoolean, *mut f64);

/// `fmi3InstantiateCoSimulation`: name, token, resource path, visible, logging on, event mode used, early return allowed,
/// required intermediate variables, their number, environment, logger, intermediate update.
pub type InstantiateCoSimulation = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const Reference,
    usize,
    *mut c_void,
    LogMessage,
    Option<IntermediateUpdate>,
) -> Component;
/// `fmi3InstantiateModelExchange`: name, token, resource path, visible, logging on, environment, logger.
pub type InstantiateModelExchange =
    unsafe extern "C" fn(*const c_char, *const c_char, *const c_char, bool, bool, *mut c_void, LogMessage) -> Component;
/// `fmi3ClockUpdateCallback`: environment.
pub type ClockUpdate = unsafe extern "C" fn(*mut c_void);
/// `fmi3LockPreemptionCallback`, `fmi3UnlockPreemptionCallback`.
pub type Preemption = unsafe extern "C" fn();
/// `fmi3InstantiateScheduledExecution`: name, token, resource path, visible, logging on, environment, logger, clock
/// update, lock preemption, unlock preemption.
pub type InstantiateScheduledExecution = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    *mut c_void,
    LogMessage,
    ClockUpdate,
    Preemption,
    Preemption,
) -> Component;
/// `fmi3ActivateModelPartition`: clock, time.
pub type ActivatePartition = call!(Reference, f64);
/// `fmi3SetDebugLogging`: on, number of categories, categories.
pub type SetDebugLogging = call!(bool, usize, *const *const c_char);
/// `fmi3EnterInitializationMode`: tolerance defined, tolerance, start, stop defined, stop.
pub type EnterInitializationMode = call!(bool, f64, f64, bool, f64);
/// `fmi3GetFloat64` and similar functions: references, their number, values, their number.
pub type Get<T> = call!(*const Reference, usize, *mut T, usize);
/// `fmi3SetFloat64` and similar functions: references, their number, values, their number.
pub type Set<T> = call!(*const Reference, usize, *const T, usize);
/// `fmi3GetBinary`: references, their number, sizes in bytes, pointers to the values, number of values.
pub type GetBinary = call!(*const Reference, usize, *mut usize, *mut *const u8, usize);
/// `fmi3SetBinary`: references, their number, sizes in bytes, pointers to the values, number of values.
pub type SetBinary = call!(*const Reference, usize, *const usize, *const *const u8, usize);
/// `fmi3SerializeFMUState`.
pub type SerializeState = call!(State, *mut u8, usize);
/// `fmi3DeserializeFMUState`.
pub type DeserializeState = call!(*const u8, usize, *mut State);
/// `fmi3GetDirectionalDerivative`, `fmi3GetAdjointDerivative`: unknowns, knowns, seed, sensitivity, each followed by
/// its length.
pub type GetDerivative = call!(*const Reference, usize, *const Reference, usize, *const f64, usize, *mut f64, usize);
/// `fmi3GetOutputDerivatives`: references, their number, orders, values, their number.
pub type GetOutputDerivatives = call!(*const Reference, usize, *const c_int, *mut f64, usize);
/// `fmi3DoStep`: time, step, true if no earlier state will be restored; results: event handling needed, terminate,
/// early return, last successful time.
pub type DoStep = call!(f64, f64, bool, *mut RawBoolean, *mut RawBoolean, *mut RawBoolean, *mut f64);
/// `fmi3UpdateDiscreteStates`, results: discrete states need update, terminate, nominals changed, values of states
/// changed, next event time defined, next event time.
pub type UpdateDiscreteStates =
    call!(*mut RawBoolean, *mut RawBoolean, *mut RawBoolean, *mut RawBoolean, *mut RawBoolean, *mut f64);
/// `fmi3SetClock`: references, their number, true for clocks to activate.
pub type SetClock = call!(*const Reference, usize, *const bool);
/// `fmi3GetClock`: references, their number, whether they are active.
pub type GetClock = call!(*const Reference, usize, *mut RawBoolean);
/// `fmi3GetIntervalDecimal`: references, their number, intervals in s, qualifiers.
pub type GetInterval = call!(*const Reference, usize, *mut f64, *mut c_int);
/// `fmi3SetIntervalDecimal`: references, their number, intervals in s.
pub type SetInterval = call!(*const Reference, usize, *const f64);
/// `fmi3GetShiftDecimal`: references, their number, times in s.
pub type GetShift = call!(*const Reference, usize, *mut f64);
/// `fmi3CompletedIntegratorStep`: true if no earlier state will be restored; results: enter Event Mode, terminate.
pub type CompletedIntegratorStep = call!(bool, *mut RawBoolean, *mut RawBoolean);
/// `fmi3GetNumberOfVariableDependencies`: variable, number.
pub type GetNumberOfDependencies = call!(Reference, *mut usize);
/// `fmi3GetVariableDependencies`: variable, its elements, independents, their elements, kinds, number.
pub type GetDependencies = call!(Reference, *mut usize, *mut Reference, *mut usize, *mut c_int, usize);
/// `fmi3GetNumberOfEventIndicators`, `fmi3GetNumberOfContinuousStates`.
pub type GetNumber = call!(*mut usize);
