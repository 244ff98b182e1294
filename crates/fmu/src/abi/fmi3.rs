//! The functions of FMI 3.0. A library must export all of them; functions for missing interfaces and types return
//! errors.

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
use super::scheduled;
pub use super::scheduled::{ClockUpdate, Preemption, activate_model_partition};
use super::updates::{self, Request, Results};
pub use super::updates::{IntermediateUpdate, get_output_derivatives};
use super::values::{self, Binaries, List, Numbers, check_count, elements};
use super::{
    Call, CallResult, Component, Export, Handle, Log, Logger as AnyLogger, Status, call, common, functions, text,
};
use crate::calls::{Function, Interface, Protocol, Version};
use crate::clocks::Span;
use crate::description::LOG_CATEGORIES;
use crate::instance::Instance;
use crate::number::Number;
use crate::runner::Model;

/// fmi3Boolean, a `bool` in C; every number except 0 is true.
pub type Boolean = u8;
/// fmi3ValueReference.
pub type ValueReference = c_uint;

/// fmi3Dependent: a dependency of any kind, which may be nonlinear.
const DEPENDENT: c_int = 5;

/// fmi3LogMessageCallback: environment, status, category, message.
pub type Logger = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// fmi3GetVersion.
pub fn version() -> *const c_char {
    c"3.0".as_ptr()
}

/// Common arguments of the instantiation functions.
#[derive(Clone, Copy, Debug)]
pub struct Arguments {
    /// instanceName.
    pub name: *const c_char,
    /// instantiationToken.
    pub token: *const c_char,
    /// resourcePath.
    pub resources: *const c_char,
    /// loggingOn.
    pub logging_on: Boolean,
    /// instanceEnvironment.
    pub environment: *mut c_void,
    /// logMessage.
    pub logger: Option<Logger>,
}

impl Arguments {
    fn log(&self, wants_all: bool) -> Log {
        let logger = self.logger.map(|logger| AnyLogger::Fmi3(logger, self.environment));
        Log { logger, name: CString::default(), wanted: [wants_all; LOG_CATEGORIES.len()] }
    }

    unsafe fn reject<E: Export>(self, function: &str, message: &str) -> Component {
        unsafe { common::create::<E>(function, self.log(true), self.name, || Err(message.to_owned())) }
    }
}

unsafe fn instantiate<E: Export>(
    function: &str,
    arguments: Arguments,
    interface: Interface,
    with_event_mode: bool,
    request: Option<Request<'_>>,
) -> Component {
    let Arguments { name, token, resources, logging_on, .. } = arguments;
    let log = arguments.log(logging_on != 0);
    let mut updates = None;
    // SAFETY: strings from the caller.
    let component = unsafe {
        common::create::<E>(function, log, name, || {
            if !common::provides::<E>(interface) {
                return Err(format!("this FMU does not provide {}", interface.name()));
            }
            if with_event_mode && !<E::Model as Model>::HAS_EVENTS {
                return Err("eventModeUsed must be false: the FMU has no Event Mode (hasEventMode is false)".to_owned());
            }
            common::check_guid::<E>("instantiationToken", token)?;
            let resources = if resources.is_null() {
                PathBuf::new()
            } else {
                PathBuf::from(text(resources).map_err(|e| format!("resourcePath is {e}"))?)
            };
            if let Some(request) = request {
                updates = request.accept::<E>()?;
            }
            let protocol = Protocol { version: Version::Fmi3, interface };
            let instance = Instance::new(protocol, E::description(), resources);
            Ok(if with_event_mode { instance.with_event_mode() } else { instance })
        })
    };
    if !component.is_null() {
        // SAFETY: created above.
        unsafe { (*component.cast::<Handle<E>>()).updates = updates };
    }
    component
}

/// fmi3InstantiateModelExchange. If it fails, logs the reason (if there is a logger) and returns a null pointer.
pub unsafe fn instantiate_model_exchange<E: Export>(arguments: Arguments) -> Component {
    unsafe { instantiate::<E>("fmi3InstantiateModelExchange", arguments, Interface::ModelExchange, false, None) }
}

