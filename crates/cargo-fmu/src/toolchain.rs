//! A Rust toolchain that builds the standard library together with a model, for platforms without a compiled standard
//! library.
//!
//! Cargo's option for this is unstable. `RUSTC_BOOTSTRAP` enables it for this one call of cargo.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use miette::{IntoDiagnostic, WrapErr, miette};
use serde::de::DeserializeOwned;

use crate::platform::Platform;

pub(crate) fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Folder in a toolchain for the sources of the standard library, both from rustup and from Debian.
const SOURCES: &str = "lib/rustlib/src/rust";
/// Debian's packages of a toolchain with sources.
pub(crate) const PACKAGES: &str = "cargo-web rustc-web rust-web-src";

/// A toolchain that has the sources of its standard library.
#[derive(Debug)]
pub(crate) struct Toolchain {
    root: PathBuf,
}

impl Toolchain {
    /// Looks in the folder that the environment variable [`Platform::variable`] contains. Without this variable, looks
    /// in the toolchain in use and in `/usr`.
    pub(crate) fn find(platform: Platform) -> Result<Self, String> {
        let mut rejected = Vec::new();
        for root in candidates(&platform.variable()) {
            match usable(&root, platform.target()) {
                Ok(()) => return Ok(Self { root }),
                Err(reason) => rejected.push(reason),
            }
        }
        Err(rejected.join(", "))
    }

    pub(crate) fn cargo(&self) -> Command {
        Command::new(self.program("cargo"))
    }

    /// Makes a program that calls cargo use this toolchain, and include the standard library in the build.
    pub(crate) fn build_library(&self, command: &mut Command) {
        command.env("CARGO", self.program("cargo")).env("RUSTC", self.program("rustc"));
        // These variables were set for the toolchain that runs this program, and do not apply to the other toolchain.
        command.env_remove("RUSTUP_TOOLCHAIN").env_remove("LD_LIBRARY_PATH");
        command.args(["-Z", "build-std=std,panic_unwind"]).env("RUSTC_BOOTSTRAP", "1");
    }

    /// Folder of the sources. Panic messages contain their paths.
    pub(crate) fn sources(&self) -> PathBuf {
        self.root.join(SOURCES)
    }

    fn program(&self, name: &str) -> PathBuf {
        program(&self.root, name)
    }
}

/// True if the toolchain in use has a compiled standard library for a target.
pub(crate) fn has_library(target: &str) -> bool {
    output(&rustc(), &["--print", "target-libdir", "--target", target])
        .is_some_and(|folder| Path::new(folder.trim_end()).is_dir())
}

pub(crate) fn in_use() -> Option<PathBuf> {
    output(&rustc(), &["--print", "sysroot"]).map(|root| PathBuf::from(root.trim_end()))
}

/// True if a program exists and succeeds with these arguments.
pub(crate) fn runs(program: impl AsRef<OsStr>, arguments: &[&str]) -> bool {
    output(program.as_ref(), arguments).is_some()
}

fn rustc() -> std::ffi::OsString {
    std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into())
}

fn program(root: &Path, name: &str) -> PathBuf {
    root.join("bin").join(name)
}

/// Folders of toolchains: the folder in the variable, or without the variable, those of the toolchain in use and of the
/// system.
fn candidates(variable: &str) -> Vec<PathBuf> {
    if let Some(named) = std::env::var_os(variable) {
        return vec![PathBuf::from(named)];
    }
    let mut candidates: Vec<_> = in_use().into_iter().collect();
    let system = PathBuf::from("/usr");
    if !candidates.contains(&system) {
        candidates.push(system);
    }
    candidates
}

/// Fails if a toolchain lacks a program, the sources or the target.
fn usable(root: &Path, target: &str) -> Result<(), String> {
    let library = root.join(SOURCES).join("library/Cargo.lock");
    for file in [program(root, "cargo"), program(root, "rustc"), library] {
        if !file.exists() {
            return Err(format!("{} does not exist", file.display()));
        }
    }
    let targets = output(program(root, "rustc").as_os_str(), &["--print", "target-list"]).unwrap_or_default();
    if !targets.lines().any(|known| known == target) {
        return Err(format!("{} does not know the target {target}", program(root, "rustc").display()));
    }
    Ok(())
}

/// Output of a program that succeeds.
fn output(program: &OsStr, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

pub(crate) fn metadata<T: DeserializeOwned>(command: &mut Command) -> miette::Result<T> {
    let output = command
        .args(["--format-version", "1"])
        .output()
        .into_diagnostic()
        .wrap_err("cargo cannot be run; is it on the PATH?")?;
    if !output.status.success() {
        return Err(miette!("cargo metadata failed:\n{}", String::from_utf8_lossy(&output.stderr).trim()));
    }
    serde_json::from_slice(&output.stdout).into_diagnostic().wrap_err("reading cargo metadata")
}
