//! Units of measure with their SI exponents, and the units in which values may be displayed.

/// A unit in which a value may be shown: `display value = factor * value + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `deg`.
    pub name: &'static str,
    /// Display units per unit.
    pub factor: f64,
    /// Added after the factor.
    pub offset: f64,
}

/// Exponents of the SI base units and of the radian, in the order of the FMI standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Exponents {
    /// Kilogram.
    pub kg: i8,
    /// Meter.
    pub m: i8,
    /// Second.
    pub s: i8,
    /// Radian.
    pub rad: i8,
}

/// A unit of measure. All of them are coherent SI units but [`MPA`] and [`MPA_PER_S`], which carry a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name as it stands in the model description, for example `rad/s`.
    pub name: &'static str,
    /// Exponents of the base units.
    pub exponents: Exponents,
    /// SI units per unit, 1 for coherent units.
    pub factor: f64,
    /// Units in which values may be displayed.
    pub display: &'static [DisplayUnit],
}

const fn show(name: &'static str, factor: f64) -> DisplayUnit {
    DisplayUnit { name, factor, offset: 0.0 }
}

const fn si(name: &'static str, kg: i8, m: i8, s: i8, rad: i8, display: &'static [DisplayUnit]) -> Unit {
    Unit { name, exponents: Exponents { kg, m, s, rad }, factor: 1.0, display }
}

/// A unit that is `factor` coherent units; shown as it is.
const fn scaled(name: &'static str, factor: f64, kg: i8, m: i8, s: i8, rad: i8) -> Unit {
    Unit { name, exponents: Exponents { kg, m, s, rad }, factor, display: &[] }
}

const DEGREES_PER_RADIAN: f64 = 180.0 / std::f64::consts::PI;

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: Unit = $value;)*
        const ALL: &[Unit] = &[$($name),*];
    };
}

units! {
    /// Dimensionless.
    ONE = si("1", 0, 0, 0, 0, &[show("%", 100.0)]);
    /// Kilogram.
    KG = si("kg", 1, 0, 0, 0, &[show("t", 1e-3)]);
    /// Moment of inertia.
    KG_M2 = si("kg.m2", 1, 2, 0, 0, &[]);
    /// Meter.
    M = si("m", 0, 1, 0, 0, &[show("mm", 1e3), show("cm", 1e2)]);
    /// Volume; brake torque per pressure.
    M3 = si("m3", 0, 3, 0, 0, &[]);
    /// Per meter; spatial frequency.
    PER_M = si("1/m", 0, -1, 0, 0, &[]);
    /// Second.
    S = si("s", 0, 0, 1, 0, &[show("ms", 1e3)]);
    /// Second squared.
    S2 = si("s2", 0, 0, 2, 0, &[]);
    /// Per second; rate of a reaching law.
    PER_S = si("1/s", 0, 0, -1, 0, &[]);
    /// Per second squared; angular acceleration per angle.
    PER_S2 = si("1/s2", 0, 0, -2, 0, &[]);
    /// Per velocity; loss of friction with the sliding speed.
    S_PER_M = si("s/m", 0, -1, 1, 0, &[]);
    /// Hertz.
    HZ = si("Hz", 0, 0, -1, 0, &[]);
    /// Radian.
    RAD = si("rad", 0, 0, 0, 1, &[show("deg", DEGREES_PER_RADIAN)]);
    /// Angular velocity.
    RAD_PER_S = si("rad/s", 0, 0, -1, 1, &[show("deg/s", DEGREES_PER_RADIAN), show("rpm", 30.0 / std::f64::consts::PI)]);
    /// Angular acceleration.
    RAD_PER_S2 = si("rad/s2", 0, 0, -2, 1, &[show("deg/s2", DEGREES_PER_RADIAN)]);
    /// Velocity.
    M_PER_S = si("m/s", 0, 1, -1, 0, &[show("km/h", 3.6), show("mm/s", 1e3)]);
    /// Acceleration.
    M_PER_S2 = si("m/s2", 0, 1, -2, 0, &[show("g", 1.0 / 9.806_65)]);
    /// Force.
    N = si("N", 1, 1, -2, 0, &[show("kN", 1e-3)]);
    /// Torque.
    N_M = si("N.m", 1, 2, -2, 0, &[show("kN.m", 1e-3)]);
    /// Power.
    W = si("W", 1, 2, -3, 0, &[show("kW", 1e-3)]);
    /// Per velocity squared; stability factor of a vehicle.
    S2_PER_M2 = si("s2/m2", 0, -2, 2, 0, &[]);
    /// Stiffness.
    N_PER_M = si("N/m", 1, 0, -2, 0, &[show("kN/m", 1e-3)]);
    /// Damping.
    N_S_PER_M = si("N.s/m", 1, 0, -1, 0, &[show("kN.s/m", 1e-3)]);
    /// Cornering stiffness; force per angle.
    N_PER_RAD = si("N/rad", 1, 1, -2, -1, &[show("kN/rad", 1e-3), show("kN/deg", 1e-3 / DEGREES_PER_RADIAN)]);
    /// Force per angular velocity.
    N_S_PER_RAD = si("N.s/rad", 1, 1, -1, -1, &[]);
    /// Torsional stiffness; moment per angle.
    N_M_PER_RAD = si("N.m/rad", 1, 2, -2, -1, &[show("kN.m/rad", 1e-3)]);
    /// Per radian; a ratio per angle.
    PER_RAD = si("1/rad", 0, 0, 0, -1, &[]);
    /// Per radian and second.
    PER_RAD_S = si("1/(rad.s)", 0, 0, -1, -1, &[]);
    /// Second per radian; a ratio per angular velocity.
    S_PER_RAD = si("s/rad", 0, 0, 1, -1, &[]);
    /// Torsional damping; moment per angular velocity.
    N_M_S_PER_RAD = si("N.m.s/rad", 1, 2, -1, -1, &[]);
    /// Moment per angular acceleration.
    N_M_S2_PER_RAD = si("N.m.s2/rad", 1, 2, 0, -1, &[]);
    /// Pressure in megapascal (with its rate the only unit here that is not coherent).
    MPA = Unit { name: "MPa", exponents: Exponents { kg: 1, m: -1, s: -2, rad: 0 }, factor: 1e6, display: &[show("bar", 10.0)] };
    /// Rate of a pressure.
    MPA_PER_S = Unit { name: "MPa/s", exponents: Exponents { kg: 1, m: -1, s: -3, rad: 0 }, factor: 1e6, display: &[show("bar/s", 10.0)] };
    /// Force in kilonewton, as tire data are fitted over the load.
    KN = scaled("kN", 1e3, 1, 1, -2, 0);
    /// Force per load of a tire in kilonewton.
    N_PER_KN = scaled("N/kN", 1e-3, 0, 0, 0, 0);
    /// Force per squared load of a tire in kilonewton.
    N_PER_KN2 = scaled("N/kN2", 1e-6, -1, -1, 2, 0);
    /// Per load of a tire in kilonewton.
    PER_KN = scaled("1/kN", 1e-3, -1, -1, 2, 0);
    /// Per squared load of a tire in kilonewton.
    PER_KN2 = scaled("1/kN2", 1e-6, -2, -2, 4, 0);
    /// Force per angle in degrees.
    N_PER_DEG = scaled("N/deg", DEGREES_PER_RADIAN, 1, 1, -2, -1);
}

