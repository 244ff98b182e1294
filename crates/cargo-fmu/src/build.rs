//! Builds the libraries of models: one builder for each platform.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use fmu_import::loader::description_options;
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use serde::Deserialize;

use crate::files::write_whole;
use crate::platform::Platform;
use crate::toolchain::{self, Toolchain, cargo, metadata};
use crate::workspace::{Model, Workspace};
use crate::{wasm32, win64, zigbuild};

/// Options of `cargo fmu pack` that are passed on to cargo.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct Options {
    /// Features to activate, as in cargo
    #[arg(long, value_name = "FEATURES")]
    features: Option<String>,
    /// Do not activate the default features
    #[arg(long)]
    no_default_features: bool,
    /// Require that Cargo.lock is up to date
    #[arg(long)]
    locked: bool,
    /// Build without optimization, with symbols for a debugger
    #[arg(long)]
    debug: bool,
    /// Folder for build artifacts, as in cargo [default: the workspace's target folder]
    #[arg(long, value_name = "DIR")]
    pub(crate) target_dir: Option<PathBuf>,
}

impl Options {
    /// Adds the options that `cargo build` and `cargo tree` share.
    pub(crate) fn apply(&self, command: &mut Command) {
        if let Some(features) = &self.features {
            command.args(["--features", features]);
        }
        if self.no_default_features {
            command.arg("--no-default-features");
        }
        if self.locked {
            command.arg("--locked");
        }
    }
}

/// Prefix of the environment variable that makes the macro `fmu::model` export symbols; the name of the library
/// follows.
const EXPORT: &str = "FMU_EXPORT_";
/// Prefix of the environment variable with the path of the dependencies that this macro builds in.
const DEPENDENCIES: &str = "FMU_DEPENDENCIES_";
/// The word in the variable of an export with which a discrete-time model without clocks of its own gets one.
const CLOCKS: &str = "clocks=true";

#[derive(Clone, Debug)]
pub(crate) struct Export {
    /// Name of the model's type, because a crate may have several models.
    pub(crate) model: String,
    pub(crate) guid: String,
    /// Version of FMI, 2 or 3.
    pub(crate) version: i32,
    pub(crate) interfaces: Vec<Interface>,
    pub(crate) indicators: usize,
    /// True if arrays are variables with dimensions, not one scalar per element (FMI 3.0).
    pub(crate) arrays: bool,
    /// True if discrete-time models without clocks of their own get one (FMI 3.0).
    pub(crate) clocks: bool,
    /// Dependencies of the equations as text, for FMI 3.0.
    pub(crate) dependencies: Option<String>,
}

