//! Steady states of FMUs with continuous states, by Newton's method on the exact Jacobian.
//!
//! A steady state is a point at which the derivatives of all states vanish, except for states that only integrate other
//! states: nothing depends on the position and the heading of a vehicle, so they drift. Equations are scaled by the
//! nominal values of the states. `plant` evaluates the FMU in Initialization Mode, so that the FMU can be started in a
//! steady state; `newton` solves the equations.

mod newton;
mod plant;

use crate::linearize::{find, interface, parse};
use fmu_import::archive::read_description;
use fmu_import::description::{BaseType, Causality, ModelDescription, Value, Variable};
use fmu_import::fmu::Fmu;
use fmu_import::loader::Instance;
use plant::{Plant, Start};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Largest derivative at a steady state, relative to the nominal value, 1/s.
pub const TOLERANCE: f64 = 1e-10;

/// The speed state that is held in a plant with pedals, and its name in a plant with prescribed speed.
const SPEED: [&str; 2] = ["vehicle.speed", "driver.speed"];
/// Prefix of the inputs that hold the speed of a plant with pedals.
const DRIVE: &str = "drive_torque.";

/// A steady state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SteadyState {
    /// All states, in the order of the description.
    pub states: Vec<TrimmedState>,
    /// The inputs that were free, with their values in the units of the variables.
    pub inputs: Vec<(String, f64)>,
    /// The values with which the FMU starts in this state, in the units of the variables: given parameters and inputs,
    /// states, and free inputs. A drifting state is included only if it was given.
    pub starts: Vec<(String, Value)>,
    /// Largest derivative of a state at rest, relative to its nominal value, 1/s.
    pub residual: f64,
    /// States that the equations do not determine. They keep their start values; the steady state is one of many.
    pub undetermined: Vec<String>,
    /// Jacobian of the derivatives of the states that do not drift with respect to these states, column by column.
    pub jacobian: Vec<f64>,
    /// Number of solver steps.
    pub iterations: usize,
}

impl SteadyState {
    /// The start values as text, in the form that [`linearize`](crate::linearize::linearize()) accepts.
    pub fn settings(&self) -> Vec<(String, String)> {
        self.starts.iter().map(|(name, value)| (name.clone(), value.text())).collect()
    }
}

/// A state at a steady state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrimmedState {
    /// Name.
    pub name: String,
    /// Value, in the unit of the variable.
    pub value: f64,
    /// Role.
    pub role: StateRole,
}

/// Role of a state at a steady state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StateRole {
    /// It rests at a value that was found.
    Rests,
    /// It rests at a value that was given.
    Held,
    /// It integrates other states, and no other state depends on it.
    Drifts,
}

/// Values that are given and values that are sought. Variables are identified by their indices.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Parameters and inputs that differ from their start values.
    pub given: Vec<(usize, Value)>,
    /// States that keep a value. `None` means that they keep their start value.
    pub held: Vec<(usize, Option<f64>)>,
    /// Inputs that are sought. The inputs of a group share one value.
    pub free: Vec<Vec<usize>>,
    /// Time, s.
    pub time: f64,
}

