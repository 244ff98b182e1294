//! The methods on functions whose minimum is known.

use fmu_study::search::{Evaluate, Stop};
use fmu_study::{cma_es, genetic, pacsa};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Number of evaluations of each method.
const BUDGET: usize = 2000;
/// Number of parameters.
const DIMENSION: usize = 6;

/// An objective; all parameters are between -2 and 2.
type Function = fn(&[f64]) -> f64;

/// The minimum is 0, at 0.7 in every coordinate. CMA-ES starts elsewhere, in the middle of the ranges.
fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|v| (v - 0.7).powi(2)).sum()
}

/// The minimum is 0, at 1 in every coordinate, at the end of a curved valley.
fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
}

/// Records the objectives and ends the search after the budget.
struct Recorder {
    function: Function,
    generations: Vec<Vec<f64>>,
}

impl Recorder {
    fn new(function: Function) -> Self {
        Self { function, generations: Vec::new() }
    }

    fn evaluations(&self) -> usize {
        self.generations.iter().map(Vec::len).sum()
    }

    fn best(&self) -> f64 {
        self.generations.iter().flatten().copied().take(BUDGET).fold(f64::INFINITY, f64::min)
    }
}

impl Evaluate for Recorder {
    fn evaluate(&mut self, population: &[Vec<f64>]) -> Result<Vec<f64>, Stop> {
        assert!(population.iter().flatten().all(|share| (0.0..=1.0).contains(share)));
        if self.evaluations() >= BUDGET {
            return Err(Stop::Budget);
        }
        let value = |shares: &Vec<f64>| (self.function)(&shares.iter().map(|s| 4.0 * s - 2.0).collect::<Vec<_>>());
        let values: Vec<f64> = population.iter().map(value).collect();
        self.generations.push(values.clone());
        Ok(values)
    }
}

fn pacsa_on(function: Function, seed: u64) -> Recorder {
    let mut recorder = Recorder::new(function);
    let _ = pacsa::run(&pacsa::Settings::default(), DIMENSION, seed, &mut recorder);
    recorder
}

fn ga_on(function: Function, seed: u64) -> Recorder {
    let mut recorder = Recorder::new(function);
    let _ = genetic::run(&genetic::Settings::default(), DIMENSION, seed, &mut recorder);
    recorder
}

fn cmaes_on(function: Function, seed: u64) -> Recorder {
    let mut recorder = Recorder::new(function);
    let _ = cma_es::run(&cma_es::Settings::default(), DIMENSION, seed, &mut recorder);
    recorder
}

/// The best of `BUDGET` points drawn at random.
fn random_on(function: Function, seed: u64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut coordinate = || 4.0 * (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 - 2.0;
    (0..BUDGET)
        .map(|_| function(&(0..DIMENSION).map(|_| coordinate()).collect::<Vec<_>>()))
        .fold(f64::INFINITY, f64::min)
}

/// Upper bounds for PACSA, GA and CMA-ES. They are between the objectives that the methods reach and those that a
/// random search reaches with the same budget, over seeds 1 to 8. For the sphere, the methods reach 0.012, 0.21 and
/// 5e-15, the random search 0.59. For Rosenbrock's function, the methods reach 5.1, 14.4 and 3.97, the random search
/// 25.8; 3.97 is the local minimum near -1 in the first coordinate.
#[test]
fn the_methods_reach_what_random_search_does_not() {
    let functions: [(&str, Function, [f64; 3]); 2] =
        [("sphere", sphere, [0.05, 0.4, 1e-10]), ("Rosenbrock", rosenbrock, [10.0, 20.0, 5.0])];
    for (name, function, bounds) in functions {
        for seed in 1..=5 {
            let found = [pacsa_on, ga_on, cmaes_on].map(|search| search(function, seed).best());
            let random = random_on(function, seed);
            for ((method, found), bound) in ["PACSA", "GA", "CMA-ES"].into_iter().zip(found).zip(bounds) {
                assert!(found < bound && bound < random, "{name}, seed {seed}: {method} {found}, random {random}");
            }
        }
    }
}

/// Reference: the crate cmaes 0.2.2. Of its seeds 1 to 1000, 877 come below 0.1, and 59 end in the local minimum; here,
/// 889 and 57 do. With a probability of 0.88, 88 of 100 seeds are expected, with a standard deviation of 3.3. Four
/// standard deviations are allowed.
#[test]
fn cma_es_follows_the_valley_most_times() {
    let found = (1..=100).filter(|seed| cmaes_on(rosenbrock, *seed).best() < 0.1).count();
    assert!(found >= 75, "{found}");
}

/// The settings are chosen for about 20 clones per generation; the specification of the algorithm gives 2068
/// evaluations in 100 generations. The number varies between generations.
#[test]
fn pacsa_asks_for_about_20_evaluations_a_generation() {
    let recorder = pacsa_on(rosenbrock, 1);
    let mean = recorder.evaluations() as f64 / recorder.generations.len() as f64;
    assert!((10.0..30.0).contains(&mean), "{mean}");
    assert_eq!(recorder.generations[0].len(), 20);
}

/// The first generation has 40 evaluations, later ones have 39, because the elite is not evaluated again.
#[test]
fn the_genetic_algorithm_asks_for_39_after_the_first() {
    let recorder = ga_on(sphere, 1);
    assert_eq!(recorder.generations[0].len(), 40);
    assert!(recorder.generations[1..].iter().all(|g| g.len() == 39));
}

#[test]
fn a_seed_is_a_search() {
    for search in [pacsa_on, ga_on, cmaes_on] {
        let generations = |seed| search(rosenbrock, seed).generations;
        assert_eq!(generations(3), generations(3));
        assert_ne!(generations(3), generations(4));
    }
}

/// Hash of all objectives of a search (FNV-1a of their bits).
fn fingerprint(recorder: &Recorder) -> u64 {
    let values = recorder.generations.iter().flatten();
    values.fold(0xcbf2_9ce4_8422_2325, |hash, v| (hash ^ v.to_bits()).wrapping_mul(0x0100_0000_01b3))
}

/// The reference is the first version of each method (commit 88c023a; for CMA-ES, version 0.2.0). The results of
/// earlier studies must not change.
#[test]
fn searches_are_those_of_the_first_version() {
    let found = [pacsa_on, ga_on, cmaes_on].map(|search| fingerprint(&search(rosenbrock, 1)));
    assert_eq!(found, [7065142992357304163, 13331227793405948313, 15890778575230120197]);
}

/// A flat objective: no candidate is better than another, and all methods continue without an error.
#[test]
fn flat_objectives_do_no_harm() {
    for search in [pacsa_on, ga_on, cmaes_on] {
        for flat in [(|_| 1e6) as Function, |_| 0.0] {
            assert!(search(flat, 1).generations.len() > 5);
        }
    }
}
