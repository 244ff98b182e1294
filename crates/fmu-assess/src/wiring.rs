//! Writes a system as a scenario.
//!
//! All signals are connected by name. Because a system is a scenario, the rules and messages of scenarios apply, and
//! `chassis run` can repeat each run.

use crate::components::{Component, SetupError};
use crate::plant::{OF_VEHICLE, Plant, is_recorded};
use fmu_import::description::{BaseType, Causality, Value, Variable};
use std::fmt::Write as _;

/// Communication step of all runs, s.
pub(crate) const STEP: f64 = 1e-3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Driving {
    /// Steering as a function of time.
    OpenLoop,
    /// A driver that follows a path.
    Path,
    /// A driver that follows a path on a rough road.
    Ride,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Road {
    Flat,
    /// The component `Road`, whose parameters define the roughness.
    Rough,
}

/// Signals of all drivers, and signals only of `PathDriver`.
pub(crate) const OF_DRIVER: [&str; 4] = ["driver.steer", "driver.speed", "driver.throttle", "driver.brake"];
pub(crate) const OF_PATH: [&str; 5] =
    ["path.lateral_deviation", "path.heading_error", "path.distance", "path.finished", "path.lost"];

/// The components of a system, and how it is driven.
pub(crate) struct Wiring<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) components: Vec<&'a Component>,
    pub(crate) driving: Driving,
    pub(crate) road: Road,
    pub(crate) driver: &'static str,
    pub(crate) unwritten: Vec<(String, String)>,
}

