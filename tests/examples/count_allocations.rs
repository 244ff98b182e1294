//! Counts the allocations in a process. This library is loaded with `LD_PRELOAD` by the tests that check that a step
//! does not allocate.
//!
//! A Rust allocator in the test's program would not see the allocations of a loaded FMU, which contains its own copy of
//! the Rust runtime. All copies eventually call the C functions below.
#![cfg(all(target_os = "linux", target_env = "gnu"))]
#![allow(unsafe_code, reason = "stands in for functions of the C library")]
#![expect(clippy::missing_safety_doc, reason = "the functions are those of the C library")]

use libc::{c_int, c_void, size_t};
use std::sync::atomic::{AtomicU64, Ordering};

static COUNT: AtomicU64 = AtomicU64::new(0);

// The internal names in the C library, which avoid a symbol lookup that might allocate.
unsafe extern "C" {
    fn __libc_malloc(size: size_t) -> *mut c_void;
    fn __libc_calloc(count: size_t, size: size_t) -> *mut c_void;
    fn __libc_realloc(pointer: *mut c_void, size: size_t) -> *mut c_void;
    fn __libc_memalign(alignment: size_t, size: size_t) -> *mut c_void;
}

fn count() {
    COUNT.fetch_add(1, Ordering::Relaxed);
}

/// Allocations so far.
#[unsafe(no_mangle)]
pub extern "C" fn counted_allocations() -> u64 {
    COUNT.load(Ordering::Relaxed)
}

/// Counts the call, and calls malloc of the C library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn malloc(size: size_t) -> *mut c_void {
    count();
    // SAFETY: the same function under another name, here and below.
    unsafe { __libc_malloc(size) }
}

/// Counts the call, and calls calloc of the C library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calloc(number: size_t, size: size_t) -> *mut c_void {
    count();
    unsafe { __libc_calloc(number, size) }
}

/// Counts the call, and calls realloc of the C library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn realloc(pointer: *mut c_void, size: size_t) -> *mut c_void {
    count();
    unsafe { __libc_realloc(pointer, size) }
}

/// Counts the call, and calls aligned_alloc of the C library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn aligned_alloc(alignment: size_t, size: size_t) -> *mut c_void {
    count();
    unsafe { __libc_memalign(alignment, size) }
}

/// Counts the call, and does what posix_memalign does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn posix_memalign(target: *mut *mut c_void, alignment: size_t, size: size_t) -> c_int {
    count();
    if !alignment.is_power_of_two() || !alignment.is_multiple_of(size_of::<*mut c_void>()) {
        return libc::EINVAL;
    }
    // SAFETY: as above; the caller's pointer is valid.
    unsafe {
        let pointer = __libc_memalign(alignment, size);
        if pointer.is_null() {
            return libc::ENOMEM;
        }
        *target = pointer;
    }
    0
}
