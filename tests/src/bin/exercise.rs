//! Runs FMUs in a separate process, for tests that observe a process or need a second one.
//!
//! - `exercise steps FMU...` starts each FMU, steps it with changing inputs and prints its name, the number of
//!   allocations in the steps, and the number of earlier allocations ("-" if allocations are not counted);
//! - `exercise master SCENARIO STOP...` executes the first run of a scenario in this process up to each time (s), and
//!   prints the number of rows and the number of allocations ("-" if allocations are not counted);
//! - `exercise life FMU...` calls every function of each FMU, with rejected calls, saved states and a reset;
//! - `exercise reload FMU...` loads each FMU, starts an instance and unloads it again, three times;
//! - `exercise continue FMU STATE SEED FIRST LAST` reads the bytes of a saved state, continues with the steps FIRST to
//!   LAST, 1 ms each, and prints the bits of all outputs;
//! - `exercise global FMU...` loads all libraries into one namespace (RTLD_GLOBAL), then steps each and prints the
//!   bits;
//! - `exercise glibc NEWEST FMU...` prints the version of the GNU C library that each FMU for Linux needs, and exits
//!   with 1 if one is newer than NEWEST, such as 2.17.

use fmu_import::description::Causality;
use fmu_system::fmus::Fmus;
use fmu_system::master::execute;
use fmu_system::resolve::{FmuFolder, Options, resolve};
use std::io::Read as _;
use std::path::Path;
use std::process::ExitCode;
use tests::signals::{Excitation, run};
use tests::{Fmu, ok, raw, symbols};

/// Communication step in s.
const STEP: f64 = 0.001;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["steps", fmus @ ..] => fmus.iter().for_each(|path| steps(path)),
        ["master", scenario, stops @ ..] => master(Path::new(scenario), stops),
        ["life", fmus @ ..] => fmus.iter().for_each(|path| life(path)),
        ["reload", fmus @ ..] => fmus.iter().for_each(|path| reload(path)),
        ["continue", path, state, seed, first, last] => {
            let steps = first.parse().expect("FIRST is a number")..last.parse().expect("LAST is a number");
            go_on(path, state, seed.parse().expect("SEED is a number"), steps);
        }
        ["global", fmus @ ..] => global(fmus),
        ["glibc", newest, fmus @ ..] => return glibc(newest, fmus),
        _ => {
            eprintln!(
                "usage: exercise steps|life|reload|global FMU... | master SCENARIO STOP... | continue FMU STATE SEED FIRST LAST | glibc NEWEST FMU..."
            );
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

fn print_bits(bits: &[u64]) {
    let words: Vec<_> = bits.iter().map(|word| format!("{word:016x}")).collect();
    println!("{}", words.join(" "));
}

fn steps(path: &str) {
    const STEPS: u32 = 300;
    // The library stays loaded, because valgrind can name only functions of libraries that are still loaded.
    let fmu = Fmu::open_and_keep(Path::new(path), false);
    let excitation = Excitation::of(&fmu, 1);
    let outputs = fmu.references(Causality::Output);
    let mut u = vec![0.0; excitation.references.len()];
    let mut y = vec![0.0; outputs.len()];
    let mut instance = fmu.started();
    let before = raw::allocations();
    for k in 0..STEPS {
        let time = f64::from(k) * STEP;
        excitation.values(time, &mut u);
        ok(instance.set_real(&excitation.references, &u));
        ok(instance.do_step(time, STEP));
        ok(instance.get_real(&outputs, &mut y));
    }
    match before.zip(raw::allocations()) {
        Some((before, after)) => println!("{} {} {before}", fmu.name, after - before),
        None => println!("{} - -", fmu.name),
    }
    ok(instance.terminate());
}

fn master(scenario: &Path, stops: &[&str]) {
    for stop in stops {
        let options = Options { stop: Some(stop.parse().expect("STOP is a number")), ..Options::default() };
        let plan = resolve(scenario, &FmuFolder::new([tests::folder()]), &options).expect("the scenario is valid");
        let run = &plan.runs[0];
        let fmus = Fmus::load(&plan.runs[..1]).expect("the FMUs can be loaded");
        let before = raw::allocations();
        let recording = execute(&plan.simulation, run, &fmus).expect("the run succeeds");
        let count = before.zip(raw::allocations()).map(|(before, after)| after - before);
        println!("{} {}", recording.time.len(), count.map_or("-".to_owned(), |count| count.to_string()));
    }
}

fn life(path: &str) {
    // The library stays loaded, because valgrind can name only functions of libraries that are still loaded.
    let fmu = Fmu::open_and_keep(Path::new(path), false);
    tests::life::life(&fmu);
    println!("{}", fmu.name);
}

fn reload(path: &str) {
    for _ in 0..3 {
        drop(Fmu::open(Path::new(path)).started());
    }
}

fn go_on(path: &str, state: &str, seed: u64, steps: std::ops::Range<u32>) {
    let fmu = Fmu::open(Path::new(path));
    let bytes = std::fs::read(state).expect("the state can be read");
    let mut instance = fmu.instance();
    let saved = ok(instance.deserialize_state(&bytes));
    ok(instance.restore_state(&saved));
    print_bits(&run(&fmu, &mut instance, &Excitation::of(&fmu, seed), 0.0, steps, STEP));
}

fn global(paths: &[&str]) {
    let fmus: Vec<_> = paths.iter().map(|path| Fmu::open_and_keep(Path::new(path), true)).collect();
    for fmu in &fmus {
        let mut instance = fmu.started();
        print!("{} ", fmu.name);
        print_bits(&run(fmu, &mut instance, &Excitation::of(fmu, 1), 0.0, 0..20, STEP));
    }
}

fn glibc(newest: &str, paths: &[&str]) -> ExitCode {
    let (major, minor) = newest.split_once('.').expect("a version such as 2.17");
    let limit = (major.parse().expect("a number"), minor.parse().expect("a number"));
    let mut code = ExitCode::SUCCESS;
    for path in paths {
        let name = Path::new(path).file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8");
        let mut archive = zip::ZipArchive::new(std::fs::File::open(path).expect("the FMU can be read")).expect("a zip");
        let mut library = Vec::new();
        let mut entry = archive.by_name(&format!("binaries/linux64/{name}.so")).expect("a library for Linux");
        entry.read_to_end(&mut library).expect("the library can be unpacked");
        let needed = symbols::newest_glibc(&library).expect("an ELF library").unwrap_or((0, 0));
        println!("{name} {}.{}", needed.0, needed.1);
        if needed > limit {
            code = ExitCode::FAILURE;
        }
    }
    code
}
