//! Computes the measured value of a signal. The symbols are those of the README.

use chassis_vehicle::random::{Normals, SENSOR_STREAM};

use crate::{Sensor, X};

/// Greatest delay in samples.
pub(crate) const MOST_SAMPLES: usize = 1000;

/// Numbers of at least this magnitude have no fraction.
const WHOLE: f64 = (1_u64 << 52) as f64;

impl Default for X {
    fn default() -> Self {
        Self { k: 0, past: Box::new([0.0; MOST_SAMPLES]) }
    }
}

/// n: the delay as a whole number of samples.
pub(crate) fn delay_in_samples(p: &Sensor) -> Result<usize, String> {
    let n = (p.tau / p.sample_time).round();
    if n > MOST_SAMPLES as f64 {
        return Err(format!(
            "'sensor.delay' = {} s is {n} samples of 'sample_time' = {} s; it must be at most {MOST_SAMPLES} samples: use \
             a shorter delay or a longer sample time",
            p.tau, p.sample_time
        ));
    }
    Ok(n as usize)
}

/// One sample of the signal: delay, bias, noise, resolution.
pub(crate) fn sample(p: &Sensor, n: usize, x: &mut X, u: f64) -> f64 {
    let delayed = delay(n, x, u);
    let mut y = delayed + p.b;
    if p.sigma > 0.0 {
        y += p.sigma * Normals::new(u64::from(p.seed.unsigned_abs()), SENSOR_STREAM, x.k).draw();
    }
    x.k = x.k.wrapping_add(1);
    quantize(y, p.q)
}

/// The signal `n` samples ago; before the first sample, its first value.
fn delay(n: usize, x: &mut X, u: f64) -> f64 {
    if x.k == 0 {
        x.past.fill(u);
    }
    let place = (x.k % MOST_SAMPLES as u64) as usize;
    let delayed = if n == 0 { u } else { x.past[(place + MOST_SAMPLES - n) % MOST_SAMPLES] };
    x.past[place] = u;
    delayed
}

/// The nearest multiple of `q`; halves are rounded away from zero. Returns the value itself if `q` is 0.
pub(crate) fn quantize(value: f64, q: f64) -> f64 {
    if q == 0.0 {
        return value;
    }
    let n = value / q;
    // Rounding to a resolution below the last digit of the value would change nothing, and n may be infinite.
    if n.abs() < WHOLE { q * n.round() } else { value }
}
