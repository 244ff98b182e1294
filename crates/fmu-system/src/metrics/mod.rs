//! Metrics: numbers, spectra and running values of recorded signals.
//!
//! This is the only implementation: scenarios, studies and Python use it. It needs no file, thread or foreign function.
//! The tests compare it with numpy and scipy (`python/tests/test_metrics.py`).
//!
//! A metric takes its signal from one column, or from several columns that are combined row by row. If requested, it
//! subtracts another column and the signal of the baseline's run. Then it converts the unit and computes the number of
//! its [`Kind`] over the rows of its window. A metric can also be an [`Expression`] of other metrics.

mod expression;
mod kind;
mod spectrum;
mod sum;

pub use expression::{Expression, ExpressionError, Problem};
pub use kind::Kind;
pub use spectrum::{Cross, Spectrum, Transfer, cross, spectrum};
pub use sum::Summation;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// A row that lies outside a window by less than this share of a step counts as inside, because the times t\[k\] =
/// start + k step are rounded.
const WINDOW_SLACK: f64 = 1e-6;

/// Columns of a recording by their index. A run need not have all of them.
pub type Columns<'a> = BTreeMap<usize, &'a [f64]>;

/// Definition of a metric: x = factor * signal + offset over the rows of a window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Definition {
    /// Indices of the columns; several are combined row by row.
    pub columns: Vec<usize>,
    /// Combination of the columns; `None` for a single one.
    pub combine: Option<Combine>,
    /// Weight of each column, for [`Combine::Squares`].
    pub weights: Vec<f64>,
    /// Kind of number computed from the rows.
    pub kind: Kind,
    /// Rows with from <= time <= to, s; `None`: all.
    pub window: Option<[f64; 2]>,
    /// Condition that ends the window early.
    pub until: Option<Until>,
    /// Index of the column that is subtracted first.
    pub minus: Option<usize>,
    /// True if the signal of the baseline's run is subtracted first. The metric is undefined for a case without a
    /// baseline.
    pub from_baseline: bool,
    /// Frequencies of [`Kind::BandPower`], Hz: from <= f < to.
    pub band: Option<[f64; 2]>,
    /// Level that the kind refers to, in the unit the signal is converted to.
    pub threshold: Option<f64>,
    /// Factor for the signal, after the subtractions.
    #[schemars(extend("default" = 1.0))]
    pub factor: f64,
    /// Offset, added after the multiplication.
    #[schemars(extend("default" = 0.0))]
    pub offset: f64,
}

/// Running values of a metric: for each row of its window, the value for the part of the window that ends at this row.
#[derive(Debug, Clone, PartialEq)]
pub struct Running {
    /// The rows.
    pub rows: Range<usize>,
    /// A value for each row.
    pub values: Vec<f64>,
}

/// Combination of several signals into one, row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Combine {
    /// The smallest.
    Min,
    /// The largest.
    Max,
    /// Root of the sum of the squares.
    Norm,
    /// Weighted sum of the squares.
    Squares,
}

/// Early end of a window: before the first row in which a signal is above or below a level. Without such a row, the
/// metric is undefined.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Until {
    /// Index of the column.
    pub column: usize,
    /// True for above the level, false for below.
    pub above: bool,
    /// Level, in the unit of the column.
    pub level: f64,
}