/// fmi3InstantiateCoSimulation. `event_mode` requires a model with events. With both `event_mode` and `early_return`, a
/// step ends at the first event, which the importer then handles; otherwise, the step itself handles its events. A step
/// also ends where the model ends the simulation. With `update`, each step of a continuous-time model calls it after each
/// integrator step; it may use the variables of `intermediate_variables`, which must have the attribute
/// `intermediateUpdate`.
pub unsafe fn instantiate_co_simulation<E: Export>(
    arguments: Arguments,
    event_mode: Boolean,
    early_return: Boolean,
    intermediate_variables: *const ValueReference,
    intermediate_count: size_t,
    update: Option<IntermediateUpdate>,
) -> Component {
    const NAME: &str = "fmi3InstantiateCoSimulation";
    let required = if intermediate_count == 0 {
        &[]
    } else if intermediate_variables.is_null() || !intermediate_variables.is_aligned() {
        let message = "requiredIntermediateVariables must be an array of length nRequiredIntermediateVariables";
        return unsafe { arguments.reject::<E>(NAME, message) };
    } else {
        // SAFETY: an array of this length, checked for null and alignment.
        unsafe { std::slice::from_raw_parts(intermediate_variables, intermediate_count) }
    };
    let can_return_early = early_return != 0;
    let request = Request { required, callback: update, environment: arguments.environment, can_return_early };
    let with_events = event_mode != 0;
    let component = unsafe { instantiate::<E>(NAME, arguments, Interface::CoSimulation, with_events, Some(request)) };
    if early_return != 0 && !component.is_null() {
        // SAFETY: created above.
        unsafe { (*component.cast::<Handle<E>>()).returns_early = true };
    }
    component
}

/// fmi3InstantiateScheduledExecution. If the callbacks for preemption are given, they are called around each call.
pub unsafe fn instantiate_scheduled_execution<E: Export>(
    arguments: Arguments,
    clock_update: Option<ClockUpdate>,
    lock: Option<Preemption>,
    unlock: Option<Preemption>,
) -> Component {
    const NAME: &str = "fmi3InstantiateScheduledExecution";
    if !scheduled::is_provided::<E>() {
        return unsafe { arguments.reject::<E>(NAME, "this FMU does not provide scheduled execution") };
    }
    let component = unsafe { instantiate::<E>(NAME, arguments, Interface::ScheduledExecution, false, None) };
    if !component.is_null() {
        // SAFETY: created above.
        unsafe { scheduled::share::<E>(component, clock_update, arguments.environment, lock, unlock) };
    }
    component
}

macro_rules! values {
    ($($name:ident $type:ty, $shared:ident;)*) => {$(
        #[doc = concat!("The function `", stringify!($shared), "` of both versions.")]
        pub unsafe fn $name<E: Export>(
            component: Component,
            references: *const ValueReference,
            count: size_t,
            values: $type,
            value_count: size_t,
        ) -> Status {
            unsafe { values::$shared::<E>(component, List { references, count, values, value_count }) }
        }
    )*};
}
values! {
    get_float64 *mut f64, get_real;
    set_float64 *const f64, set_real;
    get_boolean *mut Boolean, get_boolean;
    set_boolean *const Boolean, set_boolean;
    get_string *mut *const c_char, get_string;
    set_string *const *const c_char, set_string;
}

/// Functions that read numbers other than Float64.
pub unsafe fn get_number<E: Export, V: Number>(
    component: Component,
    function: Function,
    references: *const ValueReference,
    count: size_t,
    values: *mut V,
    value_count: size_t,
) -> Status {
    let values = Numbers::new(values);
    unsafe { values::get_number::<E>(component, function, List { references, count, values, value_count }) }
}

/// Functions that set numbers other than Float64.
pub unsafe fn set_number<E: Export, V: Number>(
    component: Component,
    function: Function,
    references: *const ValueReference,
    count: size_t,
    values: *const V,
    value_count: size_t,
) -> Status {
    let values = Numbers::new(values);
    unsafe { values::set_number::<E>(component, function, List { references, count, values, value_count }) }
}

/// fmi3GetBinary.
pub unsafe fn get_binary<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    sizes: *mut size_t,
    values: *mut *const u8,
    value_count: size_t,
) -> Status {
    let values = Binaries { sizes, values };
    unsafe { values::get_binary::<E>(component, List { references, count, values, value_count }) }
}

