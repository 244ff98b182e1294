//! The compiler packs two elements of the array forms into each instruction. Nothing in the language promises that, so
//! this looks at what it makes of `examples/lanes.rs`: a new version that no longer does fails here, not in a benchmark.
#![cfg(target_arch = "x86_64")]

use std::path::Path;
use std::process::Command;

/// Function of the example, and how many additions, subtractions, multiplications and divisions may be of single numbers.
/// A quarter of those of sine and cosine are: in the cosine the compiler packs terms of one element instead.
const SINGLE: [(&str, usize); 4] = [
    ("four_arctangents", 0),
    ("four_exponentials", 0),
    ("four_hyperbolic_tangents", 0),
    ("four_sines_and_cosines", 40),
];

fn is_arithmetic(instruction: &str, suffix: &str) -> bool {
    ["add", "sub", "mul", "div"].iter().any(|operation| instruction.strip_prefix(operation) == Some(suffix))
}

#[test]
fn array_forms_compute_two_elements_at_a_time() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("instructions");
    let _ = std::fs::remove_dir_all(target.join("release/examples"));
    let status = Command::new(env!("CARGO"))
        .args(["rustc", "--quiet", "--release", "--example", "lanes", "--target-dir"])
        .arg(&target)
        .args(["--", "--emit", "asm", "-C", "codegen-units=1"])
        .current_dir(package)
        .status()
        .unwrap();
    assert!(status.success());
    let files = std::fs::read_dir(target.join("release/examples")).unwrap().map(|entry| entry.unwrap().path());
    let file = files.into_iter().find(|path| path.extension().is_some_and(|extension| extension == "s")).unwrap();
    let text = std::fs::read_to_string(file).unwrap();

    for (name, most) in SINGLE {
        let body = text.lines().skip_while(|line| !(line.ends_with(':') && line.contains(name)));
        let body: Vec<_> = body.take_while(|line| !line.contains(".cfi_endproc")).collect();
        let count = |suffix| {
            let instructions = body.iter().filter_map(|line| line.split_whitespace().next());
            instructions.filter(|instruction| is_arithmetic(instruction, suffix)).count()
        };
        let (packed, single) = (count("pd"), count("sd"));
        assert!(packed >= 60, "{name}: {packed} packed instructions; was it inlined?");
        assert!(single <= most, "{name}: {single} instructions of single numbers, {packed} packed");
    }
}