impl Definition {
    /// Indices of the columns that the metric needs.
    pub fn needed_columns(&self) -> impl Iterator<Item = usize> + use<'_> {
        let until = self.until.as_ref().map(|until| until.column);
        self.columns.iter().copied().chain(self.minus).chain(until)
    }

    /// Computes the metric of a run from its rows. `times` are rising, and `step` is the communication step, both in s.
    ///
    /// Returns `Ok(None)` if the number is undefined (see [`Kind`] and [`Until`]) or not finite, if a column is
    /// missing, or if there is no baseline.
    ///
    /// # Errors
    /// The window contains no row or a value that is not finite, the kind needs a threshold, a band or more rows, or a
    /// column has more or fewer rows than the times.
    pub fn value(
        &self,
        times: &[f64],
        columns: &Columns<'_>,
        baseline: Option<&Columns<'_>>,
        step: f64,
    ) -> Result<Option<f64>, String> {
        let is_present = self.needed_columns().all(|index| columns.contains_key(&index));
        let others = if self.from_baseline { baseline } else { None };
        let has_baseline = others.is_some_and(|others| self.columns.iter().all(|index| others.contains_key(index)));
        if !is_present || (self.from_baseline && !has_baseline) {
            return Ok(None);
        }
        let of_baseline = others.iter().flat_map(|others| others.values());
        for column in self.needed_columns().map(|index| &columns[&index]).chain(of_baseline) {
            same_length(column, times)?;
        }
        let mut rows = window(times, self.window, step);
        if let Some(until) = self.until.filter(|_| !rows.is_empty()) {
            let ends = |x: &f64| if until.above { *x > until.level } else { *x < until.level };
            let signal = columns[&until.column];
            let end = signal[rows.clone()].iter().position(ends).map(|row| rows.start + row);
            all_finite(signal, times, &(rows.start..end.unwrap_or(rows.end)))?;
            let Some(end) = end else { return Ok(None) };
            rows.end = end;
        }
        self.finite(columns, times, &rows)?;
        let mut values = self.combined(columns, &rows);
        if let Some(minus) = self.minus {
            all_finite(columns[&minus], times, &rows)?;
            subtract(&mut values, &columns[&minus][rows.clone()]);
        }
        if let Some(others) = others {
            self.finite(others, times, &rows)?;
            subtract(&mut values, &self.combined(others, &rows));
        }
        self.convert(&mut values);
        let number = self.kind.of_rows(&times[rows], &values, self.threshold, self.band)?;
        Ok(number.filter(|number| number.is_finite()))
    }

    /// Computes the running values: for each row of the metric's window, the metric over the part of the window that
    /// ends at this row.
    ///
    /// Returns `Ok(None)` if a column is missing, or if the run has fewer than two rows in the window.
    ///
    /// # Errors
    /// The kind has no running values, the window contains a value that is not finite, or a column has more or fewer
    /// rows than the times.
    pub fn running(&self, times: &[f64], columns: &Columns<'_>, step: f64) -> Result<Option<Running>, String> {
        if !self.kind.has_running_values() {
            return Err("this kind has no running values".to_owned());
        }
        let rows = window(times, self.window, step);
        if rows.len() < 2 || !self.columns.iter().all(|index| columns.contains_key(index)) {
            return Ok(None);
        }
        for index in &self.columns {
            same_length(columns[index], times)?;
        }
        self.finite(columns, times, &rows)?;
        let mut values = self.combined(columns, &rows);
        self.convert(&mut values);
        let running = self.kind.running(&times[rows.clone()], &values)?;
        Ok(running.map(|values| Running { rows, values }))
    }

    fn finite(&self, columns: &Columns<'_>, times: &[f64], rows: &Range<usize>) -> Result<(), String> {
        self.columns.iter().try_for_each(|index| all_finite(columns[index], times, rows))
    }

    fn combined(&self, columns: &Columns<'_>, rows: &Range<usize>) -> Vec<f64> {
        let of = |index: &usize| &columns[index][rows.clone()];
        let mut signals = self.columns.iter().map(of);
        let first = signals.next().unwrap_or_default().to_vec();
        let reduced = |choose: fn(f64, f64) -> f64| {
            signals.clone().fold(first.clone(), |mut chosen, signal| {
                chosen.iter_mut().zip(signal).for_each(|(x, other)| *x = choose(*x, *other));
                chosen
            })
        };
        match self.combine {
            None => first,
            Some(Combine::Min) => reduced(|a, b| if b < a { b } else { a }),
            Some(Combine::Max) => reduced(|a, b| if b > a { b } else { a }),
            Some(Combine::Norm) => {
                let mut sums = self.squares(columns, rows, std::iter::repeat(1.0));
                sums.iter_mut().for_each(|sum| *sum = sum.sqrt());
                sums
            }
            Some(Combine::Squares) => self.squares(columns, rows, self.weights.iter().copied()),
        }
    }

    fn squares(&self, columns: &Columns<'_>, rows: &Range<usize>, weights: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut sums = vec![0.0; rows.len()];
        for (index, weight) in self.columns.iter().zip(weights) {
            for (sum, x) in sums.iter_mut().zip(&columns[index][rows.clone()]) {
                *sum += weight * x * x;
            }
        }
        sums
    }

    fn convert(&self, values: &mut [f64]) {
        values.iter_mut().for_each(|x| *x = *x * self.factor + self.offset);
    }
}

fn subtract(values: &mut [f64], others: &[f64]) {
    values.iter_mut().zip(others).for_each(|(x, other)| *x -= other);
}

fn same_length(column: &[f64], times: &[f64]) -> Result<(), String> {
    if column.len() == times.len() {
        return Ok(());
    }
    Err(format!("a column has {} rows, the times have {}", column.len(), times.len()))
}

