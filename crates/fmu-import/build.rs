//! Compiles the logger of FMI 2.0, whose calls have a variable number of arguments: stable Rust cannot define such a function.
//!
//! Without a C compiler for the target, messages contain the conversions instead of their arguments.

use std::env;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(log_arguments)");
    println!("cargo::rerun-if-changed=src/loader/logger.c");
    // When cross-compiling, the C compiler found may be that of the host.
    if env::var("TARGET") != env::var("HOST") {
        return;
    }
    let mut build = cc::Build::new();
    build.file("src/loader/logger.c").cargo_warnings(false);
    if build.try_compile("fmu_import_logger").is_ok() {
        println!("cargo::rustc-cfg=log_arguments");
    }
}
