//! Special values, symmetry, monotonicity, and bit-identical results on all paths.

use fmu_math as math;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4, PI, SQRT_2};

const INF: f64 = f64::INFINITY;
const NAN: f64 = f64::NAN;

type Single = fn(f64) -> f64;
type One = (&'static str, Single, Option<fn([f64; 6]) -> [f64; 6]>);
type Two = (&'static str, fn(f64, f64) -> f64, Option<fn([f64; 6], [f64; 6]) -> [f64; 6]>);

// Functions with their array versions, if there are any.
const ONE: [One; 13] = [
    ("sin", math::sin, Some(math::sin_each)),
    ("cos", math::cos, Some(math::cos_each)),
    ("tan", math::tan, Some(math::tan_each)),
    ("asin", math::asin, None),
    ("acos", math::acos, None),
    ("atan", math::atan, Some(math::atan_each)),
    ("exp", math::exp, Some(math::exp_each)),
    ("ln", math::ln, None),
    ("sinh", math::sinh, None),
    ("cosh", math::cosh, None),
    ("tanh", math::tanh, Some(math::tanh_each)),
    ("sin of sin_cos", |x| math::sin_cos(x).0, Some(|x| math::sin_cos_each(x).0)),
    ("cos of sin_cos", |x| math::sin_cos(x).1, Some(|x| math::sin_cos_each(x).1)),
];
const TWO: [Two; 3] =
    [("atan2", math::atan2, Some(math::atan2_each)), ("pow", math::pow, None), ("hypot", math::hypot, None)];

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In [-1, 1).
    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / 4_503_599_627_370_496.0 - 1.0
    }
    /// Returns a number in the domains of the functions. On average, one of `rare` calls returns an arbitrary bit
    /// pattern instead.
    fn number(&mut self, rare: u64) -> f64 {
        let unit = self.unit();
        match self.bits() % 4 {
            _ if self.bits().is_multiple_of(rare) => f64::from_bits(self.bits()),
            0 => unit,
            1 => unit * 8.0,
            2 => unit * 700.0,
            _ => f64::from_bits((unit.to_bits() & !(0x7ff << 52)) | ((1003 + self.bits() % 30) << 52)),
        }
    }
}

#[track_caller]
fn same(name: &str, x: &[f64], a: f64, b: f64) {
    assert!(a.to_bits() == b.to_bits(), "{name}({x:?}): {a:e} and {b:e}");
}

#[test]
fn array_forms_have_the_bits_of_the_single_forms_with_and_without_lanes_outside() {
    for rare in [1 << 40, 20, 2] {
        let mut random = Random(rare);
        for _ in 0..20_000 {
            let x: [f64; 6] = std::array::from_fn(|_| random.number(rare));
            let y: [f64; 6] = std::array::from_fn(|_| random.number(rare));
            for (name, single, each) in
                ONE.iter().filter_map(|(name, single, each)| Some((name, single, each.as_ref()?)))
            {
                for (x, value) in x.iter().zip(each(x)) {
                    same(name, &[*x], value, single(*x));
                }
                let positive = x.map(f64::abs);
                for (x, value) in positive.iter().zip(each(positive)) {
                    same(name, &[*x], value, single(*x));
                }
            }
            for (name, single, each) in
                TWO.iter().filter_map(|(name, single, each)| Some((name, single, each.as_ref()?)))
            {
                for (first, second) in [(x, y), (x.map(f64::abs), y.map(|y| y / 200.0))] {
                    for i in 0..6 {
                        same(name, &[first[i], second[i]], each(first, second)[i], single(first[i], second[i]));
                    }
                }
            }
        }
    }
}

#[test]
fn other_numbers_of_lanes_have_the_same_bits() {
    fn check<const N: usize>(random: &mut Random) {
        for _ in 0..1000 {
            let x: [f64; N] = std::array::from_fn(|_| random.number(1 << 40));
            assert_eq!(math::sin_cos_each(x), (x.map(math::sin), x.map(math::cos)));
            assert_eq!(math::tanh_each(x), x.map(math::tanh));
            let y: [f64; N] = std::array::from_fn(|_| random.number(1 << 40));
            assert_eq!(math::atan2_each(y, x), std::array::from_fn(|i| math::atan2(y[i], x[i])));
        }
    }
    let mut random = Random(3);
    check::<0>(&mut random);
    check::<1>(&mut random);
    check::<2>(&mut random);
    check::<3>(&mut random);
    check::<4>(&mut random);
    check::<5>(&mut random);
    check::<8>(&mut random);
    check::<11>(&mut random);
}

