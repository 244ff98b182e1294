//! The linear model: x' = A x + B u, y = C x + D u about an operating point, its modes and its frequency response.

use std::f64::consts::TAU;

use fmu_import::bytes::BinaryText;
use fmu_import::description::ModelDescription;
use fmu_linear::linearize::Linear;
use fmu_math::eigenvalues;
use nalgebra::{Complex, DMatrix};
use serde::Serialize;
use sha2::{Digest as _, Sha256};

/// Because of rounding errors, poles smaller than this fraction of the largest pole count as 0.
const AT_ZERO: f64 = 1e-8;

/// Number of frequencies of a response per decade.
const PER_DECADE: f64 = 100.0;

const MOST: usize = 1001;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Signal {
    pub(crate) name: String,
    /// Unit of measure; `None` without one.
    pub(crate) unit: Option<String>,
}

/// A real pole, or a pair of conjugate poles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Mode {
    /// Real part of the pole, 1/s; 0 if only rounding errors make it differ from 0.
    pub(crate) real: f64,
    /// Imaginary part, 1/s; for a pair, that of the pole above the real axis.
    pub(crate) imaginary: f64,
    /// Natural frequency: magnitude over 2 pi, Hz.
    pub(crate) frequency: f64,
    /// Damping ratio: minus the real part over the magnitude. `None` for a pole at 0.
    pub(crate) damping: Option<f64>,
    /// Time in which the mode decays to 1/e, s. `None` for a mode that does not decay.
    pub(crate) time_constant: Option<f64>,
}

#[derive(Debug, Clone)]
pub(crate) struct LinearModel {
    pub(crate) fmu: String,
    pub(crate) guid: String,
    /// SHA-256 of the file, in hexadecimal digits.
    pub(crate) sha256: String,
    /// Values that differ from the start values, as the user wrote them.
    pub(crate) settings: Vec<(String, String)>,
    pub(crate) states: Vec<Signal>,
    pub(crate) inputs: Vec<Signal>,
    pub(crate) outputs: Vec<Signal>,
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
    pub(crate) d: DMatrix<f64>,
    /// All poles, in order of decreasing real part.
    pub(crate) poles: Vec<Complex<f64>>,
}

impl LinearModel {
    /// The linear model of an FMU. `file` contains the bytes of the FMU. `None` if the eigenvalues of A do not
    /// converge.
    pub(crate) fn new(
        description: &ModelDescription,
        file: &[u8],
        settings: &[(String, String)],
        linear: Linear,
    ) -> Option<Self> {
        let signals = |names: Vec<String>| names.into_iter().map(|name| signal(description, name)).collect::<Vec<_>>();
        let (states, inputs, outputs) = (signals(linear.states), signals(linear.inputs), signals(linear.outputs));
        let (n, m, p) = (states.len(), inputs.len(), outputs.len());
        let jacobian = DMatrix::from_column_slice(n + p, n + m, &linear.jacobian);
        let part = |at: (usize, usize), size: (usize, usize)| jacobian.view(at, size).into_owned();
        let a = part((0, 0), (n, n));
        Some(Self {
            fmu: description.model_name.clone(),
            guid: description.guid.clone(),
            sha256: BinaryText::Hex.encode(&Sha256::digest(file)),
            settings: settings.to_vec(),
            states,
            inputs,
            outputs,
            b: part((0, n), (n, m)),
            c: part((n, 0), (p, n)),
            d: part((n, n), (p, m)),
            poles: eigenvalues(&a)?,
            a,
        })
    }

    /// The modes, in order of decreasing real part.
    pub(crate) fn modes(&self) -> Vec<Mode> {
        let zero = zero(&self.poles);
        let of_pair = self.poles.iter().filter(|pole| pole.im >= 0.0);
        of_pair
            .map(|pole| {
                let size = pole.norm();
                if size <= zero {
                    return Mode { real: 0.0, imaginary: 0.0, frequency: 0.0, damping: None, time_constant: None };
                }
                Mode {
                    real: pole.re,
                    imaginary: pole.im,
                    frequency: size / TAU,
                    damping: Some(-pole.re / size),
                    time_constant: (pole.re < -zero).then(|| -1.0 / pole.re),
                }
            })
            .collect()
    }

