//! Callbacks for FMUs: logger and memory.

use super::error::{Message, Status};
use super::strings::text;
use super::system;
use crate::c_api::{self, RawStatus};
use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{c_char, c_void};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of messages that are kept for an instance. Older messages are dropped.
const KEPT_MESSAGES: usize = 100;
/// Maximum length of a message, bytes.
const MAX_MESSAGE: usize = 10_000;

pub(super) struct Log {
    instance: String,
    // FMUs may log from their own threads.
    messages: Mutex<VecDeque<Message>>,
}

/// The logs of all living instances. FMUs get the address of their log as the environment.
static LOGS: Mutex<Vec<Arc<Log>>> = Mutex::new(Vec::new());

thread_local! {
    static STRAY_MESSAGES: Cell<usize> = const { Cell::new(0) };
}

/// Number of messages in this thread with an environment that does not belong to a living instance.
pub fn stray_messages() -> usize {
    STRAY_MESSAGES.get()
}

/// A log to which an FMU can write until the log is dropped.
pub(super) struct OpenLog(Arc<Log>);

impl OpenLog {
    pub(super) fn new(instance: &str) -> Self {
        let log = Arc::new(Log { instance: instance.to_owned(), messages: Mutex::default() });
        LOGS.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::clone(&log));
        Self(log)
    }

    /// The environment for the FMU, unique among living instances.
    pub(super) fn environment(&self) -> *mut c_void {
        Arc::as_ptr(&self.0).cast_mut().cast()
    }

    pub(super) fn warn(&self, text: String) {
        self.0.push(Message { status: Status::Warning, category: "importer".to_owned(), text });
    }

    pub(super) fn take(&self) -> Vec<Message> {
        let mut messages = self.0.messages.lock().unwrap_or_else(PoisonError::into_inner);
        messages.drain(..).collect()
    }
}

impl Drop for OpenLog {
    fn drop(&mut self) {
        LOGS.lock().unwrap_or_else(PoisonError::into_inner).retain(|log| !Arc::ptr_eq(log, &self.0));
    }
}

impl Log {
    fn push(&self, message: Message) {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == KEPT_MESSAGES {
            messages.pop_front();
        }
        messages.push_back(message);
    }
}

/// Adds a message to the log to which the pointer `environment` belongs. The pointer is never dereferenced, because
/// some FMUs pass a wrong one. A message with a wrong pointer is added to the log of the only instance, or of the only
/// instance with the name in the message; otherwise it is printed.
fn keep(environment: *mut c_void, instance: &str, status: RawStatus, category: String, mut text: String) {
    if text.len() > MAX_MESSAGE {
        let end = (0..=MAX_MESSAGE).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
        text.truncate(end);
    }
    text.truncate(text.trim_end().len());
    let logs = LOGS.lock().unwrap_or_else(PoisonError::into_inner);
    let own = logs.iter().find(|log| Arc::as_ptr(log).addr() == environment.addr());
    let log = own.or_else(|| {
        STRAY_MESSAGES.set(STRAY_MESSAGES.get() + 1);
        let mut of_name = logs.iter().filter(|log| logs.len() == 1 || log.instance == instance);
        of_name.next().filter(|_| of_name.next().is_none())
    });
    match log {
        Some(log) => log.push(Message { status: Status::from(status), category, text }),
        None => eprintln!("{text}"),
    }
}

#[cfg(log_arguments)]
unsafe extern "C" {
    fn fmu_import_logger(
        environment: *mut c_void,
        instance: *const c_char,
        status: RawStatus,
        category: *const c_char,
        format: *const c_char,
        ...
    );
}

/// Receives a formatted message, in which `##` means `#` (FMI 2.0.4, section 2.1.5). `#r1#` is not replaced.
#[cfg(log_arguments)]
#[unsafe(no_mangle)]
unsafe extern "C" fn fmu_import_message(
    environment: *mut c_void,
    instance: *const c_char,
    status: RawStatus,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the strings are C strings or null.
    let [instance, category, message] = [instance, category, message].map(|string| unsafe { text(string) });
    keep(environment, &instance, status, category, message.replace("##", "#"));
}

/// Receives a message without the arguments of its format.
#[cfg(not(log_arguments))]
unsafe extern "C" fn log_format(
    environment: *mut c_void,
    instance: *const c_char,
    status: RawStatus,
    category: *const c_char,
    format: *const c_char,
) {
    // SAFETY: the strings are C strings or null.
    let [instance, category, format] = [instance, category, format].map(|string| unsafe { text(string) });
    keep(environment, &instance, status, category, format.replace("%%", "%").replace("##", "#"));
}

