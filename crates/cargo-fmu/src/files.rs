//! Result files, which are written completely or not at all.

use std::path::Path;

use fmu_import::temporary;
use miette::{IntoDiagnostic, Result, WrapErr};

/// Fails if the folder is not writable. Otherwise, a long run would fail only at its end.
pub fn try_to_write(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .and_then(|()| tempfile::tempfile_in(folder).map(drop))
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write to {}; nothing was simulated", folder.display()))
}

/// Writes a file completely or not at all.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    temporary::write_whole(path, bytes).into_diagnostic().wrap_err_with(|| format!("writing {}", path.display()))
}
