//! Power spectral densities.

use super::{MetricError, interval, sum};
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Length of a segment as a share of the whole: eight segments that overlap by half fit in.
const SEGMENT: f64 = 2.0 / 9.0;

/// A segment has at least so many rows.
const MIN_ROWS: usize = 4;

/// A one-sided power spectral density, without the frequency 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Frequencies k/(N dt), Hz: k = 1, 2, … N/2, where N rows of the distance dt make a segment.
    pub frequencies: Vec<f64>,
    /// Density at each frequency: square of the signal's unit per Hz.
    pub densities: Vec<f64>,
}

impl Spectrum {
    /// Power in the band [from, to): sum of the densities in it, times the distance of the frequencies.
    #[must_use]
    pub fn power(&self, [from, to]: [f64; 2]) -> f64 {
        let rows = self.frequencies.iter().zip(&self.densities);
        sum::exact(rows.filter(|(f, _)| (from..to).contains(*f)).map(|(_, density)| *density)) * self.frequencies[0]
    }
}

/// Estimates the power spectral density of a signal with evenly spaced rows by Welch's method (P. D. Welch, IEEE Trans. Audio
/// Electroacoust. 15, 1967).
///
/// Segments of N = floor(2/9 of the rows) rows start every floor(N/2) rows. From each its mean is subtracted; then it is
/// multiplied with the periodic Hann window w\[i\] = 0.5 - 0.5 cos(2 pi i/N). The density is the mean over the segments of
/// 2 dt |X\[k\]|^2/sum(w^2), where X is the discrete Fourier transform and dt = (last - first time)/(rows - 1). The highest
/// frequency of an even N is its own mirror image and has half of it. The frequency 0 is left out: without the mean there is
/// nothing.
///
/// The transform uses no vector instructions, so the result does not depend on the machine's.
///
/// # Errors
/// A segment would have fewer than 4 rows (18 rows are needed).
pub fn spectrum(times: &[f64], values: &[f64]) -> Result<Spectrum, MetricError> {
    let size = (values.len() as f64 * SEGMENT) as usize;
    if size < MIN_ROWS {
        return Err(MetricError::TooShort(values.len()));
    }
    let interval = interval(times)?;
    let window: Vec<f64> = (0..size).map(|i| 0.5 - 0.5 * (TAU * i as f64 / size as f64).cos()).collect();
    let transform = FftPlannerScalar::new().plan_fft_forward(size);
    let mut scratch = vec![Complex::default(); transform.get_inplace_scratch_len()];
    let mut sums = vec![0.0; size / 2];
    let mut count = 0.0;
    for segment in values.windows(size).step_by(size / 2) {
        let mean = sum::exact(segment.iter().copied()) / size as f64;
        let weighted = segment.iter().zip(&window).map(|(value, weight)| (value - mean) * weight);
        let mut bins: Vec<Complex<f64>> = weighted.map(|value| Complex::new(value, 0.0)).collect();
        transform.process_with_scratch(&mut bins, &mut scratch);
        for (sum, bin) in sums.iter_mut().zip(&bins[1..]) {
            *sum += bin.norm_sqr();
        }
        count += 1.0;
    }
    let scale = 2.0 * interval / sum::exact(window.iter().map(|weight| weight * weight));
    let mut densities: Vec<f64> = sums.iter().map(|sum| sum / count * scale).collect();
    if size.is_multiple_of(2) {
        densities[size / 2 - 1] *= 0.5;
    }
    let distance = 1.0 / (size as f64 * interval);
    let frequencies = (1..=size / 2).map(|k| k as f64 * distance).collect();
    Ok(Spectrum { frequencies, densities })
}
