//! The systems that are compared: a plant with its base components, driven by a driver, without and with controllers.
//!
//! All signals are wired by name. A system becomes a scenario, so that all rules and messages of scenarios hold, and each of its
//! runs can be repeated by `chassis run`.

use crate::signals::{self, Conversion, conversion};
use crate::vehicle::VehicleFile;
use fmu_import::description::{BaseType, Causality, ModelDescription, Value, Variable};
use fmu_import::names::suggestion;
use fmu_system::master::Recording;
use fmu_system::plan::Plan;
use fmu_system::resolve::{Descriptions, Found, Options, resolve_text};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Name of the times of a recording in the file of a vehicle.
const TIME: &str = "time";

/// Communication step of all runs, s.
pub(crate) const STEP: f64 = 1e-3;

/// Base component of plants whose brakes and drives are torques.
pub const ACTUATORS: &str = "BrakeAndDriveActuators";

/// Error while setting up the bench.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct SetupError {
    /// Message, with the place.
    pub message: String,
    /// Remedy.
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

/// Subject of an assessment.
#[derive(Debug, Clone, Default)]
pub struct Subject {
    /// Name of the plant's FMU.
    pub plant: String,
    /// Components that belong to the vehicle; empty for those that the plant needs.
    pub base: Vec<String>,
    /// Controllers.
    pub with: Vec<String>,
    /// Values for parameters: component, parameter, value as written; a number may be followed by a space and a unit.
    pub set: Vec<(String, String, String)>,
    /// FMUs of `with` and `base` in the caller's order; empty: those of `with` first.
    pub order: Vec<String>,
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
    /// Name of the FMU's variable -> name of the bench's signal, where they differ.
    renamed: BTreeMap<String, String>,
    /// Units of signals of the bench that the caller has given.
    given: BTreeMap<String, String>,
}

impl Unit {
    pub(crate) fn description(&self) -> &ModelDescription {
        &self.found.description
    }

    fn variables(&self, causality: Causality) -> impl Iterator<Item = &Variable> {
        self.description().variables.iter().filter(move |variable| variable.causality == causality)
    }

    /// Inputs or outputs, by the names of the bench.
    fn signals(&self, causality: Causality) -> impl Iterator<Item = &str> {
        self.variables(causality).map(|variable| self.signal(&variable.name))
    }

    /// True if it has an input or output of this name of the bench.
    fn has(&self, causality: Causality, signal: &str) -> bool {
        self.signals(causality).any(|name| name == signal)
    }

    /// The bench's name of a variable.
    fn signal<'a>(&'a self, variable: &'a str) -> &'a str {
        self.renamed.get(variable).map_or(variable, String::as_str)
    }

    /// The FMU's name of a signal.
    fn variable<'a>(&'a self, signal: &'a str) -> &'a str {
        self.renamed.iter().find(|(_, of)| *of == signal).map_or(signal, |(variable, _)| variable)
    }

    /// A value that the bench gives to a variable, in the unit of the variable.
    ///
    /// # Errors
    /// The unit of the variable is another quantity.
    pub(crate) fn of_si(&self, signal: &str, variable: &Variable, value: f64) -> Result<f64, String> {
        let Some(needed) = signals::unit(signal) else { return Ok(value) };
        let found = conversion(needed, self.description(), variable, self.given.get(signal).map(String::as_str));
        let found = found.map_err(|unit| format!("`{}` is in {unit}, but the bench writes {needed}", variable.name))?;
        Ok(found.map_or(value, |conversion| conversion.of_si(value)))
    }
}

/// The plant, whose signals may have other names.
#[derive(Debug, Clone)]
pub(crate) struct Plant {
    pub(crate) unit: Unit,
    /// Parameters that define its size, SI.
    data: BTreeMap<&'static str, f64>,
    /// Other Real parameters that the caller has set.
    set: BTreeMap<String, f64>,
    /// Conversions of outputs that are not in the unit of the bench.
    conversions: BTreeMap<String, Conversion>,
    /// Signals that declare no unit, and the unit that they are taken to be in.
    pub(crate) assumed: BTreeMap<String, &'static str>,
}

