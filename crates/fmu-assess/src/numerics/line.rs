//! Straight lines.

use super::mean;

/// The line y = intercept + slope x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
}

impl Line {
    /// Least-squares line of y over x; `None` without two different x.
    pub(crate) fn fit(x: &[f64], y: &[f64]) -> Option<Self> {
        let (x_mean, y_mean) = (mean(x)?, mean(y)?);
        let (mut squares, mut products) = (0.0, 0.0);
        for (x, y) in x.iter().zip(y) {
            squares += (x - x_mean) * (x - x_mean);
            products += (x - x_mean) * (y - y_mean);
        }
        let slope = products / squares;
        (squares > 0.0).then_some(Self { slope, intercept: y_mean - slope * x_mean })
    }

    pub(crate) fn at(self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found() {
        let line = Line::fit(&[1.0, 2.0, 4.0], &[3.0, 5.0, 9.0]).unwrap();
        assert!((line.slope - 2.0).abs() < 1e-15 && (line.at(0.0) - 1.0).abs() < 1e-14);
    }

    /// F. J. Anscombe, "Graphs in Statistical Analysis", The American Statistician 27, 1973: y = 3.00 + 0.500 x.
    #[test]
    fn a_published_data_set() {
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
        let line = Line::fit(&x, &y).unwrap();
        assert!((line.slope - 0.5).abs() < 5e-4 && (line.intercept - 3.0).abs() < 5e-3, "{line:?}");
    }

    #[test]
    fn a_point_is_not_a_line() {
        assert_eq!(Line::fit(&[], &[]), None);
        assert_eq!(Line::fit(&[1.0, 1.0], &[1.0, 2.0]), None);
        assert_eq!(Line::fit(&[1.0, f64::NAN], &[1.0, 2.0]), None);
    }
}
