//! The C interface of FMI 2.0 for co-simulation. All unsafe code of an FMU is in this file.
//!
//! Every function checks its pointers, turns them into references and slices, and calls the safe
//! [`Instance`]. An error is logged through the caller's logger and becomes a status; a
//! panic is caught, logged, and leaves an instance that can only be reset or freed.
//!
//! # Safety
//! As in C: a component must come from [`instantiate`] and not have been freed, arrays must have the length that is
//! passed with them, strings must end with a zero, and one instance must not be used by two threads at a time.
#![allow(unsafe_code)]
#![expect(clippy::missing_safety_doc, reason = "the module's documentation says it for all functions")]

use std::any::Any;
use std::ffi::{CStr, CString};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::calls::Function;
use crate::description::{Description, LOG_CATEGORIES, LOG_DISCARD, LOG_ERROR, LOG_EVENTS};
use crate::instance::{CallError, Instance, Snapshot};
use crate::runner::Model;
use c::{c_char, c_int, c_uint, c_void, size_t};

/// fmi2Status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    /// All well.
    Ok = 0,
    /// There is no such information.
    Discard = 2,
    /// Rejected, or failed; see the log.
    Error = 3,
}

/// fmi2Boolean.
pub type Boolean = c_int;
/// fmi2ValueReference.
pub type ValueReference = c_uint;
/// fmi2Component.
pub type Component = *mut c_void;
/// fmi2FMUstate.
pub type FmuState = *mut c_void;

/// fmi2CallbackLogger: environment, instance name, status, category, message as a printf format.
pub type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// fmi2CallbackFunctions; the memory functions are not used.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Callbacks {
    /// Where messages go.
    pub logger: Option<Logger>,
    /// Not used.
    pub allocate_memory: Option<unsafe extern "C" fn(size_t, size_t) -> *mut c_void>,
    /// Not used.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Not used: no step runs on after the call.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// Passed back to the logger.
    pub environment: *mut c_void,
}

/// A model with its description; [`model`](macro@crate::model) implements it.
pub trait Export: 'static {
    /// How it runs.
    type Model: Model;
    /// The GUID, if the packer has built it in. Such a library need not write its description to know it, and does not
    /// contain the code that could.
    const GUID: Option<&'static str> = None;
    /// Folder of the resources among the sources of the model, for its description; empty in a packed library.
    const RESOURCES: &'static str = "";
    /// What the library keeps while it is loaded.
    fn library() -> &'static Library;
    /// Computed on first use, then the same for all instances.
    ///
    /// # Panics
    /// As [`Description::of`].
    fn description() -> Arc<Description> {
        let mut kept = Self::library().lock();
        let description = kept.description.get_or_insert_with(|| {
            let description = Arc::new(match Self::GUID {
                Some(guid) => Description::packed::<Self::Model>(guid),
                None => Description::of::<Self::Model>(Path::new(Self::RESOURCES)),
            });
            // On Linux the library lists the function itself, see `export!`.
            // SAFETY: a function of this library, called when the library is unloaded, at the latest when the process
            // ends. If it cannot be registered, the description is lost at the end, nothing else.
            #[cfg(not(any(target_os = "linux", target_family = "wasm")))]
            unsafe {
                libc::atexit(forget::<Self>)
            };
            description
        });
        Arc::clone(description)
    }
}

/// What a loaded library keeps outside of its instances.
#[derive(Debug, Default)]
pub struct Library(Mutex<Kept>);

#[derive(Debug, Default)]
struct Kept {
    description: Option<Arc<Description>>,
    /// The description as the packer reads it.
    text: Option<CString>,
}

impl Library {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(Kept { description: None, text: None }))
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        // A panic while it was computed has left it empty.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Frees what the library keeps: a master that loads and unloads it again and again must not lose memory. Instances
/// that are still there have their own share.
pub extern "C" fn forget<E: Export + ?Sized>() {
    let _ = catch_unwind(|| std::mem::take(&mut *E::library().lock()));
}

