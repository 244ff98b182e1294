//! A system on the bench: turns the specifications of maneuvers into runs.

use crate::plant::Plant;
use crate::run_result::{RunResult, cut};
use crate::run_spec::{RunSpec, Setting};
use crate::systems::{Speed, System};
use crate::vehicle::{Class, Vehicle};
use crate::wiring::{Driving, STEP};
use fmu_import::description::{BaseType, ModelDescription, Value};
use fmu_system::failure::Failure;
use fmu_system::master::Recording;
use fmu_system::run::{Run, Simulation};
use std::collections::BTreeMap;

/// Executes runs and returns their outcomes in the same order.
pub(crate) type Execute<'a> = dyn Fn(Vec<(Simulation, Run)>) -> Vec<Result<Recording, Failure>> + Sync + 'a;

/// Descriptions of FMUs, by their paths in a plan.
pub(crate) type Described<'a> = BTreeMap<&'a str, &'a ModelDescription>;

/// A system on the bench, and the data that all its maneuvers need.
pub(crate) struct Bench<'a> {
    pub(crate) execute: &'a Execute<'a>,
    pub(crate) descriptions: &'a Described<'a>,
    pub(crate) plant: &'a Plant,
    pub(crate) system: &'a System,
    pub(crate) vehicle: &'a Vehicle,
    /// Understeer gradient for the driver model, rad/(m/s2).
    pub(crate) understeer_gradient: f64,
    /// Amplitude A: steering wheel angle at 0.3 g in the slowly increasing steer, deg; `None` until it is known.
    pub(crate) amplitude: Option<f64>,
    /// True if the paths of the driver are mirrored.
    pub(crate) is_mirrored: bool,
    /// Speed for handling maneuvers instead of the usual speed, m/s.
    pub(crate) other_speed: Option<f64>,
    /// Ends the sine-with-dwell series after the first unstable runs.
    pub(crate) is_quick: bool,
    /// Folder for tables that drivers read.
    pub(crate) folder: &'a std::path::Path,
}

