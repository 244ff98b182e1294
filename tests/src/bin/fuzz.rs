//! Calls FMUs in ways that no master should, and checks the responses: see `tests::fuzz`.
//!
//! `fuzz [--calls N] [--seconds T] [--seed S] [--interface cs|me|se] [--verbose] FMU...` makes at least N calls to each
//! interface of each FMU, or to one interface only, and spends at least T seconds on each. Scheduled execution is called
//! from up to three threads; the FMU must then be the example Clocks. Additional calls check the
//! effects. FMUs of FMI 2.0 and FMI 3.0 can be mixed. Equal seeds and FMUs give equal calls. It prints how often each
//! function succeeded, was discarded and was rejected. At the first violation, it prints the seed and the last calls,
//! and exits with 1. With `--verbose`, it prints every call before it is made, which shows a call that ends the
//! process.

use fmu_import::description::Interface;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tests::Fmu;
use tests::fuzz::{Report, fuzz, fuzz_scheduled, interfaces, state};
use tests::raw::Raw;

const USAGE: &str = "usage: fuzz [--calls N] [--seconds T] [--seed S] [--interface cs|me|se] [--verbose] FMU...";

struct Options {
    calls: u64,
    least: Duration,
    seed: u64,
    /// Names of the interfaces to call.
    interfaces: Vec<String>,
    is_verbose: bool,
    fmus: Vec<String>,
}

fn options() -> Option<Options> {
    let mut options = Options {
        calls: 100_000,
        least: Duration::ZERO,
        seed: 1,
        interfaces: ["cs", "me", "se"].map(str::to_owned).to_vec(),
        is_verbose: false,
        fmus: Vec::new(),
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--calls" => options.calls = arguments.next()?.parse().ok()?,
            "--seconds" => options.least = Duration::try_from_secs_f64(arguments.next()?.parse().ok()?).ok()?,
            "--seed" => options.seed = arguments.next()?.parse().ok()?,
            "--interface" => options.interfaces = vec![arguments.next()?],
            "--verbose" => options.is_verbose = true,
            option if option.starts_with('-') => return None,
            fmu => options.fmus.push(fmu.to_owned()),
        }
    }
    let is_known = options.interfaces.iter().all(|name| ["cs", "me", "se"].contains(&name.as_str()));
    (is_known && !options.fmus.is_empty()).then_some(options)
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let start = Instant::now();
    let mut all = Report::default();
    // The libraries stay loaded, because valgrind can name only functions of libraries that are still loaded.
    let fmus: Vec<_> = options.fmus.iter().map(|path| Fmu::open(Path::new(path))).collect();
    let raws: Vec<_> = fmus.iter().map(Raw::load).collect();
    let runs = || fmus.iter().zip(&raws).flat_map(|(fmu, raw)| interfaces(fmu).into_iter().map(move |i| (fmu, raw, i)));
    let states: Vec<_> = runs().map(|(_, raw, interface)| (raw.guid(), state(raw, interface))).collect();
    let is_wanted = |name: &str| options.interfaces.iter().any(|wanted| wanted == name);
    let name_of = |interface| if interface == Interface::CoSimulation { "cs" } else { "me" };
    let unscheduled = runs().filter(|(.., interface)| is_wanted(name_of(*interface)));
    let scheduled =
        fmus.iter().zip(&raws).filter(|(fmu, _)| fmu.description.scheduled_execution.is_some() && is_wanted("se"));
    let all_runs = unscheduled.map(|(fmu, raw, interface)| (fmu, raw, Some(interface)));
    for (fmu, raw, interface) in all_runs.chain(scheduled.map(|(fmu, raw)| (fmu, raw, None))) {
        let others = states.iter().filter(|(guid, _)| *guid != fmu.description.guid);
        let foreign: Vec<_> = others.map(|(_, bytes)| bytes.clone()).collect();
        let begin = Instant::now();
        let goes_on = |calls: u64| calls < options.calls || begin.elapsed() < options.least;
        let (result, interface) = match interface {
            Some(interface) => (
                fuzz((fmu, raw), interface, &foreign, options.seed, options.is_verbose, goes_on),
                interface.to_string(),
            ),
            None => (
                fuzz_scheduled((fmu, raw), options.seed, options.is_verbose, goes_on),
                "scheduled execution".to_owned(),
            ),
        };
        match result {
            Ok(report) => {
                let (slowest, call) = &report.slowest;
                println!(
                    "{} {interface} of FMI {}: {} calls, {} to the other interface and {} that observe, {:.1} s, slowest \
                     {:.1} ms: {call:.120}",
                    fmu.name,
                    fmu.description.fmi,
                    report.calls,
                    report.others,
                    report.probes,
                    begin.elapsed().as_secs_f64(),
                    1e3 * slowest.as_secs_f64()
                );
                all.add(&report);
            }
            Err(violation) => {
                println!("{} {interface}: with --seed {}, at call {}:", fmu.name, options.seed, violation.call);
                violation.last.iter().for_each(|call| println!("  {call:.400}"));
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
        all.probes + all.others,
        options.seed,
        (all.calls + all.others + all.probes) as f64 / seconds
    );
    ExitCode::SUCCESS
}
