//! Values between rows.

/// The point where a signal reaches a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    /// Interpolated time, s.
    pub(crate) time: f64,
    /// The first row at or above the level.
    pub(crate) row: usize,
}

/// Finds the first row k > `from` with x\[k-1\] < level <= x\[k\].
pub(crate) fn up(times: &[f64], x: &[f64], level: f64, from: usize) -> Option<Crossing> {
    let row = (from.saturating_add(1)..x.len()).find(|k| x[k - 1] < level && level <= x[*k])?;
    let share = (level - x[row - 1]) / (x[row] - x[row - 1]);
    Some(Crossing { time: times[row - 1] + share * (times[row] - times[row - 1]), row })
}

/// Value at a time, interpolated linearly; `None` outside the recorded times.
pub(crate) fn at(times: &[f64], x: &[f64], time: f64) -> Option<f64> {
    let (first, last) = (*times.first()?, *times.last()?);
    if !(first..=last).contains(&time) {
        return None;
    }
    let after = times.partition_point(|t| *t <= time);
    if after == times.len() {
        return x.last().copied();
    }
    let share = (time - times[after - 1]) / (times[after] - times[after - 1]);
    Some(x[after - 1] + share * (x[after] - x[after - 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
    const X: [f64; 4] = [0.0, 2.0, 1.0, 3.0];

    /// Expected values computed by hand.
    #[test]
    fn levels_are_reached_between_rows() {
        assert_eq!(up(&TIMES, &X, 0.5, 0), Some(Crossing { time: 1.25, row: 1 }));
        assert_eq!(up(&TIMES, &X, 2.0, 0), Some(Crossing { time: 2.0, row: 1 }));
        assert_eq!(up(&TIMES, &X, 2.0, 1), Some(Crossing { time: 3.5, row: 3 }));
        assert_eq!(up(&TIMES, &X, 4.0, 0), None);
        assert_eq!(up(&TIMES, &X, 0.0, 0), None);
        assert_eq!(up(&TIMES, &X, 1.0, 9), None);
        assert_eq!(up(&[], &[], 1.0, 0), None);
    }

    #[test]
    fn values_are_linear_between_rows() {
        for (time, expected) in [(1.0, 0.0), (1.5, 1.0), (2.0, 2.0), (3.75, 2.5), (4.0, 3.0)] {
            assert_eq!(at(&TIMES, &X, time), Some(expected));
        }
        for time in [0.999, 4.001, f64::NAN] {
            assert_eq!(at(&TIMES, &X, time), None);
        }
        assert_eq!(at(&[], &[], 1.0), None);
        assert_eq!(at(&[1.0], &[5.0], 1.0), Some(5.0));
    }
}
