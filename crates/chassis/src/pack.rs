//! `chassis pack`: the FMUs that a scenario or a study needs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use cargo_fmu::pack::{Settings, pack_needed};
use miette::Result;

/// Arguments of `chassis pack`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Scenario or study file (TOML)
    file: PathBuf,
    #[command(flatten)]
    settings: Settings,
}

/// Packs the FMUs.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    pack_needed(&fmus(&arguments.file)?, &arguments.settings)
}

/// Names of the FMUs of a scenario, or of the scenario of a study.
///
/// # Errors
/// The file cannot be read or does not have the layout of either.
fn fmus(file: &Path) -> Result<BTreeSet<String>> {
    Ok(if fmu_study::study::is_study(file) {
        let (scenario, mut fmus) = fmu_study::study::needs(file)?;
        fmus.append(&mut fmu_system::resolve::fmu_names(&scenario)?);
        fmus
    } else {
        fmu_system::resolve::fmu_names(file)?
    })
}
