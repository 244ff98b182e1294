//! `cargo fmu pack`: builds models and packs them into FMUs.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use fmu_import::archive::Archive;
use fmu_import::description::{FmiVersion, ModelDescription};
use fmu_import::loader::{description_options, exported_descriptions};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::build::{self, Export, Interface};
use crate::documentation;
use crate::files::write_whole;
use crate::licenses::{self, Component};
use crate::new;
use crate::platform::Platform;
use crate::workspace::{Model, Workspace};
use crate::{errln, outln};

/// Arguments of `cargo fmu pack`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Names of FMUs or packages, such as RescueVehicle or rescue-vehicle [default: all models, as with --all]
    names: Vec<String>,
    /// Pack all models of the workspace's default members
    #[arg(long, conflicts_with = "names")]
    all: bool,
    /// Moved to another command
    #[arg(long = "for", value_name = "FILE", hide = true)]
    needed_by: Option<PathBuf>,
    #[command(flatten)]
    settings: Settings,
}

/// Options on how FMUs are built and packed.
#[derive(clap::Args, Debug)]
pub struct Settings {
    /// Platforms to build for, separated by commas [default: platform of this machine]
    ///
    /// Other platforms need cargo-zigbuild (Linux) or mingw-w64 (Windows), and a Rust toolchain for that platform.
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    platforms: Vec<Platform>,
    /// Build Linux binaries for glibc 2.17 and newer [default: `portable` in [workspace.metadata.fmu] of Cargo.toml]
    ///
    /// This needs cargo-zigbuild (see scripts/setup --all).
    #[arg(long, overrides_with = "no_portable")]
    portable: bool,
    /// Build Linux binaries without cargo-zigbuild; they need a glibc at least as new as this machine's
    #[arg(long)]
    no_portable: bool,
    /// Interfaces of the FMUs, separated by commas [default: all that the model has]
    ///
    /// Stateful models have co-simulation only. Discrete-time models with clocks have co-simulation and, if every clock
    /// has a priority, scheduled execution.
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    interfaces: Vec<Interface>,
    /// FMI version of the FMUs, 2 or 3
    #[arg(long, value_name = "VERSION", default_value_t = 2, value_parser = clap::value_parser!(i32).range(2..=3))]
    fmi: i32,
    /// Write arrays with numbered elements as variables with dimensions instead of one variable per element; requires
    /// --fmi 3
    #[arg(long)]
    arrays: bool,
    /// Give discrete-time models an input clock, `sample`, which the importer activates in Event Mode at each sample
    /// time; requires --fmi 3
    ///
    /// All inputs and outputs belong to the clock. Its interval is the parameter `sample_time`. Such FMUs have
    /// co-simulation and scheduled execution, but no model exchange. Models that are not discrete-time, and models with
    /// clocks of their own, stay as they are.
    #[arg(long)]
    clocks: bool,
    /// Folder for the FMUs [default: target/fmu, with --fmi 3 target/fmu3]
    #[arg(long, value_name = "OUT")]
    out: Option<PathBuf>,
    /// Update the committed model descriptions, after an intended change of an interface
    ///
    /// Their folder is set by `descriptions` in [workspace.metadata.fmu] of Cargo.toml.
    #[arg(long)]
    update_descriptions: bool,
    /// Add a list of everything linked into the FMU, in the format CycloneDX: extra/io.github.chassis-fmu/sbom.cdx.json
    #[arg(long)]
    sbom: bool,
    #[command(flatten)]
    cargo: build::Options,
}

impl Settings {
    fn format(&self) -> Result<Format> {
        for (is_given, what) in [
            (self.arrays, "arrays"),
            (self.clocks, "clocks"),
            (self.interfaces.contains(&Interface::Se), "scheduled execution"),
        ] {
            if is_given && self.fmi == 2 {
                return Err(miette!(help = "Add --fmi 3.", "FMI 2.0 has no {what}"));
            }
        }
        Ok(Format { version: self.fmi, interfaces: self.interfaces.clone(), arrays: self.arrays, clocks: self.clocks })
    }