impl Plant {
    /// `set` are parameters of the caller, `units` are units of signals, which take precedence over the declared ones.
    fn new(mut unit: Unit, set: BTreeMap<String, f64>, units: &BTreeMap<String, String>) -> Result<Self, SetupError> {
        // The time is that of recordings.
        unit.given = units.iter().filter(|(signal, _)| *signal != TIME).map(|(a, b)| (a.clone(), b.clone())).collect();
        let (conversions, assumed) = (BTreeMap::new(), BTreeMap::new());
        let mut plant = Self { unit, data: BTreeMap::new(), set, conversions, assumed };
        check_plant(&plant)?;
        for signal in plant.unit.given.keys() {
            if !plant.has_input(signal) && !plant.has_output(signal) {
                let message = format!("{} has no `{signal}`, whose unit is given", plant.unit.fmu);
                return Err(SetupError::new(message));
            }
            if signals::unit(signal).is_none() {
                return Err(SetupError::new(format!("the bench does not read `{signal}`, whose unit is given")));
            }
        }
        for variable in &plant.unit.description().variables {
            let signal = plant.signal(&variable.name).to_owned();
            let is_read = match variable.causality {
                Causality::Input => true,
                Causality::Output => is_recorded(&signal),
                _ => false,
            };
            let Some(needed) = signals::unit(&signal).filter(|_| is_read && variable.base_type == BaseType::Real)
            else {
                continue;
            };
            let given = plant.unit.given.get(&signal).cloned();
            let given = given.as_deref();
            if given.is_none() && variable.unit.is_none() && needed != "1" {
                plant.assumed.insert(signal.clone(), needed);
            }
            let found = conversion(needed, plant.unit.description(), variable, given);
            let found = found.map_err(|unit| wrong_unit(&plant.unit, variable, &signal, &unit, needed))?;
            if let Some(conversion) = found {
                if variable.causality == Causality::Input && !of_bench(&signal) || OF_VEHICLE.contains(&signal.as_str())
                {
                    let unit = given.or(variable.unit.as_deref()).unwrap_or_default();
                    return Err(wired_unit(&plant.unit, variable, unit, needed));
                }
                plant.conversions.insert(signal, conversion);
            }
        }
        for (name, needed) in signals::DATA {
            let (Some(variable), Some(value)) =
                (plant.unit.description().variable(name), real_parameter(&plant.unit, &plant.set, name))
            else {
                continue;
            };
            let found = conversion(needed, plant.unit.description(), variable, None);
            let found = found.map_err(|unit| wrong_unit(&plant.unit, variable, name, &unit, needed))?;
            plant.data.insert(name, found.map_or(value, |conversion| conversion.to_si(value)));
        }
        Ok(plant)
    }

    fn signal<'a>(&'a self, variable: &'a str) -> &'a str {
        self.unit.signal(variable)
    }

    pub(crate) fn variable<'a>(&'a self, signal: &'a str) -> &'a str {
        self.unit.variable(signal)
    }

    pub(crate) fn has_input(&self, signal: &str) -> bool {
        self.unit.has(Causality::Input, signal)
    }

    pub(crate) fn has_output(&self, signal: &str) -> bool {
        self.unit.has(Causality::Output, signal)
    }

    /// Returns true if an input begins with `start`.
    fn has_inputs(&self, start: &str) -> bool {
        self.unit.signals(Causality::Input).any(|signal| signal.starts_with(start))
    }

