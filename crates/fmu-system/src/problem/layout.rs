//! Rewrites messages of the TOML parser for authors of scenarios.

use fmu_import::names::suggestion;

/// Keys of earlier versions, and their current names.
const RENAMED: [(&str, &str); 1] = [("unit", "component")];

/// Returns message and hint for an error in the layout of a file.
pub(super) fn explain(error: &toml::de::Error, text: &str) -> (String, Option<String>) {
    let message = error.message().replace('\n', ", ");
    let key = error.span().and_then(|span| key_before(text, span.start));
    // The parser reads integers of 64 bits with a sign.
    if message.starts_with("u64 value was too large") {
        let message = "integers must be at most 9223372036854775807".to_owned();
        return (message, Some("write the value of a larger UInt64 in quotes".to_owned()));
    }
    if let Some(message) = wrong_type(&message, key) {
        return (message, None);
    }
    // serde writes "unknown field `a`, expected one of `b`, `c`".
    let mut quoted = message.split('`').skip(1).step_by(2);
    let unknown = quoted.next().filter(|_| message.starts_with("unknown "));
    let known: Vec<&str> = quoted.collect();
    let renamed = RENAMED.iter().find(|(old, new)| unknown == Some(old) && known.contains(new));
    let help = match renamed {
        None if message == "duplicate key" => {
            Some("write all entries of a list inside `name = [...]`, or all of them as `[[name]]`".to_owned())
        }
        Some((old, new)) => Some(format!("`{old}` is called `{new}` now")),
        None => unknown.and_then(|name| suggestion(name, known)),
    };
    let message = match key {
        // For an unknown field, the name in the message is the key itself.
        Some(key) if message.starts_with("unknown variant") => {
            format!("`{key}`: {}", message.replacen("unknown variant", "unknown word", 1))
        }
        Some(key) if message.starts_with("must be ") => format!("`{key}` {message}"),
        _ => message.replacen("unknown field", "unknown key", 1).replacen("missing field", "missing key", 1),
    };
    (message, help)
}

/// Rewrites a message from serde about a wrong type. For example, `invalid type: string "20", expected f64` becomes
/// "`stop` must be a number, got the string "20"". Returns `None` for other messages.
fn wrong_type(message: &str, key: Option<&str>) -> Option<String> {
    let rest = ["invalid type: ", "invalid value: ", "invalid length "].iter().find_map(|p| message.strip_prefix(p))?;
    let (found, expected) = rest.rsplit_once(", expected ")?;
    let found = match found.split_once(' ') {
        _ if message.starts_with("invalid length") => format!("{found} elements"),
        Some(("string", text)) => format!("the string {text}"),
        Some(("integer" | "boolean", value)) => value.trim_matches('`').to_string(),
        Some(("floating", value)) => value.trim_start_matches("point ").trim_matches('`').to_string(),
        _ => match found {
            "sequence" => "a list".to_string(),
            "map" => "a table".to_string(),
            other => other.to_string(),
        },
    };
    let expected = match expected {
        "f64" | "f32" | "floating point" => "a number",
        "i64" | "i32" => "a whole number",
        "u8" => "a whole number from 0 to 255",
        "u32" | "u64" | "usize" => "a whole number of at least 0",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "a table",
        "an array of length 2" | "a tuple of size 2" => "a list of 2 numbers",
        other if other.starts_with("struct ") => "a table",
        other => other,
    };
    Some(match key {
        Some(key) => format!("`{key}` must be {expected}, got {found}"),
        None => format!("expected {expected}, got {found}"),
    })
}

