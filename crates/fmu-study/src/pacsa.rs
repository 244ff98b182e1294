//! PACSA: parallel adaptive clonal selection.
//!
//! The best antibodies are copied in proportion to their affinity, the copies mutate, and the best copies replace the
//! worst antibodies. Mutation rate and number of replaced antibodies fall with the generations.
//!
//! Reference: Applied Sciences 2020, 10, 1852, section 4.2, equations 30 to 32, steps 1 to 7. The paper gives no
//! numbers for its settings and no encoding; the defaults are assumed.

use crate::search::{Code, Evaluate, Random, Stop, affinity, evaluate, first_generation, mutate, ranking};

/// Settings (step 1), with the paper's symbols.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Settings {
    /// n_p: number of antibodies, at least 2.
    pub population: usize,
    /// n_s: number of best antibodies that can be cloned.
    pub selected: usize,
    /// n_m: base of the number of clones.
    pub clone_scale: usize,
    /// Maximum number of clones of one antibody.
    pub most_clones: usize,
    /// p_r_max: mutation rate per bit at the start.
    pub mutation_max: f64,
    /// p_r_min: mutation rate per bit at the end.
    pub mutation_min: f64,
    /// lambda_max: maximum number of antibodies replaced in a generation.
    pub updates_max: f64,
    /// lambda_min: number of antibodies replaced in the last generation.
    pub updates_min: f64,
    /// x_max: number of generations.
    pub generations: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            population: 20,
            selected: 10,
            clone_scale: 2,
            most_clones: 10,
            mutation_max: 0.15,
            mutation_min: 0.01,
            updates_max: 12.0,
            updates_min: 4.0,
            generations: 100,
        }
    }
}

/// An antibody to clone, and the number and mutation rate of its clones.
#[derive(Debug, PartialEq)]
struct Cloning {
    antibody: usize,
    clones: usize,
    rate: f64,
}

/// Searches until the last generation.
pub fn run(settings: &Settings, dimension: usize, seed: u64, evaluator: &mut dyn Evaluate) -> Result<(), Stop> {
    // Steps 2 and 3: random antibodies and their affinities.
    let mut codes = first_generation(settings.population, dimension, seed);
    let mut objectives = evaluate(evaluator, &codes)?;
    for x in 1..=settings.generations {
        let affinities: Vec<f64> = objectives.iter().map(|j| affinity(*j)).collect();
        let order = ranking(&objectives);
        // Step 4: clone.
        let clonings = cloning(settings, x, &affinities, &order);
        // Step 5: mutate the clones. Then step 3 again: evaluate them.
        let mut clones: Vec<Code> = Vec::new();
        for Cloning { antibody, clones: count, rate } in clonings {
            for _ in 0..count {
                let mut clone = codes[antibody].clone();
                mutate(&mut clone, rate, &mut Random::new(seed, x, clones.len()));
                clones.push(clone);
            }
        }
        let clone_objectives = evaluate(evaluator, &clones)?;
        // Step 6: the best clones replace the worst antibodies, even if the clones are worse; the best antibody stays.
        let updates = updates(settings, x, &affinities).min(clones.len()).min(settings.population - 1);
        for (worst, clone) in replacements(&order, &clone_objectives, updates) {
            codes[worst] = clones[clone].clone();
            objectives[worst] = clone_objectives[clone];
        }
        // Step 7: continue with the next generation. The evaluator ends the search when it has reached the target.
    }
    Ok(())
}

/// Equations 30 and 31: number of clones of each antibody, and their mutation rate.
fn cloning(settings: &Settings, x: u32, affinities: &[f64], order: &[usize]) -> Vec<Cloning> {
    let average = mean(affinities);
    let least = affinities.iter().copied().fold(f64::INFINITY, f64::min);
    let rate = fall(settings.mutation_max, settings.mutation_min, x, settings.generations);
    let clonings: Vec<Cloning> = order
        .iter()
        .take(settings.selected)
        .filter(|&&i| affinities[i] > average)
        .map(|&i| {
            let excess = ((affinities[i] - least) / (average - least)).floor();
            // The conversion saturates, so a division by 0 gives the maximum number of clones.
            let clones = settings.clone_scale.saturating_mul(excess as usize).min(settings.most_clones);
            Cloning { antibody: i, clones, rate }
        })
        .filter(|cloning| cloning.clones > 0)
        .collect();
    if clonings.is_empty() {
        // If all affinities are equal, no antibody exceeds the average. The rate is then from the second branch of
        // equation 30.
        return vec![Cloning { antibody: order[0], clones: settings.clone_scale, rate: settings.mutation_min }];
    }
    clonings
}