/// fmi3SetBinary.
pub unsafe fn set_binary<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    sizes: *const size_t,
    values: *const *const u8,
    value_count: size_t,
) -> Status {
    let values = Binaries { sizes, values };
    unsafe { values::set_binary::<E>(component, List { references, count, values, value_count }) }
}

/// Functions for types that no variable has: only calls with empty lists are valid.
pub unsafe fn no_variables<E: Export>(
    component: Component,
    function: Function,
    _references: *const ValueReference,
    count: size_t,
) -> Status {
    let run = |_: &mut Handle<E>, call: &Call<E>| match count {
        0 => Ok(()),
        _ => Err(call.error("no variable of this FMU has this type")),
    };
    unsafe { call::<E>(component, function, run) }
}

/// Calls `f` with the references of clocks. An FMU without clocks does not contain the code of `f`.
unsafe fn clocks<E: Export>(
    component: Component,
    function: Function,
    references: *const ValueReference,
    count: size_t,
    f: impl FnOnce(&mut Instance<E::Model>, &Call<E>, &[ValueReference]) -> CallResult,
) -> Status {
    if !<E::Model as Model>::HAS_CLOCKS {
        return unsafe { no_variables::<E>(component, function, references, count) };
    }
    unsafe {
        call::<E>(component, function, |h, call| {
            let references = call.array("valueReferences", references, count)?;
            f(&mut h.instance, call, references)
        })
    }
}

/// fmi3GetClock.
pub unsafe fn get_clock<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *mut Boolean,
) -> Status {
    unsafe {
        clocks::<E>(component, Function::GetClock, references, count, |instance, call, references| {
            let values = call.array_mut("values", values, count)?;
            values::each(instance, references, values, Instance::get_clock, |value, found| *value = found.into())?;
            instance.ticks_are_known(references);
            Ok(())
        })
    }
}

/// fmi3SetClock.
pub unsafe fn set_clock<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *const Boolean,
) -> Status {
    unsafe {
        clocks::<E>(component, Function::SetClock, references, count, |instance, call, references| {
            let values = call.array("values", values, count)?;
            instance.set_clock(references, values.iter().map(|&value| value != 0))
        })
    }
}

/// fmi3GetIntervalDecimal.
pub unsafe fn get_interval_decimal<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    intervals: *mut f64,
    qualifiers: *mut c_int,
) -> Status {
    unsafe {
        clocks::<E>(component, Function::GetIntervalDecimal, references, count, |instance, call, references| {
            let intervals = call.array_mut("intervals", intervals, count)?;
            let qualifiers = call.array_mut("qualifiers", qualifiers, count)?;
            let targets = intervals.iter_mut().zip(qualifiers);
            values::each(instance, references, targets, Instance::interval, |(interval, qualifier), found| {
                (*interval, *qualifier) = (found.0, found.1 as c_int);
            })?;
            instance.intervals_are_known(call.0, references)
        })
    }
}

/// fmi3GetIntervalFraction.
pub unsafe fn get_interval_fraction<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    counters: *mut u64,
    resolutions: *mut u64,
    qualifiers: *mut c_int,
) -> Status {
    unsafe {
        clocks::<E>(component, Function::GetIntervalFraction, references, count, |instance, call, references| {
            let counters = call.array_mut("counters", counters, count)?;
            let resolutions = call.array_mut("resolutions", resolutions, count)?;
            let qualifiers = call.array_mut("qualifiers", qualifiers, count)?;
            let targets = counters.iter_mut().zip(resolutions).zip(qualifiers);
            values::each(instance, references, targets, Instance::interval_fraction, |((n, of), qualifier), found| {
                ((*n, *of), *qualifier) = (found.0, found.1 as c_int);
            })?;
            instance.intervals_are_known(call.0, references)
        })
    }
}

/// fmi3GetShiftDecimal.
pub unsafe fn get_shift_decimal<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    shifts: *mut f64,
) -> Status {
    unsafe {
        clocks::<E>(component, Function::GetShiftDecimal, references, count, |instance, call, references| {
            let shifts = call.array_mut("shifts", shifts, count)?;
            let one = |instance: &mut Instance<_>, reference| instance.shift(reference);
            values::each(instance, references, shifts, one, |shift, found| *shift = found)
        })
    }
}

