//! Loads the shared library of an FMU and gives its C functions a safe interface.
//!
//! The only unsafe code of the host. What the compiler cannot check is stated at each block; what
//! remains is trust in the binary itself: a library that does not keep to the FMI 2.0 interface can
//! do anything to the process, as with every importer that loads FMUs into itself.

#![allow(unsafe_code)]

pub mod calls;

use crate::archive::Unpacked;
use crate::c_api::{self, CallbackFunctions, Component, RawStatus, Reference};
use crate::python;
use crate::terminal;
use calls::{Board, Function};
use object::Object as _;
use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char, c_void};
use std::path::PathBuf;
use std::ptr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Messages kept per instance; older ones are dropped.
const KEPT_MESSAGES: usize = 100;
/// Longest message that is kept, bytes.
const MAX_MESSAGE: usize = 10_000;

/// Why a library cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The system cannot load it.
    #[error("cannot load {}: {reason}", path.display())]
    Library {
        /// The library.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// It lacks a function of FMI 2.0 for co-simulation.
    #[error("{} does not export {function}", path.display())]
    Missing {
        /// The library.
        path: PathBuf,
        /// Name of the function.
        function: &'static str,
    },
    /// A model in it contradicts itself.
    #[error("{message}")]
    Declaration {
        /// What is wrong with its declarations.
        message: String,
    },
    /// It was built for other types or another version.
    #[error("{}: {function} says \"{found}\", expected \"{expected}\"", path.display())]
    Version {
        /// The library.
        path: PathBuf,
        /// Function that was asked.
        function: &'static str,
        /// Answer.
        found: String,
        /// Answer of an FMU that can be used.
        expected: &'static str,
    },
    /// It calls Python, and the process has no Python.
    #[error(
        "{} needs the Python library, which this process lacks: it uses `{symbol}` without linking to it; give the library \
         to `cargo fmu run`, `study` or `check` with `--libpython FILE`, or run `scripts/cosim.py --native`, which finds it",
        path.display()
    )]
    Python {
        /// The library.
        path: PathBuf,
        /// A function of Python that it uses.
        symbol: String,
    },
}

/// `fmi2Status`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Status {
    /// All well.
    Ok,
    /// Done, with a reservation.
    Warning,
    /// Not done; the instance can go on.
    Discard,
    /// Failed; the instance can be freed or reset.
    Error,
    /// Failed; no instance of the FMU can be used any more.
    Fatal,
    /// Not done yet.
    Pending,
    /// A number FMI 2.0 does not know.
    Unknown(RawStatus),
}

impl From<RawStatus> for Status {
    fn from(raw: RawStatus) -> Self {
        match raw {
            0 => Self::Ok,
            1 => Self::Warning,
            2 => Self::Discard,
            3 => Self::Error,
            4 => Self::Fatal,
            5 => Self::Pending,
            other => Self::Unknown(other),
        }
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Ok => f.write_str("fmi2OK"),
            Self::Warning => f.write_str("fmi2Warning"),
            Self::Discard => f.write_str("fmi2Discard"),
            Self::Error => f.write_str("fmi2Error"),
            Self::Fatal => f.write_str("fmi2Fatal"),
            Self::Pending => f.write_str("fmi2Pending"),
            Self::Unknown(raw) => write!(f, "the unknown status {raw}"),
        }
    }
}

/// A message that an instance logged.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Message {
    /// Severity.
    pub status: Status,
    /// Category, empty if none was given.
    pub category: String,
    /// Text. Doubled percent signs are halved; conversions such as `%s` remain as they are, because
    /// a Rust function cannot receive the values that C passes for them.
    pub text: String,
}

/// What went wrong in a call.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CallProblem {
    /// The FMU answered with this status.
    Status(Status),
    /// The FMU made no instance.
    NoInstance,
    /// The FMU does not export the function.
    NotExported,
    /// The arguments do not fit; the FMU was not called.
    Arguments(&'static str),
    /// A previous call returned `fmi2Fatal`; the FMU was not called.
    Dead,
}

/// A call that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CallError {
    /// Name of the instance.
    pub instance: String,
    /// Name of the C function.
    pub function: &'static str,
    /// What went wrong.
    pub problem: CallProblem,
    /// Messages of the instance since they were last taken, this call included.
    pub messages: Vec<Message>,
}

impl std::error::Error for CallError {}

impl std::fmt::Display for CallError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { instance, function, .. } = self;
        match &self.problem {
            CallProblem::Status(status) => write!(f, "`{instance}`: {function} returned {status}"),
            CallProblem::NoInstance => write!(f, "`{instance}`: {function} returned no instance"),
            CallProblem::NotExported => {
                write!(f, "`{instance}`: the FMU does not export {function}")
            }
            CallProblem::Arguments(reason) => write!(f, "`{instance}`: {function}: {reason}"),
            CallProblem::Dead => write!(f, "`{instance}`: {function} is not possible after fmi2Fatal"),
        }?;
        for message in &self.messages {
            // Further lines of a message are not taken for messages.
            write!(f, "\n  {}: {}", message.status, terminal::indented(&message.text, "    "))?;
        }
        Ok(())
    }
}

