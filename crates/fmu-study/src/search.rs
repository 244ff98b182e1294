//! Common parts of the methods: evaluation of objectives and random numbers.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::io;
use std::path::{Path, PathBuf};

/// Error while running a study.
#[derive(Debug, thiserror::Error)]
pub enum ExecutionError {
    /// Results exist.
    #[error("{} already exists: `--resume` continues it, `--overwrite` starts over", .0.display())]
    Exists(PathBuf),
    /// The results are from another study.
    #[error(
        "{} belongs to another version of the study, its scenario or its FMUs: `--overwrite` starts over", .0.display()
    )]
    Changed(PathBuf),
    /// The history has more evaluations than the budget allows.
    #[error(
        "{} has {evaluations} evaluations, more than the budget of {budget}, and a shorter search would replace better \
         results by worse ones: `--resume` needs a budget of at least {evaluations}; `--overwrite` starts over, another \
         folder (`--out`) keeps both", path.display()
    )]
    Budget {
        /// The history.
        path: PathBuf,
        /// Number of evaluations in the history.
        evaluations: u64,
        /// The budget.
        budget: u64,
    },
    /// An FMU cannot be loaded.
    #[error("{0}")]
    Load(String),
    /// A file cannot be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Cause.
        cause: io::Error,
    },
    /// A line of a history is invalid: the file, the number of the line from 1, and a message.
    #[error("{path}, line {1}: {2}", path = .0.display())]
    Line(PathBuf, usize, String),
}

impl ExecutionError {
    /// A file cannot be read or written.
    pub(crate) fn io(path: &Path) -> impl Fn(io::Error) -> Self {
        move |cause| Self::Io { path: path.to_path_buf(), cause }
    }
}

/// Reason that a search ends early.
#[derive(Debug, thiserror::Error)]
pub enum Stop {
    /// The budget of evaluations is spent.
    #[error("the budget is spent")]
    Budget,
    /// The target is reached.
    #[error("the target is reached")]
    Target,
    /// An error, such as a history that cannot be written.
    #[error(transparent)]
    Failed(#[from] ExecutionError),
}

/// Evaluates candidates. The coordinates of a candidate are shares of the ranges of the parameters, 0 to 1.
pub trait Evaluate {
    /// Returns the objectives of a population, in the same order: finite, and the smaller the better. Each call is a
    /// generation.
    fn evaluate(&mut self, population: &[Vec<f64>]) -> Result<Vec<f64>, Stop>;
}

/// Lets a plain function evaluate populations, without files.
impl<F: FnMut(&[Vec<f64>]) -> Result<Vec<f64>, Stop>> Evaluate for F {
    fn evaluate(&mut self, population: &[Vec<f64>]) -> Result<Vec<f64>, Stop> {
        self(population)
    }
}

/// Random numbers for one individual of one generation. Each individual has its own ChaCha stream, so results do not
/// depend on the order of work, and drawing more numbers for one individual does not change the numbers of other
/// individuals.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64, generation: u32, index: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Populations are limited to far less than 2^32.
        rng.set_stream((u64::from(generation) << 32) | (index as u64 & 0xffff_ffff));
        Self(rng)
    }

    /// Returns a uniform number 0 <= u < 1 with 53 random bits.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    pub(crate) fn code(&mut self) -> u16 {
        (self.0.next_u64() >> 48) as u16
    }
}

/// A candidate in the code of PACSA and the genetic algorithm: a binary number of 16 bits per parameter, most
/// significant bit first.
pub(crate) type Code = Vec<u16>;

pub(crate) fn first_generation(population: usize, dimension: usize, seed: u64) -> Vec<Code> {
    let code = |index| {
        let mut random = Random::new(seed, 0, index);
        (0..dimension).map(|_| random.code()).collect()
    };
    (0..population).map(code).collect()
}

pub(crate) fn evaluate(evaluator: &mut dyn Evaluate, codes: &[Code]) -> Result<Vec<f64>, Stop> {
    evaluator.evaluate(&codes.iter().map(|code| decode(code)).collect::<Vec<_>>())
}

pub(crate) const BITS: usize = 16;

/// Returns the shares of the ranges: 0 is the lower bound, 65535 the upper bound.
pub(crate) fn decode(code: &[u16]) -> Vec<f64> {
    code.iter().map(|c| f64::from(*c) / f64::from(u16::MAX)).collect()
}

pub(crate) fn mutate(code: &mut [u16], probability: f64, random: &mut Random) {
    for word in code {
        for bit in (0..BITS).rev() {
            if random.chance(probability) {
                *word ^= 1 << bit;
            }
        }
    }
}

/// Affinity or fitness: the reciprocal of an objective, which is not negative. Objectives below 1e-300 get the same
/// affinity.
pub(crate) fn affinity(objective: f64) -> f64 {
    1.0 / objective.max(1e-300)
}

/// Indices from the best to the worst; equal objectives keep their order.
pub(crate) fn ranking(objectives: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..objectives.len()).collect();
    order.sort_by(|a, b| objectives[*a].total_cmp(&objectives[*b]));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_and_repeat() {
        let draw = |seed, generation, index| Random::new(seed, generation, index).uniform();
        assert_eq!(draw(1, 2, 3), draw(1, 2, 3));
        let all = [draw(1, 2, 3), draw(2, 2, 3), draw(1, 3, 3), draw(1, 2, 4), draw(1, 3, 2)];
        for (i, a) in all.iter().enumerate() {
            assert!((0.0..1.0).contains(a) && all[i + 1..].iter().all(|b| a != b));
        }
    }

    #[test]
    fn codes_span_the_range() {
        assert_eq!(decode(&[0, u16::MAX]), [0.0, 1.0]);
        // A value from the handling study: mu = 0.05 + 2.95 * 2^13/65535 = 0.41876.
        assert!((0.05 + 2.95 * decode(&[1 << 13])[0] - 0.418_756).abs() < 1e-6);
    }

    #[test]
    fn mutation_turns_the_share_of_bits() {
        let mut code = vec![0; 10_000];
        mutate(&mut code, 0.1, &mut Random::new(1, 0, 0));
        let turned: u32 = code.iter().map(|c| c.count_ones()).sum();
        // The number of turned bits among 160,000 has a standard deviation of sqrt(n p q) = 120; four standard
        // deviations are allowed.
        assert!(turned.abs_diff(16_000) < 480, "{turned}");
        let before = code.clone();
        mutate(&mut code, 0.0, &mut Random::new(1, 0, 1));
        assert_eq!(code, before);
        mutate(&mut code, 1.0, &mut Random::new(1, 0, 1));
        assert!(code.iter().zip(&before).all(|(a, b)| *a == !b));
    }
}
