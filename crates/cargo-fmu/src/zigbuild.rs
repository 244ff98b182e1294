//! cargo-zigbuild, which links libraries that load on old distributions of Linux, for the processor of this machine and
//! for others.

use std::path::{Path, PathBuf};

use miette::{Result, miette};

use crate::build::{Builder, Linker};
use crate::platform::Platform;
use crate::toolchain::{self, PACKAGES, Toolchain};

/// The oldest glibc that the libraries load with; also the oldest that Rust supports.
pub(crate) const GLIBC: &str = "2.17";
const PROGRAM: &str = "cargo-zigbuild";
/// Environment variable for cargo-zigbuild: the Python with the package `ziglang`.
const PYTHON: &str = "CARGO_ZIGBUILD_PYTHON_PATH";

/// A builder for Linux with this machine's processor and glibc 2.17 or newer. `reason` is the option or setting that
/// requests such binaries. The error lists what is missing and how to install it.
pub(crate) fn portable(root: &Path, platform: Platform, reason: &str) -> Result<Builder> {
    let programs = programs(root).map_err(|problem| {
        miette!(
            help = "Run `scripts/setup --all`, which installs both into .venv, or in a workspace of your own `python3 -m venv \
                    .venv && .venv/bin/pip install cargo-zigbuild ziglang`. Or pass --no-portable: the binary then needs \
                    a glibc as new as the one of this machine.",
            "{reason} asks for {} binaries that load with glibc {GLIBC}, which needs cargo-zigbuild and zig: {problem}",
            platform.name()
        )
    })?;
    Ok(builder(platform, programs, None))
}

/// A builder for Linux with another processor than this machine's, or from another system. The error lists what is
/// missing and how to install it.
pub(crate) fn cross(root: &Path, platform: Platform) -> Result<Builder> {
    let (name, target) = (platform.name(), platform.target());
    let mut missing = Vec::new();
    let mut help = Vec::new();
    let programs = programs(root);
    if let Err(problem) = &programs {
        missing.push(problem.clone());
        help.push(
            "Run `scripts/setup --all`, which installs cargo-zigbuild and zig into .venv, or in a workspace of your own \
             `python3 -m venv .venv && .venv/bin/pip install cargo-zigbuild ziglang`."
                .to_owned(),
        );
    }
    let is_chosen = std::env::var_os(platform.variable()).is_some();
    let toolchain = match Toolchain::find(platform) {
        // With a compiled standard library, no sources are needed. A toolchain that the user has chosen takes
        // precedence.
        _ if !is_chosen && toolchain::has_library(target) => None,
        Ok(toolchain) => Some(toolchain),
        Err(rejected) => {
            missing.push(format!(
                "the Rust in use has no standard library for {target}, and no installed toolchain has the \
                 sources to build it: {rejected}"
            ));
            help.push(format!(
                "Run `rustup target add {target}`. Without rustup, on Debian: `apt-get install --no-install-recommends \
                 {PACKAGES}`; cargo then builds the standard library from these sources. For another toolchain \
                 that has them (rustup: the component rust-src), set {}=FOLDER, where FOLDER contains bin/cargo.",
                platform.variable()
            ));
            None
        }
    };
    match programs {
        Ok(programs) if missing.is_empty() => Ok(builder(platform, programs, toolchain)),
        _ => Err(miette!(help = help.join(" "), "{name} cannot be built here: {}", missing.join("; "))),
    }
}

/// A builder with cargo-zigbuild and, if there is one, the Python next to it that has the package `ziglang`.
fn builder(platform: Platform, (program, python): (PathBuf, Option<PathBuf>), toolchain: Option<Toolchain>) -> Builder {
    let environment = python.into_iter().map(|python| (PYTHON.to_owned(), python.into_os_string())).collect();
    let native = Builder::new(platform, Some(platform.target()));
    Builder { linker: Linker::Zig, toolchain, program: Some(program), environment, ..native }
}

/// cargo-zigbuild in `.venv` at the top of the workspace or on the PATH, and the Python next to it if this Python has
/// zig.
fn programs(root: &Path) -> Result<(PathBuf, Option<PathBuf>), String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(root.join(".venv/bin")).chain(std::env::split_paths(&path));
    let mut without_zig = None;
    for folder in folders {
        let program = folder.join(PROGRAM);
        if !program.is_file() || !toolchain::runs(&program, &["--version"]) {
            continue;
        }
        let python = Some(folder.join("python3")).filter(|python| has_ziglang(python));
        if python.is_some() || has_zig() {
            return Ok((program, python));
        }
        without_zig.get_or_insert(program);
    }
    Err(without_zig.map_or_else(
        || format!("{PROGRAM} is neither in {} nor on the PATH", root.join(".venv/bin").display()),
        |program| format!("{} is installed, but cannot find zig", program.display()),
    ))
}

fn has_ziglang(python: &Path) -> bool {
    python.is_file() && toolchain::runs(python, &["-m", "ziglang", "version"])
}

/// True if cargo-zigbuild finds zig by itself. Looks in the same places in the same order.
fn has_zig() -> bool {
    let named = |variable: &str, program: &str| std::env::var_os(variable).unwrap_or_else(|| program.into());
    toolchain::runs(named(PYTHON, "python3"), &["-m", "ziglang", "version"])
        || toolchain::runs(named("CARGO_ZIGBUILD_ZIG_PATH", "zig"), &["version"])
}
