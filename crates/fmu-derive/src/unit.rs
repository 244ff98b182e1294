//! Units of measure, parsed at compile time.
//!
//! A unit is a product of named units with exponents and at most one fraction bar: `kg.m2/s2`, `N.m/(rad.s)`, `1/s`.

use proc_macro2::{Span, TokenStream};
use quote::quote;
use syn::{Error, Result};

/// Exponents of kg, m, s, A, K, mol, cd and rad, in the order of the FMI standard.
type Exponents = [i8; 8];

const DIMENSIONLESS: Exponents = [0; 8];

/// A named unit: value in SI units = value * `numerator / denominator` + `offset`.
struct Named {
    name: &'static str,
    exponents: Exponents,
    numerator: f64,
    denominator: f64,
    offset: f64,
    takes_prefix: bool,
}

const fn base(name: &'static str, exponents: Exponents) -> Named {
    Named { name, exponents, numerator: 1.0, denominator: 1.0, offset: 0.0, takes_prefix: true }
}

const fn scaled(name: &'static str, exponents: Exponents, numerator: f64, denominator: f64) -> Named {
    Named { name, exponents, numerator, denominator, offset: 0.0, takes_prefix: false }
}

const fn prefixed(name: &'static str, exponents: Exponents, numerator: f64, denominator: f64) -> Named {
    Named { takes_prefix: true, ..scaled(name, exponents, numerator, denominator) }
}

const PI: f64 = std::f64::consts::PI;

