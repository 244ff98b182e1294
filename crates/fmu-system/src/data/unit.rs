//! Units of measure of data.

use crate::run::Linear;
use fmu_import::description::{BaseUnit, DisplayUnit, ModelDescription, Variable};
use std::f64::consts::PI;

/// The exponents of kg, m, s, A, K and rad in a quantity, and its units: name, factor and offset to SI.
type Quantity = ([i32; 6], &'static [(&'static str, f64, f64)]);

const QUANTITIES: [Quantity; 17] = [
    ([0, 0, 0, 0, 0, 0], &[("1", 1.0, 0.0), ("%", 0.01, 0.0)]),
    ([0, 0, 0, 0, 0, 1], &[("rad", 1.0, 0.0), ("deg", PI / 180.0, 0.0)]),
    ([0, 0, -1, 0, 0, 1], &[("rad/s", 1.0, 0.0), ("deg/s", PI / 180.0, 0.0), ("rpm", PI / 30.0, 0.0)]),
    ([0, 0, -2, 0, 0, 1], &[("rad/s2", 1.0, 0.0), ("deg/s2", PI / 180.0, 0.0)]),
    (
        [0, 1, 0, 0, 0, 0],
        &[
            ("m", 1.0, 0.0),
            ("mm", 1e-3, 0.0),
            ("cm", 1e-2, 0.0),
            ("km", 1e3, 0.0),
            ("in", 0.0254, 0.0),
            ("ft", 0.3048, 0.0),
        ],
    ),
    (
        [0, 1, -1, 0, 0, 0],
        &[
            ("m/s", 1.0, 0.0),
            ("mm/s", 1e-3, 0.0),
            ("km/h", 1.0 / 3.6, 0.0),
            ("kph", 1.0 / 3.6, 0.0),
            ("mph", 0.447_04, 0.0),
        ],
    ),
    // `g` is standard gravity, exact by definition, not the gravity parameter of a vehicle model.
    ([0, 1, -2, 0, 0, 0], &[("m/s2", 1.0, 0.0), ("mm/s2", 1e-3, 0.0), ("g", 9.806_65, 0.0)]),
    (
        [0, 0, 1, 0, 0, 0],
        &[
            ("s", 1.0, 0.0),
            ("ms", 1e-3, 0.0),
            ("us", 1e-6, 0.0),
            ("ns", 1e-9, 0.0),
            ("min", 60.0, 0.0),
            ("h", 3600.0, 0.0),
        ],
    ),
    ([1, 1, -2, 0, 0, 0], &[("N", 1.0, 0.0), ("daN", 10.0, 0.0), ("lbf", 4.448_221_615_260_5, 0.0), ("kN", 1e3, 0.0)]),
    ([1, 2, -2, 0, 0, 0], &[("N.m", 1.0, 0.0), ("Nm", 1.0, 0.0), ("kN.m", 1e3, 0.0)]),
    ([1, -1, -2, 0, 0, 0], &[("Pa", 1.0, 0.0), ("kPa", 1e3, 0.0), ("bar", 1e5, 0.0), ("MPa", 1e6, 0.0)]),
    ([1, 0, 0, 0, 0, 0], &[("kg", 1.0, 0.0), ("lb", 0.453_592_37, 0.0), ("t", 1e3, 0.0)]),
    ([1, 2, -3, 0, 0, 0], &[("W", 1.0, 0.0), ("kW", 1e3, 0.0)]),
    ([1, 2, -3, -1, 0, 0], &[("V", 1.0, 0.0)]),
    ([0, 0, 0, 1, 0, 0], &[("A", 1.0, 0.0)]),
    ([0, 0, 0, 0, 1, 0], &[("K", 1.0, 0.0), ("degC", 1.0, 273.15)]),
    ([0, 0, -1, 0, 0, 0], &[("Hz", 1.0, 0.0)]),
];

