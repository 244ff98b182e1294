//! Metrics as JSON.

use crate::metric::Metric;
use serde_json::{Map, Value, json};

/// Metrics as a JSON object, as described at `Evaluation::to_json`.
pub(crate) fn document(metrics: &[Metric]) -> Value {
    let mut document = Map::new();
    for metric in metrics {
        insert(&mut document, &metric.name, all_rounded(&json!(metric.value)));
    }
    document.into()
}

fn insert(group: &mut Map<String, Value>, name: &str, value: Value) {
    let Some((first, rest)) = name.split_once('.') else {
        group.insert(name.to_owned(), value);
        return;
    };
    let member = group.entry(first).or_insert_with(|| Map::new().into());
    if let Value::Object(group) = member {
        insert(group, rest, value);
    }
}

/// Rounds all numbers to nine significant digits.
pub fn all_rounded(value: &Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => json!(number.as_f64().and_then(rounded)),
        Value::Array(values) => values.iter().map(all_rounded).collect(),
        Value::Object(table) => table.iter().map(|(name, value)| (name.clone(), all_rounded(value))).collect(),
        other => other.clone(),
    }
}

/// Rounds a number to 9 significant digits; `None` if it is not finite. Zero has no sign.
fn rounded(number: f64) -> Option<f64> {
    let rounded: f64 = format!("{number:.8e}").parse().ok()?;
    rounded.is_finite().then_some(rounded + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{Definition, Value};

    #[test]
    fn keys_are_sorted_and_numbers_have_9_digits() {
        static DEFINITION: Definition = Definition::neutral("any", "Any", "1");
        let metric = |name: &str, value| Metric { name: name.to_owned(), definition: &DEFINITION, value };
        let metrics = [
            metric("z.second", Value::Number(std::f64::consts::PI * 1e-7)),
            metric("z.first", Value::Boolean(true)),
            metric("a", Value::Null("no reason".to_owned())),
            metric("m", Value::Numbers(vec![Some(-0.0), None, Some(f64::INFINITY), Some(20.0)])),
        ];
        let compact = document(&metrics).to_string();
        assert_eq!(compact, "{\"a\":null,\"m\":[0.0,null,null,20.0],\"z\":{\"first\":true,\"second\":3.14159265e-7}}");
    }

    #[test]
    fn numbers_have_nine_digits() {
        assert_eq!(
            all_rounded(&json!({ "b": [1.0 / 3.0, true, null], "a": 3 })),
            json!({ "a": 3, "b": [0.333333333, true, null] })
        );
    }
}
