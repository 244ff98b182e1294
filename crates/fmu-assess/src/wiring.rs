//! The systems that are compared: a plant with the units that belong to it, driven by a driver, without and with controllers.
//!
//! All signals are wired by name. A system becomes a scenario, so that all rules and messages of scenarios hold, and each of its
//! runs can be repeated by `cargo fmu run`.

use crate::vehicle::VehicleFile;
use fmu_import::description::{BaseType, Causality, ModelDescription, Value, Variable};
use fmu_system::plan::Plan;
use fmu_system::resolve::{Descriptions, Found, Options, resolve_text};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Communication step of all runs, s.
pub(crate) const STEP: f64 = 1e-3;

/// Base unit of plants whose brakes and drives are torques.
const ACTUATORS: &str = "BrakeAndDriveActuators";

/// Why the bench cannot begin.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct SetupError {
    /// What and where.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

impl SetupError {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None }
    }

    fn with_help(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: Some(help.into()) }
    }
}

/// What is assessed.
#[derive(Debug, Clone, Default)]
pub struct Subject {
    /// Name of the plant's FMU.
    pub plant: String,
    /// Units that belong to the vehicle; `None` for those that the plant needs.
    pub base: Vec<String>,
    /// Controllers.
    pub with: Vec<String>,
    /// Values for parameters: component, parameter, value as written; a number may have a unit behind it, after a space.
    pub set: Vec<(String, String, String)>,
    /// Vehicle data and names of signals.
    pub vehicle: VehicleFile,
}

/// A component of a system: an FMU that was found.
#[derive(Debug, Clone)]
pub(crate) struct Unit {
    /// Name of the component.
    pub(crate) name: String,
    /// Name of the FMU.
    pub(crate) fmu: String,
    pub(crate) found: Found,
}

impl Unit {
    fn description(&self) -> &ModelDescription {
        &self.found.description
    }

    fn variables(&self, causality: Causality) -> impl Iterator<Item = &Variable> {
        self.description().variables.iter().filter(move |variable| variable.causality == causality)
    }

    fn has(&self, causality: Causality, name: &str) -> bool {
        self.variables(causality).any(|variable| variable.name == name)
    }
}

/// The plant, whose signals may have other names.
#[derive(Debug, Clone)]
pub(crate) struct Plant {
    pub(crate) unit: Unit,
    /// Name of the FMU's variable -> name of the bench's signal, where they differ.
    renamed: BTreeMap<String, String>,
    /// Parameters that the caller has set.
    set: BTreeMap<String, f64>,
}

impl Plant {
    fn signal<'a>(&'a self, variable: &'a str) -> &'a str {
        self.renamed.get(variable).map_or(variable, String::as_str)
    }

    pub(crate) fn variable<'a>(&'a self, signal: &'a str) -> &'a str {
        self.renamed.iter().find(|(_, of)| *of == signal).map_or(signal, |(variable, _)| variable)
    }

    pub(crate) fn has_input(&self, signal: &str) -> bool {
        self.unit.has(Causality::Input, self.variable(signal))
    }

    pub(crate) fn has_output(&self, signal: &str) -> bool {
        self.unit.has(Causality::Output, self.variable(signal))
    }

    /// Whether an input begins with this.
    fn has_inputs(&self, start: &str) -> bool {
        self.unit.variables(Causality::Input).any(|variable| self.signal(&variable.name).starts_with(start))
    }

    /// Value of a Real parameter.
    pub(crate) fn parameter(&self, name: &str) -> Option<f64> {
        if let Some(value) = self.set.get(name) {
            return Some(*value);
        }
        match self.unit.description().variable(name)?.start {
            Some(Value::Real(value)) => Some(value),
            _ => None,
        }
    }

    /// Outputs, by the names of the bench.
    pub(crate) fn outputs(&self) -> Vec<String> {
        self.unit.variables(Causality::Output).map(|variable| self.signal(&variable.name).to_owned()).collect()
    }

    /// Inputs, by the names of the bench.
    pub(crate) fn inputs(&self) -> Vec<String> {
        self.unit.variables(Causality::Input).map(|variable| self.signal(&variable.name).to_owned()).collect()
    }
}

