//! Soak tests: many instances and long runs, for automated tests and manual use.
//!
//! - `soak many INSTANCES THREADS SECONDS FMU...` keeps INSTANCES instances of different FMUs alive while the threads
//!   create, step, save, serialize, restore, reset and free them. It exits with 1 if the memory of the process grows
//!   after the first quarter of the time;
//! - `soak steps STEPS FMU` makes STEPS steps of 1 ms. It exits with 1 if the time drifts or the memory grows;
//! - `soak restore STATES FMU...` saves the state of each FMU at STATES random times, and continues from each state in
//!   another process. It exits with 1 if a result is not bit-identical;
//! - `soak continue FMU STATES` is this other process.

use fmu_import::loader::Instance;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tests::signals::{Excitation, Random, run};
use tests::{Fmu, ok};

/// Communication step in s.
const STEP: f64 = 0.001;
/// Memory growth, in bytes, that is attributed to the allocator, which keeps memory for each thread and fills gaps in
/// any order. If instances leak (a few kB each, with their states), a few thousand of them exceed this growth.
const TOLERANCE: u64 = 8 << 20;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    let number = |text: &str| text.parse::<u64>().unwrap_or_else(|_| panic!("{text} is not a whole number"));
    let result = match arguments.as_slice() {
        ["many", instances, threads, seconds, fmus @ ..] if !fmus.is_empty() => {
            many(number(instances) as usize, number(threads) as usize, number(seconds), fmus)
        }
        ["steps", steps, fmu] => steps_without_drift(number(steps), fmu),
        ["restore", states, fmus @ ..] => fmus.iter().try_for_each(|fmu| restore(number(states), fmu)),
        ["continue", fmu, states] => {
            go_on(fmu, states);
            Ok(())
        }
        _ => {
            eprintln!(
                "usage: soak many INSTANCES THREADS SECONDS FMU... | steps STEPS FMU | restore STATES FMU... | continue FMU STATES"
            );
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// Memory of the process, in bytes; `None` if the system does not report it.
fn memory() -> Option<u64> {
    const PAGE: u64 = 4096;
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(PAGE * text.split(' ').nth(1)?.parse::<u64>().ok()?)
}

/// Compares the memory at two moments.
fn flat(before: Option<u64>, after: Option<u64>) -> Result<(), String> {
    let Some((before, after)) = before.zip(after) else {
        println!("memory: not known on this system");
        return Ok(());
    };
    println!("memory: {} kB after the warm-up, {} kB at the end", before >> 10, after >> 10);
    if after <= before + TOLERANCE {
        Ok(())
    } else {
        Err(format!("the memory grew by {} kB, {} kB are allowed", (after - before) >> 10, TOLERANCE >> 10))
    }
}

/// One of many instances, with the data to use it.
struct Member<'a> {
    fmu: &'a Fmu,
    excitation: &'a Excitation,
    instance: Instance,
    steps: u32,
}

impl<'a> Member<'a> {
    fn new(fmu: &'a Fmu, excitation: &'a Excitation) -> Self {
        Self { fmu, excitation, instance: fmu.started(), steps: 0 }
    }

    fn advance(&mut self, steps: u32) -> Vec<u64> {
        let range = self.steps..self.steps + steps;
        self.steps += steps;
        run(self.fmu, &mut self.instance, self.excitation, 0.0, range, STEP)
    }

    /// Continues from a saved state twice, the second time from its bytes; returns whether the results are equal.
    fn repeats(&mut self) -> bool {
        let from = self.steps;
        let saved = ok(self.instance.save_state());
        let bytes = ok(self.instance.serialize_state(&saved));
        let first = self.advance(5);
        let copy = ok(self.instance.deserialize_state(&bytes));
        ok(self.instance.restore_state(&copy));
        self.steps = from;
        let second = self.advance(5);
        ok(self.instance.free_state(saved));
        ok(self.instance.free_state(copy));
        first == second
    }
}

fn many(instances: usize, threads: usize, seconds: u64, paths: &[&str]) -> Result<(), String> {
    let fmus: Vec<_> = paths.iter().map(|path| Fmu::open(Path::new(path))).collect();
    let excitations: Vec<_> = fmus.iter().map(|fmu| Excitation::of(fmu, 1)).collect();
    let [lives, steps, restored] = [const { AtomicU64::new(0) }; 3];
    let (is_over, differs) = (AtomicBool::new(false), AtomicBool::new(false));
    let own = instances.div_ceil(threads);
    let work = |thread: usize| {
        let mut random = Random(thread as u64);
        let fresh = |random: &mut Random| {
            let pick = random.below(fmus.len() as u64) as usize;
            lives.fetch_add(1, Ordering::Relaxed);
            Member::new(&fmus[pick], &excitations[pick])
        };
        let mut members: Vec<_> = (0..own).map(|_| fresh(&mut random)).collect();
        while !is_over.load(Ordering::Relaxed) {
            let at = random.below(own as u64) as usize;
            match random.below(8) {
                0 => members[at] = fresh(&mut random),
                1 => {
                    let member = &mut members[at];
                    ok(member.instance.reset());
                    ok(member.instance.enter_initialization_mode());
                    ok(member.instance.exit_initialization_mode());
                    member.steps = 0;
                }
                2..4 => {
                    if !members[at].repeats() {
                        differs.store(true, Ordering::Relaxed);
                    }
                    restored.fetch_add(1, Ordering::Relaxed);
                    steps.fetch_add(10, Ordering::Relaxed);
                }
                _ => {
                    drop(members[at].advance(10));
                    steps.fetch_add(10, Ordering::Relaxed);
                }
            }
        }
    };
    let (before, after) = std::thread::scope(|scope| {
        for thread in 0..threads {
            let work = &work;
            scope.spawn(move || work(thread));
        }
        let total = Duration::from_secs(seconds);
        let start = Instant::now();
        std::thread::sleep(total / 4);
        while lives.load(Ordering::Relaxed) < (own * threads) as u64 {
            std::thread::sleep(Duration::from_millis(100));
        }
        let before = memory();
        println!("{} instances alive in {threads} threads", own * threads);
        std::thread::sleep(total.saturating_sub(start.elapsed()));
        let after = memory();
        is_over.store(true, Ordering::Relaxed);
        (before, after)
    });
    println!(
        "{} instances created, {} steps, {} states restored in {seconds} s",
        lives.into_inner(),
        steps.into_inner(),
        restored.into_inner()
    );
    if differs.into_inner() {
        return Err("a restored state went on differently".to_owned());
    }
    flat(before, after)
}

fn steps_without_drift(steps: u64, path: &str) -> Result<(), String> {
    let fmu = Fmu::open(Path::new(path));
    let excitation = Excitation::of(&fmu, 1);
    let outputs = fmu.references(fmu_import::description::Causality::Output);
    let mut u = vec![0.0; excitation.references.len()];
    let mut y = vec![0.0; outputs.len()];
    let mut instance = fmu.started();
    let warm_up = steps / 100;
    let mut before = memory();
    let start = Instant::now();
    for k in 0..steps {
        if k == warm_up {
            before = memory();
        }
        let time = k as f64 * STEP;
        if k % 100 == 0 {
            excitation.values(time, &mut u);
            ok(instance.set_real(&excitation.references, &u));
        }
        ok(instance.do_step(time, STEP));
        ok(instance.get_real(&outputs, &mut y));
        // The master computes the time as a product, the FMU as a sum. The rounding of the two can differ by at most
        // one unit in the last place.
        let expected = (k + 1) as f64 * STEP;
        let found = ok(instance.last_successful_time());
        if (found - expected).abs() > f64::EPSILON * expected {
            return Err(format!("{}: {found} s after {} steps, expected {expected} s", fmu.name, k + 1));
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    println!("{}: {steps} steps in {seconds:.1} s, {:.0} ns each, no drift", fmu.name, 1e9 * seconds / steps as f64);
    flat(before, memory())
}

/// Number of steps after each restored state that are compared.
const TAIL: u32 = 10;

fn fingerprint(bits: &[u64]) -> u64 {
    bits.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
}

fn restore(states: u64, path: &str) -> Result<(), String> {
    const END: u32 = 5000;
    let fmu = Fmu::open(Path::new(path));
    let excitation = Excitation::of(&fmu, 1);
    let mut random = Random(7);
    let mut instants: Vec<_> = (0..states).map(|_| random.below(u64::from(END - TAIL)) as u32).collect();
    instants.sort_unstable();
    let mut instance = fmu.started();
    let (mut all, mut file) = (Vec::new(), Vec::new());
    let mut next = instants.iter().peekable();
    for k in 0..END {
        while next.next_if(|&&instant| instant == k).is_some() {
            let saved = ok(instance.save_state());
            let bytes = ok(instance.serialize_state(&saved));
            ok(instance.free_state(saved));
            file.extend(k.to_le_bytes());
            file.extend((bytes.len() as u32).to_le_bytes());
            file.extend(bytes);
        }
        all.push(run(&fmu, &mut instance, &excitation, 0.0, k..k + 1, STEP));
    }
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let states = folder.path().join("states");
    std::fs::write(&states, file).map_err(|error| error.to_string())?;
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let output = Command::new(program).arg("continue").arg(path).arg(&states).output();
    let output = output.map_err(|error| error.to_string())?;
    if !output.status.success() {
        return Err(format!("{}: {}", fmu.name, String::from_utf8_lossy(&output.stderr)));
    }
    let expected: String = instants
        .iter()
        .map(|&instant| format!("{:016x}\n", fingerprint(&all[instant as usize..(instant + TAIL) as usize].concat())))
        .collect();
    if String::from_utf8_lossy(&output.stdout) != expected {
        return Err(format!("{}: a restored state gives different results in another process", fmu.name));
    }
    println!("{}: {} states restored in another process, {TAIL} steps each, bit-identical", fmu.name, instants.len());
    Ok(())
}

fn go_on(path: &str, states: &str) {
    let fmu = Fmu::open(Path::new(path));
    let excitation = Excitation::of(&fmu, 1);
    let file = std::fs::read(states).expect("the states can be read");
    let number = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let mut rest = file.as_slice();
    let mut instance = fmu.instance();
    while !rest.is_empty() {
        let (instant, length) = (number(&rest[..4]), number(&rest[4..8]) as usize);
        let saved = ok(instance.deserialize_state(&rest[8..8 + length]));
        ok(instance.restore_state(&saved));
        ok(instance.free_state(saved));
        let bits = run(&fmu, &mut instance, &excitation, 0.0, instant..instant + TAIL, STEP);
        println!("{:016x}", fingerprint(&bits));
        rest = &rest[8 + length..];
    }
}
