//! Tests against the closed forms in the README.

use std::path::Path;
use std::sync::Arc;

use chassis_vehicle::random::{Normals, SENSOR_STREAM};
use fmu::simulation::DiscreteSimulation;
use fmu::testing::calls::Protocol;
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::Instance;
use fmu::testing::runner::DiscreteModel;
use proptest::prelude::*;

use super::*;

/// The measured values of a signal.
fn measured(p: &Sensor, signal: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sensor = DiscreteSimulation::new(p.clone()).unwrap();
    signal.into_iter().map(|u| sensor.sample(&U { u }).unwrap().y).collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// A signal without two equal values.
fn signal(count: usize) -> Vec<f64> {
    (0..count).map(|k| (k as f64 * 0.37).sin() + k as f64 * 1e-3).collect()
}

#[test]
fn the_start_values_pass_the_signal_on() {
    let signal = [vec![-0.0, 1e300, -5e-324], signal(2500)].concat();
    let y = measured(&Sensor::default(), signal.iter().copied());
    // -0 plus a bias of 0 is 0.
    assert_eq!(y[0], 0.0);
    assert_eq!(bits(&y[1..]), bits(&signal[1..]));
}

#[test]
fn the_delay_is_exact_and_begins_with_the_first_value() {
    let signal = signal(3333);
    for n in [0, 1, 2, 20, 999, 1000] {
        let y = measured(&Sensor { tau: n as f64 * 1e-3, ..Sensor::default() }, signal.iter().copied());
        let expected: Vec<f64> = (0..signal.len()).map(|k| signal[k.saturating_sub(n)]).collect();
        assert_eq!(bits(&y), bits(&expected), "{n} samples");
    }
}

#[test]
fn the_delay_is_a_whole_number_of_samples() {
    let n = |tau: f64, sample_time: f64| {
        Sensor { tau, sample_time, ..Sensor::default() }.derived().map(|derived| derived.n)
    };
    for (tau, sample_time, expected) in [
        (0.0, 0.001, 0),
        (4.9e-4, 0.001, 0),
        (5.1e-4, 0.001, 1),
        (0.3, 0.1, 3),
        (1.0004, 0.001, 1000),
        (50.0, 0.05, 1000),
    ] {
        assert_eq!(n(tau, sample_time), Ok(expected), "{tau} s, {sample_time} s");
    }
    assert_eq!(
        n(5.0, 0.001).unwrap_err(),
        "'sensor.delay' = 5 s is 5000 samples of 'sample_time' = 0.001 s; it must be at most 1000 samples: use a shorter \
         delay or a longer sample time"
    );
    assert!(n(f64::MAX, 1e-6).unwrap_err().contains("is inf samples"));
}

#[test]
fn bias_and_resolution_of_a_constant() {
    let y = |b: f64, q: f64, u: f64| measured(&Sensor { b, q, ..Sensor::default() }, [u])[0];
    assert_eq!(y(0.25, 0.0, 1.5), 1.75);
    // Multiples of 0.25; halves are rounded away from zero. All numbers are exact in binary.
    for (u, expected) in [(0.375, 0.5), (-0.375, -0.5), (0.374, 0.25), (0.124, 0.0), (-0.125, -0.25), (7.0, 7.0)] {
        assert_eq!(y(0.0, 0.25, u), expected, "{u}");
    }
    // The bias acts before the resolution.
    assert_eq!(y(0.0625, 0.25, 0.3125), 0.5);
}

#[test]
fn a_resolution_below_the_last_digit_changes_nothing() {
    for value in [1e300, -3.7, 1e-300] {
        for q in [1e-320, value.abs() * 1e-16] {
            assert_eq!(equations::quantize(value, q), value);
        }
    }
    // The largest quotient that is rounded is 2^52 - 0.5; the result is 2^52.
    assert_eq!(equations::quantize(1.0 - f64::EPSILON / 2.0, f64::EPSILON), 1.0);
}

/// Reference: delay, bias, noise and resolution, in this order, computed from their definitions with the random numbers
/// of the generator. The operations are the same, so the results must be bit-identical.
#[test]
fn the_effects_come_in_the_order_of_the_readme() {
    let p = Sensor { tau: 0.017, b: 0.02, sigma: 0.05, seed: 7, q: 0.01, ..Sensor::default() };
    let signal = signal(500);
    let mut normals = Normals::new(7, SENSOR_STREAM, 0);
    let expected: Vec<f64> = (0..signal.len())
        .map(|k| p.q * ((signal[k.saturating_sub(17)] + p.b + p.sigma * normals.draw()) / p.q).round())
        .collect();
    assert_eq!(bits(&measured(&p, signal)), bits(&expected));
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt())
}