struct Log {
    callbacks: Callbacks,
    name: CString,
    /// Which of [`LOG_CATEGORIES`] are wanted besides errors.
    wanted: [bool; LOG_CATEGORIES.len()],
}

impl Log {
    fn write(&self, status: c_int, category: &str, message: &str) {
        let is_wanted = LOG_CATEGORIES.iter().zip(self.wanted).any(|((name, _), on)| on && *name == category);
        let Some(logger) = self.callbacks.logger.filter(|_| category == LOG_ERROR || is_wanted) else { return };
        // The message is a printf format (no zero bytes, every percent sign doubled) in which a single # would begin a
        // value reference, as in #r1# (standard, section 2.1.5).
        let text = message.replace('\0', " ").replace('%', "%%").replace('#', "##");
        let text = CString::new(text).expect("zeros were replaced");
        let category = CString::new(category).expect("category names have no zeros");
        // SAFETY: the logger and its environment are the caller's; all strings end with a zero and outlive the call.
        unsafe {
            logger(self.callbacks.environment, self.name.as_ptr(), status, category.as_ptr(), text.as_ptr());
        }
    }
}

struct Handle<E: Export> {
    instance: Instance<E::Model>,
    log: Log,
    /// Snapshots that were handed out: only these pointers are accepted back.
    snapshots: Vec<*mut Snapshot<E::Model>>,
}

impl<E: Export> Drop for Handle<E> {
    fn drop(&mut self) {
        for snapshot in self.snapshots.drain(..) {
            // SAFETY: made by Box::into_raw and removed from the list when freed.
            drop(unsafe { Box::from_raw(snapshot) });
        }
    }
}

impl<E: Export> Handle<E> {
    fn snapshot(&self, function: Function, state: FmuState) -> Result<*mut Snapshot<E::Model>, CallError> {
        self.snapshots.iter().copied().find(|&known| known.cast() == state).ok_or_else(|| {
            error(function, "FMUstate is not a state of this instance (never saved, already freed, or of another one)")
        })
    }

    fn hand_out(&mut self, snapshot: Snapshot<E::Model>) -> FmuState {
        let pointer = Box::into_raw(Box::new(snapshot));
        self.snapshots.push(pointer);
        pointer.cast()
    }
}

type CallResult = Result<(), CallError>;

fn error(function: Function, message: &str) -> CallError {
    CallError::Error(format!("{}: {message}", function.name()))
}

fn words(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// Runs `f` on the component if its mode allows `function`; logs an error; catches a panic.
#[inline]
unsafe fn call<E: Export>(
    component: Component,
    function: Function,
    f: impl FnOnce(&mut Handle<E>) -> CallResult,
) -> Status {
    let handle = component.cast::<Handle<E>>();
    if handle.is_null() || !handle.is_aligned() {
        return Status::Error; // there is no logger to tell
    }
    // SAFETY: the caller passes a component of `instantiate` that was not freed.
    let handle = unsafe { &mut *handle };
    let result = catch_unwind(AssertUnwindSafe(|| {
        handle.instance.check(function)?;
        f(handle)
    }));
    match result {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(CallError::Error(message))) => {
            handle.log.write(Status::Error as c_int, LOG_ERROR, &message);
            Status::Error
        }
        Ok(Err(CallError::Discard(message))) => {
            handle.log.write(Status::Discard as c_int, LOG_DISCARD, &message);
            Status::Discard
        }
        Err(panic) => {
            handle.instance.mark_broken();
            let message = format!(
                "{}: internal error: {}; the instance can only be reset or freed",
                function.name(),
                words(&*panic)
            );
            handle.log.write(Status::Error as c_int, LOG_ERROR, &message);
            Status::Error
        }
    }
}

#[inline]
fn check_array<T>(function: Function, name: &str, pointer: *const T, length: usize) -> CallResult {
    if pointer.is_null() || !pointer.is_aligned() || length > isize::MAX as usize / size_of::<T>() {
        return Err(no_array(function, name, pointer.is_null(), length));
    }
    Ok(())
}

