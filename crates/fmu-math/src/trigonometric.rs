//! Sine, cosine and tangent.
//!
//! A multiple n of pi/2 is taken off in three parts (Cody and Waite), of which the first two times n are exact. The rest r
//! is known to twice the precision, |r| <= pi/4, and goes into two polynomials.

use crate::bits::{ROUNDER, SIGN, canonical, choose, fast_sum, flip, magnitude, product, sign, spread};
use crate::coefficients::{COS, PIO2_1, PIO2_2, PIO2_3, SIN, TWO_OVER_PI};
use crate::lanes::{function, polynomial6};

/// Up to here n has 14 bits.
const LIMIT: u64 = 25_000f64.to_bits();

#[inline(always)]
fn outside(x: f64) -> u64 {
    LIMIT.wrapping_sub(magnitude(x))
}

/// The number of quarter turns in the lowest two bits, and the rest in two parts.
#[inline(always)]
fn reduce(x: f64) -> (u64, f64, f64) {
    let shifted = x * TWO_OVER_PI + ROUNDER;
    let n = shifted - ROUNDER;
    // Exact: both are multiples of the last bit of x or of the part, and cancel.
    let first = x - n * PIO2_1;
    // If `first` is the smaller one, the difference is exact.
    let (rest, error) = fast_sum(first, -(n * PIO2_2));
    let (high, low) = fast_sum(rest, -(n * PIO2_3));
    (shifted.to_bits(), high, low + error)
}

/// Sine and cosine of the rest: value and correction.
#[inline(always)]
fn polynomials(high: f64, low: f64) -> ((f64, f64), (f64, f64)) {
    let z = high * high;
    let half = z * 0.5;
    let near = 1.0 - half;
    let sine = (high * z) * polynomial6(&SIN, z) + low * near;
    let cosine = ((1.0 - near) - half) + ((z * z) * polynomial6(&COS, z) - high * low);
    ((high, sine), (near, cosine))
}

#[inline(always)]
fn sin_cos_kernel(x: f64) -> (f64, f64) {
    let (turns, high, low) = reduce(f64::from_bits(magnitude(x)));
    let (s, c) = polynomials(high, low);
    let (s, c) = (s.0 + s.1, c.0 + c.1);
    let odd = spread(turns << 63);
    let sine = choose(odd, c, s);
    let cosine = choose(odd, s, c);
    (flip(sine, ((turns << 62) & SIGN) ^ sign(x)), flip(cosine, (turns.wrapping_add(1) << 62) & SIGN))
}

#[inline(always)]
fn tan_kernel(x: f64) -> f64 {
    let (turns, high, low) = reduce(f64::from_bits(magnitude(x)));
    let (s, c) = polynomials(high, low);
    let (s, c) = (fast_sum(s.0, s.1), fast_sum(c.0, c.1));
    let odd = spread(turns << 63);
    let (n, n_low) = (choose(odd, c.0, s.0), choose(odd, c.1, s.1));
    let (d, d_low) = (choose(odd, s.0, c.0), choose(odd, s.1, c.1));
    let quotient = n / d;
    let (back, back_low) = product(quotient, d);
    let corrected = quotient + (((n - back) - back_low) + (n_low - quotient * d_low)) / d;
    flip(corrected, (odd & SIGN) ^ sign(x))
}

function!(
    /// Sine of an angle in radians, within 0.9 ulp.
    sin, sin_each, outside, |x| sin_cos_kernel(x).0, libm::sin
);
function!(
    /// Cosine of an angle in radians, within 0.9 ulp.
    cos, cos_each, outside, |x| sin_cos_kernel(x).1, libm::cos
);
function!(
    /// Tangent of an angle in radians, within 1.2 ulp.
    tan, tan_each, outside, tan_kernel, libm::tan
);

/// [`sin`] and [`cos`], with the same bits.
#[inline(never)]
#[must_use]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if outside(x) >> 63 == 0 { sin_cos_kernel(x) } else { (canonical(libm::sin(x)), canonical(libm::cos(x))) }
}

/// [`sin_cos`] of each element, with the same bits: the sines, then the cosines.
#[inline(always)]
#[must_use]
pub fn sin_cos_each<const N: usize>(x: [f64; N]) -> ([f64; N], [f64; N]) {
    #[cold]
    #[inline(never)]
    fn singles(x: &[f64], sines: &mut [f64], cosines: &mut [f64]) {
        for (x, (sine, cosine)) in x.iter().zip(sines.iter_mut().zip(cosines)) {
            (*sine, *cosine) = sin_cos(*x);
        }
    }
    let mut any = 0;
    for &x in &x {
        any |= outside(x);
    }
    let (mut sines, mut cosines) = ([0.0; N], [0.0; N]);
    if any >> 63 == 0 {
        for (x, (sine, cosine)) in x.iter().zip(sines.iter_mut().zip(&mut cosines)) {
            (*sine, *cosine) = sin_cos_kernel(*x);
        }
    } else {
        singles(&x, &mut sines, &mut cosines);
    }
    (sines, cosines)
}
