//! The low-pass filter of the evaluators.

use crate::metric::Reason;
use fmu_math::{cos, tan};
use std::f64::consts::PI;

/// Pole pairs of the Butterworth filter.
const SECTIONS: usize = 3;

/// Filters a signal forward and backward with a Butterworth filter of order 6: twelve poles, no phase shift. `cutoff`
/// and the sampling rate `rate` are in Hz.
///
/// The digital filter results from a bilinear transform with prewarping. Both ends are extended by odd reflection over
/// three periods of the cutoff frequency, or fewer if the signal is shorter. Each pass starts in the steady state for
/// its first sample.
pub(crate) fn lowpass(x: &[f64], cutoff: f64, rate: f64) -> Result<Vec<f64>, Reason> {
    if cutoff >= 0.5 * rate {
        return Err(format!("a sampling rate of {rate} Hz is too low for a low-pass filter at {cutoff} Hz"));
    }
    let Some(added) = x.len().checked_sub(1) else { return Ok(Vec::new()) };
    let added = added.min((3.0 * rate / cutoff + 0.5).floor() as usize);
    let (first, last) = (x[0], x[x.len() - 1]);
    let front = x[1..=added].iter().rev().map(|x| 2.0 * first - x);
    let back = x[x.len() - 1 - added..x.len() - 1].iter().rev().map(|x| 2.0 * last - x);
    let mut extended: Vec<f64> = front.chain(x.iter().copied()).chain(back).collect();
    for section in sections(cutoff, rate) {
        section.run(&mut extended);
    }
    extended.reverse();
    for section in sections(cutoff, rate) {
        section.run(&mut extended);
    }
    extended.reverse();
    Ok(extended[added..added + x.len()].to_vec())
}

/// A second-order section with gain 1 at frequency 0: y = b0 (x + 2 x' + x'') - a1 y' - a2 y''.
struct Section {
    b0: f64,
    a1: f64,
    a2: f64,
}

fn sections(cutoff: f64, rate: f64) -> [Section; SECTIONS] {
    let k = tan(PI * cutoff / rate);
    std::array::from_fn(|index| {
        // Angle of the pole pair from the negative real axis; 2 cos(angle) is 1/Q.
        let angle = PI * (2 * index + 1) as f64 / (4 * SECTIONS) as f64;
        let damping = 2.0 * cos(angle) * k;
        let norm = 1.0 + damping + k * k;
        Section { b0: k * k / norm, a1: 2.0 * (k * k - 1.0) / norm, a2: (1.0 - damping + k * k) / norm }
    })
}

impl Section {
    /// Filters in place, starting in the steady state for the first sample.
    fn run(&self, x: &mut [f64]) {
        let first = x.first().copied().unwrap_or(0.0);
        // Transposed direct form II. In the steady state, the output equals the input.
        let mut z1 = (1.0 - self.b0) * first;
        let mut z2 = (self.b0 - self.a2) * first;
        for x in x {
            let input = *x;
            let output = self.b0 * input + z1;
            z1 = 2.0 * self.b0 * input - self.a1 * output + z2;
            z2 = self.b0 * input - self.a2 * output;
            *x = output;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_math::sin;

    const RATE: f64 = 1000.0;

    /// Closed form: the gain of both passes is 1/(1 + (tan(pi f/fs)/tan(pi fc/fs))^12), and the phase is 0. The middle
    /// of the 20 s is compared. Tolerance: the effect that the ends still have there.
    #[test]
    fn sines_have_the_gain_of_the_closed_form() {
        for frequency in [0.5, 2.0, 5.0, 6.0, 7.0, 12.0] {
            let wave: Vec<f64> = (0..20_000).map(|k| sin(2.0 * PI * frequency * f64::from(k) / RATE)).collect();
            let filtered = lowpass(&wave, 6.0, RATE).unwrap();
            let warped = (PI * frequency / RATE).tan() / (PI * 6.0 / RATE).tan();
            let gain = 1.0 / (1.0 + warped.powi(12));
            for row in 9_000..11_000 {
                let error = (filtered[row] - gain * wave[row]).abs();
                assert!(error < 1e-12, "{frequency} Hz, row {row}: {error}");
            }
        }
    }

    /// A filter without phase shift does not change a straight line. Tolerance: the effect that the ends still have in
    /// the middle.
    #[test]
    fn straight_lines_stay() {
        let line: Vec<f64> = (0..6_000).map(|k| 3.0 - 0.01 * f64::from(k)).collect();
        let filtered = lowpass(&line, 10.0, RATE).unwrap();
        for row in 2_500..3_500 {
            assert!((filtered[row] - line[row]).abs() < 1e-9, "row {row}");
        }
    }

    /// scipy 1.15.3: `sosfiltfilt(butter(6, 10, fs=100, output="sos"), x, padtype="odd", padlen=n)`.
    #[test]
    fn scipy_has_the_same_values() {
        let noise: Vec<f64> = (0..60).map(|k| f64::from(k * 7919 % 101) / 50.0 - 1.0).collect();
        let filtered = lowpass(&noise, 10.0, 100.0).unwrap();
        for (row, expected) in [
            (0, -0.998240927154697),
            (1, -0.646376436545606),
            (17, 0.02393791586441),
            (30, 0.21882809025182),
            (58, 0.567053392164845),
            (59, 0.918029149187493),
        ] {
            assert!((filtered[row] - expected).abs() < 1e-12, "row {row}: {}", filtered[row]);
        }
        // With fewer rows than the full reflection needs.
        let short = lowpass(&[0.0, 1.0, 0.5, -2.0, 3.0, 1.0, 0.0, 4.0, -1.0, 2.0, 2.0, 2.0], 10.0, 100.0).unwrap();
        assert!((short[0] - 0.00575194625623108).abs() < 1e-12 && (short[11] - 2.02246383493678).abs() < 1e-12);
        let two = lowpass(&[1.0, 2.0], 6.0, RATE).unwrap();
        assert!(two.iter().all(|y| (y - 4.04086943e-9).abs() < 1e-14), "{two:?}");
    }

    #[test]
    fn short_signals() {
        assert!(lowpass(&[], 6.0, RATE).unwrap().is_empty());
        assert!((lowpass(&[2.5], 6.0, RATE).unwrap()[0] - 2.5).abs() < 1e-15);
    }

    #[test]
    fn the_cutoff_is_below_half_the_sampling_rate() {
        let reason = lowpass(&[0.0; 9], 10.0, 20.0).unwrap_err();
        assert_eq!(reason.to_string(), "a sampling rate of 20 Hz is too low for a low-pass filter at 10 Hz");
    }
}
