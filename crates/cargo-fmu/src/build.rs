//! Builds the libraries of models: one builder for each platform.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::licenses::{self, Component};
use crate::platform::Platform;
use crate::win64;
use crate::workspace::{Model, Workspace};
use crate::zigbuild::{self, Zigbuild};

/// A call of the cargo in use.
pub(crate) fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Builds the models as the tests do: these libraries write their descriptions.
///
/// # Errors
/// A model does not build.
pub(crate) fn for_description(workspace: &Workspace, models: &[Model]) -> Result<()> {
    let mut command = cargo();
    command.args(["build", "--locked", "--target-dir"]).arg(&workspace.target);
    carry_out(command, workspace, models).map(drop)
}

/// Kind of the linux64 binary.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Linux {
    /// For this machine and those with a glibc as new.
    Native,
    /// For old distributions too.
    Portable(Asked),
}

/// Who asks for the portable binary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    /// `--portable`
    Option,
    /// `[workspace.metadata.fmu]`
    Workspace,
}

/// Build of the libraries of one platform.
#[derive(Debug)]
pub(crate) enum Builder {
    /// By the cargo in use, for this machine.
    Native(Platform),
    /// By cargo-zigbuild, for old distributions of Linux.
    Portable(Zigbuild),
    /// By another toolchain, for Windows.
    Win64(win64::Toolchain),
}

/// A library of a model and what is linked into it.
#[derive(Debug)]
pub(crate) struct Library {
    pub(crate) path: PathBuf,
    pub(crate) components: Vec<Component>,
}

/// One builder for each platform, in the order of the platforms; all they need is there.
///
/// # Errors
/// A platform cannot be built here; the message says what is missing and how to install it.
pub(crate) fn builders(workspace: &Workspace, wanted: &[Platform], linux: Linux) -> Result<Vec<Builder>> {
    let this = Platform::this()?;
    let mut wanted = if wanted.is_empty() { vec![this] } else { wanted.to_vec() };
    wanted.sort();
    wanted.dedup();
    if matches!(linux, Linux::Portable(Asked::Option)) && !wanted.contains(&Platform::Linux64) {
        return Err(miette!(
            "--portable is about the binary for linux64, which is not among the platforms to build for"
        ));
    }
    let builder = |platform| match (platform, linux) {
        (Platform::Linux64, Linux::Portable(asked)) => {
            let reason = match asked {
                Asked::Option => "--portable",
                Asked::Workspace => "`portable = true` in [workspace.metadata.fmu] of Cargo.toml",
            };
            Zigbuild::find(&workspace.root, reason).map(Builder::Portable)
        }
        (platform, _) if platform == this => Ok(Builder::Native(this)),
        (Platform::Win64, _) => win64::Toolchain::find().map(Builder::Win64),
        (platform, _) => Err(miette!(
            "a binary for {} cannot be built on {}; from another machine that is possible for win64 only",
            platform.name(),
            this.name()
        )),
    };
    wanted.into_iter().map(builder).collect()
}

impl Builder {
    /// Target platform.
    pub(crate) const fn platform(&self) -> Platform {
        match self {
            Self::Native(platform) => *platform,
            Self::Portable(_) => Platform::Linux64,
            Self::Win64(_) => Platform::Win64,
        }
    }

    /// Builds all models in one call of cargo, each with its GUID.
    ///
    /// The flags: `-Bsymbolic` keeps calls between the functions of one FMU inside it when several are loaded; the paths
    /// of the machine are taken out of the messages, and the time out of the libraries for Windows, so that two machines
    /// build the same bytes. The build has a folder of its own because these flags would make cargo build everything else
    /// anew, too; that for Windows another one, because its compiler may be another. The GUIDs are built in, so that the
    /// libraries need not write their descriptions to know them.
    ///
    /// # Errors
    /// A model does not build.
    pub(crate) fn build(&self, workspace: &Workspace, models: &[Model], guids: &[&str]) -> Result<Vec<Library>> {
        let platform = self.platform();
        let mut target = workspace.target.join("fmu-build");
        let mut sources = None;
        let (mut command, folder) = match self {
            Self::Native(_) => {
                let mut command = cargo();
                command.arg("build");
                (command, target.clone())
            }
            Self::Portable(zigbuild) => (zigbuild.cargo_build(), target.join(zigbuild::TARGET)),
            Self::Win64(toolchain) => {
                target = workspace.target.join("fmu-build-win64");
                sources = Some(toolchain.sources());
                (toolchain.cargo_build(), target.join(win64::TARGET))
            }
        };
        command.args(["--profile", "fmu", "--locked", "--target-dir"]).arg(&target);
        for (model, guid) in models.iter().zip(guids) {
            command.env(format!("FMI2_RS_GUID_{}", model.library), guid);
        }
        let mut flags: Vec<OsString> = Vec::new();
        match platform {
            Platform::Linux64 => flags.push("-Clink-arg=-Wl,-Bsymbolic".into()),
            Platform::Win64 if matches!(self, Self::Win64(_)) => {
                flags.push("-Clink-arg=-Wl,--no-insert-timestamp".into());
            }
            Platform::Win64 | Platform::Darwin64 => {}
        }
        let home = std::env::var_os("CARGO_HOME")
            .map(PathBuf::from)
            .or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
        for (from, to) in [(home, "/cargo"), (Some(workspace.root.clone()), "/chassis-fmu"), (sources, "/rust")] {
            if let Some(from) = from {
                let mut flag = OsString::from("--remap-path-prefix=");
                flag.push(from);
                flag.push(format!("={to}"));
                flags.push(flag);
            }
        }
        command.env("CARGO_ENCODED_RUSTFLAGS", flags.join(&OsString::from("\u{1f}")));
        let messages =
            carry_out(command, workspace, models).wrap_err_with(|| format!("building for {}", platform.name()))?;
        let components = licenses::components(self, workspace, models, &messages)
            .wrap_err("collecting the licenses of what is linked")?;
        let libraries = models.iter().zip(components).map(|(model, components)| Library {
            path: folder.join("fmu").join(platform.library_file(&model.library)),
            components,
        });
        Ok(libraries.collect())
    }
}

/// Lets cargo build the models. Returns its messages, which are lines of JSON; diagnostics go to the terminal.
fn carry_out(mut command: Command, workspace: &Workspace, models: &[Model]) -> Result<String> {
    command.args(["--message-format", "json-render-diagnostics"]);
    for model in models {
        command.args(["--package", &model.package]);
    }
    let output = command
        .current_dir(&workspace.root)
        .stderr(Stdio::inherit())
        .output()
        .into_diagnostic()
        .wrap_err("cargo cannot be run")?;
    if !output.status.success() {
        return Err(miette!("the models do not build; see the messages above"));
    }
    String::from_utf8(output.stdout).into_diagnostic().wrap_err("reading the messages of cargo")
}