/// Units with a name. Values: SI brochure (9th edition, 2019), tables 2, 4 and 8; `atm`, `lbf`, `inch`,
/// `ft`, `mi`, `hp`: NIST SP 811.
const NAMED: &[Named] = &[
    base("kg", [1, 0, 0, 0, 0, 0, 0, 0]),
    base("m", [0, 1, 0, 0, 0, 0, 0, 0]),
    base("s", [0, 0, 1, 0, 0, 0, 0, 0]),
    base("A", [0, 0, 0, 1, 0, 0, 0, 0]),
    base("K", [0, 0, 0, 0, 1, 0, 0, 0]),
    base("mol", [0, 0, 0, 0, 0, 1, 0, 0]),
    base("cd", [0, 0, 0, 0, 0, 0, 1, 0]),
    base("rad", [0, 0, 0, 0, 0, 0, 0, 1]),
    base("Hz", [0, 0, -1, 0, 0, 0, 0, 0]),
    base("N", [1, 1, -2, 0, 0, 0, 0, 0]),
    base("Pa", [1, -1, -2, 0, 0, 0, 0, 0]),
    base("J", [1, 2, -2, 0, 0, 0, 0, 0]),
    base("W", [1, 2, -3, 0, 0, 0, 0, 0]),
    base("C", [0, 0, 1, 1, 0, 0, 0, 0]),
    base("V", [1, 2, -3, -1, 0, 0, 0, 0]),
    base("F", [-1, -2, 4, 2, 0, 0, 0, 0]),
    base("Ohm", [1, 2, -3, -2, 0, 0, 0, 0]),
    base("S", [-1, -2, 3, 2, 0, 0, 0, 0]),
    base("Wb", [1, 2, -2, -1, 0, 0, 0, 0]),
    base("T", [1, 0, -2, -1, 0, 0, 0, 0]),
    base("H", [1, 2, -2, -2, 0, 0, 0, 0]),
    base("lm", [0, 0, 0, 0, 0, 0, 1, 0]),
    base("lx", [0, -2, 0, 0, 0, 0, 1, 0]),
    base("kat", [0, 0, -1, 0, 0, 1, 0, 0]),
    prefixed("g", [1, 0, 0, 0, 0, 0, 0, 0], 1.0, 1e3),
    prefixed("L", [0, 3, 0, 0, 0, 0, 0, 0], 1.0, 1e3),
    prefixed("bar", [1, -1, -2, 0, 0, 0, 0, 0], 1e5, 1.0),
    prefixed("Wh", [1, 2, -2, 0, 0, 0, 0, 0], 3600.0, 1.0),
    prefixed("Ah", [0, 0, 1, 1, 0, 0, 0, 0], 3600.0, 1.0),
    prefixed("eV", [1, 2, -2, 0, 0, 0, 0, 0], 1.602_176_634e-19, 1.0),
    Named { offset: 273.15, ..scaled("degC", [0, 0, 0, 0, 1, 0, 0, 0], 1.0, 1.0) },
    Named { offset: 459.67 * 5.0 / 9.0, ..scaled("degF", [0, 0, 0, 0, 1, 0, 0, 0], 5.0, 9.0) },
    scaled("%", DIMENSIONLESS, 1.0, 100.0),
    scaled("t", [1, 0, 0, 0, 0, 0, 0, 0], 1e3, 1.0),
    scaled("min", [0, 0, 1, 0, 0, 0, 0, 0], 60.0, 1.0),
    scaled("h", [0, 0, 1, 0, 0, 0, 0, 0], 3600.0, 1.0),
    scaled("d", [0, 0, 1, 0, 0, 0, 0, 0], 86400.0, 1.0),
    scaled("deg", [0, 0, 0, 0, 0, 0, 0, 1], PI, 180.0),
    scaled("rev", [0, 0, 0, 0, 0, 0, 0, 1], 2.0 * PI, 1.0),
    scaled("rpm", [0, 0, -1, 0, 0, 0, 0, 1], 2.0 * PI, 60.0),
    scaled("atm", [1, -1, -2, 0, 0, 0, 0, 0], 101_325.0, 1.0),
    scaled("psi", [1, -1, -2, 0, 0, 0, 0, 0], 4.448_221_615_260_5, 0.000_645_16),
    scaled("inch", [0, 1, 0, 0, 0, 0, 0, 0], 0.0254, 1.0),
    scaled("ft", [0, 1, 0, 0, 0, 0, 0, 0], 0.3048, 1.0),
    scaled("mi", [0, 1, 0, 0, 0, 0, 0, 0], 1609.344, 1.0),
    scaled("mph", [0, 1, -1, 0, 0, 0, 0, 0], 1609.344, 3600.0),
    scaled("kn", [0, 1, -1, 0, 0, 0, 0, 0], 1852.0, 3600.0),
    scaled("lb", [1, 0, 0, 0, 0, 0, 0, 0], 0.453_592_37, 1.0),
    scaled("lbf", [1, 1, -2, 0, 0, 0, 0, 0], 4.448_221_615_260_5, 1.0),
    scaled("hp", [1, 2, -3, 0, 0, 0, 0, 0], 745.699_871_582_270_2, 1.0),
    scaled("cal", [1, 2, -2, 0, 0, 0, 0, 0], 4.184, 1.0),
    scaled("gn", [0, 1, -2, 0, 0, 0, 0, 0], 9.806_65, 1.0),
];

/// Prefixes: name, and factor as numerator and denominator.
const PREFIXES: &[(&str, f64, f64)] = &[
    ("T", 1e12, 1.0),
    ("G", 1e9, 1.0),
    ("M", 1e6, 1.0),
    ("k", 1e3, 1.0),
    ("h", 1e2, 1.0),
    ("d", 1.0, 1e1),
    ("c", 1.0, 1e2),
    ("m", 1.0, 1e3),
    ("u", 1.0, 1e6),
    ("n", 1.0, 1e9),
    ("p", 1.0, 1e12),
];