/// How the speed of a plant is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Speed {
    /// An input prescribes it.
    Prescribed,
    /// By the driver's pedals; it coasts without.
    Pedals,
    /// Nothing holds it.
    Own,
}

/// Who drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Driving {
    /// Steering as a function of time.
    OpenLoop,
    /// A driver that follows a path.
    Path,
    /// The same on a rough road.
    Ride,
}

/// What the vehicle drives on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Road {
    Flat,
    /// A component, whose parameters tell how rough.
    Rough,
}

/// A plant with its units, wired for each kind of driving.
#[derive(Debug)]
pub(crate) struct System {
    /// `without` or `with`.
    pub(crate) name: &'static str,
    pub(crate) speed: Speed,
    plans: Vec<(Driving, Plan)>,
    /// Inputs that nothing writes, and what they get instead.
    pub(crate) unwritten: Vec<(String, String)>,
    /// Units that have no effect.
    pub(crate) idle: Vec<String>,
    /// Recorded signals: names of the bench, in the order of the columns.
    columns: Vec<(Driving, Vec<String>)>,
}

impl System {
    pub(crate) fn plan(&self, driving: Driving) -> Option<&Plan> {
        self.plans.iter().find(|(of, _)| *of == driving).map(|(_, plan)| plan)
    }

    pub(crate) fn columns(&self, driving: Driving) -> &[String] {
        self.columns.iter().find(|(of, _)| *of == driving).map_or(&[], |(_, columns)| columns)
    }

    /// All its plans.
    pub(crate) fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.plans.iter().map(|(_, plan)| plan)
    }
}

/// Plant and systems of an assessment.
#[derive(Debug)]
pub(crate) struct Systems {
    pub(crate) plant: Plant,
    pub(crate) base: Vec<Unit>,
    pub(crate) with: Vec<Unit>,
    /// The one without the controllers, and the one with them if there are any.
    pub(crate) systems: Vec<System>,
}

/// A name as a component has it: `AntilockBraking` -> `antilock_braking`.
pub(crate) fn component_name(fmu: &str) -> String {
    let mut name = String::new();
    let letters: Vec<char> = fmu.chars().collect();
    for (i, letter) in letters.iter().enumerate() {
        let follows_small = i > 0 && !letters[i - 1].is_uppercase();
        let begins_word = letters.get(i + 1).is_some_and(|next| next.is_lowercase());
        if letter.is_uppercase() && i > 0 && (follows_small || begins_word) && !name.ends_with('_') {
            name.push('_');
        }
        match letter {
            letter if letter.is_alphanumeric() => name.extend(letter.to_lowercase()),
            _ if name.ends_with('_') => (),
            _ => name.push('_'),
        }
    }
    name
}

fn find(source: &dyn Descriptions, fmu: &str) -> Result<Unit, SetupError> {
    let found = source.find(fmu).map_err(SetupError::new)?;
    let Some(found) = found else {
        let names = source.names();
        let known =
            if names.is_empty() { "there are none".to_owned() } else { format!("there are {}", names.join(", ")) };
        return Err(SetupError::with_help(
            format!("there is no FMU {fmu} in {}", source.place()),
            format!("Pack it (`cargo fmu pack {fmu}`), or say where it is by --fmus; {known}."),
        ));
    };
    if found.description.co_simulation.is_none() {
        return Err(SetupError::new(format!("{} has no co-simulation", found.path)));
    }
    Ok(Unit { name: component_name(fmu), fmu: fmu.to_owned(), found })
}