    pub(crate) fn stability(&self) -> String {
        let zero = zero(&self.poles);
        let unstable = self.poles.iter().filter(|pole| pole.re > zero).count();
        let integrators = self.poles.iter().filter(|pole| pole.norm() <= zero).count();
        let undamped = self.poles.iter().filter(|pole| pole.re.abs() <= zero && pole.norm() > zero).count();
        let counted = |count: usize, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            _ => Some(format!("{count} {many}")),
        };
        let found: Vec<String> = [
            counted(unstable, "unstable pole", "unstable poles"),
            counted(undamped, "pole without damping", "poles without damping"),
            counted(integrators, "pole at 0", "poles at 0"),
        ]
        .into_iter()
        .flatten()
        .collect();
        if found.is_empty() { "stable".to_owned() } else { found.join(", ") }
    }

    /// Frequencies for responses, Hz, from one decade below the slowest mode to one decade above the fastest mode.
    pub(crate) fn frequencies(&self) -> Vec<f64> {
        let zero = zero(&self.poles);
        let sizes = || self.poles.iter().map(|pole| pole.norm()).filter(|size| *size > zero);
        let (low, high) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
        let (low, high) = if high > 0.0 { (0.1 * low / TAU, 10.0 * high / TAU) } else { (0.01, 100.0) };
        let decades = (high / low).log10();
        // Few enough for a page, many enough for a curve. Truncated on purpose.
        let count = ((decades * PER_DECADE) as usize).clamp(2, MOST - 1);
        (0..=count).map(|k| low * (high / low).powf(k as f64 / count as f64)).collect()
    }

    /// G(j omega) = C (j omega I - A)^-1 B + D from an input to an output, at frequencies in Hz. The result is NaN at a
    /// pole.
    pub(crate) fn response(&self, input: usize, output: usize, frequencies: &[f64]) -> Vec<Complex<f64>> {
        let complex = |value: f64| Complex::new(value, 0.0);
        let b = self.b.column(input).map(complex);
        let c = self.c.row(output).map(complex);
        let d = complex(self.d[(output, input)]);
        let n = self.states.len();
        let minus_a = self.a.map(|value| complex(-value));
        let of = |frequency: &f64| {
            let mut matrix = minus_a.clone();
            for i in 0..n {
                matrix[(i, i)] += Complex::new(0.0, TAU * frequency);
            }
            matrix.lu().solve(&b).map_or(complex(f64::NAN), |x| (&c * x)[(0, 0)] + d)
        };
        frequencies.iter().map(of).collect()
    }

    /// Returns true if an input acts on an output, directly or through states.
    pub(crate) fn acts(&self, input: usize, output: usize) -> bool {
        let response = self.response(input, output, &self.frequencies()[..1]);
        response.iter().any(|g| g.norm() > 0.0)
    }
}

/// Magnitude below which a pole counts as 0, 1/s.
pub(crate) fn zero(poles: &[Complex<f64>]) -> f64 {
    AT_ZERO * poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max)
}

/// A signal with its unit; an element of an array has the array's unit.
fn signal(description: &ModelDescription, name: String) -> Signal {
    let whole = || description.variable(name.split('[').next()?);
    let variable = description.variable(&name).or_else(whole);
    let unit = variable.and_then(|variable| variable.unit.clone()).filter(|unit| unit != "1");
    Signal { name, unit }
}

#[cfg(test)]
mod tests {
    use super::super::tests::oscillator;
    use super::*;

    /// Reference: the closed form of the damped oscillator; eigenvalues of a 3 x 3 matrix are exact up to rounding.
    #[test]
    fn modes_are_those_of_the_oscillator() {
        let modes = oscillator().modes();
        let [integrator, oscillation] = &modes[..] else { panic!("{modes:?}") };
        assert_eq!((integrator.damping, integrator.time_constant), (None, None));
        assert_eq!((integrator.real, integrator.frequency), (0.0, 0.0));
        assert!((oscillation.frequency - 10.0 / TAU).abs() < 1e-12);
        assert!((oscillation.damping.unwrap() - 0.1).abs() < 1e-12);
        assert!((oscillation.time_constant.unwrap() - 1.0).abs() < 1e-12);
        assert!((oscillation.imaginary - 99.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(oscillator().stability(), "1 pole at 0");
    }

    /// Reference: FIPS 180-2, appendix B.1.
    #[test]
    fn the_hash_is_that_of_the_standard() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(oscillator().sha256, expected);
    }

    #[test]
    fn a_pole_that_rounding_moves_is_at_zero() {
        let mut model = oscillator();
        model.poles = vec![Complex::new(1e-16, 0.0), Complex::new(-3e-15, 0.0), Complex::new(-1e3, 0.0)];
        assert_eq!(model.modes().iter().map(|mode| mode.damping).collect::<Vec<_>>(), [None, None, Some(1.0)]);
        model.poles = vec![Complex::new(2.0, 0.0), Complex::new(0.0, 3.0), Complex::new(0.0, -3.0)];
        assert_eq!(model.stability(), "1 unstable pole, 2 poles without damping");
        assert_eq!(model.modes()[0].damping, Some(-1.0));
        model.poles = vec![Complex::new(-1.0, 0.0)];
        assert_eq!(model.stability(), "stable");
    }

    /// Reference: G = 0.5/(omega_0^2 - omega^2 + 2 zeta omega_0 omega j).
    #[test]
    fn the_response_is_that_of_the_oscillator() {
        let model = oscillator();
        let frequencies = model.frequencies();
        assert!((frequencies[0] * TAU - 1.0).abs() < 1e-9 && (frequencies.last().unwrap() * TAU - 100.0).abs() < 1e-7);
        for (frequency, g) in frequencies.iter().zip(model.response(0, 0, &frequencies)) {
            let omega = TAU * frequency;
            let expected = Complex::new(0.5, 0.0) / Complex::new(100.0 - omega * omega, 2.0 * omega);
            assert!((g - expected).norm() < 1e-12 * expected.norm(), "{frequency}: {g} {expected}");
        }
        assert!(model.acts(0, 0));
    }
}
