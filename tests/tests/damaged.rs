//! Random mistakes in scenario and study files always give a message with a position, never a panic.
//!
//! The committed files are changed at random, with fixed seeds. The messages for particular mistakes are tested in
//! `crates/fmu-system/tests/resolve.rs` and `crates/chassis/tests/studies.rs`.

use fmu_import::worker::{Launch, Settings};
use fmu_study::study::Workers;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tests::signals::Random;

/// Number of damaged copies of each file.
const CHANGES: u64 = 120;

/// The TOML files of a folder of the workspace, sorted.
fn files(folder: &str) -> Vec<PathBuf> {
    let folder = tests::workspace().join(folder);
    let entries = std::fs::read_dir(folder).expect("the folder is there");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("it can be read").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files
}

/// A text with one to three mistakes.
fn damage(text: &str, random: &mut Random) -> String {
    const VALUES: [&str; 20] = [
        "0",
        "-1",
        "1e308",
        "-1e308",
        "5e-324",
        "nan",
        "inf",
        "-inf",
        "9223372036854775807",
        "1e-9",
        "true",
        "\"\"",
        "\"x\"",
        "[]",
        "[1, \"a\"]",
        "{}",
        "{ value = nan, unit = \"deg\" }",
        "\"\\u0000\"",
        "1979-05-27",
        "[[[[]]]]",
    ];
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..1 + random.below(3) {
        let at = random.below(lines.len() as u64) as usize;
        let line = lines[at].clone();
        match random.below(9) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, line),
            2 => lines.truncate(at.max(1)),
            3 => lines.swap(at, 0),
            4 => {
                // A value is replaced, possibly by a value of another type.
                if let Some((key, _)) = line.split_once('=') {
                    lines[at] = format!("{key}= {}", VALUES[random.below(VALUES.len() as u64) as usize]);
                }
            }
            5 => {
                // A number in the line is replaced by an unusual one.
                const NUMBERS: [&str; 6] = ["0", "-7", "1e300", "nan", "99999999999999999999", "1e-300"];
                let number = NUMBERS[random.below(NUMBERS.len() as u64) as usize];
                if let Some(first) = line.find(|c: char| c.is_ascii_digit()) {
                    let rest = line[first..].trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
                    lines[at] = format!("{}{number}{rest}", &line[..first]);
                }
            }
            6 => lines[at] = line.replacen('"', "", 1),
            7 => {
                // A character is removed, or an unusual one is added.
                let mut characters: Vec<_> = line.chars().collect();
                if !characters.is_empty() {
                    let place = random.below(characters.len() as u64) as usize;
                    if random.below(2) == 0 {
                        characters.remove(place);
                    } else {
                        characters.insert(place, ['\u{0}', '\u{feff}', '[', '*', ':', '\u{1f697}'][place % 6]);
                    }
                }
                lines[at] = characters.into_iter().collect();
            }
            _ => {
                let other = lines[random.below(lines.len() as u64) as usize].clone();
                lines[at] = other;
            }
        }
        if lines.is_empty() {
            break;
        }
    }
    lines.join("\n")
}

/// Damages the files in a folder and reads them; returns how many were rejected with a message, and how many remained
/// valid.
fn read_damaged<E: std::fmt::Display>(
    folder: &str,
    first_seed: u64,
    read: impl Fn(&Path, &str) -> Result<(), E>,
) -> (u32, u32) {
    let (mut rejected, mut accepted) = (0, 0);
    for (number, file) in files(folder).iter().enumerate() {
        let text = std::fs::read_to_string(file).expect("the file can be read");
        let mut random = Random(first_seed + number as u64);
        for change in 0..CHANGES {
            let damaged = damage(&text, &mut random);
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| read(file, &damaged)));
            match result.unwrap_or_else(|_| panic!("{}, change {change}: a panic on\n{damaged}", file.display())) {
                Ok(()) => accepted += 1,
                Err(error) => {
                    rejected += 1;
                    assert!(!error.to_string().trim().is_empty(), "no message for\n{damaged}");
                }
            }
        }
    }
    println!("{rejected} rejected, {accepted} still in order");
    (rejected, accepted)
}

#[test]
fn damaged_scenarios_are_rejected_with_a_message() {
    let source = FmuFolder::new([tests::folder()]);
    let (rejected, accepted) = read_damaged("scenarios", 0, |file, damaged| {
        resolve_text(file, damaged, &source, &Options::default()).map(drop)
    });
    assert!(
        rejected > 1000 && accepted > 100,
        "{rejected} rejected, {accepted} accepted: the changes are not effective"
    );
}

/// Settings of the workers, which are required for reading a study. No worker is started.
fn workers() -> Workers {
    let launch = Launch { program: PathBuf::from("none"), arguments: Vec::new() };
    let settings = Settings::new(launch, Duration::from_secs(1), Arc::new(|_| ()));
    (settings, NonZeroUsize::MIN)
}

#[test]
fn damaged_studies_are_rejected_with_a_message() {
    let source = FmuFolder::new([tests::folder()]);
    // The path of a scenario in a study is relative to the study file.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [studies, scenarios] = ["studies", "scenarios"].map(|name| folder.path().join(name));
    for folder in [&studies, &scenarios] {
        std::fs::create_dir(folder).expect("it can be made");
    }
    for file in files("scenarios") {
        std::fs::copy(&file, scenarios.join(file.file_name().expect("a name"))).expect("it can be copied");
    }
    let (rejected, accepted) = read_damaged("studies", 1000, |file, damaged| {
        let path = studies.join(file.file_name().expect("a name"));
        std::fs::write(&path, damaged).expect("it can be written");
        fmu_study::study::read(&path, &source, workers()).map(drop)
    });
    assert!(rejected > 100 && accepted > 10, "{rejected} rejected, {accepted} accepted: the changes are not effective");
}

#[test]
fn files_that_are_no_text_are_rejected() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("scenario.toml");
    let source = FmuFolder::new([tests::folder()]);
    let rejects = |path: &Path| {
        let error =
            fmu_system::resolve::resolve(path, &source, &Options::default()).map(drop).expect_err("no scenario");
        assert!(!error.to_string().is_empty());
        let error = fmu_study::study::read(path, &source, workers()).map(drop).expect_err("no study");
        assert!(!error.to_string().is_empty());
    };
    let deep = format!("a = {}1{}", "[".repeat(100_000), "]".repeat(100_000));
    for bytes in [&b""[..], b"\xff\xfe\x00", b"\0\0\0", b"a = 1e999999999", deep.as_bytes()] {
        std::fs::write(&file, bytes).expect("it can be written");
        rejects(&file);
    }
    rejects(folder.path());
    rejects(&folder.path().join("missing.toml"));
}
