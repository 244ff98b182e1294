//! Road profiles as functions of distance: pure functions and small tables, heights in m (upwards positive),
//! distances in m, wavenumbers in 1/m (cycles per meter).
//!
//! All transcendental functions come from `libm`, and all random numbers from [`random`](crate::random) and SplitMix64.
//! A seed therefore gives the same road on every machine.
//!
//! # References
//!
//! * ISO 8608:2016, Mechanical vibration - Road surface profiles - Reporting of measured data: the classes A to H
//!   and the one-sided power spectral density (PSD) `G(n) = Gd (n/n0)^-2` with `n0 = 0.1 1/m`.
//! * Steele, Lea, Flood: Fast splittable pseudorandom number generators, OOPSLA 2014 (SplitMix64).

use std::f64::consts::{PI, TAU};

/// Reference wavenumber `n0` of ISO 8608 in 1/m.
pub const REFERENCE_WAVENUMBER: f64 = 0.1;

/// Roughness coefficient `Gd(n0)` in m3 of an ISO 8608 class, 1 (A) to 8 (H): the geometric mean of the class,
/// `16e-6 * 4^(class - 1)`. `None` for any other class.
pub fn class_coefficient(class: i32) -> Option<f64> {
    (1..=8).contains(&class).then(|| 16e-6 * f64::from(1_u32 << (2 * (class - 1))))
}

/// First-order shaped white noise on a grid in distance.
///
/// ```text
/// z[k+1] = alpha z[k] + sqrt(sigma^2 (1 - alpha^2)) N(0, 1)
/// alpha = exp(-2 pi n00 ds),   sigma^2 = pi n0^2 Gd/(2 n00)
/// ```
///
/// It samples `dz/ds = -2 pi n00 z + white noise` exactly. The one-sided PSD `Gd n0^2/(n^2 + n00^2)` of this process
/// approaches the PSD of ISO 8608 well above the cutoff `n00`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapedNoise {
    /// Standard deviation `sigma` of the stationary profile in m.
    pub deviation: f64,
    /// Factor `alpha` from one grid point to the next.
    pub memory: f64,
    /// Factor on the normally distributed number, in m.
    pub gain: f64,
}

impl ShapedNoise {
    /// The process for a coefficient `Gd` in m3, a cutoff `n00 > 0` in 1/m and a grid spacing `ds > 0` in m.
    pub fn new(coefficient: f64, cutoff: f64, spacing: f64) -> Self {
        let variance = PI * REFERENCE_WAVENUMBER.powi(2) * coefficient / (2.0 * cutoff);
        // 1 - alpha^2 without the cancellation at a small spacing
        let innovation = -libm::expm1(-2.0 * TAU * cutoff * spacing);
        Self {
            deviation: variance.sqrt(),
            memory: libm::exp(-TAU * cutoff * spacing),
            gain: (variance * innovation).sqrt(),
        }
    }

    /// The profile at the next grid point after `z`, given a standard normal number.
    pub fn next(&self, z: f64, normal: f64) -> f64 {
        self.memory * z + self.gain * normal
    }
}

/// Two tracks with a given correlation, from two independent profiles with equal PSD.
///
/// `left = cp z1 + cm z2`, `right = cp z1 - cm z2` with `cp = sqrt((1 + rho)/2)`, `cm = sqrt((1 - rho)/2)`. Both tracks
/// keep the PSD. The cross spectrum is `rho` times the PSD at every wavenumber (magnitude-squared coherence `rho^2`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture {
    /// Share `cp` of the common profile.
    pub common: f64,
    /// Share `cm` of the opposite profile.
    pub opposite: f64,
}

impl Mixture {
    /// The mixture for a correlation `rho` in -1..1.
    pub fn new(rho: f64) -> Self {
        Self { common: ((1.0 + rho) / 2.0).sqrt(), opposite: ((1.0 - rho) / 2.0).sqrt() }
    }

    /// Left and right track from the two profiles.
    pub fn tracks(&self, z: [f64; 2]) -> [f64; 2] {
        [self.common * z[0] + self.opposite * z[1], self.common * z[0] - self.opposite * z[1]]
    }
}

