//! FMUs that a scenario or a study needs.

#[cfg(feature = "system")]
pub(crate) use crate::system::needed::fmus;

/// Without the feature `system`, scenarios cannot be read.
#[cfg(not(feature = "system"))]
pub(crate) fn fmus(_file: &std::path::Path) -> miette::Result<std::collections::BTreeSet<String>> {
    Err(miette::miette!("`--for` needs a `cargo fmu` with the feature `system`"))
}
