//! Metrics as JSON.

use crate::metric::{Metric, Value};
use serde::Serialize;
use std::collections::BTreeMap;

/// A part of the document. The maps are sorted, whatever the features of `serde_json` are.
#[derive(Serialize)]
#[serde(untagged)]
enum Node {
    Null,
    Boolean(bool),
    Number(f64),
    Numbers(Vec<Option<f64>>),
    Group(BTreeMap<String, Node>),
}

/// Metrics as an object of JSON: keys sorted, numbers with 9 significant digits. A dot in a name makes a group, `yaw_rate.gain` is
/// `{"yaw_rate": {"gain": …}}`. What cannot be computed is null.
pub(crate) fn document(metrics: &[Metric]) -> String {
    let mut document = BTreeMap::new();
    for metric in metrics {
        insert(&mut document, &metric.name, node(&metric.value));
    }
    // Maps of strings, numbers that are finite and Booleans can always be written.
    serde_json::to_string_pretty(&document).unwrap_or_default()
}

fn insert(group: &mut BTreeMap<String, Node>, name: &str, node: Node) {
    let Some((first, rest)) = name.split_once('.') else {
        group.insert(name.to_owned(), node);
        return;
    };
    let member = group.entry(first.to_owned()).or_insert_with(|| Node::Group(BTreeMap::new()));
    if let Node::Group(group) = member {
        insert(group, rest, node);
    }
}

fn node(value: &Value) -> Node {
    match value {
        Value::Number(number) => rounded(*number).map_or(Node::Null, Node::Number),
        Value::Boolean(boolean) => Node::Boolean(*boolean),
        Value::Numbers(numbers) => Node::Numbers(numbers.iter().map(|number| number.and_then(rounded)).collect()),
        Value::Null(_) => Node::Null,
    }
}

/// The double nearest to a number of 9 significant digits. `None`: it is not finite. Zero has no sign.
pub(crate) fn rounded(number: f64) -> Option<f64> {
    let rounded: f64 = format!("{number:.8e}").parse().ok()?;
    rounded.is_finite().then_some(rounded + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{Definition, Reason};

    #[test]
    fn keys_are_sorted_and_numbers_have_9_digits() {
        static DEFINITION: Definition = Definition::new("any", "Any", "1", "Anything.");
        let metric = |name: &str, value| Metric { name: name.to_owned(), definition: &DEFINITION, value };
        let metrics = [
            metric("z.second", Value::Number(std::f64::consts::PI * 1e-7)),
            metric("z.first", Value::Boolean(true)),
            metric("a", Value::Null(Reason::new("no reason"))),
            metric("m", Value::Numbers(vec![Some(-0.0), None, Some(f64::INFINITY), Some(20.0)])),
        ];
        let compact: String = document(&metrics).split_whitespace().collect();
        assert_eq!(compact, "{\"a\":null,\"m\":[0.0,null,null,20.0],\"z\":{\"first\":true,\"second\":3.14159265e-7}}");
    }
}
