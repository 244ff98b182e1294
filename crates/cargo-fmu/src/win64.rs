//! Builds for Windows on another system: a Rust with the sources of its standard library, and mingw-w64.
//!
//! The target is `x86_64-win7-windows-gnu`. With that of newer Windows a hash map takes its random numbers from a library
//! that Windows 7 and Wine 8 lack. Rust has no prebuilt standard library for this target; cargo builds it from source.

use std::process::Command;

use miette::{Result, miette};

use crate::platform::Platform;
use crate::toolchain::{self, PACKAGES, Toolchain};

/// The target of the compiler.
const TARGET: &str = Platform::Win64.target();
const LINKER: &str = "x86_64-w64-mingw32-gcc";

/// All that a build for Windows needs.
#[derive(Debug)]
pub(crate) struct Mingw {
    toolchain: Toolchain,
}

impl Mingw {
    /// Looks for what is needed.
    ///
    /// # Errors
    /// Something is missing; the message says what, where it was looked for, and how to install it.
    pub(crate) fn find() -> Result<Self> {
        let mut missing = Vec::new();
        if !toolchain::runs(LINKER, "--version") {
            missing.push(format!("the linker {LINKER} is not on the PATH"));
        }
        let toolchain = Toolchain::find(Platform::Win64);
        if let Err(rejected) = &toolchain {
            missing.push(format!("there is no Rust that can build for Windows: {rejected}"));
        }
        match toolchain {
            Ok(toolchain) if missing.is_empty() => Ok(Self { toolchain }),
            _ => Err(miette!(
                help = format!(
                    "On Debian: `apt-get install --no-install-recommends gcc-mingw-w64-x86-64-win32 {PACKAGES}`; they do not \
                     get in the way of a Rust in the home directory. A toolchain elsewhere that has the sources of its \
                     standard library (rustup: the component rust-src) is named by {}=FOLDER, with FOLDER/bin/cargo in it.",
                    Platform::Win64.variable()
                ),
                "win64 cannot be built here: {}",
                missing.join("; ")
            )),
        }
    }

    /// A call of cargo that builds for Windows, without packages and profile.
    pub(crate) fn cargo_rustc(&self) -> Command {
        let mut command = self.toolchain.cargo();
        command.args(["rustc", "--target", TARGET]);
        Toolchain::build_library(&mut command);
        command.env(format!("CARGO_TARGET_{}_LINKER", TARGET.to_uppercase().replace('-', "_")), LINKER);
        command
    }

    /// The toolchain, which is another than the one in use.
    pub(crate) const fn toolchain(&self) -> &Toolchain {
        &self.toolchain
    }
}
