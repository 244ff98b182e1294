//! The C functions of an FMU called as C calls them, with pointers that may be null.
//!
//! All unsafe code of this package is here: what is tested is how an FMU answers calls that the safe interface of the
//! crate `fmu-import` cannot even express. Every wrapper is safe to call: an array is passed with a length that it has, or
//! as a null pointer, and strings end with a zero.
#![allow(unsafe_code)]

use crate::Fmu;
use fmu_import::archive::{Archive, Unpacked};
use fmu_import::c_api::{self, Component, RawStatus, Reference, State};
use fmu_import::description::Interface;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::{Mutex, PoisonError};

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
}

/// What is passed to fmi2Instantiate; `None` is a null pointer.
#[derive(Clone, Copy, Debug)]
pub struct Arguments<'a> {
    /// instanceName.
    pub name: Option<&'a CStr>,
    /// fmuType: 0 model exchange, 1 co-simulation.
    pub kind: c_int,
    /// fmuGUID.
    pub guid: Option<&'a CStr>,
    /// fmuResourceLocation.
    pub resources: Option<&'a CStr>,
    /// Whether there is a struct of callbacks.
    pub callbacks: bool,
}

/// An instance; freed when dropped.
pub struct RawInstance<'a> {
    raw: &'a Raw,
    component: Component,
    /// The FMU's logger writes here until the instance is freed.
    log: Option<Box<LogBook>>,
}

/// A message as the logger got it.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The instance's name.
    pub name: Vec<u8>,
    /// The status.
    pub status: RawStatus,
    /// The category.
    pub category: Vec<u8>,
    /// The message, a format of printf without arguments.
    pub format: Vec<u8>,
}

/// What the logger of one instance got.
#[derive(Debug, Default)]
pub struct LogBook(Mutex<Vec<Entry>>);

impl LogBook {
    /// The messages since the last time.
    #[must_use]
    pub fn take(&self) -> Vec<Entry> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The logger; C passes further arguments behind `format`, which are not read.
unsafe extern "C" fn note(
    environment: *mut c_void,
    name: *const c_char,
    status: RawStatus,
    category: *const c_char,
    format: *const c_char,
) {
    // SAFETY: strings of the FMU, null or with a zero at the end.
    let read = |text: *const c_char| {
        if text.is_null() { Vec::new() } else { unsafe { CStr::from_ptr(text) }.to_bytes().to_vec() }
    };
    let entry = Entry { name: read(name), status, category: read(category), format: read(format) };
    // SAFETY: the environment is the log book that lives as long as the instance.
    let book = unsafe { &*environment.cast::<LogBook>() };
    book.0.lock().unwrap_or_else(PoisonError::into_inner).push(entry);
}

/// Whether an array can have that length: one that no memory can hold is rejected before the array is looked at.
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

/// As [`pointer`], to write to.
fn pointer_mut<T>(values: Option<&mut [T]>, count: usize) -> *mut T {
    values.map_or(ptr::null_mut(), |values| {
        assert!(fits(values, count), "the array is shorter than stated");
        values.as_mut_ptr()
    })
}

impl Raw {
    /// Loads the library of an FMU a second time, for calls by hand.
    ///
    /// # Panics
    /// When it cannot be loaded.
    #[must_use]
    pub fn load(fmu: &Fmu) -> Self {
        let unpacked = unpack(fmu);
        // SAFETY: the library is one of this project's, its initializers do nothing.
        let library = unsafe { libloading::Library::new(&unpacked.binary) }.unwrap_or_else(|error| panic!("{error}"));
        Self { library, unpacked, guid: fmu.description.guid.clone() }
    }

    /// The GUID of the description.
    #[must_use]
    pub fn guid(&self) -> &str {
        &self.guid
    }

    /// The unpacked library file.
    #[must_use]
    pub fn binary(&self) -> &Path {
        &self.unpacked.binary
    }