    fn folder(&self, workspace: &Workspace) -> PathBuf {
        let default = || if self.fmi == 3 { workspace.fmus_of_fmi3() } else { workspace.fmus() };
        self.out.clone().unwrap_or_else(default)
    }

    /// The option or setting that requests portable Linux binaries. The command line takes precedence over the
    /// workspace.
    fn portable(&self, workspace: &Workspace) -> Option<&'static str> {
        if self.portable {
            return Some(build::PORTABLE);
        }
        let is_set = workspace.settings.portable && !self.no_portable;
        is_set.then_some("`portable = true` in [workspace.metadata.fmu] of Cargo.toml")
    }
}

/// Treatment of FMUs from an earlier call.
#[derive(Clone, Copy, PartialEq)]
enum Existing {
    Replaced,
    /// FMUs that differ from the earlier ones at most in their commit are neither written nor listed.
    KeptIfEqual,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    if arguments.needed_by.is_some() {
        return Err(miette!("`cargo fmu pack --for FILE` is called `chassis pack FILE` now"));
    }
    let workspace = find(&arguments.settings)?;
    let models = workspace.select(&arguments.names, arguments.all)?;
    pack(&workspace, models, &arguments.settings, Existing::Replaced)
}

/// Packs FMUs whose models are in the current workspace, unless they are up to date. Other names are ignored.
pub fn pack_needed(fmus: &BTreeSet<String>, settings: &Settings) -> Result<()> {
    let workspace = find(settings)?;
    let models = workspace.models_of(fmus);
    if models.is_empty() {
        // None of the FMUs has its model in this workspace.
        return Ok(());
    }
    let folder = settings.folder(&workspace);
    let is_missing = |model: &&Model| !folder.join(format!("{}.fmu", model.name)).exists();
    let missing: Vec<&str> = models.iter().filter(is_missing).map(|model| model.name.as_str()).collect();
    if !missing.is_empty() {
        eprintln!("Building {}; the first build also compiles the dependencies", missing.join(", "));
    }
    pack(&workspace, models, settings, Existing::KeptIfEqual)
}

fn find(settings: &Settings) -> Result<Workspace> {
    let mut workspace = Workspace::find()?;
    if let Some(target) = &settings.cargo.target_dir {
        workspace.target = std::path::absolute(target).into_diagnostic()?;
    }
    Ok(workspace)
}

