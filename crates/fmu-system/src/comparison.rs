//! Comparison of a simulated signal with a reference, such as a measured one.
//!
//! The metrics compare the samples of the reference with the simulation at the same times. The simulation is linear
//! between its rows; neither signal is resampled, and nothing is aligned. All samples have equal weights.

use std::collections::{BTreeMap, VecDeque};

/// Largest variation of a constant signal, relative to its greatest magnitude.
const CONSTANT: f64 = 1e-12;

/// A comparison. Values are in the unit of both signals, times in s.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparison {
    /// Interval of the reference, ends included; `None` for all samples.
    pub window: Option<[f64; 2]>,
    /// Tolerance of `share_within` for a sample `y`: its parts in absolute + relative · |y|, 1 for 100 %.
    pub tolerance: Option<[f64; 2]>,
    /// Tube around the reference.
    pub tube: Option<Tube>,
    /// Largest time shift that is tried; `None` for no `shift`.
    pub max_shift: Option<f64>,
}

/// Half width and half height of a tube around the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tube {
    /// Half width in s, half height.
    Size(f64, f64),
    /// Both relative to the extent of the reference.
    Relative(f64),
}

/// Samples of a signal: times in s, nondecreasing, and values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Samples<'a> {
    /// Times, s.
    pub times: &'a [f64],
    /// Values.
    pub values: &'a [f64],
}

/// Values by the name of the metric; `None` if a metric does not exist, for example the correlation with a constant.
pub type Metrics = BTreeMap<&'static str, Option<f64>>;

impl Samples<'_> {
    /// The value at a time, linear between samples and constant beyond them; at a jump, the later value.
    fn at(&self, time: f64) -> f64 {
        let after = self.times.partition_point(|sample| *sample <= time);
        let (Some(before), true) = (after.checked_sub(1), after < self.times.len()) else {
            return self.values[after.min(self.values.len() - 1)];
        };
        let [from, to] = [before, after].map(|index| (self.times[index], self.values[index]));
        if time == from.0 { from.1 } else { from.1 + (to.1 - from.1) * ((time - from.0) / (to.0 - from.0)) }
    }
}