impl Systems {
    /// Finds the FMUs and wires them.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn new(subject: &Subject, source: &dyn Descriptions) -> Result<Self, SetupError> {
        let mut found = Self::found(subject, source)?;
        let has_road = found.plant.inputs().iter().any(|input| input.starts_with("road_height."));
        let mut drivings = vec![(Driving::OpenLoop, Road::Flat), (Driving::Path, Road::Flat)];
        if has_road {
            drivings.push((Driving::Ride, Road::Rough));
        }
        found.systems.push(system("without", &found.plant, &found.base, subject, source, &drivings)?);
        if !found.with.is_empty() {
            found.systems.push(system("with", &found.plant, &found.units(), subject, source, &drivings)?);
        }
        Ok(found)
    }

    /// Finds the FMUs.
    pub(crate) fn found(subject: &Subject, source: &dyn Descriptions) -> Result<Self, SetupError> {
        let unit = find(source, &subject.plant)?;
        let mut renamed = BTreeMap::new();
        for (signal, variable) in &subject.vehicle.signals {
            if unit.description().variable(variable).is_none() {
                return Err(SetupError::new(format!(
                    "the vehicle data name `{signal}` `{variable}`, but {} has no such variable",
                    subject.plant
                )));
            }
            renamed.insert(variable.clone(), signal.clone());
        }
        let mut set = BTreeMap::new();
        for (_, name, value) in subject.set.iter().filter(|(component, _, _)| *component == unit.name) {
            let (number, given) = value.split_once(' ').map_or((value.as_str(), None), |(n, unit)| (n, Some(unit)));
            let Ok(number) = number.parse::<f64>() else { continue };
            let own = unit.description().variable(name).and_then(|variable| variable.unit.as_deref());
            // The vehicle data come from these numbers, too.
            if let Some(given) = given.filter(|given| Some(*given) != own) {
                let own = own.unwrap_or("1");
                return Err(SetupError::new(format!(
                    "`{name}` of {} is given in {given}: give it in {own}",
                    unit.name
                )));
            }
            set.insert(name.clone(), number);
        }
        let plant = Plant { unit, renamed, set };
        check_plant(&plant)?;
        let mut base = subject.base.iter().map(|fmu| find(source, fmu)).collect::<Result<Vec<_>, _>>()?;
        let needs_torques = plant.has_inputs("brake_torque.") || plant.has_inputs("drive_torque.");
        if base.is_empty() && needs_torques && source.names().iter().any(|name| name == ACTUATORS) {
            base.push(find(source, ACTUATORS)?);
        }
        let with = subject.with.iter().map(|fmu| find(source, fmu)).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { plant, base, with, systems: Vec::new() })
    }

    /// Wires one system, with all its controllers, for one kind of driving.
    pub(crate) fn only(
        subject: &Subject,
        source: &dyn Descriptions,
        driving: Driving,
        road: Road,
    ) -> Result<Self, SetupError> {
        let mut found = Self::found(subject, source)?;
        found.systems.push(system("with", &found.plant, &found.units(), subject, source, &[(driving, road)])?);
        Ok(found)
    }

    /// Controllers and base units.
    fn units(&self) -> Vec<Unit> {
        self.with.iter().chain(&self.base).cloned().collect()
    }
}

fn check_plant(plant: &Plant) -> Result<(), SetupError> {
    let mut missing = Vec::new();
    if !plant.has_input("steer.front") {
        missing.push("input `steer.front`");
    }
    for (name, text) in [
        ("vehicle.yaw_rate", "output `vehicle.yaw_rate`"),
        ("vehicle.speed", "output `vehicle.speed`"),
        ("vehicle.lateral_acceleration", "output `vehicle.lateral_acceleration`"),
    ] {
        if !plant.has_output(name) {
            missing.push(text);
        }
    }
    if missing.is_empty() {
        return Ok(());
    }
    Err(SetupError::with_help(
        format!("{} cannot be driven: it has no {}", plant.unit.fmu, missing.join(" and no ")),
        "If it has them by other names, write a file with [signals] \"steer.front\" = \"its name\", and so on, and give it by \
         --vehicle.",
    ))
}

/// Units in the order of a step: who writes a signal comes before who reads it. A circle is cut at its first unit; ties keep the
/// order.
fn ordered(units: &[Unit]) -> Vec<&Unit> {
    let mut left: Vec<&Unit> = units.iter().collect();
    let mut order = Vec::new();
    while !left.is_empty() {
        let waits = |unit: &Unit| {
            left.iter().any(|other| {
                other.name != unit.name
                    && other.variables(Causality::Output).any(|output| unit.has(Causality::Input, &output.name))
            })
        };
        let next = left.iter().position(|unit| !waits(unit)).unwrap_or(0);
        order.push(left.remove(next));
    }
    order
}

/// Signals of drivers, with the kind of driving that has them.
const OF_DRIVER: [&str; 4] = ["driver.steer", "driver.speed", "driver.throttle", "driver.brake"];
const OF_PATH: [&str; 5] =
    ["path.lateral_deviation", "path.heading_error", "path.distance", "path.finished", "path.lost"];