impl std::fmt::Display for Export {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { model, guid, version, interfaces, indicators, arrays, clocks, .. } = self;
        let interfaces: Vec<_> = interfaces.iter().map(|interface| format!("{interface:?}").to_lowercase()).collect();
        let interfaces = interfaces.join(",");
        write!(f, "{model}={guid} fmi={version} interfaces={interfaces} indicators={indicators} arrays={arrays}")?;
        if *clocks { write!(f, " {CLOCKS}") } else { Ok(()) }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Interface {
    /// Co-simulation: the FMU contains its solver
    Cs,
    /// Model exchange: the importer solves the equations
    Me,
    /// Scheduled execution: the importer activates the parts of a model with clocks; requires --fmi 3
    Se,
}

impl Interface {
    /// Flag of this interface. A library gets the sum of such flags when it describes its model.
    pub(crate) const fn bit(self) -> i32 {
        match self {
            Self::Cs => description_options::CO_SIMULATION,
            Self::Me => description_options::MODEL_EXCHANGE,
            Self::Se => description_options::SCHEDULED_EXECUTION,
        }
    }
}

/// The profile of the binaries: small self-contained libraries. Panics unwind so that the C interface can turn them
/// into an error status.
const PROFILE: [&str; 5] = [
    "profile.fmu.inherits=\"release\"",
    "profile.fmu.lto=\"fat\"",
    "profile.fmu.codegen-units=1",
    "profile.fmu.strip=true",
    "profile.fmu.panic=\"unwind\"",
];

/// The profile of debug binaries. It has its own name, so both builds are kept.
const DEBUG_PROFILE: [&str; 3] =
    ["profile.fmu-debug.inherits=\"dev\"", "profile.fmu-debug.debug=\"full\"", "profile.fmu-debug.opt-level=0"];

/// The profile of libraries that describe their models. They are called once, so only the build time matters.
const DESCRIBE_PROFILE: [&str; 4] = [
    "profile.fmu-describe.inherits=\"dev\"",
    "profile.fmu-describe.opt-level=0",
    "profile.fmu-describe.debug=\"none\"",
    "profile.fmu-describe.incremental=false",
];

/// Builds libraries that describe their models, and returns them in the order of the models. See [`Export::clocks`].
pub(crate) fn for_description(
    workspace: &Workspace,
    models: &[Model],
    options: &Options,
    clocks: bool,
) -> Result<Vec<PathBuf>> {
    let mut libraries = BTreeMap::new();
    let wanted = if clocks { format!("describe {CLOCKS}") } else { "describe".to_owned() };
    for round in rounds(models) {
        let mut command = cargo();
        command.args(["build", "--profile", "fmu-describe", "--target-dir"]).arg(workspace.target.join("fmu-build"));
        settings(&mut command, &DESCRIBE_PROFILE);
        // The libraries run on this machine to describe their models, whatever the target platform is.
        command.env_remove("CARGO_BUILD_TARGET").args(["--target", &host()?]);
        options.apply(&mut command);
        for &model in &round {
            command.env(format!("{EXPORT}{}", model.library), &wanted);
        }
        let built = artifacts(&carry_out(command, workspace, &round, &[])?)?;
        libraries.extend(kept(&built, &round, &workspace.target.join("fmu-build/described"))?);
    }
    models.iter().map(|model| artifact(&libraries, model)).collect()
}

/// Groups of models that do not depend on each other: a library that exports its model cannot be linked into another
/// library that exports its own model.
fn rounds(models: &[Model]) -> Vec<Vec<&Model>> {
    let mut rounds: Vec<Vec<&Model>> = Vec::new();
    let mut left: Vec<&Model> = models.iter().collect();
    while !left.is_empty() {
        let needs = |model: &Model| left.iter().any(|other| model.dependencies.contains(&other.package));
        let (later, now): (Vec<&Model>, Vec<&Model>) = left.iter().partition(|model| needs(model));
        // Package dependencies have no cycles, so at least one remaining package depends on none of the others.
        rounds.push(now);
        left = later;
    }
    rounds
}

#[derive(Deserialize)]
pub(crate) struct Package {
    pub(crate) name: String,
    pub(crate) version: String,
    pub(crate) license: Option<String>,
    pub(crate) repository: Option<String>,
    /// Registry or repository; `None` for a local package.
    pub(crate) source: Option<String>,
    pub(crate) manifest_path: PathBuf,
}

impl Package {
    pub(crate) fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(Path::new(""))
    }
}

/// The packages of the workspace and all their dependencies.
pub(crate) fn packages(workspace: &Workspace, options: &Options) -> Result<Vec<Package>> {
    #[derive(Deserialize)]
    struct Metadata {
        packages: Vec<Package>,
    }
    let mut command = cargo();
    command.arg("metadata").current_dir(&workspace.root);
    options.apply(&mut command);
    Ok(metadata::<Metadata>(&mut command)?.packages)
}

/// The target of this machine's compiler.
fn host() -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("-vV").output().into_diagnostic().wrap_err("rustc cannot be run")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| miette!("`rustc -vV` does not name its host"))
}

#[derive(Deserialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
enum Message {
    CompilerArtifact(Artifact),
    #[serde(other)]
    Other,
}

/// An artifact that cargo has compiled or found up to date.
#[derive(Debug, Deserialize)]
pub(crate) struct Artifact {
    pub(crate) package_id: String,
    pub(crate) manifest_path: PathBuf,
    target: Target,
    filenames: Vec<PathBuf>,
}

#[derive(Debug, Deserialize)]
struct Target {
    crate_types: Vec<String>,
}

