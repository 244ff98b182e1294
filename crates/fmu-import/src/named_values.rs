//! Names for the values of Integer variables.
//!
//! In FMI 2.0, only the values of enumerations have names. For masters that cannot set enumerations, FMUs use Integer
//! variables instead. By convention, the description of such a variable ends with a list of all values and their names:
//! `How the driver steers (0 straight, 1 ramp_step, 2 fishhook)`.

use crate::description::{BaseType, Variable};

impl Variable {
    /// The named values of an Integer or Enumeration variable, in the order of the description.
    pub fn named_values(&self) -> Vec<(i32, &str)> {
        if !self.items.is_empty() {
            return self.items.iter().map(|item| (item.value, item.name.as_str())).collect();
        }
        if self.base_type != BaseType::Integer {
            return Vec::new();
        }
        self.description.as_deref().and_then(list_at_end).unwrap_or_default()
    }
}

/// Formats named values for a message: `straight (0), ramp_step (1)`.
pub fn listed(values: &[(i32, &str)]) -> String {
    let values: Vec<String> = values.iter().map(|(value, name)| format!("{name} ({value})")).collect();
    values.join(", ")
}

/// Parses the list in parentheses at the end of a text; an entry is a whole number and an identifier, both unique.
fn list_at_end(text: &str) -> Option<Vec<(i32, &str)>> {
    let (_, list) = text.strip_suffix(')')?.rsplit_once('(')?;
    let mut values: Vec<(i32, &str)> = Vec::new();
    for entry in list.split(", ") {
        let (value, name) = entry.split_once(' ')?;
        let value = value.parse().ok()?;
        let is_identifier = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        if !is_identifier || values.iter().any(|(v, n)| *v == value || *n == name) {
            return None;
        }
        values.push((value, name));
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::ModelDescription;

    #[test]
    fn only_complete_lists_name_values() {
        let named = [(0, "straight"), (1, "ramp_step")];
        assert_eq!(list_at_end("How the driver steers (0 straight, 1 ramp_step)").as_deref(), Some(&named[..]));
        assert_eq!(list_at_end("Offset (mm) (-1 left, 1 right)"), Some(vec![(-1, "left"), (1, "right")]));
        for text in [
            "",
            "Class of ISO 8608, 1 (A) to 8 (H)",
            "Boundary layer (0: a pure sign, as in the paper)",
            "Number of periods (0 for no end)",
            "Mode (0 a, 0 b)",
            "Mode (0 a, 1 a)",
            "Mode (0 a, 1 b) of the car",
            "Mode (0 a; 1 b)",
        ] {
            assert_eq!(list_at_end(text), None, "{text}");
        }
    }

    /// The named values of an enumeration are its items. A Real has no named values, even if its description has a
    /// list.
    #[test]
    fn items_and_types() {
        let text = include_str!("../tests/data/Vehicle.xml").replacen(
            "description=\"Whole vehicle\"",
            "description=\"Whole vehicle (0 light, 1 heavy)\"",
            1,
        );
        let description = ModelDescription::parse(&text).unwrap();
        let values = |name| description.variable(name).unwrap().named_values();
        assert_eq!(values("tire.mode"), [(0, "magic"), (1, "linear")]);
        assert_eq!(values("vehicle.mass"), []);
        assert_eq!(listed(&values("tire.mode")), "magic (0), linear (1)");
    }
}
