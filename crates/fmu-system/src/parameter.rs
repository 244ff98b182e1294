//! Checks values of parameters and sets them in a run.

use crate::fmus::{Fmus, FmusError};
use crate::plan::Plan;
use crate::run::{Component, Run, Setting};
use fmu_import::description::{Causality, DisplayUnit, Initial, ModelDescription, Value, Variability, Variable};
use fmu_import::fmu::Fmu;
use fmu_import::named_values::listed;
use fmu_import::names::{any_of, suggestion};
use std::ops::Deref;

impl Run {
    /// Sets a parameter, overriding the scenario.
    ///
    /// # Errors
    /// The run has no such component, its FMU has no such parameter, or the value has another type or is outside the
    /// limits.
    pub fn set_parameter(&mut self, fmus: &Fmus, component: &str, name: &str, value: Value) -> Result<(), String> {
        let describe = |component: &Component| fmus.get(component).ok().map(Fmu::description);
        self.set(&describe, component, value, |description| parameter(description, name).map_err(|error| error.message))
    }

    /// Sets a parameter, the start value of a state or another variable, or a constant input, overriding the scenario.
    ///
    /// # Errors
    /// The run has no such component, its FMU has no such variable, the variable cannot be set, or the value has
    /// another type or is outside the limits.
    pub fn set_value(&mut self, fmus: &Fmus, component: &str, name: &str, value: Value) -> Result<(), String> {
        self.set_described(&|component| fmus.get(component).ok().map(Fmu::description), component, name, value)
    }

    /// As [`Self::set_value`], for an FMU that need not be loaded: `describe` returns the description of a component.
    pub fn set_described<'d>(
        &mut self,
        describe: &dyn Fn(&Component) -> Option<&'d ModelDescription>,
        component: &str,
        name: &str,
        value: Value,
    ) -> Result<(), String> {
        self.set(describe, component, value, |description| settable(description, name))
    }

    fn set<'d>(
        &mut self,
        describe: &dyn Fn(&Component) -> Option<&'d ModelDescription>,
        component: &str,
        value: Value,
        of: impl Fn(&'d ModelDescription) -> Result<&'d Variable, String>,
    ) -> Result<(), String> {
        let target = self.components.iter_mut().find(|u| u.name == component).ok_or_else(|| no_component(component))?;
        let description = describe(target).ok_or_else(|| FmusError::NotLoaded(target.fmu.clone()).to_string())?;
        let set = of(description).and_then(|variable| {
            check(variable, &value)?;
            target.set(variable, value)
        });
        set.map_err(|reason| format!("`{component}`: {reason}"))?;
        self.forget_steady_starts();
        Ok(())
    }
}

impl Component {
    /// Sets a variable before initialization, or an input for the whole run.
    fn set(&mut self, variable: &Variable, value: Value) -> Result<(), String> {
        let name = &variable.name;
        if variable.causality == Causality::Input {
            let constant = self.constants.iter_mut().find(|constant| constant.name == *name);
            let written = || format!("the input `{name}` cannot be set: another signal writes it");
            constant.ok_or_else(written)?.value = value;
            return Ok(());
        }
        let setting = Setting::new(variable, value);
        match self.parameters.binary_search_by(|p| p.name.as_str().cmp(name)) {
            Ok(at) => self.parameters[at] = setting,
            Err(at) => self.parameters.insert(at, setting),
        }
        Ok(())
    }
}

pub(crate) fn no_component(name: &str) -> String {
    format!("the run has no component `{name}`")
}

/// A variable of a component that can be set.
#[derive(Debug)]
pub struct Settable {
    /// The variable.
    pub variable: Variable,
    /// Its value in the scenario, if it has one.
    pub value: Option<Value>,
    /// Other units in which its value can be given.
    pub units: Vec<DisplayUnit>,
}