/// Builds the models, compares their descriptions with the committed ones, and writes the FMUs.
fn pack(workspace: &Workspace, models: Vec<Model>, arguments: &Settings, existing: Existing) -> Result<()> {
    let format = arguments.format()?;
    let folder = arguments.folder(workspace);
    // This comes before any build, so that missing tools are reported early.
    let builders = build::builders(workspace, &arguments.platforms, arguments.portable(workspace), format.version)?;
    if models.is_empty() {
        return Err(miette!(
            help = "Set `crate-type = [\"cdylib\", \"rlib\"]` in the section [lib] of its Cargo.toml.",
            "this workspace has no package with the crate type cdylib that depends on fmu"
        ));
    }
    let _lock = build::lock(workspace)?;
    let (models, descriptions) = describe(workspace, models, &format, &arguments.cargo)?;
    // Examples are exempt: their names can come from other projects.
    for (model, description) in models.iter().zip(&descriptions).filter(|(model, _)| model.is_default) {
        follow_convention(workspace, model, &description.parsed)?;
    }
    let exports: Vec<_> = descriptions.iter().map(|description| description.export(&format)).collect();
    let packages = build::packages(workspace, &arguments.cargo)?;
    let mut libraries = vec![Vec::new(); models.len()];
    let mut licenses = vec![BTreeSet::new(); models.len()];
    for builder in &builders {
        let (paths, artifacts) = builder.build(workspace, &models, &exports, &packages, &arguments.cargo)?;
        let components = licenses::components(builder, workspace, &packages, &artifacts)
            .wrap_err("collecting the licenses of what is linked")?;
        for (i, (library, components)) in paths.into_iter().zip(components).enumerate() {
            licenses[i].extend(components);
            libraries[i].push((builder.platform, library));
        }
    }
    let commit = workspace.commit().map(|commit| format!("{commit}\n").into_bytes());
    let bar = ProgressBar::new(models.len() as u64).with_style(
        ProgressStyle::with_template("packing [{bar:30}] {pos}/{len} {msg}").expect("a constant template is valid"),
    );
    let mut changed = Vec::new();
    let mut report = Vec::new();
    let mut placeholders = Vec::new();
    for (i, (model, description)) in models.iter().zip(&descriptions).enumerate() {
        bar.set_message(model.name.clone());
        // Descriptions of examples and descriptions in other formats are not committed.
        let is_committed = model.is_default && format.is_default();
        if let Some(folder) = workspace.settings.descriptions.as_ref().filter(|_| is_committed)
            && !description_is_committed(
                &workspace.root.join(folder),
                model,
                &description.xml,
                arguments.update_descriptions,
            )?
        {
            changed.push(model.name.as_str());
        }
        let binaries: Vec<&Path> = libraries[i].iter().map(|(_, path)| path.as_path()).collect();
        let findings = fmu_check::without_running(&description.xml, &binaries);
        if !findings.is_empty() {
            let findings: Vec<_> = findings.iter().map(ToString::to_string).collect();
            let version = format.version;
            return Err(miette!("{} does not follow FMI {version}.0:\n{}", model.name, findings.join("\n")));
        }
        let readme = readme(model)?;
        let mut files = files(model, &libraries[i], &licenses[i], description, &readme)?;
        if arguments.sbom {
            files.insert(documentation::SBOM.to_owned(), licenses::sbom(&licenses[i], model).into_bytes());
        }
        let path = folder.join(format!("{}.fmu", model.name));
        bar.inc(1);
        if existing == Existing::KeptIfEqual {
            let commit_of_old =
                Archive::open(&path).and_then(|mut old| old.entry(documentation::COMMIT)).ok().flatten();
            let bytes = archive(&description.xml, &files, commit_of_old.as_deref())?;
            if std::fs::read(&path).is_ok_and(|old| old == bytes) {
                continue;
            }
        }
        let bytes = archive(&description.xml, &files, commit.as_deref())?;
        write_whole(&path, &bytes)?;
        if let Some(line) = new::placeholder(&readme) {
            placeholders.push((model.name.as_str(), line.to_owned()));
        }
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
    for (name, line) in placeholders {
        errln!(
            "note: README.md of {name} still contains placeholder text, which the documentation of the FMU shows: {line}"
        );
    }
    for (model, description) in models.iter().zip(&descriptions) {
        for note in &description.notes {
            errln!(
                "note: the model structure of {} declares that everything depends on everything, because {note}",
                model.name
            );
        }
    }
    if !changed.is_empty() {
        eprintln!(
            "The interface of {} differs from the description in {}, or there is none yet; if that is intended, run `cargo fmu \
             pack --update-descriptions` and commit the change.",
            changed.join(", "),
            workspace.settings.descriptions.as_deref().unwrap_or(Path::new("")).display()
        );
    }
    Ok(())
}

struct Format {
    version: i32,
    /// Empty for all interfaces that the model has.
    interfaces: Vec<Interface>,
    arrays: bool,
    clocks: bool,
}

impl Format {
    /// Sum of the flags that request a description in this format from a library.
    fn options(&self) -> i32 {
        let interfaces = match &*self.interfaces {
            [] => Interface::Cs.bit() | Interface::Me.bit() | description_options::SCHEDULED_EXECUTION_IF_POSSIBLE,
            given => given.iter().fold(0, |sum, interface| sum | interface.bit()),
        };
        interfaces | if self.arrays { description_options::ARRAYS } else { 0 }
    }

    /// True for the format of the committed descriptions.
    fn is_default(&self) -> bool {
        let has = |interface| self.interfaces.is_empty() || self.interfaces.contains(&interface);
        self.version == 2 && has(Interface::Cs) && has(Interface::Me)
    }
}

struct Description {
    /// Name of the model's type.
    model: String,
    xml: String,
    /// terminalsAndIcons.xml; empty in FMI 2.0.
    terminals: String,
    /// Reasons for a dense model structure.
    notes: Vec<String>,
    /// Dependencies of the equations as text, for FMI 3.0.
    dependencies: Option<String>,
    parsed: ModelDescription,
}

impl Description {
    fn export(&self, format: &Format) -> Export {
        let has = |interface: &Interface| match interface {
            Interface::Cs => self.parsed.co_simulation.is_some(),
            Interface::Me => self.parsed.model_exchange.is_some(),
            Interface::Se => self.parsed.scheduled_execution.is_some(),
        };
        Export {
            model: self.model.clone(),
            guid: self.parsed.guid.clone(),
            version: format.version,
            interfaces: [Interface::Cs, Interface::Me, Interface::Se].into_iter().filter(has).collect(),
            indicators: self.parsed.number_of_event_indicators,
            arrays: format.arrays,
            clocks: format.clocks,
            dependencies: self.dependencies.clone(),
        }
    }
}

/// Asks the models for their descriptions, which also contain their names.
fn describe(
    workspace: &Workspace,
    mut models: Vec<Model>,
    format: &Format,
    options: &build::Options,
) -> Result<(Vec<Model>, Vec<Description>)> {
    let libraries = build::for_description(workspace, &models, options, format.clocks)?;
    let mut descriptions = Vec::new();
    for (model, library) in models.iter_mut().zip(libraries) {
        let describe = || -> Result<Description> {
            let ask = |options| exported_descriptions(&library, format.version, options);
            let mut exported = ask(format.options()).into_diagnostic()?;
            match (exported.pop(), exported.len()) {
                (Some((name, xml)), 0) => {
                    let parsed = ModelDescription::parse(&xml).into_diagnostic()?;
                    let notes = ask(format.options() | description_options::NOTES).into_diagnostic()?;
                    let notes = notes.iter().flat_map(|(_, notes)| notes.lines());
                    let notes = notes.filter(|note| !note.is_empty()).map(str::to_owned).collect();
                    let of_fmi3 = |option: i32| match format.version {
                        3 => {
                            let text = ask(format.options() | option).into_diagnostic()?.pop();
                            Ok::<_, miette::Report>(text.map(|(_, text)| text))
                        }
                        _ => Ok(None),
                    };
                    let terminals = of_fmi3(description_options::TERMINALS)?.unwrap_or_default();
                    let dependencies = of_fmi3(description_options::DEPENDENCIES)?;
                    Ok(Description { model: name, parsed, xml, terminals, notes, dependencies })
                }
                (None, _) => Err(miette!(
                    help = "Put `#[fmu::model(stop_time = …, step_size = …)]` on the implementation of `Continuous`, \
                            `Discrete` or `Stateful`.",
                    "the package exports no model"
                )),
                (Some((last, _)), _) => Err(miette!(
                    help = "Move each model into a package of its own.",
                    "the package exports several models: {}, {last}",
                    exported.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
                )),
            }
        };
        let description = describe().wrap_err_with(|| format!("reading the description of {}", model.package))?;
        model.name.clone_from(&description.parsed.model_name);
        descriptions.push(description);
    }
    Ok((models, descriptions))
}

/// Fails if a model breaks the naming convention of the workspace.
fn follow_convention(workspace: &Workspace, model: &Model, description: &ModelDescription) -> Result<()> {
    let Some(convention) = workspace.settings.names else { return Ok(()) };
    let names = description.variables.iter().map(|variable| variable.name.as_str());
    let others: Vec<&str> = names.filter(|name| !convention.admits(name)).collect();
    let Some(first) = others.first() else { return Ok(()) };
    let more = if others.len() > 1 { format!(" and {} more", others.len() - 1) } else { String::new() };
    Err(miette!(
        help = "Rename it, as in `#[var(\"speed.vehicle\")]`, or remove `names` from [workspace.metadata.fmu] in Cargo.toml at \
                the top of the workspace: FMI allows any name.",
        "the name `{first}`{more} of a variable of {} does not follow the convention of this workspace: words in lower snake case, \
         joined by dots",
        model.name
    ))
}

/// Compares a description with `NAME.xml` in the folder of committed descriptions; with `update`, writes this file.
/// Returns false if they differ.
fn description_is_committed(folder: &Path, model: &Model, xml: &str, update: bool) -> Result<bool> {
    let path = folder.join(format!("{}.xml", model.name));
    if update {
        write_whole(&path, xml.as_bytes())?;
    }
    Ok(std::fs::read_to_string(&path).is_ok_and(|committed| committed == xml))
}

fn readme(model: &Model) -> Result<String> {
    let path = model.folder.join("README.md");
    if path.exists() { Ok(String::from_utf8_lossy(&read(&path)?).into_owned()) } else { Ok(String::new()) }
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).into_diagnostic().wrap_err_with(|| format!("reading {}", path.display()))
}

