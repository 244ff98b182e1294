//! Direct calls of an FMU's C functions, with pointers that may be null.
//!
//! All unsafe code of this package is here, for calls that the safe interface of the crate `fmu-import` cannot express.
//! Every wrapper is safe: an array is passed as a null pointer, or with a length that does not exceed its own, and
//! strings end with a zero.
#![allow(unsafe_code)]

use crate::Fmu;
use fmu_import::archive::{Archive, Unpacked};
use fmu_import::c_api::v3::{IntermediateUpdate, RawBoolean};
use fmu_import::c_api::{self, Component, RawStatus, Reference, State};
use fmu_import::description::{FmiVersion, Interface};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::{Mutex, PoisonError};

mod calls;
mod events;
#[cfg(target_arch = "x86_64")]
mod float_environment;
mod names;
mod types;
mod updates;

pub use events::{DerivativeArrays, UpdateFlags};
#[cfg(target_arch = "x86_64")]
pub use float_environment::FloatEnvironment;
pub use names::in_version;
pub use types::TYPES_WITHOUT_VARIABLES;
pub use updates::{Shared, locks};

/// `fmi2OK`.
pub const OK: RawStatus = 0;
/// `fmi2Discard`.
pub const DISCARD: RawStatus = 2;
/// `fmi2Error`.
pub const ERROR: RawStatus = 3;

/// `fmi2CallbackFunctions` with a logger that may be missing.
#[repr(C)]
struct Callbacks {
    logger: Option<c_api::Logger>,
    allocate: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    free: Option<unsafe extern "C" fn(*mut c_void)>,
    finished: Option<unsafe extern "C" fn(*mut c_void, RawStatus)>,
    environment: *mut c_void,
}

/// The library of an FMU.
pub struct Raw {
    library: libloading::Library,
    unpacked: Unpacked,
    guid: String,
    version: FmiVersion,
}

/// Arguments of fmi2Instantiate; `None` is a null pointer.
#[derive(Clone, Copy, Debug)]
pub struct Arguments<'a> {
    /// instanceName.
    pub name: Option<&'a CStr>,
    /// fmuType: 0 model exchange, 1 co-simulation; 2 stands for the scheduled execution of FMI 3.0.
    pub kind: c_int,
    /// fmuGUID.
    pub guid: Option<&'a CStr>,
    /// fmuResourceLocation.
    pub resources: Option<&'a CStr>,
    /// True if a struct of callbacks is passed (FMI 2.0).
    pub callbacks: bool,
    /// Additional arguments in FMI 3.0.
    pub events: EventArguments<'a>,
}

/// Arguments of fmi3InstantiateCoSimulation that FMI 2.0 does not have.
#[derive(Clone, Copy, Debug, Default)]
pub struct EventArguments<'a> {
    /// eventModeUsed.
    pub mode_used: bool,
    /// earlyReturnAllowed.
    pub early_return: bool,
    /// nRequiredIntermediateVariables, with a null pointer as requiredIntermediateVariables.
    pub intermediate_variables: usize,
    /// requiredIntermediateVariables of an instance with a callback; steps are made with
    /// [`RawInstance::step_with_updates`].
    pub updates: Option<&'a [Reference]>,
    /// True if an instance for scheduled execution gets callbacks; activations are made with [`RawInstance::activate`].
    pub schedules: bool,
}

/// An instance; freed when dropped.
pub struct RawInstance<'a> {
    raw: &'a Raw,
    component: Component,
    /// The logger writes the FMU's messages here until the instance is freed.
    log: Option<Box<LogBook>>,
}

/// A message as received by the logger.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The instance's name.
    pub name: Vec<u8>,
    /// The status.
    pub status: RawStatus,
    /// The category.
    pub category: Vec<u8>,
    /// The message; in FMI 2.0 a printf format without arguments.
    pub format: Vec<u8>,
}

/// Messages received by the logger of one instance.
#[derive(Debug, Default)]
pub struct LogBook(Mutex<Vec<Entry>>);

