//! Compares the behavior of the binary with the description.
//!
//! Numbers are compared bit by bit: two instances of the same library that get the same calls have no reason to differ.

mod adjoint;
mod capabilities;
mod clocks;
mod dependencies;
mod events;
pub(super) mod exchange;
mod experiment;
mod reset;
mod stack;
mod states;
mod step_size;
mod structure;
mod types;
mod updates;
mod values;

use super::{Checked, Event, Finding, Options, SCHEDULED_EXECUTION, Severity, Topic};
use fmu_import::c_api::Reference;
use fmu_import::description::{
    BaseType, Capabilities, Causality, DataType, FmiVersion, Interface, ModelDescription, Value, Variable,
};
use fmu_import::loader::{CallError, CallProblem, Instance, Library, Status};
use std::cell::Cell;
use std::sync::Arc;
use structure::{STRUCTURE, Structure};

const STEPS: usize = 40;
/// Maximum number of internal steps in a communication step, for an FMU with a fixed internal step size.
const MOST_PARTS: f64 = 1000.0;
/// Minimum number of steps of a useful trial run.
const FEWEST_STEPS: usize = 4;

/// Largest difference that counts as a rounding error, relative to the peak of an output.
const ROUNDING: f64 = 1e-12;
/// Largest difference that counts as an error of the solver, relative to the peak of an output, if the default
/// experiment has no tolerance. Many tools have this default tolerance.
const TOLERANCE: f64 = 1e-4;
/// Differences are divided by the peak of the output, or by this number if the peak is smaller.
const SMALL: f64 = 1e-9;

type Report<'a> = &'a mut dyn FnMut(Event);

#[derive(Clone)]
struct Trial<'a> {
    library: &'a Arc<Library>,
    description: &'a ModelDescription,
    /// Co-simulation or scheduled execution, and its capabilities.
    interface: Interface,
    unit: &'a Capabilities,
    options: &'a Options,
    /// Communication step, s.
    step: f64,
    steps: usize,
    /// Start time, s.
    start: f64,
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    /// Outputs that are compared between runs: real, integer and Boolean outputs, and arrays of these types.
    observed: Vec<usize>,
    /// Names of the elements of `observed`.
    elements: Vec<String>,
    instances: Cell<usize>,
    /// Number of steps of all instances.
    made: Cell<usize>,
}

type CheckResult<T> = Result<T, CallError>;
type Stage<'t> = fn(&Trial<'t>, Report<'_>) -> CheckResult<()>;

/// Tests everything that the description promises for co-simulation or scheduled execution. `checked` counts trials,
/// instances and steps.
pub(super) fn check(
    library: &Arc<Library>,
    description: &ModelDescription,
    interface: Interface,
    options: &Options,
    checked: &mut Checked,
    report: Report<'_>,
) {
    let Some(unit) = description.interface(interface) else { return };
    let (start, step) = start_and_step(description);
    let filtered = |is_wanted: &dyn Fn(&Variable) -> bool| -> Vec<usize> {
        (0..description.variables.len()).filter(|&i| is_wanted(&description.variables[i])).collect()
    };
    let reals = |causality| {
        filtered(&|variable| {
            is_plain(variable) && variable.causality == causality && variable.base_type == BaseType::Real
        })
    };
    let is_observed = |variable: &Variable| {
        variable.causality == Causality::Output
            && variable.base_type.is_number()
            && variable.alias_of.is_none()
            && !values::is_wide(variable)
    };
    let observed = filtered(&is_observed);
    let elements = observed.iter().flat_map(|&i| description.variables[i].elements()).collect();
    let mut trial = Trial {
        library,
        description,
        interface,
        unit,
        options,
        step,
        steps: STEPS,
        start,
        inputs: reals(Causality::Input),
        outputs: reals(Causality::Output),
        observed,
        elements,
        instances: Cell::new(0),
        made: Cell::new(0),
    };
    trial.all(checked, report);
}

/// Start time and communication step of the trials, s. They are taken from the default experiment if it declares them.
fn start_and_step(description: &ModelDescription) -> (f64, f64) {
    let experiment = description.default_experiment;
    let start = experiment.start_time.filter(|time| time.is_finite()).unwrap_or(0.0);
    let duration = experiment.stop_time.map(|stop| stop - start).filter(|d| d.is_finite() && *d > 0.0);
    let step = experiment.step_size.filter(|step| step.is_finite() && *step > 0.0);
    let step = step.or(duration.map(|duration| duration / 1000.0)).unwrap_or(0.01);
    // A step with many internal steps is slow and reveals no more than a step with a few.
    let parts = description.co_simulation.as_ref().and_then(|unit| unit.fixed_internal_step_size);
    let longest = parts.map(|part| MOST_PARTS * part).filter(|longest| *longest > 0.0);
    (start, longest.map_or(step, |longest| step.min(longest)))
}