    /// A function of the library.
    fn function<F: Copy>(&self, name: &str) -> F {
        // SAFETY: callers below name the type that `fmu_import::c_api` gives the function of that name (FMI 2.0 headers).
        *unsafe { self.library.get::<F>(name) }.unwrap_or_else(|error| panic!("{name}: {error}"))
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

    /// fmi2Instantiate with a logger and loggingOn as given; what the FMU logged if it returns none.
    ///
    /// # Errors
    /// When the FMU gives no instance.
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
            // SAFETY: the callee of a variadic call may ignore the arguments behind the named ones on the platforms
            // supported (see the loader of the crate `fmu-import`).
            logger: log.is_some().then(|| unsafe { std::mem::transmute::<Fixed, c_api::Logger>(note as Fixed) }),
            allocate: None,
            free: None,
            finished: None,
            environment: log.as_deref().map_or(ptr::null_mut(), |log| ptr::from_ref(log).cast_mut().cast()),
        };
        let text = |text: Option<&CStr>| text.map_or(ptr::null(), CStr::as_ptr);
        let instantiate: c_api::Instantiate = self.function("fmi2Instantiate");
        let table = if arguments.callbacks { ptr::from_ref(&callbacks).cast() } else { ptr::null() };
        // SAFETY: strings end with a zero, the struct has the layout of the FMI header; the FMU copies it.
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

    /// An instance that is no instance: every function gets a null pointer.
    #[must_use]
    pub fn null(&self) -> RawInstance<'_> {
        RawInstance { raw: self, component: ptr::null_mut(), log: None }
    }
}

impl Drop for RawInstance<'_> {
    fn drop(&mut self) {
        let free: c_api::FreeInstance = self.raw.function("fmi2FreeInstance");
        // SAFETY: freed once; a null pointer is to be ignored.
        unsafe { free(self.component) };
    }
}

/// A value of a function's array.
pub trait Element: Copy {
    /// Name of the type in function names.
    const NAME: &'static str;
}

impl Element for f64 {
    const NAME: &'static str = "Real";
}

/// fmi2Integer and fmi2Boolean are both C's int; this tells them apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Truth(pub c_int);

impl Element for i32 {
    const NAME: &'static str = "Integer";
}

impl Element for Truth {
    const NAME: &'static str = "Boolean";
}

/// A string of C, or null.
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
    const NAME: &'static str = "String";
}

