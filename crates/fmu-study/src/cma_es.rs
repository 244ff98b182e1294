//! CMA-ES: evolution of a normal distribution by covariance matrix adaptation, restarted with twice the population
//! whenever it has converged.
//!
//! Reference: Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, appendix A, with negative weights;
//! restarts: Auger and Hansen, A Restart CMA Evolution Strategy With Increasing Population Size, 2005. Symbols and
//! equation numbers are those of the tutorial.

use crate::search::{Evaluate, Random, Stop, ranking};
use libm::{exp, log, pow, sqrt};
use nalgebra::{DMatrix, DVector};

/// Version of the search. Another version proposes other points for the same seed, so its histories are not continued.
pub(crate) const VERSION: &str = "2";
/// Maximum number of doublings of the population. No budget reaches it.
const MAX_DOUBLINGS: u32 = 10;
/// The search has converged if its width, relative to the width at the start, or the differences between objectives are
/// below this.
const CONVERGED: f64 = 1e-12;
/// The search has diverged if its width, relative to the width at the start, is at least this.
const DIVERGED: f64 = 1e4;
/// Maximum number of iterations per eigenvalue; about three are usual.
const MAX_SWEEPS: usize = 100;
/// Condition number above which the covariance matrix is meaningless in double precision.
const MAX_CONDITION: f64 = 1e14;

/// Settings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Points per generation, at least 2; `None` for 4 + 3 ln n with n parameters.
    pub population: Option<usize>,
    /// Standard deviation at the start, as a share of the ranges. The mean starts in the middle of the ranges.
    pub step_size: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { population: None, step_size: 0.3 }
    }
}

/// Searches until the evaluator ends the search.
///
/// # Errors
/// The reason for which the evaluator ended the search. The search never ends by itself.
pub fn run(settings: &Settings, dimension: usize, seed: u64, evaluator: &mut dyn Evaluate) -> Result<(), Stop> {
    let usual = 4 + (3.0 * log(dimension as f64)).floor() as usize;
    let mut generation = 0;
    for restart in 0_u32.. {
        let population = settings.population.unwrap_or(usual) << restart.min(MAX_DOUBLINGS);
        let mut strategy = Strategy::new(dimension, population, settings.step_size);
        while !strategy.has_converged() {
            let points: Vec<_> = (0..population)
                .map(|i| strategy.point(&normal(&mut Random::new(seed, generation, i), dimension)))
                .collect();
            let inside: Vec<Vec<f64>> = points.iter().map(|p| p.iter().map(|x| mirror(*x)).collect()).collect();
            strategy.update(&points, &evaluator.evaluate(&inside)?);
            generation += 1;
        }
    }
    Ok(())
}

/// Independent normal numbers with mean 0 and variance 1, by the transformation of Box and Muller.
fn normal(random: &mut Random, dimension: usize) -> DVector<f64> {
    DVector::from_fn(dimension, |_, _| {
        let radius = sqrt(-2.0 * log(1.0 - random.uniform()));
        radius * libm::cos(std::f64::consts::TAU * random.uniform())
    })
}

/// Reflects at 0 and 1 until the point is between them, so every point of the normal distribution is a candidate.
fn mirror(x: f64) -> f64 {
    let t = x.rem_euclid(2.0);
    if t > 1.0 { 2.0 - t } else { t }
}

/// The search distribution, and the quantities that adapt it.
struct Strategy {
    n: f64,
    /// Weights of the points, from the best to the worst; the weights of the worse half are negative.
    w: Vec<f64>,
    /// Number of points with positive weights, and the variance effective selection mass.
    mu: usize,
    mu_eff: f64,
    /// Learning rates for the evolution paths of step size and covariance, and for the rank-one and rank-mu updates;
    /// damping for the step size.
    c_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    d_sigma: f64,
    /// Expected length of a vector of independent standard normal numbers.
    chi: f64,
    m: DVector<f64>,
    sigma: f64,
    first_sigma: f64,
    c: DMatrix<f64>,
    /// Eigenvectors of `c`, and square roots of its eigenvalues.
    b: DMatrix<f64>,
    d: DVector<f64>,
    p_sigma: DVector<f64>,
    p_c: DVector<f64>,
    /// Best and median objective of each generation.
    best: Vec<f64>,
    median: Vec<f64>,
    /// Difference between the worst and the best objective of the last generation.
    spread: f64,
}