macro_rules! functions {
    (required { $($field:ident: $type:ty = $name:literal,)* } optional { $($other:ident: $other_type:ty = $other_name:literal,)* }) => {
        /// The functions of a library. Those a master cannot do without are required; the others
        /// are missing from many FMUs although FMI 2.0 demands them.
        struct Functions { $($field: $type,)* $($other: Option<$other_type>,)* }

        impl Functions {
            /// # Safety
            /// Every function of that name has the signature FMI 2.0 gives it, and the library
            /// outlives the table.
            unsafe fn load(library: &libloading::Library) -> Result<Self, &'static str> {
                // SAFETY: promised by the caller.
                unsafe {
                    Ok(Self {
                        $($field: *library.get::<$type>($name).map_err(|_| $name)?,)*
                        $($other: library.get::<$other_type>($other_name).ok().map(|f| *f),)*
                    })
                }
            }

            /// Names of all functions.
            const NAMES: &[&str] = &[$($name,)* $($other_name,)*];

            /// Names of the optional functions that are not there.
            fn missing(&self) -> Vec<&'static str> {
                let mut names = Vec::new();
                $(if self.$other.is_none() {
                    names.push($other_name);
                })*
                names
            }
        }
    };
}

functions! {
    required {
        get_types_platform: c_api::GetText = "fmi2GetTypesPlatform",
        get_version: c_api::GetText = "fmi2GetVersion",
        instantiate: c_api::Instantiate = "fmi2Instantiate",
        free_instance: c_api::FreeInstance = "fmi2FreeInstance",
        setup_experiment: c_api::SetupExperiment = "fmi2SetupExperiment",
        enter_initialization_mode: c_api::Transition = "fmi2EnterInitializationMode",
        exit_initialization_mode: c_api::Transition = "fmi2ExitInitializationMode",
        terminate: c_api::Transition = "fmi2Terminate",
        reset: c_api::Transition = "fmi2Reset",
        get_real: c_api::Get<f64> = "fmi2GetReal",
        get_integer: c_api::Get<i32> = "fmi2GetInteger",
        get_boolean: c_api::Get<c_api::Boolean> = "fmi2GetBoolean",
        get_string: c_api::Get<*const c_char> = "fmi2GetString",
        set_real: c_api::Set<f64> = "fmi2SetReal",
        set_integer: c_api::Set<i32> = "fmi2SetInteger",
        set_boolean: c_api::Set<c_api::Boolean> = "fmi2SetBoolean",
        set_string: c_api::Set<*const c_char> = "fmi2SetString",
        do_step: c_api::DoStep = "fmi2DoStep",
    }
    optional {
        set_debug_logging: c_api::SetDebugLogging = "fmi2SetDebugLogging",
        get_state: c_api::AccessState = "fmi2GetFMUstate",
        set_state: c_api::SetState = "fmi2SetFMUstate",
        free_state: c_api::AccessState = "fmi2FreeFMUstate",
        serialized_state_size: c_api::SerializedStateSize = "fmi2SerializedFMUstateSize",
        serialize_state: c_api::SerializeState = "fmi2SerializeFMUstate",
        deserialize_state: c_api::DeserializeState = "fmi2DeSerializeFMUstate",
        get_directional_derivative: c_api::GetDirectionalDerivative = "fmi2GetDirectionalDerivative",
        set_real_input_derivatives: c_api::SetInputDerivatives = "fmi2SetRealInputDerivatives",
        get_real_output_derivatives: c_api::GetOutputDerivatives = "fmi2GetRealOutputDerivatives",
        cancel_step: c_api::Transition = "fmi2CancelStep",
        get_status: c_api::GetStatus<RawStatus> = "fmi2GetStatus",
        get_real_status: c_api::GetStatus<f64> = "fmi2GetRealStatus",
        get_integer_status: c_api::GetStatus<i32> = "fmi2GetIntegerStatus",
        get_boolean_status: c_api::GetStatus<c_api::Boolean> = "fmi2GetBooleanStatus",
        get_string_status: c_api::GetStatus<*const c_char> = "fmi2GetStringStatus",
    }
}

/// A loaded library together with the unpacked files it stands in.
pub struct Library {
    functions: Functions,
    // Fields are dropped in this order: the library is closed before its file is removed.
    _library: libloading::Library,
    resources: CString,
    instances: AtomicUsize,
    _unpacked: Arc<Unpacked>,
}

impl std::fmt::Debug for Library {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Library").field("resources", &self.resources).finish_non_exhaustive()
    }
}

impl Library {
    /// Loads the library of an unpacked FMU.
    ///
    /// # Errors
    /// The system cannot load it, it needs a Python library that is not there, a function is missing, or it is not one of
    /// FMI 2.0 with the types platform `default`.
    pub fn load(unpacked: impl Into<Arc<Unpacked>>) -> Result<Arc<Self>, LoadError> {
        let board = calls::board();
        if let Some(board) = board {
            board.load();
        }
        let library = Self::load_unpacked(unpacked.into());
        if let Some(board) = board {
            board.leave();
        }
        library
    }