impl RawInstance<'_> {
    /// fmi2Get of a type: references, number of both arrays, values.
    pub fn get<T: Element>(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        values: Option<&mut [T]>,
    ) -> RawStatus {
        let get: c_api::Get<T> = self.raw.function(&format!("fmi2Get{}", T::NAME));
        // SAFETY: arrays of the stated length, or null.
        unsafe { get(self.component, pointer(references, count), count, pointer_mut(values, count)) }
    }

    /// fmi2Set of a type: references, number of both arrays, values.
    pub fn set<T: Element>(&self, references: Option<&[Reference]>, count: usize, values: Option<&[T]>) -> RawStatus {
        let set: c_api::Set<T> = self.raw.function(&format!("fmi2Set{}", T::NAME));
        // SAFETY: arrays of the stated length, or null; strings end with a zero, or are null.
        unsafe { set(self.component, pointer(references, count), count, pointer(values, count)) }
    }

    /// A function that gets nothing but the instance.
    pub fn transition(&self, name: &str) -> RawStatus {
        let function: c_api::Transition = self.raw.function(name);
        // SAFETY: a live instance or null.
        unsafe { function(self.component) }
    }

    /// fmi2SetupExperiment without a tolerance and stop time.
    pub fn setup_experiment(&self, start: f64) -> RawStatus {
        let function: c_api::SetupExperiment = self.raw.function("fmi2SetupExperiment");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, 0, 0.0, start, 0, 0.0) }
    }

    /// fmi2SetupExperiment with all arguments: tolerance with its flag, start, stop time with its flag.
    pub fn setup_experiment_with(&self, tolerance: (c_int, f64), start: f64, stop: (c_int, f64)) -> RawStatus {
        let function: c_api::SetupExperiment = self.raw.function("fmi2SetupExperiment");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, tolerance.0, tolerance.1, start, stop.0, stop.1) }
    }

    /// fmi2DoStep.
    pub fn do_step(&self, time: f64, step: f64) -> RawStatus {
        let function: c_api::DoStep = self.raw.function("fmi2DoStep");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, time, step, 1) }
    }

    /// fmi2SetDebugLogging.
    pub fn set_debug_logging(&self, count: usize, categories: Option<&[Text<'_>]>) -> RawStatus {
        let function: c_api::SetDebugLogging = self.raw.function("fmi2SetDebugLogging");
        // SAFETY: an array of the stated length, or null; strings end with a zero, or are null.
        unsafe { function(self.component, 1, count, pointer(categories, count).cast()) }
    }

    /// fmi2SetDebugLogging without categories.
    pub fn set_all_logging(&self, on: c_int) -> RawStatus {
        let function: c_api::SetDebugLogging = self.raw.function("fmi2SetDebugLogging");
        // SAFETY: no array.
        unsafe { function(self.component, on, 0, ptr::null()) }
    }

    /// fmi2GetFMUstate; `None` is a null pointer to the pointer.
    pub fn get_state(&self, state: Option<&mut RawState>) -> RawStatus {
        self.access_state("fmi2GetFMUstate", state)
    }

    /// fmi2FreeFMUstate; `None` is a null pointer to the pointer.
    pub fn free_state(&self, state: Option<&mut RawState>) -> RawStatus {
        self.access_state("fmi2FreeFMUstate", state)
    }

    fn access_state(&self, name: &str, state: Option<&mut RawState>) -> RawStatus {
        let function: c_api::AccessState = self.raw.function(name);
        // SAFETY: the FMU accepts back only pointers that it gave out, which is what is tested; else null.
        unsafe { function(self.component, state.map_or(ptr::null_mut(), |state| &raw mut state.0)) }
    }

    /// fmi2SetFMUstate.
    pub fn set_state(&self, state: RawState) -> RawStatus {
        let function: c_api::SetState = self.raw.function("fmi2SetFMUstate");
        // SAFETY: as above.
        unsafe { function(self.component, state.0) }
    }

    /// fmi2SerializedFMUstateSize; `None` is a null pointer.
    pub fn state_size(&self, state: RawState, size: Option<&mut usize>) -> RawStatus {
        let function: c_api::SerializedStateSize = self.raw.function("fmi2SerializedFMUstateSize");
        // SAFETY: as above.
        unsafe { function(self.component, state.0, size.map_or(ptr::null_mut(), |size| &raw mut *size)) }
    }

    /// fmi2SerializeFMUstate; `None` is a null pointer.
    pub fn serialize(&self, state: RawState, bytes: Option<&mut [u8]>, size: usize) -> RawStatus {
        let function: c_api::SerializeState = self.raw.function("fmi2SerializeFMUstate");
        // Only as much as the state needs is written, so no stated size is impossible here.
        assert!(bytes.as_ref().is_none_or(|bytes| size <= bytes.len()), "the array is shorter than stated");
        // SAFETY: as above; an array of the stated length, or null.
        unsafe { function(self.component, state.0, pointer_mut(bytes, size).cast(), size) }
    }

    /// fmi2DeSerializeFMUstate; `None` is a null pointer.
    pub fn deserialize(&self, bytes: Option<&[u8]>, size: usize, state: Option<&mut RawState>) -> RawStatus {
        let function: c_api::DeserializeState = self.raw.function("fmi2DeSerializeFMUstate");
        let state = state.map_or(ptr::null_mut(), |state| &raw mut state.0);
        // SAFETY: as above; an array of the stated length, or null.
        unsafe { function(self.component, pointer(bytes, size).cast(), size, state) }
    }

    /// fmi2GetDirectionalDerivative of one unknown by one known; each array may be null.
    pub fn directional_derivative(
        &self,
        unknown: Option<&[Reference]>,
        known: Option<&[Reference]>,
        seed: Option<&[f64]>,
        result: Option<&mut [f64]>,
    ) -> RawStatus {
        let function: c_api::GetDirectionalDerivative = self.raw.function("fmi2GetDirectionalDerivative");
        // SAFETY: arrays of one value, or null.
        unsafe {
            function(
                self.component,
                pointer(unknown, 1),
                1,
                pointer(known, 1),
                1,
                pointer(seed, 1),
                pointer_mut(result, 1),
            )
        }
    }

    /// fmi2GetDirectionalDerivative: unknowns, their number, knowns, their number, seed, result; each array may be null.
    pub fn directional_derivatives(
        &self,
        (unknown, unknowns): (Option<&[Reference]>, usize),
        (known, knowns): (Option<&[Reference]>, usize),
        seed: Option<&[f64]>,
        result: Option<&mut [f64]>,
    ) -> RawStatus {
        let function: c_api::GetDirectionalDerivative = self.raw.function("fmi2GetDirectionalDerivative");
        // SAFETY: arrays of the stated lengths, or null.
        unsafe {
            function(
                self.component,
                pointer(unknown, unknowns),
                unknowns,
                pointer(known, knowns),
                knowns,
                pointer(seed, knowns),
                pointer_mut(result, unknowns),
            )
        }
    }

    /// fmi2SetRealInputDerivatives; each array may be null.
    pub fn set_input_derivatives(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        orders: Option<&[c_int]>,
        values: Option<&[f64]>,
    ) -> RawStatus {
        let function: c_api::SetInputDerivatives = self.raw.function("fmi2SetRealInputDerivatives");
        // SAFETY: arrays of the stated length, or null.
        unsafe {
            function(self.component, pointer(references, count), count, pointer(orders, count), pointer(values, count))
        }
    }

    /// fmi2GetRealOutputDerivatives; each array may be null.
    pub fn get_output_derivatives(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        orders: Option<&[c_int]>,
        values: Option<&mut [f64]>,
    ) -> RawStatus {
        let function: c_api::GetOutputDerivatives = self.raw.function("fmi2GetRealOutputDerivatives");
        // SAFETY: arrays of the stated length, or null.
        unsafe {
            function(
                self.component,
                pointer(references, count),
                count,
                pointer(orders, count),
                pointer_mut(values, count),
            )
        }
    }

    /// fmi2GetString into an array with room for that many strings, or into none, and the strings if it returns fmi2OK.
    pub fn get_texts(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        room: Option<usize>,
    ) -> (RawStatus, Vec<Vec<u8>>) {
        let mut values = room.map(|room| vec![Text::new(None); room]);
        let status = self.get(references, count, values.as_deref_mut());
        let values = values.unwrap_or_default();
        let written = if status == OK { &values[..count.min(values.len())] } else { &[] };
        // SAFETY: the FMU has just filled in strings that live until its next function is called.
        let read = |text: &Text<'_>| unsafe { CStr::from_ptr(text.0) }.to_bytes().to_vec();
        (status, written.iter().filter(|text| !text.0.is_null()).map(read).collect())
    }

    /// The messages that the logger got since the last time; none without a logger.
    #[must_use]
    pub fn take_log(&self) -> Vec<Entry> {
        self.log.as_deref().map(LogBook::take).unwrap_or_default()
    }

    /// fmi2GetRealStatus of a kind; `None` is a null pointer.
    pub fn real_status(&self, kind: c_int, value: Option<&mut f64>) -> RawStatus {
        let function: c_api::GetStatus<f64> = self.raw.function("fmi2GetRealStatus");
        // SAFETY: a live instance or null; one value, or null.
        unsafe { function(self.component, kind, value.map_or(ptr::null_mut(), |value| &raw mut *value)) }
    }

    /// fmi2GetBooleanStatus of a kind; `None` is a null pointer.
    pub fn boolean_status(&self, kind: c_int, value: Option<&mut c_int>) -> RawStatus {
        let function: c_api::GetStatus<c_int> = self.raw.function("fmi2GetBooleanStatus");
        // SAFETY: a live instance or null; one value, or null.
        unsafe { function(self.component, kind, value.map_or(ptr::null_mut(), |value| &raw mut *value)) }
    }

    /// fmi2GetStatus of a kind.
    pub fn status(&self, kind: c_int) -> RawStatus {
        let function: c_api::GetStatus<RawStatus> = self.raw.function("fmi2GetStatus");
        let mut value = 0;
        // SAFETY: a live instance or null; one value.
        unsafe { function(self.component, kind, &raw mut value) }
    }

    /// fmi2GetIntegerStatus of a kind; `None` is a null pointer.
    pub fn integer_status(&self, kind: c_int, value: Option<&mut c_int>) -> RawStatus {
        let function: c_api::GetStatus<c_int> = self.raw.function("fmi2GetIntegerStatus");
        // SAFETY: a live instance or null; one value, or null.
        unsafe { function(self.component, kind, value.map_or(ptr::null_mut(), |value| &raw mut *value)) }
    }

    /// fmi2GetStringStatus of a kind.
    pub fn string_status(&self, kind: c_int) -> RawStatus {
        let function: c_api::GetStatus<*const c_char> = self.raw.function("fmi2GetStringStatus");
        let mut value = ptr::null();
        // SAFETY: a live instance or null; one value.
        unsafe { function(self.component, kind, &raw mut value) }
    }
}

