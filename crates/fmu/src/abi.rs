//! The C interface. All unsafe code of an FMU is in this module; the functions are in [`fmi2`] and [`fmi3`].
//!
//! Every function checks its pointers, turns them into references and slices, and calls the safe
//! [`Instance`]. An error is logged through the caller's logger and becomes a status; a
//! panic is caught, logged, and leaves an instance that can only be reset or freed.
//!
//! # Safety
//! The caller must follow the rules of the C interface: a component must come from an instantiating function and not
//! have been freed, arrays must have the length that is passed with them, strings must end with a zero, and one
//! instance must not be used by two threads at a time, except in [scheduled execution](scheduled).
#![allow(unsafe_code)]
#![expect(clippy::missing_safety_doc, reason = "documented once, for the whole module")]

use std::any::Any;
use std::collections::HashSet;
use std::ffi::{CStr, CString};
use std::fmt::Display;
use std::hash::{BuildHasherDefault, DefaultHasher};
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::calls::{Function, Interfaces, Version};
use crate::description::{Description, Format, LOG_CATEGORIES, LOG_DISCARD, LOG_ERROR};
use crate::instance::{CallError, Instance, Snapshot};
use crate::runner::Model;
use c::{c_char, c_int, c_void};

mod common;
mod float_environment;
pub mod fmi2;
pub mod fmi3;
mod scheduled;
mod updates;
mod values;

/// The values of fmi2Status and fmi3Status that the FMUs return.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    /// Success.
    Ok = 0,
    /// The requested information does not exist.
    Discard = 2,
    /// Rejected, or failed; see the log.
    Error = 3,
}

/// fmi2Component, fmi3Instance.
pub type Component = *mut c_void;
/// fmi2FMUstate, fmi3FMUState.
pub type FmuState = *mut c_void;

/// A model and its description. [`model`](macro@crate::model) implements this trait.
pub trait Export: 'static {
    /// Runner of the model.
    type Model: Model;
    /// The GUID, if the packer built it in. The library then does not contain the code that generates the description.
    const GUID: Option<&'static str> = None;
    /// The number of event indicators in model exchange, if the packer built in the GUID.
    const EVENT_INDICATORS: usize = 0;
    /// The dependencies of the equations in FMI 3.0, if the packer built in the GUID.
    const DEPENDENCIES: &'static str = "";
    /// Format of the packed FMU.
    const FORMAT: Format = Format::FMI2;
    /// Returns the library's data.
    fn library() -> &'static Library;
    /// Returns the description, computed on first use and shared by all instances. Panics like [`Description::of`].
    fn description() -> Arc<Description> {
        let mut kept = Self::library().lock();
        let description = kept.description.get_or_insert_with(|| {
            let description = Arc::new(match Self::GUID {
                Some(guid) => {
                    let (indicators, dependencies) = (Self::EVENT_INDICATORS, Self::DEPENDENCIES);
                    Description::packed::<Self::Model>(Self::FORMAT, guid, indicators, dependencies)
                }
                None => Description::of::<Self::Model>(Self::FORMAT, Path::new(Self::Model::INFO.resources)),
            });
            // On Linux, `unloading!` registers the function.

            // SAFETY: the function belongs to this library and is called when the library is unloaded or the process
            // ends. If the registration fails, the description is leaked.
            #[cfg(not(any(target_os = "linux", target_family = "wasm")))]
            unsafe {
                libc::atexit(forget::<Self>)
            };
            description
        });
        Arc::clone(description)
    }
}

/// Data that a loaded library keeps outside of its instances.
#[derive(Debug, Default)]
pub struct Library(Mutex<Kept>);

#[derive(Debug, Default)]
struct Kept {
    description: Option<Arc<Description>>,
    /// The text that the packer read last. See [`model_description`].
    text: Option<CString>,
}