/// Icon of a model without one: FMI 3.0 recommends an icon.
const ICON: &[u8] = include_bytes!("icon.png");

/// The files of the FMU except its description.
fn files(
    model: &Model,
    libraries: &[(Platform, PathBuf)],
    components: &BTreeSet<Component>,
    description: &Description,
    readme: &str,
) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut files = BTreeMap::new();
    let is_fmi3 = description.parsed.fmi == FmiVersion::V3;
    for (platform, library) in libraries {
        files.insert(platform.entry(description.parsed.fmi, &model.name), read(library)?);
    }
    for (name, text) in licenses::files(components, model) {
        files.insert(format!("documentation/licenses/{name}"), text.into_bytes());
    }
    let icon = model.folder.join("model.png");
    let icon = if icon.exists() { Some(read(&icon)?) } else { None };
    if is_fmi3 {
        let (folder, icon) = ("terminalsAndIcons", icon.unwrap_or_else(|| ICON.to_vec()));
        files.insert(format!("{folder}/terminalsAndIcons.xml"), description.terminals.clone().into_bytes());
        files.insert(documentation::ICON.to_owned(), icon);
    } else if let Some(icon) = icon {
        files.insert(documentation::ICON_OF_FMI2.to_owned(), icon);
    }
    let reference = model.folder.join("reference.csv");
    if reference.exists() {
        files.insert(documentation::REFERENCE_RUN.to_owned(), read(&reference)?);
    }
    let page = documentation::page(&description.parsed, readme, &files);
    files.insert("documentation/index.html".to_owned(), page.into_bytes());
    let resources = model.folder.join("resources");
    if resources.exists() {
        add_folder(&resources, "resources", &mut files)?;
    }
    Ok(files)
}