impl LogBook {
    /// Takes the messages since the last call.
    #[must_use]
    pub fn take(&self) -> Vec<Entry> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The logger. In C, more arguments follow `format`; they are not read.
unsafe extern "C" fn note(
    environment: *mut c_void,
    name: *const c_char,
    status: RawStatus,
    category: *const c_char,
    format: *const c_char,
) {
    // SAFETY: the FMU passes null or strings that end with a zero.
    let read = |text: *const c_char| {
        if text.is_null() { Vec::new() } else { unsafe { CStr::from_ptr(text) }.to_bytes().to_vec() }
    };
    let entry = Entry { name: read(name), status, category: read(category), format: read(format) };
    // SAFETY: the environment is the log book, which lives as long as the instance.
    let book = unsafe { &*environment.cast::<LogBook>() };
    book.0.lock().unwrap_or_else(PoisonError::into_inner).push(entry);
}

/// The logger for FMI 3.0, which does not get the name of the instance.
unsafe extern "C" fn note_fmi3(
    environment: *mut c_void,
    status: RawStatus,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: as above.
    unsafe { note(environment, c"".as_ptr(), status, category, message) }
}

/// Returns true if an array can be passed with this length: the array is long enough, or the length exceeds any memory,
/// so the FMU rejects it before it reads the array.
fn fits<T>(values: &[T], count: usize) -> bool {
    count <= values.len() || count > isize::MAX as usize / size_of::<T>()
}

/// A pointer to the values, or null.
fn pointer<T>(values: Option<&[T]>, count: usize) -> *const T {
    values.map_or(ptr::null(), |values| {
        assert!(fits(values, count), "the array is shorter than stated");
        values.as_ptr()
    })
}

/// Like [`pointer`], but writable.
fn pointer_mut<T>(values: Option<&mut [T]>, count: usize) -> *mut T {
    values.map_or(ptr::null_mut(), |values| {
        assert!(fits(values, count), "the array is shorter than stated");
        values.as_mut_ptr()
    })
}

impl Raw {
    /// Loads the library of an FMU a second time, for direct calls.
    ///
    /// # Panics
    /// If it cannot be loaded.
    #[must_use]
    pub fn load(fmu: &Fmu) -> Self {
        let unpacked = unpack(fmu);
        // SAFETY: the library belongs to this project, and its initializers do nothing.
        let library = unsafe { libloading::Library::new(&unpacked.binary) }.unwrap_or_else(|error| panic!("{error}"));
        Self { library, unpacked, guid: fmu.description.guid.clone(), version: fmu.description.fmi }
    }

    /// The GUID of the description.
    #[must_use]
    pub fn guid(&self) -> &str {
        &self.guid
    }

    /// The version of FMI.
    #[must_use]
    pub fn version(&self) -> FmiVersion {
        self.version
    }

    /// The unpacked library file.
    #[must_use]
    pub fn binary(&self) -> &Path {
        &self.unpacked.binary
    }

    /// A function of the library, by its name in FMI 2.0 if it exists there.
    fn function<F: Copy>(&self, name: &str) -> F {
        let name = in_version(self.version, name);
        // SAFETY: callers use the type from `fmu_import::c_api` for the function with this name (headers of FMI).
        *unsafe { self.library.get::<F>(name) }.unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// fmi3GetVersion.
    #[must_use]
    pub fn version_text(&self) -> String {
        let function: c_api::GetText = self.function("fmi2GetVersion");
        // SAFETY: a static string.
        unsafe { CStr::from_ptr(function()) }.to_string_lossy().into_owned()
    }

    /// fmi2GetVersion and fmi2GetTypesPlatform.
    #[must_use]
    pub fn texts(&self) -> [String; 2] {
        ["fmi2GetVersion", "fmi2GetTypesPlatform"].map(|name| {
            let function: c_api::GetText = self.function(name);
            // SAFETY: both return a static string.
            unsafe { CStr::from_ptr(function()) }.to_string_lossy().into_owned()
        })
    }

    /// fmi2Instantiate without a logger; `None` is a null pointer.
    #[must_use]
    pub fn instantiate(&self, arguments: Arguments<'_>) -> Option<RawInstance<'_>> {
        self.instantiate_with(arguments, 0, None).ok()
    }

    /// fmi2Instantiate with a logger and loggingOn as given.
    ///
    /// # Errors
    /// The FMU returns no instance; the error contains the FMU's messages.
    pub fn instantiate_logging(
        &self,
        arguments: Arguments<'_>,
        logging_on: c_int,
    ) -> Result<RawInstance<'_>, Vec<Entry>> {
        self.instantiate_with(arguments, logging_on, Some(Box::default()))
    }

    fn instantiate_with(
        &self,
        arguments: Arguments<'_>,
        logging_on: c_int,
        log: Option<Box<LogBook>>,
    ) -> Result<RawInstance<'_>, Vec<Entry>> {
        type Fixed = unsafe extern "C" fn(*mut c_void, *const c_char, RawStatus, *const c_char, *const c_char);
        let callbacks = Callbacks {
            // SAFETY: on the supported platforms, the callee of a variadic call may ignore the arguments after the
            // named ones (see the loader of the crate `fmu-import`).
            logger: log.is_some().then(|| unsafe { std::mem::transmute::<Fixed, c_api::Logger>(note as Fixed) }),
            allocate: None,
            free: None,
            finished: None,
            environment: log.as_deref().map_or(ptr::null_mut(), |log| ptr::from_ref(log).cast_mut().cast()),
        };
        let text = |text: Option<&CStr>| text.map_or(ptr::null(), CStr::as_ptr);
        if self.version == FmiVersion::V3 {
            let component = self.instantiate_fmi3(arguments, logging_on != 0, log.as_deref());
            if component.is_null() {
                return Err(log.map(|log| log.take()).unwrap_or_default());
            }
            return Ok(RawInstance { raw: self, component, log });
        }
        let instantiate: c_api::Instantiate = self.function("fmi2Instantiate");
        let table = if arguments.callbacks { ptr::from_ref(&callbacks).cast() } else { ptr::null() };
        // SAFETY: strings end with a zero; the struct has the layout of the FMI header, and the FMU copies it.
        let component = unsafe {
            instantiate(
                text(arguments.name),
                arguments.kind,
                text(arguments.guid),
                text(arguments.resources),
                table,
                0,
                logging_on,
            )
        };
        if component.is_null() {
            return Err(log.map(|log| log.take()).unwrap_or_default());
        }
        Ok(RawInstance { raw: self, component, log })
    }