#[test]
fn odd_and_even_functions_are_symmetric() {
    let mut random = Random(4);
    for _ in 0..100_000 {
        let x = random.number(100);
        if x.is_nan() {
            continue;
        }
        for (name, f) in [
            ("sin", math::sin as Single),
            ("tan", math::tan),
            ("atan", math::atan),
            ("sinh", math::sinh),
            ("tanh", math::tanh),
            ("asin", math::asin),
        ] {
            let (plus, minus) = (f(x), f(-x));
            assert!(plus.to_bits() == (-minus).to_bits() || plus.is_nan() && minus.is_nan(), "{name}({x:e})");
        }
        for (name, f) in [("cos", math::cos as Single), ("cosh", math::cosh)] {
            same(name, &[x], f(x), f(-x));
        }
        let y = random.number(100);
        if !y.is_nan() {
            same("atan2", &[y, x], math::atan2(-y, x), -math::atan2(y, x));
            same("hypot", &[x, y], math::hypot(x, y), math::hypot(-y, x));
        }
    }
}

#[test]
fn special_values_are_those_of_c() {
    let one = |name: &str, f: fn(f64) -> f64, cases: &[(f64, f64)]| {
        for &(x, expected) in cases {
            same(name, &[x], f(x), expected);
        }
        // A NaN result has the same bits for any input.
        same(name, &[NAN], f(f64::from_bits(0xfff8_0000_0000_1234)), NAN);
    };
    let tiny = 5e-324;
    one("sin", math::sin, &[(0.0, 0.0), (-0.0, -0.0), (tiny, tiny), (-tiny, -tiny), (INF, NAN), (-INF, NAN)]);
    one("cos", math::cos, &[(0.0, 1.0), (-0.0, 1.0), (tiny, 1.0), (INF, NAN), (-INF, NAN)]);
    one("tan", math::tan, &[(0.0, 0.0), (-0.0, -0.0), (tiny, tiny), (-tiny, -tiny), (INF, NAN), (-INF, NAN)]);
    one(
        "asin",
        math::asin,
        &[(0.0, 0.0), (-0.0, -0.0), (tiny, tiny), (1.0, FRAC_PI_2), (-1.0, -FRAC_PI_2), (1.1, NAN), (-INF, NAN)],
    );
    one("acos", math::acos, &[(1.0, 0.0), (-1.0, PI), (0.0, FRAC_PI_2), (-0.0, FRAC_PI_2), (-1.1, NAN), (INF, NAN)]);
    one(
        "atan",
        math::atan,
        &[
            (0.0, 0.0),
            (-0.0, -0.0),
            (tiny, tiny),
            (1.0, FRAC_PI_4),
            (-1.0, -FRAC_PI_4),
            (INF, FRAC_PI_2),
            (-INF, -FRAC_PI_2),
            (1e308, FRAC_PI_2),
        ],
    );
    one(
        "exp",
        math::exp,
        &[
            (0.0, 1.0),
            (-0.0, 1.0),
            (tiny, 1.0),
            (INF, INF),
            (-INF, 0.0),
            (709.79, INF),
            (-745.2, 0.0),
            (-745.1, tiny),
            (1e300, INF),
            (-1e300, 0.0),
        ],
    );
    one("ln", math::ln, &[(1.0, 0.0), (0.0, -INF), (-0.0, -INF), (-1.0, NAN), (-INF, NAN), (INF, INF), (-tiny, NAN)]);
    one(
        "sinh",
        math::sinh,
        &[(0.0, 0.0), (-0.0, -0.0), (tiny, tiny), (INF, INF), (-INF, -INF), (711.0, INF), (-711.0, -INF)],
    );
    one("cosh", math::cosh, &[(0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, INF), (711.0, INF)]);
    one(
        "tanh",
        math::tanh,
        &[(0.0, 0.0), (-0.0, -0.0), (tiny, tiny), (-tiny, -tiny), (INF, 1.0), (-INF, -1.0), (30.0, 1.0), (1e300, 1.0)],
    );

    let two = |name: &str, f: fn(f64, f64) -> f64, cases: &[(f64, f64, f64)]| {
        for &(x, y, expected) in cases {
            same(name, &[x, y], f(x, y), expected);
        }
    };
    let three_quarters = 3.0 * FRAC_PI_4;
    two(
        "atan2",
        math::atan2,
        &[
            (0.0, 0.0, 0.0),
            (-0.0, 0.0, -0.0),
            (0.0, -0.0, PI),
            (-0.0, -0.0, -PI),
            (0.0, 1.0, 0.0),
            (-0.0, 1.0, -0.0),
            (0.0, -1.0, PI),
            (-0.0, -1.0, -PI),
            (1.0, 0.0, FRAC_PI_2),
            (-1.0, 0.0, -FRAC_PI_2),
            (1.0, -0.0, FRAC_PI_2),
            (-1.0, -0.0, -FRAC_PI_2),
            (1.0, 1.0, FRAC_PI_4),
            (1.0, -1.0, three_quarters),
            (-1.0, -1.0, -three_quarters),
            (-1.0, 1.0, -FRAC_PI_4),
            (INF, INF, FRAC_PI_4),
            (INF, -INF, three_quarters),
            (-INF, 1.0, -FRAC_PI_2),
            (1.0, INF, 0.0),
            (-1.0, INF, -0.0),
            (1.0, -INF, PI),
            (-1.0, -INF, -PI),
            (tiny, 1.0, tiny),
            (tiny, 2.0, 0.0),
            (tiny, tiny, FRAC_PI_4),
            (NAN, 1.0, NAN),
            (1.0, NAN, NAN),
            (NAN, NAN, NAN),
            (1e308, 1e308, FRAC_PI_4),
        ],
    );
    two(
        "pow",
        math::pow,
        &[
            (2.0, 10.0, 1024.0),
            (2.0, -1074.0, tiny),
            (2.0, 1024.0, INF),
            (-2.0, 3.0, -8.0),
            (-2.0, 2.0, 4.0),
            (-2.0, 0.5, NAN),
            (0.0, 0.0, 1.0),
            (NAN, 0.0, 1.0),
            (1.0, NAN, 1.0),
            (1.0, INF, 1.0),
            (-1.0, INF, 1.0),
            (0.0, 3.0, 0.0),
            (-0.0, 3.0, -0.0),
            (0.0, -1.0, INF),
            (-0.0, -1.0, -INF),
            (0.5, INF, 0.0),
            (0.5, -INF, INF),
            (2.0, INF, INF),
            (INF, -1.0, 0.0),
            (-INF, 3.0, -INF),
            (-INF, -3.0, -0.0),
            (NAN, 1.0, NAN),
            (2.0, NAN, NAN),
            (9.0, 0.5, 3.0),
            (tiny, 1.0, tiny),
            (3.0, 1.0, 3.0),
        ],
    );
    two(
        "hypot",
        math::hypot,
        &[
            (3.0, 4.0, 5.0),
            (3e300, 4e300, 5e300),
            (3e-320, 4e-320, 5e-320),
            (0.0, -0.0, 0.0),
            (0.0, -7.0, 7.0),
            (tiny, 0.0, tiny),
            (INF, NAN, INF),
            (NAN, -INF, INF),
            (NAN, 1.0, NAN),
            (1e308, 1e308, SQRT_2 * 1e308),
            (1.5e308, 1.5e308, INF),
            (1e300, 1e-300, 1e300),
        ],
    );
}

