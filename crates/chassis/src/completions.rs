//! `chassis completions`: completion scripts.

use cargo_fmu::out;
use miette::Result;

/// Arguments of `chassis completions`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Shell
    shell: clap_complete::Shell,
}

/// Prints the script.
pub(crate) fn run(arguments: &Arguments, command: &mut clap::Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, command, "chassis", &mut script);
    out!("{}", String::from_utf8_lossy(&script));
    Ok(())
}