impl Strategy {
    /// Starts with the default parameters from table 1, and with the mean in the middle of the ranges.
    fn new(dimension: usize, population: usize, sigma: f64) -> Self {
        let n = dimension as f64;
        let mu = population / 2;
        let raw: Vec<f64> = (1..=population).map(|i| log((population + 1) as f64 / 2.0) - log(i as f64)).collect();
        let sum = |w: &[f64]| w.iter().map(|w| w.abs()).sum::<f64>();
        let effective = |w: &[f64]| sum(w) * sum(w) / w.iter().map(|w| w * w).sum::<f64>();
        let (mu_eff, mu_eff_minus) = (effective(&raw[..mu]), effective(&raw[mu..]));
        let c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + mu_eff);
        let rank_mu = 2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0) * (n + 2.0) + mu_eff);
        let c_mu = rank_mu.min(1.0 - c_1);
        // Equations (50) to (53).
        let alpha =
            (1.0 + c_1 / c_mu).min(1.0 + 2.0 * mu_eff_minus / (mu_eff + 2.0)).min((1.0 - c_1 - c_mu) / (n * c_mu));
        let scaled = |w: &f64| if *w >= 0.0 { *w / sum(&raw[..mu]) } else { alpha * *w / sum(&raw[mu..]) };
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        Self {
            n,
            w: raw.iter().map(scaled).collect(),
            mu,
            mu_eff,
            c_sigma,
            c_c: (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n),
            c_1,
            c_mu,
            d_sigma: 1.0 + 2.0 * (sqrt((mu_eff - 1.0) / (n + 1.0)) - 1.0).max(0.0) + c_sigma,
            chi: sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            m: DVector::from_element(dimension, 0.5),
            sigma,
            first_sigma: sigma,
            c: DMatrix::identity(dimension, dimension),
            b: DMatrix::identity(dimension, dimension),
            d: DVector::from_element(dimension, 1.0),
            p_sigma: DVector::zeros(dimension),
            p_c: DVector::zeros(dimension),
            best: Vec::new(),
            median: Vec::new(),
            spread: f64::INFINITY,
        }
    }

    /// Equations (38) to (40): returns the point for the independent normal numbers `z`.
    fn point(&self, z: &DVector<f64>) -> DVector<f64> {
        &self.m + self.sigma * (&self.b * self.d.component_mul(z))
    }

    /// Equations (41) to (47): updates the distribution with the objectives of a population.
    fn update(&mut self, points: &[DVector<f64>], objectives: &[f64]) {
        let order = ranking(objectives);
        let y: Vec<DVector<f64>> = order.iter().map(|i| (&points[*i] - &self.m) / self.sigma).collect();
        let mut y_w = DVector::zeros(self.m.len());
        for (w, y) in self.w.iter().zip(&y).take(self.mu) {
            y_w.axpy(*w, y, 1.0);
        }
        self.m.axpy(self.sigma, &y_w, 1.0);

        // Returns the coordinates of C^(-1/2) y along the eigenvectors, which have the same norm as the vector.
        let whitened = |y: &DVector<f64>| self.b.tr_mul(y).component_div(&self.d);
        let step = &self.b * whitened(&y_w);
        let squares: Vec<f64> = y.iter().map(|y| whitened(y).norm_squared()).collect();
        self.p_sigma.axpy(sqrt(self.c_sigma * (2.0 - self.c_sigma) * self.mu_eff), &step, 1.0 - self.c_sigma);
        let length = self.p_sigma.norm();
        self.sigma *= exp(self.c_sigma / self.d_sigma * (length / self.chi - 1.0));

        let generations = (self.best.len() + 1) as f64;
        let settled = sqrt(1.0 - pow(1.0 - self.c_sigma, 2.0 * generations));
        let is_short = length / settled < (1.4 + 2.0 / (self.n + 1.0)) * self.chi;
        let (share, rest) = if is_short { (1.0, 0.0) } else { (0.0, self.c_c * (2.0 - self.c_c)) };
        self.p_c.axpy(share * sqrt(self.c_c * (2.0 - self.c_c) * self.mu_eff), &y_w, 1.0 - self.c_c);
        let kept = 1.0 + self.c_1 * rest - self.c_1 - self.c_mu * self.w.iter().sum::<f64>();
        self.c.ger(self.c_1, &self.p_c, &self.p_c, kept);
        for ((w, y), square) in self.w.iter().zip(&y).zip(squares) {
            // Equation (46). If the objective is flat, all points can be at the mean, and the square is then 0.
            let w = if *w >= 0.0 { *w } else { w * self.n / square.max(f64::MIN_POSITIVE) };
            self.c.ger(self.c_mu * w, y, y, 1.0);
        }
        // If the eigenvalues cannot be computed, for example because elements are not finite, this search ends.
        match self.c.clone().try_symmetric_eigen(f64::EPSILON, MAX_SWEEPS * self.m.len()) {
            Some(eigen) => {
                self.b = eigen.eigenvectors;
                self.d = eigen.eigenvalues.map(|value| sqrt(value.max(f64::MIN_POSITIVE)));
            }
            None => self.sigma = 0.0,
        }

        self.best.push(objectives[order[0]]);
        self.median.push(objectives[order[order.len() / 2]]);
        self.spread = objectives[order[order.len() - 1]] - objectives[order[0]];
    }

    /// Applies the criteria ConditionCov, TolFun, Stagnation, TolX and TolXUp of appendix B.3. NoEffectAxis and
    /// NoEffectCoord are equivalent to TolX if all parameters are shares of a range.
    fn has_converged(&self) -> bool {
        let last = 10 + (30.0 * self.n / self.w.len() as f64).ceil() as usize;
        let recent = &self.best[self.best.len().saturating_sub(last)..];
        let (low, high) = recent.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let is_flat = recent.len() == last && high - low < CONVERGED && self.spread < CONVERGED;
        let shortest = (120.0 + 30.0 * self.n / self.w.len() as f64).ceil() as usize;
        let window = (self.best.len() / 5).max(shortest);
        let stagnates = [&self.best, &self.median].iter().all(|history| is_no_better(history, window));
        let width = self.sigma * self.d.max().max(self.p_c.amax()) / self.first_sigma;
        let is_out_of_scale = !(CONVERGED..DIVERGED).contains(&width);
        is_flat || stagnates || is_out_of_scale || pow(self.d.max() / self.d.min(), 2.0) > MAX_CONDITION
    }
}