    fn load_unpacked(unpacked: Arc<Unpacked>) -> Result<Arc<Self>, LoadError> {
        let path = &unpacked.binary;
        let opened = open(path);
        // Functions are looked up when they are called first, and ending the process is how the system reports a missing one.
        if let Some(symbol) = python::undefined_symbol(path).filter(|symbol| !has_symbol(opened.as_ref().ok(), symbol))
        {
            return Err(LoadError::Python { path: path.clone(), symbol });
        }
        let library = opened.map_err(|error| LoadError::Library { path: path.clone(), reason: reason(&error) })?;
        // SAFETY: the signatures are those of the FMI 2.0 headers; the table is stored beside the
        // library and its pointers are called through `Library` and `Instance` only.
        let functions = unsafe { Functions::load(&library) }
            .map_err(|function| LoadError::Missing { path: path.clone(), function })?;
        for (function, get, expected) in [
            ("fmi2GetVersion", functions.get_version, "2.0"),
            ("fmi2GetTypesPlatform", functions.get_types_platform, "default"),
        ] {
            // SAFETY: both functions take nothing and return a static string or null.
            let found = unsafe { text(get()) };
            if found != expected {
                return Err(LoadError::Version { path: path.clone(), function, found, expected });
            }
        }
        Ok(Arc::new(Self {
            functions,
            _library: library,
            resources: file_uri(&unpacked.resources),
            instances: AtomicUsize::new(0),
            _unpacked: unpacked,
        }))
    }

    /// Functions of FMI 2.0 for co-simulation that the library does not export although the standard has them; those
    /// without which it could not be loaded are not among them.
    #[must_use]
    pub fn missing_functions(&self) -> Vec<&'static str> {
        self.functions.missing()
    }

    /// Number of living instances.
    #[must_use]
    pub fn instances(&self) -> usize {
        self.instances.load(Ordering::Acquire)
    }
}

/// Functions of FMI 2.0 for co-simulation that a library, for any platform, does not export.
///
/// # Errors
/// The file cannot be read or is not a library.
pub fn not_exported(library: &std::path::Path) -> Result<Vec<&'static str>, LoadError> {
    let failed = |reason: String| LoadError::Library { path: library.to_path_buf(), reason };
    let bytes = std::fs::read(library).map_err(|error| failed(error.to_string()))?;
    let file = object::File::parse(&*bytes).map_err(|error| failed(error.to_string()))?;
    let exports = file.exports().map_err(|error| failed(error.to_string()))?;
    // macOS puts an underscore in front of every name.
    let is_there = |name: &str| {
        exports
            .iter()
            .any(|export| export.name() == name.as_bytes() || export.name().strip_prefix(b"_") == Some(name.as_bytes()))
    };
    Ok(Functions::NAMES.iter().copied().filter(|name| !is_there(name)).collect())
}

/// The model descriptions in a library that the exporter of this project made to describe its models, by the name of the
/// model's type. Empty for other libraries.
///
/// # Errors
/// The system cannot load it, or a model has no description because its declarations contradict each other.
pub fn exported_descriptions(path: &std::path::Path) -> Result<Vec<(String, String)>, LoadError> {
    const PREFIX: &str = "fmu_model_description_";
    let failed = |reason: String| LoadError::Library { path: path.to_path_buf(), reason };
    let bytes = std::fs::read(path).map_err(|error| failed(error.to_string()))?;
    let file = object::File::parse(&*bytes).map_err(|error| failed(error.to_string()))?;
    let exports = file.exports().map_err(|error| failed(error.to_string()))?;
    // macOS puts an underscore in front of every name.
    let names = exports.iter().filter_map(|export| std::str::from_utf8(export.name()).ok());
    let names = names.map(|name| name.strip_prefix('_').unwrap_or(name)).filter(|name| name.starts_with(PREFIX));
    let library = open(path).map_err(|error| failed(reason(&error)))?;
    let mut descriptions = Vec::new();
    for name in names {
        // SAFETY: the exporter defines these functions without arguments; they return a string that lives as long as the
        // library is loaded, or null.
        let description = unsafe {
            library.get::<unsafe extern "C" fn() -> *const c_char>(name.as_bytes()).map(|function| text(function()))
        };
        let description = description.map_err(|error| failed(reason(&error)))?;
        let model = name[PREFIX.len()..].to_owned();
        if description.is_empty() {
            return Err(failed(format!("{model} cannot be described; its message is above")));
        }
        if let Some(problem) = description.strip_prefix('!') {
            return Err(LoadError::Declaration { message: problem.to_owned() });
        }
        descriptions.push((model, description));
    }
    descriptions.sort();
    Ok(descriptions)
}

/// Loads a library. Those that it brings along in its folder are found under Windows only if that is asked for; elsewhere the
/// library itself says where they are.
fn open(path: &std::path::Path) -> Result<libloading::Library, libloading::Error> {
    #[cfg(windows)]
    {
        use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
        // SAFETY: loading runs initializers of the library; see the trust stated at the top.
        unsafe { Library::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }.map(Into::into)
    }
    #[cfg(not(windows))]
    {
        // SAFETY: as above.
        unsafe { libloading::Library::new(path) }
    }
}

/// Whether a library, those it brings along or the program itself have a symbol.
fn has_symbol(library: Option<&libloading::Library>, symbol: &str) -> bool {
    // SAFETY: the symbol is only looked up, not used.
    let found = library.is_some_and(|library| unsafe { library.get::<*const c_void>(symbol) }.is_ok());
    #[cfg(unix)]
    // SAFETY: as above.
    let found = found || unsafe { libloading::os::unix::Library::this().get::<*const c_void>(symbol) }.is_ok();
    found
}

/// Writes out what FMUs have printed and the C library still holds.
pub fn flush_prints() {
    // SAFETY: a null stream stands for all streams; there are no other conditions.
    unsafe { libc::fflush(ptr::null_mut()) };
}

