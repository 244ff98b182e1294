//! The rules of a description.

mod fmi3;
mod schema;

use super::Finding;
use fmu_import::description::{
    BaseType, Capabilities, Causality, FmiVersion, Initial, ModelDescription, Terminal, TerminalMember, Unknown, Value,
    Variability, Variable,
};
use fmu_import::xml::{self, Element};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

type Report<'a> = &'a mut dyn FnMut(Finding);

/// Reports all findings about a parsed description. Returns the number of elements compared with the schema.
pub(super) fn check(text: &str, description: &ModelDescription, report: Report<'_>) -> usize {
    // The description was parsed from the same text.
    let Ok(root) = xml::parse(text) else { return 0 };
    let elements = schema::schema(&root, description.fmi, report);
    general(description, report);
    definitions(description, report);
    let known = Known::new(&root, description);
    for variable in &description.variables {
        let of = variable.alias_of.map(|of| &description.variables[of]);
        // An alias has its own display unit. All other properties are those of its variable.
        if of.is_none_or(|of| of.display_unit != variable.display_unit) {
            units(description, variable, &known, report);
        }
        if of.is_none() {
            rules_of_variable(description, variable, &known, report);
        }
    }
    match description.fmi {
        FmiVersion::V2 => {
            written_attributes(&root, report);
            aliases(description, report);
        }
        FmiVersion::V3 => {
            independent(description, report);
            fmi3::check(&root, description, report);
        }
    }
    structure(description, report);
    elements
}

/// Checks the members of terminals and of those within them (FMI 3.0.2, section 2.4.9.2).
pub(super) fn terminals(description: &ModelDescription, terminals: &[Terminal], report: Report<'_>) {
    for Terminal { name: terminal, matching_rule, members, terminals: inner, .. } in terminals {
        let mut error = |message: String| report(Finding::error(format!("terminal `{terminal}`"), message));
        let mut names = HashSet::new();
        for TerminalMember { variable: name, name: member, .. } in members {
            let causality = description.variable(name).map(|variable| variable.causality);
            let causality =
                causality.or_else(|| Some(description.clocks.iter().find(|clock| clock.name == *name)?.causality));
            match causality {
                None => error(format!("refers to the variable `{name}`, which does not exist")),
                Some(Causality::Local | Causality::Independent | Causality::StructuralParameter) => {
                    error(format!("contains `{name}`: only inputs, outputs and parameters can be connected"));
                }
                _ => {}
            }
            match member {
                None if matching_rule == "plug" || matching_rule == "bus" => error(format!(
                    "matches members by their names (matchingRule=\"{matching_rule}\"), but `{name}` has no memberName"
                )),
                Some(member) if !names.insert(member) => error(format!("has two members named `{member}`")),
                _ => {}
            }
        }
        self::terminals(description, inner, report);
    }
}

/// Checks attributes of FMI 2.0 variables that the parsed description does not contain, or contains only in another
/// form.
fn written_attributes(root: &Element, report: Report<'_>) {
    let variables = root.child("ModelVariables").map_or(&[][..], |variables| &variables.children);
    for element in variables {
        let name = element.attribute("name").unwrap_or_default();
        let causality = element.attribute("causality");
        if let (Some(causality @ ("input" | "independent")), Some(initial)) = (causality, element.attribute("initial"))
        {
            let message = format!("has initial=\"{initial}\", but causality=\"{causality}\" may have none");
            report(Finding::error(variable_named(name), message));
        }
        // Other causalities may not be discrete either; the rules of the variable report that.
        let can_be_discrete = matches!(causality, None | Some("input" | "output" | "local"));
        let of_type =
            ["Integer", "Boolean", "String", "Enumeration"].into_iter().find(|name| element.child(name).is_some());
        if let Some(data_type) = of_type.filter(|_| can_be_discrete && element.attribute("variability").is_none()) {
            let message = format!(
                "is continuous, the default of `variability`, which only a Real can be (FMI 2.0.4, section 2.2.7): add \
                 variability=\"discrete\" to this {data_type}"
            );
            report(Finding::error(variable_named(name), message));
        }
    }
}

