//! Compares results with values computed by mpmath with 1400 bits (`values.py`), in units in the last place of
//! the exact result.
//!
//! The bounds are those in the documentation. A few hundred rows cannot prove a bound, but they reveal a wrong
//! coefficient, constant or case, which causes much larger errors.

use fmu_math as math;

static VALUES: &[u8] = include_bytes!("values.bin");

type Function = fn(&[f64]) -> f64;

const BOUNDS: [(&str, f64, Function); 15] = [
    ("sin", 0.9, |x| math::sin(x[0])),
    ("cos", 0.9, |x| math::cos(x[0])),
    ("tan", 1.2, |x| math::tan(x[0])),
    ("asin", 0.8, |x| math::asin(x[0])),
    ("acos", 0.8, |x| math::acos(x[0])),
    ("atan", 1.2, |x| math::atan(x[0])),
    ("exp", 1.0, |x| math::exp(x[0])),
    ("ln", 0.9, |x| math::ln(x[0])),
    ("sinh", 1.2, |x| math::sinh(x[0])),
    ("cosh", 0.9, |x| math::cosh(x[0])),
    ("tanh", 0.9, |x| math::tanh(x[0])),
    ("atan2", 1.5, |x| math::atan2(x[0], x[1])),
    ("pow", 1.2, |x| math::pow(x[0], x[1])),
    ("hypot", 1.3, |x| math::hypot(x[0], x[1])),
    ("pow far", 1.2, |x| math::pow(x[0], x[1])),
];

/// Error in ulp. The exact result is `high + low`, where `high` is the exact result rounded to a double.
fn error(value: f64, high: f64, low: f64) -> f64 {
    let exact_below = if low != 0.0 && low.is_sign_negative() != high.is_sign_negative() { 1 } else { 0 };
    // At a power of two, the exact result can be in the binade below.
    let binade = (high.abs().to_bits() - exact_below) >> 52;
    let ulp = f64::from_bits(binade.max(53) << 52) / 4_503_599_627_370_496.0;
    ((value - high) / ulp - low / ulp).abs()
}

#[test]
fn results_are_within_the_documented_bounds() {
    let mut rest = VALUES;
    let mut take = |count: usize| {
        let (bytes, tail) = rest.split_at(count);
        rest = tail;
        bytes
    };
    let size = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap()) as usize;
    for (name, bound, function) in BOUNDS {
        assert_eq!(str::from_utf8(take(8)).unwrap().trim_end_matches('\0'), name);
        let (rows, arguments) = (size(take(4)), size(take(4)));
        for _ in 0..rows {
            let row: Vec<f64> =
                take(8 * (arguments + 2)).chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
            let (x, exact) = row.split_at(arguments);
            let value = function(x);
            let error = error(value, exact[0], exact[1]);
            assert!(error <= bound, "{name}({x:?}) is {value:e}, {error:.3} ulp from {:e}", exact[0]);
        }
    }
    assert!(rest.is_empty());
}
