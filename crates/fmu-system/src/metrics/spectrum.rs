//! Power spectral densities.

use super::{interval, sum};
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Length of a segment as a share of the signal, into which eight segments that overlap by half fit.
const SEGMENT: f64 = 2.0 / 9.0;

const MIN_ROWS: usize = 4;

/// A one-sided power spectral density, without the frequency 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Frequencies k/(N dt), Hz: k = 1, 2, … N/2, for segments of N rows that are dt apart.
    pub frequencies: Vec<f64>,
    /// Density at each frequency: square of the signal's unit per Hz.
    pub densities: Vec<f64>,
}

impl Spectrum {
    /// Power in the band [from, to): sum of the densities in it, times the spacing of the frequencies.
    pub fn power(&self, [from, to]: [f64; 2]) -> f64 {
        let rows = self.frequencies.iter().zip(&self.densities);
        sum::exact(rows.filter(|(f, _)| (from..to).contains(*f)).map(|(_, density)| *density)) * self.frequencies[0]
    }
}

/// Estimates the power spectral density of a signal with evenly spaced rows by Welch's method (P. D. Welch, IEEE Trans.
/// Audio Electroacoust. 15, 1967).
///
/// Segments of N = floor(2/9 of the rows) rows start every floor(N/2) rows. The mean of each is subtracted; then it is
/// multiplied by the periodic Hann window w\[i\] = 0.5 - 0.5 cos(2 pi i/N). The density is the mean over the segments
/// of 2 dt |X\[k\]|^2/sum(w^2), where X is the discrete Fourier transform and dt = (last - first time)/(rows - 1). For
/// an even N, the highest frequency is its own mirror image and gets half the density. The frequency 0 is omitted,
/// because the mean is subtracted.
///
/// The transform uses no vector instructions, so the result does not depend on the machine.
///
/// # Errors
/// A segment would have fewer than 4 rows (18 rows are needed).
pub fn spectrum(times: &[f64], values: &[f64]) -> Result<Spectrum, String> {
    let segments = Segments::of(times, [values])?;
    let densities = segments.mean(|[bin]| bin.norm_sqr());
    Ok(Spectrum { frequencies: segments.frequencies, densities })
}

/// Cross spectrum of two signals, one-sided and without the frequency 0. The densities are averaged over several runs
/// before [`Cross::transfer`].
#[derive(Debug, Clone, PartialEq)]
pub struct Cross {
    /// Frequencies, Hz, as in [`Spectrum`].
    pub frequencies: Vec<f64>,
    /// Power spectral density Pxx of the input.
    pub input: Vec<f64>,
    /// Power spectral density Pyy of the output.
    pub output: Vec<f64>,
    /// Real part of the cross power spectral density Pxy, the mean of conj(X) Y.
    pub real: Vec<f64>,
    /// Imaginary part of Pxy.
    pub imaginary: Vec<f64>,
}

/// A transfer function estimated from two signals.
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    /// Gain |Pxy|/Pxx at each frequency: unit of the output per unit of the input. NaN where the input has no power.
    pub gain: Vec<f64>,
    /// Phase of Pxy, rad, without jumps of more than pi between frequencies; between -pi and pi at the first.
    pub phase: Vec<f64>,
    /// Coherence |Pxy|^2/(Pxx Pyy), 0 to 1: 1 where the output follows from the input linearly and without noise.
    pub coherence: Vec<f64>,
}

/// Estimates the cross power spectral density of two signals, with the segments, windows and error of [`spectrum`].
pub fn cross(times: &[f64], input: &[f64], output: &[f64]) -> Result<Cross, String> {
    let segments = Segments::of(times, [input, output])?;
    Ok(Cross {
        input: segments.mean(|[x, _]| x.norm_sqr()),
        output: segments.mean(|[_, y]| y.norm_sqr()),
        real: segments.mean(|[x, y]| (x.conj() * y).re),
        imaginary: segments.mean(|[x, y]| (x.conj() * y).im),
        frequencies: segments.frequencies,
    })
}

impl Cross {
    /// The estimate H1 = Pxy/Pxx of the transfer function (J. S. Bendat, A. G. Piersol: Random Data, 4th ed., section
    /// 6.1), which noise in the output does not bias.
    pub fn transfer(&self) -> Transfer {
        let rows =
            || (0..self.frequencies.len()).map(|k| (self.input[k], self.output[k], self.real[k], self.imaginary[k]));
        let mut before = 0.0;
        let phase = rows().map(|(_, _, re, im)| {
            let angle = im.atan2(re);
            before = angle - TAU * ((angle - before) / TAU).round();
            before
        });
        Transfer {
            gain: rows().map(|(xx, _, re, im)| re.hypot(im) / xx).collect(),
            phase: phase.collect(),
            coherence: rows().map(|(xx, yy, re, im)| (re * re + im * im) / (xx * yy)).collect(),
        }
    }
}

/// The transformed segments of some signals.
struct Segments<const N: usize> {
    frequencies: Vec<f64>,
    /// Bins of the frequencies, by segment and signal.
    bins: Vec<[Vec<Complex<f64>>; N]>,
    /// Factor that converts a squared bin to a density.
    scale: f64,
    /// True if the last frequency is its own mirror image.
    is_even: bool,
}

impl<const N: usize> Segments<N> {
    fn of(times: &[f64], signals: [&[f64]; N]) -> Result<Self, String> {
        let size = (times.len() as f64 * SEGMENT) as usize;
        if size < MIN_ROWS {
            return Err(format!("a spectrum needs at least 18 rows, got {}", times.len()));
        }
        for signal in signals {
            super::same_length(signal, times)?;
        }
        let interval = interval(times)?;
        let window: Vec<f64> = (0..size).map(|i| 0.5 - 0.5 * (TAU * i as f64 / size as f64).cos()).collect();
        let transform = FftPlannerScalar::new().plan_fft_forward(size);
        let mut scratch = vec![Complex::default(); transform.get_inplace_scratch_len()];
        let mut transformed = |segment: &[f64]| -> Vec<Complex<f64>> {
            let mean = sum::exact(segment.iter().copied()) / size as f64;
            let weighted = segment.iter().zip(&window).map(|(value, weight)| (value - mean) * weight);
            let mut bins: Vec<Complex<f64>> = weighted.map(|value| Complex::new(value, 0.0)).collect();
            transform.process_with_scratch(&mut bins, &mut scratch);
            bins[1..=size / 2].to_vec()
        };
        let starts = (0..=times.len() - size).step_by(size / 2);
        let bins = starts.map(|start| signals.map(|signal| transformed(&signal[start..start + size]))).collect();
        let distance = 1.0 / (size as f64 * interval);
        Ok(Self {
            frequencies: (1..=size / 2).map(|k| k as f64 * distance).collect(),
            bins,
            scale: 2.0 * interval / sum::exact(window.iter().map(|weight| weight * weight)),
            is_even: size.is_multiple_of(2),
        })
    }

    /// Averages a product of bins over the segments, as a density.
    fn mean(&self, product: impl Fn([Complex<f64>; N]) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.frequencies.len()];
        for segment in &self.bins {
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += product(segment.each_ref().map(|bins| bins[k]));
            }
        }
        let count = self.bins.len() as f64;
        let mut densities: Vec<f64> = sums.iter().map(|sum| sum / count * self.scale).collect();
        if let Some(last) = densities.last_mut().filter(|_| self.is_even) {
            *last *= 0.5;
        }
        densities
    }
}