/// What the system says, such as which symbol or library is missing, stands in the sources of the error.
fn reason(error: &libloading::Error) -> String {
    let chain = std::iter::successors(Some(error as &dyn std::error::Error), |error| error.source());
    chain.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// `file:` URI of a folder, everything but plain characters percent-encoded (RFC 3986).
fn file_uri(path: &std::path::Path) -> CString {
    let text = path.to_string_lossy().replace('\\', "/");
    // A Windows path starts with a drive letter, the path of a URI with a slash.
    let root = if text.starts_with('/') { "" } else { "/" };
    let mut uri = format!("file://{root}");
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/:".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri.push_str(&format!("%{byte:02X}"));
        }
    }
    // Control characters were encoded above, so there is no zero byte left to fail on.
    CString::new(uri).unwrap_or_default()
}

/// Owned text of a C string; empty for null, faulty UTF-8 replaced.
///
/// # Safety
/// `text` is null or points to a string that ends with a zero byte.
unsafe fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, the rest is promised by the caller.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Where the logger callback puts the messages of one instance.
#[derive(Default)]
struct Log {
    // FMUs may log from threads of their own.
    messages: Mutex<VecDeque<Message>>,
}

impl Log {
    fn take(&self) -> Vec<Message> {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        messages.drain(..).collect()
    }
}

/// The text of a message: a printf format in which a `#` of the text is doubled too (FMI 2.0, section 2.1.5). References
/// to variables, as in `#r1#`, stay as they are.
fn unescaped(format: &str) -> String {
    format.replace("%%", "%").replace("##", "#").trim_end().to_owned()
}

/// Receives a message. C passes further arguments behind `format`; they are not read.
unsafe extern "C" fn log_message(
    environment: *mut c_void,
    _instance: *const c_char,
    status: RawStatus,
    category: *const c_char,
    format: *const c_char,
) {
    if environment.is_null() {
        return;
    }
    // SAFETY: the environment is the `Log` boxed in the `Instance`, which lives until the FMU
    // instance is freed; the strings are C strings or null.
    let (log, category, mut text) = unsafe { (&*environment.cast::<Log>(), text(category), text(format)) };
    if text.len() > MAX_MESSAGE {
        let end = (0..=MAX_MESSAGE).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
        text.truncate(end);
    }
    let mut messages = log.messages.lock().unwrap_or_else(PoisonError::into_inner);
    if messages.len() == KEPT_MESSAGES {
        messages.pop_front();
    }
    messages.push_back(Message { status: Status::from(status), category, text: unescaped(&text) });
}

thread_local! {
    static MEMORY_CALLBACKS: Cell<usize> = const { Cell::new(0) };
}

/// Calls of `allocateMemory` and `freeMemory` by FMUs in this thread.
pub(crate) fn memory_callbacks() -> usize {
    MEMORY_CALLBACKS.get()
}

unsafe extern "C" fn allocate_memory(count: usize, size: usize) -> *mut c_void {
    MEMORY_CALLBACKS.set(MEMORY_CALLBACKS.get() + 1);
    // SAFETY: `calloc` has no conditions.
    unsafe { libc::calloc(count, size) }
}

unsafe extern "C" fn free_memory(memory: *mut c_void) {
    MEMORY_CALLBACKS.set(MEMORY_CALLBACKS.get() + 1);
    // SAFETY: FMI 2.0.4, section 2.1.5: the FMU passes what `allocateMemory` returned, or null.
    unsafe { libc::free(memory) }
}

/// A state saved with [`Instance::save_state`]; valid for the instance that made it.
#[derive(Debug)]
pub struct SavedState {
    /// Address of the log box, unique among living instances, tells whose state this is.
    owner: usize,
    slot: usize,
}

/// An instance for co-simulation, freed when dropped.
///
/// Methods are named after the C functions. Each returns an error for a status above
/// `fmi2Warning`, with what the instance logged. Setting and getting numbers and stepping do not
/// allocate unless they fail.
pub struct Instance {
    component: Component,
    // Where calls are announced, and as which component.
    board: Option<&'static Board>,
    index: u64,
    dead: bool,
    states: Vec<c_api::State>,
    name: CString,
    // The FMU keeps pointers to both boxes until it is freed.
    log: Box<Log>,
    _callbacks: Box<CallbackFunctions>,
    library: Arc<Library>,
}

