//! Values of all types: reads the values of an FMU, and chooses other values to set.

use super::{CheckResult, Trial, is_plain, moved};
use fmu_import::description::{Causality, DataType, Initial, Value, Variability, Variable};
use fmu_import::loader::Instance;

impl Trial<'_> {
    /// Variables whose value at the start is the start value in the description.
    pub(super) fn exact(&self) -> Vec<usize> {
        self.filtered(|variable| {
            variable.start.is_some()
                && (matches!(variable.causality, Causality::Parameter | Causality::Input)
                    || variable.initial == Some(Initial::Exact))
        })
    }

    /// Variables that can be set before initialization (FMI 2.0.4, section 4.2.4).
    pub(super) fn settable(&self) -> Vec<usize> {
        self.filtered(|variable| {
            variable.start.is_some()
                && is_variable(variable)
                && (matches!(variable.causality, Causality::Parameter | Causality::Input)
                    || matches!(variable.initial, Some(Initial::Exact | Initial::Approx)))
        })
    }

    /// Variables that can be set in Initialization Mode (FMI 2.0.4, section 4.2.4): the knowns of InitialUnknowns.
    pub(super) fn settable_in_initialization(&self) -> Vec<usize> {
        self.filtered(|variable| {
            is_variable(variable)
                && (matches!(variable.causality, Causality::Parameter | Causality::Input)
                    || variable.initial == Some(Initial::Exact))
        })
    }

    pub(super) fn settable_between_steps(&self) -> Vec<usize> {
        self.filtered(|variable| match variable.causality {
            Causality::Parameter => variable.variability == Variability::Tunable,
            causality => causality == Causality::Input,
        })
    }

    /// Parameters and inputs. A master can read the values that it has set.
    pub(super) fn given(&self) -> Vec<usize> {
        self.filtered(|variable| matches!(variable.causality, Causality::Parameter | Causality::Input))
    }

    pub(super) fn filtered(&self, is_wanted: impl Fn(&Variable) -> bool) -> Vec<usize> {
        let variables = self.description.variables.iter().enumerate();
        variables.filter(|(_, variable)| is_plain(variable) && is_wanted(variable)).map(|(i, _)| i).collect()
    }

    pub(super) fn values(&self, instance: &mut Instance, variables: &[usize]) -> CheckResult<Vec<Value>> {
        variables.iter().map(|&i| read(instance, self.variable(i))).collect()
    }

    /// Sets variables to other values than their start values. Returns the variables whose value the FMU rejected.
    pub(super) fn change(&self, instance: &mut Instance, variables: &[usize]) -> Vec<usize> {
        let is_rejected = |i: &usize| {
            let variable = self.variable(*i);
            let others = variable.start.as_ref().map_or(Vec::new(), |start| others(variable, start));
            !others.is_empty() && !others.iter().any(|value| instance.set_value(variable.reference, value).is_ok())
        };
        variables.iter().copied().filter(is_rejected).collect()
    }

    /// The first variable whose values differ, both values, and the number of such variables.
    pub(super) fn difference(&self, variables: &[usize], before: &[Value], after: &[Value]) -> Option<Difference<'_>> {
        let mut differing = variables.iter().zip(before.iter().zip(after)).filter(|(_, (a, b))| !is_same(a, b));
        let (&i, (before, after)) = differing.next()?;
        Some(Difference {
            name: &self.variable(i).name,
            before: before.clone(),
            after: after.clone(),
            others: differing.count(),
        })
    }
}

/// False for constants, and for structural parameters, which can be set in Configuration Mode only.
fn is_variable(variable: &Variable) -> bool {
    variable.variability != Variability::Constant && variable.causality != Causality::StructuralParameter
}

/// A variable that has another value than before.
pub(super) struct Difference<'a> {
    pub(super) name: &'a str,
    pub(super) before: Value,
    pub(super) after: Value,
    others: usize,
}

impl Difference<'_> {
    /// ` (and 3 other variables)`, or nothing.
    pub(super) fn others(&self) -> String {
        match self.others {
            0 => String::new(),
            1 => " (and 1 other variable)".to_owned(),
            n => format!(" (and {n} other variables)"),
        }
    }
}

/// Real numbers are compared bit by bit.
pub(super) fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Real(a), Value::Real(b)) => a.to_bits() == b.to_bits(),
        _ => a == b,
    }
}

/// Values near this one, but different enough to show whether anything depends on the variable. They may be outside the
/// limits.
pub(super) fn changes(variable: &Variable, value: &Value) -> Vec<Value> {
    match value {
        Value::Real(value) => [1e-3, -1e-3].map(|part| Value::Real(moved(*value, part, variable.data_type))).into(),
        _ => others(variable, value),
    }
}

/// Values other than the start value, within the limits. The first value that the FMU accepts is used.
fn others(variable: &Variable, start: &Value) -> Vec<Value> {
    let (min, max) = (variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY));
    match start {
        Value::Boolean(start) => vec![Value::Boolean(!start)],
        Value::String(start) => vec![Value::String(format!("{start}x"))],
        Value::Real(start) => {
            let [above, below] = [1e-3, -1e-3].map(|part| moved(*start, part, variable.data_type));
            let candidates = [above, below, 0.5 * (start + max), 0.5 * (start + min)];
            let is_other = |value: &f64| value.is_finite() && (min..=max).contains(value) && value != start;
            candidates.into_iter().filter(is_other).map(Value::Real).collect()
        }
        Value::Integer(start) if variable.items.is_empty() => {
            let candidates = [start.checked_add(1), start.checked_sub(1)].into_iter().flatten();
            candidates.filter(|value| (min..=max).contains(&(*value as f64))).map(Value::Integer).collect()
        }
        Value::Unsigned(start) => {
            let lower = start.checked_sub(1).filter(|value| (min..=max).contains(&(*value as f64)));
            lower.and_then(|value| Value::integer(value.into())).into_iter().collect()
        }
        Value::Binary { hex } => {
            let longer = hex.iter().chain(b"x").copied().collect();
            let shorter = hex.split_last().map(|(_, rest)| rest.to_vec());
            let is_allowed = |value: &Vec<u8>| variable.max_size.is_none_or(|most| value.len() <= most);
            let values = std::iter::once(longer).chain(shorter).filter(is_allowed);
            values.map(|hex| Value::Binary { hex }).collect()
        }
        Value::Integer(start) => {
            let items = variable.items.iter().map(|item| i64::from(item.value)).filter(|value| value != start);
            items.take(2).map(Value::Integer).collect()
        }
    }
}

/// True for an integer that may have more than 32 bits while the FMU runs.
pub(super) fn is_wide(variable: &Variable) -> bool {
    matches!(variable.data_type, DataType::UInt32 | DataType::Int64 | DataType::UInt64)
}

/// True for an array that has its start values when the FMU starts.
pub(super) fn has_starts(variable: &Variable) -> bool {
    let is_exact = matches!(variable.causality, Causality::Parameter | Causality::Input)
        || variable.initial == Some(Initial::Exact);
    is_exact && !variable.starts.is_empty()
}

pub(super) fn read(instance: &mut Instance, variable: &Variable) -> CheckResult<Value> {
    instance.get_values(variable).map(|mut values| values.remove(0))
}
