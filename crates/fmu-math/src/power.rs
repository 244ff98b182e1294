//! Powers, and the length of a vector.

use crate::bits::{abs, canonical, fast_sum, magnitude, product, sqrt, sum};
use crate::coefficients::{LN_TAIL, LN2_HI, LN2_LO, THIRD_HI, THIRD_LO};
use crate::exponential::{OVERFLOW, UNDERFLOW, exponential, power_of_two, reduce, scaled};
use crate::lanes::polynomial8;
use crate::logarithm;

/// ln(2^k m) in two parts, with a relative error of 2^-64.
///
/// As in `logarithm`, but with ln(m) = 2s (1 + s^2/3 + s^4 (1/5 + ...)). All terms are in two parts, except the inner
/// parentheses.
#[inline(always)]
fn combine(k: f64, m: f64) -> (f64, f64) {
    let f = m - 1.0;
    let (d, d_low) = sum(m, 1.0);
    let s = f / d;
    let (back, back_low) = product(s, d);
    let s_low = (((f - back) - back_low) - s * d_low) / d;

    let (z, z_low) = product(s, s);
    let z_low = z_low + 2.0 * s * s_low;
    let (third, third_low) = product(z, THIRD_HI);
    let third_low = third_low + (z * THIRD_LO + z_low * THIRD_HI);
    let (v, v_low) = fast_sum(third, z * z * polynomial8(&LN_TAIL, z));
    let v_low = v_low + third_low;

    let (s, s_low) = (s + s, s_low + s_low);
    let (q, q_low) = product(s, v);
    let q_low = q_low + (s * v_low + s_low * v);
    let (value, value_low) = fast_sum(s, q);
    let value_low = value_low + (q_low + s_low);
    let (sum, sum_low) = fast_sum(k * LN2_HI, value);
    fast_sum(sum, sum_low + (value_low + k * LN2_LO))
}

/// The power, and a number whose highest bit is set if the result is invalid.
#[inline(always)]
fn pow_kernel(x: f64, y: f64) -> (f64, u64) {
    const EXPONENT: u64 = 1e100f64.to_bits();
    const ARGUMENT: u64 = 708f64.to_bits();
    let (k, m) = logarithm::split(x);
    let (log, log_low) = combine(k, m);
    let (t, t_low) = product(y, log);
    let t_low = t_low + y * log_low;
    let outside = logarithm::outside(x) | EXPONENT.wrapping_sub(magnitude(y)) | ARGUMENT.wrapping_sub(magnitude(t));
    let (n, high, low) = reduce(t, t_low);
    let (one, rest) = exponential(high, low);
    ((one + rest) * power_of_two(n), outside)
}

/// Special values, negative and subnormal bases, and results near overflow and underflow.
#[cold]
fn pow_full(x: f64, y: f64) -> f64 {
    let base = abs(x);
    // These powers need no logarithm.
    if base == 0.0 || base == 1.0 || y == 0.0 || !base.is_finite() || !y.is_finite() {
        return libm::pow(x, y);
    }
    let is_odd = match parity(y) {
        Parity::NotInteger if x < 0.0 => return f64::NAN,
        parity => x < 0.0 && matches!(parity, Parity::Odd),
    };
    let power = if abs(y) > 1e100 {
        // Overflow or underflow: even for the base next to 1, the magnitude of the logarithm is at least 1e-16.
        if (base > 1.0) == (y > 0.0) { f64::INFINITY } else { 0.0 }
    } else {
        let is_subnormal = base < f64::MIN_POSITIVE;
        let (k, m) = logarithm::split(if is_subnormal { base * 18_014_398_509_481_984.0 } else { base });
        let (log, log_low) = combine(if is_subnormal { k - 54.0 } else { k }, m);
        let (t, t_low) = product(y, log);
        let t_low = t_low + y * log_low;
        if t > OVERFLOW {
            f64::INFINITY
        } else if t < UNDERFLOW {
            0.0
        } else {
            let (n, high, low) = reduce(t, t_low);
            let (one, rest) = exponential(high, low);
            scaled(one + rest, n)
        }
    };
    if is_odd { -power } else { power }
}

enum Parity {
    Even,
    Odd,
    NotInteger,
}

/// The parity of a finite number. From 2^53 on, all are even integers.
fn parity(y: f64) -> Parity {
    let y = abs(y);
    if y >= 9_007_199_254_740_992.0 {
        return Parity::Even;
    }
    let whole = y as u64;
    match whole as f64 == y {
        false => Parity::NotInteger,
        true if whole.is_multiple_of(2) => Parity::Even,
        true => Parity::Odd,
    }
}

/// `x` to the power `y`, within 1.2 ulp. Special values are treated as in C: `pow(x, 0.0)` and `pow(1.0, y)` are 1; for
/// negative `x`, the result is NaN unless `y` is an integer.
#[inline(never)]
#[must_use]
pub fn pow(x: f64, y: f64) -> f64 {
    let (power, outside) = pow_kernel(x, y);
    if outside >> 63 == 0 { power } else { canonical(pow_full(x, y)) }
}

/// `x` to an integer power by repeated squaring. Each of up to 2 log2(n) multiplications rounds.
#[inline]
#[must_use]
pub fn powi(x: f64, n: i32) -> f64 {
    let mut power = 1.0;
    let mut square = x;
    let mut rest = n.unsigned_abs();
    while rest != 0 {
        if rest & 1 == 1 {
            power *= square;
        }
        rest >>= 1;
        if rest != 0 {
            square *= square;
        }
    }
    if n < 0 { 1.0 / power } else { power }
}

/// The length, and a number whose highest bit is set if the squares or their sum may overflow or lose digits.
#[inline(always)]
fn hypot_kernel(x: f64, y: f64) -> (f64, u64) {
    const LARGE: u64 = 1e150f64.to_bits();
    const SMALL: u64 = 1e-140f64.to_bits();
    let (ax, ay) = (magnitude(x), magnitude(y));
    let both_small = ax.wrapping_sub(SMALL) & ay.wrapping_sub(SMALL);
    let both_zero = (ax | ay).wrapping_sub(1);
    let outside = LARGE.wrapping_sub(ax) | LARGE.wrapping_sub(ay) | (both_small & !both_zero);
    (sqrt(x * x + y * y), outside)
}

#[cold]
fn hypot_full(x: f64, y: f64) -> f64 {
    let (x, y) = (abs(x), abs(y));
    if x == f64::INFINITY || y == f64::INFINITY {
        f64::INFINITY
    } else if x.is_nan() || y.is_nan() {
        f64::NAN
    } else {
        // Scaling by a power of two is exact, or the scaled number is negligible.
        let exponent: i64 = if x > 1.0 || y > 1.0 { -600 } else { 600 };
        let scale = power_of_two(exponent as u64);
        hypot_kernel(x * scale, y * scale).0 / scale
    }
}

/// Length of the vector (`x`, `y`), within 1.3 ulp; infinite if `x` or `y` is.
#[inline(never)]
#[must_use]
pub fn hypot(x: f64, y: f64) -> f64 {
    let (length, outside) = hypot_kernel(x, y);
    if outside >> 63 == 0 { length } else { canonical(hypot_full(x, y)) }
}