impl Request {
    /// Creates the request for names and values. `free` are groups of inputs that are sought.
    ///
    /// A state that is given is held. The state `vehicle.speed` of a plant is always held. If `free` is empty and none
    /// of the inputs `drive_torque.*` of such a plant is given, these inputs are sought. For such a plant,
    /// `driver.speed` is another name of `vehicle.speed`.
    pub fn new(
        description: &ModelDescription,
        settings: &[(String, String)],
        free: &[Vec<String>],
    ) -> Result<Self, String> {
        let mut request = Self::default();
        let states: Vec<usize> = states(description).collect();
        let speed = description.index(SPEED[0]).filter(|speed| states.contains(speed));
        for (name, text) in settings {
            let known = description.index(name).is_some() || name != SPEED[1];
            let meant = if known { name } else { speed.map_or(name.as_str(), |_| SPEED[0]) };
            let in_setting = |message: String| {
                let means = if meant == name { String::new() } else { format!(" (`{name}` is `{meant}` here)") };
                format!("--set {name}={text}: {message}{means}")
            };
            let name = meant;
            let (index, variable) = find(description, name).map_err(in_setting)?;
            let index = variable.alias_of.unwrap_or(index);
            let variable = &description.variables[index];
            let value = parse(variable, text).map_err(in_setting)?;
            let is_there = request.held.iter().any(|(held, _)| *held == index);
            if is_there || request.given.iter().any(|(given, _)| *given == index) {
                return Err(in_setting(format!("`{}` is set twice", variable.name)));
            }
            match (states.contains(&index), variable.causality, value) {
                (_, Causality::Parameter | Causality::Input, value) => request.given.push((index, value)),
                (true, _, Value::Real(value)) => request.held.push((index, Some(value))),
                _ => {
                    let message = format!("`{name}` must be a parameter, an input or a state");
                    return Err(in_setting(message));
                }
            }
        }
        let group = |names: &[String]| -> Result<Vec<usize>, String> {
            let index = |name: &String| {
                let at = |message: String| format!("--free {name}: {message}");
                let (index, variable) = find(description, name).map_err(at)?;
                if variable.causality != Causality::Input || variable.base_type != BaseType::Real {
                    return Err(format!("--free {name}: `{name}` must be an input of the type Real"));
                }
                if request.given.iter().any(|(given, _)| *given == index) {
                    return Err(format!("--free {name}: `{name}` has a value by --set; leave out one of the two"));
                }
                Ok(index)
            };
            names.iter().map(index).collect()
        };
        request.free = free.iter().map(|names| group(names)).collect::<Result<_, _>>()?;
        if let Some(speed) = speed {
            let drive: Vec<usize> = indices(description, |v| v.name.starts_with(DRIVE)).collect();
            let is_given = drive.iter().any(|index| request.given.iter().any(|(given, _)| given == index));
            if free.is_empty() && !drive.is_empty() && !is_given {
                request.free.push(drive);
            }
            if request.held.iter().all(|(held, _)| *held != speed) {
                request.held.push((speed, None));
            }
        }
        Ok(request)
    }

    /// Creates the request for a scenario: all inputs are given, and the state `vehicle.speed` is held if the plant has
    /// it.
    pub fn of_inputs(description: &ModelDescription, given: Vec<(usize, Value)>, time: f64) -> Self {
        let speed = description.index(SPEED[0]).filter(|speed| states(description).any(|state| state == *speed));
        Self { given, held: speed.map(|speed| (speed, None)).into_iter().collect(), free: Vec::new(), time }
    }
}

fn indices(description: &ModelDescription, is_wanted: impl Fn(&Variable) -> bool) -> impl Iterator<Item = usize> {
    let is_wanted =
        move |v: &Variable| v.causality == Causality::Input && v.base_type == BaseType::Real && is_wanted(v);
    description.variables.iter().enumerate().filter(move |(_, v)| is_wanted(v)).map(|(index, _)| index)
}

fn states(description: &ModelDescription) -> impl Iterator<Item = usize> {
    description.derivatives.iter().filter_map(|unknown| description.variables[unknown.variable].derivative_of)
}

/// Checks in the description whether a steady state can be found.
///
/// # Errors
/// The description lists no states or no directional derivatives, or has arrays of states.
pub fn check(description: &ModelDescription) -> Result<(), String> {
    let model = &description.model_name;
    let (_, has_derivatives) = interface(description);
    if !has_derivatives || description.derivatives.is_empty() {
        return Err(format!(
            "{model} has no steady state: it lists no continuous states with directional derivatives, which a plant does"
        ));
    }
    for unknown in &description.derivatives {
        let derivative = &description.variables[unknown.variable];
        if derivative.derivative_of.is_none() {
            return Err(format!("`{}` is listed as a derivative but has no attribute `derivative`", derivative.name));
        }
        if derivative.is_array() {
            return Err(format!("`{}` is an array; only FMUs with scalar states can be trimmed", derivative.name));
        }
    }
    Ok(())
}