/// Stop time of the default experiment, s; `None` if it is missing or not after the start.
fn stop_time(description: &ModelDescription, start: f64) -> Option<f64> {
    description.default_experiment.stop_time.filter(|stop| stop.is_finite() && *stop > start)
}

/// Start time of a step in the middle of the default experiment, s. Without a stop time, the experiment is assumed to
/// have 1000 steps.
fn middle(description: &ModelDescription, start: f64, step: f64) -> f64 {
    let stop = stop_time(description, start).unwrap_or(start + 1000.0 * step);
    start + step * (0.5 * (stop - start) / step).round().max(1.0)
}

/// Maximum number of messages that are reported for a failed call; these are the latest ones.
const MOST_SAID: usize = 5;

/// Describes the error of a call: the function, and the messages that the FMU logged.
fn describe(error: &CallError) -> String {
    let earlier = error.messages.len().saturating_sub(MOST_SAID);
    let said: Vec<_> = error.messages[earlier..].iter().map(|message| message.text.as_str()).collect();
    let problem = error.to_string();
    // Removes the name of the instance, which the check has chosen. The messages of the FMU follow in quotes.
    let problem = problem.lines().next().unwrap_or_default();
    let problem = problem.split_once(": ").map_or(problem, |(_, rest)| rest);
    let earlier = if earlier > 0 { format!("{earlier} earlier messages, ") } else { String::new() };
    if said.is_empty() { problem.to_owned() } else { format!("{problem} ({earlier}\"{}\")", said.join("\", \"")) }
}

/// Returns the finding about a missing derivative. A discarded call means that the derivative is not finite at this
/// point.
fn derivative_problem(attribute: &str, error: &CallError) -> Finding {
    let problem = describe(error);
    if error.is_discarded() {
        Finding::note(attribute, format!("derivatives that the check requests are not finite: {problem}"))
    } else {
        Finding::error(attribute, format!("is promised, but {problem}"))
    }
}

fn found(report: Report<'_>, finding: Finding) {
    report(Event::Found(finding));
}