fn variable_named(name: &str) -> String {
    format!("variable `{name}`")
}

fn general(description: &ModelDescription, report: Report<'_>) {
    if let Some(time) = &description.generation_date_and_time
        && !is_date_time(time)
    {
        let message = format!("\"{time}\" is not a date and time such as 2026-01-31T12:00:00Z");
        report(Finding::error("generationDateAndTime", message));
    }
    if !matches!(description.variable_naming_convention.as_str(), "flat" | "structured") {
        let message = format!("\"{}\", expected flat or structured", description.variable_naming_convention);
        report(Finding::error("variableNamingConvention", message));
    }
    let mut identifiers = HashSet::new();
    for interface in description.interfaces() {
        let identifier = description.model_identifier(interface).unwrap_or_default();
        if !is_c_identifier(identifier) && identifiers.insert(identifier) {
            let message = format!(
                "\"{identifier}\" is not a C identifier (letters, digits and _, not starting with a digit), which FMI \
                 {} requires; importers that compile its name into a program cannot use the FMU",
                description.fmi
            );
            report(Finding::error("modelIdentifier", message));
        }
    }
    let lacks_states = |unit: &Capabilities| unit.can_serialize_fmu_state && !unit.can_get_and_set_fmu_state;
    if [&description.co_simulation, &description.model_exchange, &description.scheduled_execution]
        .into_iter()
        .flatten()
        .any(lacks_states)
    {
        let word = if description.fmi == FmiVersion::V2 { "FMUstate" } else { "FMUState" };
        let message = format!("is true, which needs canGetAndSet{word} to be true as well");
        report(Finding::error(format!("canSerialize{word}"), message));
    }
    if let Some(step) = description.co_simulation.as_ref().and_then(|unit| unit.fixed_internal_step_size)
        && !(step.is_finite() && step > 0.0)
    {
        report(Finding::error("fixedInternalStepSize", format!("{step} s, expected a number above 0")));
    }
    let experiment = description.default_experiment;
    let mut error = |message: String| report(Finding::error("DefaultExperiment", message));
    let start = experiment.start_time.unwrap_or(0.0);
    if let Some(stop) = experiment.stop_time
        && (stop.is_nan() || stop <= start)
    {
        error(format!("stopTime {stop} s is not after startTime {start} s"));
    }
    for (name, value) in [("stepSize", experiment.step_size), ("tolerance", experiment.tolerance)] {
        if let Some(value) = value
            && !(value.is_finite() && value > 0.0)
        {
            error(format!("{name} {value}, expected a number above 0"));
        }
    }
}

fn is_c_identifier(text: &str) -> bool {
    let is_plain = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    is_plain && !text.is_empty() && !text.starts_with(|c: char| c.is_ascii_digit())
}