/// fmi3GetShiftFraction.
pub unsafe fn get_shift_fraction<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    counters: *mut u64,
    resolutions: *mut u64,
) -> Status {
    unsafe {
        clocks::<E>(component, Function::GetShiftFraction, references, count, |instance, call, references| {
            let counters = call.array_mut("counters", counters, count)?;
            let resolutions = call.array_mut("resolutions", resolutions, count)?;
            let targets = counters.iter_mut().zip(resolutions);
            let one = |instance: &mut Instance<_>, reference| instance.shift_fraction(reference);
            values::each(instance, references, targets, one, |(n, of), found| (*n, *of) = found)
        })
    }
}

/// Functions that set the timing of a clock to numbers in s.
pub unsafe fn set_timing<E: Export>(
    component: Component,
    function: Function,
    references: *const ValueReference,
    count: size_t,
    seconds: *const f64,
) -> Status {
    unsafe {
        clocks::<E>(component, function, references, count, |instance, call, references| {
            let seconds = call.array("values", seconds, count)?;
            instance.set_timing(call.0, references, seconds.iter().map(|&seconds| Span::Decimal(seconds)))
        })
    }
}

/// Functions that set the timing of a clock to fractions.
pub unsafe fn set_timing_fraction<E: Export>(
    component: Component,
    function: Function,
    references: *const ValueReference,
    count: size_t,
    counters: *const u64,
    resolutions: *const u64,
) -> Status {
    unsafe {
        clocks::<E>(component, function, references, count, |instance, call, references| {
            let counters = call.array("counters", counters, count)?;
            let resolutions = call.array("resolutions", resolutions, count)?;
            let fractions = counters.iter().zip(resolutions);
            instance.set_timing(call.0, references, fractions.map(|(&counter, &of)| Span::Fraction(counter, of)))
        })
    }
}

/// Functions for capabilities that the exporter does not support.
pub unsafe fn not_provided<E: Export>(component: Component, function: Function) -> Status {
    unsafe { call::<E>(component, function, |_, call| Err(call.error("not provided (see the model description)"))) }
}

/// fmi3DoStep.
#[expect(clippy::too_many_arguments, reason = "as in the standard")]
#[inline]
pub unsafe fn do_step<E: Export>(
    component: Component,
    time: f64,
    step: f64,
    _no_set_before: Boolean,
    event_handling_needed: *mut Boolean,
    terminate: *mut Boolean,
    early_return: *mut Boolean,
    last_successful_time: *mut f64,
) -> Status {
    unsafe {
        if updates::are_provided::<E>() && updates::has_callback::<E>(component) {
            let results = Results { event_handling_needed, terminate, early_return, last_successful_time };
            return updates::do_step::<E>(component, time, step, results);
        }
        let (event, last) = (event_handling_needed, last_successful_time);
        do_step_without_updates::<E>(component, time, step, event, terminate, early_return, last)
    }
}

/// fmi3GetDirectionalDerivative and fmi3GetAdjointDerivative.
#[expect(clippy::too_many_arguments, reason = "as in the standard")]
pub unsafe fn get_derivative<E: Export>(
    component: Component,
    function: Function,
    unknowns: *const ValueReference,
    unknown_count: size_t,
    knowns: *const ValueReference,
    known_count: size_t,
    seed: *const f64,
    seed_count: size_t,
    result: *mut f64,
    result_count: size_t,
) -> Status {
    unsafe {
        call::<E>(component, function, |h, call| {
            let seed = call.array("seed", seed, seed_count)?;
            let result = call.array_mut("sensitivity", result, result_count)?;
            let unknowns = &elements(h, call, unknowns, unknown_count)?.0.to_vec();
            let (knowns, instance) = elements(h, call, knowns, known_count)?;
            let is_adjoint = function == Function::GetAdjointDerivative;
            let (of_seed, of_result) = if is_adjoint { (&**unknowns, knowns) } else { (knowns, &**unknowns) };
            check_count(call, of_seed.len(), seed.len())?;
            check_count(call, of_result.len(), result.len())?;
            match is_adjoint {
                true => instance.adjoint_derivative(unknowns, knowns, seed, result),
                false => instance.directional_derivative(unknowns, knowns, seed, result),
            }
        })
    }
}

