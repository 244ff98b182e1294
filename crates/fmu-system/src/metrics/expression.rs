//! Arithmetic with named numbers: metrics computed from metrics, and inequalities between parameters in studies.

use schemars::JsonSchema;
use serde::Serialize;
use std::ops::Range;

const DEPTH: usize = 50;

/// An expression. It is written with `+`, `-`, `*`, `/`, `^`, parentheses, numbers, names of metrics, and the functions
/// `abs(x)`, `sqrt(x)`, `min(x, y)` and `max(x, y)`, the last two also with more arguments.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Expression {
    text: String,
    /// In postfix order: operands, then the operation.
    #[serde(skip)]
    steps: Vec<Step>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    Number(f64),
    /// A named number, by its index.
    Name(usize),
    // Applied to the last operand.
    Negative,
    Abs,
    Sqrt,
    // Applied to the last two operands.
    Plus,
    Minus,
    Times,
    Over,
    Power,
    Min,
    Max,
}

/// Error in an expression, with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExpressionError {
    /// Kind of error.
    pub problem: Problem,
    /// Affected bytes of the text.
    pub place: Range<usize>,
}

/// Kind of error in an expression.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// An unknown name.
    #[error("unknown metric `{0}`")]
    Unknown(String),
    /// An operand is missing.
    #[error("expected a number or a metric")]
    Operand,
    /// Something else is missing or out of place.
    #[error("expected {0}")]
    Expected(&'static str),
    /// Nested too deeply.
    #[error("nested more than {DEPTH} times")]
    TooDeep,
}

impl Expression {
    /// Parses an expression; `index` returns the index of a name.
    ///
    /// # Errors
    /// The text is not an expression, or contains a name that `index` does not find.
    pub fn parse(text: &str, index: impl Fn(&str) -> Option<usize>) -> Result<Self, ExpressionError> {
        let (expression, end) = Self::parse_from(text, 0, index)?;
        if end < text.len() { Err(ExpressionError::at(text, end, "an operator or the end")) } else { Ok(expression) }
    }

    /// Like [`Self::parse`], for the part of a text from `start` on. Any text may follow the expression, whose end is
    /// returned, too.
    pub fn parse_from(
        text: &str,
        start: usize,
        index: impl Fn(&str) -> Option<usize>,
    ) -> Result<(Self, usize), ExpressionError> {
        let mut parser = Parser { text, at: start, depth: 0, index, steps: Vec::new() };
        parser.sum()?;
        parser.skip_blanks();
        Ok((Self { steps: parser.steps, text: text[start..parser.at].to_owned() }, parser.at))
    }

    /// The indices of the metrics that are used, in the order of the text.
    pub fn metrics(&self) -> impl Iterator<Item = usize> {
        self.steps.iter().filter_map(|step| match step {
            Step::Name(index) => Some(*index),
            _ => None,
        })
    }

    /// Computes the value from the values of the metrics. `None` if one of them is undefined, or if the result is not
    /// finite, as after a division by 0.
    pub fn value(&self, metric: impl Fn(usize) -> Option<f64>) -> Option<f64> {
        self.evaluate(metric).filter(|value| value.is_finite())
    }

    /// Computes the number, which may be infinite or NaN. `None` if a named number is missing.
    pub fn evaluate(&self, named: impl Fn(usize) -> Option<f64>) -> Option<f64> {
        let mut stack: Vec<f64> = Vec::new();
        for step in &self.steps {
            let value = match step {
                Step::Number(value) => *value,
                Step::Name(index) => named(*index)?,
                Step::Negative => -stack.pop()?,
                Step::Abs => f64::abs(stack.pop()?),
                Step::Sqrt => f64::sqrt(stack.pop()?),
                Step::Plus | Step::Minus | Step::Times | Step::Over | Step::Power | Step::Min | Step::Max => {
                    let (right, left) = (stack.pop()?, stack.pop()?);
                    match step {
                        Step::Plus => left + right,
                        Step::Minus => left - right,
                        Step::Times => left * right,
                        Step::Over => left / right,
                        Step::Power => libm::pow(left, right),
                        // NaN propagates.
                        Step::Min if right < left || right.is_nan() => right,
                        Step::Max if right > left || right.is_nan() => right,
                        _ => left,
                    }
                }
            };
            stack.push(value);
        }
        stack.pop()
    }
}

