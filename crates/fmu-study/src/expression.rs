//! Inequalities between arithmetic expressions, such as `m_u * n2 - m_s * n1 > 0`.
//!
//! NaN makes an inequality false.

use fmu_system::metrics::{self, Expression, Problem};
use std::ops::Range;

pub(crate) const FUNCTIONS: [&str; 4] = ["abs", "sqrt", "min", "max"];

/// Error in the text of an inequality: message, and place in the text in bytes.
type Mistake = (String, Range<usize>);

/// Compares two numbers; false if one is NaN.
type Relation = fn(&f64, &f64) -> bool;

const RELATIONS: [(&str, Relation); 4] = [("<=", f64::le), (">=", f64::ge), ("<", f64::lt), (">", f64::gt)];

/// An inequality such as `left < right`.
#[derive(Debug, Clone)]
pub(crate) struct Inequality {
    left: Expression,
    relation: Relation,
    right: Expression,
}

impl Inequality {
    /// Parses an inequality. `variables` are the names in the order in which [`Self::holds`] gets their values.
    pub(crate) fn parse(text: &str, variables: &[&str]) -> Result<Self, Mistake> {
        let described = |error| described(error, variables);
        let index = |name: &str| variables.iter().position(|variable| *variable == name);
        let (left, at) = Expression::parse_from(text, 0, index).map_err(described)?;
        let Some((symbol, relation)) = RELATIONS.iter().find(|(symbol, _)| text[at..].starts_with(symbol)) else {
            return Err(described(metrics::ExpressionError::at(text, at, "<, <=, > or >=")));
        };
        let (right, end) = Expression::parse_from(text, at + symbol.len(), index).map_err(described)?;
        if end < text.len() {
            return Err(described(metrics::ExpressionError::at(text, end, "the end of the inequality")));
        }
        Ok(Self { left, relation: *relation, right })
    }

    /// Returns true if the inequality holds for these values of the variables; false if a side is NaN.
    pub(crate) fn holds(&self, values: &[f64]) -> bool {
        let side = |side: &Expression| side.evaluate(|index| values.get(index).copied());
        side(&self.left).zip(side(&self.right)).is_some_and(|(left, right)| (self.relation)(&left, &right))
    }
}

fn described(error: metrics::ExpressionError, variables: &[&str]) -> Mistake {
    let message = match error.problem {
        Problem::Unknown(name) if FUNCTIONS.contains(&name.as_str()) => {
            format!("expected a parenthesis after the function `{name}`")
        }
        Problem::Unknown(name) => {
            let near = fmu_import::names::suggestion(&name, variables.iter().copied().chain(FUNCTIONS));
            format!("unknown name `{name}`{}", near.map_or(String::new(), |near| format!(", {near}")))
        }
        Problem::Operand => "expected a number, a name or a parenthesis".to_owned(),
        other => other.to_string(),
    };
    (message, error.place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(text: &str, values: &[f64]) -> bool {
        Inequality::parse(text, &["x", "y", "n_1"]).unwrap_or_else(|e| panic!("{text}: {e:?}")).holds(values)
    }

    #[test]
    fn precedence_and_association() {
        for text in [
            "1 + 2 * 3 >= 7",
            "1 + 2 * 3 <= 7",
            "(1 + 2) * 3 >= 9",
            "10 - 3 - 2 <= 5",
            "16 / 4 / 2 <= 2",
            "2 ^ 3 ^ 2 >= 512",
            "-2 ^ 2 <= -4",
            "2 ^ -1 >= 0.5",
            "--1 > 0",
            "- -1 > -+1",
            "1e-3 < 1.5E+2",
            ".5 + 1. >= 1.5",
            "max(1, min(5, 3, 4), 2) >= 3",
            "abs(-2) + sqrt(4) >= 4",
            "x*y + n_1 > 6.9",
        ] {
            assert!(holds(text, &[2.0, 3.0, 1.0]), "{text}");
        }
    }

    #[test]
    fn strict_and_not() {
        assert!(!holds("x > y", &[1.0, 1.0]) && holds("x >= y", &[1.0, 1.0]));
        assert!(!holds("x < y", &[1.0, 1.0]) && holds("x <= y", &[1.0, 1.0]));
    }

    /// NaN fulfills no inequality, in either direction.
    #[test]
    fn not_a_number_is_false() {
        for text in ["sqrt(x) < 1", "sqrt(x) >= 1", "0/0 <= 0", "min(1, sqrt(x)) <= 1", "max(sqrt(x), 1) >= 1"] {
            assert!(!holds(text, &[-1.0]), "{text}");
        }
    }

    #[test]
    fn mistakes_have_a_place() {
        let deep = format!("{}x > 0", "(".repeat(60));
        let powers = format!("{}x > 0", "x^".repeat(60));
        for (text, message, span) in [
            ("x", "expected <, <=, > or >=", 1..1),
            ("x > ", "expected a number, a name or a parenthesis", 4..4),
            ("x > 1 2", "expected the end", 6..7),
            ("x > 1 > 2", "expected the end", 6..7),
            ("(x > 1", "expected `)`", 3..4),
            ("z > 1", "unknown name `z`", 0..1),
            ("n_2 > 1", "unknown name `n_2`, did you mean `n_1`?", 0..3),
            ("1.2.3 > 1", "expected a finite number", 0..5),
            ("1e999 > 1", "expected a finite number", 0..5),
            ("2x > 1", "expected <, <=, > or >=", 1..2),
            ("x = 1", "expected <, <=, > or >=", 2..3),
            ("x ≥ 1", "expected <, <=, > or >=", 2..5),
            ("abs x > 1", "expected a parenthesis after the function `abs`", 0..3),
            ("sqrt(x, 1) > 1", "expected `)`", 6..7),
            (deep.as_str(), "nested more than 50 times", 50..51),
            (powers.as_str(), "nested more than 50 times", 100..101),
        ] {
            let error = Inequality::parse(text, &["x", "y", "n_1"]).expect_err(text);
            assert!(error.0.contains(message), "{text}: {}", error.0);
            assert_eq!(error.1, span, "{text}");
        }
    }

    /// The stability conditions of the comfort law: equation 22 in Applied Sciences 2020, 10, 1852, and the Routh
    /// condition that the paper omits. Both columns of Table 5 fulfill the conditions; the other values violate some.
    #[test]
    fn stability_conditions_of_the_comfort_law() {
        let names = ["n1", "n2", "n3", "m_s", "m_u"];
        let conditions = ["m_u*n2 - m_s*n1 > 0", "m_u - m_s*n3 > 0", "n2 > 0", "n2*n3 - n1 > 0"]
            .map(|t| Inequality::parse(t, &names).unwrap());
        let all = |n1: f64, n2: f64, n3: f64| conditions.each_ref().map(|c| c.holds(&[n1, n2, n3, 1525.0, 50.0]));
        assert_eq!(all(-0.575, 0.6559, 0.0), [true; 4]);
        assert_eq!(all(-2.55, 9.7, -0.063), [true; 4]);
        // Only the condition that the paper omits is violated: lambda^3 + 1.611 lambda^2 + 938.3 lambda + 4691 has a
        // pair of roots at +1.65 +- 30.9 j, according to the root finder of another program.
        assert_eq!(all(-0.05, 5.0, -0.1), [true, true, true, false]);
        assert_eq!(all(1.0, 1.0, 0.0), [false, true, true, false]);
        assert_eq!(all(-1.0, 1.0, 0.1), [true, false, true, true]);
    }
}
