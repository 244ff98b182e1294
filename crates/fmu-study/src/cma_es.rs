//! CMA-ES of the crate `cmaes`, an external reference: evolution of a normal distribution by covariance matrix
//! adaptation, restarted with twice the population whenever it has converged.
//!
//! Reference: Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772; restarts: Auger and Hansen, A Restart CMA
//! Evolution Strategy With Increasing Population Size, 2005.

use crate::search::{Evaluate, Stop};
use cmaes::{CMAESOptions, DVector};

/// Doublings of the population, at most: more than any budget reaches.
const MAX_DOUBLINGS: u32 = 10;

/// Settings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Points per generation, at least 2; `None`: 4 + 3 ln n.
    pub population: Option<usize>,
    /// Standard deviation at the start, as a share of the ranges; the mean is in their middle.
    pub step_size: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { population: None, step_size: 0.3 }
    }
}

/// Searches until the evaluator ends it.
///
/// # Errors
/// The evaluator ends the search; with valid settings there is no other end.
pub fn run(settings: &Settings, dimension: usize, seed: u64, evaluator: &mut dyn Evaluate) -> Result<(), Stop> {
    for restart in 0_u32.. {
        let usual = 4 + (3.0 * libm::log(dimension as f64)).floor() as usize;
        let options = CMAESOptions::new(vec![0.5; dimension], settings.step_size)
            .population_size(settings.population.unwrap_or(usual) << restart.min(MAX_DOUBLINGS))
            .seed(seed.wrapping_add(u64::from(restart)));
        let mut known = Vec::new();
        while let Some(points) = ask(&options, &known) {
            let inside: Vec<Vec<f64>> = points.iter().map(|p| p.iter().map(|x| mirror(*x)).collect()).collect();
            known.extend(evaluator.evaluate(&inside)?);
        }
        if known.is_empty() {
            // Settings the crate rejects; a study is checked against them.
            return Ok(());
        }
    }
    Ok(())
}

/// Returns the population that follows the objectives known so far; `None` if the strategy has ended.
///
/// The crate requests objectives one by one and cannot be copied. But it is a function of its seed and the objectives,
/// and cheap compared with a simulation. So it is restarted each time with the known objectives, and the points that it
/// requests after them are the next population, whose objectives it does not get.
fn ask(options: &CMAESOptions, known: &[f64]) -> Option<Vec<Vec<f64>>> {
    let generations = known.len() / options.population_size;
    let mut asked = 0;
    let mut points = Vec::new();
    let objective = |x: &DVector<f64>| {
        let value = known.get(asked).copied();
        asked += 1;
        value.unwrap_or_else(|| {
            points.push(x.as_slice().to_vec());
            0.0
        })
    };
    // The options are valid: positive dimension, population of at least 2, positive step size.
    let mut strategy = options.clone().build(objective).ok()?;
    for _ in 0..generations {
        if strategy.next().is_some() {
            return None;
        }
    }
    let _ = strategy.next();
    drop(strategy);
    (!points.is_empty()).then_some(points)
}

/// Reflects at 0 and 1 until the point is between them, so every point of the normal distribution is a candidate.
fn mirror(x: f64) -> f64 {
    let t = x.rem_euclid(2.0);
    if t > 1.0 { 2.0 - t } else { t }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflection() {
        // Sums of a few halves and tenths: rounding only.
        for (x, expected) in [(0.3, 0.3), (-0.3, 0.3), (1.3, 0.7), (2.3, 0.3), (-1.3, 0.7), (0.0, 0.0), (1.0, 1.0)] {
            assert!((mirror(x) - expected).abs() < 1e-15, "{x}");
        }
    }

    /// Asking population by population is the same search as letting the crate call the function itself.
    #[test]
    fn asking_gives_the_points_of_the_crate() {
        let sphere = |x: &[f64]| x.iter().map(|v| (v - 0.2).powi(2)).sum::<f64>();
        let options = CMAESOptions::new(vec![0.5; 3], 0.3).seed(7);
        let mut expected = Vec::new();
        let mut own = options
            .clone()
            .build(|x: &DVector<f64>| {
                expected.push(x.as_slice().to_vec());
                sphere(x.as_slice())
            })
            .unwrap();
        for _ in 0..20 {
            let _ = own.next();
        }
        drop(own);
        let (mut asked, mut known) = (Vec::new(), Vec::new());
        for _ in 0..20 {
            let points = ask(&options, &known).unwrap();
            known.extend(points.iter().map(|p| sphere(p)));
            asked.extend(points);
        }
        assert_eq!(asked, expected);
    }
}
