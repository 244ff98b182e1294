//! Frequency response: gain and phase at the frequencies of a multisine.

use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::Rows;
use crate::options::Options;
use fmu_math::{atan2, exp, hypot, ln, sin_cos};
use rustfft::num_complex::Complex;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, TAU};

/// Frequencies of the multisine, Hz.
pub(crate) const FREQUENCIES: [f64; 20] =
    [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.3, 2.6, 3.0, 3.5, 4.0];
/// Indices of the frequencies for the reference gain, 0.2 Hz, and for the delay, 1 Hz.
const REFERENCE: usize = 1;
const DELAY: usize = 9;
/// Duration at the end of the recording that is transformed, s: two periods.
const SPAN: f64 = 20.0;
/// Smallest accepted spectral line of the steering angle, relative to the sum of the angle's magnitudes over all rows.
/// For the multisine, this ratio is about 0.1 at each frequency.
const MIN_SHARE: f64 = 1e-6;

/// Evaluated signals: name of the group of metrics, column.
const RESPONSES: [(&str, &str); 2] =
    [("yaw_rate", "vehicle.yaw_rate"), ("lateral_acceleration", "vehicle.lateral_acceleration")];

/// The table of metrics: the frequencies, and eight metrics for each response.
macro_rules! metrics {
    ($first:expr, [$($group:literal $title:literal $unit:literal)*]) => {
        &[
            $first,
            $(
                Definition::neutral(concat!($group, ".gain"), concat!($title, ", gain"), $unit)
                    .is("Magnitude of the response at each frequency, per road-wheel angle."),
                Definition::neutral(concat!($group, ".phase"), concat!($title, ", phase"), "rad")
                    .is("Phase of the response at each frequency, unwrapped."),
                Definition::neutral(concat!($group, ".reference_gain"), concat!($title, ", reference gain"), $unit)
                    .is("Gain at 0.2 Hz."),
                Definition::neutral(concat!($group, ".bandwidth"), concat!($title, ", bandwidth"), "Hz")
                    .is("First frequency above 0.2 Hz at which the gain falls below the reference gain divided by sqrt(2), interpolated linearly over the logarithm of the frequency."),
                Definition::neutral(concat!($group, ".phase_45_frequency"), concat!($title, ", frequency of -45 deg"), "Hz")
                    .is("First frequency above 0.2 Hz at which the phase falls below -45 deg, interpolated in the \
                         same way."),
                Definition::neutral(concat!($group, ".peak_ratio"), concat!($title, ", peak ratio"), "1")
                    .is("Largest gain divided by the reference gain."),
                Definition::neutral(concat!($group, ".peak_frequency"), concat!($title, ", peak frequency"), "Hz")
                    .is("Frequency of the largest gain."),
                Definition::neutral(concat!($group, ".delay_1hz"), concat!($title, ", delay at 1 Hz"), "s")
                    .is("Phase lag at 1 Hz, divided by the angular frequency."),
            )*
        ]
    };
}

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "frequency_response",
    title: "Frequency response",
    source: "ISO 7401 (random input), as a multisine",
    columns: &[
        Column::needed("driver.steer", "rad"),
        Column::optional("vehicle.yaw_rate", "rad/s"),
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
    ],
    options: &[],
    metrics: metrics!(
        Definition::neutral("frequency", "Frequencies", "Hz")
            .is("Frequencies of the multisine. The last 20 s of the recording are transformed. Each row contains the steering angle that was held during the preceding step; the response is corrected for this hold."),
        ["yaw_rate" "Yaw rate" "1/s" "lateral_acceleration" "Lateral acceleration" "m/(s2.rad)"]
    ),
    compute,
};

fn compute(rows: &Rows<'_>, _: &Options, results: &mut Results) -> Result<(), Reason> {
    results.set("frequency", FREQUENCIES.to_vec());
    let input = lines(rows, "driver.steer")?;
    for (group, column) in RESPONSES {
        let response = lines(rows, column).map(|output| Response::new(&input, &output, 1.0 / rows.rate));
        let mut set = |name: &str, value: Result<f64, Reason>| results.set(&format!("{group}.{name}"), value);
        let get = |of: fn(&Response) -> f64| response.as_ref().map(of).map_err(Clone::clone);
        set("reference_gain", get(|response| response.gain[REFERENCE]));
        set("bandwidth", response.as_ref().map_err(Clone::clone).and_then(Response::bandwidth));
        set("phase_45_frequency", response.as_ref().map_err(Clone::clone).and_then(Response::phase_frequency));
        set("peak_ratio", get(|response| response.gain[response.peak()] / response.gain[REFERENCE]));
        set("peak_frequency", get(|response| FREQUENCIES[response.peak()]));
        set("delay_1hz", get(|response| -response.phase[DELAY] / TAU));
        let (gain, phase) = match response {
            Ok(response) => (Ok(response.gain.to_vec()), Ok(response.phase.to_vec())),
            Err(reason) => (Err(reason.clone()), Err(reason)),
        };
        results.set(&format!("{group}.gain"), gain);
        results.set(&format!("{group}.phase"), phase);
    }
    Ok(())
}