fn all_finite(column: &[f64], times: &[f64], rows: &Range<usize>) -> Result<(), String> {
    match rows.clone().find(|row| !column[*row].is_finite()) {
        Some(row) => Err(format!("a signal is {} at {} s", column[row], times[row])),
        None => Ok(()),
    }
}

/// Time between evenly spaced rows, s.
fn interval(times: &[f64]) -> Result<f64, String> {
    match times {
        [first, .., last] => Ok((last - first) / (times.len() - 1) as f64),
        _ => Err("a single row has no extent in time".to_owned()),
    }
}

/// Returns the rows in a window, both ends included, or all rows without a window. `times` are rising, and `step` is
/// the communication step, both in s.
pub fn window(times: &[f64], window: Option<[f64; 2]>, step: f64) -> Range<usize> {
    let Some([from, to]) = window else { return 0..times.len() };
    let slack = WINDOW_SLACK * step;
    let end = times.partition_point(|t| *t <= to + slack);
    times.partition_point(|t| *t < from - slack).min(end)..end
}

#[cfg(test)]
mod tests {
    use super::*;

    fn definition(kind: Kind) -> Definition {
        Definition {
            columns: vec![0],
            combine: None,
            weights: Vec::new(),
            kind,
            window: None,
            until: None,
            minus: None,
            from_baseline: false,
            band: None,
            threshold: None,
            factor: 1.0,
            offset: 0.0,
        }
    }

    #[test]
    fn windows_contain_both_ends() {
        let times = [0.0, 0.1, 0.2, 0.1 + 0.2, 0.4];
        assert!(times[3] > 0.3);
        assert_eq!(window(&times, Some([0.1, 0.3]), 0.1), 1..4);
        assert_eq!(window(&times, None, 0.1), 0..5);
        assert!(window(&times, Some([0.25, 0.28]), 0.1).is_empty());
        assert!(window(&times, Some([0.3, 0.1]), 0.1).is_empty());
    }

    /// Expected values computed by hand. They are exact: squares and a root of small numbers.
    #[test]
    fn kinds_of_values() {
        let values = [-4.0, 2.0, -2.0, 0.0];
        for (kind, expected) in [
            (Kind::MeanSquare, 6.0),
            (Kind::Rms, 6.0_f64.sqrt()),
            (Kind::Peak, 4.0),
            (Kind::Max, 2.0),
            (Kind::Min, -4.0),
            (Kind::Mean, -1.0),
            (Kind::Final, 0.0),
            (Kind::PeakToPeak, 6.0),
            (Kind::Deviation, 5.0_f64.sqrt()),
            (Kind::Changes, 3.0),
        ] {
            assert!(kind.needs_only_values());
            for summation in [Summation::Exact, Summation::InOrder] {
                assert_eq!(kind.of_values(&values, summation), Some(expected), "{kind:?}");
                assert_eq!(kind.of_values(&[], summation), None, "{kind:?}");
            }
        }
        assert_eq!(Kind::Overshoot.of_values(&values, Summation::Exact), None);
        for kind in [Kind::Peak, Kind::Changes, Kind::Final] {
            assert_eq!(kind.of_values(&[1.0, f64::NAN, 2.0], Summation::Exact), None, "{kind:?}");
        }
    }