#[cold]
fn no_array(function: Function, name: &str, is_null: bool, length: usize) -> CallError {
    error(
        function,
        &if is_null {
            format!("{name} must be an array of length {length}, got a null pointer")
        } else {
            format!("{name} of length {length} is not a possible array")
        },
    )
}

/// The caller's array.
#[inline]
unsafe fn array<'a, T>(function: Function, name: &str, pointer: *const T, length: usize) -> Result<&'a [T], CallError> {
    if length == 0 {
        return Ok(&[]);
    }
    check_array(function, name, pointer, length)?;
    // SAFETY: checked for null and alignment; the caller vouches for the length.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// The caller's array to write to.
#[inline]
unsafe fn array_mut<'a, T>(
    function: Function,
    name: &str,
    pointer: *mut T,
    length: usize,
) -> Result<&'a mut [T], CallError> {
    if length == 0 {
        return Ok(&mut []);
    }
    check_array(function, name, pointer, length)?;
    // SAFETY: as in `array`; the caller's arrays do not overlap.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}

/// The caller's variable to write to.
unsafe fn target<'a, T>(function: Function, name: &str, pointer: *mut T) -> Result<&'a mut T, CallError> {
    // SAFETY: an array of one value.
    unsafe { array_mut(function, name, pointer, 1) }.map(|array| &mut array[0])
}

/// The caller's string.
unsafe fn text<'a>(pointer: *const c_char) -> Result<&'a str, &'static str> {
    if pointer.is_null() {
        return Err("a null pointer");
    }
    // SAFETY: the caller's strings end with a zero.
    unsafe { CStr::from_ptr(pointer) }.to_str().map_err(|_| "not UTF-8")
}

/// Pointer to the model description, for the packer, or to an exclamation mark and what is wrong with the declarations. The
/// text lives as long as the library is loaded.
pub fn model_description<E: Export>() -> *const c_char {
    let text = || {
        let mut kept = E::library().lock();
        let text = kept.text.get_or_insert_with(|| {
            let text = match Description::try_of::<E::Model>(Path::new(E::RESOURCES)) {
                Ok(description) => description.xml,
                Err(problem) => format!("!{problem}"),
            };
            CString::new(text.replace('\0', " ")).unwrap_or_default()
        });
        text.as_ptr()
    };
    catch_unwind(text).unwrap_or(std::ptr::null())
}

/// fmi2GetTypesPlatform.
pub fn types_platform() -> *const c_char {
    c"default".as_ptr()
}

/// fmi2GetVersion.
pub fn version() -> *const c_char {
    c"2.0".as_ptr()
}

/// Path of a `file:` URI with its percent signs decoded; anything else is taken as a path.
fn resources_path(uri: &str) -> PathBuf {
    let path = uri.strip_prefix("file:").map_or(uri, |rest| {
        let rest = rest.strip_prefix("//").unwrap_or(rest);
        let rest = rest.strip_prefix("localhost").unwrap_or(rest);
        // On Windows, file:///C:/folder is the path C:/folder.
        if cfg!(windows) { rest.trim_start_matches('/') } else { rest }
    });
    let bytes = path.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let code = (bytes[i] == b'%').then(|| path.get(i + 1..i + 3)).flatten();
        // A sign is no hexadecimal digit, though the parser would take it.
        let code = code.filter(|code| code.bytes().all(|byte| byte.is_ascii_hexdigit()));
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                decoded.push(byte);
                i += 3;
            }
            None => {
                decoded.push(bytes[i]);
                i += 1;
            }
        }
    }
    PathBuf::from(String::from_utf8_lossy(&decoded).into_owned())
}

const CO_SIMULATION: c_int = 1;