/// Fourier sums of the last 20 s of a column at the frequencies of the multisine. The steering angle must contain all
/// frequencies.
fn lines(rows: &Rows<'_>, column: &str) -> Result<[Complex<f64>; 20], Reason> {
    let values = rows.column(column)?;
    let Some(begin) = values.len().checked_sub(rows.count(SPAN)) else {
        return Err(format!("the recording is shorter than {SPAN} s"));
    };
    let values = &values[begin..];
    let highest = FREQUENCIES[FREQUENCIES.len() - 1];
    if rows.rate < 2.0 * highest {
        return Err(format!("a sampling rate of {} Hz is too low for a frequency of {highest} Hz", rows.rate));
    }
    let lines = FREQUENCIES.map(|frequency| {
        let mut sum = Complex::new(0.0, 0.0);
        for (k, value) in values.iter().enumerate() {
            let turns = frequency * k as f64 / rows.rate;
            let (sin, cos) = sin_cos(TAU * (turns - turns.floor()));
            sum += Complex::new(value * cos, -value * sin);
        }
        sum
    });
    let total: f64 = values.iter().map(|value| value.abs()).sum();
    let has_no_share = |line: &Complex<f64>| hypot(line.re, line.im) <= MIN_SHARE * total;
    match lines.iter().position(has_no_share) {
        Some(line) if column == "driver.steer" => {
            Err(format!("`driver.steer` does not excite {} Hz", FREQUENCIES[line]))
        }
        _ => Ok(lines),
    }
}

struct Response {
    gain: [f64; 20],
    phase: [f64; 20],
}

impl Response {
    /// Computes the response from the spectral lines of input and output; `step` is the time between rows, s.
    fn new(input: &[Complex<f64>; 20], output: &[Complex<f64>; 20], step: f64) -> Self {
        let (mut gain, mut phase) = ([0.0; 20], [0.0; 20]);
        let mut before = 0.0;
        for (line, frequency) in FREQUENCIES.iter().enumerate() {
            // Correction for the hold: the input in each row was held during the preceding step.
            let angle = TAU * frequency * step;
            let (sin, cos) = sin_cos(angle);
            let hold = Complex::new(cos - 1.0, sin) / Complex::new(0.0, angle);
            let response = output[line] / (input[line] * hold);
            gain[line] = hypot(response.re, response.im);
            let argument = atan2(response.im, response.re);
            before = argument - TAU * ((argument - before) / TAU).round();
            phase[line] = before;
        }
        Self { gain, phase }
    }

    /// Index of the largest gain; the first if there are several.
    fn peak(&self) -> usize {
        (0..self.gain.len())
            .reduce(|best, line| if self.gain[line] > self.gain[best] { line } else { best })
            .unwrap_or(0)
    }

    fn bandwidth(&self) -> Result<f64, Reason> {
        falls_below(&self.gain, FRAC_1_SQRT_2 * self.gain[REFERENCE])
            .ok_or_else(|| "the gain does not fall below the reference gain over sqrt(2) up to 4 Hz".to_owned())
    }

    fn phase_frequency(&self) -> Result<f64, Reason> {
        falls_below(&self.phase, -FRAC_PI_4)
            .ok_or_else(|| "the phase does not fall below -45 deg between 0.2 and 4 Hz".to_owned())
    }
}

/// The first frequency above 0.2 Hz at which the values fall below a level, interpolated over the logarithm of the
/// frequency.
fn falls_below(values: &[f64; 20], level: f64) -> Option<f64> {
    let after = (REFERENCE + 1..values.len()).find(|line| values[line - 1] >= level && values[*line] < level)?;
    let share = (values[after - 1] - level) / (values[after - 1] - values[after]);
    let [low, high] = [after - 1, after].map(|line| ln(FREQUENCIES[line]));
    Some(exp(low + share * (high - low)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Halfway between 1 and 1.2 Hz on a logarithmic scale is sqrt(1.2) Hz.
    #[test]
    fn values_are_linear_over_the_logarithm() {
        let mut values = [1.0; 20];
        values[10..].fill(0.0);
        assert!((falls_below(&values, 0.5).unwrap() - 1.2_f64.sqrt()).abs() < 1e-15);
        assert_eq!(falls_below(&values, -0.5), None);
        assert_eq!(falls_below(&[0.0; 20], 0.5), None);
        values[..2].fill(0.0);
        assert!((falls_below(&values, 0.5).unwrap() - 1.2_f64.sqrt()).abs() < 1e-15);
    }
}
