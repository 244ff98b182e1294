//! Sine, cosine and tangent.
//!
//! A multiple n of pi/2 is subtracted in three parts (Cody and Waite); the products of n and the first two parts are
//! exact. The remainder r, |r| <= pi/4, is known to twice the precision and is the argument of two polynomials.

use crate::bits::{ROUNDER, SIGN, abs, canonical, choose, fast_sum, flip, magnitude, product, sign, spread};
use crate::coefficients::{COS, PIO2_1, PIO2_2, PIO2_3, SIN, TWO_OVER_PI};
use crate::lanes::{function_near, polynomial6};

/// Up to this argument, n has 14 bits.
const LIMIT: u64 = 25_000f64.to_bits();

/// Up to this argument (below pi/4), n is 0 and r is the argument itself.
const NEAR: u64 = 0.785f64.to_bits();

#[inline(always)]
fn far(x: f64) -> u64 {
    NEAR.wrapping_sub(magnitude(x))
}

#[inline(always)]
fn outside(x: f64) -> u64 {
    LIMIT.wrapping_sub(magnitude(x))
}

/// The number of quarter turns in the lowest two bits, and the remainder in two parts.
#[inline(always)]
fn reduce(x: f64) -> (u64, f64, f64) {
    let shifted = x * TWO_OVER_PI + ROUNDER;
    let n = shifted - ROUNDER;
    // Exact: both numbers are multiples of the last bit of x or of PIO2_1, and their leading bits cancel.
    let first = x - n * PIO2_1;
    // If `first` has the smaller magnitude, the difference is exact, so its error is 0.
    let (rest, error) = fast_sum(first, -(n * PIO2_2));
    let (high, low) = fast_sum(rest, -(n * PIO2_3));
    (shifted.to_bits(), high, low + error)
}

/// Sine and cosine of the remainder, each as value and correction.
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

/// [`sin_cos_kernel`] near 0.
#[inline(always)]
fn sin_cos_near(x: f64) -> (f64, f64) {
    let (s, c) = polynomials(abs(x), 0.0);
    (flip(s.0 + s.1, sign(x)), c.0 + c.1)
}

/// The quotient of two numbers, each in two parts.
#[inline(always)]
fn quotient((n, n_low): (f64, f64), (d, d_low): (f64, f64)) -> f64 {
    // The rounding error of the reciprocal is negligible in the correction. The two divisions do not depend on each
    // other, so the processor can overlap them.
    let (quotient, reciprocal) = (n / d, 1.0 / d);
    let (back, back_low) = product(quotient, d);
    quotient + (((n - back) - back_low) + (n_low - quotient * d_low)) * reciprocal
}

#[inline(always)]
fn tan_kernel(x: f64) -> f64 {
    let (turns, high, low) = reduce(f64::from_bits(magnitude(x)));
    let (s, c) = polynomials(high, low);
    let (s, c) = (fast_sum(s.0, s.1), fast_sum(c.0, c.1));
    let odd = spread(turns << 63);
    let n = (choose(odd, c.0, s.0), choose(odd, c.1, s.1));
    let d = (choose(odd, s.0, c.0), choose(odd, s.1, c.1));
    flip(quotient(n, d), (odd & SIGN) ^ sign(x))
}

/// [`tan_kernel`] near 0.
#[inline(always)]
fn tan_near(x: f64) -> f64 {
    let (s, c) = polynomials(abs(x), 0.0);
    flip(quotient(fast_sum(s.0, s.1), fast_sum(c.0, c.1)), sign(x))
}

function_near!(
    /// Sine of an angle in radians, within 0.9 ulp.
    sin, sin_each, far, |x| sin_cos_near(x).0, outside, |x| sin_cos_kernel(x).0, libm::sin
);
function_near!(
    /// Cosine of an angle in radians, within 0.9 ulp.
    cos, cos_each, far, |x| sin_cos_near(x).1, outside, |x| sin_cos_kernel(x).1, libm::cos
);
function_near!(
    /// Tangent of an angle in radians, within 1.2 ulp.
    tan, tan_each, far, tan_near, outside, tan_kernel, libm::tan
);

/// [`sin`] and [`cos`], bit-identical.
#[inline(never)]
#[must_use]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if far(x) >> 63 == 0 {
        sin_cos_near(x)
    } else if outside(x) >> 63 == 0 {
        sin_cos_kernel(x)
    } else {
        (canonical(libm::sin(x)), canonical(libm::cos(x)))
    }
}

/// [`sin_cos`] of each element, bit-identical: the sines, then the cosines.
#[inline(always)]
#[must_use]
pub fn sin_cos_each<const N: usize>(x: [f64; N]) -> ([f64; N], [f64; N]) {
    #[inline(never)]
    fn general(x: &[f64], sines: &mut [f64], cosines: &mut [f64]) {
        let mut any = 0;
        for &x in x {
            any |= outside(x);
        }
        let all = x.iter().zip(sines.iter_mut().zip(cosines));
        if any >> 63 == 0 {
            all.for_each(|(x, (sine, cosine))| (*sine, *cosine) = sin_cos_kernel(*x));
        } else {
            all.for_each(|(x, (sine, cosine))| (*sine, *cosine) = sin_cos(*x));
        }
    }
    let mut any = 0;
    for &x in &x {
        any |= far(x);
    }
    let (mut sines, mut cosines) = ([0.0; N], [0.0; N]);
    if any >> 63 == 0 {
        for (x, (sine, cosine)) in x.iter().zip(sines.iter_mut().zip(&mut cosines)) {
            (*sine, *cosine) = sin_cos_near(*x);
        }
    } else {
        // Copies, because the compiler would keep borrowed arrays in memory instead of registers.
        let copy: [f64; N] = core::array::from_fn(|i| x[i]);
        let (mut s, mut c) = ([0.0; N], [0.0; N]);
        general(&copy, &mut s, &mut c);
        (sines, cosines) = (core::array::from_fn(|i| s[i]), core::array::from_fn(|i| c[i]));
    }
    (sines, cosines)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the fast path with the general kernel: near zero, at the end of the range, and in between.
    #[test]
    fn the_fast_path_has_the_bits_of_the_general_kernel() {
        let end = f64::from_bits(NEAR);
        let tiny = [0.0, -0.0, f64::from_bits(1), f64::MIN_POSITIVE, 1e-300, 1e-20, 1e-8];
        let spaced = (0..200_000).map(|i| f64::from(i) * (end / 200_000.0));
        for x in tiny.into_iter().chain(spaced).chain([end]).flat_map(|x| [x, -x]) {
            assert_eq!(far(x) >> 63, 0, "{x:e}");
            let ((sine, cosine), (s, c)) = (sin_cos_near(x), sin_cos_kernel(x));
            assert_eq!((sine.to_bits(), cosine.to_bits()), (s.to_bits(), c.to_bits()), "{x:e}");
            assert_eq!(tan_near(x).to_bits(), tan_kernel(x).to_bits(), "{x:e}");
        }
        assert_eq!(far(end.next_up()) >> 63, 1);
        assert_eq!(far(f64::NAN) >> 63, 1);
        let shifted = end * TWO_OVER_PI + ROUNDER;
        assert_eq!(shifted - ROUNDER, 0.0, "no quarter turn is subtracted");
    }
}
