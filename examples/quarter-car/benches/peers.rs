//! What the FMI layer costs: the quarter car as a plain function beside FMUs of it, ours and those that are named:
//! `cargo bench -p quarter-car --bench peers -- OTHER.fmu …`. They need the variables `z_r`, `f_a`, `z_s`, `v_s`, `z_u`,
//! `v_u`, `a_s`.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use fmu_import::fmu::{Fmu, FmuError};

/// Communication step in s.
const STEP: f64 = 0.001;
/// Steps per measurement.
const STEPS: usize = 200_000;
/// Measurements; the median counts.
const ROUNDS: usize = 7;
const INPUTS: [&str; 2] = ["z_r", "f_a"];
const OUTPUTS: [&str; 5] = ["z_s", "v_s", "z_u", "v_u", "a_s"];

/// Road and actuator force at step `k`.
fn excitation(k: usize) -> [f64; 2] {
    let phase = std::f64::consts::TAU * (k % 1024) as f64 / 1024.0;
    [0.05 * (3.0 * phase).sin(), 100.0 * (7.0 * phase).sin()]
}

fn derivatives(x: [f64; 4], [z_r, f_a]: [f64; 2]) -> [f64; 4] {
    let f = 20_000.0 * (x[0] - x[2]) + 1_500.0 * (x[1] - x[3]) - f_a;
    [x[1], -f / 400.0, x[3], (f - 180_000.0 * (x[2] - z_r)) / 40.0]
}

/// One step of the classical Runge-Kutta method, and the outputs after it.
#[inline(never)]
fn plain_step(x: &mut [f64; 4], u: [f64; 2]) -> [f64; 5] {
    let along = |k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let k1 = derivatives(*x, u);
    let k2 = derivatives(along(k1, 0.5 * STEP), u);
    let k3 = derivatives(along(k2, 0.5 * STEP), u);
    let k4 = derivatives(along(k3, STEP), u);
    *x = std::array::from_fn(|i| x[i] + STEP / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    [x[0], x[1], x[2], x[3], derivatives(*x, u)[1]]
}

/// Nanoseconds per loop, and the last outputs.
fn plain(table: &[[f64; 2]]) -> (f64, [f64; 5]) {
    let (mut x, mut y) = ([0.0; 4], [0.0; 5]);
    let begin = Instant::now();
    for k in 0..STEPS {
        y = black_box(plain_step(&mut x, black_box(table[k % table.len()])));
    }
    (begin.elapsed().as_secs_f64() * 1e9 / STEPS as f64, y)
}

/// Nanoseconds per loop (set the inputs, step, get the outputs), microseconds to the first step, the last outputs.
fn run(fmu: &Fmu, table: &[[f64; 2]]) -> Result<(f64, f64, [f64; 5]), FmuError> {
    let variable = |name: &str| fmu.description().variables.iter().find(|variable| variable.name == name);
    let reference = |name: &&str| variable(name).unwrap_or_else(|| panic!("there is no variable {name}")).reference;
    let (inputs, outputs) = (INPUTS.each_ref().map(reference), OUTPUTS.each_ref().map(reference));
    let mut y = [0.0; 5];
    let begin = Instant::now();
    let mut instance = fmu.instantiate("bench")?;
    instance.setup_experiment(0.0, None)?;
    instance.enter_initialization_mode()?;
    instance.exit_initialization_mode()?;
    let start = begin.elapsed().as_secs_f64() * 1e6;
    let begin = Instant::now();
    for k in 0..STEPS {
        instance.set_real(&inputs, &table[k % table.len()])?;
        instance.do_step(k as f64 * STEP, STEP)?;
        instance.get_real(&outputs, &mut y)?;
    }
    Ok((begin.elapsed().as_secs_f64() * 1e9 / STEPS as f64, start, y))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target"), PathBuf::from);
    // cargo passes --bench.
    let others = std::env::args_os().skip(1).filter(|argument| argument != "--bench").map(PathBuf::from);
    let table: Vec<_> = (0..1024).map(excitation).collect();
    let expected = plain(&table).1;
    println!("{:28} {:>8} {:>8} {:>9} {:>10}", "", "ns/loop", "start µs", "bytes", "difference");
    let line = |name: &str, loops: f64, start: &str, bytes: &str, difference: f64| {
        println!("{name:28} {loops:8.1} {start:>8} {bytes:>9} {difference:10.1e}");
    };
    for path in std::iter::once(target.join("fmu/QuarterCar.fmu")).chain(others) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let fmu = Fmu::open(&path).unwrap_or_else(|error| panic!("{error}; run `cargo fmu pack QuarterCar`"));
        let bytes = std::fs::metadata(&path).map_or(0, |file| file.len()).to_string();
        // Turn by turn, so that both see the same machine.
        let (mut plain_times, mut times, mut starts, mut last) = (Vec::new(), Vec::new(), Vec::new(), expected);
        for _ in 0..ROUNDS {
            plain_times.push(plain(&table).0);
            let (time, start, y) = run(&fmu, &table).unwrap_or_else(|error| panic!("{name}: {error}"));
            times.push(time);
            starts.push(start);
            last = y;
        }
        let difference = last.iter().zip(expected).map(|(y, expected)| (y - expected).abs()).fold(0.0, f64::max);
        line("plain function", median(plain_times), "-", "-", 0.0);
        line(&name, median(times), &format!("{:.0}", median(starts)), &bytes, difference);
    }
}
