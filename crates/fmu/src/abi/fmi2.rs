//! The functions of FMI 2.0.

use std::ffi::CString;
use std::path::PathBuf;

use super::c::{c_char, c_int, c_uint, c_void, size_t};
pub use super::common::{
    completed_integrator_step, deserialize_fmu_state, enter_continuous_time_mode, enter_event_mode,
    exit_initialization_mode, free_fmu_state, free_instance, get_continuous_states, get_derivatives,
    get_event_indicators, get_fmu_state, get_nominals_of_continuous_states, reset, serialize_fmu_state,
    serialized_fmu_state_size, set_continuous_states, set_debug_logging, set_fmu_state, set_time, terminate,
};
use super::float_environment::argument;
use super::values::{self, List};
use super::{Call, CallResult, Component, Export, Log, Logger as AnyLogger, Status, call, common, functions, text};
use crate::calls::{Function, Interface, Protocol, Version};
use crate::description::LOG_CATEGORIES;
use crate::instance::{CallError, Instance};
use crate::runner::Model as _;

/// fmi2Boolean.
pub type Boolean = c_int;
/// fmi2ValueReference.
pub type ValueReference = c_uint;

/// fmi2CallbackLogger: environment, instance name, status, category, message as a printf format.
pub type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// fmi2CallbackFunctions; the memory functions are not used.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Callbacks {
    /// Receives the messages.
    pub logger: Option<Logger>,
    /// Not used.
    pub allocate_memory: Option<unsafe extern "C" fn(size_t, size_t) -> *mut c_void>,
    /// Not used.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Not used, because every step is complete when fmi2DoStep returns.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// Passed back to the logger.
    pub environment: *mut c_void,
}

/// fmi2GetTypesPlatform.
pub fn types_platform() -> *const c_char {
    c"default".as_ptr()
}

/// fmi2GetVersion.
pub fn version() -> *const c_char {
    c"2.0".as_ptr()
}

/// Path in a `file:` URI, with percent-encoded bytes decoded. Any other text is taken as a path.
fn resources_path(uri: &str) -> PathBuf {
    let path = uri.strip_prefix("file:").map_or(uri, |rest| {
        let rest = rest.strip_prefix("//").unwrap_or(rest);
        let rest = rest.strip_prefix("localhost").unwrap_or(rest);
        // On Windows, file:///C:/folder is the path C:/folder.
        if cfg!(windows) { rest.trim_start_matches('/') } else { rest }
    });
    let mut parts = path.split('%');
    let mut decoded = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        // The parser would also accept a sign, as in %+1.
        let code = part.get(..2).filter(|code| code.bytes().all(|byte| byte.is_ascii_hexdigit()));
        let byte = code.and_then(|code| u8::from_str_radix(code, 16).ok());
        decoded.push(byte.unwrap_or(b'%'));
        decoded.extend(&part.as_bytes()[if byte.is_some() { 2 } else { 0 }..]);
    }
    PathBuf::from(String::from_utf8_lossy(&decoded).into_owned())
}

fn interface_of<E: Export>(fmu_type: c_int) -> Result<Interface, String> {
    let all = [(0, Interface::ModelExchange), (1, Interface::CoSimulation)];
    let provided = || all.into_iter().filter(|(_, interface)| common::provides::<E>(*interface));
    provided().find(|(number, _)| *number == fmu_type).map(|(_, interface)| interface).ok_or_else(|| {
        let names: Vec<_> = provided().map(|(number, of)| format!("{number} ({})", of.name())).collect();
        format!("fmuType must be {}, got {fmu_type}", names.join(" or "))
    })
}

/// fmi2Instantiate. If it fails, logs the reason (if there is a logger) and returns a null pointer.
pub unsafe fn instantiate<E: Export>(
    name: *const c_char,
    fmu_type: c_int,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: Boolean,
    logging_on: Boolean,
) -> Component {
    if callbacks.is_null() || !callbacks.is_aligned() {
        return std::ptr::null_mut();
    }
    // SAFETY: checked for null; the caller's struct is copied.
    let callbacks = unsafe { *callbacks };
    let logger = callbacks.logger.map(|logger| AnyLogger::Fmi2(logger, callbacks.environment));
    let log = Log { logger, name: CString::default(), wanted: [logging_on != 0; LOG_CATEGORIES.len()] };
    // SAFETY: strings from the caller.
    unsafe {
        common::create::<E>("fmi2Instantiate", log, name, || {
            let interface = interface_of::<E>(fmu_type)?;
            common::check_guid::<E>("fmuGUID", guid)?;
            let resources = if resources.is_null() {
                PathBuf::new()
            } else {
                resources_path(text(resources).map_err(|e| format!("fmuResourceLocation is {e}"))?)
            };
            let protocol = Protocol { version: Version::Fmi2, interface };
            Ok(Instance::new(protocol, E::description(), resources))
        })
    }
}