/// Second-order Padé approximation of a delay in distance, which is an all-pass filter.
///
/// ```text
/// X1' = X2 - 12 z/T
/// X2' = -12 X1/T^2 - 6 X2/T + 72 z/T^2
/// output = X1 + z
/// ```
///
/// where `T` is the length of the delay, and `'` is the derivative with respect to distance. The output has the PSD of
/// the input, and long waves are delayed by `T`. For a ramp `z = c s`, a particular solution is `X1 = -T c`,
/// `X2 = 12 z/T`, with the output `c (s - T)`. Deviations from it decay with the poles `(-3 ± i sqrt(3))/T`.
/// [`AllPass::advance`] uses this exact solution for a piecewise linear input.
///
/// # Reference
///
/// Applied Sciences 2020, 10, 1852, eq. 6: the right track of the hydro-pneumatic half car, given as a function of time
/// at constant speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AllPass {
    length: f64,
}

impl AllPass {
    /// The all-pass with a delay length `T > 0` in m.
    pub fn new(length: f64) -> Self {
        Self { length }
    }

    /// The state `X1, X2` after a long constant input `z`.
    pub fn steady(&self, z: f64) -> [f64; 2] {
        [0.0, 12.0 * z / self.length]
    }

    /// The state after a `distance > 0` on which the input goes linearly from `z0` to `z1`.
    pub fn advance(&self, x: [f64; 2], z0: f64, z1: f64, distance: f64) -> [f64; 2] {
        let t = self.length;
        let slope = (z1 - z0) / distance;
        let e1 = x[0] + t * slope;
        let e2 = x[1] - 12.0 * z0 / t;
        let angle = 3.0_f64.sqrt() * distance / t;
        let decay = libm::exp(-3.0 * distance / t);
        let cos = decay * libm::cos(angle);
        // sin(angle)/b with the imaginary part b = sqrt(3)/T of the pole
        let sin = decay * libm::sin(angle) * t / 3.0_f64.sqrt();
        [
            cos * e1 + sin * (3.0 / t * e1 + e2) - t * slope,
            cos * e2 - sin * (12.0 / (t * t) * e1 + 3.0 / t * e2) + 12.0 * z1 / t,
        ]
    }

    /// The output for the state `x` and the input `z` at the same distance.
    pub fn output(&self, x: [f64; 2], z: f64) -> f64 {
        x[0] + z
    }

    /// Frequency response (real, imaginary) at the wavenumber `n` in 1/m; its magnitude is 1.
    pub fn response(&self, n: f64) -> [f64; 2] {
        let w = TAU * n * self.length;
        // (e - i d)/(e + i d)
        let (e, d) = (1.0 - w * w / 12.0, w / 2.0);
        let size = e * e + d * d;
        [(e * e - d * d) / size, -2.0 * e * d / size]
    }
}

/// A rough road as a sum of cosines.
///
/// ```text
/// q(x) = w(x) sum_k sqrt(2 Gd (n_k/n0)^-2 dn) cos(2 pi n_k x + phi_k),   k = 0..799
/// n_k = 0.011 + (k + 0.5) dn,   dn = (2.83 - 0.011)/800
/// w(x) = 0 for x <= 0, (1 - cos(pi x/20))/2 up to 20 m, then 1
/// ```
///
/// with phases `phi_k = 2 pi U_k` from SplitMix64 (upper 53 bits). Because the wavenumbers are equidistant, the sum is
/// `Re(exp(2 pi i n_0 x) P(x))` with a complex `P` of period `1/dn = 283.8 m`. A fast Fourier transform tabulates one
/// period of `P`. A height then takes one cubic interpolation instead of 800 cosines. The standard deviation of the
/// interpolation error is 2.4e-9 m on a class B road.
///
/// # Reference
///
/// Shinozuka, Jan: Digital simulation of random processes and its applications, J. Sound Vib. 25 (1972), 111-128.
/// Band, number of cosines and phases are the same as in the road of the heavy vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    envelope: Vec<[f64; 2]>,
}

impl Harmonics {
    /// Number of cosines.
    pub const COUNT: usize = 800;
    /// Lower end of the band in 1/m.
    pub const LOWEST: f64 = 0.011;
    /// Upper end of the band in 1/m.
    pub const HIGHEST: f64 = 2.83;
    /// Distance between two wavenumbers in 1/m.
    pub const SPACING: f64 = (Self::HIGHEST - Self::LOWEST) / Self::COUNT as f64;
    /// Distance over which the profile rises from the flat start, in m.
    pub const FADE_IN: f64 = 20.0;
    /// Number of points in the table, which are 8.7 mm apart. The fourth derivative of a class B envelope has a
    /// standard deviation of 18 m^-3, so the error of cubic interpolation is 3/128 * 18 * 0.0087^4 = 2.4e-9 m.
    const POINTS: usize = 1 << 15;

