//! `Sensor`: measures any signal at its samples, with delay, bias, noise and resolution. The README has the equations.

mod equations;
#[cfg(test)]
mod tests;

use fmu::prelude::*;

/// Symbols as in the README. The start values pass the signal on unchanged.
#[derive(Parameters, Clone, Debug)]
pub struct Sensor {
    /// tau: delay, rounded to whole samples; at most 1000 samples
    #[var("sensor.delay", unit = "s", start = 0.0, min = 0.0, display = "ms")]
    tau: f64,
    /// b: bias, in the unit of the signal
    #[var("sensor.bias", unit = Unit::NONE, start = 0.0, tunable)]
    b: f64,
    /// sigma: standard deviation of the noise, in the unit of the signal; 0 for none
    #[var("sensor.noise", unit = Unit::NONE, start = 0.0, min = 0.0, tunable)]
    sigma: f64,
    /// Seed of the noise; use a different seed for each sensor in a system
    #[var("seed", start = 1, min = 0, max = i32::MAX)]
    seed: i32,
    /// q: resolution, the smallest difference between two measured values, in the unit of the signal; 0 for none
    #[var("sensor.resolution", unit = Unit::NONE, start = 0.0, min = 0.0, tunable)]
    q: f64,
    /// T
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// The signal.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    /// Signal to measure
    #[var("sensor.true_value", unit = Unit::NONE)]
    u: f64,
}

/// The measured signal.
#[derive(Outputs, Clone, Debug, PartialEq)]
pub struct Y {
    /// Signal as measured, in its unit
    #[var("sensor.measured_value", unit = Unit::NONE)]
    y: f64,
}

/// The most recent samples.
#[derive(DiscreteState, Clone, Debug, PartialEq)]
pub struct X {
    /// k: number of the next sample.
    k: u64,
    /// Ring buffer of the signal: sample `k` is at index `k` modulo the length.
    #[var(always_finite)]
    past: Box<[f64; equations::MOST_SAMPLES]>,
}

/// The delay in samples.
#[derive(Derived, Clone, Debug)]
pub struct D {
    n: usize,
}

/// Measures any signal at its samples, with delay, bias, noise and resolution
#[fmu::model(stop_time = 2.0, step_size = 0.001)]
impl Discrete for Sensor {
    type Derived = D;
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    // Already in Initialization Mode, the output has the value of the first sample.
    const SOURCE: Option<Influence> = Some(|_, _| true);
    const FOLLOWS: Influence = |_, _| true;

    fn derived(&self) -> Result<D, String> {
        Ok(D { n: equations::delay_in_samples(self)? })
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { y: equations::sample(self, sample.derived.n, sample.state, sample.inputs.u) }
    }
}