/// fmi2EventInfo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct EventInfo {
    /// Always false: one call to fmi2NewDiscreteStates handles all events at the present time.
    pub new_discrete_states_needed: Boolean,
    /// True if the model has ended the simulation.
    pub terminate_simulation: Boolean,
    /// Always false: nominal values are constant.
    pub nominals_of_continuous_states_changed: Boolean,
    /// True if the event has set continuous states.
    pub values_of_continuous_states_changed: Boolean,
    /// True if a time event follows.
    pub next_event_time_defined: Boolean,
    /// Time of the next time event in s.
    pub next_event_time: f64,
}

functions! {
    /// fmi2SetupExperiment. A solver with error control uses the tolerance, unless the parameter `tolerance` was set.
    fn setup_experiment[SetupExperiment](
        h, call, tolerance_defined: Boolean, tolerance: f64, start: f64, stop_defined: Boolean, stop: f64
    ) {
        let stop = (stop_defined != 0).then(|| argument(stop));
        let tolerance = (tolerance_defined != 0).then(|| argument(tolerance));
        h.instance.set_experiment(call.0, argument(start), stop, tolerance)
    }

    fn enter_initialization_mode[EnterInitializationMode](h, _) { h.instance.enter_initialization() }

    // Fast path for real values, which are set and read in every step.

    fn get_real[GetReal](h, call, references: *const ValueReference, count: size_t, values: *mut f64) {
        let references = call.array("vr", references, count)?;
        h.instance.get_real(references, call.array_mut("value", values, count)?)
    }

    fn set_real[SetReal](h, call, references: *const ValueReference, count: size_t, values: *const f64) {
        let references = call.array("vr", references, count)?;
        h.instance.set_real(references, call.array("value", values, count)?)
    }

    fn get_directional_derivative[GetDirectionalDerivative](
        h, call, unknown: *const ValueReference, unknown_count: size_t, known: *const ValueReference, known_count: size_t,
        seed: *const f64, result: *mut f64
    ) {
        h.instance.directional_derivative(
            call.array("vUnknown_ref", unknown, unknown_count)?,
            call.array("vKnown_ref", known, known_count)?,
            call.array("dvKnown", seed, known_count)?,
            call.array_mut("dvUnknown", result, unknown_count)?,
        )
    }

    /// fmi2SetRealInputDerivatives: not supported by models whose inputs are constant during a step, as the capability
    /// flags declare.
    fn set_real_input_derivatives[SetRealInputDerivatives](
        h, call, references: *const ValueReference, count: size_t, orders: *const c_int, values: *const f64
    ) {
        if !E::Model::INTERPOLATES {
            return Err(call.error(NOT_SUPPORTED));
        }
        let references = call.array("vr", references, count)?;
        let orders = call.array("order", orders, count)?;
        h.instance.set_real_input_derivatives(references, orders, call.array("value", values, count)?)
    }

    /// fmi2GetRealOutputDerivatives: not supported, as the capability flags declare.
    fn get_real_output_derivatives[GetRealOutputDerivatives](
        _, call, _references: *const ValueReference, _count: size_t, _orders: *const c_int, _values: *mut f64
    ) {
        Err(call.error(NOT_SUPPORTED))
    }

    /// fmi2DoStep: fmi2Discard if the model has ended the simulation in this step or before.
    fn do_step[DoStep](h, _, time: f64, step: f64, _no_set_before: Boolean) {
        h.instance.do_step(argument(time), argument(step))?;
        match h.instance.is_finished() {
            true => Err(CallError::Discard(format!("the model ended the simulation at {} s", h.instance.time()))),
            false => Ok(()),
        }
    }

    /// fmi2CancelStep: always an error, because every step is complete when fmi2DoStep returns.
    fn cancel_step[CancelStep](_, call) { Err(call.error("no step is pending")) }

    /// fmi2GetStatus: returns fmi2Discard, because no step is ever pending.
    fn get_status[GetStatus](_, call, kind: c_int, _value: *mut c_int) { call.no_status(kind) }

    /// fmi2GetRealStatus: returns fmi2LastSuccessfulTime.
    fn get_real_status[GetRealStatus](h, call, kind: c_int, value: *mut f64) {
        if kind != LAST_SUCCESSFUL_TIME {
            return call.no_status(kind);
        }
        *call.target("value", value)? = h.instance.time();
        Ok(())
    }

    /// fmi2GetIntegerStatus: returns fmi2Discard, because the standard defines no status of this type.
    fn get_integer_status[GetIntegerStatus](_, call, kind: c_int, _value: *mut c_int) { call.no_status(kind) }

    /// fmi2GetBooleanStatus: returns fmi2Terminated.
    fn get_boolean_status[GetBooleanStatus](h, call, kind: c_int, value: *mut Boolean) {
        if kind != TERMINATED {
            return call.no_status(kind);
        }
        *call.target("value", value)? = h.instance.is_finished().into();
        Ok(())
    }

    /// fmi2GetStringStatus: returns fmi2Discard, because no step is ever pending.
    fn get_string_status[GetStringStatus](_, call, kind: c_int, _value: *mut *const c_char) { call.no_status(kind) }

    fn new_discrete_states[NewDiscreteStates](h, call, info: *mut EventInfo) {
        let info = call.target("eventInfo", info)?;
        let update = h.instance.new_discrete_states()?;
        *info = EventInfo {
            terminate_simulation: h.instance.is_finished().into(),
            values_of_continuous_states_changed: update.states_changed.into(),
            next_event_time_defined: update.next_event_time.is_some().into(),
            next_event_time: update.next_event_time.unwrap_or(0.0),
            ..EventInfo::default()
        };
        Ok(())
    }
}