    /// For every kind, a value that is not finite is an error within the window, and does not matter outside of it.
    #[test]
    fn a_value_that_is_not_finite_gives_no_number() {
        let times: Vec<f64> = (0..40).map(f64::from).collect();
        let fine: Vec<f64> = times.iter().map(|t| (0.7 * t).sin() + 2.0).collect();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut broken = fine.clone();
            broken[20] = bad;
            let columns = Columns::from([(0, broken.as_slice()), (1, &fine), (2, &broken)]);
            let is_error = |metric: &Definition| {
                let found = metric.value(&times, &columns, Some(&columns), 1.0);
                found == Err(format!("a signal is {bad} at 20 s"))
            };
            for kind in ALL_KINDS {
                let base = || Definition { threshold: Some(0.5), band: Some([0.0, 0.4]), ..definition(kind) };
                assert!(is_error(&base()), "{kind:?}");
                assert!(is_error(&Definition { columns: vec![1], minus: Some(2), ..base() }), "{kind:?}");
                for combine in [Combine::Min, Combine::Max, Combine::Norm, Combine::Squares] {
                    let metric = Definition { columns: vec![1, 0], combine: Some(combine), ..base() };
                    assert!(is_error(&Definition { weights: vec![1.0, 0.0], ..metric }), "{kind:?} {combine:?}");
                }
                let until = Until { column: 0, above: true, level: 1e9 };
                let metric = Definition { columns: vec![1], until: Some(until), ..base() };
                assert!(is_error(&metric) || bad == f64::INFINITY, "{kind:?}");
                let before = Definition { window: Some([0.0, 19.0]), ..base() };
                assert!(before.value(&times, &columns, None, 1.0).is_ok_and(|number| number.is_some()), "{kind:?}");
                let baseline = Columns::from([(1, broken.as_slice())]);
                let of_baseline = Definition { columns: vec![1], from_baseline: true, ..base() };
                assert!(of_baseline.value(&times, &columns, Some(&baseline), 1.0).is_err(), "{kind:?}");
                assert!(base().running(&times, &columns, 1.0).is_err(), "{kind:?}");
            }
        }
        // Finite values with an infinite metric: their squares are beyond the largest double.
        let huge = [1e300, 1e300];
        let columns = Columns::from([(0, huge.as_slice())]);
        assert_eq!(definition(Kind::MeanSquare).value(&[0.0, 1.0], &columns, None, 1.0), Ok(None));
    }

    const ALL_KINDS: [Kind; 20] = [
        Kind::Rms,
        Kind::MeanSquare,
        Kind::Peak,
        Kind::Max,
        Kind::Min,
        Kind::Mean,
        Kind::Final,
        Kind::PeakToPeak,
        Kind::Deviation,
        Kind::Changes,
        Kind::Integral,
        Kind::BandPower,
        Kind::Crossing,
        Kind::MagnitudeCrossing,
        Kind::Share,
        Kind::ShareBelow,
        Kind::MagnitudeShare,
        Kind::Overshoot,
        Kind::RiseTime,
        Kind::SettlingTime,
    ];

    /// The steps are in the documented order: combine, subtract, subtract the baseline, convert. Expected values
    /// computed by hand.
    #[test]
    fn a_signal_is_made_in_order() {
        let times = [0.0, 1.0, 2.0];
        let columns = Columns::from([(0, [3.0, 1.0, 0.0].as_slice()), (4, &[4.0, 5.0, 1.0]), (5, &[1.0, 2.0, 0.0])]);
        let baseline = Columns::from([(0, [3.0, 3.0, 0.0].as_slice()), (4, &[4.0, 4.0, 0.0])]);
        let of = |definition: &Definition| definition.value(&times, &columns, Some(&baseline), 1.0);
        let mut metric = Definition { columns: vec![0, 4], combine: Some(Combine::Norm), ..definition(Kind::Max) };
        metric.window = Some([0.0, 0.0]);
        assert_eq!(of(&metric), Ok(Some(5.0)));
        metric.minus = Some(5);
        assert_eq!(of(&metric), Ok(Some(4.0)));
        metric.from_baseline = true;
        assert_eq!(of(&metric), Ok(Some(-1.0)));
        (metric.factor, metric.offset) = (2.0, 10.0);
        assert_eq!(of(&metric), Ok(Some(8.0)));
        assert_eq!(metric.value(&times, &columns, None, 1.0), Ok(None));
        metric.minus = Some(6);
        assert_eq!(of(&metric), Ok(None));
    }

    #[test]
    fn columns_have_the_length_of_the_times() {
        let metric = Definition { from_baseline: true, ..definition(Kind::Mean) };
        let (long, short) = (Columns::from([(0, [1.0, 2.0].as_slice())]), Columns::from([(0, [1.0].as_slice())]));
        let expected = Err("a column has 1 rows, the times have 2".to_owned());
        assert_eq!(metric.value(&[0.0, 1.0], &long, Some(&short), 1.0), expected);
        assert_eq!(metric.value(&[0.0, 1.0], &short, Some(&long), 1.0), expected);
        assert_eq!(metric.running(&[0.0, 1.0], &short, 1.0).unwrap_err(), "a column has 1 rows, the times have 2");
    }

    #[test]
    fn units_follow_the_kind() {
        let unit = |kind: Kind, of: &str| kind.unit(Some(of)).unwrap();
        assert_eq!(unit(Kind::Integral, "m/s2"), "m/s");
        assert_eq!(unit(Kind::Integral, "m/s"), "m");
        assert_eq!(unit(Kind::Integral, "N"), "N.s");
        assert_eq!(unit(Kind::MeanSquare, "m/s2"), "(m/s2)2");
        assert_eq!(unit(Kind::Crossing, "m"), "s");
        assert_eq!(unit(Kind::Share, "m"), "1");
        assert_eq!(Kind::Rms.unit(None), None);
    }
}
