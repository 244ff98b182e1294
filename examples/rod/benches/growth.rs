//! CPU time of the default experiment for rods of 500 to 10,000 cells: `cargo bench --package rod`.

use fmu::simulation::ContinuousSimulation;
use std::time::{Duration, Instant};

macro_rules! rods {
    ($($module:ident $cells:literal),*) => {$(
        mod $module {
            use fmu::prelude::*;
            rod::rod! {
                /// Rod
                Rod, $cells
            }
        }
    )*};
}
rods!(first 500, second 1_000, third 2_000, fourth 5_000, fifth 10_000);

/// CPU time of this thread where the system reports it, otherwise the elapsed time.
fn clock(start: Instant) -> Duration {
    let nanoseconds = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

macro_rules! measure {
    ($module:ident, $cells:literal, $start:ident) => {
        let before = clock($start);
        let mut run = ContinuousSimulation::new($module::Rod::default()).expect("it starts");
        for _ in 0..200 {
            run.step(&(), 0.01).expect("a step");
        }
        let (mean, expected) = (run.outputs(&()).mean, rod::mean($cells, run.time()));
        let time = (clock($start) - before).as_secs_f64();
        let error = (mean / expected - 1.0).abs();
        println!("| {} | {time:.3} | {:.1} | {error:.1e} |", $cells, 1e6 * time / f64::from($cells));
    };
}

fn main() {
    let start = Instant::now();
    println!("| cells | CPU time, s | per cell, µs | error of the mean |");
    println!("|---|---|---|---|");
    measure!(first, 500, start);
    measure!(second, 1_000, start);
    measure!(third, 2_000, start);
    measure!(fourth, 5_000, start);
    measure!(fifth, 10_000, start);
}