    /// Wavenumber `n_k` in 1/m.
    pub fn wavenumber(k: usize) -> f64 {
        Self::LOWEST + (k as f64 + 0.5) * Self::SPACING
    }

    /// Complex amplitudes `sqrt(2 Gd (n_k/n0)^-2 dn) exp(i phi_k)` in m, for a coefficient `Gd` in m3 and a seed.
    pub fn amplitudes(coefficient: f64, seed: u64) -> Vec<[f64; 2]> {
        let mut state = seed;
        (0..Self::COUNT)
            .map(|k| {
                let ratio = Self::wavenumber(k) / REFERENCE_WAVENUMBER;
                let amplitude = (2.0 * coefficient * Self::SPACING).sqrt() / ratio;
                let phase = TAU * split_mix(&mut state);
                [amplitude * libm::cos(phase), amplitude * libm::sin(phase)]
            })
            .collect()
    }

    /// The profile with the given complex amplitudes, at most [`Harmonics::COUNT`].
    pub fn new(amplitudes: &[[f64; 2]]) -> Self {
        let mut envelope = vec![[0.0; 2]; Self::POINTS];
        for (place, amplitude) in envelope.iter_mut().zip(amplitudes).take(Self::COUNT) {
            *place = *amplitude;
        }
        fourier_sum(&mut envelope);
        Self { envelope }
    }

    /// Height at `x`, both in m; 0 at and before `x = 0`.
    pub fn height(&self, x: f64) -> f64 {
        // Written with `!` to include NaN.
        if !(x > 0.0 && x.is_finite()) {
            return 0.0;
        }
        let window = if x < Self::FADE_IN { (1.0 - libm::cos(PI * x / Self::FADE_IN)) / 2.0 } else { 1.0 };
        let periods = x * Self::SPACING;
        let place = (periods - periods.floor()) * Self::POINTS as f64;
        let f = place - place.floor();
        // cubic through the two points before and the two points after `x` (Lagrange)
        let weights = [
            -f * (f - 1.0) * (f - 2.0) / 6.0,
            (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
            -(f + 1.0) * f * (f - 2.0) / 2.0,
            (f + 1.0) * f * (f - 1.0) / 6.0,
        ];
        let before = place as usize + Self::POINTS - 1;
        let mut p = [0.0; 2];
        for (step, weight) in weights.iter().enumerate() {
            let point = self.envelope[(before + step) % Self::POINTS];
            p[0] += weight * point[0];
            p[1] += weight * point[1];
        }
        let (sin, cos) = libm::sincos(TAU * Self::wavenumber(0) * x);
        window * (cos * p[0] - sin * p[1])
    }
}

/// The next number of SplitMix64, its upper 53 bits as a fraction in 0..1.
fn split_mix(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// The Fourier sum `y[j] = sum_k x[k] exp(2 pi i j k/N)` in place, complex numbers as (real, imaginary).
///
/// Radix 2 (Cooley and Tukey 1965).
///
/// # Panics
///
/// If the length is not a power of two.
pub fn fourier_sum(x: &mut [[f64; 2]]) {
    let count = x.len();
    assert!(count.is_power_of_two(), "the length of a Fourier sum must be a power of two, got {count}");
    if count == 1 {
        return;
    }
    let shift = usize::BITS - count.trailing_zeros();
    for i in 0..count {
        let j = i.reverse_bits() >> shift;
        if i < j {
            x.swap(i, j);
        }
    }
    let rotations: Vec<[f64; 2]> = (0..count / 2)
        .map(|i| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / count as f64);
            [cos, sin]
        })
        .collect();
    let mut half = 1;
    while half < count {
        let stride = count / (2 * half);
        for block in x.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (i, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let [cos, sin] = rotations[i * stride];
                let turned = [cos * b[0] - sin * b[1], sin * b[0] + cos * b[1]];
                *b = [a[0] - turned[0], a[1] - turned[1]];
                *a = [a[0] + turned[0], a[1] + turned[1]];
            }
        }
        half *= 2;
    }
}

/// Bump of height 1: `(1 - cos(2 pi x/length))/2` for `0 < x < length`, otherwise 0. `length` must be positive.
pub fn bump(x: f64, length: f64) -> f64 {
    if x > 0.0 && x < length { (1.0 - libm::cos(TAU * x / length)) / 2.0 } else { 0.0 }
}

