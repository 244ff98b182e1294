//! Frequency weighting of vibrations according to ISO 2631-1.

use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;
use std::f64::consts::SQRT_2;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Weighting {
    /// No weighting: the result is the standard deviation.
    None,
    /// W_k: vertical acceleration.
    Vertical,
    /// W_d: horizontal acceleration.
    #[cfg(test)]
    Horizontal,
    /// W_e: angular acceleration.
    Angular,
}

/// Band limits, Hz.
const HIGH_PASS: f64 = 0.4;
const LOW_PASS: f64 = 100.0;
/// Quality factors of the transition, and of both parts of the upward step of W_k.
const TRANSITION: f64 = 0.63;
const STEP: f64 = 0.91;
/// Frequencies of the upward step, Hz.
const STEP_LOW: f64 = 2.37;
const STEP_HIGH: f64 = 3.35;

impl Weighting {
    /// Gain at a frequency, Hz.
    pub(crate) fn gain(self, frequency: f64) -> f64 {
        let transition = match self {
            Self::None => return 1.0,
            Self::Vertical => 12.5,
            #[cfg(test)]
            Self::Horizontal => 2.0,
            Self::Angular => 1.0,
        };
        // The Laplace variable relative to a corner frequency f_c: i f/f_c.
        let relative = |corner: f64| Complex::new(0.0, frequency / corner);
        let s1 = relative(HIGH_PASS);
        let high = s1 * s1 / (s1 * s1 + s1 * SQRT_2 + 1.0);
        let s2 = relative(LOW_PASS);
        let low = (s2 * s2 + s2 * SQRT_2 + 1.0).inv();
        let s3 = relative(transition);
        let falling = (s3 + 1.0) / (s3 * s3 + s3 / TRANSITION + 1.0);
        let step = if self == Self::Vertical {
            let (s5, s6) = (relative(STEP_LOW), relative(STEP_HIGH));
            let ratio = STEP_LOW / STEP_HIGH;
            (s5 * s5 + s5 / STEP + 1.0) / (s6 * s6 + s6 / STEP + 1.0) * (ratio * ratio)
        } else {
            Complex::new(1.0, 0.0)
        };
        (high * low * falling * step).norm_sqr().sqrt()
    }

    /// Weighted root mean square of a signal about its mean; `rate` is the sampling rate, Hz. The weights are applied
    /// to the Fourier transform, which avoids the transient of a filter. `None` without values.
    pub(super) fn rms(self, x: &[f64], rate: f64) -> Option<f64> {
        let mean = crate::numerics::mean(x)?;
        let mut bins: Vec<Complex<f64>> = x.iter().map(|x| Complex::new(x - mean, 0.0)).collect();
        FftPlannerScalar::new().plan_fft_forward(bins.len()).process(&mut bins);
        let count = bins.len();
        let power = |line: usize| {
            let gain = self.gain(line as f64 * rate / count as f64);
            let sides = if 2 * line == count { 1.0 } else { 2.0 };
            sides * gain * gain * bins[line].norm_sqr()
        };
        Some((1..=count / 2).map(power).sum::<f64>().sqrt() / count as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::standard_deviation;
    use fmu_math::sin;
    use std::f64::consts::TAU;

    /// Published values of W_k (ISO 2631-1, table 3) with three digits, and check numbers with four digits.
    #[test]
    fn vertical_weighting() {
        for (frequency, published, check) in [
            (0.5, 0.418, 0.4182),
            (1.0, 0.482, 0.4825),
            (2.0, 0.531, 0.5314),
            (4.0, 0.967, 0.9672),
            (5.0, 1.039, 1.0388),
            (6.3, 1.054, 1.0544),
            (8.0, 1.036, 1.0364),
            (16.0, 0.768, 0.7687),
            (31.5, 0.405, 0.4048),
            (80.0, 0.132, 0.1324),
        ] {
            let gain = Weighting::Vertical.gain(frequency);
            assert!((gain - check).abs() <= 5.1e-5, "{frequency} Hz: {gain}");
            // The tolerance is larger, because the table is for exact third-octave frequencies: 10^(8/10) = 6.31 Hz
            // instead of 6.3 Hz, 15.85 Hz instead of 16 Hz.
            assert!((gain - published).abs() <= 1e-3, "{frequency} Hz: {gain}");
        }
    }

    /// W_d from the published table, W_e from check numbers.
    #[test]
    fn horizontal_and_angular_weighting() {
        for (frequency, expected) in [(1.0, 1.011), (2.0, 0.890), (4.0, 0.512), (8.0, 0.253)] {
            let gain = Weighting::Horizontal.gain(frequency);
            assert!((gain - expected).abs() < 2e-3, "{frequency} Hz: {gain}");
        }
        for (frequency, expected) in [(1.0, 0.8798), (2.0, 0.5115), (4.0, 0.2531)] {
            let gain = Weighting::Angular.gain(frequency);
            assert!((gain - expected).abs() <= 5.1e-5, "{frequency} Hz: {gain}");
        }
        assert_eq!(Weighting::Vertical.gain(0.0), 0.0);
    }

    /// Check numbers for a sine of 3 m/s2 RMS at 5 Hz. Over whole periods, the result is 3 times the gain at 5 Hz. Over
    /// 10,001 rows of 1 ms, which are not whole periods, it is 3.116269.
    #[test]
    fn a_sine() {
        let wave =
            |rows: u32| (0..rows).map(|k| 3.0 * SQRT_2 * sin(TAU * 5.0 * f64::from(k) * 0.001)).collect::<Vec<_>>();
        let whole = Weighting::Vertical.rms(&wave(10_000), 1000.0).unwrap();
        assert!((whole - 3.116_477).abs() < 5e-7, "{whole}");
        assert!((whole - 3.0 * Weighting::Vertical.gain(5.0)).abs() < 1e-12);
        let odd = Weighting::Vertical.rms(&wave(10_001), 1000.0).unwrap();
        assert!((odd - 3.116_269).abs() < 5e-7, "{odd}");
    }

    /// Without weighting, the result is the standard deviation (Parseval), for even and odd numbers of rows.
    #[test]
    fn no_weighting_is_the_standard_deviation() {
        for rows in [1, 2, 3, 64, 97, 1000] {
            let noise: Vec<f64> = (0..rows).map(|k| f64::from(k * 7919 % 1009) - 300.0).collect();
            let (rms, expected) = (Weighting::None.rms(&noise, 100.0).unwrap(), standard_deviation(&noise).unwrap());
            assert!((rms - expected).abs() <= 1e-12 * expected, "{rows}: {rms} {expected}");
        }
        assert_eq!(Weighting::None.rms(&[], 100.0), None);
    }
}