/// Outputs of a plant that are recorded if it has them; the last ones are beginnings of names.
const RECORDED: [&str; 20] = [
    "vehicle.speed",
    "vehicle.yaw_rate",
    "vehicle.lateral_acceleration",
    "vehicle.sideslip",
    "vehicle.yaw",
    "vehicle.position_x",
    "vehicle.position_y",
    "vehicle.load_transfer_ratio",
    "body.roll",
    "body.roll_rate",
    "body.heave_acceleration",
    "body.roll_acceleration",
    "body.pitch_acceleration",
    "vehicle.longitudinal_acceleration",
    "vehicle.lateral_velocity",
    "body.pitch",
    "body.heave",
    "vehicle.yaw_acceleration",
    "tire_load.",
    "suspension_deflection.",
];

/// A system in the making.
struct Wiring<'a> {
    plant: &'a Plant,
    units: Vec<&'a Unit>,
    driving: Driving,
    road: Road,
    driver: &'static str,
    unwritten: Vec<(String, String)>,
}

impl Wiring<'_> {
    /// The component that writes a signal, other than the plant.
    fn writer(&self, signal: &str) -> Option<(&str, String)> {
        if OF_DRIVER.contains(&signal) || (self.driving != Driving::OpenLoop && OF_PATH.contains(&signal)) {
            return Some(("driver", signal.to_owned()));
        }
        let unit = self.units.iter().find(|unit| unit.has(Causality::Output, signal));
        if let Some(unit) = unit {
            return Some((&unit.name, signal.to_owned()));
        }
        let of_road = signal.starts_with("road_height.") || signal.starts_with("road_friction.");
        (self.road == Road::Rough && of_road).then(|| ("road", signal.to_owned()))
    }

    /// Where an input gets its value from: another component, or a constant.
    fn source(&mut self, component: &str, variable: &Variable, signal: &str) -> Source {
        let is_plant = component == "plant";
        if let Some((writer, name)) = self.writer(signal).filter(|(writer, _)| *writer != component) {
            return Source::Signal(writer.to_owned(), name);
        }
        if !is_plant && self.plant.has_output(signal) {
            return Source::Signal("plant".to_owned(), self.plant.variable(signal).to_owned());
        }
        let begins = |starts: &[&str]| starts.iter().any(|start| signal.starts_with(start));
        let fallback = if signal == "steer.front" {
            self.unwritten.push((signal.to_owned(), "driver.steer".to_owned()));
            return Source::Signal("driver".to_owned(), "driver.steer".to_owned());
        } else if begins(&["brake_pressure_command."]) {
            match self.units.iter().find(|unit| unit.has(Causality::Output, "brake.master_pressure")) {
                Some(unit) => {
                    self.unwritten.push((signal.to_owned(), "brake.master_pressure".to_owned()));
                    return Source::Signal(unit.name.clone(), "brake.master_pressure".to_owned());
                }
                None => None,
            }
        } else if begins(&["steer.middle", "steer.rear", "suspension_force.", "road_height.", "yaw_control_pressure."])
        {
            Some(0.0)
        } else if begins(&["road_friction.", "enable."]) {
            Some(1.0)
        } else if begins(&["target_slip."]) {
            Some(0.2)
        } else {
            None
        };
        let value = match (fallback, variable.base_type, &variable.start) {
            (Some(number), BaseType::Boolean, _) => (number > 0.5).to_string(),
            (Some(number), BaseType::Integer, _) => (number as i64).to_string(),
            (Some(number), _, _) => format!("{number:?}"),
            (None, _, Some(Value::Real(start))) => format!("{start:?}"),
            (None, _, Some(Value::Integer(start))) => start.to_string(),
            (None, _, Some(Value::Boolean(start))) => start.to_string(),
            (None, _, _) => "0.0".to_owned(),
        };
        let text = if fallback.is_none() { format!("{value} (start value)") } else { value.clone() };
        let entry = (signal.to_owned(), text);
        if !self.unwritten.contains(&entry) {
            self.unwritten.push(entry);
        }
        Source::Constant(value)
    }

    /// The scenario.
    fn scenario(&mut self, set: &[(String, String, String)]) -> String {
        let mut text = String::from("title = \"Assessment\"\n[simulation]\nstop = 1.0\n");
        let _ = writeln!(text, "step = {STEP:?}");
        let mut connections = String::new();
        let component = |text: &mut String, name: &str, fmu: &str, constants: &[(String, String)]| {
            let _ = writeln!(text, "[[component]]\nname = {}\nfmu = {}", quoted(name), quoted(fmu));
            let values: Vec<_> = set.iter().filter(|(of, _, _)| of == name).collect();
            if !values.is_empty() {
                let values: Vec<_> =
                    values.iter().map(|(_, name, value)| format!("{} = {}", quoted(name), literal(value))).collect();
                let _ = writeln!(text, "parameters = {{ {} }}", values.join(", "));
            }
            if !constants.is_empty() {
                let values: Vec<_> =
                    constants.iter().map(|(name, value)| format!("{} = {value}", quoted(name))).collect();
                let _ = writeln!(text, "inputs = {{ {} }}", values.join(", "));
            }
        };
        let mut missing = Vec::new();
        if self.driving != Driving::OpenLoop {
            for signal in ["vehicle.position_x", "vehicle.position_y", "vehicle.yaw", "vehicle.speed", "body.roll_rate"]
            {
                if self.plant.has_output(signal) {
                    connect(&mut connections, "plant", self.plant.variable(signal), "driver", signal);
                } else {
                    missing.push((signal.to_owned(), "0.0".to_owned()));
                }
            }
        }
        component(&mut text, "driver", self.driver, &missing);
        if self.road == Road::Rough {
            component(&mut text, "road", "Road", &[]);
            connect(&mut connections, "plant", self.plant.variable("vehicle.speed"), "road", "vehicle.speed");
        }
        let all: Vec<&Unit> = self.units.iter().copied().chain([&self.plant.unit]).collect();
        for unit in all {
            let is_plant = std::ptr::eq(unit, &raw const self.plant.unit);
            let name = if is_plant { "plant" } else { unit.name.as_str() };
            let mut constants = Vec::new();
            for variable in unit.variables(Causality::Input) {
                let signal =
                    if is_plant { self.plant.signal(&variable.name).to_owned() } else { variable.name.clone() };
                match self.source(name, variable, &signal) {
                    Source::Signal(from, output) => connect(&mut connections, &from, &output, name, &variable.name),
                    Source::Constant(value) => constants.push((variable.name.clone(), value)),
                }
            }
            component(&mut text, name, &unit.fmu, &constants);
        }
        let signals: Vec<_> = self.recorded().iter().map(|signal| quoted(signal)).collect();
        let _ = writeln!(text, "{connections}[[case]]\nname = \"assessed\"\ntitle = \"Assessed\"");
        let _ = writeln!(text, "[record]\nsignals = [{}]", signals.join(", "));
        text
    }

    /// Recorded signals, as a scenario names them.
    fn recorded(&self) -> Vec<String> {
        let path: &[&str] = if self.driving == Driving::OpenLoop { &[] } else { &OF_PATH };
        let mut signals: Vec<String> = OF_DRIVER.iter().chain(path).map(|signal| format!("driver:{signal}")).collect();
        for signal in self.plant.outputs() {
            let is_wanted = RECORDED
                .iter()
                .any(|wanted| *wanted == signal || (wanted.ends_with('.') && signal.starts_with(wanted)));
            if is_wanted {
                signals.push(format!("plant:{}", self.plant.variable(&signal)));
            }
        }
        signals
    }
}

