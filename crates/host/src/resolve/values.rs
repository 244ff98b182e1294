//! Values of parameters and constant inputs, converted to the unit of the variable and checked.

use super::pattern::matches;
use super::{Member, Resolver};
use crate::description::{BaseType, Causality, ModelDescription, Value, Variable};
use crate::parameter_set::ParameterSet;
use crate::plan::{self, Setting};
use crate::problem::suggestion;
use crate::scenario::{self, Case, Values};
use serde_spanned::Spanned;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// A message and a hint.
type Mistake = (String, Option<String>);

impl Resolver<'_> {
    /// Reads the parameter sets that the scenario names, relative to its folder, each once.
    pub(super) fn read_parameter_sets(&mut self, folder: &Path) {
        let scenario = self.scenario;
        let of_units = scenario.units.iter().filter_map(|u| u.parameter_set.as_ref());
        let of_cases = scenario.cases.iter().filter_map(|c| c.parameter_set.as_ref());
        for path in of_units.chain(of_cases).chain(&scenario.parameter_set) {
            match ParameterSet::read(&folder.join(path.get_ref())) {
                Ok(set) => {
                    self.sets.insert(path.get_ref().clone(), set);
                }
                Err(error) => self.problems.add(path.span(), error.to_string()),
            }
        }
        for path in scenario.cases.iter().filter_map(|c| c.parameter_set.as_ref()).chain(&scenario.parameter_set) {
            let Some(set) = self.sets.get(path.get_ref()) else { continue };
            for parameter in &set.parameters {
                let of = split_unit(&parameter.name).map(|(unit, _)| unit);
                let names = || scenario.units.iter().map(|u| u.name.get_ref().as_str());
                match of {
                    None => self.problems.add(
                        path.span(),
                        format!("{}: `{}`, expected \"unit.parameter\"", path.get_ref(), parameter.name),
                    ),
                    Some(unit) if !names().any(|name| name == unit) => self.problems.add_with_help(
                        path.span(),
                        format!("{}: `{}`: unknown unit `{unit}`", path.get_ref(), parameter.name),
                        suggestion(unit, names()),
                    ),
                    Some(_) => (),
                }
            }
        }
    }

    /// Parameters of a unit: from the bottom up the parameter set of the scenario and its own, its parameters, the
    /// parameter set of the case, the parameters of the case and of the point, the seed.
    pub(super) fn parameters(
        &mut self,
        case: &Case,
        point: Option<&scenario::Point>,
        member: &Member<'_>,
        seed: Option<(&str, Range<usize>, i32)>,
    ) -> Vec<Setting> {
        let description = &member.found.description;
        let mut settings: BTreeMap<String, Setting> = BTreeMap::new();
        let mut set = |variable: &Variable, value: Value| {
            let setting = setting(variable, value);
            settings.insert(variable.name.clone(), setting);
        };
        let of_point = point.and_then(|p| p.parameters.get(member.name()));
        // (parameter set, whether its names are those of the unit)
        let of_scenario = (self.scenario.parameter_set.as_ref(), false);
        let of_unit = (member.unit.parameter_set.as_ref(), true);
        let of_case = (case.parameter_set.as_ref(), false);
        let levels = [
            (&[of_scenario, of_unit][..], Some(&member.unit.parameters)),
            (&[of_case], case.parameters.get(member.name())),
            (&[], of_point),
        ];
        for (sets, values) in levels {
            for (path, is_of_unit) in sets {
                let Some(path) = path else { continue };
                for (variable, value) in self.set_values(path, *is_of_unit, member) {
                    set(variable, value);
                }
            }
            for (name, written) in values.into_iter().flatten() {
                match plan::parameter(description, name.get_ref()) {
                    Ok(variable) => {
                        if let Some(value) = self.value(description, variable, written) {
                            set(variable, value);
                        }
                    }
                    Err(e) => self.problems.add_with_help(name.span(), e.message, e.help),
                }
            }
        }
        if let Some((name, span, seed)) = seed {
            let value = Value::Integer(seed);
            match plan::parameter(description, name) {
                Ok(variable) => match plan::check(variable, &value) {
                    Ok(()) => set(variable, value),
                    Err(message) => self.problems.add(span, message),
                },
                Err(e) => self.problems.add_with_help(span, e.message, e.help),
            }
        }
        settings.into_values().collect()
    }

    /// What a parameter set says about a unit: all of it, or what is named `unit:parameter`.
    fn set_values<'m>(
        &mut self,
        path: &Spanned<String>,
        of_unit: bool,
        member: &'m Member<'_>,
    ) -> Vec<(&'m Variable, Value)> {
        let description = &member.found.description;
        let mut values = Vec::new();
        for written in self.sets.get(path.get_ref()).into_iter().flat_map(|set| &set.parameters) {
            let name = match split_unit(&written.name) {
                _ if of_unit => written.name.as_str(),
                Some((unit, name)) if unit == member.name() => name,
                _ => continue,
            };
            let value = plan::parameter(description, name).map_err(|e| (e.message, e.help)).and_then(|variable| {
                let value = match (&written.value, &written.unit) {
                    (Value::Real(number), Some(unit)) => convert_unit(description, variable, *number, unit)?,
                    (value, _) => value.clone(),
                };
                plan::check(variable, &value).map_err(|message| (message, None))?;
                Ok((variable, value))
            });
            match value {
                Ok(value) => values.push(value),
                Err((message, help)) => {
                    self.problems.add_with_help(path.span(), format!("{}: {message}", path.get_ref()), help);
                }
            }
        }
        values
    }

    /// Constants of the inputs of a unit: those of the case stand above those of the unit.
    pub(super) fn constants(&mut self, case: &Case, member: &Member<'_>) -> BTreeMap<usize, (Value, Range<usize>)> {
        let mut constants = BTreeMap::new();
        for level in [Some(&member.unit.inputs), case.inputs.get(member.name())].into_iter().flatten() {
            constants.extend(self.constants_of_level(level, member));
        }
        constants
    }

    fn constants_of_level(&mut self, level: &Values, member: &Member<'_>) -> BTreeMap<usize, (Value, Range<usize>)> {
        let mut constants = BTreeMap::new();
        // A plain name stands above a pattern, so patterns come first.
        for is_plain in [false, true] {
            let mut by_pattern: BTreeMap<usize, &str> = BTreeMap::new();
            for (pattern, written) in level {
                let text = pattern.get_ref().as_str();
                if text.contains('*') == is_plain {
                    continue;
                }
                let mut any = false;
                for (v, variable) in member.all(Causality::Input) {
                    if !matches(text, &variable.name) {
                        continue;
                    }
                    any = true;
                    if let Some(other) = by_pattern.insert(v, text) {
                        self.problems
                            .add(pattern.span(), format!("`{text}` and `{other}` both match `{}`", variable.name));
                    }
                    if let Some(value) = self.value(&member.found.description, variable, written) {
                        constants.insert(v, (value, pattern.span()));
                    }
                }
                if !any {
                    let names = member.all(Causality::Input).map(|(_, v)| v.name.as_str());
                    let help = suggestion(text, names);
                    self.problems.add_with_help(
                        pattern.span(),
                        format!("`{}` has no input `{text}`", member.name()),
                        help,
                    );
                }
            }
        }
        constants
    }

    /// A value as written, converted to the unit of the variable and checked.
    fn value(
        &mut self,
        description: &ModelDescription,
        variable: &Variable,
        written: &Spanned<toml::Value>,
    ) -> Option<Value> {
        let result = convert(description, variable, written.get_ref()).and_then(|value| {
            plan::check(variable, &value).map_err(|message| (message, None))?;
            Ok(value)
        });
        match result {
            Ok(value) => Some(value),
            Err((message, help)) => {
                self.problems.add_with_help(written.span(), message, help);
                None
            }
        }
    }
}

