//! Mistakes in a declaration stop the compilation at the author's line, with a message that says what was expected.
//!
//! The messages are compared with the `.stderr` file beside each case. They hold the compiler's own words too, which
//! change from version to version, so they are compared only with the compiler they were made with. After moving to
//! another one: `TRYBUILD=overwrite cargo test -p fmi2 --test compile_fail`, a look at the difference, and a new number
//! here.

use std::process::Command;

/// The compiler that wrote the `.stderr` files.
const COMPILER: &str = "rustc 1.95.";

#[test]
fn mistakes_are_named_where_they_are_made() {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = Command::new(rustc).arg("--version").output().expect("rustc runs: it built this test").stdout;
    let version = String::from_utf8_lossy(&version);
    if !version.starts_with(COMPILER) {
        eprintln!("not compared: the messages are those of {COMPILER}x, this is {version}");
        return;
    }
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
