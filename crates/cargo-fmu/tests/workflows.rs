//! The workflows that `cargo fmu new --ci` writes.
//!
//! References: the files in `tests/data/workflows`. zizmor 1.32 (`--pedantic`) finds nothing in the file for GitHub.
use std::path::Path;
use std::process::{Command, Output};

fn new(folder: &Path, service: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    command.args(["fmu", "new", "--ci", service]).current_dir(folder).output().unwrap()
}

/// The message of a failed call, without its line breaks.
fn message(output: &Output) -> String {
    assert!(!output.status.success());
    String::from_utf8_lossy(&output.stderr).split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

#[test]
fn workflows_are_those_of_the_snapshots() {
    for (service, file, snapshot) in [
        ("github", ".github/workflows/fmu.yml", include_str!("data/workflows/github.yml")),
        ("gitlab", ".gitlab-ci.yml", include_str!("data/workflows/gitlab.yml")),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let error = message(&new(folder.path(), service));
        assert!(error.contains("could not find `Cargo.toml`"), "{error}");
        std::fs::write(folder.path().join("Cargo.toml"), "[workspace]\nresolver = \"3\"\n").unwrap();
        // The workflow belongs to the workspace, so the folder in which the command is called does not matter.
        let inside = folder.path().join("models");
        std::fs::create_dir(&inside).unwrap();
        let output = new(&inside, service);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let written = std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert_eq!(written.replace(env!("CARGO_PKG_VERSION"), "VERSION"), snapshot);
        let error = message(&new(&inside, service));
        assert!(error.contains("exists already; nothing was written"), "{error}");
    }
}