/// Equation 32, rounded: number of antibodies that are replaced.
fn updates(settings: &Settings, x: u32, affinities: &[f64]) -> usize {
    let most = affinities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = affinities.iter().copied().fold(f64::INFINITY, f64::min);
    let lambda = if most - least < mean(affinities) / 2.0 {
        fall(settings.updates_max, settings.updates_min, x, settings.generations)
    } else {
        settings.updates_max
    };
    lambda.round() as usize
}

/// Returns pairs of an antibody and the clone that replaces it: the worst antibody and the best clone first.
fn replacements(order: &[usize], clones: &[f64], updates: usize) -> Vec<(usize, usize)> {
    order.iter().rev().copied().zip(ranking(clones)).take(updates).collect()
}

/// Falls linearly from `max` in generation 0 to `min` in the last generation.
fn fall(max: f64, min: f64, x: u32, generations: u32) -> f64 {
    max - f64::from(x) * ((max - min) / f64::from(generations))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations 30 and 31, computed by hand for the affinities 8, 5, 3 and 0. Their mean is 4, so (A - A_min)/(A_avg -
    /// A_min) is 2 and 1.25 for the two affinities above it.
    #[test]
    fn better_antibodies_get_more_clones() {
        let settings = Settings::default();
        let clonings = cloning(&settings, 50, &[5.0, 0.0, 8.0, 3.0], &[2, 0, 3, 1]);
        let found: Vec<_> = clonings.iter().map(|c| (c.antibody, c.clones)).collect();
        assert_eq!(found, [(2, 4), (0, 2)]);
        // The mean of 0.15 and 0.01, up to rounding.
        assert!(clonings.iter().all(|c| (c.rate - 0.08).abs() < 1e-15));
        let one = Settings { selected: 1, ..settings };
        assert_eq!(cloning(&one, 50, &[5.0, 0.0, 8.0, 3.0], &[2, 0, 3, 1]).len(), 1);
        let few = Settings { most_clones: 3, ..settings };
        assert_eq!(cloning(&few, 50, &[5.0, 0.0, 8.0, 3.0], &[2, 0, 3, 1])[0].clones, 3);
    }

    /// The best clones are used first, even if they are worse than the antibodies that they replace. At most n_p - 1
    /// antibodies are replaced, so the best antibody stays.
    #[test]
    fn the_worst_are_replaced() {
        let order = ranking(&[1.0, 4.0, 2.0, 3.0]);
        assert_eq!(replacements(&order, &[9.0, 7.0, 8.0], 2), [(1, 1), (3, 2)]);
        assert_eq!(replacements(&order, &[9.0, 7.0, 8.0], 3), [(1, 1), (3, 2), (2, 0)]);
    }

    #[test]
    fn if_all_are_equal_the_best_is_cloned() {
        let settings = Settings::default();
        let expected = [Cloning { antibody: 1, clones: 2, rate: 0.01 }];
        assert_eq!(cloning(&settings, 3, &[2.0, 2.0], &[1, 0]), expected);
    }

    /// Both branches of equation 32 and the rounding, computed by hand.
    #[test]
    fn fewer_are_replaced_when_the_population_is_alike() {
        let settings = Settings::default();
        let (different, alike) = ([1.0, 3.0], [2.0, 2.1]);
        assert_eq!(updates(&settings, 50, &different), 12);
        assert_eq!(updates(&settings, 50, &alike), 8);
        assert_eq!(updates(&settings, 100, &alike), 4);
        // 12 - 0.08 x is 11.52 for x = 6, and 11.44 for x = 7.
        assert_eq!((updates(&settings, 6, &alike), updates(&settings, 7, &alike)), (12, 11));
    }
}