    /// Rejects a controller that reads a signal that the bench converts: a connection does not convert it.
    fn check_reader(&self, reader: &Unit, all: &[&Unit]) -> Result<(), SetupError> {
        let is_raw = |signal: &&str| {
            self.conversions.contains_key(*signal)
                && self.has_output(signal)
                && !all.iter().any(|unit| unit.has(Causality::Output, signal))
        };
        let Some(signal) = reader.signals(Causality::Input).find(is_raw) else { return Ok(()) };
        let name = self.variable(signal);
        let variable = self.unit.description().variable(name);
        let declared = variable.and_then(|variable| variable.unit.as_deref());
        let unit = self.unit.given.get(signal).map(String::as_str).or(declared).unwrap_or_default();
        let (plant, reader) = (&self.unit.fmu, &reader.fmu);
        let needed = signals::unit(signal).unwrap_or_default();
        Err(SetupError::with_help(
            format!("`{name}` of {plant} is in {unit}, but {reader} reads it in {needed}"),
            format!(
                "Export {plant} with `{name}` in {needed}: the bench converts what it records, not what it connects."
            ),
        ))
    }

    /// Value of a Real parameter, in SI if it defines the size of the plant.
    pub(crate) fn parameter(&self, name: &str) -> Option<f64> {
        self.data.get(name).copied().or_else(|| real_parameter(&self.unit, &self.set, name))
    }

    /// A recording of signals of the bench in the units of the bench.
    pub(crate) fn converted<'a>(&self, signals: &[String], recording: &'a Recording) -> Cow<'a, Recording> {
        let mut recording = Cow::Borrowed(recording);
        for (index, signal) in signals.iter().enumerate() {
            if let Some(conversion) = self.conversions.get(signal)
                && recording.column(index).is_some()
                && let Some(Some(column)) = recording.to_mut().columns.get_mut(index)
            {
                column.iter_mut().for_each(|value| *value = conversion.to_si(*value));
            }
        }
        recording
    }

    /// Outputs, by the names of the bench.
    pub(crate) fn outputs(&self) -> Vec<String> {
        self.unit.signals(Causality::Output).map(str::to_owned).collect()
    }

    /// Inputs, by the names of the bench.
    pub(crate) fn inputs(&self) -> Vec<String> {
        self.unit.signals(Causality::Input).map(str::to_owned).collect()
    }
}

/// Value of a Real parameter in its own unit: that of the caller, or its start value.
fn real_parameter(unit: &Unit, set: &BTreeMap<String, f64>, name: &str) -> Option<f64> {
    if let Some(value) = set.get(name) {
        return Some(*value);
    }
    match unit.description().variable(name)?.start {
        Some(Value::Real(value)) => Some(value),
        _ => None,
    }
}

/// Control of the speed of a plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Speed {
    /// An input prescribes it.
    Prescribed,
    /// By the driver's pedals; it coasts without.
    Pedals,
    /// Nothing holds it.
    Own,
}

/// Kind of driving.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Driving {
    /// Steering as a function of time.
    OpenLoop,
    /// A driver that follows a path.
    Path,
    /// The same on a rough road.
    Ride,
}

/// Surface of the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Road {
    Flat,
    /// A component, whose parameters define the roughness.
    Rough,
}

/// A plant with its components, wired for each kind of driving.
#[derive(Debug)]
pub(crate) struct System {
    /// `without` or `with`.
    pub(crate) name: &'static str,
    pub(crate) speed: Speed,
    plans: Vec<(Driving, Plan)>,
    /// Inputs that nothing writes, and the values that they get instead, of all kinds of driving.
    pub(crate) unwritten: Vec<(String, String)>,
    /// Components without an effect.
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
    /// Controllers and base components, in the caller's order.
    all: Vec<Unit>,
    drivers: Vec<Unit>,
    /// Values of the caller, by the components of the scenarios.
    set: Vec<(String, String, String)>,
    /// True if the caller mirrors the paths of the driver.
    pub(crate) is_mirrored: bool,
    /// The one without the controllers, and the one with them if there are any.
    pub(crate) systems: Vec<System>,
}

/// Name of the component of an FMU: `AntilockBraking` -> `antilock_braking`.
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

