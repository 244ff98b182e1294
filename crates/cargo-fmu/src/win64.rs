//! Builds for Windows on another system, with mingw-w64. Uses the current toolchain if it has a standard library for
//! Windows, otherwise a toolchain with the sources of the standard library.
//!
//! Rustup's target with a compiled standard library is `x86_64-pc-windows-gnu`. The other target is
//! `x86_64-win7-windows-gnu`: with the target for newer Windows, a hash map takes its random numbers from a library
//! that Windows 7 and Wine 8 lack.

use miette::{Result, miette};

use crate::build::{Builder, Linker};
use crate::platform::Platform;
use crate::toolchain::{self, PACKAGES, Toolchain};

/// The target for which rustup has a compiled standard library.
const ORDINARY: &str = "x86_64-pc-windows-gnu";
/// The target if the standard library is built from its sources.
const TARGET: &str = Platform::Win64.target();
const LINKER: &str = "x86_64-w64-mingw32-gcc";

/// Looks for the linker and a toolchain. A toolchain that the user names comes first, then the standard library of the
/// Rust in use. The error lists what is missing, the places searched, and how to install it.
pub(crate) fn builder() -> Result<Builder> {
    let mut missing = Vec::new();
    if !toolchain::runs(LINKER, &["--version"]) {
        missing.push(format!("the linker {LINKER} is not on the PATH"));
    }
    let is_named = std::env::var_os(Platform::Win64.variable()).is_some();
    let toolchain = if !is_named && toolchain::has_library(ORDINARY) {
        Ok(None)
    } else {
        Toolchain::find(Platform::Win64).map(Some)
    };
    if let Err(rejected) = &toolchain {
        missing.push(format!(
            "no installed Rust can build for Windows: the Rust in use has no standard library for {ORDINARY}, and no \
             installed toolchain has the sources of its own ({rejected})"
        ));
    }
    match toolchain {
        Ok(toolchain) if missing.is_empty() => {
            let target = if toolchain.is_some() { TARGET } else { ORDINARY };
            let variable = format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace('-', "_"));
            Ok(Builder {
                linker: Linker::Mingw,
                toolchain,
                environment: vec![(variable, LINKER.into())],
                ..Builder::new(Platform::Win64, Some(target))
            })
        }
        _ => Err(miette!(
            help = format!(
                "With rustup: `rustup target add {ORDINARY}`, and mingw-w64 for the linker, on Debian `apt-get install \
                 --no-install-recommends gcc-mingw-w64-x86-64-win32`. Without rustup, or for Windows 7, on Debian: `apt-get \
                 install --no-install-recommends gcc-mingw-w64-x86-64-win32 {PACKAGES}`; they do not get in the way of a Rust \
                 in the home directory. For another toolchain that has the sources of its standard library (rustup: \
                 the component rust-src), set {}=FOLDER, where FOLDER contains bin/cargo.",
                Platform::Win64.variable()
            ),
            "win64 cannot be built here: {}",
            missing.join("; ")
        )),
    }
}
