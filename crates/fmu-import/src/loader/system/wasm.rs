//! Host functions of a loader that is WebAssembly itself: modules of FMUs.
//!
//! Each module has a memory of its own. The host (`web/lab/src/engine`) makes an instance of it and appends functions with the
//! signatures of FMI to the table of this program, which copy arguments and results between the memories. The address of a
//! function is its index in that table, so the rest of the loader does not know the difference. An FMU gets memory and a logger from the
//! host, too: those of this program have no meaning in its memory.

use std::ffi::c_void;
use std::mem::transmute_copy;
use std::path::Path;
use std::ptr;

#[link(wasm_import_module = "host")]
unsafe extern "C" {
    /// Makes an instance of the module of that name. 0: there is none.
    fn open_library(name: *const u8, length: usize) -> usize;
    /// Index of a function in the table. 0: the module does not export it, or no importer calls it.
    fn find_function(library: usize, name: *const u8, length: usize) -> usize;
    fn close_library(library: usize);
}

/// An instance of a module.
pub(super) struct Library(usize);

impl Drop for Library {
    fn drop(&mut self) {
        // SAFETY: the host has opened it, and it is closed once.
        unsafe { close_library(self.0) };
    }
}

fn function(library: &Library, name: &str) -> usize {
    // SAFETY: the host reads the name and keeps nothing.
    unsafe { find_function(library.0, name.as_ptr(), name.len()) }
}

pub(super) fn open(path: &Path) -> Result<Library, String> {
    let name = path.to_string_lossy();
    // SAFETY: the host reads the name and keeps nothing.
    match unsafe { open_library(name.as_ptr(), name.len()) } {
        0 => Err("its module was not added, or cannot be instantiated".to_owned()),
        library => Ok(Library(library)),
    }
}

/// A function of a module.
///
/// # Safety
/// `T` is the type of a function with the signature that the host uses, and the library outlives it.
pub(super) unsafe fn symbol<T: Copy>(library: &Library, name: &str) -> Option<T> {
    const { assert!(size_of::<T>() == size_of::<usize>()) };
    match function(library, name) {
        0 => None,
        // SAFETY: pointers of functions are indices in the table; the rest is promised by the caller.
        index => Some(unsafe { transmute_copy(&index) }),
    }
}

/// Returns true if a module exports a function that an importer calls.
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

/// FMUs get their memory from the host.
pub(super) fn allocate(_count: usize, _size: usize) -> *mut c_void {
    ptr::null_mut()
}

/// FMUs give their memory back to the host.
///
/// # Safety
/// None; as on other platforms.
pub(super) unsafe fn free(_memory: *mut c_void) {}
