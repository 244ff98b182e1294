//! What the binary does, held against what the description says.
//!
//! Numbers are compared bit by bit: two instances of the same library that get the same calls have no reason to differ.

use super::{Event, Finding};
use crate::c_api::Reference;
use crate::description::{BaseType, Causality, Initial, ModelDescription, Unknown, Value, Variable};
use crate::loader::{CallError, CallProblem, Instance, Library, Status};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Steps of a trial run.
const STEPS: usize = 40;
/// Steps without which a trial run shows nothing.
const FEWEST_STEPS: usize = 4;
/// Points at which dependencies are looked for.
const POINTS: usize = 6;

type Tell<'a> = &'a mut dyn FnMut(Event);

/// Largest range of a parameter whose values are all tried.
const MOST_CHOICES: f64 = 8.0;

/// Another value of a parameter that is a switch (0 or 1) or a whole number.
#[derive(Clone, Copy)]
struct Choice {
    parameter: usize,
    value: i32,
}

/// A trial of one binary.
struct Trial<'a> {
    library: &'a Arc<Library>,
    description: &'a ModelDescription,
    /// Communication step, s.
    step: f64,
    /// Steps of a run.
    steps: usize,
    /// Time of the start, s.
    start: f64,
    /// Real inputs.
    inputs: Vec<usize>,
    /// Real outputs.
    outputs: Vec<usize>,
}

type Answer<T> = Result<T, CallError>;
type Part<'t> = fn(&Trial<'t>, Tell<'_>) -> Answer<()>;

/// Tries everything the description promises.
pub(super) fn check(library: &Arc<Library>, description: &ModelDescription, tell: Tell<'_>) {
    let experiment = description.default_experiment;
    let start = experiment.start_time.filter(|time| time.is_finite()).unwrap_or(0.0);
    let duration = experiment.stop_time.map(|stop| stop - start).filter(|d| d.is_finite() && *d > 0.0);
    let step = experiment.step_size.filter(|step| step.is_finite() && *step > 0.0);
    let reals = |causality| {
        let is_wanted = |variable: &Variable| variable.causality == causality && variable.base_type == BaseType::Real;
        (0..description.variables.len()).filter(|&i| is_wanted(&description.variables[i])).collect()
    };
    let mut trial = Trial {
        library,
        description,
        step: step.or(duration.map(|duration| duration / 1000.0)).unwrap_or(0.01),
        steps: STEPS,
        start,
        inputs: reals(Causality::Input),
        outputs: reals(Causality::Output),
    };
    if !trial.instantiation(tell) {
        return;
    }
    tell(Event::Trying("runs".to_owned()));
    trial.steps = trial.length();
    if trial.steps >= FEWEST_STEPS {
        trial.run_all(tell);
    } else {
        let (steps, step) = (2 * FEWEST_STEPS, trial.step);
        let message = format!("ends the simulation within {steps} steps of {step} s, too early to be tried");
        found(tell, Finding::warning("fmi2DoStep", message));
    }
}

/// The reason of a refusal: the call, and what the FMU said about it.
fn words(error: &CallError) -> String {
    let said: Vec<_> = error.messages.iter().map(|message| message.text.as_str()).collect();
    let problem = error.to_string();
    // The name of the instance is ours and says nothing; what the FMU said follows in quotes.
    let problem = problem.lines().next().unwrap_or_default();
    let problem = problem.split_once(": ").map_or(problem, |(_, rest)| rest);
    if said.is_empty() { problem.to_owned() } else { format!("{problem} (\"{}\")", said.join("\", \"")) }
}

fn found(tell: Tell<'_>, finding: Finding) {
    tell(Event::Found(finding));
}

