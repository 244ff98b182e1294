//! `cargo fmu pack`: builds models and zips them to FMUs.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use host::description::ModelDescription;
use host::loader::LoadError;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::documentation;
use crate::needed;
use crate::output::outln;
use crate::platform::Platform;
use crate::win64;
use crate::workspace::{Model, Workspace};

/// Which models, and for whom.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Names of FMUs or packages, such as RescueVehicle or rescue-vehicle; none means all
    names: Vec<String>,
    /// All models of the workspace's default members
    #[arg(long, conflicts_with = "names")]
    all: bool,
    /// The models that this scenario or study needs; tells only what it had to pack
    #[arg(long = "for", value_name = "FILE", conflicts_with_all = ["names", "all"])]
    needed_by: Option<PathBuf>,
    /// Platforms the FMUs get binaries for; win64 elsewhere needs mingw-w64 and a Rust with the sources of its library
    /// [default: that of this machine]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    platforms: Vec<Platform>,
    /// A linux64 binary that loads on distributions from glibc 2.17 on (needs cargo-zigbuild)
    #[arg(long)]
    portable: bool,
    /// Folder the FMUs are written to [default: target/fmu]
    #[arg(long, value_name = "OUT")]
    out: Option<PathBuf>,
    /// Writes the generated model descriptions to modelDescription/, after an intended change of an interface
    #[arg(long)]
    update_descriptions: bool,
}

/// Oldest glibc that the portable binary needs.
const PORTABLE_TARGET: &str = "x86_64-unknown-linux-gnu.2.17";

/// Builds, checks against the committed descriptions, and zips.
///
/// # Errors
/// When a model does not build, its library has no description, or a file cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    // First, because the user should not wait for a build to hear what is missing.
    let builders = builders(&arguments.platforms, arguments.portable)?;
    let workspace = Workspace::find()?;
    let folder = arguments.out.clone().unwrap_or_else(|| workspace.fmus());
    let models = match &arguments.needed_by {
        None => workspace.select(&arguments.names, arguments.all)?,
        Some(file) => {
            let models = workspace.models_of(&needed::fmus(file)?);
            if models.is_empty() {
                // All its FMUs come from elsewhere.
                return Ok(());
            }
            let is_missing = |model: &&Model| !folder.join(format!("{}.fmu", model.name)).exists();
            let missing: Vec<&str> = models.iter().filter(is_missing).map(|model| model.name.as_str()).collect();
            if !missing.is_empty() {
                eprintln!("Building {}; this takes some minutes the first time", missing.join(", "));
            }
            models
        }
    };
    if models.is_empty() {
        return Err(miette!("this workspace has no package with the crate type cdylib that depends on fmi2"));
    }
    let descriptions = describe(&workspace, &models)?;
    let mut libraries = vec![Vec::new(); models.len()];
    for builder in &builders {
        let built = build(&workspace, &models, &descriptions, builder)?;
        let platform = builder.platform()?;
        libraries.iter_mut().zip(built).for_each(|(libraries, path)| libraries.push((platform, path)));
    }
    let bar = ProgressBar::new(models.len() as u64).with_style(
        ProgressStyle::with_template("packing [{bar:30}] {pos}/{len} {msg}").expect("a constant template is valid"),
    );
    let mut changed = Vec::new();
    let mut report = Vec::new();
    for ((model, description), libraries) in models.iter().zip(&descriptions).zip(&libraries) {
        bar.set_message(model.name.clone());
        // The descriptions of examples are not committed.
        if model.is_default
            && !description_is_committed(&workspace, model, &description.xml, arguments.update_descriptions)?
        {
            changed.push(model.name.as_str());
        }
        let bytes = archive(model, libraries, description)?;
        let path = folder.join(format!("{}.fmu", model.name));
        bar.inc(1);
        if arguments.needed_by.is_some() && std::fs::read(&path).is_ok_and(|old| old == bytes) {
            continue;
        }
        write_whole(&path, &bytes)?;
        report.push(format!(
            "{} ({} kB)",
            path.strip_prefix(&workspace.root).unwrap_or(&path).display(),
            bytes.len() / 1000
        ));
    }
    bar.finish_and_clear();
    for line in report {
        outln!("{line}");
    }
    if !changed.is_empty() {
        eprintln!(
            "The interface of {} is not the one in modelDescription/, or not there yet; if that is intended, run `cargo fmu \
             pack --update-descriptions` and commit the change.",
            changed.join(", ")
        );
    }
    Ok(())
}

