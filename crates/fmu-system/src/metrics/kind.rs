//! Kinds of metrics: how the rows of a signal become a number.

use super::spectrum::spectrum;
use super::{Summation, interval, sum};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Computation of a metric from the n rows x\[0\] … x\[n-1\] of its window, at the times t\[0\] … t\[n-1\].
///
/// n is at least 1. Where an entry says so, there may be no number ("undefined"). Rows that are not finite are an
/// error. Sums are rounded once ([`Summation::Exact`]).
///
/// The unit of the number is that of the signal unless an entry says otherwise, see [`Kind::unit`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "MetricKind")]
pub enum Kind {
    /// Root mean square: sqrt(sum(x\[i\]^2)/n).
    Rms,
    /// Mean square: sum(x\[i\]^2)/n. Unit: square of the signal's.
    MeanSquare,
    /// Largest magnitude: max |x\[i\]|.
    Peak,
    /// Largest value.
    Max,
    /// Smallest value.
    Min,
    /// Mean: sum(x\[i\])/n.
    Mean,
    /// Last value: x\[n-1\].
    Final,
    /// Largest minus smallest value.
    PeakToPeak,
    /// Standard deviation of the rows (divided by n): sqrt(sum((x\[i\] - mean)^2)/n).
    Deviation,
    /// Number of rows whose value differs from that of the previous row. Unit: 1.
    Changes,
    /// Integral over time: sum(x\[i\]) dt with dt = (t\[n-1\] - t\[0\])/(n - 1). Each row counts for the interval dt,
    /// the last one too. An error for a single row. Unit: that of the signal times s.
    Integral,
    /// Power in the band \[from, to): integral of the [power spectral density](super::spectrum()). An error for fewer
    /// than 18 rows. Unit: square of the signal's.
    BandPower,
    /// Time t\[i\] of the first row with x\[i\] > threshold. Undefined if there is none. Unit: s.
    Crossing,
    /// Time t\[i\] of the first row with |x\[i\]| > threshold. Undefined if there is none. Unit: s.
    MagnitudeCrossing,
    /// Share of the rows with x\[i\] > threshold, 0 to 1. Unit: 1.
    Share,
    /// Share of the rows with x\[i\] < threshold, 0 to 1. Unit: 1.
    ShareBelow,
    /// Share of the rows with |x\[i\]| > threshold, 0 to 1. Unit: 1.
    MagnitudeShare,
    /// Largest excess of the signal over its last value, as a share of that: max(x\[i\]/x\[n-1\]) - 1. Undefined if the
    /// last value is 0. Unit: 1.
    Overshoot,
    /// Time t\[i\] - t\[0\] of the first row with x\[i\]/x\[n-1\] >= threshold. Undefined if there is none or the last
    /// value is 0. Unit: s.
    RiseTime,
    /// Time t\[i\] - t\[0\] of the first row from which on |x\[i\]/x\[n-1\] - 1| <= threshold. Undefined if the last
    /// value is 0. Unit: s.
    SettlingTime,
}

impl Kind {
    /// Returns true if the kind refers to a threshold.
    pub fn has_threshold(self) -> bool {
        matches!(
            self,
            Self::Crossing
                | Self::MagnitudeCrossing
                | Self::Share
                | Self::ShareBelow
                | Self::MagnitudeShare
                | Self::RiseTime
                | Self::SettlingTime
        )
    }