functions! {
    /// fmi3EnterInitializationMode; for the tolerance, see [`super::fmi2::setup_experiment`].
    fn enter_initialization_mode[EnterInitializationMode](
        h, call, tolerance_defined: Boolean, tolerance: f64, start: f64, stop_defined: Boolean, stop: f64
    ) {
        let stop = (stop_defined != 0).then(|| argument(stop));
        let tolerance = (tolerance_defined != 0).then(|| argument(tolerance));
        h.instance.set_experiment(call.0, argument(start), stop, tolerance)?;
        h.instance.enter_initialization()
    }

    /// fmi3UpdateDiscreteStates: one call handles all events at the present time.
    fn update_discrete_states[NewDiscreteStates](
        h, call, needs_update: *mut Boolean, terminate: *mut Boolean, nominals_changed: *mut Boolean, states_changed: *mut Boolean,
        next_defined: *mut Boolean, next: *mut f64
    ) {
        let needs_update = call.target("discreteStatesNeedUpdate", needs_update)?;
        let terminate = call.target("terminateSimulation", terminate)?;
        let nominals = call.target("nominalsOfContinuousStatesChanged", nominals_changed)?;
        let states = call.target("valuesOfContinuousStatesChanged", states_changed)?;
        let next_defined = call.target("nextEventTimeDefined", next_defined)?;
        let next = call.target("nextEventTime", next)?;
        let update = h.instance.new_discrete_states()?;
        (*needs_update, *terminate, *nominals) = (0, h.instance.is_finished().into(), 0);
        *states = update.states_changed.into();
        *next_defined = update.next_event_time.is_some().into();
        *next = update.next_event_time.unwrap_or(0.0);
        Ok(())
    }

    /// fmi3EvaluateDiscreteStates: discrete outputs are always evaluated.
    fn evaluate_discrete_states[EvaluateDiscreteStates](_, _) { Ok(()) }

    fn get_number_of_event_indicators[GetNumberOfEventIndicators](h, call, count: *mut size_t) {
        *call.target("nEventIndicators", count)? = h.instance.layout().indicators.total();
        Ok(())
    }

    fn get_number_of_continuous_states[GetNumberOfContinuousStates](h, call, count: *mut size_t) {
        *call.target("nContinuousStates", count)? = h.instance.state_count();
        Ok(())
    }

    /// fmi3GetNumberOfVariableDependencies: before the end of the initialization, those at the start.
    fn get_number_of_variable_dependencies[GetNumberOfVariableDependencies](
        h, call, reference: ValueReference, count: *mut size_t
    ) {
        *call.target("nDependencies", count)? = h.instance.dependencies(call.0, reference)?.len();
        Ok(())
    }

    /// fmi3GetVariableDependencies.
    fn get_variable_dependencies[GetVariableDependencies](
        h, call, dependent: ValueReference, elements: *mut size_t, independents: *mut ValueReference,
        elements_of_independents: *mut size_t, kinds: *mut c_int, count: size_t
    ) {
        let all = h.instance.dependencies(call.0, dependent)?;
        if count != all.len() {
            let name = "nDependencies";
            return Err(call.error(format_args!("{name} must be {} for this variable, got {count}", all.len())));
        }
        let elements = call.array_mut("elementIndicesOfDependent", elements, count)?;
        let independents = call.array_mut("independents", independents, count)?;
        let of = call.array_mut("elementIndicesOfIndependents", elements_of_independents, count)?;
        let kinds = call.array_mut("dependencyKinds", kinds, count)?;
        for (i, dependency) in all.iter().enumerate() {
            (elements[i], independents[i], of[i]) = (dependency.element, dependency.on, dependency.element_of);
        }
        kinds.fill(DEPENDENT);
        Ok(())
    }

    fn enter_step_mode[EnterStepMode](h, _) { h.instance.enter_step_mode() }

    fn enter_configuration_mode[EnterConfigurationMode](h, _) { h.instance.enter_configuration() }

    fn exit_configuration_mode[ExitConfigurationMode](h, _) { h.instance.exit_configuration() }

    /// fmi3DoStep without a callback for intermediate updates.
    fn do_step_without_updates[DoStep](
        h, call, time: f64, step: f64, event_handling_needed: *mut Boolean, terminate: *mut Boolean,
        early_return: *mut Boolean, last_successful_time: *mut f64
    ) {
        let event = call.target("eventHandlingNeeded", event_handling_needed)?;
        let terminate = call.target("terminateSimulation", terminate)?;
        let early = call.target("earlyReturn", early_return)?;
        let last = call.target("lastSuccessfulTime", last_successful_time)?;
        (*event, *terminate, *early, *last) = (0, 0, 0, h.instance.time());
        let (time, step) = (argument(time), argument(step));
        // For models without events, the constant lets the compiler remove this branch.
        if <E::Model as Model>::HAS_EVENTS && h.returns_early {
            let has_event = h.instance.do_step_to_event(time, step)?;
            *event = has_event.into();
            *early = (has_event && h.instance.time() < time + step).into();
        } else {
            h.instance.do_step(time, step)?;
        }
        if h.instance.is_finished() {
            (*event, *terminate) = (0, 1);
        }
        *last = h.instance.time();
        Ok(())
    }
}