/// Finds the key whose value, or list, contains a place; `None` if there is none.
fn key_before(text: &str, at: usize) -> Option<&str> {
    let mut before = text.get(..at)?;
    // If the place is in a list, go back to the start of the list.
    if before.trim_end().ends_with(['[', ',']) {
        before = before.rsplit_once('[')?.0;
        while before.trim_end().ends_with(['[', ',']) {
            before = before.rsplit_once('[')?.0;
        }
    }
    let before = before.trim_end().strip_suffix('=')?.trim_end();
    if let Some(quoted) = before.strip_suffix('"') {
        return quoted.rsplit_once('"').map(|(_, key)| key);
    }
    let start = before.rfind(|c: char| !(c.is_alphanumeric() || "_-.".contains(c))).map_or(0, |i| i + 1);
    Some(&before[start..]).filter(|key| !key.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spanned::Spanned;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Layout {
        #[serde(rename = "stop")]
        _stop: Option<Spanned<f64>>,
        #[serde(rename = "every")]
        _every: Option<Spanned<i64>>,
        #[serde(rename = "digits")]
        _digits: Option<u8>,
        #[serde(rename = "window")]
        _window: Option<Spanned<[f64; 2]>>,
        #[serde(rename = "title")]
        _title: Option<String>,
        #[serde(rename = "log")]
        _log: Option<bool>,
        #[serde(rename = "seeds")]
        _seeds: Option<Vec<Spanned<i32>>>,
        #[serde(rename = "kind")]
        _kind: Option<crate::metrics::Kind>,
        #[serde(rename = "inner")]
        _inner: Option<Box<Layout>>,
        #[serde(rename = "a.b", default)]
        _dotted: std::collections::BTreeMap<String, f64>,
    }

    #[test]
    fn types_are_explained_without_the_words_of_a_programming_language() {
        for (text, expected) in [
            ("stop = \"20\"", "`stop` must be a number, got the string \"20\""),
            ("stop = true", "`stop` must be a number, got true"),
            ("stop = [1.0]", "`stop` must be a number, got a list"),
            ("every = 1.5", "`every` must be a whole number, got 1.5"),
            ("digits = -3", "`digits` must be a whole number from 0 to 255, got -3"),
            ("title = 3", "`title` must be a string, got 3"),
            ("log = \"yes\"", "`log` must be true or false, got the string \"yes\""),
            ("window = 1.0", "`window` must be a list of 2 numbers, got 1.0"),
            ("window = [1.0]", "`window` must be a list of 2 numbers, got 1 elements"),
            ("window = [0.0, \"end\"]", "`window` must be a number, got the string \"end\""),
            ("seeds = [1,\n  \"2\"]", "`seeds` must be a whole number, got the string \"2\""),
            ("inner = 3", "`inner` must be a table, got 3"),
            ("inner = { stop = \"x\" }", "`stop` must be a number, got the string \"x\""),
            ("\"a.b\" = { \"c.d\" = \"x\" }", "`c.d` must be a number, got the string \"x\""),
            ("kind = \"RMS\"", "`kind`: unknown word `RMS`, expected one of `rms`"),
            ("stopp = 1", "unknown key `stopp`"),
        ] {
            let error = toml::from_str::<Layout>(text).expect_err(text);
            let (message, _) = explain(&error, text);
            assert!(message.starts_with(expected), "{text}: {message}\n  expected {expected}");
        }
    }

    /// The error about a key from an earlier version contains the new name, but only where the new name is a key.
    #[test]
    fn renamed_keys_are_named() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Scenario {
            #[serde(rename = "component")]
            _components: Vec<Layout>,
        }
        let text = "[[unit]]\nstop = 1.0";
        let (message, help) = explain(&toml::from_str::<Scenario>(text).unwrap_err(), text);
        assert!(message.starts_with("unknown key `unit`"), "{message}");
        assert_eq!(help.as_deref(), Some("`unit` is called `component` now"));
        let (_, help) = explain(&toml::from_str::<Layout>("unit = 1").unwrap_err(), "unit = 1");
        assert_eq!(help, None);
    }

    #[test]
    fn a_list_that_is_written_in_two_ways_has_a_help() {
        let text = "metric = [{ name = \"a\" }]\n[[metric]]\nname = \"b\"";
        let (message, help) = explain(&toml::from_str::<toml::Table>(text).unwrap_err(), text);
        assert_eq!(message, "duplicate key");
        assert!(help.is_some_and(|help| help.contains("`[[name]]`")));
    }

    /// TOML 1.0.0, section Integer.
    #[test]
    fn integers_beyond_64_bits_with_a_sign_have_a_help() {
        let text = "id = 9223372036854775808";
        let (message, help) = explain(&toml::from_str::<toml::Table>(text).unwrap_err(), text);
        assert_eq!(message, "integers must be at most 9223372036854775807");
        assert_eq!(help.as_deref(), Some("write the value of a larger UInt64 in quotes"));
    }

    #[test]
    fn words_in_capitals_are_suggested() {
        let text = "kind = \"RMS\"";
        let (_, help) = explain(&toml::from_str::<Layout>(text).unwrap_err(), text);
        assert_eq!(help.as_deref(), Some("did you mean `rms`?"));
    }
}