impl Artifact {
    /// Name and version, from `registry+https://…#libm@0.2.16`, or `path+file:///…/road#0.1.0` if the folder is named
    /// like the package.
    pub(crate) fn name_and_version(&self) -> Option<(&str, &str)> {
        let (url, fragment) = self.package_id.rsplit_once('#')?;
        Some(fragment.split_once('@').unwrap_or((url.rsplit('/').next()?, fragment)))
    }

    /// True if the part was compiled for the target. Procedural macros and build scripts are compiled for this machine.
    pub(crate) fn is_for(&self, target: &str) -> bool {
        self.filenames.iter().any(|path| path.components().any(|part| part.as_os_str() == target))
    }

    /// The package and the path of a dynamic library.
    fn library(&self) -> Option<(String, PathBuf)> {
        let is_library = |path: &&PathBuf| {
            path.extension()
                .is_some_and(|extension| ["so", "dll", "dylib", "wasm"].iter().any(|known| extension == *known))
        };
        let is_dynamic = self.target.crate_types.iter().any(|kind| kind == "cdylib");
        let path = self.filenames.iter().filter(|_| is_dynamic).find(is_library)?;
        Some((self.name_and_version()?.0.to_owned(), path.clone()))
    }
}

/// Reads the messages of cargo, one JSON object per line.
pub(crate) fn artifacts(messages: &str) -> Result<Vec<Artifact>> {
    let mut artifacts = Vec::new();
    for line in messages.lines() {
        if let Message::CompilerArtifact(artifact) =
            serde_json::from_str(line).into_diagnostic().wrap_err("reading the messages of cargo")?
        {
            artifacts.push(artifact);
        }
    }
    Ok(artifacts)
}

/// Copies the libraries of a round, because a later round that depends on them rebuilds them without their exports.
fn kept(built: &[Artifact], round: &[&Model], folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let built = built.iter().filter_map(Artifact::library).collect();
    std::fs::create_dir_all(folder).into_diagnostic().wrap_err_with(|| format!("making {}", folder.display()))?;
    let copy = |model: &&Model| {
        let library = artifact(&built, model)?;
        let path = folder.join(library.file_name().unwrap_or_default());
        // An existing file is removed first, because a library that is loaded must not be overwritten.
        let _ = std::fs::remove_file(&path);
        std::fs::copy(&library, &path)
            .into_diagnostic()
            .wrap_err_with(|| format!("copying {} to {}", library.display(), path.display()))?;
        Ok((model.package.clone(), path))
    };
    round.iter().map(copy).collect()
}

fn artifact(libraries: &BTreeMap<String, PathBuf>, model: &Model) -> Result<PathBuf> {
    libraries.get(&model.package).cloned().ok_or_else(|| miette!("cargo built no library of {}", model.package))
}

/// Compiler flags that the user has set in the environment, otherwise in the configuration of cargo, where flags for
/// the target take precedence over flags for every build.
fn user_flags(root: &Path, target: &str) -> Vec<OsString> {
    let split = |flags: &std::ffi::OsStr, separator: char| -> Vec<OsString> {
        flags.to_string_lossy().split(separator).filter(|flag| !flag.is_empty()).map(OsString::from).collect()
    };
    if let Some(flags) = std::env::var_os("CARGO_ENCODED_RUSTFLAGS") {
        return split(&flags, '\u{1f}');
    }
    if let Some(flags) = std::env::var_os("RUSTFLAGS") {
        return split(&flags, ' ');
    }
    let home = cargo_home().map(|home| home.join("config.toml"));
    let files = root.ancestors().map(|folder| folder.join(".cargo/config.toml")).chain(home);
    let tables: Vec<toml::Table> =
        files.filter_map(|file| std::fs::read_to_string(file).ok()).filter_map(|text| text.parse().ok()).collect();
    let read = |section: &str, keys: &[&str]| -> Vec<OsString> {
        let value =
            |table: &toml::Table| keys.iter().try_fold(table.get(section)?, |value, key| value.get(key)).cloned();
        let flags = |value| match value {
            toml::Value::Array(flags) => flags.iter().filter_map(toml::Value::as_str).map(OsString::from).collect(),
            value => split(value.as_str().unwrap_or_default().as_ref(), ' '),
        };
        tables.iter().filter_map(value).flat_map(flags).collect()
    };
    let of_target = read("target", &[target, "rustflags"]);
    if of_target.is_empty() { read("build", &["rustflags"]) } else { of_target }
}

