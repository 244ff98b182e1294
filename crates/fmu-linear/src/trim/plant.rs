//! An FMU in Initialization Mode at given states and inputs.

use super::{Request, states};
use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, Initial, ModelDescription, Value, Variability, Variable};
use fmu_import::loader::{CallError, Instance};
use std::f64::consts::FRAC_PI_2;

/// If a calculated state starts from a parameter, the name of this parameter contains this word.
const INITIAL: &str = "initial";
/// Maximum number of attempts to give a calculated state its value by changing its parameter.
const ATTEMPTS: usize = 8;
/// Largest error of a calculated state whose value is set by its parameter, relative to the nominal value of the state.
const REACHED: f64 = 1e-9;

#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) variable: usize,
    pub(super) nominal: f64,
    /// Source of its start value.
    pub(super) start: Start,
    pub(super) held: Option<f64>,
    /// True if the state integrates other states, and no state at rest depends on it.
    pub(super) drifts: bool,
    /// Limits of the model's valid range: those in the description, and a quarter turn for an angle.
    pub(super) range: [f64; 2],
}

impl State {
    /// True if a value that was found is in the valid range, except for rounding.
    pub(super) fn has(&self, value: f64) -> bool {
        let slack = REACHED * self.nominal;
        self.drifts || self.held.is_some() || (value >= self.range[0] - slack && value <= self.range[1] + slack)
    }
}

/// Declared minimum and maximum of a variable.
fn bounds(variable: &Variable) -> [f64; 2] {
    [variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY)]
}

/// The valid range of a state. With roll or pitch beyond a quarter turn, a vehicle is on its side.
fn range(description: &ModelDescription, variable: &Variable) -> [f64; 2] {
    let [low, high] = bounds(variable);
    if !matches!(variable.name.rsplit('.').next(), Some("roll" | "pitch")) {
        return [low, high];
    }
    let name = variable.unit.as_deref();
    let factor = match name.and_then(|name| description.unit(name)).and_then(|unit| unit.base) {
        Some(base) if base.exponents == [0, 0, 0, 0, 0, 0, 0, 1] && base.factor > 0.0 => base.factor,
        None if name == Some("rad") => 1.0,
        _ => return [low, high],
    };
    let turn = FRAC_PI_2 / factor;
    [low.max(-turn), high.min(turn)]
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// The state has a start value.
    Exact,
    /// The FMU computes the start value from a parameter with this index, and possibly from others.
    Parameter(usize),
    /// The FMU computes the start value.
    Calculated,
}

pub(super) struct Plant<'a> {
    description: &'a ModelDescription,
    request: &'a Request,
    instantiate: &'a mut dyn FnMut() -> Result<Instance, String>,
    instance: Option<Instance>,
    states: Vec<State>,
    references: Vec<Reference>,
    derivatives: Vec<Reference>,
    /// For each state that starts from a parameter, the value of this parameter.
    parameters: Vec<f64>,
    /// Current states and free inputs of the FMU.
    x: Vec<f64>,
    inputs: Vec<f64>,
}

fn real(value: Option<&Value>) -> f64 {
    match value {
        Some(Value::Real(value)) => *value,
        _ => 0.0,
    }
}

