//! `cargo fmu pack`: builds models and zips them to FMUs.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use host::description::ModelDescription;
use host::loader::LoadError;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::build::{self, Asked, Linux};
use crate::documentation;
use crate::licenses::Licenses;
use crate::needed;
use crate::output::outln;
use crate::platform::Platform;
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
    /// A linux64 binary that loads on distributions from glibc 2.17 on (needs cargo-zigbuild, see scripts/setup)
    /// [default: `portable` in [workspace.metadata.fmu] of Cargo.toml]
    #[arg(long, overrides_with = "no_portable")]
    portable: bool,
    /// A linux64 binary that needs a glibc as new as the one of this machine, without cargo-zigbuild
    #[arg(long)]
    no_portable: bool,
    /// Folder the FMUs are written to [default: target/fmu]
    #[arg(long, value_name = "OUT")]
    out: Option<PathBuf>,
    /// Writes the generated model descriptions to modelDescription/, after an intended change of an interface
    #[arg(long)]
    update_descriptions: bool,
}

impl Arguments {
    /// Which linux64 binary: the command line decides, then the workspace.
    fn linux(&self, workspace: &Workspace) -> Linux {
        if self.portable {
            Linux::Portable(Asked::Option)
        } else if workspace.settings.portable && !self.no_portable {
            Linux::Portable(Asked::Workspace)
        } else {
            Linux::Native
        }
    }
}

/// Builds, checks against the committed descriptions, and zips.
///
/// # Errors
/// When a model does not build, its library has no description, or a file cannot be written.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
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
    // Before any build, because the user should not wait for one to hear what is missing.
    let builders = build::builders(&workspace, &arguments.platforms, arguments.linux(&workspace))?;
    if models.is_empty() {
        return Err(miette!("this workspace has no package with the crate type cdylib that depends on fmi2"));
    }
    let descriptions = describe(&workspace, &models)?;
    let guids: Vec<_> = descriptions.iter().map(|description| description.parsed.guid.as_str()).collect();
    let mut libraries = vec![Vec::new(); models.len()];
    let mut licenses = vec![Licenses::default(); models.len()];
    for builder in &builders {
        let built = builder.build(&workspace, &models, &guids)?;
        for (i, library) in built.into_iter().enumerate() {
            licenses[i].add(library.components);
            libraries[i].push((builder.platform(), library.path));
        }
    }
    let bar = ProgressBar::new(models.len() as u64).with_style(
        ProgressStyle::with_template("packing [{bar:30}] {pos}/{len} {msg}").expect("a constant template is valid"),
    );
    let mut changed = Vec::new();
    let mut report = Vec::new();
    for (i, (model, description)) in models.iter().zip(&descriptions).enumerate() {
        bar.set_message(model.name.clone());
        // The descriptions of examples are not committed.
        if model.is_default
            && !description_is_committed(&workspace, model, &description.xml, arguments.update_descriptions)?
        {
            changed.push(model.name.as_str());
        }
        let bytes = archive(model, &libraries[i], &licenses[i], description)?;
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

/// Builds the models as the tests do and asks them for their descriptions.
fn describe(workspace: &Workspace, models: &[Model]) -> Result<Vec<Description>> {
    build::for_description(workspace, models)?;
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

/// Compares with, or writes, `modelDescription/NAME.xml`. False if they differ.
fn description_is_committed(workspace: &Workspace, model: &Model, xml: &str, update: bool) -> Result<bool> {
    let path = workspace.root.join("modelDescription").join(format!("{}.xml", model.name));
    if update {
        write_whole(&path, xml.as_bytes())?;
    }
    Ok(std::fs::read_to_string(&path).is_ok_and(|committed| committed == xml))
}

/// The bytes of the FMU: the same for the same files, on every machine.
fn archive(
    model: &Model,
    libraries: &[(Platform, PathBuf)],
    licenses: &Licenses,
    description: &Description,
) -> Result<Vec<u8>> {
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let read =
        |path: &Path| std::fs::read(path).into_diagnostic().wrap_err_with(|| format!("reading {}", path.display()));
    for (platform, library) in libraries {
        files.insert(platform.entry(&model.name), read(library)?);
    }
    let readme = model.folder.join("README.md");
    let text = if readme.exists() { String::from_utf8_lossy(&read(&readme)?).into_owned() } else { String::new() };
    files.insert("documentation/index.html".to_owned(), documentation::page(&description.parsed, &text).into_bytes());
    for (name, text) in licenses.files(model) {
        files.insert(format!("documentation/licenses/{name}"), text.into_bytes());
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
