//! What builds libraries for Windows on another system: a Rust with the sources of its standard library, and mingw-w64.
//!
//! The target is `x86_64-win7-windows-gnu`. With that of newer Windows a hash map takes its random numbers from a library
//! that Windows 7 and Wine 8 lack. There is no compiled standard library for it, so cargo builds that along; the option is
//! not stable, which `RUSTC_BOOTSTRAP` admits, for this one call of cargo only.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use miette::{Result, miette};

/// The target of the compiler.
pub(crate) const TARGET: &str = "x86_64-win7-windows-gnu";
const LINKER: &str = "x86_64-w64-mingw32-gcc";
/// Names the folder of a toolchain, which has `bin/cargo` and `bin/rustc`.
const VARIABLE: &str = "CHASSIS_FMU_WIN64_RUST";
/// Where the sources of the standard library stand in a toolchain, by rustup and by Debian.
const SOURCES: &str = "lib/rustlib/src/rust";

/// A toolchain that can build for Windows.
#[derive(Debug)]
pub(crate) struct Toolchain {
    root: PathBuf,
}

impl Toolchain {
    /// Looks for what is needed.
    ///
    /// # Errors
    /// Something is missing; the message says what, where it was looked for, and how to install it.
    pub(crate) fn find() -> Result<Self> {
        let mut missing = Vec::new();
        if !runs(LINKER, "--version") {
            missing.push(format!("the linker {LINKER} is not on the PATH"));
        }
        let mut toolchain = None;
        let mut rejected = Vec::new();
        for root in candidates() {
            match usable(&root) {
                Ok(()) => {
                    toolchain = Some(Self { root });
                    break;
                }
                Err(reason) => rejected.push(reason),
            }
        }
        if toolchain.is_none() {
            missing.push(format!("there is no Rust that can build for Windows: {}", rejected.join(", ")));
        }
        match toolchain {
            Some(toolchain) if missing.is_empty() => Ok(toolchain),
            _ => Err(miette!(
                help = format!(
                    "On Debian: `apt-get install --no-install-recommends gcc-mingw-w64-x86-64-win32 cargo-web rustc-web \
                     rust-web-src`; they do not get in the way of a Rust in the home directory. A toolchain elsewhere that \
                     has the sources of its standard library (rustup: the component rust-src) is named by \
                     {VARIABLE}=FOLDER, with FOLDER/bin/cargo in it."
                ),
                "win64 cannot be built here: {}",
                missing.join("; ")
            )),
        }
    }

    /// A call of this toolchain's cargo that builds for Windows, without packages and profile.
    pub(crate) fn cargo_rustc(&self) -> Command {
        let mut command = self.cargo();
        command.args(["rustc", "--target", TARGET, "-Z", "build-std=std,panic_unwind"]).env("RUSTC_BOOTSTRAP", "1");
        command.env(format!("CARGO_TARGET_{}_LINKER", TARGET.to_uppercase().replace('-', "_")), LINKER);
        command
    }

    /// A call of this toolchain's cargo.
    pub(crate) fn cargo(&self) -> Command {
        let mut command = Command::new(self.program("cargo"));
        command.env("RUSTC", self.program("rustc"));
        // They belong to the cargo that runs this program.
        command.env_remove("RUSTUP_TOOLCHAIN").env_remove("LD_LIBRARY_PATH");
        command
    }

    /// Where the sources of the standard library lie; their paths get into messages.
    pub(crate) fn sources(&self) -> PathBuf {
        self.root.join(SOURCES)
    }

    fn program(&self, name: &str) -> PathBuf {
        program(&self.root, name)
    }
}

fn program(root: &Path, name: &str) -> PathBuf {
    root.join("bin").join(name)
}

/// Folders of toolchains: the one that is told; else the one in use and that of the system.
fn candidates() -> Vec<PathBuf> {
    if let Some(told) = std::env::var_os(VARIABLE) {
        return vec![PathBuf::from(told)];
    }
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let in_use = output(&rustc, &["--print", "sysroot"]).map(|root| PathBuf::from(root.trim_end()));
    let mut candidates: Vec<_> = in_use.into_iter().collect();
    let system = PathBuf::from("/usr");
    if !candidates.contains(&system) {
        candidates.push(system);
    }
    candidates
}

/// Whether a toolchain has all that is needed, otherwise what it lacks.
fn usable(root: &Path) -> Result<(), String> {
    let library = root.join(SOURCES).join("library/Cargo.lock");
    for file in [program(root, "cargo"), program(root, "rustc"), library] {
        if !file.exists() {
            return Err(format!("there is no {}", file.display()));
        }
    }
    let targets = output(program(root, "rustc").as_os_str(), &["--print", "target-list"]).unwrap_or_default();
    if !targets.lines().any(|target| target == TARGET) {
        return Err(format!("{} does not know the target {TARGET}", program(root, "rustc").display()));
    }
    Ok(())
}

fn runs(program: &str, argument: &str) -> bool {
    output(OsStr::new(program), &[argument]).is_some()
}

/// What a program that succeeds prints.
fn output(program: &OsStr, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}
