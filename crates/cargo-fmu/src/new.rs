//! `cargo fmu new`: writes a working package, which users turn into their model, and a workflow for the workspace.

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::ValueEnum as _;
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::files::write_whole;
use crate::outln;
use crate::toolchain::cargo;
use crate::workspace::{Workspace, pascal_case};

/// Arguments of `cargo fmu new`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Folder of the new package, named in kebab case, such as heat-pump or models/heat-pump
    ///
    /// The FMU gets the name in Pascal case, HeatPump.
    #[arg(required_unless_present = "ci")]
    path: Option<PathBuf>,
    /// Kind of model
    #[arg(long, value_enum, default_value_t = Kind::Continuous)]
    kind: Kind,
    /// Folder of the crate `fmu`, if it is neither in the workspace nor in a registry
    #[arg(long, value_name = "DIR")]
    exporter_path: Option<PathBuf>,
    /// Write a workflow that tests all models of the workspace, packs them for all platforms and checks the FMUs
    ///
    /// Without a folder of a new package, only the workflow is written.
    #[arg(long, value_enum, value_name = "SERVICE")]
    ci: Option<Ci>,
    /// Moved to another command
    #[arg(long, value_name = "FMU", hide = true)]
    plant: Option<String>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Ci {
    /// GitHub Actions: .github/workflows/fmu.yml
    Github,
    /// GitLab CI/CD: .gitlab-ci.yml
    Gitlab,
}

impl Ci {
    /// Path in the workspace, and template.
    const fn file(self) -> (&'static str, &'static str) {
        match self {
            Self::Github => (".github/workflows/fmu.yml", include_str!("../templates/github.yml.in")),
            Self::Gitlab => (".gitlab-ci.yml", include_str!("../templates/gitlab.yml.in")),
        }
    }
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Kind {
    /// A continuous-time model: differential equations
    Continuous,
    /// A discrete-time model, updated at each sample: a controller, a filter, a signal source
    Discrete,
    /// An existing simulation that advances itself
    Stateful,
    /// Moved to another command
    #[value(hide = true)]
    Scenario,
}

impl Kind {
    const fn template(self) -> &'static str {
        match self {
            Self::Continuous => include_str!("../templates/continuous.rs.in"),
            Self::Discrete => include_str!("../templates/discrete.rs.in"),
            Self::Stateful => include_str!("../templates/stateful.rs.in"),
            // Scenarios are not packages.
            Self::Scenario => "",
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    if matches!(arguments.kind, Kind::Scenario) || arguments.plant.is_some() {
        return Err(miette!("`cargo fmu new PATH --kind scenario` is called `chassis new PATH` now"));
    }
    // Outside of a workspace there are no settings, and the new package is the workspace.
    let workspace = Workspace::find();
    let root = workspace.as_ref().ok().map(|workspace| workspace.root.clone()).or_else(|| arguments.path.clone());
    let workflow = arguments.ci.zip(root).map(|(ci, root)| (root.join(ci.file().0), ci.file().1));
    if let Some((path, _)) = workflow.as_ref().filter(|(path, _)| path.exists()) {
        return Err(miette!("{} exists already; nothing was written", path.display()));
    }
    match (&arguments.path, workspace) {
        (Some(path), workspace) => package(path, workspace.ok(), arguments)?,
        (None, Err(error)) => return Err(error),
        (None, Ok(_)) => {}
    }
    if let Some((path, template)) = workflow {
        write_whole(&path, template.replace("{version}", env!("CARGO_PKG_VERSION")).as_bytes())?;
        outln!("{} tests, packs and checks all models of the workspace.", path.display());
    }
    Ok(())
}

fn package(path: &Path, workspace: Option<Workspace>, arguments: &Arguments) -> Result<()> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let is_word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    if !name.split('-').all(is_word) {
        return Err(miette!("`{name}` must be in kebab case: lower-case words with hyphens, such as heat-pump"));
    }
    // The settings use the command line's names for the kinds.
    let kind = arguments.kind.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned());
    let folder = workspace.as_ref().map_or_else(|| path.to_owned(), |workspace| workspace.place(path, &kind));
    if folder.exists() {
        return Err(miette!("{} exists already; nothing was written", folder.display()));
    }
    if let Some(path) = &arguments.exporter_path
        && !path.join("Cargo.toml").exists()
    {
        return Err(miette!("--exporter-path must be a folder with a Cargo.toml, {} has none", path.display()));
    }
    // If there is a workspace, cargo adds the package to it, and the package inherits keys from it.
    let made = succeed(cargo().args(["new", "--lib", "--quiet", "--vcs", "none"]).arg(&folder))
        .and_then(|()| fill(&folder, name, arguments))
        .and_then(|()| match workspace {
            // A workspace ignores its folder `target` already.
            Some(_) => Ok(()),
            None => write_whole(&folder.join(".gitignore"), b"/target\n"),
        })
        .wrap_err_with(|| format!("writing {}", folder.display()));
    if made.is_err() {
        // Removes a partial package; the folder did not exist before this call.
        let _ = std::fs::remove_dir_all(&folder);
    }
    made?;
    let fmu = pascal_case(name);
    let inside = folder.strip_prefix(std::env::current_dir().into_diagnostic()?).unwrap_or(&folder);
    let enter = if workspace.is_some() { String::new() } else { format!("  cd {}\n", inside.display()) };
    outln!(
        "{} is ready. Next:\n{enter}  cargo test -p {name}\n  cargo fmu pack {name}\n  cargo fmu check {fmu}\n\
         Then change src/lib.rs and the README.",
        inside.display()
    );
    Ok(())
}

/// README of a new package: sections with placeholder text.
const README: &str = include_str!("../templates/README.md.in");

/// The first line of a README that is still placeholder text from the template.
pub(crate) fn placeholder(readme: &str) -> Option<&str> {
    let is_text = |line: &&str| !line.is_empty() && !line.starts_with('#');
    readme.lines().filter(is_text).find(|line| README.lines().any(|placeholder| placeholder == *line))
}

/// Turns the library that cargo has written into a model.
fn fill(folder: &Path, name: &str, arguments: &Arguments) -> Result<()> {
    let manifest = folder.join("Cargo.toml");
    let mut add = cargo();
    add.args(["add", "--quiet", "--manifest-path"]).arg(&manifest).arg("fmu");
    if let Some(path) = &arguments.exporter_path {
        add.arg("--path").arg(std::path::absolute(path).into_diagnostic()?);
    }
    succeed(&mut add).map_err(|error| {
        miette!(
            help = "--exporter-path DIR takes the crate from a folder.",
            "the crate `fmu` cannot be added as a dependency: {error}"
        )
    })?;
    let text = std::fs::read_to_string(&manifest).into_diagnostic()?;
    let library = "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n\n[dependencies]";
    write_whole(&manifest, text.replacen("[dependencies]", library, 1).as_bytes())?;
    let fmu = pascal_case(name);
    for (file, template) in [("src/lib.rs", arguments.kind.template()), ("README.md", README)] {
        write_whole(&folder.join(file), template.replace("{Name}", &fmu).as_bytes())?;
    }
    Ok(())
}

/// Runs a command that prints nothing unless it fails.
fn succeed(command: &mut Command) -> Result<()> {
    let output = command.output().into_diagnostic().wrap_err("cargo cannot be run; is it on the PATH?")?;
    if output.status.success() {
        return Ok(());
    }
    Err(miette!("{}", String::from_utf8_lossy(&output.stderr).trim()))
}
