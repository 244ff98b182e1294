//! Numbers as text.

/// Maximum length of a number in bytes: `-2.2250738585072014e-308`.
pub(super) const MAX_LENGTH: usize = 24;

/// Appends the shortest text that reads back as the same double, in the notation of `{:?}` but four times faster. If
/// two of the shortest texts are equally near, it writes the text that ends with an even digit, as Python does, so that
/// the files of the FMPy master have the same bytes.
pub(super) fn push(text: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let number = buffer.format(value).as_bytes();
    let magnitude = value.abs();
    // Notations of zmij that differ from those of Rust and Python.
    if (1e-5..1e-4).contains(&magnitude) {
        push_fifth_place(text, number);
    } else if magnitude >= 1e16 {
        // `1e+16` becomes `1e16`.
        text.extend(number.iter().filter(|sign| **sign != b'+'));
    } else {
        text.extend_from_slice(number);
    }
}

/// Appends `0.0000123` as `1.23e-5`.
fn push_fifth_place(text: &mut Vec<u8>, number: &[u8]) {
    let digits = match number.strip_prefix(b"-") {
        Some(digits) => {
            text.push(b'-');
            digits
        }
        None => number,
    };
    let digits = digits.strip_prefix(b"0.0000").unwrap_or(digits);
    let (first, rest) = digits.split_at(1);
    text.extend_from_slice(first);
    if !rest.is_empty() {
        text.push(b'.');
        text.extend_from_slice(rest);
    }
    text.extend_from_slice(b"e-5");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(value: f64) -> String {
        let mut text = Vec::new();
        push(&mut text, value);
        String::from_utf8(text).unwrap()
    }

    /// Significant digits without zeros at the end.
    fn digits(text: &str) -> String {
        let mantissa = text.split('e').next().unwrap();
        let digits: String = mantissa.chars().filter(char::is_ascii_digit).collect();
        digits.trim_matches('0').to_owned()
    }

    /// The reference is the standard library. If two texts are equally near, it rounds up.
    #[track_caller]
    fn assert_as_debug(value: f64) {
        let (ours, reference) = (written(value), format!("{value:?}"));
        if ours != reference {
            assert_eq!(ours.parse::<f64>().unwrap().to_bits(), value.to_bits(), "{ours}");
            assert_eq!(ours.len(), reference.len(), "{ours}, {reference}");
            // All digits of a double: no more than 767 are significant.
            assert_eq!(digits(&format!("{value:.800e}")), digits(&ours) + "5", "{ours}, {reference}");
            assert!(digits(&ours).ends_with(['2', '4', '6', '8']), "{ours}, {reference}");
        }
    }

    #[test]
    fn a_number_between_two_texts_has_the_even_digit() {
        // Printed by Python 3.11.
        assert_eq!(written(2.0_f64.powi(-25)), "2.9802322387695312e-8");
        assert_eq!(written(-(1_232_624_430_263_560.0 + 0.25)), "-1232624430263560.2");
    }

    #[test]
    fn numbers_are_written_as_the_standard_library_does() {
        let special = [0.0, f64::NAN, f64::INFINITY, f64::MAX, f64::MIN_POSITIVE, f64::EPSILON, 0.1 + 0.2];
        let tens = (-324..=308).map(|power| format!("1e{power}").parse().unwrap());
        let twos = (-1074..=1023).map(|power| 2.0_f64.powi(power));
        for value in special.into_iter().chain(tens).chain(twos) {
            // The notation changes at powers of ten, so test both neighbors too.
            let bits = value.to_bits();
            for near in [bits.saturating_sub(1), bits, bits + 1] {
                assert_as_debug(f64::from_bits(near));
                assert_as_debug(-f64::from_bits(near));
            }
        }
    }

    #[test]
    fn random_numbers_are_written_as_the_standard_library_does() {
        // A linear congruential generator with the multiplier of Knuth's MMIX: its high bits are random enough.
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 32) as u32
        };
        for _ in 0..200_000 {
            // Test any double, a double in the range of signals, and a double with few digits.
            let (high, low) = (random(), random());
            assert_as_debug(f64::from_bits(u64::from(high) << 32 | u64::from(low)));
            let unit = f64::from(low) / f64::from(u32::MAX) - 0.5;
            assert_as_debug(unit * 10_f64.powi((high % 30) as i32 - 10));
            assert_as_debug(f64::from(low % 100_000) * 10_f64.powi((high % 24) as i32 - 12));
        }
    }

    /// `python/tests/test_results.py` has the same numbers and the same line.
    #[test]
    fn numbers_are_written_as_the_python_master_does() {
        let nasty =
            [0.1 + 0.2, -0.0, 5e-324, f64::MAX, 1e-5, 1e16, 123_456_789.123_456_79, 1.0, -2.5e-8, 2.0_f64.powi(-25)];
        assert_eq!(
            nasty.map(written).join(","),
            "0.30000000000000004,-0.0,5e-324,1.7976931348623157e308,1e-5,1e16,123456789.12345679,1.0,-2.5e-8,\
             2.9802322387695312e-8"
        );
    }

    #[test]
    fn no_number_is_longer_than_its_room() {
        assert_eq!(written(-2.225_073_858_507_201_4e-308).len(), MAX_LENGTH);
    }
}
