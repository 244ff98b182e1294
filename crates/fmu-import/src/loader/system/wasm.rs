//! Replaces the operating system if this crate is compiled to WebAssembly and each FMU is a WebAssembly module.
//!
//! Each module has a separate memory. The host (`web/lab/src/engine`) instantiates the module and appends functions
//! with FMI signatures to the function table of this program; they copy arguments and results between the memories. The
//! address of a function is its index in the table, so the other loader code needs no changes. Memory and logger
//! callbacks of an FMU also come from the host, because addresses in this program are not valid in the module's memory.

use std::ffi::c_void;
use std::mem::transmute_copy;
use std::path::Path;
use std::ptr;

#[link(wasm_import_module = "host")]
unsafe extern "C" {
    /// Instantiates the module with this name. Returns 0 if there is none.
    fn open_library(name: *const u8, length: usize) -> usize;
    /// Index of a function in the table. Returns 0 if the module does not export it, or if importers never call it.
    fn find_function(library: usize, name: *const u8, length: usize) -> usize;
    fn close_library(library: usize);
}

pub(super) struct Library(usize);

impl Drop for Library {
    fn drop(&mut self) {
        // SAFETY: the host opened the library; it is closed once.
        unsafe { close_library(self.0) };
    }
}

fn function(library: &Library, name: &str) -> usize {
    // SAFETY: the host only reads the name.
    unsafe { find_function(library.0, name.as_ptr(), name.len()) }
}

pub(super) fn open(path: &Path) -> Result<Library, String> {
    let name = path.to_string_lossy();
    // SAFETY: the host only reads the name.
    match unsafe { open_library(name.as_ptr(), name.len()) } {
        0 => Err("the FMU's module is missing or cannot be instantiated".to_owned()),
        library => Ok(Library(library)),
    }
}

/// A function of a module.
///
/// # Safety
/// `T` must be a function type with the host's signature, and the library must outlive the function.
pub(super) unsafe fn symbol<T: Copy>(library: &Library, name: &str) -> Option<T> {
    const { assert!(size_of::<T>() == size_of::<usize>()) };
    match function(library, name) {
        0 => None,
        // SAFETY: function pointers are indices in the table; the signature is promised by the caller.
        index => Some(unsafe { transmute_copy(&index) }),
    }
}

/// Returns true if a module exports a function and importers call it.
pub(super) fn exports(library: &Library, name: &str) -> bool {
    function(library, name) != 0
}

pub(super) fn has_symbol(library: Option<&Library>, symbol: &str) -> bool {
    library.is_some_and(|library| exports(library, symbol))
}

/// A module has no streams.
pub fn flush_prints() {}

/// A module has no locale.
pub fn locale() -> String {
    String::new()
}

/// Not called: FMUs get their memory from the host.
pub(super) fn allocate(_count: usize, _size: usize) -> *mut c_void {
    ptr::null_mut()
}

/// Not called: FMUs free their memory through the host.
///
/// # Safety
/// There are no conditions; the function is unsafe only because it is unsafe on other platforms.
pub(super) unsafe fn free(_memory: *mut c_void) {}