const NOT_SUPPORTED: &str = "not supported (see the capability flags)";
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

impl<E: Export> Call<E> {
    fn no_status(&self, kind: c_int) -> CallResult {
        let function = self.0.name(Version::Fmi2);
        Err(CallError::Discard(format!("{function}: status kind {kind} is not available")))
    }
}

macro_rules! values {
    ($($name:ident $type:ty;)*) => {$(
        #[doc = concat!("The function `", stringify!($name), "` of both versions.")]
        pub unsafe fn $name<E: Export>(
            component: Component,
            references: *const ValueReference,
            count: size_t,
            values: $type,
        ) -> Status {
            unsafe { values::$name::<E>(component, List { references, count, values, value_count: count }) }
        }
    )*};
}
values! {
    get_integer *mut c_int;
    set_integer *const c_int;
    get_boolean *mut Boolean;
    set_boolean *const Boolean;
    get_string *mut *const c_char;
    set_string *const *const c_char;
}

/// The FMI 2.0 interface of a model, with the functions for co-simulation (`cs`), model exchange (`me`) or both.
/// [`model`](macro@crate::model) adds it where `cargo fmu pack` requests it.
#[doc(hidden)]
#[macro_export]
macro_rules! c_interface_of_fmi2 {
    (@cs $model:ty) => {
        $crate::c_functions! { $model:
            fmi2SetRealInputDerivatives set_real_input_derivatives (vr: *const ValueReference, n: size_t, order: *const c_int, value: *const f64);
            fmi2GetRealOutputDerivatives get_real_output_derivatives (vr: *const ValueReference, n: size_t, order: *const c_int, value: *mut f64);
            fmi2DoStep do_step (time: f64, step: f64, no_set_before: Boolean);
            fmi2CancelStep cancel_step ();
            fmi2GetStatus get_status (kind: c_int, value: *mut c_int);
            fmi2GetRealStatus get_real_status (kind: c_int, value: *mut f64);
            fmi2GetIntegerStatus get_integer_status (kind: c_int, value: *mut c_int);
            fmi2GetBooleanStatus get_boolean_status (kind: c_int, value: *mut Boolean);
            fmi2GetStringStatus get_string_status (kind: c_int, value: *mut *const c_char);
        }
    };
    (@me $model:ty) => {
        $crate::c_functions! { $model:
            fmi2EnterEventMode enter_event_mode ();
            fmi2NewDiscreteStates new_discrete_states (info: *mut EventInfo);
            fmi2EnterContinuousTimeMode enter_continuous_time_mode ();
            fmi2CompletedIntegratorStep completed_integrator_step (no_set_before: Boolean, enter_event_mode: *mut Boolean, terminate: *mut Boolean);
            fmi2SetTime set_time (time: f64);
            fmi2SetContinuousStates set_continuous_states (x: *const f64, n: size_t);
            fmi2GetDerivatives get_derivatives (value: *mut f64, n: size_t);
            fmi2GetEventIndicators get_event_indicators (value: *mut f64, n: size_t);
            fmi2GetContinuousStates get_continuous_states (x: *mut f64, n: size_t);
            fmi2GetNominalsOfContinuousStates get_nominals_of_continuous_states (value: *mut f64, n: size_t);
        }
    };
    ($model:ty: $($interface:ident)*) => {
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, clippy::missing_safety_doc, clippy::too_many_arguments)]
        pub mod c_interface {
            #[allow(unused_imports)]
            use super::*;
            use $crate::__private::abi::{Component, FmuState, Status};
            use $crate::__private::abi::fmi2::*;
            use $crate::__private::abi::c::*;

            $crate::unloading!($model);

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
                types_platform()
            }
            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetVersion() -> *const c_char {
                version()
            }
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2FreeInstance(component: Component) {
                unsafe { free_instance::<$model>(component) }
            }
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2Instantiate(
                name: *const c_char,
                fmu_type: c_int,
                guid: *const c_char,
                resources: *const c_char,
                callbacks: *const Callbacks,
                visible: Boolean,
                logging_on: Boolean,
            ) -> Component {
                unsafe { instantiate::<$model>(name, fmu_type, guid, resources, callbacks, visible, logging_on) }
            }
            $crate::c_functions! { $model:
                fmi2SetDebugLogging set_debug_logging (on: Boolean, n: size_t, categories: *const *const c_char);
                fmi2SetupExperiment setup_experiment (with_tolerance: Boolean, tolerance: f64, start: f64, with_stop: Boolean, stop: f64);
                fmi2EnterInitializationMode enter_initialization_mode ();
                fmi2ExitInitializationMode exit_initialization_mode ();
                fmi2Terminate terminate ();
                fmi2Reset reset ();
                fmi2GetReal get_real (vr: *const ValueReference, n: size_t, value: *mut f64);
                fmi2GetInteger get_integer (vr: *const ValueReference, n: size_t, value: *mut c_int);
                fmi2GetBoolean get_boolean (vr: *const ValueReference, n: size_t, value: *mut Boolean);
                fmi2GetString get_string (vr: *const ValueReference, n: size_t, value: *mut *const c_char);
                fmi2SetReal set_real (vr: *const ValueReference, n: size_t, value: *const f64);
                fmi2SetInteger set_integer (vr: *const ValueReference, n: size_t, value: *const c_int);
                fmi2SetBoolean set_boolean (vr: *const ValueReference, n: size_t, value: *const Boolean);
                fmi2SetString set_string (vr: *const ValueReference, n: size_t, value: *const *const c_char);
                fmi2GetFMUstate get_fmu_state (state: *mut FmuState);
                fmi2SetFMUstate set_fmu_state (state: FmuState);
                fmi2FreeFMUstate free_fmu_state (state: *mut FmuState);
                fmi2SerializedFMUstateSize serialized_fmu_state_size (state: FmuState, size: *mut size_t);
                fmi2SerializeFMUstate serialize_fmu_state (state: FmuState, bytes: *mut c_char, size: size_t);
                fmi2DeSerializeFMUstate deserialize_fmu_state (bytes: *const c_char, size: size_t, state: *mut FmuState);
                fmi2GetDirectionalDerivative get_directional_derivative (unknown: *const ValueReference, unknown_count: size_t, known: *const ValueReference, known_count: size_t, seed: *const f64, result: *mut f64);
            }
            $($crate::c_interface_of_fmi2! { @$interface $model })*
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resource_uri_becomes_a_path() {
        // RFC 8089: a missing authority, an empty one and localhost mean the same; %XX is a byte.
        for uri in ["file:///a/b%20c", "file:/a/b%20c", "file://localhost/a/b%20c", "/a/b%20c"] {
            assert_eq!(resources_path(uri), PathBuf::from("/a/b c"), "{uri}");
        }
        for path in ["/50%", "/5%+1", "/5%\u{20ac}"] {
            assert_eq!(resources_path(&format!("file://{path}")), PathBuf::from(path));
        }
    }
}