/// Where an input gets its value from.
enum Source {
    /// Component and output.
    Signal(String, String),
    /// As TOML writes it.
    Constant(String),
}

fn connect(connections: &mut String, from: &str, output: &str, to: &str, input: &str) {
    let (from, to) = (quoted(&format!("{from}:{output}")), quoted(&format!("{to}:{input}")));
    let _ = writeln!(connections, "[[connection]]\nfrom = {from}\nto = {to}");
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A value of the command line as TOML: a number, also with a unit behind it, or a truth value as it is, anything else as text.
fn literal(value: &str) -> String {
    if let Some((number, unit)) = value.split_once(' ').filter(|(number, _)| number.parse::<f64>().is_ok()) {
        return format!("{{ value = {}, unit = {} }}", literal(number), quoted(unit));
    }
    match value.parse::<f64>() {
        Ok(number) if value.contains(['.', 'e', 'E']) => format!("{number:?}"),
        Ok(_) => value.to_owned(),
        Err(_) if ["true", "false"].contains(&value) => value.to_owned(),
        Err(_) => quoted(value),
    }
}

fn system(
    name: &'static str,
    plant: &Plant,
    units: &[Unit],
    subject: &Subject,
    source: &dyn Descriptions,
    drivings: &[(Driving, Road)],
) -> Result<System, SetupError> {
    let mut written: BTreeMap<&str, &str> = BTreeMap::new();
    for unit in units {
        for output in unit.variables(Causality::Output) {
            if let Some(other) = written.insert(&output.name, &unit.fmu) {
                return Err(SetupError::with_help(
                    format!("{other} and {} both write `{}`", unit.fmu, output.name),
                    "Leave one of them out.",
                ));
            }
        }
    }
    let reads = |signal: &str| plant.has_input(signal) || units.iter().any(|unit| unit.has(Causality::Input, signal));
    let acts = |unit: &&Unit| unit.variables(Causality::Output).any(|output| reads(&output.name));
    let idle = units.iter().filter(|unit| !acts(unit)).map(|unit| unit.fmu.clone()).collect();
    let has_pedals = units.iter().any(|unit| {
        unit.variables(Causality::Output)
            .any(|o| o.name.starts_with("drive_torque.") || o.name.starts_with("brake_torque."))
    });
    let speed = if plant.has_input("driver.speed") {
        Speed::Prescribed
    } else if has_pedals {
        Speed::Pedals
    } else {
        Speed::Own
    };
    let set: Vec<_> = (subject.set.iter().cloned())
        .map(|(component, name, value)| {
            (if component == plant.unit.name { "plant".to_owned() } else { component }, name, value)
        })
        .collect();
    let mut plans = Vec::new();
    let mut columns = Vec::new();
    let mut unwritten = Vec::new();
    for &(driving, road) in drivings {
        let driver = if driving == Driving::OpenLoop { "Driver" } else { "PathDriver" };
        let mut wiring = Wiring { plant, units: ordered(units), driving, road, driver, unwritten: Vec::new() };
        let text = wiring.scenario(&set);
        let options = Options::default();
        let plan = resolve_text(Path::new("assessment.toml"), &text, source, &options)
            .map_err(|error| SetupError::new(explained(&error)))?;
        columns.push((driving, plan.columns.iter().map(|column| signal_of(&column.name, plant)).collect()));
        plans.push((driving, plan));
        if unwritten.is_empty() {
            unwritten = wiring.unwritten;
        }
    }
    Ok(System { name, speed, plans, unwritten, idle, columns })
}

/// The bench's name of a column, which has that of its component in front where several components have the signal.
fn signal_of(column: &str, plant: &Plant) -> String {
    let (component, variable) = column.split_once(':').unwrap_or(("", column));
    let is_of_driver = OF_DRIVER.contains(&variable) || OF_PATH.contains(&variable);
    if component == "driver" || (component.is_empty() && is_of_driver) {
        return variable.to_owned();
    }
    plant.signal(variable).to_owned()
}

fn explained(error: &fmu_system::resolve::ResolveError) -> String {
    use fmu_system::resolve::ResolveError;
    match error {
        // Places in a text that nobody has written would not help.
        ResolveError::Problems(problems) => {
            let lines = problems.problems.iter().map(ToString::to_string);
            lines.collect::<Vec<_>>().join("\n")
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_named_like_their_fmus() {
        for (fmu, name) in [
            ("EspCar", "esp_car"),
            ("AntilockBraking", "antilock_braking"),
            ("RollLQRSuspension", "roll_lqr_suspension"),
            ("my-plant", "my_plant"),
            ("Stranger2", "stranger2"),
        ] {
            assert_eq!(component_name(fmu), name);
        }
    }

    #[test]
    fn values_of_the_command_line_become_toml() {
        for (given, written) in
            [("1", "1"), ("1.5", "1.5"), ("1e3", "1000.0"), ("true", "true"), ("individual", "\"individual\"")]
        {
            assert_eq!(literal(given), written);
        }
    }
}