/// Other spellings of units, each with the unit that is probably meant. They are rejected, because some have other
/// meanings.
const SPELLINGS: [(&str, &str); 12] = [
    ("Grad", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("Grad/s", "deg/s"),
    ("dps", "deg/s"),
    ("radian", "rad"),
    ("sec", "s"),
    ("kmh", "km/h"),
    ("kmph", "km/h"),
    ("mps", "m/s"),
    ("m/s/s", "m/s2"),
    ("1/min", "rpm"),
];

/// Finds a unit by its name: value in SI = factor * value + offset. `°` is accepted for `deg`, `²` and `^2` for `2`,
/// and `-` for `1`.
pub fn find(name: &str) -> Option<BaseUnit> {
    let name = name.trim().replace("°C", "degC").replace('°', "deg").replace('²', "2").replace("^2", "2");
    let name = name.replace(['·', '*'], ".").replace(['µ', 'μ'], "u");
    let name = if name == "-" { "1" } else { name.as_str() };
    QUANTITIES.iter().find_map(|([kg, m, s, ampere, kelvin, rad], units)| {
        let (_, factor, offset) = units.iter().find(|unit| unit.0 == name)?;
        Some(BaseUnit { exponents: [*kg, *m, *s, *ampere, *kelvin, 0, 0, *rad], factor: *factor, offset: *offset })
    })
}

/// Returns true if the exponents of two units are equal except for the radian, which some tools omit.
pub fn is_same_without_angle(a: [i32; 8], b: [i32; 8]) -> bool {
    a[..7] == b[..7]
}

/// True for numbers of definitions that differ by the digits that their files give.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

/// True if two definitions of a unit are equal, except for rounding.
fn is_equal(a: BaseUnit, b: BaseUnit) -> bool {
    a.exponents == b.exponents && is_near(a.factor, b.factor) && is_near(a.offset, b.offset)
}

/// A unit of measure as its file defines it: SI value = factor * value + offset.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Declared {
    pub(crate) name: String,
    pub(crate) base: Option<BaseUnit>,
    /// True for a difference (`relativeDeclared`), to which offsets do not apply.
    pub(crate) is_relative: bool,
}

/// Two units between which no value can be converted.
#[derive(Debug)]
pub(crate) struct UnitMismatch {
    /// The units with their definitions: `in bar, 100000 kg m^-1 s^-2`.
    pub(crate) words: [String; 2],
    /// True if only the exponents of rad differ.
    pub(crate) is_angle: bool,
}

impl Declared {
    /// The unit of a variable; `None` if it has none.
    pub(crate) fn of(description: &ModelDescription, variable: &Variable) -> Option<Self> {
        let name = variable.unit.clone()?;
        let base = description.unit(&name).and_then(|unit| unit.base);
        Some(Self { name, base, is_relative: variable.relative_quantity })
    }

    pub(crate) fn conversion_to(&self, to: &Self) -> Result<Linear, UnitMismatch> {
        let is_same = self.name == to.name;
        let error = |words, is_angle| Err(UnitMismatch { words, is_angle });
        let words = || [self.definition(), to.definition()];
        let (a, b) = match (self.base, to.base) {
            (a, b) if is_same && a.zip(b).is_none_or(|(a, b)| is_equal(a, b)) => return Ok(Linear::IDENTITY),
            (Some(a), Some(b)) => (a, b),
            _ => return error(words(), false),
        };
        // A unit whose definition depends on the file is a mistake in one of them.
        if is_same || a.exponents != b.exponents {
            return error(words(), !is_same && is_same_without_angle(a.exponents, b.exponents));
        }
        let factor = a.factor / b.factor;
        match [self.is_relative, to.is_relative] {
            [true, true] => Ok(Linear { factor, offset: 0.0 }),
            [true, false] | [false, true] if !is_near(a.offset, b.offset) => {
                let kind = |of: &Self| if of.is_relative { "a difference" } else { "not a difference" };
                error([self, to].map(|of| format!("{} in {}", kind(of), of.name)), false)
            }
            _ => Ok(Linear { factor, offset: (a.offset - b.offset) / b.factor }),
        }
    }

