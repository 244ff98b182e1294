//! A plain genetic algorithm, with which the paper compares its method. Parents are selected by roulette in proportion
//! to 1/objective, children result from single-point crossover and mutation of bits, and the best individuals are kept.
//!
//! Reference: Applied Sciences 2020, 10, 1852, section 5.1, which compares with a GA without describing it; Goldberg,
//! Genetic Algorithms in Search, Optimization and Machine Learning, 1989.

use crate::search::{BITS, Code, Evaluate, Random, Stop, affinity, evaluate, first_generation, mutate, ranking};

/// Settings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Number of individuals, at least 2.
    pub population: usize,
    /// Probability that two parents are crossed.
    pub crossover: f64,
    /// Mutation rate per bit.
    pub mutation: f64,
    /// Number of best individuals that are kept unchanged; less than the population.
    pub elite: usize,
    /// Number of generations.
    pub generations: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { population: 40, crossover: 0.8, mutation: 0.01, elite: 1, generations: 100 }
    }
}

/// Searches until the last generation. The elite is not evaluated again.
pub fn run(settings: &Settings, dimension: usize, seed: u64, evaluator: &mut dyn Evaluate) -> Result<(), Stop> {
    let mut codes = first_generation(settings.population, dimension, seed);
    let mut objectives = evaluate(evaluator, &codes)?;
    for generation in 1..=settings.generations {
        let wheel = Wheel::new(&objectives);
        let wanted = settings.population - settings.elite;
        let mut children: Vec<Code> = Vec::with_capacity(wanted + 1);
        while children.len() < wanted {
            // Each pair has its own random stream, identified by the index of its first child.
            let mut random = Random::new(seed, generation, children.len());
            let parents = [wheel.spin(random.uniform()), wheel.spin(random.uniform())].map(|i| codes[i].as_slice());
            let pair = if random.chance(settings.crossover) {
                let points = (BITS * dimension - 1) as f64;
                let point = 1 + (random.uniform() * points) as usize;
                [cross(parents[0], parents[1], point), cross(parents[1], parents[0], point)]
            } else {
                parents.map(<[u16]>::to_vec)
            };
            for mut child in pair {
                mutate(&mut child, settings.mutation, &mut random);
                children.push(child);
            }
        }
        children.truncate(wanted);
        let child_objectives = evaluate(evaluator, &children)?;
        let elite: Vec<usize> = ranking(&objectives).into_iter().take(settings.elite).collect();
        objectives = elite.iter().map(|i| objectives[*i]).chain(child_objectives).collect();
        codes = elite.iter().map(|i| codes[*i].clone()).chain(children).collect();
    }
    Ok(())
}

/// A roulette wheel with a sector for each individual, as wide as its fitness.
struct Wheel {
    ends: Vec<f64>,
}

impl Wheel {
    fn new(objectives: &[f64]) -> Self {
        let ends = objectives.iter().scan(0.0, |sum, j| {
            *sum += affinity(*j);
            Some(*sum)
        });
        Self { ends: ends.collect() }
    }

    /// The individual at a share 0 <= u < 1 of the circumference.
    fn spin(&self, u: f64) -> usize {
        let last = self.ends.len() - 1;
        let at = u * self.ends[last];
        self.ends.partition_point(|end| *end <= at).min(last)
    }
}

/// Returns the first `point` bits of `head`, followed by the remaining bits of `tail`.
fn cross(head: &[u16], tail: &[u16], point: usize) -> Code {
    let (word, bit) = (point / BITS, point % BITS);
    let mut child = [&head[..word], &tail[word..]].concat();
    if bit > 0 {
        let low = u16::MAX >> bit;
        child[word] = (head[word] & !low) | (tail[word] & low);
    }
    child
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossover_by_hand() {
        let (a, b) = ([0xffff, 0xffff], [0, 0]);
        assert_eq!(cross(&a, &b, 1), [0x8000, 0]);
        assert_eq!(cross(&a, &b, 16), [0xffff, 0]);
        assert_eq!(cross(&a, &b, 20), [0xffff, 0xf000]);
        assert_eq!(cross(&b, &a, 31), [0, 1]);
    }

    /// Sectors with the widths 1/1, 1/2 and 1/4 on a circumference of 1.75.
    #[test]
    fn the_wheel_has_sectors_by_fitness() {
        let wheel = Wheel::new(&[1.0, 2.0, 4.0]);
        let at = |length: f64| wheel.spin(length / 1.75);
        assert_eq!([at(0.0), at(0.99), at(1.01), at(1.49), at(1.51), at(1.74)], [0, 0, 1, 1, 2, 2]);
        assert_eq!(wheel.spin(1.0 - f64::EPSILON / 2.0), 2);
    }
}