/// Checks the digits and separators of an `xs:dateTime`.
fn is_date_time(text: &str) -> bool {
    let Some((date, time)) = text.split_once('T') else { return false };
    let numbers = |text: &str, separator: char, lengths: &[usize]| {
        let parts: Vec<&str> = text.split(separator).collect();
        parts.len() == lengths.len()
            && parts
                .iter()
                .zip(lengths)
                .all(|(part, length)| part.len() == *length && part.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let zone = time.find(['Z', '+', '-']).unwrap_or(time.len());
    let (time, zone) = time.split_at(zone);
    let (time, fraction) = time.split_once('.').unwrap_or((time, "0"));
    let is_zone = zone.is_empty() || zone == "Z" || numbers(&zone[1..], ':', &[2, 2]);
    let is_fraction = !fraction.is_empty() && fraction.bytes().all(|byte| byte.is_ascii_digit());
    numbers(date, '-', &[4, 2, 2]) && numbers(time, ':', &[2, 2, 2]) && is_fraction && is_zone
}

/// Lookup tables for the definitions that variables refer to.
struct Known<'a> {
    /// Pairs of a unit and a display unit, including those that the parsed description omits.
    display_units: HashSet<(&'a str, &'a str)>,
    /// Values of the items of each enumeration.
    items: HashMap<&'a str, HashSet<i64>>,
}

impl<'a> Known<'a> {
    fn new(root: &'a Element, description: &'a ModelDescription) -> Self {
        let name = |element: &'a Element| element.attribute("name").unwrap_or_default();
        let units = root.child("UnitDefinitions").into_iter().flat_map(|units| &units.children);
        let pairs = units.flat_map(|unit| unit.children.iter().map(move |shown| (name(unit), name(shown))));
        let mut items: HashMap<&str, HashSet<i64>> = HashMap::new();
        for variable in description.variables.iter().filter(|variable| !variable.items.is_empty()) {
            if let Some(name) = variable.declared_type.as_deref() {
                items.entry(name).or_insert_with(|| variable.items.iter().map(|item| item.value.into()).collect());
            }
        }
        Self { display_units: pairs.collect(), items }
    }
}

/// Checks that each unit is defined once.
fn definitions(description: &ModelDescription, report: Report<'_>) {
    let mut names = HashSet::new();
    for unit in description.units.iter().filter(|unit| !names.insert(&unit.name)) {
        report(Finding::error(format!("unit `{}`", unit.name), "is defined twice"));
    }
}

fn rules_of_variable(description: &ModelDescription, variable: &Variable, known: &Known<'_>, report: Report<'_>) {
    let mut error = |message: String| report(Finding::error(variable_named(&variable.name), message));
    let Variable { causality, variability, initial, .. } = *variable;
    if description.variable_naming_convention == "structured" && !is_structured(&variable.name) {
        error("its name does not follow the structured naming convention that the description promises".to_owned());
    }

    let allowed: &[Variability] = match causality {
        Causality::Parameter | Causality::CalculatedParameter | Causality::StructuralParameter => {
            &[Variability::Fixed, Variability::Tunable]
        }
        Causality::Input => &[Variability::Discrete, Variability::Continuous],
        Causality::Output => &[Variability::Constant, Variability::Discrete, Variability::Continuous],
        Causality::Independent => &[Variability::Continuous],
        Causality::Local => &[
            Variability::Constant,
            Variability::Fixed,
            Variability::Tunable,
            Variability::Discrete,
            Variability::Continuous,
        ],
    };
    if !allowed.contains(&variability) {
        error(format!("causality {causality:?} and variability {variability:?} do not go together"));
    }
    let is_initial_allowed = match causality {
        Causality::Parameter | Causality::StructuralParameter => initial == Some(Initial::Exact),
        // FMI 3.0 allows only these; FMI 2.0 allows no `initial`, which `written_attributes` checks.
        Causality::Input if description.fmi == FmiVersion::V3 => matches!(initial, None | Some(Initial::Exact)),
        Causality::Independent if description.fmi == FmiVersion::V3 => initial.is_none(),
        Causality::CalculatedParameter => initial != Some(Initial::Exact),
        Causality::Local if matches!(variability, Variability::Fixed | Variability::Tunable) => {
            initial != Some(Initial::Exact)
        }
        _ => variability != Variability::Constant || initial == Some(Initial::Exact),
    };
    if let Some(initial) = initial.filter(|_| !is_initial_allowed) {
        error(format!(
            "causality {causality:?}, variability {variability:?} and initial {initial:?} do not go together"
        ));
    }
    if variability == Variability::Continuous && variable.base_type != BaseType::Real {
        error(format!("is a continuous {}; only a Real can be continuous", variable.base_type));
    }

    let is_given = matches!(causality, Causality::Parameter | Causality::StructuralParameter | Causality::Input)
        || matches!(initial, Some(Initial::Exact | Initial::Approx));
    if is_given && !variable.has_start() && variable.size > 0 {
        error("has no start value, which inputs, parameters and variables with initial exact or approx need".into());
    }
    if !is_given && variable.has_start() {
        error("has a start value, although it is calculated".to_owned());
    }

    limits(variable, known, &mut error);
}

fn units(description: &ModelDescription, variable: &Variable, known: &Known<'_>, report: Report<'_>) {
    let mut error = |message: String| report(Finding::error(variable_named(&variable.name), message));
    match (&variable.unit, &variable.display_unit) {
        (Some(unit), _) if description.unit(unit).is_none() => {
            error(format!("its unit `{unit}` is not defined in UnitDefinitions"));
        }
        (Some(unit), Some(display)) if display != unit && !known.display_units.contains(&(&**unit, &**display)) => {
            error(format!("its display unit `{display}` is not one of the unit `{unit}`"));
        }
        (None, Some(display)) => error(format!("has the display unit `{display}`, but no unit")),
        _ => (),
    }
}

fn limits(variable: &Variable, known: &Known<'_>, error: &mut dyn FnMut(String)) {
    let (min, max) = (variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY));
    if min.is_nan() || max.is_nan() || min > max {
        return error(format!("min {min} is above max {max}"));
    }
    // A Boolean has no limits.
    let starts = variable.start.iter().chain(&variable.starts).filter(|start| start.base_type() != BaseType::Boolean);
    for start in starts.filter_map(Value::number) {
        if !start.is_finite() {
            error(format!("its start value {start} is not a finite number"));
        } else if !(min..=max).contains(&start) {
            error(format!("its start value {start} is outside of its limits, {min} to {max}"));
        }
    }
    for start in variable.start.iter().chain(&variable.starts) {
        if let (Value::Binary { hex }, Some(most)) = (start, variable.max_size)
            && hex.len() > most
        {
            error(format!("its start value has {} bytes, but its `maxSize` is {most}", hex.len()));
        }
    }
    let items = variable.declared_type.as_deref().and_then(|name| known.items.get(name));
    for start in variable.start.iter().chain(&variable.starts) {
        if let (Some(items), Value::Integer(value)) = (items, start)
            && !items.contains(value)
        {
            error(format!("its start value {start} is not one of its items"));
        }
    }
    if variable.nominal.is_some_and(|nominal| !(nominal.is_finite() && nominal > 0.0)) {
        error("its nominal value is not above 0".to_owned());
    }
}

