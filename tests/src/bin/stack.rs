//! Measures the stack that a thread needs to call an FMU.
//!
//! - `stack FMU...` prints for each FMU the smallest stack of a thread, in whole pages and in kB of 1024 bytes, that
//!   suffices for a complete use of the FMU (all functions, rejected calls, saved states, a reset);
//! - `stack --within KB FMU` makes these calls in a thread with a stack of KB kB; if the stack overflows, a signal ends
//!   the process;
//! - `stack --within KB --below KB FMU` calls the FMU below stack frames with a total size of KB kB.
//!
//! The result includes the start of the thread and about 2 kB for the frames of this program.

use std::hint::black_box;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use tests::Fmu;

/// Range of tested sizes. The system does not give a thread a smaller stack than the first size.
const LEAST_KB: usize = 16;
const MOST_KB: usize = 1024;
const PAGE_KB: usize = 4;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["--within", size, path] => within(kb(size), 0, path),
        ["--within", size, "--below", frames, path] => within(kb(size), kb(frames), path),
        [first, ..] if !first.starts_with('-') => {
            for path in &arguments {
                let name = Path::new(path).file_stem().unwrap_or_default().to_string_lossy();
                match least(path) {
                    Some(size) => println!("{name} {size}"),
                    None => {
                        eprintln!("{name} fails with a stack of {MOST_KB} kB: run `stack --within {MOST_KB} {path}`");
                        return ExitCode::FAILURE;
                    }
                }
            }
        }
        _ => {
            eprintln!("usage: stack FMU... | --within KB [--below KB] FMU");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

fn kb(argument: &str) -> usize {
    argument.parse().expect("KB is a number")
}

/// Calls `work` below stack frames with a total size of at least `frames` kB.
fn below(frames: usize, work: &dyn Fn()) {
    let frame = [0_u8; 1024];
    if frames > 1 {
        below(frames - 1, work);
    } else {
        work();
    }
    black_box(&frame);
}

fn within(size: usize, frames: usize, path: &str) {
    // The main thread unpacks and loads the FMU, as in a master.
    let fmu = Fmu::open(Path::new(path));
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(size * 1024);
        let run = || match frames {
            0 => tests::life::life(&fmu),
            _ => below(frames, &|| tests::life::life(&fmu)),
        };
        let thread = thread.spawn_scoped(scope, run).expect("a thread can be made");
        thread.join().expect("the FMU does what it should");
    });
}

/// Returns true if all calls of an FMU fit into a stack of `size` kB.
fn is_enough(size: usize, path: &str) -> bool {
    let program = std::env::current_exe().expect("the path of this program");
    // A child process that a signal ends leaves its unpacked files in this folder.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut child = Command::new(program);
    child.env("TMPDIR", folder.path());
    child.args(["--within", &size.to_string(), path]).stdout(Stdio::null()).stderr(Stdio::null());
    child.status().expect("this program runs").success()
}

/// The smallest stack in kB, by bisection; `None` if the largest is not enough.
fn least(path: &str) -> Option<usize> {
    let (mut low, mut high) = (LEAST_KB / PAGE_KB, MOST_KB / PAGE_KB);
    if !is_enough(high * PAGE_KB, path) {
        return None;
    }
    while low < high {
        let middle = (low + high) / 2;
        if is_enough(middle * PAGE_KB, path) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    Some(high * PAGE_KB)
}
