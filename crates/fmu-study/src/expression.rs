//! Inequalities between arithmetic expressions, such as `m_u * n2 - m_s * n1 > 0`.
//!
//! Numbers, names, `+ - * / ^` (right-associative, binds more than a sign), parentheses, `abs`, `sqrt`, `min`, `max`.
//! Nothing else: an expression can neither loop nor reach anything but the values it is given. Values that are not a
//! number make an inequality false.

use std::ops::Range;

/// Maximum nesting depth; the parser is recursive.
const MAX_DEPTH: usize = 50;

/// Reserved names.
pub const FUNCTIONS: [&str; 4] = ["abs", "sqrt", "min", "max"];

/// A text that is not an inequality.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ExpressionError {
    /// Message: found and expected text.
    pub message: String,
    /// Place in the text, in bytes.
    pub span: Range<usize>,
}

/// `left < right` and the like.
#[derive(Debug, Clone, PartialEq)]
pub struct Inequality {
    left: Node,
    relation: Relation,
    right: Node,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Relation {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Number(f64),
    /// Index into the values.
    Variable(usize),
    Negative(Box<Node>),
    Binary(char, Box<Node>, Box<Node>),
    Function(&'static str, Vec<Node>),
}

impl Inequality {
    /// Parses an inequality. `variables` are the names in the order in which [`Self::holds`] gets their values.
    ///
    /// # Errors
    /// The text is not an inequality or contains an unknown name.
    pub fn parse(text: &str, variables: &[&str]) -> Result<Self, ExpressionError> {
        let tokens = tokens(text)?;
        let mut parser = Parser { tokens: &tokens, at: 0, end: text.len(), variables, depth: 0 };
        let left = parser.sum()?;
        let relation = match parser.peek() {
            Some(Token::Symbol("<")) => Relation::Less,
            Some(Token::Symbol("<=")) => Relation::LessOrEqual,
            Some(Token::Symbol(">")) => Relation::Greater,
            Some(Token::Symbol(">=")) => Relation::GreaterOrEqual,
            _ => return Err(parser.error("expected <, <=, > or >=")),
        };
        parser.at += 1;
        let right = parser.sum()?;
        if parser.peek().is_some() {
            return Err(parser.error("expected the end of the inequality"));
        }
        Ok(Self { left, relation, right })
    }

    /// Returns true if it holds for these values of the variables; false if a side is NaN.
    #[must_use]
    pub fn holds(&self, values: &[f64]) -> bool {
        let (left, right) = (self.left.value(values), self.right.value(values));
        match self.relation {
            Relation::Less => left < right,
            Relation::LessOrEqual => left <= right,
            Relation::Greater => left > right,
            Relation::GreaterOrEqual => left >= right,
        }
    }
}

impl Node {
    fn value(&self, values: &[f64]) -> f64 {
        match self {
            Self::Number(v) => *v,
            // The parser only makes indices of known variables; a missing value is NaN.
            Self::Variable(index) => values.get(*index).copied().unwrap_or(f64::NAN),
            Self::Negative(node) => -node.value(values),
            Self::Binary(operator, a, b) => {
                let (a, b) = (a.value(values), b.value(values));
                match operator {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' => a / b,
                    _ => libm::pow(a, b),
                }
            }
            Self::Function(name, arguments) => {
                let mut arguments = arguments.iter().map(|a| a.value(values));
                let first = arguments.next().unwrap_or(f64::NAN);
                // `f64::min` would drop a NaN.
                let pick = |a: f64, b: f64, first: bool| {
                    if a.is_nan() || b.is_nan() {
                        f64::NAN
                    } else if first {
                        a
                    } else {
                        b
                    }
                };
                match *name {
                    "abs" => first.abs(),
                    "sqrt" => first.sqrt(),
                    "min" => arguments.fold(first, |a, b| pick(a, b, a <= b)),
                    _ => arguments.fold(first, |a, b| pick(a, b, a >= b)),
                }
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Token<'a> {
    Number(f64),
    Name(&'a str),
    Symbol(&'a str),
}

fn tokens(text: &str) -> Result<Vec<(Token<'_>, Range<usize>)>, ExpressionError> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        let byte = bytes[at];
        let take = |from: usize, accept: &dyn Fn(usize) -> bool| {
            (from..bytes.len()).find(|&i| !accept(i)).unwrap_or(bytes.len())
        };
        let token = if byte.is_ascii_whitespace() {
            at += 1;
            continue;
        } else if byte.is_ascii_digit() || byte == b'.' {
            // A sign belongs to a number only after the letter of its exponent.
            at = take(start, &|i| {
                bytes[i].is_ascii_alphanumeric()
                    || bytes[i] == b'.'
                    || (matches!(bytes[i], b'+' | b'-') && matches!(bytes[i - 1], b'e' | b'E'))
            });
            match text[start..at].parse::<f64>() {
                Ok(value) if value.is_finite() => Token::Number(value),
                _ => {
                    return Err(ExpressionError {
                        message: format!("`{}` is no number", &text[start..at]),
                        span: start..at,
                    });
                }
            }
        } else if byte.is_ascii_alphabetic() || byte == b'_' {
            at = take(start, &|i| bytes[i].is_ascii_alphanumeric() || bytes[i] == b'_');
            Token::Name(&text[start..at])
        } else if text[start..].starts_with("<=") || text[start..].starts_with(">=") {
            at += 2;
            Token::Symbol(&text[start..at])
        } else if b"+-*/^(),<>".contains(&byte) {
            at += 1;
            Token::Symbol(&text[start..at])
        } else {
            let length = text[start..].chars().next().map_or(1, char::len_utf8);
            let span = start..start + length;
            return Err(ExpressionError { message: format!("unexpected `{}`", &text[span.clone()]), span });
        };
        tokens.push((token, start..at));
    }
    Ok(tokens)
}

struct Parser<'a> {
    tokens: &'a [(Token<'a>, Range<usize>)],
    at: usize,
    end: usize,
    variables: &'a [&'a str],
    depth: usize,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> Option<Token<'a>> {
        self.tokens.get(self.at).map(|(token, _)| *token)
    }

    fn error(&self, message: impl Into<String>) -> ExpressionError {
        let span = self.tokens.get(self.at).map_or(self.end..self.end, |(_, span)| span.clone());
        ExpressionError { message: message.into(), span }
    }

    /// Takes a symbol if it is next.
    fn take(&mut self, symbols: &[&str]) -> Option<char> {
        match self.peek() {
            Some(Token::Symbol(symbol)) if symbols.contains(&symbol) => {
                self.at += 1;
                symbol.chars().next()
            }
            _ => None,
        }
    }

    fn sum(&mut self) -> Result<Node, ExpressionError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(self.error(format!("nested deeper than {MAX_DEPTH}")));
        }
        let mut node = self.product()?;
        while let Some(operator) = self.take(&["+", "-"]) {
            node = Node::Binary(operator, Box::new(node), Box::new(self.product()?));
        }
        self.depth -= 1;
        Ok(node)
    }

    fn product(&mut self) -> Result<Node, ExpressionError> {
        let mut node = self.signed()?;
        while let Some(operator) = self.take(&["*", "/"]) {
            node = Node::Binary(operator, Box::new(node), Box::new(self.signed()?));
        }
        Ok(node)
    }

    /// A sign binds less than a power: -x^2 is -(x^2).
    fn signed(&mut self) -> Result<Node, ExpressionError> {
        let mut negative = false;
        while let Some(sign) = self.take(&["-", "+"]) {
            negative ^= sign == '-';
        }
        let node = self.power()?;
        Ok(if negative { Node::Negative(Box::new(node)) } else { node })
    }

    fn power(&mut self) -> Result<Node, ExpressionError> {
        let base = self.atom()?;
        if self.take(&["^"]).is_none() {
            return Ok(base);
        }
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(self.error(format!("nested deeper than {MAX_DEPTH}")));
        }
        let exponent = self.signed()?;
        self.depth -= 1;
        Ok(Node::Binary('^', Box::new(base), Box::new(exponent)))
    }

    fn atom(&mut self) -> Result<Node, ExpressionError> {
        match self.peek() {
            Some(Token::Number(value)) => {
                self.at += 1;
                Ok(Node::Number(value))
            }
            Some(Token::Name(name)) => self.name(name),
            Some(Token::Symbol("(")) => {
                self.at += 1;
                let node = self.sum()?;
                self.close()?;
                Ok(node)
            }
            _ => Err(self.error("expected a number, a name or a parenthesis")),
        }
    }

    fn close(&mut self) -> Result<(), ExpressionError> {
        self.take(&[")"]).map(|_| ()).ok_or_else(|| self.error("expected a closing parenthesis"))
    }

    fn name(&mut self, name: &str) -> Result<Node, ExpressionError> {
        if let Some(function) = FUNCTIONS.into_iter().find(|f| *f == name) {
            self.at += 1;
            if self.take(&["("]).is_none() {
                return Err(self.error(format!("expected a parenthesis behind the function `{name}`")));
            }
            let mut arguments = vec![self.sum()?];
            let several = matches!(function, "min" | "max");
            while several && self.take(&[","]).is_some() {
                arguments.push(self.sum()?);
            }
            self.close()?;
            return Ok(Node::Function(function, arguments));
        }
        match self.variables.iter().position(|v| *v == name) {
            Some(index) => {
                self.at += 1;
                Ok(Node::Variable(index))
            }
            None => {
                let near = fmu_import::names::suggestion(name, self.variables.iter().copied().chain(FUNCTIONS));
                let near = near.map_or(String::new(), |s| format!(", {s}"));
                Err(self.error(format!("unknown name `{name}`{near}")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(text: &str, values: &[f64]) -> bool {
        Inequality::parse(text, &["x", "y", "n_1"]).unwrap_or_else(|e| panic!("{text}: {e}")).holds(values)
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
            ("(x > 1", "expected a closing parenthesis", 3..4),
            ("z > 1", "unknown name `z`", 0..1),
            ("n_2 > 1", "unknown name `n_2`, did you mean `n_1`?", 0..3),
            ("1.2.3 > 1", "`1.2.3` is no number", 0..5),
            ("1e999 > 1", "is no number", 0..5),
            ("2x > 1", "`2x` is no number", 0..2),
            ("x = 1", "unexpected `=`", 2..3),
            ("x ≥ 1", "unexpected `≥`", 2..5),
            ("abs x > 1", "expected a parenthesis behind the function `abs`", 4..5),
            ("sqrt(x, 1) > 1", "expected a closing parenthesis", 6..7),
            (deep.as_str(), "nested deeper than 50", 50..51),
            (powers.as_str(), "nested deeper than 50", 100..101),
        ] {
            let error = Inequality::parse(text, &["x", "y", "n_1"]).expect_err(text);
            assert!(error.message.contains(message), "{text}: {error}");
            assert_eq!(error.span, span, "{text}");
        }
    }

    /// The stability conditions of the comfort law (Applied Sciences 2020, 10, 1852, equation 22, and the Routh term it
    /// lacks) at both columns of Table 5, which fulfill them, and beside them.
    #[test]
    fn stability_conditions_of_the_comfort_law() {
        let names = ["n1", "n2", "n3", "m_s", "m_u"];
        let conditions = ["m_u*n2 - m_s*n1 > 0", "m_u - m_s*n3 > 0", "n2 > 0", "n2*n3 - n1 > 0"]
            .map(|t| Inequality::parse(t, &names).unwrap());
        let all = |n1: f64, n2: f64, n3: f64| conditions.each_ref().map(|c| c.holds(&[n1, n2, n3, 1525.0, 50.0]));
        assert_eq!(all(-0.575, 0.6559, 0.0), [true; 4]);
        assert_eq!(all(-2.55, 9.7, -0.063), [true; 4]);
        // The missing term alone: lambda^3 + 1.611 lambda^2 + 938.3 lambda + 4691 has a pair at +1.65 +- 30.9 j (a root
        // finder of another program).
        assert_eq!(all(-0.05, 5.0, -0.1), [true, true, true, false]);
        assert_eq!(all(1.0, 1.0, 0.0), [false, true, true, false]);
        assert_eq!(all(-1.0, 1.0, 0.1), [true, false, true, true]);
    }
}