/// fmi2Instantiate. A null pointer means that the reason was logged, if there was a logger.
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
    let mut log = Log { callbacks, name: CString::default(), wanted: [logging_on != 0; LOG_CATEGORIES.len()] };
    let mut known_name = CString::default();
    let result = catch_unwind(AssertUnwindSafe(|| -> Result<Instance<E::Model>, String> {
        // SAFETY: strings of the caller.
        let name = unsafe { text(name) }.map_err(|e| format!("instanceName is {e}"))?;
        known_name = CString::new(name).expect("a C string has no inner zeros");
        if name.is_empty() {
            return Err("instanceName is empty".to_owned());
        }
        if fmu_type != CO_SIMULATION {
            return Err(format!("fmuType must be {CO_SIMULATION} (co-simulation), got {fmu_type}"));
        }
        // SAFETY: as above.
        let guid = unsafe { text(guid) }.map_err(|e| format!("fmuGUID is {e}"))?;
        let description = E::description();
        if guid != description.guid {
            return Err(format!(
                "fmuGUID must be {}, got {guid}; the library and modelDescription.xml do not belong together",
                description.guid
            ));
        }
        let resources = if resources.is_null() {
            PathBuf::new()
        } else {
            // SAFETY: as above.
            resources_path(unsafe { text(resources) }.map_err(|e| format!("fmuResourceLocation is {e}"))?)
        };
        Ok(Instance::new(description, resources))
    }));
    log.name = known_name;
    let message = match result {
        Ok(Ok(instance)) => {
            return Box::into_raw(Box::new(Handle::<E> { instance, log, snapshots: Vec::new() })).cast();
        }
        Ok(Err(message)) => message,
        Err(panic) => format!("internal error: {}", words(&*panic)),
    };
    log.write(Status::Error as c_int, LOG_ERROR, &format!("fmi2Instantiate: {message}"));
    std::ptr::null_mut()
}

/// fmi2FreeInstance; a null pointer is ignored.
pub unsafe fn free_instance<E: Export>(component: Component) {
    let handle = component.cast::<Handle<E>>();
    if !handle.is_null() && handle.is_aligned() {
        // SAFETY: made by Box::into_raw in `instantiate`, freed once.
        let handle = unsafe { Box::from_raw(handle) };
        // Nothing is left to report to if dropping panicked.
        let _ = catch_unwind(AssertUnwindSafe(move || drop(handle)));
    }
}

/// fmi2SetDebugLogging.
pub unsafe fn set_debug_logging<E: Export>(
    component: Component,
    logging_on: Boolean,
    count: size_t,
    categories: *const *const c_char,
) -> Status {
    let function = Function::SetDebugLogging;
    let run = |handle: &mut Handle<E>| {
        // SAFETY: the caller's array.
        let names = unsafe { array(function, "categories", categories, count) }?;
        let mut wanted = [logging_on != 0 && names.is_empty(); LOG_CATEGORIES.len()];
        for &name in names {
            // SAFETY: the caller's strings.
            let name = unsafe { text(name) }.map_err(|e| error(function, &format!("a category is {e}")))?;
            let known = LOG_CATEGORIES.iter().position(|(known, _)| *known == name).ok_or_else(|| {
                let all: Vec<_> = LOG_CATEGORIES.iter().map(|(known, _)| *known).collect();
                error(function, &format!("category '{name}' is unknown, expected one of {}", all.join(", ")))
            })?;
            wanted[known] = logging_on != 0;
        }
        handle.log.wanted = wanted;
        Ok(())
    };
    // SAFETY: see the module's documentation; the same holds for every call below.
    unsafe { call::<E>(component, function, run) }
}

/// fmi2SetupExperiment. The tolerance is not used: the integrator has a fixed step.
pub unsafe fn setup_experiment<E: Export>(
    component: Component,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start: f64,
    stop_defined: Boolean,
    stop: f64,
) -> Status {
    let stop = (stop_defined != 0).then_some(stop);
    unsafe { call::<E>(component, Function::SetupExperiment, |h| h.instance.setup_experiment(start, stop)) }
}