    fn definition(&self) -> String {
        let name = &self.name;
        let Some(base) = self.base else { return format!("in {name}, which its FMU does not define") };
        let names = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];
        let power = |(name, exponent): (&&str, &i32)| match exponent {
            0 => None,
            1 => Some((*name).to_owned()),
            _ => Some(format!("{name}^{exponent}")),
        };
        let powers: Vec<String> = names.iter().zip(&base.exponents).filter_map(power).collect();
        let offset = if base.offset == 0.0 { String::new() } else { format!(" + {}", base.offset) };
        format!("in {name} ({}{})", [base.factor.to_string(), powers.join(" ")].join(" ").trim(), offset)
    }
}

/// The unit of a variable, to which values are converted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Target {
    /// Name of the unit; `None` accepts values in any unit without conversion.
    pub name: Option<String>,
    /// The unit in SI; `None` if it is only known by its name.
    pub base: Option<BaseUnit>,
    /// Units to show values in.
    pub display: Vec<DisplayUnit>,
    /// True for a difference, to which offsets do not apply.
    pub is_relative: bool,
}

impl Target {
    /// A unit by its name.
    pub fn named(name: &str) -> Self {
        Self { name: Some(name.to_owned()), base: find(name), ..Self::default() }
    }

    /// The unit of a variable of an FMU.
    pub fn of(description: &ModelDescription, variable: &Variable) -> Self {
        let unit = variable.unit.as_deref();
        let declared = unit.and_then(|name| description.unit(name)).and_then(|unit| unit.base);
        let known = unit.and_then(find);
        // Some tools omit the radian from the exponents; the name of the unit then shows that it is an angle.
        let lacks_angle = declared.zip(known).is_some_and(|(declared, known)| {
            is_same_without_angle(declared.exponents, known.exponents) && is_near(declared.factor, known.factor)
        });
        Self {
            name: unit.map(str::to_owned),
            base: if lacks_angle { known } else { declared.or(known) },
            display: description.display_units(variable),
            is_relative: variable.relative_quantity,
        }
    }

    /// Returns the conversion from a unit.
    ///
    /// # Errors
    /// The unit is unknown or has another dimension: message and help.
    pub fn from(&self, unit: &str) -> Result<Linear, (String, String)> {
        let Some(own) = self.name.as_deref().filter(|own| *own != unit) else { return Ok(Linear::IDENTITY) };
        let offset = |offset: f64| if self.is_relative { 0.0 } else { offset };
        if let (Some(from), Some(to)) = (find(unit), self.base) {
            if from.exponents != to.exponents {
                let help = "correct the unit in the file, or choose another column".to_owned();
                return Err((format!("`{unit}` and `{own}` measure different quantities"), help));
            }
            return Ok(Linear {
                factor: from.factor / to.factor,
                offset: offset((from.offset - to.offset) / to.factor),
            });
        }
        if let Some(display) = self.display.iter().find(|display| display.name == unit) {
            return Ok(Linear {
                factor: 1.0 / display.factor,
                offset: offset((0.0 - display.offset) / display.factor),
            });
        }
        let spelled = SPELLINGS.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(unit));
        let near = match spelled {
            Some((_, meant)) => format!("did you mean `{meant}`? "),
            None => self.alternatives(),
        };
        Err((
            format!("the unit `{unit}` cannot be converted to `{own}`"),
            format!("{near}Give the column a known unit, or no unit and values in {own}"),
        ))
    }

    /// Lists the known units of the same quantity. Units with a similar spelling would mislead: mPa and MPa are
    /// different.
    fn alternatives(&self) -> String {
        let Some(base) = self.base else { return String::new() };
        let is_same =
            |[kg, m, s, ampere, kelvin, rad]: [i32; 6]| [kg, m, s, ampere, kelvin, 0, 0, rad] == base.exponents;
        let same = QUANTITIES.iter().find(|(powers, _)| is_same(*powers));
        let names: Vec<&str> = same.iter().flat_map(|(_, units)| units.iter().map(|(name, ..)| *name)).collect();
        if names.is_empty() { String::new() } else { format!("known units: {}. ", names.join(", ")) }
    }
}
