//! Linear models of FMUs with continuous states, from directional derivatives, or from differences in model exchange.

use fmu_import::archive::Archive;
use fmu_import::bytes::BinaryText;
use fmu_import::description::{BaseType, Causality, DataType, Initial, Interface, ModelDescription, Value, Variable};
use fmu_import::fmu::Fmu;
use fmu_import::loader::{CallError, Instance};
use fmu_import::named_values::listed;
use fmu_import::names::suggestion;
use std::path::Path;

/// A linear model x' = A x + B u, y = C x + D u around an operating point.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Linear {
    /// Names of the states x.
    pub states: Vec<String>,
    /// Names of the inputs u.
    pub inputs: Vec<String>,
    /// Names of the outputs y.
    pub outputs: Vec<String>,
    /// \[A B; C D\], column by column.
    #[serde(skip)]
    pub jacobian: Vec<f64>,
    /// True if the Jacobian is from central differences instead of directional derivatives.
    pub by_differences: bool,
}

/// Step of central differences for doubles and for Float32, relative to the value or its nominal value. It is the cube
/// root of the rounding error (1e-16 and 6e-8), at which rounding and truncation errors are about equal.
const DIFFERENCE: [f64; 2] = [6e-6, 4e-3];
/// Maximum number of updates of the discrete states in the first event.
const ROUNDS: usize = 100;

/// Linearizes an FMU at its start values, some of which `settings` changes. The binary is loaded into this process.
///
/// # Errors
/// The FMU cannot be used, has no continuous states, or has neither directional derivatives nor the interface for model
/// exchange, or a value cannot be set.
pub fn linearize(path: &Path, settings: &[(String, String)]) -> Result<Linear, String> {
    let archive = Archive::open(path).and_then(|mut archive| archive.description());
    let description = &archive.map_err(|error| error.to_string())?;
    let (interface, has_derivatives) = interface(description);
    let has_differences = !has_derivatives && description.model_exchange.is_some();
    let interface = if has_differences { Interface::ModelExchange } else { interface };
    let fmu = Fmu::open_for(path, interface).map_err(|error| error.to_string())?;
    let cannot = |why: &str| Err(format!("{} cannot be linearized: {why}", description.model_name));
    if description.derivatives.is_empty() {
        return cannot("it lists no continuous states");
    }
    if !has_derivatives && !has_differences {
        return cannot(
            "it has neither directional derivatives nor the interface for model exchange, which differences need; \
             export it with one of the two",
        );
    }
    let call = |error: CallError| error.to_string();
    let mut instance = fmu.instantiate("linearize").map_err(|error| error.to_string())?;
    instance.setup_experiment(0.0, None).map_err(call)?;
    for (name, value) in settings {
        set(&mut instance, description, name, value).map_err(|message| format!("--set {name}={value}: {message}"))?;
    }
    instance.enter_initialization_mode().map_err(call)?;

    let derivatives: Vec<&Variable> =
        description.derivatives.iter().map(|unknown| &description.variables[unknown.variable]).collect();
    let state = |derivative: &&Variable| {
        let state = derivative.derivative_of.map(|state| &description.variables[state]);
        state
            .ok_or_else(|| format!("`{}` is listed as a derivative but has no attribute `derivative`", derivative.name))
    };
    let states: Vec<&Variable> = derivatives.iter().map(state).collect::<Result<_, _>>()?;
    let real = |causality: Causality| -> Vec<&Variable> {
        let is_wanted =
            |v: &&Variable| v.causality == causality && v.base_type == BaseType::Real && v.alias_of.is_none();
        description.variables.iter().filter(is_wanted).collect()
    };
    let (inputs, outputs) = (real(Causality::Input), real(Causality::Output));

    let elements = |variables: &[&Variable]| variables.iter().flat_map(|variable| variable.elements()).collect();
    let (names_of_states, names_of_inputs, names_of_outputs) =
        (elements(&states), elements(&inputs), elements(&outputs));
    let linear = |jacobian| Linear {
        states: names_of_states,
        inputs: names_of_inputs,
        outputs: names_of_outputs,
        jacobian,
        by_differences: !has_derivatives,
    };
    if !has_derivatives {
        return by_differences(&mut instance, &inputs, &outputs).map(linear).map_err(call);
    }
    let unknown: Vec<_> = derivatives.iter().chain(&outputs).map(|variable| variable.reference).collect();
    let mut jacobian = Vec::new();
    let mut column = vec![0.0; derivatives.iter().chain(&outputs).map(|variable| variable.size).sum()];
    for known in states.iter().chain(&inputs) {
        let mut seed = vec![0.0; known.size];
        for element in 0..known.size {
            seed.fill(0.0);
            seed[element] = 1.0;
            instance.get_directional_derivative(&unknown, &[known.reference], &seed, &mut column).map_err(call)?;
            jacobian.extend_from_slice(&column);
        }
    }
    Ok(linear(jacobian))
}