fn cargo_home() -> Option<PathBuf> {
    std::env::var_os("CARGO_HOME").map(PathBuf::from).or_else(|| std::env::home_dir().map(|home| home.join(".cargo")))
}

/// The option for Linux binaries that load on old distributions.
pub(crate) const PORTABLE: &str = "--portable";

#[derive(Debug)]
pub(crate) struct Builder {
    pub(crate) platform: Platform,
    pub(crate) linker: Linker,
    /// Target of the compiler; `None` for this machine, whose target the compiler reports when it is needed.
    pub(crate) target: Option<&'static str>,
    /// Toolchain that builds its standard library from sources; `None` for the toolchain in use.
    pub(crate) toolchain: Option<Toolchain>,
    /// Program to call instead of cargo; `None` for the toolchain's cargo.
    pub(crate) program: Option<PathBuf>,
    pub(crate) environment: Vec<(String, OsString)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Linker {
    /// This machine's linker; on a Mac also for the other processor.
    Native,
    /// zig, for old distributions of Linux and for other processors.
    Zig,
    Mingw,
    Lld,
}

/// Returns one builder per platform, in platform order, after checking that its tools are installed. `portable` is the
/// option or setting that requests portable binaries: the Linux binary for this machine's processor then loads on old
/// distributions, too. Linux binaries for other processors always do. The error lists what is missing and how to
/// install it.
pub(crate) fn builders(
    workspace: &Workspace,
    wanted: &[Platform],
    portable: Option<&str>,
    version: i32,
) -> Result<Vec<Builder>> {
    let this = Platform::this()?;
    let mut wanted = if wanted.is_empty() { vec![this] } else { wanted.to_vec() };
    wanted.sort();
    wanted.dedup();
    if portable == Some(PORTABLE) && !wanted.iter().any(|platform| platform.is_linux()) {
        return Err(miette!(
            help = "Leave out --portable, or add linux64 or aarch64-linux to --platforms.",
            "--portable applies to Linux binaries, but --platforms lists no Linux platform"
        ));
    }
    if version == 2 {
        one_folder_each(&wanted)?;
    }
    let builder = |platform: Platform| match (platform, portable) {
        (_, Some(reason)) if platform == this && this.is_linux() => {
            zigbuild::portable(&workspace.root, platform, reason)
        }
        _ if platform == this => Ok(Builder::new(this, None)),
        (Platform::Linux64 | Platform::Aarch64Linux, _) => zigbuild::cross(&workspace.root, platform),
        (Platform::Win64, _) => win64::builder(),
        (Platform::Wasm32, _) => wasm32::builder(),
        (Platform::X86_64Darwin | Platform::Aarch64Darwin, _) if this.is_darwin() => {
            if toolchain::has_library(platform.target()) {
                return Ok(Builder::new(platform, Some(platform.target())));
            }
            Err(miette!(
                help = format!("Run `rustup target add {}`.", platform.target()),
                "{} cannot be built here: the Rust in use has no standard library for {}",
                platform.name(),
                platform.target()
            ))
        }
        (Platform::X86_64Darwin | Platform::Aarch64Darwin, _) => Err(miette!(
            help = "Run the same command on a Mac, where darwin64 is the default. Binaries built from the same sources have \
                    the same GUID, so those of the Mac can be added to this FMU; the guide shows the commands (Packing for \
                    several platforms).",
            "a binary for {} cannot be built on {}: only a Mac has the linker and the libraries of macOS",
            platform.name(),
            this.name()
        )),
    };
    wanted.into_iter().map(builder).collect()
}

/// Waits until no other call builds FMUs in this target folder, and keeps others out until the file is dropped. Cargo has
/// one place for the library of a model, whatever the FMI version and the interfaces of the call.
pub(crate) fn lock(workspace: &Workspace) -> Result<File> {
    let folder = workspace.target.join("fmu-build");
    let locked = || {
        std::fs::create_dir_all(&folder)?;
        let file = File::create(folder.join("lock"))?;
        if file.try_lock().is_err() {
            eprintln!("Waiting for another call that packs FMUs in {}", folder.display());
            file.lock()?;
        }
        Ok::<_, std::io::Error>(file)
    };
    locked().into_diagnostic().wrap_err_with(|| format!("locking {}", folder.display()))
}

/// Rejects two platforms that share a folder in FMI 2.0, because a folder can contain the library of only one of them.
fn one_folder_each(wanted: &[Platform]) -> Result<()> {
    for (i, platform) in wanted.iter().enumerate() {
        if let Some(other) = wanted[..i].iter().find(|other| other.fmi2() == platform.fmi2()) {
            return Err(miette!(
                help = "Pack one of them, or each with its own --out, and join the two libraries with `lipo -create`.",
                "{} and {} cannot be in one FMU: FMI 2.0 has one folder for both, binaries/{}",
                other.name(),
                platform.name(),
                platform.fmi2()
            ));
        }
    }
    Ok(())
}

impl Builder {
    /// A builder that calls the cargo in use.
    pub(crate) fn new(platform: Platform, target: Option<&'static str>) -> Self {
        Self { platform, linker: Linker::Native, target, toolchain: None, program: None, environment: Vec::new() }
    }

