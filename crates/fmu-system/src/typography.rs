//! Numbers and units as text for people.

/// Numbers below `SMALL` and from `LARGE` on are written with a power of ten.
const SMALL: f64 = 1e-4;
const LARGE: f64 = 1e9;

/// Formats a number with these decimals, or with four significant digits.
pub fn number(value: f64, digits: Option<u8>) -> String {
    let size = value.abs();
    if !size.is_finite() || size >= LARGE || (digits.is_none() && size > 0.0 && size < SMALL) {
        return significant(value, 6);
    }
    let decimals = digits
        .map_or_else(|| if size > 0.0 { (3 - size.log10().floor() as i32).max(0) as usize } else { 3 }, usize::from);
    minus(&format!("{value:.decimals$}"))
}

/// Formats a number with up to `digits` significant digits, and with a power of ten where that is shorter: C's format
/// `g`.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return minus(&value.to_string().to_lowercase());
    }
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let power: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| {
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text.to_owned() }
    };
    if (-4..digits as i32).contains(&power) {
        return minus(&trimmed(&format!("{value:.*}", (digits as i32 - 1 - power).max(0) as usize)));
    }
    format!("{}×10{}", minus(&trimmed(mantissa)), raised(&power.to_string()))
}

/// Replaces the hyphen with a minus sign and drops it for a negative zero.
fn minus(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(size) if size.chars().all(|c| matches!(c, '0' | '.')) => size.to_owned(),
        _ => text.replace('-', "−"),
    }
}

fn raised(text: &str) -> String {
    let of = |c: char| match c.to_digit(10) {
        Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
        None => '⁻',
    };
    text.chars().map(of).collect()
}

/// Formats a unit: rad/s2 as rad/s², N.m as N·m, deg as °, 1 as an empty text.
pub fn unit(name: &str) -> String {
    if name == "1" {
        return String::new();
    }
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let letters: Vec<char> = name.replace('.', "·").chars().collect();
    let mut out = String::new();
    let mut at = 0;
    while at < letters.len() {
        let before = at.checked_sub(1).map(|i| letters[i]);
        let end = letters[at..].iter().position(|c| !is_word(*c)).map_or(letters.len(), |length| at + length);
        let starts_word = is_word(letters[at]) && !before.is_some_and(is_word);
        if starts_word && letters[at..end] == ['d', 'e', 'g'] {
            out.push('°');
            at = end;
        } else if letters[at].is_ascii_digit() && before.is_some_and(|c| c.is_ascii_alphabetic() || c == ')') {
            let count = letters[at..].iter().take_while(|c| c.is_ascii_digit()).count();
            out += &raised(&letters[at..at + count].iter().collect::<String>());
            at += count;
        } else {
            out.push(letters[at]);
            at += 1;
        }
    }
    out
}

/// A number with its unit, which may be empty.
pub fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() { number.to_owned() } else { format!("{number} {unit}") }
}

/// Formats one or two limits with a unit: `at least 1 s and at most 2 s`.
pub fn limits([min, max]: [Option<f64>; 2], unit: &str) -> String {
    let ends = [("at least", min), ("at most", max)];
    let ends = ends.into_iter().filter_map(|(word, limit)| Some((word, significant(limit?, 6))));
    ends.map(|(word, limit)| format!("{word} {}", with_unit(&limit, unit))).collect::<Vec<_>>().join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: Python's formats `.6g` and `.2f`.
    #[test]
    fn numbers_and_units_are_written_for_people() {
        for (value, text) in [
            (0.35, "0.35"),
            (-0.0, "0"),
            (123_456.7, "123457"),
            (1_234_567.0, "1.23457×10⁶"),
            (1e-5, "1×10⁻⁵"),
            (-2.5e-7, "−2.5×10⁻⁷"),
            (999_999.96, "1×10⁶"),
        ] {
            assert_eq!(significant(value, 6), text);
        }
        assert_eq!(number(0.012_345, None), "0.01235");
        assert_eq!(number(12_345.6, None), "12346");
        assert_eq!(number(-0.001, Some(2)), "0.00");
        assert_eq!(number(0.0, None), "0.000");
        assert_eq!(number(5e-5, None), "5×10⁻⁵");
        for (name, text) in [
            ("1", ""),
            ("rad/s2", "rad/s²"),
            ("N.m", "N·m"),
            ("deg/s", "°/s"),
            ("(m/s)2", "(m/s)²"),
            ("10 deg", "10 °"),
        ] {
            assert_eq!(unit(name), text);
        }
    }
}
