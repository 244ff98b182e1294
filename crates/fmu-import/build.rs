//! Compiles the logger of FMI 2.0, whose calls have a variable number of arguments: stable Rust cannot define such a function.
//!
//! Where there is no C compiler for the target, messages keep the conversions in place of their arguments.

use std::env;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(log_arguments)");
    println!("cargo::rerun-if-changed=src/loader/logger.c");
    // The C compiler that is found for another system may be that of this one.
    if env::var("TARGET") != env::var("HOST") {
        return;
    }
    let mut build = cc::Build::new();
    build.file("src/loader/logger.c").cargo_warnings(false);
    if build.try_compile("fmu_import_logger").is_ok() {
        println!("cargo::rustc-cfg=log_arguments");
    }
}