/// Finds the parameter, variable with a start value, or input of a component, in the first run that has it. `describe`
/// returns the description of the FMU of a component.
///
/// # Errors
/// There is no such variable; the message suggests another name.
pub fn settable_of<D: Deref<Target = ModelDescription>>(
    plan: &Plan,
    describe: impl Fn(&Component) -> Result<D, String>,
    component: &str,
    name: &str,
) -> Result<Settable, String> {
    let mut first = None;
    for found in plan.runs.iter().flat_map(|run| &run.components).filter(|other| other.name == component) {
        let description = describe(found)?;
        match settable(&description, name) {
            Err(message) => first = first.or(Some(format!("`{component}`: {message}"))),
            Ok(variable) => {
                let set = found.parameters.iter().chain(&found.constants).find(|setting| setting.name == variable.name);
                let value = set.map(|setting| &setting.value).or(variable.start.as_ref()).cloned();
                let units = description.display_units(variable);
                return Ok(Settable { variable: variable.clone(), value, units });
            }
        }
    }
    Err(first.unwrap_or_else(|| {
        let components = plan.runs.iter().flat_map(|run| &run.components).map(|other| other.name.as_str());
        let hint = suggestion(component, components).map_or(String::new(), |hint| format!("; {hint}"));
        format!("unknown component `{component}`{hint}")
    }))
}

/// Finds the parameter, variable with a start value, or input with this name.
///
/// # Errors
/// There is no such variable; the message suggests another name.
pub fn settable<'a>(description: &'a ModelDescription, name: &str) -> Result<&'a Variable, String> {
    let input = named(description, name).filter(|variable| variable.causality == Causality::Input);
    match input.or_else(|| with_start(description, name)) {
        Some(variable) => Ok(variable),
        None => parameter(description, name).map_err(|error| match error.help {
            Some(help) => format!("{}; {help}", error.message),
            None => error.message,
        }),
    }
}

/// Finds the variable with this name whose start value can be set.
pub(crate) fn with_start<'a>(description: &'a ModelDescription, name: &str) -> Option<&'a Variable> {
    let is_set = |initial| matches!(initial, Some(Initial::Exact | Initial::Approx));
    named(description, name).filter(|v| v.variability != Variability::Constant && is_set(v.initial))
}

/// Finds the variable that a name sets. Aliases are followed, except aliases of outputs.
fn named<'a>(description: &'a ModelDescription, name: &str) -> Option<&'a Variable> {
    let variable = description.variable(name)?;
    let of = variable.alias_of.filter(|_| variable.causality != Causality::Output);
    Some(of.map_or(variable, |of| &description.variables[of]))
}

pub(crate) struct NoParameter {
    pub(crate) message: String,
    pub(crate) help: Option<String>,
}

pub(crate) fn parameter<'a>(description: &'a ModelDescription, name: &str) -> Result<&'a Variable, NoParameter> {
    let settable = |v: &&Variable| v.causality == Causality::Parameter && v.variability != Variability::Constant;
    let model = &description.model_name;
    match named(description, name) {
        Some(variable) if settable(&variable) => Ok(variable),
        Some(variable) => Err(NoParameter {
            message: format!("`{name}` of {model} is not a parameter but {}", role(variable)),
            help: match variable.causality {
                Causality::Input => Some(
                    "use `inputs` to hold an input constant, or `start = \"steady\"` to start in a steady state"
                        .to_owned(),
                ),
                Causality::CalculatedParameter => {
                    Some("set the parameters from which it follows; `cargo fmu inspect` lists them".to_owned())
                }
                Causality::StructuralParameter => Some("set it in `structure` of the component".to_owned()),
                _ => None,
            },
        }),
        None => Err(NoParameter {
            message: format!("{model} has no parameter `{name}`"),
            help: array(description, name)
                .or_else(|| suggestion(name, description.variables.iter().filter(settable).map(|v| v.name.as_str()))),
        }),
    }
}

/// A message and a hint.
pub(crate) type Mistake = (String, Option<String>);

/// Factor and offset of a unit in which the values of a variable can be given or shown: shown value = factor * value +
/// offset. `own` is the unit of the variable, `use_of` the word "given" or "shown".
pub(crate) fn scale(
    name: &str,
    own: Option<&str>,
    units: &[DisplayUnit],
    wanted: &str,
    use_of: &str,
) -> Result<(f64, f64), Mistake> {
    // A variable without a unit is a plain number.
    if own.unwrap_or("1") == wanted {
        return Ok((1.0, 0.0));
    }
    let Some(own) = own else {
        let message = format!("`{name}` has no unit of measure, so it cannot be {use_of} in `{wanted}`");
        return Err((message, Some("leave out `unit`".to_owned())));
    };
    if let Some(unit) = units.iter().find(|unit| unit.name == wanted) {
        return Ok((unit.factor, unit.offset));
    }
    let all: Vec<&str> = std::iter::once(own).chain(units.iter().map(|unit| unit.name.as_str())).collect();
    let message = format!("`{name}` cannot be {use_of} in `{wanted}`, expected {}", any_of(&all));
    Err((message, suggestion(wanted, all)))
}

