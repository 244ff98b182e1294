//! Options of evaluators.

use crate::components::SetupError;
use serde::Deserialize as _;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Keys that describe how a recording was made. Every evaluator accepts and ignores them.
pub(crate) const DESCRIPTIVE: [&str; 6] =
    ["driver_parameters", "parameters", "plant", "plant_parameters", "step", "vehicle.speed"];

/// An option of an evaluator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OptionRule {
    /// Name.
    pub name: &'static str,
    /// Unit of measure; `1` if it has none.
    pub unit: &'static str,
    /// Allowed values.
    pub form: Form,
    /// Value if the option is not given.
    pub default: Fallback,
    /// Meaning of the option, and of its absence.
    pub meaning: &'static str,
}

impl OptionRule {
    /// An option whose meaning follows.
    pub(crate) const fn new(name: &'static str, unit: &'static str, form: Form, default: Fallback) -> Self {
        Self { name, unit, form, default, meaning: "" }
    }

    pub(crate) const fn is(self, meaning: &'static str) -> Self {
        Self { meaning, ..self }
    }
}

/// Allowed values of an option.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// A number above 0.
    Positive,
    /// A number of at least 0.
    NotNegative,
    /// Any finite number.
    Number,
    /// One of these integers.
    Integer(&'static [u8]),
    /// One of these words.
    Word(&'static [&'static str]),
    /// Coned sections, each as [x begin, x end, right edge, left edge], m.
    Lanes,
}

/// Value of an option that is not given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fallback {
    /// The option is required.
    Required,
    /// The option may be left out; [`OptionRule::meaning`] describes this case.
    Absent,
    /// A number.
    Number(f64),
    /// A word.
    Word(&'static str),
}

/// A coned section of a track, m: begin, end, right edge, left edge.
pub(crate) type Lane = [f64; 4];

