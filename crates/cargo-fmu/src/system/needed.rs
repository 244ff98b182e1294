//! FMUs that a scenario or a study needs.

use std::collections::BTreeSet;
use std::path::Path;

use miette::Result;

/// Names of the FMUs of a scenario, or of the scenario of a study.
///
/// # Errors
/// The file cannot be read or does not have the layout of either.
pub(crate) fn fmus(file: &Path) -> Result<BTreeSet<String>> {
    Ok(if fmu_study::study::is_study(file) {
        let (scenario, mut fmus) = fmu_study::study::needs(file)?;
        fmus.append(&mut fmu_system::resolve::fmu_names(&scenario)?);
        fmus
    } else {
        fmu_system::resolve::fmu_names(file)?
    })
}
