//! Inputs that excite any FMU without knowledge of its model. They are smooth and deterministic, and the unit of a
//! variable determines the amplitude.

use crate::{Fmu, Instance, bits, is_double, ok};
use fmu_import::c_api::Reference;
use fmu_import::description::{Causality, Value, Variable};

/// Pseudorandom numbers that are the same on every platform (SplitMix64: Steele, Lea, Flood, "Fast splittable
/// pseudorandom number generators", OOPSLA 2014).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in [-1, 1).
    pub fn symmetric(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 2.0_f64.powi(-52) - 1.0
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.bits() % end
    }
}

/// A small deviation of a variable from its start value, which depends on the unit. With such deviations, the tires
/// stay on the road and do not saturate.
#[must_use]
pub fn scale(variable: &Variable) -> f64 {
    if variable.name.starts_with("wheel_speed") {
        return 1.0; // rad/s: about 2 % of the speed of a rolling wheel
    }
    match variable.unit.as_deref().unwrap_or("1") {
        "m" => 2e-3,
        "rad" => 0.02,
        "m/s" | "rad/s" => 0.05,
        "N" | "N.m" => 500.0,
        "MPa" => 0.5,
        _ => 0.1,
    }
}

/// Start value of a real variable; 0 if it has no start value.
#[must_use]
pub fn start(variable: &Variable) -> f64 {
    match variable.start {
        Some(Value::Real(value)) => value,
        _ => 0.0,
    }
}

/// Returns true for a quantity that is normally positive: forward speed, grip, pedals. An FMU may reject a vehicle that
/// drives backwards.
#[must_use]
pub fn is_magnitude(variable: &Variable) -> bool {
    let name = variable.name.as_str();
    name.ends_with(".speed")
        || name.starts_with("wheel_speed")
        || name.starts_with("road_friction")
        || name.contains("brake")
        || name.ends_with(".throttle")
}

/// Sinusoidal inputs of an FMU.
#[derive(Clone, Debug)]
pub struct Excitation {
    /// Value references of the real inputs.
    pub references: Vec<Reference>,
    /// Offset, amplitude, angular frequency (rad/s) and phase of each input.
    waves: Vec<[f64; 4]>,
}

impl Excitation {
    /// Waves of 0.2 to 3 Hz around the start values.
    #[must_use]
    pub fn of(fmu: &Fmu, seed: u64) -> Self {
        let mut random = Random(seed);
        let inputs = || fmu.with(Causality::Input).filter(|v| is_double(v));
        let waves = inputs()
            .map(|variable| {
                let amplitude = scale(variable);
                let offset = start(variable) + if is_magnitude(variable) { amplitude } else { 0.0 };
                let frequency = std::f64::consts::TAU * (1.6 + 1.4 * random.symmetric());
                [offset, amplitude, frequency, std::f64::consts::PI * random.symmetric()]
            })
            .collect();
        Self { references: inputs().map(|variable| variable.reference).collect(), waves }
    }

    /// The values at a time in s.
    pub fn values(&self, time: f64, values: &mut [f64]) {
        for (value, [offset, amplitude, frequency, phase]) in values.iter_mut().zip(&self.waves) {
            *value = offset + amplitude * (frequency * time + phase).sin();
        }
    }
}

/// Steps from `time` (the inputs as functions of `time` - `origin`) and returns the bits of all outputs of all steps.
///
/// # Panics
/// If the FMU returns an error.
pub fn run(
    fmu: &Fmu,
    instance: &mut Instance,
    excitation: &Excitation,
    origin: f64,
    steps: std::ops::Range<u32>,
    step: f64,
) -> Vec<u64> {
    let mut inputs = vec![0.0; excitation.references.len()];
    let mut all = Vec::new();
    for k in steps {
        let elapsed = f64::from(k) * step;
        excitation.values(elapsed, &mut inputs);
        ok(instance.set_real(&excitation.references, &inputs));
        ok(instance.do_step(origin + elapsed, step));
        all.extend(bits(&fmu.outputs(instance)));
    }
    all
}