/// The FMI 3.0 interface of a model, with all functions. The instantiation functions for interfaces that the FMU does
/// not provide return errors. [`model`](macro@crate::model) adds it where `cargo fmu pack` requests it.
#[doc(hidden)]
#[macro_export]
macro_rules! c_interface_of_fmi3 {
    (@instantiate $model:ty: $($name:ident $target:ident ($($argument:ident: $type:ty),*) ($($last:ident: $last_type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            name: *const c_char,
            token: *const c_char,
            resources: *const c_char,
            _visible: Boolean,
            logging_on: Boolean,
            $($argument: $type,)*
            environment: *mut c_void,
            logger: Option<Logger>
            $(, $last: $last_type)*
        ) -> Component {
            let arguments = Arguments { name, token, resources, logging_on, environment, logger };
            unsafe { $target::<$model>(arguments $(, $argument)* $(, $last)*) }
        }
    )*};
    (@number $model:ty: $($get:ident $set:ident $get_function:ident $set_function:ident $type:ty;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get(
            component: Component,
            vr: *const ValueReference,
            n: size_t,
            values: *mut $type,
            n_values: size_t,
        ) -> Status {
            let function = $crate::__private::calls::Function::$get_function;
            unsafe { get_number::<$model, $type>(component, function, vr, n, values, n_values) }
        }
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(
            component: Component,
            vr: *const ValueReference,
            n: size_t,
            values: *const $type,
            n_values: size_t,
        ) -> Status {
            let function = $crate::__private::calls::Function::$set_function;
            unsafe { set_number::<$model, $type>(component, function, vr, n, values, n_values) }
        }
    )*};
    (@timing $target:ident $model:ty: $($name:ident $function:ident ($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            component: Component,
            vr: *const ValueReference,
            n: size_t
            $(, $argument: $type)*
        ) -> Status {
            let function = $crate::__private::calls::Function::$function;
            unsafe { $target::<$model>(component, function, vr, n $(, $argument)*) }
        }
    )*};
    (@of $interface:ident $model:ty: $($name:ident $target:ident $function:ident ($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(component: Component $(, $argument: $type)*) -> Status {
            if <$model as $crate::__private::Export>::FORMAT.interfaces.$interface {
                unsafe { $target::<$model>(component $(, $argument)*) }
            } else {
                unsafe { not_provided::<$model>(component, $crate::__private::calls::Function::$function) }
            }
        }
    )*};
    ($model:ty) => {
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, clippy::missing_safety_doc, clippy::too_many_arguments)]
        pub mod c_interface {
            #[allow(unused_imports)]
            use super::*;
            use $crate::__private::abi::{Component, FmuState, Status};
            use $crate::__private::abi::fmi3::*;
            use $crate::__private::abi::c::*;

            $crate::unloading!($model);

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi3GetVersion() -> *const c_char {
                version()
            }
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi3FreeInstance(component: Component) {
                unsafe { free_instance::<$model>(component) }
            }
            $crate::c_interface_of_fmi3! { @instantiate $model:
                fmi3InstantiateModelExchange instantiate_model_exchange () ();
                fmi3InstantiateCoSimulation instantiate_co_simulation (event_mode: Boolean, early_return: Boolean, intermediate: *const ValueReference, n_intermediate: size_t) (update: Option<IntermediateUpdate>);
                fmi3InstantiateScheduledExecution instantiate_scheduled_execution () (update: Option<ClockUpdate>, lock: Option<Preemption>, unlock: Option<Preemption>);
            }
            $crate::c_functions! { $model:
                fmi3SetDebugLogging set_debug_logging (on: Boolean, n: size_t, categories: *const *const c_char);
                fmi3EnterInitializationMode enter_initialization_mode (with_tolerance: Boolean, tolerance: f64, start: f64, with_stop: Boolean, stop: f64);
                fmi3ExitInitializationMode exit_initialization_mode ();
                fmi3EnterEventMode enter_event_mode ();
                fmi3Terminate terminate ();
                fmi3Reset reset ();
                fmi3GetFMUState get_fmu_state (state: *mut FmuState);
                fmi3SetFMUState set_fmu_state (state: FmuState);
                fmi3FreeFMUState free_fmu_state (state: *mut FmuState);
                fmi3SerializedFMUStateSize serialized_fmu_state_size (state: FmuState, size: *mut size_t);
                fmi3SerializeFMUState serialize_fmu_state (state: FmuState, bytes: *mut u8, size: size_t);
                fmi3DeserializeFMUState deserialize_fmu_state (bytes: *const u8, size: size_t, state: *mut FmuState);
                fmi3EvaluateDiscreteStates evaluate_discrete_states ();
                fmi3UpdateDiscreteStates update_discrete_states (needs_update: *mut Boolean, terminate: *mut Boolean, nominals: *mut Boolean, states: *mut Boolean, next_defined: *mut Boolean, next: *mut f64);
                fmi3EnterStepMode enter_step_mode ();
                fmi3EnterConfigurationMode enter_configuration_mode ();
                fmi3ExitConfigurationMode exit_configuration_mode ();
                fmi3ActivateModelPartition activate_model_partition (clock: ValueReference, time: f64);
                fmi3GetNumberOfVariableDependencies get_number_of_variable_dependencies (vr: ValueReference, n: *mut size_t);
                fmi3GetVariableDependencies get_variable_dependencies (dependent: ValueReference, elements: *mut size_t, independents: *mut ValueReference, their_elements: *mut size_t, kinds: *mut c_int, n: size_t);
                fmi3GetDirectionalDerivative get_derivative GetDirectionalDerivative (unknowns: *const ValueReference, n_unknowns: size_t, knowns: *const ValueReference, n_knowns: size_t, seed: *const f64, n_seed: size_t, result: *mut f64, n_result: size_t);
                fmi3GetAdjointDerivative get_derivative GetAdjointDerivative (unknowns: *const ValueReference, n_unknowns: size_t, knowns: *const ValueReference, n_knowns: size_t, seed: *const f64, n_seed: size_t, result: *mut f64, n_result: size_t);
                fmi3GetOutputDerivatives get_output_derivatives (vr: *const ValueReference, n: size_t, orders: *const i32, values: *mut f64, n_values: size_t);
                fmi3GetFloat64 get_float64 (vr: *const ValueReference, n: size_t, values: *mut f64, n_values: size_t);
                fmi3SetFloat64 set_float64 (vr: *const ValueReference, n: size_t, values: *const f64, n_values: size_t);
                fmi3GetBoolean get_boolean (vr: *const ValueReference, n: size_t, values: *mut Boolean, n_values: size_t);
                fmi3SetBoolean set_boolean (vr: *const ValueReference, n: size_t, values: *const Boolean, n_values: size_t);
                fmi3GetString get_string (vr: *const ValueReference, n: size_t, values: *mut *const c_char, n_values: size_t);
                fmi3GetBinary get_binary (vr: *const ValueReference, n: size_t, sizes: *mut size_t, values: *mut *const u8, n_values: size_t);
                fmi3SetBinary set_binary (vr: *const ValueReference, n: size_t, sizes: *const size_t, values: *const *const u8, n_values: size_t);
                fmi3GetClock get_clock (vr: *const ValueReference, n: size_t, values: *mut Boolean);
                fmi3SetClock set_clock (vr: *const ValueReference, n: size_t, values: *const Boolean);
                fmi3GetIntervalDecimal get_interval_decimal (vr: *const ValueReference, n: size_t, intervals: *mut f64, qualifiers: *mut c_int);
                fmi3GetIntervalFraction get_interval_fraction (vr: *const ValueReference, n: size_t, counters: *mut u64, resolutions: *mut u64, qualifiers: *mut c_int);
                fmi3GetShiftDecimal get_shift_decimal (vr: *const ValueReference, n: size_t, shifts: *mut f64);
                fmi3GetShiftFraction get_shift_fraction (vr: *const ValueReference, n: size_t, counters: *mut u64, resolutions: *mut u64);
                fmi3SetString set_string (vr: *const ValueReference, n: size_t, values: *const *const c_char, n_values: size_t);
            }
            $crate::c_interface_of_fmi3! { @number $model:
                fmi3GetFloat32 fmi3SetFloat32 GetFloat32 SetFloat32 f32;
                fmi3GetInt8 fmi3SetInt8 GetInt8 SetInt8 i8;
                fmi3GetUInt8 fmi3SetUInt8 GetUInt8 SetUInt8 u8;
                fmi3GetInt16 fmi3SetInt16 GetInt16 SetInt16 i16;
                fmi3GetUInt16 fmi3SetUInt16 GetUInt16 SetUInt16 u16;
                fmi3GetInt32 fmi3SetInt32 GetInteger SetInteger i32;
                fmi3GetUInt32 fmi3SetUInt32 GetUInt32 SetUInt32 u32;
                fmi3GetInt64 fmi3SetInt64 GetInt64 SetInt64 i64;
                fmi3GetUInt64 fmi3SetUInt64 GetUInt64 SetUInt64 u64;
            }
            $crate::c_interface_of_fmi3! { @timing set_timing $model:
                fmi3SetIntervalDecimal SetIntervalDecimal (intervals: *const f64);
                fmi3SetShiftDecimal SetShiftDecimal (shifts: *const f64);
            }
            $crate::c_interface_of_fmi3! { @timing set_timing_fraction $model:
                fmi3SetIntervalFraction SetIntervalFraction (counters: *const u64, resolutions: *const u64);
                fmi3SetShiftFraction SetShiftFraction (counters: *const u64, resolutions: *const u64);
            }
            $crate::c_interface_of_fmi3! { @of co_simulation $model:
                fmi3DoStep do_step DoStep (time: f64, step: f64, no_set_before: Boolean, event: *mut Boolean, terminate: *mut Boolean, early: *mut Boolean, last: *mut f64);
            }
            $crate::c_interface_of_fmi3! { @of model_exchange $model:
                fmi3EnterContinuousTimeMode enter_continuous_time_mode EnterContinuousTimeMode ();
                fmi3CompletedIntegratorStep completed_integrator_step CompletedIntegratorStep (no_set_before: Boolean, enter_event_mode: *mut Boolean, terminate: *mut Boolean);
                fmi3SetTime set_time SetTime (time: f64);
                fmi3SetContinuousStates set_continuous_states SetContinuousStates (x: *const f64, n: size_t);
                fmi3GetContinuousStateDerivatives get_derivatives GetDerivatives (value: *mut f64, n: size_t);
                fmi3GetEventIndicators get_event_indicators GetEventIndicators (value: *mut f64, n: size_t);
                fmi3GetContinuousStates get_continuous_states GetContinuousStates (x: *mut f64, n: size_t);
                fmi3GetNominalsOfContinuousStates get_nominals_of_continuous_states GetNominalsOfContinuousStates (value: *mut f64, n: size_t);
                fmi3GetNumberOfEventIndicators get_number_of_event_indicators GetNumberOfEventIndicators (n: *mut size_t);
                fmi3GetNumberOfContinuousStates get_number_of_continuous_states GetNumberOfContinuousStates (n: *mut size_t);
            }
        }
    };
}