/// Finds an FMU. `names` has the FMU's names of signals, where they differ from those of the bench.
fn find(source: &dyn Descriptions, fmu: &str, names: Option<&BTreeMap<String, String>>) -> Result<Unit, SetupError> {
    let found = source.find(fmu).map_err(SetupError::new)?;
    let Some(found) = found else {
        let names = source.names();
        let similar = suggestion(fmu, names.iter().map(String::as_str));
        let help = similar.unwrap_or_else(|| {
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            format!("Pack it (`cargo fmu pack {fmu}`), or say where it is by --fmus. There are {known}.")
        });
        return Err(SetupError::with_help(format!("there is no FMU {fmu} in {}", source.place()), help));
    };
    if found.description.co_simulation.is_none() {
        return Err(SetupError::new(format!("{} has no co-simulation", found.path)));
    }
    let mut renamed = BTreeMap::new();
    for (signal, variable) in names.into_iter().flatten().filter(|(signal, _)| *signal != TIME) {
        if found.description.variable(variable).is_none() {
            return Err(SetupError::new(format!(
                "the vehicle data name `{signal}` `{variable}`, but {fmu} has no such variable"
            )));
        }
        renamed.insert(variable.clone(), signal.clone());
    }
    Ok(Unit { name: component_name(fmu), fmu: fmu.to_owned(), found, renamed, given: BTreeMap::new() })
}

impl Systems {
    /// Values of the caller: component, parameter, value.
    pub(crate) fn given(&self) -> impl Iterator<Item = (&Unit, &str, &str)> {
        self.set.iter().filter_map(|(component, name, value)| {
            let mut units = self.all.iter().chain(&self.drivers);
            let is_known = |unit: &&Unit| unit.description().variable(name).is_some();
            let unit = match component.as_str() {
                "plant" => Some(&self.plant.unit),
                "driver" => self.drivers.iter().find(is_known),
                _ => units.find(|unit| unit.name == *component),
            };
            unit.map(|unit| (unit, name.as_str(), value.as_str()))
        })
    }

    /// Finds the FMUs and wires them.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn new(subject: &Subject, source: &dyn Descriptions) -> Result<Self, SetupError> {
        let mut found = Self::found(subject, source)?;
        let mut drivings = vec![(Driving::OpenLoop, Road::Flat), (Driving::Path, Road::Flat)];
        if found.plant.has_inputs("road_height.") {
            drivings.push((Driving::Ride, Road::Rough));
        }
        found.wire("without", &found.base.clone(), source, &drivings)?;
        if !found.with.is_empty() {
            found.wire("with", &found.all.clone(), source, &drivings)?;
        }
        Ok(found)
    }

    /// Wires one system, with all its controllers, for one kind of driving.
    pub(crate) fn only(
        subject: &Subject,
        source: &dyn Descriptions,
        driving: Driving,
        road: Road,
    ) -> Result<Self, SetupError> {
        let mut found = Self::found(subject, source)?;
        found.wire("with", &found.all.clone(), source, &[(driving, road)])?;
        Ok(found)
    }

    fn wire(
        &mut self,
        name: &'static str,
        units: &[Unit],
        source: &dyn Descriptions,
        drivings: &[(Driving, Road)],
    ) -> Result<(), SetupError> {
        let system = system(name, &self.plant, units, &self.drivers, &self.set, source, drivings)?;
        self.systems.push(system);
        Ok(())
    }

    /// Finds the FMUs.
    pub(crate) fn found(subject: &Subject, source: &dyn Descriptions) -> Result<Self, SetupError> {
        let unit = find(source, &subject.plant, Some(&subject.vehicle.signals))?;
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
        let plant = Plant::new(unit, set, &subject.vehicle.units)?;
        let of = |fmu: &String| find(source, fmu, subject.vehicle.controllers.get(fmu));
        let mut base = subject.base.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        let needs_torques = plant.has_inputs("brake_torque.") || plant.has_inputs("drive_torque.");
        if base.is_empty() && needs_torques && source.names().iter().any(|name| name == ACTUATORS) {
            base.push(of(&ACTUATORS.to_owned())?);
        }
        let with = subject.with.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        let controllers: Vec<&Unit> = with.iter().chain(&base).collect();
        controllers.iter().try_for_each(|unit| plant.check_reader(unit, &controllers))?;
        let mut all: Vec<Unit> = with.iter().chain(&base).cloned().collect();
        all.sort_by_key(|unit| subject.order.iter().position(|fmu| *fmu == unit.fmu).unwrap_or(usize::MAX));
        let drivers = DRIVERS.into_iter().filter_map(|fmu| find(source, fmu, None).ok()).collect::<Vec<_>>();
        let set = settings(subject, &plant, &all, &drivers)?;
        let is_mirrored = set.iter().any(|(component, name, value)| {
            let is_true = value == "true" || value.parse::<f64>().is_ok_and(|number| number > 0.5);
            component == "driver" && name == "path.mirror" && is_true
        });
        Ok(Self { plant, base, with, all, drivers, set, is_mirrored, systems: Vec::new() })
    }
}

