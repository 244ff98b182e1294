//! A mistake in a declaration is a compile error at the author's line, with a message that states the rule.
//!
//! The messages are compared with the `.stderr` file next to each case. They include text from the compiler, so the
//! test is valid for one compiler version only. To switch to another version, run `TRYBUILD=overwrite cargo test -p fmu
//! --test compile_fail -- --ignored`, review the difference, and change the number here.

use std::process::Command;

/// The compiler that wrote the `.stderr` files.
const COMPILER: &str = "rustc 1.95.";

// Ignored by default, because scripts/test accepts any compiler from the MSRV on. `.ci/run` uses the right one.
#[test]
#[ignore = "compares messages of rustc 1.95; .ci/run runs this test"]
fn mistakes_are_named_where_they_are_made() {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = Command::new(rustc).arg("--version").output().expect("rustc runs: it built this test").stdout;
    let version = String::from_utf8_lossy(&version);
    assert!(version.starts_with(COMPILER), "the messages are those of {COMPILER}x, this is {version}");
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
