//! The functions that the worker calls.
//!
//! Texts and bytes pass through memory that the worker requests ([`lab_allocate`]) or that stays here until the next
//! request ([`lab_response`], [`lab_body`]). All code but this module is safe.

#![allow(unsafe_code)]

use crate::Lab;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// State shared by all functions: the worker has one thread.
#[derive(Default)]
struct State {
    lab: Lab,
    response: Vec<u8>,
    body: Vec<u8>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
    static PANIC: RefCell<String> = RefCell::default();
}

/// Calls `work` with the state; returns `otherwise` if it panics.
fn with<T>(otherwise: T, work: impl FnOnce(&mut State) -> T) -> T {
    let caught = catch_unwind(AssertUnwindSafe(|| STATE.with_borrow_mut(work)));
    caught.unwrap_or(otherwise)
}

#[cfg(target_family = "wasm")]
#[link(wasm_import_module = "host")]
unsafe extern "C" {
    /// Size of the module of an FMU; copies it if `to` is not null.
    fn read_module(name: *const u8, length: usize, to: *mut u8) -> usize;
}

/// The module of an FMU, which the worker keeps.
#[cfg(target_family = "wasm")]
pub(crate) fn module(fmu: &str) -> Vec<u8> {
    // SAFETY: the worker reads the name, and writes as many bytes as it has reported.
    unsafe {
        let mut bytes = vec![0; read_module(fmu.as_ptr(), fmu.len(), std::ptr::null_mut())];
        read_module(fmu.as_ptr(), fmu.len(), bytes.as_mut_ptr());
        bytes
    }
}

/// Outside of WebAssembly there is no worker.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn module(_fmu: &str) -> Vec<u8> {
    Vec::new()
}

/// Memory for a request.
#[unsafe(no_mangle)]
pub extern "C" fn lab_allocate(size: usize) -> *mut u8 {
    Box::into_raw(vec![0_u8; size].into_boxed_slice()).cast()
}

/// Frees memory from [`lab_allocate`].
///
/// # Safety
/// The memory is from [`lab_allocate`], with this size, and is freed once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lab_free(memory: *mut u8, size: usize) {
    // SAFETY: promised by the caller.
    drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(memory, size)) });
}

/// Answers a request. Returns the length of the response. The number is negative if the response is a failure.
///
/// # Safety
/// Each pointer must point to the stated number of bytes, and nothing else may change these bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lab_request(text: *const u8, length: usize, body: *const u8, size: usize) -> isize {
    // SAFETY: promised by the caller.
    let (text, body) = unsafe { (std::slice::from_raw_parts(text, length), std::slice::from_raw_parts(body, size)) };
    std::panic::set_hook(Box::new(|panic| PANIC.set(panic.to_string())));
    let answer = catch_unwind(AssertUnwindSafe(|| {
        STATE.with_borrow_mut(|state| {
            let (response, body) = state.lab.respond(text, body);
            state.body = body;
            let (text, sign) = match response {
                Ok(text) => (text, 1),
                Err(failure) => (serde_json::to_string(&failure).unwrap_or_default(), -1),
            };
            state.response = text.into_bytes();
            sign * state.response.len().cast_signed()
        })
    }));
    answer.unwrap_or_else(|_| {
        let message = format!("the lab has panicked: {}", PANIC.take());
        with(0, |state| {
            state.response = serde_json::json!({ "message": message, "help": "" }).to_string().into_bytes();
            -state.response.len().cast_signed()
        })
    })
}

/// Returns a pointer to the response.
#[unsafe(no_mangle)]
pub extern "C" fn lab_response() -> *const u8 {
    with(std::ptr::null(), |state| state.response.as_ptr())
}

/// Returns a pointer to the body of the response.
#[unsafe(no_mangle)]
pub extern "C" fn lab_body() -> *const u8 {
    with(std::ptr::null(), |state| state.body.as_ptr())
}

/// Length of the body of the response.
#[unsafe(no_mangle)]
pub extern "C" fn lab_body_size() -> usize {
    with(0, |state| state.body.len())
}

/// Advances a system by at most `steps` steps. Returns the number of steps that were made, which is smaller at the end
/// of the run, or -1 if the system fails or has failed before.
#[unsafe(no_mangle)]
pub extern "C" fn lab_advance(system: usize, steps: u32) -> i32 {
    let caught = catch_unwind(AssertUnwindSafe(|| STATE.with_borrow_mut(|state| state.lab.advance(system, steps))));
    caught.unwrap_or_else(|_| {
        let message = PANIC.take();
        with((), |state| state.lab.fail(system, &message));
        -1
    })
}

/// Time of a system, s.
#[unsafe(no_mangle)]
pub extern "C" fn lab_time(system: usize) -> f64 {
    with(f64::NAN, |state| state.lab.time(system))
}

/// Number of new rows of a system.
#[unsafe(no_mangle)]
pub extern "C" fn lab_rows(system: usize) -> usize {
    with(0, |state| state.lab.rows(system).0)
}

/// Returns a pointer to the new rows: doubles, row by row.
#[unsafe(no_mangle)]
pub extern "C" fn lab_rows_data(system: usize) -> *const f64 {
    with(std::ptr::null(), |state| state.lab.rows(system).1.as_ptr())
}

/// Discards the new rows, after the worker has read them.
#[unsafe(no_mangle)]
pub extern "C" fn lab_rows_read(system: usize) {
    with((), |state| state.lab.rows_read(system));
}

/// Makes the failure of a system the response: component, message and time. Returns its length.
#[unsafe(no_mangle)]
pub extern "C" fn lab_failure(system: usize) -> usize {
    with(0, |state| {
        state.response = state.lab.failure(system).into_bytes();
        state.response.len()
    })
}