/// FMUs of the drivers: steering as a function of time, and along a path.
const DRIVERS: [&str; 2] = ["Driver", "PathDriver"];

/// Parameters of drivers and plants that the bench sets itself, and what to do instead of setting them.
const GIVEN: [(&str, &str, &str); 6] = [
    ("driver", "geometry.wheelbase", "Give `wheelbase` in the table [vehicle] of a file, by --vehicle."),
    (
        "driver",
        "vehicle.understeer_gradient",
        "Give `understeer_gradient` in the table [vehicle] of a file, by --vehicle.",
    ),
    ("driver", "steer.ratio", "Give `steer_ratio` in the table [vehicle] of a file, by --vehicle."),
    ("driver", "path.vehicle_width", "Give `width` in the table [vehicle] of a file, by --vehicle."),
    ("driver", "speed.initial", "Use --speed."),
    ("plant", "vehicle.initial_speed", "Use --speed."),
];

/// Parameters of drivers and road that the procedures of the maneuvers prescribe.
const PRESCRIBED: [(&str, &[&str]); 2] = [
    (
        "driver",
        &[
            "maneuver",
            "table.file",
            "path.start",
            "path.radius",
            "path.turn_in",
            "path.arc",
            "path.overlap",
            "path.offset",
            "path.change_distance",
            "path.run_out",
            "path.lost_distance",
            "steer.amplitude",
            "steer.start",
            "steer.rise_time",
            "steer.frequency",
            "steer.dwell_time",
            "steer.wheel_amplitude",
            "steer.wheel_rate",
            "steer.maximum_dwell",
            "steer.hold_start",
            "roll_rate.threshold",
            "speed.control",
            "speed.final",
            "speed.start",
            "speed.rise_time",
            "release.distance",
            "brake.amplitude",
            "brake.start",
            "brake.rise_time",
        ],
    ),
    (
        "road",
        &[
            "profile",
            "tracks",
            "roughness.start",
            "roughness.class",
            "seed",
            "geometry.axle_offset.middle",
            "geometry.axle_offset.rear",
        ],
    ),
];

/// The values of the caller, by the components of the scenarios.
fn settings(
    subject: &Subject,
    plant: &Plant,
    units: &[Unit],
    drivers: &[Unit],
) -> Result<Vec<(String, String, String)>, SetupError> {
    let mut known = vec![plant.unit.name.as_str(), "driver"];
    if plant.has_inputs("road_height.") {
        known.push("road");
    }
    known.extend(units.iter().map(|unit| unit.name.as_str()));
    let mut set = Vec::new();
    for (component, name, value) in &subject.set {
        if !known.contains(&component.as_str()) {
            let message = format!("there is no component `{component}` whose `{name}` could be set");
            return Err(SetupError::with_help(message, format!("There are `{}`.", known.join("`, `"))));
        }
        let own = if *component == plant.unit.name { "plant" } else { component.as_str() };
        let given = GIVEN.iter().find(|(of, parameter, _)| *of == own && parameter == name).map(|(_, _, help)| *help);
        let is_prescribed = PRESCRIBED.iter().any(|(of, names)| *of == own && names.contains(&name.as_str()));
        if given.is_some() || is_prescribed {
            return Err(SetupError::with_help(
                format!("`{component}:{name}` cannot be set: the bench gives it a value"),
                given.unwrap_or("The procedures of the maneuvers prescribe it."),
            ));
        }
        let is_known = |driver: &Unit| driver.description().variable(name).is_some();
        if own == "driver" && !drivers.is_empty() && !drivers.iter().any(is_known) {
            let names = drivers.iter().flat_map(|driver| driver.variables(Causality::Parameter));
            let help = suggestion(name, names.map(|variable| variable.name.as_str()));
            let message = format!("neither Driver nor PathDriver has a parameter `{name}`");
            return Err(SetupError { message, help });
        }
        let unit = std::iter::once(&plant.unit).chain(units).find(|unit| unit.name == *component);
        if let Some(unit) = unit.filter(|unit| unit.description().variable(name).is_none()) {
            let names = unit.variables(Causality::Parameter).map(|variable| variable.name.as_str());
            let message = format!("{} has no parameter `{name}`", unit.fmu);
            return Err(SetupError { message, help: suggestion(name, names) });
        }
        set.push((own.to_owned(), name.clone(), value.clone()));
    }
    Ok(set)
}

