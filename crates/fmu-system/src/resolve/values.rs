//! Values of parameters and constant inputs, converted to the unit of the variable and checked.

use super::pattern::matches;
use super::system::{CaseComponent, Resolver};
use crate::parameter::{self, Mistake};
use crate::run::Setting;
use crate::scenario::{self, Case, Given, Values};
use crate::spanned::Spanned;
use fmu_import::bytes::BinaryText;
use fmu_import::description::{BaseType, Causality, DataType, ModelDescription, Value, Variable};
use fmu_import::limits;
use fmu_import::named_values::listed;
use fmu_import::names::suggestion;
use fmu_import::parameter_set::{Parameter, ParameterSet};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;
use std::path::Path;

/// Parameters of an FMU that can be set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Names {
    /// All parameters; another name is a mistake.
    All,
    /// Only parameters that the component's own FMU has, too, with the same type and unit of measure.
    Shared,
}

/// Constants of inputs by index, with their places in the file. An invalid constant was reported and has no value.
type Constants = BTreeMap<usize, (Option<Value>, Range<usize>)>;

impl Resolver<'_> {
    /// Reads the parameter sets that the scenario names, relative to its folder, each once.
    pub(super) fn read_parameter_sets(&mut self) {
        let (scenario, folder) = (self.scenario, self.folder);
        let of_components = scenario.components.iter().filter_map(|u| u.parameter_set.as_ref());
        let of_cases = scenario.cases.iter().filter_map(|c| c.parameter_set.as_ref());
        for path in of_components.chain(of_cases).chain(&scenario.parameter_set) {
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
                let of = split_component(&parameter.name).map(|(component, _)| component);
                let names = || scenario.components.iter().map(|u| u.name.as_str());
                match of {
                    None => self.problems.add(
                        path.span(),
                        format!("{}: `{}`, expected \"component.parameter\"", path.get_ref(), parameter.name),
                    ),
                    Some(component) if !names().any(|name| name == component) => self.problems.add_with_help(
                        path.span(),
                        format!("{}: `{}`: unknown component `{component}`", path.get_ref(), parameter.name),
                        suggestion(component, names()),
                    ),
                    Some(_) => (),
                }
            }
        }
    }

    /// Parameters of a component, in ascending precedence: the parameter set of the scenario, its own parameter set,
    /// its parameters, the parameter set of the case, the parameters of the case, the parameters of the point, the
    /// seed.
    ///
    /// If the case sets another FMU for the component, the first three apply only if the case keeps the parameters. The
    /// first three, the point and the seed then apply only to parameters that this FMU shares with the component's own
    /// FMU.
    pub(super) fn parameters(
        &mut self,
        case: &Case,
        point: Option<&scenario::Point>,
        member: &CaseComponent<'_>,
        seed: Option<(&str, Range<usize>, i32)>,
    ) -> Vec<Setting> {
        let mut settings: BTreeMap<String, Setting> = BTreeMap::new();
        let mut set = |values: Vec<(&Variable, Value)>| {
            for (variable, value) in values {
                settings.insert(variable.name.clone(), Setting::new(variable, value));
            }
        };
        let shared = if member.replaced.is_some() { Names::Shared } else { Names::All };
        if member.replaced.as_ref().is_none_or(|replaced| replaced.keep_parameters) {
            if let Some(path) = &self.scenario.parameter_set {
                set(self.set_values(path, false, member, shared));
            }
            if let Some(path) = &member.component.parameter_set {
                set(self.set_values(path, true, member, shared));
            }
            set(self.written_values(&member.component.parameters, member, shared));
        }
        if let Some(path) = &case.parameter_set {
            set(self.set_values(path, false, member, Names::All));
        }
        for (values, names) in [
            (case.parameters.get(member.name()), Names::All),
            (point.and_then(|p| p.parameters.get(member.name())), shared),
        ] {
            if let Some(values) = values {
                set(self.written_values(values, member, names));
            }
        }
        if let Some((name, span, seed)) = seed {
            let value = Value::Integer(seed.into());
            if let Some(variable) = self.parameter(name, span.clone(), None, member, shared) {
                match parameter::check(variable, &value) {
                    Ok(()) => set(vec![(variable, value)]),
                    Err(message) => self.problems.add(span, message),
                }
            }
        }
        settings.into_values().collect()
    }

    fn written_values<'m>(
        &mut self,
        values: &Values,
        member: &'m CaseComponent<'_>,
        names: Names,
    ) -> Vec<(&'m Variable, Value)> {
        let mut found: Vec<(&Variable, Value)> = Vec::new();
        for (name, written) in &self.with_elements(values, member) {
            if let Some(variable) = self.parameter(name.get_ref(), name.span(), None, member, names)
                && !self.is_set_twice(&found, variable, name)
                && let Some(value) = self.value(&member.found.description, variable, written)
            {
                found.push((variable, value));
            }
        }
        found
    }

    /// Replaces the lists that are values of arrays by the values of their elements.
    fn with_elements(&mut self, values: &Values, member: &CaseComponent<'_>) -> Vec<(Spanned<String>, Spanned<Given>)> {
        let description = &member.found.description;
        let mut all = Vec::new();
        for (name, written) in values {
            let elements: Vec<&Variable> = match &written.0 {
                toml::Value::Array(_) if description.index(name).is_none() => description.elements_of(name).collect(),
                _ => Vec::new(),
            };
            let Some(last) = elements.last() else {
                all.push((name.clone(), written.clone()));
                continue;
            };
            let mut list = Vec::new();
            let shape = flattened(&written.0, &mut list);
            let lengths: Vec<usize> = indices(&last.name[name.len()..]);
            if list.len() != elements.len() || shape.is_none_or(|shape| shape.len() > 1 && shape != lengths) {
                let of = lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ");
                let message = format!("`{}` is an array of {of} elements, got a list of {}", **name, list.len());
                let mut others = description.variables.iter().map(|variable| variable.causality);
                let has_lengths = others.any(|causality| causality == Causality::StructuralParameter);
                let help = match lengths.len() {
                    1 if has_lengths => {
                        format!("write a list of {of} values, or set another length in `structure` of the component")
                    }
                    1 => format!("write a list of {of} values"),
                    _ => format!("write {} values row by row, or a list with a list for each row", elements.len()),
                };
                self.problems.add_with_help(written.span(), message, Some(help));
                continue;
            }
            all.extend(elements.into_iter().zip(list).map(|(element, value)| {
                let name = Spanned::new(name.span(), element.name.clone());
                (name, Spanned::new(written.span(), Given(value)))
            }));
        }
        all
    }

    fn is_set_twice(&mut self, found: &[(&Variable, Value)], variable: &Variable, name: &Spanned<String>) -> bool {
        let is_twice = found.iter().any(|(other, _)| other.name == variable.name);
        if is_twice {
            let message =
                format!("`{}` sets `{}` again: both are names of one parameter", name.get_ref(), variable.name);
            self.problems.add(name.span(), message);
        }
        is_twice
    }

    /// Finds the parameter for a name at `span`; `set` is the file if the name is from a parameter set. A parameter
    /// that is missing is a mistake; with [`Names::Shared`], one that is not shared is only a warning.
    fn parameter<'m>(
        &mut self,
        name: &str,
        span: Range<usize>,
        set: Option<&str>,
        member: &'m CaseComponent<'_>,
        names: Names,
    ) -> Option<&'m Variable> {
        let file = set.map_or(String::new(), |path| format!("{path}: "));
        let description = &member.found.description;
        let found = parameter::parameter(description, name);
        let found = found.or_else(|error| parameter::with_start(description, name).ok_or(error));
        if names == Names::All {
            return found.map_err(|e| self.problems.add_with_help(span, format!("{file}{}", e.message), e.help)).ok();
        }
        let original = member.replaced.as_ref().and_then(|replaced| replaced.original.as_ref());
        let why = match (found, original.map(|o| parameter::parameter(&o.description, name))) {
            (Ok(variable), Some(Ok(own))) => match own.mismatch_of_parameter(variable) {
                None => return Some(variable),
                Some([own, other]) => format!("it is {other} there, {own} in the FMU of the component"),
            },
            (Ok(_), _) => {
                format!("the FMU of the component, {}, has no such parameter", member.component.fmu.get_ref())
            }
            (Err(_), _) => format!("{} has no such parameter", description.model_name),
        };
        let message = format!("{file}`{name}` is not carried over: {why}");
        self.problems.warn(span, message, None);
        None
    }

    /// Returns the values of a parameter set for a component: all values, or the values named `component:parameter`.
    fn set_values<'m>(
        &mut self,
        path: &Spanned<String>,
        of_component: bool,
        member: &'m CaseComponent<'_>,
        names: Names,
    ) -> Vec<(&'m Variable, Value)> {
        let description = &member.found.description;
        let mut values = Vec::new();
        let written: Vec<Parameter> = self.sets.get(path.get_ref()).map_or(Vec::new(), |set| set.parameters.clone());
        for written in written {
            let name = match split_component(&written.name) {
                _ if of_component => written.name.as_str(),
                Some((component, name)) if component == member.name() => name,
                _ => continue,
            };
            let Some(variable) = self.parameter(name, path.span(), Some(path.get_ref()), member, names) else {
                continue;
            };
            let value = match (&written.value, &written.unit) {
                (Value::Real(number), Some(unit)) => convert_unit(description, variable, *number, unit),
                (Value::String(name), _) if variable.base_type == BaseType::Integer => named(variable, name),
                (Value::String(text), _) => Ok(self.string(text)),
                (value, _) => Ok(value.clone()),
            };
            let value = value.and_then(|value| {
                parameter::check(variable, &value).map(|()| value).map_err(|message| (message, None))
            });
            match value {
                Ok(value) => {
                    if written.unit.is_none() {
                        self.check_angle(variable, &value, path.span(), Some(path.get_ref()));
                    }
                    values.push((variable, value));
                }
                Err((message, help)) => {
                    self.problems.add_with_help(path.span(), format!("{}: {message}", path.get_ref()), help);
                }
            }
        }
        values
    }

    /// Constants for the inputs of a component. Constants of the case take precedence over constants of the component.
    pub(super) fn constants(&mut self, case: &Case, member: &CaseComponent<'_>) -> Constants {
        let mut constants = BTreeMap::new();
        for (level, is_of_component) in
            [(Some(&member.component.inputs), true), (case.inputs.get(member.name()), false)]
        {
            let Some(level) = level else { continue };
            constants.extend(self.constants_of_level(level, is_of_component, member));
        }
        constants
    }

    fn constants_of_level(&mut self, level: &Values, is_of_component: bool, member: &CaseComponent<'_>) -> Constants {
        let mut constants = BTreeMap::new();
        let level = self.with_elements(level, member);
        // A plain name takes precedence over a pattern, so patterns come first.
        for is_plain in [false, true] {
            let mut by_pattern: BTreeMap<usize, &str> = BTreeMap::new();
            for (pattern, written) in &level {
                let text = pattern.as_str();
                if text.contains('*') == is_plain {
                    continue;
                }
                let mut any = false;
                for (v, variable) in member.all(Causality::Input) {
                    if !member.names(v).any(|name| matches(text, name)) {
                        continue;
                    }
                    any = true;
                    if let Some(other) = by_pattern.insert(v, text) {
                        self.problems
                            .add(pattern.span(), format!("`{text}` and `{other}` both match `{}`", variable.name));
                    }
                    let value = self.value(&member.found.description, variable, written);
                    constants.insert(v, (value, pattern.span()));
                }
                // Another FMU need not have all inputs of the component's own FMU.
                let may_lack = is_of_component && member.replaced.is_some();
                if !any && !may_lack {
                    let names = member.all(Causality::Input).map(|(_, v)| v.name.as_str());
                    let help = parameter::array(&member.found.description, text).or_else(|| suggestion(text, names));
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

    pub(super) fn value(
        &mut self,
        description: &ModelDescription,
        variable: &Variable,
        written: &Spanned<Given>,
    ) -> Option<Value> {
        let converted = match variable.base_type {
            BaseType::Binary if !variable.is_array() => bytes(variable, &written.0, self.folder),
            _ => convert(description, variable, &written.0),
        };
        let result = converted.and_then(|value| {
            parameter::check(variable, &value).map_err(|message| (message, None))?;
            Ok(match value {
                Value::String(text) => self.string(&text),
                other => other,
            })
        });
        match result {
            Ok(value) => {
                // An explicit unit shows that the value is intended.
                if !written.0.is_table() {
                    self.check_angle(variable, &value, written.span(), None);
                }
                Some(value)
            }
            Err((message, help)) => {
                self.problems.add_with_help(written.span(), message, help);
                None
            }
        }
    }

    /// Makes a String value. The name of a file becomes its absolute path, so that the FMU can be executed anywhere.
    fn string(&self, text: &str) -> Value {
        Value::String(super::file_in(self.folder, text).unwrap_or_else(|| text.to_owned()))
    }

    /// Warns about an angle at `span` that was probably meant in degrees; `set` is the file if the angle is from a
    /// parameter set.
    fn check_angle(&mut self, variable: &Variable, value: &Value, span: Range<usize>, set: Option<&str>) {
        if let Value::Real(number) = *value
            && is_implausible(variable, number)
        {
            let file = set.map_or(String::new(), |path| format!("{path}: "));
            let message = format!("{file}`{}` is {number} rad, which is {:.0} deg", variable.name, number.to_degrees());
            let help = format!("if degrees are meant, write {{ value = {number}, unit = \"deg\" }}");
            self.problems.warn(span, message, set.is_none().then_some(help));
        }
    }
}

/// Component and parameter of a name in a parameter set for several components: `component.parameter` as SSP writes it
/// (names of components have no dot), or `component:parameter` as in the rest of a scenario.
fn split_component(name: &str) -> Option<(&str, &str)> {
    name.split_once([':', '.'])
}

fn convert(description: &ModelDescription, variable: &Variable, written: &toml::Value) -> Result<Value, Mistake> {
    let name = &variable.name;
    if variable.is_array() {
        let help = "the FMU needs a variable for each element to be set".to_string();
        return Err((
            format!("`{name}` is an array of {} elements, which a scenario cannot set", variable.size),
            Some(help),
        ));
    }
    let wrong = |found: &str| {
        let expected = match variable.base_type {
            BaseType::Real => "a number",
            BaseType::Integer => "a whole number",
            BaseType::Boolean => "true or false",
            BaseType::String => "a string",
            BaseType::Binary => BYTES,
        };
        Err((format!("`{name}` must be {expected}, got {found}"), None))
    };
    match (written, variable.base_type) {
        (toml::Value::Float(v), BaseType::Real) => Ok(Value::Real(*v)),
        // Integers in TOML have 64 bits. Only integers beyond 2^53, which make no sense as parameters, would be
        // rounded.
        (toml::Value::Integer(v), BaseType::Real) => Ok(Value::Real(*v as f64)),
        (toml::Value::Integer(v), BaseType::Integer) => Ok(Value::Integer(*v)),
        (toml::Value::String(text), BaseType::Integer) => match large(variable, text) {
            Some(value) => Ok(value),
            None => named(variable, text),
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
                other => return wrong(&shown(other)),
            };
            if base_type != BaseType::Real {
                return wrong("a value with a unit");
            }
            convert_unit(description, variable, number, unit)
        }
        (other, _) => wrong(&shown(other)),
    }
}

/// Appends the values in a list, row by row, and returns its lengths; `None` if the lengths of its rows differ.
fn flattened(written: &toml::Value, list: &mut Vec<toml::Value>) -> Option<Vec<usize>> {
    let toml::Value::Array(rows) = written else {
        list.push(written.clone());
        return Some(Vec::new());
    };
    let shapes: Vec<Option<Vec<usize>>> = rows.iter().map(|row| flattened(row, list)).collect();
    let is_regular = shapes.iter().all(|shape| shape.is_some() && *shape == shapes[0]);
    let of_row = shapes.into_iter().next().flatten().unwrap_or_default();
    is_regular.then(|| std::iter::once(rows.len()).chain(of_row).collect())
}

/// The numbers in the indices of an element, such as `[2,3]`.
fn indices(text: &str) -> Vec<usize> {
    text.trim_matches(['[', ']']).split(',').filter_map(|index| index.parse().ok()).collect()
}

/// The number in a string. TOML has integers of 64 bits with a sign, so a larger UInt64 is a string of digits.
fn large(variable: &Variable, text: &str) -> Option<Value> {
    let is_large = variable.data_type == DataType::UInt64 && text.bytes().all(|digit| digit.is_ascii_digit());
    text.parse().ok().filter(|_| is_large).and_then(Value::integer)
}

const BYTES: &str = "a string in Base64, { file = \"..\" } or { hex = \"..\" }";

/// The bytes of a Binary.
fn bytes(variable: &Variable, written: &toml::Value, folder: &Path) -> Result<Value, Mistake> {
    let name = &variable.name;
    let decoded = |encoding: BinaryText, text: &str, rule: &str| {
        let bytes = encoding.decode(text).ok_or_else(|| {
            let help = "{ file = \"..\" } reads the bytes of a file".to_owned();
            (format!("`{name}` is the string {text:?}, which is not {rule}"), Some(help))
        })?;
        Ok(Value::Binary { hex: bytes })
    };
    let only = written.as_table().filter(|table| table.len() == 1).and_then(|table| table.iter().next());
    match (written, only) {
        (toml::Value::String(text), _) => decoded(BinaryText::Base64, text, "Base64"),
        (_, Some((key, toml::Value::String(text)))) if key == "hex" => {
            decoded(BinaryText::Hex, text, "a list of hexadecimal digits in pairs")
        }
        (_, Some((key, toml::Value::String(path)))) if key == "file" => {
            let path = folder.join(path);
            let read = limits::read_bytes(&path, limits::BINARY_FILE);
            let reason = |cause| (format!("`{name}`: cannot read {}: {cause}", path.display()), None);
            Ok(Value::Binary { hex: read.map_err(reason)? })
        }
        (other, _) => Err((format!("`{name}` must be {BYTES}, got {}", shown(other)), None)),
    }
}

fn shown(value: &toml::Value) -> String {
    match value {
        toml::Value::String(text) => format!("the string {text:?}"),
        toml::Value::Array(_) => "a list".to_string(),
        toml::Value::Table(_) => "a table".to_string(),
        other => other.to_string(),
    }
}

fn named(variable: &Variable, name: &str) -> Result<Value, Mistake> {
    let values = variable.named_values();
    if let Some((value, _)) = values.iter().find(|(_, n)| *n == name) {
        return Ok(Value::Integer((*value).into()));
    }
    if values.is_empty() {
        return Err((format!("`{}` is Integer without named values, got the string \"{name}\"", variable.name), None));
    }
    let message = format!("`{}` has no value `{name}`, expected one of {}", variable.name, listed(&values));
    Err((message, suggestion(name, values.iter().map(|(_, n)| *n))))
}

/// Returns true if an angle in rad is more than a full turn, although the start value of its variable is not.
pub(super) fn is_implausible(variable: &Variable, value: f64) -> bool {
    let is_large = |value: f64| value.abs() > TAU;
    let usual = variable.start.as_ref().and_then(Value::real).unwrap_or(0.0);
    variable.unit.as_deref() == Some("rad") && is_large(value) && !is_large(usual)
}

fn convert_unit(
    description: &ModelDescription,
    variable: &Variable,
    number: f64,
    unit: &str,
) -> Result<Value, Mistake> {
    let units = description.display_units(variable);
    let (factor, offset) = parameter::scale(&variable.name, variable.unit.as_deref(), &units, unit, "given")?;
    Ok(Value::Real((number - offset) / factor))
}
