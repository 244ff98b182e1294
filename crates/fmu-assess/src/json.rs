//! Metrics as JSON.

use crate::metric::{Metric, Value};
use serde_json::{Map, json};

/// Metrics as an object of JSON: keys sorted, numbers with 9 significant digits. A dot in a name makes a group, `yaw_rate.gain` is
/// `{"yaw_rate": {"gain": …}}`. What cannot be computed is null.
pub(crate) fn document(metrics: &[Metric]) -> serde_json::Value {
    let mut document = Map::new();
    for metric in metrics {
        insert(&mut document, &metric.name, value(&metric.value));
    }
    document.into()
}

fn insert(group: &mut Map<String, serde_json::Value>, name: &str, value: serde_json::Value) {
    let Some((first, rest)) = name.split_once('.') else {
        group.insert(name.to_owned(), value);
        return;
    };
    let member = group.entry(first).or_insert_with(|| Map::new().into());
    if let serde_json::Value::Object(group) = member {
        insert(group, rest, value);
    }
}

fn value(value: &Value) -> serde_json::Value {
    match value {
        Value::Number(number) => json!(rounded(*number)),
        Value::Boolean(boolean) => json!(boolean),
        Value::Numbers(numbers) => numbers.iter().map(|number| json!(number.and_then(rounded))).collect(),
        Value::Null(_) => serde_json::Value::Null,
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
        let compact = document(&metrics).to_string();
        assert_eq!(compact, "{\"a\":null,\"m\":[0.0,null,null,20.0],\"z\":{\"first\":true,\"second\":3.14159265e-7}}");
    }
}