/// \[A B; C D\], column by column, by central differences in Continuous-Time Mode, which this function enters.
fn by_differences(instance: &mut Instance, inputs: &[&Variable], outputs: &[&Variable]) -> Result<Vec<f64>, CallError> {
    instance.exit_initialization_mode()?;
    for _ in 0..ROUNDS {
        if !instance.new_discrete_states()?.is_needed_again {
            break;
        }
    }
    instance.enter_continuous_time_mode()?;
    let is_single = inputs.iter().chain(outputs).any(|variable| variable.data_type == DataType::Float32);
    let size = |variables: &[&Variable]| variables.iter().map(|variable| variable.size).sum::<usize>();
    let references = |variables: &[&Variable]| variables.iter().map(|variable| variable.reference).collect::<Vec<_>>();
    let (given, read) = (references(inputs), references(outputs));
    let number = instance.number_of_states();
    let (mut states, mut nominals, mut values) = (vec![0.0; number], vec![1.0; number], vec![0.0; size(inputs)]);
    instance.get_continuous_states(&mut states)?;
    instance.get_nominals(&mut nominals)?;
    if !given.is_empty() {
        instance.get_real(&given, &mut values)?;
    }
    nominals.extend(inputs.iter().flat_map(|input| vec![input.nominal.unwrap_or(1.0); input.size]));

    // The point contains the states, followed by the inputs.
    let mut point: Vec<f64> = states.iter().chain(&values).copied().collect();
    let mut at = |point: &[f64]| -> Result<Vec<f64>, CallError> {
        let mut found = vec![0.0; number + size(outputs)];
        instance.set_continuous_states(&point[..number])?;
        if !given.is_empty() {
            instance.set_real(&given, &point[number..])?;
        }
        let (derivatives, results) = found.split_at_mut(number);
        instance.get_derivatives(derivatives)?;
        if !read.is_empty() {
            instance.get_real(&read, results)?;
        }
        Ok(found)
    };
    let mut jacobian = Vec::new();
    for column in 0..point.len() {
        let center = point[column];
        let step = DIFFERENCE[usize::from(is_single)] * center.abs().max(nominals[column].abs());
        let (above, below) = (center + step, center - step);
        point[column] = above;
        let high = at(&point)?;
        point[column] = below;
        let low = at(&point)?;
        point[column] = center;
        // The divisor is the distance of the two points, which rounding makes slightly different from twice the step.
        jacobian.extend(high.iter().zip(&low).map(|(high, low)| (high - low) / (above - below)));
    }
    Ok(jacobian)
}

/// The interface to use, and true if it has directional derivatives.
pub(crate) fn interface(description: &ModelDescription) -> (Interface, bool) {
    let mut interfaces = description.interfaces();
    interfaces.retain(|interface| *interface != Interface::ScheduledExecution);
    let has_derivatives =
        |of: &&Interface| description.interface(**of).is_some_and(|unit| unit.provides_directional_derivative);
    match interfaces.iter().find(has_derivatives) {
        Some(interface) => (*interface, true),
        None => (interfaces.first().copied().unwrap_or(Interface::ModelExchange), false),
    }
}