pub(super) fn logger() -> c_api::Logger {
    #[cfg(log_arguments)]
    return fmu_import_logger;
    #[cfg(not(log_arguments))]
    {
        type Fixed = unsafe extern "C" fn(*mut c_void, *const c_char, RawStatus, *const c_char, *const c_char);
        // SAFETY: in the C calling conventions of the supported platforms, named arguments of a variadic call are
        // passed as in an ordinary call, and the caller removes all arguments, so the callee can ignore the others.
        return unsafe { std::mem::transmute::<Fixed, c_api::Logger>(log_format as Fixed) };
    }
}

/// Receives an FMI 3.0 message, whose text is not a format.
pub(super) unsafe extern "C" fn log_text(
    environment: *mut c_void,
    status: RawStatus,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the strings are C strings or null.
    let [category, message] = [category, message].map(|string| unsafe { text(string) });
    keep(environment, "", status, category, message);
}

thread_local! {
    static MEMORY_CALLBACKS: Cell<usize> = const { Cell::new(0) };
}

/// Number of calls to `allocateMemory` and `freeMemory` by FMUs in this thread.
pub fn memory_callbacks() -> usize {
    MEMORY_CALLBACKS.get()
}

pub(super) unsafe extern "C" fn allocate_memory(count: usize, size: usize) -> *mut c_void {
    MEMORY_CALLBACKS.set(MEMORY_CALLBACKS.get() + 1);
    system::allocate(count, size)
}

pub(super) unsafe extern "C" fn free_memory(memory: *mut c_void) {
    MEMORY_CALLBACKS.set(MEMORY_CALLBACKS.get() + 1);
    // SAFETY: FMI 2.0.4, section 2.1.5: the FMU passes what `allocateMemory` returned, or null.
    unsafe { system::free(memory) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CString;
    use std::ptr;

    #[test]
    fn messages_are_kept_with_escaped_signs_halved() {
        let log = OpenLog::new("one");
        let environment = log.environment();
        for i in 0..KEPT_MESSAGES + 5 {
            let format = CString::new(format!("{i}: 5 %% of ##x\n")).unwrap();
            // SAFETY: C strings that outlive the call, and no arguments, because the format needs none.
            unsafe { logger()(environment, ptr::null(), 3, ptr::null(), format.as_ptr()) };
        }
        let messages = log.take();
        assert_eq!(messages.len(), KEPT_MESSAGES);
        assert_eq!(messages[0].text, "5: 5 % of #x", "the oldest are dropped");
        assert_eq!(messages[0].status, Status::Error);
        let text = CString::new("100 %% of ##x\n").unwrap();
        // SAFETY: as above.
        unsafe { log_text(environment, 1, ptr::null(), text.as_ptr()) };
        assert_eq!(log.take()[0].text, "100 %% of ##x", "FMI 3.0 escapes nothing");
    }

    /// As with `printf` in C. Text that is not a valid conversion is kept unchanged, and so is everything after it.
    #[cfg(log_arguments)]
    #[test]
    fn arguments_take_the_place_of_conversions() {
        let log = OpenLog::new("one");
        macro_rules! logged {
            ($format:literal $(, $argument:expr)*) => {{
                // SAFETY: C strings, and the arguments that the format needs.
                unsafe { logger()(log.environment(), c"one".as_ptr(), 0, ptr::null(), $format.as_ptr() $(, $argument)*) };
                log.take().remove(0).text
            }};
        }
        assert_eq!(
            logged!(c"it broke at %g with %d of %s", 0.49, 7, c"nine".as_ptr()),
            "it broke at 0.49 with 7 of nine"
        );
        assert_eq!(logged!(c"%5.1f|%-4d|%04x|%+.2e|%c|%u", 2.26, 3, 255, 0.5, 65, 9), "  2.3|3   |00ff|+5.00e-01|A|9");
        assert_eq!(
            logged!(c"%lld %ld %zu %hhd", i64::MIN, std::ffi::c_long::MAX, usize::MAX, 300),
            format!("{} {} {} 44", i64::MIN, std::ffi::c_long::MAX, usize::MAX)
        );
        assert_eq!(logged!(c"%.*s %*d", 2, c"abc".as_ptr(), 4, 1), "ab    1");
        assert_eq!(logged!(c"%s", ptr::null::<c_char>()), "(null)");
        assert_eq!(logged!(c"50%% and %n %d", ptr::null::<c_char>(), 1), "50% and %n %d", "nothing is written");
        assert_eq!(logged!(c"90% sure", 90), "90% sure", "text that is not meant as a format");
        if cfg!(target_os = "linux") {
            let unmapped = ptr::without_provenance::<c_char>(0x1234_5678_9000);
            assert_eq!(logged!(c"CPU at 100%sec", unmapped), "CPU at 100%sec", "no page of the program");
            assert_eq!(logged!(c"%.0s!", unmapped), "!", "nothing is read");
        }
        assert_eq!(logged!(c"ends with %"), "ends with %");
        let long = CString::new("x".repeat(MAX_MESSAGE)).unwrap();
        assert_eq!(logged!(c"%s%s", long.as_ptr(), long.as_ptr()).len(), MAX_MESSAGE);
    }
}