impl<'a> Plant<'a> {
    /// Creates the plant at its start values, changed by the request.
    pub(super) fn new(
        description: &'a ModelDescription,
        request: &'a Request,
        instantiate: &'a mut dyn FnMut() -> Result<Instance, String>,
    ) -> Result<Self, String> {
        let variable = |index: usize| &description.variables[index];
        let state = |index: usize| {
            let nominal = variable(index).nominal.map(f64::abs).filter(|nominal| *nominal > 0.0 && nominal.is_finite());
            let start = if variable(index).initial == Some(Initial::Exact) { Start::Exact } else { Start::Calculated };
            let range = range(description, variable(index));
            State { variable: index, nominal: nominal.unwrap_or(1.0), start, held: None, drifts: false, range }
        };
        let all: Vec<usize> = states(description).collect();
        let start = |index: usize| {
            let given = request.given.iter().rev().find(|(given, _)| *given == index).map(|(_, value)| value);
            real(given.or(variable(index).start.as_ref()))
        };
        let mut plant = Self {
            description,
            request,
            instantiate,
            instance: None,
            references: all.iter().map(|index| variable(*index).reference).collect(),
            derivatives: description.derivatives.iter().map(|unknown| variable(unknown.variable).reference).collect(),
            states: all.iter().map(|index| state(*index)).collect(),
            parameters: vec![0.0; all.len()],
            x: all.iter().map(|index| start(*index)).collect(),
            inputs: request.free.iter().map(|group| group.first().map_or(0.0, |index| start(*index))).collect(),
        };
        plant.initialize()?;
        plant.find_parameters(&start)?;
        let mut x = plant.x.clone();
        let mut is_sought = vec![false; x.len()];
        for (index, value) in &request.held {
            let Some(i) = plant.states.iter().position(|state| state.variable == *index) else { continue };
            x[i] = value.unwrap_or(x[i]);
            plant.states[i].held = Some(x[i]);
            is_sought[i] = true;
        }
        // If the FMU computes other values from the same parameter, they follow: for example, wheels roll at the held
        // speed.
        plant.x.copy_from_slice(&x);
        plant.initialize()?;
        plant.reach(&x, &is_sought)?;
        plant.find_drifting()?;
        Ok(plant)
    }

    pub(super) fn states(&self) -> Vec<State> {
        self.states.clone()
    }

    /// The states, the value of each group of free inputs, and the parameters of calculated states with their values.
    pub(super) fn point(&self) -> (Vec<f64>, Vec<f64>, Vec<(usize, Value)>) {
        let parameter = |(state, value): (&State, &f64)| match state.start {
            Start::Parameter(index) => Some((index, Value::Real(*value))),
            _ => None,
        };
        let parameters = self.states.iter().zip(&self.parameters).filter_map(parameter).collect();
        (self.x.clone(), self.inputs.clone(), parameters)
    }

    pub(super) fn nominal_of_input(&self, group: usize) -> f64 {
        let first = self.request.free[group].first();
        let nominal = first.and_then(|index| self.description.variables[*index].nominal).map(f64::abs);
        nominal.filter(|nominal| *nominal > 0.0 && nominal.is_finite()).unwrap_or(1.0)
    }

    pub(super) fn groups(&self) -> usize {
        self.request.free.len()
    }

    /// Moves to states and inputs. Because a parameter determines the value of a calculated state, this value may have
    /// rounding errors; [`Self::point`] returns the actual value.
    pub(super) fn move_to(&mut self, x: &[f64], inputs: &[f64]) -> Result<(), String> {
        self.x.copy_from_slice(x);
        self.inputs.copy_from_slice(inputs);
        self.initialize()?;
        self.reach(x, &vec![true; x.len()])
    }

    /// Finds the parameters with which the calculated states that are sought start at `x`.
    fn reach(&mut self, x: &[f64], is_sought: &[bool]) -> Result<(), String> {
        for _ in 0..ATTEMPTS {
            let off: Vec<usize> = (0..x.len())
                .filter(|i| is_sought[*i] && matches!(self.states[*i].start, Start::Parameter(_)))
                .filter(|i| (self.x[*i] - x[*i]).abs() > f64::EPSILON * x[*i].abs())
                .collect();
            if off.is_empty() {
                break;
            }
            let here = self.x.clone();
            let before = self.parameters.clone();
            let mut after = before.clone();
            for i in off {
                let [low, high] = self.bounds_of_parameter(i);
                let change = 1e-3 * before[i].abs().max(1.0);
                let change = if before[i] + change > high { -change } else { change };
                self.parameters[i] = before[i] + change;
                self.x.copy_from_slice(x);
                self.initialize()?;
                let slope = (self.x[i] - here[i]) / change;
                self.parameters[i] = before[i];
                if slope != 0.0 && slope.is_finite() {
                    // Rounding errors must not move the parameter out of its range: it must be 0 m/s, not -1e-12 m/s.
                    after[i] = (before[i] + (x[i] - here[i]) / slope).max(low).min(high);
                }
            }
            self.parameters = after;
            self.x.copy_from_slice(x);
            self.initialize()?;
        }
        for (i, state) in self.states.iter().enumerate().filter(|(i, _)| is_sought[*i]) {
            if (self.x[i] - x[i]).abs().is_nan() || (self.x[i] - x[i]).abs() > REACHED * state.nominal {
                let variable = &self.description.variables[state.variable];
                return Err(format!(
                    "`{}` cannot start at {:?}: the FMU computes its start value, {:?}{}",
                    variable.name,
                    x[i],
                    self.x[i],
                    match state.start {
                        Start::Parameter(index) => format!(", from `{}`", self.description.variables[index].name),
                        _ => String::new(),
                    }
                ));
            }
        }
        Ok(())
    }