/// fmi2EnterInitializationMode.
pub unsafe fn enter_initialization_mode<E: Export>(component: Component) -> Status {
    unsafe { call::<E>(component, Function::EnterInitializationMode, |h| h.instance.enter_initialization()) }
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

/// fmi2GetReal.
pub unsafe fn get_real<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *mut f64,
) -> Status {
    let function = Function::GetReal;
    unsafe {
        call::<E>(component, function, |h| {
            let references = array(function, "vr", references, count)?;
            h.instance.get_real(references, array_mut(function, "value", values, count)?)
        })
    }
}

/// fmi2GetInteger.
pub unsafe fn get_integer<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *mut c_int,
) -> Status {
    unsafe {
        get(component, Function::GetInteger, references, count, values, |h: &mut Handle<E>, r| {
            h.instance.get_integer(r)
        })
    }
}

/// fmi2GetBoolean.
pub unsafe fn get_boolean<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *mut Boolean,
) -> Status {
    unsafe {
        get(component, Function::GetBoolean, references, count, values, |h: &mut Handle<E>, r| {
            h.instance.get_boolean(r).map(Boolean::from)
        })
    }
}

/// fmi2GetString. The strings live until a string is set, a state is restored, or the instance is reset or freed.
pub unsafe fn get_string<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *mut *const c_char,
) -> Status {
    unsafe {
        get(component, Function::GetString, references, count, values, |h: &mut Handle<E>, r| {
            h.instance.get_string(r).map(CStr::as_ptr)
        })
    }
}

/// Values of a type that is not real; all references are checked before the first value is written.
unsafe fn get<E: Export, V>(
    component: Component,
    function: Function,
    references: *const ValueReference,
    count: size_t,
    values: *mut V,
    one: impl Fn(&mut Handle<E>, ValueReference) -> Result<V, CallError>,
) -> Status {
    unsafe {
        call::<E>(component, function, |h| {
            let references = array(function, "vr", references, count)?;
            let values = array_mut(function, "value", values, count)?;
            references.iter().try_for_each(|&reference| one(h, reference).map(drop))?;
            for (value, &reference) in values.iter_mut().zip(references) {
                *value = one(h, reference)?;
            }
            Ok(())
        })
    }
}

/// fmi2SetReal.
pub unsafe fn set_real<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *const f64,
) -> Status {
    let function = Function::SetReal;
    unsafe {
        call::<E>(component, function, |h| {
            let references = array(function, "vr", references, count)?;
            h.instance.set_real(references, array(function, "value", values, count)?)
        })
    }
}

/// fmi2SetInteger.
pub unsafe fn set_integer<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *const c_int,
) -> Status {
    let function = Function::SetInteger;
    unsafe {
        call::<E>(component, function, |h| {
            let references = array(function, "vr", references, count)?;
            h.instance.set_integer(references, array(function, "value", values, count)?)
        })
    }
}

/// fmi2SetBoolean; any number but 0 is true.
pub unsafe fn set_boolean<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *const Boolean,
) -> Status {
    let function = Function::SetBoolean;
    unsafe {
        call::<E>(component, function, |h| {
            let references = array(function, "vr", references, count)?;
            let values: Vec<_> = array(function, "value", values, count)?.iter().map(|&value| value != 0).collect();
            h.instance.set_boolean(references, &values)
        })
    }
}

/// fmi2SetString.
pub unsafe fn set_string<E: Export>(
    component: Component,
    references: *const ValueReference,
    count: size_t,
    values: *const *const c_char,
) -> Status {
    let function = Function::SetString;
    unsafe {
        call::<E>(component, function, |h| {
            let references = array(function, "vr", references, count)?;
            let texts: Result<Vec<_>, _> = array(function, "value", values, count)?
                .iter()
                .map(|&value| text(value).map(str::to_owned).map_err(|e| error(function, &format!("a value is {e}"))))
                .collect();
            h.instance.set_string(references, &texts?)
        })
    }
}

/// fmi2GetFMUstate: into a new state, or into one that was saved before.
pub unsafe fn get_fmu_state<E: Export>(component: Component, state: *mut FmuState) -> Status {
    let function = Function::GetFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let state = target(function, "FMUstate", state)?;
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
            let state = target(function, "FMUstate", state)?;
            if state.is_null() {
                return Ok(());
            }
            let snapshot = h.snapshot(function, *state)?;
            h.snapshots.retain(|&known| known != snapshot);
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
            *target(function, "size", size)? = h.instance.serialize(&*snapshot)?.len();
            Ok(())
        })
    }
}