/// The bytes of the FMU. The same files give the same bytes on every machine.
fn archive(xml: &str, files: &BTreeMap<String, Vec<u8>>, commit: Option<&[u8]>) -> Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // The description comes first, as readers expect; the rest is sorted by name.
    let mut entries: BTreeMap<_, _> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    entries.extend(commit.map(|commit| (documentation::COMMIT, commit)));
    for (name, bytes) in std::iter::once(("modelDescription.xml", xml.as_bytes())).chain(entries) {
        zip.start_file(name, options).into_diagnostic()?;
        zip.write_all(bytes).into_diagnostic()?;
    }
    Ok(zip.finish().into_diagnostic()?.into_inner())
}

fn add_folder(folder: &Path, entry: &str, files: &mut BTreeMap<String, Vec<u8>>) -> Result<()> {
    let reading = || format!("reading {}", folder.display());
    for item in std::fs::read_dir(folder).into_diagnostic().wrap_err_with(reading)? {
        let path = item.into_diagnostic()?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        let name = name.ok_or_else(|| miette!("the name of {} is not UTF-8, rename it", path.display()))?;
        let entry = format!("{entry}/{name}");
        if path.is_dir() {
            add_folder(&path, &entry, files)?;
        } else {
            let bytes = std::fs::read(&path).into_diagnostic();
            files.insert(entry, bytes.wrap_err_with(|| format!("reading {}", path.display()))?);
        }
    }
    Ok(())
}