    /// Minimum and maximum of the parameter that a state starts from.
    fn bounds_of_parameter(&self, state: usize) -> [f64; 2] {
        match self.states[state].start {
            Start::Parameter(index) => bounds(&self.description.variables[index]),
            Start::Exact | Start::Calculated => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    pub(super) fn derivatives(&mut self) -> Result<Vec<f64>, String> {
        let mut values = vec![0.0; self.derivatives.len()];
        self.call(|instance, derivatives| instance.get_real(derivatives, &mut values))?;
        Ok(values)
    }

    /// Partial derivatives of all state derivatives with respect to a state, or to a group of free inputs, whose
    /// indices follow the states.
    pub(super) fn column(&mut self, index: usize) -> Result<Vec<f64>, String> {
        let knowns: Vec<Reference> = match index.checked_sub(self.states.len()) {
            None => vec![self.references[index]],
            Some(group) => {
                self.request.free[group].iter().map(|input| self.description.variables[*input].reference).collect()
            }
        };
        let mut values = vec![0.0; self.derivatives.len()];
        self.call(|instance, derivatives| {
            instance.get_directional_derivative(derivatives, &knowns, &vec![1.0; knowns.len()], &mut values)
        })?;
        Ok(values)
    }

    /// Calls the instance with the references of the derivatives. An instance that has returned an error is not used
    /// again.
    fn call(&mut self, call: impl FnOnce(&mut Instance, &[Reference]) -> Result<(), CallError>) -> Result<(), String> {
        let instance = self.instance.as_mut().ok_or("the FMU is not there")?;
        call(instance, &self.derivatives).map_err(|error| {
            self.instance = None;
            error.to_string()
        })
    }

    /// Resets or creates the instance, and enters Initialization Mode at the current point, with the calls that a
    /// master makes before a run.
    fn initialize(&mut self) -> Result<(), String> {
        // One instance at a time: some FMUs allow only one.
        let used = self.instance.take().and_then(|mut used| used.reset().is_ok().then_some(used));
        let mut instance = used.map_or_else(|| (self.instantiate)(), Ok)?;
        self.set_all(&mut instance).map_err(|error| error.to_string())?;
        self.instance = Some(instance);
        Ok(())
    }

    fn set_all(&mut self, instance: &mut Instance) -> Result<(), CallError> {
        instance.setup_experiment(self.request.time, None)?;
        for (index, value) in &self.request.given {
            instance.set_value(self.description.variables[*index].reference, value)?;
        }
        for (i, state) in self.states.iter().enumerate() {
            match state.start {
                Start::Exact => {
                    let [low, high] = bounds(&self.description.variables[state.variable]);
                    let (x, slack) = (self.x[i], REACHED * state.nominal);
                    // Rounding errors must not move a value out of the range of its variable. Values farther outside
                    // are left to the FMU, which rejects them.
                    let x = if (low - slack..low).contains(&x) {
                        low
                    } else if x > high && x <= high + slack {
                        high
                    } else {
                        x
                    };
                    instance.set_real(&[self.references[i]], &[x])?;
                }
                Start::Parameter(index) => {
                    instance.set_real(&[self.description.variables[index].reference], &[self.parameters[i]])?;
                }
                Start::Calculated => (),
            }
        }
        for (group, value) in self.request.free.iter().zip(&self.inputs) {
            for index in group {
                instance.set_real(&[self.description.variables[*index].reference], &[*value])?;
            }
        }
        instance.enter_initialization_mode()?;
        instance.get_real(&self.references, &mut self.x)
    }

    /// Finds the parameters that calculated states start from: those with `initial` in their name on which the start
    /// value depends. If there are several for a state, uses the parameter that changes the fewest states.
    fn find_parameters(&mut self, start: &dyn Fn(usize) -> f64) -> Result<(), String> {
        if self.states.iter().all(|state| state.start == Start::Exact) {
            return Ok(());
        }
        let is_candidate = |v: &Variable| {
            v.causality == Causality::Parameter
                && v.variability != Variability::Constant
                && v.initial == Some(Initial::Exact)
                && v.base_type == BaseType::Real
                && !v.is_array()
                && v.name.split(['.', '_']).any(|word| word == INITIAL)
        };
        let variables = self.description.variables.iter().enumerate();
        let candidates: Vec<usize> = variables.filter(|(_, v)| is_candidate(v)).map(|(index, _)| index).collect();
        // Some FMUs allow one instance only.
        self.instance = None;
        let mut trial = |change: Option<(Reference, f64)>| {
            let mut instance = (self.instantiate)().ok()?;
            let mut states = vec![0.0; self.references.len()];
            let read = instance.setup_experiment(self.request.time, None).and_then(|()| {
                if let Some((reference, value)) = change {
                    instance.set_real(&[reference], &[value])?;
                }
                instance.enter_initialization_mode()?;
                instance.get_real(&self.references, &mut states)
            });
            read.ok().map(|()| states)
        };
        let Some(unchanged) = trial(None) else { return Ok(()) };
        let mut effects: Vec<(usize, Vec<usize>)> = Vec::new();
        for parameter in candidates {
            let variable = &self.description.variables[parameter];
            let value = real(variable.start.as_ref());
            let change = (variable.reference, value + 1e-3 * value.abs().max(1.0));
            let Some(changed) = trial(Some(change)) else { continue };
            let is_moved = |i: &usize| {
                self.states[*i].start == Start::Calculated && changed[*i].to_bits() != unchanged[*i].to_bits()
            };
            effects.push((parameter, (0..unchanged.len()).filter(is_moved).collect()));
        }
        effects.sort_by_key(|(parameter, moved)| (moved.len(), *parameter));
        for (parameter, moved) in effects {
            let Some(i) = moved.into_iter().find(|i| self.states[*i].start == Start::Calculated) else { continue };
            self.states[i].start = Start::Parameter(parameter);
            self.parameters[i] = start(parameter);
        }
        Ok(())
    }

    fn find_drifting(&mut self) -> Result<(), String> {
        let n = self.states.len();
        let depends = self.dependencies()?;
        loop {
            let rests: Vec<usize> = (0..n).filter(|i| !self.states[*i].drifts).collect();
            let drifting: Vec<usize> = rests
                .iter()
                .copied()
                .filter(|j| rests.iter().all(|i| !depends[*i][*j]) && rests.iter().any(|i| depends[*j][*i]))
                .collect();
            if drifting.is_empty() {
                return Ok(());
            }
            for j in drifting {
                self.states[j].drifts = true;
            }
        }
    }

    /// Dependencies of the state derivatives on the states, from the model structure. Dependencies that the model
    /// structure does not list are determined from the Jacobians at this point and at a point nearby.
    fn dependencies(&mut self) -> Result<Vec<Vec<bool>>, String> {
        let n = self.states.len();
        let listed: Vec<Option<&Vec<usize>>> =
            self.description.derivatives.iter().map(|unknown| unknown.dependencies.as_ref()).collect();
        let mut depends = vec![vec![false; n]; n];
        for (row, listed) in depends.iter_mut().zip(&listed) {
            for (j, state) in self.states.iter().enumerate() {
                row[j] = listed.is_some_and(|listed| listed.contains(&state.variable));
            }
        }
        if listed.iter().all(Option::is_some) {
            return Ok(depends);
        }
        let (x, inputs, _) = self.point();
        let nearby: Vec<f64> = x
            .iter()
            .zip(&self.states)
            .enumerate()
            .map(
                |(i, (x, state))| {
                    if state.start == Start::Exact { x + 0.01 * (1.0 + i as f64) * state.nominal } else { *x }
                },
            )
            .collect();
        for point in [nearby, x] {
            if self.move_to(&point, &inputs).is_err() {
                continue;
            }
            for j in 0..n {
                let column = self.column(j)?;
                for ((row, value), _) in
                    depends.iter_mut().zip(column).zip(&listed).filter(|(_, listed)| listed.is_none())
                {
                    row[j] |= value != 0.0;
                }
            }
        }
        Ok(depends)
    }
}