impl Instance {
    /// `fmi2Instantiate` for co-simulation, invisible.
    ///
    /// `logging` asks the FMU to log more than errors.
    ///
    /// # Errors
    /// The FMU returns no instance, or a name holds a zero byte.
    pub fn instantiate(library: &Arc<Library>, name: &str, guid: &str, logging: bool) -> Result<Self, CallError> {
        let failed = |problem, messages| CallError {
            instance: name.to_string(),
            function: Function::Instantiate.name(),
            problem,
            messages,
        };
        let (Ok(c_name), Ok(c_guid)) = (CString::new(name), CString::new(guid)) else {
            return Err(failed(CallProblem::Arguments("the name or the GUID holds a zero byte"), Vec::new()));
        };
        let log = Box::new(Log::default());
        type Fixed = unsafe extern "C" fn(*mut c_void, *const c_char, RawStatus, *const c_char, *const c_char);
        let callbacks = Box::new(CallbackFunctions {
            // SAFETY: defining a variadic function is not stable in Rust. In the C calling
            // conventions of the supported platforms the named arguments of a variadic call stand
            // where those of an ordinary call stand, and the caller removes them, so a callee may
            // ignore the rest.
            logger: unsafe { std::mem::transmute::<Fixed, c_api::Logger>(log_message as Fixed) },
            allocate_memory,
            free_memory,
            step_finished: None,
            environment: ptr::from_ref::<Log>(&log).cast_mut().cast(),
        });
        let board = calls::board();
        let index = board.map_or(0, Board::current);
        if let Some(board) = board {
            board.enter(index, Function::Instantiate);
        }
        // SAFETY: all pointers are valid for the call; callbacks and log live as long as the
        // instance, in the struct below.
        let component = unsafe {
            (library.functions.instantiate)(
                c_name.as_ptr(),
                c_api::CO_SIMULATION,
                c_guid.as_ptr(),
                library.resources.as_ptr(),
                &raw const *callbacks,
                c_api::FALSE,
                c_api::Boolean::from(logging),
            )
        };
        if let Some(board) = board {
            board.leave();
        }
        if component.is_null() {
            return Err(failed(CallProblem::NoInstance, log.take()));
        }
        library.instances.fetch_add(1, Ordering::AcqRel);
        Ok(Self {
            component,
            board,
            index,
            dead: false,
            states: Vec::new(),
            name: c_name,
            log,
            _callbacks: callbacks,
            library: Arc::clone(library),
        })
    }

    /// Name given at instantiation.
    #[must_use]
    pub fn name(&self) -> &str {
        self.name.to_str().unwrap_or_default()
    }

    /// Messages logged since they were last taken; at most the latest 100.
    #[must_use]
    pub fn take_messages(&mut self) -> Vec<Message> {
        self.log.take()
    }

    #[cold]
    fn failure(&mut self, function: Function, problem: CallProblem) -> CallError {
        if problem == CallProblem::Status(Status::Fatal) {
            self.dead = true;
        }
        CallError { instance: self.name().to_string(), function: function.name(), problem, messages: self.log.take() }
    }

    fn enter(&self, function: Function) {
        if let Some(board) = self.board {
            board.enter(self.index, function);
        }
    }

    fn leave(&self) {
        if let Some(board) = self.board {
            board.leave();
        }
    }

    /// Calls the FMU unless it is dead, and checks the status.
    fn call(
        &mut self,
        function: Function,
        call: impl FnOnce(&Functions, Component) -> RawStatus,
    ) -> Result<(), CallError> {
        if self.dead {
            return Err(self.failure(function, CallProblem::Dead));
        }
        self.enter(function);
        let status = call(&self.library.functions, self.component);
        self.leave();
        match status {
            0 | 1 => Ok(()),
            status => Err(self.failure(function, CallProblem::Status(Status::from(status)))),
        }
    }

    /// As [`Self::call`] for a function the FMU may lack.
    fn call_optional<F: Copy>(
        &mut self,
        function: Function,
        select: impl FnOnce(&Functions) -> Option<F>,
        call: impl FnOnce(F, Component) -> RawStatus,
    ) -> Result<(), CallError> {
        match select(&self.library.functions) {
            Some(f) => self.call(function, |_, component| call(f, component)),
            None => Err(self.failure(function, CallProblem::NotExported)),
        }
    }

    fn same_length(&mut self, function: Function, references: usize, values: usize) -> Result<(), CallError> {
        if references == values {
            Ok(())
        } else {
            Err(self.failure(function, CallProblem::Arguments("the number of references and of values differ")))
        }
    }

    /// `fmi2SetDebugLogging` for the given categories; none: all.
    ///
    /// # Errors
    /// The FMU refuses, lacks the function, or a category holds a zero byte.
    pub fn set_debug_logging(&mut self, on: bool, categories: &[&str]) -> Result<(), CallError> {
        const NAME: Function = Function::SetDebugLogging;
        let (_owned, pointers) = self.c_strings(NAME, categories)?;
        self.call_optional(
            NAME,
            |f| f.set_debug_logging,
            // SAFETY: live instance; the array holds as many C strings as stated.
            |f, c| unsafe { f(c, c_api::Boolean::from(on), pointers.len(), pointers.as_ptr()) },
        )
    }

