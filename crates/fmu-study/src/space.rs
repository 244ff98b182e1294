//! Parameters and their ranges.

/// A parameter of a component and the range it is searched in.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Parameter {
    /// `component:parameter`.
    pub name: String,
    /// Name in constraints, if it has one.
    pub symbol: Option<String>,
    /// Unit of measure.
    pub unit: Option<String>,
    /// Lower bound.
    pub min: f64,
    /// Upper bound, above the lower one.
    pub max: f64,
    /// True for a logarithmic scale: equal shares of the range are then equal ratios instead of equal differences, and
    /// both bounds are above 0.
    pub log: bool,
}

impl Parameter {
    /// Name of the component and of its parameter.
    pub fn component_and_name(&self) -> (&str, &str) {
        self.name.split_once(':').unwrap_or(("", &self.name))
    }

    /// Value at a share of the range, from 0 to 1. The shares 0 and 1 give exactly the bounds.
    pub fn at(&self, share: f64) -> f64 {
        let value = if self.log {
            self.min * libm::pow(self.max / self.min, share)
        } else {
            self.min + (self.max - self.min) * share
        };
        // Rounding could give a value outside the range.
        if share >= 1.0 { self.max } else { value.clamp(self.min, self.max) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(min: f64, max: f64, log: bool) -> Parameter {
        Parameter { name: "a:b".into(), symbol: None, unit: None, min, max, log }
    }

    #[test]
    fn shares_of_a_range() {
        let linear = parameter(-3.0, 0.1, false);
        assert_eq!([linear.at(0.0), linear.at(1.0)], [-3.0, 0.1]);
        assert!((linear.at(0.5) + 1.45).abs() < 1e-15);
        let log = parameter(0.01, 100.0, true);
        assert_eq!([log.at(0.0), log.at(1.0)], [0.01, 100.0]);
        // The power and the product are each rounded once.
        assert!((log.at(0.5) - 1.0).abs() < 1e-15);
        assert_eq!(linear.component_and_name(), ("a", "b"));
    }
}
