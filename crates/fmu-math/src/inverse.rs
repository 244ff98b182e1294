//! Arctangent, arcsine and arccosine.

use crate::bits::{SIGN, abs, choose, fast_sum, flip, keep, magnitude, mask, max, min, sign, spread, sqrt, upper};
use crate::coefficients::{ASIN, ATAN, PIO4_HI, PIO4_LO};
use crate::lanes::{function_near, function2_near, polynomial13};

/// Largest magnitude of the arguments for the kernel of `atan2`, which adds them without overflow.
const LARGE: u64 = 1e300f64.to_bits();
const ONE: u64 = 1f64.to_bits();
/// This minus the bits of `x` approximates the bits of `1/x`, with a relative error of up to 7 %.
const RECIPROCAL: u64 = 0x7fde_6238_0000_0000;

/// The angle of a point. `small` and `great` are the smaller and the larger magnitude of its coordinates. The masks are
/// set if `great` belongs to y (`steep`), if `small` is more than half of `great` (`diagonal`), and if the point is in
/// the left half plane (`back`).
///
/// The argument of the polynomial is between -1/3 and 1/2. It is `small`/`great`, which is the tangent of an angle. If
/// `diagonal` is set, it is instead the tangent of the difference between this angle and pi/4. The result is the sum of
/// the polynomial and a multiple of pi/4 in two parts.
#[inline(always)]
fn angle(small: f64, great: f64, steep: u64, diagonal: u64, back: u64) -> f64 {
    let numerator = small - keep(diagonal, great);
    let (denominator, error) = fast_sum(great, keep(diagonal, small));
    let t = numerator / denominator;
    // Corrects the rounding error of the denominator, for which a rough reciprocal is enough.
    let correction = t * (error * f64::from_bits(RECIPROCAL.wrapping_sub(denominator.to_bits())));
    let turn = (steep ^ back) & SIGN;
    let eighths = flip(keep(diagonal, 1.0), turn) + (keep(steep, 2.0) + keep(back & !steep, 4.0));
    let t = flip(t, turn);
    let (angle, error) = fast_sum(eighths * PIO4_HI, t);
    let error = error + (eighths * PIO4_LO - flip(correction, turn));
    // The terms above do not depend on z, so the processor computes them in parallel with the polynomial.
    let z = t * t;
    angle + (error + (t * z) * polynomial13(&ATAN, z))
}

#[inline(always)]
fn atan2_kernel(y: f64, x: f64) -> (f64, u64) {
    let (ay, ax) = (abs(y), abs(x));
    let (small, great) = (min(ay, ax), max(ay, ax));
    // If both coordinates are 0, the denominator is 1, so the quotient is 0.
    let great = f64::from_bits(great.to_bits() | keep(mask(great == 0.0), 1.0).to_bits());
    let angle = angle(small, great, mask(ax < ay), mask(great < small + small), spread(x.to_bits()));
    (flip(abs(angle), sign(y)), LARGE.wrapping_sub(ay.to_bits()) | LARGE.wrapping_sub(ax.to_bits()))
}

/// [`angle`] for a quotient of at most 1/2 in the right half plane, where only the polynomial remains.
#[inline(always)]
fn near_angle(t: f64) -> f64 {
    let z = t * t;
    t + (t * z) * polynomial13(&ATAN, z)
}

/// The highest bit is set unless `0 < x`, `2 |y| <= x` and `x <= LARGE`.
#[inline(always)]
fn atan2_far(y: f64, x: f64) -> u64 {
    let (x, twice) = (x.to_bits(), (2.0 * abs(y)).to_bits());
    x | x.wrapping_sub(1) | x.wrapping_sub(twice) | LARGE.wrapping_sub(x)
}

#[inline(always)]
fn atan2_near(y: f64, x: f64) -> f64 {
    flip(near_angle(abs(y) / x), sign(y))
}

const HALF: u64 = 0.5f64.to_bits();

#[inline(always)]
fn atan_far(x: f64) -> u64 {
    HALF.wrapping_sub(magnitude(x))
}

#[inline(always)]
fn atan_near(x: f64) -> f64 {
    flip(near_angle(abs(x)), sign(x))
}

#[inline(always)]
fn atan_outside(x: f64) -> u64 {
    LARGE.wrapping_sub(magnitude(x))
}

/// [`atan2_kernel`] with 1 for `x`.
#[inline(always)]
fn atan_kernel(x: f64) -> f64 {
    let ax = abs(x);
    let diagonal = mask(0.5 < ax) & mask(ax < 2.0);
    flip(angle(min(ax, 1.0), max(ax, 1.0), mask(1.0 < ax), diagonal, 0), sign(x))
}

#[inline(always)]
fn unit_outside(x: f64) -> u64 {
    ONE.wrapping_sub(magnitude(x))
}