    /// The formula in words.
    pub fn formula(self) -> &'static str {
        match self {
            Self::Rms => "square root of the mean of the squares",
            Self::MeanSquare => "mean of the squares",
            Self::Peak => "largest magnitude",
            Self::Max => "largest value",
            Self::Min => "smallest value",
            Self::Mean => "mean",
            Self::Final => "last value",
            Self::PeakToPeak => "largest minus smallest value",
            Self::Deviation => "standard deviation about the mean",
            Self::Changes => "number of rows whose value differs from that of the row before",
            Self::Integral => "sum of the rows times their distance in time",
            Self::BandPower => "integral of the power spectral density over the band",
            Self::Crossing => "time of the first row above the threshold",
            Self::MagnitudeCrossing => "time of the first row whose magnitude is above the threshold",
            Self::Share => "share of the rows above the threshold",
            Self::ShareBelow => "share of the rows below the threshold",
            Self::MagnitudeShare => "share of the rows whose magnitude is above the threshold",
            Self::Overshoot => "largest value as a share of the last one, minus 1",
            Self::RiseTime => {
                "time from the first row to the first one that reaches the threshold, a share of the last value"
            }
            Self::SettlingTime => {
                "time from the first row until the deviations from the last value stay within the threshold, a share of that value"
            }
        }
    }

    /// Returns true if the number follows from the values alone, without times or settings, and is always defined.
    pub fn needs_only_values(self) -> bool {
        self.of_values(&[0.0], Summation::InOrder).is_some()
    }

    /// Returns true if the kind has running values: for each row of a window, the value for the part of the window that
    /// ends at this row.
    pub fn has_running_values(self) -> bool {
        matches!(self, Self::Rms | Self::Mean | Self::Integral)
    }

    /// Unit of measure of the number for a signal in a unit; `None` if unknown.
    pub fn unit(self, of_signal: Option<&str>) -> Option<String> {
        match self {
            Self::Crossing | Self::MagnitudeCrossing | Self::RiseTime | Self::SettlingTime => Some("s".into()),
            Self::Share | Self::ShareBelow | Self::MagnitudeShare | Self::Changes | Self::Overshoot => Some("1".into()),
            // m/s2 becomes m/s, m/s becomes m, N becomes N.s
            Self::Integral => of_signal.map(|unit| match (unit.strip_suffix("/s2"), unit.strip_suffix("/s")) {
                (Some(rest), _) => format!("{rest}/s"),
                (None, Some(rest)) => rest.to_string(),
                (None, None) => format!("{unit}.s"),
            }),
            Self::BandPower | Self::MeanSquare => of_signal.map(|unit| format!("({unit})2")),
            _ => of_signal.map(str::to_string),
        }
    }

    /// Computes the number of a signal; `None` for kinds that [need more](Self::needs_only_values), without values, or
    /// if a value is not finite.
    pub fn of_values(self, values: &[f64], summation: Summation) -> Option<f64> {
        let last = *values.last()?;
        if values.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let squares = || summation.mean(values.iter().map(|x| x * x));
        Some(match self {
            Self::MeanSquare => squares(),
            Self::Rms => squares().sqrt(),
            Self::Peak => largest(values.iter().map(|x| x.abs())),
            Self::Max => largest(values.iter().copied()),
            Self::Min => smallest(values),
            Self::Mean => summation.mean(values.iter().copied()),
            Self::Final => last,
            Self::PeakToPeak => largest(values.iter().copied()) - smallest(values),
            Self::Deviation => {
                let mean = summation.mean(values.iter().copied());
                summation.mean(values.iter().map(|x| (x - mean) * (x - mean))).sqrt()
            }
            Self::Changes => values.windows(2).filter(|pair| pair[1] - pair[0] != 0.0).count() as f64,
            _ => return None,
        })
    }

    /// Computes the number of a signal; `Ok(None)` if it is undefined.
    pub(super) fn of_rows(
        self,
        times: &[f64],
        values: &[f64],
        threshold: Option<f64>,
        band: Option<[f64; 2]>,
    ) -> Result<Option<f64>, String> {
        if values.is_empty() {
            return Err("the window contains no recorded row".to_owned());
        }
        if let Some(number) = self.of_values(values, Summation::Exact) {
            return Ok(Some(number));
        }
        let threshold = match threshold {
            None if self.has_threshold() => return Err("this kind needs a threshold".to_owned()),
            given => given.unwrap_or_default(),
        };
        let share = |is_inside: &dyn Fn(f64) -> bool| {
            let inside = values.iter().filter(|x| is_inside(**x)).count();
            Some(inside as f64 / values.len() as f64)
        };
        let first = |is_reached: &dyn Fn(f64) -> bool| values.iter().position(|x| is_reached(*x)).map(|row| times[row]);
        // Numbers relative to a last value of 0 are undefined.
        let last = values.last().copied().filter(|last| *last != 0.0);
        Ok(match self {
            Self::Integral => Some(sum::exact(values.iter().copied()) * interval(times)?),
            Self::BandPower => Some(spectrum(times, values)?.power(band.ok_or("this kind needs a band")?)),
            Self::Crossing => first(&|x| x > threshold),
            Self::MagnitudeCrossing => first(&|x| x.abs() > threshold),
            Self::Share => share(&|x| x > threshold),
            Self::ShareBelow => share(&|x| x < threshold),
            Self::MagnitudeShare => share(&|x| x.abs() > threshold),
            Self::Overshoot => last.map(|last| largest(values.iter().map(|x| x / last)) - 1.0),
            Self::RiseTime => last.and_then(|last| first(&|x| x / last >= threshold)).map(|time| time - times[0]),
            Self::SettlingTime => last.and_then(|last| {
                let outside = values.iter().rposition(|x| (x / last - 1.0).abs() > threshold);
                times.get(outside.map_or(0, |row| row + 1)).map(|time| time - times[0])
            }),
            _ => None,
        })
    }

    /// Computes the number of the window up to each row, summed in order; `None` for kinds without running values.
    pub(super) fn running(self, times: &[f64], values: &[f64]) -> Result<Option<Vec<f64>>, String> {
        let sums = |of: &dyn Fn(f64) -> f64, shown: &dyn Fn(f64, usize) -> f64| {
            let mut sum = 0.0;
            let running = values.iter().enumerate().map(|(row, x)| {
                sum += of(*x);
                shown(sum, row + 1)
            });
            Some(running.collect())
        };
        Ok(match self {
            Self::Mean => sums(&|x| x, &|sum, count| sum / count as f64),
            Self::Rms => sums(&|x| x * x, &|sum, count| (sum / count as f64).sqrt()),
            Self::Integral => {
                let interval = interval(times)?;
                sums(&|x| x, &|sum, _| sum * interval)
            }
            _ => None,
        })
    }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, |largest, x| if x > largest { x } else { largest })
}

fn smallest(values: &[f64]) -> f64 {
    -largest(values.iter().map(|x| -x))
}
