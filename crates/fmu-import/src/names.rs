//! Suggestions for misspelled names.

use std::collections::BTreeSet;

/// "did you mean …?" with the most similar candidate, if one is similar enough. Ignores case.
pub fn suggestion<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    // At most a third of the characters may differ: enough for typing errors, too few for accidental matches. A name of
    // one character is not similar to any other name.
    let limit = (name.chars().count() / 3).max(usize::from(name.chars().count() > 1));
    let name = name.to_lowercase();
    // The edit distance is at least the difference in length. This test skips most long names.
    let length = name.chars().count();
    candidates
        .into_iter()
        .filter(|c| c.to_lowercase().chars().count().abs_diff(length) <= limit)
        .map(|c| (strsim::damerau_levenshtein(&name, &c.to_lowercase()), c))
        .filter(|(distance, _)| *distance <= limit)
        .min()
        .map(|(_, nearest)| format!("did you mean `{nearest}`?"))
}

/// Like [`suggestion`], but if no candidate is similar enough, lists those that share the most words with the name.
pub fn similar<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str> + Clone) -> Option<String> {
    const SHOWN: usize = 4;
    // Words of one or two characters match by accident.
    let words = |name: &str| -> BTreeSet<String> {
        name.to_lowercase()
            .split(|letter: char| !letter.is_alphanumeric())
            .filter(|word| word.len() > 2)
            .map(str::to_owned)
            .collect()
    };
    let wanted = words(name);
    suggestion(name, candidates.clone()).or_else(|| {
        let shared = |other: &str| words(other).intersection(&wanted).count();
        let mut names: Vec<(usize, &str)> =
            candidates.into_iter().map(|other| (shared(other), other)).filter(|(count, _)| *count > 0).collect();
        names.sort_by_key(|(count, other)| (std::cmp::Reverse(*count), *other));
        names.dedup();
        let names: Vec<String> = names.iter().take(SHOWN).map(|(_, name)| format!("`{name}`")).collect();
        (!names.is_empty()).then(|| format!("similar names: {}", names.join(", ")))
    })
}

/// Formats the expected names for a message: `rad`, or `one of rad, deg`.
pub fn any_of(names: &[&str]) -> String {
    match names {
        [name] => (*name).to_owned(),
        names => format!("one of {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_the_same_words_are_similar() {
        let names = ["body.roll", "body.roll_rate", "vehicle.speed", "body.roll"];
        assert_eq!(similar("body.rol", names).unwrap(), "did you mean `body.roll`?");
        assert_eq!(similar("roll_rate", names).unwrap(), "similar names: `body.roll_rate`, `body.roll`");
        assert_eq!(
            similar("vehicle:roll", names).unwrap(),
            "similar names: `body.roll`, `body.roll_rate`, `vehicle.speed`"
        );
        assert_eq!(similar("tire.slip", names), None);
    }

    #[test]
    fn near_names_are_suggested_and_far_ones_not() {
        let names = ["body.roll", "body.roll_rate", "vehicle.speed"];
        let near = suggestion("body.rol", names).unwrap();
        assert_eq!(near, "did you mean `body.roll`?");
        assert_eq!(suggestion("wheel_height.fl", names), None);
        assert_eq!(suggestion("RMS", ["rms", "peak"]).unwrap(), "did you mean `rms`?");
        assert_eq!(suggestion("espcar", ["EspCar"]).unwrap(), "did you mean `EspCar`?");
    }
}