impl Trial<'_> {
    fn all(&mut self, checked: &mut Checked, report: Report<'_>) {
        if !instantiation(self.library, self.description, self.interface, self.options, report) {
            return;
        }
        report(Event::trying(self.name("runs"), Topic::Simulation));
        if self.is_asynchronous() {
            let message = "is set, and fmi2DoStep returns fmi2Pending: the check does not support asynchronous steps";
            return found(report, Finding::warning("canRunAsynchronuously", message).about(Topic::Simulation));
        }
        self.steps = self.length();
        if self.steps < FEWEST_STEPS {
            let (steps, step) = (2 * FEWEST_STEPS, self.step);
            let message = format!("ends the simulation within {steps} steps of {step} s, too early to be tried");
            let function = self.function("fmi2DoStep", "fmi3DoStep");
            return found(report, Finding::warning(function, message).about(Topic::Simulation));
        }
        self.run_all(checked, report);
    }

    fn instance(&self, name: &str) -> CheckResult<Instance> {
        self.instances.set(self.instances.get() + 1);
        Instance::instantiate(self.library, name, &self.description.guid, false)
    }

    fn initializing(&self, name: &str) -> CheckResult<Instance> {
        let mut instance = self.instance(name)?;
        instance.setup_experiment(self.start, None)?;
        instance.enter_initialization_mode()?;
        Ok(instance)
    }

    /// An instance that can be stepped.
    fn started(&self, name: &str) -> CheckResult<Instance> {
        let mut instance = self.initializing(name)?;
        instance.exit_initialization_mode()?;
        Ok(instance)
    }

    /// The name of a function in the version of the FMU.
    fn function(&self, v2: &'static str, v3: &'static str) -> &'static str {
        match self.description.fmi {
            FmiVersion::V2 => v2,
            FmiVersion::V3 => v3,
        }
    }

    fn is_single(&self) -> bool {
        self.unit.can_be_instantiated_only_once_per_process
    }

    fn is_scheduled(&self) -> bool {
        self.interface == Interface::ScheduledExecution
    }

    /// The name of a trial.
    fn name(&self, trial: &str) -> String {
        if self.is_scheduled() { format!("{SCHEDULED_EXECUTION}{trial}") } else { trial.to_owned() }
    }

    /// Returns true if the call of a step returns before the step is complete, and the description allows this.
    fn is_asynchronous(&self) -> bool {
        let is_allowed = self.unit.can_run_asynchronously;
        let is_pending = |error: CallError| error.problem == CallProblem::Status(Status::Pending);
        is_allowed
            && self.started("step").is_ok_and(|mut instance| self.go(&mut instance, 0..1, 1).is_err_and(is_pending))
    }

    fn run_all(&self, checked: &mut Checked, report: Report<'_>) {
        use Topic::{Simulation, Standard};
        let stages: [(&str, Topic, Stage<'_>); 21] = [
            ("start values", Standard, Self::start_values),
            ("runs", Simulation, Self::runs),
            ("another start time", Simulation, Self::another_start),
            ("the default experiment", Simulation, Self::experiment),
            ("reset before initialization", Standard, Self::reset_before_initialization),
            ("reset after a run", Standard, Self::reset_after_run),
            ("two instances", Standard, Self::instances),
            ("saved states", Standard, Self::states),
            ("capabilities", Standard, Self::capabilities),
            ("adjoint derivatives", Standard, Self::adjoint),
            ("dependencies at the start", Standard, Self::initial_dependencies),
            ("dependencies between steps", Standard, Self::step_dependencies),
            ("dependencies of elements", Standard, Self::element_dependencies),
            ("step size of the solver", Simulation, Self::step_size),
            ("types of FMI 3.0", Standard, Self::types),
            (STRUCTURE, Standard, Self::structure),
            (clocks::CLOCKS, Standard, Self::clocks),
            (events::EVENTS, Standard, Self::events),
            ("intermediate updates", Standard, Self::updates),
            ("the end of a run", Standard, Self::end),
            (stack::STACK, Simulation, Self::stack),
        ];
        let earlier = (checked.instances, checked.steps);
        for (name, topic, stage) in stages {
            let name = self.name(name);
            if self.options.skip.contains(&name) {
                continue;
            }
            report(Event::trying(name.clone(), topic));
            let before = self.instances.get();
            if let Err(error) = stage(self, report) {
                found(report, Finding::error(&name, describe(&error)).about(topic));
            }
            // A trial that made no instance has tested nothing.
            if self.instances.get() > before {
                checked.trials.push(name);
            }
            (checked.instances, checked.steps) = (earlier.0 + self.instances.get(), earlier.1 + self.made.get());
            report(Event::Checked(checked.clone()));
        }
    }

    /// Number of steps in a run. An instance can make twice as many steps. The number is smaller if the FMU ends the
    /// simulation.
    ///
    /// An FMU may end the simulation with fmi2Discard and fmi2Terminated, or with a result of fmi3DoStep. The trial
    /// `runs` reports other failures.
    fn length(&self) -> usize {
        let Ok(mut instance) = self.started("length") else { return STEPS };
        for k in 0..2 * STEPS {
            let Err(error) = self.go(&mut instance, k..k + 1, 1) else { continue };
            return if experiment::ends_simulation(&mut instance, &error) { k / 2 } else { STEPS };
        }
        STEPS
    }

    fn variable(&self, i: usize) -> &Variable {
        &self.description.variables[i]
    }

    fn references(&self, variables: &[usize]) -> Vec<Reference> {
        variables.iter().map(|&i| self.variable(i).reference).collect()
    }

    fn reals(&self, instance: &mut Instance, variables: &[usize]) -> CheckResult<Vec<f64>> {
        let mut values = vec![0.0; variables.len()];
        if !variables.is_empty() {
            instance.get_real(&self.references(variables), &mut values)?;
        }
        Ok(values)
    }

    fn set(&self, instance: &mut Instance, variables: &[usize], values: &[f64]) -> CheckResult<()> {
        if variables.is_empty() {
            return Ok(());
        }
        instance.set_real(&self.references(variables), values)
    }

    fn start_values(&self, report: Report<'_>) -> CheckResult<()> {
        let mut instance = self.initializing("start")?;
        for i in self.exact() {
            let variable = self.variable(i);
            let value = values::read(&mut instance, variable)?;
            if let Some(start) = variable.start.as_ref().filter(|start| **start != value) {
                let message = format!("its start value is {start}, but the binary starts with {value}");
                found(report, Finding::error(format!("variable `{}`", variable.name), message));
            }
        }
        for variable in self.description.variables.iter().filter(|variable| values::has_starts(variable)) {
            let now = instance.get_values(variable)?;
            let mut elements = variable.elements().into_iter().zip(variable.starts.iter().zip(&now));
            if let Some((name, (start, value))) = elements.find(|(_, (start, value))| start != value) {
                let message = format!("its start value is {start}, but the binary starts with {value}");
                found(report, Finding::error(format!("variable `{name}`"), message));
            }
        }
        Ok(())
    }

    /// Inputs that change from step to step, in proportion to their start values.
    fn input(&self, k: usize) -> Vec<f64> {
        let value = |(j, &i): (usize, &usize)| {
            let start = self.start_of(i);
            // Each input has its own phase, so no two are ever equal.
            moved(start, 0.01 * (0.7 * k as f64 + 1.3 * j as f64).sin(), self.variable(i).data_type)
        };
        self.inputs.iter().enumerate().map(value).collect()
    }

    fn start_of(&self, i: usize) -> f64 {
        match self.variable(i).start {
            Some(Value::Real(start)) => start,
            _ => 0.0,
        }
    }

    /// Runs some steps and returns all observed outputs after each step, as numbers.
    fn go(&self, instance: &mut Instance, steps: std::ops::Range<usize>, parts: usize) -> CheckResult<Vec<f64>> {
        let mut outputs = Vec::new();
        for k in steps {
            self.set(instance, &self.inputs, &self.input(k))?;
            let h = self.step / parts as f64;
            for part in 0..parts {
                self.made.set(self.made.get() + 1);
                instance.do_step(self.start + self.step * k as f64 + h * part as f64, h)?;
            }
            self.read_outputs(instance, &mut outputs)?;
        }
        Ok(outputs)
    }

    fn read_outputs(&self, instance: &mut Instance, outputs: &mut Vec<f64>) -> CheckResult<()> {
        for &i in &self.observed {
            for value in instance.get_values(self.variable(i))? {
                outputs.push(match value {
                    Value::Real(value) => value,
                    Value::Integer(value) => value as f64,
                    Value::Unsigned(value) => value as f64,
                    Value::Boolean(value) => f64::from(u8::from(value)),
                    Value::String(_) | Value::Binary { .. } => continue,
                });
            }
        }
        Ok(())
    }

    /// Checks that the results of a run are finite, and that another instance has the same results.
    fn runs(&self, report: Report<'_>) -> CheckResult<()> {
        let mut first = self.started("first")?;
        let expected = self.go(&mut first, 0..self.steps, 1)?;
        drop(first);
        if let Some(at) = expected.iter().position(|value| !value.is_finite()) {
            let name = &self.elements[at % self.elements.len()];
            let message = format!("is {} after step {}", expected[at], at / self.elements.len() + 1);
            found(report, Finding::error(format!("variable `{name}`"), message).about(Topic::Simulation));
        }
        let outputs = self.go(&mut self.started("again")?, 0..self.steps, 1)?;
        let finding = self.comparison("runs", "give different results for the same calls", &expected, &outputs);
        if let Some(finding) = finding {
            found(report, finding.about(Topic::Simulation));
        }
        Ok(())
    }

    /// Returns true if two runs are equal; reports a difference.
    fn compare(&self, report: Report<'_>, subject: &str, message: &str, expected: &[f64], values: &[f64]) -> bool {
        let finding = self.comparison(subject, message, expected, values);
        let is_equal = finding.is_none();
        if let Some(finding) = finding {
            found(report, finding);
        }
        is_equal
    }

    /// Returns the finding if two runs differ: a note for rounding errors, a warning within the tolerance of a solver,
    /// otherwise an error.
    fn comparison(&self, subject: &str, message: &str, expected: &[f64], values: &[f64]) -> Option<Finding> {
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits();
        let at = expected.iter().zip(values).position(differs)?;
        let columns = self.elements.len();
        let name = &self.elements[at % columns];
        let message = format!("{message}; first `{name}`: {:?} and {:?}", expected[at], values[at]);
        let tolerance = self.description.default_experiment.tolerance.filter(|tolerance| *tolerance > 0.0);
        let tolerance = tolerance.unwrap_or(TOLERANCE);
        let differences = (0..columns).map(|column| {
            let peak = expected.iter().skip(column).step_by(columns).fold(SMALL, |peak, value| value.abs().max(peak));
            let pairs = expected.iter().zip(values).skip(column).step_by(columns).filter(|pair| differs(*pair));
            pairs.map(|(a, b)| (a - b).abs() / peak).fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
        });
        let largest = differences.fold(0.0, |most: f64, d| if d > most || d.is_nan() { d } else { most });
        let (severity, explanation) = if largest <= ROUNDING {
            (Severity::Note, format!("; at most {largest:.1e} of the peak, as by rounding"))
        } else if largest <= tolerance {
            (Severity::Warning, format!("; at most {largest:.1e} of the peak, within the tolerance {tolerance:.0e}"))
        } else {
            (Severity::Error, String::new())
        };
        Some(Finding { severity, ..Finding::error(subject, message + &explanation) })
    }

    fn structure(&self, report: Report<'_>) -> CheckResult<()> {
        let structure = Structure {
            description: self.description,
            start: self.start,
            instance: &|name| self.instance(name),
            advance: &|instance, k| instance.do_step(self.start + self.step * k as f64, self.step),
            interface: self.interface,
        };
        structure.check(report)
    }

    fn end(&self, _: Report<'_>) -> CheckResult<()> {
        let mut instance = self.started("end")?;
        self.go(&mut instance, 0..2, 1)?;
        instance.terminate()
    }
}

