//! Metrics: definitions and values.

use serde::Serialize;

/// Definition of a metric.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Definition {
    /// Name. A dot separates the group from the metric: `yaw_rate.gain`.
    pub name: &'static str,
    /// Title for tables and plots.
    pub title: &'static str,
    /// Unit of measure; `1` if it has none.
    pub unit: &'static str,
    /// Computation, in words.
    pub definition: &'static str,
    /// The better direction.
    pub direction: Direction,
    /// Group of columns, each of which gives a separate metric: `tire_load` gives `name.fl`, `name.fr` and so on.
    pub places: Option<&'static str>,
    /// Column whose largest magnitude is the metric.
    pub(crate) peak_of: Option<&'static str>,
}

impl Definition {
    /// A metric without a preferred direction, whose definition follows.
    pub(crate) const fn neutral(name: &'static str, title: &'static str, unit: &'static str) -> Self {
        Self { name, title, unit, definition: "", direction: Direction::None, places: None, peak_of: None }
    }

    /// A metric of which lower values are better.
    pub(crate) const fn lower(name: &'static str, title: &'static str, unit: &'static str) -> Self {
        Self::neutral(name, title, unit).down()
    }

    /// A metric of which higher values are better.
    pub(crate) const fn higher(name: &'static str, title: &'static str, unit: &'static str) -> Self {
        Self { direction: Direction::Up, ..Self::neutral(name, title, unit) }
    }

    /// Lower values are better.
    pub(crate) const fn down(self) -> Self {
        Self { direction: Direction::Down, ..self }
    }

    /// One metric for each column `places.*`.
    pub(crate) const fn each(self, places: &'static str) -> Self {
        Self { places: Some(places), ..self }
    }

    pub(crate) const fn is(self, definition: &'static str) -> Self {
        Self { definition, ..self }
    }
}

/// The better direction of a metric.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Higher values.
    Up,
    /// Lower values.
    Down,
    /// Neither: the metric describes the vehicle.
    None,
}

/// Value of a metric.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A finite number, in the unit of the definition.
    Number(f64),
    /// True or false.
    Boolean(bool),
    /// Several numbers. An element is `None` where the definition gives no value.
    Numbers(Vec<Option<f64>>),
    /// The value cannot be computed.
    #[serde(serialize_with = "null")]
    Null(Reason),
}

fn null<S: serde::Serializer>(_: &Reason, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_none()
}

/// Reason that a value cannot be computed.
pub type Reason = String;

/// A metric of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Metric {
    /// Name from the definition. If there is one metric for each column of a group, the name ends with the suffix of
    /// the column: `dynamic_load_coefficient.fl`.
    pub name: String,
    /// Definition.
    pub definition: &'static Definition,
    /// Its value.
    pub value: Value,
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        if number.is_finite() {
            Self::Number(number)
        } else {
            Self::Null("the result is not a finite number".to_owned())
        }
    }
}

impl From<bool> for Value {
    fn from(boolean: bool) -> Self {
        Self::Boolean(boolean)
    }
}

impl From<Vec<f64>> for Value {
    fn from(numbers: Vec<f64>) -> Self {
        numbers.into_iter().map(Some).collect::<Vec<_>>().into()
    }
}

impl From<Vec<Option<f64>>> for Value {
    fn from(numbers: Vec<Option<f64>>) -> Self {
        Self::Numbers(numbers.into_iter().map(|number| number.filter(|number| number.is_finite())).collect())
    }
}

impl<T: Into<Self>> From<Result<T, Reason>> for Value {
    fn from(result: Result<T, Reason>) -> Self {
        result.map_or_else(Self::Null, Into::into)
    }
}

/// The metrics that an evaluator has computed.
pub(crate) struct Results {
    table: &'static [Definition],
    metrics: Vec<Metric>,
    /// Notes on the values for the user.
    pub(crate) notes: Vec<String>,
}

impl Results {
    pub(crate) fn new(table: &'static [Definition]) -> Self {
        Self { table, metrics: Vec::new(), notes: Vec::new() }
    }

    pub(crate) fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.insert(name, name.to_owned(), value.into());
    }

    pub(crate) fn set_at(&mut self, name: &str, place: &str, value: impl Into<Value>) {
        self.insert(name, format!("{name}.{place}"), value.into());
    }

    fn insert(&mut self, of: &str, name: String, value: Value) {
        let definition = self.table.iter().find(|definition| definition.name == of);
        debug_assert!(definition.is_some(), "`{of}` is not in the table of the evaluator");
        self.metrics.extend(definition.map(|definition| Metric { name, definition, value }));
    }

    /// All metrics, in the order of the table. Metrics that were not set get `reason`.
    pub(crate) fn finish(mut self, reason: &Reason) -> Vec<Metric> {
        for definition in self.table {
            if !self.metrics.iter().any(|metric| metric.definition.name == definition.name) {
                self.set(definition.name, Value::Null(reason.clone()));
            }
        }
        self.metrics.sort_by_key(|metric| self.table.iter().position(|of| of.name == metric.definition.name));
        self.metrics
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static TABLE: [Definition; 3] = [
        Definition::neutral("a", "A", "1").is("Something."),
        Definition::lower("b", "B", "1").is("Something of each wheel.").each("tire_load"),
        Definition::neutral("c", "C", "1").is("Something else."),
    ];

    #[test]
    fn metrics_are_in_the_order_of_the_table() {
        let mut results = Results::new(&TABLE);
        results.set("c", true);
        results.set_at("b", "fr", 2.0);
        results.set_at("b", "fl", f64::NAN);
        let metrics = results.finish(&"not set".to_owned());
        let names: Vec<&str> = metrics.iter().map(|metric| &*metric.name).collect();
        assert_eq!(names, ["a", "b.fr", "b.fl", "c"]);
        assert_eq!(metrics[0].value, Value::Null("not set".to_owned()));
        assert_eq!(metrics[1].value, Value::Number(2.0));
        assert_eq!(metrics[2].value, Value::Null("the result is not a finite number".to_owned()));
        assert_eq!(metrics[3].value, Value::Boolean(true));
        assert_eq!(metrics[2].definition.direction, Direction::Down);
    }
}