/// A name of the structured convention (FMI 2.0.4, section 2.2.9): identifiers with indices, joined by dots, optionally
/// inside `der()`.
fn is_structured(name: &str) -> bool {
    let inner = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
    let Some(inner) = inner else { return is_identifier(name) };
    // The index of an array element may contain a comma; a derivative of higher order has a comma after the index.
    let (variable, order) = match inner.rsplit_once(',') {
        Some((variable, order)) if !order.ends_with(']') => (variable, order),
        _ => (inner, "1"),
    };
    is_identifier(variable) && !order.is_empty() && order.bytes().all(|byte| byte.is_ascii_digit())
}

/// Names with indices, joined by dots.
fn is_identifier(name: &str) -> bool {
    let mut rest = name;
    loop {
        let Some(after) = after_identifier(rest) else { return false };
        rest = after;
        if let Some(indexed) = rest.strip_prefix('[') {
            let Some((indices, after)) = indexed.split_once(']') else { return false };
            let is_index = |index: &str| !index.is_empty() && index.bytes().all(|byte| byte.is_ascii_digit());
            if !indices.split(',').all(|index| is_index(index.trim())) {
                return false;
            }
            rest = after;
        }
        match rest.strip_prefix('.') {
            Some(after) => rest = after,
            None => return rest.is_empty(),
        }
    }
}

/// Returns the text after the identifier at the start, plain or in single quotes.
fn after_identifier(text: &str) -> Option<&str> {
    if let Some(quoted) = text.strip_prefix('\'') {
        let mut escaped = false;
        for (i, c) in quoted.char_indices() {
            match c {
                '\'' if !escaped => return (i > 0).then(|| &quoted[i + 1..]),
                '\\' => escaped = !escaped,
                _ => escaped = false,
            }
        }
        return None;
    }
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let end = text.find(|c| !is_word(c)).unwrap_or(text.len());
    (end > 0 && !text.starts_with(|c: char| c.is_ascii_digit())).then(|| &text[end..])
}