/// A pointer that an FMU gave out as fmi2FMUstate, or null.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawState(State);

impl RawState {
    /// No state yet.
    pub const NULL: Self = Self(ptr::null_mut());

    /// A pointer that no FMU gave out. FMUs compare such pointers, they do not follow them.
    #[must_use]
    pub fn invented(address: usize) -> Self {
        Self(ptr::without_provenance_mut(address))
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_null(self) -> bool {
        self.0.is_null()
    }
}

fn unpack(fmu: &Fmu) -> Unpacked {
    let unpacked =
        Archive::open(&fmu.path).and_then(|mut archive| archive.unpack(&fmu.description, Interface::CoSimulation));
    unpacked.unwrap_or_else(|error| panic!("{error}"))
}

/// Loads a library and keeps it loaded to the end of the process; later loads of the same file find this one. If
/// `global`, all libraries loaded so share one space of names (RTLD_GLOBAL), as in some masters; Windows has no such space.
///
/// # Panics
/// When it cannot be loaded.
pub fn keep_loaded(path: &Path, global: bool) {
    #[cfg(unix)]
    let load = || {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_LOCAL, RTLD_NOW};
        let space = if global { RTLD_GLOBAL } else { RTLD_LOCAL };
        // SAFETY: the library is one of this project's, its initializers do nothing.
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

/// How often memory was allocated in this process so far; `None` if it runs without `count_allocations`.
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
    // The name with its zero at the end needs no memory of its own.
    // SAFETY: the preloaded library defines this function with this type.
    let function = unsafe { this.get::<extern "C" fn() -> u64>(c"counted_allocations") };
    function.ok().map(|function| function())
}

/// Lets another thread use an instance, then frees it there.
///
/// # Panics
/// When `work` panics.
pub fn on_another_thread<T: Send>(
    instance: fmu_import::loader::Instance,
    work: impl FnOnce(&mut fmu_import::loader::Instance) -> T + Send,
) -> T {
    struct Moved(fmu_import::loader::Instance);
    // SAFETY: an instance may be used by any thread, by one at a time (FMI 2.0.4, section 2.1.5); it is given away.
    unsafe impl Send for Moved {}
    let moved = Moved(instance);
    let run = move || {
        let mut moved = moved;
        work(&mut { &mut moved }.0)
    };
    std::thread::scope(|scope| scope.spawn(run).join()).expect("the thread does not panic")
}
