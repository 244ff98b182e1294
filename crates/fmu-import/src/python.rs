//! FMUs written in Python: their binaries call Python, which the process must have loaded.

use object::{Object as _, ObjectSymbol as _, ReadCache};
use std::fs::File;
use std::path::Path;

/// The first symbol of Python's C interface that an ELF library uses without defining it; `None` for other formats.
pub(crate) fn undefined_symbol(library: &Path) -> Option<String> {
    let content = ReadCache::new(File::open(library).ok()?);
    let parsed = object::File::parse(&content).ok()?;
    // Python reserves these prefixes for its C interface.
    let is_python = |name: &&str| name.starts_with("Py") || name.starts_with("_Py");
    let undefined = parsed.dynamic_symbols().filter(|symbol| symbol.is_undefined() && !symbol.is_weak());
    let mut names: Vec<&str> = undefined.filter_map(|symbol| symbol.name().ok()).filter(is_python).collect();
    names.sort_unstable();
    names.first().map(ToString::to_string)
}