/// Usual display units, to which importers can convert values.
const DISPLAY: &[(&str, &[&str])] = &[
    ("1", &["%"]),
    ("kg", &["t"]),
    ("m", &["mm", "cm"]),
    ("s", &["ms"]),
    ("rad", &["deg"]),
    ("rad/s", &["deg/s", "rpm"]),
    ("rad/s2", &["deg/s2"]),
    ("m/s", &["km/h", "mm/s"]),
    ("m/s2", &["g"]),
    ("N", &["kN"]),
    ("N.m", &["kN.m"]),
    ("W", &["kW"]),
    ("N/m", &["kN/m"]),
    ("N.s/m", &["kN.s/m"]),
    ("N/rad", &["kN/rad", "kN/deg"]),
    ("N.m/rad", &["kN.m/rad"]),
    ("MPa", &["bar"]),
    ("MPa/s", &["bar/s"]),
    ("K", &["degC"]),
    ("Pa", &["bar", "kPa"]),
    ("J", &["kJ", "kWh"]),
];

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unit {
    name: String,
    exponents: Exponents,
    numerator: f64,
    denominator: f64,
    offset: f64,
}

impl Unit {
    /// Parses a unit such as `m/s`; `1` is dimensionless.
    pub(crate) fn parse(text: &str, span: Span) -> Result<Self> {
        let mut unit =
            Self { name: text.to_owned(), exponents: DIMENSIONLESS, numerator: 1.0, denominator: 1.0, offset: 0.0 };
        let (above, below) = match text.split_once('/') {
            Some((above, below)) => (above, Some(below)),
            None => (text, None),
        };
        if let Some(better) = in_ascii(text) {
            return Err(Error::new(span, format!("write the unit `{text}` as `{better}`")));
        }
        let factors = text.split(['.', '/']).count();
        unit.multiply(above, 1, factors, text, span)?;
        if let Some(below) = below {
            let inner = below.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
            if inner.is_none() && below.contains('.') {
                let message = format!("write parentheses around the denominator of `{text}`, as in `1/(rad.s)`");
                return Err(Error::new(span, message));
            }
            unit.multiply(inner.unwrap_or(below), -1, factors, text, span)?;
        }
        Ok(unit)
    }

    fn multiply(&mut self, product: &str, sign: i8, factors: usize, text: &str, span: Span) -> Result<()> {
        for factor in product.split('.') {
            if factor == "1" {
                continue;
            }
            if factor.contains(['^', '*']) {
                let better = text.replace("**", "").replace('^', "").replace('*', ".");
                let message =
                    format!("write the unit `{text}` as `{better}`: exponents follow the name, and a dot multiplies");
                return Err(Error::new(span, message));
            }
            let letters = factor.trim_end_matches(|c: char| c.is_ascii_digit());
            let letters = letters.strip_suffix('-').unwrap_or(letters);
            let exponent = &factor[letters.len()..];
            let exponent: i8 = match exponent {
                "" => 1,
                digits => digits.parse().ok().filter(|e: &i8| (-12..=12).contains(e) && *e != 0).ok_or_else(|| {
                    Error::new(span, format!("`{factor}` in the unit `{text}`: the exponent must be 1 to 12"))
                })?,
            };
            let (named, numerator, denominator) = find(letters).ok_or_else(|| unknown(letters, text, span))?;
            if named.offset != 0.0 {
                if factors > 1 || exponent != 1 {
                    let message =
                        format!("`{letters}` has an offset, so it cannot be part of the unit `{text}`; use K");
                    return Err(Error::new(span, message));
                }
                self.offset = named.offset;
            }
            let exponent = exponent * sign;
            for (sum, part) in self.exponents.iter_mut().zip(named.exponents) {
                *sum += part * exponent;
            }
            for _ in 0..exponent.unsigned_abs() {
                if exponent > 0 {
                    self.numerator *= numerator;
                    self.denominator *= denominator;
                } else {
                    self.numerator *= denominator;
                    self.denominator *= numerator;
                }
            }
        }
        Ok(())
    }

