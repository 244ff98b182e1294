//! Folders with FMUs.

use std::path::PathBuf;

use fmu_system::resolve::FmuFolder;

use cargo_fmu::workspace::Workspace;

/// FMUs in folders. Of those that are missing, the current workspace, if any, can build its own.
pub(crate) fn folders(folders: &[PathBuf]) -> FmuFolder {
    let buildable = || Workspace::find().map_or(Vec::new(), |w| w.models.into_iter().map(|model| model.name).collect());
    FmuFolder::new(folders).with_buildable(buildable)
}
