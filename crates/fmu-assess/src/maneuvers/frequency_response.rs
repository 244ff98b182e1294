//! Frequency response (ISO 7401, random input) with a sum of sines that repeats every ten seconds.

use super::shown;
use crate::bench::Bench;
use crate::evaluators::frequency_response::FREQUENCIES;
use crate::results::Results;
use crate::run_spec::RunSpec;
use crate::wiring::{Driving, STEP};
use fmu_math::sin;
use serde_json::json;
use std::f64::consts::PI;
use std::fmt::Write as _;

/// Period, start of the steering, and end of the run, s.
const PERIOD: f64 = 10.0;
const START: f64 = 1.0;
const STOP: f64 = 32.0;

/// The unscaled sum of sines, with the phases of Schroeder (1970).
fn sum(time: f64) -> f64 {
    let line = |(index, frequency): (usize, &f64)| {
        let i = (index + 1) as f64;
        sin(2.0 * PI * frequency * time - PI * i * (i - 1.0) / FREQUENCIES.len() as f64)
    };
    FREQUENCIES.iter().enumerate().map(line).sum()
}

/// The steering angle as a table for the driver.
fn table(peak: f64) -> String {
    let rows = (PERIOD / STEP).round() as usize;
    let largest = (0..rows).map(|row| sum(row as f64 * STEP).abs()).fold(0.0, f64::max);
    let mut text = String::from("time,driver.steer\n");
    let _ = writeln!(text, "0,0");
    let count = ((STOP - START) / STEP).round() as usize;
    for row in 0..=count {
        let time = START + row as f64 * STEP;
        let _ = writeln!(text, "{time:?},{:?}", peak / largest * sum(row as f64 * STEP));
    }
    text
}

/// Steers with the sum of sines. `steer` is the steering angle of the step steer, rad.
pub(crate) fn run(bench: &Bench<'_>, steer: Option<f64>, results: &mut Results) {
    let wanted = [
        "yaw_rate.bandwidth",
        "yaw_rate.phase_45_frequency",
        "yaw_rate.peak_ratio",
        "yaw_rate.delay_1hz",
        "lateral_acceleration.bandwidth",
        "lateral_acceleration.delay_1hz",
    ];
    // `results` already contains all metrics of the step steer. The ones that follow belong to this maneuver.
    results.maneuver = "frequency_response";
    let Some(steer) = steer else {
        results.take_none("frequency_response", &wanted, "the amplitude comes from the step steer, which found none");
        return;
    };
    let path = bench.folder.join(format!("frequency_response_{}.csv", bench.system.name));
    let written = std::fs::write(&path, table(0.5 * steer));
    let spec = RunSpec::new("frequency_response", Driving::OpenLoop, bench.speed(), STOP)
        .maneuver("table")
        .text("table.file", &path.to_string_lossy())
        .show("steer", 0.5 * steer);
    if let (Ok(()), Some((run, metrics))) = (written, shown(bench, spec, "frequency_response", &json!({}), results)) {
        results.take(&run, &metrics, &wanted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table repeats after its period and has the requested peak.
    #[test]
    fn the_steering_repeats_and_has_its_peak() {
        let text = table(0.02);
        let rows: Vec<f64> =
            text.lines().skip(2).map(|line| line.split_once(',').unwrap().1.parse().unwrap()).collect();
        let period = 10_000;
        let peak = rows[..period].iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        assert!((peak - 0.02).abs() < 1e-15);
        // Tolerance: rounding of the arguments of the sines, which are up to 2 pi 4 Hz 30 s, times the number of sines.
        assert!(rows.iter().zip(&rows[period..]).all(|(first, second)| (first - second).abs() < 1e-12));
        assert_eq!(rows.len(), 31_001);
    }
}