    fn instantiate_fmi3(&self, arguments: Arguments<'_>, logging_on: bool, log: Option<&LogBook>) -> Component {
        type Logger = Option<c_api::v3::LogMessage>;
        type Exchange = unsafe extern "C" fn(
            *const c_char,
            *const c_char,
            *const c_char,
            bool,
            bool,
            *mut c_void,
            Logger,
        ) -> Component;
        type CoSimulation = unsafe extern "C" fn(
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
            Logger,
            Option<IntermediateUpdate>,
        ) -> Component;
        type Scheduled = unsafe extern "C" fn(
            *const c_char,
            *const c_char,
            *const c_char,
            bool,
            bool,
            *mut c_void,
            Logger,
            Option<unsafe extern "C" fn(*mut c_void)>,
            Option<unsafe extern "C" fn()>,
            Option<unsafe extern "C" fn()>,
        ) -> Component;
        let text = |text: Option<&CStr>| text.map_or(ptr::null(), CStr::as_ptr);
        let (name, token, resources) = (text(arguments.name), text(arguments.guid), text(arguments.resources));
        let environment = log.map_or(ptr::null_mut(), |log| ptr::from_ref(log).cast_mut().cast());
        let logger: Logger = log.map(|_| note_fmi3 as c_api::v3::LogMessage);
        let EventArguments { mode_used, early_return, intermediate_variables, updates, schedules } = arguments.events;
        let (required, count) =
            updates.map_or((ptr::null(), intermediate_variables), |required| (required.as_ptr(), required.len()));
        let update = updates.map(|_| updates::update as IntermediateUpdate);
        // SAFETY: strings end with a zero; the types are those of the headers, with callbacks that may be null. The
        // array of intermediate variables has the stated length, or is null, which the FMU rejects.
        unsafe {
            match arguments.kind {
                0 => {
                    let make: Exchange = self.function("fmi3InstantiateModelExchange");
                    make(name, token, resources, false, logging_on, environment, logger)
                }
                1 => {
                    let make: CoSimulation = self.function("fmi3InstantiateCoSimulation");
                    make(
                        name,
                        token,
                        resources,
                        false,
                        logging_on,
                        mode_used,
                        early_return,
                        required,
                        count,
                        environment,
                        logger,
                        update,
                    )
                }
                _ => {
                    let make: Scheduled = self.function("fmi3InstantiateScheduledExecution");
                    let (update, lock, unlock) = match schedules {
                        true => {
                            (Some(updates::clock_update as _), Some(updates::lock as _), Some(updates::unlock as _))
                        }
                        false => (None, None, None),
                    };
                    make(name, token, resources, false, logging_on, environment, logger, update, lock, unlock)
                }
            }
        }
    }

    /// A null instance: every function gets a null pointer.
    #[must_use]
    pub fn null(&self) -> RawInstance<'_> {
        RawInstance { raw: self, component: ptr::null_mut(), log: None }
    }
}

impl Drop for RawInstance<'_> {
    fn drop(&mut self) {
        let free: c_api::FreeInstance = self.raw.function("fmi2FreeInstance");
        // SAFETY: the instance is freed only once; FMUs ignore a null pointer.
        unsafe { free(self.component) };
    }
}