/// The description of a model.
struct Description {
    xml: String,
    parsed: ModelDescription,
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Builds the models as the tests do and asks them for their descriptions.
fn describe(workspace: &Workspace, models: &[Model]) -> Result<Vec<Description>> {
    let mut command = cargo();
    command.args(["build", "--locked", "--target-dir"]).arg(&workspace.target);
    carry_out(command, workspace, models)?;
    let describe = |model: &Model| -> Result<Description> {
        let library = workspace.target.join("debug").join(Platform::this()?.library_file(&model.library));
        let xml = host::loader::exported_description(&library).map_err(|error| match error {
            LoadError::Missing { .. } => miette!(
                help = "The last item of src/lib.rs is `fmi2::export!(plant NAME);`, or `sampled` or `advancing`.",
                "{error}"
            ),
            error => miette!("{error}"),
        })?;
        if xml.is_empty() {
            return Err(miette!("the declarations contradict each other; see the message above"));
        }
        Ok(Description { parsed: ModelDescription::parse(&xml).into_diagnostic()?, xml })
    };
    let describe = |model| describe(model).wrap_err_with(|| format!("reading the description of {}", model.name));
    models.iter().map(describe).collect()
}

/// Lets cargo build the models.
fn carry_out(mut command: Command, workspace: &Workspace, models: &[Model]) -> Result<()> {
    for model in models {
        command.args(["--package", &model.package]);
    }
    let status = command.current_dir(&workspace.root).status().into_diagnostic().wrap_err("cargo cannot be run")?;
    if !status.success() {
        return Err(miette!("the models do not build; see the messages above"));
    }
    Ok(())
}

/// How the libraries of one platform are built.
#[derive(Debug)]
enum Builder {
    /// By the cargo in use, for this machine.
    Native,
    /// By cargo-zigbuild, for old distributions of Linux.
    Portable,
    /// By another toolchain, for Windows.
    Win64(win64::Toolchain),
}

impl Builder {
    fn platform(&self) -> Result<Platform> {
        match self {
            Self::Native => Platform::this(),
            Self::Portable => Ok(Platform::Linux64),
            Self::Win64(_) => Ok(Platform::Win64),
        }
    }
}

/// One builder for each platform, in the order of the platforms; all they need is there.
fn builders(wanted: &[Platform], portable: bool) -> Result<Vec<Builder>> {
    let this = Platform::this()?;
    let mut wanted = if wanted.is_empty() { vec![this] } else { wanted.to_vec() };
    wanted.sort();
    wanted.dedup();
    if portable && !wanted.contains(&Platform::Linux64) {
        return Err(miette!(
            "--portable is about the binary for linux64, which is not among the platforms to build for"
        ));
    }
    let builder = |platform| match platform {
        Platform::Linux64 if portable => require_zigbuild().map(|()| Builder::Portable),
        platform if platform == this => Ok(Builder::Native),
        Platform::Win64 => win64::Toolchain::find().map(Builder::Win64),
        platform => Err(miette!(
            "a binary for {} cannot be built on {}; from another machine that is possible for win64 only",
            platform.name(),
            this.name()
        )),
    };
    wanted.into_iter().map(builder).collect()
}

/// Builds all models in one call of cargo and returns their libraries.
///
/// The flags: `-Bsymbolic` keeps calls between the functions of one FMU inside it when several are loaded; the paths
/// of the machine are taken out of the messages, and the time out of the libraries for Windows, so that two machines build
/// the same bytes. The build has a folder of its own because these flags would make cargo build everything else anew, too;
/// that for Windows another one, because its compiler may be another. The GUIDs are built in, so that the libraries need not
/// write their descriptions to know them.
fn build(
    workspace: &Workspace,
    models: &[Model],
    descriptions: &[Description],
    builder: &Builder,
) -> Result<Vec<PathBuf>> {
    let platform = builder.platform()?;
    let mut target = workspace.target.join("fmu-build");
    let mut sources = None;
    let (mut command, folder) = match builder {
        Builder::Native => {
            let mut command = cargo();
            command.arg("build");
            (command, target.clone())
        }
        Builder::Portable => {
            let mut command = cargo();
            command.args(["zigbuild", "--target", PORTABLE_TARGET]);
            (command, target.join("x86_64-unknown-linux-gnu"))
        }
        Builder::Win64(toolchain) => {
            target = workspace.target.join("fmu-build-win64");
            sources = Some(toolchain.sources());
            (toolchain.cargo_build(), target.join(win64::TARGET))
        }
    };
    command.args(["--profile", "fmu", "--locked", "--target-dir"]).arg(&target);
    for (model, description) in models.iter().zip(descriptions) {
        command.env(format!("FMI2_RS_GUID_{}", model.library), &description.parsed.guid);
    }
    let mut flags: Vec<OsString> = Vec::new();
    match builder {
        Builder::Win64(_) => flags.push("-Clink-arg=-Wl,--no-insert-timestamp".into()),
        _ if platform == Platform::Linux64 => flags.push("-Clink-arg=-Wl,-Bsymbolic".into()),
        _ => {}
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
    carry_out(command, workspace, models).wrap_err_with(|| format!("building for {}", platform.name()))?;
    Ok(models.iter().map(|model| folder.join("fmu").join(platform.library_file(&model.library))).collect())
}

/// Says what to install when the cross linker is missing.
fn require_zigbuild() -> Result<()> {
    let found = Command::new("cargo-zigbuild").arg("--version").output().is_ok_and(|o| o.status.success());
    if found {
        return Ok(());
    }
    Err(miette!(
        help = "Install it with `pip install ziglang cargo-zigbuild` (in a Python environment on the PATH), then call \
                this command again; without --portable the FMU needs a glibc as new as this machine's.",
        "--portable needs cargo-zigbuild, which was not found"
    ))
}

/// Compares with, or writes, `modelDescription/NAME.xml`. False if they differ.
fn description_is_committed(workspace: &Workspace, model: &Model, xml: &str, update: bool) -> Result<bool> {
    let path = workspace.root.join("modelDescription").join(format!("{}.xml", model.name));
    if update {
        write_whole(&path, xml.as_bytes())?;
    }
    Ok(std::fs::read_to_string(&path).is_ok_and(|committed| committed == xml))
}

/// The bytes of the FMU: the same for the same files, on every machine.
fn archive(model: &Model, libraries: &[(Platform, PathBuf)], description: &Description) -> Result<Vec<u8>> {
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let read =
        |path: &Path| std::fs::read(path).into_diagnostic().wrap_err_with(|| format!("reading {}", path.display()));
    for (platform, library) in libraries {
        files.insert(platform.entry(&model.name), read(library)?);
    }
    let readme = model.folder.join("README.md");
    let text = if readme.exists() { String::from_utf8_lossy(&read(&readme)?).into_owned() } else { String::new() };
    files.insert("documentation/index.html".to_owned(), documentation::page(&description.parsed, &text).into_bytes());
    for (name, license) in documentation::LICENSES {
        files.insert(format!("documentation/licenses/{name}"), license.as_bytes().to_vec());
    }
    for (file, entry) in [("model.png", "model.png"), ("reference.csv", documentation::REFERENCE_RUN)] {
        let path = model.folder.join(file);
        if path.exists() {
            files.insert(entry.to_owned(), read(&path)?);
        }
    }
    let resources = model.folder.join("resources");
    if resources.exists() {
        for entry in std::fs::read_dir(&resources).into_diagnostic()? {
            let path = entry.into_diagnostic()?.path();
            if let Some(name) = path.file_name().and_then(|name| name.to_str())
                && path.is_file()
            {
                files.insert(format!("resources/{name}"), read(&path)?);
            }
        }
    }

    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // The description stands first, as readers expect it; the rest in the order of the names.
    let first = ("modelDescription.xml".to_owned(), description.xml.as_bytes().to_vec());
    for (name, bytes) in std::iter::once(first).chain(files) {
        zip.start_file(name, options).into_diagnostic()?;
        zip.write_all(&bytes).into_diagnostic()?;
    }
    Ok(zip.finish().into_diagnostic()?.into_inner())
}

/// Writes a file so that it is there whole or not at all.
///
/// # Errors
/// When the folder is not writable.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let write = || -> std::io::Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(bytes)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644))?;
        }
        file.persist(path)?;
        Ok(())
    };
    write().into_diagnostic().wrap_err_with(|| format!("writing {}", path.display()))
}
