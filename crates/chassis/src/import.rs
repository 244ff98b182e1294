//! `chassis import`: writes the system in an SSP file as a scenario.

use crate::plan::print_warnings;
use cargo_fmu::outln;
use clap::Args;
use fmu_system::import::{Choice, import};
use fmu_system::resolve::{FmuFolder, Options, resolve};
use miette::{Context as _, IntoDiagnostic, miette};
use std::fs;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// SSP file
    system: PathBuf,

    #[command(flatten)]
    structure: Structure,

    /// Stop time in seconds, if the file has none
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    stop: Option<f64>,

    /// Folder for the scenario and its FMUs; it must be empty or not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Structure {
    /// Structure in an SSP file: the name of its .ssd file [default: SystemStructure]
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Option<String>,

    /// Communication step, in seconds
    #[arg(long, value_name = "H")]
    pub(crate) step: Option<f64>,
}

pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    let Arguments { system, structure: Structure { variant, step }, stop, out } = arguments;
    if system.extension().is_some_and(|extension| extension == "toml") {
        let help = "run it with `chassis run`; `chassis export` writes it as an SSP file";
        return Err(miette!(help = help, "{} must be an SSP file, got a scenario", system.display()));
    }
    if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(miette!("{}: the folder is not empty; choose another one", out.display()));
    }
    let imported = import(system, &Choice { variant: variant.clone(), stop: *stop, step: *step })?;
    let fmus = out.join("fmus");
    let scenario = out.join(system.file_stem().unwrap_or_default()).with_extension("toml");
    let write = || {
        fs::create_dir_all(&fmus)?;
        for entry in fs::read_dir(imported.folder.path())? {
            let entry = entry?;
            fs::copy(entry.path(), fmus.join(entry.file_name()))?;
        }
        fs::write(&scenario, &imported.text)
    };
    write().into_diagnostic().wrap_err_with(|| format!("writing to {}", out.display()))?;
    let mut plan = resolve(&scenario, &FmuFolder::new([&fmus]), &Options::default())?;
    plan.warnings.splice(0..0, imported.warnings);
    print_warnings(&plan);
    outln!("chassis run {} --fmus {}", scenario.display(), fmus.display());
    Ok(())
}
