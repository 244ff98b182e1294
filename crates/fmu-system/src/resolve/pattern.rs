//! Patterns of signal names.

pub(super) fn split_pattern(text: &str) -> (Option<&str>, &str) {
    match text.split_once(':') {
        Some((component, pattern)) => (Some(component), pattern),
        None => (None, text),
    }
}

pub(super) fn is_match(text: &str, component: &str, signal: &str) -> bool {
    let (of, pattern) = split_pattern(text);
    of.is_none_or(|of| of == component) && matches(pattern, signal)
}

/// Returns true if a name matches a pattern, in which `*` stands for any characters.
pub(super) fn matches(pattern: &str, name: &str) -> bool {
    let Some((first, rest)) = pattern.split_once('*') else {
        return pattern == name;
    };
    let Some(mut name) = name.strip_prefix(first) else {
        return false;
    };
    let (middle, last) = rest.rsplit_once('*').unwrap_or(("", rest));
    // The leftmost match of each part leaves the most text for the parts that follow.
    for part in middle.split('*') {
        let Some(at) = name.find(part) else {
            return false;
        };
        name = &name[at + part.len()..];
    }
    name.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn patterns() {
        for (pattern, name, expected) in [
            ("body.roll", "body.roll", true),
            ("body.roll", "body.roll_rate", false),
            ("body.*", "body.roll", true),
            ("*", "", true),
            ("*.fl", "road_height.fl", true),
            ("*.fl", "road_height.fr", false),
            ("a*b*c", "a-b-b-c", true),
            ("a*b*c", "acb", false),
            ("a*a", "a", false),
            ("**", "x", true),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }
}