    /// `fmi2SetupExperiment` without a tolerance. Times in seconds.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn setup_experiment(&mut self, start: f64, stop: Option<f64>) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::SetupExperiment, |f, c| unsafe {
            (f.setup_experiment)(c, c_api::FALSE, 0.0, start, c_api::Boolean::from(stop.is_some()), stop.unwrap_or(0.0))
        })
    }

    /// `fmi2EnterInitializationMode`.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::EnterInitializationMode, |f, c| unsafe { (f.enter_initialization_mode)(c) })
    }

    /// `fmi2ExitInitializationMode`.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::ExitInitializationMode, |f, c| unsafe { (f.exit_initialization_mode)(c) })
    }

    /// `fmi2Terminate`.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn terminate(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::Terminate, |f, c| unsafe { (f.terminate)(c) })
    }

    /// `fmi2Reset`.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn reset(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::Reset, |f, c| unsafe { (f.reset)(c) })
    }

    /// `fmi2DoStep` from `time` over `step`, both in seconds; no earlier state will be restored.
    ///
    /// # Errors
    /// The FMU refuses, fails, or has not finished the step.
    pub fn do_step(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::DoStep, |f, c| unsafe { (f.do_step)(c, time, step, c_api::TRUE) })
    }

    /// `fmi2GetReal`.
    ///
    /// # Errors
    /// The lengths differ or the FMU refuses.
    pub fn get_real(&mut self, refs: &[Reference], values: &mut [f64]) -> Result<(), CallError> {
        self.same_length(Function::GetReal, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetReal, |f, c| unsafe { (f.get_real)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr()) })
    }

    /// `fmi2GetInteger`, also for enumerations.
    ///
    /// # Errors
    /// The lengths differ or the FMU refuses.
    pub fn get_integer(&mut self, refs: &[Reference], values: &mut [i32]) -> Result<(), CallError> {
        self.same_length(Function::GetInteger, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetInteger, |f, c| unsafe {
            (f.get_integer)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr())
        })
    }

    /// `fmi2GetBoolean`; 0 is false, all else true.
    ///
    /// # Errors
    /// The lengths differ or the FMU refuses.
    pub fn get_boolean(&mut self, refs: &[Reference], values: &mut [c_api::Boolean]) -> Result<(), CallError> {
        self.same_length(Function::GetBoolean, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetBoolean, |f, c| unsafe {
            (f.get_boolean)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr())
        })
    }

    /// `fmi2GetString`.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_string(&mut self, refs: &[Reference]) -> Result<Vec<String>, CallError> {
        let mut pointers = vec![ptr::null(); refs.len()];
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetString, |f, c| unsafe {
            (f.get_string)(c, refs.as_ptr(), refs.len(), pointers.as_mut_ptr())
        })?;
        // SAFETY: the FMU filled in C strings that stay valid until its next function is called.
        Ok(pointers.into_iter().map(|p| unsafe { text(p) }).collect())
    }

    /// `fmi2SetReal`.
    ///
    /// # Errors
    /// The lengths differ or the FMU refuses.
    pub fn set_real(&mut self, refs: &[Reference], values: &[f64]) -> Result<(), CallError> {
        self.same_length(Function::SetReal, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::SetReal, |f, c| unsafe { (f.set_real)(c, refs.as_ptr(), refs.len(), values.as_ptr()) })
    }

    /// `fmi2SetInteger`, also for enumerations.
    ///
    /// # Errors
    /// The lengths differ or the FMU refuses.
    pub fn set_integer(&mut self, refs: &[Reference], values: &[i32]) -> Result<(), CallError> {
        self.same_length(Function::SetInteger, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::SetInteger, |f, c| unsafe {
            (f.set_integer)(c, refs.as_ptr(), refs.len(), values.as_ptr())
        })
    }

    /// `fmi2SetBoolean`; values are 0 or 1.
    ///
    /// # Errors
    /// The lengths differ or the FMU refuses.
    pub fn set_boolean(&mut self, refs: &[Reference], values: &[c_api::Boolean]) -> Result<(), CallError> {
        self.same_length(Function::SetBoolean, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::SetBoolean, |f, c| unsafe {
            (f.set_boolean)(c, refs.as_ptr(), refs.len(), values.as_ptr())
        })
    }

    /// `fmi2SetString`.
    ///
    /// # Errors
    /// The lengths differ, a value holds a zero byte, or the FMU refuses.
    pub fn set_string(&mut self, refs: &[Reference], values: &[&str]) -> Result<(), CallError> {
        self.same_length(Function::SetString, refs.len(), values.len())?;
        let (_owned, pointers) = self.c_strings(Function::SetString, values)?;
        // SAFETY: live instance; both arrays have the stated length, the strings live on.
        self.call(Function::SetString, |f, c| unsafe {
            (f.set_string)(c, refs.as_ptr(), refs.len(), pointers.as_ptr())
        })
    }

    /// C strings and the pointers to them.
    fn c_strings(
        &mut self,
        function: Function,
        texts: &[&str],
    ) -> Result<(Vec<CString>, Vec<*const c_char>), CallError> {
        let owned: Result<Vec<CString>, _> = texts.iter().map(|t| CString::new(*t)).collect();
        match owned {
            Ok(owned) => {
                let pointers = owned.iter().map(|s| s.as_ptr()).collect();
                Ok((owned, pointers))
            }
            Err(_) => Err(self.failure(function, CallProblem::Arguments("a string holds a zero byte"))),
        }
    }

    /// `fmi2GetDirectionalDerivative`: `result` = d(unknowns)/d(knowns) * `seed`.
    ///
    /// # Errors
    /// The lengths differ, or the FMU refuses or lacks the function.
    pub fn get_directional_derivative(
        &mut self,
        unknowns: &[Reference],
        knowns: &[Reference],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetDirectionalDerivative;
        self.same_length(NAME, knowns.len(), seed.len())?;
        self.same_length(NAME, unknowns.len(), result.len())?;
        self.call_optional(
            NAME,
            |f| f.get_directional_derivative,
            // SAFETY: live instance; all arrays have the stated lengths.
            |f, c| unsafe {
                f(
                    c,
                    unknowns.as_ptr(),
                    unknowns.len(),
                    knowns.as_ptr(),
                    knowns.len(),
                    seed.as_ptr(),
                    result.as_mut_ptr(),
                )
            },
        )
    }

    /// `fmi2SetRealInputDerivatives`; an order per reference, from 1.
    ///
    /// # Errors
    /// The lengths differ, or the FMU refuses or lacks the function.
    pub fn set_real_input_derivatives(
        &mut self,
        refs: &[Reference],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::SetRealInputDerivatives;
        self.same_length(NAME, refs.len(), values.len())?;
        self.same_length(NAME, refs.len(), orders.len())?;
        self.call_optional(
            NAME,
            |f| f.set_real_input_derivatives,
            // SAFETY: live instance; all arrays have the stated length.
            |f, c| unsafe { f(c, refs.as_ptr(), refs.len(), orders.as_ptr(), values.as_ptr()) },
        )
    }

    /// `fmi2GetRealOutputDerivatives`; an order per reference, from 1.
    ///
    /// # Errors
    /// The lengths differ, or the FMU refuses or lacks the function.
    pub fn get_real_output_derivatives(
        &mut self,
        refs: &[Reference],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetRealOutputDerivatives;
        self.same_length(NAME, refs.len(), values.len())?;
        self.same_length(NAME, refs.len(), orders.len())?;
        self.call_optional(
            NAME,
            |f| f.get_real_output_derivatives,
            // SAFETY: live instance; all arrays have the stated length.
            |f, c| unsafe { f(c, refs.as_ptr(), refs.len(), orders.as_ptr(), values.as_mut_ptr()) },
        )
    }

    /// `fmi2CancelStep`.
    ///
    /// # Errors
    /// The FMU refuses or lacks the function.
    pub fn cancel_step(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_optional(Function::CancelStep, |f| f.cancel_step, |f, c| unsafe { f(c) })
    }

    /// `fmi2GetStatus(fmi2DoStepStatus)`: status of a pending step.
    ///
    /// # Errors
    /// The FMU has no answer or lacks the function.
    pub fn do_step_status(&mut self) -> Result<Status, CallError> {
        let mut value = 0;
        // SAFETY: live instance; the value is written through a valid pointer. 0: fmi2DoStepStatus.
        let get = |f: c_api::GetStatus<RawStatus>, c| unsafe { f(c, 0, &raw mut value) };
        self.call_optional(Function::GetStatus, |f| f.get_status, get)?;
        Ok(Status::from(value))
    }

    /// `fmi2GetRealStatus(fmi2LastSuccessfulTime)`: time reached, s.
    ///
    /// # Errors
    /// The FMU has no answer or lacks the function.
    pub fn last_successful_time(&mut self) -> Result<f64, CallError> {
        let mut value = 0.0;
        // SAFETY: as above. 2: fmi2LastSuccessfulTime.
        let get = |f: c_api::GetStatus<f64>, c| unsafe { f(c, 2, &raw mut value) };
        self.call_optional(Function::GetRealStatus, |f| f.get_real_status, get)?;
        Ok(value)
    }

    /// `fmi2GetIntegerStatus` for the number of a kind of `fmi2StatusKind`; no kind is standard.
    ///
    /// # Errors
    /// The FMU has no answer or lacks the function.
    pub fn integer_status(&mut self, kind: i32) -> Result<i32, CallError> {
        let mut value = 0;
        // SAFETY: as above.
        let get = |f: c_api::GetStatus<i32>, c| unsafe { f(c, kind, &raw mut value) };
        self.call_optional(Function::GetIntegerStatus, |f| f.get_integer_status, get)?;
        Ok(value)
    }

    /// `fmi2GetBooleanStatus(fmi2Terminated)`: the FMU wants the simulation to end.
    ///
    /// # Errors
    /// The FMU has no answer or lacks the function.
    pub fn wants_termination(&mut self) -> Result<bool, CallError> {
        let mut value = 0;
        // SAFETY: as above. 3: fmi2Terminated.
        let get = |f: c_api::GetStatus<c_api::Boolean>, c| unsafe { f(c, 3, &raw mut value) };
        self.call_optional(Function::GetBooleanStatus, |f| f.get_boolean_status, get)?;
        Ok(value != 0)
    }

    /// `fmi2GetStringStatus(fmi2PendingStatus)`: what a pending step is doing.
    ///
    /// # Errors
    /// The FMU has no answer or lacks the function.
    pub fn pending_status(&mut self) -> Result<String, CallError> {
        let mut value = ptr::null();
        // SAFETY: as above. 1: fmi2PendingStatus.
        let get = |f: c_api::GetStatus<*const c_char>, c| unsafe { f(c, 1, &raw mut value) };
        self.call_optional(Function::GetStringStatus, |f| f.get_string_status, get)?;
        // SAFETY: a C string of the FMU, valid until its next function is called.
        Ok(unsafe { text(value) })
    }

    fn owner(&self) -> usize {
        ptr::from_ref::<Log>(&self.log).addr()
    }

    /// The pointer behind a saved state of this instance.
    fn state(&mut self, function: Function, saved: &SavedState) -> Result<c_api::State, CallError> {
        if saved.owner == self.owner()
            && let Some(state) = self.states.get(saved.slot)
        {
            return Ok(*state);
        }
        Err(self.failure(function, CallProblem::Arguments("the state was saved by another instance")))
    }

    fn keep(&mut self, state: c_api::State) -> SavedState {
        let owner = self.owner();
        self.states.push(state);
        SavedState { owner, slot: self.states.len() - 1 }
    }

    /// `fmi2GetFMUstate`. The state lives until [`Self::free_state`] or the end of the instance.
    ///
    /// # Errors
    /// The FMU refuses or lacks the function.
    pub fn save_state(&mut self) -> Result<SavedState, CallError> {
        let mut state = ptr::null_mut();
        self.call_optional(
            Function::GetFMUstate,
            |f| f.get_state,
            // SAFETY: live instance; a null state asks for a new one.
            |f, c| unsafe { f(c, &raw mut state) },
        )?;
        Ok(self.keep(state))
    }

    /// `fmi2GetFMUstate` into a state saved before.
    ///
    /// # Errors
    /// The state is of another instance, or the FMU refuses or lacks the function.
    pub fn save_state_again(&mut self, saved: &SavedState) -> Result<(), CallError> {
        const NAME: Function = Function::GetFMUstate;
        let mut state = self.state(NAME, saved)?;
        // SAFETY: live instance; the state is null or one that this instance returned.
        let get = |f: c_api::AccessState, c| unsafe { f(c, &raw mut state) };
        let result = self.call_optional(NAME, |f| f.get_state, get);
        // The FMU may have replaced the pointer, even where it failed.
        self.states[saved.slot] = state;
        result
    }

    /// `fmi2SetFMUstate`.
    ///
    /// # Errors
    /// The state is of another instance, or the FMU refuses or lacks the function.
    pub fn restore_state(&mut self, saved: &SavedState) -> Result<(), CallError> {
        const NAME: Function = Function::SetFMUstate;
        let state = self.state(NAME, saved)?;
        self.call_optional(
            NAME,
            |f| f.set_state,
            // SAFETY: live instance; the state is one that this instance returned.
            |f, c| unsafe { f(c, state) },
        )
    }

    /// `fmi2FreeFMUstate`.
    ///
    /// # Errors
    /// The state is of another instance, or the FMU refuses or lacks the function.
    pub fn free_state(&mut self, saved: SavedState) -> Result<(), CallError> {
        const NAME: Function = Function::FreeFMUstate;
        let mut state = self.state(NAME, &saved)?;
        // SAFETY: live instance; the state is null or one that this instance returned.
        let free = |f: c_api::AccessState, c| unsafe { f(c, &raw mut state) };
        self.call_optional(NAME, |f| f.free_state, free)?;
        // The slot stays, so that other states keep theirs; null is freed as nothing.
        self.states[saved.slot] = ptr::null_mut();
        Ok(())
    }

    /// `fmi2SerializeFMUstate`: the bytes of a saved state.
    ///
    /// # Errors
    /// The state is of another instance, or the FMU refuses or lacks the functions.
    pub fn serialize_state(&mut self, saved: &SavedState) -> Result<Vec<u8>, CallError> {
        const NAME: Function = Function::SerializeFMUstate;
        let state = self.state(NAME, saved)?;
        let mut size = 0;
        self.call_optional(
            Function::SerializedFMUstateSize,
            |f| f.serialized_state_size,
            // SAFETY: live instance and state; the size is written through a valid pointer.
            |f, c| unsafe { f(c, state, &raw mut size) },
        )?;
        let mut bytes = vec![0_u8; size];
        self.call_optional(
            NAME,
            |f| f.serialize_state,
            // SAFETY: live instance and state; the buffer has the size that the FMU asked for.
            |f, c| unsafe { f(c, state, bytes.as_mut_ptr().cast(), size) },
        )?;
        Ok(bytes)
    }

    /// `fmi2DeSerializeFMUstate`: a saved state from its bytes.
    ///
    /// # Errors
    /// The FMU refuses the bytes or lacks the function.
    pub fn deserialize_state(&mut self, bytes: &[u8]) -> Result<SavedState, CallError> {
        let mut state = ptr::null_mut();
        self.call_optional(
            Function::DeSerializeFMUstate,
            |f| f.deserialize_state,
            // SAFETY: live instance; the bytes have the stated length; null asks for a new state.
            |f, c| unsafe { f(c, bytes.as_ptr().cast(), bytes.len(), &raw mut state) },
        )?;
        Ok(self.keep(state))
    }
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance").field("name", &self.name).field("dead", &self.dead).finish_non_exhaustive()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // After fmi2Fatal no function may be called, not even to free.
        if !self.dead {
            if let Some(free) = self.library.functions.free_state {
                self.enter(Function::FreeFMUstate);
                for state in &mut self.states {
                    if !state.is_null() {
                        // SAFETY: live instance; the state is one that it returned. Nothing can be
                        // done about a failure here.
                        unsafe { free(self.component, &raw mut *state) };
                    }
                }
            }
            self.enter(Function::FreeInstance);
            // SAFETY: the instance is freed once, here.
            unsafe { (self.library.functions.free_instance)(self.component) };
            self.leave();
        }
        self.library.instances.fetch_sub(1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resource_uri_is_encoded() {
        let uri = file_uri(std::path::Path::new("/a b%ü/resources"));
        assert_eq!(uri.to_str().unwrap(), "file:///a%20b%25%C3%BC/resources");
    }

    #[test]
    fn messages_are_kept_with_escaped_signs_halved() {
        let log = Log::default();
        let environment = ptr::from_ref(&log).cast_mut().cast();
        for i in 0..KEPT_MESSAGES + 5 {
            let format = CString::new(format!("{i}: 5 %% of ##x\n")).unwrap();
            // SAFETY: a log and C strings that outlive the call, as the callback expects.
            unsafe { log_message(environment, ptr::null(), 3, ptr::null(), format.as_ptr()) };
        }
        let messages = log.take();
        assert_eq!(messages.len(), KEPT_MESSAGES);
        assert_eq!(messages[0].text, "5: 5 % of #x", "the oldest are dropped");
        assert_eq!(messages[0].status, Status::Error);
    }
}