/// Checked options.
#[derive(Debug)]
pub(crate) struct Options(BTreeMap<&'static str, Value>);

impl Options {
    /// Checks options against the rules of an evaluator.
    pub(crate) fn new(
        evaluator: &'static str,
        rules: &'static [OptionRule],
        given: &Value,
    ) -> Result<Self, SetupError> {
        let Value::Object(given) = given else {
            return Err(SetupError::with_help(
                format!("the options must be an object such as {{\"steer.ratio\": 16}}, got {given}"),
                "Write the options as JSON: names in double quotes, in braces.",
            ));
        };
        let is_known =
            |name: &String| rules.iter().any(|rule| rule.name == name) || DESCRIPTIVE.contains(&name.as_str());
        if let Some(name) = given.keys().find(|name| !is_known(name)) {
            let known: Vec<&str> = rules.iter().map(|rule| rule.name).collect();
            let help = match known[..] {
                [] => "It has no options: leave it out.".to_owned(),
                _ => format!("Use one of `{}`, or leave it out.", known.join("`, `")),
            };
            return Err(SetupError::with_help(format!("`{evaluator}` has no option `{name}`"), help));
        }
        let mut options = BTreeMap::new();
        for rule in rules {
            if let Some(value) = rule.value(evaluator, given)? {
                options.insert(rule.name, value);
            }
        }
        Ok(Self(options))
    }

    /// A number; `None` if the option was left out and has no default.
    pub(crate) fn given(&self, name: &str) -> Option<f64> {
        self.0.get(name)?.as_f64()
    }

    /// A number that is required or has a default.
    pub(crate) fn number(&self, name: &str) -> f64 {
        debug_assert!(self.given(name).is_some(), "`{name}` is not a number with a default");
        self.given(name).unwrap_or(f64::NAN)
    }

    /// A word that is required or has a default.
    pub(crate) fn word(&self, name: &str) -> &str {
        self.0.get(name).and_then(Value::as_str).unwrap_or_default()
    }

    pub(crate) fn lanes(&self, name: &str) -> Option<Vec<Lane>> {
        lanes(self.0.get(name)?)
    }
}

impl OptionRule {
    fn value(&self, evaluator: &'static str, given: &Map<String, Value>) -> Result<Option<Value>, SetupError> {
        let Some(value) = given.get(self.name) else {
            return match self.default {
                Fallback::Required => Err(SetupError::with_help(
                    format!("`{evaluator}` needs the option `{}`: {}", self.name, self.meaning),
                    format!("Add it to the options: {{\"{}\": VALUE}}.", self.name),
                )),
                Fallback::Absent => Ok(None),
                Fallback::Number(number) => Ok(Some(number.into())),
                Fallback::Word(word) => Ok(Some(word.into())),
            };
        };
        let number = value.as_f64().filter(|number| number.is_finite());
        let is_allowed = match self.form {
            Form::Positive => number.is_some_and(|number| number > 0.0),
            Form::NotNegative => number.is_some_and(|number| number >= 0.0),
            Form::Number => number.is_some(),
            Form::Integer(allowed) => number.is_some_and(|number| allowed.iter().any(|one| f64::from(*one) == number)),
            Form::Word(allowed) => value.as_str().is_some_and(|word| allowed.contains(&word)),
            Form::Lanes => lanes(value).is_some(),
        };
        is_allowed.then(|| Some(value.clone())).ok_or_else(|| {
            SetupError::with_help(
                format!("the option `{}` of `{evaluator}` must be {}, got {value}", self.name, self.form.rule()),
                "Change the value, or leave the option out if it has a default.",
            )
        })
    }
}

impl Form {
    /// The allowed values, as the end of "must be".
    fn rule(self) -> String {
        match self {
            Self::Positive => "a positive number".to_owned(),
            Self::NotNegative => "a number of at least 0".to_owned(),
            Self::Number => "a number".to_owned(),
            Self::Integer(allowed) => allowed.iter().map(u8::to_string).collect::<Vec<_>>().join(" or "),
            Self::Word(allowed) => allowed.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(" or "),
            Self::Lanes => {
                "a list of sections [x begin, x end, right edge, left edge] with begin < end and right < left"
                    .to_owned()
            }
        }
    }
}

fn lanes(value: &Value) -> Option<Vec<Lane>> {
    let lanes: Vec<Lane> = Vec::deserialize(value).ok()?;
    let is_section = |[begin, end, right, left]: &Lane| begin < end && right < left;
    (!lanes.is_empty() && lanes.iter().all(is_section)).then_some(lanes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    static RULES: [OptionRule; 4] = [
        OptionRule { name: "ratio", unit: "1", form: Form::Positive, default: Fallback::Required, meaning: "a ratio" },
        OptionRule {
            name: "class",
            unit: "1",
            form: Form::Word(&["car", "truck"]),
            default: Fallback::Word("car"),
            meaning: "a class",
        },
        OptionRule {
            name: "track",
            unit: "1",
            form: Form::Integer(&[2, 3]),
            default: Fallback::Number(2.0),
            meaning: "a track",
        },
        OptionRule { name: "lanes", unit: "m", form: Form::Lanes, default: Fallback::Absent, meaning: "lanes" },
    ];

    #[test]
    fn options_have_defaults() {
        let options = Options::new("e", &RULES, &json!({"ratio": 16, "step": 0.001, "plant": "EspCar"})).unwrap();
        assert_eq!((options.number("ratio"), options.number("track")), (16.0, 2.0));
        assert_eq!(options.word("class"), "car");
        assert_eq!(options.lanes("lanes"), None);
        let options = Options::new("e", &RULES, &json!({"ratio": 1, "lanes": [[0, 1, -1.5, 2]]})).unwrap();
        assert_eq!(options.lanes("lanes"), Some(vec![[0.0, 1.0, -1.5, 2.0]]));
    }

    #[test]
    fn mistakes_name_the_option_and_the_rule() {
        for (given, expected) in [
            (json!([1]), "the options must be an object such as {\"steer.ratio\": 16}, got [1]"),
            (json!({}), "`e` needs the option `ratio`: a ratio"),
            (json!({"ratio": 0}), "the option `ratio` of `e` must be a positive number, got 0"),
            (json!({"ratio": "16"}), "the option `ratio` of `e` must be a positive number, got \"16\""),
            (json!({"ratio": null}), "the option `ratio` of `e` must be a positive number, got null"),
            (json!({"ratio": 1, "class": "bus"}), "must be \"car\" or \"truck\", got \"bus\""),
            (json!({"ratio": 1, "track": 4}), "the option `track` of `e` must be 2 or 3, got 4"),
            (json!({"ratio": 1, "lanes": []}), "must be a list of sections"),
            (json!({"ratio": 1, "lanes": [[0, 1, 2]]}), "must be a list of sections"),
            (json!({"ratio": 1, "lanes": [[0, 1, 2, -2]]}), "right < left, got [[0,1,2,-2]]"),
            (json!({"ratios": 1}), "`e` has no option `ratios`"),
        ] {
            let error = Options::new("e", &RULES, &given).unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
            assert!(error.help.is_some());
        }
    }
}