/// The type of the values in a function's array.
pub trait Element: Copy {
    /// Name of the type in the function names of FMI 2.0 and FMI 3.0; empty if a version does not have it.
    const NAMES: [&'static str; 2];
}

impl Element for f64 {
    const NAMES: [&'static str; 2] = ["Real", "Float64"];
}

macro_rules! elements_of_fmi3 {
    ($($type:ty: $name:literal;)*) => {$(
        impl Element for $type {
            const NAMES: [&'static str; 2] = ["", $name];
        }
    )*};
}
elements_of_fmi3! {
    f32: "Float32";
    i8: "Int8";
    Octet: "UInt8";
    i16: "Int16";
    u16: "UInt16";
    u32: "UInt32";
    i64: "Int64";
    u64: "UInt64";
    u8: "Boolean";
}

/// Distinguishes fmi3UInt8 from fmi3Boolean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Octet(pub u8);

/// Distinguishes fmi2Boolean from fmi2Integer; both are C's int.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Truth(pub c_int);

impl Element for i32 {
    const NAMES: [&'static str; 2] = ["Integer", "Int32"];
}

impl Element for Truth {
    const NAMES: [&'static str; 2] = ["Boolean", ""];
}

/// A C string, or null.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Text<'a>(*const c_char, std::marker::PhantomData<&'a CStr>);

impl<'a> Text<'a> {
    /// A string, or a null pointer.
    #[must_use]
    pub fn new(text: Option<&'a CStr>) -> Self {
        Self(text.map_or(ptr::null(), CStr::as_ptr), std::marker::PhantomData)
    }
}

impl Element for Text<'_> {
    const NAMES: [&'static str; 2] = ["String", "String"];
}

/// A pointer that an FMU returned as fmi2FMUstate, or null.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawState(State);

impl RawState {
    /// No state yet.
    pub const NULL: Self = Self(ptr::null_mut());

    /// A pointer that no FMU returned. FMUs only compare such pointers and do not dereference them.
    #[must_use]
    pub fn invented(address: usize) -> Self {
        Self(ptr::without_provenance_mut(address))
    }

    /// Returns true if there is no state.
    #[must_use]
    pub fn is_null(self) -> bool {
        self.0.is_null()
    }
}

fn unpack(fmu: &Fmu) -> Unpacked {
    let description = &fmu.description;
    let interface =
        if description.co_simulation.is_some() { Interface::CoSimulation } else { Interface::ModelExchange };
    let unpacked = Archive::open(&fmu.path).and_then(|mut archive| archive.unpack(description, interface));
    unpacked.unwrap_or_else(|error| panic!("{error}"))
}

/// Loads a library and keeps it loaded until the process ends; later loads of the same file find it. If `global`, all
/// libraries loaded this way share one namespace (RTLD_GLOBAL), as in some masters. Windows does not have such a
/// namespace.
///
/// # Panics
/// If it cannot be loaded.
pub fn keep_loaded(path: &Path, global: bool) {
    #[cfg(unix)]
    let load = || {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_LOCAL, RTLD_NOW};
        let space = if global { RTLD_GLOBAL } else { RTLD_LOCAL };
        // SAFETY: the library belongs to this project, and its initializers do nothing.
        unsafe { Library::open(Some(path), RTLD_NOW | space) }
    };
    #[cfg(not(unix))]
    let load = || {
        let _ = global;
        // SAFETY: as above.
        unsafe { libloading::Library::new(path) }
    };
    std::mem::forget(load().unwrap_or_else(|error| panic!("{error}")));
}

/// Number of allocations in this process so far; `None` without the library `count_allocations`.
#[must_use]
pub fn allocations() -> Option<u64> {
    #[cfg(unix)]
    return preloaded_count();
    #[cfg(not(unix))]
    None
}

#[cfg(unix)]
fn preloaded_count() -> Option<u64> {
    let this = libloading::os::unix::Library::this();
    // A C string literal avoids an allocation. SAFETY: the preloaded library defines this function with this type.
    let function = unsafe { this.get::<extern "C" fn() -> u64>(c"counted_allocations") };
    function.ok().map(|function| function())
}

/// Uses an instance on another thread, then frees it there.
///
/// # Panics
/// If `work` panics.
pub fn on_another_thread<T: Send>(
    instance: fmu_import::loader::Instance,
    work: impl FnOnce(&mut fmu_import::loader::Instance) -> T + Send,
) -> T {
    struct Moved(fmu_import::loader::Instance);
    // SAFETY: any thread may use an instance, one at a time (FMI 2.0.4, section 2.1.5); it is moved to the other
    // thread.
    unsafe impl Send for Moved {}
    let moved = Moved(instance);
    let run = move || {
        let mut moved = moved;
        work(&mut { &mut moved }.0)
    };
    std::thread::scope(|scope| scope.spawn(run).join()).expect("the thread does not panic")
}
