//! Mistakes in a declaration stop the compilation at the author's line, with a message that says what was expected.
//!
//! The messages are compared with the `.stderr` file beside each case. They hold the compiler's own words too, so a
//! new toolchain may need `TRYBUILD=overwrite cargo test -p fmi2 --test compile_fail` and a look at the difference.

#[test]
fn mistakes_are_named_where_they_are_made() {
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
