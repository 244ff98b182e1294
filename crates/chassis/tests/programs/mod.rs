//! The programs that tests call.

use std::path::PathBuf;

/// Commands of `cargo fmu`. All other commands belong to `chassis`.
const EXPORTER: [&str; 6] = ["check", "inspect", "linearize", "new", "pack", "trim"];

/// The program that has a command. The program of another package exists if the whole workspace is tested.
pub(crate) fn program(command: &str) -> PathBuf {
    let chassis = PathBuf::from(env!("CARGO_BIN_EXE_chassis"));
    if !EXPORTER.contains(&command) {
        return chassis;
    }
    let exporter = chassis.with_file_name(format!("cargo-fmu{}", std::env::consts::EXE_SUFFIX));
    assert!(exporter.exists(), "{} is missing; `cargo test --workspace` builds it", exporter.display());
    exporter
}