/// For `|x| >= 1/2`, asin(|x|) = pi/2 - 2 asin(sqrt((1 - |x|)/2)). Returns the mask for this case, the argument of the
/// polynomial in two parts, and the polynomial's contribution.
#[inline(always)]
fn half_angle(x: f64) -> (u64, f64, f64, f64) {
    let ax = abs(x);
    let wide = mask(0.5 <= ax);
    let z = choose(wide, (1.0 - ax) * 0.5, ax * ax);
    let s = choose(wide, sqrt(z), ax);
    let tail = s * (z * polynomial13(&ASIN, z));
    // The square of the upper half is exact. 1e-300 prevents a division by zero for x = 1.
    let high = choose(wide, upper(s), s);
    let low = keep(wide, (z - high * high) / (s + high + 1e-300));
    (wide, high, low, tail)
}

#[inline(always)]
fn asin_kernel(x: f64) -> f64 {
    let (wide, high, low, tail) = half_angle(x);
    let (angle, error) = fast_sum(2.0 * PIO4_HI, -2.0 * high);
    let wide_angle = angle + (error + (2.0 * PIO4_LO - 2.0 * (low + tail)));
    flip(choose(wide, wide_angle, high + tail), sign(x))
}

#[inline(always)]
fn acos_kernel(x: f64) -> f64 {
    let (wide, high, low, tail) = half_angle(x);
    let negative = spread(x.to_bits());
    let eighths = choose(wide, keep(negative, 4.0), 2.0);
    let scale = choose(wide, 2.0, 1.0);
    // Subtracts the angle from the multiple of pi/4; for 1/2 <= x, adds it.
    let side = sign(x) ^ (wide & SIGN);
    let (angle, error) = fast_sum(eighths * PIO4_HI, -flip(high * scale, side));
    angle + (error + (eighths * PIO4_LO - flip((low + tail) * scale, side)))
}

function_near!(
    /// Arctangent, in [-pi/2, pi/2], within 1.2 ulp.
    atan, atan_each, atan_far, atan_near, atan_outside, atan_kernel, libm::atan
);
function2_near!(
    /// Angle of the point (`x`, `y`), in [-pi, pi], within 1.5 ulp. Zeros and infinities are treated as in C:
    /// `atan2(0.0, 0.0)` is 0.
    atan2, atan2_each, y, x, atan2_far, atan2_near, atan2_kernel, libm::atan2
);
/// Arcsine, in [-pi/2, pi/2], within 0.8 ulp; NaN outside [-1, 1].
#[inline(never)]
#[must_use]
pub fn asin(x: f64) -> f64 {
    if unit_outside(x) >> 63 == 0 { asin_kernel(x) } else { f64::NAN }
}

/// Arccosine, in [0, pi], within 0.8 ulp; NaN outside [-1, 1].
#[inline(never)]
#[must_use]
pub fn acos(x: f64) -> f64 {
    if unit_outside(x) >> 63 == 0 { acos_kernel(x) } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the fast path with the general kernel: near zero, at the end of the range, and in between.
    #[test]
    fn the_fast_path_has_the_bits_of_the_general_kernel() {
        let tiny = [0.0, -0.0, f64::from_bits(1), f64::MIN_POSITIVE, 1e-300, 1e-20, 1e-8];
        let spaced = (0..200_000).map(|i| f64::from(i) * (0.5 / 200_000.0));
        for y in tiny.into_iter().chain(spaced).chain([0.5]).flat_map(|y| [y, -y]) {
            assert_eq!(atan_far(y) >> 63, 0, "{y:e}");
            assert_eq!(atan_near(y).to_bits(), atan_kernel(y).to_bits(), "{y:e}");
            for x in [1.0, 3.7, 29.0, 1e-3, 1e150, f64::from_bits(LARGE)] {
                for y in [y * x, (y * x).next_down().max(-x / 2.0)] {
                    assert_eq!(atan2_far(y, x) >> 63, 0, "({y:e}, {x:e})");
                    assert_eq!(atan2_near(y, x).to_bits(), atan2_kernel(y, x).0.to_bits(), "({y:e}, {x:e})");
                }
            }
        }
        assert_eq!(atan_far(0.5f64.next_up()) >> 63, 1);
        assert_eq!(atan_far(f64::NAN) >> 63, 1);
        let nan = f64::NAN;
        let elsewhere = [
            (0.0, 0.0),
            (0.0, -0.0),
            (-0.0, 0.0),
            (0.5f64.next_up(), 1.0),
            (0.0, -1.0),
            (nan, 1.0),
            (0.0, nan),
            (0.0, -nan),
            (f64::INFINITY, 1.0),
            (1.0, f64::INFINITY),
            (f64::MAX, f64::MAX),
        ];
        for (y, x) in elsewhere {
            assert_eq!(atan2_far(y, x) >> 63, 1, "({y:e}, {x:e})");
        }
    }
}