/// Trapezoid of height 1: up in the first quarter of `length`, level for half of it, down in the last quarter. `length`
/// must be positive.
pub fn trapezoid(x: f64, length: f64) -> f64 {
    let from_nearer_end = x.min(length - x);
    (4.0 * from_nearer_end / length).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the geometric means of ISO 8608, which are products of small integers. The tolerance covers one
    /// rounding.
    #[test]
    fn classes_are_the_geometric_means() {
        let expected = [16e-6, 64e-6, 256e-6, 1024e-6, 4096e-6, 16384e-6, 65536e-6, 262_144e-6];
        for (class, expected) in (1..).zip(expected) {
            let found = class_coefficient(class).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-15);
        }
        assert_eq!(class_coefficient(0), None);
        assert_eq!(class_coefficient(9), None);
    }

    /// Reference: stationary RMS of a class C road with n00 = 0.011 1/m, 0.0191 m (printed with four decimals).
    #[test]
    fn noise_has_the_stationary_deviation() {
        let noise = ShapedNoise::new(256e-6, 0.011, 0.01);
        assert!((noise.deviation - 0.0191).abs() < 5e-5);
        // var = alpha^2 var + gain^2, to rounding
        let variance = noise.gain.powi(2) / (1.0 - noise.memory.powi(2));
        assert!((variance / noise.deviation.powi(2) - 1.0).abs() < 1e-12);
        assert_eq!(noise.next(1.0, 0.0), noise.memory);
    }

    /// The two shares keep the PSD and the correlation: cp^2 + cm^2 = 1 and cp^2 - cm^2 = rho, to rounding.
    #[test]
    fn mixture_keeps_density_and_correlation() {
        for rho in [0.0, 0.6, 0.995, 1.0] {
            let m = Mixture::new(rho);
            let [l, r] = m.tracks([1.0, 0.0]);
            assert_eq!(l, r);
            assert!((m.common.powi(2) + m.opposite.powi(2) - 1.0).abs() < 1e-15);
            assert!((m.common.powi(2) - m.opposite.powi(2) - rho).abs() < 1e-15);
        }
    }

    /// Reference: a Runge-Kutta integration of the all-pass equations for a piecewise linear input, with a step of
    /// T/4000 (error of order (1/4000)^4 = 4e-15). The tolerance of 1e-12 covers the rounding of 12,000 steps.
    #[test]
    fn all_pass_is_exact_between_the_points() {
        let t = 1.56;
        let filter = AllPass::new(t);
        let slope = |x: [f64; 2], z: f64| {
            [x[1] - 12.0 * z / t, -12.0 * x[0] / t.powi(2) - 6.0 * x[1] / t + 72.0 * z / t.powi(2)]
        };
        let inputs = [0.3, -0.1, 0.8, 0.8];
        let mut x = filter.steady(0.0);
        let mut y = x;
        let steps = 4000;
        let h = t / f64::from(steps);
        for pair in inputs.windows(2) {
            x = filter.advance(x, pair[0], pair[1], t);
            for i in 0..steps {
                let z = |share: f64| pair[0] + (pair[1] - pair[0]) * (f64::from(i) + share) / f64::from(steps);
                let add = |y: [f64; 2], k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
                let k1 = slope(y, z(0.0));
                let k2 = slope(add(y, k1, h / 2.0), z(0.5));
                let k3 = slope(add(y, k2, h / 2.0), z(0.5));
                let k4 = slope(add(y, k3, h), z(1.0));
                for i in 0..2 {
                    y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
                }
            }
            assert!((x[0] - y[0]).abs() < 1e-12 && (x[1] - y[1]).abs() < 1e-12);
        }
    }

    /// Reference: the Padé form of a delay has magnitude 1 and phase -2 atan((w T/2)/(1 - (w T)^2/12)). It delays a
    /// ramp by exactly T and does not change a constant.
    #[test]
    fn all_pass_delays() {
        let filter = AllPass::new(2.0);
        for n in [0.001, 0.01, 0.1, 1.0, 10.0] {
            let [re, im] = filter.response(n);
            assert!((re.hypot(im) - 1.0).abs() < 1e-15);
            let w = TAU * n * 2.0;
            let phase = -2.0 * (w / 2.0).atan2(1.0 - w * w / 12.0);
            assert!((re - phase.cos()).abs() < 1e-14 && (im - phase.sin()).abs() < 1e-14);
        }
        // after 40 m = 20 T, the transient has decayed to exp(-60)
        let x = filter.advance(filter.steady(0.0), 0.0, 4.0, 40.0);
        assert!((filter.output(x, 4.0) - 0.1 * 38.0).abs() < 1e-14);
        let x = filter.advance(filter.steady(0.7), 0.7, 0.7, 1.0);
        assert!((filter.output(x, 0.7) - 0.7).abs() < 1e-15);
    }

    /// Reference: the frequency response of the filter. The input is a long cosine, sampled every 1 cm. Its linear
    /// interpolation reduces the amplitude by a factor of (2 pi n ds)^2/12 = 8.2e-5. The gain from input to state is at
    /// most 2, so the tolerance is 2e-4.
    #[test]
    fn all_pass_state_follows_its_response() {
        let (filter, n, ds) = (AllPass::new(1.56), 0.5, 0.01);
        let z = |k: i32| libm::cos(TAU * n * ds * f64::from(k));
        let [re, im] = filter.response(n);
        let mut x = filter.steady(1.0);
        for k in 0..5000 {
            x = filter.advance(x, z(k), z(k + 1), ds);
            if k > 2000 {
                let angle = TAU * n * ds * f64::from(k + 1);
                let expected = re * angle.cos() - im * angle.sin();
                assert!((filter.output(x, z(k + 1)) - expected).abs() < 2e-4);
            }
        }
    }

    /// Reference: the road of the heavy vehicle, q(25 m) and q(100 m) for seed 1, class B, given to 1e-8 m. The
    /// tolerance is half a unit of the last digit plus the interpolation error of 2.4e-9 m.
    #[test]
    fn harmonics_give_the_reference_heights() {
        let road = Harmonics::new(&Harmonics::amplitudes(64e-6, 1));
        assert!((road.height(25.0) - -0.001_879_93).abs() < 1e-8);
        assert!((road.height(100.0) - 0.004_244_32).abs() < 1e-8);
    }

    /// Reference: the sum of 800 cosines, over many periods of the table. The tolerance of 2e-8 m is eight standard
    /// deviations of the interpolation error and 2e-6 standard deviations of the profile.
    #[test]
    fn harmonics_equal_the_sum() {
        let amplitudes = Harmonics::amplitudes(64e-6, 2);
        let road = Harmonics::new(&amplitudes);
        for i in 0..500 {
            let x = -5.0 + 3.137_1 * f64::from(i) + f64::from(i * i) * 0.01;
            let sum: f64 = amplitudes
                .iter()
                .enumerate()
                .map(|(k, a)| {
                    let (sin, cos) = libm::sincos(TAU * Harmonics::wavenumber(k) * x);
                    a[0] * cos - a[1] * sin
                })
                .sum();
            let window = if x <= 0.0 {
                0.0
            } else if x < 20.0 {
                (1.0 - (PI * x / 20.0).cos()) / 2.0
            } else {
                1.0
            };
            assert!((road.height(x) - window * sum).abs() < 2e-8);
        }
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0] {
            assert_eq!(road.height(x), 0.0);
        }
        assert!(road.height(1e300).is_finite());
    }

    /// Reference: the definition of the Fourier sum, evaluated directly. The rounding error in a sum of 64 terms of
    /// size 1 is 1e-14.
    #[test]
    fn fourier_sum_is_the_definition() {
        for count in [1_usize, 2, 64] {
            let x: Vec<[f64; 2]> = (0..count).map(|k| [(k * k % 7) as f64 / 7.0, (k % 5) as f64 / 5.0]).collect();
            let mut y = x.clone();
            fourier_sum(&mut y);
            for (j, y) in y.iter().enumerate() {
                let mut sum = [0.0; 2];
                for (k, x) in x.iter().enumerate() {
                    let (sin, cos) = (TAU * (j * k) as f64 / count as f64).sin_cos();
                    sum[0] += x[0] * cos - x[1] * sin;
                    sum[1] += x[0] * sin + x[1] * cos;
                }
                assert!((y[0] - sum[0]).abs() < 1e-12 && (y[1] - sum[1]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn obstacles_have_their_shape() {
        assert_eq!([bump(0.0, 2.0), bump(1.0, 2.0), bump(2.0, 2.0), bump(-1.0, 2.0)], [0.0, 1.0, 0.0, 0.0]);
        assert!((bump(0.5, 2.0) - 0.5).abs() < 1e-15);
        let shape = [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 3.5, 4.0, 9.0].map(|x| trapezoid(x, 4.0));
        assert_eq!(shape, [0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0]);
    }
}
