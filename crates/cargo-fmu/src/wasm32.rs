//! Builds for WebAssembly. This needs a Rust toolchain with the sources of its standard library, and the linker
//! `rust-lld`.
//!
//! With the compiled standard library for this target, a panic ends in a trap without a message. A standard library
//! built with `-C panic=unwind` lets the C interface turn a panic into an error status, as on every other platform.

use std::path::{Path, PathBuf};

use miette::{Result, miette};

use crate::build::{Builder, Linker};
use crate::platform::Platform;
use crate::toolchain::{self, PACKAGES, Toolchain};

const TARGET: &str = Platform::Wasm32.target();
const LINKER: &str = "rust-lld";
/// Environment variable that selects another linker, for this program and for cargo.
const VARIABLE: &str = "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER";

/// Flags for the compiler and its linker. An importer adds its callbacks to the table of functions, which therefore is
/// exported and can grow.
pub(crate) const FLAGS: [&str; 3] = ["-Cpanic=unwind", "-Clink-arg=--export-table", "-Clink-arg=--growable-table"];

/// Looks for the toolchain and the linker. The error lists what is missing, the places searched, and how to install it.
pub(crate) fn builder() -> Result<Builder> {
    let linker =
        std::env::var_os(VARIABLE).map(PathBuf::from).or_else(|| toolchain::in_use().and_then(|root| linker(&root)));
    match (Toolchain::find(Platform::Wasm32), linker) {
        (Ok(toolchain), Some(linker)) => Ok(Builder {
            linker: Linker::Lld,
            toolchain: Some(toolchain),
            environment: vec![(VARIABLE.to_owned(), linker.into_os_string())],
            ..Builder::new(Platform::Wasm32, Some(TARGET))
        }),
        (toolchain, linker) => {
            let mut missing = Vec::new();
            let mut help = Vec::new();
            if let Err(rejected) = toolchain {
                missing.push(format!("no installed Rust can build the standard library for {TARGET}: {rejected}"));
                help.push(format!(
                    "On Debian: `apt-get install --no-install-recommends {PACKAGES}`; with rustup: `rustup component add \
                     rust-src`. For another toolchain that has the sources of its standard library, set {}=FOLDER, \
                     where FOLDER contains bin/cargo.",
                    Platform::Wasm32.variable()
                ));
            }
            if linker.is_none() {
                missing.push(format!("the Rust in use has no {LINKER}"));
                help.push(format!("Use a Rust that rustup installed, which has {LINKER}, or set {VARIABLE}=FILE to a linker for WebAssembly."));
            }
            Err(miette!(help = help.join(" "), "wasm32 cannot be built here: {}", missing.join("; ")))
        }
    }
}

/// The linker of a toolchain, which is in a folder named after the platform of this machine.
fn linker(root: &Path) -> Option<PathBuf> {
    let targets = std::fs::read_dir(root.join("lib/rustlib")).ok()?.filter_map(Result::ok);
    let mut linkers =
        targets.map(|target| target.path().join("bin").join(format!("{LINKER}{}", std::env::consts::EXE_SUFFIX)));
    linkers.find(|path| path.is_file())
}