/// Standard errors for M = 40,000 samples: mean sigma/sqrt(M), standard deviation sigma/sqrt(2 M), correlation
/// 1/sqrt(M). The tolerance is four standard errors for each of 8 seeds. The seeds are fixed, so the outcome is always
/// the same.
#[test]
fn noise_has_its_mean_and_standard_deviation() {
    const M: usize = 40_000;
    let (u, sigma) = (-3.0, 0.2);
    let one = 1.0 / (M as f64).sqrt();
    let mut all: Vec<Vec<f64>> = Vec::new();
    for seed in 0..8 {
        let y = measured(&Sensor { sigma, seed, ..Sensor::default() }, std::iter::repeat_n(u, M));
        let (mean, deviation) = mean_and_deviation(&y);
        assert!((mean - u).abs() < 4.0 * sigma * one, "seed {seed}: mean {mean}");
        assert!((deviation / sigma - 1.0).abs() < 4.0 * one / 2.0_f64.sqrt(), "seed {seed}: deviation {deviation}");
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - u) * (b - u)).sum::<f64>();
        for lag in [1, 2, 1000] {
            let correlation = product(&y[lag..], &y) / (M as f64 * sigma * sigma);
            assert!(correlation.abs() < 4.0 * one, "seed {seed}: correlation {correlation} after {lag} samples");
        }
        for other in &all {
            let correlation = product(&y, other) / (M as f64 * sigma * sigma);
            assert!(correlation.abs() < 4.0 * one, "seed {seed}: correlation {correlation} with another seed");
        }
        all.push(y);
    }
}

/// Rounding a random variable to multiples of q adds q^2/12 to its variance (Widrow, Kollár 2008), with an error below
/// 1e-7 for q = sigma. The tolerance is four standard errors sqrt(2/M) of the variance.
#[test]
fn resolution_adds_its_variance_to_the_noise() {
    const M: usize = 100_000;
    let (sigma, q) = (0.2, 0.2);
    let y = measured(&Sensor { sigma, q, ..Sensor::default() }, std::iter::repeat_n(0.07, M));
    let (_, deviation) = mean_and_deviation(&y);
    let expected = sigma * sigma + q * q / 12.0;
    let error = deviation * deviation / expected - 1.0;
    assert!(error.abs() < 4.0 * (2.0 / M as f64).sqrt(), "{error}");
}

#[test]
fn each_seed_gives_different_noise() {
    let noise = |seed: i32| bits(&measured(&Sensor { sigma: 1.0, seed, ..Sensor::default() }, [0.0; 100]));
    assert_eq!(noise(3), noise(3));
    let other = noise(4);
    assert!(noise(3).iter().all(|value| !other.contains(value)));
    // `Road` uses other streams.
    let mut road = Normals::new(3, 0, 0);
    assert!(noise(3).iter().all(|value| *value != road.draw().to_bits()));
}

type Fmu = Instance<DiscreteModel<Sensor>>;

/// An instance with delay, noise and resolution, and the value references of input and output.
fn instance() -> (Fmu, u32, u32) {
    let description = Arc::new(Description::of::<DiscreteModel<Sensor>>(Format::FMI2, Path::new("")));
    let reference = |name: &str| {
        description
            .layout
            .variables
            .iter()
            .find(|v| v.declaration.name == name)
            .unwrap_or_else(|| panic!("{name}"))
            .reference
    };
    let mut fmu = Fmu::new(Protocol::CS2, Arc::clone(&description), Path::new("").to_owned());
    for (name, value) in
        [("sensor.delay", 0.02), ("sensor.noise", 0.3), ("sensor.resolution", 0.01), ("sample_time", 0.004)]
    {
        fmu.set_real(&[reference(name)], &[value]).unwrap();
    }
    fmu.setup_experiment(0.0, None).unwrap();
    fmu.enter_initialization().unwrap();
    fmu.exit_initialization().unwrap();
    (fmu, reference("sensor.true_value"), reference("sensor.measured_value"))
}