    /// A display unit for values in this unit. For accelerations, `g` is standard gravity.
    pub(crate) fn display(&self, name: &str, span: Span) -> Result<Self> {
        let acceleration = [0, 1, -2, 0, 0, 0, 0, 0];
        let parsed = if name == "g" && self.exponents == acceleration { "gn" } else { name };
        let display = Self { name: name.to_owned(), ..Self::parse(parsed, span)? };
        if display.exponents != self.exponents {
            let message = format!("values in {} cannot be displayed in {name}: the dimensions differ", self.name);
            return Err(Error::new(span, message));
        }
        Ok(display)
    }

    pub(crate) fn is_second(&self) -> bool {
        self.exponents == [0, 0, 1, 0, 0, 0, 0, 0] && self.numerator == self.denominator
    }

    fn factor(&self) -> f64 {
        self.numerator / self.denominator
    }

    /// The unit of the time derivative: `m/s` for `m`, `m/s2` for `m/s`, `N/(rad.s)` for `N/rad`.
    fn rate(&self) -> Self {
        let mut exponents = self.exponents;
        exponents[2] -= 1;
        // The derivative of a temperature in degC is in K/s.
        let name = if self.offset == 0.0 { self.name.as_str() } else { "K" };
        let name = match name.split_once('/') {
            None => format!("{name}/s"),
            Some((above, below)) => {
                let below = below.trim_start_matches('(').trim_end_matches(')');
                let mut found = false;
                let mut factors: Vec<String> = below
                    .split('.')
                    .map(|factor| match factor.strip_prefix('s').map(|digits| (digits, digits.parse::<u8>())) {
                        Some(("", _)) => {
                            found = true;
                            "s2".to_owned()
                        }
                        Some((_, Ok(exponent))) => {
                            found = true;
                            format!("s{}", exponent + 1)
                        }
                        _ => factor.to_owned(),
                    })
                    .collect();
                if !found {
                    factors.push("s".to_owned());
                }
                let below = factors.join(".");
                if factors.len() == 1 { format!("{above}/{below}") } else { format!("{above}/({below})") }
            }
        };
        Self { name, exponents, offset: 0.0, ..self.clone() }
    }