impl Bench<'_> {
    /// Ratio of steering wheel angle to front wheel angle.
    pub(crate) fn ratio(&self) -> f64 {
        self.vehicle.steer_ratio.value
    }

    pub(crate) fn is_car(&self) -> bool {
        self.vehicle.class == Class::Car
    }

    /// Returns true if the driver controls the speed with pedals.
    pub(crate) fn has_pedals(&self) -> bool {
        self.system.speed == Speed::Pedals
    }

    /// Returns the reason that limits for coasting cars do not apply, or `None` if they apply.
    pub(crate) fn not_applicable(&self) -> Option<&'static str> {
        match self.system.speed {
            _ if !self.is_car() => Some("the limit applies to cars only"),
            Speed::Prescribed => Some("the speed is prescribed, so the vehicle cannot coast"),
            Speed::Own if self.plant.found.description.variable("vehicle.initial_speed").is_none() => {
                Some("nothing sets the speed of the vehicle")
            }
            Speed::Pedals | Speed::Own => None,
        }
    }

    /// Speed for maneuvers that do not prescribe one, m/s.
    pub(crate) fn speed(&self) -> f64 {
        self.other_speed.unwrap_or(if self.is_car() { 80.0 } else { 60.0 } / 3.6)
    }

    /// Makes the run for a specification, up to the time `stop`.
    pub(crate) fn run(&self, spec: &RunSpec, stop: f64) -> Result<(Simulation, Run), String> {
        let plan = self.system.plan(spec.driving).ok_or("the plant cannot follow a path: it has no position")?;
        let steps = (stop / STEP).round();
        let simulation = Simulation { stop: steps * STEP, steps: steps as u64, ..plan.simulation };
        let mut run = plan.runs.first().ok_or("the system has no run")?.clone();
        run.id.clone_from(&spec.id);
        let mut set = |component: &str, name: &str, setting: &Setting, is_optional: bool| -> Result<(), String> {
            let signal = name;
            let name = if component == "plant" { self.plant.variable(name) } else { name };
            let found = run.components.iter().find(|other| other.name == component);
            let found = found.and_then(|other| self.descriptions.get(&*other.fmu));
            let Some(variable) = found.and_then(|description| description.variable(name)) else {
                return if is_optional { Ok(()) } else { Err(format!("`{component}` has no variable `{name}`")) };
            };
            let value = match (setting, variable.base_type) {
                (Setting::Text(text), BaseType::Integer) => {
                    let values = variable.named_values();
                    let named = values.iter().find(|(_, item)| item == text);
                    let (value, _) = named.ok_or_else(|| format!("`{name}` of `{component}` has no value `{text}`"))?;
                    Value::Integer(i64::from(*value))
                }
                (Setting::Text(text), _) => Value::String(text.clone()),
                (Setting::Number(number), BaseType::Integer) => Value::Integer(*number as i64),
                (Setting::Number(number), BaseType::Boolean) => Value::Boolean(*number > 0.5),
                (Setting::Number(number), _) if component == "plant" => {
                    Value::Real(self.plant.of_si(signal, variable, *number)?)
                }
                (Setting::Number(number), _) => Value::Real(*number),
            };
            run.set_described(&|of| self.descriptions.get(of.fmu.as_str()).copied(), component, name, value)
                .map_err(|error| error.to_string())
        };
        let number = Setting::Number;
        set("plant", "vehicle.initial_speed", &number(spec.speed), true)?;
        set("driver", "speed.initial", &number(spec.speed), false)?;
        if spec.driving != Driving::OpenLoop {
            // If the wheelbase is unknown, no path is followed and the driver does not need it.
            if let Some(wheelbase) = &self.vehicle.wheelbase {
                set("driver", "geometry.wheelbase", &number(wheelbase.value), false)?;
            }
            set("driver", "vehicle.understeer_gradient", &number(self.understeer_gradient), false)?;
            set("driver", "steer.ratio", &number(self.ratio()), false)?;
            if let Some(width) = &self.vehicle.width {
                set("driver", "path.vehicle_width", &number(width.value), false)?;
            }
        }
        for (component, name, setting) in &spec.values {
            set(component, name, setting, false)?;
        }
        if spec.driving != Driving::OpenLoop && spec.values.iter().all(|(_, name, _)| name != "speed.final") {
            self.start_at_speed(&mut run, spec.speed);
        }
        Ok((simulation, run))
    }

    /// Replaces the plant's connection to a constant prescribed speed with a constant value. With the connection, the
    /// plant would be initialized at standstill, because `PathDriver` writes the speed only from its first sample on.
    fn start_at_speed(&self, run: &mut Run, speed: f64) {
        let name = self.plant.variable("driver.speed");
        let Some(variable) = self.plant.found.description.variable(name) else { return };
        let Some(plant) = run.components.iter_mut().find(|component| component.name == "plant") else { return };
        let is_read = |input: &fmu_system::run::Wire| {
            (input.reference, input.base_type) == (variable.reference, variable.base_type)
        };
        if let Some(at) = plant.inputs.iter().position(is_read).filter(|_| variable.base_type == BaseType::Real) {
            let fmu_system::run::Wire { name, base_type, reference, .. } = plant.inputs.remove(at);
            plant.constants.push(fmu_system::run::Setting { name, base_type, reference, value: Value::Real(speed) });
        }
    }

    pub(crate) fn wheelbase(&self) -> Result<f64, String> {
        let found = self.vehicle.wheelbase.as_ref().map(|datum| datum.value);
        found.ok_or_else(|| "the wheelbase is unknown; set it in the vehicle data (`--vehicle`)".to_owned())
    }
}

/// Executes runs of a system. A failed run keeps the rows before the failure.
pub(crate) fn drive(bench: &Bench<'_>, specs: Vec<RunSpec>) -> Vec<RunResult> {
    let requests = specs.iter().map(|spec| bench.run(spec, spec.stop)).collect::<Vec<_>>();
    let wanted = requests.iter().flatten().cloned().collect();
    let mut outcomes = (bench.execute)(wanted).into_iter();
    specs
        .into_iter()
        .zip(requests)
        .map(|(spec, request)| match request {
            Err(message) => RunResult::failed(spec, message),
            Ok(_) => match outcomes.next() {
                Some(Ok(recording)) => result(bench, spec, &recording, None),
                Some(Err(failure)) => match &failure.recorded {
                    // Keeps the rows before the failure, if there are any after the start.
                    Some(recording) if recording.time.len() > 1 => {
                        result(bench, spec, recording, Some(failure.to_string()))
                    }
                    _ => RunResult::failed(spec, failure.to_string()),
                },
                None => RunResult::failed(spec, "the run returned no result".to_owned()),
            },
        })
        .collect()
}

/// Cuts a recording where the run ends. `failure` describes the failure after the last row, if any.
pub(crate) fn result(bench: &Bench<'_>, spec: RunSpec, recording: &Recording, failure: Option<String>) -> RunResult {
    let names = bench.system.columns(spec.driving);
    cut(spec, names, &bench.plant.converted(names, recording), bench.ratio(), failure)
}