/// Reference: the first sample, which has no delay. With a resolution of 0.5 and a bias of 0.25, 3.2 is measured as
/// 3.5.
#[test]
fn the_output_starts_at_the_input() {
    let description = Arc::new(Description::of::<DiscreteModel<Sensor>>(Format::FMI2, Path::new("")));
    let parameter =
        |name: &str| description.layout.variables.iter().find(|v| v.declaration.name == name).unwrap().reference;
    let (u, y) = (parameter("sensor.true_value"), parameter("sensor.measured_value"));
    let mut fmu = Fmu::new(Protocol::CS2, Arc::clone(&description), Path::new("").to_owned());
    for (name, value) in [("sensor.delay", 0.02), ("sensor.bias", 0.25), ("sensor.resolution", 0.5)] {
        fmu.set_real(&[parameter(name)], &[value]).unwrap();
    }
    fmu.setup_experiment(0.0, None).unwrap();
    fmu.enter_initialization().unwrap();
    let read = |fmu: &mut Fmu| {
        let mut value = [f64::NAN];
        fmu.get_real(&[y], &mut value).unwrap();
        value[0]
    };
    assert_eq!(read(&mut fmu), 0.5, "0.25 is rounded away from zero");
    fmu.set_real(&[u], &[3.2]).unwrap();
    assert_eq!(read(&mut fmu), 3.5);
    fmu.exit_initialization().unwrap();
    assert_eq!(read(&mut fmu), 3.5);
    fmu.do_step(0.0, 0.001).unwrap();
    assert_eq!(read(&mut fmu), 3.5);
}

/// Output values every 8 ms, for a signal that changes every 8 ms.
fn run(fmu: &mut Fmu, u: u32, y: u32, step: f64, times: std::ops::Range<u32>) -> Vec<u64> {
    let mut values = Vec::new();
    let parts = (0.008 / step).round() as u32;
    for k in times {
        fmu.set_real(&[u], &[(f64::from(k) * 0.4).sin()]).unwrap();
        for part in 0..parts {
            fmu.do_step((f64::from(k * parts + part)) * step, step).unwrap();
        }
        let mut value = [0.0];
        fmu.get_real(&[y], &mut value).unwrap();
        values.push(value[0].to_bits());
    }
    values
}

#[test]
fn results_do_not_depend_on_the_communication_step() {
    let values = |step| {
        let (mut fmu, u, y) = instance();
        run(&mut fmu, u, y, step, 0..200)
    };
    let expected = values(0.008);
    for step in [0.004, 0.002, 0.001, 0.0005] {
        assert_eq!(values(step), expected, "{step} s");
    }
}

#[test]
fn a_saved_state_continues_delay_and_noise() {
    let (mut fmu, u, y) = instance();
    run(&mut fmu, u, y, 0.008, 0..700); // longer than the buffer
    let saved = fmu.snapshot().unwrap();
    let bytes = fmu.serialize(&saved).unwrap();
    let (mut other, ..) = instance();
    let read = other.deserialize(&bytes).unwrap();
    other.restore(&read).unwrap();
    assert_eq!(run(&mut other, u, y, 0.008, 700..1500), run(&mut fmu, u, y, 0.008, 700..1500));
}

proptest! {
    /// A quantized value is a multiple of the resolution and differs from the signal by at most half of it. The
    /// rounding of the product adds one part in 2^53 of the value.
    #[test]
    fn quantized_values_are_the_nearest_multiples(value in -1e3..1e3_f64, q in 1e-6..10.0_f64) {
        let y = equations::quantize(value, q);
        let n = (y / q).round();
        prop_assert_eq!(y, q * n);
        prop_assert!((y - value).abs() <= 0.5 * q + 2.0 * f64::EPSILON * value.abs());
        prop_assert_eq!(equations::quantize(-value, q), -y);
    }
}