    /// An expression of type `DisplayUnit`: `display value = factor * value + offset`.
    pub(crate) fn display_tokens(&self, root: &TokenStream, display: &Self) -> TokenStream {
        let name = &display.name;
        let factor = (self.numerator * display.denominator) / (self.denominator * display.numerator);
        let offset = (self.offset - display.offset) * display.denominator / display.numerator;
        quote!(#root::DisplayUnit { name: #name, factor: #factor, offset: #offset })
    }

    pub(crate) fn tokens(&self, root: &TokenStream) -> TokenStream {
        let rate = self.rate().tokens_with(root, &quote!(None));
        self.tokens_with(root, &quote!(Some(&#rate)))
    }

    fn tokens_with(&self, root: &TokenStream, rate: &TokenStream) -> TokenStream {
        let (name, exponents, factor, offset) = (&self.name, self.exponents, self.factor(), self.offset);
        let usual = DISPLAY.iter().find(|(unit, _)| *unit == name).map_or(&[][..], |(_, usual)| usual);
        let usual = usual.iter().filter_map(|name| self.display(name, Span::call_site()).ok());
        let display = usual.map(|display| self.display_tokens(root, &display));
        quote! {
            #root::Unit {
                name: #name,
                exponents: [#(#exponents),*],
                factor: #factor,
                offset: #offset,
                display: &[#(#display),*],
                rate: #rate,
            }
        }
    }
}

/// Replaces the non-ASCII characters in a unit, which are not allowed; `None` if the result is not a unit.
fn in_ascii(text: &str) -> Option<String> {
    if text.is_ascii() {
        return None;
    }
    let mut better = String::new();
    for sign in text.replace("°C", "degC").replace("°F", "degF").chars() {
        match sign {
            // The micro sign and the Greek letter; the ohm sign and the Greek letter.
            'µ' | 'μ' => better.push('u'),
            '\u{2126}' | '\u{3a9}' => better.push_str("Ohm"),
            '°' => better.push_str("deg"),
            '·' | '⋅' | '×' => better.push('.'),
            '⁻' => better.push('-'),
            '¹' => better.push('1'),
            '²' => better.push('2'),
            '³' => better.push('3'),
            '⁴' => better.push('4'),
            other => better.push(other),
        }
    }
    (better.is_ascii() && Unit::parse(&better, Span::call_site()).is_ok()).then_some(better)
}

/// Finds a named unit, optionally with a prefix, and the numerator and denominator of its factor.
fn find(letters: &str) -> Option<(&'static Named, f64, f64)> {
    let exact = |name: &str| NAMED.iter().find(|named| named.name == name);
    if let Some(named) = exact(letters) {
        return Some((named, named.numerator, named.denominator));
    }
    PREFIXES.iter().find_map(|(prefix, numerator, denominator)| {
        let named = exact(letters.strip_prefix(prefix)?)?;
        // The kilogram already has a prefix.
        (named.takes_prefix && named.name != "kg").then_some((
            named,
            named.numerator * numerator,
            named.denominator * denominator,
        ))
    })
}

fn unknown(letters: &str, text: &str, span: Span) -> Error {
    let aliases = [("ohm", "Ohm"), ("degree", "deg"), ("l", "L"), ("in", "inch"), ("sec", "s"), ("kph", "km/h")];
    let alias = aliases.iter().find(|(alias, _)| *alias == letters).map(|(_, name)| (*name).to_owned());
    let prefixed = NAMED.iter().filter(|named| named.takes_prefix && named.name != "kg");
    let prefixed =
        prefixed.flat_map(|named| PREFIXES.iter().map(move |(prefix, ..)| format!("{prefix}{}", named.name)));
    let nearest = || {
        NAMED
            .iter()
            .map(|named| named.name.to_owned())
            .chain(prefixed)
            // Among equally similar names, prefers one with the same first letter.
            .map(|name| {
                let distance = strsim::damerau_levenshtein(&name.to_lowercase(), &letters.to_lowercase());
                let starts_alike = name.starts_with(letters.chars().next().unwrap_or_default());
                let is_plain = NAMED.iter().any(|named| named.name == name);
                (distance, !starts_alike, !is_plain, name)
            })
            .min()
            .filter(|(distance, ..)| *distance <= 1 && letters.len() > 1 || *distance == 0)
            .map(|(.., name)| name)
    };
    let hint = alias.or_else(nearest).map_or_else(
        || "; the guide lists all units and explains how to define your own".to_owned(),
        |name| format!("; did you mean `{name}`?"),
    );
    let whole = if letters == text { String::new() } else { format!(" in `{text}`") };
    Error::new(span, format!("unknown unit `{letters}`{whole}{hint}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Unit {
        Unit::parse(text, Span::call_site()).unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    fn error(text: &str) -> String {
        Unit::parse(text, Span::call_site()).unwrap_err().to_string()
    }

    #[test]
    fn units_have_the_dimensions_and_factors_of_their_definitions() {
        // Reference: SI brochure, 9th edition.
        assert_eq!(parse("N.m/rad").exponents, [1, 2, -2, 0, 0, 0, 0, -1]);
        assert_eq!(parse("1/(rad.s)").exponents, [0, 0, -1, 0, 0, 0, 0, -1]);
        assert_eq!(parse("s2/m2").exponents, [0, -2, 2, 0, 0, 0, 0, 0]);
        assert_eq!(parse("m-1").exponents, parse("1/m").exponents);
        assert_eq!(parse("V").exponents, parse("W/A").exponents);
        assert_eq!(parse("Ohm").exponents, parse("V/A").exponents);
        assert_eq!(parse("H").exponents, parse("V.s/A").exponents);
        assert_eq!(parse("F").exponents, parse("A.s/V").exponents);
        assert_eq!(parse("Pa").exponents, parse("N/m2").exponents);
        assert_eq!(parse("kWh").factor(), 3.6e6);
        assert_eq!(parse("MPa").factor(), 1e6);
        assert_eq!(parse("km/h").factor(), 1.0 / 3.6);
        assert_eq!(parse("m3/s").factor(), 1.0);
        assert_eq!(parse("mm").factor(), 1e-3);
        assert_eq!(parse("cm2").factor(), 1e-4);
        assert_eq!(parse("N/deg").factor(), 180.0 / PI);
        assert_eq!(parse("degC").offset, 273.15);
    }

    #[test]
    fn rates_are_composed() {
        for (unit, rate) in [
            ("m", "m/s"),
            ("m/s", "m/s2"),
            ("m/s2", "m/s3"),
            ("1", "1/s"),
            ("N/rad", "N/(rad.s)"),
            ("1/(rad.s)", "1/(rad.s2)"),
            ("degC", "K/s"),
            ("mol/m3", "mol/(m3.s)"),
            ("mi/h", "mi/(h.s)"),
            ("kg/sr", "kg/(sr.s)"),
        ] {
            let parsed = Unit { name: unit.to_owned(), ..Unit::parse("m", Span::call_site()).unwrap() };
            let parsed = if unit == "degC" { parse(unit) } else { parsed };
            assert_eq!(parsed.rate().name, rate);
        }
        assert_eq!(parse("N.m").rate().exponents, parse("W").exponents);
    }

    #[test]
    fn unknown_units_have_a_suggestion() {
        assert_eq!(error("rads"), "unknown unit `rads`; did you mean `rad`?");
        assert_eq!(error("N.mm/ra"), "unknown unit `ra` in `N.mm/ra`; did you mean `rad`?");
        for (unit, better) in [
            ("°C", "degC"),
            ("°/s", "deg/s"),
            ("\u{b5}m", "um"),
            ("\u{3bc}m/s²", "um/s2"),
            ("k\u{2126}", "kOhm"),
            ("N·m", "N.m"),
            ("m·s⁻²", "m.s-2"),
        ] {
            assert_eq!(error(unit), format!("write the unit `{unit}` as `{better}`"));
        }
        assert_eq!(
            error("furlong"),
            "unknown unit `furlong`; the guide lists all units and explains how to define your own"
        );
        assert_eq!(error("degC/s"), "`degC` has an offset, so it cannot be part of the unit `degC/s`; use K");
        assert_eq!(error("1/rad.s"), "write parentheses around the denominator of `1/rad.s`, as in `1/(rad.s)`");
        assert_eq!(error("kkg"), "unknown unit `kkg`; did you mean `kg`?");
        let rule = "exponents follow the name, and a dot multiplies";
        assert_eq!(error("m^3/s"), format!("write the unit `m^3/s` as `m3/s`: {rule}"));
        assert_eq!(error("N*m"), format!("write the unit `N*m` as `N.m`: {rule}"));
        assert_eq!(error("kg*m**2"), format!("write the unit `kg*m**2` as `kg.m2`: {rule}"));
    }

    #[test]
    fn display_units_need_the_same_dimension() {
        let display = |unit: &str, name: &str| parse(unit).display(name, Span::call_site());
        assert_eq!(display("m/s2", "g").unwrap().numerator, 9.806_65);
        assert!(display("m", "deg").unwrap_err().to_string().contains("the dimensions differ"));
    }

    #[test]
    fn names_are_unique_with_and_without_prefixes() {
        let mut names: Vec<String> = NAMED.iter().map(|named| named.name.to_owned()).collect();
        names.sort_unstable();
        let count = names.len();
        names.dedup();
        assert_eq!(names.len(), count);
        // `min` is the minute, `cd` the candela, `Pa` the pascal: a plain name wins over a prefix.
        assert_eq!(parse("min").factor(), 60.0);
        assert_eq!(parse("cd").exponents[6], 1);
        assert_eq!(parse("Pa").exponents, [1, -1, -2, 0, 0, 0, 0, 0]);
    }
}