/// Checks monotonicity at points where the formula changes, and at the ends of the domain.
#[test]
fn neighbors_are_in_order_at_the_ends_and_between_the_formulas() {
    let rises: [(&str, Single, &[f64]); 8] = [
        ("exp", math::exp, &[-745.0, -708.5, -708.0, -0.3465735902799726, 0.34657359027997264, 708.0, 709.5]),
        ("ln", math::ln, &[1e-310, f64::MIN_POSITIVE, FRAC_1_SQRT_2, SQRT_2, 1e300]),
        ("atan", math::atan, &[0.5, 1.0, 2.0, 1e300]),
        ("asin", math::asin, &[0.5, 1.0 - 1e-13]),
        ("-acos", |x| -math::acos(x), &[-1.0 + 1e-13, -0.5, 0.5, 1.0 - 1e-13]),
        ("sinh", math::sinh, &[0.34657359027997264, 708.0]),
        ("cosh", math::cosh, &[0.34657359027997264, 708.0]),
        ("tanh", math::tanh, &[0.55, 0.8664339756999316]),
    ];
    for (name, f, points) in rises {
        for &point in points {
            // In steps of 64 doubles, the function increases by more than the error of a result.
            let upward = if point < 0.0 { -64 } else { 64 };
            let x = |i: i64| f64::from_bits(point.to_bits().wrapping_add_signed(upward * i));
            for i in -500..500 {
                let (x, next) = (x(i), x(i + 1));
                assert!(
                    f(x) <= f(next) || f(x).is_nan() || f(next).is_nan(),
                    "{name} falls from {x:e} to {next:e}: {:e}, {:e}",
                    f(x),
                    f(next)
                );
            }
        }
    }
}