    pub(crate) fn target(&self) -> Result<String> {
        self.target.map_or_else(host, |target| Ok(target.to_owned()))
    }

    /// Builds all models, each with its GUID. Returns the library of each model, and the parts from which it was
    /// linked.
    ///
    /// The build uses its own target folder, one per toolchain, because its flags would make cargo rebuild everything
    /// else. The GUIDs are compiled in, so the libraries need not generate their descriptions to know them.
    pub(crate) fn build(
        &self,
        workspace: &Workspace,
        models: &[Model],
        exports: &[Export],
        packages: &[Package],
        options: &Options,
    ) -> Result<(Vec<PathBuf>, Vec<Vec<Artifact>>)> {
        let mut parts = Vec::new();
        let mut libraries = BTreeMap::new();
        let platform = self.platform.name();
        // Local packages outside of the workspace, for example an exporter that is not published.
        let outside = packages.iter().filter(|package| package.source.is_none());
        let outside: Vec<_> = outside.filter(|package| !package.folder().starts_with(&workspace.root)).collect();
        for (model, export) in models.iter().zip(exports) {
            let mut command = self.command(workspace, options, &outside)?;
            // Only the cdylib: with the ordinary library too, cargo would skip link-time optimization.
            command.args(["--lib", "--crate-type", "cdylib"]);
            command.env(format!("{EXPORT}{}", model.library), export.to_string());
            if let Some(text) = &export.dependencies {
                // A file, because the text may be longer than the value of an environment variable can be.
                let path = workspace.target.join("fmu-build/described").join(format!("{}.dependencies", model.library));
                // The file keeps its date if nothing has changed, so that cargo does not compile the model again.
                if std::fs::read_to_string(&path).ok().as_ref() != Some(text) {
                    write_whole(&path, text.as_bytes())?;
                }
                command.env(format!("{DEPENDENCIES}{}", model.library), path);
            }
            let mut flags = library_flags(self.platform, &model.name);
            if !options.debug {
                // This flag is only for this package; in other packages, paths below the workspace are relative. If all
                // packages got the flag, it would differ between two workspaces that share a target folder, and cargo
                // would rebuild the exporter for each workspace.
                flags.push(format!("--remap-path-prefix={}=/workspace", workspace.root.display()));
            }
            let built =
                carry_out(command, workspace, &[model], &flags).wrap_err_with(|| format!("building for {platform}"))?;
            let folder = workspace.target.join("fmu-build").join(platform);
            let built = artifacts(&built)?;
            libraries.extend(kept(&built, &[model], &folder)?);
            parts.push(built);
        }
        let libraries = models.iter().map(|model| artifact(&libraries, model)).collect::<Result<_>>()?;
        Ok((libraries, parts))
    }