/// True if, among the last generations, the median of the newest 30 % is no better than the median of the oldest 30 %.
fn is_no_better(history: &[f64], window: usize) -> bool {
    let median = |values: &[f64]| values[ranking(values)[values.len() / 2]];
    let Some(start) = history.len().checked_sub(window) else { return false };
    let (recent, share) = (&history[start..], window * 3 / 10);
    median(&recent[window - share..]) >= median(&recent[..share])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflection() {
        // The tolerance covers rounding errors only.
        for (x, expected) in [(0.3, 0.3), (-0.3, 0.3), (1.3, 0.7), (2.3, 0.3), (-1.3, 0.7), (0.0, 0.0), (1.0, 1.0)] {
            assert!((mirror(x) - expected).abs() < 1e-15, "{x}");
        }
    }

    /// Reference: the class `CMA` of the Python package cmaes 0.13.1 with the same five populations of eight points.
    /// Its `_EPS` in equation (46) is set to 0. Its criterion for a short path of the step size counts one generation
    /// more, which has no effect here. The remaining differences are rounding errors.
    #[test]
    fn five_populations_move_the_distribution_as_in_another_implementation() {
        let mut state = 1_u32;
        let mut coordinate = |_, _| {
            state = state.wrapping_mul(1_103_515_245).wrapping_add(12_345) % (1 << 31);
            2.0 * f64::from(state) / f64::from(1_u32 << 31) - 0.5
        };
        let rosenbrock = |x: &DVector<f64>| {
            let x: Vec<f64> = x.iter().map(|v| 4.0 * v - 2.0).collect();
            x.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum::<f64>()
        };
        let mut strategy = Strategy::new(3, 8, 0.3);
        for _ in 0..5 {
            let points: Vec<_> = (0..8).map(|_| DVector::from_fn(3, &mut coordinate)).collect();
            strategy.update(&points, &points.iter().map(rosenbrock).collect::<Vec<_>>());
        }
        let found =
            [strategy.m.as_slice(), strategy.p_sigma.as_slice(), strategy.p_c.as_slice(), strategy.c.as_slice()];
        let expected = [
            [0.485_853_328_439_893_4, 0.333_670_477_908_972_75, 1.049_671_299_754_983_5],
            [-0.515_722_869_135_932_8, -1.305_169_579_884_148_5, 1.014_623_644_975_085_8],
            [-0.315_288_901_996_086_3, -1.692_817_461_460_233_4, 0.010_258_007_227_137_1],
            [0.922_173_290_259_232_7, 0.175_594_542_495_756_2, 0.205_810_738_192_490_74],
            [0.175_594_542_495_756_2, 1.225_283_181_060_843, 0.359_592_264_840_372_43],
            [0.205_810_738_192_490_74, 0.359_592_264_840_372_43, 1.777_083_872_105_798_9],
        ];
        for (found, expected) in found.concat().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!((strategy.sigma - 0.389_934_908_639_413_6).abs() < 1e-12, "{}", strategy.sigma);
    }

    /// Computed by hand: of ten values, the medians of the first three and of the last three are compared.
    #[test]
    fn a_history_that_does_not_fall_stagnates() {
        let falling = [9.0, 8.0, 8.0, 5.0, 5.0, 5.0, 5.0, 7.0, 7.0, 9.0];
        assert!(!is_no_better(&falling, 10) && !is_no_better(&falling, 11));
        assert!(is_no_better(&[7.0, 9.0, 9.0, 5.0, 5.0, 5.0, 5.0, 9.0, 9.0, 7.0], 10));
        assert!(is_no_better(&falling, 5));
    }

    /// With 20,000 numbers, the standard errors of mean and variance are 0.007 and 0.01; four standard errors are
    /// allowed.
    #[test]
    fn numbers_are_normal() {
        let z = normal(&mut Random::new(1, 0, 0), 20_000);
        let mean = z.mean();
        let variance = z.map(|z| z * z).mean() - mean * mean;
        assert!(mean.abs() < 0.028 && (variance - 1.0).abs() < 0.04, "{mean} {variance}");
    }
}
