//! cargo-zigbuild, which links linux64 binaries that load on old distributions.

use std::path::{Path, PathBuf};
use std::process::Command;

use miette::{Result, miette};

/// The target of the compiler.
pub(crate) const TARGET: &str = "x86_64-unknown-linux-gnu";
/// The oldest glibc that the binaries load with; also the oldest that Rust supports.
const GLIBC: &str = "2.17";
const PROGRAM: &str = "cargo-zigbuild";
/// Tells cargo-zigbuild which Python has the package `ziglang`.
const PYTHON: &str = "CARGO_ZIGBUILD_PYTHON_PATH";

/// An installed cargo-zigbuild that finds zig.
#[derive(Debug)]
pub(crate) struct Zigbuild {
    program: PathBuf,
    /// The Python beside it, if that one has the package `ziglang`.
    python: Option<PathBuf>,
}

impl Zigbuild {
    /// Looks in `.venv` at the top of the workspace, then on the PATH.
    ///
    /// `reason` names the option or setting that asks for a portable binary.
    ///
    /// # Errors
    /// cargo-zigbuild or zig is missing; the message says what was found and how to install the rest.
    pub(crate) fn find(root: &Path, reason: &str) -> Result<Self> {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(root.join(".venv/bin")).chain(std::env::split_paths(&path));
        let mut without_zig = None;
        for folder in folders {
            let program = folder.join(PROGRAM);
            if !program.is_file() || !succeeds(Command::new(&program).arg("--version")) {
                continue;
            }
            let python = Some(folder.join("python3")).filter(|python| has_ziglang(python));
            if python.is_some() || has_zig() {
                return Ok(Self { program, python });
            }
            without_zig.get_or_insert(program);
        }
        let problem = without_zig.map_or_else(
            || format!("there is no {PROGRAM} in {} or on the PATH", root.join(".venv/bin").display()),
            |program| format!("{} is installed, but finds no zig", program.display()),
        );
        Err(miette!(
            help = "Run `scripts/setup`, which installs both into .venv, or in a workspace of your own `python3 -m venv .venv && \
                    .venv/bin/pip install cargo-zigbuild ziglang`. Or pass --no-portable: the binary then needs a glibc as \
                    new as the one of this machine.",
            "{reason} asks for linux64 binaries that load with glibc {GLIBC}, which takes cargo-zigbuild and zig: {problem}"
        ))
    }

    /// A build for Linux with the cargo in use, without packages and profile.
    pub(crate) fn cargo_rustc(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(["rustc", "--target", &format!("{TARGET}.{GLIBC}")]);
        if let Some(python) = &self.python {
            command.env(PYTHON, python);
        }
        command
    }
}

fn has_ziglang(python: &Path) -> bool {
    python.is_file() && succeeds(Command::new(python).args(["-m", "ziglang", "version"]))
}

/// Whether cargo-zigbuild finds zig without our help. It looks in this order.
fn has_zig() -> bool {
    let named = |variable: &str, program: &str| std::env::var_os(variable).unwrap_or_else(|| program.into());
    succeeds(Command::new(named(PYTHON, "python3")).args(["-m", "ziglang", "version"]))
        || succeeds(Command::new(named("CARGO_ZIGBUILD_ZIG_PATH", "zig")).arg("version"))
}

fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}
