//! Calls FMUs as no master should, and checks how they answer: see `tests::fuzz`.
//!
//! `fuzz [--calls N] [--seconds T] [--seed S] [--verbose] FMU...` makes about N calls to each FMU, and more until T
//! seconds are over, in the same order whenever seed and FMUs are the same, and prints how often each function
//! succeeded, was discarded and was rejected. Calls that only observe are made besides. It ends with 1 at the first
//! broken rule and prints the seed and the last calls. If a call ends the process, `--verbose` shows which: it prints
//! every call before it is made.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tests::Fmu;
use tests::fuzz::{Report, fuzz, state};
use tests::raw::Raw;

const USAGE: &str = "usage: fuzz [--calls N] [--seconds T] [--seed S] [--verbose] FMU...";

struct Options {
    calls: u64,
    least: Duration,
    seed: u64,
    is_verbose: bool,
    fmus: Vec<String>,
}

fn options() -> Option<Options> {
    let mut options = Options { calls: 100_000, least: Duration::ZERO, seed: 1, is_verbose: false, fmus: Vec::new() };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--calls" => options.calls = arguments.next()?.parse().ok()?,
            "--seconds" => options.least = Duration::try_from_secs_f64(arguments.next()?.parse().ok()?).ok()?,
            "--seed" => options.seed = arguments.next()?.parse().ok()?,
            "--verbose" => options.is_verbose = true,
            option if option.starts_with('-') => return None,
            fmu => options.fmus.push(fmu.to_owned()),
        }
    }
    (!options.fmus.is_empty()).then_some(options)
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let start = Instant::now();
    let mut all = Report::default();
    // Kept loaded: valgrind can name the functions of a library that is still there.
    let fmus: Vec<_> = options.fmus.iter().map(|path| Fmu::open(Path::new(path))).collect();
    let states: Vec<_> = fmus.iter().map(|fmu| (&fmu.description.guid, state(fmu))).collect();
    for fmu in &fmus {
        let raw = Raw::load(fmu);
        let others = states.iter().filter(|(guid, _)| **guid != fmu.description.guid);
        let foreign: Vec<_> = others.map(|(_, bytes)| bytes.clone()).collect();
        let begin = Instant::now();
        let goes_on = |calls: u64| calls < options.calls || begin.elapsed() < options.least;
        match fuzz(fmu, &raw, &foreign, options.seed, options.is_verbose, goes_on) {
            Ok(report) => {
                let (slowest, call) = &report.slowest;
                println!(
                    "{} {} calls and {} that observe, {:.1} s, slowest {:.1} ms: {call:.120}",
                    fmu.name,
                    report.calls,
                    report.probes,
                    begin.elapsed().as_secs_f64(),
                    1e3 * slowest.as_secs_f64()
                );
                all.add(&report);
            }
            Err(violation) => {
                println!("{}: with --seed {}, at call {}:", fmu.name, options.seed, violation.call);
                violation.last.iter().for_each(|call| println!("  {call}"));
                println!("{}", violation.what);
                return ExitCode::FAILURE;
            }
        }
    }
    println!("function: fmi2OK, fmi2Discard, fmi2Error");
    for (function, [ok, discard, error]) in &all.functions {
        println!("{function}: {ok}, {discard}, {error}");
    }
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{} calls and {} that observe with --seed {}, {:.0} per second",
        all.calls,
        all.probes,
        options.seed,
        (all.calls + all.probes) as f64 / seconds
    );
    ExitCode::SUCCESS
}
