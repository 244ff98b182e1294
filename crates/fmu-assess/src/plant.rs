//! The plant of a system, whose signals can have other names and units than the bench's.

use crate::components::{Component, SetupError, TIME};
use crate::signals::{self, conversion};
use fmu_import::description::{BaseType, Causality, Variable};
use fmu_system::master::Recording;
use fmu_system::run::Linear;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Deref;

/// Outputs of a plant that are recorded if it has them. A name that ends with a dot is a prefix.
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

/// Outputs of a plant that `PathDriver` reads.
pub(crate) const OF_VEHICLE: [&str; 5] =
    ["vehicle.position_x", "vehicle.position_y", "vehicle.yaw", "vehicle.speed", "body.roll_rate"];

/// Returns true if the bench records a signal of the plant.
pub(crate) fn is_recorded(signal: &str) -> bool {
    RECORDED.iter().any(|wanted| *wanted == signal || (wanted.ends_with('.') && signal.starts_with(wanted)))
}

/// The plant, whose signals can have other names than the bench's.
#[derive(Debug, Clone)]
pub(crate) struct Plant {
    pub(crate) component: Component,
    /// Parameters that define the size of the plant, in SI units.
    data: BTreeMap<&'static str, f64>,
    /// Real parameters set by the caller.
    set: BTreeMap<String, f64>,
    /// Conversions for outputs that are not in the bench's unit.
    conversions: BTreeMap<String, Linear>,
    /// Signals without a declared unit, and the unit that is assumed for them.
    pub(crate) assumed: BTreeMap<String, &'static str>,
}

impl Plant {
    /// `set` are parameters set by the caller. `units` are units of signals; they take precedence over declared units.
    pub(crate) fn new(
        mut component: Component,
        set: BTreeMap<String, f64>,
        units: &BTreeMap<String, String>,
    ) -> Result<Self, SetupError> {
        // The unit of `time` applies to recordings, not to the plant.
        component.given =
            units.iter().filter(|(signal, _)| *signal != TIME).map(|(a, b)| (a.clone(), b.clone())).collect();
        let (conversions, assumed) = (BTreeMap::new(), BTreeMap::new());
        let mut plant = Self { component, data: BTreeMap::new(), set, conversions, assumed };
        check_plant(&plant)?;
        for signal in plant.given.keys() {
            if !plant.has_input(signal) && !plant.has_output(signal) {
                let message = format!("a unit is given for `{signal}`, but {} has no such signal", plant.fmu);
                return Err(SetupError::new(message));
            }
            if signals::unit(signal).is_none() {
                return Err(SetupError::new(format!(
                    "a unit is given for `{signal}`, but the bench does not use this signal"
                )));
            }
        }
        for variable in &plant.component.description().variables {
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
            let given = plant.given.get(&signal).cloned();
            let given = given.as_deref();
            if given.is_none() && variable.unit.is_none() && needed != "1" {
                plant.assumed.insert(signal.clone(), needed);
            }
            let found = conversion(needed, plant.description(), variable, given);
            let found = found.map_err(|unit| wrong_unit(&plant.component, variable, &signal, &unit, needed))?;
            if let Some(conversion) = found {
                if variable.causality == Causality::Input && !of_bench(&signal) || OF_VEHICLE.contains(&signal.as_str())
                {
                    let unit = given.or(variable.unit.as_deref()).unwrap_or_default();
                    let reader = "the other end of its connection is in";
                    return Err(wired_unit(&plant.component, &variable.name, unit, needed, reader));
                }
                plant.conversions.insert(signal, conversion);
            }
        }
        for (name, needed) in signals::DATA {
            let (Some(variable), Some(value)) =
                (plant.description().variable(name), real_parameter(&plant.component, &plant.set, name))
            else {
                continue;
            };
            let found = conversion(needed, plant.description(), variable, None);
            let found = found.map_err(|unit| wrong_unit(&plant.component, variable, name, &unit, needed))?;
            plant.data.insert(name, found.map_or(value, |conversion| conversion.of(value)));
        }
        Ok(plant)
    }

    pub(crate) fn has_input(&self, signal: &str) -> bool {
        self.component.has(Causality::Input, signal)
    }

    pub(crate) fn has_output(&self, signal: &str) -> bool {
        self.component.has(Causality::Output, signal)
    }

