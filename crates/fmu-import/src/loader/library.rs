//! The shared library of an FMU.

use super::calls;
use super::error::LoadError;
use super::floats::FloatEnvironment;
use super::functions::{self, Functions};
use super::strings::{file_uri, folder_path, text};
use super::system;
use crate::archive::Unpacked;
use crate::description::{FmiVersion, Interface};
use crate::python;
use crate::signature::Signature;
use crate::wasm;
use object::Object as _;
use std::collections::BTreeSet;
use std::ffi::{CString, c_char};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A loaded library with the folder of unpacked files that contains it.
pub struct Library {
    pub(super) functions: Functions,
    // Must be declared before `_unpacked`, so that the library is closed before its file is deleted.
    library: system::Library,
    /// A URI (FMI 2.0) or a path (FMI 3.0). The folder always exists, because some FMI 3.0 FMUs crash without it.
    pub(super) resources: CString,
    pub(super) signature: Signature,
    pub(super) instances: AtomicUsize,
    _unpacked: Arc<Unpacked>,
}

impl std::fmt::Debug for Library {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Library").field("resources", &self.resources).finish_non_exhaustive()
    }
}

impl Library {
    /// Loads the library of an unpacked FMU. Fails if the system cannot load it, it needs Python, a function is
    /// missing, its FMI version differs from the description, or (FMI 2.0) its types platform is not `default`.
    pub fn load(unpacked: impl Into<Arc<Unpacked>>) -> Result<Arc<Self>, LoadError> {
        let board = calls::board();
        if let Some(board) = board {
            board.load();
        }
        let floats = FloatEnvironment::current();
        let library = Self::load_unpacked(unpacked.into());
        if FloatEnvironment::current() != floats {
            floats.restore("loading the library");
        }
        if let Some(board) = board {
            board.leave();
        }
        library
    }

    fn load_unpacked(unpacked: Arc<Unpacked>) -> Result<Arc<Self>, LoadError> {
        let path = &unpacked.binary;
        let opened = system::open(path);
        // Functions are looked up at their first call. If one were missing, the system would then end the process.
        if let Some(symbol) =
            python::undefined_symbol(path).filter(|symbol| !system::has_symbol(opened.as_ref().ok(), symbol))
        {
            return Err(LoadError::Other(format!(
                "{} needs the Python library: it uses `{symbol}` without linking to it; pass the library with `--libpython \
                 FILE`, or use the command `chassis` of the Python package, which finds it",
                path.display()
            )));
        }
        let library = opened.map_err(|reason| LoadError::of_system(path, reason))?;
        let signature = unpacked.signature.clone();
        // SAFETY: the signatures come from the FMI headers; the table is stored together with the library.
        let functions = unsafe { Functions::load(&library, signature.fmi, signature.interface) }
            .map_err(|function| LoadError::Missing { path: path.clone(), function })?;
        let answers = match &functions {
            Functions::V2(f) => vec![
                ("fmi2GetVersion", f.get_version, "2.0"),
                ("fmi2GetTypesPlatform", f.get_types_platform, "default"),
            ],
            Functions::V3(f) => vec![("fmi3GetVersion", f.get_version, "3.0")],
        };
        for (function, get, expected) in answers {
            // SAFETY: these functions have no arguments and return a static string or null.
            let found = unsafe { text(get()) };
            let is_patch = expected == "3.0" && found.starts_with("3.0.");
            if found != expected && !is_patch {
                let path = path.display();
                let message = format!("{path}: {function} returned \"{found}\", expected \"{expected}\"");
                return Err(LoadError::Version(message));
            }
        }
        let resources = match signature.fmi {
            FmiVersion::V2 => file_uri(&unpacked.resources),
            FmiVersion::V3 => folder_path(&unpacked.resources),
        };
        Ok(Arc::new(Self {
            functions,
            library,
            resources,
            signature,
            instances: AtomicUsize::new(0),
            _unpacked: unpacked,
        }))
    }

    /// Functions of these interfaces that neither the library nor one of its dependencies exports.
    pub fn missing_functions(&self, interfaces: &[Interface]) -> Vec<&'static str> {
        let names = functions::names(self.signature.fmi, interfaces).into_iter();
        names.filter(|name| !system::exports(&self.library, name)).collect()
    }

    /// Number of living instances.
    pub fn instances(&self) -> usize {
        self.instances.load(Ordering::Acquire)
    }
}

/// Functions that these interfaces require in an FMI version, but that a library does not export. The library may be
/// for any platform.
pub fn not_exported(
    library: &std::path::Path,
    fmi: FmiVersion,
    interfaces: &[Interface],
) -> Result<Vec<&'static str>, LoadError> {
    let names = exported(library)?;
    Ok(functions::names(fmi, interfaces).into_iter().filter(|name| !names.contains(*name)).collect())
}

/// Names that a library exports. The library may be for any platform.
fn exported(library: &std::path::Path) -> Result<BTreeSet<String>, LoadError> {
    let failed = |reason: &dyn std::fmt::Display| LoadError::of_system(library, reason);
    let bytes = std::fs::read(library).map_err(|error| failed(&error))?;
    if let Some(names) = wasm::Names::read(&bytes) {
        return Ok(names.functions.into_iter().collect());
    }
    let file = object::File::parse(&*bytes).map_err(|error| failed(&error))?;
    let exports = file.exports().map_err(|error| failed(&error))?;
    // macOS prepends an underscore to every name.
    let names = exports.iter().filter_map(|export| std::str::from_utf8(export.name()).ok());
    Ok(names.map(|name| name.strip_prefix('_').unwrap_or(name).to_owned()).collect())
}

/// Returns the model descriptions from a library built with this project's exporter, each with the name of the model's
/// type. Empty for other libraries. `version` is the FMI version, 2 or 3; `options` is a sum of
/// [`description_options`](super::description_options). Fails if the system cannot load the library, or the
/// declarations of a model are inconsistent.
pub fn exported_descriptions(
    path: &std::path::Path,
    version: i32,
    options: i32,
) -> Result<Vec<(String, String)>, LoadError> {
    const PREFIX: &str = "fmu_model_description_";
    let failed = |reason: String| LoadError::of_system(path, reason);
    let names = exported(path)?.into_iter().filter(|name| name.starts_with(PREFIX));
    let library = system::open(path).map_err(failed)?;
    let mut descriptions = Vec::new();
    for name in names {
        // SAFETY: the exporter defines these functions with these arguments; a string lives until the next call.
        let description = unsafe {
            let function = system::symbol::<unsafe extern "C" fn(i32, i32) -> *const c_char>(&library, &name);
            function.map(|function| text(function(version, options)))
        };
        let description = description.ok_or_else(|| failed(format!("it does not export {name}")))?;
        let model = name[PREFIX.len()..].to_owned();
        if description.is_empty() {
            return Err(failed(format!("the description of {model} could not be generated; see the message above")));
        }
        if let Some(problem) = description.strip_prefix('!') {
            return Err(LoadError::Other(problem.to_owned()));
        }
        descriptions.push((model, description));
    }
    descriptions.sort();
    Ok(descriptions)
}