/// For a variable whose unit follows from another one, such as a distance or a time by choice: the description
/// declares no unit.
pub const UNDECLARED: Unit = si("", 0, 0, 0, 0, &[]);

impl Unit {
    /// Whether the description declares it.
    pub fn is_declared(&self) -> bool {
        !self.name.is_empty()
    }

    /// A number with its unit, as messages show it.
    pub(crate) fn with(&self, value: f64) -> String {
        if self.is_declared() { format!("{value} {}", self.name) } else { format!("{value}") }
    }

    /// The unit of the time derivative.
    ///
    /// # Panics
    /// If none of this module's units has its exponents and factor; the states of a plant are checked when its
    /// description is made.
    pub fn per_second(&self) -> Unit {
        let exponents = Exponents { s: self.exponents.s - 1, ..self.exponents };
        *ALL.iter()
            .find(|unit| unit.exponents == exponents && unit.factor == self.factor)
            .unwrap_or_else(|| panic!("a unit for the time derivative of {} is missing in fmi2::unit", self.name))
    }

    /// The display unit of this name.
    pub const fn display_unit(&self, name: &str) -> Option<&'static DisplayUnit> {
        let mut i = 0;
        while i < self.display.len() {
            if same(self.display[i].name, name) {
                return Some(&self.display[i]);
            }
            i += 1;
        }
        None
    }
}

/// Equality of strings in constants.
const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// The unit of this name, for example `rad/s`; `1` for none.
///
/// # Panics
/// With this message when there is none, which stops the compilation: the derives call it in constants.
pub const fn named(name: &str, message: &str) -> Unit {
    let mut i = 0;
    while i < ALL.len() {
        if same(ALL[i].name, name) {
            return ALL[i];
        }
        i += 1;
    }
    panic!("{}", message)
}

/// Stops the compilation when `unit` cannot be displayed as `name`; called by the derives.
pub const fn require_display_unit(unit: &Unit, name: &str) {
    assert!(unit.display_unit(name).is_some(), "the unit has no display unit of this name");
}

/// Stops the compilation when a time is not in seconds; called by the derives.
pub const fn require_seconds(unit: &Unit) {
    assert!(same(unit.name, S.name), "sample_time and max_step are in s");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_factors_positive() {
        let mut names: Vec<_> = ALL.iter().map(|u| u.name).collect();
        names.sort_unstable();
        let count = names.len();
        names.dedup();
        assert_eq!(names.len(), count);
        for unit in ALL {
            assert!(unit.factor > 0.0 && unit.display.iter().all(|d| d.factor > 0.0), "{}", unit.name);
        }
    }

    #[test]
    fn a_number_is_shown_with_its_unit_if_it_has_one() {
        assert_eq!((M.with(0.5), UNDECLARED.with(0.5)), ("0.5 m".to_owned(), "0.5".to_owned()));
    }

    #[test]
    fn units_are_found_by_their_names() {
        ALL.iter().for_each(|unit| assert_eq!(named(unit.name, ""), *unit));
    }

    #[test]
    fn display_factors_are_those_of_the_definitions() {
        let factor = |unit: Unit, name| unit.display_unit(name).unwrap().factor;
        assert!((factor(RAD, "deg") * std::f64::consts::PI - 180.0).abs() < 1e-13);
        assert_eq!(factor(M_PER_S, "km/h"), 3.6);
        assert!((factor(N_PER_RAD, "kN/deg") * 1e3 * 180.0 / std::f64::consts::PI - 1.0).abs() < 1e-15);
        assert_eq!(M.display_unit("deg"), None);
    }
}
