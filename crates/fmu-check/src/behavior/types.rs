//! Inputs of the types that only FMI 3.0 has, at the limits of their types, and arrays.

use super::values::is_same;
use super::{CheckResult, Report, Trial, found, moved};
use crate::Finding;
use fmu_import::description::{BaseType, Causality, DataType, FmiVersion, Value, Variable};
use fmu_import::loader::Instance;

/// Largest Binary that the trial sets, bytes.
const LARGEST: usize = 1 << 20;

impl Trial<'_> {
    /// Sets inputs in Initialization Mode and reads them back. The FMU may reject a value, but an accepted value must be
    /// read back.
    pub(super) fn types(&self, report: Report<'_>) -> CheckResult<()> {
        let is_tried = |variable: &&Variable| {
            let is_plain = matches!(variable.data_type, DataType::Float64 | DataType::Int32 | DataType::Boolean);
            let is_input = variable.causality == Causality::Input && variable.alias_of.is_none();
            is_input && variable.clocks.is_empty() && (variable.is_array() || !is_plain)
        };
        let variables: Vec<&Variable> = self.description.variables.iter().filter(is_tried).collect();
        if self.description.fmi == FmiVersion::V2 || variables.is_empty() {
            return Ok(());
        }
        let mut instance = self.initializing("types")?;
        for variable in variables {
            let tried: Vec<Vec<Value>> = match variable.base_type {
                _ if variable.is_array() => vec![distinct(variable)],
                BaseType::Binary => binaries(variable),
                _ => limits(variable).into_iter().map(|value| vec![value]).collect(),
            };
            for values in tried.iter().filter(|values| !values.is_empty()) {
                if !round_trip(&mut instance, variable, values, report)? {
                    // After an error, an instance can only be reset or freed.
                    drop(instance);
                    instance = self.initializing("types")?;
                }
            }
            let Some(larger) = too_large(variable) else { continue };
            if instance.set_binary(&[variable.reference], &[&larger]).is_ok() {
                let most = larger.len() - 1;
                let message = format!("accepts {} bytes, although its `maxSize` is {most}", larger.len());
                found(report, Finding::warning(format!("variable `{}`", variable.name), message));
            } else {
                drop(instance);
                instance = self.initializing("types")?;
            }
        }
        Ok(())
    }
}

/// Sets a variable and reports a different value that is then read. Returns false if the FMU rejects the values.
fn round_trip(instance: &mut Instance, variable: &Variable, values: &[Value], report: Report<'_>) -> CheckResult<bool> {
    let accepted = match values {
        // The FMU must copy the bytes, because the importer may change them after the call (FMI 3.0.2, section 2.2.6.2).
        [Value::Binary { hex }] => {
            let mut lent = hex.clone();
            let accepted = instance.set_binary(&[variable.reference], &[&lent]);
            lent.fill(0xee);
            std::hint::black_box(&lent);
            accepted.and_then(|()| instance.get_values(variable))
        }
        values => instance.set_values(variable, values).and_then(|()| instance.get_values(variable)),
    };
    let Ok(read) = accepted else { return Ok(false) };
    let mut elements = variable.elements().into_iter().zip(values.iter().zip(&read));
    if let Some((name, (set, read))) = elements.find(|(_, (set, read))| !is_same(set, read)) {
        let message = format!("is set to {set}, but then has the value {read}");
        found(report, Finding::error(format!("variable `{name}`"), message));
    }
    Ok(true)
}

/// The limits of a scalar's type, within those that the variable declares.
fn limits(variable: &Variable) -> Vec<Value> {
    let within =
        |value: f64| variable.min.is_none_or(|min| value >= min) && variable.max.is_none_or(|max| value <= max);
    match variable.data_type {
        DataType::Float32 => {
            let values = [f32::MIN, f32::MAX, f32::MIN_POSITIVE].map(f64::from);
            values.into_iter().filter(|value| within(*value)).map(Value::Real).collect()
        }
        DataType::Enumeration | DataType::String => Vec::new(),
        _ => {
            let range = variable.integers();
            let ends = [*range.start(), *range.end()].into_iter().filter(|value| within(*value as f64));
            ends.filter_map(Value::integer).collect()
        }
    }
}

/// A different value for each element of an array, in the order of the elements; empty if there are too few values.
fn distinct(variable: &Variable) -> Vec<Value> {
    let (min, max) = (variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY));
    let is_float32 = variable.data_type == DataType::Float32;
    let other = |(index, start): (usize, &Value)| match start {
        Value::Real(start) => {
            let value = moved(*start, 1e-3 * (index + 1) as f64, variable.data_type);
            Some(Value::Real(if is_float32 { f64::from(value as f32) } else { value }))
        }
        Value::Integer(_) | Value::Unsigned(_) if variable.items.is_empty() => {
            let value = start.whole()? + index as i128;
            variable.integers().contains(&value).then(|| Value::integer(value)).flatten()
        }
        Value::Boolean(_) => Some(Value::Boolean(index % 3 == 0)),
        Value::String(start) => Some(Value::String(format!("{start}{index}"))),
        Value::Binary { .. } => {
            let bytes = index.to_le_bytes()[..variable.max_size.map_or(2, |most| most.min(2))].to_vec();
            Some(Value::Binary { hex: bytes })
        }
        _ => None,
    };
    let values: Option<Vec<Value>> = variable.starts.iter().enumerate().map(other).collect();
    let is_within = |value: &Value| match value {
        Value::Real(value) => (min..=max).contains(value),
        value => value.whole().is_none_or(|value| (min..=max).contains(&(value as f64))),
    };
    values.filter(|values| values.iter().all(is_within)).unwrap_or_default()
}

/// An empty Binary, and one with the largest size.
fn binaries(variable: &Variable) -> Vec<Vec<Value>> {
    let largest = variable.max_size.filter(|most| *most <= LARGEST).unwrap_or(1);
    let of = |size: usize| Value::Binary { hex: (0..size).map(|index| (index % 251 + 1) as u8).collect() };
    vec![vec![of(0)], vec![of(largest)]]
}

/// A Binary with one byte more than the largest size, if the variable is a scalar with a `maxSize`.
fn too_large(variable: &Variable) -> Option<Vec<u8>> {
    let most = variable.max_size.filter(|most| *most <= LARGEST && !variable.is_array())?;
    Some(vec![1; most + 1])
}
