//! Result files, which are written completely or not at all.

use std::io::Write as _;
use std::path::Path;

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
    let write = || -> std::io::Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(bytes)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644))?;
        }
        file.persist(path)?;
        Ok(())
    };
    write().into_diagnostic().wrap_err_with(|| format!("writing {}", path.display()))
}
