//! The rows of a trace.

use crate::metric::Reason;
use crate::trace::Trace;

/// Largest deviation of a row from an even grid, relative to the step. It allows for rounded times and clock jitter.
pub(crate) const UNEVENNESS: f64 = 0.5;

/// Fraction of a step by which a time can exceed a limit, because times are rounded.
const SLACK: f64 = 1e-6;

pub(crate) fn no_rows() -> Reason {
    "the recording has no rows".to_owned()
}

/// A trace whose times are finite, increasing and evenly spaced.
pub(crate) struct Rows<'a> {
    trace: &'a Trace<'a>,
    pub(crate) times: &'a [f64],
    /// Mean time h between rows, s.
    pub(crate) step: f64,
    /// Sampling rate 1/h, rounded to 0.001 Hz.
    pub(crate) rate: f64,
}

impl<'a> Rows<'a> {
    /// Checks the times.
    pub(crate) fn new(trace: &'a Trace<'a>) -> Result<Self, Reason> {
        let times = trace.times();
        let &[first, .., last] = times else {
            let count = if times.is_empty() { "no rows" } else { "one row" };
            return Err(format!("the recording has {count}; at least two are needed"));
        };
        if let Some(row) = times.iter().position(|time| !time.is_finite()) {
            return Err(format!("the time of row {} is not a finite number", row + 1));
        }
        if let Some(row) = times.windows(2).position(|pair| pair[0] >= pair[1]) {
            let (before, after) = (times[row], times[row + 1]);
            return Err(format!(
                "the times must increase: row {} is at {after} s, the previous row at {before} s",
                row + 2
            ));
        }
        let step = (last - first) / (times.len() - 1) as f64;
        let grid = |row: usize| first + row as f64 * step;
        if let Some(row) = (0..times.len()).find(|row| (times[*row] - grid(*row)).abs() > UNEVENNESS * step) {
            return Err(format!(
                "the rows are not evenly spaced: row {} is at {} s, expected at {:.6} s",
                row + 1,
                times[row],
                grid(row)
            ));
        }
        let rate = (1000.0 / step + 0.5).floor() / 1000.0;
        if rate <= 0.0 || !rate.is_finite() {
            return Err(format!("rows at a distance of {step} s have no usable sampling rate"));
        }
        Ok(Self { trace, times, step, rate })
    }

    /// A column of finite numbers.
    pub(crate) fn column(&self, name: &str) -> Result<&'a [f64], Reason> {
        let column = self.trace.column(name);
        let column = column.ok_or_else(|| format!("the recording has no column `{name}`"))?;
        match column.iter().position(|value| !value.is_finite()) {
            Some(row) => Err(format!("`{name}` is not a finite number at {} s", self.times[row])),
            None => Ok(column),
        }
    }

    /// Returns true if the recording has the column, even without values.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.trace.column(name).is_some()
    }

    /// The columns `group.*`: place and full name.
    pub(crate) fn places(&self, group: &str) -> Vec<(&'a str, &'a str)> {
        let place = |name: &'a str| Some((name.strip_prefix(group)?.strip_prefix('.')?, name));
        self.trace.names().filter_map(place).collect()
    }

    /// Number of rows in a span of time, s, rounded.
    pub(crate) fn count(&self, span: f64) -> usize {
        (span * self.rate + 0.5).floor() as usize
    }

    /// True for a time at or before a limit, with a tolerance for rounding.
    pub(crate) fn is_until(&self, time: f64, limit: f64) -> bool {
        time <= limit + SLACK * self.step
    }

    /// The first row at or after a time, with a tolerance for rounding; the number of rows if there is none.
    pub(crate) fn first_from(&self, begin: f64) -> usize {
        self.times.partition_point(|time| *time < begin - SLACK * self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(times: &[f64]) -> String {
        Rows::new(&Trace::new(times)).err().map(|reason| reason.to_string()).unwrap_or_default()
    }

    #[test]
    fn the_rate_is_rounded() {
        let times: Vec<f64> = (1..=1000).map(|k| f64::from(k) / 333.333_4).collect();
        let trace = Trace::new(times);
        let rows = Rows::new(&trace).unwrap();
        assert_eq!(rows.rate, 333.333);
        assert_eq!(rows.count(0.2), 67);
        assert_eq!(rows.first_from(1.0), 333);
    }

    #[test]
    fn times_that_cannot_be_used_have_a_reason() {
        assert_eq!(reason(&[0.0, 0.1, 0.2]), "");
        // Clock jitter of a third of a step.
        assert_eq!(reason(&[0.0, 0.13, 0.17, 0.3]), "");
        for (times, expected) in [
            (&[][..], "the recording has no rows; at least two are needed"),
            (&[1.0], "the recording has one row; at least two are needed"),
            (&[0.0, f64::NAN], "the time of row 2 is not a finite number"),
            (&[0.0, 0.1, 0.1], "the times must increase: row 3 is at 0.1 s, the previous row at 0.1 s"),
            (&[0.0, 0.1, 0.2, 1.0], "the rows are not evenly spaced: row 2 is at 0.1 s, expected at 0.333333 s"),
            (&[0.0, 1e4], "rows at a distance of 10000 s have no usable sampling rate"),
        ] {
            assert_eq!(reason(times), expected);
        }
    }

    #[test]
    fn columns_are_finite() {
        let trace = Trace::new(vec![0.0, 0.1]).with("tire_load.fl", vec![1.0, f64::INFINITY]).unwrap();
        let rows = Rows::new(&trace).unwrap();
        assert_eq!(rows.column("a").unwrap_err().to_string(), "the recording has no column `a`");
        assert_eq!(
            rows.column("tire_load.fl").unwrap_err().to_string(),
            "`tire_load.fl` is not a finite number at 0.1 s"
        );
        assert_eq!(rows.places("tire_load"), [("fl", "tire_load.fl")]);
        assert!(rows.places("tire").is_empty());
    }
}