/// Finds the scalar variable with a name, and its index.
pub(crate) fn find<'d>(description: &'d ModelDescription, name: &str) -> Result<(usize, &'d Variable), String> {
    let index = description.index(name).ok_or_else(|| {
        let near = suggestion(name, description.variables.iter().map(|variable| variable.name.as_str()));
        let hint = near.map_or_else(String::new, |near| format!("; {near}"));
        format!("{} has no variable `{name}`{hint}", description.model_name)
    })?;
    let variable = &description.variables[index];
    if variable.is_array() {
        return Err(format!("`{name}` is an array of {} elements; only scalars can be set", variable.size));
    }
    Ok((index, variable))
}

fn set(instance: &mut Instance, description: &ModelDescription, name: &str, value: &str) -> Result<(), String> {
    let (_, variable) = find(description, name)?;
    let is_settable = matches!(variable.causality, Causality::Parameter | Causality::Input)
        || variable.initial == Some(Initial::Exact);
    if !is_settable {
        return Err(format!("`{name}` is neither a parameter, an input nor a state"));
    }
    match parse(variable, value)? {
        Value::String(_) => Err(format!("`{name}` is a String; a linear model depends on numbers only")),
        value => instance.set_value(variable.reference, &value).map_err(|error| error.to_string()),
    }
}

/// Parses a value from the command line. An Integer whose values have names may be given by name.
pub(crate) fn parse(variable: &Variable, text: &str) -> Result<Value, String> {
    let unit = variable.unit.as_ref().map_or_else(String::new, |unit| format!(" in {unit}, without the unit"));
    let expected = |what: &str| format!("`{}` must be {what}, got `{text}`", variable.name);
    match variable.base_type {
        BaseType::Real => text.parse().map(Value::Real).map_err(|_| expected(&format!("a number{unit}"))),
        BaseType::Boolean => match text {
            "true" | "1" => Ok(Value::Boolean(true)),
            "false" | "0" => Ok(Value::Boolean(false)),
            _ => Err(expected("true or false")),
        },
        BaseType::Integer => {
            let values = variable.named_values();
            let named = values.iter().find(|(_, name)| *name == text).map(|(value, _)| *value);
            let value = named.map_or_else(|| text.parse().ok(), |value| Some(i128::from(value)));
            value.and_then(Value::integer).ok_or_else(|| match values.as_slice() {
                [] => expected("a whole number"),
                values => expected(&format!("one of {}", listed(values))),
            })
        }
        BaseType::String => Ok(Value::String(text.to_owned())),
        BaseType::Binary => {
            let bytes = BinaryText::Base64.decode(text);
            bytes.map(|hex| Value::Binary { hex }).ok_or_else(|| expected("bytes in Base64"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_by_the_type_of_the_variable() {
        let description = ModelDescription::parse(include_str!("../../fmu-import/tests/data/Vehicle.xml")).unwrap();
        let of = |is_wanted: &dyn Fn(&&Variable) -> bool| description.variables.iter().find(is_wanted).unwrap();
        let real = description.variable("vehicle.mass").unwrap();
        assert_eq!(parse(real, "1e3"), Ok(Value::Real(1000.0)));
        assert_eq!(
            parse(real, "true").unwrap_err(),
            "`vehicle.mass` must be a number in kg, without the unit, got `true`"
        );
        let enumeration = description.variable("tire.mode").unwrap();
        assert_eq!(parse(enumeration, "linear"), Ok(Value::Integer(1)));
        assert_eq!(parse(enumeration, "0"), Ok(Value::Integer(0)));
        let message = "`tire.mode` must be one of magic (0), linear (1), got `linea`";
        assert_eq!(parse(enumeration, "linea").unwrap_err(), message);
        let boolean = of(&|variable| variable.base_type == BaseType::Boolean);
        for (text, value) in [("true", true), ("1", true), ("false", false), ("0", false)] {
            assert_eq!(parse(boolean, text), Ok(Value::Boolean(value)));
        }
        assert!(parse(boolean, "yes").unwrap_err().ends_with("must be true or false, got `yes`"));
    }
}
