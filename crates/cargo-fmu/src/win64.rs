//! Builds for Windows on another system, with mingw-w64: by the Rust in use if it has a standard library for Windows, otherwise by a Rust
//! with the sources of its standard library.
//!
//! The target with a compiled standard library, `x86_64-pc-windows-gnu`, is that of rustup. The other one is
//! `x86_64-win7-windows-gnu`: with that of newer Windows a hash map takes its random numbers from a library that Windows 7 and Wine 8 lack.

use std::process::Command;

use miette::{Result, miette};

use crate::platform::Platform;
use crate::toolchain::cargo;
use crate::toolchain::{self, PACKAGES, Toolchain};

/// The target that rustup has a standard library for.
const ORDINARY: &str = "x86_64-pc-windows-gnu";
/// The target of a build with the sources.
const TARGET: &str = Platform::Win64.target();
const LINKER: &str = "x86_64-w64-mingw32-gcc";

/// All that a build for Windows needs.
#[derive(Debug)]
pub(crate) struct Mingw {
    /// With the sources of its standard library; none for the Rust in use, which has a compiled one.
    toolchain: Option<Toolchain>,
}

impl Mingw {
    /// Looks for what is needed. A toolchain that the user names comes first, then the standard library of the Rust in use.
    ///
    /// # Errors
    /// Something is missing; the message names it, the places searched, and the way to install it.
    pub(crate) fn find() -> Result<Self> {
        let mut missing = Vec::new();
        if !toolchain::runs(LINKER, "--version") {
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
                "no Rust here can build for Windows: the Rust in use has no standard library for {ORDINARY}, and none has \
                 the sources of its own ({rejected})"
            ));
        }
        match toolchain {
            Ok(toolchain) if missing.is_empty() => Ok(Self { toolchain }),
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

    /// The target of the compiler.
    pub(crate) const fn target(&self) -> &'static str {
        match self.toolchain {
            Some(_) => TARGET,
            None => ORDINARY,
        }
    }

    /// A call of cargo that builds for Windows, without packages and profile.
    pub(crate) fn cargo_rustc(&self) -> Command {
        let target = self.target();
        let mut command = self.toolchain.as_ref().map_or_else(cargo, Toolchain::cargo);
        command.args(["rustc", "--target", target]);
        if self.toolchain.is_some() {
            Toolchain::build_library(&mut command);
        }
        command.env_remove("CARGO_BUILD_TARGET");
        command.env(format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace('-', "_")), LINKER);
        command
    }

    /// The toolchain, if it is not the one in use.
    pub(crate) const fn toolchain(&self) -> Option<&Toolchain> {
        self.toolchain.as_ref()
    }
}