impl Wiring<'_> {
    /// The component, other than the plant, that writes a signal.
    fn writer(&self, signal: &str) -> Option<(&str, String)> {
        if OF_DRIVER.contains(&signal) || (self.driving != Driving::OpenLoop && OF_PATH.contains(&signal)) {
            return Some(("driver", signal.to_owned()));
        }
        let component = self.components.iter().find(|component| component.has(Causality::Output, signal));
        if let Some(component) = component {
            return Some((&component.name, component.variable(signal).to_owned()));
        }
        let of_road = signal.starts_with("road_height.") || signal.starts_with("road_friction.");
        (self.road == Road::Rough && of_road).then(|| ("road", signal.to_owned()))
    }

    /// Finds the source of an input: another component, or a constant in the unit of the input.
    fn source(
        &mut self,
        component: &Component,
        of: &str,
        variable: &Variable,
        signal: &str,
    ) -> Result<Source, SetupError> {
        let is_plant = of == "plant";
        if let Some((writer, name)) = self.writer(signal).filter(|(writer, _)| *writer != of) {
            return Ok(Source::Signal(writer.to_owned(), name));
        }
        if !is_plant && self.plant.has_output(signal) {
            return Ok(Source::Signal("plant".to_owned(), self.plant.variable(signal).to_owned()));
        }
        let starts_with = |start: &&str| signal.starts_with(start);
        let begins = |starts: &[&str]| starts.iter().any(starts_with);
        if signal == "steer.front" {
            self.unwritten.push((signal.to_owned(), "driver.steer".to_owned()));
            return Ok(Source::Signal("driver".to_owned(), "driver.steer".to_owned()));
        }
        let master = "brake.master_pressure";
        if begins(&["brake_pressure_command."])
            && let Some(component) = self.components.iter().find(|component| component.has(Causality::Output, master))
        {
            self.unwritten.push((signal.to_owned(), master.to_owned()));
            return Ok(Source::Signal(component.name.clone(), component.variable(master).to_owned()));
        }
        let zero = ["steer.middle", "steer.rear", "suspension_force.", "road_height.", "yaw_control_pressure."];
        let fallback = match () {
            () if begins(&zero) => Some(0.0),
            () if begins(&["road_friction.", "enable."]) => Some(1.0),
            () if begins(&["target_slip."]) => Some(0.2),
            () => None,
        };
        let value = match (fallback, variable.base_type, &variable.start) {
            (Some(number), BaseType::Boolean, _) => (number > 0.5).to_string(),
            (Some(number), BaseType::Integer, _) => (number as i64).to_string(),
            (Some(number), _, _) => {
                format!("{:?}", component.of_si(signal, variable, number).map_err(SetupError::new)?)
            }
            (None, _, Some(start @ (Value::Real(_) | Value::Integer(_) | Value::Boolean(_)))) => start.to_string(),
            (None, _, Some(start @ Value::Unsigned(_))) => format!("{:?}", start.text()),
            (None, _, _) => "0.0".to_owned(),
        };
        let text = if fallback.is_none() { format!("{value} (start value)") } else { value.clone() };
        let entry = (signal.to_owned(), text);
        if !self.unwritten.contains(&entry) {
            self.unwritten.push(entry);
        }
        Ok(Source::Constant(value))
    }

    pub(crate) fn scenario(&mut self, set: &[(String, String, String)]) -> Result<String, SetupError> {
        let mut text = String::from("title = \"Assessment\"\n[simulation]\nstop = 1.0\n");
        let _ = writeln!(text, "step = {STEP:?}");
        let mut connections = String::new();
        let add = |text: &mut String, name: &str, fmu: &str, constants: &[(String, String)]| {
            let _ = writeln!(text, "[[component]]\nname = {}\nfmu = {}", quoted(name), quoted(fmu));
            let of_component = set.iter().filter(|(of, _, _)| of == name);
            let parameters = of_component.map(|(_, name, value)| format!("{} = {}", quoted(name), literal(value)));
            let inputs = constants.iter().map(|(name, value)| format!("{} = {value}", quoted(name)));
            for (key, values) in [("parameters", parameters.collect::<Vec<_>>()), ("inputs", inputs.collect())] {
                if !values.is_empty() {
                    let _ = writeln!(text, "{key} = {{ {} }}", values.join(", "));
                }
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
        add(&mut text, "driver", self.driver, &missing);
        if self.road == Road::Rough {
            add(&mut text, "road", "Road", &[]);
            connect(&mut connections, "plant", self.plant.variable("vehicle.speed"), "road", "vehicle.speed");
        }
        let all: Vec<&Component> = self.components.iter().copied().chain([&self.plant.component]).collect();
        for component in all {
            let is_plant = std::ptr::eq(component, &raw const self.plant.component);
            let name = if is_plant { "plant" } else { component.name.as_str() };
            let mut constants = Vec::new();
            for variable in component.description().of(Causality::Input) {
                let signal = component.signal(&variable.name).to_owned();
                match self.source(component, name, variable, &signal)? {
                    Source::Signal(from, output) => connect(&mut connections, &from, &output, name, &variable.name),
                    Source::Constant(value) => constants.push((variable.name.clone(), value)),
                }
            }
            add(&mut text, name, &component.fmu, &constants);
        }
        let signals: Vec<_> = self.recorded().iter().map(|signal| quoted(signal)).collect();
        let _ = writeln!(text, "{connections}[[case]]\nname = \"assessed\"\ntitle = \"Assessed\"");
        let _ = writeln!(text, "[record]\nsignals = [{}]", signals.join(", "));
        Ok(text)
    }

    /// Recorded signals, named as in a scenario.
    fn recorded(&self) -> Vec<String> {
        let path: &[&str] = if self.driving == Driving::OpenLoop { &[] } else { &OF_PATH };
        let mut signals: Vec<String> = OF_DRIVER.iter().chain(path).map(|signal| format!("driver:{signal}")).collect();
        let outputs = self.plant.signals(Causality::Output).filter(|signal| is_recorded(signal));
        signals.extend(outputs.map(|signal| format!("plant:{}", self.plant.variable(signal))));
        signals
    }
}

enum Source {
    /// Component and output.
    Signal(String, String),
    /// A constant, as TOML.
    Constant(String),
}

fn connect(connections: &mut String, from: &str, output: &str, to: &str, input: &str) {
    let (from, to) = (quoted(&format!("{from}:{output}")), quoted(&format!("{to}:{input}")));
    let _ = writeln!(connections, "[[connection]]\nfrom = {from}\nto = {to}");
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A value from the command line as TOML: a number with or without unit, or a Boolean; otherwise, a string.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_the_command_line_become_toml() {
        for (given, written) in
            [("1", "1"), ("1.5", "1.5"), ("1e3", "1000.0"), ("true", "true"), ("individual", "\"individual\"")]
        {
            assert_eq!(literal(given), written);
        }
    }
}