    /// Returns true if the name of an input begins with `start`.
    pub(crate) fn has_inputs(&self, start: &str) -> bool {
        self.component.signals(Causality::Input).any(|signal| signal.starts_with(start))
    }

    /// Rejects a controller that reads a signal in a unit other than the bench's, because connections do not convert.
    pub(crate) fn check_reader(&self, reader: &Component, all: &[&Component]) -> Result<(), SetupError> {
        let is_raw = |signal: &&str| {
            self.conversions.contains_key(*signal)
                && self.has_output(signal)
                && !all.iter().any(|component| component.has(Causality::Output, signal))
        };
        let Some(signal) = reader.signals(Causality::Input).find(is_raw) else { return Ok(()) };
        let name = self.variable(signal);
        let variable = self.component.description().variable(name);
        let declared = variable.and_then(|variable| variable.unit.as_deref());
        let unit = self.component.given.get(signal).map(String::as_str).or(declared).unwrap_or_default();
        let needed = signals::unit(signal).unwrap_or_default();
        Err(wired_unit(&self.component, name, unit, needed, &format!("{} reads it in", reader.fmu)))
    }

    /// Value of a Real parameter; in SI if it defines the size of the plant.
    pub(crate) fn parameter(&self, name: &str) -> Option<f64> {
        self.data.get(name).copied().or_else(|| real_parameter(&self.component, &self.set, name))
    }

    /// Converts a recording to the bench's units.
    pub(crate) fn converted<'a>(&self, signals: &[String], recording: &'a Recording) -> Cow<'a, Recording> {
        let mut recording = Cow::Borrowed(recording);
        for (index, signal) in signals.iter().enumerate() {
            if let Some(conversion) = self.conversions.get(signal)
                && recording.column(index).is_some()
                && let Some(Some(column)) = recording.to_mut().columns.get_mut(index)
            {
                column.iter_mut().for_each(|value| *value = conversion.of(*value));
            }
        }
        recording
    }
}

impl Deref for Plant {
    type Target = Component;

    fn deref(&self) -> &Component {
        &self.component
    }
}

/// Value of a Real parameter in its declared unit: set by the caller, or its start value.
fn real_parameter(component: &Component, set: &BTreeMap<String, f64>, name: &str) -> Option<f64> {
    set.get(name).copied().or_else(|| component.description().variable(name)?.start.as_ref()?.real())
}

/// Returns true for an input that the bench sets to a constant.
fn of_bench(signal: &str) -> bool {
    ["road_friction.", "target_slip."].iter().any(|start| signal.starts_with(start))
}

fn wrong_unit(component: &Component, variable: &Variable, signal: &str, found: &str, needed: &str) -> SetupError {
    let name = &variable.name;
    let declare = format!("Declare the unit of `{name}` with its base units in the FMU");
    let help = match variable.causality {
        Causality::Input | Causality::Output => format!(
            "{declare}, or set it in a file for `--vehicle`: [signals] \"{signal}\" = {{ variable = \"{name}\", unit = \
             \"{needed}\" }}."
        ),
        _ => format!("{declare}."),
    };
    SetupError::with_help(
        format!(
            "`{name}` of {} is in {found}, but the bench needs {needed}, or a unit that converts to it",
            component.fmu
        ),
        help,
    )
}

/// Error for a signal that a connection would have to convert.
fn wired_unit(component: &Component, name: &str, unit: &str, needed: &str, reader: &str) -> SetupError {
    let fmu = &component.fmu;
    SetupError::with_help(
        format!("`{name}` of {fmu} is in {unit}, but {reader} {needed}"),
        format!("Export {fmu} with `{name}` in {needed}: the bench converts recorded signals, but not connections."),
    )
}

fn check_plant(plant: &Plant) -> Result<(), SetupError> {
    let outputs = ["vehicle.yaw_rate", "vehicle.speed", "vehicle.lateral_acceleration"];
    let input = (!plant.has_input("steer.front")).then(|| "input `steer.front`".to_owned());
    let outputs = outputs.into_iter().filter(|name| !plant.has_output(name)).map(|name| format!("output `{name}`"));
    let missing: Vec<String> = input.into_iter().chain(outputs).collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(SetupError::with_help(
        format!("{} cannot be driven: it has no {}", plant.fmu, missing.join(" and no ")),
        "If they have other names, map them in a file for `--vehicle`: [signals] \"steer.front\" = \"its name\", and so on.",
    ))
}