    /// The cargo command, without the packages to build.
    fn command(&self, workspace: &Workspace, options: &Options, outside: &[&Package]) -> Result<Command> {
        let platform = self.platform;
        let mut folder = workspace.target.join("fmu-build");
        let mut sources = None;
        if let Some(toolchain) = &self.toolchain {
            folder = workspace.target.join(format!("fmu-build-{}", platform.name()));
            sources = Some(toolchain.sources());
        }
        let target = self.target()?;
        let cargo = || self.toolchain.as_ref().map_or_else(cargo, Toolchain::cargo);
        let mut command = self.program.as_ref().map_or_else(cargo, Command::new);
        // cargo-zigbuild accepts the version of glibc as a suffix of the target.
        let glibc = if self.linker == Linker::Zig { format!(".{}", zigbuild::GLIBC) } else { String::new() };
        command.args(["rustc", "--target", &format!("{target}{glibc}")]).env_remove("CARGO_BUILD_TARGET");
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        if let Some(toolchain) = &self.toolchain {
            toolchain.build_library(&mut command);
        }
        let (profile, values) = if options.debug { ("fmu-debug", &DEBUG_PROFILE[..]) } else { ("fmu", &PROFILE[..]) };
        command.args(["--profile", profile, "--target-dir"]).arg(&folder);
        settings(&mut command, values);
        options.apply(&mut command);
        let mut flags = user_flags(&workspace.root, &target);
        flags.extend(linker_flags(platform, self.linker == Linker::Native));
        // Paths of this machine are replaced in the binaries. The last match wins, so packages come last: a package may
        // be inside one of the other folders.
        let known = [(cargo_home(), "/cargo"), (Some(workspace.target.clone()), "/target"), (sources, "/rust")];
        let known = known.into_iter().filter_map(|(from, to)| Some((from?, to.to_owned())));
        let all = known
            .chain(outside.iter().map(|package| (package.folder().to_owned(), format!("/packages/{}", package.name))));
        // A debugger needs the real paths of the sources.
        for (from, to) in all.filter(|_| !options.debug) {
            let mut flag = OsString::from("--remap-path-prefix=");
            flag.push(from);
            flag.push(format!("={to}"));
            flags.push(flag);
        }
        command.env("CARGO_ENCODED_RUSTFLAGS", flags.join(&OsString::from("\u{1f}")));
        Ok(command)
    }
}

fn settings(command: &mut Command, values: &[&str]) {
    for value in values {
        command.args(["--config", value]);
    }
}

/// Flags for the compiler that are the same for all models of a platform.
///
/// `-Bsymbolic` keeps calls between the functions of an FMU inside this FMU when several FMUs are loaded. On Windows
/// and macOS, this is always so. Windows libraries get no timestamp, so builds are reproducible.
fn linker_flags(platform: Platform, is_native: bool) -> Vec<OsString> {
    match platform {
        Platform::Linux64 | Platform::Aarch64Linux => vec!["-Clink-arg=-Wl,-Bsymbolic".into()],
        Platform::Win64 if !is_native => vec!["-Clink-arg=-Wl,--no-insert-timestamp".into()],
        Platform::Win64 | Platform::X86_64Darwin | Platform::Aarch64Darwin => Vec::new(),
        Platform::Wasm32 => wasm32::FLAGS.map(Into::into).to_vec(),
    }
}

/// Flags for the library of one model only, so dependencies are not rebuilt for the next model.
///
/// A macOS library contains its own name, by default its path on the machine that links it.
fn library_flags(platform: Platform, name: &str) -> Vec<String> {
    if platform.is_darwin() {
        return vec![format!("-Clink-arg=-Wl,-install_name,@rpath/{name}.{}", platform.extension())];
    }
    Vec::new()
}

/// Builds the models with cargo. Returns cargo's messages, one JSON object per line; diagnostics go to the terminal.
///
/// `flags` are compiler flags for these packages, not for their dependencies; only `cargo rustc` accepts them.
fn carry_out(mut command: Command, workspace: &Workspace, models: &[&Model], flags: &[String]) -> Result<String> {
    command.args(["--message-format", "json-render-diagnostics"]);
    for model in models {
        command.args(["--package", &model.package]);
    }
    if !flags.is_empty() {
        command.arg("--").args(flags);
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_model_is_built_after_those_it_contains() {
        let model = |package: &str, dependencies: &[&str]| Model {
            package: package.to_owned(),
            name: package.to_owned(),
            folder: PathBuf::new(),
            library: package.to_owned(),
            is_default: true,
            dependencies: dependencies.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>(),
        };
        let models = [model("loop", &["motor", "controller"]), model("motor", &["shared"]), model("controller", &[])];
        let names: Vec<Vec<&str>> =
            rounds(&models).iter().map(|round| round.iter().map(|model| model.package.as_str()).collect()).collect();
        assert_eq!(names, [vec!["motor", "controller"], vec!["loop"]]);
    }

    #[test]
    fn flags_of_the_linker_follow_the_platform() {
        let flags = |platform, is_native| {
            let flags = linker_flags(platform, is_native).into_iter();
            flags.map(|flag| flag.into_string().unwrap()).collect::<Vec<_>>().join(" ")
        };
        for linux in [Platform::Linux64, Platform::Aarch64Linux] {
            assert_eq!(flags(linux, false), "-Clink-arg=-Wl,-Bsymbolic");
            assert_eq!(flags(linux, true), flags(linux, false));
        }
        assert_eq!(flags(Platform::Win64, false), "-Clink-arg=-Wl,--no-insert-timestamp");
        // Microsoft's linker does not support this option.
        assert_eq!(flags(Platform::Win64, true), "");
        for mac in [Platform::X86_64Darwin, Platform::Aarch64Darwin] {
            // Apple's linker has no `-Bsymbolic`.
            assert_eq!(flags(mac, true), "");
            assert_eq!(library_flags(mac, "Road"), ["-Clink-arg=-Wl,-install_name,@rpath/Road.dylib"]);
        }
        for other in [Platform::Linux64, Platform::Win64, Platform::Aarch64Linux] {
            assert!(library_flags(other, "Road").is_empty());
        }
    }

    #[test]
    fn an_fmu_has_one_library_in_each_folder() {
        let all = [Platform::Linux64, Platform::Win64, Platform::Aarch64Linux, Platform::Aarch64Darwin];
        assert!(one_folder_each(&all).is_ok());
        let error = one_folder_each(&[Platform::X86_64Darwin, Platform::Aarch64Darwin]).unwrap_err().to_string();
        assert_eq!(
            error,
            "x86_64-darwin and aarch64-darwin cannot be in one FMU: FMI 2.0 has one folder for both, binaries/darwin64"
        );
    }

    /// The forms are from cargo's documentation, "Package ID Specifications".
    #[test]
    fn identities_of_packages_are_read() {
        for (id, name, version) in [
            ("registry+https://github.com/rust-lang/crates.io-index#libm@0.2.16", "libm", "0.2.16"),
            ("path+file:///home/me/project/road#0.1.0", "road", "0.1.0"),
            ("path+file:///home/me/project/road#my-road@0.1.0", "my-road", "0.1.0"),
            ("git+https://example.org/fmu?branch=main#fmu@0.2.0", "fmu", "0.2.0"),
        ] {
            let artifact = Artifact {
                package_id: id.to_owned(),
                manifest_path: PathBuf::new(),
                target: Target { crate_types: Vec::new() },
                filenames: Vec::new(),
            };
            assert_eq!(artifact.name_and_version(), Some((name, version)));
        }
    }

    /// Reference: the messages of cargo 1.95, shortened.
    #[test]
    fn libraries_are_taken_from_the_messages_of_cargo() {
        let messages = r#"{"reason":"compiler-artifact","package_id":"path+file:///w/motor#0.1.0","manifest_path":"/w/motor/Cargo.toml","target":{"crate_types":["cdylib","rlib"]},"filenames":["/w/target/x/libmotor.so","/w/target/x/libmotor.rlib"]}
{"reason":"compiler-artifact","package_id":"registry+https://x#libc@0.2.1","manifest_path":"/c/libc/Cargo.toml","target":{"crate_types":["lib"]},"filenames":["/w/target/x/liblibc.rlib"]}
{"reason":"build-finished","success":true}"#;
        let artifacts = artifacts(messages).unwrap();
        let libraries: Vec<_> = artifacts.iter().filter_map(Artifact::library).collect();
        assert_eq!(libraries, [("motor".to_owned(), "/w/target/x/libmotor.so".into())]);
        assert!(artifacts.iter().all(|artifact| artifact.is_for("x") && !artifact.is_for("y")));
    }
}