impl Comparison {
    /// Compares a simulation with a reference. Only samples of the reference count that are in the window and not
    /// outside the simulation; with fewer than two, all metrics but `samples` are `None`.
    pub fn metrics(&self, simulated: Samples<'_>, reference: Samples<'_>) -> Metrics {
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        let (run, window) = (range(simulated.times), self.window.unwrap_or(all));
        let from = reference.times.partition_point(|time| *time < window[0].max(run[0]));
        let to = reference.times.partition_point(|time| *time <= window[1].min(run[1])).max(from);
        let (t, y) = (&reference.times[from..to], &reference.values[from..to]);
        let mut all = Metrics::from([("samples", Some(t.len() as f64))]);
        let s: Vec<f64> = t.iter().map(|time| simulated.at(*time)).collect();
        let e: Vec<f64> = s.iter().zip(y).map(|(s, y)| s - y).collect();
        let count = t.len() as f64;
        let mut add = |name, value: Option<f64>| all.insert(name, value.filter(|_| t.len() > 1));
        let square_mean = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>() / count;
        let (bias, rmse) = (mean(&e), square_mean(&e).sqrt());
        let deviations: Vec<f64> = e.iter().map(|e| e - bias).collect();
        add("bias", Some(bias));
        add("mae", Some(e.iter().map(|e| e.abs()).sum::<f64>() / count));
        add("rmse", Some(rmse));
        add("deviation", Some(square_mean(&deviations).sqrt()));
        let max_error = e.iter().fold(0.0, |max: f64, e| max.max(e.abs()));
        add("max_error", Some(max_error));
        add("max_error_time", e.iter().position(|e| e.abs() == max_error).map(|index| t[index]));
        let [least, most] = range(y);
        let varies = !is_constant(y);
        add("nrmse_range", varies.then(|| rmse / (most - least)));
        add("nrmse_q95", quantile(y, 0.95).filter(|q| *q > 0.0).map(|q| rmse / q));
        let about_mean: Vec<f64> = y.iter().map(|value| value - mean(y)).collect();
        let unexplained = varies.then(|| square_mean(&e) / square_mean(&about_mean));
        add("r2", unexplained.map(|share| 1.0 - share));
        add("fit", unexplained.map(|share| 1.0 - share.sqrt()));
        add("correlation", pearson(y, &s));
        add("shift", self.max_shift.filter(|_| t.len() > 1).and_then(|max| shift(t, y, &s, max)));
        let share = |inside: &dyn Fn(usize) -> bool| (0..t.len()).filter(|i| inside(*i)).count() as f64 / count;
        let within =
            self.tolerance.map(|[absolute, relative]| share(&|i| e[i].abs() <= absolute + relative * y[i].abs()));
        add("share_within", within);
        let size = self.tube.map(|tube| match tube {
            Tube::Size(width, height) => (width, height),
            Tube::Relative(part) => (part * range(t).iter().fold(0.0, |a, b| b - a), part * (most - least)),
        });
        let beyond = size.map(|(width, height)| excess(Samples { times: t, values: y }, &s, width, height));
        add("tube_share", beyond.as_ref().map(|beyond| share(&|i| beyond[i] <= 0.0)));
        add("tube_excess", beyond.as_ref().map(|beyond| beyond.iter().copied().fold(0.0, f64::max)));
        add("tube_exit", beyond.and_then(|beyond| Some(t[beyond.iter().position(|beyond| *beyond > 0.0)?])));
        all
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The least and the greatest value; infinity and minus infinity if there is none.
fn range(values: &[f64]) -> [f64; 2] {
    [values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
}

fn is_constant(values: &[f64]) -> bool {
    let [least, most] = range(values);
    most - least <= CONSTANT * least.abs().max(most.abs())
}

/// Quantile of the magnitudes, linear between order statistics.
fn quantile(values: &[f64], part: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    sorted.sort_by(f64::total_cmp);
    let place = part * (sorted.len().checked_sub(1)?) as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(low + (high - low) * place.fract())
}

/// Pearson's correlation coefficient; `None` if one of the signals is constant.
fn pearson(a: &[f64], b: &[f64]) -> Option<f64> {
    if is_constant(a) || is_constant(b) {
        return None;
    }
    let means = [mean(a), mean(b)];
    let [mut ab, mut aa, mut bb] = [0.0; 3];
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - means[0], b - means[1]);
        (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
    }
    Some(ab / (aa * bb).sqrt())
}

/// The time by which the simulation is late, s: the lag with the largest correlation, refined by a parabola through it
/// and its neighbors. `None` if the largest is at the limit or not above 0.
fn shift(t: &[f64], y: &[f64], s: &[f64], max_shift: f64) -> Option<f64> {
    let mut steps: Vec<f64> = t.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let step = 0.5 * (steps[(steps.len() - 1) / 2] + steps[steps.len() / 2]);
    if !(step > 0.0 && max_shift.is_finite()) {
        return None;
    }
    let count = ((t[t.len() - 1] - t[0]) / step + 1e-9).floor() as usize + 1;
    let [y, s] = [y, s].map(|values| {
        let samples = Samples { times: t, values };
        (0..count).map(|k| samples.at(t[0] + k as f64 * step)).collect::<Vec<f64>>()
    });
    let most = ((max_shift / step).round() as usize).min((count - 1) / 2);
    let correlation = |lag: usize| match lag.checked_sub(most) {
        Some(late) => pearson(&y[..count - late], &s[late..]),
        None => pearson(&y[most - lag..], &s[..count - (most - lag)]),
    };
    let all: Vec<Option<f64>> = (0..=2 * most).map(correlation).collect();
    let greatest = all.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
    let best = all.iter().position(|value| *value == Some(greatest))?;
    if most < 1 || greatest <= 0.0 || best == 0 || best == 2 * most {
        return None;
    }
    let (before, after) = (all[best - 1]?, all[best + 1]?);
    let curvature = before - 2.0 * greatest + after;
    let refined = if curvature == 0.0 { 0.0 } else { 0.5 * (before - after) / curvature };
    Some(step * (best as f64 - most as f64 + refined))
}

/// Distance of each sample of the simulation from the tube around the reference; 0 or negative inside it. The edges of
/// the tube are the extremes of the reference, linear between its samples, within the half width, plus the half height.
fn excess(reference: Samples<'_>, s: &[f64], width: f64, height: f64) -> Vec<f64> {
    let upper = highest(reference, width);
    let mirrored: Vec<f64> = reference.values.iter().map(|value| -value).collect();
    let lower = highest(Samples { values: &mirrored, ..reference }, width);
    let beyond = |((s, upper), lower): ((&f64, f64), f64)| (s - upper - height).max(-lower - height - s);
    s.iter().zip(upper).zip(lower).map(beyond).collect()
}

/// The greatest value of a signal within `width` of each of its samples.
fn highest(signal: Samples<'_>, width: f64) -> Vec<f64> {
    let Samples { times, values } = signal;
    // The samples in the interval that are greater than all later ones: the first is the greatest.
    let (mut greatest, mut next): (VecDeque<usize>, usize) = (VecDeque::new(), 0);
    let mut at = |time: f64| {
        while next < times.len() && times[next] <= time + width {
            while greatest.back().is_some_and(|last| values[*last] <= values[next]) {
                greatest.pop_back();
            }
            greatest.push_back(next);
            next += 1;
        }
        while greatest.front().is_some_and(|first| times[*first] < time - width) {
            greatest.pop_front();
        }
        let inside = greatest.front().map_or(f64::NEG_INFINITY, |first| values[*first]);
        inside.max(signal.at(time - width)).max(signal.at(time + width))
    };
    times.iter().map(|time| at(*time)).collect()
}