/// Checks the time variable that FMI 3.0 requires.
fn independent(description: &ModelDescription, report: Report<'_>) {
    let is_time = |variable: &&Variable| variable.causality == Causality::Independent && variable.alias_of.is_none();
    let times: Vec<&Variable> = description.variables.iter().filter(is_time).collect();
    if times.is_empty() {
        let message = "has no variable with causality=\"independent\", which FMI 3.0 requires: add the time, a Float64";
        report(Finding::error("ModelVariables", message));
    }
    for time in times.iter().skip(1) {
        report(Finding::error(variable_named(&time.name), "is a second variable with causality Independent"));
    }
    for time in times.iter().filter(|time| time.base_type != BaseType::Real) {
        let message =
            format!("is the independent variable, which must be a Float64 or a Float32, not {}", time.data_type);
        report(Finding::error(variable_named(&time.name), message));
    }
}

/// Checks aliases: variables of one base type with the same value reference are one quantity.
fn aliases(description: &ModelDescription, report: Report<'_>) {
    let mut sets: BTreeMap<_, Vec<&Variable>> = BTreeMap::new();
    for variable in &description.variables {
        sets.entry((variable.base_type, variable.reference)).or_default().push(variable);
    }
    for ((base_type, reference), set) in sets.into_iter().filter(|(_, set)| set.len() > 1) {
        let names = set.iter().map(|variable| format!("`{}`", variable.name)).collect::<Vec<_>>().join(", ");
        let subject = format!("{base_type} value reference {reference}");
        let count = |causality| set.iter().filter(|variable| variable.causality == causality).count();
        if count(Causality::Input) + count(Causality::Parameter) > 1 {
            report(Finding::error(subject, format!("belongs to {names}: setting one sets the other, too")));
        } else if count(Causality::Output) > 1 {
            report(Finding::warning(subject, format!("belongs to {names}: they can never differ")));
        }
    }
}

fn structure(description: &ModelDescription, report: Report<'_>) {
    let variables = &description.variables;
    let states: BTreeSet<usize> =
        description.derivatives.iter().filter_map(|unknown| variables[unknown.variable].derivative_of).collect();
    let is_calculated = |variable: &Variable| variable.initial != Some(Initial::Exact);
    let all = |is_wanted: &dyn Fn(usize, &Variable) -> bool| -> BTreeSet<usize> {
        (0..variables.len()).filter(|&i| variables[i].alias_of.is_none() && is_wanted(i, &variables[i])).collect()
    };
    let names = match description.fmi {
        FmiVersion::V2 => ["Outputs", "Derivatives", "InitialUnknowns", "EventIndicators"],
        FmiVersion::V3 => ["Output", "ContinuousStateDerivative", "InitialUnknown", "EventIndicator"],
    };
    let outputs = all(&|_, variable| variable.causality == Causality::Output);
    let derivatives: BTreeSet<usize> = description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let listed: BTreeSet<usize> = description.initial_unknowns.iter().map(|unknown| unknown.variable).collect();
    let initial = all(&|i, variable| {
        let is_unknown = variable.causality == Causality::Output || states.contains(&i) || derivatives.contains(&i);
        // The FMU chooses which clocked variables it initializes.
        let is_unknown = if variable.clocks.is_empty() { is_unknown } else { listed.contains(&i) };
        variable.causality == Causality::CalculatedParameter || (is_unknown && is_calculated(variable))
    });

    list(description, names[0], &description.outputs, Some(&outputs), report);
    list(description, names[1], &description.derivatives, None, report);
    list(description, names[2], &description.initial_unknowns, Some(&initial), report);
    list(description, names[3], &description.event_indicators, None, report);
    for unknown in &description.derivatives {
        let variable = &variables[unknown.variable];
        if variable.derivative_of.is_none() {
            let message = format!("is listed in {}, but lacks the attribute `derivative`", names[1]);
            report(Finding::error(variable_named(&variable.name), message));
        }
        let state = variable.derivative_of.map(|of| &variables[of]);
        if let Some(state) = state.filter(|state| state.size != variable.size) {
            let message = format!(
                "must have as many elements as its state: it has {}, but `{}` has {}",
                variable.size, state.name, state.size
            );
            report(Finding::error(variable_named(&variable.name), message));
        }
    }
    for unknown in &description.event_indicators {
        let variable = &variables[unknown.variable];
        if variable.base_type != BaseType::Real || variable.variability != Variability::Continuous {
            let message = format!("is listed in {}, which takes continuous Float64 and Float32 only", names[3]);
            report(Finding::error(variable_named(&variable.name), message));
        }
    }
    let has_inputs = variables.iter().any(|variable| variable.causality == Causality::Input);
    for unknown in description.outputs.iter().filter(|unknown| has_inputs && unknown.dependencies.is_none()) {
        report(Finding::warning(
            variable_named(&variables[unknown.variable].name),
            format!(
                "its entry in {} has no `dependencies`, which means that it depends on all inputs: masters then see \
                 algebraic loops that may not be there",
                names[0]
            ),
        ));
    }
}

