//! Compiles the logger for FMI 2.0, which is a variadic function: stable Rust cannot define one.
//!
//! Without a C compiler for the target, messages contain the format specifiers instead of the arguments.

use std::env;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(log_arguments)");
    println!("cargo::rerun-if-changed=src/loader/logger.c");
    // When cross-compiling, the C compiler may produce code for the host.
    if env::var("TARGET") != env::var("HOST") {
        return;
    }
    let mut build = cc::Build::new();
    build.file("src/loader/logger.c").cargo_warnings(false);
    if build.try_compile("fmu_import_logger").is_ok() {
        println!("cargo::rustc-cfg=log_arguments");
    }
}