/// Checks that instantiation succeeds with the GUID in the description and fails with another GUID.
fn instantiation(
    library: &Arc<Library>,
    description: &ModelDescription,
    interface: Interface,
    options: &Options,
    report: Report<'_>,
) -> bool {
    let (function, token) = match (description.fmi, interface) {
        (FmiVersion::V2, _) => ("fmi2Instantiate", "GUID"),
        (FmiVersion::V3, Interface::CoSimulation) => ("fmi3InstantiateCoSimulation", "instantiation token"),
        (FmiVersion::V3, Interface::ModelExchange) => ("fmi3InstantiateModelExchange", "instantiation token"),
        (FmiVersion::V3, Interface::ScheduledExecution) => ("fmi3InstantiateScheduledExecution", "instantiation token"),
    };
    report(Event::trying(format!("instantiating for {interface}"), Topic::Simulation));
    if let Err(error) = Instance::instantiate(library, "check", &description.guid, false) {
        let message = format!("{}; the binary may belong to another description", describe(&error));
        found(report, Finding::error(function, message).about(Topic::Simulation));
        return false;
    }
    let trial = format!("instantiating for {interface} with a wrong {token}");
    if options.skip.contains(&trial) {
        return true;
    }
    report(Event::trying(trial, Topic::Standard));
    if Instance::instantiate(library, "check", "{not the GUID}", false).is_ok() {
        let message = format!("a wrong {token} is accepted, so a description of another binary goes unnoticed");
        found(report, Finding::warning(function, message));
    }
    true
}

