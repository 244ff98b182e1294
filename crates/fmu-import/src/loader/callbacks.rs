//! The functions that an FMU may call: the logger and its memory.

use super::error::{Message, Status};
use super::strings::text;
use super::system;
use crate::c_api::RawStatus;
use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{c_char, c_void};
use std::sync::{Mutex, PoisonError};

/// Messages kept per instance; older ones are dropped.
const KEPT_MESSAGES: usize = 100;
/// Longest message that is kept, bytes.
const MAX_MESSAGE: usize = 10_000;

/// Messages of one instance, collected by the logger callback.
#[derive(Default)]
pub(super) struct Log {
    // FMUs may log from threads of their own.
    messages: Mutex<VecDeque<Message>>,
}

impl Log {
    pub(super) fn take(&self) -> Vec<Message> {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        messages.drain(..).collect()
    }

    fn push(&self, status: RawStatus, category: String, mut text: String, read: impl Fn(&str) -> String) {
        if text.len() > MAX_MESSAGE {
            let end = (0..=MAX_MESSAGE).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
            text.truncate(end);
        }
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == KEPT_MESSAGES {
            messages.pop_front();
        }
        messages.push_back(Message { status: Status::from(status), category, text: read(&text) });
    }
}

/// The text of a message: a printf format in which a `#` of the text is doubled too (FMI 2.0, section 2.1.5). References
/// to variables, as in `#r1#`, stay as they are.
fn unescaped(format: &str) -> String {
    format.replace("%%", "%").replace("##", "#").trim_end().to_owned()
}

/// Receives a message. C passes further arguments behind `format`; they are not read.
pub(super) unsafe extern "C" fn log_message(
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
    let (log, category, text) = unsafe { (&*environment.cast::<Log>(), text(category), text(format)) };
    log.push(status, category, text, unescaped);
}

/// Receives a message of FMI 3.0, whose text is not a format.
pub(super) unsafe extern "C" fn log_text(
    environment: *mut c_void,
    status: RawStatus,
    category: *const c_char,
    message: *const c_char,
) {
    if environment.is_null() {
        return;
    }
    // SAFETY: as above.
    let (log, category, text) = unsafe { (&*environment.cast::<Log>(), text(category), text(message)) };
    log.push(status, category, text, |text| text.trim_end().to_owned());
}

thread_local! {
    static MEMORY_CALLBACKS: Cell<usize> = const { Cell::new(0) };
}

/// Calls of `allocateMemory` and `freeMemory` by FMUs in this thread.
pub(crate) fn memory_callbacks() -> usize {
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
        let text = CString::new("100 %% of ##x\n").unwrap();
        // SAFETY: as above.
        unsafe { log_text(environment, 1, ptr::null(), text.as_ptr()) };
        assert_eq!(log.take()[0].text, "100 %% of ##x", "FMI 3.0 escapes nothing");
    }
}