#[test]
fn the_hyperbolic_tangent_reaches_one() {
    let steps: Vec<f64> = (0..240).map(|i| math::tanh(17.0 + 0.025 * f64::from(i))).collect();
    assert!(steps.is_sorted() && steps[0] < 1.0 && steps.last() == Some(&1.0));
}

#[test]
fn results_stay_in_their_ranges() {
    let mut random = Random(5);
    for _ in 0..200_000 {
        let (x, unit) = (random.number(10), random.unit());
        for x in [x, unit, 1.0 - unit.abs() * 1e-12] {
            for value in [math::sin(x), math::cos(x), math::tanh(x)] {
                assert!(value.abs() <= 1.0 || value.is_nan());
            }
            for value in [math::atan(x), math::asin(x)] {
                assert!(value.abs() <= FRAC_PI_2 || value.is_nan());
            }
            assert!((0.0..=PI).contains(&math::acos(x)) || x.is_nan() || x.abs() > 1.0);
            assert!(math::atan2(x, unit).abs() <= PI || x.is_nan());
            assert!(math::cosh(x) >= 1.0 || x.is_nan());
        }
    }
}

#[test]
fn integer_powers_are_products() {
    assert_eq!(math::powi(3.0, 4), 81.0);
    assert_eq!(math::powi(2.0, -2), 0.25);
    assert_eq!(math::powi(-2.0, 3), -8.0);
    assert_eq!(math::powi(0.0, 0), 1.0);
    assert_eq!(math::powi(2.0, i32::MIN), 0.0);
    assert_eq!(math::powi(1.7, 3), 1.7 * (1.7 * 1.7));
}

/// Reference: x^y = (x^(y/2))^2, where x^(y/2) is within 1.2 ulp (`accuracy`) and its square within 3 ulp. If the
/// result is subnormal, each side of this equation is within one subnormal step of the exact result. Bases are
/// subnormal, or near 1 with exponents up to 1e18.
#[test]
fn powers_below_the_normal_numbers_are_squares() {
    let mut random = Random(11);
    let (mut subnormal, mut far) = (0, 0);
    for k in 0..20_000 {
        let near = 1.0 + random.unit() * 0.5_f64.powi(2 + (random.bits() % 48) as i32);
        let x = if k % 3 == 0 { 1e-310 * (1.0 + random.unit()) } else { near };
        // The logarithm of the result is between -747 and -707. The results are therefore normal numbers (above
        // -708.4), subnormal numbers, or 0 (below -745.2).
        let y = (-727.0 + 20.0 * random.unit()) / math::ln(x);
        if !y.is_finite() {
            continue;
        }
        let (power, root) = (math::pow(x, y), math::pow(x, y / 2.0));
        let bound = 4.0 * f64::EPSILON * power + f64::from_bits(1);
        assert!((power - root * root).abs() <= bound, "{x:e} ^ {y:e}: {power:e}, {:e}", root * root);
        subnormal += u32::from(power > 0.0 && power < f64::MIN_POSITIVE);
        far += u32::from(y.abs() > 2_147_483_648.0);
    }
    assert!(subnormal > 10_000 && far > 1_000, "{subnormal} results are subnormal, {far} exponents are above 2^31");
}

/// The hash is the same on every platform: Linux on any processor, Windows, WebAssembly, ARM.
#[test]
fn a_million_results_have_the_same_hash_everywhere() {
    let mut random = Random(6);
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |value: f64| hash = (hash ^ value.to_bits()).wrapping_mul(0x100_0000_01b3).rotate_left(29);
    for _ in 0..1_000_000 / (13 + 3) / 6 + 1 {
        let x: [f64; 6] = std::array::from_fn(|_| random.number(50));
        let y: [f64; 6] = std::array::from_fn(|_| random.number(50));
        ONE.iter().flat_map(|(_, single, _)| x.map(single)).for_each(&mut add);
        TWO.iter().flat_map(|(_, two, _)| (0..6).map(move |i| two(x[i].abs(), y[i]))).for_each(&mut add);
    }
    assert_eq!(hash, 0xc03b_66e3_3131_225a, "{hash:#x}");
}