impl ExpressionError {
    /// An error that marks the character at `place`.
    pub fn at(text: &str, place: usize, expected: &'static str) -> Self {
        Self { problem: Problem::Expected(expected), place: character(text, place) }
    }
}

/// The bytes of the character at `at`; empty at the end of the text.
fn character(text: &str, at: usize) -> Range<usize> {
    at..at + text[at..].chars().next().map_or(0, char::len_utf8)
}

struct Parser<'a, F> {
    text: &'a str,
    /// Number of bytes read.
    at: usize,
    depth: usize,
    index: F,
    steps: Vec<Step>,
}

type Parsed = Result<(), ExpressionError>;

impl<F: Fn(&str) -> Option<usize>> Parser<'_, F> {
    fn skip_blanks(&mut self) {
        self.at = self.text.len() - self.text[self.at..].trim_start().len();
    }

    fn takes(&mut self, wanted: char) -> bool {
        self.skip_blanks();
        let is_there = self.text[self.at..].starts_with(wanted);
        self.at += if is_there { wanted.len_utf8() } else { 0 };
        is_there
    }

    /// Takes the characters from here on for which `belongs` is true.
    fn taken(&mut self, belongs: impl Fn(char) -> bool) -> (&str, Range<usize>) {
        let rest = &self.text[self.at..];
        let length = rest.find(|c| !belongs(c)).unwrap_or(rest.len());
        let place = self.at..self.at + length;
        self.at = place.end;
        (&self.text[place.clone()], place)
    }

    fn expected(&mut self, what: &'static str) -> Parsed {
        self.skip_blanks();
        Err(ExpressionError::at(self.text, self.at, what))
    }

    fn sum(&mut self) -> Parsed {
        self.chain(Self::product, [('+', Step::Plus), ('-', Step::Minus)])
    }

    fn product(&mut self) -> Parsed {
        self.chain(Self::signed, [('*', Step::Times), ('/', Step::Over)])
    }

    /// Parses operands that are joined by operators of the same precedence, from left to right.
    fn chain(&mut self, operand: fn(&mut Self) -> Parsed, operators: [(char, Step); 2]) -> Parsed {
        operand(self)?;
        while let Some((_, step)) = operators.into_iter().find(|(sign, _)| self.takes(*sign)) {
            operand(self)?;
            self.steps.push(step);
        }
        Ok(())
    }

    /// A sign binds less tightly than a power: -x^2 is -(x^2).
    fn signed(&mut self) -> Parsed {
        self.depth += 1;
        if self.depth > DEPTH {
            self.skip_blanks();
            return Err(ExpressionError { problem: Problem::TooDeep, place: character(self.text, self.at) });
        }
        let mut is_negative = false;
        while let Some(sign) = ['-', '+'].into_iter().find(|sign| self.takes(*sign)) {
            is_negative ^= sign == '-';
        }
        if self.takes('(') {
            self.sum()?;
            self.closes()?;
        } else {
            self.operand()?;
        }
        if self.takes('^') {
            self.signed()?;
            self.steps.push(Step::Power);
        }
        if is_negative {
            self.steps.push(Step::Negative);
        }
        self.depth -= 1;
        Ok(())
    }

    fn closes(&mut self) -> Parsed {
        if self.takes(')') { Ok(()) } else { self.expected("`)`") }
    }

    fn operand(&mut self) -> Parsed {
        self.skip_blanks();
        let first = self.text[self.at..].chars().next();
        if first.is_some_and(|c| c.is_ascii_digit() || c == '.') {
            return self.number();
        }
        if !first.is_some_and(|c| c.is_ascii_alphabetic() || c == '_') {
            return Err(ExpressionError { problem: Problem::Operand, place: character(self.text, self.at) });
        }
        let (name, place) = self.taken(|c| c.is_ascii_alphanumeric() || c == '_');
        let name = name.to_owned();
        if !self.takes('(') {
            let Some(index) = (self.index)(&name) else {
                return Err(ExpressionError { problem: Problem::Unknown(name), place });
            };
            self.steps.push(Step::Name(index));
            return Ok(());
        }
        let (step, has_several) = match name.as_str() {
            "abs" => (Step::Abs, false),
            "sqrt" => (Step::Sqrt, false),
            "min" => (Step::Min, true),
            "max" => (Step::Max, true),
            _ => {
                let problem = Problem::Expected("one of the functions abs, sqrt, min and max");
                return Err(ExpressionError { problem, place });
            }
        };
        self.sum()?;
        if !has_several {
            self.steps.push(step);
            return self.closes();
        }
        if !self.takes(',') {
            return self.expected("`,` and a second number");
        }
        loop {
            self.sum()?;
            self.steps.push(step);
            if !self.takes(',') {
                return self.closes();
            }
        }
    }

    fn number(&mut self) -> Parsed {
        let start = self.at;
        self.taken(|c| c.is_ascii_digit() || c == '.');
        // An exponent has a sign and digits after the letter; without digits the letter is not part of the number.
        let rest = &self.text[self.at..];
        if let Some(exponent) = rest.strip_prefix(['e', 'E']) {
            let sign = usize::from(exponent.starts_with(['+', '-']));
            if exponent[sign..].starts_with(|c: char| c.is_ascii_digit()) {
                self.at += 1 + sign;
                self.taken(|c| c.is_ascii_digit());
            }
        }
        match self.text[start..self.at].parse::<f64>() {
            Ok(value) if value.is_finite() => {
                self.steps.push(Step::Number(value));
                Ok(())
            }
            _ => Err(ExpressionError { problem: Problem::Expected("a finite number"), place: start..self.at }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Expression, ExpressionError> {
        let names = ["peak", "final", "e1"];
        Expression::parse(text, |name| names.iter().position(|known| *known == name))
    }

    fn value(text: &str) -> Option<f64> {
        parse(text).unwrap().value(|index| [Some(8.0), Some(2.0), None][index])
    }

    /// Expected values computed by hand.
    #[test]
    fn expressions_follow_the_rules_of_arithmetic() {
        for (text, expected) in [
            ("final / peak", 0.25),
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("10 - 4 - 3", 3.0),
            ("16 / 4 / 2", 2.0),
            ("-peak + 2 * -final", -12.0),
            ("--peak", 8.0),
            ("100*(peak-final)/peak", 75.0),
            ("abs(final - peak)", 6.0),
            ("sqrt(peak * final)", 4.0),
            ("min(peak, final) + max(1, 2)", 4.0),
            ("1e3 + 1.5E-1 + .5", 1000.65),
            ("2 ^ 3 ^ 2 - -2 ^ 2", 516.0),
            ("min(3, +1, 2)", 1.0),
        ] {
            assert_eq!(value(text), Some(expected), "{text}");
        }
    }

    #[test]
    fn without_a_number_there_is_none() {
        for text in ["e1", "0 * e1", "1 / 0", "0 / 0", "sqrt(-1)", "max(0 / 0, 1)", "min(1, 0 / 0)", "1e308 * 10"] {
            assert_eq!(value(text), None, "{text}");
        }
    }

    #[test]
    fn mistakes_have_a_place() {
        let nested = "(".repeat(60);
        for (text, message, place) in [
            ("", "expected a number or a metric", 0..0),
            ("peak / ", "expected a number or a metric", 7..7),
            ("peak final", "expected an operator or the end", 5..6),
            ("peak + last", "unknown metric `last`", 7..11),
            ("(peak", "expected `)`", 5..5),
            ("min(peak)", "expected `,` and a second number", 8..9),
            ("sin(peak)", "expected one of the functions abs, sqrt, min and max", 0..3),
            ("1.2.3", "expected a finite number", 0..5),
            ("1e999", "expected a finite number", 0..5),
            ("2e", "expected an operator or the end", 1..2),
            ("peak × 2", "expected an operator or the end", 5..7),
            (&nested, "nested more than 50 times", 50..51),
        ] {
            let error = parse(text).unwrap_err();
            assert_eq!((error.problem.to_string().as_str(), error.place), (message, place), "{text}");
        }
    }

    #[test]
    fn metrics_are_listed() {
        assert_eq!(parse("final / peak - final").unwrap().metrics().collect::<Vec<_>>(), [1, 0, 1]);
    }
}