/// fmi2SerializeFMUstate.
pub unsafe fn serialize_fmu_state<E: Export>(
    component: Component,
    state: FmuState,
    bytes: *mut c_char,
    size: size_t,
) -> Status {
    let function = Function::SerializeFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let snapshot = h.snapshot(function, state)?;
            let written = h.instance.serialize(&*snapshot)?;
            if size < written.len() {
                return Err(error(function, &format!("size must be at least {}, got {size}", written.len())));
            }
            array_mut(function, "serializedState", bytes.cast::<u8>(), written.len())?.copy_from_slice(&written);
            Ok(())
        })
    }
}

/// fmi2DeSerializeFMUstate.
pub unsafe fn deserialize_fmu_state<E: Export>(
    component: Component,
    bytes: *const c_char,
    size: size_t,
    state: *mut FmuState,
) -> Status {
    let function = Function::DeSerializeFMUstate;
    unsafe {
        call::<E>(component, function, |h| {
            let state = target(function, "FMUstate", state)?;
            let snapshot = h.instance.deserialize(array(function, "serializedState", bytes.cast::<u8>(), size)?)?;
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

/// fmi2GetDirectionalDerivative.
pub unsafe fn get_directional_derivative<E: Export>(
    component: Component,
    unknown: *const ValueReference,
    unknown_count: size_t,
    known: *const ValueReference,
    known_count: size_t,
    seed: *const f64,
    result: *mut f64,
) -> Status {
    let function = Function::GetDirectionalDerivative;
    unsafe {
        call::<E>(component, function, |h| {
            h.instance.directional_derivative(
                array(function, "vUnknown_ref", unknown, unknown_count)?,
                array(function, "vKnown_ref", known, known_count)?,
                array(function, "dvKnown", seed, known_count)?,
                array_mut(function, "dvUnknown", result, unknown_count)?,
            )
        })
    }
}

/// Inputs are held over a step and outputs have no known slope, as the capability flags say.
unsafe fn no_interpolation<E: Export>(component: Component, function: Function) -> Status {
    unsafe { call::<E>(component, function, |_| Err(error(function, "not supported (see the capability flags)"))) }
}

/// fmi2SetRealInputDerivatives: not supported.
pub unsafe fn set_real_input_derivatives<E: Export>(
    component: Component,
    _references: *const ValueReference,
    _count: size_t,
    _orders: *const c_int,
    _values: *const f64,
) -> Status {
    unsafe { no_interpolation::<E>(component, Function::SetRealInputDerivatives) }
}

/// fmi2GetRealOutputDerivatives: not supported.
pub unsafe fn get_real_output_derivatives<E: Export>(
    component: Component,
    _references: *const ValueReference,
    _count: size_t,
    _orders: *const c_int,
    _values: *mut f64,
) -> Status {
    unsafe { no_interpolation::<E>(component, Function::GetRealOutputDerivatives) }
}

/// fmi2DoStep.
pub unsafe fn do_step<E: Export>(component: Component, time: f64, step: f64, _no_set_before: Boolean) -> Status {
    unsafe { call::<E>(component, Function::DoStep, |h| h.instance.do_step(time, step)) }
}

/// fmi2CancelStep: a step is over when fmi2DoStep returns.
pub unsafe fn cancel_step<E: Export>(component: Component) -> Status {
    let function = Function::CancelStep;
    unsafe { call::<E>(component, function, |_| Err(error(function, "no step is pending"))) }
}

const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

unsafe fn no_answer<E: Export>(component: Component, function: Function, kind: c_int) -> Status {
    unsafe {
        call::<E>(component, function, |_| {
            Err(CallError::Discard(format!("{}: no answer to status kind {kind}", function.name())))
        })
    }
}

/// fmi2GetStatus: no step is ever pending.
pub unsafe fn get_status<E: Export>(component: Component, kind: c_int, _value: *mut c_int) -> Status {
    unsafe { no_answer::<E>(component, Function::GetStatus, kind) }
}

/// fmi2GetRealStatus: answers fmi2LastSuccessfulTime.
pub unsafe fn get_real_status<E: Export>(component: Component, kind: c_int, value: *mut f64) -> Status {
    let function = Function::GetRealStatus;
    if kind != LAST_SUCCESSFUL_TIME {
        return unsafe { no_answer::<E>(component, function, kind) };
    }
    unsafe {
        call::<E>(component, function, |h| {
            *target(function, "value", value)? = h.instance.time();
            Ok(())
        })
    }
}

/// fmi2GetIntegerStatus: the standard has no question of this type.
pub unsafe fn get_integer_status<E: Export>(component: Component, kind: c_int, _value: *mut c_int) -> Status {
    unsafe { no_answer::<E>(component, Function::GetIntegerStatus, kind) }
}

/// fmi2GetBooleanStatus: answers fmi2Terminated; the FMU never asks to end the simulation.
pub unsafe fn get_boolean_status<E: Export>(component: Component, kind: c_int, value: *mut Boolean) -> Status {
    let function = Function::GetBooleanStatus;
    if kind != TERMINATED {
        return unsafe { no_answer::<E>(component, function, kind) };
    }
    unsafe {
        call::<E>(component, function, |_| {
            *target(function, "value", value)? = 0;
            Ok(())
        })
    }
}

/// fmi2GetStringStatus: no step is ever pending.
pub unsafe fn get_string_status<E: Export>(component: Component, kind: c_int, _value: *mut *const c_char) -> Status {
    unsafe { no_answer::<E>(component, Function::GetStringStatus, kind) }
}

/// The C interface of a model; [`model`](macro@crate::model) adds it where `cargo fmu pack` asks for it.
#[doc(hidden)]
#[macro_export]
macro_rules! c_interface {
    (@functions $model:ty: $($name:ident $target:ident ($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(component: Component $(, $argument: $type)*) -> Status {
            unsafe { $target::<$model>(component $(, $argument)*) }
        }
    )*};
    ($model:ty) => {
        #[doc(hidden)]
        #[allow(unsafe_code, non_snake_case, clippy::missing_safety_doc, clippy::too_many_arguments)]
        pub mod c_interface {
            #[allow(unused_imports)]
            use super::*;
            use $crate::abi::*;
            use $crate::abi::c::*;

            // Called when the library is unloaded, or when the process ends. `atexit` would not do: the start-up code of
            // zig does not connect it with the library, so the function is called when the library is gone.
            #[cfg(target_os = "linux")]
            #[used]
            #[unsafe(link_section = ".fini_array")]
            static FORGET: extern "C" fn() = forget::<$model>;

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
            $crate::c_interface! { @functions $model:
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
        }
    };
}

/// The types of C.
#[doc(hidden)]
pub mod c {
    #[cfg(target_family = "wasm")]
    pub use core::ffi::{c_char, c_int, c_uint, c_void};
    #[cfg(not(target_family = "wasm"))]
    pub use libc::{c_char, c_int, c_uint, c_void, size_t};

    /// WebAssembly has no C library.
    #[cfg(target_family = "wasm")]
    #[expect(non_camel_case_types, reason = "as in C")]
    pub type size_t = usize;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resource_uri_becomes_a_path() {
        // RFC 8089: no authority, an empty one and localhost mean the same; %XX is a byte.
        for uri in ["file:///a/b%20c", "file:/a/b%20c", "file://localhost/a/b%20c", "/a/b%20c"] {
            assert_eq!(resources_path(uri), PathBuf::from("/a/b c"), "{uri}");
        }
        for path in ["/50%", "/5%+1", "/5%\u{20ac}"] {
            assert_eq!(resources_path(&format!("file://{path}")), PathBuf::from(path));
        }
    }
}