/// Finds the steady state of an FMU. The binary is loaded into this process.
///
/// # Errors
/// The FMU cannot be used or has no states with directional derivatives, a value cannot be set, or a state cannot rest.
pub fn trim(path: &Path, settings: &[(String, String)], free: &[Vec<String>]) -> Result<SteadyState, String> {
    let description = read_description(path).map_err(|error| error.to_string())?;
    let fmu = Fmu::open_for(path, interface(&description).0).map_err(|error| error.to_string())?;
    check(&description)?;
    let request = Request::new(&description, settings, free)?;
    let steady = steady(&description, &request, &mut || fmu.instantiate("trim").map_err(|error| error.to_string()))?;
    for (index, given) in &request.given {
        let name = &description.variables[*index].name;
        if let Some((_, found)) = steady.starts.iter().find(|(start, value)| start == name && value != given) {
            return Err(format!(
                "--set {name}: the steady state determines this parameter ({found}); leave the option out, or set the state \
                 that starts from it"
            ));
        }
    }
    Ok(steady)
}

/// Finds the steady state of an FMU, with instances from `instantiate`, one at a time.
pub fn steady(
    description: &ModelDescription,
    request: &Request,
    instantiate: &mut dyn FnMut() -> Result<Instance, String>,
) -> Result<SteadyState, String> {
    check(description)?;
    let mut plant = Plant::new(description, request, instantiate)?;
    let solution = newton::solve(&mut plant);
    let states = plant.states();
    let unit = |index: usize, per_second: bool| {
        let unit = description.variables[index].unit.as_deref().filter(|unit| *unit != "1");
        match (unit, per_second) {
            (Some(unit), true) => format!(" ({unit})/s"),
            (None, true) => " 1/s".to_owned(),
            (unit, false) => unit.map_or(String::new(), |unit| format!(" {unit}")),
        }
    };
    let solution = solution?;
    if let Some((state, rate, residual)) = solution.restless {
        let state = &states[state];
        let name = &description.variables[state.variable].name;
        let of = if state.held.is_some() && request.free.is_empty() {
            " It is held, and no input is free to keep it (--free)."
        } else {
            ""
        };
        return Err(format!(
            "{}: `{name}` cannot rest: where the derivatives are smallest, its own is {rate:.3e}{}, {residual:.1e} of its nominal \
             value per second (a steady state needs {TOLERANCE:e}).{of}",
            description.model_name,
            unit(state.variable, true),
        ));
    }
    if let Some((state, value)) = solution.outside {
        let state = &states[state];
        let [low, high] = state.range;
        return Err(format!(
            "{}: `{}` can only rest at {value:.3}{}, outside the valid range of the model ({low:.4} to {high:.4}): there is \
             no steady state near the start values. Choose another operating point, such as a lower speed or a smaller steering angle (--set).",
            description.model_name,
            description.variables[state.variable].name,
            unit(state.variable, false),
        ));
    }
    let name = |index: usize| description.variables[index].name.clone();
    let (x, inputs, parameters) = plant.point();
    let mut starts: BTreeMap<usize, Value> = request.given.iter().cloned().collect();
    starts.extend(parameters);
    for (state, value) in states.iter().zip(&x) {
        if matches!(state.start, Start::Exact) && (!state.drifts || state.held.is_some()) {
            starts.insert(state.variable, Value::Real(*value));
        }
    }
    for (group, value) in request.free.iter().zip(&inputs) {
        starts.extend(group.iter().map(|index| (*index, Value::Real(*value))));
    }
    let role = |state: &plant::State| match (state.drifts, state.held) {
        (true, _) => StateRole::Drifts,
        (false, Some(_)) => StateRole::Held,
        (false, None) => StateRole::Rests,
    };
    Ok(SteadyState {
        states: states
            .iter()
            .zip(&x)
            .map(|(state, value)| TrimmedState { name: name(state.variable), value: *value, role: role(state) })
            .collect(),
        inputs: request
            .free
            .iter()
            .zip(&inputs)
            .flat_map(|(group, value)| group.iter().map(|index| (name(*index), *value)))
            .collect(),
        starts: starts.into_iter().map(|(index, value)| (name(index), value)).collect(),
        residual: solution.residual,
        undetermined: solution.undetermined.iter().map(|state| name(states[*state].variable)).collect(),
        jacobian: solution.jacobian,
        iterations: solution.iterations,
    })
}
