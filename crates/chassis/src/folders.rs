//! Folders with FMUs.

use std::path::{Path, PathBuf};

use cargo_fmu::workspace::Workspace;
use fmu_system::resolve::FmuFolder;

/// Output folder of `cargo fmu pack`, relative to the workspace root.
const PACKED: &str = "target/fmu";

/// FMUs in folders. Of those that are missing, the current workspace, if any, can build its own.
pub(crate) fn folders(given: &[PathBuf]) -> FmuFolder {
    let buildable = || Workspace::find().map_or(Vec::new(), |w| w.models.into_iter().map(|model| model.name).collect());
    FmuFolder::new(places(given)).with_buildable(buildable)
}

/// The given folders; without any, `target/fmu` of this folder or one above it, or, outside of workspaces, the FMUs that came with this
/// program.
pub(crate) fn places(given: &[PathBuf]) -> Vec<PathBuf> {
    if !given.is_empty() {
        return given.to_vec();
    }
    let here = std::env::current_dir().unwrap_or_default();
    let above = || here.ancestors().skip(1).map(|folder| folder.join(PACKED)).find(|folder| folder.is_dir());
    // In the repository the program is in `target`, in a wheel it is in a folder beside that of the FMUs. Another workspace may have
    // models of the same names.
    let own = || {
        if here.ancestors().any(|folder| folder.join("Cargo.toml").exists()) {
            return None;
        }
        let own = std::env::current_exe().ok()?;
        let places = own.ancestors().skip(2).take(2).flat_map(|folder| [folder.join("fmu"), folder.join("fmus")]);
        places.into_iter().find(|folder| folder.is_dir())
    };
    let here = Path::new(PACKED).to_path_buf();
    let found = if here.is_dir() { None } else { above().or_else(own) };
    vec![found.unwrap_or(here)]
}
