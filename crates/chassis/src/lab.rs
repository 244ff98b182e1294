//! `chassis lab`: the site that simulates vehicles in a browser.

use std::process::Command;

use miette::{IntoDiagnostic as _, Result, WrapErr as _, miette};

use crate::python::{exit, root};

pub(crate) fn run(options: &[String]) -> Result<()> {
    let root = root().ok_or_else(|| {
        miette!(
            help = "Clone the repository, and call `scripts/lab` in it.",
            "the lab is built from the sources of the repository, and this program is not in one"
        )
    })?;
    let mut command = Command::new(root.join("scripts/lab"));
    let status = command.args(options).status().into_diagnostic().wrap_err("starting scripts/lab")?;
    if status.success() { Ok(()) } else { exit(status.code().unwrap_or(1)) }
}