/// Checks that a list of the model structure is complete, has no duplicates, and declares dependencies on possible
/// knowns only.
fn list(
    description: &ModelDescription,
    name: &str,
    unknowns: &[Unknown],
    expected: Option<&BTreeSet<usize>>,
    report: Report<'_>,
) {
    let variables = &description.variables;
    let mut error = |i: usize, message: String| report(Finding::error(variable_named(&variables[i].name), message));
    let states: BTreeSet<usize> = variables.iter().filter_map(|variable| variable.derivative_of).collect();
    let mut listed = BTreeSet::new();
    for unknown in unknowns {
        if !listed.insert(unknown.variable) {
            error(unknown.variable, format!("is listed twice in {name}"));
        }
        let Some(dependencies) = &unknown.dependencies else { continue };
        for &dependency in dependencies {
            let known = &variables[dependency];
            let never = known.causality == Causality::CalculatedParameter && !name.starts_with("InitialUnknown");
            // An output or event indicator that is a state may depend on itself, because states are knowns.
            if (dependency == unknown.variable && !states.contains(&dependency)) || never {
                error(unknown.variable, format!("cannot depend on `{}` in {name}", known.name));
            }
        }
    }
    if let Some(expected) = expected {
        for &i in expected.difference(&listed) {
            error(i, format!("is not listed in ModelStructure/{name}, where it belongs"));
        }
        for &i in listed.difference(expected) {
            error(i, format!("is listed in ModelStructure/{name}, where it does not belong"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_names() {
        for name in
            ["x", "body.roll", "a[3].b", "a[1, 2]", "der(x)", "der(a.b[2], 2)", "der(a[1,2])", "'a b'.c", "'it\\'s'"]
        {
            assert!(is_structured(&name.replace(", 2)", ",2)")), "{name}");
        }
        for name in ["", "der(der(x))", "1x", "a.", ".a", "a b", "a[x]", "a[1", "der(x", "der(x,)", "''", "'a", "a-b"] {
            assert!(!is_structured(name), "{name}");
        }
    }

    #[test]
    fn dates() {
        for text in ["2026-01-31T12:00:00Z", "2026-01-31T12:00:00", "2026-01-31T12:00:00.5+01:00"] {
            assert!(is_date_time(text), "{text}");
        }
        for text in [
            "",
            "yesterday",
            "2026-1-31T12:00:00Z",
            "2026-01-31 12:00:00",
            "2026-01-31T12:00Z",
            "2026-01-31T12:00:00.Z",
        ] {
            assert!(!is_date_time(text), "{text}");
        }
    }
}
