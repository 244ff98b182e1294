//! Time of a communication step, for two versions of the FMUs.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    // cargo adds the option `--bench`.
    let folders: Vec<_> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [before] = folders.as_slice() else {
        eprintln!("error: give one folder, with the FMUs to compare with");
        return ExitCode::from(2);
    };
    bench::compare_versions(Path::new(before));
    ExitCode::SUCCESS
}
