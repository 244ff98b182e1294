//! Random numbers for roads and sensors, bit-identical on every platform.
//!
//! Each use has separate streams, so two models with the same seed are independent.
//!
//! | stream | use |
//! |---|---|
//! | 0, 1 | left and right track of `Road` |
//! | 2 ([`SENSOR_STREAM`]) | noise of `Sensor` |
//!
//! # References
//!
//! * Bernstein: ChaCha, a variant of Salsa20, 2008.
//! * Box, Muller: A note on the generation of random normal deviates, Ann. Math. Statist. 29 (1958), 610-611.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Stream for the noise of `Sensor`.
pub const SENSOR_STREAM: u64 = 2;

/// Standard normal numbers, addressed by index: number `k` depends only on the seed, the stream and `k`.
///
/// The generator is ChaCha8 with the seed in the first eight bytes (little endian) of an otherwise zero key. Number
/// `k` takes the four words from word `4 k` on, as two 64-bit integers `a` and `b`, and is
/// `sqrt(-2 ln((a' + 1)/2^53)) cos(2 pi b'/2^53)` with the upper 53 bits `a'`, `b'` (Box and Muller). A saved FMU state
/// therefore needs only the index.
#[derive(Clone, Debug)]
pub struct Normals(ChaCha8Rng);

impl Normals {
    /// The numbers of a stream, starting at index `first`.
    pub fn new(seed: u64, stream: u64, first: u64) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(stream);
        generator.set_word_pos(4 * u128::from(first));
        Self(generator)
    }

    /// The next number.
    pub fn draw(&mut self) -> f64 {
        const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;
        let radius = ((self.0.next_u64() >> 11) + 1) as f64 * UNIT;
        let angle = (self.0.next_u64() >> 11) as f64 * UNIT;
        (-2.0 * libm::log(radius)).sqrt() * libm::cos(TAU * angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers depend only on their index; another seed or stream gives other numbers.
    #[test]
    fn normals_are_addressed_by_index() {
        let mut all = Normals::new(7, 1, 0);
        let numbers: Vec<f64> = (0..300).map(|_| all.draw()).collect();
        for first in [0, 1, 5, 31, 32, 33, 64, 255] {
            let mut some = Normals::new(7, 1, first);
            for expected in &numbers[first as usize..] {
                assert_eq!(some.draw().to_bits(), expected.to_bits());
            }
        }
        assert_ne!(Normals::new(8, 1, 0).draw(), numbers[0]);
        assert_ne!(Normals::new(7, 0, 0).draw(), numbers[0]);
    }

    /// Reference: a separate program in Python (ChaCha8 block function and Box-Muller written from their definitions).
    /// The tolerance allows for libraries whose logarithm and cosine differ in the last digits.
    #[test]
    fn normals_follow_the_definition() {
        for (seed, stream, number, expected) in [
            (1, 0, 0, -0.386_711_286_344_948_5),
            (1, 0, 1, 0.580_285_084_098_023_3),
            (1, 1, 0, 0.882_403_993_492_006_5),
            (2, 0, 0, 0.146_315_458_326_355_67),
            (1, 1, 123_456, -1.991_741_973_722_175_8),
        ] {
            let found = Normals::new(seed, stream, number).draw();
            assert!((found - expected).abs() < 1e-14);
        }
    }

    /// Reference: moments and distribution of the standard normal. The standard errors for N = 100,000 numbers are
    /// sqrt(1/N) = 0.0032 for the mean, sqrt(2/N) = 0.0045 for the second moment, sqrt(15/N) = 0.0123 for the third,
    /// sqrt(96/N) = 0.031 for the fourth, and sqrt(0.84 * 0.16/N) = 0.00116 for the share of the numbers below 1. The
    /// tolerance is four standard errors.
    #[test]
    fn normals_are_normal() {
        let count = 100_000;
        let mut normals = Normals::new(1, 0, 0);
        let mut sums = [0.0; 4];
        let mut below_one = 0;
        for _ in 0..count {
            let x = normals.draw();
            for (power, sum) in (1..).zip(&mut sums) {
                *sum += x.powi(power) / f64::from(count);
            }
            below_one += i32::from(x < 1.0);
        }
        assert!(sums[0].abs() < 4.0 * 0.0032);
        assert!((sums[1] - 1.0).abs() < 4.0 * 0.0045);
        assert!(sums[2].abs() < 4.0 * 0.0123);
        assert!((sums[3] - 3.0).abs() < 4.0 * 0.031);
        let share = f64::from(below_one) / f64::from(count);
        assert!((share - 0.841_344_7).abs() < 4.0 * 0.00116);
    }
}