/// Returns the help for the name of an array: the elements to write instead.
pub(crate) fn array(description: &ModelDescription, name: &str) -> Option<String> {
    let mut elements = description.elements_of(name);
    let first = elements.next()?;
    let last = elements.next_back().unwrap_or(first);
    Some(format!("`{name}` is an array: write its elements, `{}` to `{}`", first.name, last.name))
}

/// Returns the role of a variable, with its article.
pub(crate) fn role(variable: &Variable) -> &'static str {
    match (variable.causality, variable.variability) {
        (_, Variability::Constant) => "a constant",
        (Causality::Parameter, _) => "a parameter",
        (Causality::CalculatedParameter, _) => "a calculated parameter",
        (Causality::Input, _) => "an input",
        (Causality::Output, _) => "an output",
        (Causality::Local, _) => "a local variable",
        (Causality::Independent, _) => "the time",
        (Causality::StructuralParameter, _) => "a structural parameter, which sets the size of arrays",
    }
}

/// Checks that an Integer is in the list of values, if there is one; the error states the rule.
pub(crate) fn check_item(variable: &Variable, value: i128) -> Result<(), String> {
    let named = variable.named_values();
    if named.is_empty() || named.iter().any(|(item, _)| i128::from(*item) == value) {
        return Ok(());
    }
    Err(format!("expected one of {}", listed(&named)))
}

/// Checks type, limits and items; the message states which one is violated.
pub(crate) fn check(variable: &Variable, value: &Value) -> Result<(), String> {
    let name = &variable.name;
    if variable.is_array() {
        return Err(format!("`{name}` is an array of {} elements; only scalars can be set", variable.size));
    }
    let number = match value {
        _ if value.base_type() != variable.base_type => {
            return Err(format!("`{name}` is {}, got {value}, {}", variable.base_type, value.base_type()));
        }
        Value::Real(v) if !v.is_finite() => {
            return Err(format!("`{name}` is {v}, expected a finite number"));
        }
        Value::Real(v) => *v,
        Value::Integer(_) | Value::Unsigned(_) => {
            let v = value.whole().unwrap_or_default();
            let range = variable.integers();
            if !range.contains(&v) {
                let (least, most, data_type) = (range.start(), range.end(), variable.data_type);
                return Err(match (i32::try_from(*least), i32::try_from(*most)) {
                    (Ok(i32::MIN), Ok(i32::MAX)) => format!("`{name}` is {v}, which does not fit in 32 bits"),
                    _ => format!("`{name}` is {v}, expected a whole number from {least} to {most} ({data_type})"),
                });
            }
            check_item(variable, v).map_err(|rule| format!("`{name}` is {v}, {rule}"))?;
            v as f64
        }
        Value::Binary { hex } => {
            let fits = variable.max_size.is_none_or(|most| hex.len() <= most);
            let most = variable.max_size.unwrap_or_default();
            let message = || format!("`{name}` has {} bytes, expected at most {most} (its `maxSize`)", hex.len());
            return if fits { Ok(()) } else { Err(message()) };
        }
        Value::Boolean(_) | Value::String(_) => return Ok(()),
    };
    let unit = variable.unit.as_deref().filter(|u| *u != "1").map_or(String::new(), |u| format!(" {u}"));
    if variable.min.is_some_and(|min| number < min) {
        return Err(format!("`{name}` is {value}{unit}, expected at least {}", variable.min.unwrap_or_default()));
    }
    if variable.max.is_some_and(|max| number > max) {
        return Err(format!("`{name}` is {value}{unit}, expected at most {}", variable.max.unwrap_or_default()));
    }
    Ok(())
}