/// True for a scalar that is not an alias. The trials vary such variables one by one.
fn is_plain(variable: &Variable) -> bool {
    !variable.is_array() && variable.alias_of.is_none()
}

/// True for two derivatives that differ by rounding errors only.
fn is_same_derivative(a: f64, b: f64) -> bool {
    const TOLERABLE: f64 = 1e-9;
    a.to_bits() == b.to_bits() || (a - b).abs() <= TOLERABLE * a.abs().max(b.abs())
}

/// The value, changed by a part of its magnitude, which is at least 1. Near the greatest number of the type, the change
/// goes in the other direction, because infinities are invalid.
fn moved(value: f64, part: f64, data_type: DataType) -> f64 {
    let greatest = if data_type == DataType::Float32 { f64::from(f32::MAX) } else { f64::MAX };
    let change = part * value.abs().max(1.0);
    if (value + change).abs() <= greatest { value + change } else { value - change }
}

#[cfg(test)]
mod tests {
    use super::{DataType, moved};

    #[test]
    fn a_changed_value_is_finite_and_another_one() {
        for (greatest, data_type) in [(f64::MAX, DataType::Float64), (f64::from(f32::MAX), DataType::Float32)] {
            for value in [greatest, -greatest, 1e30, 0.0, -2.5] {
                for part in [1e-3, -1e-3, 1.0, -1.0] {
                    let other = moved(value, part, data_type);
                    assert!(other.abs() <= greatest && other != value, "{value:e} by {part}: {other:e}");
                }
            }
        }
        assert_eq!([moved(3.0, 0.5, DataType::Float64), moved(0.5, -0.5, DataType::Float32)], [4.5, 0.0]);
    }
}
