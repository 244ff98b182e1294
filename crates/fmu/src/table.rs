//! Tables of a function of one variable.

/// Points of a function, linear in between and constant outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    x: Box<[f64]>,
    y: Box<[f64]>,
}

impl Table {
    /// A table from points with increasing `x`.
    ///
    /// # Errors
    /// There is no point, a number is not finite, or `x` does not increase.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Result<Self, String> {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        if x.is_empty() {
            return Err("a table needs at least one point".to_owned());
        }
        if let Some(i) = (0..x.len()).find(|&i| !(x[i].is_finite() && y[i].is_finite())) {
            return Err(format!("point {} of the table is ({}, {}); both must be finite", i + 1, x[i], y[i]));
        }
        if let Some(i) = (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
            return Err(format!("the first column of the table must increase, but {} follows {}", x[i], x[i - 1]));
        }
        Ok(Self { x: x.into(), y: y.into() })
    }

    /// Value and slope at `x`.
    #[must_use]
    pub fn at(&self, x: f64) -> (f64, f64) {
        let above = self.x.partition_point(|&point| point <= x);
        if above == 0 {
            return (self.y[0], 0.0);
        }
        let below = above - 1;
        if above == self.x.len() {
            return (self.y[below], 0.0);
        }
        let slope = (self.y[above] - self.y[below]) / (self.x[above] - self.x[below]);
        (self.y[below] + slope * (x - self.x[below]), slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_its_points_and_constant_outside() {
        let table = Table::new([(0.0, 1.0), (2.0, 5.0), (3.0, 4.0)]).unwrap();
        assert_eq!([-1.0, 0.0, 0.5, 2.0, 2.25, 9.0].map(|x| table.at(x).0), [1.0, 1.0, 2.0, 5.0, 4.75, 4.0]);
        assert_eq!([-1.0, 0.5, 2.25, 9.0].map(|x| table.at(x).1), [0.0, 2.0, -1.0, 0.0]);
    }

    #[test]
    fn impossible_tables_are_rejected() {
        assert_eq!(Table::new([]).unwrap_err(), "a table needs at least one point");
        let error = Table::new([(1.0, 0.0), (1.0, 2.0)]).unwrap_err();
        assert_eq!(error, "the first column of the table must increase, but 1 follows 1");
        let error = Table::new([(1.0, f64::NAN)]).unwrap_err();
        assert_eq!(error, "point 1 of the table is (1, NaN); both must be finite");
    }
}