impl Library {
    /// An empty library.
    pub const fn new() -> Self {
        Self(Mutex::new(Kept { description: None, text: None }))
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        // If a thread panicked while it computed the description, the description is still missing.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Frees the library's data, so that a master that repeatedly loads and unloads the library does not leak memory.
/// Instances that still exist hold their own references to the description.
pub extern "C" fn forget<E: Export + ?Sized>() {
    let _ = catch_unwind(|| std::mem::take(&mut *E::library().lock()));
}

/// The importer's logger, with the environment pointer that it expects back.
enum Logger {
    Fmi2(fmi2::Logger, *mut c_void),
    Fmi3(fmi3::Logger, *mut c_void),
}

struct Log {
    logger: Option<Logger>,
    name: CString,
    /// For each of the [`LOG_CATEGORIES`], true if its messages are logged. Errors are always logged.
    wanted: [bool; LOG_CATEGORIES.len()],
}

impl Log {
    fn write(&self, status: Status, category: &str, message: &str) {
        let is_wanted = LOG_CATEGORIES.iter().zip(self.wanted).any(|((name, _), on)| on && *name == category);
        let Some(logger) = self.logger.as_ref().filter(|_| category == LOG_ERROR || is_wanted) else { return };
        let text = message.replace('\0', " ");
        let category = CString::new(category).expect("category names have no zeros");
        let to_c = |text: String| CString::new(text).expect("zeros were replaced");
        match *logger {
            Logger::Fmi2(logger, environment) => {
                // The message is a printf format, so percent signs are doubled. The same applies to #, because a single
                // # would begin a value reference, as in #r1# (FMI 2.0, section 2.1.5).
                let text = to_c(text.replace('%', "%%").replace('#', "##"));
                // SAFETY: the logger and its environment are the caller's; all strings end with a zero and outlive the call.
                unsafe {
                    logger(environment, self.name.as_ptr(), status as c_int, category.as_ptr(), text.as_ptr());
                }
            }
            Logger::Fmi3(logger, environment) => {
                let text = to_c(text);
                // SAFETY: as above.
                unsafe { logger(environment, status as c_int, category.as_ptr(), text.as_ptr()) };
            }
        }
    }
}

struct Handle<E: Export> {
    instance: Instance<E::Model>,
    log: Log,
    /// Snapshots that the importer holds. All other pointers to states are rejected.
    snapshots: HashSet<*mut Snapshot<E::Model>, BuildHasherDefault<DefaultHasher>>,
    /// True if a co-simulation step may end at an event before its end (FMI 3.0).
    returns_early: bool,
    /// Data for intermediate updates, if the importer passed a callback (FMI 3.0).
    updates: Option<Box<updates::Updates>>,
    /// Value references of the array elements in the present call (FMI 3.0 with native arrays).
    elements: Vec<fmi3::ValueReference>,
}

impl<E: Export> Drop for Handle<E> {
    fn drop(&mut self) {
        for snapshot in self.snapshots.drain() {
            // SAFETY: made by Box::into_raw and removed from the set when freed.
            drop(unsafe { Box::from_raw(snapshot) });
        }
    }
}

impl<E: Export> Handle<E> {
    fn hand_out(&mut self, snapshot: Snapshot<E::Model>) -> FmuState {
        let pointer = Box::into_raw(Box::new(snapshot));
        self.snapshots.insert(pointer);
        pointer.cast()
    }
}

type CallResult = Result<(), CallError>;

fn words(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// A call to a function: reads the arguments, and adds the function's name to errors.
struct Call<E>(Function, PhantomData<E>);

impl<E: Export> Call<E> {
    #[cold]
    #[inline(never)]
    fn error(&self, message: impl Display) -> CallError {
        CallError::Error(format!("{}: {message}", self.0.name(E::FORMAT.version)))
    }

    fn snapshot(&self, h: &Handle<E>, state: FmuState) -> Result<*mut Snapshot<E::Model>, CallError> {
        let known = state.cast();
        h.snapshots.contains(&known).then_some(known).ok_or_else(|| {
            self.error(
                "FMUstate is not a state of this instance (never saved, already freed, or from another instance)",
            )
        })
    }

    #[inline]
    fn check_array<T>(&self, name: &str, pointer: *const T, length: usize) -> CallResult {
        self.check_memory(name, pointer.is_null(), pointer.is_aligned(), [length, size_of::<T>()])
    }

    /// Rejects an array that is null, misaligned, or too long for the size of its values, in bytes.
    #[inline]
    fn check_memory(&self, name: &str, is_null: bool, is_aligned: bool, [length, size]: [usize; 2]) -> CallResult {
        if is_null || !is_aligned || length > isize::MAX as usize / size {
            return Err(self.no_array(name, is_null, length));
        }
        Ok(())
    }

    #[cold]
    fn no_array(&self, name: &str, is_null: bool, length: usize) -> CallError {
        self.error(if is_null {
            format!("{name} must be an array of length {length}, got a null pointer")
        } else {
            format!("{name} is not a valid array: its pointer is misaligned, or its length, {length}, is too large")
        })
    }

    #[inline]
    unsafe fn array<'a, T>(&self, name: &str, pointer: *const T, length: usize) -> Result<&'a [T], CallError> {
        if length == 0 {
            return Ok(&[]);
        }
        self.check_array(name, pointer, length)?;
        // SAFETY: checked for null and alignment; the caller vouches for the length.
        Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
    }

    #[inline]
    unsafe fn array_mut<'a, T>(&self, name: &str, pointer: *mut T, length: usize) -> Result<&'a mut [T], CallError> {
        if length == 0 {
            return Ok(&mut []);
        }
        self.check_array(name, pointer, length)?;
        // SAFETY: as in `array`; the caller's arrays do not overlap.
        Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
    }

    unsafe fn target<'a, T>(&self, name: &str, pointer: *mut T) -> Result<&'a mut T, CallError> {
        // SAFETY: an array of one value.
        unsafe { self.array_mut(name, pointer, 1) }.map(|array| &mut array[0])
    }
}

/// Runs `f` on the component if its mode allows `function`. Logs errors and catches panics. Computations run in the
/// default floating-point environment, independent of the caller's.
#[inline]
unsafe fn call<E: Export>(
    component: Component,
    function: Function,
    f: impl FnOnce(&mut Handle<E>, &Call<E>) -> CallResult,
) -> Status {
    let handle = component.cast::<Handle<E>>();
    if handle.is_null() || !handle.is_aligned() {
        return Status::Error; // no logger to report to
    }
    // SAFETY: the caller passes a component of `instantiate` that was not freed. In scheduled execution, no other thread
    // uses the handle until `_access` is dropped.
    unsafe {
        if scheduled::is_provided::<E>() {
            let _access = scheduled::access::<E>(component);
            return run(&mut *handle, function, f);
        }
        run(&mut *handle, function, f)
    }
}

/// [`call`] with the exclusive use of the handle.
#[inline(always)]
fn run<E: Export>(
    handle: &mut Handle<E>,
    function: Function,
    f: impl FnOnce(&mut Handle<E>, &Call<E>) -> CallResult,
) -> Status {
    let call = Call(function, PhantomData);
    let callers = if handle.instance.may_compute(function) { float_environment::enter() } else { None };
    let result = catch_unwind(AssertUnwindSafe(|| {
        handle.instance.check(function)?;
        f(handle, &call)
    }));
    float_environment::leave(callers);
    match result {
        Ok(Ok(())) => Status::Ok,
        result => failed(handle, function, result),
    }
}

/// Logs why a call failed, and returns its status. Not inlined, because a library would contain a copy for each function.
#[cold]
#[inline(never)]
fn failed<E: Export>(handle: &mut Handle<E>, function: Function, result: std::thread::Result<CallResult>) -> Status {
    let (status, category, message) = match result {
        Ok(Ok(())) => return Status::Ok,
        Ok(Err(CallError::Error(message))) => (Status::Error, LOG_ERROR, message),
        Ok(Err(CallError::Discard(message))) => (Status::Discard, LOG_DISCARD, message),
        Err(panic) => {
            handle.instance.mark_broken();
            let name = function.name(E::FORMAT.version);
            let message =
                format!("{name}: internal error: {}; the instance can only be reset or freed", words(&*panic));
            (Status::Error, LOG_ERROR, message)
        }
    };
    handle.log.write(status, category, &message);
    status
}

/// Defines functions of the C interface for a model `E`. A body gets the [`Handle`] of the component and the [`Call`].
///
/// Safety: the bodies are unsafe. They use pointers that the caller must pass according to the standard: a component of
/// this library, arrays of the given lengths, strings that end with a zero, states of this component.
macro_rules! functions {
    ($($(#[$attribute:meta])* fn $name:ident[$function:ident]($h:pat, $call:pat
        $(, $argument:ident: $type:ty)* $(,)?) $body:block)*) => {$(
        #[doc = concat!("`", stringify!($function), "` in the table of calls.\n")]
        $(#[$attribute])*
        pub unsafe fn $name<E: Export>(component: Component $(, $argument: $type)*) -> Status {
            unsafe { call::<E>(component, Function::$function, |$h, $call| $body) }
        }
    )*};
}
use functions;

unsafe fn text<'a>(pointer: *const c_char) -> Result<&'a str, &'static str> {
    if pointer.is_null() {
        return Err("a null pointer");
    }
    // SAFETY: the caller's strings end with a zero.
    unsafe { CStr::from_ptr(pointer) }.to_str().map_err(|_| "not UTF-8")
}

/// Returns the model description for the packer or, if the declarations contain an error, an exclamation mark followed
/// by the error. The text lives until the next call or until the library is unloaded. `version` is 2 or 3; `options` is
/// a sum of 1 (co-simulation), 2 (model exchange), 4 (native arrays), 8 (return terminalsAndIcons.xml instead), 16
/// (return the notes instead), 32 (return the dependencies for the library instead), 64 (scheduled execution) and 128
/// (scheduled execution if all clocks have priorities), as in `fmu_import::loader::description_options`.
pub fn model_description<E: Export>(version: c_int, options: c_int) -> *const c_char {
    let text = || {
        let has = |bit: c_int| options & bit != 0;
        let format = Format {
            version: if version == 3 { Version::Fmi3 } else { Version::Fmi2 },
            interfaces: Interfaces {
                co_simulation: has(1),
                model_exchange: has(2),
                scheduled_execution: has(64) || (has(128) && E::Model::SCHEDULED_EXECUTION),
            },
            arrays: has(4),
        };
        let text = match Description::try_of::<E::Model>(format, Path::new(E::Model::INFO.resources)) {
            Ok(description) if has(8) => description.terminals(format),
            // The line break keeps the text from being empty, which would mean a failure.
            Ok(description) if has(16) => format!("\n{}", description.notes.join("\n")),
            Ok(description) if has(32) => description.dependencies.into_owned(),
            Ok(description) => description.xml,
            Err(problem) => format!("!{problem}"),
        };
        let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        E::library().lock().text.insert(text).as_ptr()
    };
    catch_unwind(text).unwrap_or(std::ptr::null())
}

/// Defines functions of the C interface. Each function calls `target` for the model; some also pass their entry in the
/// table of calls.
#[doc(hidden)]
#[macro_export]
macro_rules! c_functions {
    ($model:ty: $($name:ident $target:ident $($function:ident)? ($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(component: Component $(, $argument: $type)*) -> Status {
            unsafe {
                $target::<$model>(component $(, $crate::__private::calls::Function::$function)? $(, $argument)*)
            }
        }
    )*};
}

/// Frees the library's data when the library is unloaded; part of every library, regardless of its interfaces.
#[doc(hidden)]
#[macro_export]
macro_rules! unloading {
    ($model:ty) => {
        // Called when the library is unloaded or the process ends. `atexit` does not work: the start-up code of zig
        // does not associate the function with the library and would call it after the library is unloaded.
        #[cfg(target_os = "linux")]
        #[used]
        #[unsafe(link_section = ".fini_array")]
        static FORGET: extern "C" fn() = $crate::__private::abi::forget::<$model>;
    };
}

/// The C types in the signatures of the interface.
#[doc(hidden)]
pub mod c {
    #[cfg(target_family = "wasm")]
    pub use core::ffi::{c_char, c_int, c_uint, c_void};
    #[cfg(not(target_family = "wasm"))]
    pub use libc::{c_char, c_int, c_uint, c_void, size_t};

    /// The type of sizes in C. Defined here for WebAssembly, which has no C library.
    #[cfg(target_family = "wasm")]
    #[expect(non_camel_case_types, reason = "as in C")]
    pub type size_t = usize;
}
