//! Compares the limit cycle with an independent solution.

use fmu::simulation::ContinuousSimulation;
use van_der_pol::VanDerPol;

/// Amplitude and period for mu = 1: Runge-Kutta of order 4 in steps of 0.5 ms in 80-bit numbers (NumPy, `longdouble`), the
/// maxima by Newton's method.
const AMPLITUDE: f64 = 2.008_619_860_874_8;
const PERIOD: f64 = 6.663_286_859_323;

/// Tolerance: the default steps of 10 ms have an error of about 1e-9 per period; the parabola through three points around a
/// maximum is exact up to x''' step^3 / (9 sqrt(3)) = 2e-7 in x, and its time up to x'''' step^2 / 6 = 5e-5 s, which is nearly
/// the same at each maximum.
#[test]
fn amplitude_and_period_match_the_limit_cycle() {
    const STEP: f64 = 0.01;
    let mut run = ContinuousSimulation::new(VanDerPol::default()).expect("it starts");
    let mut values = vec![run.state().x];
    while run.time() < 60.0 {
        run.step(&(), STEP).expect("a step");
        values.push(run.state().x);
    }
    let maxima: Vec<(f64, f64)> = (1..values.len() - 1)
        .filter(|&k| values[k] > 1.0 && values[k] > values[k - 1] && values[k] >= values[k + 1])
        .map(|k| {
            let [before, at, after] = [values[k - 1], values[k], values[k + 1]];
            let offset = 0.5 * (before - after) / (before - 2.0 * at + after);
            ((k as f64 + offset) * STEP, at - 0.25 * (before - after) * offset)
        })
        .collect();
    // In the first periods, the motion has not yet reached the limit cycle.
    let [.., (before, _), (last, amplitude)] = maxima[..] else { panic!("two maxima") };
    assert!((amplitude - AMPLITUDE).abs() < 1e-6, "{amplitude}");
    assert!((last - before - PERIOD).abs() < 1e-4, "{}", last - before);
}

/// Reference: without damping the oscillator is harmonic, x = 2 cos t. Tolerance: a step has an error of step^5 / 120, which
/// adds up to 2 * 20 s * 0.01^4 / 120 = 3e-9.
#[test]
fn without_damping_the_motion_is_harmonic() {
    let mut run = ContinuousSimulation::new(VanDerPol { mu: 0.0 }).expect("it starts");
    for _ in 0..2000 {
        run.step(&(), 0.01).expect("a step");
    }
    let (x, time) = (run.state().x, run.time());
    assert!((x - 2.0 * time.cos()).abs() < 1e-8, "{}", x - 2.0 * time.cos());
}
