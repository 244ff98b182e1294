//! The compiler vectorizes the array versions of the functions: each instruction processes two elements. The language
//! does not guarantee this. These tests check the assembly of `examples/lanes.rs`, which contains the fast paths, and
//! of the library, which contains the general paths. They fail if a compiler version no longer vectorizes the
//! functions.
#![cfg(target_arch = "x86_64")]

use std::path::Path;
use std::process::Command;

/// A function, and the maximum number of scalar additions, subtractions, multiplications and divisions.
type Limit = (&'static str, usize);

const FAST_PATHS: [Limit; 4] =
    [("four_arctangents", 0), ("four_exponentials", 0), ("four_hyperbolic_tangents", 0), ("four_sines_and_cosines", 0)];

/// General paths for two elements.
const GENERAL_PATHS: [Limit; 4] =
    [("9atan_each3two", 0), ("8sin_each3two", 0), ("8cos_each3two", 0), ("8tan_each3two", 0)];

fn is_arithmetic(instruction: &str, suffix: &str) -> bool {
    ["add", "sub", "mul", "div"].iter().any(|operation| instruction.strip_prefix(operation) == Some(suffix))
}

/// The assembly of an artifact of this package.
fn assembly(artifact: &[&str], folder: &str) -> String {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("instructions");
    let folder = target.join("release").join(folder);
    let _ = std::fs::remove_dir_all(&folder);
    let status = Command::new(env!("CARGO"))
        .args(["rustc", "--quiet", "--release"])
        .args(artifact)
        .arg("--target-dir")
        .arg(&target)
        .args(["--", "--emit", "asm", "-C", "codegen-units=1"])
        .current_dir(package)
        .status()
        .unwrap();
    assert!(status.success());
    let mut files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let file = files.find(|path| path.extension().is_some_and(|extension| extension == "s")).unwrap();
    std::fs::read_to_string(file).unwrap()
}

/// Checks that each function contains at least `least` packed instructions, and no more scalar instructions than its
/// limit.
fn are_packed(text: &str, limits: &[Limit], least: usize) {
    for (name, most) in limits {
        let body = text.lines().skip_while(|line| !(line.ends_with(':') && line.contains(name)));
        let body: Vec<_> = body.take_while(|line| !line.contains(".cfi_endproc")).collect();
        let count = |suffix| {
            let instructions = body.iter().filter_map(|line| line.split_whitespace().next());
            instructions.filter(|instruction| is_arithmetic(instruction, suffix)).count()
        };
        let (packed, single) = (count("pd"), count("sd"));
        assert!(packed >= least, "{name}: {packed} packed instructions; was it inlined?");
        assert!(single <= *most, "{name}: {single} instructions of single numbers, {packed} packed");
    }
}

#[test]
fn array_forms_compute_two_elements_at_a_time() {
    are_packed(&assembly(&["--example", "lanes"], "examples"), &FAST_PATHS, 60);
    are_packed(&assembly(&["--lib"], "deps"), &GENERAL_PATHS, 40);
}
