//! Calls the C functions as a master does.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::marker::PhantomData;
use std::ptr::{null, null_mut};

use fmu::testing::abi::fmi2::{self, Callbacks, Logger};
use fmu::testing::abi::{self, Component, Export, FmuState, Status};
use fmu::testing::calls::{Function, Version};

use crate::allocations::live;
use crate::models::{CartPair, Fragile, Sampler, reference};

/// A message that the logger received.
#[derive(Clone, Debug, PartialEq)]
struct Message {
    instance: String,
    status: c_int,
    category: String,
    /// As received: a printf format.
    format: String,
}

type Messages = RefCell<Vec<Message>>;

unsafe extern "C" fn collect(
    environment: *mut c_void,
    instance: *const c_char,
    status: c_int,
    category: *const c_char,
    format: *const c_char,
) {
    // SAFETY: the environment is the list from `callbacks`; the strings end with a zero.
    unsafe {
        let text = |text: *const c_char| CStr::from_ptr(text).to_str().unwrap().to_owned();
        let message = Message { instance: text(instance), status, category: text(category), format: text(format) };
        (*environment.cast::<Messages>()).borrow_mut().push(message);
    }
}

/// Stable Rust cannot define variadic functions. A function without the variadic arguments is called in the same way.
fn logger() -> Logger {
    type Plain = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char);
    // SAFETY: both are pointers to functions with the C calling convention; variadic arguments are never passed.
    unsafe { std::mem::transmute::<Plain, Logger>(collect) }
}

fn callbacks(messages: &Messages) -> Callbacks {
    Callbacks {
        logger: Some(logger()),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        environment: std::ptr::from_ref(messages).cast_mut().cast(),
    }
}

const MODEL_EXCHANGE: c_int = 0;
const CO_SIMULATION: c_int = 1;

/// An instance with the name "unit" that is used through the C interface, and its messages.
pub(crate) struct C<E: Export> {
    pub(crate) component: Component,
    messages: Box<Messages>,
    export: PhantomData<E>,
}

impl<E: Export> Drop for C<E> {
    fn drop(&mut self) {
        // SAFETY: freed once.
        unsafe { fmi2::free_instance::<E>(self.component) }
    }
}

impl<E: Export> C<E> {
    fn new(logging_on: bool) -> Self {
        Self::of(CO_SIMULATION, logging_on)
    }

    fn of(interface: c_int, logging_on: bool) -> Self {
        let messages = Box::new(Messages::default());
        let guid = CString::new(E::description().guid.as_str()).unwrap();
        // SAFETY: all pointers live long enough.
        let component = unsafe {
            fmi2::instantiate::<E>(
                c"unit".as_ptr(),
                interface,
                guid.as_ptr(),
                c"file:///nowhere".as_ptr(),
                &callbacks(&messages),
                0,
                c_int::from(logging_on),
            )
        };
        assert!(!component.is_null(), "{messages:?}");
        Self { component, messages, export: PhantomData }
    }

    /// An instance in Step Mode.
    pub(crate) fn ready() -> Self {
        let fmu = Self::new(false);
        assert_eq!(fmu.initialize(), Status::Ok);
        fmu
    }

    /// An instance for model exchange, in Event Mode.
    pub(crate) fn exchange() -> Self {
        let fmu = Self::of(MODEL_EXCHANGE, false);
        assert_eq!(fmu.initialize(), Status::Ok);
        fmu
    }