/// Returns true for an input that only the bench sets, to a constant.
fn of_bench(signal: &str) -> bool {
    ["road_friction.", "target_slip."].iter().any(|start| signal.starts_with(start))
}

fn wrong_unit(unit: &Unit, variable: &Variable, signal: &str, found: &str, needed: &str) -> SetupError {
    let name = &variable.name;
    let declare = format!("Declare the unit of `{name}` with its base units in the FMU");
    let help = match variable.causality {
        Causality::Input | Causality::Output => format!(
            "{declare}, or give it in a file by --vehicle: [signals] \"{signal}\" = {{ variable = \"{name}\", unit = \
             \"{needed}\" }}."
        ),
        _ => format!("{declare}."),
    };
    SetupError::with_help(
        format!("`{name}` of {} is in {found}, but the bench needs {needed}, or a unit that converts to it", unit.fmu),
        help,
    )
}

fn wired_unit(unit: &Unit, variable: &Variable, found: &str, needed: &str) -> SetupError {
    let name = &variable.name;
    SetupError::with_help(
        format!("`{name}` of {} is in {found}, but the other end of its connection is in {needed}", unit.fmu),
        format!(
            "Export {} with `{name}` in {needed}: the bench converts what it records, not what it connects.",
            unit.fmu
        ),
    )
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

/// Components in the order of a step: the writer of a signal comes before its readers. A cycle is broken at its first component in `units`;
/// ties keep the order.
fn ordered(units: &[Unit]) -> Vec<&Unit> {
    let writes = |unit: &Unit, other: &Unit| {
        unit.name != other.name && unit.signals(Causality::Output).any(|output| other.has(Causality::Input, output))
    };
    let edges: Vec<Vec<bool>> =
        units.iter().map(|unit| units.iter().map(|other| writes(unit, other)).collect()).collect();
    order(&edges).into_iter().map(|index| &units[index]).collect()
}

/// The order of a graph: `edges[i][j]` is true if i comes before j, unless both are in a cycle that is cut there.
fn order(edges: &[Vec<bool>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..edges.len()).collect();
    let mut order = Vec::new();
    while !left.is_empty() {
        // Transitive closure of the edges.
        let mut reaches = edges.to_vec();
        for via in &left {
            for from in &left {
                for to in &left {
                    reaches[*from][*to] |= reaches[*from][*via] && reaches[*via][*to];
                }
            }
        }
        // All that come before it are in its cycle.
        let is_next = |unit: &usize| left.iter().all(|other| !reaches[*other][*unit] || reaches[*unit][*other]);
        let next = left.iter().position(is_next).unwrap_or(0);
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

/// Outputs of a plant that the driver of paths reads.
const OF_VEHICLE: [&str; 5] =
    ["vehicle.position_x", "vehicle.position_y", "vehicle.yaw", "vehicle.speed", "body.roll_rate"];

/// Returns true if a signal of the plant is recorded.
fn is_recorded(signal: &str) -> bool {
    RECORDED.iter().any(|wanted| *wanted == signal || (wanted.ends_with('.') && signal.starts_with(wanted)))
}

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
            return Some((&unit.name, unit.variable(signal).to_owned()));
        }
        let of_road = signal.starts_with("road_height.") || signal.starts_with("road_friction.");
        (self.road == Road::Rough && of_road).then(|| ("road", signal.to_owned()))
    }

    /// Finds the source of an input: another component, or a constant.
    ///
    /// # Errors
    /// The constant does not fit the unit of the input.
    fn source(
        &mut self,
        unit: &Unit,
        component: &str,
        variable: &Variable,
        signal: &str,
    ) -> Result<Source, SetupError> {
        let is_plant = component == "plant";
        if let Some((writer, name)) = self.writer(signal).filter(|(writer, _)| *writer != component) {
            return Ok(Source::Signal(writer.to_owned(), name));
        }
        if !is_plant && self.plant.has_output(signal) {
            return Ok(Source::Signal("plant".to_owned(), self.plant.variable(signal).to_owned()));
        }
        let begins = |starts: &[&str]| starts.iter().any(|start| signal.starts_with(start));
        let fallback = if signal == "steer.front" {
            self.unwritten.push((signal.to_owned(), "driver.steer".to_owned()));
            return Ok(Source::Signal("driver".to_owned(), "driver.steer".to_owned()));
        } else if begins(&["brake_pressure_command."]) {
            match self.units.iter().find(|unit| unit.has(Causality::Output, "brake.master_pressure")) {
                Some(unit) => {
                    self.unwritten.push((signal.to_owned(), "brake.master_pressure".to_owned()));
                    let variable = unit.variable("brake.master_pressure").to_owned();
                    return Ok(Source::Signal(unit.name.clone(), variable));
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
            (Some(number), _, _) => format!("{:?}", unit.of_si(signal, variable, number).map_err(SetupError::new)?),
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
        Ok(Source::Constant(value))
    }

    /// The scenario.
    fn scenario(&mut self, set: &[(String, String, String)]) -> Result<String, SetupError> {
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
            for signal in OF_VEHICLE {
                if self.plant.has_output(signal) {
                    connect(&mut connections, "plant", self.plant.variable(signal), "driver", signal);
                } else {
                    missing.push((signal.to_owned(), "0.0".to_owned()));
                    self.unwritten.push((format!("driver:{signal}"), "0.0".to_owned()));
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
                let signal = unit.signal(&variable.name).to_owned();
                match self.source(unit, name, variable, &signal)? {
                    Source::Signal(from, output) => connect(&mut connections, &from, &output, name, &variable.name),
                    Source::Constant(value) => constants.push((variable.name.clone(), value)),
                }
            }
            component(&mut text, name, &unit.fmu, &constants);
        }
        let signals: Vec<_> = self.recorded().iter().map(|signal| quoted(signal)).collect();
        let _ = writeln!(text, "{connections}[[case]]\nname = \"assessed\"\ntitle = \"Assessed\"");
        let _ = writeln!(text, "[record]\nsignals = [{}]", signals.join(", "));
        Ok(text)
    }

    /// Recorded signals, as a scenario names them.
    fn recorded(&self) -> Vec<String> {
        let path: &[&str] = if self.driving == Driving::OpenLoop { &[] } else { &OF_PATH };
        let mut signals: Vec<String> = OF_DRIVER.iter().chain(path).map(|signal| format!("driver:{signal}")).collect();
        for signal in self.plant.outputs() {
            if is_recorded(&signal) {
                signals.push(format!("plant:{}", self.plant.variable(&signal)));
            }
        }
        signals
    }
}

/// Source of an input.
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

/// A value of the command line as TOML: a number, also with a unit after it, or a Boolean as it is, anything else as text.
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
    drivers: &[Unit],
    set: &[(String, String, String)],
    source: &dyn Descriptions,
    drivings: &[(Driving, Road)],
) -> Result<System, SetupError> {
    let mut written: BTreeMap<&str, &str> = BTreeMap::new();
    for unit in drivers.iter().rev().chain([&plant.unit]) {
        written.extend(unit.signals(Causality::Output).map(|output| (output, unit.fmu.as_str())));
    }
    for unit in units {
        for output in unit.signals(Causality::Output) {
            if let Some(other) = written.insert(output, &unit.fmu) {
                return Err(SetupError::with_help(
                    format!("{other} and {} both write `{output}`", unit.fmu),
                    "Leave one of them out.",
                ));
            }
        }
    }
    let reads = |signal: &str| plant.has_input(signal) || units.iter().any(|unit| unit.has(Causality::Input, signal));
    let acts = |unit: &&Unit| unit.signals(Causality::Output).any(reads);
    let idle = units.iter().filter(|unit| !acts(unit)).map(|unit| unit.fmu.clone()).collect();
    let has_pedals = units.iter().any(|unit| {
        unit.signals(Causality::Output).any(|o| o.starts_with("drive_torque.") || o.starts_with("brake_torque."))
    });
    let speed = if plant.has_input("driver.speed") {
        Speed::Prescribed
    } else if has_pedals {
        Speed::Pedals
    } else {
        Speed::Own
    };
    let mut plans = Vec::new();
    let mut columns = Vec::new();
    let mut unwritten: Vec<(String, String)> = Vec::new();
    for &(driving, road) in drivings {
        let driver = DRIVERS[usize::from(driving != Driving::OpenLoop)];
        // Each driver has parameters that the other one does not have, and no run has all components.
        let description = drivers.iter().find(|unit| unit.fmu == driver).map(Unit::description);
        let is_of_system = |(component, name, _): &&(String, String, String)| match component.as_str() {
            "driver" => description.is_none_or(|description| description.variable(name).is_some()),
            _ => true,
        };
        let set: Vec<_> = set.iter().filter(is_of_system).cloned().collect();
        let mut wiring = Wiring { plant, units: ordered(units), driving, road, driver, unwritten: Vec::new() };
        let text = wiring.scenario(&set)?;
        let options = Options::default();
        let plan = resolve_text(Path::new("assessment.toml"), &text, source, &options)
            .map_err(|error| SetupError::new(explained(&error)))?;
        columns.push((driving, plan.columns.iter().map(|column| signal_of(&column.name, plant)).collect()));
        plans.push((driving, plan));
        for entry in wiring.unwritten {
            if !unwritten.iter().any(|(signal, _)| *signal == entry.0) {
                unwritten.push(entry);
            }
        }
    }
    Ok(System { name, speed, plans, unwritten, idle, columns })
}

/// The bench's name of a column. The column has the name of its component in front if a component before it has the signal, too.
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
        // Places in a generated text would not help.
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

    /// By hand. `"ab"`: a writes what b reads.
    #[test]
    fn writers_come_before_readers_and_cycles_are_cut_where_they_are_named_first() {
        let of = |count: usize, edges: &[&str]| {
            let mut graph = vec![vec![false; count]; count];
            for edge in edges {
                let ends: Vec<usize> = edge.bytes().map(|letter| usize::from(letter - b'a')).collect();
                graph[ends[0]][ends[1]] = true;
            }
            order(&graph).into_iter().map(|index| char::from(b'a' + index as u8)).collect::<String>()
        };
        assert_eq!(of(3, &[]), "abc");
        assert_eq!(of(3, &["ca", "cb"]), "cab");
        assert_eq!(of(4, &["dc", "cb", "ba"]), "dcba");
        // A cycle of b and c: b was named first.
        assert_eq!(of(3, &["bc", "cb"]), "abc");
        // a waits for the cycle of b and c; it is not a place to cut it.
        assert_eq!(of(3, &["ba", "bc", "cb"]), "bac");
        assert_eq!(of(3, &["ca", "bc", "cb"]), "bca");
        // The cycle of a and b waits for that of c and d.
        assert_eq!(of(4, &["ab", "ba", "cd", "dc", "da"]), "cdab");
        // All in one cycle a, b, c: after the cut the others keep their direction.
        assert_eq!(of(3, &["ac", "cb", "ba"]), "acb");
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
