//! Model exchange: derivatives, event indicators and states, as an importer with a solver uses them.

mod integration;

use super::experiment::EXPERIMENT;
use super::stack::{STACK, taken, warn_above_limit};
use super::structure::{STRUCTURE, Structure, is_structural};
use super::{CheckResult, Report, adjoint, derivative_problem, describe, found, instantiation, is_same_derivative};
use crate::{Checked, Event, Finding, MODEL_EXCHANGE, Options, Topic};
use fmu_import::description::{
    BaseType, Capabilities, DataType, FmiVersion, Interface, ModelDescription, Value, Variable,
};
use fmu_import::loader::{CallError, Instance, Library};
use std::cell::Cell;
use std::sync::Arc;

/// Maximum number of updates of the discrete states in one event.
const MOST_UPDATES: usize = 1000;
#[derive(Clone)]
struct Exchange<'a> {
    library: &'a Arc<Library>,
    description: &'a ModelDescription,
    unit: &'a Capabilities,
    /// Start time and step of an integration, s.
    start: f64,
    step: f64,
    /// Value references of the states and their derivatives, which may be arrays. Both lists are empty if a derivative
    /// in the description has no state of the same size; `rules` reports this.
    states: Vec<u32>,
    derivatives: Vec<u32>,
    /// Names of the elements of the states; if `states` is empty, of the derivatives.
    names: Vec<String>,
    options: &'a Options,
    /// Number of parts into which a step must be divided to keep the integration finite.
    parts: Cell<usize>,
    /// Time that the latest integration has reached, s.
    time: Cell<f64>,
    instances: Cell<usize>,
    made: Cell<usize>,
}

/// Early end of a trial: a failed call, or a finding.
enum Failure {
    Call(CallError),
    Found(Finding),
}

impl From<CallError> for Failure {
    fn from(error: CallError) -> Self {
        Self::Call(error)
    }
}

type Outcome<T> = Result<T, Failure>;
type Stage<'t> = fn(&Exchange<'t>, Report<'_>) -> Outcome<()>;