/// Unit and parameter of a name in a parameter set for several units: `unit.parameter` as SSP writes it (names of units
/// have no dot), or `unit:parameter` as in the rest of a scenario.
fn split_unit(name: &str) -> Option<(&str, &str)> {
    name.split_once([':', '.'])
}

pub(super) fn setting(variable: &Variable, value: Value) -> Setting {
    Setting { name: variable.name.clone(), base_type: variable.base_type, reference: variable.reference, value }
}

/// A value as written in TOML as a value of the variable, in the unit of the variable.
fn convert(description: &ModelDescription, variable: &Variable, written: &toml::Value) -> Result<Value, Mistake> {
    let name = &variable.name;
    let wrong = |found: &str| Err((format!("`{name}` is {}, got {found}", variable.base_type), None));
    match (written, variable.base_type) {
        (toml::Value::Float(v), BaseType::Real) => Ok(Value::Real(*v)),
        // TOML integers have 64 bits; whole numbers beyond 2^53 are no sensible parameters.
        (toml::Value::Integer(v), BaseType::Real) => Ok(Value::Real(*v as f64)),
        (toml::Value::Integer(v), BaseType::Integer) => match i32::try_from(*v) {
            Ok(v) => Ok(Value::Integer(v)),
            Err(_) => wrong(&format!("{v}, which has more than 32 bits")),
        },
        (toml::Value::Boolean(v), BaseType::Boolean) => Ok(Value::Boolean(*v)),
        (toml::Value::String(v), BaseType::String) => Ok(Value::String(v.clone())),
        (toml::Value::Table(table), base_type) => {
            let mut keys = table.keys().map(String::as_str);
            let (Some(value), Some(toml::Value::String(unit)), true) =
                (table.get("value"), table.get("unit"), keys.all(|key| key == "value" || key == "unit"))
            else {
                return Err((
                    format!("`{name}`: expected a value or {{ value = .., unit = \"..\" }}"),
                    Some("a name with a dot is written in quotes: \"steer.amplitude\" = 1".into()),
                ));
            };
            let number = match value {
                toml::Value::Float(v) => *v,
                toml::Value::Integer(v) => *v as f64,
                other => return wrong(other.type_str()),
            };
            if base_type != BaseType::Real {
                return wrong("a value with a unit");
            }
            convert_unit(description, variable, number, unit)
        }
        (other, _) => wrong(other.type_str()),
    }
}

fn convert_unit(
    description: &ModelDescription,
    variable: &Variable,
    number: f64,
    unit: &str,
) -> Result<Value, Mistake> {
    let name = &variable.name;
    let Some(own) = &variable.unit else {
        return Err((format!("`{name}` has no unit of measure"), None));
    };
    if own == unit {
        return Ok(Value::Real(number));
    }
    let display_units = description.display_units(variable);
    match display_units.iter().find(|u| u.name == unit) {
        Some(u) => Ok(Value::Real((number - u.offset) / u.factor)),
        None => {
            let mut all = vec![own.as_str()];
            all.extend(display_units.iter().map(|u| u.name.as_str()));
            Err((format!("`{name}` cannot be given in `{unit}`, expected one of: {}", all.join(", ")), None))
        }
    }
}