impl Trial<'_> {
    fn instance(&self, name: &str) -> Answer<Instance> {
        Instance::instantiate(self.library, name, &self.description.guid, false)
    }

    /// An instance in Initialization Mode.
    fn initializing(&self, name: &str) -> Answer<Instance> {
        self.configured(name, None)
    }

    /// The same, with another value of one parameter.
    fn configured(&self, name: &str, choice: Option<Choice>) -> Answer<Instance> {
        let mut instance = self.instance(name)?;
        if let Some(Choice { parameter, value }) = choice {
            let reference = [self.variable(parameter).reference];
            match self.variable(parameter).base_type {
                BaseType::Boolean => instance.set_boolean(&reference, &[value])?,
                _ => instance.set_integer(&reference, &[value])?,
            }
        }
        instance.setup_experiment(self.start, None)?;
        instance.enter_initialization_mode()?;
        Ok(instance)
    }

    /// Other values of the parameters that choose between equations: switches, and whole numbers with few values.
    fn choices(&self) -> Vec<Choice> {
        let values = |variable: &Variable| match (&variable.start, variable.min, variable.max) {
            (Some(Value::Boolean(start)), ..) => vec![i32::from(!start)],
            (Some(Value::Integer(start)), Some(min), Some(max)) if max - min <= MOST_CHOICES => {
                (min as i32..=max as i32).filter(|value| value != start).collect()
            }
            _ => Vec::new(),
        };
        let parameters = self.description.variables.iter().enumerate();
        parameters
            .filter(|(_, variable)| variable.causality == Causality::Parameter)
            .flat_map(|(parameter, variable)| {
                values(variable).into_iter().map(move |value| Choice { parameter, value })
            })
            .collect()
    }

    /// An instance that can be stepped.
    fn started(&self, name: &str) -> Answer<Instance> {
        let mut instance = self.initializing(name)?;
        instance.exit_initialization_mode()?;
        Ok(instance)
    }

    fn is_single(&self) -> bool {
        self.description.co_simulation.as_ref().is_some_and(|unit| unit.can_be_instantiated_only_once_per_process)
    }

    /// Whether an instance can be made, and only with the GUID of the description.
    fn instantiation(&self, tell: Tell<'_>) -> bool {
        tell(Event::Trying("instantiating".to_owned()));
        if let Err(error) = self.instance("check") {
            let message = format!("{}; the binary may belong to another description", words(&error));
            found(tell, Finding::error("fmi2Instantiate", message));
            return false;
        }
        tell(Event::Trying("instantiating with a wrong GUID".to_owned()));
        if Instance::instantiate(self.library, "check", "{not the GUID}", false).is_ok() {
            let message = "a wrong GUID is accepted, so a description of another binary goes unnoticed";
            found(tell, Finding::warning("fmi2Instantiate", message));
        }
        true
    }

    fn run_all(&self, tell: Tell<'_>) {
        let parts: [(&str, Part<'_>); 7] = [
            ("start values", Self::start_values),
            ("runs", Self::runs),
            ("saved states", Self::states),
            ("capabilities", Self::capabilities),
            ("dependencies at the start", Self::initial_dependencies),
            ("dependencies between steps", Self::step_dependencies),
            ("the end of a run", Self::end),
        ];
        for (name, part) in parts {
            tell(Event::Trying(name.to_owned()));
            if let Err(error) = part(self, tell) {
                found(tell, Finding::error(name, words(&error)));
            }
        }
    }

    /// Steps of a run such that one instance can take twice as many: fewer if the FMU ends the simulation by itself.
    ///
    /// It may, by fmi2Discard and fmi2Terminated. What else goes wrong is found by `runs`.
    fn length(&self) -> usize {
        let Ok(mut instance) = self.started("length") else { return STEPS };
        for k in 0..2 * STEPS {
            let Err(error) = self.go(&mut instance, k..k + 1, 1) else { continue };
            let is_discarded = error.problem == CallProblem::Status(Status::Discard);
            return if is_discarded && instance.wants_termination() == Ok(true) { k / 2 } else { STEPS };
        }
        STEPS
    }

    fn variable(&self, i: usize) -> &Variable {
        &self.description.variables[i]
    }

    fn references(&self, variables: &[usize]) -> Vec<Reference> {
        variables.iter().map(|&i| self.variable(i).reference).collect()
    }

    fn reals(&self, instance: &mut Instance, variables: &[usize]) -> Answer<Vec<f64>> {
        let mut values = vec![0.0; variables.len()];
        instance.get_real(&self.references(variables), &mut values)?;
        Ok(values)
    }

    fn set(&self, instance: &mut Instance, variables: &[usize], values: &[f64]) -> Answer<()> {
        instance.set_real(&self.references(variables), values)
    }

    /// What has a start value has it.
    fn start_values(&self, tell: Tell<'_>) -> Answer<()> {
        let mut instance = self.initializing("start")?;
        for variable in &self.description.variables {
            let is_exact = matches!(variable.causality, Causality::Parameter | Causality::Input)
                || variable.initial == Some(Initial::Exact);
            let Some(start) = variable.start.as_ref().filter(|_| is_exact) else { continue };
            let value = value(&mut instance, variable)?;
            if value != *start {
                let message = format!("its start value is {start}, but the binary starts with {value}");
                found(tell, Finding::error(format!("variable `{}`", variable.name), message));
            }
        }
        Ok(())
    }

    /// Inputs that change from step to step, by the size of their start values.
    fn input(&self, k: usize) -> Vec<f64> {
        let value = |(j, &i): (usize, &usize)| {
            let start = self.start_of(i);
            // A phase of their own for all inputs; no two are ever equal.
            start + 0.01 * size(start) * (0.7 * k as f64 + 1.3 * j as f64).sin()
        };
        self.inputs.iter().enumerate().map(value).collect()
    }

    fn start_of(&self, i: usize) -> f64 {
        match self.variable(i).start {
            Some(Value::Real(start)) => start,
            _ => 0.0,
        }
    }

    /// Goes over some steps and returns all real outputs after each.
    fn go(&self, instance: &mut Instance, steps: std::ops::Range<usize>, parts: usize) -> Answer<Vec<f64>> {
        let mut outputs = Vec::new();
        for k in steps {
            self.set(instance, &self.inputs, &self.input(k))?;
            let h = self.step / parts as f64;
            for part in 0..parts {
                instance.do_step(self.start + self.step * k as f64 + h * part as f64, h)?;
            }
            outputs.extend(self.reals(instance, &self.outputs)?);
        }
        Ok(outputs)
    }

    /// A run is finite and repeats itself: in another instance, beside it, and after a reset.
    fn runs(&self, tell: Tell<'_>) -> Answer<()> {
        let mut first = self.started("first")?;
        let expected = self.go(&mut first, 0..self.steps, 1)?;
        if let Some(at) = expected.iter().position(|value| !value.is_finite()) {
            let name = &self.variable(self.outputs[at % self.outputs.len()]).name;
            let message = format!("is {} after step {}", expected[at], at / self.outputs.len() + 1);
            found(tell, Finding::error(format!("variable `{name}`"), message));
        }
        if !self.is_single() {
            let mut second = self.started("second")?;
            // The first one goes on in between: instances must not share what they remember.
            let mut outputs = Vec::new();
            for k in 0..self.steps {
                outputs.extend(self.go(&mut second, k..k + 1, 1)?);
                self.go(&mut first, self.steps + k..self.steps + k + 1, 1)?;
            }
            self.compare(tell, "two instances", "give different results for the same calls", &expected, &outputs);
        }
        first.reset()?;
        first.setup_experiment(self.start, None)?;
        first.enter_initialization_mode()?;
        first.exit_initialization_mode()?;
        let again = self.go(&mut first, 0..self.steps, 1)?;
        self.compare(
            tell,
            "fmi2Reset",
            "does not bring back the start: the same run differs after it",
            &expected,
            &again,
        );
        Ok(())
    }

    fn compare(&self, tell: Tell<'_>, subject: &str, message: &str, expected: &[f64], values: &[f64]) {
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits();
        if let Some(at) = expected.iter().zip(values).position(differs) {
            let name = &self.variable(self.outputs[at % self.outputs.len()]).name;
            let message = format!("{message}; first `{name}`: {:?} and {:?}", expected[at], values[at]);
            found(tell, Finding::error(subject, message));
        }
    }

    /// A restored state goes on as it did before, also from bytes in a new instance.
    fn states(&self, tell: Tell<'_>) -> Answer<()> {
        let Some(unit) = self.description.co_simulation.as_ref().filter(|unit| unit.can_get_and_set_fmu_state) else {
            return Ok(());
        };
        let middle = self.steps / 2;
        let mut instance = self.started("state")?;
        self.go(&mut instance, 0..middle, 1)?;
        let saved = instance.save_state()?;
        let expected = self.go(&mut instance, middle..self.steps, 1)?;
        instance.restore_state(&saved)?;
        let again = self.go(&mut instance, middle..self.steps, 1)?;
        self.compare(tell, "fmi2SetFMUstate", "a restored state goes on otherwise", &expected, &again);
        if !unit.can_serialize_fmu_state {
            return instance.free_state(saved);
        }
        let bytes = instance.serialize_state(&saved)?;
        instance.free_state(saved)?;
        drop(instance);
        let mut other = self.started("bytes")?;
        let saved = other.deserialize_state(&bytes)?;
        other.restore_state(&saved)?;
        let again = self.go(&mut other, middle..self.steps, 1)?;
        let message = "a state read from its bytes goes on otherwise in another instance";
        self.compare(tell, "fmi2DeSerializeFMUstate", message, &expected, &again);
        other.free_state(saved)
    }

    /// What the description says the FMU can do.
    fn capabilities(&self, tell: Tell<'_>) -> Answer<()> {
        let unit = self.description.co_simulation.clone().unwrap_or_default();
        let mut promise = |attribute: &str, result: Answer<()>| {
            if let Err(error) = result {
                let message = format!("is promised, but {}", words(&error));
                found(tell, Finding::error(attribute, message));
            }
        };
        if unit.can_handle_variable_communication_step_size {
            let result = self.started("parts").and_then(|mut instance| {
                self.go(&mut instance, 0..2, 1)?;
                self.go(&mut instance, 2..4, 2).map(drop)
            });
            promise("canHandleVariableCommunicationStepSize", result);
        }
        if unit.can_interpolate_inputs && !self.inputs.is_empty() {
            let reference = self.references(&self.inputs[..1]);
            let result = self.started("slope").and_then(|mut i| i.set_real_input_derivatives(&reference, &[1], &[0.0]));
            promise("canInterpolateInputs", result);
        }
        if unit.max_output_derivative_order > 0 && !self.outputs.is_empty() {
            let reference = self.references(&self.outputs[..1]);
            let result = self.started("slope").and_then(|mut instance| {
                self.go(&mut instance, 0..2, 1)?;
                instance.get_real_output_derivatives(&reference, &[1], &mut [0.0])
            });
            promise("maxOutputDerivativeOrder", result);
        }
        if unit.provides_directional_derivative
            && let Some((unknown, known)) = self.real_dependency()
        {
            let (unknown, known) = (self.references(&[unknown]), self.references(&[known]));
            let mut slope = [f64::NAN];
            let result = self.started("derivative").and_then(|mut instance| {
                self.go(&mut instance, 0..2, 1)?;
                instance.get_directional_derivative(&unknown, &known, &[1.0], &mut slope)
            });
            let is_well = result.is_ok();
            promise("providesDirectionalDerivative", result);
            if is_well && !slope[0].is_finite() {
                found(tell, Finding::error("fmi2GetDirectionalDerivative", format!("gives {}", slope[0])));
            }
        }
        Ok(())
    }

    /// An output or derivative and what it says it depends on, both real.
    fn real_dependency(&self) -> Option<(usize, usize)> {
        let is_real = |i: usize| self.variable(i).base_type == BaseType::Real;
        let unknowns = self.description.outputs.iter().chain(&self.description.derivatives);
        unknowns.filter(|unknown| is_real(unknown.variable)).find_map(|unknown| {
            let known = unknown.dependencies.iter().flatten().copied().find(|&i| is_real(i) && i != unknown.variable);
            known.map(|known| (unknown.variable, known))
        })
    }

    /// Finds unknowns that change with a known although they do not name it; `followed` collects those that change.
    fn dependencies(
        &self,
        list: &str,
        unknowns: &[&Unknown],
        known: &[usize],
        instance: &mut Instance,
        followed: &mut BTreeSet<usize>,
        tell: Tell<'_>,
    ) -> Answer<()> {
        let variables: Vec<usize> = unknowns.iter().map(|unknown| unknown.variable).collect();
        for &j in known {
            let before = self.reals(instance, &variables)?;
            let kept = self.reals(instance, &[j])?[0];
            for sign in [1.0, -1.0] {
                // Refused: outside of the limits, perhaps; nothing is learned.
                if self.set(instance, &[j], &[kept + sign * 1e-3 * size(kept)]).is_err() {
                    continue;
                }
                let Ok(after) = self.reals(instance, &variables) else { break };
                for (unknown, (a, b)) in unknowns.iter().zip(before.iter().zip(&after)) {
                    if a.to_bits() == b.to_bits() || unknown.variable == j {
                        continue;
                    }
                    followed.insert(unknown.variable);
                    if unknown.dependencies.as_ref().is_some_and(|named| !named.contains(&j)) {
                        let name = &self.variable(unknown.variable).name;
                        let message = format!(
                            "changes with `{}`, which its dependencies in {list} do not name",
                            self.variable(j).name
                        );
                        found(tell, Finding::error(format!("variable `{name}`"), message));
                    }
                }
            }
            self.set(instance, &[j], &[kept])?;
        }
        Ok(())
    }

    /// InitialUnknowns: what follows inputs and real parameters in Initialization Mode.
    fn initial_dependencies(&self, tell: Tell<'_>) -> Answer<()> {
        let is_real = |i: usize| self.variable(i).base_type == BaseType::Real;
        let unknowns: Vec<&Unknown> =
            self.description.initial_unknowns.iter().filter(|unknown| is_real(unknown.variable)).collect();
        let is_known =
            |i: &usize| is_real(*i) && matches!(self.variable(*i).causality, Causality::Parameter | Causality::Input);
        let known: Vec<usize> = (0..self.description.variables.len()).filter(is_known).collect();
        let mut once = Once::default();
        for choice in self.all_choices() {
            // A value that is refused, or with which nothing can be read before the end of initialization, shows nothing.
            let Ok(mut instance) = self.configured("dependencies", choice) else { continue };
            if unknowns.iter().any(|unknown| self.reals(&mut instance, &[unknown.variable]).is_err()) {
                continue;
            }
            let tell = &mut once.filter(tell);
            self.dependencies("InitialUnknowns", &unknowns, &known, &mut instance, &mut BTreeSet::new(), tell)?;
        }
        Ok(())
    }

    /// The parameters as they start, then every choice.
    fn all_choices(&self) -> impl Iterator<Item = Option<Choice>> {
        std::iter::once(None).chain(self.choices().into_iter().map(Some))
    }

    /// Outputs: what follows inputs between two steps, if the FMU answers for inputs that were just set.
    fn step_dependencies(&self, tell: Tell<'_>) -> Answer<()> {
        let is_real = |unknown: &&Unknown| self.variable(unknown.variable).base_type == BaseType::Real;
        let unknowns: Vec<&Unknown> = self.description.outputs.iter().filter(is_real).collect();
        if unknowns.is_empty() || self.inputs.is_empty() {
            return Ok(());
        }
        let mut followed = BTreeSet::new();
        let mut once = Once::default();
        for choice in self.all_choices() {
            let started = self.configured("dependencies", choice).and_then(|mut instance| {
                instance.exit_initialization_mode()?;
                Ok(instance)
            });
            let Ok(mut instance) = started else { continue };
            for point in 0..POINTS {
                if self.go(&mut instance, point * 5..point * 5 + 5, 1).is_err() {
                    break;
                }
                let tell = &mut once.filter(tell);
                self.dependencies("Outputs", &unknowns, &self.inputs, &mut instance, &mut followed, tell)?;
            }
        }
        // An FMU that computes its outputs in fmi2DoStep only follows no input between steps.
        if followed.is_empty() {
            return Ok(());
        }
        for unknown in unknowns.iter().filter(|unknown| !followed.contains(&unknown.variable)) {
            let names_inputs = unknown.dependencies.iter().flatten().any(|i| self.inputs.contains(i));
            if names_inputs {
                let name = &self.variable(unknown.variable).name;
                let message = "names inputs among its dependencies in Outputs, but followed none of them in any trial: \
                               masters may solve an algebraic loop that is not there";
                found(tell, Finding::warning(format!("variable `{name}`"), message));
            }
        }
        Ok(())
    }

    fn end(&self, _: Tell<'_>) -> Answer<()> {
        let mut instance = self.started("end")?;
        self.go(&mut instance, 0..2, 1)?;
        instance.terminate()
    }
}

/// Passes every finding on once: several points show the same.
#[derive(Default)]
struct Once(BTreeSet<(String, String)>);

impl Once {
    fn filter<'a>(&'a mut self, tell: Tell<'a>) -> impl FnMut(Event) + 'a {
        move |event| match &event {
            Event::Found(finding) if !self.0.insert((finding.subject.clone(), finding.message.clone())) => (),
            _ => tell(event),
        }
    }
}

/// Size of a change that is neither nothing nor too much for a value.
fn size(value: f64) -> f64 {
    value.abs().max(1.0)
}

fn value(instance: &mut Instance, variable: &Variable) -> Answer<Value> {
    let reference = [variable.reference];
    Ok(match variable.base_type {
        BaseType::Real => {
            let mut value = [0.0];
            instance.get_real(&reference, &mut value)?;
            Value::Real(value[0])
        }
        BaseType::Integer => {
            let mut value = [0];
            instance.get_integer(&reference, &mut value)?;
            Value::Integer(value[0])
        }
        BaseType::Boolean => {
            let mut value = [0];
            instance.get_boolean(&reference, &mut value)?;
            Value::Boolean(value[0] != 0)
        }
        BaseType::String => Value::String(instance.get_string(&reference)?.remove(0)),
    })
}