/// Tests the calls that an importer makes in model exchange. `co_simulation` is the library for co-simulation, if the
/// FMU has this interface.
pub(crate) fn check(
    library: &Arc<Library>,
    co_simulation: Option<&Arc<Library>>,
    description: &ModelDescription,
    options: &Options,
    checked: &mut Checked,
    report: Report<'_>,
) {
    let Some(unit) = &description.model_exchange else { return };
    if !instantiation(library, description, Interface::ModelExchange, options, report) {
        return;
    }
    let (start, step) = super::start_and_step(description);
    let variables = &description.variables;
    let derivatives = description.derivatives.iter().map(|unknown| &variables[unknown.variable]);
    let state_of = |derivative: &Variable| {
        derivative.derivative_of.map(|state| &variables[state]).filter(|state| state.size == derivative.size)
    };
    let states = derivatives.clone().map(state_of).collect::<Option<Vec<_>>>();
    let exchange = Exchange {
        library,
        description,
        unit,
        start,
        step,
        derivatives: derivatives.clone().map(|derivative| derivative.reference).collect(),
        names: match &states {
            Some(states) => states.iter().flat_map(|state| state.elements()).collect(),
            None => derivatives.flat_map(Variable::elements).collect(),
        },
        states: states.into_iter().flatten().map(|state| state.reference).collect(),
        options,
        parts: Cell::new(1),
        time: Cell::new(start),
        instances: Cell::new(0),
        made: Cell::new(0),
    };
    let stages: [(&str, Topic, Stage<'_>); 10] = [
        ("the event at the start", Topic::Simulation, Exchange::start_of_event),
        ("states with derivatives and event indicators", Topic::Simulation, Exchange::values),
        ("saved states", Topic::Standard, Exchange::saved_states),
        ("integration", Topic::Simulation, Exchange::integration),
        ("another start time", Topic::Simulation, Exchange::another_start),
        (EXPERIMENT, Topic::Simulation, Exchange::experiment),
        ("partial derivatives", Topic::Standard, Exchange::directional),
        (STRUCTURE, Topic::Standard, Exchange::structure),
        ("the end", Topic::Standard, Exchange::end),
        (STACK, Topic::Simulation, Exchange::stack),
    ];
    let before = (checked.instances, checked.steps);
    let mut finish = |name: String, exchange: &Exchange<'_>, report: Report<'_>| {
        checked.trials.push(name);
        checked.instances = before.0 + exchange.instances.get();
        checked.steps = before.1 + exchange.made.get();
        report(Event::Checked(checked.clone()));
    };
    for (name, topic, stage) in stages {
        // The default experiment runs once, if possible in co-simulation, which needs no solver in the importer.
        if (name == EXPERIMENT && co_simulation.is_some()) || (name == STRUCTURE && !is_structural(description)) {
            continue;
        }
        let name = format!("{MODEL_EXCHANGE}{name}");
        if options.skip.contains(&name) {
            continue;
        }
        report(Event::trying(name.clone(), topic));
        let is_settled = match stage(&exchange, report) {
            Ok(()) => true,
            Err(Failure::Call(error)) => {
                found(report, Finding::error(&name, describe(&error)).about(topic));
                true
            }
            Err(Failure::Found(finding)) => {
                found(report, finding.about(topic));
                false
            }
        };
        finish(name, &exchange, report);
        // If the FMU cannot be started, nothing else can be tested.
        if !is_settled && exchange.instances.get() == 1 {
            break;
        }
    }
    let name = format!("{MODEL_EXCHANGE}state derivatives as in co-simulation");
    if let Some(other) = co_simulation.filter(|_| !options.skip.contains(&name)) {
        report(Event::trying(name.clone(), Topic::Standard));
        // Errors are ignored: the derivatives need not be readable in co-simulation, and other trials have reported the
        // errors of other calls.
        if let Ok(Some(finding)) = exchange.agreement(other) {
            found(report, finding);
        }
        finish(name, &exchange, report);
    }
}

impl Exchange<'_> {
    fn function(&self, v2: &'static str, v3: &'static str) -> &'static str {
        match self.description.fmi {
            FmiVersion::V2 => v2,
            FmiVersion::V3 => v3,
        }
    }

    fn instance(&self, name: &str) -> CheckResult<Instance> {
        self.instances.set(self.instances.get() + 1);
        Instance::instantiate(self.library, name, &self.description.guid, false)
    }

    /// Brings an instance to the end of its first event. Returns the time of the next event.
    fn start_up(&self, instance: &mut Instance, start: f64, stop: Option<f64>) -> Outcome<Option<f64>> {
        instance.setup_experiment(start, stop)?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        Ok(self.settle(instance, start)?.next_event)
    }

    /// An instance in Continuous-Time Mode.
    fn started(&self, name: &str) -> Outcome<Instance> {
        let mut instance = self.instance(name)?;
        self.start_up(&mut instance, self.start, None)?;
        Ok(instance)
    }

    /// Updates discrete states until the event is over, and enters Continuous-Time Mode.
    fn settle(&self, instance: &mut Instance, time: f64) -> Outcome<Settled> {
        for _ in 0..MOST_UPDATES {
            let update = instance.new_discrete_states()?;
            if update.terminates {
                return Ok(Settled { next_event: None, is_over: true });
            }
            if !update.is_needed_again {
                instance.enter_continuous_time_mode()?;
                // An event that is not after the current time would never be reached.
                if let Some(next) = update.next_event.filter(|next| next.is_nan() || *next <= time) {
                    let message =
                        format!("defines the next event at {next} s, which is not after the current time, {time} s");
                    return Err(self.broken("fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates", message));
                }
                return Ok(Settled { next_event: update.next_event, is_over: false });
            }
        }
        let message = format!("needs another update after {MOST_UPDATES} updates: the event at {time} s does not end");
        Err(self.broken("fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates", message))
    }

    fn broken(&self, v2: &'static str, v3: &'static str, message: String) -> Failure {
        Failure::Found(Finding::error(self.function(v2, v3), message))
    }

    fn start_of_event(&self, _: Report<'_>) -> Outcome<()> {
        self.started("event").map(drop)
    }

    fn states(&self, instance: &mut Instance) -> CheckResult<Vec<f64>> {
        let mut states = vec![0.0; instance.number_of_states()];
        instance.get_continuous_states(&mut states)?;
        Ok(states)
    }

    fn derivatives(&self, instance: &mut Instance) -> CheckResult<Vec<f64>> {
        let mut derivatives = vec![0.0; instance.number_of_states()];
        instance.get_derivatives(&mut derivatives)?;
        Ok(derivatives)
    }

    fn indicators(&self, instance: &mut Instance) -> CheckResult<Vec<f64>> {
        let mut indicators = vec![0.0; instance.number_of_event_indicators()];
        if !indicators.is_empty() {
            instance.get_event_indicators(&mut indicators)?;
        }
        Ok(indicators)
    }

    /// Checks states, derivatives, indicators and nominal values at the start.
    fn values(&self, report: Report<'_>) -> Outcome<()> {
        let mut instance = self.started("values")?;
        if self.description.fmi == FmiVersion::V3 {
            self.numbers(&mut instance, report)?;
        }
        let states = self.states(&mut instance)?;
        let derivatives = self.derivatives(&mut instance)?;
        let indicators = self.indicators(&mut instance)?;
        if let Some(function) = instance.overrun() {
            let message = "writes to the first element of an array that has none, which crashes other importers";
            found(report, Finding::error(function, message));
        }
        let get_states = "GetContinuousStates";
        let get_derivatives = self.function("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives");
        let get_states = format!("{}{get_states}", self.function("fmi2", "fmi3"));
        let get_indicators = self.function("fmi2GetEventIndicators", "fmi3GetEventIndicators");
        let indicator_names: Vec<String> = (1..=indicators.len()).map(|i| format!("indicator {i}")).collect();
        for (function, names, values) in [
            (get_states.as_str(), &self.names, &states),
            (get_derivatives, &self.names, &derivatives),
            (get_indicators, &indicator_names, &indicators),
        ] {
            if let Some(i) = values.iter().position(|value| !value.is_finite()) {
                let message = format!("gives {} for `{}` at the start", values[i], names[i]);
                found(report, Finding::error(function, message).about(Topic::Simulation));
            }
        }

        // The functions for states and derivatives must return the values of the variables that are states and
        // derivatives.
        let mut named = vec![0.0; states.len()];
        if !self.states.is_empty() {
            instance.get_real(&self.states, &mut named)?;
            self.differs(report, &get_states, "the variable has the value", &states, &named);
        }
        if !self.derivatives.is_empty() {
            instance.get_real(&self.derivatives, &mut named)?;
        }
        self.differs(report, get_derivatives, "the variable has the value", &derivatives, &named);

        // Without changes, all values must stay the same, in this instance and in another one.
        instance.set_time(self.start)?;
        instance.set_continuous_states(&states)?;
        let again = self.derivatives(&mut instance)?;
        self.differs(report, get_derivatives, "the second call for the same states gives", &derivatives, &again);
        if !self.unit.can_be_instantiated_only_once_per_process {
            let other = self.derivatives(&mut self.started("again")?)?;
            self.differs(report, get_derivatives, "another instance gives", &derivatives, &other);
        }
        if self.indicators(&mut instance)?.iter().zip(&indicators).any(|(a, b)| a.to_bits() != b.to_bits()) {
            found(report, Finding::error(get_indicators, "gives another value for the same states in a second call"));
        }
        let moved: Vec<f64> = states.iter().map(|state| super::moved(*state, 1e-3, DataType::Float64)).collect();
        instance.set_continuous_states(&moved)?;
        let read = self.states(&mut instance)?;
        self.differs(report, &get_states, "what was set is", &read, &moved);

        let get_nominals = self.function("fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates");
        let mut nominals = vec![1.0; states.len()];
        instance.get_nominals(&mut nominals)?;
        if let Some(i) = nominals.iter().position(|nominal| !(nominal.is_finite() && *nominal > 0.0)) {
            let message = format!("gives {} for `{}`; a nominal value must be above 0", nominals[i], self.names[i]);
            found(report, Finding::error(get_nominals, message));
        }
        Ok(())
    }

    /// Checks that the numbers of states and event indicators are those in the description.
    fn numbers(&self, instance: &mut Instance, report: Report<'_>) -> CheckResult<()> {
        for (function, number, expected) in [
            ("fmi3GetNumberOfContinuousStates", instance.get_number_of_states()?, instance.number_of_states()),
            (
                "fmi3GetNumberOfEventIndicators",
                instance.get_number_of_event_indicators()?,
                instance.number_of_event_indicators(),
            ),
        ] {
            if number != expected {
                let message = format!("gives {number}, but ModelStructure has {expected}");
                found(report, Finding::error(function, message));
            }
        }
        Ok(())
    }

    /// Reports the first element that differs from its expected value. Returns true if an element differs.
    fn differs(&self, report: Report<'_>, function: &str, relation: &str, values: &[f64], expected: &[f64]) -> bool {
        let differing = values.iter().zip(expected).position(|(a, b)| a.to_bits() != b.to_bits());
        let Some(i) = differing else { return false };
        let message = format!("gives {:?} for `{}`, but {relation} {:?}", values[i], self.names[i], expected[i]);
        found(report, Finding::error(function, message));
        true
    }

    /// Checks that restoring an FMU state restores the continuous states and their derivatives, also from bytes in a
    /// new instance.
    fn saved_states(&self, report: Report<'_>) -> Outcome<()> {
        if !self.unit.can_get_and_set_fmu_state {
            return Ok(());
        }
        let set = self.function("fmi2SetFMUstate", "fmi3SetFMUState");
        let read = self.function("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState");
        let mut instance = self.started("state")?;
        let states = self.states(&mut instance)?;
        let moved: Vec<f64> = states.iter().map(|state| super::moved(*state, 1e-3, DataType::Float64)).collect();
        instance.set_continuous_states(&moved)?;
        let derivatives = self.derivatives(&mut instance)?;
        let saved = instance.save_state()?;
        instance.set_continuous_states(&states)?;
        self.derivatives(&mut instance)?;
        instance.restore_state(&saved)?;
        if self.is_other(report, set, &mut instance, &moved, &derivatives)? || !self.unit.can_serialize_fmu_state {
            return Ok(instance.free_state(saved)?);
        }
        let bytes = instance.serialize_state(&saved)?;
        instance.free_state(saved)?;
        drop(instance);
        let mut other = self.started("bytes")?;
        let saved = other.deserialize_state(&bytes)?;
        other.restore_state(&saved)?;
        self.is_other(report, read, &mut other, &moved, &derivatives)?;
        Ok(other.free_state(saved)?)
    }

    fn is_other(
        &self,
        report: Report<'_>,
        function: &str,
        instance: &mut Instance,
        states: &[f64],
        derivatives: &[f64],
    ) -> CheckResult<bool> {
        let now = self.states(instance)?;
        if self.differs(report, function, "when the state was saved it was", &now, states) {
            return Ok(true);
        }
        let now = self.derivatives(instance)?;
        Ok(self.differs(report, function, "when the state was saved its derivative was", &now, derivatives))
    }

    /// Tests directional derivatives, and in FMI 3.0 adjoint derivatives.
    fn directional(&self, report: Report<'_>) -> Outcome<()> {
        if !self.unit.provides_directional_derivative && !self.unit.provides_adjoint_derivatives {
            return Ok(());
        }
        let mut instance = self.started("derivative")?;
        if self.unit.provides_directional_derivative && !self.states.is_empty() {
            let n = instance.number_of_states();
            let mut seed = vec![0.0; n];
            for j in 0..n {
                seed.fill(0.0);
                seed[j] = 1.0;
                let mut column = vec![0.0; n];
                if let Err(error) =
                    instance.get_directional_derivative(&self.derivatives, &self.states, &seed, &mut column)
                {
                    let attribute = self.function("providesDirectionalDerivative", "providesDirectionalDerivatives");
                    found(report, derivative_problem(attribute, &error));
                    return Ok(());
                }
                if let Some(i) = column.iter().position(|value| !value.is_finite()) {
                    let function = self.function("fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative");
                    let (value, of, by) = (column[i], &self.names[i], &self.names[j]);
                    let message = format!("gives {value} for the derivative of `{of}` with respect to `{by}`");
                    found(report, Finding::error(function, message));
                    return Ok(());
                }
            }
        }
        if self.unit.provides_adjoint_derivatives {
            let has_directional = self.unit.provides_directional_derivative;
            adjoint::compare(self.description, &mut instance, has_directional, report);
        }
        Ok(())
    }

    /// Checks that an integration and a directional derivative do not need much stack.
    fn stack(&self, report: Report<'_>) -> Outcome<()> {
        // Other trials report failed calls.
        let exchange = self.clone();
        let integrate = move || drop(exchange.instance(STACK).map(|mut instance| exchange.integrate(&mut instance, 1)));
        let Some(((), size)) = taken(integrate) else { return Ok(()) };
        let mut sizes = vec![("an integration", size)];
        if self.unit.provides_directional_derivative && !self.states.is_empty() {
            let exchange = self.clone();
            let derivative = move || -> Outcome<()> {
                let mut instance = exchange.started(STACK)?;
                let n = instance.number_of_states();
                let mut column = vec![0.0; n];
                let (unknowns, knowns) = (&exchange.derivatives, &exchange.states);
                Ok(instance.get_directional_derivative(unknowns, knowns, &vec![1.0; n], &mut column)?)
            };
            let size = taken(move || drop(derivative())).map(|(_, size)| size);
            sizes.extend(size.map(|size| ("a directional derivative", size)));
        }
        warn_above_limit(report, &format!("{MODEL_EXCHANGE}{STACK}"), &sizes);
        Ok(())
    }

    fn structure(&self, report: Report<'_>) -> Outcome<()> {
        let structure = Structure {
            description: self.description,
            start: self.start,
            instance: &|name| self.instance(name),
            advance: &|instance, _| instance.new_discrete_states().map(|_| ()),
            interface: Interface::ModelExchange,
        };
        Ok(structure.check(report)?)
    }

    fn end(&self, _: Report<'_>) -> Outcome<()> {
        Ok(self.started("end")?.terminate()?)
    }

    /// Compares the derivatives at the start with those of an instance for co-simulation.
    fn agreement(&self, library: &Arc<Library>) -> Outcome<Option<Finding>> {
        let is_real = |unknown: &fmu_import::description::Unknown| {
            self.description.variables[unknown.variable].base_type == BaseType::Real
        };
        if self.states.is_empty() || !self.description.derivatives.iter().all(is_real) {
            return Ok(None);
        }
        let mut exchange = self.started("exchange")?;
        let (states, derivatives) = (self.states(&mut exchange)?, self.derivatives(&mut exchange)?);
        let mut other = Instance::instantiate(library, "co-simulation", &self.description.guid, false)?;
        self.instances.set(self.instances.get() + 1);
        other.setup_experiment(self.start, None)?;
        other.enter_initialization_mode()?;
        other.exit_initialization_mode()?;
        let (mut its_states, mut its_derivatives) = (vec![0.0; states.len()], vec![0.0; states.len()]);
        other.get_real(&self.states, &mut its_states)?;
        other.get_real(&self.derivatives, &mut its_derivatives)?;
        // An event at the start may occur in only one of the interfaces; the derivatives cannot be compared then.
        if states.iter().zip(&its_states).any(|(a, b)| a.to_bits() != b.to_bits()) {
            return Ok(None);
        }
        let is_other = |i: &usize| !is_same_derivative(derivatives[*i], its_derivatives[*i]);
        Ok((0..states.len()).find(is_other).map(|i| {
            let [exchange, other] = [derivatives[i], its_derivatives[i]].map(Value::Real);
            let message = format!(
                "gives {exchange} for the derivative of `{}` at the start, but co-simulation gives {other}",
                self.names[i]
            );
            Finding::error(self.function("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"), message)
        }))
    }
}

struct Settled {
    /// Time of the next event, s.
    next_event: Option<f64>,
    is_over: bool,
}