    fn initialize(&self) -> Status {
        // SAFETY: the component lives.
        unsafe {
            assert_eq!(fmi2::setup_experiment::<E>(self.component, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
            assert_eq!(fmi2::enter_initialization_mode::<E>(self.component), Status::Ok);
            fmi2::exit_initialization_mode::<E>(self.component)
        }
    }

    fn set(&self, name: &str, value: f64) -> Status {
        // SAFETY: one reference, one value.
        unsafe { fmi2::set_real::<E>(self.component, &reference::<E>(name), 1, &value) }
    }

    pub(crate) fn get(&self, name: &str) -> f64 {
        let mut value = f64::NAN;
        // SAFETY: one reference, one value.
        let status = unsafe { fmi2::get_real::<E>(self.component, &reference::<E>(name), 1, &mut value) };
        assert_eq!(status, Status::Ok, "{:?}", self.messages);
        value
    }

    pub(crate) fn step(&self, time: f64, step: f64) -> Status {
        // SAFETY: the component lives.
        unsafe { fmi2::do_step::<E>(self.component, time, step, 1) }
    }

    pub(crate) fn save(&self) -> FmuState {
        let mut state = null_mut();
        // SAFETY: the pointer is written to.
        assert_eq!(unsafe { fmi2::get_fmu_state::<E>(self.component, &mut state) }, Status::Ok);
        assert!(!state.is_null());
        state
    }

    fn bytes(&self, state: FmuState) -> Vec<c_char> {
        let mut size = 0;
        // SAFETY: the state comes from the component; the array has this size.
        unsafe {
            assert_eq!(fmi2::serialized_fmu_state_size::<E>(self.component, state, &mut size), Status::Ok);
            let mut bytes = vec![0; size];
            let status = fmi2::serialize_fmu_state::<E>(self.component, state, bytes.as_mut_ptr(), size);
            assert_eq!(status, Status::Ok);
            bytes
        }
    }

    /// Messages since the last call.
    fn take(&self) -> Vec<Message> {
        self.messages.take()
    }

    /// The only message since the last call, which must be an error.
    #[track_caller]
    fn error(&self) -> String {
        let mut messages = self.take();
        assert_eq!(messages.len(), 1, "{messages:?}");
        let Message { instance, status, category, format } = messages.remove(0);
        assert_eq!((instance.as_str(), status, category.as_str()), ("unit", Status::Error as c_int, "logStatusError"));
        format
    }
}

#[test]
fn a_failed_instantiation_logs_the_reason() {
    let messages = Messages::default();
    let callbacks = callbacks(&messages);
    let guid = CString::new(Sampler::description().guid.as_str()).unwrap();
    let (name, guid, uri) = (c"unit".as_ptr(), guid.as_ptr(), c"file:///x".as_ptr());
    let rejected = |name, kind, guid, uri| {
        // SAFETY: each string is null or ends with a zero.
        let component = unsafe { fmi2::instantiate::<Sampler>(name, kind, guid, uri, &callbacks, 0, 0) };
        assert!(component.is_null());
        let mut messages = messages.take();
        assert_eq!(messages.len(), 1, "{messages:?}");
        let message = messages.remove(0);
        assert_eq!((message.status, message.category.as_str()), (3, "logStatusError"));
        message.format
    };
    assert_eq!(rejected(null(), 1, guid, uri), "fmi2Instantiate: instanceName is a null pointer");
    assert_eq!(rejected(c"".as_ptr(), 1, guid, uri), "fmi2Instantiate: instanceName is empty");
    assert_eq!(rejected(c"\xff".as_ptr(), 1, guid, uri), "fmi2Instantiate: instanceName is not UTF-8");
    for kind in [2, -1] {
        assert_eq!(
            rejected(name, kind, guid, uri),
            format!("fmi2Instantiate: fmuType must be 0 (model exchange) or 1 (co-simulation), got {kind}")
        );
    }
    assert_eq!(rejected(name, 1, null(), uri), "fmi2Instantiate: fmuGUID is a null pointer");
    // The message is a printf format: the percent sign is doubled.
    assert_eq!(
        rejected(name, 1, c"{50%n#r1#}".as_ptr(), uri),
        format!(
            "fmi2Instantiate: fmuGUID must be {}, got {{50%%n##r1##}}; the library and modelDescription.xml do not \
             belong together",
            Sampler::description().guid
        )
    );
    assert_eq!(rejected(name, 1, guid, c"\xc3".as_ptr()), "fmi2Instantiate: fmuResourceLocation is not UTF-8");
    // Without callbacks or without a logger, the reason cannot be reported.
    let silent = Callbacks { logger: None, ..callbacks };
    // SAFETY: null callbacks are rejected; resources may be null.
    unsafe {
        assert!(fmi2::instantiate::<Sampler>(name, 1, guid, uri, null(), 0, 0).is_null());
        assert!(fmi2::instantiate::<Sampler>(null(), 1, guid, uri, &silent, 0, 0).is_null());
        let component = fmi2::instantiate::<Sampler>(name, 1, guid, null(), &silent, 1, 1);
        assert!(!component.is_null());
        assert_eq!(fmi2::do_step::<Sampler>(component, 0.0, 0.1, 0), Status::Error);
        fmi2::free_instance::<Sampler>(component);
    }
    assert_eq!(messages.take(), []);
}

#[test]
fn versions_and_description_are_c_strings() {
    // SAFETY: the strings live as long as the library.
    let text = |text: *const c_char| unsafe { CStr::from_ptr(text) }.to_str().unwrap();
    assert_eq!(text(fmi2::version()), "2.0");
    assert_eq!(text(fmi2::types_platform()), "default");
    assert_eq!(text(abi::model_description::<CartPair>(2, 3)), CartPair::description().xml);
}

/// Every function of the C interface that returns a status, with harmless arguments.
fn all_calls<E: Export>(component: Component) -> Vec<(Function, Status)> {
    let (mut real, mut integer, mut text, mut size, mut state) = (0.0, 0, null(), 0, null_mut());
    let (mut other_integer, mut event_info) = (0, fmi2::EventInfo::default());
    // SAFETY: arrays of length 0 may be null; the other pointers are written to.
    unsafe {
        vec![
            (Function::SetDebugLogging, fmi2::set_debug_logging::<E>(component, 0, 0, null())),
            (Function::SetupExperiment, fmi2::setup_experiment::<E>(component, 0, 0.0, 0.0, 0, 0.0)),
            (Function::EnterInitializationMode, fmi2::enter_initialization_mode::<E>(component)),
            (Function::ExitInitializationMode, fmi2::exit_initialization_mode::<E>(component)),
            (Function::Terminate, fmi2::terminate::<E>(component)),
            (Function::GetReal, fmi2::get_real::<E>(component, null(), 0, null_mut())),
            (Function::GetInteger, fmi2::get_integer::<E>(component, null(), 0, null_mut())),
            (Function::GetBoolean, fmi2::get_boolean::<E>(component, null(), 0, null_mut())),
            (Function::GetString, fmi2::get_string::<E>(component, null(), 0, null_mut())),
            (Function::SetReal, fmi2::set_real::<E>(component, null(), 0, null())),
            (Function::SetInteger, fmi2::set_integer::<E>(component, null(), 0, null())),
            (Function::SetBoolean, fmi2::set_boolean::<E>(component, null(), 0, null())),
            (Function::SetString, fmi2::set_string::<E>(component, null(), 0, null())),
            (Function::GetFMUstate, fmi2::get_fmu_state::<E>(component, &mut state)),
            (Function::SetFMUstate, fmi2::set_fmu_state::<E>(component, state)),
            (Function::FreeFMUstate, fmi2::free_fmu_state::<E>(component, &mut state)),
            (Function::SerializedFMUstateSize, fmi2::serialized_fmu_state_size::<E>(component, state, &mut size)),
            (Function::SerializeFMUstate, fmi2::serialize_fmu_state::<E>(component, state, null_mut::<u8>(), 0)),
            (Function::DeSerializeFMUstate, fmi2::deserialize_fmu_state::<E>(component, null::<u8>(), 0, &mut state)),
            (
                Function::GetDirectionalDerivative,
                fmi2::get_directional_derivative::<E>(component, null(), 0, null(), 0, null(), null_mut()),
            ),
            (
                Function::SetRealInputDerivatives,
                fmi2::set_real_input_derivatives::<E>(component, null(), 0, null(), null()),
            ),
            (
                Function::GetRealOutputDerivatives,
                fmi2::get_real_output_derivatives::<E>(component, null(), 0, null(), null_mut()),
            ),
            (Function::DoStep, fmi2::do_step::<E>(component, 0.0, 0.1, 1)),
            (Function::CancelStep, fmi2::cancel_step::<E>(component)),
            (Function::GetStatus, fmi2::get_status::<E>(component, 0, &mut integer)),
            (Function::GetRealStatus, fmi2::get_real_status::<E>(component, 2, &mut real)),
            (Function::GetIntegerStatus, fmi2::get_integer_status::<E>(component, 0, &mut integer)),
            (Function::GetBooleanStatus, fmi2::get_boolean_status::<E>(component, 3, &mut integer)),
            (Function::GetStringStatus, fmi2::get_string_status::<E>(component, 1, &mut text)),
            (Function::EnterEventMode, fmi2::enter_event_mode::<E>(component)),
            (Function::NewDiscreteStates, fmi2::new_discrete_states::<E>(component, &mut event_info)),
            (Function::EnterContinuousTimeMode, fmi2::enter_continuous_time_mode::<E>(component)),
            (
                Function::CompletedIntegratorStep,
                fmi2::completed_integrator_step::<E>(component, 1, &mut integer, &mut other_integer),
            ),
            (Function::SetTime, fmi2::set_time::<E>(component, 0.0)),
            (Function::SetContinuousStates, fmi2::set_continuous_states::<E>(component, null(), 0)),
            (Function::GetDerivatives, fmi2::get_derivatives::<E>(component, null_mut(), 0)),
            (Function::GetEventIndicators, fmi2::get_event_indicators::<E>(component, null_mut(), 0)),
            (Function::GetContinuousStates, fmi2::get_continuous_states::<E>(component, null_mut(), 0)),
            (
                Function::GetNominalsOfContinuousStates,
                fmi2::get_nominals_of_continuous_states::<E>(component, null_mut(), 0),
            ),
            (Function::Reset, fmi2::reset::<E>(component)),
        ]
    }
}

#[test]
fn a_null_component_is_an_error_everywhere() {
    let calls = all_calls::<Sampler>(null_mut());
    let of_fmi2 = Function::ALL.iter().filter(|function| !function.name(Version::Fmi2).is_empty());
    assert_eq!(calls.len(), of_fmi2.count(), "every function is called");
    for (function, status) in calls {
        assert_eq!(status, Status::Error, "{}", function.name(Version::Fmi2));
    }
    // SAFETY: a null pointer is ignored.
    unsafe { fmi2::free_instance::<Sampler>(null_mut()) }
}

#[test]
fn empty_arrays_may_be_null_and_others_may_not() {
    let fmu = C::<Sampler>::ready();
    let one = reference::<Sampler>("filter_input");
    let component = fmu.component;
    // SAFETY: null and misaligned pointers are rejected before they are read.
    unsafe {
        assert_eq!(fmi2::get_real::<Sampler>(component, null(), 0, null_mut()), Status::Ok);
        assert_eq!(fmi2::set_real::<Sampler>(component, null(), 0, null()), Status::Ok);
        assert_eq!(fmu.take(), []);

        assert_eq!(fmi2::get_real::<Sampler>(component, null(), 1, &mut 0.0), Status::Error);
        assert_eq!(fmu.error(), "fmi2GetReal: vr must be an array of length 1, got a null pointer");
        assert_eq!(fmi2::get_real::<Sampler>(component, &one, 1, null_mut()), Status::Error);
        assert_eq!(fmu.error(), "fmi2GetReal: value must be an array of length 1, got a null pointer");
        assert_eq!(fmi2::set_real::<Sampler>(component, &one, 1, null()), Status::Error);
        assert_eq!(fmu.error(), "fmi2SetReal: value must be an array of length 1, got a null pointer");
        let odd = null::<u8>().wrapping_add(3).cast::<f64>();
        assert_eq!(fmi2::set_real::<Sampler>(component, &one, 1, odd), Status::Error);
        assert_eq!(
            fmu.error(),
            "fmi2SetReal: value is not a valid array: its pointer is misaligned, or its length, 1, is too large"
        );
        assert_eq!(fmi2::set_real::<Sampler>(component, &one, usize::MAX, &0.0), Status::Error);
        assert!(fmu.error().ends_with("is too large"));

        let label = reference::<Sampler>("filter.label");
        let fresh = C::<Sampler>::new(false);
        assert_eq!(fmi2::set_string::<Sampler>(fresh.component, &label, 1, &null()), Status::Error);
        assert_eq!(fresh.error(), "fmi2SetString: a value is a null pointer");
        assert_eq!(fmi2::set_string::<Sampler>(fresh.component, &label, 1, &c"\xff".as_ptr()), Status::Error);
        assert_eq!(fresh.error(), "fmi2SetString: a value is not UTF-8");

        assert_eq!(fmi2::get_fmu_state::<Sampler>(component, null_mut()), Status::Error);
        assert!(fmu.error().starts_with("fmi2GetFMUstate: FMUstate must be an array of length "));
        assert_eq!(fmi2::get_real_status::<Sampler>(component, 2, null_mut()), Status::Error);
        assert!(fmu.error().starts_with("fmi2GetRealStatus: value must be an array of length "));
        assert_eq!(fmi2::get_boolean_status::<Sampler>(component, 3, null_mut()), Status::Error);
        assert!(fmu.error().starts_with("fmi2GetBooleanStatus: value must be an array of length "));
        assert_eq!(fmi2::set_debug_logging::<Sampler>(component, 1, 1, null()), Status::Error);
        assert!(fmu.error().starts_with("fmi2SetDebugLogging: categories must be an array of length "));
        assert_eq!(fmi2::set_debug_logging::<Sampler>(component, 1, 1, &null()), Status::Error);
        assert_eq!(fmu.error(), "fmi2SetDebugLogging: a category is a null pointer");
    }
}

#[test]
fn all_types_are_set_and_read_back() {
    let fmu = C::<Sampler>::new(false);
    let component = fmu.component;
    let [order, on, label] = ["filter.order", "filter.on", "filter.label"].map(reference::<Sampler>);
    let text = c"100 % gr\xc3\xbcn \"<&>\"";
    // SAFETY: one reference, one value; strings end with a zero.
    unsafe {
        assert_eq!(fmi2::set_integer::<Sampler>(component, &order, 1, &3), Status::Ok);
        assert_eq!(fmi2::set_boolean::<Sampler>(component, &on, 1, &0), Status::Ok);
        assert_eq!(fmi2::set_string::<Sampler>(component, &label, 1, &text.as_ptr()), Status::Ok);
        assert_eq!(fmu.initialize(), Status::Ok);
        let (mut integer, mut boolean, mut string) = (0, 7, null());
        assert_eq!(fmi2::get_integer::<Sampler>(component, &order, 1, &mut integer), Status::Ok);
        assert_eq!(fmi2::get_boolean::<Sampler>(component, &on, 1, &mut boolean), Status::Ok);
        assert_eq!(fmi2::get_string::<Sampler>(component, &label, 1, &mut string), Status::Ok);
        assert_eq!((integer, boolean), (3, 0));
        // The pointer stays valid during other calls.
        assert_eq!(fmu.step(0.0, 0.01), Status::Ok);
        assert_eq!(CStr::from_ptr(string), text);
        // Nothing is written unless all references are valid.
        let mut pair = [5, 5];
        assert_eq!(fmi2::get_integer::<Sampler>(component, [order, on].as_ptr(), 2, pair.as_mut_ptr()), Status::Error);
        assert_eq!(pair, [5, 5]);
        assert!(fmu.error().contains("must be a variable of type Integer, it is 'filter.on' of type Boolean"));
    }
    let carts = C::<CartPair>::ready();
    let on = reference::<CartPair>("damper.on");
    for (value, expected) in [(0, 0), (-1, 1), (256, 1)] {
        let mut boolean = 7;
        // SAFETY: one reference, one value.
        unsafe {
            assert_eq!(fmi2::set_boolean::<CartPair>(carts.component, &on, 1, &value), Status::Ok);
            assert_eq!(fmi2::get_boolean::<CartPair>(carts.component, &on, 1, &mut boolean), Status::Ok);
        }
        assert_eq!(boolean, expected);
    }
}

#[test]
fn percent_signs_in_messages_are_doubled() {
    let fmu = C::<Sampler>::new(false);
    let category = c"%s%n 50%".as_ptr();
    // SAFETY: one string.
    let status = unsafe { fmi2::set_debug_logging::<Sampler>(fmu.component, 1, 1, &category) };
    assert_eq!(status, Status::Error);
    assert_eq!(
        fmu.error(),
        "fmi2SetDebugLogging: category '%%s%%n 50%%' is unknown, expected one of logStatusError, logStatusDiscard, \
         logEvents"
    );
}

#[test]
fn the_categories_decide_what_is_logged_and_errors_always_are() {
    let discarded = |fmu: &C<Sampler>| {
        // SAFETY: the value is not written to.
        let status = unsafe { fmi2::get_status::<Sampler>(fmu.component, 0, &mut 0) };
        assert_eq!(status, Status::Discard);
    };
    let choose = |fmu: &C<Sampler>, on: bool, names: &[&CStr]| {
        let names: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
        let pointer = if names.is_empty() { null() } else { names.as_ptr() };
        // SAFETY: an array of strings.
        unsafe { fmi2::set_debug_logging::<Sampler>(fmu.component, c_int::from(on), names.len(), pointer) }
    };
    let kinds = |fmu: &C<Sampler>| {
        // Causes two events, a request for information that does not exist, and an error.

        // SAFETY: the component lives.
        unsafe { fmi2::reset::<Sampler>(fmu.component) };
        fmu.initialize();
        discarded(fmu);
        assert_eq!(fmu.step(0.0, -1.0), Status::Error);
        let kinds: Vec<_> = fmu.take().iter().map(|m| format!("{} {}", m.category, m.status)).collect();
        kinds.join(", ")
    };
    let all = "logEvents 0, logEvents 0, logStatusDiscard 2, logStatusError 3";

    let fmu = C::<Sampler>::new(true);
    assert_eq!(kinds(&fmu), all);
    assert_eq!(choose(&fmu, false, &[]), Status::Ok);
    assert_eq!(kinds(&fmu), "logStatusError 3");
    assert_eq!(choose(&fmu, true, &[c"logStatusDiscard"]), Status::Ok);
    assert_eq!(kinds(&fmu), "logStatusDiscard 2, logStatusError 3");
    // A rejected choice changes nothing, even if its first name is valid.
    assert_eq!(choose(&fmu, true, &[c"logEvents", c"logAll"]), Status::Error);
    fmu.take();
    assert_eq!(kinds(&fmu), "logStatusDiscard 2, logStatusError 3");
    assert_eq!(choose(&fmu, true, &[c"logEvents", c"logStatusDiscard"]), Status::Ok);
    assert_eq!(kinds(&fmu), all);
    assert_eq!(choose(&fmu, false, &[c"logEvents"]), Status::Ok);
    assert_eq!(kinds(&fmu), "logStatusError 3");
    assert_eq!(kinds(&C::<Sampler>::new(false)), "logStatusError 3");

    let fmu = C::<Sampler>::new(true);
    fmu.initialize();
    let state = fmu.save();
    // SAFETY: a state of the component.
    unsafe {
        fmi2::set_fmu_state::<Sampler>(fmu.component, state);
        fmi2::terminate::<Sampler>(fmu.component);
    }
    let events: Vec<_> = fmu.take().into_iter().map(|message| message.format).collect();
    assert_eq!(events, ["initialized", "state at 0 s restored", "terminated at 0 s"]);
}

#[test]
fn a_simulation_through_the_c_interface() {
    let fmu = C::<Sampler>::ready();
    assert_eq!(fmu.set("filter_input", 0.5), Status::Ok);
    for k in 0..100 {
        assert_eq!(fmu.step(f64::from(k) * 0.01, 0.01), Status::Ok);
    }
    assert_eq!(fmu.get("filter_count"), 100.0);
    let (mut time, mut ended) = (0.0, 7);
    // SAFETY: the values are written to.
    unsafe {
        assert_eq!(fmi2::get_real_status::<Sampler>(fmu.component, 2, &mut time), Status::Ok);
        assert_eq!(fmi2::get_boolean_status::<Sampler>(fmu.component, 3, &mut ended), Status::Ok);
        assert_eq!((time, ended), (99.0 * 0.01 + 0.01, 0));
        // Status kinds that are not available are discarded; no step is ever pending.
        assert_eq!(fmi2::get_real_status::<Sampler>(fmu.component, 0, &mut time), Status::Discard);
        assert_eq!(fmi2::get_boolean_status::<Sampler>(fmu.component, 2, &mut ended), Status::Discard);
        for kind in [-1, 0, 1, 2, 3, 4] {
            assert_eq!(fmi2::get_status::<Sampler>(fmu.component, kind, null_mut()), Status::Discard);
            assert_eq!(fmi2::get_integer_status::<Sampler>(fmu.component, kind, null_mut()), Status::Discard);
            assert_eq!(fmi2::get_string_status::<Sampler>(fmu.component, kind, null_mut()), Status::Discard);
        }
        assert_eq!(fmi2::cancel_step::<Sampler>(fmu.component), Status::Error);
        assert_eq!(fmu.error(), "fmi2CancelStep: no step is pending");
        let (input, output) = (reference::<Sampler>("filter_input"), reference::<Sampler>("filter_output"));
        let set = fmi2::set_real_input_derivatives::<Sampler>(fmu.component, &input, 1, &1, &0.0);
        assert_eq!(set, Status::Error);
        assert_eq!(fmu.error(), "fmi2SetRealInputDerivatives: not supported (see the capability flags)");
        let get = fmi2::get_real_output_derivatives::<Sampler>(fmu.component, &output, 1, &1, &mut time);
        assert_eq!(get, Status::Error);
        assert_eq!(fmu.error(), "fmi2GetRealOutputDerivatives: not supported (see the capability flags)");
        assert_eq!(fmi2::terminate::<Sampler>(fmu.component), Status::Ok);
    }
    assert_eq!(fmu.step(1.0, 0.01), Status::Error);
    assert_eq!(fmu.error(), "fmi2DoStep called in Terminated, allowed in Step Mode");
    assert_eq!(fmu.get("filter_count"), 100.0);
}

#[test]
fn directional_derivatives_through_the_c_interface() {
    let fmu = C::<CartPair>::ready();
    let unknown = ["der(cart_velocity.l)", "cart_acceleration.r"].map(reference::<CartPair>);
    let known = ["cart_position.l", "cart_force.r"].map(reference::<CartPair>);
    let mut slopes = [0.0; 2];
    // SAFETY: arrays of two.
    let status = unsafe {
        fmi2::get_directional_derivative::<CartPair>(
            fmu.component,
            unknown.as_ptr(),
            2,
            known.as_ptr(),
            2,
            [1.0, 4.0].as_ptr(),
            slopes.as_mut_ptr(),
        )
    };
    assert_eq!((status, slopes), (Status::Ok, [-4.0, 2.0]));
}

#[test]
fn a_failed_step_is_an_error_that_a_saved_state_undoes() {
    let fmu = C::<Fragile>::ready();
    assert_eq!(fmu.step(0.0, 0.1), Status::Ok);
    let state = fmu.save();
    assert_eq!(fmu.set("divisor", 0.0), Status::Ok);
    assert_eq!(fmu.step(0.1, 0.1), Status::Error);
    assert_eq!(
        fmu.error(),
        "fmi2DoStep: 'quotient' became inf at 0.1 s; the state at 0.1 s was restored and the instance cannot continue"
    );
    assert_eq!(fmu.get("sum_of_quotients"), 1.0);
    // SAFETY: a state of the component.
    assert_eq!(unsafe { fmi2::set_fmu_state::<Fragile>(fmu.component, state) }, Status::Ok);
    assert_eq!(fmu.step(0.1, 0.1), Status::Ok);
    assert_eq!(fmu.get("sum_of_quotients"), 2.0);
}

#[test]
fn states_belong_to_one_instance_and_are_known_until_they_are_freed() {
    const STRANGER: &str =
        "FMUstate is not a state of this instance (never saved, already freed, or from another instance)";
    let (fmu, other) = (C::<Sampler>::ready(), C::<Sampler>::ready());
    let component = fmu.component;
    let state = fmu.save();
    let mut word = 0_u64;
    let nonsense: FmuState = std::ptr::from_mut(&mut word).cast();
    // SAFETY: unknown states are rejected before they are read.
    unsafe {
        for stranger in [null_mut(), nonsense, other.save()] {
            let mut size = 7;
            assert_eq!(fmi2::set_fmu_state::<Sampler>(component, stranger), Status::Error);
            assert_eq!(fmu.error(), format!("fmi2SetFMUstate: {STRANGER}"));
            assert_eq!(fmi2::serialized_fmu_state_size::<Sampler>(component, stranger, &mut size), Status::Error);
            assert_eq!(fmu.error(), format!("fmi2SerializedFMUstateSize: {STRANGER}"));
            assert_eq!(fmi2::serialize_fmu_state::<Sampler>(component, stranger, null_mut::<u8>(), 0), Status::Error);
            assert_eq!(fmu.error(), format!("fmi2SerializeFMUstate: {STRANGER}"));
            assert_eq!(size, 7);
            if !stranger.is_null() {
                let mut pointer = stranger;
                assert_eq!(fmi2::get_fmu_state::<Sampler>(component, &mut pointer), Status::Error);
                assert_eq!(fmu.error(), format!("fmi2GetFMUstate: {STRANGER}"));
                assert_eq!(fmi2::free_fmu_state::<Sampler>(component, &mut pointer), Status::Error);
                assert_eq!(fmu.error(), format!("fmi2FreeFMUstate: {STRANGER}"));
                assert_eq!(pointer, stranger);
            }
        }
        // Freeing a state sets the caller's variable to null. A copy of the pointer is rejected afterwards.
        let (mut first, stale) = (state, state);
        assert_eq!(fmi2::free_fmu_state::<Sampler>(component, &mut first), Status::Ok);
        assert!(first.is_null());
        assert_eq!(fmi2::free_fmu_state::<Sampler>(component, &mut first), Status::Ok);
        assert_eq!(fmi2::free_fmu_state::<Sampler>(component, null_mut()), Status::Ok);
        assert_eq!(fmu.take(), []);
        let mut again = stale;
        assert_eq!(fmi2::free_fmu_state::<Sampler>(component, &mut again), Status::Error);
        assert_eq!(fmu.error(), format!("fmi2FreeFMUstate: {STRANGER}"));
        assert_eq!(fmi2::set_fmu_state::<Sampler>(component, stale), Status::Error);
        assert_eq!(fmu.error(), format!("fmi2SetFMUstate: {STRANGER}"));
        let odd = null_mut::<u8>().wrapping_add(3).cast::<FmuState>();
        assert_eq!(fmi2::free_fmu_state::<Sampler>(component, odd), Status::Error);
        assert_eq!(
            fmu.error(),
            "fmi2FreeFMUstate: FMUstate is not a valid array: its pointer is misaligned, or its length, 1, is too large"
        );
    }
}

#[test]
fn nothing_is_left_of_a_freed_instance() {
    let run = || {
        let fmu = C::<Sampler>::new(true);
        let label = reference::<Sampler>("filter.label");
        // SAFETY: one reference, one string.
        unsafe { fmi2::set_string::<Sampler>(fmu.component, &label, 1, &c"longer".as_ptr()) };
        fmu.initialize();
        let mut freed = fmu.save();
        fmu.bytes(freed);
        // These states are freed with their instance.
        fmu.save();
        assert_eq!(fmu.step(0.0, -1.0), Status::Error);
        // SAFETY: a state of the component.
        unsafe {
            assert_eq!(fmi2::set_fmu_state::<Sampler>(fmu.component, freed), Status::Ok);
            assert_eq!(fmi2::get_fmu_state::<Sampler>(fmu.component, &mut freed), Status::Ok);
            assert_eq!(fmi2::reset::<Sampler>(fmu.component), Status::Ok);
        }
    };
    run(); // the description is computed once and kept
    let before = live();
    run();
    assert_eq!(live(), before);
}

#[test]
fn a_passed_state_is_overwritten() {
    let fmu = C::<Sampler>::ready();
    let state = fmu.save();
    let first = fmu.bytes(state);
    assert_eq!(fmu.step(0.0, 0.05), Status::Ok);
    let mut same = state;
    // SAFETY: a state of the component.
    unsafe {
        assert_eq!(fmi2::get_fmu_state::<Sampler>(fmu.component, &mut same), Status::Ok);
        assert_eq!(same, state);
        assert_ne!(fmu.bytes(state), first);
        // Deserializing bytes also overwrites the state.
        let status = fmi2::deserialize_fmu_state::<Sampler>(fmu.component, first.as_ptr(), first.len(), &mut same);
        assert_eq!((status, same), (Status::Ok, state));
        assert_eq!(fmu.bytes(state), first);
        // If bytes are rejected, the saved state is unchanged.
        let status = fmi2::deserialize_fmu_state::<Sampler>(fmu.component, first.as_ptr(), first.len() - 1, &mut same);
        assert_eq!((status, same), (Status::Error, state));
        assert_eq!(fmu.bytes(state), first);
        fmu.take();
        assert_eq!(fmi2::deserialize_fmu_state::<Sampler>(fmu.component, null::<u8>(), 8, &mut same), Status::Error);
        assert!(fmu.error().starts_with("fmi2DeSerializeFMUstate: serializedState must be an array of length "));
        assert_eq!(fmi2::deserialize_fmu_state::<Sampler>(fmu.component, first.as_ptr(), 8, null_mut()), Status::Error);
        assert!(fmu.error().starts_with("fmi2DeSerializeFMUstate: FMUstate must be an array of length "));
        assert_eq!(fmi2::set_fmu_state::<Sampler>(fmu.component, state), Status::Ok);
    }
    assert_eq!(fmu.get("filter_count"), 0.0);
}

#[test]
fn bytes_transfer_a_state_and_need_a_large_enough_array() {
    let (fmu, other) = (C::<CartPair>::ready(), C::<CartPair>::new(false));
    assert_eq!(fmu.step(0.0, 0.25), Status::Ok);
    let state = fmu.save();
    let bytes = fmu.bytes(state);
    let mut small = vec![0; bytes.len() - 1];
    let mut copy = null_mut();
    // SAFETY: the arrays have the sizes that are passed.
    unsafe {
        let status = fmi2::serialize_fmu_state::<CartPair>(fmu.component, state, small.as_mut_ptr(), small.len());
        assert_eq!(status, Status::Error);
        assert_eq!(
            fmu.error(),
            format!("fmi2SerializeFMUstate: size must be at least {}, got {}", bytes.len(), small.len())
        );
        let status = fmi2::deserialize_fmu_state::<CartPair>(other.component, bytes.as_ptr(), bytes.len(), &mut copy);
        assert_eq!(status, Status::Ok);
        assert_eq!(fmi2::set_fmu_state::<CartPair>(other.component, copy), Status::Ok);
    }
    assert_eq!(other.step(0.25, 0.25), Status::Ok);
    assert_eq!(fmu.step(0.25, 0.25), Status::Ok);
    assert_eq!(other.get("cart_position.l").to_bits(), fmu.get("cart_position.l").to_bits());
    assert_eq!(other.bytes(other.save()), fmu.bytes(fmu.save()));
}

#[test]
fn after_a_panic_only_reset_and_free_are_left() {
    for (place, message) in [
        (1, "fmi2ExitInitializationMode: internal error: 100%% on demand, in the derived parameters"),
        (2, "fmi2ExitInitializationMode: internal error: on demand, in the initial state"),
        (3, "fmi2DoStep: internal error: on demand, in a sample"),
    ] {
        let fmu = C::<Fragile>::new(false);
        let parameter = reference::<Fragile>("panic");
        // SAFETY: one reference, one value.
        let status = unsafe { fmi2::set_integer::<Fragile>(fmu.component, &parameter, 1, &place) };
        assert_eq!(status, Status::Ok);
        let status = fmu.initialize();
        let status = if place == 3 { fmu.step(0.0, 0.1) } else { status };
        assert_eq!(status, Status::Error);
        assert_eq!(fmu.error(), format!("{message}; the instance can only be reset or freed"));
        for (function, status) in all_calls::<Fragile>(fmu.component) {
            // The last call is the reset, which succeeds.
            let expected = if function == Function::Reset { Status::Ok } else { Status::Error };
            assert_eq!(status, expected, "{}", function.name(Version::Fmi2));
        }
        assert!(fmu.take().iter().all(|message| {
            message.format.contains("called in Broken, allowed in ")
                || message.format.ends_with(" is not a function of co-simulation")
        }));
        assert_eq!(fmu.initialize(), Status::Ok);
        assert_eq!(fmu.step(0.0, 0.1), Status::Ok);
        assert_eq!(fmu.get("sum_of_quotients"), 1.0);
    }
    // A broken instance can also be freed without a reset.
    let fmu = C::<Fragile>::new(false);
    // SAFETY: one reference, one value.
    unsafe { fmi2::set_integer::<Fragile>(fmu.component, &reference::<Fragile>("panic"), 1, &3) };
    fmu.initialize();
    assert_eq!(fmu.step(0.0, 0.1), Status::Error);
}

#[test]
fn a_state_saved_before_a_panic_outlives_the_reset() {
    let fmu = C::<Fragile>::ready();
    assert_eq!(fmu.step(0.0, 0.3), Status::Ok);
    let state = fmu.save();
    // SAFETY: a state of the component; one reference, one value.
    unsafe {
        assert_eq!(fmi2::reset::<Fragile>(fmu.component), Status::Ok);
        fmi2::set_integer::<Fragile>(fmu.component, &reference::<Fragile>("panic"), 1, &2);
        assert_eq!(fmu.initialize(), Status::Error);
        assert_eq!(fmi2::set_fmu_state::<Fragile>(fmu.component, state), Status::Error);
        assert_eq!(fmi2::reset::<Fragile>(fmu.component), Status::Ok);
        assert_eq!(fmi2::set_fmu_state::<Fragile>(fmu.component, state), Status::Ok);
    }
    assert_eq!(fmu.get("sum_of_quotients"), 3.0);
    assert_eq!(fmu.step(0.3, 0.1), Status::Ok);
}

#[test]
fn instances_in_several_threads_do_not_disturb_each_other() {
    let run = |seed: u32| {
        let fmu = C::<CartPair>::ready();
        let mut seen = Vec::new();
        for k in 0..200 {
            assert_eq!(fmu.set("cart_force.l", f64::from(k * seed % 17)), Status::Ok);
            assert_eq!(fmu.step(f64::from(k) * 0.05, 0.05), Status::Ok);
            seen.push(fmu.get("cart_position.l").to_bits());
        }
        seen
    };
    let alone: Vec<_> = (1..5).map(run).collect();
    let together: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (1..5).map(|seed| scope.spawn(move || run(seed))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(together, alone);
}
