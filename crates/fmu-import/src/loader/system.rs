//! Functions of the operating system and the C library: dynamic loading, memory, streams, locale.

use std::ffi::c_void;
use std::path::Path;
use std::ptr;

pub(super) use libloading::Library;

/// Loads a library. On Windows, dependencies in the library's folder are found only with a flag; on other systems, the
/// library contains their search path.
pub(super) fn open(path: &Path) -> Result<Library, String> {
    #[cfg(windows)]
    let opened = {
        use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
        // SAFETY: loading runs the library's initializers, which must be trusted, see `crate::loader`.
        unsafe { Library::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }.map(Into::into)
    };
    #[cfg(not(windows))]
    // SAFETY: as above.
    let opened = unsafe { Library::new(path) };
    opened.map_err(|error| reason(&error))
}

/// A function of a library.
///
/// # Safety
/// The function must have the type `T`, and the library must outlive it.
pub(super) unsafe fn symbol<T: Copy>(library: &Library, name: &str) -> Option<T> {
    // SAFETY: promised by the caller.
    unsafe { library.get::<T>(name) }.ok().map(|symbol| *symbol)
}

pub(super) fn exports(library: &Library, name: &str) -> bool {
    // SAFETY: the symbol is only looked up, not used.
    unsafe { library.get::<*const c_void>(name) }.is_ok()
}

/// Returns true if the library, its dependencies or this program export a symbol.
pub(super) fn has_symbol(library: Option<&Library>, symbol: &str) -> bool {
    let found = library.is_some_and(|library| exports(library, symbol));
    #[cfg(unix)]
    // SAFETY: the symbol is only looked up, not used.
    let found = found || unsafe { libloading::os::unix::Library::this().get::<*const c_void>(symbol) }.is_ok();
    found
}

/// Flushes output of FMUs that the C library has buffered.
pub fn flush_prints() {
    // SAFETY: null means all streams; there are no other conditions.
    unsafe { libc::fflush(ptr::null_mut()) };
}

/// The locale of this process, as the C library writes it.
pub fn locale() -> String {
    // SAFETY: with null, the locale is only read. The string lives until the locale changes.
    unsafe { super::strings::text(libc::setlocale(libc::LC_ALL, ptr::null())) }
}

pub(super) fn allocate(count: usize, size: usize) -> *mut c_void {
    // SAFETY: `calloc` has no conditions.
    unsafe { libc::calloc(count, size) }
}

/// Frees memory of an FMU.
///
/// # Safety
/// The memory must be from [`allocate`], or null.
pub(super) unsafe fn free(memory: *mut c_void) {
    // SAFETY: promised by the caller.
    unsafe { libc::free(memory) }
}

/// Joins the messages of the error and its sources, one of which contains the name of a missing symbol or library.
fn reason(error: &libloading::Error) -> String {
    let chain = std::iter::successors(Some(error as &dyn std::error::Error), |error| error.source());
    chain.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}
