//! Units of measure. [`unit!`](crate::unit!) parses them at compile time.

/// A unit in which a tool can display a value: `display value = factor * value + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `deg`.
    pub name: &'static str,
    /// Factor of the conversion.
    pub factor: f64,
    /// Offset of the conversion.
    pub offset: f64,
}

/// A unit of measure: `SI value = factor * value + offset`.
///
/// [`unit!`](crate::unit!) provides the usual units. To define another unit:
///
/// ```
/// use fmu::Unit;
/// const FURLONG: Unit = Unit { name: "furlong", factor: 201.168, rate: None, display: &[], ..fmu::unit!("m") };
/// assert_eq!(FURLONG.exponents, fmu::unit!("m").exponents);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name in the model description, for example `rad/s`.
    pub name: &'static str,
    /// Exponents of kg, m, s, A, K, mol, cd and rad, in the order of the FMI standard.
    pub exponents: [i8; 8],
    /// Factor of the conversion; 1 for coherent units.
    pub factor: f64,
    /// Offset of the conversion; 0 except for temperatures.
    pub offset: f64,
    /// Units in which values may be displayed.
    pub display: &'static [DisplayUnit],
    /// The unit of the time derivative; `None` if it is undeclared.
    pub rate: Option<&'static Unit>,
}

impl Unit {
    /// Dimensionless.
    pub const ONE: Self =
        Self { name: "1", display: &[DisplayUnit { name: "%", factor: 100.0, offset: 0.0 }], ..Self::NONE };
    /// Second.
    pub const S: Self = Self {
        name: "s",
        exponents: [0, 0, 1, 0, 0, 0, 0, 0],
        display: &[DisplayUnit { name: "ms", factor: 1e3, offset: 0.0 }],
        ..Self::NONE
    };
    /// For a variable whose unit depends on another variable or on the connected signal: declares no unit.
    pub const NONE: Self = Self { name: "", exponents: [0; 8], factor: 1.0, offset: 0.0, display: &[], rate: None };

    /// Returns true if the model description declares the unit.
    #[must_use]
    pub const fn is_declared(&self) -> bool {
        !self.name.is_empty()
    }

    /// A number with its unit, for messages.
    pub(crate) fn with(&self, value: f64) -> String {
        if self.is_declared() { format!("{value} {}", self.name) } else { format!("{value}") }
    }

    /// The unit of the time derivative.
    #[must_use]
    pub fn per_second(&self) -> Self {
        self.rate.copied().unwrap_or(Self::NONE)
    }

    /// The display unit with this name.
    #[must_use]
    pub fn display_unit(&self, name: &str) -> Option<DisplayUnit> {
        self.display.iter().find(|unit| unit.name == name).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit;

    #[test]
    fn a_number_is_shown_with_its_unit_if_it_has_one() {
        assert_eq!((unit!("m").with(0.5), Unit::NONE.with(0.5)), ("0.5 m".to_owned(), "0.5".to_owned()));
    }

    #[test]
    fn constants_equal_the_units_of_the_macro() {
        for (written, parsed) in [(Unit::ONE, unit!("1")), (Unit::S, unit!("s"))] {
            assert_eq!(written, Unit { rate: None, ..parsed });
        }
    }

    #[test]
    fn display_factors_are_those_of_the_definitions() {
        let factor = |unit: Unit, name| unit.display_unit(name).unwrap().factor;
        assert!((factor(unit!("rad"), "deg") * std::f64::consts::PI - 180.0).abs() < 1e-13);
        assert_eq!(factor(unit!("m/s"), "km/h"), 3.6);
        assert!((factor(unit!("N/rad"), "kN/deg") * 1e3 * 180.0 / std::f64::consts::PI - 1.0).abs() < 1e-15);
        let celsius = unit!("K").display_unit("degC").unwrap();
        assert_eq!((celsius.factor, celsius.offset), (1.0, -273.15));
        assert_eq!(unit!("m").display_unit("deg"), None);
    }
}
