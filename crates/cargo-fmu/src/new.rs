//! `cargo fmu new`: a package that builds and packs, to be changed into a model.

use std::path::PathBuf;

use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::output::outln;
use crate::pack::write_whole;
use crate::workspace::{Workspace, pascal_case};

/// What kind of model, and its name.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// plant (a differential equation) or controller (sampled)
    kind: Kind,
    /// Name of the package in kebab case, such as yaw-damper (the FMU becomes YawDamper)
    name: String,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Kind {
    Plant,
    Controller,
}

/// The files of a package and their templates.
fn files(kind: Kind) -> [(&'static str, &'static str); 4] {
    let (library, equations) = match kind {
        Kind::Plant => {
            (include_str!("../templates/plant/lib.rs.in"), include_str!("../templates/plant/equations.rs.in"))
        }
        Kind::Controller => {
            (include_str!("../templates/controller/lib.rs.in"), include_str!("../templates/controller/equations.rs.in"))
        }
    };
    [
        ("Cargo.toml", include_str!("../templates/Cargo.toml.in")),
        ("README.md", include_str!("../templates/README.md.in")),
        ("src/lib.rs", library),
        ("src/equations.rs", equations),
    ]
}

/// Writes the package.
///
/// # Errors
/// On a name that is not in kebab case, or a folder that exists already.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let name = &arguments.name;
    let word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    if !name.split('-').all(word) {
        return Err(miette!(
            "'{name}' is not in kebab case; expected lower-case words with hyphens, such as yaw-damper"
        ));
    }
    let workspace = Workspace::find()?;
    if workspace.models.iter().any(|model| model.package == *name) {
        return Err(miette!("there is a model named '{name}' already"));
    }
    let parent = match arguments.kind {
        Kind::Plant => "fmu-plant",
        Kind::Controller => "fmu-controllers",
    };
    let folder: PathBuf = workspace.root.join(parent).join(name);
    if folder.exists() {
        return Err(miette!("{parent}/{name} exists already; nothing was written"));
    }
    let fmu = pascal_case(name);
    for (file, template) in files(arguments.kind) {
        let text = template.replace("{Name}", &fmu).replace("{package}", name);
        write_whole(&folder.join(file), text.as_bytes()).wrap_err_with(|| format!("writing {parent}/{name}"))?;
    }
    // The lock file has to list the new package before anything is built with --locked.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let update = ["update", "--workspace", "--offline", "--quiet"];
    let status =
        std::process::Command::new(cargo).args(update).current_dir(&workspace.root).status().into_diagnostic()?;
    if !status.success() {
        return Err(miette!("the package was written, but `cargo update --workspace` failed; see the message above"));
    }
    outln!(
        "{parent}/{name} is ready. Next:\n  cargo test -p {name}\n  cargo fmu pack {fmu} --update-descriptions\n\
         then change the signals in src/lib.rs, the law in src/equations.rs, and the README."
    );
    Ok(())
}
